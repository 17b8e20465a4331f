//! Vocabulary: constellations, satellites, signals, observations, epochs, events.

mod constellation;
mod event;
mod limits;
mod misnamed;
mod observation;
mod signal;
mod signal_table;

pub use constellation::{Constellation, SatelliteId, SatelliteIdError};
pub use event::{CycleSlip, Event, EventKind};
pub(crate) use limits::MAX_PHASE_CYCLES;
pub use limits::{CN0_BOUNDS_DBHZ, MAX_DOPPLER_HZ, PSEUDORANGE_BOUNDS_M};
pub use misnamed::Misnamed;
pub use observation::{EpochFlag, LossOfLock, Observation, ObservationEpoch};
pub use signal::{ClockGroup, SignalCode, SignalKey};
