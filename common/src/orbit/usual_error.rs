//! What broadcast orbits and clocks err, beside what their messages state.
//!
//! A message states an accuracy that its operator vouches for, in steps: 2 m is the least of GPS and BeiDou, and every Galileo satellite
//! states 3.12 m. Against precise orbits the errors along the line of sight are 0.7 m (GPS), 0.6 m (QZSS), 1.9 m (GLONASS) and 1.5 m (BeiDou-2)
//! in Montenbruck, Steigenberger and Hauschild (GPS Solutions 19, 2015), and since then 0.2 to 0.3 m for Galileo, and about half a metre for
//! GPS and BeiDou-3.

use crate::gnss::{Constellation, SatelliteId};

/// How large the errors of broadcast orbits and clocks are taken to be.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BroadcastAccuracy {
    /// What they usually are, and more in proportion where a message states more than usual.
    #[default]
    Usual,
    /// What the messages state.
    Stated,
}

impl BroadcastAccuracy {
    /// Standard deviation of orbit and clock together along the line of sight, m, of a message that states `stated_m`.
    pub fn sigma_m(self, satellite: SatelliteId, stated_m: f64) -> f64 {
        match self {
            Self::Stated => stated_m,
            Self::Usual => {
                let (stated_usually_m, error_m) = usual(satellite);
                error_m * (stated_m / stated_usually_m).max(1.0)
            }
        }
    }
}

/// The accuracy that a healthy satellite's messages state, and the usual error, m.
const fn usual(satellite: SatelliteId) -> (f64, f64) {
    match satellite.constellation {
        Constellation::Galileo => (3.12, 0.3),
        Constellation::Glonass => (2.5, 1.9),
        Constellation::Beidou if !satellite.is_beidou_3() => (2.0, 1.5),
        _ => (2.0, 0.6),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_the_usual_ones_and_grow_with_what_is_stated() {
        let sigma = |name: &str, stated_m| BroadcastAccuracy::Usual.sigma_m(name.parse().unwrap(), stated_m);
        assert_eq!([sigma("G05", 2.0), sigma("C30", 2.0), sigma("C06", 2.0)], [0.6, 0.6, 1.5]);
        assert_eq!([sigma("E11", 3.12), sigma("E11", 1.0), sigma("R03", 2.5)], [0.3, 0.3, 1.9]);
        assert!((sigma("G05", 8.0) - 2.4).abs() < 1e-12 && sigma("G05", 6_144.0) > 1_000.0);
        assert_eq!(BroadcastAccuracy::Stated.sigma_m("E11".parse().unwrap(), 3.12), 3.12);
    }
}
