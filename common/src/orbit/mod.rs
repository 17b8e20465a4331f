//! Satellite position, velocity and clock, from precise (SP3, RINEX clocks) or broadcast (Kepler, GLONASS) orbits, and group
//! delays from biases (Bias-SINEX) or navigation messages.
//!
//! ```
//! # use std::sync::Arc;
//! # use cofix_common::simulation::{Scenario, Simulation};
//! # let simulation = Simulation::new(Scenario { duration_s: 10.0, ..Scenario::default() })?;
//! # let simulated = simulation.epochs(0).next().ok_or("no epoch")?;
//! # let (epoch, products) = (simulated.epoch, Arc::new(simulation.products()));
//! let satellite = epoch.observations[0].satellite;
//! let state = products.satellite_state(satellite, epoch.time_gps)?;
//! println!("{satellite}: {} m from the Earth's centre, clock {:e} s", state.position.0.norm(), state.clock_s);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod accuracy_index;
mod biases;
mod broadcast;
mod clocks;
mod glonass;
mod group_delay;
mod ionosphere;
mod kepler;
mod plausible;
mod precise;
mod products;
mod records;
mod usual_error;

pub use accuracy_index::{UNKNOWN_ACCURACY_M, sisa_m, ura_m};
pub(crate) use broadcast::gravity_and_rotation;
pub use broadcast::is_healthy;
pub use glonass::GlonassEphemeris;
pub(crate) use glonass::accuracy_m;
pub use ionosphere::{IonosphereDelay, LineOfSight};
pub use kepler::{KeplerEphemeris, NavigationMessage};
pub(crate) use plausible::{Implausible, check_reference_s, within};
pub use precise::{MAX_NODES, MIN_NODES};
pub use products::Products;
pub use records::{
    BiasFile, ClockFile, ClockRecord, CodeBias, IonosphereTerms, NavigationFile, Sp3, Sp3Position,
};
pub use usual_error::BroadcastAccuracy;

use crate::frames::{Ecef, EcefVector};
use crate::gnss::SatelliteId;
use crate::time::GpsTime;

/// A satellite at one instant, in the Earth-fixed frame of that instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SatelliteState {
    /// Antenna phase centre (broadcast) or centre of mass (SP3), m.
    pub position: Ecef,
    /// Velocity in the rotating Earth-fixed frame, m/s.
    pub velocity: EcefVector,
    /// Clock offset dT_s with relativity and without group delay, s.
    pub clock_s: f64,
    /// Clock drift, s/s.
    pub clock_drift_sps: f64,
    /// Standard deviation of orbit and clock together along the line of sight, m: what a broadcast message states.
    pub sigma_m: f64,
    /// Reference of the clock; decides the group delay correction of a single signal.
    pub clock_reference: ClockReference,
}

/// The signal or combination to which a satellite clock refers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClockReference {
    /// Reference of the broadcast message: L1/L2 P(Y) (GPS, QZSS), E1/E5b (Galileo I/NAV), E1/E5a (F/NAV), B3I (BeiDou),
    /// L1 (GLONASS).
    Broadcast,
    /// Ionosphere-free pair of an SP3 or clock file: C1W/C2W (GPS), C1X/C5X (Galileo), C2I/C6I (BeiDou).
    IonosphereFree,
}

/// Reason for a missing satellite state.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OrbitError {
    /// No product contains the satellite.
    #[error("{satellite}: no orbit in any product")]
    Unknown {
        /// The satellite.
        satellite: SatelliteId,
    },
    /// The products contain the satellite, but not at this time.
    #[error(
        "{satellite} at {time}: {}the orbits reach from {first} to {last}; name a product that covers it{}",
        between(*time, *first, *last),
        time.rollover_hint(*first)
    )]
    NotCovered {
        /// The satellite.
        satellite: SatelliteId,
        /// Requested instant; between `first` and `last` it lies in a gap.
        time: GpsTime,
        /// First usable instant.
        first: GpsTime,
        /// Last usable instant.
        last: GpsTime,
    },
    /// The precise orbits have too few positions without a gap there.
    #[error(
        "{satellite} at {time}: the SP3 orbits have {nodes} positions around it without a gap, and {} are needed; name the file of the day before or after too",
        MIN_NODES
    )]
    TooFewNodes {
        /// The satellite.
        satellite: SatelliteId,
        /// Requested instant.
        time: GpsTime,
        /// Number of positions at equal intervals around it.
        nodes: usize,
    },
    /// The precise orbits have a position, but no clock.
    #[error("{satellite} at {time}: the SP3 orbits have no clock there; name a RINEX clock file too")]
    NoClock {
        /// The satellite.
        satellite: SatelliteId,
        /// Requested instant.
        time: GpsTime,
    },
    /// The message in force declares the satellite unusable.
    #[error("{satellite} at {time}: its navigation message says unhealthy ({health})")]
    Unhealthy {
        /// The satellite.
        satellite: SatelliteId,
        /// Requested instant.
        time: GpsTime,
        /// The health word.
        health: f64,
    },
}

/// Text on the relation of an uncovered instant to the orbits' span.
fn between(time: GpsTime, first: GpsTime, last: GpsTime) -> &'static str {
    if first <= time && time <= last { "it lies in a gap, though " } else { "" }
}
