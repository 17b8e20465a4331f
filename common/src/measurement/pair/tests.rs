use super::*;
use crate::constants::SPEED_OF_LIGHT_MPS;
use crate::frames::{Ecef, EcefVector};
use crate::gnss::{LossOfLock, Observation, SatelliteId};
use crate::skips::Reason;

const RANGE_M: f64 = 1_000.0;

/// A signal with a pseudorange of 1 km and an L1 ionospheric delay of `delay_l1_m`.
fn signal(satellite: &str, [band, attribute]: [u8; 2], delay_l1_m: f64) -> PreparedObservation {
    let satellite: SatelliteId = satellite.parse().unwrap();
    let signal = SignalCode::new(band, attribute);
    let frequency_hz = signal.frequency_hz(satellite.constellation, Some(0)).unwrap();
    let pseudorange_m = RANGE_M + delay_l1_m * (1_575.42e6 / frequency_hz).powi(2);
    PreparedObservation {
        observation: Observation {
            satellite,
            signal,
            pseudorange_m: Some(pseudorange_m),
            carrier_phase_cycles: None,
            doppler_hz: None,
            cn0_dbhz: Some(40.0),
            loss_of_lock: LossOfLock::default(),
        },
        frequency_hz,
        pseudorange_m,
        range_rate_mps: Some(frequency_hz / SPEED_OF_LIGHT_MPS),
        phase_m: None,
        position: Ecef::new(2e7, 1e7, 1e7),
        velocity: EcefVector::new(1.0, 2.0, 3.0),
        satellite_variance_m2: 0.5,
        usual_variance_m2: 0.5,
        signal_variance_m2: 0.0,
        code_sigma_m: None,
        stated: None,
        second: None,
    }
}

fn names(prepared: &[PreparedObservation]) -> Vec<String> {
    let name = |p: &PreparedObservation| p.second.map_or(p.observation.signal, |second| second.pair);
    prepared.iter().map(|p| format!("{} {}", p.observation.satellite, name(p))).collect()
}

#[test]
fn the_ionosphere_cancels() {
    let mut skips = Skips::default();
    for (satellite, codes, delay_m) in [
        ("G05", [*b"1C", *b"5Q"], 7.0),
        ("G05", [*b"1C", *b"2L"], 25.0),
        ("E07", [*b"1C", *b"5Q"], -3.0),
        ("E07", [*b"7Q", *b"1C"], 12.0),
        ("C30", [*b"2I", *b"5P"], 90.0),
        ("C12", [*b"2I", *b"6I"], 40.0),
        ("R03", [*b"1C", *b"2C"], 11.0),
        ("J02", [*b"1C", *b"5Q"], 11.0),
    ] {
        let signals = codes.map(|code| signal(satellite, code, delay_m)).to_vec();
        let combined = Ionosphere::Pair.form_pairs(signals.clone(), &mut skips);
        let [pair] = combined.as_slice() else { panic!("{satellite}: {:?}", names(&combined)) };
        assert!((pair.pseudorange_m - RANGE_M).abs() < 1e-9, "{satellite}: {}", pair.pseudorange_m);
        let higher = usize::from(signals[0].frequency_hz < signals[1].frequency_hz);
        assert_eq!(pair.range_rate_mps, signals[higher].range_rate_mps);
    }
    assert!(skips.is_empty(), "{skips}");
}

/// A delay of one signal, such as the receiver's, enters every pair with the same factor.
#[test]
fn other_delays_stay_and_are_the_same_for_every_satellite() {
    let clock = |satellite: &str| {
        let mut second = signal(satellite, *b"5Q", 5.0);
        second.pseudorange_m += 10.0;
        let pairs =
            Ionosphere::Pair.form_pairs(vec![signal(satellite, *b"1C", 5.0), second], &mut Skips::default());
        pairs[0].pseudorange_m - RANGE_M
    };
    let gamma = (1_575.42_f64 / 1_176.45).powi(2);
    assert!((clock("G01") + 10.0 / (gamma - 1.0)).abs() < 1e-9);
    assert!((clock("G01") - clock("G32")).abs() < 1e-9);
}

