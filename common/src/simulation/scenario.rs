//! Description of a simulation.

use crate::frames::{Enu, Geodetic};
use crate::time::GpsTime;

use super::convoy::ConvoyOptions;
use super::environment::ErrorModel;
use super::motion::OwnMotion;
use super::mount::Mount;
use super::receiver::ClockOptions;
use super::shared::{IonosphereResidual, SharedErrors};
use super::street::{Canyon, Facade};

/// Maximum duration of a scenario, s (one day).
const LONGEST_S: f64 = 86_400.0;
/// Minimum interval between epochs, s.
const SHORTEST_INTERVAL_S: f64 = 0.01;
/// Maximum speed of a phone relative to its vehicle along an axis, m/s.
const FASTEST_MPS: f64 = 10_000.0;
/// Maximum acceleration of a phone relative to its vehicle along an axis, m/s².
const GREATEST_ACCELERATION_MPS2: f64 = 1_000.0;
/// Minimum time constant of the errors that all phones have alike, s.
const SHORTEST_TIME_CONSTANT_S: f64 = 600.0;
/// Maximum number of vehicles.
const MOST_VEHICLES: f64 = 100.0;

/// One phone.
#[derive(Clone, Debug, PartialEq)]
pub struct PhoneOptions {
    /// Name of the phone.
    pub name: String,
    /// Vehicle of the phone; vehicle 0 leads.
    pub vehicle: usize,
    /// Mounting in the vehicle.
    pub mount: Mount,
    /// Motion relative to the vehicle.
    pub motion: OwnMotion,
    /// Offset of the time tags from the full interval, s, in [0, interval).
    pub epoch_offset_s: f64,
    /// Start of the phone after that of the scenario, s.
    pub starts_after_s: f64,
    /// End of the phone before that of the scenario, s.
    pub stops_before_s: f64,
    /// Gain of the antenna relative to an average one, dB.
    pub antenna_db: f64,
    /// Whether the phone tracks GPS L5 too.
    pub dual_frequency: bool,
    /// Clock at the first epoch.
    pub clock: ClockOptions,
}

impl PhoneOptions {
    /// Phone `rank`, on the roof of its own vehicle of that rank; names, offsets, start and end differ between ranks.
    pub fn of_vehicle(rank: usize) -> Self {
        const OFFSETS_S: [f64; 4] = [0.000_4, 0.200_3, 0.499_7, 0.750_1];
        let turn = rank % OFFSETS_S.len();
        let number = rank as f64;
        let sign = if rank.is_multiple_of(2) { 1.0 } else { -1.0 };
        Self {
            name: format!("SIM{}", rank + 1),
            vehicle: rank,
            mount: Mount::default(),
            motion: OwnMotion::default(),
            epoch_offset_s: OFFSETS_S.get(turn).copied().unwrap_or(0.0),
            starts_after_s: 3.0 * turn as f64,
            stops_before_s: 4.0 * turn as f64,
            antenna_db: -1.5 * turn as f64,
            dual_frequency: rank.is_multiple_of(2),
            clock: ClockOptions {
                bias_s: sign * (1.0 + number) * 8e-7,
                drift_sps: -sign * (2.0 + number) * 1.5e-9,
            },
        }
    }
}

/// A simulated drive. [`Scenario::default`] is a convoy of three cars, ten minutes at 1 Hz.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenario {
    /// Seed of all random values.
    pub seed: u64,
    /// Start, GPS time.
    pub start_gps: GpsTime,
    /// Duration, s.
    pub duration_s: f64,
    /// Time between epochs, s.
    pub interval_s: f64,
    /// Start of the road.
    pub origin: Geodetic,
    /// The phones.
    pub phones: Vec<PhoneOptions>,
    /// Motion and distances of the vehicles.
    pub convoy: ConvoyOptions,
    /// Sections of the lap between houses.
    pub canyons: Vec<Canyon>,
    /// Sizes of the errors.
    pub errors: ErrorModel,
    /// Replaces `errors` by [`ErrorModel::none`]: clocks and delays remain, and the models remove the delays exactly.
    pub noise_free: bool,
}

/// Houses of a street of four storeys.
pub(super) const STREET: Facade = Facade { height_m: 14.0, distance_m: 14.0 };

