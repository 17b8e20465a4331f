//! Position and receiver clocks by iterated weighted least squares (Cappello 2023, Eq. 2-3).

use nalgebra::{Cholesky, Matrix3, U3, Vector3};

use super::elimination::{Eliminated, Row};
use super::groups::ClockGroups;
use super::{Dops, PointSolution, VelocitySolution};
use crate::frames::{Ecef, EcefVector, LocalFrame};
use crate::measurement::{CorrectedObservation, Usage};

const MAX_ITERATIONS: u32 = 12;
const CONVERGED_M: f64 = 1e-3;

/// Reason for a missing epoch-wise solution.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SolveError {
    /// Fewer measurements than unknowns.
    #[error("{have} pseudoranges for {need} unknowns")]
    TooFew {
        /// Number of pseudoranges in use.
        have: usize,
        /// Number of unknowns: 3 + one clock per group.
        need: usize,
    },
    /// The geometry of the satellites is singular.
    #[error("the geometry of {have} pseudoranges is singular")]
    Singular {
        /// Number of pseudoranges in use.
        have: usize,
    },
    /// The residuals are absurd ([`RaimReport::may_start_filter`](crate::integrity::RaimReport::may_start_filter)).
    #[error("the pseudoranges contradict each other: residuals {scale:.0} times as large as expected")]
    Contradictory {
        /// Posterior scale √(D/(m − n)).
        scale: f64,
    },
    /// The iteration did not converge.
    #[error("no convergence in {MAX_ITERATIONS} iterations, last step {step_m:.3} m")]
    Diverged {
        /// Length of the last step, m.
        step_m: f64,
    },
}

/// A least-squares fit with the data for its statistics.
#[derive(Clone, Debug)]
pub struct Fit {
    position: Ecef,
    groups: ClockGroups,
    /// One row per observation in use.
    rows: Vec<FitRow>,
    eliminated: Eliminated,
    factor: Cholesky<f64, U3>,
}

#[derive(Clone, Copy, Debug)]
struct FitRow {
    observation: usize,
    row: Row,
    residual_m: f64,
}

/// Solves for the observations marked [`Usage::Used`], starting from `start`; the Earth's centre is a valid start.
///
/// # Errors
/// [`SolveError`] for too few observations, a singular geometry, or an iteration without convergence.
pub fn solve_position(observations: &[CorrectedObservation], start: Ecef) -> Result<Fit, SolveError> {
    let used = || observations.iter().enumerate().filter(|(_, o)| o.usage == Usage::Used);
    let groups = ClockGroups::of(used().map(|(_, o)| o));
    let (have, need) = (used().count(), 3 + groups.len());
    if have < need {
        return Err(SolveError::TooFew { have, need });
    }
    let mut position = start;
    let mut step_m = f64::INFINITY;
    for _ in 0..MAX_ITERATIONS {
        let rows: Vec<Row> = used().map(|(_, o)| code_row(o, position, &groups)).collect();
        let eliminated = Eliminated::new(&rows, groups.len());
        let factor = eliminated.factor().ok_or(SolveError::Singular { have })?;
        let step = factor.solve(&eliminated.rhs);
        step_m = step.norm();
        if !step_m.is_finite() {
            return Err(SolveError::Singular { have });
        }
        position = position + EcefVector(step);
        if step_m < CONVERGED_M {
            let clocks: Vec<f64> = (0..groups.len()).map(|g| eliminated.clock(g, &step)).collect();
            let rows = used()
                .zip(rows)
                .map(|((observation, _), row)| FitRow {
                    observation,
                    row,
                    residual_m: row.y - row.h.dot(&step) - clocks[row.group],
                })
                .collect();
            return Ok(Fit { position, groups: groups.with_clocks(clocks), rows, eliminated, factor });
        }
    }
    Err(SolveError::Diverged { step_m })
}

/// Linearised pseudorange of one observation about `position`: y = P_c − |r_s − r|, h = −u.
pub(crate) fn code_row(observation: &CorrectedObservation, position: Ecef, groups: &ClockGroups) -> Row {
    let line = observation.satellite_position.0 - position.0;
    let range_m = line.norm();
    Row {
        h: line / -range_m,
        group: groups.index(observation.clock_group()),
        y: observation.pseudorange_m - range_m,
        weight: observation.pseudorange_sigma_m.powi(-2),
    }
}

impl Fit {
    /// Position, m.
    pub const fn position(&self) -> Ecef {
        self.position
    }

    /// Covariance of the position in ECEF by the stochastic model, m².
    pub fn position_covariance(&self) -> Matrix3<f64> {
        self.factor.inverse()
    }

