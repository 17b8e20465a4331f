//! Vehicles that follow each other on the road, and bounds on their distances.
//!
//! Vehicle n moves as the lead vehicle did n·τ earlier, n·d further back (Newell's car-following law), so the gap
//! along the road lies between d (standing) and d + τ·v. Each follower's gap also varies smoothly along the road, by
//! at most A, and each vehicle moves sideways in its lane by at most O. Standing vehicles stand still. A phone is fixed
//! in its vehicle, which points along the road.

use std::f64::consts::TAU;

use nalgebra::Vector3;

use super::mount::Mount;
use super::profile::SpeedProfile;
use super::road::{Road, RoadPoint};
use super::street::RoadPlace;
use crate::frames::{Ecef, EcefVector, Enu, Geodetic, LocalFrame};

/// Length of one period of the gap variation along the road, m.
const VARIATION_PERIOD_M: f64 = 430.0;
/// Mean Earth radius, for the drop of the horizon below the tangent plane, m.
const EARTH_RADIUS_M: f64 = 6_371_000.0;

/// Minimum bound of a vertical velocity, m/s.
const LEAST_VERTICAL_MPS: f64 = 0.05;

/// Motion of the vehicles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Traffic {
    /// Driving through a town, with stops.
    #[default]
    Town,
    /// Standing.
    Standing,
}

/// Motion and distances of the vehicles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConvoyOptions {
    /// Motion of the vehicles.
    pub traffic: Traffic,
    /// Distance between phones of adjacent standing vehicles (d), m.
    pub standstill_gap_m: f64,
    /// Time gap (τ), s.
    pub headway_s: f64,
    /// Maximum variation of a follower's gap (A), m.
    pub gap_variation_m: f64,
    /// Maximum sideways offset from the lane's centre (O), m.
    pub lateral_m: f64,
}

impl Default for ConvoyOptions {
    /// Gaps of about 16 m at a light and 26 m at 14 m/s.
    fn default() -> Self {
        Self {
            traffic: Traffic::Town,
            standstill_gap_m: 16.0,
            headway_s: 0.7,
            gap_variation_m: 1.0,
            lateral_m: 0.4,
        }
    }
}

/// State of a vehicle or of a phone in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VehicleState {
    /// Position, m.
    pub position: Ecef,
    /// Velocity, m/s.
    pub velocity: EcefVector,
    /// Place on the road.
    pub(super) place: RoadPlace,
}

/// The convoy: vehicle 0 leads.
#[derive(Clone, Debug)]
pub struct Convoy {
    road: Road,
    profile: SpeedProfile,
    options: ConvoyOptions,
    frame: LocalFrame,
}

impl Convoy {
    /// A convoy on the standard road around `origin`.
    pub fn new(origin: Geodetic, options: ConvoyOptions) -> Self {
        let frame = LocalFrame::at(origin.geodetic_to_ecef());
        let profile = match options.traffic {
            Traffic::Town => SpeedProfile::town(),
            Traffic::Standing => SpeedProfile::standing(),
        };
        Self { road: Road::circuit(), profile, options, frame }
    }

    /// The road.
    pub const fn road(&self) -> &Road {
        &self.road
    }

    /// The local frame at the scenario's origin.
    pub const fn frame(&self) -> &LocalFrame {
        &self.frame
    }

    /// State of vehicle `vehicle` at `time_s` since the start.
    pub fn state(&self, vehicle: usize, time_s: f64) -> VehicleState {
        self.phone_state(vehicle, &Mount::default(), time_s)
    }

    /// State of a phone in vehicle `vehicle` at `time_s` since the start.
    pub fn phone_state(&self, vehicle: usize, mount: &Mount, time_s: f64) -> VehicleState {
        let (road_m, road_mps) = self.along(vehicle, time_s);
        let point = self.road.at(road_m);
        let wave_number = TAU * (23.0 + vehicle as f64) / self.road.lap_m();
        let (sin, cos) = (wave_number * road_m + vehicle as f64).sin_cos();
        let lateral_m = self.options.lateral_m;
        let beside = Beside {
            forward_m: mount.forward_m,
            right_m: lateral_m * sin + mount.right_m,
            right_rate: lateral_m * wave_number * cos,
            up_m: mount.up_m,
        };
        let (place, per_metre) = beside.place(&point);
        VehicleState {
            position: self.frame.enu_to_ecef(place),
            velocity: self.frame.vector_enu_to_ecef((per_metre.vector() * road_mps).into()),
            place: RoadPlace {
                road_m: road_m + mount.forward_m,
                lap_m: self.road.lap_m(),
                heading_rad: point.heading_rad,
                turn_radps: point.curvature_1pm * road_mps,
                right_m: beside.right_m,
                right_mps: beside.right_rate * road_mps,
            },
        }
    }

