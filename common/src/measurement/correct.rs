//! Corrections of raw pseudoranges and Dopplers:
//! P_c = P + c·dT_s − I − T + group delay correction, and the rate −λD + c·dṪ_s.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::beidou2::beidou2_code_correction_m;
use super::exclusion::{Exclusion, Exclusions};
use super::given::RecordedObservation;
use super::pair::Ionosphere;
use super::prepared::PreparedObservation;
use super::{Carrier, CorrectedObservation, RangeRate, SharedError, StochasticModel, Usage};
use crate::atmosphere::{STANDARD_RELATIVE_HUMIDITY, Troposphere, TroposphereMapping};
use crate::constants::{EARTH_ROTATION_RADPS, SPEED_OF_LIGHT_MPS};
use crate::frames::{Direction, Ecef, EcefVector, LocalFrame};
use crate::gnss::{Constellation, Observation, ObservationEpoch, SignalKey};
use crate::orbit::{
    BroadcastAccuracy, ClockReference, IonosphereDelay, LineOfSight, OrbitError, Products, SatelliteState,
};
use crate::skips::{Reason, Skips};
use crate::time::GpsTime;

/// Share of [`CorrectionOptions::beidou_bias_sigma_m`] on broadcast clocks, to which BeiDou's group delays belong.
const BEIDOU_BROADCAST_SHARE: f64 = 0.5;

/// Masks and models of the corrections.
#[derive(Clone, Debug, PartialEq)]
pub struct CorrectionOptions {
    /// Elevation mask, rad.
    pub elevation_mask_rad: f64,
    /// Elevation mask, rad, of satellites with tropospheric delays in the recording. The other mask is higher because low signals are noisy and
    /// reflected: on a recorded drive a mask of 5° instead of 7.5° changes the error of 95 % of the epochs from 8.0 to 9.0 m.
    pub stated_elevation_mask_rad: f64,
    /// Treatment of the ionospheric delay.
    pub ionosphere: Ionosphere,
    /// C/N0 mask, dB-Hz.
    pub minimum_cn0_dbhz: f64,
    /// Excluded constellations, satellites and signals.
    pub exclude: Vec<Exclusion>,
    /// Variances of code and Doppler.
    pub stochastic: StochasticModel,
    /// Standard deviation of a signal whose group delay is in no product, m.
    pub unknown_group_delay_sigma_m: f64,
    /// How large filters take the errors of broadcast orbits and clocks to be. Epoch-wise solutions and their tests rest on what is stated.
    pub broadcast_accuracy: BroadcastAccuracy,
    /// Standard deviation of BeiDou's clocks and group delays together, m, on precise clocks; half on broadcast ones. It is larger than for the
    /// other systems: TGD1 enters B1I with a factor of 1.94 on precise clocks, and receivers treat second- and third-generation satellites
    /// differently.
    pub beidou_bias_sigma_m: f64,
    /// Whether the variation of BeiDou-2's B1I pseudoranges with elevation is corrected, as by default. On four recorded drives it changes
    /// horizontal errors by at most 0.04 m, three of them to the better.
    pub beidou2_code_bias: bool,
    /// Standard deviation of GLONASS' biases between frequency channels, m. All channels of a band share one receiver
    /// clock here, but their delays in the receiver's filters differ, by metres in cheap receivers.
    pub glonass_bias_sigma_m: f64,
    /// Mapping function of the tropospheric delay.
    pub troposphere_mapping: TroposphereMapping,
    /// Relative humidity of the standard atmosphere, 0-1.
    pub relative_humidity: f64,
}

impl Default for CorrectionOptions {
    fn default() -> Self {
        Self {
            elevation_mask_rad: 7.5_f64.to_radians(),
            stated_elevation_mask_rad: 0.0,
            ionosphere: Ionosphere::default(),
            minimum_cn0_dbhz: 15.0,
            exclude: Vec::new(),
            stochastic: StochasticModel::default(),
            unknown_group_delay_sigma_m: 2.0,
            broadcast_accuracy: BroadcastAccuracy::default(),
            beidou_bias_sigma_m: 2.0,
            beidou2_code_bias: true,
            glonass_bias_sigma_m: 3.0,
            troposphere_mapping: TroposphereMapping::default(),
            relative_humidity: STANDARD_RELATIVE_HUMIDITY,
        }
    }
}

