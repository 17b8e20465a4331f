//! GLONASS strings to ephemerides.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod broadcast_words;
mod navbits_encoder;
mod vectors;

use broadcast_words::r01;
use cofix_common::formats::navbits::{
    GlonassAssembler, GlonassClock, GlonassLabel, GlonassMessage, GlonassName, ReceiverCheck,
};
use cofix_common::orbit::GlonassEphemeris;
use cofix_common::orbit::NavigationFile;
use cofix_common::skips::Reason;
use cofix_common::time::GpsTime;
use navbits_encoder::Bits;
use navbits_encoder::glonass::{Frame, at_the_low_end, strings, with_check_bits};
use proptest::prelude::*;
use vectors::{Table, beside::required, distance_m, glonass};

/// When the quoted frame was sent: 16 leap seconds.
fn then() -> GpsTime {
    "2015-06-27T00:40:16".parse().unwrap()
}

const LABEL: GlonassLabel =
    GlonassLabel { name: GlonassName::Slot(1), frame: 1, string: None, receiver: ReceiverCheck::Unknown };

fn clock(now: GpsTime) -> GlonassClock {
    GlonassClock { now, leap_seconds: if now < "2017-01-01T00:00:18".parse().unwrap() { 16 } else { 18 } }
}

/// Feeds strings; gives the message of the last one.
fn read(label: GlonassLabel, strings: &[Vec<u8>], now: GpsTime) -> Result<Option<GlonassMessage>, String> {
    let mut assembler = GlonassAssembler::default();
    let mut last = None;
    for (string, number) in strings.iter().zip(1..) {
        let label = GlonassLabel { string: Some(number), ..label };
        last = assembler.string(label, string, clock(now)).map_err(|e| e.to_string())?;
    }
    Ok(last)
}

fn r01_on(channel: i8) -> GlonassEphemeris {
    read(LABEL, &r01(), then()).unwrap().unwrap().on_channel(channel)
}

#[test]
fn as_broadcast() {
    let e = r01_on(1);
    assert_eq!((e.satellite.to_string(), e.frequency_channel), ("R01".to_owned(), 1));
    assert_eq!(e.toe.to_string(), "2015-06-27T00:45:16.000 GPS", "3:45 in Moscow");
    assert_eq!((e.health, e.health_flags, e.is_healthy()), (Some(0), Some(0), true));
    assert!((25.4e6..25.6e6).contains(&e.position.0.norm()), "{e:?}");
    assert!((3e3..4e3).contains(&e.velocity.0.norm()) && e.tau_s.abs() < 1e-3 && e.gamma.abs() < 1e-10);
    assert!(e.acceleration.0.norm() < 1e-5, "{e:?}");
}

/// Strings at either end of their bytes, or without check bits.
#[test]
fn all_forms_of_strings_are_read() {
    let expected = read(LABEL, &r01(), then());
    let low: Vec<_> = r01().iter().map(|string| at_the_low_end(string)).collect();
    assert_eq!(read(LABEL, &low, then()), expected);
    let blank = |string: &Vec<u8>| {
        let mut blank = string.clone();
        blank[9] &= 0xf8;
        blank[10] = 0;
        blank
    };
    let blanked: Vec<_> = r01().iter().map(blank).collect();
    let low: Vec<_> = blanked.iter().map(|string| at_the_low_end(string)).collect();
    for strings in [blanked, low] {
        let passed = GlonassLabel { receiver: ReceiverCheck::Passed, ..LABEL };
        assert_eq!(read(passed, &strings, then()), expected);
        assert!(read(LABEL, &strings, then()).unwrap_err().contains("check bits"));
    }
}

/// Turned over as a whole, or but for the bits that are left over behind it.
#[test]
fn strings_may_be_turned_over() {
    let expected = read(LABEL, &r01(), then());
    let turn = |string: &Vec<u8>| string.iter().map(|byte| !byte).collect::<Vec<u8>>();
    let turned: Vec<_> = r01().iter().map(turn).collect();
    let low: Vec<_> = r01().iter().map(|string| turn(&at_the_low_end(string))).collect();
    let but_spare: Vec<_> = turned
        .iter()
        .map(|string| {
            let mut clear = string.clone();
            clear[10] &= 0xf8;
            clear
        })
        .collect();
    for strings in [but_spare, turned, low] {
        assert_eq!(read(LABEL, &strings, then()), expected);
    }
}

