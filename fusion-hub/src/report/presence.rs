//! The part of a session that a phone's epochs cover.

use cofix_common::time::GpsTime;

/// Number of the phone's shortest steps beyond which a step is a gap; of a gap this length counts as covered.
const GAP_STEPS: f64 = 5.0;

/// The time that a phone's epochs cover, whatever their rate and whether other phones have epochs between them.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Presence {
    last: Option<GpsTime>,
    shortest_s: Option<f64>,
    covered_s: f64,
}

impl Presence {
    /// Counts an epoch.
    pub(super) fn push(&mut self, time: GpsTime) {
        let step_s = self.last.replace(time).map_or(0.0, |last| time - last);
        if step_s > 0.0 {
            let shortest_s = self.shortest_s.map_or(step_s, |shortest_s| shortest_s.min(step_s));
            self.shortest_s = Some(shortest_s);
            self.covered_s += step_s.min(GAP_STEPS * shortest_s);
        }
    }

    /// The part of the group's time that was covered; `None` without any time.
    pub(super) fn share(&self, group: Option<(GpsTime, GpsTime)>) -> Option<f64> {
        let (first, last) = group?;
        let span_s = last - first;
        if self.last.is_none() {
            return Some(0.0);
        }
        Some(if span_s > 0.0 { (self.covered_s / span_s).min(1.0) } else { 1.0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn share(times_s: impl IntoIterator<Item = f64>, span_s: f64) -> f64 {
        let time = |seconds: f64| GpsTime::from_week_tow(2_118, seconds);
        let mut presence = Presence::default();
        times_s.into_iter().for_each(|seconds| presence.push(time(seconds)));
        presence.share(Some((time(0.0), time(span_s)))).unwrap()
    }

    #[test]
    fn rates_do_not_matter_and_gaps_do() {
        let every = |step_s: f64, count: u32| (0..count).map(move |k| step_s * f64::from(k));
        for step_s in [0.1, 1.0, 30.0] {
            assert!((share(every(step_s, 101), 100.0 * step_s) - 1.0).abs() < 1e-9, "{step_s}");
        }
        assert!((share(every(1.0, 51), 100.0) - 0.5).abs() < 1e-9, "it left early");
        let gap = every(1.0, 21).chain(every(1.0, 21).map(|s| s + 80.0));
        assert!((share(gap, 100.0) - 0.45).abs() < 1e-9, "it was away for a minute");
        assert!(share([], 100.0) == 0.0 && share([0.0], 0.0) == 1.0);
    }
}
