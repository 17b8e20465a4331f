//! Plausibility of the values of a message.
//!
//! The limits are wide: they reject NaN, garbage and wrong units. Bad measurements are left to the estimator.

use std::collections::BTreeSet;
use std::fmt;
use std::ops::RangeInclusive;

use super::{EpochMessage, KeyNameError, PaceMessage, check_name};
use nalgebra::{Cholesky, SMatrix};

use crate::filter::PhoneState;
use crate::frames::Ecef;
use crate::gnss::{CN0_BOUNDS_DBHZ, PSEUDORANGE_BOUNDS_M, SatelliteId, SignalCode};
use crate::integrity::{GlobalTest, ProtectionLevels};
use crate::measurement::CorrectedObservation;
use crate::skips::{Reason, Skips};
use crate::solve::{PointSolution, VelocitySolution};
use crate::time::GpsTime;

/// Maximum number of observations in one message; a phone receives about 60 signals.
pub const MAXIMUM_OBSERVATIONS: usize = 256;

/// 2200-01-01 00:00:00 GPST.
const LATEST_NANOS: i64 = 6_942_153_600_000_000_000;
/// Standard deviations, m or m/s. A value below a millimetre would dominate all other measurements of the phone.
const SIGMA: RangeInclusive<f64> = 1e-3..=1e4;
/// Range rates: Doppler up to its limit (200 kHz) on the longest wavelength in use.
const RANGE_RATE_MPS: RangeInclusive<f64> = -6e4..=6e4;
const AVERAGED_S: RangeInclusive<f64> = 0.0..=60.0;
/// Changes of range over a minute at the largest range rate.
const RANGE_CHANGE_M: RangeInclusive<f64> = -4e6..=4e6;
/// Ionospheric delays; a recording may state one below zero.
const IONOSPHERE_M: RangeInclusive<f64> = -1e4..=1e4;
const SATELLITE_RADIUS_M: RangeInclusive<f64> = 6.4e6..=6e7;
const SATELLITE_SPEED_MPS: RangeInclusive<f64> = 0.0..=2e4;
const ANGLE_RAD: RangeInclusive<f64> = -7.0..=7.0;
const RESIDUAL_M: RangeInclusive<f64> = -1e9..=1e9;
const COORDINATE_M: RangeInclusive<f64> = -1e8..=1e8;
const SPEED_MPS: RangeInclusive<f64> = -1e5..=1e5;
const POSITIVE: RangeInclusive<f64> = 0.0..=f64::MAX;
/// Variances of positions (m²), velocities and accelerations: a tenth of a millimetre to a thousand kilometres.
const VARIANCE: RangeInclusive<f64> = 1e-8..=1e12;
/// Time until a recording's first epoch is due, s.
const DUE_IN_S: RangeInclusive<f64> = -3_600.0..=3_600.0;
const FINITE: RangeInclusive<f64> = f64::MIN..=f64::MAX;

/// A value outside its plausible range; NaN is outside every range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{quantity} is {value:e}, outside {lower:e} to {upper:e}")]
pub struct Implausible {
    /// Name of the quantity, with its unit.
    pub quantity: &'static str,
    /// The value.
    pub value: f64,
    /// Minimum plausible value.
    pub lower: f64,
    /// Maximum plausible value.
    pub upper: f64,
}

