//! Multiple signal messages MSM4 to MSM7 (RTCM 10403.3): ranges, phases, rates, strengths by satellite and signal.

use super::clock::SentTime;
use super::lock::LockTime;
use crate::formats::bits::{Bits, TooShort};
use crate::gnss::Constellation;

/// More cells than this are forbidden (DF396).
const MAX_CELLS: usize = 64;
/// DF397: no rough range.
const NO_RANGE: u32 = 255;
/// DF399: no rough rate.
const NO_RATE: i32 = -8_192;
/// Exponent of the unit in which ranges are summed, ms·2⁻³¹: that of the finest field, DF406.
const RANGE_EXPONENT: u32 = 31;

/// Which message of the family.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Level {
    /// Standard resolution, without rates.
    Msm4,
    /// Standard resolution, with rates.
    Msm5,
    /// Extended resolution, without rates.
    Msm6,
    /// Extended resolution, with rates.
    Msm7,
}

impl Level {
    const fn has_rates(self) -> bool {
        matches!(self, Self::Msm5 | Self::Msm7)
    }

    const fn is_extended(self) -> bool {
        matches!(self, Self::Msm6 | Self::Msm7)
    }
}

/// A decoded message.
#[derive(Clone, Debug)]
pub(super) struct Message {
    /// The system.
    pub(super) constellation: Constellation,
    /// Epoch time as sent.
    pub(super) sent: SentTime,
    /// Whether more messages of the same epoch follow (DF393).
    pub(super) more_follow: bool,
    /// Satellite and signal pairs with data.
    pub(super) cells: Vec<Cell>,
}

/// Observations of one satellite on one signal; a value that was not sent is `None`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cell {
    /// Number in the satellite mask, 1-64.
    pub(super) satellite: u8,
    /// Number in the signal mask, 1-32.
    pub(super) signal: u8,
    /// GLONASS frequency channel, −7…6.
    pub(super) glonass_channel: Option<i8>,
    /// Code, ms·2⁻³¹ of travel time.
    code: Option<i64>,
    /// Phase, ms·2⁻³¹ of travel time.
    phase: Option<i64>,
    /// Phase range rate, m/s, positive = receding.
    pub(super) rate_mps: Option<f64>,
    /// Signal strength, dB-Hz.
    pub(super) cn0_dbhz: Option<f64>,
    /// Age of the lock.
    pub(super) lock: LockTime,
    /// Half-cycle ambiguity not resolved (DF420).
    pub(super) half_cycle: bool,
}

impl Cell {
    /// A cell whose values are not read yet.
    fn empty(rough: &Rough, signal: u8, constellation: Constellation) -> Self {
        Self {
            satellite: rough.satellite,
            signal,
            glonass_channel: rough.glonass_channel(constellation),
            code: None,
            phase: None,
            rate_mps: None,
            cn0_dbhz: None,
            lock: LockTime::coarse(0),
            half_cycle: false,
        }
    }

    /// Travel time of the code, s.
    pub(super) fn code_s(&self) -> Option<f64> {
        self.code.map(seconds)
    }

    /// Travel time of the phase, s.
    pub(super) fn phase_s(&self) -> Option<f64> {
        self.phase.map(seconds)
    }
}

fn seconds(units: i64) -> f64 {
    units as f64 / (1_u64 << RANGE_EXPONENT) as f64 / 1e3
}

/// Why a message gives nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fault {
    /// It ends too early.
    TooShort,
    /// More satellite and signal pairs than permitted.
    TooManyCells(usize),
}

impl From<TooShort> for Fault {
    fn from(_: TooShort) -> Self {
        Self::TooShort
    }
}

/// Rough values of a satellite.
#[derive(Clone, Copy, Debug, Default)]
struct Rough {
    satellite: u8,
    /// DF397, ms.
    whole_ms: u32,
    /// DF398, ms·2⁻¹⁰.
    fraction: u32,
    /// Extended information; GLONASS: DF419.
    extended: Option<u32>,
    /// DF399, m/s.
    rate_mps: Option<i32>,
}

impl Rough {
    /// The sum of rough range and a fine part of exponent −`exponent`, ms·2⁻³¹.
    fn plus(&self, fine: Option<i32>, exponent: u32) -> Option<i64> {
        let known = self.whole_ms != NO_RANGE;
        let rough = (i64::from(self.whole_ms) << RANGE_EXPONENT)
            + (i64::from(self.fraction) << (RANGE_EXPONENT - 10));
        fine.filter(|_| known).map(|fine| rough + (i64::from(fine) << (RANGE_EXPONENT - exponent)))
    }

