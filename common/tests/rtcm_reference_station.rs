//! GLONASS ephemerides and station positions, written bit by bit here and by another implementation (rtcm-rs).

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

mod rtcm_support;

use cofix_common::formats::decode::{Decoder, Record};
use cofix_common::formats::rtcm::{RtcmDecoder, RtcmOptions, Station};
use cofix_common::orbit::GlonassEphemeris;
use cofix_common::skips::{Reason, Skips};
use rtcm_support::{NOW, Writer, decode, frame_of};

/// The fields that tests change. Numbers are as sent.
#[derive(Clone, Copy)]
struct Sent {
    slot: u64,
    channel: u64,
    almanac: (u64, u64),
    health: u64,
    interval: u64,
    x: i64,
    unhealthy: u64,
    tau: i64,
    l2_delay: u64,
    accuracy: u64,
    day: u64,
    modern: u64,
}

/// A satellite at 17:15 in Moscow, 69 quarters of an hour into the day; 14:19:53 GPST is 17:19:35 there.
const SENT: Sent = Sent {
    slot: 9,
    channel: 5,
    almanac: (1, 1),
    health: 0,
    interval: 69,
    x: 40_218_254,
    unhealthy: 0,
    tau: -188_052,
    l2_delay: 0b1_0100,
    accuracy: 5,
    day: 226,
    modern: 1,
};

fn message(sent: Sent) -> Vec<u8> {
    Writer::default()
        .unsigned(12, 1020)
        .unsigned(6, sent.slot)
        .unsigned(5, sent.channel)
        .unsigned(1, sent.almanac.0)
        .unsigned(1, sent.almanac.1)
        .unsigned(2, 1)
        .unsigned(12, 2_492)
        .unsigned(1, sent.health)
        .unsigned(1, 1)
        .unsigned(7, sent.interval)
        .signed(24, -2_159_766)
        .signed(27, sent.x)
        .signed(5, 0)
        .signed(24, 885_946)
        .signed(27, 67_807)
        .signed(5, -2)
        .signed(24, -2_618_952)
        .signed(27, -33_212_595)
        .signed(5, 3)
        .unsigned(1, 1)
        .signed(11, -2)
        .unsigned(2, 3)
        .unsigned(1, sent.unhealthy)
        .signed(22, sent.tau)
        .unsigned(5, sent.l2_delay)
        .unsigned(5, 7)
        .unsigned(1, 1)
        .unsigned(4, sent.accuracy)
        .unsigned(11, sent.day)
        .unsigned(2, sent.modern)
        .unsigned(1, 1)
        .unsigned(11, 226)
        .signed(32, -3)
        .unsigned(5, 7)
        .signed(22, 8)
        .unsigned(1, 0)
        .unsigned(7, 0)
        .frame()
}

fn outcome(frame: &[u8]) -> (Vec<Record>, Skips) {
    decode(&[frame])
}

fn ephemeris(sent: Sent) -> GlonassEphemeris {
    match outcome(&message(sent)) {
        (records, skips) if skips.is_empty() => match records.as_slice() {
            [Record::Glonass(ephemeris)] => **ephemeris,
            other => panic!("{other:?}"),
        },
        (_, skips) => panic!("{skips}"),
    }
}

#[test]
fn every_field_has_its_place_sign_and_unit() {
    let e = ephemeris(SENT);
    assert_eq!((e.satellite.to_string(), e.frequency_channel), ("R09".to_owned(), -2));
    // 17:15:00 in Moscow is 14:15:00 UTC.
    assert_eq!(e.toe, "2020-08-13T14:15:18".parse().unwrap());
    let kilometres = |numbers: [i64; 3], bits: i32| numbers.map(|n| n as f64 * 1e3 * 2_f64.powi(-bits));
    assert_eq!(<[f64; 3]>::from(e.position.0), kilometres([40_218_254, 67_807, -33_212_595], 11));
    assert_eq!(<[f64; 3]>::from(e.velocity.0), kilometres([-2_159_766, 885_946, -2_618_952], 20));
    assert_eq!(<[f64; 3]>::from(e.acceleration.0), kilometres([0, -2, 3], 30));
    assert_eq!(e.tau_s, -188_052.0 * 2_f64.powi(-30));
    assert_eq!(e.gamma, -2.0 * 2_f64.powi(-40));
    assert_eq!(e.l2_delay_s, Some(-4.0 * 2_f64.powi(-30)));
    assert_eq!((e.health, e.health_flags, e.age_days, e.accuracy_m), (Some(0), Some(0b011), 7.0, 7.0));
    assert!(e.is_healthy());
}

