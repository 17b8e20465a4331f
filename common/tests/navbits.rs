//! Navigation message bits to ephemerides.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::f64::consts::PI;

use cofix_common::gnss::SatelliteId;
use cofix_common::navbits::{InavAssembler, LnavAssembler, ReceiverCheck};
use cofix_common::orbit::KeplerEphemeris;
use cofix_common::time::GpsTime;
use proptest::prelude::*;

/// Subframes 1, 2, 3 and page 18 of subframe 4 as GPS PRN 4 sent them at the start of week 1869, and those of QZSS J01 in
/// week 2118 (words quoted in the tests of the GNSSTk, University of Texas).
const PRN4: [[u32; 10]; 4] = [
    [
        0x22C34D21, 0x000029D4, 0x34D44000, 0x091B1DE7, 0x1C33746E, 0x2F701369, 0x39F53CB5, 0x128070A8,
        0x003FF454, 0x3EAFC2F0,
    ],
    [
        0x22C34D21, 0x00004A44, 0x12BFCB3A, 0x0D7A9094, 0x3B99FBAF, 0x3FC081B8, 0x09D171E1, 0x04B0A847,
        0x03497656, 0x00709FA0,
    ],
    [
        0x22C34D21, 0x00006BCC, 0x3FE14ED4, 0x05ABBB58, 0x3FE3498B, 0x145EE03A, 0x062ECB6F, 0x1C48068F,
        0x3FE95E1E, 0x12844624,
    ],
    [
        0x22C34D21, 0x000B2C64, 0x1E05FFE1, 0x3F808FEC, 0x3F7F405F, 0x00000413, 0x0000003F, 0x01491376,
        0x044EC0EB, 0x044000D8,
    ],
];
const J01: [[u32; 10]; 4] = [
    [
        0x22C0AA24, 0x2A302164, 0x046840DF, 0x20000015, 0x00000016, 0x00000029, 0x00003D3C, 0x205FDC4B,
        0x0000092D, 0x39CF43FC,
    ],
    [
        0x22C0AA24, 0x2A3042F4, 0x207F0CCA, 0x06A60B06, 0x3C48F93B, 0x3FD449AB, 0x36CFD9C8, 0x074DF288,
        0x3B724294, 0x1FDC5FD4,
    ],
    [
        0x22C0AA24, 0x2A30637C, 0x3FF3E0D0, 0x1EC816E4, 0x3FB8074C, 0x2AABCE23, 0x38897015, 0x2AD457DF,
        0x3FF8CC38, 0x204A5D8C,
    ],
    [
        0x22C0AA24, 0x2A326470, 0x3E01BFFD, 0x3E3DC8BE, 0x3828DFC7, 0x0000003F, 0x0000003F, 0x00C5D1F0,
        0x04A241CF, 0x0480009C,
    ],
];

/// Words 1 to 5 of E01 in Galileo week 1014 (GPS week 2038), from the same source.
const E01: [[u32; 4]; 5] = [
    [0x045E86B2, 0x14606028, 0x0039B8BE, 0xA813EC77],
    [0x085E78BB, 0x0E292854, 0x403C05B7, 0x23FFF7FD],
    [0x0C5EFFC8, 0x1B1BAB09, 0xAB19670C, 0x0B0C496B],
    [0x105E07FF, 0xE3FFFA1A, 0xCFEE8486, 0xFFFDC601],
    [0x145B82A0, 0x0581F67D, 0x401FB3F4, 0x8CAAAAAA],
];

fn bytes(words: &[u32; 10]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_be_bytes()).collect()
}

fn satellite(name: &str) -> SatelliteId {
    name.parse().unwrap()
}

/// Feeds subframes; gives the ephemeris of the last one.
fn lnav(
    name: &str,
    subframes: &[[u32; 10]],
    receiver: ReceiverCheck,
    now: GpsTime,
) -> Result<Option<KeplerEphemeris>, String> {
    let mut assembler = LnavAssembler::default();
    let mut last = None;
    for words in subframes {
        last =
            assembler.subframe(satellite(name), &bytes(words), receiver, now).map_err(|e| e.to_string())?;
    }
    Ok(last)
}

fn near(value: f64, expected: f64, relative: f64) -> bool {
    (value - expected).abs() <= relative * expected.abs()
}

