//! The signal of an observation code by the version of its file.

use super::types::{ObservationKind, ObservationType};
use crate::gnss::{Constellation, SignalCode};
use crate::skips::Reason;

/// RINEX 3.02, which named BeiDou's B1I as band 1; before and after it is band 2 (RINEX 3.05, table 9, note).
const B1I_ON_BAND_1: u16 = 302;
/// RINEX 3.04, which gave BeiDou's band 1 to B1C.
const B1C_ON_BAND_1: u16 = 304;

/// Signal of a code.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Meaning {
    /// The signal.
    pub(super) signal: SignalCode,
    /// Why the code is not simply that of the signal in the file's version.
    pub(super) remark: Remark,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Remark {
    /// No remark.
    None,
    /// It is taken for the signal, for this reason.
    Taken(Reason),
    /// It cannot be, for this reason.
    Refused(Reason),
}

/// The meaning of a code among all of its system's. RINEX 2 has names of its own, which are settled before.
pub(super) fn meaning(
    observed: &ObservationType,
    constellation: Constellation,
    version: u16,
    all: &[ObservationType],
) -> Meaning {
    let signal = observed.signal;
    let as_written = |remark| Meaning { signal, remark };
    if version < 300 || observed.kind == ObservationKind::Other {
        return as_written(Remark::None);
    }
    if constellation == Constellation::Beidou && may_be_b1i(signal, version) {
        return b1i(signal, version, all);
    }
    as_written(match signal.since(constellation) {
        None => Remark::Refused(Reason::SignalNotOfSystem),
        Some(_) if observed.kind == ObservationKind::Pseudorange && !signal.has_pseudorange() => {
            Remark::Refused(Reason::PseudorangeOfCodelessTracking)
        }
        Some(since) if since > version => Remark::Taken(Reason::ObservationCodeNewerThanFile),
        Some(_) => Remark::None,
    })
}

/// Whether a code of BeiDou's band 1 can be B1I: no other signal there has I and Q; X and blank were B1I's before B1C came.
fn may_be_b1i(signal: SignalCode, version: u16) -> bool {
    match (signal.band, signal.attribute) {
        (b'1', b'I' | b'Q') => true,
        (b'1', b'X' | b' ') => version < B1C_ON_BAND_1,
        _ => false,
    }
}

