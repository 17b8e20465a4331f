//! One `Raw` line to one observation: masks, pseudorange, Doppler, phase.

use super::options::{KnownTime, Masks, Options};
use super::pseudorange::{ReceiveTime, TransmitScale};
use super::raw::RawLine;
use crate::formats::android::{Signal, channel_only};
use crate::gnss::{CN0_BOUNDS_DBHZ, LossOfLock, MAX_DOPPLER_HZ, MAX_PHASE_CYCLES, Observation, SatelliteId};
use crate::measurement::GivenCorrections;
use crate::skips::Reason;

/// Reason why a line gives no observation, or not all values of one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Refusal {
    /// Reason to count under.
    pub(super) reason: Reason,
    /// Name or unit of the value.
    pub(super) quantity: &'static str,
    /// The value.
    pub(super) value: f64,
}

const fn refuse<T>(reason: Reason, quantity: &'static str, value: f64) -> Result<T, Refusal> {
    Err(Refusal { reason, quantity, value })
}

/// An observation and the GLONASS channel that its line tells.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measured {
    pub(super) observation: Observation,
    pub(super) glonass_channel: Option<i8>,
    /// The same where the phone knows nothing else of the satellite.
    pub(super) channel_only: Option<i8>,
    /// The line says that the lock was lost, whether or not it has a phase.
    pub(super) is_lost: bool,
    /// Satellite state and delays by the line.
    pub(super) given: Option<GivenCorrections>,
}

/// Forms the observation of a line. `clock` is the epoch's time, `leap_seconds` that of GLONASS' scale.
pub(super) fn measure(
    line: &RawLine,
    (satellite, signal): (SatelliteId, Signal),
    clock: ReceiveTime,
    leap_seconds: i64,
    options: &Options,
) -> Result<Measured, Refusal> {
    let masks = &options.masks;
    let scale = scale(line.state, satellite, leap_seconds, masks)?;
    check(line, masks)?;
    let receive = ReceiveTime { fraction_ns: clock.fraction_ns + line.time_offset_ns, ..clock };
    let pseudorange_m = scale.pseudorange_m(receive, line.received_sv_time_ns).unwrap_or(f64::NAN);
    let (shortest, longest) = masks.pseudorange_m;
    if !(shortest..=longest).contains(&pseudorange_m) {
        return refuse(Reason::MaskPseudorange, "m", pseudorange_m);
    }
    Ok(Measured {
        observation: Observation {
            satellite,
            signal: signal.code,
            pseudorange_m: Some(pseudorange_m),
            carrier_phase_cycles: None,
            doppler_hz: None,
            cn0_dbhz: line.cn0_dbhz,
            loss_of_lock: LossOfLock::default(),
        },
        glonass_channel: signal.glonass_channel,
        channel_only: channel_only(line.constellation_type, line.svid).map(|(_, channel)| channel),
        is_lost: line.range_state.is_lock_lost(),
        given: line.given,
    })
}

/// Adds Doppler (−rate/λ) and phase (delta range/λ, which grows with the distance as in RINEX) with the nominal
/// wavelength of the signal, or says why one of the two is refused. Losses of lock are added with the epoch.
pub(super) fn add_carrier(line: &RawLine, measured: &mut Measured, options: &Options) -> Result<(), Refusal> {
    let observation = &mut measured.observation;
    let phase_m = line.range_m.filter(|_| line.range_state.is_valid() || options.keep_invalid_phase);
    if line.rate_mps.is_none() && phase_m.is_none() {
        return Ok(());
    }
    let constellation = observation.satellite.constellation;
    let Some(wavelength_m) = observation.signal.wavelength_m(constellation, measured.glonass_channel) else {
        return refuse(Reason::DopplerWithoutCarrierFrequency, "CarrierFrequencyHz", f64::NAN);
    };
    let phase_cycles = phase_m.map(|range| range / wavelength_m);
    if let Some(cycles) = phase_cycles.filter(|cycles| cycles.abs() > MAX_PHASE_CYCLES) {
        return refuse(Reason::AccumulatedDeltaRangeOutOfRange, "cycles", cycles);
    }
    observation.carrier_phase_cycles = phase_cycles;
    observation.loss_of_lock.half_cycle = phase_cycles.is_some() && line.range_state.has_half_cycle();
    let uncertainty = line.rate_uncertainty_mps.unwrap_or(0.0);
    if uncertainty > options.masks.max_rate_uncertainty_mps {
        return refuse(Reason::MaskPseudorangeRateUncertainty, "m/s", uncertainty);
    }
    let doppler_hz = line.rate_mps.map(|rate| -rate / wavelength_m);
    if let Some(doppler_hz) = doppler_hz.filter(|doppler| doppler.abs() > MAX_DOPPLER_HZ) {
        return refuse(Reason::DopplerOutOfRange, "Hz", doppler_hz);
    }
    observation.doppler_hz = doppler_hz;
    Ok(())
}

/// The scale of the time of transmission, by the state bits.
fn scale(
    state: u32,
    satellite: SatelliteId,
    leap_seconds: i64,
    masks: &Masks,
) -> Result<TransmitScale, Refusal> {
    let scale = TransmitScale::full(satellite.constellation, leap_seconds);
    match masks.states.of(satellite.constellation).known_time(state) {
        Some(KnownTime::Complete) => Ok(scale),
        // Geostationary BeiDou satellites have subframes of 0.6 s only, by whichever bit the lock on them is told.
        Some(KnownTime::Modulo(6_000)) if satellite.is_beidou_geostationary() => Ok(scale.modulo(600)),
        Some(KnownTime::Modulo(period_ms)) => Ok(scale.modulo(period_ms)),
        None => refuse(Reason::MaskStateBits, "State", f64::from(state)),
    }
}

/// The masks by the phone's statements on its own measurement. A value that the log does not have passes.
fn check(line: &RawLine, masks: &Masks) -> Result<(), Refusal> {
    let above = |value: Option<f64>, limit: f64| value.filter(|v| *v > limit);
    if let Some(value) = above(line.clock.bias_uncertainty_ns, masks.max_bias_uncertainty_ns) {
        return refuse(Reason::MaskClockBiasUncertainty, "ns", value);
    }
    if let Some(value) = above(line.received_sv_time_uncertainty_ns, masks.max_received_time_uncertainty_ns) {
        return refuse(Reason::MaskReceivedTimeUncertainty, "ns", value);
    }
    if let Some(value) = line.cn0_dbhz.filter(|cn0| *cn0 < masks.min_cn0_dbhz) {
        return refuse(Reason::MaskCn0, "dB-Hz", value);
    }
    if let Some(value) = line.cn0_dbhz.filter(|cn0| !CN0_BOUNDS_DBHZ.contains(cn0)) {
        return refuse(Reason::Cn0OutOfRange, "dB-Hz", value);
    }
    if line.multipath && masks.reject_multipath {
        return refuse(Reason::MaskMultipath, "MultipathIndicator", 1.0);
    }
    // Longer offsets than this belong to no receiver: satellites move by 10 m in 10 ms.
    if line.time_offset_ns.abs() > 1e7 {
        return refuse(Reason::MeasurementFarFromEpoch, "TimeOffsetNanos", line.time_offset_ns);
    }
    Ok(())
}
