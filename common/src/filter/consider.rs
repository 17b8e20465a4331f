//! The second covariance: the filter's gains under a richer model of the errors.
//!
//! Errors of orbits, clocks, group delays and ionosphere last for hours and reach all phones alike. A filter that takes them for white noise
//! believes that they average out. Here they are *considered* (Schmidt 1966): states s that all phones share, with rows of zero in the
//! gain. The estimate is that of the filter; its error e and s follow
//!
//! ```text
//! prediction   e ← Fe + w          s ← Φs + …
//! update       e ← (I − KH)e − K(Gs + v)
//! ```
//!
//! with K of the filter and G the sensitivities of the rows to s. So C = E[esᵀ] and P₂ = E[eeᵀ] are propagated beside the filter's P, in
//! Joseph form, at a cost linear in the number of shared states. The variances of s are those of its stationary Gauss-Markov process and
//! never shrink.

use nalgebra::{DMatrix, DVector, SMatrix, Vector3};
use serde::{Deserialize, Serialize};

use super::information::Measured;
use crate::atmosphere::{Crossing, L1_HZ, Shell, scale_from_l1};
use crate::frames::Direction;
use crate::gnss::SatelliteId;
use crate::measurement::CorrectedObservation;

/// Number of ionospheric states: zenith, gradient to the north, gradient to the east.
const IONOSPHERE_STATES: usize = 3;
/// Distance of an ionospheric pierce point for which the gradient's standard deviation is stated, rad on the Earth's surface (320 km).
const GRADIENT_DISTANCE_RAD: f64 = 0.05;
/// Vertical delay on L1 of the night, m: the constant of the Klobuchar model, 5 ns. Only what exceeds it has gradients.
const NIGHT_DELAY_M: f64 = 1.5;
/// The ionospheric shell.
const SHELL: Shell = Shell::new(6_371e3, 350e3);

/// Errors that all phones share.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SharedErrors {
    /// Smallest standard deviation of a satellite's orbit, clock and group delay together, m.
    pub satellite_sigma_m: f64,
    /// Share of the standard deviation that an observation states for them, where it is larger. What is stated serves the weights and errs
    /// on the safe side.
    pub satellite_share: f64,
    /// Standard deviation of the ionospheric residual at the zenith, as a share of the modelled delay.
    pub ionosphere_share: f64,
    /// Standard deviation of the change of that share towards a pierce point 0.05 rad (320 km) away.
    pub gradient_share: f64,
    /// Time constant of all shared errors, s.
    pub time_constant_s: f64,
}

impl SharedErrors {
    /// No shared errors: the second covariance is the filter's.
    pub const NONE: Self = Self {
        satellite_sigma_m: 0.0,
        satellite_share: 0.0,
        ionosphere_share: 0.0,
        gradient_share: 0.0,
        time_constant_s: 7_200.0,
    };

    /// Whether there are any.
    pub fn are_none(&self) -> bool {
        self.satellite_sigma_m <= 0.0 && self.ionosphere_share <= 0.0 && self.gradient_share <= 0.0
    }
}

/// Innovations of a row, m, up to which it has its full weight (k0σ) and from which on it has none (k1σ); see [`super::RobustWeights`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Pull {
    pub kept_m: f64,
    pub rejected_m: f64,
}

/// Sensitivity of one observation to the shared states.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sensitivity {
    /// Column of the satellite.
    satellite: usize,
    /// Coefficients of the ionospheric states.
    ionosphere: Vector3<f64>,
}

/// A block of rows z = He + Gs + v of a few states.
pub(super) struct Block<'a> {
    /// Offsets of the states.
    pub states: &'a [usize],
    /// L, H = Lᵀ.
    pub root: &'a DMatrix<f64>,
    /// Gain K of the filter, a row for each state of all phones.
    pub gain: &'a DMatrix<f64>,
    /// Covariance of v.
    pub noise: DMatrix<f64>,
    /// G, a column for each shared state; `None` if the rows do not depend on them.
    pub shared: Option<DMatrix<f64>>,
}