fn b1i(signal: SignalCode, version: u16, all: &[ObservationType]) -> Meaning {
    let has_band_2 = all.iter().any(|o| o.kind != ObservationKind::Other && o.signal.band == b'2');
    if has_band_2 {
        return Meaning { signal, remark: Remark::Refused(Reason::BeidouBand1Unclear) };
    }
    let remark =
        if version == B1I_ON_BAND_1 { Remark::None } else { Remark::Taken(Reason::BeidouBand1TakenForB1i) };
    Meaning { signal: SignalCode::new(b'2', signal.attribute), remark }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::rinex::types::observation_type;

    /// The meaning of the first code of a list.
    fn first(codes: &str, constellation: Constellation, version: u16) -> (String, Remark) {
        let all: Vec<_> =
            codes.split_whitespace().map(|code| observation_type(code.as_bytes()).unwrap()).collect();
        let Meaning { signal, remark } = meaning(&all[0], constellation, version, &all);
        (signal.to_string(), remark)
    }

    #[test]
    fn beidous_band_1_is_what_the_version_says() {
        use Remark::{None, Refused, Taken};
        for (codes, version, signal, remark) in [
            // 3.02 named B1I so, and only 3.02.
            ("C1I", 302, "2I", None),
            ("C1Q", 302, "2Q", None),
            ("C1X", 302, "2X", None),
            ("C1", 302, "2 ", None),
            ("C1I", 300, "2I", Taken(Reason::BeidouBand1TakenForB1i)),
            ("C1I", 303, "2I", Taken(Reason::BeidouBand1TakenForB1i)),
            ("L1I", 304, "2I", Taken(Reason::BeidouBand1TakenForB1i)),
            ("C1I", 402, "2I", Taken(Reason::BeidouBand1TakenForB1i)),
            ("C1X", 301, "2X", Taken(Reason::BeidouBand1TakenForB1i)),
            ("C1X", 303, "2X", Taken(Reason::BeidouBand1TakenForB1i)),
            ("C1", 303, "2 ", Taken(Reason::BeidouBand1TakenForB1i)),
            // B1C came with 3.04.
            ("C1X", 304, "1X", None),
            ("C1P", 304, "1P", None),
            ("C1D", 401, "1D", None),
            ("C1", 304, "1 ", None),
            ("C1P", 303, "1P", Taken(Reason::ObservationCodeNewerThanFile)),
            ("C1D", 302, "1D", Taken(Reason::ObservationCodeNewerThanFile)),
            // B1I is there already, so that it cannot be this.
            ("C1X C2I", 303, "1X", Refused(Reason::BeidouBand1Unclear)),
            ("C1X L2I", 302, "1X", Refused(Reason::BeidouBand1Unclear)),
            ("C1I C2I", 304, "1I", Refused(Reason::BeidouBand1Unclear)),
            ("C1X C2I", 304, "1X", None),
            // B1A.
            ("C1A", 304, "1A", None),
            ("C1S", 305, "1S", None),
            ("C1Z", 304, "1Z", Taken(Reason::ObservationCodeNewerThanFile)),
            // No signal of BeiDou.
            ("C1C", 300, "1C", Refused(Reason::SignalNotOfSystem)),
            ("C1C", 302, "1C", Refused(Reason::SignalNotOfSystem)),
            ("L1C", 304, "1C", Refused(Reason::SignalNotOfSystem)),
            ("C1C", 402, "1C", Refused(Reason::SignalNotOfSystem)),
            ("C1W", 304, "1W", Refused(Reason::SignalNotOfSystem)),
        ] {
            assert_eq!(
                first(codes, Constellation::Beidou, version),
                (signal.to_owned(), remark),
                "{codes} {version}"
            );
        }
    }

    /// What exists in a version is itself; what came later is taken for it, with a remark; all else is refused.
    #[test]
    fn codes_of_all_systems_by_version() {
        let versions = [300, 301, 302, 303, 304, 305, 400, 401, 402];
        for letter in "GRESJCI".chars() {
            let constellation = Constellation::from_letter(letter).unwrap();
            for version in versions {
                for (band, attribute) in
                    (b'0'..=b'9').flat_map(|b| (b'A'..=b'Z').chain([b' ']).map(move |a| (b, a)))
                {
                    let code = SignalCode::new(band, attribute);
                    if constellation == Constellation::Beidou && may_be_b1i(code, version) {
                        continue;
                    }
                    let (signal, remark) = first(&format!("S{code}"), constellation, version);
                    let expected = match code.since(constellation) {
                        None => Remark::Refused(Reason::SignalNotOfSystem),
                        Some(since) if since > version => Remark::Taken(Reason::ObservationCodeNewerThanFile),
                        Some(_) => Remark::None,
                    };
                    assert_eq!((signal, remark), (code.to_string(), expected), "{letter} {version}");
                }
            }
        }
    }

    #[test]
    fn other_kinds_are_not_judged_and_codeless_tracking_has_no_range() {
        assert_eq!(first("X1", Constellation::Galileo, 304), ("1 ".to_owned(), Remark::None));
        assert_eq!(first("I3", Constellation::Gps, 304), ("3 ".to_owned(), Remark::None));
        assert_eq!(first("L1N", Constellation::Gps, 304), ("1N".to_owned(), Remark::None));
        assert_eq!(
            first("C1N", Constellation::Gps, 304),
            ("1N".to_owned(), Remark::Refused(Reason::PseudorangeOfCodelessTracking))
        );
        // Names of RINEX 2 have been settled before.
        assert_eq!(first("C1C", Constellation::Beidou, 211), ("1C".to_owned(), Remark::None));
        assert_eq!(first("c1c", Constellation::Gps, 304), ("1C".to_owned(), Remark::None));
    }
}
