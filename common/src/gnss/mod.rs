//! Names of things: constellations, satellites, signals, observations, epochs, events.

mod constellation;
mod event;
mod observation;
mod signal;

pub use constellation::{Constellation, SatelliteId, SatelliteIdError};
pub use event::{CycleSlip, Event, EventKind};
pub use observation::{EpochFlag, LossOfLock, Observation, ObservationEpoch};
pub use signal::{ClockGroup, SignalCode};