/// C and P₂ with the shared states.
#[derive(Clone, Debug)]
pub(super) struct Consider {
    options: SharedErrors,
    /// The satellites with their columns, in the order of satellites.
    sorted: Vec<(SatelliteId, usize)>,
    /// Variances of the shared states.
    variances: Vec<f64>,
    /// Largest pull of each shared state's satellite on a filter with robust weights, m; see [`Consider::faults`].
    pulls: Vec<f64>,
    /// C, a row for each state and a column for each shared state.
    pub cross: DMatrix<f64>,
    /// P₂.
    pub covariance: DMatrix<f64>,
}

/// Least share of an error in its own innovation that counts: below it an error does not show.
const LEAST_LEFT: f64 = 0.01;

impl Consider {
    pub fn new(options: SharedErrors) -> Self {
        let shares = [options.ionosphere_share, options.gradient_share, options.gradient_share];
        Self {
            options,
            sorted: Vec::new(),
            variances: shares.iter().map(|share| share * share).collect(),
            pulls: vec![0.0; IONOSPHERE_STATES],
            cross: DMatrix::zeros(0, IONOSPHERE_STATES),
            covariance: DMatrix::zeros(0, 0),
        }
    }

    /// Number of shared states.
    pub fn shared_states(&self) -> usize {
        self.variances.len()
    }

    /// The sensitivity of an observation; a satellite that is seen first gets a state.
    pub fn sensitivity(&mut self, observation: &CorrectedObservation) -> Sensitivity {
        let stated_m = self.options.satellite_share * observation.shared.stated_sigma_m;
        let sigma_m = stated_m.max(self.options.satellite_sigma_m);
        let known = self.sorted.binary_search_by_key(&observation.satellite, |(satellite, _)| *satellite);
        let satellite = match known {
            Ok(place) => self.sorted[place].1,
            Err(place) => {
                self.sorted.insert(place, (observation.satellite, self.variances.len()));
                self.variances.push(0.0);
                self.pulls.push(0.0);
                self.cross.resize_horizontally_mut(self.variances.len(), 0.0);
                self.variances.len() - 1
            }
        };
        self.variances[satellite] = self.variances[satellite].max(sigma_m * sigma_m);
        Sensitivity { satellite, ionosphere: ionosphere(observation) }
    }

    /// Takes the largest lasting errors that robust weights let pass, after an update with these rows of the code. `states` are the phone's
    /// position and biases.
    ///
    /// An error b of satellite i leaves ρb of it in the satellite's innovation; the rest is absorbed by position, biases and clock. A pseudorange that
    /// is off by v standard deviations pulls like vγ(v) of them, at most k0, and so like an error of k0σ/ρ. An error that is there at once and
    /// above k1σ has no weight.
    pub fn take_pulls(
        &mut self,
        states: &[usize],
        rows: &[Measured],
        sensitive: &[Sensitivity],
        pulls: &[Pull],
    ) {
        let total: f64 = rows.iter().map(|row| row.weight).sum();
        if total <= 0.0 {
            return;
        }
        let mut mean = DVector::zeros(states.len());
        let mut own_share = vec![0.0; self.pulls.len()];
        for (row, sensitivity) in rows.iter().zip(sensitive) {
            row.add_to(&mut mean, row.weight / total);
            own_share[sensitivity.satellite] += row.weight / total;
        }
        let mut centred = DVector::zeros(states.len());
        let mut largest_m = vec![0.0_f64; self.pulls.len()];
        for ((row, sensitivity), pull) in rows.iter().zip(sensitive).zip(pulls) {
            let column = sensitivity.satellite;
            row.centred(&mean, &mut centred);
            // C belongs to the error, true less estimated: the estimate moves the other way.
            let cross = states.iter().map(|state| self.cross[(*state, column)]);
            let absorbed: f64 =
                -centred.iter().zip(cross).map(|(h, c)| h * c).sum::<f64>() / self.variances[column];
            let share = (1.0 - own_share[column] - absorbed).max(LEAST_LEFT);
            largest_m[column] = largest_m[column].max((pull.kept_m / share).min(pull.rejected_m));
        }
        for (known_m, new_m) in self.pulls.iter_mut().zip(largest_m) {
            if new_m > 0.0 {
                *known_m = new_m;
            }
        }
    }

