//! Seeded, simulated drives with truth, for demonstrations, samples, and tests without files.
//!
//! A [`Scenario`] describes a drive and a [`Simulation`] computes it: vehicles with one or more phones follow each other on a
//! closed road, stop at lights and pass streets between houses, or stand. GPS, Galileo and BeiDou satellites are described
//! by the broadcast messages that receivers use. Every phone records code and Doppler at time tags of
//! its own clock. The truth refers to the true instant of reception.
//!
//! | file | content |
//! |---|---|
//! | `scenario`, `named` | scenarios, and those with a name |
//! | `road`, `profile`, `convoy`, `mount`, `motion` | positions of vehicles and phones |
//! | `street` | houses that hide and reflect satellites |
//! | `constellation`, `satellites`, `geometry` | orbits, messages, light time |
//! | `environment`, `tracks`, `receiver` | errors, their random processes, clocks |
//! | `shared` | slow errors of satellites and ionosphere, the same at all phones |
//! | `observations` | epochs from all of these |
//! | `constraints` | true constraints on the phones |
//!
//! ```
//! use cofix_common::simulation::{Scenario, Simulation};
//!
//! let simulation = Simulation::new(Scenario { duration_s: 10.0, ..Scenario::default() })?;
//! for phone in 0..simulation.phone_names().len() {
//!     for simulated in simulation.epochs(phone) {
//!         assert!(!simulated.epoch.observations.is_empty());
//!     }
//! }
//! # Ok::<(), cofix_common::simulation::ScenarioError>(())
//! ```
//!
//! All random values follow from the seed. The constellation, each phone's clock, each satellite at each phone, and
//! each piece of a façade have their own ChaCha streams, so results do not depend on the order in which phones are simulated.
//! Sines and exponentials are those of the platform, so two platforms may differ in the last digits.
//!
//! A phone may have a motion of its own ([`OwnMotion`]), such as one that is carried away from the car. Slow biases of
//! satellites and an ionosphere residual, the same at all phones, are off unless [`ErrorModel::shared`] says otherwise.
//!
//! Phones of one vehicle have common errors as in a real one: errors of orbits, clocks and atmosphere, reflections by
//! houses, and a part of the diffuse multipath. Not simulated: carrier phase, cycle slips, GLONASS, diffraction at roofs,
//! second reflections, and any dependence of the multipath's correlation on speed.

mod constellation;
mod constraints;
mod convoy;
mod environment;
mod geometry;
mod motion;
mod mount;
mod named;
mod observations;
mod profile;
mod random;
mod receiver;
mod road;
mod satellites;
mod scenario;
mod shared;
mod street;
mod tracks;

pub use convoy::{Convoy, ConvoyOptions, Traffic, VehicleState};
pub use environment::ErrorModel;
pub use motion::{AccelerationPulse, OwnMotion};
pub use mount::Mount;
pub use observations::{GrossError, PhoneEpochs, SimulatedEpoch, TruthState};
pub use receiver::{ClockOptions, ClockState, InterSystemBiases};
pub use road::{Road, RoadPoint};
pub use scenario::{PhoneOptions, Scenario, ScenarioError};
pub use shared::{IonosphereResidual, SharedErrors};
pub use street::{Canyon, Facade};

use crate::atmosphere::KlobucharCoefficients;
use crate::gnss::SatelliteId;
use crate::orbit::{IonosphereTerms, NavigationFile};
use crate::orbit::{KeplerEphemeris, Products, SatelliteState};
use crate::time::GpsTime;

use random::Streams;
use satellites::SimulatedSatellite;
use shared::IonosphereProcess;

/// Broadcast ionosphere coefficients: a day of moderate solar activity.
const KLOBUCHAR: KlobucharCoefficients = KlobucharCoefficients {
    alpha: [1.3e-8, 1.5e-8, -6.0e-8, -6.0e-8],
    beta: [1.05e5, 4.9e4, -1.3e5, -2.6e5],
};

/// A prepared scenario.
#[derive(Clone, Debug)]
pub struct Simulation {
    scenario: Scenario,
    convoy: Convoy,
    ephemerides: Vec<KeplerEphemeris>,
    satellites: Vec<SimulatedSatellite>,
    ionosphere: IonosphereProcess,
}

impl Simulation {
    /// Prepares a scenario.
    ///
    /// # Errors
    ///
    /// The first invalid field of the scenario.
    pub fn new(scenario: Scenario) -> Result<Self, ScenarioError> {
        scenario.validate()?;
        let streams = Streams::new(scenario.seed);
        let ephemerides =
            constellation::ephemerides(scenario.start_gps, scenario.end_gps(), &mut streams.world());
        let (shared, duration_s) = (scenario.error_model().shared, scenario.duration_s);
        let satellites = SimulatedSatellite::group(&ephemerides, streams, &shared, duration_s);
        let ionosphere = IonosphereProcess::new(duration_s, shared.time_constant_s, streams.ionosphere());
        let convoy = Convoy::new(scenario.origin, scenario.convoy);
        Ok(Self { scenario, convoy, ephemerides, satellites, ionosphere })
    }

