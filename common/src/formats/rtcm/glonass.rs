//! Message 1020, GLONASS ephemerides (RTCM 10403.3, table 3.5-21), whose values are those of the navigation message (GLONASS
//! ICD, L1 and L2, edition 5.1, tables 4.5 and 4.9): numbers have a sign and a magnitude, lengths are in kilometres.

use nalgebra::Vector3;

use super::clock::StreamClock;
use super::date::{Claim, Unit};
use super::ephemeris::Fault;
use crate::formats::bits::{Bits, TooShort, power};
use crate::formats::moscow::DAYS_OF_FOUR_YEARS;
use crate::frames::{Ecef, EcefVector};
use crate::gnss::{Constellation, SatelliteId};
use crate::orbit::{GlonassEphemeris, accuracy_m, within};
use crate::time::GpsTime;

/// t_b counts quarters of an hour of the Moscow day.
const MILLIS_PER_INTERVAL: i64 = 900_000;
/// The last quarter of an hour of a day.
const LAST_INTERVAL: u32 = 95;
/// DF040 counts channels from −7.
const LOWEST_CHANNEL: i8 = -7;
/// The highest value of DF040, channel 13.
const LAST_CHANNEL: u32 = 20;
/// A slot beyond this is none.
const MAX_SLOT: f64 = 63.0;
/// DF125: Δτ_n of all ones is "minus zero", which says that it is unknown.
const UNKNOWN_L2_DELAY: u32 = 0b1_0000;
/// Slot and frequency channel.
pub(super) fn channel(bytes: &[u8]) -> Result<(u8, i8), Fault> {
    let mut bits = Bits::new(bytes);
    bits.skip(12);
    slot_and_channel(&mut bits)
}

fn slot_and_channel(bits: &mut Bits<'_>) -> Result<(u8, i8), Fault> {
    let (slot, channel) = (bits.unsigned(6)?, bits.unsigned(5)?);
    within("slot", f64::from(slot), 1.0..=MAX_SLOT)?;
    within("frequency channel (DF040)", f64::from(channel), 0.0..=f64::from(LAST_CHANNEL))?;
    // Both are small by now.
    let (slot, channel) = (u8::try_from(slot).unwrap_or(0), i8::try_from(channel).unwrap_or(0));
    Ok((slot, channel + LOWEST_CHANNEL))
}

/// A message as sent: all but its date is known.
pub(super) struct Sent {
    /// Its reference time is to be set.
    ephemeris: GlonassEphemeris,
    /// t_b, milliseconds of the Moscow day.
    millis: i64,
    /// N_T and N_4, as far as they are sent.
    date: Option<(u32, Option<u32>)>,
}

/// Reads the message.
pub(super) fn read(bytes: &[u8]) -> Result<Sent, Fault> {
    let mut bits = Bits::new(bytes);
    bits.skip(12);
    let (slot, frequency_channel) = slot_and_channel(&mut bits)?;
    let almanac_flags = almanac_flags(&mut bits)?;
    bits.skip(2 + 12); // P1, t_k
    let health = u8::from(bits.flag()?);
    bits.skip(1); // P2
    let interval = bits.unsigned(7)?;
    within("t_b (quarters of an hour)", f64::from(interval), 0.0..=f64::from(LAST_INTERVAL))?;
    let [x, y, z] = [Axis::read(&mut bits)?, Axis::read(&mut bits)?, Axis::read(&mut bits)?];
    let rest = Rest::read(&mut bits)?;
    let of = |part: fn(&Axis) -> f64| Vector3::new(part(&x), part(&y), part(&z));
    let ephemeris = GlonassEphemeris {
        satellite: SatelliteId::new(Constellation::Glonass, slot),
        toe: GpsTime::default(),
        position: Ecef(of(|axis| axis.position_m)),
        velocity: EcefVector(of(|axis| axis.velocity_mps)),
        acceleration: EcefVector(of(|axis| axis.acceleration_mps2)),
        tau_s: rest.tau_s,
        gamma: rest.gamma,
        l2_delay_s: rest.l2_delay_s,
        frequency_channel,
        health: Some(health),
        health_flags: Some(almanac_flags | rest.unhealthy_flag << 2),
        age_days: rest.age_days,
        accuracy_m: accuracy_m(rest.accuracy_factor),
    };
    ephemeris.check().map_err(|value| Fault::from(value).of(ephemeris.satellite))?;
    Ok(Sent { ephemeris, millis: i64::from(interval) * MILLIS_PER_INTERVAL, date: rest.date })
}