    /// Displacement of three consecutive states by the largest lasting fault of each satellite that robust weights let pass.
    ///
    /// The sensitivity of a state to a lasting error of a satellite is C/Pₛ, and the largest such error that of [`Consider::take_pulls`]. Faults that
    /// grow slowly over all limits are not among them.
    pub fn faults(&self, at: usize) -> impl Iterator<Item = Vector3<f64>> + '_ {
        self.sorted.iter().filter(|(_, column)| self.variances[*column] > 0.0).map(move |(_, column)| {
            let per_metre = self.cross.fixed_view::<3, 1>(at, *column) / self.variances[*column];
            per_metre * self.pulls[*column]
        })
    }

    /// Adds L⁻¹wh̃gᵀ of one observation with the weight w to G; `compressed` is L⁻¹h̃.
    pub fn add_sensitivity(
        shared: &mut DMatrix<f64>,
        weight: f64,
        compressed: &DVector<f64>,
        sensitivity: Sensitivity,
    ) {
        let Sensitivity { satellite, ionosphere } = sensitivity;
        shared.column_mut(satellite).axpy(weight, compressed, 1.0);
        for (column, coefficient) in ionosphere.iter().enumerate() {
            shared.column_mut(column).axpy(weight * *coefficient, compressed, 1.0);
        }
    }

    /// Adds states of a new phone with this covariance.
    pub fn insert(&mut self, offset: usize, covariance: &DMatrix<f64>) {
        let n = covariance.nrows();
        let rows = self.cross.nrows();
        self.cross.resize_vertically_mut(n, 0.0);
        debug_assert!(rows == offset);
        self.covariance.resize_mut(n, n, 0.0);
        let states = n - offset;
        self.covariance
            .view_mut((offset, offset), (states, states))
            .copy_from(&covariance.view((offset, offset), (states, states)));
    }

    /// Adds a state that depends on no shared one; its variance is set elsewhere.
    pub fn insert_row(&mut self, index: usize) {
        let cross = std::mem::replace(&mut self.cross, DMatrix::zeros(0, 0));
        self.cross = cross.insert_row(index, 0.0);
    }

    /// Removes states.
    pub fn remove(&mut self, at: usize, states: usize) {
        let cross = std::mem::replace(&mut self.cross, DMatrix::zeros(0, 0));
        self.cross = cross.remove_rows(at, states);
        let covariance = std::mem::replace(&mut self.covariance, DMatrix::zeros(0, 0));
        self.covariance = covariance.remove_rows(at, states).remove_columns(at, states);
    }

    /// Takes states anew in this order; some may occur twice.
    pub fn select(&mut self, places: &[usize]) {
        self.cross = self.cross.select_rows(places);
        self.covariance = self.covariance.select_rows(places).select_columns(places);
    }

    /// Decorrelates the shared states over a time.
    pub fn age(&mut self, dt_s: f64) {
        self.cross *= (-dt_s / self.options.time_constant_s).exp();
    }

    /// Applies a block of rows.
    pub fn update(&mut self, block: &Block<'_>) {
        let Block { states, root, gain, .. } = *block;
        // D = E[e zᵀ], Y = E[z zᵀ] of z = He + Gs + v, and HC.
        let mut d = self.covariance.select_columns(states) * root;
        let mut output = root.tr_mul(&self.cross.select_rows(states));
        let mut y = block.noise.clone();
        if let Some(shared) = &block.shared {
            add_product(&mut d, 1.0, &self.cross, |shared_state, row| shared[(row, shared_state)]);
            let columns = output.column_iter_mut().zip(shared.column_iter()).zip(&self.variances);
            for ((mut output, shared), variance) in columns {
                output.axpy(*variance, &shared, 1.0);
            }
            add_product(&mut y, 1.0, shared, |shared_state, row| output[(row, shared_state)]);
        }
        y.gemm_tr(1.0, root, &d.select_rows(states), 1.0);
        let y = (&y + y.transpose()) * 0.5;
        // P₂ ← P₂ − KDᵀ − DKᵀ + KYKᵀ = P₂ − KMᵀ − MKᵀ with M = D − ½KY
        add_product(&mut d, -0.5, gain, |row, column| y[(row, column)]);
        add_product(&mut self.covariance, -1.0, gain, |row, state| d[(state, row)]);
        add_product(&mut self.covariance, -1.0, &d, |row, state| gain[(state, row)]);
        self.covariance.fill_upper_triangle_with_lower_triangle();
        // C ← C − K(HC + GPₛ)
        add_product(&mut self.cross, -1.0, gain, |row, column| output[(row, column)]);
    }

    /// Covariance of the errors of states of this filter with those of another, through the shared states: C₁ Pₛ⁻¹ C₂ᵀ for N states each.
    pub fn between<const N: usize>(&self, at: usize, other: &Self, other_at: usize) -> SMatrix<f64, N, N> {
        let mut covariance = SMatrix::<f64, N, N>::zeros();
        let mut add = |column: usize, other_column: usize| {
            let variance = self.variances[column].max(other.variances[other_column]);
            if variance > 0.0 {
                let mine = self.cross.fixed_view::<N, 1>(at, column).into_owned();
                let theirs = other.cross.fixed_view::<N, 1>(other_at, other_column) * variance.recip();
                for (mut sums, factor) in covariance.column_iter_mut().zip(theirs.iter()) {
                    sums += mine * *factor;
                }
            }
        };
        for column in 0..IONOSPHERE_STATES {
            add(column, column);
        }
        let (mut mine, mut theirs) = (self.sorted.iter().peekable(), other.sorted.iter().peekable());
        while let (Some((one, column)), Some((two, other_column))) = (mine.peek(), theirs.peek()) {
            if one == two {
                add(*column, *other_column);
            }
            let order = one.cmp(two);
            mine.next_if(|_| order.is_le());
            theirs.next_if(|_| order.is_ge());
        }
        covariance
    }
}

