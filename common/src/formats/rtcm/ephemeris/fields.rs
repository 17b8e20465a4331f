//! The fields of the ephemeris messages, in their order.

use std::f64::consts::PI;

use super::super::bits::{Bits, TooShort};
use crate::gnss::{Constellation, SatelliteId};
use crate::orbit::{NavigationMessage, sisa_m, ura_m};

/// The fields that all five messages have in this order, from C_rs to Ω̇.
pub(super) struct Orbit {
    pub(super) crs_m: f64,
    pub(super) delta_n_radps: f64,
    pub(super) m0_rad: f64,
    pub(super) cuc_rad: f64,
    pub(super) eccentricity: f64,
    pub(super) cus_rad: f64,
    pub(super) sqrt_a: f64,
    pub(super) toe_s: f64,
    pub(super) cic_rad: f64,
    pub(super) omega0_rad: f64,
    pub(super) cis_rad: f64,
    pub(super) i0_rad: f64,
    pub(super) crc_m: f64,
    pub(super) omega_rad: f64,
    pub(super) omega_dot_radps: f64,
}

/// Widths and scale factors in which the systems differ.
struct Widths {
    /// Harmonic corrections: bits, scale of angles (rad), scale of lengths (m).
    harmonic: (usize, f64, f64),
    /// Reference times: bits and scale, s.
    time: (usize, f64),
}

const fn widths(constellation: Constellation) -> Widths {
    match constellation {
        Constellation::Beidou => Widths { harmonic: (18, power(-31), power(-6)), time: (17, 8.0) },
        Constellation::Galileo => Widths { harmonic: (16, power(-29), power(-5)), time: (14, 60.0) },
        _ => Widths { harmonic: (16, power(-29), power(-5)), time: (16, 16.0) },
    }
}

/// 2ⁿ for n ≤ 0.
pub(in crate::formats::rtcm) const fn power(n: i32) -> f64 {
    let mut value = 1.0;
    let mut k = 0;
    while k > n {
        value /= 2.0;
        k -= 1;
    }
    value
}

impl Orbit {
    fn read(bits: &mut Bits<'_>, widths: &Widths) -> Result<Self, TooShort> {
        let (harmonic, angle, length) = widths.harmonic;
        let semicircles = PI * power(-31);
        // Struct fields are evaluated in the order written, which is that of the message.
        Ok(Self {
            crs_m: bits.scaled(harmonic, length)?,
            delta_n_radps: bits.scaled(16, PI * power(-43))?,
            m0_rad: bits.scaled(32, semicircles)?,
            cuc_rad: bits.scaled(harmonic, angle)?,
            eccentricity: bits.scaled_unsigned(32, power(-33))?,
            cus_rad: bits.scaled(harmonic, angle)?,
            sqrt_a: bits.scaled_unsigned(32, power(-19))?,
            toe_s: bits.scaled_unsigned(widths.time.0, widths.time.1)?,
            cic_rad: bits.scaled(harmonic, angle)?,
            omega0_rad: bits.scaled(32, semicircles)?,
            cis_rad: bits.scaled(harmonic, angle)?,
            i0_rad: bits.scaled(32, semicircles)?,
            crc_m: bits.scaled(harmonic, length)?,
            omega_rad: bits.scaled(32, semicircles)?,
            omega_dot_radps: bits.scaled(24, PI * power(-43))?,
        })
    }
}

/// The fields around the orbit.
pub(super) struct Rest {
    pub(super) satellite: SatelliteId,
    pub(super) message: NavigationMessage,
    /// As sent, and how many weeks until the number repeats.
    pub(super) week: (u32, i64),
    pub(super) i_dot_radps: f64,
    pub(super) toc_s: f64,
    pub(super) clock: (f64, f64, f64),
    pub(super) group_delays_s: (f64, f64),
    pub(super) accuracy_m: f64,
    pub(super) health: u32,
    pub(super) issue_of_data: u32,
    pub(super) issue_of_clock: u32,
}

/// Message 1019.
pub(super) fn gps(bits: &mut Bits<'_>) -> Result<(Rest, Orbit), TooShort> {
    let widths = widths(Constellation::Gps);
    let satellite = satellite(bits, 6, Constellation::Gps)?;
    let week = (bits.unsigned(10)?, 1024);
    let accuracy_m = ura_m(bits.unsigned(4)?.into());
    bits.skip(2); // code on L2
    let i_dot_radps = bits.scaled(14, PI * power(-43))?;
    let issue_of_data = bits.unsigned(8)?;
    let (toc_s, clock) = lnav_clock(bits, &widths)?;
    let issue_of_clock = bits.unsigned(10)?;
    let orbit = Orbit::read(bits, &widths)?;
    let group_delays_s = (bits.scaled(8, power(-31))?, 0.0);
    let health = bits.unsigned(6)?;
    let message = NavigationMessage::Lnav;
    let rest = Rest {
        satellite,
        message,
        week,
        i_dot_radps,
        toc_s,
        clock,
        group_delays_s,
        accuracy_m,
        health,
        issue_of_data,
        issue_of_clock,
    };
    Ok((rest, orbit))
}

