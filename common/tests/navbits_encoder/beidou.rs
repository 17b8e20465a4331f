//! BeiDou D1 and D2 (BDS-SIS-ICD-B1I 3.0, 5.2 and 5.3).

use cofix_common::atmosphere::KlobucharCoefficients;
use cofix_common::orbit::{KeplerEphemeris, ura_m};
use cofix_common::time::{BEIDOU_BEHIND_GPS_S, BEIDOU_WEEK_OFFSET, GpsTime, SECONDS_PER_WEEK};

use super::{Bits, semicircles, units};

/// Powers of the root of X⁴ + X + 1 in the field of sixteen elements, from the fourteenth down to the zeroth.
const POWERS: [u32; 15] = [9, 13, 15, 14, 7, 10, 5, 11, 12, 6, 3, 8, 4, 2, 1];

/// Check bits of a block of 11 bits: the sum over all 15 bits of the root's powers is zero.
fn check_bits(block: &[u8]) -> u32 {
    block.iter().zip(POWERS).filter(|(bit, _)| **bit == 1).fold(0, |sum, (_, power)| sum ^ power)
}

fn number(bits: &[u8]) -> u32 {
    bits.iter().fold(0, |value, bit| value << 1 | u32::from(*bit))
}

/// Ten words of 224 data bits, their blocks taken apart.
fn words(bits: &Bits) -> [u32; 10] {
    assert_eq!(bits.0.len(), 224);
    let (first, rest) = bits.0.split_at(26);
    let mut words = [number(first) << 4 | check_bits(&first[15..]); 10];
    for (word, data) in words[1..].iter_mut().zip(rest.chunks(22)) {
        let (one, two) = data.split_at(11);
        *word = number(data) << 8 | check_bits(one) << 4 | check_bits(two);
    }
    words
}

/// Words as the satellite sends them: the blocks' bits alternately, but for word 1.
pub fn as_sent(words: &[u32; 10]) -> [u32; 10] {
    let mut sent = words.map(|word| {
        let one = word >> 19 << 4 | word >> 4 & 0xf;
        let two = (word >> 8 & 0x7ff) << 4 | word & 0xf;
        (0..15).rev().fold(0, |value, k| value << 2 | (one >> k & 1) << 1 | two >> k & 1)
    });
    sent[0] = words[0];
    sent
}

/// Preamble, `FraID` and SOW.
fn start(number: i64, seconds_of_week: i64) -> Bits {
    let mut bits = Bits::default();
    bits.put(0x712, 11).put(0, 4).put(number, 3).put(seconds_of_week, 20);
    bits
}

/// Week and second of the week in BeiDou time.
fn beidou_time(time: GpsTime) -> (i64, i64) {
    let own = time - BEIDOU_BEHIND_GPS_S;
    #[allow(clippy::cast_possible_truncation)]
    let seconds = own.tow_s() as i64;
    (own.week() - BEIDOU_WEEK_OFFSET, seconds)
}

fn accuracy_index(e: &KeplerEphemeris) -> i64 {
    i64::try_from((0..16).find(|index| ura_m(*index) >= e.accuracy_m).unwrap_or(15)).unwrap()
}

fn tenths_of_ns(seconds: f64) -> i64 {
    #[allow(clippy::cast_possible_truncation)]
    let tenths = (seconds * 1e10).round() as i64;
    tenths
}

fn eighths(time: GpsTime) -> i64 {
    beidou_time(time).1 / 8
}

fn klobuchar(k: &KlobucharCoefficients) -> [i64; 8] {
    let [a0, a1, a2, a3] = k.alpha;
    let [b0, b1, b2, b3] = k.beta;
    let terms = [(a0, -30), (a1, -27), (a2, -24), (a3, -24), (b0, 11), (b1, 14), (b2, 16), (b3, 16)];
    terms.map(|(value, exponent)| units(value, exponent))
}

/// What the first piece of both messages begins with: from the health to the group delays.
fn put_head(one: &mut Bits, e: &KeplerEphemeris, week: i64) {
    #[allow(clippy::cast_possible_truncation)]
    let health = e.health as i64;
    one.put(health, 1)
        .put(e.issue_of_clock.into(), 5)
        .put(accuracy_index(e), 4)
        .put(week, 13)
        .put(eighths(e.toc), 17);
    one.put(tenths_of_ns(e.group_delays_s.0), 10).put(tenths_of_ns(e.group_delays_s.1), 10);
}

