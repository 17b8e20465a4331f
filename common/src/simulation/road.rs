//! A closed road of straights, transition curves and arcs, by arc length.
//!
//! The curvature is piecewise linear in the arc length s (straights, clothoids, circular arcs), so the heading is
//! piecewise quadratic and exact. Positions are Gauss-Legendre integrals of it over pieces so short that the
//! error stays below a micrometre. A pattern with a net turn of 90°, repeated four times, closes the road:
//! s may take any value and wraps. The height is a sum of two sine waves with whole numbers of periods per lap.

use std::f64::consts::{FRAC_PI_2, TAU};

use crate::statistics::quadrature;

/// Maximum length of a piece for one Gauss-Legendre sum, m.
const MAXIMUM_PIECE_M: f64 = 25.0;
/// Length of a transition between a straight and an arc, m.
const TRANSITION_M: f64 = 50.0;
/// Height waves: amplitude (m), periods per lap. Together they bound the slope.
const HEIGHT_WAVES: [(f64, f64); 2] = [(4.0, 7.0), (0.8, 16.0)];

/// Element of the repeated pattern.
#[derive(Clone, Copy, Debug)]
enum Element {
    /// A straight with its length, m.
    Straight(f64),
    /// A turn (rad, positive = right) with an arc of radius `radius_m` between two transitions.
    Turn { angle_rad: f64, radius_m: f64 },
}

/// A piece with linear curvature, and its starting point.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Piece {
    start_m: f64,
    east_m: f64,
    north_m: f64,
    heading_rad: f64,
    curvature_1pm: f64,
    curvature_rate_1pm2: f64,
}

/// A point of the road's centre line. Lengths in m, in a plane whose axes are east and north.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoadPoint {
    /// East coordinate, m.
    pub east_m: f64,
    /// North coordinate, m.
    pub north_m: f64,
    /// Height above the scenario's origin, m.
    pub height_m: f64,
    /// Direction of travel, rad clockwise from north; not wrapped.
    pub heading_rad: f64,
    /// Change of heading per metre, 1/m, positive = turning right.
    pub curvature_1pm: f64,
    /// Change of height per metre.
    pub slope: f64,
}

/// The road.
#[derive(Clone, Debug, PartialEq)]
pub struct Road {
    pieces: Vec<Piece>,
    lap_m: f64,
    minimum_radius_m: f64,
}

impl Road {
    /// The road of the demonstration: four times straights of 300, 350 and 250 m with turns of 120°, −75° and 45°.
    pub fn circuit() -> Self {
        Self::four_times(&[
            Element::Straight(300.0),
            Element::Turn { angle_rad: 120.0_f64.to_radians(), radius_m: 120.0 },
            Element::Straight(350.0),
            Element::Turn { angle_rad: -75.0_f64.to_radians(), radius_m: 150.0 },
            Element::Straight(250.0),
            Element::Turn { angle_rad: 45.0_f64.to_radians(), radius_m: 200.0 },
        ])
    }

    /// Repeats a pattern with a net turn of ±90° four times.
    fn four_times(pattern: &[Element]) -> Self {
        let mut builder = Builder::default();
        let mut minimum_radius_m = f64::INFINITY;
        for _ in 0..4 {
            for element in pattern {
                match *element {
                    Element::Straight(length_m) => builder.add(length_m, 0.0),
                    Element::Turn { angle_rad, radius_m } => {
                        minimum_radius_m = minimum_radius_m.min(radius_m);
                        let curvature = angle_rad.signum() / radius_m;
                        builder.add(TRANSITION_M, curvature);
                        // Both transitions together turn as much as an arc of the length of one.
                        builder.add((angle_rad.abs() * radius_m - TRANSITION_M).max(0.0), curvature);
                        builder.add(TRANSITION_M, 0.0);
                    }
                }
            }
        }
        Self { pieces: builder.pieces, lap_m: builder.end.start_m, minimum_radius_m }
    }

    /// Length of one lap, m.
    pub const fn lap_m(&self) -> f64 {
        self.lap_m
    }

    /// Radius of the tightest arc, m.
    pub const fn minimum_radius_m(&self) -> f64 {
        self.minimum_radius_m
    }

    /// Bound of |slope|.
    pub fn maximum_slope(&self) -> f64 {
        HEIGHT_WAVES.iter().map(|(amplitude_m, periods)| amplitude_m * TAU * periods / self.lap_m).sum()
    }

