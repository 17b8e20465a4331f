//! Satellite and signal of a line.

use super::raw::RawLine;
use crate::formats::android::{Signal, channel_only, satellite, signal};
use crate::gnss::SatelliteId;
use crate::skips::{Reason, Skips};

/// Satellite and signal of a line; `None` (counted) if they are not known. A GLONASS satellite of which the phone knows only the
/// channel has the phone's number.
pub(super) fn named((number, line): (u64, &RawLine), skips: &mut Skips) -> Option<(SatelliteId, Signal)> {
    let (system, svid) = (line.constellation_type, line.svid);
    let by_channel = channel_only(system, svid);
    let satellite = satellite(system, svid).map_err(|reason| {
        skips.add(reason, || format!("line {number}: ConstellationType {system}, Svid {svid}"));
    });
    let channel = by_channel.map(|(_, channel)| channel);
    let satellite = satellite.ok().or_else(|| by_channel.map(|(satellite, _)| satellite))?;
    let Some(signal) = signal(satellite, line.frequency_hz, line.code_type) else {
        // A line without a slot is counted already.
        if channel.is_none() {
            let frequency_hz = line.frequency_hz.unwrap_or(f64::NAN);
            skips.add(Reason::CarrierFrequencyOfNoSignal, || {
                format!("line {number}: {satellite}, {frequency_hz} Hz")
            });
        }
        return None;
    };
    let glonass_channel = signal.glonass_channel.or(channel);
    if channel.is_some() && glonass_channel != channel {
        return None;
    }
    Some((satellite, Signal { glonass_channel, ..signal }))
}
