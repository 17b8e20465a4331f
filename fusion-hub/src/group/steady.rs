//! The clock of a group's thread.

use std::time::{Duration, Instant};

/// Longest step from one look to the next: time in which the thread itself stood still (a suspended computer, a slow disk) is no phone's
/// silence.
const LONGEST_STEP: Duration = Duration::from_millis(500);

/// Time since the start, without standstills of the thread.
#[derive(Debug)]
pub(super) struct Steady {
    looked: Instant,
    time: Duration,
}

impl Steady {
    /// Goes on at a time.
    pub(super) fn at(time: Duration) -> Self {
        Self { looked: Instant::now(), time }
    }

    pub(super) fn tick(&mut self) -> Duration {
        let now = Instant::now();
        self.time += step(now.saturating_duration_since(self.looked));
        self.looked = now;
        self.time
    }
}

fn step(elapsed: Duration) -> Duration {
    elapsed.min(LONGEST_STEP)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thread_that_stood_still_has_not_waited() {
        assert_eq!(step(Duration::from_millis(50)), Duration::from_millis(50));
        assert_eq!(step(Duration::from_hours(8)), LONGEST_STEP);
    }
}
