//! Recognises a file that was named in the wrong place by its beginning, and says where it goes.

use super::gsdc;
use super::stream::table::recognise_text;
use super::text::content;

/// Name of observation files in errors.
pub const OBSERVATIONS: &str = "observation";

/// Files that are no observations. The kinds with a name are those that options take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Observations,
    Navigation,
    Sp3,
    Clock,
    Bias,
    Ionex,
    Truth,
    Session,
    /// Of no use here; why.
    Other(&'static str),
}

impl Kind {
    /// Name of the kind in errors.
    const fn name(self) -> &'static str {
        match self {
            Self::Observations => OBSERVATIONS,
            Self::Navigation => "RINEX navigation",
            Self::Sp3 => "SP3",
            Self::Clock => "RINEX clock",
            Self::Bias => "Bias-SINEX",
            Self::Ionex => "IONEX",
            Self::Truth => "truth",
            Self::Session => "session",
            Self::Other(_) => "",
        }
    }

    /// The kind of the file and where it goes: on the command line and in a session file.
    const fn hint(self) -> &'static str {
        match self {
            Self::Observations => {
                "this looks like observations; they go to --observations (in a session file, observations of [[phone]])"
            }
            Self::Navigation => {
                "this looks like RINEX navigation messages; they go to --navigation (in a session file, navigation of [products])"
            }
            Self::Sp3 => {
                "this looks like SP3 orbits; they go to --sp3 (in a session file, sp3 of [products])"
            }
            Self::Clock => {
                "this looks like RINEX clocks; they go to --clock beside --sp3 (in a session file, clock of [products])"
            }
            Self::Bias => {
                "this looks like Bias-SINEX code biases; they go to --bias beside --sp3 (in a session file, bias of [products])"
            }
            Self::Ionex => {
                "this looks like IONEX ionosphere maps; they go to --ionex (in a session file, ionex of [products])"
            }
            Self::Truth => "this looks like a truth table; in a session file it goes to truth of [[phone]]",
            Self::Session => "this looks like a session file; it goes to cofix-hub replay or cofix-hub run",
            Self::Other(said) => said,
        }
    }
}

/// Beginnings that tell a file.
const BEGINNINGS: [(&[u8], Kind); 17] = [
    (
        b"$G",
        Kind::Other(
            "this looks like NMEA text, which has positions and no observations; in a session file it may be the truth of a [[phone]]",
        ),
    ),
    (b"$@", Kind::Other("this looks like Septentrio SBF; convert it to RINEX")),
    (b"\xb5\x62", Kind::Other("this looks like u-blox UBX; convert it to RINEX")),
    (b"#a", Kind::Sp3),
    (b"#b", Kind::Sp3),
    (b"#c", Kind::Sp3),
    (b"#d", Kind::Sp3),
    (b"%=BIA", Kind::Bias),
    (b"%=SNX", Kind::Other("this looks like SINEX, of which only Bias-SINEX (%=BIA) is used")),
    (b"gps_week,gps_tow_s", Kind::Truth),
    (b"[[phone]]", Kind::Session),
    (b"group =", Kind::Session),
    (b"RRF", Kind::Other("this looks like a Rerun recording; cofix-viewer shows it")),
    (b"-----BEGIN", Kind::Other("this looks like a certificate; those of casters go to --caster-ca")),
    (b"<!DOCTYPE", WEB_PAGE),
    (b"<!doctype", WEB_PAGE),
    (b"<html", WEB_PAGE),
];
const WEB_PAGE: Kind = Kind::Other("this is a web page; the download may need a login");

/// Labels of first lines, at column 60 or soon after it.
const LABELS: [(&str, Option<Kind>); 4] = [
    ("IONEX VERSION / TYPE", Some(Kind::Ionex)),
    ("CRINEX VERS", Some(Kind::Observations)),
    ("ANTEX VERSION / SYST", Some(Kind::Other("this looks like ANTEX antenna offsets, which are not used"))),
    ("RINEX VERSION / TYPE", None),
];
/// Columns around that of a RINEX file's type, which clock files of 3.04 have one further on.
const TYPE: std::ops::Range<usize> = 20..22;

