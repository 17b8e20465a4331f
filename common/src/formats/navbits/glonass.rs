//! GLONASS strings to ephemerides (GLONASS ICD, L1 and L2, edition 5.1, 4.3 and 4.4).
//!
//! A frame has 15 strings and takes 30 s; its strings 1 to 4 are the message of the satellite that sends it. Strings have no issue
//! of data, so those of a message are of one frame: they come in order, under one frame number, within its 30 s.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::glonass_string::GlonassString;
use super::{ReceiverCheck, Refused, impossible, refused};
use crate::formats::moscow::{self, MILLIS_PER_DAY};
use crate::frames::{Ecef, EcefVector};
use crate::gnss::{Constellation, SatelliteId};
use crate::orbit::{GlonassEphemeris, accuracy_m};
use crate::skips::Reason;
use crate::time::GpsTime;

/// Strings in a frame, and those of the ephemeris.
const STRINGS: u64 = 15;
const PIECES: usize = 4;
/// Duration of a frame, s.
const FRAME_S: f64 = 30.0;
/// t_b counts quarters of an hour of the Moscow day.
const MILLIS_PER_INTERVAL: i64 = 900_000;
const LAST_INTERVAL: u64 = 95;
/// t_b lies in the middle of an interval of at most an hour, in which the message is sent; with room for a late one, s.
const MAX_FROM_FRAME_S: f64 = 3_600.0;
/// The same as for the messages of other systems: logs of stored messages may be some hours old, s.
const MAX_AGE_S: f64 = 86_400.0;
/// Δτ_n of all ones is "minus zero", which says that it is unknown.
const UNKNOWN_L2_DELAY: u64 = 0b1_0000;

/// A phone's name of a GLONASS satellite.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum GlonassName {
    /// The slot.
    Slot(u8),
    /// The frequency channel, −7 to 6, while the phone does not know the slot. The message carries the slot.
    Channel(i8),
}

/// A phone's statements about a string.
#[derive(Clone, Copy, Debug)]
pub struct GlonassLabel {
    /// The satellite.
    pub name: GlonassName,
    /// Number of the frame as the phone gives it, usually 1 to 5.
    pub frame: i64,
    /// Number of the string in the frame; `None` if the phone does not say it.
    pub string: Option<u8>,
    /// The phone's own check.
    pub receiver: ReceiverCheck,
}

/// Time of reception of strings.
#[derive(Clone, Copy, Debug)]
pub struct GlonassClock {
    /// An instant near the strings' reception. The day of a GLONASS-M's message may differ from it.
    pub now: GpsTime,
    /// Seconds that GPS time is ahead of UTC.
    pub leap_seconds: i64,
}

/// A GLONASS ephemeris without the frequency channel, which the message does not carry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GlonassMessage {
    with_channel_0: GlonassEphemeris,
    channel: Option<i8>,
}

impl GlonassMessage {
    /// The satellite's slot.
    pub const fn slot(&self) -> u8 {
        self.with_channel_0.satellite.number
    }

    /// The channel that the phone named the satellite by, if it did.
    pub const fn channel(&self) -> Option<i8> {
        self.channel
    }

    /// The ephemeris of a satellite on this channel.
    #[must_use]
    pub const fn on_channel(self, frequency_channel: i8) -> GlonassEphemeris {
        GlonassEphemeris { frequency_channel, ..self.with_channel_0 }
    }
}

/// Puts strings together. One serves all satellites.
#[derive(Clone, Debug, Default)]
pub struct GlonassAssembler {
    satellites: BTreeMap<GlonassName, Frame>,
}

/// The strings of a frame as far as they have come.
#[derive(Clone, Debug, Default)]
struct Frame {
    number: i64,
    /// Reception of the first string that has come.
    began: GpsTime,
    last: Option<GlonassString>,
    strings: [Option<GlonassString>; PIECES],
    given: Option<GlonassMessage>,
}

impl GlonassAssembler {
    /// Takes a string: 11 bytes. Gives the message that it completes, unless it equals the last one given.
    ///
    /// # Errors
    /// When the string is damaged, or the message that it completes cannot be one.
    pub fn string(
        &mut self,
        label: GlonassLabel,
        bytes: &[u8],
        clock: GlonassClock,
    ) -> Result<Option<GlonassMessage>, Refused> {
        let name = label.name;
        let with_name = |refused: Refused| refused.of(name);
        let string = GlonassString::read(bytes, label.string, label.receiver).map_err(with_name)?;
        if !(1..=STRINGS).contains(&string.number()) {
            let detail = format!("{name}: {}", string.number());
            return Err(refused(Reason::GlonassStringImpossibleNumber, detail));
        }
        let frame = self.satellites.entry(name).or_default();
        frame.put(label.frame, string, clock.now);
        frame.complete(name, clock).map_err(with_name)
    }
}

impl std::fmt::Display for GlonassName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Slot(slot) => write!(f, "R{slot:02}"),
            Self::Channel(channel) => write!(f, "GLONASS on channel {channel}"),
        }
    }
}

impl Frame {
    /// Takes a string, and drops the strings of another frame.
    fn put(&mut self, number: i64, string: GlonassString, now: GpsTime) {
        let follows = self.last.is_some_and(|last| last.number() < string.number() || last == string);
        if number != self.number || !follows || (now - self.began).abs() >= FRAME_S {
            self.strings = [None; PIECES];
            self.number = number;
            self.began = now;
        }
        self.last = Some(string);
        let place =
            usize::try_from(string.number()).ok().and_then(|k| self.strings.get_mut(k.checked_sub(1)?));
        if let Some(place) = place {
            *place = Some(string);
        }
    }

