//! Raw observations of one phone, epoch by epoch.
//!
//! At the true instant of reception t = tag − dt_r the phone is at r_k. With the path of [`super::geometry`],
//!
//! ```text
//! P   = ρ + c·(dt_r + ISB) − c·dT_s + I + T + c·TGD + multipath + outlier + noise
//! −λD = ρ̇ + c·(ḋt_r − ḋT_s) + noise
//! ```
//!
//! I and T are the delays of the models that a receiver corrects with (Klobuchar, and Saastamoinen at
//! [`STANDARD_RELATIVE_HUMIDITY`]), times a scale that is not one.

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use crate::atmosphere::{
    STANDARD_RELATIVE_HUMIDITY, klobuchar_delay_l1_m, saastamoinen_delay_m, scale_from_l1,
};
use crate::constants::SPEED_OF_LIGHT_MPS;
use crate::frames::{Direction, Ecef, EcefVector, LocalFrame};
use crate::gnss::{
    ClockGroup, EpochFlag, LossOfLock, Observation, ObservationEpoch, SatelliteId, SignalCode,
};
use crate::time::GpsTime;

use super::Simulation;
use super::environment::{ErrorModel, GaussMarkov, Outlier, Surroundings};
use super::geometry::{Path, path};
use super::receiver::{ClockState, InterSystemBiases};
use super::satellites::SimulatedSatellite;
use super::scenario::PhoneOptions;

/// C/N0 below which a signal is lost, dB-Hz.
const LOST_BELOW_DBHZ: f64 = 18.0;
/// Loss of a signal that arrives by reflection only, dB.
const REFLECTION_LOSS_DB: f64 = 8.0;
/// Correlation time of the shadowing, s.
const SHADOWING_CORRELATION_S: f64 = 5.0;

/// Where a phone truly was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TruthState {
    /// The instant, GPS time.
    pub time_gps: GpsTime,
    /// Position, m.
    pub position: Ecef,
    /// Velocity, m/s.
    pub velocity: EcefVector,
}

/// A satellite that was received by reflection only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fault {
    /// The satellite.
    pub satellite: SatelliteId,
    /// The error on all its pseudoranges, m.
    pub error_m: f64,
}

/// An epoch with what only a simulation knows.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulatedEpoch {
    /// The raw observations, in the order of satellites.
    pub epoch: ObservationEpoch,
    /// The truth at the instant of reception, which is the time tag minus the clock bias.
    pub truth: TruthState,
    /// The phone's clock.
    pub clock: ClockState,
    /// Satellites in `epoch` with a gross error.
    pub faults: Vec<Fault>,
    /// Whether the phone was in a canyon.
    pub in_canyon: bool,
}

/// The random processes of one satellite at one phone. It has a random stream of its own and draws equally often
/// whatever happens, so that what blocks one satellite changes nothing for the others.
struct Track {
    random: ChaCha8Rng,
    shadowing: GaussMarkov,
    multipath: [GaussMarkov; 2],
    outlier: Outlier,
}

/// What the processes of a satellite give at one epoch.
struct Draws {
    shadowing: f64,
    multipath: [f64; 2],
    outlier_m: f64,
    code_noise: [f64; 2],
    rate_noise: [f64; 2],
}

/// Iterator over the epochs of one phone.
pub struct PhoneEpochs<'a> {
    simulation: &'a Simulation,
    phone: &'a PhoneOptions,
    vehicle: usize,
    errors: ErrorModel,
    biases: InterSystemBiases,
    clock: ClockState,
    clock_random: ChaCha8Rng,
    tracks: Vec<Track>,
    next_tag_s: f64,
    last_tag_s: f64,
    tag_index: f64,
}

/// Everything about one epoch that its satellites share.
struct Instant<'a> {
    epochs: &'a PhoneEpochs<'a>,
    truth: TruthState,
    clock: ClockState,
    frame: LocalFrame,
    surroundings: Surroundings,
}

impl Track {
    fn start(mut random: ChaCha8Rng) -> Self {
        let shadowing = GaussMarkov::start(&mut random);
        let multipath = [GaussMarkov::start(&mut random), GaussMarkov::start(&mut random)];
        Self { random, shadowing, multipath, outlier: Outlier::default() }
    }