    /// Frequency channel; 14 and 15 mean that it is not known.
    fn glonass_channel(&self, constellation: Constellation) -> Option<i8> {
        let extended = self.extended.filter(|v| constellation == Constellation::Glonass && *v <= 13)?;
        i8::try_from(extended).ok().map(|channel| channel - 7)
    }
}

/// Decodes the message, whose number has been looked at already.
pub(super) fn decode(bytes: &[u8], constellation: Constellation, level: Level) -> Result<Message, Fault> {
    let mut bits = Bits::new(bytes);
    bits.skip(12 + 12); // message number, station
    let sent = SentTime::of_msm(&mut bits, constellation)?;
    let more_follow = bits.flag()?;
    bits.skip(3 + 7 + 2 + 2 + 1 + 3); // issue of station data, reserved, clock steering, external clock, smoothing
    let satellites = bits.mask(64)?;
    let signals = bits.mask(32)?;
    let pairs = satellites.len() * signals.len();
    if pairs > MAX_CELLS {
        return Err(Fault::TooManyCells(pairs));
    }
    let mut present = Vec::with_capacity(pairs);
    for satellite in 0..satellites.len() {
        for signal in &signals {
            if bits.flag()? {
                present.push((satellite, *signal));
            }
        }
    }
    let rough = rough(&mut bits, &satellites, level)?;
    let cells = cells(&mut bits, constellation, level, &rough, &present)?;
    Ok(Message { constellation, sent, more_follow, cells })
}

/// Satellite data: each field for all satellites before the next field.
fn rough(bits: &mut Bits<'_>, satellites: &[u8], level: Level) -> Result<Vec<Rough>, Fault> {
    let mut rough: Vec<Rough> =
        satellites.iter().map(|satellite| Rough { satellite: *satellite, ..Rough::default() }).collect();
    for r in &mut rough {
        r.whole_ms = bits.unsigned(8)?;
    }
    if level.has_rates() {
        for r in &mut rough {
            r.extended = Some(bits.unsigned(4)?);
        }
    }
    for r in &mut rough {
        r.fraction = bits.unsigned(10)?;
    }
    if level.has_rates() {
        for r in &mut rough {
            r.rate_mps = Some(bits.signed(14)?).filter(|rate| *rate != NO_RATE);
        }
    }
    Ok(rough)
}

/// Width in bits of a fine field and the exponent of its unit, ms·2^−exponent.
type FineField = (usize, u32);

/// Signal data: each field for all cells before the next field.
fn cells(
    bits: &mut Bits<'_>,
    constellation: Constellation,
    level: Level,
    rough: &[Rough],
    present: &[(usize, u8)],
) -> Result<Vec<Cell>, Fault> {
    let extended = level.is_extended();
    // DF405 and DF406, or DF400 and DF401.
    let (code, phase): (FineField, FineField) =
        if extended { ((20, 29), (24, 31)) } else { ((15, 24), (22, 29)) };
    let owners: Vec<&Rough> = present.iter().filter_map(|(index, _)| rough.get(*index)).collect();
    let signals = present.iter().map(|(_, signal)| *signal);
    let mut cells: Vec<Cell> =
        owners.iter().zip(signals).map(|(rough, signal)| Cell::empty(rough, signal, constellation)).collect();
    for (cell, rough) in cells.iter_mut().zip(&owners) {
        cell.code = rough.plus(fine(bits, code.0)?, code.1);
    }
    for (cell, rough) in cells.iter_mut().zip(&owners) {
        cell.phase = rough.plus(fine(bits, phase.0)?, phase.1);
    }
    for cell in &mut cells {
        cell.lock =
            if extended { LockTime::fine(bits.unsigned(10)?) } else { LockTime::coarse(bits.unsigned(4)?) };
    }
    for cell in &mut cells {
        cell.half_cycle = bits.flag()?;
    }
    for cell in &mut cells {
        // DF408 or DF403
        let cn0 = if extended { bits.scaled_unsigned(10, 0.0625)? } else { bits.scaled_unsigned(6, 1.0)? };
        cell.cn0_dbhz = Some(cn0).filter(|cn0| *cn0 > 0.0);
    }
    if level.has_rates() {
        for (cell, rough) in cells.iter_mut().zip(&owners) {
            // DF404
            let fine = fine(bits, 15)?;
            cell.rate_mps =
                rough.rate_mps.zip(fine).map(|(rough, fine)| f64::from(rough) + f64::from(fine) * 1e-4);
        }
    }
    Ok(cells)
}

/// A fine value of a width; the most negative number means that there is none.
fn fine(bits: &mut Bits<'_>, width: usize) -> Result<Option<i32>, TooShort> {
    let none = -(1_i32 << (width - 1));
    Ok(Some(bits.signed(width)?).filter(|value| *value != none))
}