/// Error of an invalid message.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum InvalidMessage {
    /// The phone's name is not a valid name.
    #[error("phone: {0}")]
    Name(#[from] KeyNameError),
    /// The name differs from the one in the key.
    #[error("the message names phone '{found}' but came on the key of '{expected}'")]
    OtherPhone {
        /// The name in the message.
        found: String,
        /// The name in the key.
        expected: String,
    },
    /// The time is before 1980 or after 2200.
    #[error("sequence {sequence}: the time {time_gps} is outside 1980 to 2200")]
    Time {
        /// The message's sequence number.
        sequence: u64,
        /// Time of the message.
        time_gps: GpsTime,
    },
    /// More than [`MAXIMUM_OBSERVATIONS`] observations.
    #[error("{time_gps}: {count} observations, more than {MAXIMUM_OBSERVATIONS}")]
    TooManyObservations {
        /// The message's time.
        time_gps: GpsTime,
        /// Number of observations.
        count: usize,
    },
    /// An observation has an implausible value.
    #[error("{satellite} {signal} at {time_gps}: {implausible}")]
    Observation {
        /// The satellite.
        satellite: SatelliteId,
        /// The signal.
        signal: SignalCode,
        /// The message's time.
        time_gps: GpsTime,
        /// The value.
        implausible: Implausible,
    },
    /// The satellite cannot transmit the signal, by the signal table of all decoders.
    #[error("{satellite} {signal} at {time_gps}: {reason}")]
    Signal {
        /// The satellite.
        satellite: SatelliteId,
        /// The signal.
        signal: SignalCode,
        /// The message's time.
        time_gps: GpsTime,
        /// Reason from the signal table.
        reason: Reason,
    },
    /// A satellite's signal occurs twice.
    #[error("{satellite} {signal} at {time_gps}: second observation of the same signal")]
    Duplicate {
        /// The satellite.
        satellite: SatelliteId,
        /// The signal.
        signal: SignalCode,
        /// The message's time.
        time_gps: GpsTime,
    },
    /// The epoch-wise solution, the local state or the RAIM values contain an implausible value.
    #[error("{part} at {time_gps}: {implausible}")]
    Part {
        /// The part.
        part: Part,
        /// The message's time.
        time_gps: GpsTime,
        /// The value.
        implausible: Implausible,
    },
}

/// Parts of a message that can be dropped separately.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// [`EpochMessage::wls`].
    Wls,
    /// [`EpochMessage::local`].
    Local,
    /// [`EpochMessage::local_integrity`].
    LocalIntegrity,
    /// [`EpochMessage::raim`]'s global test.
    GlobalTest,
    /// [`EpochMessage::raim`]'s protection levels.
    Protection,
    /// [`EpochMessage::raim`]'s levels by the largest slope.
    Slope,
    /// [`EpochMessage::raim`]'s report on the velocity.
    Velocity,
}

impl Part {
    /// All parts.
    const ALL: [Self; 7] = [
        Self::Wls,
        Self::Local,
        Self::LocalIntegrity,
        Self::GlobalTest,
        Self::Protection,
        Self::Slope,
        Self::Velocity,
    ];
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Wls => "epoch-wise solution",
            Self::Local => "local state",
            Self::LocalIntegrity => "report on the local state",
            Self::GlobalTest => "global test",
            Self::Protection => "protection levels",
            Self::Slope => "levels by slope",
            Self::Velocity => "report on the velocity",
        })
    }
}

impl EpochMessage {
    /// Checks the whole message.
    ///
    /// # Errors
    /// The first implausible value.
    pub fn validate(&self) -> Result<(), InvalidMessage> {
        self.check_frame()?;
        let mut seen = BTreeSet::new();
        for observation in &self.observations {
            self.check_one(observation, &mut seen)?;
        }
        for part in Part::ALL {
            self.check_part(part)?;
        }
        Ok(())
    }

    /// Drops implausible parts and keeps the rest: each dropped observation and part is counted in `skips`.
    /// `None`, also counted, if nothing can be kept: a name other than `phone`, an implausible time, too many observations.
    pub fn sanitise(mut self, phone: &str, skips: &mut Skips) -> Option<Self> {
        let frame = self.check_frame().and_then(|()| self.check_phone(phone));
        if let Err(error) = frame {
            skips.add(Reason::MessageRefused, || error.to_string());
            return None;
        }
        let mut seen = BTreeSet::new();
        let candidates = std::mem::take(&mut self.observations);
        let mut kept = Vec::with_capacity(candidates.len());
        for observation in candidates {
            match self.check_one(&observation, &mut seen) {
                Ok(()) => kept.push(observation),
                Err(error) => skips.add(Reason::ObservationInMessage, || error.to_string()),
            }
        }
        self.observations = kept;
        for part in Part::ALL {
            if let Err(error) = self.check_part(part) {
                skips.add(Reason::PartOfMessage, || error.to_string());
                self.drop_part(part);
            }
        }
        Some(self)
    }