    fn advance(&mut self, step_s: f64, errors: &ErrorModel, in_canyon: bool) -> Draws {
        let random = &mut self.random;
        let rate_hz = if in_canyon { errors.outliers_canyon_hz } else { errors.outliers_open_hz };
        let mut normal = |_| random.sample::<f64, _>(StandardNormal);
        let (code_noise, rate_noise) = ([0, 1].map(&mut normal), [0, 1].map(&mut normal));
        Draws {
            shadowing: self.shadowing.advance(step_s, SHADOWING_CORRELATION_S, random),
            multipath: self
                .multipath
                .each_mut()
                .map(|process| process.advance(step_s, errors.multipath_correlation_s, random)),
            outlier_m: self.outlier.advance(step_s, rate_hz, random),
            code_noise,
            rate_noise,
        }
    }
}

impl<'a> PhoneEpochs<'a> {
    pub(super) fn new(simulation: &'a Simulation, vehicle: usize, phone: &'a PhoneOptions) -> Self {
        let scenario = simulation.scenario();
        let mut clock_random = simulation.random(vehicle + 1, 0);
        let biases = InterSystemBiases::draw(&mut clock_random);
        let tracks = (0..simulation.satellites().len())
            .map(|satellite| Track::start(simulation.random(vehicle + 1, satellite + 1)))
            .collect();
        let tag_index = (phone.starts_after_s / scenario.interval_s).ceil();
        Self {
            simulation,
            phone,
            vehicle,
            errors: scenario.error_model(),
            biases,
            clock: phone.clock.into(),
            clock_random,
            tracks,
            next_tag_s: tag_index * scenario.interval_s + phone.epoch_offset_s,
            last_tag_s: scenario.duration_s - phone.stops_before_s,
            tag_index,
        }
    }

    /// The phone's biases of constellations and bands.
    pub const fn inter_system_biases(&self) -> &InterSystemBiases {
        &self.biases
    }
}

impl Iterator for PhoneEpochs<'_> {
    type Item = SimulatedEpoch;

    fn next(&mut self) -> Option<SimulatedEpoch> {
        if self.next_tag_s > self.last_tag_s {
            return None;
        }
        let scenario = self.simulation.scenario();
        let convoy = self.simulation.convoy();
        let received_s = self.next_tag_s - self.clock.bias_s;
        let vehicle = convoy.state(self.vehicle, received_s);
        let lap_m = convoy.road().lap_m();
        let surroundings = Surroundings::at(&scenario.canyons, vehicle.road_m, lap_m, vehicle.heading_rad);
        let in_canyon = surroundings.in_canyon();
        let draws: Vec<Draws> = self
            .tracks
            .iter_mut()
            .map(|track| track.advance(scenario.interval_s, &self.errors, in_canyon))
            .collect();
        let instant = Instant {
            truth: TruthState {
                time_gps: scenario.start_gps + received_s,
                position: vehicle.position,
                velocity: vehicle.velocity,
            },
            clock: self.clock,
            frame: LocalFrame::at(vehicle.position),
            surroundings,
            epochs: self,
        };
        let mut observations = Vec::with_capacity(48);
        let mut faults = Vec::new();
        for (satellite, draws) in self.simulation.satellites().iter().zip(&draws) {
            instant.observe(satellite, draws, &mut observations, &mut faults);
        }
        let truth = instant.truth;
        let epoch = ObservationEpoch {
            time_gps: scenario.start_gps + self.next_tag_s,
            flag: EpochFlag::Ok,
            observations,
        };
        let simulated = SimulatedEpoch { epoch, truth, clock: self.clock, faults, in_canyon };
        self.clock = self.clock.advance(scenario.interval_s, &mut self.clock_random);
        self.tag_index += 1.0;
        self.next_tag_s = self.tag_index * scenario.interval_s + self.phone.epoch_offset_s;
        Some(simulated)
    }
}