#[test]
fn gps_as_broadcast() {
    let now = GpsTime::from_week_tow(1869, 100.0);
    let e = lnav("G04", &PRN4[..3], ReceiverCheck::Unknown, now).unwrap().unwrap();
    assert_eq!(e.toe.to_string(), "2015-11-01T02:00:00.000");
    assert_eq!((e.toc, e.toe_own_tow_s, e.issue_of_data, e.health), (e.toe, 7_200.0, 74, 0.0));
    // A Block IIF satellite: 26,560 km, 54°, node moving west by 0.04° a day.
    assert!(near(e.sqrt_a, 5_153.64, 1e-5) && near(e.eccentricity, 0.012_018, 1e-4));
    assert!(near(e.i0_rad.to_degrees(), 53.885, 1e-4) && near(e.omega_dot_radps, -8.277e-9, 1e-3));
    assert!(near(e.clock.0, -4.008_3e-5, 1e-4) && near(e.group_delays_s.0, -6.519e-9, 1e-3));
    assert_eq!(e.accuracy_m, 2.8);
    let state = e.state(e.toe);
    assert!((26.2e6..26.9e6).contains(&state.position.0.norm()) && state.velocity.0.norm() < 4e3);
}

#[test]
fn ionosphere_and_leap_seconds_as_broadcast() {
    let mut assembler = LnavAssembler::default();
    let now = GpsTime::from_week_tow(1869, 600.0);
    assembler.subframe(satellite("G01"), &bytes(&PRN4[3]), ReceiverCheck::Unknown, now).unwrap();
    let system = assembler.system();
    let klobuchar = system.klobuchar.unwrap();
    // As files print them: 0.2142D-07 -0.7451D-08 -0.1192D-06 0.1192D-06, 0.1290D+06 -0.4915D+05 -0.1966D+06 0.6554D+05.
    let printed = [0.214_2e-7, -0.745_1e-8, -0.119_2e-6, 0.119_2e-6];
    assert!(klobuchar.alpha.iter().zip(printed).all(|(a, b)| near(*a, b, 1e-4)));
    assert_eq!(klobuchar.beta, [129_024.0, -49_152.0, -196_608.0, 65_536.0]);
    assert_eq!(system.leap_seconds, Some(17));
    // QZSS' coefficients, fitted to Japan, do not replace them.
    let later = GpsTime::from_week_tow(2118, 518_514.0);
    assembler.subframe(satellite("J01"), &bytes(&J01[3]), ReceiverCheck::Unknown, later).unwrap();
    assert_eq!(assembler.system(), system);
}

#[test]
fn qzss_as_broadcast() {
    let now = GpsTime::from_week_tow(2118, 518_500.0);
    let e = lnav("J01", &J01[..3], ReceiverCheck::Unknown, now).unwrap().unwrap();
    assert_eq!(e.toe.to_string(), "2020-08-15T01:00:00.000");
    // A geosynchronous orbit of 42,164 km, inclined by 41.7°.
    assert!(near(e.sqrt_a, 6_493.72, 1e-5) && near(e.i0_rad.to_degrees(), 41.719, 1e-3));
    assert!(near(e.eccentricity, 0.075_89, 1e-3));
}

/// Words with data bits as sent, from those above, which have them as meant (parity bits are the same).
fn as_sent(words: &[u32; 10]) -> [u32; 10] {
    let mut before = 0;
    words.map(|word| {
        let turned = if before == 1 { word ^ 0x3fff_ffc0 } else { word };
        before = word & 1;
        turned
    })
}

