//! Measurement update of one phone from changes of range, which tie its position to that of the epoch before.
//!
//! The position at the end of an epoch is kept as three more states, a copy with the same errors (stochastic cloning, Roumeliotis and Burdick
//! 2002). A change of range depends on both positions: with u and u' the directions from phone to satellite at this epoch and the one before,
//! δΔρ = −u·δr + u'·δr' + c·Δdt. Nothing is approximated but by linearising, so any interval serves. The kept position is
//! dropped before code and Doppler are applied, since nothing later depends on it.

use super::information::{Information, Measured, Other};
use super::joint::{JointFilter, Kept};
use super::slots::KEPT_STATES;
use super::update::Innovation;
use crate::frames::Ecef;
use crate::measurement::CorrectedObservation;
use crate::time::GpsTime;

/// Minimum number of changes: with fewer the clock takes up all.
const FEWEST: usize = 2;

impl JointFilter {
    /// Updates the phone in `slot` with changes of range since its epoch at `since_gps`. Without a position of that time nothing changes.
    pub(super) fn update_changes(
        &mut self,
        slot: usize,
        observations: &[CorrectedObservation],
        since_gps: GpsTime,
    ) -> (Kept, Innovation) {
        let offered = observations.iter().filter(|observation| observation.range_change.is_some()).count();
        let known = &self.slots[slot];
        if known.kept != Some(since_gps) || offered < FEWEST {
            return (Kept { kept: 0, offered }, Innovation::default());
        }
        let (at, before) = (known.at, known.behind_biases());
        let (now, then) = (self.position_at(at), self.position_at(before));
        let rows: Vec<Measured> = observations.iter().filter_map(|o| change_row(o, now, then)).collect();
        let states: Vec<usize> = (at..at + 3).chain(before..before + KEPT_STATES).collect();
        let information = Information::new(&rows, states.len());
        let innovation = self.apply_unshared(&states, &information);
        (Kept { kept: offered, offered }, innovation)
    }

    /// Keeps the present position of a phone beside its state.
    pub(super) fn keep_position(&mut self, slot: usize) {
        if !self.options.use_changes {
            return;
        }
        self.forget_position(slot);
        let (at, index) = (self.slots[slot].at, self.slots[slot].behind_biases());
        self.slots[slot].kept = Some(self.time_gps());
        for later in self.slots.iter_mut().skip(slot + 1) {
            later.at += KEPT_STATES;
        }
        let n = self.mean.len();
        let places: Vec<usize> = (0..index).chain(at..at + KEPT_STATES).chain(index..n).collect();
        self.mean = self.mean.select_rows(&places);
        self.covariance = self.covariance.select_rows(&places).select_columns(&places);
        if let Some(consider) = &mut self.consider {
            consider.select(&places);
        }
    }

    /// Drops the kept position of a phone.
    pub(super) fn forget_position(&mut self, slot: usize) {
        if self.slots[slot].kept.take().is_none() {
            return;
        }
        let index = self.slots[slot].behind_biases();
        self.remove_states(index, KEPT_STATES);
    }
}