impl Default for Scenario {
    fn default() -> Self {
        Self {
            seed: 1,
            start_gps: GpsTime::from_week_tow(2409, 208_800.0),
            duration_s: 600.0,
            interval_s: 1.0,
            origin: Geodetic::from_degrees(48.0, 11.5, 500.0),
            phones: (0..3).map(PhoneOptions::of_vehicle).collect(),
            convoy: ConvoyOptions::default(),
            canyons: vec![Canyon::symmetric(2_100.0, 2_950.0, STREET)],
            errors: ErrorModel::default(),
            noise_free: false,
        }
    }
}

/// Error for an invalid scenario.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ScenarioError {
    /// A number is outside its range.
    #[error("{name} is {value}; it must lie in [{minimum}, {maximum}]")]
    OutOfRange {
        /// Name of the field.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Smallest value.
        minimum: f64,
        /// Largest value.
        maximum: f64,
    },
    /// The scenario has no phone.
    #[error("the scenario has no phones; give it at least one")]
    NoPhones,
    /// Two phones have the same name.
    #[error("two phones are called '{0}'; names must differ")]
    DuplicateName(String),
}

impl Scenario {
    /// The errors in force.
    pub fn error_model(&self) -> ErrorModel {
        if self.noise_free { ErrorModel::none() } else { self.errors }
    }

    /// End, GPS time.
    pub fn end_gps(&self) -> GpsTime {
        self.start_gps + self.duration_s
    }

    /// Checks the conditions of the generator.
    ///
    /// # Errors
    ///
    /// The first field that is outside its range.
    pub fn validate(&self) -> Result<(), ScenarioError> {
        within("duration_s", self.duration_s, 1.0, LONGEST_S)?;
        within("interval_s", self.interval_s, SHORTEST_INTERVAL_S, self.duration_s)?;
        within("latitude_rad", self.origin.latitude_rad, -1.5, 1.5)?;
        within("longitude_rad", self.origin.longitude_rad, -3.15, 3.15)?;
        within("height_m", self.origin.height_m, -500.0, 9_000.0)?;
        within("standstill_gap_m", self.convoy.standstill_gap_m, 0.0, 1_000.0)?;
        within("headway_s", self.convoy.headway_s, 0.0, 60.0)?;
        within("gap_variation_m", self.convoy.gap_variation_m, 0.0, 10.0)?;
        within("lateral_m", self.convoy.lateral_m, 0.0, 10.0)?;
        self.error_model().validate()?;
        if self.phones.is_empty() {
            return Err(ScenarioError::NoPhones);
        }
        for (index, phone) in self.phones.iter().enumerate() {
            if self.phones.iter().take(index).any(|other| other.name == phone.name) {
                return Err(ScenarioError::DuplicateName(phone.name.clone()));
            }
            within("epoch_offset_s", phone.epoch_offset_s, 0.0, self.interval_s)?;
            within("starts_after_s", phone.starts_after_s, 0.0, LONGEST_S)?;
            within("stops_before_s", phone.stops_before_s, 0.0, LONGEST_S)?;
            within("clock.bias_s", phone.clock.bias_s, -1e-2, 1e-2)?;
            within("clock.drift_sps", phone.clock.drift_sps, -1e-5, 1e-5)?;
            within("vehicle", phone.vehicle as f64, 0.0, MOST_VEHICLES)?;
            within("mount.forward_m", phone.mount.forward_m, -20.0, 20.0)?;
            within("mount.right_m", phone.mount.right_m, -3.0, 3.0)?;
            within("mount.up_m", phone.mount.up_m, -3.0, 3.0)?;
            within("mount.cabin_loss_db", phone.mount.cabin_loss_db, 0.0, 60.0)?;
            within("mount.faces_rad", phone.mount.faces_rad, -10.0, 10.0)?;
            within("mount.body_loss_db", phone.mount.body_loss_db, 0.0, 60.0)?;
            phone.motion.validate()?;
        }
        self.canyons.iter().flat_map(|canyon| [canyon.left, canyon.right]).flatten().try_for_each(|facade| {
            within("canyon height_m", facade.height_m, 0.0, 1_000.0)?;
            within("canyon distance_m", facade.distance_m, 1.0, 1_000.0)
        })
    }
}

