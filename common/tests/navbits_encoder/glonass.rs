//! GLONASS strings (GLONASS ICD, L1 and L2, edition 5.1, tables 4.5, 4.6 and 4.13).

use cofix_common::orbit::GlonassEphemeris;
use cofix_common::time::GpsTime;

use super::{Bits, unit};

/// Bits that each of the sums C1 to C7 takes, as the ICD lists them.
const SUMS: [&[(usize, usize)]; 7] = [
    &[
        (9, 10),
        (12, 13),
        (15, 15),
        (17, 17),
        (19, 20),
        (22, 22),
        (24, 24),
        (26, 26),
        (28, 28),
        (30, 30),
        (32, 32),
        (34, 35),
        (37, 37),
        (39, 39),
        (41, 41),
        (43, 43),
        (45, 45),
        (47, 47),
        (49, 49),
        (51, 51),
        (53, 53),
        (55, 55),
        (57, 57),
        (59, 59),
        (61, 61),
        (63, 63),
        (65, 66),
        (68, 68),
        (70, 70),
        (72, 72),
        (74, 74),
        (76, 76),
        (78, 78),
        (80, 80),
        (82, 82),
        (84, 84),
    ],
    &[
        (9, 9),
        (11, 12),
        (14, 15),
        (18, 19),
        (21, 22),
        (25, 26),
        (29, 30),
        (33, 34),
        (36, 37),
        (40, 41),
        (44, 45),
        (48, 49),
        (52, 53),
        (56, 57),
        (60, 61),
        (64, 65),
        (67, 68),
        (71, 72),
        (75, 76),
        (79, 80),
        (83, 84),
    ],
    &[
        (10, 12),
        (16, 19),
        (23, 26),
        (31, 34),
        (38, 41),
        (46, 49),
        (54, 57),
        (62, 65),
        (69, 72),
        (77, 80),
        (85, 85),
    ],
    &[(13, 19), (27, 34), (42, 49), (58, 65), (73, 80)],
    &[(20, 34), (50, 65), (81, 85)],
    &[(35, 65)],
    &[(66, 85)],
];

/// What a frame says beside the ephemeris.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// When it begins.
    pub sent: GpsTime,
    /// Seconds that GPS time is ahead of UTC.
    pub leap_seconds: i64,
    /// Whether it is of a GLONASS-M.
    pub is_modern: bool,
}

/// A number as sign and magnitude.
fn put(bits: &mut Bits, value: f64, exponent: i32, count: u32) {
    #[allow(clippy::cast_possible_truncation)]
    let magnitude = (value.abs() / unit(exponent)).round() as i64;
    bits.put(i64::from(value < 0.0), 1).put(magnitude, count - 1);
}

/// Day of four years, 1 = 1 January of the leap year, and seconds of the day, in Moscow.
fn moscow(time: GpsTime, leap_seconds: i64) -> (i64, i64) {
    let own = time + (10_800 - leap_seconds) as f64;
    let calendar = own.calendar();
    let months = [31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
    let year = i64::from(calendar.year).rem_euclid(4);
    let passed: i64 = months.iter().take(calendar.month as usize - 1).sum();
    let leap_day = i64::from(year == 0 && calendar.month > 2 || year > 0);
    #[allow(clippy::cast_possible_truncation)]
    let seconds = own.tow_s().rem_euclid(86_400.0).round() as i64;
    (365 * year + passed + leap_day + i64::from(calendar.day), seconds)
}

/// Strings 1 to 4, each in 11 bytes.
pub fn strings(e: &GlonassEphemeris, frame: Frame) -> [Vec<u8>; 4] {
    let (_, sent_s) = moscow(frame.sent, frame.leap_seconds);
    let (day, toe_s) = moscow(e.toe, frame.leap_seconds);
    let modern = |value: i64| if frame.is_modern { value } else { 0 };
    let accuracy = [1.0, 2.0, 2.5, 4.0, 5.0, 7.0, 10.0].iter().position(|m| *m == e.accuracy_m).unwrap_or(15);
    let start = |number: i64| {
        let mut bits = Bits::default();
        bits.put(0, 1).put(number, 4);
        bits
    };
    let mut strings = [1, 2, 3, 4].map(start);
    let [one, two, three, four] = &mut strings;
    one.put(0, 2).put(1, 2).put(sent_s / 3_600, 5).put(sent_s / 60 % 60, 6).put(sent_s / 30 % 2, 1);
    two.put(i64::from(e.health.unwrap_or(0)), 1).put(0, 2).put(1, 1).put(toe_s / 900, 7).put(0, 5);
    three.put(1, 1);
    put(three, e.gamma, -40, 11);
    three.put(0, 1).put(modern(3), 2).put(modern(i64::from(e.health_flags.unwrap_or(0) >> 2)), 1);
    for (axis, string) in [&mut *one, &mut *two, &mut *three].into_iter().enumerate() {
        put(string, e.velocity.0[axis] / 1e3, -20, 24);
        put(string, e.acceleration.0[axis] / 1e3, -30, 5);
        put(string, e.position.0[axis] / 1e3, -11, 27);
    }
    put(four, e.tau_s, -30, 22);
    match e.l2_delay_s.filter(|_| frame.is_modern) {
        Some(delay_s) => put(four, delay_s, -30, 5),
        None => {
            four.put(0b1_0000, 5);
        }
    }
    #[allow(clippy::cast_possible_truncation)]
    four.put(e.age_days as i64, 5)
        .put(0, 14)
        .put(0, 1)
        .put(modern(i64::try_from(accuracy).unwrap()), 4)
        .put(0, 3);
    four.put(modern(day), 11).put(modern(e.satellite.number.into()), 5).put(modern(1), 2);
    strings.map(|string| with_check_bits(&string))
}

/// Appends bits 8 to 1.
pub fn with_check_bits(data: &Bits) -> Vec<u8> {
    assert_eq!(data.0.len(), 77);
    let bit = |number: usize| data.0[85 - number];
    let sum = |ranges: &[(usize, usize)]| {
        ranges.iter().flat_map(|(from, to)| *from..=*to).fold(0, |sum, number| sum ^ bit(number))
    };
    let checks = SUMS.map(sum);
    let all = data.0.iter().chain(&checks).fold(0, |sum, bit| sum ^ bit);
    let mut whole = Bits(data.0.clone());
    whole.put(all.into(), 1);
    whole.0.extend(checks.iter().rev());
    whole.bytes()
}

/// The string at the low end of its bytes.
pub fn at_the_low_end(string: &[u8]) -> Vec<u8> {
    let mut bits = Bits::default();
    bits.put(0, 3);
    for byte in string {
        bits.put((*byte).into(), 8);
    }
    bits.0.truncate(88);
    bits.bytes()
}
