//! Satellites' states and ionosphere terms in `Raw` lines since 2022 (Android API, `SatellitePvt`; names as the app prints them).

use super::columns::{RAW_COLUMNS, Raw};
use super::fields::{Fields, real};
use crate::atmosphere::KlobucharCoefficients;
use crate::frames::{Ecef, EcefVector};
use crate::measurement::{
    GivenCorrections, MAX_SATELLITE_CLOCK_M, MAX_SATELLITE_DRIFT_MPS, MAX_SATELLITE_SPEED_MPS, ORBIT_BOUNDS_M,
};
use crate::skips::Reason;

/// Standard deviation of orbit and clock along the line of sight, m. The app does not say whether the clock contains the
/// signal's group delay, and those of GPS satellites differ by 2 m.
const SIGMA_M: f64 = 2.0;
/// A position nearer to the Earth's centre stands for none, m.
const EARTHS_INSIDE_M: f64 = 6e6;
/// Largest delay in the atmosphere, m.
const MAX_DELAY_M: f64 = 500.0;
/// Largest magnitudes of the coefficients α and β that a GPS message has room for (IS-GPS-200, table 20-X).
const MAX_ALPHA: [f64; 4] = [1.2e-7, 9.6e-7, 7.7e-6, 7.7e-6];
const MAX_BETA: [f64; 4] = [2.63e5, 2.1e6, 8.4e6, 8.4e6];

/// Satellite state and delays of a line; `None` where the phone gives none (blank, zero, or another place inside the Earth), and,
/// counted, where they are impossible.
pub(super) fn corrections(fields: &[&[u8]; RAW_COLUMNS], read: &mut Fields<'_>) -> Option<GivenCorrections> {
    let at = |column: Raw| fields.get(column as usize).copied().unwrap_or_default();
    // A state is whole or missing.
    if [Raw::SvPositionX, Raw::SvVelocityX, Raw::SvClockBias].into_iter().any(|column| at(column).is_empty())
    {
        return None;
    }
    let number = |column: Raw| real(at(column)).unwrap_or(0.0);
    let vector = |columns: [Raw; 3]| nalgebra::Vector3::from(columns.map(number));
    let position = vector([Raw::SvPositionX, Raw::SvPositionY, Raw::SvPositionZ]);
    let velocity = vector([Raw::SvVelocityX, Raw::SvVelocityY, Raw::SvVelocityZ]);
    let [clock_m, clock_drift_mps] = [Raw::SvClockBias, Raw::SvClockDrift].map(number);
    if position.norm() < EARTHS_INSIDE_M {
        return None;
    }
    let is_sound = ORBIT_BOUNDS_M.contains(&position.norm())
        && velocity.norm() <= MAX_SATELLITE_SPEED_MPS
        && clock_m.abs() <= MAX_SATELLITE_CLOCK_M
        && clock_drift_mps.abs() <= MAX_SATELLITE_DRIFT_MPS;
    if !is_sound {
        let (distance_m, speed_mps) = (position.norm(), velocity.norm());
        read.refuse(Reason::SatelliteStateImpossible, || {
            format!("{distance_m:.0} m from the Earth's centre, {speed_mps} m/s, clock {clock_m} m, {clock_drift_mps} m/s")
        });
        return None;
    }
    let delay_m = |column: Raw| real(at(column)).filter(|delay_m| (0.0..=MAX_DELAY_M).contains(delay_m));
    Some(GivenCorrections {
        satellite_position: Ecef(position),
        satellite_velocity: EcefVector(velocity),
        clock_m,
        clock_drift_mps,
        receiver_bias_m: 0.0,
        ionosphere_m: delay_m(Raw::IonosphericDelay),
        troposphere_m: delay_m(Raw::TroposphericDelay),
        sigma_m: SIGMA_M,
        code_sigma_m: None,
    })
}

/// Klobuchar's coefficients of a line; `None` where the phone gives none or impossible ones.
pub(super) fn klobuchar(fields: &[&[u8]; RAW_COLUMNS]) -> Option<KlobucharCoefficients> {
    use Raw::{
        KlobucharAlpha0, KlobucharAlpha1, KlobucharAlpha2, KlobucharAlpha3, KlobucharBeta0, KlobucharBeta1,
        KlobucharBeta2, KlobucharBeta3,
    };
    let four = |columns: [Raw; 4], limits: [f64; 4]| {
        let mut values = [0.0; 4];
        for ((value, column), limit) in values.iter_mut().zip(columns).zip(limits) {
            *value = real(fields.get(column as usize)?).filter(|value| value.abs() <= limit)?;
        }
        Some(values)
    };
    let alpha = four([KlobucharAlpha0, KlobucharAlpha1, KlobucharAlpha2, KlobucharAlpha3], MAX_ALPHA)?;
    let beta = four([KlobucharBeta0, KlobucharBeta1, KlobucharBeta2, KlobucharBeta3], MAX_BETA)?;
    // All zero stands for nothing known.
    (alpha != [0.0; 4] || beta != [0.0; 4]).then_some(KlobucharCoefficients { alpha, beta })
}
