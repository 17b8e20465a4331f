//! Errors of a series of positions against truth.

use nalgebra::{Cholesky, Matrix3, Vector2};
use serde::Serialize;

use super::{Protection, Truth};
use crate::frames::{Ecef, Enu, LocalFrame};
use crate::time::GpsTime;

/// A position at an instant with its covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution {
    /// Time of the position, GPS time.
    pub time_gps: GpsTime,
    /// The position, m.
    pub position: Ecef,
    /// Covariance of the position in ECEF, m².
    pub covariance: Matrix3<f64>,
}

/// Accuracy of one phone by one method. Percentiles are interpolated linearly between order statistics.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Accuracy {
    /// Number of scored epochs.
    pub epochs: usize,
    /// Scored epochs / truth epochs inside the group's span; a late start and an early end reduce it.
    pub availability: f64,
    /// Scored epochs / truth epochs inside the phone's own recording.
    pub availability_in_recording: f64,
    /// Median horizontal error, m.
    pub horizontal_p50_m: f64,
    /// 68th percentile of the horizontal error, m.
    pub horizontal_p68_m: f64,
    /// 95th percentile of the horizontal error, m.
    pub horizontal_p95_m: f64,
    /// Median absolute height error, m.
    pub vertical_p50_m: f64,
    /// 68th percentile of the absolute height error, m.
    pub vertical_p68_m: f64,
    /// 95th percentile of the absolute height error, m.
    pub vertical_p95_m: f64,
    /// Mean east error, m.
    pub mean_east_m: f64,
    /// Mean north error, m.
    pub mean_north_m: f64,
    /// Mean up error, m.
    pub mean_up_m: f64,
    /// Root mean square east error, m.
    pub rmse_east_m: f64,
    /// Root mean square north error, m.
    pub rmse_north_m: f64,
    /// Root mean square up error, m.
    pub rmse_up_m: f64,
    /// Root mean square horizontal error, m.
    pub rmse_2d_m: f64,
    /// Mean normalised estimation error squared of the horizontal position; 2 for a correct covariance, more for one that
    /// is too small.
    pub nees_horizontal: f64,
    /// Mean normalised estimation error squared of the height; 1 for a correct covariance.
    pub nees_up: f64,
    /// What integrity monitoring said of the positions; empty where nothing did.
    #[serde(flatten)]
    pub protection: Protection,
}

/// An error and its ratio to the covariance.
#[derive(Clone, Copy, Debug)]
struct Scored {
    error: Enu,
    nees_horizontal: f64,
    nees_up: f64,
}

/// First and last instant of the counted truth epochs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Spans {
    /// Span of all phones of the group together.
    pub group: (GpsTime, GpsTime),
    /// Span of the phone's own recording.
    pub recording: (GpsTime, GpsTime),
}

/// Spans of a single phone.
impl From<(GpsTime, GpsTime)> for Spans {
    fn from(recording: (GpsTime, GpsTime)) -> Self {
        Self { group: recording, recording }
    }
}

/// Scores `solutions` (in order of time) against `truth`.
///
/// Each truth epoch of counted quality inside the group's span is matched with the nearest solution within half the truth's
/// interval, and the truth is interpolated to the solution's instant. `None` if no truth epoch lies inside the span, or
/// none has a solution.
pub fn score(
    truth: &Truth,
    qualities: &[u8],
    spans: impl Into<Spans>,
    solutions: &[Solution],
) -> Option<Accuracy> {
    let spans = spans.into();
    let half_s = truth.interval_s() / 2.0;
    let is_in = |time: GpsTime, span: (GpsTime, GpsTime)| time >= span.0 - half_s && time <= span.1 + half_s;
    let mut expected = Expected::default();
    let mut scored = Vec::new();
    for time in truth.times(qualities).filter(|t| is_in(*t, spans.group) || is_in(*t, spans.recording)) {
        expected.in_group += 1;
        let is_recorded = is_in(time, spans.recording);
        expected.in_recording += usize::from(is_recorded);
        let nearest = nearest(solutions, time).filter(|s| (s.time_gps - time).abs() <= half_s);
        let compared = nearest.and_then(|solution| compare(truth, qualities, solution));
        expected.scored_in_recording += usize::from(is_recorded && compared.is_some());
        scored.extend(compared);
    }
    Accuracy::of(&scored, expected)
}

/// Truth epochs to be scored.
#[derive(Clone, Copy, Debug, Default)]
struct Expected {
    in_group: usize,
    in_recording: usize,
    scored_in_recording: usize,
}

fn nearest(solutions: &[Solution], time: GpsTime) -> Option<&Solution> {
    let after = solutions.partition_point(|s| s.time_gps < time);
    let candidates = [after.checked_sub(1), Some(after)];
    candidates
        .into_iter()
        .flatten()
        .filter_map(|i| solutions.get(i))
        .min_by(|a, b| (a.time_gps - time).abs().total_cmp(&(b.time_gps - time).abs()))
}

/// Error of a position at a time, where the truth has it.
pub(super) fn truth_error(truth: &Truth, qualities: &[u8], time_gps: GpsTime, position: Ecef) -> Option<Enu> {
    let reference = truth.at(time_gps, qualities)?;
    Some(LocalFrame::at(reference.position).ecef_to_enu(position))
}