/// Receivers give words at either end of their four bytes, of either sign, with data bits as sent or as meant, or without
/// parity bits.
#[test]
fn all_forms_of_words_are_read() {
    let now = GpsTime::from_week_tow(1869, 100.0);
    let expected = lnav("G04", &PRN4[..3], ReceiverCheck::Unknown, now).unwrap();
    let read = |change: &dyn Fn(&[u32; 10]) -> [u32; 10], receiver: ReceiverCheck| {
        let changed: Vec<[u32; 10]> = PRN4[..3].iter().map(change).collect();
        lnav("G04", &changed, receiver, now)
    };
    let high = |words: &[u32; 10]| words.map(|w| w << 2);
    let negative = |words: &[u32; 10]| words.map(|w| w ^ 0x3fff_ffff);
    let sent_negative = |words: &[u32; 10]| negative(&as_sent(words));
    for change in [&high as &dyn Fn(&[u32; 10]) -> [u32; 10], &negative, &as_sent, &sent_negative] {
        assert_eq!(read(change, ReceiverCheck::Unknown), Ok(expected));
    }
    assert!(PRN4[..3].iter().all(|words| as_sent(words) != *words), "the forms differ");
    let meant = |words: &[u32; 10]| words.map(|w| w & 0x3fff_ffc0);
    assert_eq!(read(&meant, ReceiverCheck::Passed), Ok(expected));
    let refused = read(&meant, ReceiverCheck::Unknown).unwrap_err();
    assert!(refused.contains("parity"), "{refused}");
}

#[test]
fn any_single_wrong_bit_is_refused() {
    let now = GpsTime::from_week_tow(1869, 100.0);
    for words in PRN4.iter().chain(&J01) {
        for bit in 0..300 {
            let mut damaged = *words;
            damaged[bit / 30] ^= 1 << (bit % 30);
            let mut assembler = LnavAssembler::default();
            for receiver in [ReceiverCheck::Unknown, ReceiverCheck::Passed] {
                let result = assembler.subframe(satellite("G04"), &bytes(&damaged), receiver, now);
                assert!(result.is_err(), "bit {bit}");
            }
        }
    }
}

#[test]
fn the_week_comes_from_the_recording() {
    let read = |week: i64, tow_s: f64| {
        lnav("G04", &PRN4[..3], ReceiverCheck::Unknown, GpsTime::from_week_tow(week, tow_s))
            .map(|e| e.map(|e| e.toe))
    };
    let toe = GpsTime::from_week_tow(1869, 7_200.0);
    assert_eq!(read(1869, 0.0), Ok(Some(toe)));
    assert_eq!(read(1868, 604_000.0), Ok(Some(toe)));
    assert_eq!(read(1869, 250_000.0), Ok(Some(toe)));
    // Message weeks count modulo 1024.
    assert_eq!(read(1869 + 1024, 0.0), Ok(Some(GpsTime::from_week_tow(1869 + 1024, 7_200.0))));
    for other in [1868, 1870, 2000] {
        let refused = read(other, 0.0).unwrap_err();
        assert!(refused.contains("another week"), "{refused}");
    }
}

#[test]
fn pieces_of_different_issues_do_not_mix() {
    let mut assembler = LnavAssembler::default();
    let now = GpsTime::from_week_tow(1869, 100.0);
    let mut feed = |words: &[u32; 10]| {
        assembler.subframe(satellite("G04"), &bytes(words), ReceiverCheck::Unknown, now).unwrap()
    };
    let newer = LnavFields { issue: 75, tow_s: 100.0 * 6.0, ..LnavFields::like_prn4() }.subframes();
    assert_eq!(feed(&PRN4[0]), None);
    assert_eq!(feed(&newer[1]), None);
    assert_eq!(feed(&PRN4[2]), None, "subframe 2 has issue 75");
    assert_eq!(feed(&PRN4[1]).unwrap().issue_of_data, 74);
    assert_eq!(feed(&PRN4[1]), None, "the same again is not given again");
    assert_eq!(feed(&newer[0]), None);
    assert_eq!(feed(&newer[1]), None);
    assert_eq!(feed(&newer[2]).unwrap().issue_of_data, 75);
}

// --- An encoder, from the tables of IS-GPS-200 ---------------------------------------------------------------------------

/// The numbers of subframes 1 to 3 as the message's integers.
#[derive(Clone, Debug)]
struct LnavFields {
    week: i64,
    /// Start of subframe 1, s of week.
    tow_s: f64,
    issue: i64,
    ura: i64,
    health: i64,
    tgd: i64,
    toc: i64,
    af: [i64; 3],
    toe: i64,
    sqrt_a: i64,
    e: i64,
    /// i0, OMEGA0, omega, M0.
    angles: [i64; 4],
    /// delta n, IDOT, OMEGA DOT.
    rates: [i64; 3],
    /// Cuc, Cus, Crc, Crs, Cic, Cis.
    harmonics: [i64; 6],
}