    /// Number of measurements less number of unknowns, m − n.
    pub fn degrees_of_freedom(&self) -> usize {
        self.rows.len() - 3 - self.groups.len()
    }

    /// D = rᵀWr.
    pub fn weighted_square_sum(&self) -> f64 {
        self.rows.iter().map(|r| r.residual_m * r.residual_m * r.row.weight).sum()
    }

    /// Number of measurements.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there are no measurements.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Index of the `i`-th measurement in the solved observations.
    pub fn observation(&self, i: usize) -> usize {
        self.rows[i].observation
    }

    /// Residual of the `i`-th measurement, m.
    pub fn residual_m(&self, i: usize) -> f64 {
        self.rows[i].residual_m
    }

    /// Element (i, j) of the covariance of the residuals, C_v = W⁻¹ − H(HᵀWH)⁻¹Hᵀ, m², clocks included in H.
    pub fn residual_covariance(&self, i: usize, j: usize) -> f64 {
        let (a, b) = (&self.rows[i].row, &self.rows[j].row);
        let solved = self.factor.solve(&self.eliminated.centred(b));
        let position_part = self.eliminated.centred(a).dot(&solved);
        let clock_part = if a.group == b.group { 1.0 / self.eliminated.group_weight(a.group) } else { 0.0 };
        let noise = if i == j { 1.0 / a.weight } else { 0.0 };
        noise - position_part - clock_part
    }

    /// Displacement of the position by an error of 1 m of the `i`-th measurement, ECEF.
    pub fn effect_of(&self, i: usize) -> EcefVector {
        let row = &self.rows[i].row;
        EcefVector(self.factor.solve(&self.eliminated.centred(row)) * row.weight)
    }

    /// The measurements about the solution, with the index of each in the solved observations: y is the residual.
    pub(crate) fn rows(&self) -> impl Iterator<Item = (usize, Row)> + '_ {
        self.rows.iter().map(|r| (r.observation, Row { y: r.residual_m, ..r.row }))
    }

    /// Number of receiver clocks.
    pub(crate) fn groups(&self) -> usize {
        self.groups.len()
    }

    /// Weight 1/σ² of the `i`-th measurement, 1/m².
    pub fn weight(&self, i: usize) -> f64 {
        self.rows[i].row.weight
    }

    /// Residual of any observation against this fit, m; `None` if its clock was not estimated.
    pub fn residual_of(&self, observation: &CorrectedObservation) -> Option<f64> {
        let clock = self.groups.clock_m(observation.clock_group())?;
        let range_m = observation.satellite_position.distance_m(self.position);
        Some(observation.pseudorange_m - range_m - clock)
    }

    /// Dilution of precision with one clock per group; `None` if the unweighted geometry is singular.
    pub fn dops(&self) -> Option<Dops> {
        let unweighted: Vec<Row> = self.rows.iter().map(|r| Row { weight: 1.0, y: 0.0, ..r.row }).collect();
        let eliminated = Eliminated::new(&unweighted, self.groups.len());
        let factor = eliminated.factor()?;
        let covariance = LocalFrame::at(self.position).covariance_ecef_to_enu(&factor.inverse());
        let horizontal = covariance.m11 + covariance.m22;
        let clocks: f64 = (0..self.groups.len())
            .map(|g| {
                let mean = eliminated.mean(g);
                1.0 / eliminated.group_weight(g) + mean.dot(&factor.solve(&mean))
            })
            .sum();
        Some(Dops {
            gdop: (covariance.trace() + clocks).sqrt(),
            pdop: covariance.trace().sqrt(),
            hdop: horizontal.sqrt(),
            vdop: covariance.m33.sqrt(),
        })
    }

    /// The solution for publication; `None` if the dilution of precision cannot be computed.
    pub fn to_solution(&self, velocity: Option<VelocitySolution>) -> Option<PointSolution> {
        Some(PointSolution {
            position: self.position,
            position_covariance: self.position_covariance(),
            clocks_m: self.groups.iter().collect(),
            velocity,
            dops: self.dops()?,
            used: u16::try_from(self.rows.len()).unwrap_or(u16::MAX),
        })
    }
}

/// Unit vector from `position` to the satellite of an observation.
pub(crate) fn line_of_sight(observation: &CorrectedObservation, position: Ecef) -> Vector3<f64> {
    (observation.satellite_position.0 - position.0).normalize()
}

