//! BeiDou D1 and D2 bits to ephemerides.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod broadcast_words;
mod navbits_encoder;
mod vectors;

use broadcast_words::{C06, c01};
use cofix_common::atmosphere::KlobucharCoefficients;
use cofix_common::formats::navbits::{BeidouAssembler, ReceiverCheck};
use cofix_common::gnss::{Constellation, SatelliteId};
use cofix_common::orbit::KeplerEphemeris;
use cofix_common::orbit::NavigationFile;
use cofix_common::skips::Reason;
use cofix_common::time::GpsTime;
use navbits_encoder::beidou::{as_sent, d1, d2};
use proptest::prelude::*;
use vectors::{Table, beside::required, distance_m, kepler};

const NONE: KlobucharCoefficients = KlobucharCoefficients { alpha: [0.0; 4], beta: [0.0; 4] };

fn satellite(name: &str) -> SatelliteId {
    name.parse().unwrap()
}

fn bytes(words: &[u32; 10]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_be_bytes()).collect()
}

/// When the quoted messages were sent.
fn then() -> GpsTime {
    GpsTime::from_beidou_week_tow(810, 345_614.0)
}

/// Feeds subframes; gives the ephemeris of the last one.
fn read(
    satellite: SatelliteId,
    subframes: &[[u32; 10]],
    receiver: ReceiverCheck,
    now: GpsTime,
) -> Result<Option<KeplerEphemeris>, String> {
    let mut assembler = BeidouAssembler::default();
    let mut last = None;
    for words in subframes {
        last = assembler.subframe(satellite, &bytes(words), receiver, now).map_err(|e| e.to_string())?;
    }
    Ok(last)
}

fn near(value: f64, expected: f64, relative: f64) -> bool {
    (value - expected).abs() <= relative * expected.abs()
}

/// C06 is in an inclined geosynchronous orbit.
#[test]
fn d1_as_broadcast() {
    let e = read(satellite("C06"), &C06, ReceiverCheck::Unknown, then()).unwrap().unwrap();
    assert_eq!(e.toe, GpsTime::from_beidou_week_tow(810, 345_600.0));
    assert_eq!((e.toc, e.toe_own_tow_s, e.issue_of_data, e.health), (e.toe, 345_600.0, 1, 0.0));
    assert_eq!(e.accuracy_m, 2.0);
    assert!(near(e.sqrt_a.powi(2), 42_164e3, 1e-3) && near(e.i0_rad.to_degrees(), 54.5, 0.03), "{e:?}");
    assert!((0.002..0.02).contains(&e.eccentricity));
    // Between those of broadcast files of 2020 (8.4 and -2.6 ns) and 2023 (8.2 and -1.4 ns).
    assert!(near(e.group_delays_s.0, 8.2e-9, 1e-6) && near(e.group_delays_s.1, -1.9e-9, 1e-6));
    let mut assembler = BeidouAssembler::default();
    assembler.subframe(e.satellite, &bytes(&C06[0]), ReceiverCheck::Unknown, then()).unwrap();
    let klobuchar = assembler.klobuchar().unwrap();
    assert!(klobuchar.alpha.iter().all(|a| a.abs() < 1e-5) && klobuchar.beta[0] > 1e4, "{klobuchar:?}");
    // D2 has the same terms in its second page.
    assembler.subframe(satellite("C01"), &bytes(&c01()[1]), ReceiverCheck::Unknown, then()).unwrap();
    assert_eq!(assembler.klobuchar(), Some(klobuchar));
}

/// C01 stands above 144.5° east.
#[test]
fn d2_as_broadcast() {
    let pages = c01();
    let e = read(satellite("C01"), &pages, ReceiverCheck::Unknown, then()).unwrap().unwrap();
    assert_eq!(e.toe, GpsTime::from_beidou_week_tow(810, 345_600.0));
    assert_eq!((e.toc, e.toe_own_tow_s, e.health), (e.toe, 345_600.0, 0.0));
    let position = e.state(e.toe).position.0;
    assert!(near(position.norm(), 42_164e3, 1e-3), "{position}");
    let longitude_deg = position.y.atan2(position.x).to_degrees();
    assert!((longitude_deg - 144.5).abs() < 0.3 && position.z.abs() < 2e6, "{longitude_deg} {position}");
    // The page with nothing but ionosphere terms may be missing, another one not.
    for missing in 0..10 {
        let mut some = pages.clone();
        some.remove(missing);
        let without = read(satellite("C01"), &some, ReceiverCheck::Unknown, then()).unwrap();
        assert_eq!(without, Some(e).filter(|_| missing == 1), "page {}", missing + 1);
    }
}