/// Corrects the epochs of one phone and counts the observations that it skips.
#[derive(Clone, Debug)]
pub struct Corrector {
    products: Arc<Products>,
    options: CorrectionOptions,
    exclusions: Exclusions,
    pub(super) skips: Skips,
}

impl Corrector {
    /// A corrector with the given products.
    pub fn new(products: Arc<Products>, options: CorrectionOptions) -> Self {
        let exclusions = Exclusions::new(&options.exclude);
        Self { products, options, exclusions, skips: Skips::default() }
    }

    /// Replaces the products, for example after new navigation messages.
    pub fn set_products(&mut self, products: Arc<Products>) {
        self.products = products;
    }

    /// The products in use.
    pub const fn products(&self) -> &Arc<Products> {
        &self.products
    }

    /// Counts of skips in [`Corrector::prepare`] by reason.
    pub const fn skips(&self) -> &Skips {
        &self.skips
    }

    /// Members of [`CorrectionOptions::exclude`] that have named no observation so far.
    pub fn idle_exclusions(&self) -> impl Iterator<Item = Exclusion> {
        self.exclusions.idle()
    }

    /// Satellite states and position-independent corrections of one epoch; unusable observations are counted.
    pub fn prepare(&mut self, epoch: &ObservationEpoch) -> Vec<PreparedObservation> {
        self.prepare_stated(epoch, |_| None)
    }

