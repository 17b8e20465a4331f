//! Dates of recordings of RTCM 3, whose observations lack the week.
//!
//! Ephemerides in the stream state it. Where there are none, or to complete their week numbers, which repeat after 20 years, a date serves that the
//! user or the orbits give, or else the file's last change, which is after the recording. A live stream is dated by the computer's clock.

use std::io;
use std::path::Path;
use std::time::SystemTime;

use cofix_common::formats::format::Format;
use cofix_common::formats::rtcm::{Dating, DatingHint, FIRST_WEEK, StreamDates};
use cofix_common::formats::stream::recognise_text;
use cofix_common::skips::{Reason, Skips};
use cofix_common::time::GpsTime;
use cofix_common::time::leap_seconds_at;

use crate::Stop;
use crate::clock;
use crate::input::{Bytes, Portion, Recorded};

/// The dates of a recording, and notes about them.
pub(crate) struct Dated {
    pub(crate) dates: StreamDates,
    pub(crate) notes: Skips,
}

/// Looks through a file, if it is RTCM 3. `near`: a given instant near its beginning.
pub(crate) fn of_file(path: &Path, near: Option<GpsTime>) -> io::Result<Option<Dated>> {
    let hint = near.map_or_else(|| DatingHint::NotAfter(last_change(path)), DatingHint::Near);
    let Some(dates) = look_through(path, hint)? else { return Ok(None) };
    let notes = notes(&dates, hint);
    Ok(Some(Dated { dates, notes }))
}

/// When a file was last changed; now where that is impossible, since a clock was not set.
fn last_change(path: &Path) -> GpsTime {
    let now = clock::now();
    let changed = std::fs::metadata(path).and_then(|metadata| metadata.modified()).ok();
    let changed = changed.map(|changed: SystemTime| clock::gps_time_of(changed));
    changed.filter(|changed| changed.week() >= FIRST_WEEK && *changed <= now).unwrap_or(now)
}

fn look_through(path: &Path, hint: DatingHint) -> io::Result<Option<StreamDates>> {
    let (DatingHint::Near(time) | DatingHint::NotAfter(time)) = hint;
    let leap_seconds = u8::try_from(leap_seconds_at(time)).unwrap_or(0);
    let (mut dating, mut bytes) = (Dating::new(hint, leap_seconds), Recorded::open(path)?);
    let (mut buffer, mut is_first) = (Vec::new(), true);
    // Damage is counted where the file is read.
    while let Ok(Portion::Bytes) = bytes.next(&mut buffer, &Stop::default()) {
        let is_text = is_first && !matches!(recognise_text(&buffer, false), None | Some(Format::Rtcm3));
        dating.feed(&buffer);
        if is_text || dating.is_hopeless() {
            return Ok(None);
        }
        is_first = false;
    }
    Ok(Some(dating).filter(|dating| dating.frames() > 0).and_then(Dating::finish))
}

fn notes(dates: &StreamDates, hint: DatingHint) -> Skips {
    let mut notes = Skips::default();
    let begins = dates.begins();
    match hint {
        DatingHint::Near(near) if dates.moved_s() != 0.0 => {
            notes.add(Reason::DateGiven, || format!("the stream begins at {begins}, {near} was given"));
        }
        DatingHint::NotAfter(changed) if !dates.are_stated() => {
            notes.add(Reason::NoDateGiven, || {
                format!("the stream begins at {begins}, the file was last changed at {changed}; give --date")
            });
        }
        DatingHint::NotAfter(changed) if dates.moved_s() != 0.0 => {
            notes.add(Reason::FileLastChangeNotWeekStreamEphemerides, || {
                format!("the stream begins at {begins}, the file was last changed at {changed}")
            });
        }
        DatingHint::Near(_) | DatingHint::NotAfter(_) => {}
    }
    notes
}