    /// A state displaced by `displacement_m` (east, north, up from the curved Earth), with the additional velocity `velocity_mps`. The place on
    /// the road, by which houses are seen, stays that of the vehicle.
    pub(super) fn displaced(
        &self,
        state: VehicleState,
        displacement_m: Vector3<f64>,
        velocity_mps: Vector3<f64>,
    ) -> VehicleState {
        let before = self.frame.ecef_to_enu(state.position).vector();
        let rate_before = self.frame.vector_ecef_to_enu(state.velocity).vector();
        let (drop_before_m, drop_before_mps) = drop_of_horizon(before, rate_before);
        let (drop_m, drop_mps) = drop_of_horizon(before + displacement_m, rate_before + velocity_mps);
        let displacement = displacement_m - Vector3::z() * (drop_m - drop_before_m);
        let velocity = velocity_mps - Vector3::z() * (drop_mps - drop_before_mps);
        let in_ecef = |vector: Vector3<f64>| self.frame.vector_enu_to_ecef(vector.into()).0;
        VehicleState {
            position: Ecef(state.position.0 + in_ecef(displacement)),
            velocity: EcefVector(state.velocity.0 + in_ecef(velocity)),
            ..state
        }
    }

    /// Maximum speed along the lane's centre, m/s.
    pub fn maximum_speed_mps(&self) -> f64 {
        self.profile.maximum_speed_mps() * (1.0 + self.options.gap_variation_m * TAU / VARIATION_PERIOD_M)
    }

    /// Maximum |vertical velocity| of the vehicle, m/s.
    pub fn maximum_vertical_mps(&self) -> f64 {
        (self.maximum_speed_mps() * (self.road.maximum_slope() + 1e-3)).max(LEAST_VERTICAL_MPS)
    }

    /// Lower and upper bound (m) of the distance of two vehicles at every common instant.
    ///
    /// With g the gap along the road and R the smallest radius, the chord of the centre line is at least
    /// 2R·sin(g/2R) (Schur's comparison) and at most g; sideways offsets add at most 2·O, the slope at most its
    /// secant.
    pub fn distance_bounds_m(&self, a: usize, b: usize) -> (f64, f64) {
        let ranks = a.abs_diff(b) as f64;
        if ranks == 0.0 {
            return (0.0, 0.0);
        }
        let ConvoyOptions { standstill_gap_m, headway_s, gap_variation_m, lateral_m, .. } = self.options;
        let varying = if a.min(b) == 0 { 1.0 } else { 2.0 } * gap_variation_m;
        let lower = (ranks * standstill_gap_m - varying).max(0.0);
        let upper = ranks * (standstill_gap_m + headway_s * self.profile.maximum_speed_mps()) + varying;
        let radius = self.road.minimum_radius_m();
        let chord = 2.0 * radius * (lower / (2.0 * radius)).min(TAU / 4.0).sin();
        let minimum = (chord - 2.0 * lateral_m).max(0.0);
        (minimum, upper.hypot(upper * self.road.maximum_slope()) + 2.0 * lateral_m)
    }

    /// Distance along the road (m) and its rate (m/s).
    fn along(&self, vehicle: usize, time_s: f64) -> (f64, f64) {
        let rank = vehicle as f64;
        let lead = self.profile.at(time_s - rank * self.options.headway_s);
        if vehicle == 0 {
            return (lead.distance_m, lead.speed_mps);
        }
        let wave_number = TAU / VARIATION_PERIOD_M;
        let (sin, cos) = (wave_number * lead.distance_m + 2.0 * rank).sin_cos();
        let amplitude = self.options.gap_variation_m;
        (
            lead.distance_m - rank * self.options.standstill_gap_m + amplitude * sin,
            lead.speed_mps * (1.0 + amplitude * wave_number * cos),
        )
    }
}