/// The kind of a file with this beginning and where it goes, unless that kind was `expected`.
pub fn hint(start: &[u8], expected: &str) -> Option<&'static str> {
    let start = content(start);
    let kind = labelled(start)
        .or_else(|| BEGINNINGS.iter().find(|(bytes, _)| start.starts_with(bytes)).map(|(_, kind)| *kind))
        .or_else(|| gsdc::is_ground_truth(start).then_some(Kind::Truth))
        .or_else(|| recognise_text(start, true).map(|_| Kind::Observations))?;
    (kind.name() != expected).then(|| kind.hint())
}

fn labelled(start: &[u8]) -> Option<Kind> {
    let first = start.split(|byte| *byte == b'\n').next()?;
    let label = String::from_utf8_lossy(first.get(60..)?);
    let (_, kind) = LABELS.iter().find(|(known, _)| label.contains(known))?;
    kind.or_else(|| match first.get(TYPE)?.trim_ascii().first()? {
        b'O' => Some(Kind::Observations),
        b'N' | b'G' | b'H' | b'E' => Some(Kind::Navigation),
        b'C' => Some(Kind::Clock),
        b'M' => Some(Kind::Other("this looks like RINEX meteorological data, which are not used")),
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn first_line(version: &str, kind: &str, label: &str) -> String {
        format!("{version:<20}{kind:<40}{label}\n")
    }

    #[test]
    fn every_file_that_an_option_takes_is_told_where_it_goes() {
        let rinex = "RINEX VERSION / TYPE";
        for (start, name, option) in [
            (first_line("     3.04", "OBSERVATION DATA    M", rinex), "observation", "--observations"),
            (
                first_line("3.0", "COMPACT RINEX FORMAT", "CRINEX VERS   / TYPE"),
                "observation",
                "--observations",
            ),
            ("# \n# Header Description:\n".to_owned(), "observation", "--observations"),
            ("phone,millisSinceGpsEpoch,svid\n".to_owned(), "observation", "--observations"),
            (
                first_line("     3.04", "N: GNSS NAV DATA    M: MIXED", rinex),
                "RINEX navigation",
                "--navigation",
            ),
            (first_line("     2.01", "GLONASS NAV DATA", rinex), "RINEX navigation", "--navigation"),
            (first_line("     3.00", "CLOCK DATA", rinex), "RINEX clock", "--clock"),
            (first_line("3.04", " C", &format!("     {rinex}")), "RINEX clock", "--clock"),
            ("#aV2025  1  1".to_owned(), "SP3", "--sp3"),
            ("#bP2025  1  1".to_owned(), "SP3", "--sp3"),
            ("#cP2025  1  1".to_owned(), "SP3", "--sp3"),
            ("#dP2025  1  1".to_owned(), "SP3", "--sp3"),
            ("%=BIA 1.00 COD".to_owned(), "Bias-SINEX", "--bias"),
            (first_line("     1.0", "IONOSPHERE MAPS     GNSS", "IONEX VERSION / TYPE"), "IONEX", "--ionex"),
            ("gps_week,gps_tow_s,latitude_deg\n".to_owned(), "truth", "truth of [[phone]]"),
            ("group = 'g'\n".to_owned(), "session", "cofix-hub replay"),
        ] {
            let said = hint(start.as_bytes(), "something else").unwrap();
            assert!(said.contains(option), "{start}: {said}");
            assert!(option.starts_with("cofix") || said.contains("session file"), "{said}");
            assert_eq!(hint(start.as_bytes(), name), None, "{start}");
            let marked = format!("\r\n\u{feff}{start}");
            assert_eq!(hint(marked.as_bytes(), "something else"), Some(said), "{start}");
        }
    }

    #[test]
    fn what_is_of_no_use_is_named_and_the_rest_is_not_guessed_at() {
        for (start, said) in [
            (&b"\xb5\x62\x01\x07"[..], "UBX"),
            (b"$GPGGA,1,2", "NMEA"),
            (b"<!DOCTYPE html>", "web page"),
            (b"%=SNX 2.02", "SINEX"),
        ] {
            assert!(hint(start, "SP3").unwrap().contains(said));
        }
        for start in [&b""[..], b"lorem ipsum", b"\xd3\x00"] {
            assert_eq!(hint(start, "SP3"), None);
        }
    }
}
