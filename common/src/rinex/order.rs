//! Epochs in time order, each once.

use crate::time::GpsTime;

/// A longer step forward than this (s) is believed only when the next epoch confirms it: one damaged date must
/// not turn all later epochs into steps backwards.
const MAX_STEP_S: f64 = 86_400.0;

/// Keeps the epochs in time order.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Order {
    last: Option<GpsTime>,
    suspect: Option<GpsTime>,
}

impl Order {
    /// Accepts a time, or says why not and against which time.
    pub(super) fn check(
        &mut self,
        time: GpsTime,
        first: Option<GpsTime>,
    ) -> Result<(), (&'static str, GpsTime)> {
        if let Some(last) = self.last {
            if time == last {
                return Err(("epoch repeats the time of the one before", last));
            }
            if time < last {
                return Err(("epoch steps back in time", last));
            }
        }
        if let Some(reference) = self.last.or(first) {
            let confirmed = self.suspect.is_some_and(|s| (0.0..=MAX_STEP_S).contains(&(time - s)));
            if (time - reference).abs() > MAX_STEP_S && !confirmed {
                self.suspect = Some(time);
                return Err(("epoch jumps by more than a day", reference));
            }
        }
        self.last = Some(time);
        self.suspect = None;
        Ok(())
    }
}