    fn check_frame(&self) -> Result<(), InvalidMessage> {
        check_name(&self.phone)?;
        if !(0..=LATEST_NANOS).contains(&self.time_gps.nanos()) {
            return Err(InvalidMessage::Time { sequence: self.sequence, time_gps: self.time_gps });
        }
        let count = self.observations.len();
        if count > MAXIMUM_OBSERVATIONS {
            return Err(InvalidMessage::TooManyObservations { time_gps: self.time_gps, count });
        }
        Ok(())
    }

    fn check_phone(&self, expected: &str) -> Result<(), InvalidMessage> {
        if self.phone == expected {
            return Ok(());
        }
        Err(InvalidMessage::OtherPhone { found: self.phone.clone(), expected: expected.to_owned() })
    }

    fn check_one(
        &self,
        observation: &CorrectedObservation,
        seen: &mut BTreeSet<(SatelliteId, SignalCode)>,
    ) -> Result<(), InvalidMessage> {
        let CorrectedObservation { satellite, signal, .. } = *observation;
        let time_gps = self.time_gps;
        if let Some(reason) = satellite.cannot_send(signal) {
            return Err(InvalidMessage::Signal { satellite, signal, time_gps, reason });
        }
        check_observation(observation).map_err(|implausible| InvalidMessage::Observation {
            satellite,
            signal,
            time_gps,
            implausible,
        })?;
        if seen.insert((satellite, signal)) {
            Ok(())
        } else {
            Err(InvalidMessage::Duplicate { satellite, signal, time_gps })
        }
    }

    fn check_part(&self, part: Part) -> Result<(), InvalidMessage> {
        let checked = match part {
            Part::Wls => self.wls.as_ref().map(check_solution),
            Part::Local => self.local.as_ref().map(check_state),
            Part::GlobalTest => self.raim.global_test.as_ref().map(check_test),
            Part::LocalIntegrity => self.local_integrity.map(|report| {
                let test = report.test.and_then(|test| test.global_test);
                test.as_ref().map_or(Ok(()), check_test)?;
                report.protection.map_or(Ok(()), check_levels)
            }),
            Part::Protection => self.raim.protection.map(check_levels),
            Part::Slope => self.raim.slope.map(|levels| {
                within("horizontal level by slope (m)", levels.horizontal_m, POSITIVE)?;
                within("vertical level by slope (m)", levels.vertical_m, POSITIVE)?;
                within("ARP (m)", levels.arp_m, POSITIVE)
            }),
            Part::Velocity => {
                self.raim.velocity.and_then(|report| report.global_test.as_ref().map(check_test))
            }
        };
        checked.unwrap_or(Ok(())).map_err(|implausible| InvalidMessage::Part {
            part,
            time_gps: self.time_gps,
            implausible,
        })
    }

    fn drop_part(&mut self, part: Part) {
        match part {
            Part::Wls => self.wls = None,
            Part::Local => self.local = None,
            Part::LocalIntegrity => self.local_integrity = None,
            Part::GlobalTest => self.raim.global_test = None,
            Part::Protection => self.raim.protection = None,
            Part::Slope => self.raim.slope = None,
            Part::Velocity => self.raim.velocity = None,
        }
    }
}

impl PaceMessage {
    /// Checks the time of the message.
    ///
    /// # Errors
    /// If it is more than an hour from now, or NaN.
    pub fn validate(self) -> Result<Self, Implausible> {
        within("time until the first epoch is due (s)", self.due_in_s, DUE_IN_S).map(|()| self)
    }
}

fn check_levels(levels: ProtectionLevels) -> Result<(), Implausible> {
    within("horizontal protection level (m)", levels.horizontal_m, POSITIVE)?;
    within("vertical protection level (m)", levels.vertical_m, POSITIVE)
}

fn check_test(test: &GlobalTest) -> Result<(), Implausible> {
    within("test statistic", test.statistic, POSITIVE)?;
    within("test threshold", test.threshold, POSITIVE)
}

