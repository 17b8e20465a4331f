//! What holds of every record, whatever it was read from.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use cofix_common::formats::decode::Record;
use cofix_common::formats::gnsslogger::{Fix, SignalStatus};
use cofix_common::formats::packing::Packing;
use cofix_common::frames::Direction;
use cofix_common::gnss::{
    CN0_BOUNDS_DBHZ, CycleSlip, Event, EventKind, MAX_DOPPLER_HZ, Observation, ObservationEpoch,
    PSEUDORANGE_BOUNDS_M, SatelliteId,
};
use cofix_common::orbit::{GlonassEphemeris, KeplerEphemeris, SatelliteState};

/// Memory that records may take per byte they were read from.
const MEMORY_PER_BYTE: usize = 64;
/// And beside that, for room that is set aside in the largest epoch.
const MEMORY_AT_LEAST: usize = 1 << 20;

/// Whether bytes are a packed file: what it holds is longer than itself.
pub(crate) fn is_packed(bytes: &[u8]) -> bool {
    Packing::of(bytes).is_some()
}

/// Values are finite, satellites have numbers, and records take no more memory than their text makes likely.
pub(crate) fn records(records: &[Record], bytes: usize) {
    let mut memory = 0;
    for record in records {
        memory += size_of::<Record>();
        match record {
            Record::Epoch(epoch) => {
                memory += epoch.observations.capacity() * size_of::<Observation>();
                observations(epoch);
            }
            Record::Ephemeris(ephemeris) => kepler(ephemeris),
            Record::Glonass(ephemeris) => glonass(ephemeris),
            Record::Event(event) => {
                let lines = event.lines.iter().map(|line| size_of::<String>() + line.capacity());
                memory += size_of::<Event>() + lines.sum::<usize>();
                memory += event.slips.capacity() * size_of::<CycleSlip>();
                self::event(event);
            }
        }
    }
    let limit = MEMORY_AT_LEAST + MEMORY_PER_BYTE * bytes;
    assert!(memory <= limit, "records of {bytes} bytes take {memory}, limit {limit}");
}

/// Epochs come in order of time, each once.
pub(crate) fn in_order(records: &[Record]) {
    let times: Vec<_> = records.iter().filter_map(epoch).map(|epoch| epoch.time_gps).collect();
    assert!(times.is_sorted_by(|a, b| a < b), "{times:?}");
}

/// Pseudoranges and Doppler as the decoders state their limits.
pub(crate) fn in_bounds(records: &[Record]) {
    for observation in records.iter().filter_map(epoch).flat_map(|epoch| &epoch.observations) {
        let inside = observation.pseudorange_m.is_none_or(|p| PSEUDORANGE_BOUNDS_M.contains(&p))
            && observation.doppler_hz.is_none_or(|d| d.abs() <= MAX_DOPPLER_HZ)
            && observation.cn0_dbhz.is_none_or(|c| CN0_BOUNDS_DBHZ.contains(&c));
        assert!(inside, "{observation:?}");
    }
}

/// The epoch of a record.
pub(crate) fn epoch(record: &Record) -> Option<&ObservationEpoch> {
    match record {
        Record::Epoch(epoch) => Some(epoch),
        Record::Ephemeris(_) | Record::Glonass(_) | Record::Event(_) => None,
    }
}

/// Events have no more than a file can tell of them.
fn event(event: &Event) {
    assert!(
        event.lines.len() <= 999 && event.lines.iter().all(|line| line.chars().count() <= 80),
        "{event:?}"
    );
    assert!(event.kind != EventKind::External || event.time_gps.is_some(), "{event:?}");
    assert!(
        event.slips.is_empty() || (event.kind == EventKind::CycleSlips && event.lines.is_empty()),
        "{event:?}"
    );
    for slip in &event.slips {
        numbered(slip.satellite);
        assert!(slip.slip_cycles.is_finite() && slip.slip_cycles != 0.0, "{event:?}");
    }
}

fn observations(epoch: &ObservationEpoch) {
    for observation in &epoch.observations {
        numbered(observation.satellite);
        let values = [
            observation.pseudorange_m,
            observation.carrier_phase_cycles,
            observation.doppler_hz,
            observation.cn0_dbhz,
        ];
        assert!(values.into_iter().flatten().all(f64::is_finite), "{}: {observation:?}", epoch.time_gps);
        assert!(values.iter().any(Option::is_some), "{}: {observation:?}", epoch.time_gps);
    }
    let name = |o: &Observation| (o.satellite, o.signal);
    let mut names: Vec<_> = epoch.observations.iter().map(name).collect();
    names.sort_unstable();
    let count = names.len();
    names.dedup();
    assert_eq!(names.len(), count, "{}: a signal twice", epoch.time_gps);
}

/// A phone's own position lies on the Earth, and its accuracy is one.
pub(crate) fn fix(fix: &Fix) {
    let inside = fix.latitude_rad.abs() <= FRAC_PI_2 && fix.longitude_rad.abs() <= PI;
    assert!(inside && fix.accuracy_m.is_none_or(|m| m >= 0.0 && m.is_finite()), "{fix:?}");
}

/// What a phone says about a signal can be.
pub(crate) fn status(status: &SignalStatus) {
    numbered(status.satellite);
    let strengths = [status.cn0_dbhz, status.baseband_cn0_dbhz];
    assert!(strengths.into_iter().flatten().all(|cn0| cn0 > 0.0 && cn0 <= 70.0), "{status:?}");
    let is_one = |d: Direction| (0.0..TAU).contains(&d.azimuth_rad) && d.elevation_rad.abs() <= FRAC_PI_2;
    assert!(status.direction.is_none_or(is_one), "{status:?}");
}

fn numbered(satellite: SatelliteId) {
    assert!((1..=99).contains(&satellite.number), "{satellite}");
}

/// Orbit and clock are finite where they are used.
pub(crate) fn kepler(ephemeris: &KeplerEphemeris) {
    numbered(ephemeris.satellite);
    for elapsed_s in [-7_200.0, 0.0, 14_400.0] {
        finite(&ephemeris.state(ephemeris.toe + elapsed_s), ephemeris);
    }
    assert!((ephemeris.toe - ephemeris.toc).abs() <= 2.0 * 604_800.0, "{ephemeris:?}");
    assert!(ephemeris.health.is_finite() && ephemeris.accuracy_m > 0.0, "{ephemeris:?}");
}

/// Orbit and clock are finite where they are used.
pub(crate) fn glonass(ephemeris: &GlonassEphemeris) {
    numbered(ephemeris.satellite);
    for elapsed_s in [-1_800.0, 0.0, 1_800.0] {
        finite(&ephemeris.state(ephemeris.toe + elapsed_s), ephemeris);
    }
    assert!((-7..=13).contains(&ephemeris.frequency_channel), "{ephemeris:?}");
}

pub(crate) fn finite(state: &SatelliteState, of: &dyn std::fmt::Debug) {
    let all = state.position.is_finite()
        && state.velocity.is_finite()
        && state.clock_s.is_finite()
        && state.clock_drift_sps.is_finite()
        && state.sigma_m > 0.0;
    assert!(all, "{state:?} of {of:?}");
}
