//! Constraints on the phones of a scenario, as an observer would write them: bounds that the truth keeps.

use crate::constraint::{Constraint, Distance, VerticalVelocity};

use super::Simulation;
use super::mount::Mount;
use super::scenario::PhoneOptions;

/// Step of the bounds between vehicles, m.
const STEP_M: f64 = 0.1;
/// Step of the bound between phones of one vehicle, m.
const CABIN_STEP_M: f64 = 0.5;
/// Minimum margin of the bound between phones of one vehicle, m.
const CABIN_ROOM_M: f64 = 0.5;

impl Simulation {
    /// Constraints that the truth keeps: the distance of every pair.
    ///
    /// Phones of one vehicle have one common upper bound with a margin. Between vehicles the bounds are those of the convoy,
    /// enlarged by the phones' offsets in their vehicles. Motions of phones relative to their vehicles are not considered: the bounds are
    /// those of an observer who does not know of them.
    pub fn distance_constraints(&self) -> Vec<Constraint> {
        let phones = &self.scenario.phones;
        let count = phones.len();
        let pairs = (0..count).flat_map(|first| (first + 1..count).map(move |second| (first, second)));
        let bounded = |(first, second): (usize, usize)| {
            let (minimum_m, maximum_m) = self.bounds_m(phones.get(first)?, phones.get(second)?);
            Some(Constraint::Distance(Distance { phones: [first, second], minimum_m, maximum_m }))
        };
        pairs.filter_map(bounded).collect()
    }

    /// Constraints that the truth keeps: the vertical velocity of every phone.
    pub fn vertical_velocity_constraints(&self) -> Vec<Constraint> {
        let maximum_mps = (self.convoy.maximum_vertical_mps() * 100.0).ceil() / 100.0;
        (0..self.scenario.phones.len())
            .map(|phone| Constraint::VerticalVelocity(VerticalVelocity { phone, maximum_mps }))
            .collect()
    }

    fn bounds_m(&self, a: &PhoneOptions, b: &PhoneOptions) -> (f64, f64) {
        if a.vehicle == b.vehicle {
            return (0.0, self.cabin_m(a.vehicle));
        }
        let (minimum_m, maximum_m) = self.convoy.distance_bounds_m(a.vehicle, b.vehicle);
        let arms_m = [a, b].map(|phone| phone.mount.distance_m(&Mount::default())).iter().sum::<f64>();
        let steps = |length_m: f64| (length_m / STEP_M * 1e6).round() / 1e6;
        let shortest = steps((minimum_m - arms_m).max(0.0)).floor();
        let longest = steps(maximum_m + arms_m).ceil();
        // In this order of operations the decimals are exact.
        (shortest / STEP_M.recip(), longest / STEP_M.recip())
    }

    /// Upper bound of the distances between the phones of a vehicle, m.
    fn cabin_m(&self, vehicle: usize) -> f64 {
        let within: Vec<&PhoneOptions> =
            self.scenario.phones.iter().filter(|phone| phone.vehicle == vehicle).collect();
        let distances = within.iter().flat_map(|a| within.iter().map(|b| a.mount.distance_m(&b.mount)));
        let largest_m = distances.fold(0.0, f64::max);
        ((largest_m + CABIN_ROOM_M) / CABIN_STEP_M).ceil() * CABIN_STEP_M
    }
}