    /// The same for a recording with additional data: `stated` returns the data on the observation at an index. The receiver's standard
    /// deviation of a code replaces the stochastic model without a C/N0. The recording's satellite state is used if no product has one.
    pub(super) fn prepare_stated<'a>(
        &mut self,
        epoch: &ObservationEpoch,
        stated: impl Fn(usize) -> Option<&'a RecordedObservation>,
    ) -> Vec<PreparedObservation> {
        let mut prepared = Vec::with_capacity(epoch.observations.len());
        let mut last: Option<PreparedState> = None;
        for (index, observation) in epoch.observations.iter().enumerate() {
            if self.is_excluded(observation, epoch.time_gps) {
                continue;
            }
            let Some(pseudorange_m) = observation.pseudorange_m else {
                self.skips.add(Reason::NoPseudorange, || {
                    format!("{} {} at {}", observation.satellite, observation.signal, epoch.time_gps)
                });
                continue;
            };
            if self.is_weak(observation, epoch.time_gps) {
                continue;
            }
            let stated = stated(index);
            let state = match last {
                Some(known) if known.serves(observation, pseudorange_m) => known,
                _ => match self.state(observation, epoch.time_gps, pseudorange_m) {
                    Ok(state) => state,
                    Err(error) => {
                        prepared.extend(self.without_state(&error, epoch.time_gps, stated));
                        continue;
                    }
                },
            };
            last = Some(state);
            let Some(frequency_hz) = self.frequency_hz(observation, epoch.time_gps) else {
                self.no_carrier_frequency(observation, epoch.time_gps);
                continue;
            };
            let by_products = self.prepare_by_products(observation, frequency_hz, pseudorange_m, &state);
            let code_sigma_m = stated.and_then(|stated| stated.given?.code_sigma_m);
            prepared.push(PreparedObservation { code_sigma_m, ..by_products });
        }
        self.pairs(prepared)
    }

    /// An observation of a satellite without a state in the products, with the recording's state, if there is one.
    fn without_state(
        &mut self,
        error: &OrbitError,
        time_gps: GpsTime,
        stated: Option<&RecordedObservation>,
    ) -> Option<PreparedObservation> {
        // A satellite with an unhealthy navigation message is not used, whatever the recording states.
        let stated = stated.filter(|_| !matches!(error, OrbitError::Unhealthy { .. }));
        let Some((stated, given)) = stated.and_then(|stated| Some((stated, stated.given?))) else {
            self.skips.add(Reason::NoSatelliteState, || error.to_string());
            return None;
        };
        self.skips.add(Reason::RecordedSatelliteStateUsed, || {
            format!("{} at {time_gps}", stated.observation.satellite)
        });
        self.prepare_given(&stated.observation, stated.frequency_hz, time_gps, &given)
    }

    /// Replaces prepared signals by ionosphere-free pairs, if the options say so.
    pub(crate) fn pairs(&mut self, prepared: Vec<PreparedObservation>) -> Vec<PreparedObservation> {
        self.options.ionosphere.form_pairs(prepared, &mut self.skips)
    }

    /// Carrier frequency; that of GLONASS by the channel in the navigation messages.
    fn frequency_hz(&self, observation: &Observation, time_gps: GpsTime) -> Option<f64> {
        let satellite = observation.satellite;
        let channel = self.products.glonass_channel(satellite, time_gps);
        observation.signal.frequency_hz(satellite.constellation, channel)
    }

    /// Whether a mask excludes an observation; counts it.
    pub(super) fn is_excluded(&mut self, observation: &Observation, time_gps: GpsTime) -> bool {
        let Some(exclusion) = self.exclusions.first(observation) else { return false };
        self.skips.add_about(Reason::ExcludedByMask, exclusion, || {
            format!("{} {} at {time_gps}", observation.satellite, observation.signal)
        });
        true
    }

    /// Whether a signal is below the C/N0 mask; counts it.
    pub(super) fn is_weak(&mut self, observation: &Observation, time_gps: GpsTime) -> bool {
        let weak = observation.cn0_dbhz.is_some_and(|cn0| cn0 < self.options.minimum_cn0_dbhz);
        if weak {
            self.skips.add(Reason::Cn0BelowMask, || {
                format!("{} {} at {time_gps}", observation.satellite, observation.signal)
            });
        }
        weak
    }

    pub(super) fn no_carrier_frequency(&mut self, observation: &Observation, time_gps: GpsTime) {
        self.skips.add(Reason::NoCarrierFrequency, || {
            format!("{} {} at {time_gps}", observation.satellite, observation.signal)
        });
    }

    /// Usual variance of orbit, clock and group delay, m².
    fn usual_variance_m2(&self, observation: &Observation, state: &SatelliteState) -> f64 {
        let beidou_m2 = self.beidou_variance_m2(observation);
        match state.clock_reference {
            ClockReference::IonosphereFree => state.sigma_m.powi(2) + beidou_m2,
            ClockReference::Broadcast => {
                let sigma_m = self.options.broadcast_accuracy.sigma_m(observation.satellite, state.sigma_m);
                sigma_m.powi(2) + BEIDOU_BROADCAST_SHARE.powi(2) * beidou_m2
            }
        }
    }

    /// Additional variance of BeiDou's clocks and group delays, m².
    pub(super) fn beidou_variance_m2(&self, observation: &Observation) -> f64 {
        let is_beidou = observation.satellite.constellation == Constellation::Beidou;
        if is_beidou { self.options.beidou_bias_sigma_m.powi(2) } else { 0.0 }
    }

    /// Additional variance of GLONASS' frequency channels, m².
    pub(super) fn glonass_variance_m2(&self, observation: &Observation) -> f64 {
        let is_glonass = observation.satellite.constellation == Constellation::Glonass;
        if is_glonass { self.options.glonass_bias_sigma_m.powi(2) } else { 0.0 }
    }

    /// Satellite state at transmission: t_tx = t_rx − P/c − dT_s.
    fn state(
        &self,
        observation: &Observation,
        time_gps: GpsTime,
        pseudorange_m: f64,
    ) -> Result<PreparedState, OrbitError> {
        let by_satellite_clock = time_gps - pseudorange_m / SPEED_OF_LIGHT_MPS;
        let state = self.products.satellite_state(observation.satellite, by_satellite_clock)?;
        // dT_s is below a few milliseconds, so one step along the velocity is exact to a micrometre.
        let position = state.position + EcefVector(state.velocity.0 * -state.clock_s);
        Ok(PreparedState {
            satellite_state: SatelliteState { position, ..state },
            observation: *observation,
            sent: by_satellite_clock,
        })
    }

    fn prepare_by_products(
        &mut self,
        observation: &Observation,
        frequency_hz: f64,
        pseudorange_m: f64,
        prepared: &PreparedState,
    ) -> PreparedObservation {
        let state = &prepared.satellite_state;
        let group_delay_m = self.products.group_delay_correction_m(
            observation.satellite,
            observation.signal,
            state.clock_reference,
            prepared.sent,
        );
        let unknown_m = self.options.unknown_group_delay_sigma_m;
        if group_delay_m.is_none() {
            self.skips.add(Reason::GroupDelayUnknown, || {
                format!("{} {}", observation.satellite, observation.signal)
            });
        }
        let wavelength_m = SPEED_OF_LIGHT_MPS / frequency_hz;
        PreparedObservation {
            observation: *observation,
            frequency_hz,
            pseudorange_m: pseudorange_m + SPEED_OF_LIGHT_MPS * state.clock_s + group_delay_m.unwrap_or(0.0),
            range_rate_mps: observation
                .doppler_hz
                .map(|doppler| -wavelength_m * doppler + SPEED_OF_LIGHT_MPS * state.clock_drift_sps),
            phase_m: observation
                .carrier_phase_cycles
                .map(|cycles| wavelength_m * cycles + SPEED_OF_LIGHT_MPS * state.clock_s),
            position: state.position,
            velocity: state.velocity,
            satellite_variance_m2: state.sigma_m.powi(2) + self.beidou_variance_m2(observation),
            usual_variance_m2: self.usual_variance_m2(observation, state),
            signal_variance_m2: self.glonass_variance_m2(observation)
                + if group_delay_m.is_none() { unknown_m * unknown_m } else { 0.0 },
            code_sigma_m: None,
            stated: None,
            second: None,
        }
    }

    /// Corrected observations as seen from `position` (Sagnac rotation, direction, masks, atmosphere, standard deviations), and the counts
    /// of masked observations and missing models. The counts are valid only if this position is final.
    pub fn finish(
        &self,
        prepared: &[PreparedObservation],
        position: Ecef,
        time_gps: GpsTime,
    ) -> (Vec<CorrectedObservation>, Skips) {
        let Finished { observations, masked, .. } = self.finish_with_carriers(prepared, position, time_gps);
        (observations, masked)
    }

    /// The same with what the carriers say.
    pub fn finish_with_carriers(
        &self,
        prepared: &[PreparedObservation],
        position: Ecef,
        time_gps: GpsTime,
    ) -> Finished {
        let mut finished = Finished::default();
        let view = View::new(position, time_gps, &self.options);
        finished.observations.reserve(prepared.len());
        for observation in prepared {
            let seen = view.see(observation);
            let mask_rad = match observation.stated.and_then(|stated| stated.troposphere_m) {
                Some(_) => self.options.stated_elevation_mask_rad,
                None => self.options.elevation_mask_rad,
            };
            if seen.direction.elevation_rad < mask_rad {
                finished.masked.add(Reason::ElevationBelowMask, || {
                    format!("{} at {time_gps}", observation.observation.satellite)
                });
                continue;
            }
            let (corrected, carrier) = view.correct(observation, &seen, &self.products, &mut finished.masked);
            finished.carriers.insert(corrected.signal_key(), carrier);
            finished.observations.push(corrected);
        }
        finished
    }
}

