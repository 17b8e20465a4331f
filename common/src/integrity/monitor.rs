//! One epoch: solution, exclusion, verdict, protection levels.

use super::checks::{count_excluded, geometry_verdict, global_test, mark, test_of, usages};
use super::group_exclusion::exclude_group;
use super::options::{AlarmLimits, Method, RaimOptions};
use super::protection::{separation_levels, slope_levels};
use super::{Cause, ProtectionLevels, RaimReport, TestReport, Verdict, forward_backward, subset};
use crate::frames::Ecef;
use crate::measurement::CorrectedObservation;
use crate::solve::{Fit, RateFit, SolveError, solve_position};

/// A solution with its RAIM report; without a solution the verdict is [`Verdict::CannotBeChecked`].
#[derive(Debug)]
pub struct Monitored {
    /// Solution after exclusion.
    pub fit: Result<Fit, SolveError>,
    /// Verdict on the solution.
    pub report: RaimReport,
}

/// Solves and tests, with exclusions by the method of the options, and protection levels of what is left. Excluded observations are marked in
/// place.
///
/// The geometry is checked before and after: if it is beyond its limits, nothing is excluded. If absurd residuals remain after the exclusions,
/// one whole clock group or constellation is excluded instead, if exactly one such exclusion succeeds.
///
/// Groups are not excluded for smaller residuals. In a city several satellites of the largest constellation are reflected, and the rest alone
/// passes by its lack of redundancy: in 61 such epochs of recordings the mean horizontal error grew from 14 to 20 m.
pub fn solve_with_raim(
    observations: &mut [CorrectedObservation],
    start: Ecef,
    options: &RaimOptions,
) -> Monitored {
    let offered = usages(observations);
    let mut monitored = monitor(observations, start, options);
    if options.exclude_groups && options.method != Method::None && !monitored.report.may_start_filter() {
        let by_singles = usages(observations);
        mark(observations, &offered);
        match exclude_group(observations, start, options) {
            Some(by_group) => monitored = by_group,
            None => mark(observations, &by_singles),
        }
    }
    protect(observations, &mut monitored, options);
    monitored
}

/// Solves and tests, with exclusions of single measurements.
fn monitor(observations: &mut [CorrectedObservation], start: Ecef, options: &RaimOptions) -> Monitored {
    let fit = match solve_position(observations, start) {
        Ok(fit) => fit,
        Err(error) => return Monitored { fit: Err(error), report: RaimReport::of(Verdict::CannotBeChecked) },
    };
    let (fit, verdict) = judge(observations, fit, options);
    let report = RaimReport {
        global_test: global_test(&fit, options),
        excluded: count_excluded(observations),
        ..RaimReport::of(verdict)
    };
    Monitored { fit: Ok(fit), report }
}

fn judge(observations: &mut [CorrectedObservation], fit: Fit, options: &RaimOptions) -> (Fit, Verdict) {
    let Some(test) = global_test(&fit, options) else { return (fit, Verdict::CannotBeChecked) };
    let by_geometry = |fit: Fit| {
        let verdict = geometry_verdict(fit.dops(), options.dop_limits);
        (fit, verdict)
    };
    if test.passes() {
        return by_geometry(fit);
    }
    if test.degrees_of_freedom < 2 {
        return (fit, Verdict::Unreliable(Cause::InsufficientRedundancy));
    }
    if geometry_verdict(fit.dops(), options.dop_limits) != Verdict::Reliable {
        return (fit, Verdict::Unreliable(Cause::Geometry));
    }
    let (fit, verdict) = match options.method {
        Method::ForwardBackward => forward_backward::exclude(observations, fit, options),
        Method::Subset => subset::exclude(observations, fit, options),
        Method::None => (fit, Verdict::Unreliable(Cause::TestsFailed)),
    };
    if verdict == Verdict::Reliable { by_geometry(fit) } else { (fit, verdict) }
}

/// Adds the protection levels, and holds a reliable solution against the alarm limits.
fn protect(observations: &[CorrectedObservation], monitored: &mut Monitored, options: &RaimOptions) {
    let Ok(fit) = &monitored.fit else { return };
    let report = &mut monitored.report;
    report.protection = separation_levels(observations, fit, &options.protection);
    report.slope = slope_levels(fit, options);
    if report.verdict == Verdict::Reliable && exceeds(report.protection, options.alarm_limits) {
        report.verdict = Verdict::Unreliable(Cause::AlarmLimit);
    }
}

/// Whether levels are beyond limits. Levels that cannot be computed are beyond any limit.
pub(crate) fn exceeds(levels: Option<ProtectionLevels>, limits: AlarmLimits) -> bool {
    levels.map_or_else(
        || limits != AlarmLimits::NONE,
        |levels| levels.horizontal_m > limits.horizontal_m || levels.vertical_m > limits.vertical_m,
    )
}