    /// The point at arc length `s_m` in the plane; any value is valid, because the road is closed.
    pub fn at(&self, s_m: f64) -> RoadPoint {
        let s_m = s_m.rem_euclid(self.lap_m);
        let index = self.pieces.partition_point(|piece| piece.start_m <= s_m).saturating_sub(1);
        let piece = self.pieces.get(index).copied().unwrap_or_else(Piece::origin);
        let end = piece.after(s_m - piece.start_m);
        let (mut height_m, mut slope) = (0.0, 0.0);
        for (amplitude_m, periods) in HEIGHT_WAVES {
            let wave_number = TAU * periods / self.lap_m;
            height_m += amplitude_m * (wave_number * s_m).sin();
            slope += amplitude_m * wave_number * (wave_number * s_m).cos();
        }
        RoadPoint {
            east_m: end.east_m,
            north_m: end.north_m,
            height_m,
            heading_rad: end.heading_rad,
            curvature_1pm: end.curvature_1pm,
            slope,
        }
    }
}

impl Piece {
    /// The start: at the origin, heading north-east, straight.
    const fn origin() -> Self {
        Self {
            start_m: 0.0,
            east_m: 0.0,
            north_m: 0.0,
            heading_rad: FRAC_PI_2 / 2.0,
            curvature_1pm: 0.0,
            curvature_rate_1pm2: 0.0,
        }
    }

    fn heading_after(&self, length_m: f64) -> f64 {
        self.heading_rad + length_m * (self.curvature_1pm + 0.5 * length_m * self.curvature_rate_1pm2)
    }

    /// The remainder of the piece after `length_m`.
    fn after(&self, length_m: f64) -> Self {
        let (mut east, mut north) = (0.0, 0.0);
        for (node, weight) in quadrature::ON_UNIT_INTERVAL {
            let (sin, cos) = self.heading_after(length_m * node).sin_cos();
            east += weight * sin;
            north += weight * cos;
        }
        Self {
            start_m: self.start_m + length_m,
            east_m: self.east_m + length_m * east,
            north_m: self.north_m + length_m * north,
            heading_rad: self.heading_after(length_m),
            curvature_1pm: self.curvature_1pm + length_m * self.curvature_rate_1pm2,
            curvature_rate_1pm2: self.curvature_rate_1pm2,
        }
    }
}

/// Joins pieces end to end.
struct Builder {
    pieces: Vec<Piece>,
    end: Piece,
}

impl Default for Builder {
    fn default() -> Self {
        Self { pieces: Vec::new(), end: Piece::origin() }
    }
}

impl Builder {
    /// Adds `length_m` of road with a linear change of the curvature to `curvature_1pm`; for zero length the curvature jumps.
    fn add(&mut self, length_m: f64, curvature_1pm: f64) {
        if length_m <= 0.0 {
            self.end.curvature_1pm = curvature_1pm;
            return;
        }
        self.end.curvature_rate_1pm2 = (curvature_1pm - self.end.curvature_1pm) / length_m;
        let count = (length_m / MAXIMUM_PIECE_M).ceil();
        let mut left = count;
        while left > 0.5 {
            self.pieces.push(self.end);
            self.end = self.end.after(length_m / count);
            left -= 1.0;
        }
        self.end.curvature_1pm = curvature_1pm;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_circuit_closes() {
        let road = Road::circuit();
        let (start, end) = (road.at(0.0), road.at(road.lap_m() - 1e-6));
        assert!((end.east_m - start.east_m).hypot(end.north_m - start.north_m) < 1e-5, "{end:?}");
        assert!((end.heading_rad - start.heading_rad - TAU).abs() < 1e-9, "{end:?}");
        assert!((end.height_m - start.height_m).abs() < 1e-5);
        assert!((5_000.0..8_000.0).contains(&road.lap_m()), "{}", road.lap_m());
    }

    proptest! {
        #[test]
        fn derivatives_agree_with_differences(s in -5_000.0..15_000.0_f64) {
            let road = Road::circuit();
            let h = 0.01;
            let (a, b, p) = (road.at(s - h), road.at(s + h), road.at(s));
            let (sin, cos) = p.heading_rad.sin_cos();
            prop_assert!(((b.east_m - a.east_m) / (2.0 * h) - sin).abs() < 1e-6);
            prop_assert!(((b.north_m - a.north_m) / (2.0 * h) - cos).abs() < 1e-6);
            prop_assert!(((b.height_m - a.height_m) / (2.0 * h) - p.slope).abs() < 1e-6);
            prop_assert!(p.curvature_1pm.abs() <= 1.0 / road.minimum_radius_m() + 1e-12);
            prop_assert!(p.slope.abs() <= road.maximum_slope());
        }
    }
}
