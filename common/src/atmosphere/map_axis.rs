//! Grid lines of an ionosphere map.

/// Maximum number of grid lines.
const MAX_LINES: f64 = 10_000.0;
/// Rounding tolerance, in steps.
const TOLERANCE: f64 = 1e-6;
/// Minimum latitude of the outermost parallel that is extended to the pole, degrees.
const POLAR_CAP_DEG: f64 = 85.0;

/// Two grid lines with their weights.
pub(crate) type Cell = [(usize, f64); 2];

/// Equidistant grid lines; the step may be negative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    first_deg: f64,
    step_deg: f64,
    count: usize,
}

impl Axis {
    /// An axis from first, last and step, degrees. `None` unless a whole number of steps leads from first to last.
    pub(crate) fn from_degrees([first_deg, last_deg, step_deg]: [f64; 3]) -> Option<Self> {
        let steps = (last_deg - first_deg) / step_deg;
        let whole = (steps - steps.round()).abs() < 1e-3 && (1.0..MAX_LINES).contains(&steps.round());
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // between 1 and the limit
        whole.then(|| Self { first_deg, step_deg, count: steps.round() as usize + 1 })
    }

    /// Number of lines.
    pub(crate) const fn count(&self) -> usize {
        self.count
    }

    fn last_deg(&self) -> f64 {
        self.first_deg + self.step_deg * (self.count - 1) as f64
    }

    /// Whether all lines are between −limit and limit, degrees.
    pub(crate) fn stays_within(&self, limit_deg: f64) -> bool {
        self.first_deg.abs() <= limit_deg && self.last_deg().abs() <= limit_deg + TOLERANCE
    }

    /// The line at a value.
    pub(crate) fn index_of_degrees(&self, value_deg: f64) -> Option<usize> {
        let steps = (value_deg - self.first_deg) / self.step_deg;
        let index = self.index(steps.round())?;
        ((steps - steps.round()).abs() < 1e-3 && index < self.count).then_some(index)
    }

    /// Index of the line at a whole number of steps, if there is one.
    fn index(&self, steps: f64) -> Option<usize> {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // checked
        (0.0..self.count as f64).contains(&steps).then_some(steps as usize)
    }

    /// The lines around a latitude. Beyond the outermost parallels of a map that reaches the polar caps, these are used.
    pub(crate) fn latitude_cell(&self, latitude_deg: f64) -> Option<Cell> {
        let (low, high) = (self.first_deg.min(self.last_deg()), self.first_deg.max(self.last_deg()));
        let low_end = if low <= -POLAR_CAP_DEG { -90.0 } else { low };
        let high_end = if high >= POLAR_CAP_DEG { 90.0 } else { high };
        let within = (low_end - TOLERANCE..=high_end + TOLERANCE).contains(&latitude_deg);
        self.cell((latitude_deg.clamp(low, high) - self.first_deg) / self.step_deg).filter(|_| within)
    }

    /// The lines around a longitude, across the date line too if the map covers all longitudes.
    pub(crate) fn longitude_cell(&self, longitude_deg: f64) -> Option<Cell> {
        let around = 360.0 / self.step_deg.abs();
        let steps = ((longitude_deg - self.first_deg) / self.step_deg).rem_euclid(around);
        let is_closed = (around - around.round()).abs() < TOLERANCE && self.count as f64 + 0.5 > around;
        if !is_closed {
            // Rounding may give a value just before the first line.
            return self.cell(if around - steps < TOLERANCE { 0.0 } else { steps });
        }
        let left = steps.floor();
        let right = if left + 1.0 + TOLERANCE > around { 0.0 } else { left + 1.0 };
        let fraction = steps - left;
        let left = if left + TOLERANCE > around { 0.0 } else { left };
        Some([(self.index(left)?, 1.0 - fraction), (self.index(right)?, fraction)])
    }

    /// The lines around a number of steps from the first.
    fn cell(&self, steps: f64) -> Option<Cell> {
        let last = (self.count - 1) as f64;
        if !(-TOLERANCE..=last + TOLERANCE).contains(&steps) {
            return None;
        }
        let left = self.index(steps.floor().clamp(0.0, last - 1.0))?;
        let fraction = (steps - left as f64).clamp(0.0, 1.0);
        Some([(left, 1.0 - fraction), (left + 1, fraction)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn steps_of_either_sign_lead_from_first_to_last() {
        let down = Axis::from_degrees([87.5, -87.5, -2.5]).unwrap();
        assert_eq!(
            (down.count(), down.index_of_degrees(82.5), down.index_of_degrees(83.0)),
            (71, Some(2), None)
        );
        assert_eq!(Axis::from_degrees([-180.0, 180.0, 5.0]).unwrap().count(), 73);
        for absurd in
            [[0.0, 10.0, -1.0], [0.0, 10.0, 0.0], [0.0, 0.0, 1.0], [0.0, 10.0, 3.0], [0.0, 1e9, 1.0]]
        {
            assert_eq!(Axis::from_degrees(absurd), None, "{absurd:?}");
        }
        assert_eq!(down.index_of_degrees(-90.0), None);
        assert_eq!(down.index_of_degrees(90.0), None);
    }

    proptest! {
        /// For any sign of the step and any first line, the weighted lines equal the longitude modulo a full turn.
        #[test]
        fn cells_around_the_earth_hold_the_longitude(
            longitude_deg in -720.0..720.0_f64,
            first_deg in prop::sample::select(vec![-180.0, 0.0, 2.5, 180.0]),
            step_deg in prop::sample::select(vec![5.0, -5.0, 2.5, 1.0, 7.0, -60.0]),
            is_doubled in any::<bool>(),
        ) {
            let around = 360.0_f64 / f64::abs(step_deg);
            prop_assume!(around.fract() == 0.0);
            let steps = if is_doubled { around } else { around - 1.0 };
            let axis = Axis::from_degrees([first_deg, first_deg + step_deg * steps, step_deg]).unwrap();
            let cell = axis.longitude_cell(longitude_deg).unwrap();
            let (sin, cos) = cell.iter().fold((0.0, 0.0), |sum, (index, weight)| {
                let at = (first_deg + step_deg * *index as f64 - longitude_deg).to_radians();
                (sum.0 + weight * at.sin(), sum.1 + weight * at.cos())
            });
            // The mean direction of the weighted lines is the longitude up to second order of the step.
            prop_assert!(sin.atan2(cos).to_degrees().abs() < 0.01 + (step_deg / 60.0).powi(2) * 10.0);
            prop_assert!((cell[0].1 + cell[1].1 - 1.0).abs() < 1e-12);
            prop_assert!(cell.iter().all(|(index, weight)| *index < axis.count() && (0.0..=1.0).contains(weight)));
        }
    }
}