#[test]
fn flags_make_a_satellite_unhealthy() {
    assert!(!ephemeris(Sent { health: 1, ..SENT }).is_healthy());
    assert!(!ephemeris(Sent { unhealthy: 1, ..SENT }).is_healthy());
    assert!(!ephemeris(Sent { almanac: (0, 1), ..SENT }).is_healthy());
    assert!(ephemeris(Sent { almanac: (0, 0), ..SENT }).is_healthy(), "the almanac says nothing");
}

#[test]
fn what_only_later_satellites_send_is_not_taken_from_older_ones() {
    let e = ephemeris(Sent { modern: 0, unhealthy: 1, day: 1_000, ..SENT });
    assert_eq!((e.l2_delay_s, e.accuracy_m), (None, 5.0));
    assert!(e.is_healthy());
    assert_eq!(e.toe, "2020-08-13T14:15:18".parse().unwrap());
    assert_eq!(ephemeris(Sent { l2_delay: 0b1_0000, ..SENT }).l2_delay_s, None, "minus zero");
    assert_eq!(ephemeris(Sent { l2_delay: 0, ..SENT }).l2_delay_s, Some(0.0));
}

/// Before the first observations the day that is sent counts, afterwards the stream's own time.
#[test]
fn the_date_is_completed() {
    assert_eq!(ephemeris(Sent { day: 224, ..SENT }).toe, "2020-08-11T14:15:18".parse().unwrap());
    let near = "2020-08-10T12:00:00".parse().unwrap();
    let mut decoder = RtcmDecoder::new(RtcmOptions::near(near));
    decoder.feed(&message(SENT)).unwrap();
    let Some(Record::Glonass(e)) = decoder.next_record() else { panic!("{}", decoder.skips()) };
    assert_eq!(e.toe, "2020-08-13T14:15:18".parse().unwrap());
}

#[test]
fn a_repeated_message_gives_one_record_and_an_absurd_one_none() {
    let stream = [
        message(SENT),
        message(SENT),
        message(Sent { interval: 71, ..SENT }),
        message(Sent { x: 1, ..SENT }),
        message(Sent { slot: 0, ..SENT }),
        message(Sent { channel: 21, ..SENT }),
        message(Sent { interval: 96, ..SENT }),
        frame_of(&message(SENT)[3..30]),
    ];
    let (records, skips) = outcome(&stream.concat());
    assert_eq!(records.len(), 2);
    assert_eq!(skips.count(Reason::EphemerisImpossible), 4, "{skips}");
    assert_eq!(skips.count(Reason::MessageTooShort), 1, "{skips}");
}

fn station(frame: &[u8]) -> (Option<Station>, Skips) {
    let mut decoder = RtcmDecoder::new(RtcmOptions::near(NOW.parse().unwrap()));
    decoder.feed(frame).unwrap();
    (decoder.station(), decoder.skips().clone())
}

/// The example of the standard (RTCM 10403.3, section 4.2).
#[test]
fn the_standards_own_example() {
    let frame = [
        0xd3, 0x00, 0x13, 0x3e, 0xd7, 0xd3, 0x02, 0x02, 0x98, 0x0e, 0xde, 0xef, 0x34, 0xb4, 0xbd, 0x62, 0xac,
        0x09, 0x41, 0x98, 0x6f, 0x33, 0x36, 0x0b, 0x98,
    ];
    let (station, skips) = station(&frame);
    let station = station.unwrap();
    assert_eq!((station.id, station.antenna_height_m), (2003, None));
    let expected = nalgebra::Vector3::new(1_114_104.599_9, -4_850_729.710_8, 3_975_521.464_3);
    assert!((station.position.0 - expected).norm() < 1e-8, "{station:?}");
    assert!(skips.is_empty(), "{skips}");
}

fn station_message(number: u64, coordinates_tenth_mm: [i64; 3]) -> Writer {
    let [x, y, z] = coordinates_tenth_mm;
    Writer::default()
        .unsigned(12, number)
        .unsigned(12, 4_095)
        .unsigned(10, 0)
        .twos_complement(38, x)
        .unsigned(2, 3)
        .twos_complement(38, y)
        .unsigned(2, 3)
        .twos_complement(38, z)
}

#[test]
fn heights_are_read_and_absurd_positions_refused() {
    let place = [-38_176_811_213, 35_628_394_311, 36_501_591_593];
    let frame = station_message(1006, place).unsigned(16, 15_000).frame();
    let known = station(&frame).0.unwrap();
    assert_eq!((known.id, known.antenna_height_m), (4095, Some(1.5)));
    assert!((known.position.0.x + 3_817_681.121_3).abs() < 1e-8);
    let short = station_message(1006, place).frame();
    assert_eq!(station(&short).1.count(Reason::MessageTooShort), 1);
    for place in [[0, 0, 0], [1 << 36, 0, 0]] {
        let (refused, skips) = station(&station_message(1005, place).frame());
        assert_eq!((refused, skips.count(Reason::StationPositionImpossible)), (None, 1), "{skips}");
    }
}