/// Receivers give words at either end of their four bytes, of either sign, as sent or with the blocks taken apart, or without check
/// bits.
#[test]
fn all_forms_of_words_are_read() {
    for (name, subframes) in [("C06", C06.to_vec()), ("C01", c01())] {
        let read = |change: &dyn Fn(&[u32; 10]) -> [u32; 10], receiver| {
            let changed: Vec<_> = subframes.iter().map(change).collect();
            read(satellite(name), &changed, receiver, then())
        };
        let expected = read(&|words| *words, ReceiverCheck::Unknown).unwrap().unwrap();
        let high = |words: &[u32; 10]| words.map(|w| w << 2);
        let negative = |words: &[u32; 10]| words.map(|w| w ^ 0x3fff_ffff);
        let sent_negative = |words: &[u32; 10]| negative(&as_sent(words));
        for change in [&high as &dyn Fn(&[u32; 10]) -> [u32; 10], &negative, &as_sent, &sent_negative] {
            assert_eq!(read(change, ReceiverCheck::Unknown), Ok(Some(expected)), "{name}");
        }
        // Tracked half a cycle off, with the data bits put right.
        let checks_negative = |words: &[u32; 10]| {
            let mut turned = words.map(|w| w ^ 0xff);
            turned[0] = words[0] ^ 0xf;
            turned
        };
        assert_eq!(read(&checks_negative, ReceiverCheck::Unknown), Ok(Some(expected)), "{name}");
        let blank = |words: &[u32; 10]| {
            let mut blank = words.map(|w| w & !0xff);
            blank[0] = words[0] & !0xf;
            blank
        };
        assert_eq!(read(&blank, ReceiverCheck::Passed), Ok(Some(expected)), "{name}");
        let refused = read(&blank, ReceiverCheck::Unknown).unwrap_err();
        assert!(refused.contains("check bits"), "{refused}");
    }
}

/// The four reserved bits of word 1 have no check bits; of D2 pages the second half is reserved.
#[test]
fn any_single_wrong_bit_is_refused() {
    for (name, subframes, used) in [("C06", C06.to_vec(), 300), ("C01", c01(), 150)] {
        for (words, form) in subframes.iter().flat_map(|w| [(*w, "taken apart"), (as_sent(w), "as sent")]) {
            for bit in 0..300 {
                let mut damaged = words;
                damaged[bit / 30] ^= 1 << (29 - bit % 30);
                let reserved = (11..15).contains(&bit) || bit >= used;
                for receiver in [ReceiverCheck::Unknown, ReceiverCheck::Passed] {
                    let result = BeidouAssembler::default().subframe(
                        satellite(name),
                        &bytes(&damaged),
                        receiver,
                        then(),
                    );
                    assert_eq!(result.is_ok(), reserved, "{name} {form}, bit {bit}");
                }
            }
        }
    }
}

#[test]
fn pieces_that_do_not_follow_each_other_do_not_mix() {
    let e = read(satellite("C06"), &C06, ReceiverCheck::Unknown, then()).unwrap().unwrap();
    let next = d1(&e, &NONE, then() + 30.0);
    let newer = KeplerEphemeris { sqrt_a: e.sqrt_a + 1.0, toe: e.toe + 3_600.0, toc: e.toc + 3_600.0, ..e };
    let newer = d1(&newer, &NONE, then() + 60.0);
    let mut assembler = BeidouAssembler::default();
    let mut feed = |words: &[u32; 10]| {
        assembler.subframe(e.satellite, &bytes(words), ReceiverCheck::Unknown, then()).unwrap()
    };
    assert_eq!(feed(&C06[0]), None);
    assert_eq!(feed(&next[1]), None, "half a minute later");
    assert_eq!(feed(&C06[2]), None);
    assert_eq!(feed(&C06[0]), None);
    assert_eq!(feed(&C06[1]).unwrap().toe, e.toe, "in any order");
    assert_eq!(feed(&C06[1]), None, "the same again is not given again");
    assert_eq!(next.iter().find_map(&mut feed), None, "nor when it is sent again");
    assert_eq!(feed(&newer[1]).or_else(|| feed(&newer[2])), None);
    assert_eq!(feed(&newer[0]).unwrap().toe, e.toe + 3_600.0);
}