#[test]
fn the_bands_farthest_apart_make_the_pair() {
    let signals = vec![
        signal("G01", *b"2L", 1.0),
        signal("G02", *b"1C", 1.0),
        signal("G01", *b"1C", 1.0),
        signal("E01", *b"7Q", 1.0),
        signal("E01", *b"1C", 1.0),
        signal("E01", *b"1X", 1.0),
        signal("G01", *b"5Q", 1.0),
        signal("E01", *b"5Q", 1.0),
        signal("G03", *b"2L", 1.0),
        signal("G03", *b"5Q", 1.0),
    ];
    let mut skips = Skips::default();
    let pairs = Ionosphere::Pair.form_pairs(signals.clone(), &mut skips);
    assert_eq!(names(&pairs), ["G01 1+5", "G02 1C", "E01 1+5", "G03 2L", "G03 5Q"]);
    assert!(skips.is_empty(), "{skips}");
    let alone = Ionosphere::PairOnly.form_pairs(signals.clone(), &mut skips);
    assert_eq!(names(&alone), ["G01 1+5", "E01 1+5"]);
    assert_eq!(skips.count(Reason::NoSecondBandForPair), 3);
    assert_eq!(names(&Ionosphere::Model.form_pairs(signals.clone(), &mut skips)), names(&signals));
}

#[test]
fn a_signal_without_frequency_makes_no_pair() {
    let unknown = PreparedObservation { frequency_hz: f64::NAN, ..signal("R01", *b"1C", 1.0) };
    let signals = vec![unknown, signal("R01", *b"2C", 1.0)];
    assert_eq!(Ionosphere::Pair.form_pairs(signals, &mut Skips::default()).len(), 2);
}

#[test]
fn variances_are_propagated() {
    let mut second = signal("G01", *b"5Q", 0.0);
    second.signal_variance_m2 = 4.0;
    let pairs = Ionosphere::Pair.form_pairs(vec![signal("G01", *b"1C", 0.0), second], &mut Skips::default());
    let gamma = (1_575.42_f64 / 1_176.45).powi(2);
    let expected = (gamma * gamma * 2.0 + (3.0 + 4.0)) / (gamma - 1.0).powi(2);
    let variance_m2 = pairs[0].second.unwrap().variance_m2(2.0, 3.0);
    assert!((variance_m2 - expected).abs() < 1e-9, "{variance_m2} {expected}");
    let equal =
        SecondSignal { signal_variance_m2: 0.0, ..pairs[0].second.unwrap() }.variance_m2(1.0, 1.0).sqrt();
    assert!((equal - 2.588).abs() < 1e-3, "{equal}");
}

/// The factor of the variance also follows from the signal code of the pair.
#[test]
fn the_factor_of_the_variance_follows_from_the_name() {
    for (satellite, codes) in [
        ("G01", [*b"1C", *b"5Q"]),
        ("E01", [*b"1C", *b"7Q"]),
        ("C30", [*b"2I", *b"6I"]),
        ("R03", [*b"1C", *b"2C"]),
    ] {
        let signals = codes.map(|code| signal(satellite, code, 0.0)).to_vec();
        let constellation = signals[0].observation.satellite.constellation;
        assert_eq!(variance_factor(signals[0].observation.signal, constellation), 1.0);
        let second = Ionosphere::Pair.form_pairs(signals, &mut Skips::default())[0].second.unwrap();
        let factor = variance_factor(second.pair, constellation);
        assert!((factor - second.variance_m2(1.0, 1.0)).abs() < 1e-9, "{satellite}: {factor}");
        assert!(factor > 6.0);
    }
}

#[test]
fn a_pair_whose_first_signal_lacks_a_doppler_has_the_seconds_rate() {
    let first = PreparedObservation { range_rate_mps: None, ..signal("G01", *b"1C", 1.0) };
    let second = signal("G01", *b"5Q", 1.0);
    let rate_mps = second.range_rate_mps;
    let pairs = Ionosphere::Pair.form_pairs(vec![first, second], &mut Skips::default());
    assert!(rate_mps.is_some() && pairs[0].range_rate_mps == rate_mps);
}

#[test]
fn words_are_read_and_refused() {
    assert_eq!("model".parse(), Ok(Ionosphere::Model));
    assert_eq!("pair".parse(), Ok(Ionosphere::Pair));
    assert_eq!("pair-only".parse(), Ok(Ionosphere::PairOnly));
    let error = "free".parse::<Ionosphere>().unwrap_err();
    assert!(error.to_string().contains("'pair-only'"), "{error}");
}