impl LnavFields {
    fn like_prn4() -> Self {
        Self {
            week: 1869,
            tow_s: 0.0,
            issue: 74,
            ura: 1,
            health: 0,
            tgd: -14,
            toc: 450,
            af: [-86_079, -47, 0],
            toe: 450,
            sqrt_a: 2_701_993_392,
            e: 103_236_066,
            angles: [642_872_110, 991_344_555, 762_394_200, 1_122_928_321],
            rates: [13_802, 1_094, -23_176],
            harmonics: [-254, 4_802, 6_331, -212, -123, -115],
        }
    }

    fn subframes(&self) -> [[u32; 10]; 3] {
        let [cuc, cus, crc, crs, cic, cis] = self.harmonics;
        let [i0, omega0, omega, m0] = self.angles;
        let [delta_n, idot, omega_dot] = self.rates;
        let start = |number: i64| {
            let mut bits = Bits::default();
            bits.put(0x8b, 8).put(0, 16);
            #[allow(clippy::cast_possible_truncation)] // below 100800
            let count = (self.tow_s / 6.0) as i64 + number;
            bits.put(count, 17).put(0, 2).put(number, 3).put(0, 2);
            bits
        };
        let mut one = start(1);
        one.put(self.week % 1024, 10).put(1, 2).put(self.ura, 4).put(self.health, 6).put(0, 2);
        one.put(0, 24).put(0, 24).put(0, 24).put(0, 16).put(self.tgd, 8);
        one.put(self.issue, 8).put(self.toc, 16);
        one.put(self.af[2], 8).put(self.af[1], 16).put(self.af[0], 22).put(0, 2);
        let mut two = start(2);
        two.put(self.issue, 8).put(crs, 16).put(delta_n, 16).put(m0, 32).put(cuc, 16).put(self.e, 32);
        two.put(cus, 16).put(self.sqrt_a, 32).put(self.toe, 16).put(0, 1).put(0, 5).put(0, 2);
        let mut three = start(3);
        three.put(cic, 16).put(omega0, 32).put(cis, 16).put(i0, 32).put(crc, 16).put(omega, 32);
        three.put(omega_dot, 24).put(self.issue, 8).put(idot, 14).put(0, 2);
        [one.words(), two.words(), three.words()]
    }
}

#[derive(Default)]
struct Bits(Vec<u8>);

impl Bits {
    fn put(&mut self, value: i64, count: u32) -> &mut Self {
        self.0.extend((0..count).rev().map(|k| u8::from(value >> k & 1 == 1)));
        self
    }

    /// Ten words with parity by the equations of table 20-XIV, bit by bit, data bits as sent.
    fn words(&self) -> [u32; 10] {
        assert_eq!(self.0.len(), 240);
        let (mut d29, mut d30) = (0, 0);
        let mut words = [0; 10];
        for (word, data) in words.iter_mut().zip(self.0.chunks(24)) {
            let d = |k: usize| data[k - 1];
            let x = |bits: &[usize]| bits.iter().fold(0, |sum, k| sum ^ d(*k));
            let parity = [
                d29 ^ x(&[1, 2, 3, 5, 6, 10, 11, 12, 13, 14, 17, 18, 20, 23]),
                d30 ^ x(&[2, 3, 4, 6, 7, 11, 12, 13, 14, 15, 18, 19, 21, 24]),
                d29 ^ x(&[1, 3, 4, 5, 7, 8, 12, 13, 14, 15, 16, 19, 20, 22]),
                d30 ^ x(&[2, 4, 5, 6, 8, 9, 13, 14, 15, 16, 17, 20, 21, 23]),
                d30 ^ x(&[1, 3, 5, 6, 7, 9, 10, 14, 15, 16, 17, 18, 21, 22, 24]),
                d29 ^ x(&[3, 5, 6, 8, 9, 10, 11, 13, 15, 19, 22, 23, 24]),
            ];
            let sent = data.iter().map(|bit| bit ^ d30).chain(parity);
            *word = sent.fold(0, |value, bit| value << 1 | u32::from(bit));
            (d29, d30) = (parity[4], parity[5]);
        }
        words
    }
}