/// Drop of the curved Earth below the tangent plane at a place (east, north, up) in it, m, and its rate with the velocity there, m/s.
fn drop_of_horizon(place: Vector3<f64>, velocity: Vector3<f64>) -> (f64, f64) {
    let (east, north) = (place.x, place.y);
    (
        (east * east + north * north) / (2.0 * EARTH_RADIUS_M),
        (east * velocity.x + north * velocity.y) / EARTH_RADIUS_M,
    )
}

/// An offset from a point of the centre line.
struct Beside {
    /// Offset in the road's direction, m.
    forward_m: f64,
    /// Offset to the right, m.
    right_m: f64,
    /// Change of `right_m` per metre of road.
    right_rate: f64,
    /// Offset upwards, m.
    up_m: f64,
}

impl Beside {
    /// Local coordinates, and their derivative with respect to the length along the road. The tangent plane is bent down to the curved
    /// Earth.
    fn place(&self, point: &RoadPoint) -> (Enu, Enu) {
        let Self { forward_m, right_m, right_rate, up_m } = *self;
        let (sin, cos) = point.heading_rad.sin_cos();
        let east = point.east_m + forward_m * sin + right_m * cos;
        let north = point.north_m + forward_m * cos - right_m * sin;
        let along_rate = 1.0 - point.curvature_1pm * right_m;
        let across_rate = right_rate + point.curvature_1pm * forward_m;
        let east_rate = along_rate * sin + across_rate * cos;
        let north_rate = along_rate * cos - across_rate * sin;
        let (place, rate) = (Vector3::new(east, north, 0.0), Vector3::new(east_rate, north_rate, 0.0));
        let (drop_m, drop_rate) = drop_of_horizon(place, rate);
        let up = point.height_m + up_m - drop_m;
        let up_rate = point.slope - drop_rate;
        (Enu { east, north, up }, Enu { east: east_rate, north: north_rate, up: up_rate })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn convoy() -> Convoy {
        Convoy::new(Geodetic::from_degrees(48.0, 11.5, 500.0), ConvoyOptions::default())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2_000))]
        #[test]
        fn distances_vertical_speed_and_velocity_hold(vehicle in 0_usize..4, time_s in 0.0..3_000.0_f64) {
            let convoy = convoy();
            let state = convoy.state(vehicle, time_s);
            for other in 0..4 {
                let distance = convoy.state(other, time_s).position.distance_m(state.position);
                let (minimum, maximum) = convoy.distance_bounds_m(vehicle, other);
                prop_assert!((minimum..=maximum).contains(&distance), "{minimum} {distance} {maximum}");
            }
            let up = LocalFrame::at(state.position).vector_ecef_to_enu(state.velocity).up;
            prop_assert!(up.abs() <= convoy.maximum_vertical_mps(), "{up}");
            let rear_right = Mount::open(-1.5, 0.6, 0.4);
            for mount in [Mount::default(), rear_right] {
                let at = |time_s: f64| convoy.phone_state(vehicle, &mount, time_s);
                let h = 1e-3;
                let derivative = (at(time_s + h).position - at(time_s - h).position).0 / (2.0 * h);
                prop_assert!((derivative - at(time_s).velocity.0).norm() < 1e-4);
            }
            let apart_m = convoy.phone_state(vehicle, &rear_right, time_s).position.distance_m(state.position);
            prop_assert!((apart_m - rear_right.distance_m(&Mount::default())).abs() < 1e-3, "{apart_m}");
        }
    }

    #[test]
    fn the_bounds_are_near_what_happens() {
        let convoy = convoy();
        let (mut smallest, mut largest) = (f64::INFINITY, 0.0_f64);
        for second in 0..1_200 {
            let (lead, next) = (convoy.state(0, f64::from(second)), convoy.state(1, f64::from(second)));
            let distance = lead.position.distance_m(next.position);
            (smallest, largest) = (smallest.min(distance), largest.max(distance));
        }
        let (minimum, maximum) = convoy.distance_bounds_m(0, 1);
        assert!(
            smallest - minimum < 2.5 && maximum - largest < 2.5,
            "{minimum} {smallest} {largest} {maximum}"
        );
        assert!(convoy.maximum_vertical_mps() < 0.8);
    }
}
