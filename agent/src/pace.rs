//! Recorded epochs at the speed of time, or a multiple of it.

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

    /// Waits until the epoch of `time_gps` is due; `true` when asked to stop meanwhile.
    pub(crate) fn wait(&mut self, time_gps: GpsTime, stop: &Stop) -> bool {
        let (start, first) = *self.start.get_or_insert_with(|| (Instant::now(), time_gps));
        let due = due_after(self.speed, time_gps - first);
        let left = due.saturating_sub(start.elapsed());
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
    fn a_request_to_stop_ends_the_wait() {
        let stop = Stop::default();
        let mut pace = Pace::new(Speed::Times(1.0));
        let start = GpsTime::from_week_tow(2118, 0.0);
        assert!(!pace.wait(start, &stop));
        stop.request();
        assert!(pace.wait(start + 1e6, &stop));
    }
}
