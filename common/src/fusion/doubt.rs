//! Whether the phones' own measurements contradict a constraint.
//!
//! The measure is the excess over the bounds of the distribution without any constraint, in its standard deviations. Beyond the limit the
//! constraint is contradicted at once; beyond six tenths of it when that lasts for five seconds, because an error of measurements passes and a
//! wrong constraint does not. A contradicted constraint stays so until the excess is below half of the limit.

use crate::time::GpsTime;

/// Share of the limit beyond which a constraint is doubted.
const DOUBTED_SHARE: f64 = 0.5;
/// Share of the limit beyond which a lasting excess is a contradiction.
const LASTING_SHARE: f64 = 0.6;
/// Time after which an excess is lasting, s.
const LASTING_S: f64 = 5.0;

/// What measurements say of a constraint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Doubt {
    /// Nothing against it.
    None,
    /// It may be wrong: it is applied, and the result is not reliable.
    Doubted,
    /// It is not applied.
    Contradicted,
}

/// History of one constraint.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Excess {
    /// Begin of an excess that may become a lasting one.
    since: Option<GpsTime>,
    is_contradicted: bool,
}

impl Excess {
    /// Takes the excess at a time, in standard deviations.
    pub fn take(&mut self, sigmas: f64, time_gps: GpsTime, limit_sigmas: f64) -> Doubt {
        let since = self.since.filter(|since| *since <= time_gps).unwrap_or(time_gps);
        self.since = (sigmas > LASTING_SHARE * limit_sigmas).then_some(since);
        let is_lasting = self.since.is_some_and(|since| time_gps - since >= LASTING_S);
        let is_doubted = sigmas > DOUBTED_SHARE * limit_sigmas;
        self.is_contradicted = sigmas > limit_sigmas || is_lasting || (self.is_contradicted && is_doubted);
        match (self.is_contradicted, is_doubted) {
            (true, _) => Doubt::Contradicted,
            (false, true) => Doubt::Doubted,
            (false, false) => Doubt::None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMIT: f64 = 6.0;

    fn run(sigmas: &[(f64, f64)]) -> Vec<Doubt> {
        let mut excess = Excess::default();
        let at = |second: f64| GpsTime::from_week_tow(2118, second);
        sigmas.iter().map(|(second, sigmas)| excess.take(*sigmas, at(*second), LIMIT)).collect()
    }

    #[test]
    fn a_large_excess_counts_at_once_and_until_it_is_small() {
        use Doubt::{Contradicted, Doubted, None};
        let seen = run(&[(0.0, 2.9), (1.0, 3.1), (2.0, 6.1), (3.0, 3.1), (4.0, 2.9), (5.0, 3.1)]);
        assert_eq!(seen, [None, Doubted, Contradicted, Contradicted, None, Doubted]);
    }

    #[test]
    fn a_moderate_excess_counts_after_five_seconds_without_a_break() {
        let seen = run(&[(0.0, 4.5), (2.0, 4.5), (4.9, 4.5), (5.0, 4.5)]);
        assert_eq!(seen[2..], [Doubt::Doubted, Doubt::Contradicted]);
        let broken = run(&[(0.0, 4.5), (2.0, 3.5), (4.9, 4.5), (9.8, 4.5), (9.9, 4.5)]);
        assert_eq!(broken[3..], [Doubt::Doubted, Doubt::Contradicted]);
    }

    #[test]
    fn without_a_limit_nothing_is_doubted() {
        assert_eq!(Excess::default().take(1e9, GpsTime::default(), f64::INFINITY), Doubt::None);
    }
}