/// Carriers of an epoch by signal.
pub type Carriers = BTreeMap<SignalKey, Carrier>;

/// An epoch as seen from a position.
#[derive(Clone, Debug, Default)]
pub struct Finished {
    /// The observations that no mask excludes.
    pub observations: Vec<CorrectedObservation>,
    /// What their carriers say.
    pub carriers: Carriers,
    /// Counts of masked observations and missing models.
    pub masked: Skips,
}

/// Observations without a known position: satellites rotated for the measured travel time, no atmosphere, no masks. They serve to start an
/// iteration.
pub fn without_position(prepared: &[PreparedObservation]) -> Vec<CorrectedObservation> {
    prepared
        .iter()
        .map(|p| {
            let seen = rotate(p, p.pseudorange_m / SPEED_OF_LIGHT_MPS);
            let direction = Direction { azimuth_rad: 0.0, elevation_rad: std::f64::consts::FRAC_PI_2 };
            seen.observation(p, direction, p.pseudorange_m, 10.0, 1.0)
        })
        .collect()
}

#[derive(Clone, Copy)]
struct PreparedState {
    satellite_state: SatelliteState,
    observation: Observation,
    /// Time of transmission, which selects the navigation message and its group delay.
    sent: GpsTime,
}

impl PreparedState {
    /// Whether this state also serves another signal of the same satellite: within a microsecond (300 m) a satellite moves by 4 mm.
    fn serves(&self, observation: &Observation, pseudorange_m: f64) -> bool {
        self.observation.satellite == observation.satellite
            && self.observation.pseudorange_m.is_some_and(|known| (known - pseudorange_m).abs() < 300.0)
    }
}

