//! The common playback time of a group's recordings.

use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use cofix_common::time::GpsTime;
use cofix_common::wire::PaceMessage;
use zenoh::query::Query;

use super::reply;

/// Largest distance of an agent's first epoch from the others' playback time, s of the recordings. Beyond it the agent begins at once: it plays
/// another drive, or a new run.
const FARTHEST_S: f64 = 60.0;

/// The playback time, set by the first agent that asked.
#[derive(Clone, Copy, Debug)]
struct Played {
    at: Instant,
    time: GpsTime,
    times: f64,
}

/// Answers when the first epochs of recordings are due.
#[derive(Debug, Default)]
pub(super) struct PlaybackClock {
    played: Mutex<Option<Played>>,
}

impl PlaybackClock {
    /// Time until the epoch of `first` is due at `times` the recorded speed, s; negative when it was due earlier.
    fn due_in_s(&self, now: Instant, first: GpsTime, times: f64) -> f64 {
        let mut played = self.played.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(played) = played.filter(|played| played.times == times) {
            let elapsed_s = now.saturating_duration_since(played.at).as_secs_f64();
            let ahead_s = (first - played.time) - times * elapsed_s;
            if ahead_s.abs() <= FARTHEST_S {
                return ahead_s / times;
            }
        }
        *played = Some(Played { at: now, time: first, times });
        0.0
    }

    /// Answers `cofix/<group>/phone/<phone>/pace?first=<ns>;speed=<times>`.
    pub(super) fn answer(&self, query: &Query) {
        let parameters = query.parameters();
        let first = parameters.get("first").and_then(|first| first.parse().ok()).map(GpsTime::from_nanos);
        let times = parameters.get("speed").and_then(|times| times.parse().ok());
        let times = times.filter(|times: &f64| times.is_finite() && *times > 0.0);
        let (Some(first), Some(times)) = (first, times) else { return };
        let due_in_s = self.due_in_s(Instant::now(), first, times);
        reply(query, "pace", &PaceMessage { due_in_s });
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn all_phones_play_one_time() {
        let clock = PlaybackClock::default();
        let (begin, start) = (Instant::now(), GpsTime::from_week_tow(2_118, 0.0));
        let ask = |after_s: f64, first_s: f64, times: f64| {
            clock.due_in_s(begin + Duration::from_secs_f64(after_s), start + first_s, times)
        };
        let near = |a: f64, b: f64| (a - b).abs() < 1e-6;
        assert!(near(ask(0.0, 10.0, 1.0), 0.0), "the first begins at once");
        assert!(near(ask(0.5, 18.0, 1.0), 7.5), "a recording that begins 8 s later waits");
        assert!(near(ask(1.0, 2.0, 1.0), -9.0), "one that began earlier hurries");
        assert!(near(ask(100.0, 10.0, 1.0), 0.0), "a new run has a time of its own");
        assert!(near(ask(101.0, 12.0, 1.0), 1.0));
        assert!(near(ask(101.0, 12.0, 20.0), 0.0), "so has another speed");
        assert!(near(ask(102.0, 72.0, 20.0), 2.0));
    }
}
