//! One `Raw` line as numbers.

use super::columns::{RAW_COLUMNS, Raw};
use super::fields::{Fields, bits, integer, real};
use super::stated;
use crate::formats::android::{MULTIPATH_DETECTED, RangeState, code_type, satellite, signal};
use crate::formats::lost_locks::SignalKey;
use crate::measurement::GivenCorrections;

/// The numbers of a `Raw` line; units as in its column names.
#[derive(Clone, Copy, Debug)]
pub(super) struct RawLine {
    pub(super) clock: ClockFields,
    pub(super) constellation_type: i64,
    pub(super) svid: i64,
    pub(super) time_offset_ns: f64,
    pub(super) state: u32,
    pub(super) received_sv_time_ns: i64,
    pub(super) received_sv_time_uncertainty_ns: Option<f64>,
    pub(super) cn0_dbhz: Option<f64>,
    pub(super) rate_mps: Option<f64>,
    pub(super) rate_uncertainty_mps: Option<f64>,
    pub(super) range_state: RangeState,
    pub(super) range_m: Option<f64>,
    pub(super) frequency_hz: Option<f64>,
    pub(super) multipath: bool,
    pub(super) code_type: Option<u8>,
    pub(super) given: Option<GivenCorrections>,
}

/// The phone's clock, which is the same in all lines of an epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ClockFields {
    pub(super) time_ns: i64,
    pub(super) full_bias_ns: i64,
    pub(super) bias_ns: f64,
    pub(super) bias_uncertainty_ns: Option<f64>,
    pub(super) discontinuities: Option<i64>,
    pub(super) leap_seconds: Option<i64>,
}

impl RawLine {
    /// Whether the satellite is one of GPS.
    pub(super) const fn is_gps(&self) -> bool {
        self.constellation_type == 1
    }
}

/// The signal of a line that tells a loss of lock, even if other fields cannot be read.
pub(super) fn lost_signal(fields: &[&[u8]; RAW_COLUMNS]) -> Option<SignalKey> {
    let at = |column: Raw| fields.get(column as usize).copied().unwrap_or_default();
    if !RangeState(bits(at(Raw::AccumulatedDeltaRangeState))?).is_lock_lost() {
        return None;
    }
    let satellite = satellite(integer(at(Raw::ConstellationType))?, integer(at(Raw::Svid))?).ok()?;
    let signal = signal(satellite, real(at(Raw::CarrierFrequencyHz)), code_type(at(Raw::CodeType)))?;
    Some((satellite, signal.code))
}

/// Reads the fields of a line; `None` (counted) when a needed one is missing or is no number.
pub(super) fn parse(fields: &[&[u8]; RAW_COLUMNS], read: &mut Fields<'_>) -> Option<RawLine> {
    let at = |column: Raw| fields.get(column as usize).copied().unwrap_or_default();
    Some(RawLine {
        clock: clock(fields, read)?,
        constellation_type: read.required("ConstellationType", at(Raw::ConstellationType), integer)?,
        svid: read.required("Svid", at(Raw::Svid), integer)?,
        time_offset_ns: read.optional("TimeOffsetNanos", at(Raw::TimeOffsetNanos), real).unwrap_or(0.0),
        state: read.required("State", at(Raw::State), bits)?,
        received_sv_time_ns: read.required("ReceivedSvTimeNanos", at(Raw::ReceivedSvTimeNanos), integer)?,
        received_sv_time_uncertainty_ns: read.optional(
            "ReceivedSvTimeUncertaintyNanos",
            at(Raw::ReceivedSvTimeUncertaintyNanos),
            real,
        ),
        cn0_dbhz: read.optional("Cn0DbHz", at(Raw::Cn0DbHz), real),
        rate_mps: read.optional("PseudorangeRateMetersPerSecond", at(Raw::PseudorangeRate), real),
        rate_uncertainty_mps: read.optional(
            "PseudorangeRateUncertaintyMetersPerSecond",
            at(Raw::PseudorangeRateUncertainty),
            real,
        ),
        range_state: read
            .optional("AccumulatedDeltaRangeState", at(Raw::AccumulatedDeltaRangeState), bits)
            .map_or_else(RangeState::default, RangeState),
        range_m: read.optional("AccumulatedDeltaRangeMeters", at(Raw::AccumulatedDeltaRange), real),
        frequency_hz: read.optional("CarrierFrequencyHz", at(Raw::CarrierFrequencyHz), real),
        multipath: integer(at(Raw::MultipathIndicator)) == Some(MULTIPATH_DETECTED),
        code_type: code_type(at(Raw::CodeType)),
        given: stated::corrections(fields, read),
    })
}

fn clock(fields: &[&[u8]; RAW_COLUMNS], read: &mut Fields<'_>) -> Option<ClockFields> {
    let at = |column: Raw| fields.get(column as usize).copied().unwrap_or_default();
    Some(ClockFields {
        time_ns: read.required("TimeNanos", at(Raw::TimeNanos), integer)?,
        full_bias_ns: read.required("FullBiasNanos", at(Raw::FullBiasNanos), integer)?,
        bias_ns: read.optional("BiasNanos", at(Raw::BiasNanos), real).unwrap_or(0.0),
        bias_uncertainty_ns: read.optional("BiasUncertaintyNanos", at(Raw::BiasUncertaintyNanos), real),
        discontinuities: read.optional(
            "HardwareClockDiscontinuityCount",
            at(Raw::HardwareClockDiscontinuityCount),
            integer,
        ),
        leap_seconds: read.optional("LeapSecond", at(Raw::LeapSecond), integer),
    })
}
