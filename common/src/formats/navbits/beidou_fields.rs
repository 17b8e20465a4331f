//! The numbers in BeiDou D1 and D2 (BDS-SIS-ICD-B1I 3.0, 5.2 and 5.3).
//!
//! Both messages cut the same numbers into pieces, in different order. Here the pieces' bits stand one after the other, so that no
//! number is cut: 186, 186 and 185 bits of subframes 1 to 3 of D1, or the bits of pages 1 to 10 of D2, 557 in both cases.

use super::beidou_words::Data;
use crate::formats::bits::{angle, copy, number, positive, signed, unsigned};
use crate::gnss::SatelliteId;
use crate::orbit::{KeplerEphemeris, NavigationMessage, ura_m};
use crate::time::GpsTime;

/// The numbers' bits without gaps.
pub(super) type Joined = [u8; 70];

/// First bit and number of bits that the pieces of a message contribute.
type Parts = &'static [(usize, usize)];

/// Subframes 1 to 3 of D1: all after SOW but the last bit, which is reserved.
const D1_PARTS: Parts = &[(38, 186), (38, 186), (38, 185)];
/// Pages 1 to 10 of subframe 1 of D2: from behind the page number to the reserved bits.
const D2_PARTS: Parts =
    &[(42, 60), (42, 64), (80, 28), (42, 64), (42, 64), (42, 64), (42, 64), (42, 66), (42, 64), (42, 19)];

/// First bits of the numbers that the two messages place differently.
struct Places {
    af0: usize,
    af1: usize,
    af2: usize,
    e: usize,
    cus: usize,
    crc: usize,
    crs: usize,
    sqrt_a: usize,
    cic: usize,
    cis: usize,
    omega_dot: usize,
    i_dot: usize,
    omega0: usize,
    omega: usize,
}

const D1: Places = Places {
    af2: 124,
    af0: 135,
    af1: 159,
    e: 252,
    cus: 284,
    crc: 302,
    crs: 320,
    sqrt_a: 338,
    cic: 419,
    omega_dot: 437,
    cis: 461,
    i_dot: 479,
    omega0: 493,
    omega: 525,
};

const D2: Places = Places {
    af0: 124,
    af1: 148,
    af2: 170,
    cus: 252,
    e: 270,
    sqrt_a: 302,
    cic: 334,
    cis: 352,
    crc: 419,
    crs: 437,
    omega_dot: 455,
    omega0: 479,
    omega: 511,
    i_dot: 543,
};

/// Puts the pieces' bits one after the other; those of a missing piece are zero.
pub(super) fn join(pieces: &[Option<Data>], geostationary: bool) -> Joined {
    let parts = if geostationary { D2_PARTS } else { D1_PARTS };
    let mut joined = [0; 70];
    let mut at = 0;
    for (piece, (from, count)) in pieces.iter().zip(parts) {
        if let Some(data) = piece {
            copy(data, *from, &mut joined, at, *count);
        }
        at += count;
    }
    joined
}

/// The week, modulo 8192.
pub(super) fn week(joined: &Joined) -> u64 {
    unsigned(joined, 10, 13)
}

/// toe and toc, s of the BeiDou week.
pub(super) fn references_s(joined: &Joined) -> (f64, f64) {
    (positive(joined, 370, 17, 3), positive(joined, 23, 17, 3))
}

/// The ephemeris, with toe and toc as instants.
pub(super) fn ephemeris(
    satellite: SatelliteId,
    joined: &Joined,
    (toe, toc): (GpsTime, GpsTime),
) -> KeplerEphemeris {
    let at = if satellite.is_beidou_geostationary() { D2 } else { D1 };
    let tenths_of_ns = |start: usize| signed(joined, start, 10) as f64 * 1e-10;
    let radians = |start: usize| number(joined, start, 18, -31);
    let metres = |start: usize| number(joined, start, 18, -6);
    KeplerEphemeris {
        satellite,
        message: NavigationMessage::BeidouD1D2,
        toe,
        toe_own_tow_s: references_s(joined).0,
        toc,
        sqrt_a: positive(joined, at.sqrt_a, 32, -19),
        eccentricity: positive(joined, at.e, 32, -33),
        i0_rad: angle(joined, 387, 32, -31),
        i_dot_radps: angle(joined, at.i_dot, 14, -43),
        omega0_rad: angle(joined, at.omega0, 32, -31),
        omega_dot_radps: angle(joined, at.omega_dot, 24, -43),
        omega_rad: angle(joined, at.omega, 32, -31),
        m0_rad: angle(joined, 220, 32, -31),
        delta_n_radps: angle(joined, 186, 16, -43),
        cuc_cus_rad: (radians(202), radians(at.cus)),
        crc_crs_m: (metres(at.crc), metres(at.crs)),
        cic_cis_rad: (radians(at.cic), radians(at.cis)),
        clock: (
            number(joined, at.af0, 24, -33),
            number(joined, at.af1, 22, -50),
            number(joined, at.af2, 11, -66),
        ),
        group_delays_s: (tenths_of_ns(40), tenths_of_ns(50)),
        accuracy_m: ura_m(unsigned(joined, 6, 4)),
        health: unsigned(joined, 0, 1) as f64,
        issue_of_data: u32::try_from(unsigned(joined, 181, 5)).unwrap_or_default(),
        issue_of_clock: u32::try_from(unsigned(joined, 1, 5)).unwrap_or_default(),
    }
}
