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
pub use velocity::solve_velocity;

use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

use crate::frames::{Ecef, EcefVector};
use crate::gnss::ClockGroup;

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