/// Subframes 1 to 3 of D1, of which the first begins at `sent`.
pub fn d1(e: &KeplerEphemeris, k: &KlobucharCoefficients, sent: GpsTime) -> [[u32; 10]; 3] {
    let (week, seconds) = beidou_time(sent);
    #[allow(clippy::cast_possible_truncation)]
    let begin = |number: i64| start(number, (seconds + 6 * (number - 1)) % SECONDS_PER_WEEK as i64);
    let mut one = begin(1);
    put_head(&mut one, e, week);
    for term in klobuchar(k) {
        one.put(term, 8);
    }
    one.put(units(e.clock.2, -66), 11).put(units(e.clock.0, -33), 24).put(units(e.clock.1, -50), 22);
    one.put(e.issue_of_data.into(), 5);
    let toe = eighths(e.toe);
    let mut two = begin(2);
    two.put(semicircles(e.delta_n_radps, -43), 16).put(units(e.cuc_cus_rad.0, -31), 18);
    two.put(semicircles(e.m0_rad, -31), 32).put(units(e.eccentricity, -33), 32);
    two.put(units(e.cuc_cus_rad.1, -31), 18).put(units(e.crc_crs_m.0, -6), 18);
    two.put(units(e.crc_crs_m.1, -6), 18).put(units(e.sqrt_a, -19), 32).put(toe >> 15, 2);
    let mut three = begin(3);
    three.put(toe, 15).put(semicircles(e.i0_rad, -31), 32).put(units(e.cic_cis_rad.0, -31), 18);
    three.put(semicircles(e.omega_dot_radps, -43), 24).put(units(e.cic_cis_rad.1, -31), 18);
    three.put(semicircles(e.i_dot_radps, -43), 14).put(semicircles(e.omega0_rad, -31), 32);
    three.put(semicircles(e.omega_rad, -31), 32).put(0, 1);
    [one, two, three].map(|bits| words(&bits))
}

/// Pages 1 to 10 of subframe 1 of D2, of which the first begins at `sent`.
pub fn d2(e: &KeplerEphemeris, k: &KlobucharCoefficients, sent: GpsTime) -> [[u32; 10]; 10] {
    let (week, seconds) = beidou_time(sent);
    #[allow(clippy::cast_possible_truncation)]
    let begin = |page: i64| {
        let mut bits = start(1, (seconds + 3 * (page - 1)) % SECONDS_PER_WEEK as i64);
        bits.put(page, 4);
        bits
    };
    let mut pages: [Bits; 10] = std::array::from_fn(|k| begin(i64::try_from(k).unwrap() + 1));
    let [one, two, three, four, five, six, seven, eight, nine, ten] = &mut pages;
    put_head(one, e, week);
    one.put(0, 12);
    for term in klobuchar(k) {
        two.put(term, 8);
    }
    two.put(0, 8);
    let drift = units(e.clock.1, -50);
    three.put(0, 38).put(units(e.clock.0, -33), 24).put(drift >> 18, 4).put(0, 6);
    let cuc = units(e.cuc_cus_rad.0, -31);
    four.put(drift, 18).put(units(e.clock.2, -66), 11).put(e.issue_of_data.into(), 5);
    four.put(semicircles(e.delta_n_radps, -43), 16).put(cuc >> 4, 14).put(0, 8);
    let eccentricity = units(e.eccentricity, -33);
    five.put(cuc, 4).put(semicircles(e.m0_rad, -31), 32).put(units(e.cuc_cus_rad.1, -31), 18);
    five.put(eccentricity >> 22, 10).put(0, 8);
    let cic = units(e.cic_cis_rad.0, -31);
    six.put(eccentricity, 22).put(units(e.sqrt_a, -19), 32).put(cic >> 8, 10).put(0, 8);
    let i0 = semicircles(e.i0_rad, -31);
    seven
        .put(cic, 8)
        .put(units(e.cic_cis_rad.1, -31), 18)
        .put(eighths(e.toe), 17)
        .put(i0 >> 11, 21)
        .put(0, 8);
    let omega_dot = semicircles(e.omega_dot_radps, -43);
    eight.put(i0, 11).put(units(e.crc_crs_m.0, -6), 18).put(units(e.crc_crs_m.1, -6), 18);
    eight.put(omega_dot >> 5, 19).put(0, 6);
    let omega = semicircles(e.omega_rad, -31);
    nine.put(omega_dot, 5).put(semicircles(e.omega0_rad, -31), 32).put(omega >> 5, 27).put(0, 8);
    ten.put(omega, 5).put(semicircles(e.i_dot_radps, -43), 14).put(0, 53);
    pages.map(|mut page| {
        // What is reserved is ones and zeros in turn.
        page.put(0x2a_aaaa_aaaa_aaaa, 55).put(0x2a_aaaa_aaaa_aaaa, 55);
        words(&page)
    })
}
