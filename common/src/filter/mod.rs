//! The joint Kalman filter over K ≥ 1 phones; the agent's local filter is the case K = 1.
//!
//! ```
//! # use std::sync::Arc;
//! # use cofix_common::simulation::{Scenario, Simulation};
//! # let simulation = Simulation::new(Scenario { duration_s: 10.0, ..Scenario::default() })?;
//! # let simulated = simulation.epochs(0).next().ok_or("no epoch")?;
//! # let (epoch, products) = (simulated.epoch, Arc::new(simulation.products()));
//! use cofix_common::filter::{FilterOptions, JointFilter, Start};
//! # use cofix_common::pipeline::{PhonePipeline, PipelineOptions};
//!
//! # let mut pipeline = PhonePipeline::new("SIM1", products, PipelineOptions::default());
//! # let message = pipeline.process(&epoch);
//! # let solution = message.wls.ok_or("no solution")?;
//! let mut filter = JointFilter::new(FilterOptions::default());
//! filter.insert(0, epoch.time_gps, &Start::at_solution(&solution, message.raim.verdict));
//! filter.predict(epoch.time_gps + 1.0);
//! filter.update(0, &message.observations);
//! println!("{:?}", filter.state(0).ok_or("no state")?.position());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod admit;
mod biases;
mod changes;
mod consider;
mod information;
mod joint;
mod manoeuvre;
mod noise_level;
mod options;
mod process;
mod slots;
mod standing;
mod update;
mod weights;

pub use admit::{Admitted, PhoneEpoch, Unsound};
pub use consider::SharedErrors;
pub use joint::{JointFilter, Kept, Start};
pub use options::{CodeNoise, FilterOptions, LateCodes, Motion, ProcessNoise, RobustWeights};
pub use update::UpdateReport;

use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};

use crate::frames::{Ecef, EcefVector};

/// States of one phone: position, velocity, acceleration, three ECEF components each.
pub const STATES_PER_PHONE: usize = 9;

/// State of one phone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PhoneState {
    /// Position (m), velocity (m/s), acceleration (m/s²), ECEF.
    pub mean: SVector<f64, STATES_PER_PHONE>,
    /// Covariance of the state.
    pub covariance: SMatrix<f64, STATES_PER_PHONE, STATES_PER_PHONE>,
}

impl PhoneState {
    /// Position, m.
    pub fn position(&self) -> Ecef {
        Ecef::new(self.mean[0], self.mean[1], self.mean[2])
    }

    /// Velocity, m/s.
    pub fn velocity(&self) -> EcefVector {
        EcefVector::new(self.mean[3], self.mean[4], self.mean[5])
    }
}