/// Two wrong bits, too: the code tells up to three.
#[test]
fn one_or_two_wrong_bits_are_refused() {
    let flip = |string: &mut [u8], bit: usize| string[bit / 8] ^= 0x80 >> (bit % 8);
    for (string, number) in r01().iter().zip(1..) {
        for (first, second) in (0..85).flat_map(|first| (first..85).map(move |second| (first, second))) {
            let mut damaged = string.clone();
            flip(&mut damaged, first);
            if first != second {
                flip(&mut damaged, second);
            }
            for receiver in [ReceiverCheck::Unknown, ReceiverCheck::Passed] {
                let label = GlonassLabel { string: Some(number), receiver, ..LABEL };
                let result = GlonassAssembler::default().string(label, &damaged, clock(then()));
                assert!(result.is_err(), "string {number}, bits {first} and {second}");
            }
        }
    }
}

#[test]
fn strings_of_different_frames_do_not_mix() {
    let e = r01_on(1);
    let frame = |seconds: f64| Frame { sent: then() + seconds, leap_seconds: 16, is_modern: true };
    let later = strings(&GlonassEphemeris { tau_s: 1e-5, ..e }, frame(30.0));
    let mut assembler = GlonassAssembler::default();
    // Strings with the number of their frame and the time; what the last one gives.
    let mut feed = |pieces: &[(&[u8], i64, f64)]| {
        let one = |(string, frame, seconds): &(&[u8], i64, f64)| {
            let label = GlonassLabel { frame: *frame, ..LABEL };
            assembler.string(label, string, clock(then() + *seconds)).unwrap()
        };
        pieces.iter().map(one).last().unwrap().map(|message| message.on_channel(1).tau_s)
    };
    let first = r01();
    let [a, b, c, d] = [&first[0], &first[1], &first[2], &first[3]].map(Vec::as_slice);
    let other = later[3].as_slice();
    // String 4 of the next frame: by the frame's number, by the time, by the order.
    assert_eq!(feed(&[(a, 1, 0.0), (b, 1, 2.0), (c, 1, 4.0), (other, 2, 6.0)]), None);
    assert_eq!(feed(&[(a, 1, 100.0), (b, 1, 102.0), (c, 1, 104.0), (other, 1, 136.0)]), None);
    assert_eq!(feed(&[(b, 1, 202.0), (c, 1, 202.0), (a, 1, 202.0), (d, 1, 202.0)]), None);
    assert_eq!(feed(&[(a, 3, 302.0), (b, 3, 302.0), (c, 3, 302.0), (d, 3, 302.0)]), Some(e.tau_s));
    assert_eq!(feed(&[(d, 3, 303.0)]), None, "the same again is not given again");
    assert_eq!(
        feed(&[(a, 4, 332.0), (b, 4, 332.0), (c, 4, 332.0), (d, 4, 332.0)]),
        None,
        "nor in the next frame"
    );
    let [a, b, c, d] = later.each_ref().map(Vec::as_slice);
    let given = feed(&[(a, 5, 362.0), (b, 5, 364.0), (c, 5, 366.0), (d, 5, 368.0)]).unwrap();
    assert!((given - 1e-5).abs() < 1e-9, "{given}");
}

/// While a phone does not know the slot it names the satellite by its channel, and the message has the slot.
#[test]
fn a_satellite_known_by_its_channel_gets_its_slot() {
    let by_channel = GlonassLabel { name: GlonassName::Channel(-4), ..LABEL };
    let message = read(by_channel, &r01(), then()).unwrap().unwrap();
    assert_eq!((message.slot(), message.channel()), (1, Some(-4)));
    assert_eq!(read(LABEL, &r01(), then()).unwrap().unwrap().channel(), None);
    let other = GlonassLabel { name: GlonassName::Slot(2), ..LABEL };
    assert!(read(other, &r01(), then()).unwrap_err().contains("another satellite: R02: slot 1"));
    // Satellites before GLONASS-M do not say it, nor the day.
    let frame = Frame { sent: then(), leap_seconds: 16, is_modern: false };
    let old = strings(&r01_on(1), frame).to_vec();
    assert!(read(by_channel, &old, then()).unwrap_err().contains("unknown slot"));
    let e = read(LABEL, &old, then() + 20_000.0).unwrap().unwrap().on_channel(1);
    assert_eq!((e.toe, e.accuracy_m, e.l2_delay_s), (r01_on(1).toe, 5.0, None));
}

