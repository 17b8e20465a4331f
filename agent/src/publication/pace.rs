//! Recorded epochs at the recorded speed, or a multiple of it.
//!
//! The agents of a group play the same time: the hub tells each when its first epoch is due (`cofix/<group>/phone/<phone>/pace`), for
//! recordings begin at different seconds, and a phone that lags by more than the hub's latency is not waited for. Where no hub answers, an
//! agent begins immediately.

use std::time::{Duration, Instant};

use cofix_common::time::GpsTime;

use crate::{Speed, Stop};

/// Holds epochs back until their time has come. The first sets the clock.
#[derive(Debug)]
pub(crate) struct Pace {
    speed: Speed,
    start: Option<(Instant, GpsTime)>,
}

impl Pace {
    pub(crate) const fn new(speed: Speed) -> Self {
        Self { speed, start: None }
    }

    /// The multiple of the recorded speed, as long as no first epoch has set the clock; `None` when it is set or not needed.
    pub(crate) const fn unset_times(&self) -> Option<f64> {
        match (self.speed, self.start) {
            (Speed::Times(times), None) => Some(times),
            _ => None,
        }
    }

    /// The epoch of `first` is due in `due_in_s` seconds; a negative number lies in the past.
    pub(crate) fn set(&mut self, first: GpsTime, due_in_s: f64) {
        let now = Instant::now();
        let apart = Duration::try_from_secs_f64(due_in_s.abs()).unwrap_or_default();
        let start = if due_in_s < 0.0 { now.checked_sub(apart) } else { now.checked_add(apart) };
        self.start = Some((start.unwrap_or(now), first));
    }

    /// Waits until the epoch of `time_gps` is due; `true` when asked to stop meanwhile.
    pub(crate) fn wait(&mut self, time_gps: GpsTime, stop: &Stop) -> bool {
        let (start, first) = *self.start.get_or_insert_with(|| (Instant::now(), time_gps));
        let due = due_after(self.speed, time_gps - first);
        let now = Instant::now();
        let left = start.checked_add(due).map_or(due, |at| at.saturating_duration_since(now));
        if left.is_zero() { stop.is_requested() } else { stop.sleep(left) }
    }
}

/// How long after the first epoch one of `recorded_s` later is due.
fn due_after(speed: Speed, recorded_s: f64) -> Duration {
    match speed {
        Speed::Maximum => Duration::ZERO,
        Speed::Times(times) => Duration::try_from_secs_f64(recorded_s / times).unwrap_or(Duration::ZERO),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn epochs_are_due_at_their_distance_over_the_speed() {
        assert_eq!(due_after(Speed::Times(1.0), 3.5), Duration::from_millis(3_500));
        assert_eq!(due_after(Speed::Times(10.0), 5.0), Duration::from_millis(500));
        assert_eq!(due_after(Speed::Maximum, 1e9), Duration::ZERO);
        assert_eq!(due_after(Speed::Times(1.0), -1.0), Duration::ZERO);
        assert_eq!(due_after(Speed::Times(1e-300), 1e300), Duration::ZERO);
    }

    #[test]
    fn a_group_s_clock_delays_the_first_epoch_or_hurries_it() {
        let first = GpsTime::from_week_tow(2118, 0.0);
        let due_s = |due_in_s: f64, after_s: f64| {
            let mut pace = Pace::new(Speed::Times(10.0));
            assert_eq!(pace.unset_times(), Some(10.0));
            pace.set(first, due_in_s);
            assert_eq!(pace.unset_times(), None);
            let (start, first) = pace.start.unwrap();
            let at = start + due_after(pace.speed, (first + after_s) - first);
            at.saturating_duration_since(Instant::now()).as_secs_f64()
        };
        assert!((9.0..=10.0).contains(&due_s(10.0, 0.0)));
        assert!(due_s(-5.0, 49.0) < 1e-9, "it was due a tenth of a second ago");
        assert!((0.0..=0.1).contains(&due_s(-5.0, 51.0)));
        assert_eq!(Pace::new(Speed::Maximum).unset_times(), None);
    }

    #[test]
    fn a_request_to_stop_ends_the_wait() {
        let stop = Stop::default();
        let mut pace = Pace::new(Speed::Times(1.0));
        let start = GpsTime::from_week_tow(2118, 0.0);
        assert!(!pace.wait(start, &stop));
        stop.request();
        assert!(pace.wait(start + 1e6, &stop));
    }
}
