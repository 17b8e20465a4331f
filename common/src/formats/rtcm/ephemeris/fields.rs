//! The fields of the ephemeris messages, in their order.

use std::f64::consts::PI;

use super::Sent;
use crate::formats::bits::{Bits, TooShort, power};
use crate::gnss::{Constellation, SatelliteId};
use crate::orbit::{KeplerEphemeris, NavigationMessage, sisa_m, ura_m};
use crate::time::GpsTime;

/// Widths and scale factors in which the systems differ.
struct Widths {
    /// Harmonic corrections: bits, scale of angles (rad), scale of lengths (m).
    harmonic: (usize, f64, f64),
    /// Reference times: bits and scale, s.
    time: (usize, f64),
    /// Drift rate (s/s²), drift (s/s) and bias (s) of the clock, in the order of the message: bits and scale.
    clock: [(usize, f64); 3],
}

const LNAV: Widths = Widths {
    harmonic: (16, power(-29), power(-5)),
    time: (16, 16.0),
    clock: [(8, power(-55)), (16, power(-43)), (22, power(-31))],
};

const fn widths(constellation: Constellation) -> Widths {
    match constellation {
        Constellation::Beidou => Widths {
            harmonic: (18, power(-31), power(-6)),
            time: (17, 8.0),
            clock: [(11, power(-66)), (22, power(-50)), (24, power(-33))],
        },
        Constellation::Galileo => {
            Widths { time: (14, 60.0), clock: [(6, power(-59)), (21, power(-46)), (31, power(-34))], ..LNAV }
        }
        _ => LNAV,
    }
}

/// A message of which nothing has been read yet.
fn blank(satellite: SatelliteId, message: NavigationMessage) -> Sent {
    let ephemeris = KeplerEphemeris {
        satellite,
        message,
        toe: GpsTime::default(),
        toe_own_tow_s: 0.0,
        toc: GpsTime::default(),
        sqrt_a: 0.0,
        eccentricity: 0.0,
        i0_rad: 0.0,
        i_dot_radps: 0.0,
        omega0_rad: 0.0,
        omega_dot_radps: 0.0,
        omega_rad: 0.0,
        m0_rad: 0.0,
        delta_n_radps: 0.0,
        cuc_cus_rad: (0.0, 0.0),
        crc_crs_m: (0.0, 0.0),
        cic_cis_rad: (0.0, 0.0),
        clock: (0.0, 0.0, 0.0),
        group_delays_s: (0.0, 0.0),
        accuracy_m: 0.0,
        health: 0.0,
        issue_of_data: 0,
        issue_of_clock: 0,
    };
    Sent { ephemeris, toc_s: 0.0, week: (0, 1) }
}

/// The fields that all five messages have in this order, from C_rs to Ω̇.
fn orbit(e: &mut KeplerEphemeris, bits: &mut Bits<'_>, widths: &Widths) -> Result<(), TooShort> {
    let (harmonic, angle, length) = widths.harmonic;
    let semicircles = PI * power(-31);
    e.crc_crs_m.1 = bits.scaled(harmonic, length)?;
    e.delta_n_radps = bits.scaled(16, PI * power(-43))?;
    e.m0_rad = bits.scaled(32, semicircles)?;
    e.cuc_cus_rad.0 = bits.scaled(harmonic, angle)?;
    e.eccentricity = bits.scaled_unsigned(32, power(-33))?;
    e.cuc_cus_rad.1 = bits.scaled(harmonic, angle)?;
    e.sqrt_a = bits.scaled_unsigned(32, power(-19))?;
    e.toe_own_tow_s = bits.scaled_unsigned(widths.time.0, widths.time.1)?;
    e.cic_cis_rad.0 = bits.scaled(harmonic, angle)?;
    e.omega0_rad = bits.scaled(32, semicircles)?;
    e.cic_cis_rad.1 = bits.scaled(harmonic, angle)?;
    e.i0_rad = bits.scaled(32, semicircles)?;
    e.crc_crs_m.0 = bits.scaled(harmonic, length)?;
    e.omega_rad = bits.scaled(32, semicircles)?;
    e.omega_dot_radps = bits.scaled(24, PI * power(-43))?;
    Ok(())
}

/// Rate of the inclination, which stands in every message elsewhere.
fn inclination_rate(e: &mut KeplerEphemeris, bits: &mut Bits<'_>) -> Result<(), TooShort> {
    e.i_dot_radps = bits.scaled(14, PI * power(-43))?;
    Ok(())
}

/// toc and the clock polynomial, sent from the highest power down.
fn clock(sent: &mut Sent, bits: &mut Bits<'_>, widths: &Widths) -> Result<(), TooShort> {
    let [rate, drift, bias] = widths.clock;
    sent.toc_s = bits.scaled_unsigned(widths.time.0, widths.time.1)?;
    sent.ephemeris.clock.2 = bits.scaled(rate.0, rate.1)?;
    sent.ephemeris.clock.1 = bits.scaled(drift.0, drift.1)?;
    sent.ephemeris.clock.0 = bits.scaled(bias.0, bias.1)?;
    Ok(())
}

