//! An encoder of navigation messages, from the tables of IS-GPS-200, the Galileo OS SIS ICD, BDS-SIS-ICD-B1I and the GLONASS ICD, and
//! a reader of RINEX 2 records to feed it.
#![allow(dead_code, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

pub mod beidou;
pub mod fnav;
pub mod glonass;

use std::f64::consts::PI;

use cofix_common::time::GpsTime;

/// The numbers of subframes 1 to 3 as the message's integers.
#[derive(Clone, Debug)]
pub struct LnavFields {
    pub week: i64,
    /// Start of subframe 1, s of week.
    pub tow_s: f64,
    /// IODC, of which the low eight bits are IODE.
    pub issue: i64,
    pub ura: i64,
    pub health: i64,
    pub tgd: i64,
    pub toc: i64,
    pub af: [i64; 3],
    pub toe: i64,
    pub sqrt_a: i64,
    pub e: i64,
    /// i0, OMEGA0, omega, M0.
    pub angles: [i64; 4],
    /// delta n, IDOT, OMEGA DOT.
    pub rates: [i64; 3],
    /// Cuc, Cus, Crc, Crs, Cic, Cis.
    pub harmonics: [i64; 6],
}

impl LnavFields {
    pub fn like_prn4() -> Self {
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

    pub fn subframes(&self) -> [[u32; 10]; 3] {
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
        one.put(self.week % 1024, 10).put(1, 2).put(self.ura, 4).put(self.health, 6);
        one.put(self.issue >> 8, 2);
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
pub struct Bits(pub Vec<u8>);

impl Bits {
    pub fn put(&mut self, value: i64, count: u32) -> &mut Self {
        self.0.extend((0..count).rev().map(|k| u8::from(value >> k & 1 == 1)));
        self
    }

    /// Bits in bytes, the last filled with zeros.
    pub fn bytes(&self) -> Vec<u8> {
        let byte = |bits: &[u8]| bits.iter().fold(0, |value, bit| value << 1 | bit) << (8 - bits.len());
        self.0.chunks(8).map(byte).collect()
    }

    /// Ten words with parity by the equations of table 20-XIV, bit by bit, data bits as sent.
    pub fn words(&self) -> [u32; 10] {
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

/// The integer next to a number in units of 2^`exponent`. Files have twelve digits, which is more than the messages.
pub fn units(value: f64, exponent: i32) -> i64 {
    #[allow(clippy::cast_possible_truncation)]
    let integer = (value / unit(exponent)).round() as i64;
    integer
}

/// The same of an angle or a rate in semicircles.
pub fn semicircles(value: f64, exponent: i32) -> i64 {
    units(value / PI, exponent)
}

/// The integer whose multiple of the unit a printed number is: it must be one, or the unit is wrong.
pub fn integer(value: f64, unit: f64, name: &str) -> i64 {
    let multiple = value / unit;
    assert!((multiple - multiple.round()).abs() < 0.02, "{name} = {value} is {multiple} units");
    #[allow(clippy::cast_possible_truncation)]
    let integer = multiple.round() as i64;
    integer
}

pub fn unit(exponent: i32) -> f64 {
    2_f64.powi(exponent)
}

/// One record of a RINEX 2 file: satellite number and its 31 numbers (three of the clock, seven lines of four).
pub fn rinex2(text: &str) -> Vec<(u8, Vec<f64>)> {
    let number = |field: &str| field.trim().replace('D', "E").parse::<f64>().unwrap_or(0.0);
    let lines: Vec<&str> = text.lines().skip_while(|l| !l.contains("END OF HEADER")).skip(1).collect();
    lines
        .chunks_exact(8)
        .map(|record| {
            let mut values = Vec::new();
            for (index, line) in record.iter().enumerate() {
                let padded = format!("{line:80}");
                let from = usize::from(index == 0);
                values.extend((from..4).map(|k| number(&padded[3 + 19 * k..22 + 19 * k])));
            }
            (record[0][..2].trim().parse().unwrap(), values)
        })
        .collect()
}

pub fn fields(v: &[f64]) -> Option<(LnavFields, GpsTime)> {
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
        issue: integer(v[26], 1.0, "IODC"),
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

/// A page of a word: even half, odd half with empty OSNMA, SAR and spare fields, CRC by long division.
pub fn page(word: &[u32; 4], with_crc: bool) -> Vec<u8> {
    let mut bits = Bits::default();
    let data: Vec<u8> =
        word.iter().flat_map(|part| (0..32).rev().map(move |k| u8::from(part >> k & 1 == 1))).collect();
    bits.put(0, 2).0.extend(&data[..112]);
    bits.put(1, 1).put(0, 1).0.extend(&data[112..]);
    bits.put(0, 40 + 22 + 2);
    let crc = if with_crc { remainder(&bits.0) } else { 0 };
    bits.put(crc, 24).put(0, 8).put(0, 4);
    assert_eq!(bits.0.len(), 232);
    bits.bytes()
}

/// Remainder of the bits, followed by 24 zeros, by the polynomial 1864CFB (hexadecimal).
pub fn remainder(bits: &[u8]) -> i64 {
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