#[test]
fn what_cannot_be_is_refused() {
    let e = r01_on(1);
    let frame = Frame { sent: then(), leap_seconds: 16, is_modern: true };
    let refusal =
        |e: &GlonassEphemeris, frame: Frame, now: GpsTime| read(LABEL, &strings(e, frame), now).unwrap_err();
    assert!(refusal(&e, frame, then() + 100_000.0).contains("another day"));
    assert_eq!(read(LABEL, &r01(), then() + 80_000.0).unwrap().unwrap().on_channel(1), e, "a day off");
    let late = Frame { sent: then() + 7_200.0, ..frame };
    assert!(refusal(&e, late, then()).contains("from the frame's t_k"), "{}", refusal(&e, late, then()));
    let mut low = e;
    low.position.0 *= 0.1;
    assert!(refusal(&low, frame, then()).contains("distance from the Earth's centre"));
    let mut slow = e;
    slow.velocity.0 *= 0.0;
    assert!(refusal(&slow, frame, then()).contains("speed"));
    let mut assembler = GlonassAssembler::default();
    let mut fails = |bytes: &[u8]| assembler.string(LABEL, bytes, clock(then())).unwrap_err().reason;
    assert_eq!(fails(&r01()[0][1..]), Reason::GlonassStringWrongLength);
    assert_eq!(fails(&[0; 11]), Reason::GlonassStringImpossibleNumber);
    let mut bits = Bits::default();
    bits.put(0, 1).put(2, 4).put(0, 4).put(96, 7).put(0, 61);
    let mut one = r01();
    one[1] = with_check_bits(&bits);
    assert!(read(LABEL, &one, then()).unwrap_err().contains("t_b = 96"));
}

/// Unhealthy satellites: B_n, and l_n of string 3.
#[test]
fn health_comes_back() {
    let frame = Frame { sent: then(), leap_seconds: 16, is_modern: true };
    for (health, flags) in [(0, 0), (1, 0), (0, 4), (1, 4)] {
        let sick = GlonassEphemeris { health: Some(health), health_flags: Some(flags), ..r01_on(1) };
        let e = read(LABEL, &strings(&sick, frame), then()).unwrap().unwrap().on_channel(1);
        assert_eq!(e, sick);
        assert_eq!(e.is_healthy(), health == 0 && flags == 0);
    }
}

/// The frame that an ephemeris is sent in: the minute after its interval's beginning.
fn frame_of(e: &GlonassEphemeris) -> Frame {
    Frame { sent: e.toe - 840.0, leap_seconds: 18, is_modern: true }
}

fn label_of(e: &GlonassEphemeris) -> GlonassLabel {
    GlonassLabel { name: GlonassName::Slot(e.satellite.number), ..LABEL }
}

/// Reference vectors: parameters as bits and back, then the satellite's position.
#[test]
#[ignore = "needs the reference data"]
fn vectors_come_back_from_their_strings() {
    let table = Table::read("oracle/sat/glonass_vectors_brd4.csv");
    let (mut rows, mut worst_m, mut worst_s) = (0, 0.0_f64, 0.0_f64);
    for row in &table.rows {
        let mut expected = glonass(&table, row);
        // Their health is B_n + 2·flags.
        let health = expected.health.unwrap();
        (expected.health, expected.health_flags) = (Some(health & 1), Some(health >> 1 & 4));
        let frame = frame_of(&expected);
        let message = read(label_of(&expected), &strings(&expected, frame), frame.sent).unwrap().unwrap();
        let e = message.on_channel(expected.frequency_channel);
        assert_eq!((e.toe, e.health, e.health_flags), (expected.toe, expected.health, expected.health_flags));
        let state = e.state(table.time(row, ""));
        worst_m = worst_m.max(distance_m(&table, row, state.position));
        worst_s = worst_s.max((state.clock_s - table.number(row, "clk_s")).abs());
        rows += 1;
    }
    println!("{rows} rows: {worst_m:e} m, {worst_s:e} s");
    assert!(rows == 260 && worst_m <= 1.4e-3 && worst_s < 1e-15, "{rows}: {worst_m} m, {worst_s} s");
}

