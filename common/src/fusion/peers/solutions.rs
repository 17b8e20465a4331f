//! Epoch-wise solutions of a phone that all lie beyond the bounds to its companions.
//!
//! Robust weights hold a phone's filter back for many seconds when all its pseudoranges are those of another place, so that the filters contradict
//! no bound yet. The epoch-wise solutions show it at once, but one that is wrong by 30 m tells nothing: reflections do that too. What tells
//! is that every solution of some seconds lies beyond the bound in one direction. Errors by reflections change their direction within seconds,
//! so the excess that is asked for is the smaller the longer all solutions show it. Everything is horizontal.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use nalgebra::Vector2;

use super::{COMPANIONS_M, Evidence, FEWEST_PARTNERS, Seen, plane_at};
use crate::time::GpsTime;

/// Times for which all solutions must lie beyond the bound, s, and how far at least, in standard deviations of one solution. In 160 hours of
/// simulated honest phones the largest were 3.1, 2.4, 1.4 and 0.6.
const LASTING: [(f64, f64); 4] = [(8.0, 4.0), (12.0, 3.0), (15.0, 2.2), (20.0, 1.4)];
/// Time over which the mean of the solutions counts, s.
const MEAN_S: f64 = 8.0;
/// Minimum time between two solutions, s.
const INTERVAL_S: f64 = 0.5;
/// Longest time between two solutions in a row, s, and minimum number of solutions.
const LONGEST_GAP_S: f64 = 3.0;
const FEWEST: usize = 6;
/// Share of the way from the companion's filter that must be seen from its own epoch-wise solutions too: two phones that are displaced alike are none from each other.
const SEEN_SHARE: f64 = 0.5;

/// The epoch-wise solution of a phone beside a companion.
#[derive(Clone, Copy, Debug)]
struct Moment {
    time_gps: GpsTime,
    /// From the companion's filter, m.
    from_filter_m: Vector2<f64>,
    /// From the companion's epoch-wise solution, m, if it has one.
    from_solution_m: Option<Vector2<f64>>,
    sigma_m: f64,
}

impl Moment {
    fn new(time_gps: GpsTime, own: &Seen, other: &Seen) -> Option<Self> {
        let (position, sigma_m) = own.solution?;
        let plane = plane_at(other.position);
        let from = |place| plane * (position - place).0;
        let from_solution_m = other.solution.map(|(place, _)| from(place));
        Some(Self { time_gps, from_filter_m: from(other.position), from_solution_m, sigma_m })
    }
}

/// The last moments of a phone beside a companion, and the upper bound of their distance, m.
#[derive(Clone, Debug)]
struct Pair {
    moments: VecDeque<Moment>,
    within_m: f64,
}

impl Pair {
    fn take(&mut self, time_gps: GpsTime, moment: Moment, within_m: f64) {
        let longest_s = LASTING.iter().fold(0.0_f64, |longest, (lasting_s, _)| longest.max(*lasting_s));
        self.moments.retain(|earlier| (0.0..=longest_s).contains(&(time_gps - earlier.time_gps)));
        if self.moments.back().is_none_or(|last| time_gps - last.time_gps >= INTERVAL_S) {
            self.moments.push_back(moment);
        }
        self.within_m = within_m;
    }

    /// The moments of some last seconds; empty where they are too few or have a gap.
    fn last(&self, time_gps: GpsTime, lasting_s: f64) -> Vec<Moment> {
        let begin = time_gps + -lasting_s;
        let last: Vec<Moment> =
            self.moments.iter().filter(|moment| moment.time_gps >= begin).copied().collect();
        let times = last.iter().map(|moment| moment.time_gps).chain([time_gps]);
        let gaps_s = times.scan(begin, |before, now| Some(now - std::mem::replace(before, now)));
        let is_whole = last.len() >= FEWEST && gaps_s.fold(0.0, f64::max) <= LONGEST_GAP_S;
        if is_whole { last } else { Vec::new() }
    }

