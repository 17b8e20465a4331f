//! Time of arrival of a row's signals: its epoch, checked by transmission and pseudorange.

use super::columns::{Generation, Required};
use super::fields::{Fault, Fields, MAX_NANOS};
use crate::constants::SPEED_OF_LIGHT_MPS;
use crate::formats::time_order::LONG_STEP_S;
use crate::skips::Reason;
use crate::time::GpsTime;

/// Epoch and arrival may differ by this much, s, in tables that give the epoch to the nanosecond.
const MAX_TAG_ERROR_S: f64 = 0.1;
/// Largest change by the cut to whole milliseconds, s.
const TAG_CUT_S: f64 = 0.001;
/// Largest error of an epoch in whole seconds, s: some rows have the next epoch's.
const MAX_TAG_SHIFT_S: f64 = 2.0;

/// By how much an epoch as it is written is later than the arrival of the signals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Shift {
    /// By whole seconds, mostly none, s.
    Whole(f64),
    /// By any other time, s: the row's arrival is in place of the epoch, and counts where another row confirms it.
    Irregular(f64),
}

/// Times of a row.
pub(super) struct Times {
    /// The epoch; rows belong together by it.
    pub(super) time_gps: GpsTime,
    /// Receive time.
    pub(super) received_gps: GpsTime,
    /// By how much the epoch as written was off.
    pub(super) shift: Shift,
}

/// The times of a row, by its own columns and by its transmission and pseudorange.
pub(super) fn times(fields: &Fields<'_>, pseudorange_m: f64) -> Result<Times, Fault> {
    let transmission = GpsTime::from_nanos(fields.count(Required::Transmission, MAX_NANOS)?);
    let arrival = transmission + pseudorange_m / SPEED_OF_LIGHT_MPS;
    let times = match fields.columns.generation {
        Generation::Derived2021 => {
            let millis = fields.count(Required::Time, MAX_NANOS / 1_000_000)?;
            times_2021(GpsTime::from_nanos(millis * 1_000_000), arrival)
        }
        Generation::Device2022 => {
            let written = GpsTime::from_nanos(fields.count(Required::Time, MAX_NANOS)?);
            let shift_s = (written - arrival).round();
            let time_gps = written - shift_s;
            let is_sound = shift_s.abs() <= MAX_TAG_SHIFT_S && (time_gps - arrival).abs() <= MAX_TAG_ERROR_S;
            let times = Times { time_gps, received_gps: time_gps, shift: Shift::Whole(shift_s) };
            is_sound.then_some(times).ok_or(written)
        }
    };
    times.map_err(|written| contradiction(written, written - arrival))
}

/// In the files of 2021 an epoch carries the time of the next one; the arrival that follows from transmission and pseudorange
/// tells. Of it they keep whole milliseconds, in one of which a satellite goes 4 m; the arrival has the rest. Where the step to
/// the next epoch is no whole number of seconds, the arrival alone tells the time. The epoch as written if it is absurd.
fn times_2021(written: GpsTime, arrival: GpsTime) -> Result<Times, GpsTime> {
    let late_s = written - arrival;
    let shift_s = late_s.round();
    let is_cut = (late_s - shift_s).abs() <= TAG_CUT_S;
    if is_cut && shift_s.abs() <= MAX_TAG_SHIFT_S {
        let time_gps = written - shift_s;
        return Ok(Times { time_gps, received_gps: arrival, shift: Shift::Whole(shift_s) });
    }
    let times = Times { time_gps: arrival, received_gps: arrival, shift: Shift::Irregular(late_s) };
    (late_s.abs() < LONG_STEP_S).then_some(times).ok_or(written)
}

/// A row whose epoch and arrival do not go together.
pub(super) fn contradiction(written: GpsTime, late_s: f64) -> Fault {
    Fault {
        reason: Reason::EpochContradictsPseudorange,
        detail: format!("{written} is {late_s:.3} s after the arrival"),
    }
}