/// The integer whose multiple of the unit a printed number is: it must be one, or the unit is wrong.
fn integer(value: f64, unit: f64, name: &str) -> i64 {
    let multiple = value / unit;
    assert!((multiple - multiple.round()).abs() < 0.02, "{name} = {value} is {multiple} units");
    #[allow(clippy::cast_possible_truncation)]
    let integer = multiple.round() as i64;
    integer
}

fn unit(exponent: i32) -> f64 {
    2_f64.powi(exponent)
}

/// One record of a RINEX 2 file: satellite number and its 31 numbers (three of the clock, seven lines of four).
fn rinex2(text: &str) -> Vec<(u8, Vec<f64>)> {
    let number = |field: &str| field.trim().replace('D', "E").parse::<f64>().unwrap_or(0.0);
    let lines: Vec<&str> = text.lines().skip_while(|l| !l.contains("END OF HEADER")).skip(1).collect();
    lines
        .chunks_exact(8)
        .map(|record| {
            let mut values = Vec::new();
            for (index, line) in record.iter().enumerate() {
                let padded = format!("{line:80}");
                let from = if index == 0 { 1 } else { 0 };
                values.extend((from..4).map(|k| number(&padded[3 + 19 * k..22 + 19 * k])));
            }
            (record[0][..2].trim().parse().unwrap(), values)
        })
        .collect()
}

fn fields(v: &[f64]) -> Option<(LnavFields, GpsTime)> {
    let ura = [2.0, 2.8, 4.0, 5.7, 8.0, 11.3, 16.0, 32.0].iter().position(|m| *m == v[23])?;
    let semicircles = |at: usize, exponent: i32, name: &str| integer(v[at] / PI, unit(exponent), name);
    // The week number goes with toe. Sent an hour and a half before it, on the six seconds.
    #[allow(clippy::cast_possible_truncation)]
    let toe = GpsTime::from_week_tow(v[21] as i64, v[11]);
    let sent = toe - 5_400.0;
    let sent = sent - sent.tow_s() % 30.0;
    let fields = LnavFields {
        week: sent.week(),
        tow_s: sent.tow_s(),
        issue: integer(v[3], 1.0, "IODE"),
        ura: i64::try_from(ura).unwrap(),
        health: integer(v[24], 1.0, "health"),
        tgd: integer(v[25], unit(-31), "TGD"),
        toc: integer(v[11], 16.0, "toe"),
        af: [
            integer(v[0], unit(-31), "af0"),
            integer(v[1], unit(-43), "af1"),
            integer(v[2], unit(-55), "af2"),
        ],
        toe: integer(v[11], 16.0, "toe"),
        sqrt_a: integer(v[10], unit(-19), "sqrt A"),
        e: integer(v[8], unit(-33), "e"),
        angles: [
            semicircles(15, -31, "i0"),
            semicircles(13, -31, "OMEGA0"),
            semicircles(17, -31, "omega"),
            semicircles(6, -31, "M0"),
        ],
        rates: [
            semicircles(5, -43, "delta n"),
            semicircles(19, -43, "IDOT"),
            semicircles(18, -43, "OMEGA DOT"),
        ],
        harmonics: [
            integer(v[7], unit(-29), "Cuc"),
            integer(v[9], unit(-29), "Cus"),
            integer(v[16], unit(-5), "Crc"),
            integer(v[4], unit(-5), "Crs"),
            integer(v[12], unit(-29), "Cic"),
            integer(v[14], unit(-29), "Cis"),
        ],
    };
    Some((fields, sent))
}

