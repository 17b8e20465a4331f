//! Exclusion of everything that one constellation, or one clock group, contributes.
//!
//! A receiver can decode a whole constellation wrongly, so that its pseudoranges are off by kilometres while all others agree to metres.
//! The exclusion of single measurements then fails, because the least squares spread the errors over all residuals.

use super::checks::{geometry_verdict, global_test, mark, usages};
use super::monitor::Monitored;
use super::options::RaimOptions;
use super::{RaimReport, Verdict};
use crate::frames::Ecef;
use crate::gnss::{ClockGroup, Constellation};
use crate::measurement::{CorrectedObservation, Usage};
use crate::solve::solve_position;

/// Minimum m − n of what is left: with less, one wrong measurement among the rest could not be found (m ≥ n + 2 to exclude).
const LEAST_REDUNDANCY: u16 = 2;

/// Observations that are excluded together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Group {
    /// A constellation on one band.
    Clock(ClockGroup),
    /// A constellation on all its bands.
    Whole(Constellation),
}

impl Group {
    fn contains(self, observation: &CorrectedObservation) -> bool {
        match self {
            Self::Clock(group) => observation.clock_group() == group,
            Self::Whole(constellation) => observation.satellite.constellation == constellation,
        }
    }
}

/// Excludes one clock group if the rest passes the global test with redundancy and a valid geometry. If no clock group suffices, does so with
/// whole constellations. If two such exclusions succeed, the measurements do not tell which one is right. `None` without a single success;
/// the observations are then as they were.
pub(super) fn exclude_group(
    observations: &mut [CorrectedObservation],
    start: Ecef,
    options: &RaimOptions,
) -> Option<Monitored> {
    let (clocks, wholes) = groups(observations);
    let mut passing = |groups: Vec<Group>| -> Vec<(Group, Monitored)> {
        let passes = |group| Some((group, without(observations, group, start, options)?));
        groups.into_iter().filter_map(passes).collect()
    };
    let mut passed = passing(clocks);
    if passed.is_empty() {
        passed = passing(wholes);
    }
    let (group, monitored) = passed.pop()?;
    passed.is_empty().then(|| {
        exclude(observations, group);
        monitored
    })
}

/// The clock groups in use, and the constellations with more than one of them.
fn groups(observations: &[CorrectedObservation]) -> (Vec<Group>, Vec<Group>) {
    let (mut clocks, mut wholes) = (Vec::new(), Vec::new());
    for observation in observations.iter().filter(|o| o.usage == Usage::Used) {
        let clock = Group::Clock(observation.clock_group());
        if clocks.contains(&clock) {
            continue;
        }
        let whole = Group::Whole(observation.satellite.constellation);
        let has_other =
            observations.iter().any(|o| o.usage == Usage::Used && whole.contains(o) && !clock.contains(o));
        if has_other && !wholes.contains(&whole) {
            wholes.push(whole);
        }
        clocks.push(clock);
    }
    (clocks, wholes)
}

/// Excludes the observations in use of a group and returns their number.
fn exclude(observations: &mut [CorrectedObservation], group: Group) -> u16 {
    let mut excluded = 0;
    for observation in observations.iter_mut().filter(|o| o.usage == Usage::Used && group.contains(o)) {
        observation.usage = Usage::Excluded;
        excluded += 1;
    }
    excluded
}

/// The solution without a group, if it is reliable; leaves the observations as they were.
fn without(
    observations: &mut [CorrectedObservation],
    group: Group,
    start: Ecef,
    options: &RaimOptions,
) -> Option<Monitored> {
    let offered = usages(observations);
    let excluded = exclude(observations, group);
    let fit = solve_position(observations, start);
    mark(observations, &offered);
    let fit = fit.ok()?;
    let test = global_test(&fit, options)?;
    let passes = test.passes() && test.degrees_of_freedom >= LEAST_REDUNDANCY;
    let verdict = geometry_verdict(fit.dops(), options.dop_limits);
    (passes && verdict == Verdict::Reliable).then(|| {
        let report = RaimReport { global_test: Some(test), excluded, ..RaimReport::of(verdict) };
        Monitored { fit: Ok(fit), report }
    })
}

#[cfg(test)]
mod tests {
    use super::super::{Cause, solve_with_raim};
    use super::*;
    use crate::measurement::sky::{OPEN_SKY_DEG, Receiver};

    /// Errors of a constellation that is decoded wrongly, m: each satellite's own hundreds of kilometres.
    fn ruin(observations: &mut [CorrectedObservation], group: Group) {
        let errors_m = [3e5, -2.1e5, 1.7e5, -3e5, 2.6e5, -1.1e5, 0.9e5, -2.9e5];
        let ruined = observations.iter_mut().filter(|o| group.contains(o));
        for (observation, error_m) in ruined.zip(errors_m.into_iter().cycle()) {
            observation.pseudorange_m += error_m;
        }
    }

