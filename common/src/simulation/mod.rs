//! A seeded, simulated convoy with truth: for demonstrations and for tests that need no files.
//!
//! A [`Scenario`] says what happens, a [`Simulation`] makes it: vehicles with one phone each follow each other on a
//! closed road, stop at lights and pass a street canyon; GPS, Galileo and BeiDou satellites are described by the same
//! broadcast messages that a receiver uses; and every phone records code and Doppler on its own time tags by its own
//! clock. The truth belongs to the true instant of reception.
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
//! Everything random follows from the seed. The constellation, each phone's clock, and each satellite at each phone
//! have ChaCha streams of their own, so results do not depend on which phone is asked first. Sines and exponentials
//! come from the platform, so two platforms may differ in the last digits.
//!
//! Not simulated: carrier phase, cycle slips, GLONASS, antenna patterns, several phones in one vehicle, errors of
//! orbits and satellite clocks, and any correlation of multipath between phones or with speed.

mod constellation;
mod convoy;
mod environment;
mod geometry;
mod observations;
mod profile;
mod receiver;
mod road;
mod satellites;
mod scenario;

pub use convoy::{Convoy, ConvoyOptions, VehicleState};
pub use environment::{Canyon, ErrorModel};
pub use observations::{Fault, PhoneEpochs, SimulatedEpoch, TruthState};
pub use receiver::{ClockOptions, ClockState, InterSystemBiases};
pub use road::{Road, RoadPoint};
pub use scenario::{PhoneOptions, Scenario, ScenarioError};

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::atmosphere::KlobucharCoefficients;
use crate::constraint::Constraint;
use crate::gnss::SatelliteId;
use crate::orbit::{KeplerEphemeris, Products, SatelliteState};
use crate::rinex::{IonosphereTerms, NavigationFile};
use crate::time::GpsTime;

use satellites::SimulatedSatellite;

/// The ionosphere that the messages tell: a day of moderate solar activity.
const KLOBUCHAR: KlobucharCoefficients = KlobucharCoefficients {
    alpha: [1.3e-8, 1.5e-8, -6.0e-8, -6.0e-8],
    beta: [1.05e5, 4.9e4, -1.3e5, -2.6e5],
};

/// A scenario at work.
#[derive(Clone, Debug)]
pub struct Simulation {
    scenario: Scenario,
    convoy: Convoy,
    ephemerides: Vec<KeplerEphemeris>,
    satellites: Vec<SimulatedSatellite>,
}

impl Simulation {
    /// Sets up a scenario.
    ///
    /// # Errors
    ///
    /// The first field of the scenario that cannot be simulated.
    pub fn new(scenario: Scenario) -> Result<Self, ScenarioError> {
        scenario.validate()?;
        let mut random = stream(scenario.seed, 0, 0);
        let ephemerides = constellation::ephemerides(scenario.start_gps, scenario.end_gps(), &mut random);
        let satellites = SimulatedSatellite::group(&ephemerides, &mut random);
        let convoy = Convoy::new(scenario.origin, scenario.convoy);
        Ok(Self { scenario, convoy, ephemerides, satellites })
    }

    /// The scenario.
    pub const fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// The vehicles.
    pub const fn convoy(&self) -> &Convoy {
        &self.convoy
    }

    /// Names of the phones in the order of the convoy; their position here is their index everywhere.
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

    /// All that a receiver is told, as if read from a navigation file.
    pub fn navigation(&self) -> NavigationFile {
        NavigationFile {
            ephemerides: self.ephemerides.clone(),
            ionosphere: IonosphereTerms { gps: Some(KLOBUCHAR), ..IonosphereTerms::default() },
            leap_seconds: Some(18),
            ..NavigationFile::default()
        }
    }

    /// The products that a receiver corrects with.
    pub fn products(&self) -> Products {
        Products::new(Vec::new(), vec![self.navigation()])
    }

    /// A satellite's state by its message in force; `None` for a satellite that does not exist.
    pub fn satellite_state(&self, satellite: SatelliteId, time_gps: GpsTime) -> Option<SatelliteState> {
        let found = self.satellites.iter().find(|simulated| simulated.id() == satellite)?;
        found.state(time_gps)
    }

    /// The epochs of a phone in order of time; none for an index without a phone.
    pub fn epochs(&self, phone: usize) -> impl Iterator<Item = SimulatedEpoch> {
        self.phone(phone).into_iter().flatten()
    }

    /// The generator of a phone's epochs.
    pub fn phone(&self, phone: usize) -> Option<PhoneEpochs<'_>> {
        self.scenario.phones.get(phone).map(|options| PhoneEpochs::new(self, phone, options))
    }

    /// Where a phone truly is at any instant.
    pub fn truth_at(&self, phone: usize, time_gps: GpsTime) -> TruthState {
        let state = self.convoy.state(phone, time_gps - self.scenario.start_gps);
        TruthState { time_gps, position: state.position, velocity: state.velocity }
    }

    /// The truth of a phone at the start and every second after it, to the end.
    pub fn truth_table(&self, phone: usize) -> Vec<TruthState> {
        let seconds = self.scenario.duration_s.floor();
        std::iter::successors(Some(0.0), |second| Some(second + 1.0))
            .take_while(|second| *second <= seconds)
            .map(|second| self.truth_at(phone, self.scenario.start_gps + second))
            .collect()
    }

    /// Constraints that the truth keeps: the distance of every pair.
    pub fn distance_constraints(&self) -> Vec<Constraint> {
        let count = self.scenario.phones.len();
        let pairs = (0..count).flat_map(|first| (first + 1..count).map(move |second| (first, second)));
        pairs
            .map(|phones| {
                let (minimum_m, maximum_m) = self.convoy.distance_bounds_m(phones.0, phones.1);
                Constraint::Distance { phones, minimum_m, maximum_m }
            })
            .collect()
    }

    /// Constraints that the truth keeps: the vertical velocity of every phone.
    pub fn vertical_velocity_constraints(&self) -> Vec<Constraint> {
        let maximum_mps = self.convoy.maximum_vertical_mps();
        (0..self.scenario.phones.len())
            .map(|phone| Constraint::VerticalVelocity { phone, maximum_mps })
            .collect()
    }

    fn satellites(&self) -> &[SimulatedSatellite] {
        &self.satellites
    }

    /// The random stream of a phone's clock (`satellite` 0) or of a satellite there (its index plus 1).
    fn random(&self, phone: usize, satellite: usize) -> ChaCha8Rng {
        stream(self.scenario.seed, phone, satellite)
    }
}

/// Streams of one seed: (0, 0) is the world's, (phone + 1, …) a phone's.
fn stream(seed: u64, phone: usize, satellite: usize) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(((phone as u64) << 16) | satellite as u64);
    random
}