/// Verdict on a velocity by the global test of its range rates: reliable; unreliable if the range rates in use contradict each other, or if more
/// had to go than redundant ones are left; or not to be checked.
pub fn velocity_report(fit: &RateFit, options: &RaimOptions) -> TestReport {
    let dof = fit.degrees_of_freedom;
    let global_test = test_of(fit.weighted_square_sum, dof, options);
    let verdict = match global_test {
        None => Verdict::CannotBeChecked,
        Some(test) if test.passes() && fit.excluded <= dof => Verdict::Reliable,
        Some(_) => Verdict::Unreliable(Cause::TestsFailed),
    };
    TestReport { verdict, global_test, excluded: u16::try_from(fit.excluded).unwrap_or(u16::MAX) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::Usage;
    use crate::measurement::sky::{OPEN_SKY_DEG, Receiver};

    fn monitor(observations: &mut [CorrectedObservation]) -> Monitored {
        solve_with_raim(observations, Receiver::in_wuhan().position, &RaimOptions::default())
    }

    #[test]
    fn a_clean_sky_is_reliable() {
        let mut observations = Receiver::in_wuhan().observe(&OPEN_SKY_DEG);
        let monitored = monitor(&mut observations);
        assert_eq!(monitored.report.verdict, Verdict::Reliable);
        assert_eq!(monitored.report.global_test.unwrap().degrees_of_freedom, 6);
        assert!(observations.iter().all(|o| o.usage == Usage::Used));
    }

    #[test]
    fn one_fault_is_found_and_excluded() {
        let receiver = Receiver::in_wuhan();
        for faulty in 0..OPEN_SKY_DEG.len() {
            let mut observations = receiver.observe(&OPEN_SKY_DEG);
            observations[faulty].pseudorange_m += 60.0;
            let monitored = monitor(&mut observations);
            assert_eq!(monitored.report.verdict, Verdict::Reliable, "satellite {faulty}");
            assert_eq!(monitored.report.excluded, 1, "satellite {faulty}");
            assert_eq!(observations[faulty].usage, Usage::Excluded);
            assert!(monitored.fit.unwrap().position().distance_m(receiver.position) < 1e-3);
        }
    }

    const SIGNS: [f64; 12] = [1.0, 1.0, 1.0, -1.0, -1.0, 1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0];

    /// All residuals pass the local test although the global test fails, so no single measurement is at fault.
    #[test]
    fn spread_out_errors_are_not_blamed_on_one_measurement() {
        let receiver = Receiver::in_wuhan();
        let disturbed = |scale: f64| {
            let mut observations = receiver.observe(&OPEN_SKY_DEG);
            for (observation, sign) in observations.iter_mut().zip(SIGNS) {
                observation.pseudorange_m += scale * sign * observation.pseudorange_sigma_m;
            }
            observations
        };
        let largest = |observations: &[CorrectedObservation]| {
            let fit = solve_position(observations, receiver.position).unwrap();
            let normalised = |i: usize| fit.residual_m(i).abs() / fit.residual_covariance(i, i).sqrt();
            (0..fit.len()).map(normalised).fold(0.0, f64::max)
        };
        // Residuals are linear in the errors: this scale brings the largest just below the local threshold of 3.29.
        let mut observations = disturbed(3.28 / largest(&disturbed(1.0)));
        assert!(largest(&observations) < 3.29);
        let monitored = monitor(&mut observations);
        let test = monitored.report.global_test.unwrap();
        assert!(test.statistic > test.threshold, "{test:?}");
        assert_eq!(monitored.report.verdict, Verdict::Unreliable(Cause::TestsFailed));
        assert_eq!(monitored.report.excluded, 0);
    }

    #[test]
    fn two_that_cannot_be_told_apart_are_both_kept() {
        // Two satellites of one constellation share a clock, so their residuals are equal with opposite sign.
        let mut sky = OPEN_SKY_DEG[..9].to_vec();
        sky.extend([(100.0, 30.0), (250.0, 40.0)]);
        let receiver = Receiver { clocks_m: [150.0; 3], ..Receiver::in_wuhan() };
        let mut observations = receiver.observe(&sky);
        for (i, observation) in observations.iter_mut().enumerate() {
            observation.satellite.constellation =
                if i < 9 { crate::gnss::Constellation::Gps } else { crate::gnss::Constellation::Beidou };
        }
        observations[9].pseudorange_m += 60.0;
        let report = monitor(&mut observations).report;
        assert_eq!(report.verdict, Verdict::Unreliable(Cause::Inseparable));
        assert_eq!(report.excluded, 0);
    }

    #[test]
    fn without_redundancy_nothing_is_checked_or_excluded() {
        let receiver = Receiver::in_wuhan();
        let mut six = receiver.observe(&OPEN_SKY_DEG[..6]);
        six[0].pseudorange_m += 60.0;
        assert_eq!(monitor(&mut six).report.verdict, Verdict::CannotBeChecked);
        let mut seven = receiver.observe(&OPEN_SKY_DEG[..7]);
        seven[0].pseudorange_m += 200.0;
        let report = monitor(&mut seven).report;
        assert_eq!(report.verdict, Verdict::Unreliable(Cause::InsufficientRedundancy));
        assert_eq!(report.excluded, 0);
    }

    #[test]
    fn bad_geometry_is_named() {
        let mut low: Vec<(f64, f64)> =
            (0..8).map(|i| (f64::from(i) * 1.0, 30.0 + f64::from(i % 3))).collect();
        low.push((40.0, 33.0));
        let mut observations = Receiver::in_wuhan().observe(&low);
        let report = monitor(&mut observations).report;
        assert_eq!(report.verdict, Verdict::Unreliable(Cause::Geometry));
    }

    #[test]
    fn five_satellites_give_no_solution() {
        let mut observations = Receiver::in_wuhan().observe(&OPEN_SKY_DEG[..5]);
        let monitored = monitor(&mut observations);
        assert!(monitored.fit.is_err());
        assert_eq!(monitored.report.verdict, Verdict::CannotBeChecked);
    }

    /// The sky twice, from two azimuths, with Gaussian errors of the stated standard deviations.
    fn noisy_sky(random: &mut impl rand::Rng) -> Vec<CorrectedObservation> {
        let receiver = Receiver::in_wuhan();
        let mut observations = receiver.observe(&OPEN_SKY_DEG);
        observations.extend(receiver.observe(&OPEN_SKY_DEG.map(|(azimuth, up)| (azimuth + 25.0, up + 3.0))));
        for observation in &mut observations {
            let normal: f64 = random.sample(rand_distr::StandardNormal);
            observation.pseudorange_m += observation.pseudorange_sigma_m * normal;
        }
        observations
    }

    #[test]
    fn in_a_thousand_epochs_without_faults_one_is_suspected() {
        let mut random = <rand_chacha::ChaCha8Rng as rand::SeedableRng>::seed_from_u64(1);
        let suspects = |observations: &mut [CorrectedObservation]| {
            let report = monitor(observations).report;
            report.excluded > 0 || report.verdict != Verdict::Reliable
        };
        let suspected = (0..10_000).filter(|_| suspects(&mut noisy_sky(&mut random))).count();
        assert!((2..25).contains(&suspected), "{suspected} of 10,000");
    }

    #[test]
    fn six_faults_among_24_signals_are_all_excluded() {
        let mut random = <rand_chacha::ChaCha8Rng as rand::SeedableRng>::seed_from_u64(2);
        let mut observations = noisy_sky(&mut random);
        let faults = [(1, 90.0), (5, -70.0), (9, 120.0), (14, 60.0), (19, -150.0), (22, 80.0)];
        for (index, error_m) in faults {
            observations[index].pseudorange_m += error_m;
        }
        assert_eq!(monitor(&mut observations).report.verdict, Verdict::Reliable);
        let excluded: Vec<usize> =
            (0..observations.len()).filter(|i| observations[*i].usage == Usage::Excluded).collect();
        assert_eq!(excluded, faults.map(|(index, _)| index));
    }

    /// Satellites all around within 1.5° of one elevation: their ranges do not tell the height from the clock.
    #[test]
    fn a_position_without_height_is_not_reliable() {
        let ring: Vec<(f64, f64)> = (0..12_u8)
            .map(|i| (30.0 * f64::from(i), 20.0 + 0.73 * [1.0, -1.0][usize::from(i % 2)]))
            .collect();
        let mut observations = Receiver { clocks_m: [150.0; 3], ..Receiver::in_wuhan() }.observe(&ring);
        for observation in &mut observations {
            observation.satellite.constellation = crate::gnss::Constellation::Gps;
        }
        let monitored = monitor(&mut observations);
        let dops = monitored.fit.unwrap().dops().unwrap();
        let limits = RaimOptions::default().dop_limits;
        assert!(dops.pdop < limits.pdop && dops.hdop < limits.hdop && dops.vdop > limits.vdop, "{dops:?}");
        assert_eq!(monitored.report.verdict, Verdict::Unreliable(Cause::Geometry));
    }
}