/// Adds αAB, with B by its elements. For matrices of some ten rows that is faster than a general product, which packs them first.
fn add_product(sum: &mut DMatrix<f64>, alpha: f64, a: &DMatrix<f64>, b: impl Fn(usize, usize) -> f64) {
    let rows = sum.nrows();
    if rows == 0 {
        return;
    }
    for (column, sums) in sum.as_mut_slice().chunks_exact_mut(rows).enumerate() {
        for (inner, factors) in a.as_slice().chunks_exact(rows).enumerate() {
            let factor = alpha * b(inner, column);
            for (sum, element) in sums.iter_mut().zip(factors) {
                *sum += factor * element;
            }
        }
    }
}

/// Coefficients of zenith residual and gradients in the ionospheric error of an observation, m.
fn ionosphere(observation: &CorrectedObservation) -> Vector3<f64> {
    let delay_m = observation.shared.ionosphere_m.abs();
    if delay_m == 0.0 {
        return Vector3::zeros();
    }
    let Direction { azimuth_rad, elevation_rad } = observation.direction;
    let Crossing { centre_rad, zenith_rad } = SHELL.crossing(elevation_rad);
    let mapping = 1.0 / zenith_rad.cos();
    let constellation = observation.satellite.constellation;
    let frequency_hz = observation.signal.frequency_hz(constellation, Some(0)).unwrap_or(L1_HZ);
    let night_m = scale_from_l1(NIGHT_DELAY_M, frequency_hz) * mapping;
    let gradient_m = (delay_m - night_m).max(0.0) * centre_rad / GRADIENT_DISTANCE_RAD;
    let (sin, cos) = azimuth_rad.sin_cos();
    Vector3::new(delay_m.max(night_m), gradient_m * cos, gradient_m * sin)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::{FilterOptions, JointFilter, RobustWeights, STATES_PER_PHONE, Start};
    use crate::frames::EcefVector;
    use crate::measurement::SharedError;
    use crate::measurement::sky::{OPEN_SKY_DEG, Receiver};
    use crate::solve::VelocitySolution;
    use crate::time::GpsTime;

    /// Code with shared errors, without range rates, displaced by 0.7 standard deviations with alternating signs.
    fn observed() -> Vec<CorrectedObservation> {
        let mut observations = Receiver::in_wuhan().observe(&OPEN_SKY_DEG);
        for (index, observation) in observations.iter_mut().enumerate() {
            observation.range_rate = None;
            observation.pseudorange_m += [0.7, -0.7][index % 2] * observation.pseudorange_sigma_m;
            observation.shared = SharedError {
                stated_sigma_m: 0.8,
                satellite_sigma_m: 0.8,
                ionosphere_m: 3.0 + 0.5 * index as f64,
            };
        }
        observations
    }

    const LAST_S: u8 = 20;

    fn at(second: f64) -> GpsTime {
        GpsTime::from_week_tow(2118, second)
    }

    /// A filter without robust weights that was started at 0 s, updated every second up to [`LAST_S`] and predicted one more.
    fn before_an_update(observations: &[CorrectedObservation]) -> JointFilter {
        let robust = RobustWeights { keep: f64::INFINITY, reject: f64::INFINITY };
        let mut filter = JointFilter::new(FilterOptions { robust, ..FilterOptions::default() });
        let identity = nalgebra::Matrix3::identity();
        let at_rest =
            VelocitySolution { velocity: EcefVector::new(0.0, 0.0, 0.0), covariance: identity * 0.01 };
        let (position, position_covariance) = (Receiver::in_wuhan().position, identity);
        filter.insert(0, at(0.0), &Start { position, position_covariance, velocity: Some(at_rest) });
        for second in 1..=LAST_S {
            filter.predict(at(f64::from(second)));
            filter.update(0, observations);
        }
        filter.predict(at(f64::from(LAST_S + 1)));
        filter
    }

    /// Weights and variances of the noise alone of the code rows, as the filter takes them.
    fn model(filter: &JointFilter, observations: &[CorrectedObservation]) -> (DMatrix<f64>, DMatrix<f64>) {
        let options = &filter.options;
        let inflation = options.code_noise.inflation(1.0, false);
        let diagonal = |value: &dyn Fn(&CorrectedObservation) -> f64| {
            DMatrix::from_diagonal(&DVector::from_iterator(
                observations.len(),
                observations.iter().map(|observation| inflation * value(observation)),
            ))
        };
        let lasting = |o: &CorrectedObservation| options.lasting_weight * o.shared.satellite_sigma_m.powi(2);
        let variances = diagonal(&|o| o.noise_variance_m2() + lasting(o));
        (variances.try_inverse().unwrap(), diagonal(&CorrectedObservation::noise_variance_m2))
    }

    /// A filter with the default robust weights, updated for two minutes; from the twentieth second on one pseudorange has an error.
    fn with_a_fault(faulty: usize, error_m: f64) -> JointFilter {
        let still = Receiver { velocity: EcefVector::new(0.0, 0.0, 0.0), ..Receiver::in_wuhan() };
        let clean = still.observe(&OPEN_SKY_DEG);
        let mut wrong = clean.clone();
        wrong[faulty].pseudorange_m += error_m;
        let mut filter = JointFilter::new(FilterOptions::default());
        let (position, position_covariance) =
            (Receiver::in_wuhan().position, nalgebra::Matrix3::identity() * 9.0);
        filter.insert(0, at(0.0), &Start { position, position_covariance, velocity: None });
        for second in 1..=120_u8 {
            filter.predict(at(f64::from(second)));
            filter.update(0, if second < 20 { &clean } else { &wrong });
        }
        filter
    }

    /// Whatever the size of a fault and whichever the satellite, it moves the position by no more than the filter says.
    #[test]
    fn a_lasting_fault_moves_the_position_by_no_more_than_robust_weights_let_pass() {
        for faulty in [0, 4, 9] {
            let clean = with_a_fault(faulty, 0.0);
            let largest_m = clean.faults(0).unwrap().iter().map(Vector3::norm).fold(0.0, f64::max);
            let mut worst_m: f64 = 0.0;
            for error_m in [-2_000.0, -60.0, -15.0, -8.0, 4.0, 8.0, 12.0, 20.0, 40.0, 300.0] {
                let moved = with_a_fault(faulty, error_m).position(0) - clean.position(0);
                worst_m = worst_m.max(moved.norm());
            }
            println!("satellite {faulty}: {worst_m:.2} m, at most {largest_m:.2} m");
            assert!(worst_m < largest_m && worst_m > 0.05 * largest_m, "{worst_m} m, {largest_m} m");
        }
        let plain = FilterOptions {
            robust: RobustWeights { keep: f64::INFINITY, reject: f64::INFINITY },
            ..FilterOptions::default()
        };
        let mut unbounded = JointFilter::new(plain);
        let start = Start {
            position: Receiver::in_wuhan().position,
            position_covariance: nalgebra::Matrix3::identity(),
            velocity: None,
        };
        unbounded.insert(0, at(0.0), &start);
        assert!(unbounded.faults(0).is_none(), "without robust weights nothing bounds a fault");
    }

    /// The second covariance and C after an update against the textbook formula with the full rows, each with one white clock.
    #[test]
    fn the_second_covariance_is_that_of_the_errors_under_the_gain_of_the_filter() {
        let observations = observed();
        let mut filter = before_an_update(&observations);
        let (before, mean) = (filter.consider.clone().unwrap(), filter.mean.clone());
        filter.update(0, &observations);
        let after = filter.consider.clone().unwrap();

        let (rows, states) = (observations.len(), mean.len());
        let mut design = DMatrix::zeros(rows, states);
        let mut shared = DMatrix::zeros(rows, before.shared_states());
        for (row, observation) in observations.iter().enumerate() {
            let line = observation.satellite_position.0 - mean.fixed_rows::<3>(0);
            design.view_mut((row, 0), (1, 3)).copy_from(&(-line.normalize().transpose()));
            if let Some(bias) = filter.slots[0].bias(observation.clock_group()) {
                design[(row, STATES_PER_PHONE + bias)] = 1.0;
            }
            let Sensitivity { satellite, ionosphere } = before.clone().sensitivity(observation);
            shared[(row, satellite)] = 1.0;
            shared.view_mut((row, 0), (1, IONOSPHERE_STATES)).copy_from(&ionosphere.transpose());
        }
        let (weights, noise) = model(&filter, &observations);
        let level = filter.slots[0].noise_level.factor();
        let ones = DMatrix::from_element(rows, 1, 1.0);
        let without_clock =
            DMatrix::identity(rows, rows) - &ones * ones.transpose() * &weights / weights.sum();
        let gain = &filter.covariance * design.transpose() * &weights * without_clock;
        let kept = DMatrix::identity(states, states) - &gain * &design;
        let variances = DMatrix::from_diagonal(&DVector::from_vec(before.variances.clone()));
        let by_shared = &gain * &shared;
        let crossed = &kept * &before.cross * by_shared.transpose();
        let expected = &kept * &before.covariance * kept.transpose() - &crossed - crossed.transpose()
            + &by_shared * &variances * by_shared.transpose()
            + &gain * noise * level * gain.transpose();
        let difference = (&after.covariance - &expected).amax();
        assert!(difference < 1e-6 * expected.amax(), "{difference} m² of {}", expected.amax());
        let cross = &kept * &before.cross - by_shared * variances;
        let difference = (&after.cross - &cross).amax();
        assert!(difference < 1e-6 * cross.amax(), "{difference} of {}", cross.amax());
        assert!((0.3..0.97).contains(&level), "innovations of 0.7 standard deviations: {level}");
    }

    #[test]
    fn what_shared_errors_left_in_a_state_loses_its_correlation_with_them() {
        let observations = observed();
        let mut filter = before_an_update(&observations);
        let time_constant_s = 40.0;
        let consider = filter.consider.as_mut().unwrap();
        consider.options.time_constant_s = time_constant_s;
        consider.cross.rows_mut(3, 6).fill(0.0);
        let before = consider.cross.clone();
        assert!(before.amax() > 0.01);
        filter.predict(at(f64::from(LAST_S + 1) + time_constant_s));
        let after = &filter.consider.as_ref().unwrap().cross;
        assert!((after - before * (-1.0_f64).exp()).amax() < 1e-9);
    }
}