struct Rotated {
    position: Ecef,
    velocity: EcefVector,
}

struct Seen {
    rotated: Rotated,
    direction: Direction,
}

/// The satellite in the Earth-fixed frame of a reception `travel_s` later.
fn rotate(prepared: &PreparedObservation, travel_s: f64) -> Rotated {
    let (sin, cos) = (EARTH_ROTATION_RADPS * travel_s).sin_cos();
    let turn = |v: &nalgebra::Vector3<f64>| {
        nalgebra::Vector3::new(cos * v.x + sin * v.y, cos * v.y - sin * v.x, v.z)
    };
    Rotated { position: Ecef(turn(&prepared.position.0)), velocity: EcefVector(turn(&prepared.velocity.0)) }
}

impl Rotated {
    fn observation(
        &self,
        prepared: &PreparedObservation,
        direction: Direction,
        pseudorange_m: f64,
        pseudorange_sigma_m: f64,
        rate_sigma_mps: f64,
    ) -> CorrectedObservation {
        CorrectedObservation {
            satellite: prepared.observation.satellite,
            signal: prepared.second.map_or(prepared.observation.signal, |second| second.pair),
            pseudorange_m,
            pseudorange_sigma_m,
            shared: SharedError::default(),
            range_rate: prepared.range_rate_mps.map(|range_rate_mps| RangeRate {
                range_rate_mps,
                sigma_mps: rate_sigma_mps,
                averaged_s: 0.0,
            }),
            range_change: None,
            cn0_dbhz: prepared.observation.cn0_dbhz,
            direction,
            satellite_position: self.position,
            satellite_velocity: self.velocity,
            usage: Usage::Used,
            residual_m: None,
        }
    }
}

/// A receiver position at one instant.
struct View<'a> {
    frame: LocalFrame,
    time_gps: GpsTime,
    troposphere: Troposphere,
    options: &'a CorrectionOptions,
}

impl<'a> View<'a> {
    fn new(position: Ecef, time_gps: GpsTime, options: &'a CorrectionOptions) -> Self {
        let frame = LocalFrame::at(position);
        let CorrectionOptions { troposphere_mapping, relative_humidity, .. } = *options;
        let troposphere = Troposphere::at(frame.geodetic(), time_gps, troposphere_mapping, relative_humidity);
        Self { frame, time_gps, troposphere, options }
    }

    fn see(&self, prepared: &PreparedObservation) -> Seen {
        let receiver = self.frame.origin();
        let rough_s = prepared.position.distance_m(receiver) / SPEED_OF_LIGHT_MPS;
        let rotated = rotate(prepared, rough_s);
        let line = (rotated.position - receiver).0;
        let direction = self.frame.direction(&line.normalize());
        Seen { rotated, direction }
    }