#[cfg(test)]
#[path = "../../tests/beside/mod.rs"]
mod beside;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::sky::{OPEN_SKY_DEG, Receiver};

    #[test]
    fn the_true_position_comes_back_from_the_centre_of_the_earth() {
        let receiver = Receiver::in_wuhan();
        let observations = receiver.observe(&OPEN_SKY_DEG);
        let fit = solve_position(&observations, Ecef::new(0.0, 0.0, 0.0)).unwrap();
        assert!(fit.position().distance_m(receiver.position) < 1e-4);
        assert_eq!(fit.degrees_of_freedom(), 12 - 6);
        assert!(fit.weighted_square_sum() < 1e-8);
        for (observation, clock) in observations.iter().zip(receiver.clocks_m) {
            assert!((fit.groups.clock_m(observation.clock_group()).unwrap() - clock).abs() < 1e-4);
        }
    }

    #[test]
    fn the_row_is_the_derivative_of_the_range() {
        let receiver = Receiver::in_wuhan();
        let observations = receiver.observe(&OPEN_SKY_DEG);
        let groups = ClockGroups::of(observations.iter());
        for observation in &observations {
            let row = code_row(observation, receiver.position, &groups);
            for axis in 0..3 {
                let mut step = Vector3::zeros();
                step[axis] = 10.0;
                let at = |s: Vector3<f64>| {
                    observation.satellite_position.distance_m(receiver.position + EcefVector(s))
                };
                let numeric = (at(step) - at(-step)) / 20.0;
                assert!((numeric - row.h[axis]).abs() < 1e-8, "{}", observation.satellite);
            }
        }
    }

    #[test]
    fn residual_covariance_equals_the_dense_formula() {
        let receiver = Receiver::in_wuhan();
        let observations = receiver.observe(&OPEN_SKY_DEG);
        let fit = solve_position(&observations, receiver.position).unwrap();
        let m = fit.len();
        let design = nalgebra::DMatrix::from_fn(m, 6, |i, j| match j {
            0..=2 => fit.rows[i].row.h[j],
            _ => f64::from(u8::from(fit.rows[i].row.group == j - 3)),
        });
        let weights = nalgebra::DMatrix::from_fn(m, m, |i, j| if i == j { fit.weight(i) } else { 0.0 });
        let normal = design.transpose() * &weights * &design;
        let dense =
            weights.try_inverse().unwrap() - &design * normal.cholesky().unwrap().solve(&design.transpose());
        for i in 0..m {
            for j in 0..m {
                assert!((fit.residual_covariance(i, j) - dense[(i, j)]).abs() < 1e-9, "{i} {j}");
            }
        }
    }

    #[test]
    fn too_few_and_flat_geometries_are_named() {
        let receiver = Receiver::in_wuhan();
        let few = receiver.observe(&OPEN_SKY_DEG[..5]);
        let error = solve_position(&few, receiver.position).unwrap_err();
        assert_eq!(error, SolveError::TooFew { have: 5, need: 6 });
        let mut same = receiver.observe(&[(10.0, 40.0); 8]);
        for observation in &mut same {
            observation.satellite.constellation = crate::gnss::Constellation::Gps;
        }
        assert!(matches!(solve_position(&same, receiver.position), Err(SolveError::Singular { have: 8 })));
    }

    #[test]
    #[ignore = "needs the reference data"]
    fn dops_agree_with_the_reference() {
        let table = String::from_utf8(beside::required("oracle/dops.csv")).unwrap();
        let mut compared = 0;
        for line in table.lines().skip(1) {
            let fields: Vec<&str> = line.split(',').collect();
            let number = |i: usize| fields[i].parse::<f64>().unwrap();
            let pairs: Vec<f64> = fields[6].split(';').map(|v| v.parse().unwrap()).collect();
            let mask_deg = number(0);
            let directions: Vec<(f64, f64)> = pairs
                .chunks_exact(2)
                .map(|p| (p[0], p[1]))
                .filter(|(_, elevation_deg)| *elevation_deg >= mask_deg)
                .collect();
            if number(2) <= 0.0 {
                continue;
            }
            let receiver = Receiver { clocks_m: [150.0; 3], ..Receiver::in_wuhan() };
            let mut sky = receiver.observe(&directions);
            for observation in &mut sky {
                observation.satellite.constellation = crate::gnss::Constellation::Gps;
            }
            let dops = solve_position(&sky, receiver.position).unwrap().dops().unwrap();
            let pairs = [(dops.gdop, 2), (dops.pdop, 3), (dops.hdop, 4), (dops.vdop, 5)];
            for (ours, field) in pairs {
                let reference = number(field);
                assert!((ours - reference).abs() <= 1e-6 * reference, "{line}: {ours} {reference}");
            }
            compared += 1;
        }
        assert!(compared > 70, "{compared} rows compared");
    }
}
