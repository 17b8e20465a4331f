//! Products beside orbits: clocks, biases and maps of the ionosphere, and what they give at any instant and place.

use cofix_common::atmosphere::{Ionex, IonosphereMap};
use cofix_common::constants::SPEED_OF_LIGHT_MPS;
use cofix_common::frames::{Direction, Ecef, Geodetic};
use cofix_common::gnss::{SatelliteId, SignalCode};
use cofix_common::orbit::{
    BiasFile, ClockFile, ClockRecord, ClockReference, CodeBias, LineOfSight, Products, Sp3, Sp3Position,
};
use cofix_common::skips::Skips;
use cofix_common::time::GpsTime;

use crate::checks;

/// Clocks that are believed, s.
const MAX_CLOCK_S: f64 = 0.1;
/// Clocks between records stay between them, and what is there of relativity is below a microsecond.
const MAX_STATE_CLOCK_S: f64 = MAX_CLOCK_S + 1e-6;
/// Biases that are believed, s: 1000 ns, as rounding has them.
const MAX_BIAS_S: f64 = 1_000.0 * 1e-9;
/// Vertical contents that are believed, TECU.
const MAX_TEC_TECU: f64 = 1_000.0;
/// Delay on L1 of a content of one TECU, m.
const L1_DELAY_M: f64 = 40.3e16 / (L1_HZ * L1_HZ);
const L1_HZ: f64 = 1_575.42e6;
/// A shell as low as is believed is crossed at the horizon at no more than this many times its height.
const MAX_SLANT: f64 = 10.0;
/// What is evaluated at most of a file.
const MOST: usize = 60;

/// RINEX clocks, with the orbits that they go with.
pub fn clocks(bytes: &[u8]) {
    let Ok(file) = ClockFile::parse(bytes) else { return };
    if checks::is_packed(bytes) {
        return;
    }
    assert!((0.1..=7_200.0).contains(&file.interval_s), "{}", file.interval_s);
    assert!(!file.records.is_empty());
    bounded(file.records.capacity(), size_of::<ClockRecord>(), bytes);
    for record in &file.records {
        assert!((1..=99).contains(&record.satellite.number), "{record:?}");
        assert!(record.clock_s.abs() <= MAX_CLOCK_S, "{record:?}");
    }
    assert!(file.records.is_sorted_by_key(|record| record.time));

    let records: Vec<ClockRecord> = file.records.iter().take(MOST).copied().collect();
    let mut products = Products::new(vec![orbit(&records)], Vec::new());
    products.add_clocks(vec![file.clone(), file]);
    let span = products.clock_coverage();
    assert!(span.is_some_and(|(first, last)| first <= last), "{span:?}");
    for ClockRecord { satellite, time, .. } in records {
        for time in
            [0.0, -15.0, 7.0, 300.0, 899.5].map(|offset_s| time + offset_s).into_iter().chain(extremes())
        {
            let Ok(state) = products.satellite_state(satellite, time) else { continue };
            checks::finite(&state, &(satellite, time));
            assert!(state.clock_s.abs() <= MAX_STATE_CLOCK_S, "{satellite} {time}: {state:?}");
        }
    }
}

/// Circular orbits around the first of the records, for the satellites of all of them. Without clocks, so that theirs are used.
fn orbit(records: &[ClockRecord]) -> Sp3 {
    const RADIUS_M: f64 = 2.656e7;
    const RATE_RADPS: f64 = 7.3e-5;
    const INTERVAL_S: f64 = 300.0;
    let mut satellites: Vec<SatelliteId> = records.iter().map(|record| record.satellite).collect();
    satellites.sort_unstable();
    satellites.dedup();
    let start = records.first().map_or_else(GpsTime::default, |record| record.time);
    let mut positions = Vec::new();
    for step in -12..=24 {
        let elapsed_s = INTERVAL_S * f64::from(step);
        let (sin, cos) = (RATE_RADPS * elapsed_s).sin_cos();
        positions.extend(satellites.iter().map(|satellite| Sp3Position {
            satellite: *satellite,
            time: start + elapsed_s,
            position: Ecef::new(RADIUS_M * cos, 0.6 * RADIUS_M * sin, 0.8 * RADIUS_M * sin),
            clock_s: None,
        }));
    }
    Sp3 { interval_s: INTERVAL_S, epochs: 37, positions, skips: Skips::default() }
}

