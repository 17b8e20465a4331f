//! Ephemeris messages 1019 (GPS), 1042 (BeiDou), 1044 (QZSS), 1045 and 1046 (Galileo F/NAV and I/NAV).
//!
//! RTCM 10403.3; the scale factors are those of the systems' own documents.

mod fields;

pub(super) use fields::power;
use fields::{Orbit, Rest};

use super::bits::{Bits, TooShort};
use crate::gnss::Constellation;
use crate::orbit::KeplerEphemeris;
use crate::time::{BEIDOU_BEHIND_GPS_S, BEIDOU_WEEK_OFFSET, GpsTime, SECONDS_PER_WEEK};

/// Galileo week 0 is GPS week 1024.
const GALILEO_WEEK_OFFSET: i64 = 1024;
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

/// Decodes an ephemeris message by its number. `now` is where the stream is in time, to complete week numbers.
pub(super) fn decode(bytes: &[u8], number: u32, now: GpsTime) -> Result<KeplerEphemeris, Fault> {
    let mut bits = Bits::new(bytes);
    bits.skip(12);
    let (rest, orbit) = match number {
        1019 => fields::gps(&mut bits)?,
        1042 => fields::beidou(&mut bits)?,
        1044 => fields::qzss(&mut bits)?,
        _ => fields::galileo(&mut bits, number == 1046)?,
    };
    assemble(&rest, &orbit, now)
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
        issue_of_clock: rest.issue_of_clock,
    })
}

/// Refuses a value outside its limits.
pub(super) fn within(name: &str, value: f64, low: f64, high: f64) -> Result<(), Fault> {
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