impl ErrorModel {
    fn validate(&self) -> Result<(), ScenarioError> {
        let sizes = [
            ("code_a_m2", self.code_a_m2),
            ("code_b_m2hz", self.code_b_m2hz),
            ("rate_a_m2ps2", self.rate_a_m2ps2),
            ("rate_b_m2ps2hz", self.rate_b_m2ps2hz),
            ("multipath_open_m", self.multipath_open_m),
            ("multipath_canyon_m", self.multipath_canyon_m),
            ("outliers_hz", self.outliers_hz),
            ("shadowing_db", self.shadowing_db),
            ("signal_in_space_m", self.signal_in_space_m),
            ("ionosphere_scale", self.ionosphere_scale),
            ("troposphere_scale", self.troposphere_scale),
            ("l5_delay_m", self.l5_delay_m),
        ];
        sizes.into_iter().try_for_each(|(name, value)| within(name, value, 0.0, 1e9))?;
        within("multipath_shared", self.multipath_shared, 0.0, 1.0)?;
        within("facades_reflecting", self.facades_reflecting, 0.0, 1.0)?;
        within("multipath_correlation_s", self.multipath_correlation_s, 1e-3, LONGEST_S)?;
        self.shared.validate()
    }
}

impl SharedErrors {
    fn validate(&self) -> Result<(), ScenarioError> {
        within("gps_galileo_bias_sigma_m", self.gps_galileo_bias_sigma_m, 0.0, 1e9)?;
        within("beidou_bias_sigma_m", self.beidou_bias_sigma_m, 0.0, 1e9)?;
        within("time_constant_s", self.time_constant_s, SHORTEST_TIME_CONSTANT_S, f64::MAX)?;
        self.ionosphere_mean.validate(-1e9)?;
        self.ionosphere_sigma.validate(0.0)
    }
}

impl IonosphereResidual {
    fn validate(&self, minimum: f64) -> Result<(), ScenarioError> {
        within("vertical_fraction", self.vertical_fraction, minimum, 1e9)?;
        within("north_m_per_1000km", self.north_m_per_1000km, minimum, 1e9)?;
        within("east_m_per_1000km", self.east_m_per_1000km, minimum, 1e9)
    }
}

impl OwnMotion {
    fn validate(&self) -> Result<(), ScenarioError> {
        let axes = |name, Enu { east, north, up }: Enu, largest: f64| {
            [east, north, up].into_iter().try_for_each(|value| within(name, value, -largest, largest))
        };
        axes("motion.initial_velocity_mps", self.initial_velocity_mps, FASTEST_MPS)?;
        self.pulses.iter().try_for_each(|pulse| {
            within("pulse.from_s", pulse.from_s, -LONGEST_S, LONGEST_S)?;
            within("pulse.duration_s", pulse.duration_s, 0.0, LONGEST_S)?;
            axes("pulse.acceleration_mps2", pulse.acceleration_mps2, GREATEST_ACCELERATION_MPS2)
        })
    }
}

fn within(name: &'static str, value: f64, minimum: f64, maximum: f64) -> Result<(), ScenarioError> {
    if (minimum..=maximum).contains(&value) {
        Ok(())
    } else {
        Err(ScenarioError::OutOfRange { name, value, minimum, maximum })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn absurd_scenarios_are_refused_with_the_field_named() {
        assert_eq!(Scenario::default().validate(), Ok(()));
        let text = |scenario: Scenario| scenario.validate().unwrap_err().to_string();
        assert!(text(Scenario { duration_s: f64::NAN, ..Scenario::default() }).contains("duration_s"));
        assert!(text(Scenario { interval_s: 0.0, ..Scenario::default() }).contains("interval_s is 0"));
        assert!(text(Scenario { phones: Vec::new(), ..Scenario::default() }).contains("no phones"));
        let errors = ErrorModel { code_b_m2hz: -1.0, ..ErrorModel::default() };
        assert!(text(Scenario { errors, ..Scenario::default() }).contains("code_b_m2hz is -1"));
        let shared = SharedErrors { time_constant_s: 10.0, ..SharedErrors::typical() };
        let errors = ErrorModel { shared, ..ErrorModel::default() };
        assert!(text(Scenario { errors, ..Scenario::default() }).contains("time_constant_s is 10"));
        let motion = OwnMotion::with_velocity(Enu { east: 0.0, north: f64::NAN, up: 0.0 });
        let phones = vec![PhoneOptions { motion, ..PhoneOptions::of_vehicle(0) }];
        assert!(text(Scenario { phones, ..Scenario::default() }).contains("initial_velocity_mps is NaN"));
        let twice = vec![PhoneOptions::of_vehicle(1), PhoneOptions::of_vehicle(1)];
        assert!(text(Scenario { phones: twice, ..Scenario::default() }).contains("SIM2"));
    }
}