/// Two broadcast files, each record as the subframes that it was made of, and back to the printed digits. The file's
/// numbers are whole multiples of the message's units.
#[test]
fn broadcast_files_come_back_from_their_subframes() {
    let (mut total, mut single) = (0, 0);
    for name in ["hour1820.16n", "hour2350.16n"] {
        let path = format!("{}/../../shared/data/google-static-2016/{name}", env!("CARGO_MANIFEST_DIR"));
        let Ok(text) = std::fs::read_to_string(&path) else {
            println!("skipped: {path} is not here");
            return;
        };
        for (number, v) in rinex2(&text) {
            let Some((fields, sent)) = fields(&v) else { continue };
            let name = format!("G{number:02}");
            let e = lnav(&name, &fields.subframes(), ReceiverCheck::Unknown, sent + 40_000.0);
            let e = e.unwrap().unwrap_or_else(|| panic!("{name}: no ephemeris"));
            let pairs = [
                (e.clock.0, v[0]),
                (e.clock.1, v[1]),
                (e.clock.2, v[2]),
                (f64::from(e.issue_of_data), v[3]),
                (e.crc_crs_m.1, v[4]),
                (e.delta_n_radps, v[5]),
                (e.m0_rad, v[6]),
                (e.cuc_cus_rad.0, v[7]),
                (e.eccentricity, v[8]),
                (e.cuc_cus_rad.1, v[9]),
                (e.sqrt_a, v[10]),
                (e.toe_own_tow_s, v[11]),
                (e.cic_cis_rad.0, v[12]),
                (e.omega0_rad, v[13]),
                (e.cic_cis_rad.1, v[14]),
                (e.i0_rad, v[15]),
                (e.crc_crs_m.0, v[16]),
                (e.omega_rad, v[17]),
                (e.omega_dot_radps, v[18]),
                (e.i_dot_radps, v[19]),
                (e.toe.week() as f64, v[21]),
                (e.accuracy_m, v[23]),
                (e.health, v[24]),
                (e.group_delays_s.0, v[25]),
            ];
            for (index, (value, printed)) in pairs.into_iter().enumerate() {
                // Twelve digits of which the first is not zero: one unit of the last is at most 1e-11.
                if near(value, printed, 1.01e-11) {
                    continue;
                }
                // Some of the network's receivers keep delta n, OMEGA DOT and IDOT in single precision.
                assert!([5, 18, 19].contains(&index), "{name} value {index}: {value:e}, {printed:e}");
                assert!(near(value, printed, 6e-8), "{name} value {index}: {value:e}, {printed:e}");
                single += usize::from(index == 5);
            }
            total += 1;
        }
    }
    assert_eq!((total, single), (831, 184));
}

// --- Galileo -------------------------------------------------------------------------------------------------------------

/// A page of a word: even half, odd half with empty OSNMA, SAR and spare fields, CRC by long division.
fn page(word: &[u32; 4], with_crc: bool) -> Vec<u8> {
    let mut bits = Bits::default();
    let data: Vec<u8> =
        word.iter().flat_map(|part| (0..32).rev().map(move |k| u8::from(part >> k & 1 == 1))).collect();
    bits.put(0, 2).0.extend(&data[..112]);
    bits.put(1, 1).put(0, 1).0.extend(&data[112..]);
    bits.put(0, 40 + 22 + 2);
    let crc = if with_crc { remainder(&bits.0) } else { 0 };
    bits.put(crc, 24).put(0, 8).put(0, 4);
    assert_eq!(bits.0.len(), 232);
    bits.0.chunks(8).map(|byte| byte.iter().fold(0, |value, bit| value << 1 | bit)).collect()
}

/// Remainder of the bits, followed by 24 zeros, by the polynomial 1864CFB (hexadecimal).
fn remainder(bits: &[u8]) -> i64 {
    let mut rest: Vec<u8> = bits.to_vec();
    rest.extend([0; 24]);
    for at in 0..bits.len() {
        if rest[at] == 1 {
            for k in 0..25 {
                rest[at + k] ^= u8::from(0x0186_4cfb_u32 >> (24 - k) & 1 == 1);
            }
        }
    }
    rest[bits.len()..].iter().fold(0, |value, bit| value << 1 | i64::from(*bit))
}

fn inav(name: &str, words: &[[u32; 4]], now: GpsTime) -> Result<Option<KeplerEphemeris>, String> {
    let mut assembler = InavAssembler::default();
    let mut last = None;
    for word in words {
        last = assembler
            .page(satellite(name), &page(word, true), ReceiverCheck::Unknown, now)
            .map_err(|e| e.to_string())?;
    }
    Ok(last)
}

