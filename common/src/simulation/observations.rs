//! Raw observations of one phone, epoch by epoch.
//!
//! At the true instant of reception t = tag − dt_r the phone is at r_k. With the path of [`super::geometry`],
//!
//! ```text
//! P   = ρ + c·(dt_r + ISB) − c·dT_s + I + T + c·TGD + signal in space + shared + reflection + multipath + outlier + noise
//! −λD = ρ̇ + c·(ḋt_r − ḋT_s) + reflection + noise
//! ```
//!
//! The reflection is that of [`super::street`] with its weight in the received signal. I and T are the delays of a receiver's models
//! (Klobuchar, and Saastamoinen with the mapping of Niell at [`STANDARD_RELATIVE_HUMIDITY`]), times a scale different from one.

use std::f64::consts::PI;

use rand_chacha::ChaCha8Rng;

use crate::atmosphere::{
    STANDARD_RELATIVE_HUMIDITY, Troposphere, TroposphereMapping, klobuchar_delay_l1_m, scale_from_l1,
};
use crate::constants::SPEED_OF_LIGHT_MPS;
use crate::frames::{Direction, Ecef, EcefVector, LocalFrame};
use crate::gnss::{
    ClockGroup, EpochFlag, LossOfLock, Observation, ObservationEpoch, SatelliteId, SignalCode,
};
use crate::measurement::beidou2_code_correction_m;
use crate::time::GpsTime;

use super::Simulation;
use super::environment::{ErrorModel, Mixture};
use super::geometry::{Path, path};
use super::receiver::{ClockState, InterSystemBiases};
use super::satellites::SimulatedSatellite;
use super::scenario::PhoneOptions;
use super::shared::{SharedErrors, ZENITH};
use super::street::{Facades, Surroundings};
use super::tracks::{Draws, SharedTrack, Track};

/// C/N0 below which a signal is lost, dB-Hz.
const LOST_BELOW_DBHZ: f64 = 18.0;
/// Loss of a passing reflection, dB.
const PASSING_LOSS_DB: f64 = 8.0;

/// True state of a phone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TruthState {
    /// Time of the state, GPS time.
    pub time_gps: GpsTime,
    /// Position, m.
    pub position: Ecef,
    /// Velocity, m/s.
    pub velocity: EcefVector,
}

/// A satellite that was received by reflection only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GrossError {
    /// The satellite.
    pub satellite: SatelliteId,
    /// Error on all its pseudoranges, m.
    pub error_m: f64,
}

/// An epoch with its truth.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulatedEpoch {
    /// The raw observations, ordered by satellite.
    pub epoch: ObservationEpoch,
    /// Truth at the instant of reception, which is the time tag minus the clock bias.
    pub truth: TruthState,
    /// The phone's clock.
    pub clock: ClockState,
    /// Satellites in `epoch` with a gross error.
    pub faults: Vec<GrossError>,
    /// Whether there were houses directly beside the phone.
    pub in_canyon: bool,
}

/// Iterator over the epochs of one phone.
pub struct PhoneEpochs<'a> {
    simulation: &'a Simulation,
    phone: &'a PhoneOptions,
    errors: ErrorModel,
    biases: InterSystemBiases,
    clock: ClockState,
    clock_random: ChaCha8Rng,
    tracks: Vec<Track>,
    shared: Vec<SharedTrack>,
    next_tag_s: f64,
    last_tag_s: f64,
    tag_index: f64,
}

/// Data common to all satellites of an epoch.
struct Instant<'a> {
    epochs: &'a PhoneEpochs<'a>,
    truth: TruthState,
    clock: ClockState,
    frame: LocalFrame,
    troposphere: Troposphere,
    surroundings: Surroundings<'a>,
    heading_rad: f64,
}

/// Reception of a satellite by a phone at one instant, on all signals.
struct Reception {
    path: Path,
    direction: Direction,
    mixture: Mixture,
    /// Delay by façades and passing reflections, m.
    late_m: f64,
    /// Rate of the delay by façades, m/s.
    late_mps: f64,
}