    fn complete(
        &mut self,
        name: GlonassName,
        clock: GlonassClock,
    ) -> Result<Option<GlonassMessage>, Refused> {
        let [Some(one), Some(two), Some(three), Some(four)] = self.strings else { return Ok(None) };
        let message = message(name, &[one, two, three, four], clock)?;
        if self.given == Some(message) {
            return Ok(None);
        }
        let ephemeris = message.with_channel_0;
        ephemeris.check().map_err(|value| impossible(ephemeris.satellite, &value))?;
        self.given = Some(message);
        Ok(Some(message))
    }
}

/// The message of strings 1 to 4, by table 4.6 of the ICD; numbers and units by table 4.5.
fn message(
    name: GlonassName,
    strings: &[GlonassString; PIECES],
    clock: GlonassClock,
) -> Result<GlonassMessage, Refused> {
    let [one, two, three, four] = strings;
    let is_modern = four.field(10, 9) != 0;
    let toe = reference(strings, is_modern, clock)?;
    let xyz = |high, low, exponent| {
        Vector3::from([one, two, three].map(|string| 1e3 * string.signed(high, low, exponent)))
    };
    let l2_delay_is_known = is_modern && four.field(58, 54) != UNKNOWN_L2_DELAY;
    let with_channel_0 = GlonassEphemeris {
        satellite: SatelliteId::new(Constellation::Glonass, slot(name, four, is_modern)?),
        toe,
        position: Ecef(xyz(35, 9, -11)),
        velocity: EcefVector(xyz(64, 41, -20)),
        acceleration: EcefVector(xyz(40, 36, -30)),
        tau_s: four.signed(80, 59, -30),
        gamma: three.signed(79, 69, -40),
        l2_delay_s: l2_delay_is_known.then(|| four.signed(58, 54, -30)),
        frequency_channel: 0,
        health: Some(u8::from(two.field(80, 80) == 1)),
        // Of the flags l_n alone: C_n is in the almanac.
        health_flags: Some(u8::from(is_modern && three.field(65, 65) == 1) << 2),
        age_days: four.field(53, 49) as f64,
        accuracy_m: accuracy_m(u8::try_from(four.field(33, 30)).ok().filter(|_| is_modern)),
    };
    let channel = match name {
        GlonassName::Slot(_) => None,
        GlonassName::Channel(channel) => Some(channel),
    };
    Ok(GlonassMessage { with_channel_0, channel })
}

/// The slot by the phone, else by the message of a GLONASS-M.
fn slot(name: GlonassName, four: &GlonassString, is_modern: bool) -> Result<u8, Refused> {
    let said = u8::try_from(four.field(15, 11)).ok().filter(|slot| is_modern && *slot != 0);
    match (name, said) {
        (GlonassName::Slot(slot), Some(said)) if slot != said => {
            Err(refused(Reason::GlonassStringsOfOtherSatellite, format!("slot {said}")))
        }
        (GlonassName::Slot(slot), _) => Ok(slot),
        (GlonassName::Channel(_), Some(said)) => Ok(said),
        (GlonassName::Channel(_), None) => {
            Err(refused(Reason::GlonassMessageUnknownSlot, "n is not in string 4".to_owned()))
        }
    }
}

/// The reference time t_b, on the day N_T that a GLONASS-M sends, else on the day that brings it nearest to `now`. It must be near the
/// frame's own time t_k.
fn reference(
    [one, two, _, four]: &[GlonassString; PIECES],
    is_modern: bool,
    GlonassClock { now, leap_seconds }: GlonassClock,
) -> Result<GpsTime, Refused> {
    let impossible = |detail: String| refused(Reason::EphemerisImpossible, detail);
    let interval = two.field(76, 70);
    if interval > LAST_INTERVAL {
        return Err(impossible(format!("t_b = {interval}, limit {LAST_INTERVAL}")));
    }
    // At most 7 bits.
    let millis = i64::try_from(interval).unwrap_or_default() * MILLIS_PER_INTERVAL;
    let day = four.field(26, 16);
    let toe = if is_modern {
        u32::try_from(day).ok().and_then(|day| moscow::of_four_years(day, millis, leap_seconds, now))
    } else {
        moscow::nearest(moscow::to_gps_millis(millis, leap_seconds), MILLIS_PER_DAY, now)
    };
    let toe = toe.ok_or_else(|| impossible(format!("N_T = {day}, limits 1 to 1461")))?;
    if (toe - now).abs() > MAX_AGE_S {
        let detail = format!("reference time {toe}, received at {now}");
        return Err(refused(Reason::EphemerisOfOtherDay, detail));
    }
    let sent_s = (one.field(76, 72) * 3_600 + one.field(71, 66) * 60 + one.field(65, 65) * 30) as f64;
    let from_frame_s = millis as f64 / 1e3 - sent_s;
    if from_frame_s.abs() > MAX_FROM_FRAME_S {
        return Err(impossible(format!(
            "t_b is {from_frame_s} s from the frame's t_k, limit {MAX_FROM_FRAME_S} s"
        )));
    }
    Ok(toe)
}
