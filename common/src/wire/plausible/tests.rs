use super::super::example::{message, observation};
use super::*;
use crate::skips::Reason;

/// A change that makes an observation invalid.
type Spoil = fn(&mut CorrectedObservation);

/// A change that makes a message invalid.
type SpoilMessage = fn(&mut EpochMessage);

const SPOILS: [(&str, Spoil); 16] = [
    ("pseudorange", |o| o.pseudorange_m = f64::NAN),
    ("pseudorange", |o| o.pseudorange_m = 1e12),
    ("pseudorange", |o| o.pseudorange_m = 9e5),
    ("pseudorange sigma", |o| o.pseudorange_sigma_m = 0.0),
    ("pseudorange sigma", |o| o.pseudorange_sigma_m = -1.0),
    ("pseudorange sigma", |o| o.pseudorange_sigma_m = f64::INFINITY),
    ("corrected range rate", |o| o.range_rate.as_mut().unwrap().range_rate_mps = 7e4),
    ("range rate sigma", |o| o.range_rate.as_mut().unwrap().sigma_mps = f64::NAN),
    ("C/N0", |o| o.cn0_dbhz = Some(71.0)),
    ("azimuth", |o| o.direction.azimuth_rad = f64::NAN),
    ("elevation", |o| o.direction.elevation_rad = 45.0),
    ("satellite radius", |o| o.satellite_position = Ecef::new(0.0, 0.0, 6e6)),
    ("satellite radius", |o| o.satellite_position.0.y = f64::NAN),
    ("satellite speed", |o| o.satellite_velocity.0.z = f64::NEG_INFINITY),
    ("residual", |o| o.residual_m = Some(f64::NAN)),
    ("satellite number", |o| o.satellite.number = 0),
];

#[test]
fn a_good_message_passes_unchanged() {
    let mut skips = Skips::default();
    assert_eq!(message(30).validate(), Ok(()));
    assert_eq!(message(30).sanitise("HP30", &mut skips), Some(message(30)));
    assert!(skips.is_empty());
}

#[test]
fn ionosphere_free_pairs_pass_and_other_letters_do_not() {
    let mut pair = message(4);
    pair.observations[1].signal =
        SignalCode::pair(SignalCode::new(b'1', b'C'), SignalCode::new(b'5', b'Q')).unwrap();
    assert_eq!(pair.validate(), Ok(()));
    for band in [b'0', b'S', b'a', 0, 255] {
        pair.observations[1].signal.band = band;
        assert!(matches!(pair.validate(), Err(InvalidMessage::Signal { .. })), "{band}");
    }
}

/// Signals accepted by the decoders pass; signals that they refuse do not.
#[test]
fn signals_are_those_of_the_satellites() {
    for (satellite, code, passes) in [
        ("G01", b"1C", true),
        ("G01", b"1 ", true),
        ("C01", b"2 ", true),
        ("C01", b"7I", true),
        ("C19", b"7I", false),
        ("C19", b"7D", true),
        ("C19", b"1C", false),
        ("E01", b"5 ", true),
        ("E01", b"2 ", false),
        ("G01", b"5C", false),
        ("G01", b"1\0", false),
    ] {
        let mut one = message(1);
        one.observations[0].satellite = satellite.parse().unwrap();
        one.observations[0].signal = SignalCode::new(code[0], code[1]);
        assert_eq!(one.validate().is_ok(), passes, "{satellite} {}", code.escape_ascii());
        let mut skips = Skips::default();
        let kept = one.sanitise("HP30", &mut skips).unwrap().observations.len();
        assert_eq!((kept == 1, skips.is_empty()), (passes, passes), "{skips}");
    }
}

#[test]
fn a_bad_observation_goes_and_the_good_ones_stay() {
    for (quantity, spoil) in SPOILS {
        let mut bad = message(4);
        spoil(&mut bad.observations[2]);
        let error = bad.validate().unwrap_err();
        assert!(matches!(error, InvalidMessage::Observation { .. }), "{error}");
        let mut skips = Skips::default();
        let kept = bad.sanitise("HP30", &mut skips).unwrap();
        assert_eq!(kept.observations.len(), 3, "{quantity}");
        assert_eq!(kept.validate(), Ok(()));
        let (reason, skip) = skips.iter().next().unwrap();
        assert_eq!((reason, skip.count), (Reason::ObservationInMessage.text(), 1));
        assert!(
            skip.first.contains(quantity) && skip.first.contains("2020-08-13T14:19:01"),
            "{}",
            skip.first
        );
    }
}

