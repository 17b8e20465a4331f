//! Ephemeris messages 1019 (GPS), 1042 (BeiDou), 1044 (QZSS), 1045 and 1046 (Galileo F/NAV and I/NAV).
//!
//! RTCM 10403.3, tables 3.5-21, 3.5-92, 3.5-94, 3.5-95; the scale factors are those of the systems' own documents.

use std::f64::consts::PI;

use super::bits::{Bits, TooShort};
use crate::gnss::{Constellation, SatelliteId};
use crate::orbit::{KeplerEphemeris, NavigationMessage};
use crate::time::{BEIDOU_BEHIND_GPS_S, BEIDOU_WEEK_OFFSET, GpsTime, SECONDS_PER_WEEK};

/// Galileo week 0 is GPS week 1024.
const GALILEO_WEEK_OFFSET: i64 = 1024;
/// Accuracy assumed where the message gives no prediction, m.
const UNKNOWN_ACCURACY_M: f64 = 10.0;
/// Clock reference and orbit reference are never farther apart than this, s.
const MAX_TOE_TOC_S: f64 = 86_400.0;

/// Why a message gives no ephemeris.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Fault {
    /// It ends too early.
    TooShort,
    /// A value that cannot be: what, and its limits.
    Impossible(String),
}

impl From<TooShort> for Fault {
    fn from(_: TooShort) -> Self {
        Self::TooShort
    }
}

