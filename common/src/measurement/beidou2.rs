//! The code bias of BeiDou-2 by elevation (Wanninger and Beer 2015, "BeiDou satellite-induced code pseudorange variations: diagnosis and
//! therapy", GPS Solutions 19).
//!
//! The pseudoranges of BeiDou-2's inclined and medium satellites get shorter, against their carrier phases, from the horizon to the zenith: by
//! 0.9 m and 1.5 m on B1. The variation arises in the satellites and is the same in all receivers. The paper's table is of what is *added*
//! to the measured pseudorange. Geostationary satellites always stand at one elevation, where nothing is known, and BeiDou-3 has no
//! such variation. Only B1I is corrected here: B2I and B3I have tables of their own, so a pair of bands is left as it is.

use crate::gnss::{Constellation, SatelliteId, SignalCode};

/// Steps of the tables, °.
const STEP_DEG: f64 = 10.0;
/// Correction of B1I at elevations of 0°, 10°, … 90°, m: satellites in inclined geosynchronous orbits.
const INCLINED_M: [f64; 10] = [-0.55, -0.40, -0.34, -0.23, -0.15, -0.04, 0.09, 0.19, 0.27, 0.35];
/// The same of satellites in medium orbits.
const MEDIUM_M: [f64; 10] = [-0.47, -0.38, -0.32, -0.23, -0.11, 0.06, 0.34, 0.69, 0.97, 1.05];
/// RINEX band digit of B1I.
const B1I_BAND: u8 = b'2';

/// What is to be added to a pseudorange at an elevation, m; 0 for signals without such a bias.
pub fn beidou2_code_correction_m(satellite: SatelliteId, signal: SignalCode, elevation_rad: f64) -> f64 {
    let table = table(satellite).filter(|_| signal.band == B1I_BAND);
    table.map_or(0.0, |table| interpolated(table, elevation_rad.to_degrees()))
}

/// The table of a satellite by its orbit.
const fn table(satellite: SatelliteId) -> Option<&'static [f64; 10]> {
    match (satellite.constellation, satellite.number) {
        (Constellation::Beidou, 6..=10 | 13 | 16) => Some(&INCLINED_M),
        (Constellation::Beidou, 11 | 12 | 14) => Some(&MEDIUM_M),
        _ => None,
    }
}

/// Linear between the steps; elevations outside 0° to 90° are limited to them.
fn interpolated(table: &[f64; 10], elevation_deg: f64) -> f64 {
    let place = (elevation_deg / STEP_DEG).clamp(0.0, 9.0);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 0 to 8
    let index = place.floor().min(8.0) as usize;
    let part = place - index as f64;
    table[index] + part * (table[index + 1] - table[index])
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::frames::{EcefVector, Enu, Geodetic, LocalFrame};
    use crate::gnss::{LossOfLock, Observation};
    use crate::measurement::prepared::{PreparedObservation, SecondSignal};
    use crate::measurement::{CorrectionOptions, Corrector};
    use crate::orbit::Products;
    use crate::time::GpsTime;

    fn observation(constellation: Constellation, number: u8, signal: [u8; 2]) -> Observation {
        Observation {
            satellite: SatelliteId::new(constellation, number),
            signal: SignalCode::new(signal[0], signal[1]),
            pseudorange_m: None,
            carrier_phase_cycles: None,
            doppler_hz: None,
            cn0_dbhz: None,
            loss_of_lock: LossOfLock::default(),
        }
    }

    fn correction_m(constellation: Constellation, number: u8, signal: [u8; 2], elevation_deg: f64) -> f64 {
        let Observation { satellite, signal, .. } = observation(constellation, number, signal);
        beidou2_code_correction_m(satellite, signal, elevation_deg.to_radians())
    }

    /// C11 about 62° above the horizon in the north, as a single signal or as a pair.
    fn c11(frame: &LocalFrame, second: Option<SecondSignal>) -> PreparedObservation {
        let line = Enu { east: 0.0, north: 1.0e7, up: 1.88e7 };
        PreparedObservation {
            observation: observation(Constellation::Beidou, 11, *b"2I"),
            frequency_hz: 1_561.098e6,
            pseudorange_m: 2.13e7,
            range_rate_mps: None,
            phase_m: None,
            position: frame.origin() + frame.vector_enu_to_ecef(line),
            velocity: EcefVector::new(0.0, 0.0, 0.0),
            satellite_variance_m2: 1.0,
            usual_variance_m2: 1.0,
            signal_variance_m2: 0.0,
            code_sigma_m: None,
            stated: None,
            second,
        }
    }

    #[test]
    fn the_option_adds_the_correction_to_single_signals() {
        let frame = LocalFrame::at(Geodetic::from_degrees(30.5, 114.3, 25.0).geodetic_to_ecef());
        let pair = SignalCode::pair(SignalCode::new(b'2', b'I'), SignalCode::new(b'6', b'I')).unwrap();
        let second =
            SecondSignal { pair, factor: 2.94, cn0_dbhz: None, code_sigma_m: None, signal_variance_m2: 0.0 };
        let corrected = |beidou2_code_bias, second| {
            let options = CorrectionOptions { beidou2_code_bias, ..CorrectionOptions::default() };
            let corrector = Corrector::new(Arc::new(Products::new(Vec::new(), Vec::new())), options);
            let prepared = [c11(&frame, second)];
            corrector.finish(&prepared, frame.origin(), GpsTime::from_week_tow(2118, 0.0)).0.remove(0)
        };
        let (off, on) = (corrected(false, None), corrected(true, None));
        let expected_m =
            correction_m(Constellation::Beidou, 11, *b"2I", on.direction.elevation_rad.to_degrees());
        assert!((0.35..0.45).contains(&expected_m), "{expected_m}");
        assert!((on.pseudorange_m - off.pseudorange_m - expected_m).abs() < 1e-6);
        assert_eq!(corrected(true, Some(second)).pseudorange_m, corrected(false, Some(second)).pseudorange_m);
    }

    #[test]
    fn corrections_are_those_of_the_paper_and_linear_in_between() {
        for (number, elevation_deg, expected_m) in [
            (6, 0.0, -0.55),
            (10, 55.0, 0.025),
            (13, 90.0, 0.35),
            (16, 30.0, -0.23),
            (11, 10.0, -0.38),
            (12, 62.0, 0.41),
            (14, 90.0, 1.05),
            (14, 95.0, 1.05),
            (14, -5.0, -0.47),
        ] {
            let ours_m = correction_m(Constellation::Beidou, number, *b"2I", elevation_deg);
            assert!((ours_m - expected_m).abs() < 1e-12, "C{number:02} at {elevation_deg}°: {ours_m}");
        }
    }

    #[test]
    fn other_satellites_and_signals_have_none() {
        // Geostationary, and BeiDou-3.
        for number in [1, 5, 15, 17, 19, 37, 59] {
            assert_eq!(correction_m(Constellation::Beidou, number, *b"2I", 80.0), 0.0, "C{number:02}");
        }
        assert_eq!(correction_m(Constellation::Beidou, 11, *b"6I", 80.0), 0.0);
        assert_eq!(correction_m(Constellation::Beidou, 11, *b"1P", 80.0), 0.0);
        assert_eq!(correction_m(Constellation::Gps, 11, *b"2I", 80.0), 0.0);
    }
}