impl<'a> PhoneEpochs<'a> {
    pub(super) fn new(simulation: &'a Simulation, index: usize, phone: &'a PhoneOptions) -> Self {
        let scenario = simulation.scenario();
        let streams = simulation.streams();
        let errors = scenario.error_model();
        let mut clock_random = streams.phone(index);
        let biases = InterSystemBiases::draw(&mut clock_random);
        let satellites = 0..simulation.satellites().len();
        let tracks = satellites.clone().map(|satellite| Track::start(streams.satellite(index, satellite)));
        let shared =
            satellites.map(|satellite| SharedTrack::start(streams.vehicle(phone.vehicle, satellite)));
        let tag_index = (phone.starts_after_s / scenario.interval_s).ceil();
        Self {
            simulation,
            phone,
            errors,
            biases,
            clock: phone.clock.into(),
            clock_random,
            tracks: tracks.collect(),
            shared: shared.collect(),
            next_tag_s: tag_index * scenario.interval_s + phone.epoch_offset_s,
            last_tag_s: scenario.duration_s - phone.stops_before_s,
            tag_index,
        }
    }

    /// Random draws of all satellites, with the vehicle's part of the multipath.
    fn draw(&mut self) -> Vec<Draws> {
        let (step_s, time_s) = (self.simulation.scenario().interval_s, self.next_tag_s);
        let (own, common) =
            ((1.0 - self.errors.multipath_shared).sqrt(), self.errors.multipath_shared.sqrt());
        let with_shared = |(track, shared): (&mut Track, &mut SharedTrack)| {
            let shared = shared.advance_to(time_s, step_s, &self.errors);
            let mut draws = track.advance(step_s, &self.errors);
            for (multipath, of_vehicle) in draws.multipath.iter_mut().zip(shared) {
                *multipath = own * *multipath + common * of_vehicle;
            }
            draws
        };
        self.tracks.iter_mut().zip(&mut self.shared).map(with_shared).collect()
    }