/// The fields that all five messages have in this order, from C_rs to Ω̇.
struct Orbit {
    crs_m: f64,
    delta_n_radps: f64,
    m0_rad: f64,
    cuc_rad: f64,
    eccentricity: f64,
    cus_rad: f64,
    sqrt_a: f64,
    toe_s: f64,
    cic_rad: f64,
    omega0_rad: f64,
    cis_rad: f64,
    i0_rad: f64,
    crc_m: f64,
    omega_rad: f64,
    omega_dot_radps: f64,
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
const fn power(n: i32) -> f64 {
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
struct Rest {
    satellite: SatelliteId,
    message: NavigationMessage,
    /// As sent, and how many weeks until the number repeats.
    week: (u32, i64),
    i_dot_radps: f64,
    toc_s: f64,
    clock: (f64, f64, f64),
    group_delays_s: (f64, f64),
    accuracy_m: f64,
    health: u32,
    issue_of_data: u32,
}

/// Decodes an ephemeris message by its number. `now` is where the stream is in time, to complete week numbers.
pub(super) fn decode(bytes: &[u8], number: u32, now: GpsTime) -> Result<KeplerEphemeris, Fault> {
    let mut bits = Bits::new(bytes);
    bits.skip(12);
    let (rest, orbit) = match number {
        1019 => gps(&mut bits)?,
        1042 => beidou(&mut bits)?,
        1044 => qzss(&mut bits)?,
        _ => galileo(&mut bits, number == 1046)?,
    };
    assemble(&rest, &orbit, now)
}

fn gps(bits: &mut Bits<'_>) -> Result<(Rest, Orbit), TooShort> {
    let widths = widths(Constellation::Gps);
    let satellite = satellite(bits, 6, Constellation::Gps)?;
    let week = (bits.unsigned(10)?, 1024);
    let accuracy_m = ura_m(bits.unsigned(4)?);
    bits.skip(2); // code on L2
    let i_dot_radps = bits.scaled(14, PI * power(-43))?;
    let issue_of_data = bits.unsigned(8)?;
    let (toc_s, clock) = lnav_clock(bits, &widths)?;
    bits.skip(10); // IODC
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
    };
    Ok((rest, orbit))
}

fn qzss(bits: &mut Bits<'_>) -> Result<(Rest, Orbit), TooShort> {
    let widths = widths(Constellation::Qzss);
    let satellite = satellite(bits, 4, Constellation::Qzss)?;
    let (toc_s, clock) = lnav_clock(bits, &widths)?;
    let issue_of_data = bits.unsigned(8)?;
    let orbit = Orbit::read(bits, &widths)?;
    let i_dot_radps = bits.scaled(14, PI * power(-43))?;
    bits.skip(2); // code on L2
    let week = (bits.unsigned(10)?, 1024);
    let accuracy_m = ura_m(bits.unsigned(4)?);
    let health = bits.unsigned(6)?;
    let group_delays_s = (bits.scaled(8, power(-31))?, 0.0);
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

fn beidou(bits: &mut Bits<'_>) -> Result<(Rest, Orbit), TooShort> {
    let widths = widths(Constellation::Beidou);
    let satellite = satellite(bits, 6, Constellation::Beidou)?;
    let week = (bits.unsigned(13)?, 8192);
    let accuracy_m = ura_m(bits.unsigned(4)?);
    let i_dot_radps = bits.scaled(14, PI * power(-43))?;
    let issue_of_data = bits.unsigned(5)?;
    let toc_s = bits.scaled_unsigned(widths.time.0, widths.time.1)?;
    let rate = bits.scaled(11, power(-66))?;
    let drift = bits.scaled(22, power(-50))?;
    let clock = (bits.scaled(24, power(-33))?, drift, rate);
    bits.skip(5); // AODC
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
    };
    Ok((rest, orbit))
}

fn galileo(bits: &mut Bits<'_>, inav: bool) -> Result<(Rest, Orbit), TooShort> {
    let widths = widths(Constellation::Galileo);
    let satellite = satellite(bits, 6, Constellation::Galileo)?;
    let week = (bits.unsigned(12)?, 4096);
    let issue_of_data = bits.unsigned(10)?;
    let accuracy_m = sisa_m(bits.unsigned(8)?);
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

/// User range accuracy of an index (IS-GPS-200, 20.3.3.3.1.3; BDS-SIS-ICD-B1I, 5.2.4.5), m.
fn ura_m(index: u32) -> f64 {
    match index {
        1 => 2.8,
        3 => 5.7,
        5 => 11.3,
        0..=6 => 2_f64.powf(1.0 + f64::from(index) / 2.0),
        _ => 2_f64.powf(f64::from(index) - 2.0),
    }
}

/// Signal-in-space accuracy of an index (Galileo OS SIS ICD, table 89), m.
fn sisa_m(index: u32) -> f64 {
    let above = |start: u32, base: f64, step: f64| base + step * f64::from(index - start);
    match index {
        0..50 => above(0, 0.0, 0.01).max(0.01),
        50..75 => above(50, 0.5, 0.02),
        75..100 => above(75, 1.0, 0.04),
        100..=125 => above(100, 2.0, 0.16),
        _ => UNKNOWN_ACCURACY_M,
    }
}

fn assemble(rest: &Rest, orbit: &Orbit, now: GpsTime) -> Result<KeplerEphemeris, Fault> {
    within("satellite number", f64::from(rest.satellite.number), 1.0, 63.0)?;
    within("sqrt(A)", orbit.sqrt_a, 4e3, 8e3)?;
    within("eccentricity", orbit.eccentricity, 0.0, 0.499)?;
    within("toe", orbit.toe_s, 0.0, SECONDS_PER_WEEK - 1.0)?;
    within("toc", rest.toc_s, 0.0, SECONDS_PER_WEEK - 1.0)?;
    let (toe, toc) = references(rest, orbit.toe_s, now)?;
    Ok(KeplerEphemeris {
        satellite: rest.satellite,
        message: rest.message,
        toe,
        toe_own_tow_s: orbit.toe_s,
        toc,
        sqrt_a: orbit.sqrt_a,
        eccentricity: orbit.eccentricity,
        i0_rad: orbit.i0_rad,
        i_dot_radps: rest.i_dot_radps,
        omega0_rad: orbit.omega0_rad,
        omega_dot_radps: orbit.omega_dot_radps,
        omega_rad: orbit.omega_rad,
        m0_rad: orbit.m0_rad,
        delta_n_radps: orbit.delta_n_radps,
        cuc_cus_rad: (orbit.cuc_rad, orbit.cus_rad),
        crc_crs_m: (orbit.crc_m, orbit.crs_m),
        cic_cis_rad: (orbit.cic_rad, orbit.cis_rad),
        clock: rest.clock,
        group_delays_s: rest.group_delays_s,
        accuracy_m: rest.accuracy_m,
        health: f64::from(rest.health),
        issue_of_data: rest.issue_of_data,
    })
}

fn within(name: &str, value: f64, low: f64, high: f64) -> Result<(), Fault> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(Fault::Impossible(format!("{name} = {value:e}, limits {low:e} to {high:e}")))
}

/// Reference times of orbit and clock. The week as sent is that of the transmission, so next to a week's end the reference
/// may lie in the other week; the stream's own time decides, and the clock's reference goes with the orbit's.
fn references(rest: &Rest, toe_s: f64, now: GpsTime) -> Result<(GpsTime, GpsTime), Fault> {
    let (offset, behind_s) = match rest.satellite.constellation {
        Constellation::Beidou => (BEIDOU_WEEK_OFFSET, BEIDOU_BEHIND_GPS_S),
        Constellation::Galileo => (GALILEO_WEEK_OFFSET, 0.0),
        _ => (0, 0.0),
    };
    let (sent, period) = rest.week;
    let shortened = i64::from(sent) + offset;
    let periods = (now.week() - shortened + period / 2).div_euclid(period);
    let week = shortened + periods * period;
    let as_sent = GpsTime::from_week_tow(week, toe_s + behind_s);
    let toe = [0.0, -SECONDS_PER_WEEK, SECONDS_PER_WEEK]
        .into_iter()
        .map(|shift| as_sent + shift)
        .find(|toe| (*toe - now).abs() <= SECONDS_PER_WEEK / 2.0)
        .unwrap_or(as_sent);
    let same_week = toe + (rest.toc_s - toe_s);
    let toc = same_week + ((toe - same_week) / SECONDS_PER_WEEK).round() * SECONDS_PER_WEEK;
    if (toe - toc).abs() > MAX_TOE_TOC_S {
        return Err(Fault::Impossible(format!(
            "toe {toe} and toc {toc} are more than {MAX_TOE_TOC_S} s apart"
        )));
    }
    Ok((toe, toc))
}