#[test]
fn an_absurd_value_is_named_with_its_limits() {
    let mut bad = message(2);
    bad.observations[1].pseudorange_m = 3e12;
    let text = bad.validate().unwrap_err().to_string();
    assert_eq!(
        text,
        "G02 1C at 2020-08-13T14:19:01.999 GPS: corrected pseudorange (m) is 3e12, outside 1e6 to 1e9"
    );
}

#[test]
fn the_second_observation_of_a_signal_goes() {
    let mut bad = message(3);
    bad.observations.push(observation(2));
    assert!(matches!(bad.validate(), Err(InvalidMessage::Duplicate { .. })));
    let mut skips = Skips::default();
    assert_eq!(bad.sanitise("HP30", &mut skips), Some(message(3)));
    assert_eq!(skips.total(), 1);
}

#[test]
fn bad_parts_go_alone() {
    let spoils: [(Part, SpoilMessage); 14] = [
        (Part::Wls, |m| m.wls.as_mut().unwrap().position.0.x = 2e8),
        (Part::Wls, |m| m.wls.as_mut().unwrap().position_covariance[(1, 1)] = -1.0),
        (Part::Wls, |m| m.wls.as_mut().unwrap().position_covariance.fill(0.0)),
        (Part::Wls, |m| m.wls.as_mut().unwrap().position_covariance[(0, 1)] += 1.0),
        (Part::Wls, |m| m.wls.as_mut().unwrap().position_covariance.fill(1.0)),
        (Part::Wls, |m| m.wls.as_mut().unwrap().dops.pdop = f64::NAN),
        (Part::Wls, |m| m.wls.as_mut().unwrap().clocks_m[0].1 = f64::INFINITY),
        (Part::Local, |m| m.local.as_mut().unwrap().mean[8] = f64::NAN),
        (Part::Local, |m| m.local.as_mut().unwrap().covariance[(0, 5)] = f64::NAN),
        (Part::LocalIntegrity, |m| {
            m.local_integrity.as_mut().unwrap().protection.as_mut().unwrap().vertical_m = -1.0;
        }),
        (Part::GlobalTest, |m| m.raim.global_test.as_mut().unwrap().statistic = f64::NAN),
        (Part::Protection, |m| m.raim.protection.as_mut().unwrap().vertical_m = f64::NAN),
        (Part::Slope, |m| m.raim.slope.as_mut().unwrap().arp_m = -1.0),
        (Part::Velocity, |m| {
            m.raim.velocity.as_mut().unwrap().global_test.as_mut().unwrap().threshold = f64::INFINITY;
        }),
    ];
    for (part, spoil) in spoils {
        let mut bad = message(5);
        spoil(&mut bad);
        assert!(matches!(bad.validate(), Err(InvalidMessage::Part { part: found, .. }) if found == part));
        let mut skips = Skips::default();
        let mut expected = message(5);
        expected.drop_part(part);
        assert_eq!(bad.sanitise("HP30", &mut skips), Some(expected));
        assert_eq!(skips.count(Reason::PartOfMessage), 1);
    }
}

#[test]
fn hopeless_messages_are_refused_with_facts() {
    let spoils: [(&str, SpoilMessage); 5] = [
        ("'HP20' but came on the key of 'HP30'", |m| m.phone = "HP20".to_owned()),
        ("contains '*'", |m| m.phone = "*".to_owned()),
        ("outside 1980 to 2200", |m| m.time_gps = GpsTime::from_nanos(-1)),
        ("outside 1980 to 2200", |m| m.time_gps = GpsTime::from_nanos(i64::MAX)),
        ("257 observations", |m| m.observations = vec![observation(1); 257]),
    ];
    for (text, spoil) in spoils {
        let mut bad = message(1);
        spoil(&mut bad);
        let mut skips = Skips::default();
        assert_eq!(bad.sanitise("HP30", &mut skips), None);
        let (reason, skip) = skips.iter().next().unwrap();
        assert_eq!(reason, Reason::MessageRefused.text());
        assert!(skip.first.contains(text), "{}", skip.first);
    }
}

#[test]
fn a_pace_is_within_an_hour() {
    for due_in_s in [0.0, -3_600.0, 3_600.0] {
        assert!(PaceMessage { due_in_s }.validate().is_ok());
    }
    for due_in_s in [3_601.0, f64::NAN, f64::INFINITY] {
        assert!(PaceMessage { due_in_s }.validate().is_err());
    }
}