#[test]
fn galileo_as_broadcast() {
    let now = GpsTime::from_week_tow(2038, 518_430.0);
    let e = inav("E01", &E01, now).unwrap().unwrap();
    assert_eq!(e.toe, GpsTime::from_week_tow(2038, 517_200.0));
    assert_eq!((e.toc, e.toe_own_tow_s, e.issue_of_data, e.health), (e.toe, 517_200.0, 94, 0.0));
    // 29,600 km, 56.7°, nearly a circle; SISA 107 = 3.12 m; both BGDs about -5 ns.
    assert!(near(e.sqrt_a, 5_440.622_6, 1e-7) && near(e.i0_rad.to_degrees(), 56.713, 1e-4));
    assert!(near(e.eccentricity, 1.101e-4, 1e-3) && near(e.accuracy_m, 3.12, 1e-9));
    assert!(near(e.group_delays_s.0, -4.657e-9, 1e-3) && near(e.group_delays_s.1, -5.122e-9, 1e-3));
    assert!((29.5e6..29.7e6).contains(&e.state(e.toe).position.0.norm()));
}

#[test]
fn galileo_pages_are_checked() {
    let now = GpsTime::from_week_tow(2038, 518_430.0);
    let mut assembler = InavAssembler::default();
    let good = page(&E01[0], true);
    for bit in 0..220 {
        let mut damaged = good.clone();
        damaged[bit / 8] ^= 0x80 >> (bit % 8);
        assert!(assembler.page(satellite("E01"), &damaged, ReceiverCheck::Passed, now).is_err(), "bit {bit}");
    }
    let blank = page(&E01[0], false);
    assert!(assembler.page(satellite("E01"), &blank, ReceiverCheck::Unknown, now).is_err());
    assert_eq!(assembler.page(satellite("E01"), &blank, ReceiverCheck::Passed, now), Ok(None));
    assert!(assembler.page(satellite("E01"), &good[1..], ReceiverCheck::Passed, now).is_err());
    // Another satellite, another week, another issue.
    assert!(inav("E02", &E01, now).unwrap_err().contains("another satellite"));
    assert!(inav("E01", &E01, now + 20.0 * 604_800.0).unwrap_err().contains("another week"));
    let mut mixed = E01;
    mixed[1][0] ^= 1 << 16;
    assert_eq!(inav("E01", &mixed, now), Ok(None));
    // Days off, and the rollover of twelve-bit weeks.
    let toe = |now| inav("E01", &E01, now).unwrap().unwrap().toe;
    assert_eq!(toe(now + 80_000.0), GpsTime::from_week_tow(2038, 517_200.0));
    assert_eq!(toe(now + 4_096.0 * 604_800.0), GpsTime::from_week_tow(2038 + 4_096, 517_200.0));
}

proptest! {
    #[test]
    fn any_bytes_do_no_harm(bytes in prop::collection::vec(any::<u8>(), 0..64), nanos in any::<i64>(), passed in any::<bool>()) {
        let receiver = if passed { ReceiverCheck::Passed } else { ReceiverCheck::Unknown };
        let now = GpsTime::from_nanos(nanos);
        let _ = LnavAssembler::default().subframe(satellite("G04"), &bytes, receiver, now);
        let _ = InavAssembler::default().page(satellite("E01"), &bytes, receiver, now);
    }

    /// With the check bits right, any numbers in the fields.
    #[test]
    fn any_fields_do_no_harm(fields in prop::array::uniform5(prop::array::uniform32(any::<u8>())), nanos in any::<i64>()) {
        let now = GpsTime::from_nanos(nanos);
        let mut lnav = LnavAssembler::default();
        let mut inav = InavAssembler::default();
        for (number, content) in (1..).zip(&fields) {
            let mut bits = Bits::default();
            bits.put(0x8b, 8).put(0, 16).put(i64::from(content[31]), 17).put(0, 2).put(number, 3).put(0, 2);
            content[..24].iter().for_each(|byte| { bits.put(i64::from(*byte), 8); });
            // The same issue everywhere, so that the ephemeris is formed.
            let mut frame = bits.0.clone();
            for at in [48, 168, 216] {
                frame[at..at + 8].fill(0);
            }
            let _ = lnav.subframe(satellite("G04"), &bytes(&Bits(frame).words()), ReceiverCheck::Unknown, now);
            let mut word: [u32; 4] = std::array::from_fn(|k| u32::from_be_bytes(content[4 * k..4 * k + 4].try_into().unwrap()));
            word[0] = u32::try_from(number).unwrap() << 26 | word[0] & 0xffff;
            let _ = inav.page(satellite("E01"), &page(&word, true), ReceiverCheck::Unknown, now);
        }
    }
}
