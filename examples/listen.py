#!/usr/bin/env python3
"""Prints the fused states of a group, as a hub publishes them with `cofix-hub run SESSION --json`.

    pip install eclipse-zenoh
    python3 examples/listen.py my-drive --connect tcp/HUB:7447

docs/wire.md has the keys of Zenoh, docs/states.md those of the JSON objects.
"""

import argparse
import datetime
import json
import sys

GPS_EPOCH = datetime.datetime(1980, 1, 6)


def line(state):
    """One state as text; the time is GPS time, which is ahead of UTC by 18 s since 2017."""
    since = datetime.timedelta(weeks=state["time_gps"]["week"], seconds=state["time_gps"]["tow_s"])
    at = (GPS_EPOCH + since).isoformat(timespec="milliseconds")
    east, north, up = state["position_sigma_enu_m"]
    return (
        f"{at} {state['phone']:>12} {state['latitude_deg']:13.8f} {state['longitude_deg']:13.8f} "
        f"{state['height_m']:9.2f} m  sigma {east:.2f} {north:.2f} {up:.2f} m  {state['verdict'] or 'predicted'}"
    )


def main():
    parser = argparse.ArgumentParser(description="Prints the fused states of a group.")
    parser.add_argument("group")
    parser.add_argument("--phone", default="*", help="one phone [default: all]")
    parser.add_argument("--connect", default="tcp/127.0.0.1:7447", help="Zenoh endpoint of the hub")
    parser.add_argument("--count", type=int, default=0, help="end after so many states [default: never]")
    arguments = parser.parse_args()

    import zenoh

    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([arguments.connect]))
    config.insert_json5("scouting/multicast/enabled", "false")
    printed = 0
    with zenoh.open(config) as session:
        key = f"cofix/{arguments.group}/fused/{arguments.phone}/json"
        with session.declare_subscriber(key) as states:
            print(f"listening on {key}", file=sys.stderr, flush=True)
            for sample in states:
                print(line(json.loads(sample.payload.to_string())), flush=True)
                printed += 1
                if arguments.count and printed >= arguments.count:
                    return


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        pass