    /// Whether every solution lies beyond the bound, for one of the times of [`LASTING`].
    fn is_beyond(&self, time_gps: GpsTime) -> bool {
        LASTING.iter().any(|(lasting_s, sigmas)| {
            let last = self.last(time_gps, *lasting_s);
            let Some(way_m) = mean(last.iter().map(|moment| moment.from_filter_m)) else { return false };
            let direction = way_m.normalize();
            let along_m = |offset_m: Vector2<f64>| offset_m.dot(&direction);
            let beyond =
                |moment: &Moment| along_m(moment.from_filter_m) > self.within_m + sigmas * moment.sigma_m;
            let seen_m = mean(last.iter().filter_map(|moment| moment.from_solution_m)).map(along_m);
            last.iter().all(beyond) && seen_m.is_some_and(|seen_m| seen_m > SEEN_SHARE * way_m.norm())
        })
    }

    /// How far the mean of the solutions is beyond the bound, in standard deviations of one solution; `None` if they are too few.
    fn excess_sigmas(&self, time_gps: GpsTime) -> Option<f64> {
        let last = self.last(time_gps, MEAN_S);
        let way_m = mean(last.iter().map(|moment| moment.from_filter_m))?;
        let sigma_m = last.iter().map(|moment| moment.sigma_m).sum::<f64>() / last.len() as f64;
        Some((way_m.norm() - self.within_m) / sigma_m)
    }
}

/// The phones' epoch-wise solutions beside their companions.
#[derive(Clone, Debug, Default)]
pub(super) struct Solutions(BTreeMap<(usize, usize), Pair>);

impl Solutions {
    /// Takes the phones that are seen, and the bounds in force between them.
    pub fn take(&mut self, time_gps: GpsTime, evidence: &[Evidence<'_>], seen: &[Option<Seen>]) {
        let mut bounds: BTreeMap<(usize, usize), f64> = BTreeMap::new();
        for bound in evidence.iter().filter(|evidence| evidence.within_m <= COMPANIONS_M) {
            let &[a, b] = bound.phones else { continue };
            for pair in [(a, b), (b, a)] {
                let within_m = bounds.entry(pair).or_insert(f64::INFINITY);
                *within_m = within_m.min(bound.within_m);
            }
        }
        self.0.retain(|pair, _| bounds.contains_key(pair));
        let at = |phone: usize| seen.get(phone)?.as_ref();
        for (pair, within_m) in bounds {
            let moment =
                at(pair.0).zip(at(pair.1)).and_then(|(own, other)| Moment::new(time_gps, own, other));
            if let Some(moment) = moment {
                let new = || Pair { moments: VecDeque::new(), within_m };
                self.0.entry(pair).or_insert_with(new).take(time_gps, moment, within_m);
            }
        }
    }

    /// The only phone whose solutions lie beyond the bounds to all its companions, of which there are at least two.
    pub fn displaced(&self, time_gps: GpsTime, is_isolated: impl Fn(usize) -> bool) -> Option<usize> {
        let phones: BTreeSet<usize> = self.0.keys().map(|(own, _)| *own).collect();
        let is_displaced = |phone: &usize| {
            let mut among_others = self.of(*phone).filter(|(other, _)| !is_isolated(*other));
            !is_isolated(*phone)
                && among_others.clone().count() >= FEWEST_PARTNERS
                && among_others.all(|(_, pair)| pair.is_beyond(time_gps))
        };
        let displaced: Vec<usize> = phones.into_iter().filter(is_displaced).collect();
        if let [phone] = displaced[..] { Some(phone) } else { None }
    }

    /// How far the mean of a phone's solutions is at least beyond the bounds to its companions, in standard deviations of one solution; 0 if
    /// nothing tells.
    pub fn excess_sigmas(&self, phone: usize, time_gps: GpsTime) -> f64 {
        let excesses = self.of(phone).map(|(_, pair)| pair.excess_sigmas(time_gps).unwrap_or(0.0));
        excesses.min_by(f64::total_cmp).unwrap_or(0.0)
    }

    /// A phone beside each companion.
    fn of(&self, phone: usize) -> impl Iterator<Item = (usize, &Pair)> + Clone {
        self.0.range((phone, 0)..=(phone, usize::MAX)).map(|((_, other), pair)| (*other, pair))
    }
}

fn mean(offsets_m: impl Iterator<Item = Vector2<f64>>) -> Option<Vector2<f64>> {
    let (count, sum) = offsets_m.fold((0_u32, Vector2::zeros()), |(n, sum), offset| (n + 1, sum + offset));
    (count > 0).then(|| sum / f64::from(count))
}

#[cfg(test)]
mod tests {
    use nalgebra::{SMatrix, SVector, Vector3};

