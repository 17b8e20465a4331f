//! Protection levels of a filter's state, and the verdict on it.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::options::{ProtectionOptions, RaimOptions};
use super::{Cause, ProtectionLevels, RaimReport, TestReport, Verdict, exceeds};
use crate::filter::PhoneState;
use crate::frames::{Ecef, EcefVector, LocalFrame};
use crate::solve::PointSolution;
use crate::statistics::normal::two_sided_threshold;
use crate::time::GpsTime;

/// What integrity monitoring says of a filter's state after an epoch.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StateReport {
    /// That of the test, or of RAIM on the epoch where there is no test; unreliable where the levels are beyond the alarm limits.
    pub verdict: Verdict,
    /// Test of all pseudoranges against the prediction; `None` at the start, and where the prediction is too vague.
    pub test: Option<TestReport>,
    /// Protection levels of the position; `None` where nothing bounds its error.
    pub protection: Option<ProtectionLevels>,
}

impl StateReport {
    /// From the test, RAIM on the epoch, and levels.
    pub(crate) fn new(
        test: Option<TestReport>,
        raim: &RaimReport,
        protection: Option<ProtectionLevels>,
        options: &RaimOptions,
    ) -> Self {
        let own = test.map_or(raim.verdict, |test| test.verdict);
        let is_beyond = own == Verdict::Reliable && exceeds(protection, options.alarm_limits);
        let verdict = if is_beyond { Verdict::Unreliable(Cause::AlarmLimit) } else { own };
        Self { verdict, test, protection }
    }
}

/// Levels of a state at a time by those of the phone's reliable epoch-wise solution at another, which is carried along with the state's velocity:
/// |x̂ − x| ≤ |x̂ − x̂_wls| + |x̂_wls − x|.
pub(crate) fn levels_about(
    (solution, at_gps): (&PointSolution, GpsTime),
    raim: &RaimReport,
    (state, time_gps): (&PhoneState, GpsTime),
) -> Option<ProtectionLevels> {
    let levels = raim.protection.filter(|_| raim.verdict == Verdict::Reliable)?;
    let carried = solution.position + EcefVector(state.velocity().0 * (time_gps - at_gps));
    let apart = LocalFrame::at(carried).ecef_to_enu(state.position());
    Some(ProtectionLevels {
        horizontal_m: levels.horizontal_m + apart.horizontal(),
        vertical_m: levels.vertical_m + apart.up.abs(),
    })
}

/// What lasting faults of single satellites do to the positions of a group at most.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SatelliteFaults {
    /// Largest displacement by one satellite, east, north and up, m.
    largest_m: Vector3<f64>,
    /// Number of satellites.
    satellites: f64,
}

impl SatelliteFaults {
    /// Of displacements (ECEF, m) of some phones, each by each satellite. Phones of a group are so near to each other that one local frame, at
    /// `near`, serves for all.
    pub fn new(near: Ecef, phones: usize, faults: &[Vector3<f64>]) -> Self {
        let frame = LocalFrame::at(near);
        let largest_m = faults.iter().fold(Vector3::zeros(), |largest: Vector3<f64>, fault| {
            let moved = frame.vector_ecef_to_enu(EcefVector(*fault));
            largest.sup(&Vector3::new(moved.east, moved.north, moved.up).abs())
        });
        Self { largest_m, satellites: faults.len() as f64 / phones.max(1) as f64 }
    }
}

/// Protection levels of a filter's position; `None` if the promised probability cannot be kept.
///
/// Without a fault the error has the stated covariance. A lasting fault of one satellite moves the position by at most the largest of
/// `faults`, whatever its size, because robust weights bound its pull; what remains has the stated covariance too. This is
/// the sensitivity of the filter over all its memory, not a bank of filters without each satellite. Faults of whole constellations and of two
/// satellites at once are not monitored.
pub fn state_levels(
    state: &PhoneState,
    faults: &SatelliteFaults,
    options: &ProtectionOptions,
) -> Option<ProtectionLevels> {
    let covariance: Matrix3<f64> = state.covariance.fixed_view::<3, 3>(0, 0).into_owned();
    let covariance = LocalFrame::at(state.position()).covariance_ecef_to_enu(&covariance);
    let total = options.satellite_fault * faults.satellites;
    let budget = options.misleading - 0.5 * total * total;
    if budget <= 0.0 {
        return None;
    }
    let sigmas = |probability: f64| {
        let share = probability / (faults.satellites + 1.0);
        let faulty = two_sided_threshold((2.0 * share / options.satellite_fault).min(1.0));
        (two_sided_threshold(share), faulty)
    };
    let level = |axis: usize, (fault_free, faulty): (f64, f64)| {
        let sigma_m = covariance[(axis, axis)].sqrt();
        (fault_free * sigma_m).max(faults.largest_m[axis] + faulty * sigma_m)
    };
    let horizontal = sigmas(budget / 4.0);
    let horizontal_m = level(0, horizontal).hypot(level(1, horizontal));
    let levels = ProtectionLevels { horizontal_m, vertical_m: level(2, sigmas(budget / 2.0)) };
    levels.finite()
}
