//! What integrity monitoring said of positions, against truth.

use serde::Serialize;

use super::Truth;
use super::score::{percentile, truth_error};
use crate::frames::Ecef;
use crate::integrity::{ProtectionLevels, Verdict};
use crate::time::GpsTime;

/// A position and what was said of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Claim {
    /// Time of the position, GPS time.
    pub time_gps: GpsTime,
    /// The position, m.
    pub position: Ecef,
    /// Whether it was called reliable.
    pub is_reliable: bool,
    /// Its protection levels, if any.
    pub levels: Option<ProtectionLevels>,
}

impl Claim {
    /// A position with the verdict on it and its levels.
    pub fn of(time_gps: GpsTime, position: Ecef, verdict: Verdict, levels: Option<ProtectionLevels>) -> Self {
        Self { time_gps, position, is_reliable: verdict == Verdict::Reliable, levels }
    }
}

/// Protection levels of one phone by one method against truth; `None` where there is nothing to say.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Protection {
    /// Median HPL of the scored reliable epochs, m.
    pub hpl_p50_m: Option<f64>,
    /// Median VPL, m.
    pub vpl_p50_m: Option<f64>,
    /// Share of the scored reliable epochs whose horizontal error the HPL bounds. An epoch without a level is not bounded.
    pub hpl_bounds: Option<f64>,
    /// Share whose vertical error the VPL bounds.
    pub vpl_bounds: Option<f64>,
    /// Reliable scored epochs / scored epochs.
    pub reliable_availability: Option<f64>,
    /// Reliable scored epochs with an error beyond a level, or without levels.
    pub misleading_epochs: Option<u64>,
}

impl Protection {
    /// Scores claims. Each is compared with the truth at its own time, where rows of these qualities give one.
    pub fn score(truth: &Truth, qualities: &[u8], claims: &[Claim]) -> Self {
        let scored: Vec<(bool, Option<Bounded>)> = claims
            .iter()
            .filter_map(|claim| {
                let error = truth_error(truth, qualities, claim.time_gps, claim.position)?;
                let bounded = claim.levels.map(|levels| Bounded {
                    levels,
                    horizontally: error.horizontal() <= levels.horizontal_m,
                    vertically: error.up.abs() <= levels.vertical_m,
                });
                Some((claim.is_reliable, bounded))
            })
            .collect();
        let reliable: Vec<Option<Bounded>> =
            scored.iter().filter(|(is_reliable, _)| *is_reliable).map(|(_, bounded)| *bounded).collect();
        if reliable.is_empty() {
            let reliable_availability = (!scored.is_empty()).then_some(0.0);
            return Self { reliable_availability, ..Self::default() };
        }
        let median_m = |level: fn(&ProtectionLevels) -> f64| {
            let mut levels: Vec<f64> = reliable.iter().flatten().map(|b| level(&b.levels)).collect();
            levels.sort_by(f64::total_cmp);
            (!levels.is_empty()).then(|| percentile(&levels, 0.5))
        };
        let count = |holds: fn(&Bounded) -> bool| reliable.iter().flatten().filter(|b| holds(b)).count();
        let share = |count: usize| Some(count as f64 / reliable.len() as f64);
        let fully_bounded = count(|b| b.horizontally && b.vertically);
        Self {
            hpl_p50_m: median_m(|levels| levels.horizontal_m),
            vpl_p50_m: median_m(|levels| levels.vertical_m),
            hpl_bounds: share(count(|b| b.horizontally)),
            vpl_bounds: share(count(|b| b.vertically)),
            reliable_availability: Some(reliable.len() as f64 / scored.len() as f64),
            misleading_epochs: Some((reliable.len() - fully_bounded) as u64),
        }
    }
}

/// Levels, and whether they bound the errors.
#[derive(Clone, Copy)]
struct Bounded {
    levels: ProtectionLevels,
    horizontally: bool,
    vertically: bool,
}

#[cfg(test)]
mod tests {
    use super::super::TruthPoint;
    use super::*;
    use crate::frames::{EcefVector, Enu, Geodetic, LocalFrame};

    #[test]
    fn levels_are_counted_against_the_errors_of_reliable_epochs() {
        let start = GpsTime::from_week_tow(2118, 100.0);
        let site = Geodetic::from_degrees(30.0, 114.0, 20.0).geodetic_to_ecef();
        let still = TruthPoint { position: site, velocity: EcefVector::new(0.0, 0.0, 0.0) };
        let truth = Truth::from_points((0..10).map(|i| (start + f64::from(i), still)), 1);
        let position = LocalFrame::at(site).enu_to_ecef(Enu { east: 3.0, north: 4.0, up: -7.0 });
        let claim = |i: u8, is_reliable, levels: Option<(f64, f64)>| Claim {
            time_gps: start + f64::from(i),
            position,
            is_reliable,
            levels: levels.map(|(horizontal_m, vertical_m)| ProtectionLevels { horizontal_m, vertical_m }),
        };
        let claims = [
            claim(0, true, Some((6.0, 8.0))),
            claim(1, true, Some((4.0, 8.0))),
            claim(2, true, Some((10.0, 6.0))),
            claim(3, true, None),
            claim(4, false, Some((1.0, 1.0))),
            claim(50, true, Some((1.0, 1.0))),
        ];
        let scored = Protection::score(&truth, &[1], &claims);
        assert_eq!(scored.reliable_availability, Some(0.8));
        assert_eq!((scored.hpl_bounds, scored.vpl_bounds), (Some(0.5), Some(0.5)));
        assert_eq!((scored.hpl_p50_m, scored.vpl_p50_m), (Some(6.0), Some(8.0)));
        assert_eq!(scored.misleading_epochs, Some(3));
        let none = Protection::score(&truth, &[1], &claims[4..]);
        assert_eq!(none, Protection { reliable_availability: Some(0.0), ..Protection::default() });
        assert_eq!(Protection::score(&truth, &[2], &claims), Protection::default());
    }
}