    /// 24 signals of GPS, Galileo and BeiDou, with those of the second twelve satellites' band 5 when `two_bands`.
    fn sky(two_bands: bool) -> (Receiver, Vec<CorrectedObservation>) {
        let receiver = Receiver::in_wuhan();
        let mut observations = receiver.observe(&OPEN_SKY_DEG);
        let mut others =
            receiver.observe(&OPEN_SKY_DEG.map(|(azimuth, elevation)| (azimuth + 25.0, elevation)));
        for other in &mut others {
            other.satellite.number += 20;
            if two_bands {
                other.signal.band = b'5';
            }
        }
        observations.extend(others);
        (receiver, observations)
    }

    fn assert_only(group: Group, two_bands: bool) {
        let (receiver, mut observations) = sky(two_bands);
        ruin(&mut observations, group);
        let monitored = solve_with_raim(&mut observations, receiver.position, &RaimOptions::default());
        assert_eq!(monitored.report.verdict, Verdict::Reliable, "{group:?}");
        assert!(monitored.fit.unwrap().position().distance_m(receiver.position) < 1e-3, "{group:?}");
        for observation in &observations {
            let expected = if group.contains(observation) { Usage::Excluded } else { Usage::Used };
            assert_eq!(observation.usage, expected, "{group:?}: {}", observation.satellite);
        }
        let excluded = observations.iter().filter(|o| o.usage == Usage::Excluded).count();
        assert_eq!(usize::from(monitored.report.excluded), excluded);
    }

    #[test]
    fn a_constellation_that_is_wrong_as_a_whole_is_excluded() {
        for constellation in [Constellation::Gps, Constellation::Galileo, Constellation::Beidou] {
            assert_only(Group::Whole(constellation), false);
            assert_only(Group::Whole(constellation), true);
        }
    }

    #[test]
    fn of_a_wrong_band_only_the_band_is_excluded() {
        for constellation in [Constellation::Gps, Constellation::Galileo, Constellation::Beidou] {
            for band in [b'1', b'5'] {
                assert_only(Group::Clock(ClockGroup { constellation, band }), true);
            }
        }
    }

    #[test]
    fn two_wrong_constellations_leave_no_choice() {
        let (receiver, mut observations) = sky(false);
        ruin(&mut observations, Group::Whole(Constellation::Gps));
        ruin(&mut observations, Group::Whole(Constellation::Galileo));
        let monitored = solve_with_raim(&mut observations, receiver.position, &RaimOptions::default());
        assert!(matches!(monitored.report.verdict, Verdict::Unreliable(Cause::TestsFailed)));
        assert!(!monitored.report.may_start_filter());
        let excluded = observations.iter().filter(|o| o.usage == Usage::Excluded).count();
        assert_eq!(usize::from(monitored.report.excluded), excluded);
    }

    /// Two constellations contradict each other, and each agrees with itself: which one is wrong remains open.
    #[test]
    fn of_two_constellations_that_agree_with_themselves_none_is_excluded() {
        let (receiver, elsewhere) = (Receiver::in_wuhan(), {
            let in_wuhan = Receiver::in_wuhan();
            Receiver {
                position: in_wuhan.position + crate::frames::EcefVector::new(9e4, 8e4, -7e4),
                ..in_wuhan
            }
        });
        let (_, mut observations) = sky(false);
        observations.retain(|o| o.satellite.constellation != Constellation::Beidou);
        for observation in
            observations.iter_mut().filter(|o| o.satellite.constellation == Constellation::Galileo)
        {
            let range_m = |from: &Receiver| observation.satellite_position.distance_m(from.position);
            observation.pseudorange_m += range_m(&elsewhere) - range_m(&receiver);
        }
        let (mut gps, mut galileo) = (observations.clone(), observations.clone());
        let options = RaimOptions::default();
        let whole = |constellation| Group::Whole(constellation);
        assert!(without(&mut gps, whole(Constellation::Galileo), receiver.position, &options).is_some());
        assert!(without(&mut galileo, whole(Constellation::Gps), receiver.position, &options).is_some());
        assert!(exclude_group(&mut observations, receiver.position, &options).is_none());
        assert!(observations.iter().all(|o| o.usage == Usage::Used));
    }

    #[test]
    fn a_rest_without_redundancy_is_not_believed() {
        let receiver = Receiver::in_wuhan();
        // Eight satellites of GPS and BeiDou alternate with four of Galileo; with six of the eight one is too many for 3 + 2 unknowns.
        let mut observations = receiver.observe(&OPEN_SKY_DEG);
        let of_rest = |o: &CorrectedObservation| o.satellite.constellation != Constellation::Galileo;
        let mut kept = 0;
        observations.retain(|o| {
            !of_rest(o) || {
                kept += 1;
                kept <= 6
            }
        });
        ruin(&mut observations, Group::Whole(Constellation::Galileo));
        assert!(exclude_group(&mut observations, receiver.position, &RaimOptions::default()).is_none());
    }
}
