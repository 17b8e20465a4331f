//! One row: its fields as numbers, checked for plausibility.

use super::columns::{Columns, Optional, Required};
use super::fields::{Fault, Fields, MAX_NANOS, shorten};
use super::times::{Shift, Times, times};
use super::{masks, signal};
use crate::constants::SPEED_OF_LIGHT_MPS;
use crate::formats::android::RangeState;
use crate::formats::gnsslogger::Masks;
use crate::formats::lost_locks::SignalKey;
use crate::frames::{Ecef, EcefVector};
use crate::gnss::{
    CN0_BOUNDS_DBHZ, Constellation, LossOfLock, MAX_DOPPLER_HZ, Observation, PSEUDORANGE_BOUNDS_M,
    SatelliteId, SignalCode,
};
use crate::measurement::{
    GivenCorrections, MAX_SATELLITE_CLOCK_M, MAX_SATELLITE_DRIFT_MPS, MAX_SATELLITE_SPEED_MPS,
    ORBIT_BOUNDS_M, RecordedObservation,
};
use crate::skips::Reason;
use crate::time::GpsTime;

/// Largest delay in the atmosphere, m.
const MAX_DELAY_M: f64 = 500.0;
/// Standard deviation of orbit and clock along the line of sight, m. The files do not carry the broadcast accuracy; GPS and Galileo
/// reached this in those years.
const ORBIT_SIGMA_M: f64 = 0.5;
/// Largest standard deviation of a pseudorange that a phone states, m, and the smallest that is believed.
const CODE_SIGMA_BOUNDS_M: (f64, f64) = (0.1, 1e5);
/// A row that was read.
#[derive(Clone, Debug)]
pub(super) struct Row {
    /// Epoch as it is written, whole seconds corrected; the arrival where that is no time of the row's.
    pub(super) time_gps: GpsTime,
    /// Receive time.
    pub(super) received_gps: GpsTime,
    /// By how much the epoch as written was off, s.
    pub(super) shift: Shift,
    /// The observation. That its lock was lost is noted whether or not there is a phase.
    pub(super) recorded: RecordedObservation,
    /// Frequency channel of a GLONASS satellite of which only that is known.
    pub(super) channel_only: Option<i8>,
    /// Reason why there are no corrections, if there are none.
    pub(super) lack: Option<String>,
}

/// Reads a row.
pub(super) fn read(columns: &Columns, masks: &Masks, fields: &[&str]) -> Result<Row, Fault> {
    let fields = Fields { columns, fields };
    let Names { satellite, channel_only, signal } = names(&fields)?;
    masks::check(&fields, satellite.constellation, masks)?;
    let pseudorange_m = fields.number(Required::Pseudorange, PSEUDORANGE_BOUNDS_M)?;
    let Times { time_gps, received_gps, shift } = times(&fields, pseudorange_m)?;
    let (given, lack) = match given(&fields) {
        Ok(given) => (Some(given), None),
        Err(fault) => (None, Some(fault.detail)),
    };
    let frequency_hz = frequency_hz(&fields, satellite, signal);
    let recorded = RecordedObservation {
        observation: observation(&fields, satellite, signal, pseudorange_m, frequency_hz),
        frequency_hz,
        given,
    };
    Ok(Row { time_gps, received_gps, shift, recorded, channel_only, lack })
}

/// The signal of a row that tells a loss of lock, and the row's time if it can be read, even if other fields cannot be used.
/// Tables of 2021 do not tell losses of lock.
pub(super) fn lost_signal(columns: &Columns, fields: &[&str]) -> Option<(SignalKey, Option<GpsTime>)> {
    let fields = Fields { columns, fields };
    if !RangeState(fields.bits(Optional::DeltaRangeState)?).is_lock_lost() {
        return None;
    }
    let Names { satellite, signal, .. } = names(&fields).ok()?;
    Some(((satellite, signal), fields.count(Required::Time, MAX_NANOS).ok().map(GpsTime::from_nanos)))
}

/// Satellite and signal of a row.
struct Names {
    satellite: SatelliteId,
    channel_only: Option<i8>,
    signal: SignalCode,
}

