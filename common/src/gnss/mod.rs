//! Names of things: constellations, satellites, signals, observations, epochs.

mod constellation;
mod observation;
mod signal;

pub use constellation::{Constellation, SatelliteId, SatelliteIdError};
pub use observation::{EpochFlag, LossOfLock, Observation, ObservationEpoch};
pub use signal::{ClockGroup, SignalCode};
