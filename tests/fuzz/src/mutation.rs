//! Damage to files, as random as it is repeatable.

use rand::Rng;
use rand::seq::IndexedRandom;

/// Longest result: limits of lines and of what is looked at are 16 and 64 KiB.
const LONGEST: usize = 200_000;

/// Numbers that formats seldom expect.
const NUMBERS: [&str; 14] = [
    "0",
    "-1",
    "-0.0",
    "999",
    "1e400",
    "nan",
    "inf",
    "-9.9D+99",
    "4294967296",
    "9223372036854775807",
    "-9223372036854775808",
    "99999999999999999999",
    "0.9999999999",
    "",
];

/// A damaged copy of one of `seeds`, damaged one to six times; parts of another may have got into it.
pub fn mutate(seeds: &[Vec<u8>], random: &mut impl Rng) -> Vec<u8> {
    let mut bytes = seeds.choose(random).cloned().unwrap_or_default();
    for _ in 0..random.random_range(1..=6) {
        let other = seeds.choose(random).map_or(&[][..], Vec::as_slice);
        damage(&mut bytes, other, random);
        bytes.truncate(LONGEST);
    }
    bytes
}

fn damage(bytes: &mut Vec<u8>, other: &[u8], random: &mut impl Rng) {
    let at = random.random_range(0..=bytes.len());
    let end = (at + length(random)).min(bytes.len());
    match random.random_range(0..11) {
        0 => bytes.truncate(at),
        1 => drop(bytes.drain(at..end)),
        2 => flip(bytes, at, random),
        3 => noise(bytes, at, random),
        4 => repeat(bytes, at, end, random),
        5 => splice(bytes, other, at, random),
        6 => drop(bytes.splice(at..at, *b"\r\n")),
        7 => line_again(bytes, at, random),
        8 | 9 => number(bytes, at, random),
        _ => swap_lines(bytes, random),
    }
}

/// Mostly short, seldom a line or many.
fn length(random: &mut impl Rng) -> usize {
    let longest = *[4, 20, 90, 1_000].choose(random).unwrap_or(&4);
    random.random_range(1..=longest)
}

fn flip(bytes: &mut [u8], at: usize, random: &mut impl Rng) {
    if let Some(byte) = bytes.get_mut(at) {
        *byte = if random.random() { *byte ^ 1 << random.random_range(0..8) } else { random.random() };
    }
}

fn noise(bytes: &mut Vec<u8>, at: usize, random: &mut impl Rng) {
    let new: Vec<u8> = (0..length(random)).map(|_| random.random()).collect();
    bytes.splice(at..at, new);
}

/// Repeats a part, now and then until it is longer than any line may be.
fn repeat(bytes: &mut Vec<u8>, from: usize, to: usize, random: &mut impl Rng) {
    let times = if random.random_ratio(1, 20) { 1_000 } else { random.random_range(1..4) };
    let again = bytes.get(from..to).unwrap_or_default().repeat(times);
    bytes.splice(to..to, again);
}

fn splice(bytes: &mut Vec<u8>, other: &[u8], at: usize, random: &mut impl Rng) {
    let from = random.random_range(0..=other.len());
    let to = (from + length(random)).min(other.len());
    bytes.splice(at..at, other.get(from..to).unwrap_or_default().iter().copied());
}

/// The line around a place.
fn line(bytes: &[u8], at: usize) -> std::ops::Range<usize> {
    let before = bytes.get(..at).unwrap_or_default();
    let from = before.iter().rposition(|byte| *byte == b'\n').map_or(0, |place| place + 1);
    let after = bytes.get(at..).unwrap_or_default();
    from..after.iter().position(|byte| *byte == b'\n').map_or(bytes.len(), |place| at + place + 1)
}

/// A line a second time, at once or somewhere else.
fn line_again(bytes: &mut Vec<u8>, at: usize, random: &mut impl Rng) {
    let range = line(bytes, at);
    let copy = bytes.get(range.clone()).unwrap_or_default().to_vec();
    let place =
        if random.random() { range.end } else { line(bytes, random.random_range(0..=bytes.len())).start };
    bytes.splice(place..place, copy);
}

fn swap_lines(bytes: &mut Vec<u8>, random: &mut impl Rng) {
    let at = line(bytes, random.random_range(0..=bytes.len()));
    let taken: Vec<u8> = bytes.drain(at).collect();
    let place = line(bytes, random.random_range(0..=bytes.len())).start;
    bytes.splice(place..place, taken);
}

/// Another number in place of the next one, of the same width when it is shorter.
fn number(bytes: &mut Vec<u8>, at: usize, random: &mut impl Rng) {
    let is_part = |byte: &u8| byte.is_ascii_digit() || matches!(byte, b'.' | b'-' | b'+');
    let Some(from) = bytes.iter().skip(at).position(is_part).map(|place| at + place) else { return };
    let rest = bytes.get(from..).unwrap_or_default();
    let width = rest.iter().position(|byte| !is_part(byte)).unwrap_or(rest.len());
    let new = *NUMBERS.choose(random).unwrap_or(&"0");
    let new = if random.random() { format!("{new:>width$}") } else { new.to_owned() };
    bytes.splice(from..from + width, new.into_bytes());
}