impl Sent {
    /// The date that it states, if it does.
    pub(super) fn claim(&self, clock: &StreamClock) -> Option<Claim> {
        let (day, four_years) = self.date?;
        let as_sent = clock.of_date(day, four_years, self.millis)?;
        let repeats_days = if four_years.is_some() { None } else { Some(DAYS_OF_FOUR_YEARS.into()) };
        Some(Claim { satellite: self.ephemeris.satellite, as_sent, repeats_days, unit: Unit::Day })
    }

    /// Its reference time on the day that is nearest to the stream's time.
    pub(super) fn on_nearest_day(&self, clock: &StreamClock) -> Option<GpsTime> {
        clock.of_nearest_day(self.millis)
    }

    /// The ephemeris with its reference time.
    pub(super) const fn dated(self, toe: GpsTime) -> GlonassEphemeris {
        GlonassEphemeris { toe, ..self.ephemeris }
    }
}

/// C_n of the almanac and whether it is there, as RINEX 3.05, table A10, has them.
fn almanac_flags(bits: &mut Bits<'_>) -> Result<u8, TooShort> {
    let (healthy, reported) = (bits.flag()?, bits.flag()?);
    Ok(u8::from(healthy) | u8::from(reported) << 1)
}

/// One coordinate with its derivatives, in the order of the message.
struct Axis {
    velocity_mps: f64,
    position_m: f64,
    acceleration_mps2: f64,
}

impl Axis {
    fn read(bits: &mut Bits<'_>) -> Result<Self, TooShort> {
        Ok(Self {
            velocity_mps: bits.sign_magnitude(24, 1e3 * power(-20))?,
            position_m: bits.sign_magnitude(27, 1e3 * power(-11))?,
            acceleration_mps2: bits.sign_magnitude(5, 1e3 * power(-30))?,
        })
    }
}

/// What comes after the coordinates, as far as it is used. What only a GLONASS-M sends is `None` of others.
struct Rest {
    gamma: f64,
    unhealthy_flag: u8,
    tau_s: f64,
    l2_delay_s: Option<f64>,
    age_days: f64,
    accuracy_factor: Option<u8>,
    /// Day of the four years, and number of the four years where it is sent.
    date: Option<(u32, Option<u32>)>,
}

impl Rest {
    fn read(bits: &mut Bits<'_>) -> Result<Self, TooShort> {
        bits.skip(1); // P3
        let gamma = bits.sign_magnitude(11, power(-40))?;
        bits.skip(2); // P of GLONASS-M
        let unhealthy = bits.flag()?;
        let tau_s = bits.sign_magnitude(22, power(-30))?;
        let is_delay_unknown = bits.clone().unsigned(5)? == UNKNOWN_L2_DELAY;
        let l2_delay_s = bits.sign_magnitude(5, power(-30))?;
        let age_days = f64::from(bits.unsigned(5)?);
        bits.skip(1); // P4
        let accuracy_factor = u8::try_from(bits.unsigned(4)?).ok();
        let day = bits.unsigned(11)?;
        let is_modern = bits.unsigned(2)? != 0;
        let four_years = four_years(bits);
        Ok(Self {
            gamma,
            unhealthy_flag: u8::from(unhealthy && is_modern),
            tau_s,
            l2_delay_s: Some(l2_delay_s).filter(|_| is_modern && !is_delay_unknown),
            age_days,
            accuracy_factor: accuracy_factor.filter(|_| is_modern),
            date: Some((day, four_years)).filter(|_| is_modern && day > 0),
        })
    }
}

/// N_4 of the additional data, where the message has them.
fn four_years(bits: &mut Bits<'_>) -> Option<u32> {
    let is_there = bits.flag().ok()?;
    bits.skip(11 + 32); // N^A, tau_c
    bits.unsigned(5).ok().filter(|four_years| is_there && *four_years > 0)
}