#[test]
fn what_cannot_be_is_refused() {
    let e = read(satellite("C06"), &C06, ReceiverCheck::Unknown, then()).unwrap().unwrap();
    let refusal = |e: &KeplerEphemeris, now: GpsTime| {
        read(e.satellite, &d1(e, &NONE, then()), ReceiverCheck::Unknown, now).unwrap_err()
    };
    let week_s = 604_800.0;
    assert!(refusal(&e, then() + 2.0 * week_s).contains("another week"));
    let far = KeplerEphemeris { toc: e.toe - 200_000.0, ..e };
    assert!(refusal(&far, then()).contains("toe - toc"), "{}", refusal(&far, then()));
    let small = KeplerEphemeris { sqrt_a: 3_000.0, ..e };
    assert!(refusal(&small, then()).contains("sqrt(A) = 3e3"), "{}", refusal(&small, then()));
    // Weeks count modulo 8192, and the phone's time may be days off.
    let toe = |now| read(e.satellite, &C06, ReceiverCheck::Unknown, now).unwrap().unwrap().toe;
    assert_eq!(toe(then() + 250_000.0), e.toe);
    assert_eq!(toe(then() + 8_192.0 * week_s), e.toe + 8_192.0 * week_s);
    let mut assembler = BeidouAssembler::default();
    let mut fails = |bytes: &[u8]| {
        assembler.subframe(e.satellite, bytes, ReceiverCheck::Passed, then()).unwrap_err().reason
    };
    assert_eq!(fails(&bytes(&C06[0])[1..]), Reason::BeidouSubframeWrongLength);
    assert_eq!(fails(&[0x55; 40]), Reason::BeidouSubframeWithoutPreamble);
    let blank = |rest: u16| [&[0x38, 0x90], rest.to_be_bytes().as_slice(), &[0; 36]].concat();
    assert_eq!(fails(&blank(0x7000)), Reason::BeidouSubframeImpossibleNumber);
    assert_eq!(fails(&blank(0x1ff0)), Reason::BeidouSubframeImpossibleTime);
}

/// Messages sent around the end of a week, whose toe is in the next.
#[test]
fn a_week_may_end_between_the_pieces() {
    let e = read(satellite("C06"), &C06, ReceiverCheck::Unknown, then()).unwrap().unwrap();
    let end = GpsTime::from_beidou_week_tow(811, 0.0);
    let e = KeplerEphemeris { toe: end, toc: end, toe_own_tow_s: 0.0, ..e };
    for sent in [end - 12.0, end - 6.0, end - 3_600.0, end] {
        let read =
            |now| read(e.satellite, &d1(&e, &NONE, sent), ReceiverCheck::Unknown, now).unwrap().unwrap();
        assert_eq!((read(sent).toe, read(end + 100.0).toc), (end, end));
    }
    let c01 = KeplerEphemeris { satellite: satellite("C01"), ..e };
    let pages = d2(&c01, &NONE, end - 12.0);
    assert_eq!(read(c01.satellite, &pages, ReceiverCheck::Unknown, end).unwrap().unwrap().toe, end);
}

/// The message of an ephemeris, sent ten minutes after its reference time.
fn message(e: &KeplerEphemeris) -> (Vec<[u32; 10]>, GpsTime) {
    let sent = e.toe + 600.0;
    let geostationary = e.satellite.is_beidou_geostationary();
    (if geostationary { d2(e, &NONE, sent).to_vec() } else { d1(e, &NONE, sent).to_vec() }, sent)
}

/// Reference vectors: parameters as bits and back, then the satellite's position. The vectors have 13 digits of angles,
/// 2·10⁻⁵ m at the satellite's distance, and the bits none to lose.
#[test]
#[ignore = "needs the reference data"]
fn vectors_come_back_from_their_subframes() {
    let table = Table::read("oracle/sat/kepler_vectors_brd4.csv");
    let (mut rows, mut geostationary, mut worst_m, mut worst_s) = (0, 0, 0.0_f64, 0.0_f64);
    for row in table.rows.iter().filter(|row| table.text(row, "sat").starts_with('C')) {
        let expected = kepler(&table, row);
        let (subframes, sent) = message(&expected);
        let e = read(expected.satellite, &subframes, ReceiverCheck::Unknown, sent).unwrap().unwrap();
        assert_eq!((e.toe, e.toc, e.toe_own_tow_s), (expected.toe, expected.toc, expected.toe_own_tow_s));
        assert_eq!((e.issue_of_data, e.health), (expected.issue_of_data, expected.health));
        assert_eq!(e.issue_of_clock, expected.issue_of_clock);
        for (value, printed) in
            [(e.group_delays_s.0, expected.group_delays_s.0), (e.group_delays_s.1, expected.group_delays_s.1)]
        {
            assert!((value - printed).abs() < 1e-18, "{value:e} {printed:e}");
        }
        let state = e.state(table.time(row, ""));
        worst_m = worst_m.max(distance_m(&table, row, state.position));
        worst_s = worst_s.max((state.clock_s - table.number(row, "clk_s")).abs());
        rows += 1;
        geostationary += u32::from(e.satellite.is_beidou_geostationary());
    }
    println!("{rows} rows, {geostationary} geostationary: {worst_m:e} m, {worst_s:e} s");
    assert_eq!((rows, geostationary), (336, 40));
    assert!(worst_m < 1e-4 && worst_s < 1e-15, "{worst_m} m, {worst_s} s");
}