impl Instant<'_> {
    /// Appends what the phone records of a satellite: nothing when it is hidden or too weak.
    fn observe(
        &self,
        satellite: &SimulatedSatellite,
        draws: &Draws,
        observations: &mut Vec<Observation>,
        faults: &mut Vec<Fault>,
    ) {
        let TruthState { time_gps, position, velocity } = self.truth;
        if !satellite.may_be_above_horizon(time_gps, &self.frame) {
            return;
        }
        let Some(path) = path(time_gps, position, velocity, |time| satellite.state(time)) else { return };
        let direction = self.frame.direction(&path.unit);
        if !self.surroundings.is_visible(direction) {
            return;
        }
        let before = observations.len();
        for (band, signal) in satellite.signals(self.epochs.phone.dual_frequency).enumerate() {
            observations.extend(self.signal(satellite, signal, band, (&path, direction), draws));
        }
        if draws.outlier_m != 0.0 && observations.len() > before {
            faults.push(Fault { satellite: satellite.id(), error_m: draws.outlier_m });
        }
    }

    fn signal(
        &self,
        satellite: &SimulatedSatellite,
        signal: SignalCode,
        band: usize,
        (path, direction): (&Path, Direction),
        draws: &Draws,
    ) -> Option<Observation> {
        let errors = &self.epochs.errors;
        let cn0_dbhz = self.cn0_dbhz(direction, band, draws);
        let constellation = satellite.id().constellation;
        let wavelength_m = signal.wavelength_m(constellation, None)?;
        if cn0_dbhz < LOST_BELOW_DBHZ {
            return None;
        }
        let group = ClockGroup { constellation, band: signal.band };
        let clock_m = SPEED_OF_LIGHT_MPS * (self.clock.bias_s + self.epochs.biases.of(group) - path.clock_s);
        let delays_m = self.atmosphere_m(direction, SPEED_OF_LIGHT_MPS / wavelength_m)
            + satellite.group_delay_m(signal, errors.l5_delay_m);
        let in_canyon = self.surroundings.in_canyon();
        // a code ten times as fast: a third of the noise, half of the multipath
        let (noise_scale, multipath_scale) = if band == 0 { (1.0, 1.0) } else { (0.35, 0.5) };
        let pick = |values: [f64; 2]| values.get(band).copied().unwrap_or(0.0);
        let error_m = draws.outlier_m
            + pick(draws.multipath)
                * multipath_scale
                * errors.multipath_sigma_m(direction.elevation_rad, in_canyon)
            + pick(draws.code_noise) * noise_scale * errors.code_sigma_m(cn0_dbhz);
        let rate_mps = path.range_rate_mps
            + SPEED_OF_LIGHT_MPS * (self.clock.drift_sps - path.clock_drift_sps)
            + pick(draws.rate_noise) * errors.rate_sigma_mps(cn0_dbhz);
        Some(Observation {
            satellite: satellite.id(),
            signal,
            pseudorange_m: Some(path.range_m + clock_m + delays_m + error_m),
            carrier_phase_cycles: None,
            doppler_hz: Some(-rate_mps / wavelength_m),
            cn0_dbhz: Some(cn0_dbhz),
            loss_of_lock: LossOfLock::default(),
        })
    }

    /// True delays of ionosphere and troposphere, m.
    fn atmosphere_m(&self, direction: Direction, frequency_hz: f64) -> f64 {
        let errors = &self.epochs.errors;
        let receiver = self.frame.geodetic();
        let coefficients = self.epochs.simulation.klobuchar();
        let l1_m = klobuchar_delay_l1_m(coefficients, receiver, direction, self.truth.time_gps);
        errors.ionosphere_scale * scale_from_l1(l1_m, frequency_hz)
            + errors.troposphere_scale * saastamoinen_delay_m(receiver, direction, STANDARD_RELATIVE_HUMIDITY)
    }

    /// From about 35 dB-Hz at the horizon to 47 dB-Hz at the zenith, less in a canyon.
    fn cn0_dbhz(&self, direction: Direction, band: usize, draws: &Draws) -> f64 {
        let shadowing_db = draws.shadowing * self.epochs.errors.shadowing_db;
        let surroundings_db =
            if self.surroundings.in_canyon() { 4.0 * shadowing_db - 3.0 } else { shadowing_db };
        let reflection_db = if draws.outlier_m == 0.0 { 0.0 } else { -REFLECTION_LOSS_DB };
        let band_db = if band == 0 { 0.0 } else { -1.5 };
        33.0 + 14.0 * direction.elevation_rad.sin().max(0.0).powf(0.7)
            + self.epochs.phone.antenna_db
            + surroundings_db
            + reflection_db
            + band_db
    }
}