    fn correct(
        &self,
        prepared: &PreparedObservation,
        seen: &Seen,
        products: &Products,
        skips: &mut Skips,
    ) -> (CorrectedObservation, Carrier) {
        let (ionosphere, troposphere_m) = self.atmosphere_m(prepared, seen.direction, products, skips);
        let cn0_dbhz = prepared.observation.cn0_dbhz;
        let elevation_rad = seen.direction.elevation_rad;
        let signal_m2 = self.code_variance_m2(cn0_dbhz, prepared.code_sigma_m, elevation_rad)
            + prepared.signal_variance_m2;
        let signals_m2 = prepared.second.map_or(signal_m2, |second| {
            let noise_m2 = self.code_variance_m2(second.cn0_dbhz, second.code_sigma_m, elevation_rad);
            second.variance_m2(signal_m2, noise_m2)
        });
        let variance = prepared.satellite_variance_m2 + signals_m2;
        let rate = self.options.stochastic.rate;
        let with_signal =
            |satellite_m2: f64| (satellite_m2 + prepared.signal_variance_m2).min(variance).sqrt();
        let shared = SharedError {
            stated_sigma_m: with_signal(prepared.satellite_variance_m2),
            satellite_sigma_m: with_signal(prepared.usual_variance_m2),
            ionosphere_m: ionosphere.uncertain_m,
        };
        let observation = seen.rotated.observation(
            prepared,
            seen.direction,
            prepared.pseudorange_m + self.code_correction_m(prepared, elevation_rad)
                - ionosphere.delay_m
                - troposphere_m,
            variance.sqrt(),
            rate.variance(cn0_dbhz, elevation_rad).sqrt(),
        );
        let carrier = Carrier {
            phase_m: prepared.phase_m,
            delay_m: ionosphere.delay_m - troposphere_m,
            loss_of_lock: prepared.observation.loss_of_lock,
        };
        (CorrectedObservation { shared, ..observation }, carrier)
    }

    /// Correction of code biases by elevation, m, if the options say so; 0 for a pair.
    fn code_correction_m(&self, prepared: &PreparedObservation, elevation_rad: f64) -> f64 {
        if self.options.beidou2_code_bias && prepared.second.is_none() {
            beidou2_code_correction_m(
                prepared.observation.satellite,
                prepared.observation.signal,
                elevation_rad,
            )
        } else {
            0.0
        }
    }

    /// Variance of a code by the model, or, without a C/N0, by the recording, m².
    fn code_variance_m2(
        &self,
        cn0_dbhz: Option<f64>,
        stated_sigma_m: Option<f64>,
        elevation_rad: f64,
    ) -> f64 {
        let model = || self.options.stochastic.code.variance(cn0_dbhz, elevation_rad);
        stated_sigma_m.filter(|_| cn0_dbhz.is_none()).map_or_else(model, |sigma_m| sigma_m * sigma_m)
    }

    /// Ionospheric delay, and tropospheric delay (m), by the recording, or else by the models.
    fn atmosphere_m(
        &self,
        prepared: &PreparedObservation,
        direction: Direction,
        products: &Products,
        skips: &mut Skips,
    ) -> (IonosphereDelay, f64) {
        let stated_ionosphere_m = prepared.stated.and_then(|stated| stated.ionosphere_m);
        let stated_troposphere_m = prepared.stated.and_then(|stated| stated.troposphere_m);
        let geodetic = self.frame.geodetic();
        let troposphere_m = stated_troposphere_m.unwrap_or_else(|| self.troposphere.delay_m(direction));
        if prepared.second.is_some() {
            return (IonosphereDelay { delay_m: 0.0, uncertain_m: 0.0 }, troposphere_m);
        }
        let stated =
            stated_ionosphere_m.map(|delay_m| IonosphereDelay { delay_m, uncertain_m: delay_m.abs() });
        let ionosphere = stated.unwrap_or_else(|| {
            let (time, frequency_hz) = (self.time_gps, prepared.frequency_hz);
            let sight = LineOfSight { receiver: geodetic, direction, time, frequency_hz };
            products.ionosphere_delay(&sight, skips)
        });
        (ionosphere, troposphere_m)
    }
}