/// Every record of a broadcast file.
#[test]
#[ignore = "needs the reference data"]
fn a_broadcast_file_comes_back_from_its_strings() {
    let path = "oracle/inputs/BRD400DLR_20230710000_as_rnx305_GRECJI.rnx.gz";
    let bytes = required(path);
    let file = NavigationFile::parse(&bytes).unwrap();
    let (mut with_delay, mut worst_m, mut worst_s) = (0, 0.0_f64, 0.0_f64);
    for expected in &file.glonass {
        let frame = frame_of(expected);
        let message = read(label_of(expected), &strings(expected, frame), frame.sent).unwrap().unwrap();
        let e = message.on_channel(expected.frequency_channel);
        assert_eq!((e.satellite, e.toe, e.health), (expected.satellite, expected.toe, expected.health));
        assert_eq!((e.age_days, e.accuracy_m), (expected.age_days, expected.accuracy_m));
        if let (Some(a), Some(b)) = (e.l2_delay_s, expected.l2_delay_s) {
            assert!((a - b).abs() < 1e-18, "{a:e} {b:e}");
            with_delay += 1;
        }
        for elapsed_s in [-900.0, 0.0, 900.0] {
            let (a, b) = (e.state(e.toe + elapsed_s), expected.state(e.toe + elapsed_s));
            worst_m = worst_m.max(a.position.distance_m(b.position));
            worst_s = worst_s.max((a.clock_s - b.clock_s).abs());
        }
    }
    println!("{} records, {with_delay} with an L2 delay: {worst_m:e} m, {worst_s:e} s", file.glonass.len());
    assert_eq!((file.glonass.len(), with_delay), (1_240, 1_239));
    assert!(worst_m < 1e-4 && worst_s < 1e-15, "{worst_m} m, {worst_s} s");
}

proptest! {
    #[test]
    fn any_bytes_do_no_harm(bytes in prop::collection::vec(any::<u8>(), 10..13), nanos in any::<i64>(), passed in any::<bool>()) {
        let receiver = if passed { ReceiverCheck::Passed } else { ReceiverCheck::Unknown };
        let label = GlonassLabel { receiver, ..LABEL };
        let clock = GlonassClock { now: GpsTime::from_nanos(nanos), leap_seconds: 18 };
        let _ = GlonassAssembler::default().string(label, &bytes, clock);
    }

    /// With the check bits right, any numbers in the fields of a frame.
    #[test]
    fn any_fields_do_no_harm(contents in prop::array::uniform4(any::<[u8; 9]>()), nanos in any::<i64>()) {
        let mut assembler = GlonassAssembler::default();
        let clock = GlonassClock { now: GpsTime::from_nanos(nanos), leap_seconds: 18 };
        for (number, content) in (1..).zip(&contents) {
            let mut bits = Bits::default();
            bits.put(0, 1).put(number, 4);
            for byte in content {
                bits.put((*byte).into(), 8);
            }
            if let Ok(Some(message)) = assembler.string(LABEL, &with_check_bits(&bits), clock) {
                let e = message.on_channel(0);
                prop_assert!(e.state(e.toe + 600.0).position.is_finite());
            }
        }
    }

    /// Whatever real numbers are in a frame, a wrong bit of it is seen.
    #[test]
    fn a_wrong_bit_is_seen(tau_s in -1e-3..1e-3, gamma in -9e-10..9e-10, string in 0..4_usize, bit in 0..85_usize) {
        let e = GlonassEphemeris { tau_s, gamma, ..r01_on(1) };
        let mut strings = strings(&e, Frame { sent: then(), leap_seconds: 16, is_modern: true }).to_vec();
        prop_assert!(read(LABEL, &strings, then()).unwrap().is_some());
        strings[string][bit / 8] ^= 0x80 >> (bit % 8);
        prop_assert!(read(LABEL, &strings, then()).unwrap_err().contains("check bits"));
    }
}