/// Row of one change of range about the positions `now` and `then`.
fn change_row(observation: &CorrectedObservation, now: Ecef, then: Ecef) -> Option<Measured> {
    let change = observation.range_change?;
    let (line, line_before) = (observation.satellite_position - now, change.satellite_before - then);
    Some(Measured {
        h: -line.0.normalize(),
        other: Other::Before(line_before.0.normalize()),
        y: change.change_m - (line.norm() - line_before.norm()),
        weight: change.sigma_m.powi(-2),
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

    use super::*;
    use crate::filter::process::Step;
    use crate::filter::{FilterOptions, Motion, PhoneEpoch, STATES_PER_PHONE, Start};
    use crate::frames::EcefVector;
    use crate::measurement::RangeChange;
    use crate::measurement::sky::{OPEN_SKY_DEG, Receiver};

    /// Codes and changes of range without robust weights, every error white.
    const PLAIN: FilterOptions = FilterOptions {
        use_changes: true,
        process: Motion::Road.process(),
        maximum_gap_s: 60.0,
        ..FilterOptions::peng2023()
    };
    const EPOCHS: usize = 6;
    const CHANGE_SIGMA_M: f64 = 0.02;

    fn at(interval_s: f64, epoch: usize) -> GpsTime {
        GpsTime::from_week_tow(2118, 100.0 + interval_s * epoch as f64)
    }

    /// A number between −1 and 1 that looks random.
    fn scatter(seed: usize) -> f64 {
        ((seed * 7_919) % 1_000) as f64 / 500.0 - 1.0
    }

    /// Observations of an accelerating phone under moving satellites, with errors in code and changes.
    fn drive(interval_s: f64) -> Vec<Vec<CorrectedObservation>> {
        let receiver = Receiver::in_wuhan();
        let sky = receiver.observe(&OPEN_SKY_DEG);
        let phone = |k: usize| {
            let t = interval_s * k as f64;
            Ecef(receiver.position.0 + Vector3::new(8.0, -5.0, 2.0) * t + Vector3::new(0.3, 0.2, 0.0) * t * t)
        };
        let satellite = |i: usize, k: usize| {
            Ecef(sky[i].satellite_position.0 + sky[i].satellite_velocity.0 * (interval_s * k as f64))
        };
        let clock_m = |k: usize| 40.0 * scatter(k + 3);
        let range_m = |i: usize, k: usize| satellite(i, k).distance_m(phone(k)) + clock_m(k);
        let observation = |i: usize, k: usize| CorrectedObservation {
            // One clock group.
            satellite: sky[0].satellite,
            satellite_position: satellite(i, k),
            pseudorange_m: range_m(i, k) + sky[i].pseudorange_sigma_m * scatter(i + 31 * k),
            range_rate: None,
            range_change: k.checked_sub(1).map(|before| RangeChange {
                change_m: range_m(i, k) - range_m(i, before) + CHANGE_SIGMA_M * scatter(i + 17 * k + 5),
                sigma_m: CHANGE_SIGMA_M,
                satellite_before: satellite(i, before),
            }),
            ..sky[i].clone()
        };
        (0..EPOCHS).map(|k| (0..sky.len()).map(|i| observation(i, k)).collect()).collect()
    }

    fn start() -> Start {
        let position = Receiver::in_wuhan().position + EcefVector::new(3.0, -2.0, 4.0);
        Start { position, position_covariance: Matrix3::identity() * 25.0, velocity: None }
    }

    /// The filter after all epochs; the first one only starts it.
    fn filtered(interval_s: f64, epochs: &[Vec<CorrectedObservation>]) -> JointFilter {
        let mut filter = JointFilter::new(PLAIN);
        filter.insert(0, at(interval_s, 0), &start());
        filter.keep_position(0);
        for (k, observations) in epochs.iter().enumerate().skip(1) {
            let time_gps = at(interval_s, k);
            let changes_since_gps = Some(at(interval_s, k - 1));
            let admitted = filter
                .admit(0, &PhoneEpoch { time_gps, observations, changes_since_gps, wls: None, tests: None });
            assert_eq!(admitted.update.unwrap().changes.kept, observations.len());
        }
        filter
    }

    /// Normal equations of all epochs together: nine states an epoch, then a clock for the codes and one for the changes of each epoch.
    struct Batch {
        normal: DMatrix<f64>,
        rhs: DVector<f64>,
    }

    impl Batch {
        fn add(&mut self, row: &[(usize, f64)], y: f64, weight: f64) {
            for (i, hi) in row {
                self.rhs[*i] += weight * hi * y;
                for (j, hj) in row {
                    self.normal[(*i, *j)] += weight * hi * hj;
                }
            }
        }
    }

    /// Least squares over all epochs, linearised at `reference`: what a filter without approximations gives at the last epoch.
    fn batch(
        interval_s: f64,
        epochs: &[Vec<CorrectedObservation>],
        reference: &[DVector<f64>],
    ) -> (DVector<f64>, DMatrix<f64>) {
        let n = STATES_PER_PHONE;
        let unknowns = EPOCHS * (n + 2);
        let mut sums = Batch { normal: DMatrix::zeros(unknowns, unknowns), rhs: DVector::zeros(unknowns) };
        // The start.
        let initial = filtered(interval_s, &epochs[..1]);
        let covariance = initial.covariance.view((0, 0), (n, n)).into_owned();
        let information = covariance.cholesky().unwrap().inverse();
        let off = initial.mean.rows(0, n) - &reference[0];
        let (mut block, mut rhs) = (sums.normal.view_mut((0, 0), (n, n)), sums.rhs.rows_mut(0, n));
        block += &information;
        rhs += &information * off;
        // The motion, in the filter's steps of one second at most.
        let process = PLAIN.process;
        let steps: u8 = if interval_s > 1.0 { 30 } else { 1 };
        let step = Step::new(interval_s / f64::from(steps), &process);
        let up = crate::frames::LocalFrame::at(start().position).up();
        let (mut transition, mut noise) = (DMatrix::identity(n, n), DMatrix::zeros(n, n));
        for _ in 0..steps {
            step.advance_columns(&mut transition, &[0]);
            step.advance_covariance(&mut noise, &[0]);
            step.add_noise(&mut noise, 0, &up, &process);
        }
        let weight = noise.cholesky().unwrap().inverse();
        for k in 1..EPOCHS {
            let mut jacobian = DMatrix::zeros(n, 2 * n);
            jacobian.view_mut((0, 0), (n, n)).copy_from(&-&transition);
            jacobian.view_mut((0, n), (n, n)).fill_with_identity();
            let y = &transition * &reference[k - 1] - &reference[k];
            let mut block = sums.normal.view_mut((n * (k - 1), n * (k - 1)), (2 * n, 2 * n));
            block += jacobian.transpose() * &weight * &jacobian;
            let mut rhs = sums.rhs.rows_mut(n * (k - 1), 2 * n);
            rhs += jacobian.transpose() * &weight * y;
        }
        // The measurements of all epochs but the first, whose codes the start stands for.
        for (k, observations) in epochs.iter().enumerate().skip(1) {
            let (now, then) =
                (Ecef::new(reference[k][0], reference[k][1], reference[k][2]), &reference[k - 1]);
            let then = Ecef::new(then[0], then[1], then[2]);
            for observation in observations {
                let line = observation.satellite_position - now;
                let u = line.0.normalize();
                let mut row: Vec<(usize, f64)> = (0..3).map(|axis| (n * k + axis, -u[axis])).collect();
                row.push((EPOCHS * n + k, 1.0));
                let y = observation.pseudorange_m - line.norm();
                sums.add(&row, y, observation.pseudorange_sigma_m.powi(-2));
                let change = observation.range_change.unwrap();
                let before = change.satellite_before - then;
                let v = before.0.normalize();
                row.truncate(3);
                row.extend((0..3).map(|axis| (n * (k - 1) + axis, v[axis])));
                row.push((EPOCHS * (n + 1) + k, 1.0));
                let y = change.change_m - (line.norm() - before.norm());
                sums.add(&row, y, change.sigma_m.powi(-2));
            }
        }
        for clock in 0..2 * EPOCHS {
            sums.normal[(EPOCHS * n + clock, EPOCHS * n + clock)] += 1e-12;
        }
        let factor = sums.normal.cholesky().unwrap();
        let last = n * (EPOCHS - 1);
        let mean = &reference[EPOCHS - 1] + factor.solve(&sums.rhs).rows(last, n);
        (mean, factor.inverse().view((last, last), (n, n)).into_owned())
    }

    #[test]
    fn the_filter_equals_least_squares_over_all_epochs_at_any_interval() {
        for interval_s in [0.1, 1.0, 30.0] {
            let epochs = drive(interval_s);
            let reference: Vec<DVector<f64>> = (0..EPOCHS)
                .map(|k| {
                    let filter = filtered(interval_s, &epochs[..=k]);
                    filter.mean.rows(0, STATES_PER_PHONE).into_owned()
                })
                .collect();
            let filter = filtered(interval_s, &epochs);
            let (mean, covariance) = batch(interval_s, &epochs, &reference);
            let n = STATES_PER_PHONE;
            let stated = filter.covariance.view((0, 0), (n, n));
            let sigmas = covariance.diagonal().map(f64::sqrt);
            let off = (filter.mean.rows(0, n) - &mean).component_div(&sigmas);
            assert!(off.amax() < 1e-2, "{interval_s} s: {off}");
            let ratio = (stated - &covariance).component_div(&(&sigmas * sigmas.transpose()));
            // The vertical turns a little on the way.
            assert!(ratio.amax() < 5e-3, "{interval_s} s: {ratio}");
            let untied = {
                let mut filter = JointFilter::new(FilterOptions { use_changes: false, ..PLAIN });
                filter.insert(0, at(interval_s, 0), &start());
                for (k, observations) in epochs.iter().enumerate().skip(1) {
                    filter.predict(at(interval_s, k));
                    filter.update(0, observations);
                }
                filter.covariance.view((0, 0), (3, 3)).trace()
            };
            assert!(stated.view((0, 0), (3, 3)).trace() < 0.9 * untied, "changes of range help");
        }
    }

    #[test]
    fn the_row_is_the_derivative_with_respect_to_both_positions() {
        let observation = &drive(10.0)[3][4];
        let (now, then) = (Receiver::in_wuhan().position, Receiver::in_wuhan().position);
        let row = change_row(observation, now, then).unwrap();
        let Other::Before(before) = row.other else { panic!("{:?}", row.other) };
        for axis in 0..3 {
            let mut step = Vector3::zeros();
            step[axis] = 10.0;
            let y = |now: Vector3<f64>, then: Vector3<f64>| {
                change_row(observation, Ecef(now), Ecef(then)).unwrap().y
            };
            // y is observed less computed.
            let by_now = (y(now.0 - step, then.0) - y(now.0 + step, then.0)) / 20.0;
            let by_then = (y(now.0, then.0 - step) - y(now.0, then.0 + step)) / 20.0;
            assert!((by_now - row.h[axis]).abs() < 1e-6 && (by_then - before[axis]).abs() < 1e-6);
        }
    }

    #[test]
    fn changes_since_another_epoch_are_counted_and_change_nothing() {
        let epochs = drive(1.0);
        let after_a_lost_message = |changes_since_gps| {
            let mut filter = filtered(1.0, &epochs[..2]);
            let observations = &epochs[3];
            let epoch =
                PhoneEpoch { time_gps: at(1.0, 3), observations, changes_since_gps, wls: None, tests: None };
            let update = filter.admit(0, &epoch).update.unwrap();
            (filter, update.changes)
        };
        let (unused, changes) = after_a_lost_message(Some(at(1.0, 2)));
        let (without, _) = after_a_lost_message(None);
        assert_eq!((changes.kept, changes.offered), (0, OPEN_SKY_DEG.len()));
        assert_eq!((unused.mean, unused.covariance), (without.mean, without.covariance));
    }

    /// Two phones in one filter are those of two filters, whatever is kept of which.
    #[test]
    fn kept_positions_of_several_phones_do_not_mix() {
        let epochs = drive(1.0);
        let (mut both, mut alone) = (JointFilter::new(PLAIN), JointFilter::new(PLAIN));
        for (k, observations) in epochs.iter().enumerate() {
            let changes_since_gps = k.checked_sub(1).map(|before| at(1.0, before));
            let mut epoch =
                PhoneEpoch { time_gps: at(1.0, k), observations, changes_since_gps, wls: None, tests: None };
            if k == 0 {
                both.insert(1, epoch.time_gps, &start());
                both.keep_position(0);
                both.insert(0, epoch.time_gps, &start());
                alone.insert(0, epoch.time_gps, &start());
                alone.keep_position(0);
            }
            alone.admit(0, &epoch);
            epoch.changes_since_gps = epoch.changes_since_gps.filter(|_| k % 2 == 0);
            both.admit(1, &epoch);
            epoch.changes_since_gps = changes_since_gps;
            both.admit(0, &epoch);
        }
        let (a, b) = (both.state(both.slot(0).unwrap()).unwrap(), alone.state(0).unwrap());
        assert!((a.mean - b.mean).amax() < 1e-6 && (a.covariance - b.covariance).amax() < 1e-9);
        both.remove(0);
        assert!((both.state(0).unwrap().mean - b.mean).amax() < 1e-6);
    }
}