    use super::*;
    use crate::constraint::FreePhone;
    use crate::frames::{Ecef, Enu, LocalFrame};
    use crate::fusion::doubt::Doubt;

    /// Second from which on a phone is displaced.
    const BEGIN: u8 = 20;
    const PAIRS: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

    /// Four phones at one place for some seconds with a bound of a distance between all; `east_m` gives how far east the solution of a phone is.
    fn solutions(
        within_m: f64,
        seconds: u8,
        east_m: impl Fn(usize, u8) -> Option<f64>,
    ) -> (Solutions, GpsTime) {
        let place = Ecef(Vector3::new(-2_267_749.0, 5_009_154.0, 3_221_290.0));
        let frame = LocalFrame::at(place);
        let start = GpsTime::from_week_tow(2118, 100.0);
        let standing = FreePhone::new(SVector::zeros(), SMatrix::identity());
        let mut solutions = Solutions::default();
        for second in 0..=seconds {
            let seen = |phone: usize| {
                let mut seen = Seen::new(&standing, None, start);
                seen.position = place;
                let at = |east| place + frame.vector_enu_to_ecef(Enu { east, north: 0.0, up: 0.0 });
                seen.solution = east_m(phone, second).map(|east| (at(east), 3.0));
                Some(seen)
            };
            let evidence: Vec<Evidence<'_>> = PAIRS
                .iter()
                .enumerate()
                .map(|(place, phones)| Evidence { place, phones, doubt: Doubt::None, share: 0.0, within_m })
                .collect();
            let seen: Vec<Option<Seen>> = (0..4).map(seen).collect();
            solutions.take(start + f64::from(second), &evidence, &seen);
        }
        (solutions, start + f64::from(seconds))
    }

    fn displaced(within_m: f64, seconds: u8, east_m: impl Fn(usize, u8) -> Option<f64>) -> Option<usize> {
        let (solutions, now) = solutions(within_m, seconds, east_m);
        solutions.displaced(now, |_| false)
    }

    fn only(liar: usize, east_m: f64) -> impl Fn(usize, u8) -> Option<f64> {
        move |phone, second| Some(if phone == liar && second >= BEGIN { east_m } else { 0.0 })
    }

    #[test]
    fn the_excess_that_is_asked_for_is_smaller_the_longer_it_lasts() {
        assert_eq!(displaced(2.0, BEGIN + 7, only(2, 14.1)), None);
        assert_eq!(displaced(2.0, BEGIN + 8, only(2, 14.1)), Some(2));
        assert_eq!(displaced(2.0, BEGIN + 19, only(2, 6.3)), None);
        assert_eq!(displaced(2.0, BEGIN + 20, only(2, 6.3)), Some(2));
        assert_eq!(displaced(2.0, BEGIN + 60, only(2, 6.1)), None);
        // Bounds between cars do not count.
        assert_eq!(displaced(11.0, BEGIN + 8, only(2, 100.0)), None);
    }

    #[test]
    fn solutions_that_scatter_or_pause_tell_nothing() {
        let scattering = |phone, second: u8| Some(if phone == 2 && second != 5 { 30.0 } else { 0.0 });
        assert_eq!(displaced(2.0, 8, scattering), None);
        let pausing = |phone, second: u8| {
            (phone != 2 || !(2..6).contains(&second)).then_some(30.0 * f64::from(u8::from(phone == 2)))
        };
        assert_eq!(displaced(2.0, 8, pausing), None);
        assert_eq!(displaced(2.0, 14, pausing), Some(2));
    }

    #[test]
    fn two_that_are_displaced_alike_are_not_named() {
        assert_eq!(displaced(2.0, 30, |phone, _| Some(if phone > 1 { 30.0 } else { 0.0 })), None);
        // A companion without solutions of its own cannot tell.
        assert_eq!(displaced(2.0, 30, |phone, _| (phone == 2).then_some(30.0)), None);
    }

    #[test]
    fn the_mean_is_measured_in_standard_deviations_beyond_the_bound() {
        let (solutions, now) = solutions(2.0, BEGIN + 8, only(1, 11.0));
        assert!((solutions.excess_sigmas(1, now) - 3.0).abs() < 1e-6);
        assert!(solutions.excess_sigmas(0, now) < 0.0);
        assert_eq!(Solutions::default().excess_sigmas(0, now), 0.0);
    }
}