    /// Biases of the phone's constellations and bands.
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
        let draws = self.draw();
        let scenario = self.simulation.scenario();
        let received_s = self.next_tag_s - self.clock.bias_s;
        let state = self.simulation.phone_state(self.phone, received_s);
        let surroundings = Surroundings::at(&scenario.canyons, state.place);
        let in_canyon = surroundings.in_canyon();
        let (time_gps, frame) = (scenario.start_gps + received_s, LocalFrame::at(state.position));
        let instant = Instant {
            truth: TruthState { time_gps, position: state.position, velocity: state.velocity },
            clock: self.clock,
            troposphere: troposphere_at(&frame, time_gps),
            frame,
            surroundings,
            heading_rad: state.place.heading_rad,
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

/// The troposphere of a receiver's model by default.
fn troposphere_at(frame: &LocalFrame, time_gps: GpsTime) -> Troposphere {
    Troposphere::at(frame.geodetic(), time_gps, TroposphereMapping::default(), STANDARD_RELATIVE_HUMIDITY)
}

impl Instant<'_> {
    /// Appends the phone's observations of a satellite: none if it is hidden or too weak.
    fn observe(
        &self,
        satellite: &SimulatedSatellite,
        draws: &Draws,
        observations: &mut Vec<Observation>,
        faults: &mut Vec<GrossError>,
    ) {
        let Some(reception) = self.reception(satellite, draws) else { return };
        let before = observations.len();
        for (band, signal) in satellite.signals(self.epochs.phone.dual_frequency).enumerate() {
            observations.extend(self.signal(satellite, signal, band, &reception, draws));
        }
        let reflected_only = draws.outlier_m != 0.0 || reception.mixture.delayed == 1.0;
        if reflected_only && observations.len() > before {
            faults.push(GrossError { satellite: satellite.id(), error_m: reception.late_m });
        }
    }

    /// Reception of a satellite, directly, by reflection on the other side of the street, or both; `None` without reception.
    fn reception(&self, satellite: &SimulatedSatellite, draws: &Draws) -> Option<Reception> {
        let TruthState { time_gps, position, velocity } = self.truth;
        if !satellite.may_be_above_horizon(time_gps, &self.frame) {
            return None;
        }
        let path = path(time_gps, position, velocity, |time| satellite.state(time))?;
        let direction = self.frame.direction(&path.unit);
        let PhoneEpochs { simulation, phone, errors, .. } = self.epochs;
        let facades = Facades { streams: simulation.streams(), reflecting: errors.facades_reflecting };
        let reflection = self.surroundings.reflection(direction, &facades);
        let body_db = |from| phone.mount.loss_db(self.heading_rad, from);
        let direct_db = self.surroundings.is_visible(direction).then(|| body_db(direction));
        let reflected_db = reflection.map(|reflection| reflection.loss_db + body_db(reflection.from));
        let mixture = Mixture::of(direct_db, reflected_db, PI * draws.phase)?;
        let (excess_m, excess_mps) =
            reflection.map_or((0.0, 0.0), |reflection| (reflection.excess_m, reflection.excess_mps));
        Some(Reception {
            path,
            direction,
            mixture,
            late_m: mixture.delayed * excess_m + draws.outlier_m,
            late_mps: mixture.delayed * excess_mps,
        })
    }

    fn signal(
        &self,
        satellite: &SimulatedSatellite,
        signal: SignalCode,
        band: usize,
        reception: &Reception,
        draws: &Draws,
    ) -> Option<Observation> {
        let errors = &self.epochs.errors;
        let Reception { path, direction, .. } = reception;
        let cn0_dbhz = self.cn0_dbhz(reception, band, draws);
        let constellation = satellite.id().constellation;
        let wavelength_m = signal.wavelength_m(constellation, None)?;
        if cn0_dbhz < LOST_BELOW_DBHZ {
            return None;
        }
        let group = ClockGroup { constellation, band: signal.band };
        let clock_m = SPEED_OF_LIGHT_MPS * (self.clock.bias_s + self.epochs.biases.of(group) - path.clock_s);
        let frequency_hz = SPEED_OF_LIGHT_MPS / wavelength_m;
        let delays_m = self.atmosphere_m(*direction, frequency_hz)
            + self.shared_m(satellite, *direction, frequency_hz)
            + satellite.group_delay_m(signal, errors.l5_delay_m)
            - beidou2_code_correction_m(satellite.id(), signal, direction.elevation_rad)
            + satellite.signal_in_space_m(errors.signal_in_space_m);
        let in_canyon = self.surroundings.in_canyon();
        // chipping rate ten times as high: a third of the noise, half of the multipath
        let (noise_scale, multipath_scale) = if band == 0 { (1.0, 1.0) } else { (0.35, 0.5) };
        let pick = |values: [f64; 2]| values.get(band).copied().unwrap_or(0.0);
        let error_m = reception.late_m
            + pick(draws.multipath)
                * multipath_scale
                * errors.multipath_sigma_m(direction.elevation_rad, in_canyon)
            + pick(draws.code_noise) * noise_scale * errors.code_sigma_m(cn0_dbhz);
        let rate_mps = path.range_rate_mps
            + SPEED_OF_LIGHT_MPS * (self.clock.drift_sps - path.clock_drift_sps)
            + reception.late_mps
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

    /// Slow errors that all phones have alike, m.
    fn shared_m(&self, satellite: &SimulatedSatellite, direction: Direction, frequency_hz: f64) -> f64 {
        let PhoneEpochs { simulation, errors, .. } = self.epochs;
        if errors.shared == SharedErrors::NONE {
            return 0.0;
        }
        let (receiver, time_gps) = (self.frame.geodetic(), self.truth.time_gps);
        let vertical_m = klobuchar_delay_l1_m(simulation.klobuchar(), receiver, ZENITH, time_gps);
        let residual = simulation.ionosphere_residual(time_gps);
        let ionosphere_m = residual.delay_l1_m(vertical_m, receiver, direction);
        let bias_m = satellite.bias_m(&errors.shared, time_gps - simulation.scenario().start_gps);
        bias_m + scale_from_l1(ionosphere_m, frequency_hz)
    }

    /// True delays of ionosphere and troposphere, m.
    fn atmosphere_m(&self, direction: Direction, frequency_hz: f64) -> f64 {
        let errors = &self.epochs.errors;
        let receiver = self.frame.geodetic();
        let coefficients = self.epochs.simulation.klobuchar();
        let l1_m = klobuchar_delay_l1_m(coefficients, receiver, direction, self.truth.time_gps);
        errors.ionosphere_scale * scale_from_l1(l1_m, frequency_hz)
            + errors.troposphere_scale * self.troposphere.delay_m(direction)
    }

    /// C/N0 from about 33 dB-Hz at the horizon to 47 dB-Hz at the zenith for an average phone under an open sky.
    fn cn0_dbhz(&self, reception: &Reception, band: usize, draws: &Draws) -> f64 {
        let shadowing_db = draws.shadowing * self.epochs.errors.shadowing_db;
        let surroundings_db = if self.surroundings.in_canyon() { 2.0 * shadowing_db } else { shadowing_db };
        let passing_db = if draws.outlier_m == 0.0 { 0.0 } else { -PASSING_LOSS_DB };
        let band_db = if band == 0 { 0.0 } else { -1.5 };
        33.0 + 14.0 * reception.direction.elevation_rad.sin().max(0.0).powf(0.7)
            + self.epochs.phone.antenna_db
            + reception.mixture.gain_db
            + surroundings_db
            + passing_db
            + band_db
    }
}