/// Message 1044.
pub(super) fn qzss(bits: &mut Bits<'_>) -> Result<(Rest, Orbit), TooShort> {
    let widths = widths(Constellation::Qzss);
    let satellite = satellite(bits, 4, Constellation::Qzss)?;
    let (toc_s, clock) = lnav_clock(bits, &widths)?;
    let issue_of_data = bits.unsigned(8)?;
    let orbit = Orbit::read(bits, &widths)?;
    let i_dot_radps = bits.scaled(14, PI * power(-43))?;
    bits.skip(2); // code on L2
    let week = (bits.unsigned(10)?, 1024);
    let accuracy_m = ura_m(bits.unsigned(4)?.into());
    let health = bits.unsigned(6)?;
    let group_delays_s = (bits.scaled(8, power(-31))?, 0.0);
    let issue_of_clock = bits.unsigned(10)?;
    let message = NavigationMessage::Lnav;
    let rest = Rest {
        satellite,
        message,
        week,
        i_dot_radps,
        toc_s,
        clock,
        group_delays_s,
        accuracy_m,
        health,
        issue_of_data,
        issue_of_clock,
    };
    Ok((rest, orbit))
}

/// toc and the clock polynomial, sent from the highest power down.
fn lnav_clock(bits: &mut Bits<'_>, widths: &Widths) -> Result<(f64, (f64, f64, f64)), TooShort> {
    let toc_s = bits.scaled_unsigned(widths.time.0, widths.time.1)?;
    let rate = bits.scaled(8, power(-55))?;
    let drift = bits.scaled(16, power(-43))?;
    let bias = bits.scaled(22, power(-31))?;
    Ok((toc_s, (bias, drift, rate)))
}

/// Message 1042.
pub(super) fn beidou(bits: &mut Bits<'_>) -> Result<(Rest, Orbit), TooShort> {
    let widths = widths(Constellation::Beidou);
    let satellite = satellite(bits, 6, Constellation::Beidou)?;
    let week = (bits.unsigned(13)?, 8192);
    let accuracy_m = ura_m(bits.unsigned(4)?.into());
    let i_dot_radps = bits.scaled(14, PI * power(-43))?;
    let issue_of_data = bits.unsigned(5)?;
    let toc_s = bits.scaled_unsigned(widths.time.0, widths.time.1)?;
    let rate = bits.scaled(11, power(-66))?;
    let drift = bits.scaled(22, power(-50))?;
    let clock = (bits.scaled(24, power(-33))?, drift, rate);
    let issue_of_clock = bits.unsigned(5)?;
    let orbit = Orbit::read(bits, &widths)?;
    let group_delays_s = (bits.scaled(10, 1e-10)?, bits.scaled(10, 1e-10)?);
    let health = bits.unsigned(1)?;
    let message = NavigationMessage::BeidouD1D2;
    let rest = Rest {
        satellite,
        message,
        week,
        i_dot_radps,
        toc_s,
        clock,
        group_delays_s,
        accuracy_m,
        health,
        issue_of_data,
        issue_of_clock,
    };
    Ok((rest, orbit))
}

/// Message 1046 (I/NAV) or 1045 (F/NAV).
pub(super) fn galileo(bits: &mut Bits<'_>, inav: bool) -> Result<(Rest, Orbit), TooShort> {
    let widths = widths(Constellation::Galileo);
    let satellite = satellite(bits, 6, Constellation::Galileo)?;
    let week = (bits.unsigned(12)?, 4096);
    let issue_of_data = bits.unsigned(10)?;
    let issue_of_clock = issue_of_data;
    let accuracy_m = sisa_m(bits.unsigned(8)?.into());
    let i_dot_radps = bits.scaled(14, PI * power(-43))?;
    let toc_s = bits.scaled_unsigned(widths.time.0, widths.time.1)?;
    let rate = bits.scaled(6, power(-59))?;
    let drift = bits.scaled(21, power(-46))?;
    let clock = (bits.scaled(31, power(-34))?, drift, rate);
    let orbit = Orbit::read(bits, &widths)?;
    let e5a_s = bits.scaled(10, power(-32))?;
    let (message, e5b_s, health) = if inav {
        let e5b_s = bits.scaled(10, power(-32))?;
        let (e5b, e1b) = (signal_health(bits)?, signal_health(bits)?);
        (NavigationMessage::GalileoInav, e5b_s, e5b << 6 | e1b)
    } else {
        (NavigationMessage::GalileoFnav, f64::NAN, signal_health(bits)? << 3)
    };
    let group_delays_s = (e5a_s, e5b_s);
    let rest = Rest {
        satellite,
        message,
        week,
        i_dot_radps,
        toc_s,
        clock,
        group_delays_s,
        accuracy_m,
        health,
        issue_of_data,
        issue_of_clock,
    };
    Ok((rest, orbit))
}

/// Health (2 bits) and data validity (1 bit) of a signal in the order of RINEX 3.05, table A8: validity lowest.
fn signal_health(bits: &mut Bits<'_>) -> Result<u32, TooShort> {
    let health = bits.unsigned(2)?;
    Ok(health << 1 | bits.unsigned(1)?)
}

fn satellite(
    bits: &mut Bits<'_>,
    width: usize,
    constellation: Constellation,
) -> Result<SatelliteId, TooShort> {
    let number = u8::try_from(bits.unsigned(width)?).unwrap_or_default();
    Ok(SatelliteId::new(constellation, number))
}