/// Every record of a broadcast file: positions up to an hour from toe.
#[test]
#[ignore = "needs the reference data"]
fn a_broadcast_file_comes_back_from_its_subframes() {
    let path = "oracle/inputs/BRD400DLR_20230710000_as_rnx305_GRECJI.rnx.gz";
    let bytes = required(path);
    let file = NavigationFile::parse(&bytes).unwrap();
    let records = file.ephemerides.iter().filter(|e| e.satellite.constellation == Constellation::Beidou);
    let (mut count, mut worst_m, mut worst_s) = (0, 0.0_f64, 0.0_f64);
    for expected in records {
        let (subframes, sent) = message(expected);
        let e = read(expected.satellite, &subframes, ReceiverCheck::Unknown, sent).unwrap().unwrap();
        assert_eq!((e.toe, e.toc, e.health), (expected.toe, expected.toc, expected.health));
        assert_eq!((e.accuracy_m, e.issue_of_data), (expected.accuracy_m, expected.issue_of_data));
        assert_eq!(e.issue_of_clock, expected.issue_of_clock);
        for elapsed_s in [-3_600.0, 0.0, 3_600.0] {
            let (a, b) = (e.state(e.toe + elapsed_s), expected.state(e.toe + elapsed_s));
            worst_m = worst_m.max(a.position.distance_m(b.position));
            worst_s = worst_s.max((a.clock_s - b.clock_s).abs());
        }
        count += 1;
    }
    println!("{count} records: {worst_m:e} m, {worst_s:e} s");
    assert_eq!(count, 1_061);
    assert!(worst_m < 1e-4 && worst_s < 1e-15, "{worst_m} m, {worst_s} s");
}

proptest! {
    #[test]
    fn any_bytes_do_no_harm(
        bytes in prop::collection::vec(any::<u8>(), 38..42),
        number in 1..64_u8,
        nanos in any::<i64>(),
        passed in any::<bool>(),
    ) {
        let receiver = if passed { ReceiverCheck::Passed } else { ReceiverCheck::Unknown };
        let satellite = SatelliteId::new(Constellation::Beidou, number);
        let _ = BeidouAssembler::default().subframe(satellite, &bytes, receiver, GpsTime::from_nanos(nanos));
    }

    /// With the check bits blanked, any numbers in the fields of pieces that follow each other.
    #[test]
    fn any_fields_do_no_harm(
        pieces in prop::collection::vec(prop::collection::vec(any::<u8>(), 40), 10),
        seconds in 0..604_800_i64,
        number in 1..64_u8,
        nanos in any::<i64>(),
    ) {
        let satellite = SatelliteId::new(Constellation::Beidou, number);
        let geostationary = satellite.is_beidou_geostationary();
        let mut assembler = BeidouAssembler::default();
        for (piece, content) in (0_i64..).zip(&pieces) {
            let mut bytes = content.clone();
            let (subframe, step) = if geostationary { (1, 3) } else { (piece % 3 + 1, 6) };
            let second = (seconds + step * piece) % 604_800;
            let first = 0x712 << 19 | subframe << 12 | second >> 12 << 4;
            let second_word = (second & 0xfff) << 18 | (piece + 1) << 14;
            bytes[..4].copy_from_slice(&u32::try_from(first).unwrap().to_be_bytes());
            bytes[4] = 0;
            for (at, byte) in u32::try_from(second_word).unwrap().to_be_bytes().into_iter().enumerate() {
                bytes[4 + at] = byte | if at == 2 { content[6] & 0x3f } else { 0 };
            }
            bytes.iter_mut().skip(7).step_by(4).for_each(|byte| *byte = 0);
            let result = assembler.subframe(satellite, &bytes, ReceiverCheck::Passed, GpsTime::from_nanos(nanos));
            if let Ok(Some(e)) = result {
                prop_assert!(e.state(e.toe + 600.0).position.is_finite());
            }
        }
    }
}
