//! Steps between epochs: the usual one, and gaps.

use std::collections::BTreeMap;

use cofix_common::time::GpsTime;
use serde::Serialize;

use super::LISTED;

/// Number of usual steps beyond which a step is a gap.
const GAP: f64 = 1.5;
/// Most different steps that are counted, to the millisecond; further ones count with the longest.
const DISTINCT: usize = 10_000;
/// Most steps kept that may turn out to be gaps.
const CANDIDATES: usize = 100_000;
/// Count at which the most frequent step is taken for the usual one; before that any step may turn out to be a gap.
const KNOWN_AFTER: u64 = 100;

/// A gap.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Gap {
    /// The epoch before it, GPS time.
    pub after_gps: String,
    /// Time to the next epoch, s.
    pub duration_s: f64,
}

/// Gaps in a recording.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Gaps {
    /// How many.
    pub count: u64,
    /// Epochs that would have fitted into them.
    pub missing_epochs: u64,
    /// The longest, s.
    pub longest_s: f64,
    /// The first ones.
    pub first: Vec<Gap>,
}

/// Collects steps.
#[derive(Clone, Debug, Default)]
pub(super) struct Steps {
    by_millisecond: BTreeMap<i64, u64>,
    /// The most frequent so far, and how often.
    usual: (i64, u64),
    candidates: Vec<(GpsTime, f64)>,
}

impl Steps {
    pub(super) fn add(&mut self, before: GpsTime, after: GpsTime) {
        let step_s = after - before;
        #[allow(clippy::cast_possible_truncation)] // saturates
        let milliseconds = (step_s * 1e3).round() as i64;
        if self.by_millisecond.len() < DISTINCT || self.by_millisecond.contains_key(&milliseconds) {
            let count = self.by_millisecond.entry(milliseconds).or_default();
            *count += 1;
            if *count > self.usual.1 {
                self.usual = (milliseconds, *count);
            }
        }
        let is_candidate = step_s * 1e3 > GAP * self.usual.0 as f64 || self.usual.1 < KNOWN_AFTER;
        if is_candidate && self.candidates.len() < CANDIDATES {
            self.candidates.push((before, step_s));
        }
    }

    /// The usual step, s (the median: phones' epochs jitter), and the gaps.
    pub(super) fn report(self) -> (Option<f64>, Gaps) {
        let total: u64 = self.by_millisecond.values().sum();
        let mut below = 0;
        let median = self.by_millisecond.iter().find_map(|(milliseconds, count)| {
            below += count;
            (2 * below >= total).then_some(*milliseconds as f64 * 1e-3)
        });
        let Some(interval_s) = median.filter(|interval| *interval > 0.0) else {
            return (median, Gaps::default());
        };
        let mut gaps = Gaps::default();
        for (after, duration_s) in self.candidates.into_iter().filter(|(_, step)| *step > GAP * interval_s) {
            gaps.count += 1;
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
            let missing = (duration_s / interval_s - 1.0).round() as u64;
            gaps.missing_epochs = gaps.missing_epochs.saturating_add(missing);
            gaps.longest_s = gaps.longest_s.max(duration_s);
            if gaps.first.len() < LISTED {
                gaps.first.push(Gap { after_gps: after.iso(), duration_s });
            }
        }
        (Some(interval_s), gaps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn usual_steps_are_not_kept() {
        let start = GpsTime::from_week_tow(2118, 0.0);
        let mut steps = Steps::default();
        for second in 0..10_000 {
            steps.add(start + f64::from(second), start + f64::from(second + 1));
        }
        assert!(steps.candidates.len() <= 100, "{}", steps.candidates.len());
        steps.add(start + 10_000.0, start + 10_030.0);
        assert_eq!(steps.report().1.count, 1);
    }

    #[test]
    fn gaps_are_told_from_jitter() {
        let start = GpsTime::from_week_tow(2118, 0.0);
        let times = [0.0, 1.001, 2.0, 2.999, 7.0, 8.001, 9.0, 10.0];
        let mut steps = Steps::default();
        for pair in times.windows(2) {
            steps.add(start + pair[0], start + pair[1]);
        }
        let (interval, gaps) = steps.report();
        assert_eq!(interval, Some(1.0));
        assert_eq!((gaps.count, gaps.missing_epochs), (1, 3));
        assert!((gaps.longest_s - 4.001).abs() < 1e-9);
        assert_eq!(gaps.first[0].after_gps, (start + 2.999).iso());
        assert_eq!(Steps::default().report(), (None, Gaps::default()));
    }
}
