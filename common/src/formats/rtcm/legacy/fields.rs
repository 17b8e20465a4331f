//! Layout of messages 1002, 1004, 1010 and 1012 (RTCM 10403.3, tables 3.5-2, -4, -12 and -14; data fields DF003 to DF050).

use crate::formats::bits::{Bits, TooShort};
use crate::formats::rtcm::clock::SentTime;
use crate::formats::rtcm::lock::LockTime;
use crate::gnss::{Constellation, SignalCode};

/// Ranges are summed in the unit of the phases (DF012), m, in which every scale of these messages is a whole number.
pub(super) const UNIT_M: f64 = 0.000_5;
/// DF011, DF017, DF041, DF047: pseudoranges are in steps of 2 cm.
const CODE_STEP: i64 = 40;
/// DF014: one light-millisecond.
const GPS_MODULUS: i64 = 599_584_916;
/// DF044: two light-milliseconds.
const GLONASS_MODULUS: i64 = 2 * GPS_MODULUS;
/// DF012, DF018, DF042, DF048: no phase.
const NO_PHASE: i32 = -(1 << 19);
/// DF017, DF047: no pseudorange on L2.
const NO_CODE: i32 = -(1 << 13);
/// The highest value of DF040, channel 13.
const LAST_CHANNEL: u32 = 20;
/// DF040 counts channels from −7.
const LOWEST_CHANNEL: i8 = -7;

/// Which message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Kind {
    /// GPS or GLONASS.
    pub(super) constellation: Constellation,
    /// Whether L2 is in it.
    pub(super) has_second: bool,
    /// Whether it has the whole milliseconds of the pseudorange, and strengths.
    pub(super) is_extended: bool,
}

impl Kind {
    /// Of a message's number.
    pub(super) const fn of(number: u32) -> Option<Self> {
        let (constellation, first) = match number {
            1001..=1004 => (Constellation::Gps, 1001),
            1009..=1012 => (Constellation::Glonass, 1009),
            _ => return None,
        };
        let place = number - first;
        Some(Self { constellation, has_second: place >= 2, is_extended: place % 2 == 1 })
    }
}

/// A decoded message.
#[derive(Clone, Debug)]
pub(super) struct Message {
    /// Epoch time as sent.
    pub(super) sent: SentTime,
    /// Whether more messages of the same epoch follow (DF005).
    pub(super) more_follow: bool,
    /// What it says of each satellite.
    pub(super) satellites: Vec<Satellite>,
}

/// One satellite of a message.
#[derive(Clone, Copy, Debug)]
pub(super) struct Satellite {
    /// DF009 or DF038 as sent.
    pub(super) number: u8,
    /// GLONASS frequency channel, −7…13.
    pub(super) glonass_channel: Option<i8>,
    /// Whether the pseudorange (DF011, DF041) is out of its range: some encoders mark missing ones by all bits set.
    pub(super) is_beyond_modulus: bool,
    /// On L1.
    pub(super) first: Tracked,
    /// On L2, where the message has it.
    pub(super) second: Option<Tracked>,
}

/// One signal of a satellite; a value that was not sent is `None`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Tracked {
    /// Which; `None` for a reserved indicator.
    pub(super) signal: Option<SignalCode>,
    /// Pseudorange, 0.5 mm.
    pub(super) code: Option<i64>,
    /// The pseudorange on L1 of which phases say the difference, 0.5 mm.
    pub(super) base: i64,
    /// Phase range less that pseudorange, 0.5 mm.
    pub(super) phase_difference: Option<i32>,
    /// Signal strength, dB-Hz.
    pub(super) cn0_dbhz: Option<f64>,
    /// Age of the lock.
    pub(super) lock: LockTime,
}

/// Decodes a message with whole pseudoranges.
pub(super) fn decode(bytes: &[u8], kind: Kind) -> Result<Message, TooShort> {
    let mut bits = Bits::new(bytes);
    bits.skip(12 + 12); // message number, station
    let sent = SentTime::of_legacy(&mut bits, kind.constellation)?;
    let more_follow = bits.flag()?;
    let count = bits.unsigned(5)?;
    bits.skip(1 + 3); // smoothing and its interval
    let satellites = (0..count).map(|_| satellite(&mut bits, kind)).collect::<Result<_, _>>()?;
    Ok(Message { sent, more_follow, satellites })
}

