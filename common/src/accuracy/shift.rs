//! Detection of a time shift between truth and solutions: UTC or local time written as GPS time, or a wrong clock.

use nalgebra::Vector3;

use super::{Solution, Truth};
use crate::frames::LocalFrame;
use crate::time::GpsTime;

/// Maximum number of compared solutions, at equal intervals.
const MOST_SAMPLES: usize = 400;
/// Minimum number of comparisons.
const FEWEST_SAMPLES: usize = 20;
/// Maximum shift without a time zone, whole seconds: leap seconds, the 14 s of BeiDou time, clocks set by hand.
const NEAREST_SHIFTS_S: i32 = 40;
/// Maximum time zone, hours; zones are multiples of a quarter of an hour.
const FARTHEST_ZONE_H: i32 = 14;
/// Differences between time scales of receivers and programs, s.
const SCALES_S: [f64; 4] = [0.0, 18.0, -18.0, 14.0];
/// Step of the second search, around the best shift of the first, s.
const FINE_STEP_S: f64 = 0.05;
/// Maximum ratio of the median distances with and without the shift.
const BETTER: f64 = 0.6;
/// Minimum reduction of the median distance, m, if there was a median without the shift.
const LEAST_GAIN_M: f64 = 0.5;
/// Maximum median distance with the shift, m; positions that are wrong by kilometres fit no shift.
const FITS_M: f64 = 30.0;

/// A shift of a truth's times that makes it agree with the solutions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeShift {
    /// Seconds to add to the truth's times.
    pub shift_s: f64,
    /// Median horizontal distance of the solutions from the unshifted truth, m; `None` without common times.
    pub median_m: Option<f64>,
    /// Median horizontal distance after the shift, m.
    pub shifted_median_m: f64,
}

/// The shift of the truth's times for which `solutions` (in order of time) agree distinctly better, if there is one. A phone at rest agrees
/// with any shift, so no shift is reported for it.
pub fn time_shift(truth: &Truth, qualities: &[u8], solutions: &[Solution]) -> Option<TimeShift> {
    let step = solutions.len().div_ceil(MOST_SAMPLES).max(1);
    let samples: Vec<&Solution> = solutions.iter().step_by(step).collect();
    let search = Search { truth, qualities, up: LocalFrame::at(samples.first()?.position).up(), samples };
    let median_m = search.median_m(0.0);
    let coarse = best(candidates().into_iter().filter_map(|s| Some((s, search.median_m(s)?))))?;
    let steps = |from: i32| (from..=-from).map(|i| coarse.0 + f64::from(i) * FINE_STEP_S);
    let (shift_s, shifted_median_m) = best(steps(-20).filter_map(|s| Some((s, search.median_m(s)?))))?;
    let gains =
        |as_is_m: f64| shifted_median_m < BETTER * as_is_m && as_is_m - shifted_median_m > LEAST_GAIN_M;
    let is_better = shifted_median_m < FITS_M && median_m.is_none_or(gains);
    // Removes rounding errors of the search's steps.
    let shift_s = (shift_s * 1e3).round() * 1e-3;
    (is_better && shift_s != 0.0).then_some(TimeShift { shift_s, median_m, shifted_median_m })
}

struct Search<'a> {
    truth: &'a Truth,
    qualities: &'a [u8],
    samples: Vec<&'a Solution>,
    up: Vector3<f64>,
}

impl Search<'_> {
    /// Median horizontal distance, m; `None` if fewer than half of the samples have a truth.
    fn median_m(&self, shift_s: f64) -> Option<f64> {
        let mut distances: Vec<f64> =
            self.samples.iter().filter_map(|solution| self.distance_m(solution, shift_s)).collect();
        if distances.len() < FEWEST_SAMPLES.max(self.samples.len() / 2) {
            return None;
        }
        let middle = distances.len() / 2;
        Some(*distances.select_nth_unstable_by(middle, f64::total_cmp).1)
    }

    fn distance_m(&self, solution: &Solution, shift_s: f64) -> Option<f64> {
        let time: GpsTime = solution.time_gps - shift_s;
        let difference = (solution.position - self.truth.at(time, self.qualities)?.position).0;
        Some((difference - self.up * self.up.dot(&difference)).norm())
    }
}

/// Smallest first, so that of equal distances the smallest shift wins.
fn candidates() -> Vec<f64> {
    let mut shifts: Vec<f64> = (-NEAREST_SHIFTS_S..=NEAREST_SHIFTS_S).map(f64::from).collect();
    for quarter in (-4 * FARTHEST_ZONE_H..=4 * FARTHEST_ZONE_H).filter(|quarter| *quarter != 0) {
        shifts.extend(SCALES_S.map(|scale_s| 900.0 * f64::from(quarter) + scale_s));
    }
    shifts.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    shifts
}

/// The first shift with the smallest distance.
fn best(shifts: impl Iterator<Item = (f64, f64)>) -> Option<(f64, f64)> {
    shifts.min_by(|a, b| a.1.total_cmp(&b.1))
}

#[cfg(test)]
mod tests {
    use super::super::TruthPoint;
    use super::*;
    use crate::frames::{Ecef, EcefVector, Enu, Geodetic};
    use nalgebra::Matrix3;

    const EPOCHS: u32 = 120;

    fn start() -> GpsTime {
        GpsTime::from_week_tow(2118, 100.0)
    }

    fn frame() -> LocalFrame {
        LocalFrame::at(Geodetic::from_degrees(30.0, 114.0, 20.0).geodetic_to_ecef())
    }

    /// Position on a curve with speed `speed_mps`.
    fn place(time: GpsTime, speed_mps: f64) -> Ecef {
        let angle = (time - start()) * speed_mps / 400.0;
        frame().enu_to_ecef(Enu { east: 400.0 * angle.sin(), north: 400.0 * angle.cos(), up: 0.0 })
    }

    /// Shift found for a truth with times too small by `late_s`, and solutions with a one-metre error to the east.
    fn shift(late_s: f64, speed_mps: f64) -> Option<TimeShift> {
        let seconds = |i: u32| start() + f64::from(i);
        let point = |time| TruthPoint {
            position: place(time, speed_mps),
            velocity: EcefVector((place(time + 0.5, speed_mps) - place(time - 0.5, speed_mps)).0),
        };
        let truth = Truth::from_points((0..EPOCHS).map(|i| (seconds(i) - late_s, point(seconds(i)))), 1);
        let solutions: Vec<_> = (0..EPOCHS)
            .map(|i| Solution {
                time_gps: seconds(i),
                position: place(seconds(i), speed_mps)
                    + frame().vector_enu_to_ecef(Enu { east: 1.0, north: 0.0, up: 5.0 }),
                covariance: Matrix3::identity(),
            })
            .collect();
        time_shift(&truth, &[1], &solutions)
    }

    #[test]
    fn utc_late_clocks_and_local_time_are_found() {
        for late_s in [18.0, -18.0, 0.5, 1.0, 14.0, 8.0 * 3_600.0, -5.5 * 3_600.0 + 18.0] {
            let found = shift(late_s, 15.0).unwrap();
            assert!((found.shift_s - late_s).abs() < 0.11, "{late_s}: {found:?}");
            assert!(found.shifted_median_m < 1.5, "{found:?}");
            assert_eq!(found.median_m.is_none(), late_s.abs() > 120.0, "{found:?}");
        }
    }

    #[test]
    fn what_fits_or_stands_still_is_left_alone() {
        assert_eq!(shift(0.0, 15.0), None);
        assert_eq!(shift(18.0, 0.0), None);
        assert_eq!(shift(500.0, 15.0), None, "no time in common, and no zone");
    }
}