fn check_observation(o: &CorrectedObservation) -> Result<(), Implausible> {
    within("satellite number", f64::from(o.satellite.number), 1.0..=99.0)?;
    within("corrected pseudorange (m)", o.pseudorange_m, PSEUDORANGE_BOUNDS_M)?;
    within("pseudorange sigma (m)", o.pseudorange_sigma_m, SIGMA)?;
    for sigma_m in [o.shared.stated_sigma_m, o.shared.satellite_sigma_m] {
        within("satellite sigma (m)", sigma_m, 0.0..=*SIGMA.end())?;
    }
    within("ionosphere (m)", o.shared.ionosphere_m, IONOSPHERE_M)?;
    if let Some(rate) = o.range_rate {
        within("corrected range rate (m/s)", rate.range_rate_mps, RANGE_RATE_MPS)?;
        within("range rate sigma (m/s)", rate.sigma_mps, SIGMA)?;
        within("averaging time of the range rate (s)", rate.averaged_s, AVERAGED_S)?;
    }
    if let Some(change) = o.range_change {
        within("change of range (m)", change.change_m, RANGE_CHANGE_M)?;
        within("sigma of the change of range (m)", change.sigma_m, SIGMA)?;
        within("satellite radius before (m)", change.satellite_before.0.norm(), SATELLITE_RADIUS_M)?;
    }
    if let Some(cn0_dbhz) = o.cn0_dbhz {
        within("C/N0 (dB-Hz)", cn0_dbhz, CN0_BOUNDS_DBHZ)?;
    }
    within("azimuth (rad)", o.direction.azimuth_rad, ANGLE_RAD)?;
    within("elevation (rad)", o.direction.elevation_rad, ANGLE_RAD)?;
    within("satellite radius (m)", o.satellite_position.0.norm(), SATELLITE_RADIUS_M)?;
    within("satellite speed (m/s)", o.satellite_velocity.norm(), SATELLITE_SPEED_MPS)?;
    o.residual_m.map_or(Ok(()), |residual_m| within("residual (m)", residual_m, RESIDUAL_M))
}

fn check_solution(solution: &PointSolution) -> Result<(), Implausible> {
    check_position(solution.position)?;
    check_covariance("position covariance (m²)", &solution.position_covariance)?;
    check_all("receiver clock (m)", solution.clocks_m.iter().map(|(_, clock_m)| clock_m), FINITE)?;
    if let Some(VelocitySolution { velocity, covariance }) = &solution.velocity {
        check_all("velocity (m/s)", velocity.0.iter(), SPEED_MPS)?;
        check_covariance("velocity covariance (m²/s²)", covariance)?;
    }
    let dops = solution.dops;
    check_all("dilution of precision", [dops.gdop, dops.pdop, dops.hdop, dops.vdop].iter(), POSITIVE)
}

fn check_state(state: &PhoneState) -> Result<(), Implausible> {
    check_position(state.position())?;
    check_all("velocity (m/s)", state.velocity().0.iter(), SPEED_MPS)?;
    check_all("state", state.mean.iter(), FINITE)?;
    check_covariance("state covariance", &state.covariance)
}

/// Variances in range, symmetric to rounding, positive definite.
fn check_covariance<const N: usize>(
    quantity: &'static str,
    covariance: &SMatrix<f64, N, N>,
) -> Result<(), Implausible> {
    check_all(quantity, covariance.iter(), FINITE)?;
    check_all(quantity, covariance.diagonal().iter(), VARIANCE)?;
    let largest = covariance.amax();
    let asymmetry = (covariance - covariance.transpose()).amax() / largest;
    within("asymmetry of a covariance", asymmetry, 0.0..=1e-9)?;
    // 1 for a definite matrix, 0 otherwise: a matrix without a Cholesky factor is not a covariance.
    let is_definite = Cholesky::new(*covariance).is_some();
    within("definiteness of a covariance", f64::from(u8::from(is_definite)), 1.0..=1.0)
}

fn check_position(position: Ecef) -> Result<(), Implausible> {
    check_all("position coordinate (m)", position.0.iter(), COORDINATE_M)
}

fn check_all<'a>(
    quantity: &'static str,
    mut values: impl Iterator<Item = &'a f64>,
    range: RangeInclusive<f64>,
) -> Result<(), Implausible> {
    values.try_for_each(|&value| within(quantity, value, range.clone()))
}

fn within(quantity: &'static str, value: f64, range: RangeInclusive<f64>) -> Result<(), Implausible> {
    if range.contains(&value) {
        return Ok(());
    }
    Err(Implausible { quantity, value, lower: *range.start(), upper: *range.end() })
}

#[cfg(test)]
mod tests;
