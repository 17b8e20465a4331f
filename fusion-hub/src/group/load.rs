//! How busy the group's thread is: a hub that cannot keep up says so.

use std::time::Duration;

/// Time over which the load is measured.
const WINDOW: Duration = Duration::from_secs(30);
/// Share of that time at work from which on the hub does not keep up.
const LIMIT: f64 = 0.95;
/// Shortest time between two warnings.
const QUIET: Duration = Duration::from_mins(5);

/// The load of a live group.
#[derive(Debug, Default)]
pub(super) struct Load {
    window_begin: Duration,
    at_work: Duration,
    told: Option<Duration>,
}

impl Load {
    /// Takes how long the thread was at work until `now`, the time since the start. The share of a whole window, where it is too large and was not told just before.
    pub(super) fn take(&mut self, at_work: Duration, now: Duration) -> Option<f64> {
        self.at_work += at_work;
        let window = now.saturating_sub(self.window_begin);
        if window < WINDOW {
            return None;
        }
        let share = self.at_work.as_secs_f64() / window.as_secs_f64();
        (self.window_begin, self.at_work) = (now, Duration::ZERO);
        let is_told = self.told.is_some_and(|told| now.saturating_sub(told) < QUIET);
        if share < LIMIT || is_told {
            return None;
        }
        self.told = Some(now);
        Some(share.min(1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(share: f64, seconds: u32) -> Vec<u32> {
        let mut load = Load::default();
        let take = |second: &u32| {
            let now = Duration::from_secs(u64::from(*second));
            load.take(Duration::from_secs_f64(share), now).is_some()
        };
        (1..=seconds).filter(take).collect()
    }

    #[test]
    fn a_group_that_does_not_keep_up_says_so_now_and_then() {
        assert_eq!(told(0.98, 400), [30, 330]);
        assert!(told(0.9, 400).is_empty());
    }

    #[test]
    fn a_busy_moment_is_no_load() {
        let mut load = Load::default();
        assert_eq!(load.take(Duration::from_secs(20), Duration::from_secs(20)), None);
        assert_eq!(load.take(Duration::from_secs(1), Duration::from_secs(40)), None);
        assert_eq!(load.take(Duration::from_secs(40), Duration::from_secs(80)), Some(1.0));
    }
}
