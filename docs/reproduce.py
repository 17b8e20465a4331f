#!/usr/bin/env python3
"""From the published WHU-Smartphone dataset to the accuracy table of the README.

    python3 docs/reproduce.py DATA

DATA is the dataset's folder, with the orbits and the navigation messages in DATA/products. docs/reproduce.md says what to
fetch from where. The script downloads nothing. It checks which files are there, names those that are missing, replays every
session that is complete with `cofix-hub`, once for each navigation file, and prints the table. It needs Python 3.8 and nothing
else; the hub is built by cargo unless --hub names one.
"""

import argparse
import json
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
REPOSITORY = HERE.parent
SESSIONS = sorted((HERE / "reproduce").glob("*.toml"))
METHODS = ["wls", "local", "joint"]

DATASET = "https://github.com/CJQP/WHU-Smartphone-Dataset"
# Orbits with clocks of 2020-08-13, in the order of preference, and where they are published.
ORBITS = [
    ("Sta21184.sp3", "ftp://ftp.glonass-iac.ru/MCC/PRODUCTS/20226/final/ (used for the README)"),
    ("WUM0MGXFIN_20202260000_01D_15M_ORB.SP3", "https://cddis.nasa.gov/archive/gnss/products/mgex/2118/"),
    ("COD0MGXFIN_20202260000_01D_05M_ORB.SP3", "https://cddis.nasa.gov/archive/gnss/products/mgex/2118/"),
    ("GFZ0MGXRAP_20202260000_01D_05M_ORB.SP3", "https://cddis.nasa.gov/archive/gnss/products/mgex/2118/"),
]
# Navigation messages: group delays and Klobuchar terms.
NAVIGATION = [
    ("BRDC00IGS_R_20202260000_01D_MN.rnx", "https://cddis.nasa.gov/archive/gnss/data/daily/2020/brdc/ (of the day)"),
    ("BRDM00DLR_S_20202260000_01D_MN.rnx", "https://cddis.nasa.gov/archive/gnss/data/daily/2020/brdc/ (of the day)"),
    (
        "ESBC00DNK_R_20201770000_01D_MN.rnx",
        "https://cddis.nasa.gov/archive/gnss/data/daily/2020/177/20p/ (of 2020-06-25, used for the README)",
    ),
]
# Horizontal error, m, 50th / 95th percentile, mean over the phones, with Sta21184.sp3 and ESBC00DNK_R_20201770000_01D_MN.rnx.
README = {
    "WH-3-08": ["1.78 / 5.24", "1.05 / 2.81", "0.53 / 1.49"],
    "WH-3-09": ["1.89 / 5.16", "1.27 / 2.74", "0.63 / 1.49"],
    "WH-4-06": ["1.84 / 4.67", "1.09 / 2.20", "0.76 / 1.64"],
}


def main():
    arguments = parse_arguments()
    data = arguments.data.resolve()
    if not data.is_dir():
        sys.exit(f"{data} is no folder")
    orbits = products(data, ORBITS, arguments.sp3)
    navigation = products(data, NAVIGATION, arguments.navigation)
    if not orbits or not navigation:
        sys.exit(missing_products(data, orbits, navigation))
    print(f"orbits: {orbits[0]}")
    rows = []
    for session in SESSIONS:
        missing = [path for path in recordings(session) if not (data / path).is_file()]
        if missing:
            print(f"{session.stem} is left out, it lacks:")
            print("".join(f"    {path}\n" for path in missing), end="")
            continue
        for file in navigation:
            rows.append((session.stem, file, replay(arguments.hub, session, data, orbits[0], file)))
    if not rows:
        sys.exit(f"no session is complete; the recordings and truths are at {DATASET}")
    print_table(rows)


def parse_arguments():
    summary, _, rest = __doc__.partition("\n")
    parser = argparse.ArgumentParser(
        description=summary, epilog=rest, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("data", type=pathlib.Path, metavar="DATA", help="folder of the dataset")
    parser.add_argument("--sp3", metavar="NAME", help="another orbit file in DATA/products")
    parser.add_argument("--navigation", metavar="NAME", help="another navigation file in DATA/products")
    hub = f"cargo run --release --quiet --manifest-path {shlex.quote(str(REPOSITORY / 'Cargo.toml'))} --bin cofix-hub --"
    parser.add_argument("--hub", default=hub, metavar="COMMAND", help="the hub's command [default: built by cargo]")
    return parser.parse_args()


def products(data, known, chosen):
    """Paths, relative to the data, of the products that are there: the chosen one, or all known ones, packed or not."""
    names = [chosen] if chosen else [name + end for name, _ in known for end in ("", ".gz", ".Z")]
    found = {path.name.lower(): path for path in sorted((data / "products").glob("*"))}
    paths = [found[name.lower()] for name in names if name.lower() in found]
    return [path.relative_to(data).as_posix() for path in paths]


def missing_products(data, orbits, navigation):
    lines = []
    for what, found, known in (("orbits", orbits, ORBITS), ("navigation messages", navigation, NAVIGATION)):
        if not found:
            lines.append(f"{data / 'products'} has no {what}; put one of these there, packed or not:")
            lines += [f"    {name}  from {source}" for name, source in known]
    return "\n".join(lines)


def recordings(session):
    """The files of a session's phones, relative to the data, each once."""
    paths = re.findall(r'^(?:observations|truth) = "([^"]+)"', session.read_text(encoding="utf-8"), re.MULTILINE)
    return list(dict.fromkeys(paths))


def replay(hub, session, data, orbits, navigation):
    """The report of a session, replayed with these products."""
    text = session.read_text(encoding="utf-8")
    text = re.sub(r"^sp3 = .*$", lambda _: f"sp3 = [{json.dumps(orbits)}]", text, flags=re.MULTILINE)
    text = re.sub(r"^navigation = .*$", lambda _: f"navigation = [{json.dumps(navigation)}]", text, flags=re.MULTILINE)
    with tempfile.TemporaryDirectory() as folder:
        copy = pathlib.Path(folder) / session.name
        copy.write_text(text, encoding="utf-8")
        report = pathlib.Path(folder) / "report.json"
        command = [*shlex.split(hub), "replay", str(copy), "--data", str(data), "--report", str(report)]
        print(f"\n{session.stem} with {navigation}:\n", flush=True)
        if subprocess.run(command, check=False).returncode != 0:
            sys.exit(f"{session.stem}: the replay failed")
        return json.loads(report.read_text(encoding="utf-8"))


def mean(phones):
    """Mean over the phones of the 50th and 95th percentile of the horizontal error."""
    scored = [accuracy for accuracy in phones.values() if accuracy]
    p50, p95 = (sum(phone[key] for phone in scored) / len(scored) for key in ("horizontal_p50_m", "horizontal_p95_m"))
    return f"{p50:.2f} / {p95:.2f}"


def print_table(rows):
    print("\nHorizontal error in metres, 50th / 95th percentile, mean over the four phones:\n")
    line = "{:<9} {:<44} {:<12} {:<12} {:<12}"
    print(line.format("session", "navigation", *METHODS))
    for session, navigation, report in rows:
        cells = [mean(report["methods"][method]) for method in METHODS]
        print(line.format(session, pathlib.PurePosixPath(navigation).name, *cells))
    for session in dict.fromkeys(session for session, _, _ in rows):
        print(line.format(session, "README", *README[session]))


if __name__ == "__main__":
    main()