    /// The scenario.
    pub const fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// Vehicles of the scenario.
    pub const fn convoy(&self) -> &Convoy {
        &self.convoy
    }

    /// Names of the phones, in the order of their indices.
    pub fn phone_names(&self) -> Vec<&str> {
        self.scenario.phones.iter().map(|phone| phone.name.as_str()).collect()
    }

    /// All broadcast messages, by satellite and then by time.
    pub fn ephemerides(&self) -> &[KeplerEphemeris] {
        &self.ephemerides
    }

    /// The broadcast coefficients of the ionosphere.
    #[allow(clippy::unused_self)] // belongs to what a receiver is told
    pub const fn klobuchar(&self) -> &KlobucharCoefficients {
        &KLOBUCHAR
    }

    /// All messages for a receiver, as if read from a navigation file.
    pub fn navigation(&self) -> NavigationFile {
        NavigationFile {
            ephemerides: self.ephemerides.clone(),
            ionosphere: IonosphereTerms { gps: Some(KLOBUCHAR), ..IonosphereTerms::default() },
            leap_seconds: Some(18),
            ..NavigationFile::default()
        }
    }

    /// Products for the corrections of a receiver.
    pub fn products(&self) -> Products {
        Products::new(Vec::new(), vec![self.navigation()])
    }

    /// Satellite state by the message in force; `None` for a satellite that does not exist.
    pub fn satellite_state(&self, satellite: SatelliteId, time_gps: GpsTime) -> Option<SatelliteState> {
        let found = self.satellites.iter().find(|simulated| simulated.id() == satellite)?;
        found.state(time_gps)
    }

    /// Epochs of a phone in order of time; empty for an index without a phone.
    pub fn epochs(&self, phone: usize) -> impl Iterator<Item = SimulatedEpoch> {
        self.phone(phone).into_iter().flatten()
    }

    /// Generator of a phone's epochs.
    pub fn phone(&self, phone: usize) -> Option<PhoneEpochs<'_>> {
        self.scenario.phones.get(phone).map(|options| PhoneEpochs::new(self, phone, options))
    }

    /// True state of a phone at any instant. An index without a phone means the vehicle of that rank.
    pub fn truth_at(&self, phone: usize, time_gps: GpsTime) -> TruthState {
        let time_s = time_gps - self.scenario.start_gps;
        let options = self.scenario.phones.get(phone);
        let state = options
            .map_or_else(|| self.convoy.state(phone, time_s), |options| self.phone_state(options, time_s));
        TruthState { time_gps, position: state.position, velocity: state.velocity }
    }

    /// Truth of a phone every second from the start to the end.
    pub fn truth_table(&self, phone: usize) -> Vec<TruthState> {
        let seconds = self.scenario.duration_s.floor();
        std::iter::successors(Some(0.0), |second| Some(second + 1.0))
            .take_while(|second| *second <= seconds)
            .map(|second| self.truth_at(phone, self.scenario.start_gps + second))
            .collect()
    }

    /// Slow range bias of a satellite, the same at all phones, m; `None` for a satellite that does not exist.
    pub fn satellite_bias_m(&self, satellite: SatelliteId, time_gps: GpsTime) -> Option<f64> {
        let found = self.satellites.iter().find(|simulated| simulated.id() == satellite)?;
        Some(found.bias_m(&self.scenario.error_model().shared, time_gps - self.scenario.start_gps))
    }

    /// Ionosphere residual, the same at all phones.
    pub fn ionosphere_residual(&self, time_gps: GpsTime) -> IonosphereResidual {
        self.ionosphere.at(&self.scenario.error_model().shared, time_gps - self.scenario.start_gps)
    }

    /// State of a phone at `time_s` since the start.
    fn phone_state(&self, phone: &PhoneOptions, time_s: f64) -> VehicleState {
        let state = self.convoy.phone_state(phone.vehicle, &phone.mount, time_s);
        if phone.motion.is_none() {
            return state;
        }
        let (displacement_m, velocity_mps) = phone.motion.at(time_s);
        self.convoy.displaced(state, displacement_m, velocity_mps)
    }

    fn satellites(&self) -> &[SimulatedSatellite] {
        &self.satellites
    }

    const fn streams(&self) -> Streams {
        Streams::new(self.scenario.seed)
    }
}
