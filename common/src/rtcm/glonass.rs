//! Message 1020, GLONASS ephemerides (RTCM 10403.3, table 3.5-21), whose values are those of the navigation message (GLONASS
//! ICD, L1 and L2, edition 5.1, tables 4.5 and 4.9): numbers have a sign and a magnitude, lengths are in kilometres.

use nalgebra::Vector3;

use super::bits::{Bits, TooShort};
use super::clock::StreamClock;
use super::ephemeris::{Fault, power, within};
use crate::frames::{Ecef, EcefVector};
use crate::gnss::{Constellation, SatelliteId};
use crate::orbit::{GlonassEphemeris, RADIUS_BOUNDS_M, SPEED_BOUNDS_MPS, accuracy_m};

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
/// How far the stream's beginning may be from the instant that stands for it, s. A date farther away is not believed.
const DATE_LIMIT_S: f64 = 4.0 * 86_400.0;

/// Slot and frequency channel.
pub(super) fn channel(bytes: &[u8]) -> Result<(u8, i8), Fault> {
    let mut bits = Bits::new(bytes);
    bits.skip(12);
    slot_and_channel(&mut bits)
}

fn slot_and_channel(bits: &mut Bits<'_>) -> Result<(u8, i8), Fault> {
    let (slot, channel) = (bits.unsigned(6)?, bits.unsigned(5)?);
    within("slot", f64::from(slot), 1.0, MAX_SLOT)?;
    within("frequency channel (DF040)", f64::from(channel), 0.0, f64::from(LAST_CHANNEL))?;
    // Both are small by now.
    let (slot, channel) = (u8::try_from(slot).unwrap_or(0), i8::try_from(channel).unwrap_or(0));
    Ok((slot, channel + LOWEST_CHANNEL))
}

/// Decodes the message. Its reference time lacks the date unless the satellite is a GLONASS-M, which sends the day: until observations have
/// told the time (`told_time`), that day completes it; afterwards the day nearest to the stream's time does.
pub(super) fn decode(bytes: &[u8], clock: &StreamClock, told_time: bool) -> Result<GlonassEphemeris, Fault> {
    let mut bits = Bits::new(bytes);
    bits.skip(12);
    let (slot, frequency_channel) = slot_and_channel(&mut bits)?;
    let almanac_flags = almanac_flags(&mut bits)?;
    bits.skip(2 + 12); // P1, t_k
    let health = u8::from(bits.flag()?);
    bits.skip(1); // P2
    let interval = bits.unsigned(7)?;
    within("t_b (quarters of an hour)", f64::from(interval), 0.0, f64::from(LAST_INTERVAL))?;
    let [x, y, z] = [Axis::read(&mut bits)?, Axis::read(&mut bits)?, Axis::read(&mut bits)?];
    let rest = Rest::read(&mut bits)?;
    let of = |part: fn(&Axis) -> f64| Vector3::new(part(&x), part(&y), part(&z));
    let (position, velocity) = (of(|axis| axis.position_m), of(|axis| axis.velocity_mps));
    within("distance from the Earth's centre (m)", position.norm(), RADIUS_BOUNDS_M.0, RADIUS_BOUNDS_M.1)?;
    within("speed (m/s)", velocity.norm(), SPEED_BOUNDS_MPS.0, SPEED_BOUNDS_MPS.1)?;
    let day = rest.day_of_four_years.filter(|_| !told_time);
    let toe = clock
        .resolve_moscow(day, i64::from(interval) * MILLIS_PER_INTERVAL, DATE_LIMIT_S)
        .ok_or_else(|| Fault::Impossible(format!("t_b = {interval} near {}", clock.near)))?;
    Ok(GlonassEphemeris {
        satellite: SatelliteId::new(Constellation::Glonass, slot),
        toe,
        position: Ecef(position),
        velocity: EcefVector(velocity),
        acceleration: EcefVector(of(|axis| axis.acceleration_mps2)),
        tau_s: rest.tau_s,
        gamma: rest.gamma,
        l2_delay_s: rest.l2_delay_s,
        frequency_channel,
        health: Some(health),
        health_flags: Some(almanac_flags | rest.unhealthy_flag << 2),
        age_days: rest.age_days,
        accuracy_m: accuracy_m(rest.accuracy_factor),
    })
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
    day_of_four_years: Option<u32>,
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
        Ok(Self {
            gamma,
            unhealthy_flag: u8::from(unhealthy && is_modern),
            tau_s,
            l2_delay_s: Some(l2_delay_s).filter(|_| is_modern && !is_delay_unknown),
            age_days,
            accuracy_factor: accuracy_factor.filter(|_| is_modern),
            day_of_four_years: Some(day).filter(|_| is_modern),
        })
    }
}
