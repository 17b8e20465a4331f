//! Epoch-wise weighted least squares: position, clocks, velocity, dilution of precision.
//!
//! ```
//! # use std::sync::Arc;
//! # use cofix_common::simulation::{Scenario, Simulation};
//! # let simulation = Simulation::new(Scenario { duration_s: 10.0, ..Scenario::default() })?;
//! # let simulated = simulation.epochs(0).next().ok_or("no epoch")?;
//! # let (epoch, products) = (simulated.epoch, Arc::new(simulation.products()));
//! # use cofix_common::frames::Ecef;
//! # use cofix_common::measurement::{CorrectionOptions, Corrector, without_position};
//! use cofix_common::solve::{solve_position, solve_velocity};
//!
//! # let mut corrector = Corrector::new(products, CorrectionOptions::default());
//! # let prepared = corrector.prepare(&epoch);
//! # // Without a position there is no elevation yet, and no atmosphere: a first solution comes first.
//! # let rough = solve_position(&without_position(&prepared), Ecef::new(0.0, 0.0, 0.0))?;
//! # let (corrected, _) = corrector.finish(&prepared, rough.position(), epoch.time_gps);
//! let fit = solve_position(&corrected, rough.position())?;
//! let solution = fit.to_solution(solve_velocity(&corrected, fit.position())).ok_or("singular")?;
//! println!("{:?}, {} signals", solution.position.ecef_to_geodetic(), solution.used);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub(crate) mod elimination;
pub(crate) mod groups;
pub(crate) mod position;
pub(crate) mod velocity;

pub use position::{Fit, SolveError, solve_position};
pub use velocity::{RateFit, fit_velocity, solve_velocity};

use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

use crate::frames::{Ecef, EcefVector};
use crate::gnss::{ClockGroup, Constellation};

/// An epoch-wise solution.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PointSolution {
    /// Position, m.
    pub position: Ecef,
    /// Covariance of the position in ECEF by the stochastic model, m².
    pub position_covariance: Matrix3<f64>,
    /// Receiver clock of each group in use, m.
    pub clocks_m: Vec<(ClockGroup, f64)>,
    /// Velocity from Doppler, if there were enough range rates.
    pub velocity: Option<VelocitySolution>,
    /// Dilution of precision of the used satellites.
    pub dops: Dops,
    /// Number of used signals.
    pub used: u16,
}

/// The clock group of the signal that most phones receive best, whose satellites' clocks are those of GPS time.
const GPS_L1: ClockGroup = ClockGroup { constellation: Constellation::Gps, band: b'1' };

impl PointSolution {
    /// Offset of the receiver's clock from GPS time, m: that of GPS L1, or else the median of all groups. The groups differ by less than a
    /// microsecond (the biases of constellations and bands), so this is exact enough for a time, not for a pseudorange.
    pub fn receiver_clock_m(&self) -> Option<f64> {
        let gps_l1 = self.clocks_m.iter().find(|(group, _)| *group == GPS_L1);
        gps_l1.map(|(_, clock_m)| *clock_m).or_else(|| {
            let mut clocks_m: Vec<f64> = self.clocks_m.iter().map(|(_, clock_m)| *clock_m).collect();
            clocks_m.sort_by(f64::total_cmp);
            clocks_m.get(clocks_m.len() / 2).copied()
        })
    }
}

/// An epoch-wise velocity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct VelocitySolution {
    /// Velocity, m/s.
    pub velocity: EcefVector,
    /// Covariance of the velocity in ECEF by the stochastic model, m²/s².
    pub covariance: Matrix3<f64>,
}

/// Dilution of precision with one clock per group.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Dops {
    /// Geometric.
    pub gdop: f64,
    /// Position.
    pub pdop: f64,
    /// Horizontal.
    pub hdop: f64,
    /// Vertical.
    pub vdop: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::sky::{OPEN_SKY_DEG, Receiver};

    #[test]
    fn the_receiver_clock_is_that_of_gps_l1_or_else_the_median() {
        let receiver = Receiver::in_wuhan();
        let observations = receiver.observe(&OPEN_SKY_DEG);
        let fit = solve_position(&observations, receiver.position).unwrap();
        let mut solution = fit.to_solution(None).unwrap();
        let clock_m = solution.receiver_clock_m().unwrap();
        assert!((clock_m - receiver.clocks_m[0]).abs() < 1e-3, "{clock_m}");
        solution.clocks_m[0].0.band = b'5';
        solution.clocks_m[2].1 = -3e5;
        let clock_m = solution.receiver_clock_m().unwrap();
        assert!(
            (clock_m - receiver.clocks_m[0]).abs() < 1e-3,
            "the median of 150, 157 and -300,000 m: {clock_m}"
        );
        solution.clocks_m.clear();
        assert_eq!(solution.receiver_clock_m(), None);
    }
}