fn names(fields: &Fields<'_>) -> Result<Names, Fault> {
    let (constellation, number) = (fields.text(Required::Constellation), fields.text(Required::Satellite));
    let (satellite, channel_only) = signal::satellite(constellation, number).ok_or_else(|| Fault {
        reason: Reason::SatelliteNotUsed,
        detail: format!("constellation type '{}', svid '{}'", shorten(constellation), shorten(number)),
    })?;
    let code_type = fields.columns.optional(fields.fields, Optional::CodeType);
    let on_carrier = || signal::signal_at(satellite, fields.optional(Optional::CarrierFrequency)?, code_type);
    let name = fields.text(Required::Signal);
    let signal = if name.is_empty() { on_carrier() } else { signal::signal(satellite, name, code_type) };
    let signal = signal.ok_or_else(|| Fault {
        reason: Reason::SignalNotUsed,
        detail: format!("{satellite} '{}'", shorten(name)),
    })?;
    Ok(Names { satellite, channel_only, signal })
}

fn given(fields: &Fields<'_>) -> Result<GivenCorrections, Fault> {
    use Required::{
        ClockBias, ClockDrift, Ionosphere, PositionX, PositionY, PositionZ, ReceiverBias, Troposphere,
        VelocityX, VelocityY, VelocityZ,
    };
    let (lowest, highest) = CODE_SIGMA_BOUNDS_M;
    let [x, y, z] =
        [PositionX, PositionY, PositionZ].map(|column| fields.symmetric(column, *ORBIT_BOUNDS_M.end()));
    let position = Ecef::new(x?, y?, z?);
    let distance_m = position.0.norm();
    if !ORBIT_BOUNDS_M.contains(&distance_m) {
        return Err(Fault {
            reason: Reason::ImpossibleValue,
            detail: format!("satellite {distance_m} m from the Earth's centre"),
        });
    }
    let [vx, vy, vz] =
        [VelocityX, VelocityY, VelocityZ].map(|column| fields.symmetric(column, MAX_SATELLITE_SPEED_MPS));
    Ok(GivenCorrections {
        satellite_position: position,
        satellite_velocity: EcefVector::new(vx?, vy?, vz?),
        clock_m: fields.symmetric(ClockBias, MAX_SATELLITE_CLOCK_M)?,
        clock_drift_mps: fields.symmetric(ClockDrift, MAX_SATELLITE_DRIFT_MPS)?,
        receiver_bias_m: fields.symmetric(ReceiverBias, *PSEUDORANGE_BOUNDS_M.start())?,
        ionosphere_m: Some(fields.symmetric(Ionosphere, MAX_DELAY_M)?),
        troposphere_m: Some(fields.symmetric(Troposphere, MAX_DELAY_M)?),
        sigma_m: ORBIT_SIGMA_M,
        code_sigma_m: fields
            .optional(Optional::PseudorangeUncertainty)
            .filter(|sigma| (lowest..=highest).contains(sigma)),
    })
}

/// Carrier frequency: the signal's own, for GLONASS the recorded one.
fn frequency_hz(fields: &Fields<'_>, satellite: SatelliteId, signal: SignalCode) -> Option<f64> {
    let nominal = signal.frequency_hz(satellite.constellation, None);
    let recorded = || {
        fields
            .optional(Optional::CarrierFrequency)
            .filter(|f| satellite.constellation == Constellation::Glonass && (1.59e9..1.61e9).contains(f))
    };
    nominal.or_else(recorded)
}

fn observation(
    fields: &Fields<'_>,
    satellite: SatelliteId,
    signal: SignalCode,
    pseudorange_m: f64,
    frequency_hz: Option<f64>,
) -> Observation {
    let per_wavelength = |metres: f64| Some(metres * frequency_hz? / SPEED_OF_LIGHT_MPS);
    let doppler_hz = fields.optional(Optional::PseudorangeRate).and_then(|rate| per_wavelength(-rate));
    let state = RangeState(fields.bits(Optional::DeltaRangeState).unwrap_or(0));
    Observation {
        satellite,
        signal,
        pseudorange_m: Some(pseudorange_m),
        carrier_phase_cycles: fields
            .optional(Optional::DeltaRange)
            .filter(|_| state.is_valid())
            .and_then(per_wavelength),
        doppler_hz: doppler_hz.filter(|doppler| doppler.abs() <= MAX_DOPPLER_HZ),
        cn0_dbhz: fields.optional(Optional::Cn0).filter(|cn0| CN0_BOUNDS_DBHZ.contains(cn0)),
        loss_of_lock: LossOfLock {
            cycle_slip: state.is_lock_lost(),
            half_cycle: state.is_valid() && state.has_half_cycle(),
            ..LossOfLock::default()
        },
    }
}