/// Bias-SINEX.
pub fn biases(bytes: &[u8]) {
    let Ok(file) = BiasFile::parse(bytes) else { return };
    if checks::is_packed(bytes) {
        return;
    }
    assert!(!file.biases.is_empty());
    bounded(file.biases.capacity(), size_of::<CodeBias>(), bytes);
    for bias in &file.biases {
        assert!((1..=99).contains(&bias.satellite.number), "{bias:?}");
        assert!(bias.bias_s.abs() <= MAX_BIAS_S, "{bias:?}");
        assert!(bias.end.is_none_or(|end| end > bias.start), "{bias:?}");
    }
    let biases: Vec<CodeBias> = file.biases.iter().take(MOST).copied().collect();
    // Biases go with precise orbits; any will do.
    let records: Vec<ClockRecord> = biases
        .iter()
        .map(|bias| ClockRecord { satellite: bias.satellite, time: bias.start, clock_s: 0.0 })
        .collect();
    let mut products = Products::new(vec![orbit(&records)], Vec::new());
    products.add_biases(file.clone());
    products.add_biases(file);
    let span = products.bias_coverage();
    assert!(span.is_some_and(|(first, last)| first < last), "{span:?}");
    for bias in biases {
        let ends = bias.end.into_iter().flat_map(|end| [end, end + 2.0]);
        let instants =
            [bias.start, bias.start - 1.0, bias.start + 3_600.0].into_iter().chain(ends).chain(extremes());
        // Bands and attributes that the satellite may not have, too.
        let SignalCode { band, attribute } = bias.signal;
        let signals = [bias.signal, SignalCode::new(band, b'X'), SignalCode::new(b'1', attribute)];
        let corrections_m: Vec<Option<f64>> = instants
            .flat_map(|time| signals.map(|signal| (time, signal)))
            .map(|(time, signal)| {
                products.group_delay_correction_m(
                    bias.satellite,
                    signal,
                    ClockReference::IonosphereFree,
                    time,
                )
            })
            .collect();
        // The first is that of the bias itself when it starts.
        assert!(corrections_m.first().is_some_and(Option::is_some), "{bias:?}");
        let limit_m = MAX_BIAS_S * SPEED_OF_LIGHT_MPS * (1.0 + 1e-9);
        let possible = corrections_m.iter().flatten().all(|correction_m| correction_m.abs() <= limit_m);
        assert!(possible, "{bias:?}: {corrections_m:?}");
    }
}

/// IONEX.
pub fn ionex(bytes: &[u8]) {
    let Ok(file) = Ionex::parse(bytes) else { return };
    if checks::is_packed(bytes) {
        return;
    }
    assert!(!file.maps.is_empty());
    // A map takes no more memory than its header's grid, and half of the grid's values must be there.
    assert!(file.maps.len() <= bytes.len() / 100, "{} maps", file.maps.len());
    assert!(file.maps.is_sorted_by_key(IonosphereMap::time));
    let times: Vec<GpsTime> = file.maps.iter().take(8).map(IonosphereMap::time).collect();
    let mut products = Products::default();
    products.add_ionosphere_maps(file);
    let span = products.ionosphere_map_coverage();
    assert!(span.is_some_and(|(first, last)| first <= last), "{span:?}");
    for time in times.into_iter().flat_map(|time| [time, time + 1_234.5, time - 0.25]).chain(extremes()) {
        for sight in sights(time) {
            let delay_m = products.ionosphere_delay_m(&sight, &mut Skips::default());
            let limit_m = MAX_TEC_TECU * MAX_SLANT * L1_DELAY_M;
            assert!((0.0..=limit_m).contains(&delay_m), "{sight:?}: {delay_m} m");
        }
    }
}

/// Views from all over the Earth, its poles and beyond the date line included, upwards, to the horizon and below it.
fn sights(time: GpsTime) -> impl Iterator<Item = LineOfSight> {
    const LATITUDES_DEG: [f64; 9] = [-90.0, -89.999_999, -60.0, -0.1, 0.0, 31.4, 75.0, 87.6, 90.0];
    const LONGITUDES_DEG: [f64; 9] =
        [-540.0, -180.0, -179.999_999, -77.5, 0.0, 114.3, 180.0, 359.999_999, 725.0];
    const ELEVATIONS_DEG: [f64; 3] = [-5.0, 12.0, 90.0];
    let places =
        LATITUDES_DEG.into_iter().flat_map(|latitude| LONGITUDES_DEG.map(|longitude| (latitude, longitude)));
    places.flat_map(move |(latitude_deg, longitude_deg)| {
        ELEVATIONS_DEG.map(|elevation_deg: f64| LineOfSight {
            receiver: Geodetic::from_degrees(latitude_deg, longitude_deg, 100.0),
            direction: Direction {
                azimuth_rad: (latitude_deg + longitude_deg).to_radians(),
                elevation_rad: elevation_deg.to_radians(),
            },
            time,
            frequency_hz: L1_HZ,
        })
    })
}

/// Instants that no file covers.
fn extremes() -> [GpsTime; 3] {
    [i64::MIN, 0, i64::MAX].map(GpsTime::from_nanos)
}

/// Room that is set aside is no more than some times the text.
fn bounded(capacity: usize, size: usize, bytes: &[u8]) {
    let (memory, limit) = (capacity * size, 4_096 + 8 * bytes.len());
    assert!(memory <= limit, "{capacity} records of {} bytes take {memory}, limit {limit}", bytes.len());
}
