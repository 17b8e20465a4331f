//! The hub's estimator: aligned epochs in, fused and constrained epochs out. No I/O.

use cofix_common::constraint::{Constraint, ConstraintAction};
use cofix_common::filter::PhoneState;
use cofix_common::skips::Skips;
use cofix_common::time::GpsTime;
use cofix_common::wire::EpochMessage;

/// A constraint and when it holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScheduledConstraint {
    /// The constraint; phones by their index in the group.
    pub constraint: Constraint,
    /// First instant at which it holds; `None`: always.
    pub from_gps: Option<GpsTime>,
    /// Last instant at which it holds; `None`: always.
    pub to_gps: Option<GpsTime>,
}

/// What the engine may be told.
#[derive(Clone, Debug, Default)]
pub struct EngineOptions {}

/// One fused epoch of the group.
#[derive(Clone, Debug)]
pub struct FusedEpoch {
    /// The common time, GPS time: the latest of the phones' receive times.
    pub time_gps: GpsTime,
    /// One entry per phone of the group, in the group's order.
    pub phones: Vec<FusedPhone>,
    /// What every constraint did that was not satisfied already.
    pub actions: Vec<ConstraintAction>,
    /// All pairs under a distance constraint.
    pub distances: Vec<PairDistance>,
}

/// One phone in a fused epoch.
#[derive(Clone, Debug)]
pub struct FusedPhone {
    /// Its message of this epoch; `None` when it had none.
    pub message: Option<EpochMessage>,
    /// Its fused state at the common time; `None` until it is initialised.
    pub state: Option<PhoneState>,
}

/// The distance of two phones after fusion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairDistance {
    /// Indices of the phones.
    pub phones: (usize, usize),
    /// Distance, m.
    pub distance_m: f64,
    /// Its standard deviation by the joint covariance, m.
    pub sigma_m: f64,
    /// Lower bound, m.
    pub minimum_m: f64,
    /// Upper bound, m.
    pub maximum_m: f64,
}

/// The joint estimator of a group.
pub struct Engine {
    skips: Skips,
}

impl Engine {
    /// An engine for the named phones.
    pub fn new(_phones: &[String], _constraints: Vec<ScheduledConstraint>, _options: EngineOptions) -> Self {
        Self { skips: Skips::default() }
    }

    /// Fuses the messages of one aligned epoch: at most one per phone, `None` where a phone has none.
    pub fn step(&mut self, _messages: Vec<Option<EpochMessage>>) -> FusedEpoch {
        todo!()
    }

    /// What was skipped so far.
    pub fn skips(&self) -> &Skips {
        &self.skips
    }
}