fn compare(truth: &Truth, qualities: &[u8], solution: &Solution) -> Option<Scored> {
    let reference = truth.at(solution.time_gps, qualities)?;
    let frame = LocalFrame::at(reference.position);
    let error = frame.ecef_to_enu(solution.position);
    let covariance = frame.covariance_ecef_to_enu(&solution.covariance);
    let horizontal = covariance.fixed_view::<2, 2>(0, 0).into_owned();
    let e = Vector2::new(error.east, error.north);
    let nees_horizontal = Cholesky::new(horizontal).map_or(f64::NAN, |factor| e.dot(&factor.solve(&e)));
    Some(Scored { error, nees_horizontal, nees_up: error.up * error.up / covariance.m33 })
}

impl Accuracy {
    fn of(scored: &[Scored], expected: Expected) -> Option<Self> {
        if scored.is_empty() {
            return None;
        }
        let sorted = |size: fn(&Enu) -> f64| {
            let mut sizes: Vec<f64> = scored.iter().map(|s| size(&s.error)).collect();
            sizes.sort_by(f64::total_cmp);
            sizes
        };
        let (horizontal, vertical) = (sorted(|e| e.horizontal()), sorted(|e| e.up.abs()));
        let rms = |component: fn(&Enu) -> f64| mean(scored, |s| component(&s.error).powi(2)).sqrt();
        Some(Self {
            epochs: scored.len(),
            availability: scored.len() as f64 / expected.in_group as f64,
            availability_in_recording: expected.scored_in_recording as f64 / expected.in_recording as f64,
            horizontal_p50_m: percentile(&horizontal, 0.50),
            horizontal_p68_m: percentile(&horizontal, 0.68),
            horizontal_p95_m: percentile(&horizontal, 0.95),
            vertical_p50_m: percentile(&vertical, 0.50),
            vertical_p68_m: percentile(&vertical, 0.68),
            vertical_p95_m: percentile(&vertical, 0.95),
            mean_east_m: mean(scored, |s| s.error.east),
            mean_north_m: mean(scored, |s| s.error.north),
            mean_up_m: mean(scored, |s| s.error.up),
            rmse_east_m: rms(|e| e.east),
            rmse_north_m: rms(|e| e.north),
            rmse_up_m: rms(|e| e.up),
            rmse_2d_m: rms(|e| e.horizontal()),
            nees_horizontal: mean(scored, |s| s.nees_horizontal),
            nees_up: mean(scored, |s| s.nees_up),
            protection: Protection::default(),
        })
    }
}

fn mean(scored: &[Scored], value: impl Fn(&Scored) -> f64) -> f64 {
    scored.iter().map(value).sum::<f64>() / scored.len() as f64
}

/// The `fraction` quantile of sorted values by linear interpolation; NaN without values.
pub fn percentile(sorted: &[f64], fraction: f64) -> f64 {
    let position = fraction * sorted.len().saturating_sub(1) as f64;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within the slice's length
    let below = position.floor() as usize;
    match (sorted.get(below), sorted.get(below + 1)) {
        (Some(a), Some(b)) => a + (b - a) * (position - below as f64),
        (Some(a), None) => *a,
        _ => f64::NAN,
    }
}

#[cfg(test)]
mod tests {
    use super::super::TruthPoint;
    use super::*;
    use crate::frames::{EcefVector, Geodetic};

    #[test]
    fn percentiles_interpolate() {
        let sorted = [1.0, 2.0, 3.0, 4.0];
        assert_eq!(percentile(&sorted, 0.5), 2.5);
        assert_eq!(percentile(&sorted, 1.0), 4.0);
        assert!((percentile(&sorted, 0.95) - 3.85).abs() < 1e-12);
        assert!(percentile(&[], 0.5).is_nan());
    }

    #[test]
    fn errors_and_availability_count_missing_epochs() {
        let start = GpsTime::from_week_tow(2118, 100.0);
        let site = Geodetic::from_degrees(30.0, 114.0, 20.0).geodetic_to_ecef();
        let still = TruthPoint { position: site, velocity: EcefVector::new(0.0, 0.0, 0.0) };
        let truth = Truth::from_points((0..10).map(|i| (start + f64::from(i), still)), 1);
        let off = LocalFrame::at(site).enu_to_ecef(Enu { east: 3.0, north: 4.0, up: -2.0 });
        let solutions: Vec<_> = (0..6)
            .map(|i| Solution {
                time_gps: start + f64::from(i) + 0.0003,
                position: off,
                covariance: Matrix3::identity() * 4.0,
            })
            .collect();
        let spans = Spans { group: (start, start + 7.0), recording: (start, start + 5.0) };
        let accuracy = score(&truth, &[1], spans, &solutions).unwrap();
        assert_eq!(accuracy.epochs, 6);
        assert!((accuracy.availability - 0.75).abs() < 1e-12, "8 truth epochs inside the group's span");
        assert!((accuracy.availability_in_recording - 1.0).abs() < 1e-12, "6 of them inside the recording");
        assert!((accuracy.vertical_p95_m - 2.0).abs() < 1e-4 && (accuracy.mean_up_m + 2.0).abs() < 1e-4);
        assert!((accuracy.mean_east_m - 3.0).abs() < 1e-4 && (accuracy.mean_north_m - 4.0).abs() < 1e-4);
        assert!((accuracy.horizontal_p95_m - 5.0).abs() < 1e-6);
        assert!((accuracy.rmse_up_m - 2.0).abs() < 1e-4);
        assert!((accuracy.rmse_east_m - 3.0).abs() < 1e-4 && (accuracy.rmse_north_m - 4.0).abs() < 1e-4);
        assert!(
            (accuracy.nees_horizontal - 25.0 / 4.0).abs() < 1e-6 && (accuracy.nees_up - 1.0).abs() < 1e-6
        );
        assert!(score(&truth, &[2], spans, &solutions).is_none());
    }
}
