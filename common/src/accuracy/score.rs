//! Errors of a series of positions against truth.

use serde::Serialize;

use super::Truth;
use crate::frames::{Ecef, Enu, LocalFrame};
use crate::time::GpsTime;

/// A position at an instant.
pub type Solution = (GpsTime, Ecef);

/// Accuracy of one phone by one method. Percentiles interpolate linearly between order statistics.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Accuracy {
    /// Scored epochs.
    pub epochs: usize,
    /// Scored epochs / truth epochs inside the phone's recording.
    pub availability: f64,
    /// Median horizontal error, m.
    pub horizontal_p50_m: f64,
    /// 68th percentile of the horizontal error, m.
    pub horizontal_p68_m: f64,
    /// 95th percentile of the horizontal error, m.
    pub horizontal_p95_m: f64,
    /// Root mean square east error, m.
    pub rmse_east_m: f64,
    /// Root mean square north error, m.
    pub rmse_north_m: f64,
    /// Root mean square up error, m.
    pub rmse_up_m: f64,
    /// Root mean square horizontal error, m.
    pub rmse_2d_m: f64,
}

/// Scores `solutions` (in order of time) against `truth` for a recording that spans `recording`.
///
/// Each truth epoch of counted quality inside the recording is matched with the nearest solution within half the truth's
/// interval, and the truth is interpolated to that solution's instant. `None` when no truth epoch lies inside, or
/// none has a solution.
pub fn score(
    truth: &Truth,
    qualities: &[u8],
    recording: (GpsTime, GpsTime),
    solutions: &[Solution],
) -> Option<Accuracy> {
    let half_s = truth.interval_s() / 2.0;
    let inside = |time: GpsTime| time >= recording.0 - half_s && time <= recording.1 + half_s;
    let mut expected = 0_usize;
    let mut errors = Vec::new();
    for time in truth.times(qualities).filter(|t| inside(*t)) {
        expected += 1;
        let nearest = nearest(solutions, time).filter(|(t, _)| (*t - time).abs() <= half_s);
        errors.extend(nearest.and_then(|solution| error(truth, qualities, solution)));
    }
    Accuracy::of(&errors, expected)
}

fn nearest(solutions: &[Solution], time: GpsTime) -> Option<Solution> {
    let after = solutions.partition_point(|(t, _)| *t < time);
    let candidates = [after.checked_sub(1), Some(after)];
    candidates
        .into_iter()
        .flatten()
        .filter_map(|i| solutions.get(i).copied())
        .min_by(|a, b| (a.0 - time).abs().total_cmp(&(b.0 - time).abs()))
}

fn error(truth: &Truth, qualities: &[u8], (time, position): Solution) -> Option<Enu> {
    let reference = truth.at(time, qualities)?;
    Some(LocalFrame::at(reference.position).ecef_to_enu(position))
}

impl Accuracy {
    fn of(errors: &[Enu], expected: usize) -> Option<Self> {
        if errors.is_empty() {
            return None;
        }
        let mut horizontal: Vec<f64> = errors.iter().map(|e| e.horizontal()).collect();
        horizontal.sort_by(f64::total_cmp);
        let rms = |component: fn(&Enu) -> f64| {
            (errors.iter().map(|e| component(e).powi(2)).sum::<f64>() / errors.len() as f64).sqrt()
        };
        Some(Self {
            epochs: errors.len(),
            availability: errors.len() as f64 / expected as f64,
            horizontal_p50_m: percentile(&horizontal, 0.50),
            horizontal_p68_m: percentile(&horizontal, 0.68),
            horizontal_p95_m: percentile(&horizontal, 0.95),
            rmse_east_m: rms(|e| e.east),
            rmse_north_m: rms(|e| e.north),
            rmse_up_m: rms(|e| e.up),
            rmse_2d_m: rms(|e| e.horizontal()),
        })
    }
}

/// The `fraction` quantile of sorted values by linear interpolation; NaN when there are none.
fn percentile(sorted: &[f64], fraction: f64) -> f64 {
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
        let solutions: Vec<_> = (0..6).map(|i| (start + f64::from(i) + 0.0003, off)).collect();
        let accuracy = score(&truth, &[1], (start, start + 7.0), &solutions).unwrap();
        assert_eq!(accuracy.epochs, 6);
        assert!((accuracy.availability - 0.75).abs() < 1e-12, "8 truth epochs inside the recording");
        assert!((accuracy.horizontal_p95_m - 5.0).abs() < 1e-6);
        assert!((accuracy.rmse_up_m - 2.0).abs() < 1e-4);
        assert!((accuracy.rmse_east_m - 3.0).abs() < 1e-4 && (accuracy.rmse_north_m - 4.0).abs() < 1e-4);
        assert!(score(&truth, &[2], (start, start + 7.0), &solutions).is_none());
    }
}