/// Message 1019.
pub(super) fn gps(bits: &mut Bits<'_>) -> Result<Sent, TooShort> {
    let widths = widths(Constellation::Gps);
    let mut sent = blank(satellite(bits, 6, Constellation::Gps)?, NavigationMessage::Lnav);
    sent.week = (bits.unsigned(10)?, 1024);
    sent.ephemeris.accuracy_m = ura_m(bits.unsigned(4)?.into());
    bits.skip(2); // code on L2
    inclination_rate(&mut sent.ephemeris, bits)?;
    sent.ephemeris.issue_of_data = bits.unsigned(8)?;
    clock(&mut sent, bits, &widths)?;
    sent.ephemeris.issue_of_clock = bits.unsigned(10)?;
    orbit(&mut sent.ephemeris, bits, &widths)?;
    sent.ephemeris.group_delays_s.0 = bits.scaled(8, power(-31))?;
    sent.ephemeris.health = bits.scaled_unsigned(6, 1.0)?;
    Ok(sent)
}

/// Message 1044.
pub(super) fn qzss(bits: &mut Bits<'_>) -> Result<Sent, TooShort> {
    let widths = widths(Constellation::Qzss);
    let mut sent = blank(satellite(bits, 4, Constellation::Qzss)?, NavigationMessage::Lnav);
    clock(&mut sent, bits, &widths)?;
    sent.ephemeris.issue_of_data = bits.unsigned(8)?;
    orbit(&mut sent.ephemeris, bits, &widths)?;
    inclination_rate(&mut sent.ephemeris, bits)?;
    bits.skip(2); // code on L2
    sent.week = (bits.unsigned(10)?, 1024);
    sent.ephemeris.accuracy_m = ura_m(bits.unsigned(4)?.into());
    sent.ephemeris.health = bits.scaled_unsigned(6, 1.0)?;
    sent.ephemeris.group_delays_s.0 = bits.scaled(8, power(-31))?;
    sent.ephemeris.issue_of_clock = bits.unsigned(10)?;
    Ok(sent)
}

/// Message 1042.
pub(super) fn beidou(bits: &mut Bits<'_>) -> Result<Sent, TooShort> {
    let widths = widths(Constellation::Beidou);
    let mut sent = blank(satellite(bits, 6, Constellation::Beidou)?, NavigationMessage::BeidouD1D2);
    sent.week = (bits.unsigned(13)?, 8192);
    sent.ephemeris.accuracy_m = ura_m(bits.unsigned(4)?.into());
    inclination_rate(&mut sent.ephemeris, bits)?;
    sent.ephemeris.issue_of_data = bits.unsigned(5)?;
    clock(&mut sent, bits, &widths)?;
    sent.ephemeris.issue_of_clock = bits.unsigned(5)?;
    orbit(&mut sent.ephemeris, bits, &widths)?;
    sent.ephemeris.group_delays_s = (bits.scaled(10, 1e-10)?, bits.scaled(10, 1e-10)?);
    sent.ephemeris.health = bits.scaled_unsigned(1, 1.0)?;
    Ok(sent)
}

/// Message 1046 (I/NAV) or 1045 (F/NAV).
pub(super) fn galileo(bits: &mut Bits<'_>, message: NavigationMessage) -> Result<Sent, TooShort> {
    let widths = widths(Constellation::Galileo);
    let mut sent = blank(satellite(bits, 6, Constellation::Galileo)?, message);
    sent.week = (bits.unsigned(12)?, 4096);
    sent.ephemeris.issue_of_data = bits.unsigned(10)?;
    sent.ephemeris.issue_of_clock = sent.ephemeris.issue_of_data;
    sent.ephemeris.accuracy_m = sisa_m(bits.unsigned(8)?.into());
    inclination_rate(&mut sent.ephemeris, bits)?;
    clock(&mut sent, bits, &widths)?;
    orbit(&mut sent.ephemeris, bits, &widths)?;
    let e5a_s = bits.scaled(10, power(-32))?;
    let (e5b_s, health) = if message == NavigationMessage::GalileoInav {
        let e5b_s = bits.scaled(10, power(-32))?;
        let (e5b, e1b) = (signal_health(bits)?, signal_health(bits)?);
        (e5b_s, e5b << 6 | e1b)
    } else {
        (f64::NAN, signal_health(bits)? << 3)
    };
    sent.ephemeris.group_delays_s = (e5a_s, e5b_s);
    sent.ephemeris.health = f64::from(health);
    Ok(sent)
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