fn satellite(bits: &mut Bits<'_>, kind: Kind) -> Result<Satellite, TooShort> {
    let is_glonass = kind.constellation == Constellation::Glonass;
    let (code_width, ambiguity_width, modulus) =
        if is_glonass { (25, 7, GLONASS_MODULUS) } else { (24, 8, GPS_MODULUS) };
    let number = small(bits, 6)?;
    let indicator = bits.unsigned(1)?;
    let glonass_channel = if is_glonass { channel(bits.unsigned(5)?) } else { None };
    let remainder = i64::from(bits.unsigned(code_width)?) * CODE_STEP;
    let is_beyond_modulus = remainder > modulus + CODE_STEP;
    let phase_difference = phase(bits)?;
    let lock = LockTime::whole_seconds(bits.unsigned(7)?);
    let base = remainder + i64::from(bits.unsigned(ambiguity_width)?) * modulus;
    let cn0_dbhz = strength(bits)?;
    // Without a phase the pseudorange on L1 is there for the difference on L2 only (DF011). Encoders of receivers without phases
    // leave it out of every satellite, though; a strength tells that L1 was tracked.
    let code = Some(base).filter(|_| phase_difference.is_some() || cn0_dbhz.is_some());
    let signal = Some(first_signal(indicator));
    let first = Tracked { signal, code, base, phase_difference, cn0_dbhz, lock };
    let second = if kind.has_second { Some(second(bits, kind.constellation, base)?) } else { None };
    Ok(Satellite { number, glonass_channel, is_beyond_modulus, first, second })
}

fn second(bits: &mut Bits<'_>, constellation: Constellation, base: i64) -> Result<Tracked, TooShort> {
    let signal = second_signal(constellation, bits.unsigned(2)?);
    let difference = Some(bits.signed(14)?).filter(|difference| *difference != NO_CODE);
    let phase_difference = phase(bits)?;
    let lock = LockTime::whole_seconds(bits.unsigned(7)?);
    let cn0_dbhz = strength(bits)?;
    let code = difference.map(|difference| base + i64::from(difference) * CODE_STEP);
    Ok(Tracked { signal, code, base, phase_difference, cn0_dbhz, lock })
}

fn phase(bits: &mut Bits<'_>) -> Result<Option<i32>, TooShort> {
    bits.signed(20).map(|difference| Some(difference).filter(|difference| *difference != NO_PHASE))
}

fn strength(bits: &mut Bits<'_>) -> Result<Option<f64>, TooShort> {
    bits.scaled_unsigned(8, 0.25).map(|cn0| Some(cn0).filter(|cn0| *cn0 > 0.0))
}

fn small(bits: &mut Bits<'_>, width: usize) -> Result<u8, TooShort> {
    bits.unsigned(width).and_then(|value| u8::try_from(value).map_err(|_| TooShort))
}

fn channel(sent: u32) -> Option<i8> {
    let sent = Some(sent).filter(|sent| *sent <= LAST_CHANNEL)?;
    i8::try_from(sent).ok().map(|channel| channel + LOWEST_CHANNEL)
}

/// DF010 and DF039: C/A, or P (of GPS P(Y), tracked directly).
const fn first_signal(indicator: u32) -> SignalCode {
    SignalCode::new(b'1', if indicator == 0 { b'C' } else { b'P' })
}

/// DF016 and DF046. Of GPS: "C/A or L2C" is taken for L2C, as no satellite sends C/A on L2; P(Y) tracked directly, cross-correlated
/// with L1, and correlated as codes. `None` for a reserved indicator.
const fn second_signal(constellation: Constellation, indicator: u32) -> Option<SignalCode> {
    let attribute = match (constellation, indicator) {
        (Constellation::Gps, 0) => b'X',
        (Constellation::Gps | Constellation::Glonass, 1) => b'P',
        (Constellation::Gps, 2) => b'D',
        (Constellation::Gps, 3) => b'W',
        (Constellation::Glonass, 0) => b'C',
        _ => return None,
    };
    Some(SignalCode::new(b'2', attribute))
}
