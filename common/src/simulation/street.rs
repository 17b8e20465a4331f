//! Houses beside the road, which block and reflect signals.
//!
//! A façade is a vertical plane parallel to the road at the distance w from the lane's centre, over its section of the road and with the
//! height h above the phones. A ray with the azimuth Δ from the road's direction and the elevation e meets the façade on its side at the
//! horizontal distance r = w/|sin Δ|, r·cos Δ further along the road, at the height r·tan e; the satellite is hidden if the façade there is
//! higher. So houses ahead of a phone and behind it hide satellites too, and a side street opens the view. The road is assumed straight
//! over [`REACH_M`]; façades beyond that distance have no effect.
//!
//! The other side of the street is a mirror: by the image of the phone behind that façade, a reflected ray is longer by
//! 2·w·|sin Δ|·cos e, where w is the distance of the mirror. It is received if it meets the mirror below its top and
//! passes above the houses on the satellite's side. Reflectivity and loss are properties of a
//! piece of a façade ([`Facades`]): all phones that use the same piece have the same reflection.

use rand::Rng;

use crate::frames::Direction;

use super::random::Streams;

/// Maximum horizontal distance to the façade on a ray, m.
const REACH_M: f64 = 200.0;
/// Minimum distance of a phone from a façade, m.
const CLOSEST_M: f64 = 0.5;
/// Size of a piece of a façade with one reflectivity, m: along the road, and in height.
const PIECE_M: (f64, f64) = (6.0, 4.0);
/// Loss of a reflection: minimum, and range above it, dB. Glass and smooth stone lose 4 dB, plaster and brick up to 14 dB.
const REFLECTION_LOSS_DB: (f64, f64) = (4.0, 10.0);
/// Minimum elevation of reception, rad (5°).
const HORIZON_RAD: f64 = 0.087_266;

/// The front of a row of houses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facade {
    /// Height above the phones, m.
    pub height_m: f64,
    /// Distance from the lane's centre, m.
    pub distance_m: f64,
}

/// A section of road with houses on one side or both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Canyon {
    /// Begin, as distance along the road from the start of a lap, m.
    pub from_m: f64,
    /// End, m.
    pub to_m: f64,
    /// Houses to the left of the direction of travel.
    pub left: Option<Facade>,
    /// Houses to the right.
    pub right: Option<Facade>,
}

impl Canyon {
    /// Equal houses on both sides.
    pub const fn symmetric(from_m: f64, to_m: f64, facade: Facade) -> Self {
        Self { from_m, to_m, left: Some(facade), right: Some(facade) }
    }

    /// An old town from `from_m` to `to_m`: houses of 10 to 26 m, 8 to 13 m from the lane, with side streets and a
    /// small square; the pattern of blocks repeats.
    pub fn old_town(from_m: f64, to_m: f64) -> Vec<Self> {
        let mut blocks = Vec::new();
        let mut start_m = from_m;
        for (length_m, left, right) in OLD_TOWN.iter().copied().cycle() {
            let end_m = (start_m + length_m).min(to_m);
            let facade = |(height_m, distance_m): (f64, f64)| Facade { height_m, distance_m };
            if left.is_some() || right.is_some() {
                blocks.push(Self {
                    from_m: start_m,
                    to_m: end_m,
                    left: left.map(facade),
                    right: right.map(facade),
                });
            }
            start_m += length_m;
            if start_m >= to_m {
                break;
            }
        }
        blocks
    }

    fn facade(&self, side: Side) -> Option<Facade> {
        match side {
            Side::Left => self.left,
            Side::Right => self.right,
        }
    }
}

/// Height and distance of a row of houses, m.
type Houses = Option<(f64, f64)>;
/// The blocks of [`Canyon::old_town`]: length (m), houses to the left and to the right.
const OLD_TOWN: [(f64, Houses, Houses); 9] = [
    (60.0, Some((18.0, 9.0)), Some((22.0, 11.0))),
    (12.0, None, None),
    (45.0, Some((24.0, 9.0)), Some((15.0, 11.0))),
    (25.0, None, Some((20.0, 11.0))),
    (70.0, Some((20.0, 10.0)), Some((26.0, 12.0))),
    (12.0, None, None),
    (40.0, Some((12.0, 8.0)), None),
    (55.0, Some((26.0, 9.0)), Some((21.0, 13.0))),
    (15.0, Some((10.0, 9.0)), None),
];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    Left,
    Right,
}

impl Side {
    const fn opposite(self) -> Self {
        match self {
            Self::Left => Self::Right,
            Self::Right => Self::Left,
        }
    }
}

/// Position and motion of a phone on the road.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RoadPlace {
    /// Distance along the road, m.
    pub road_m: f64,
    /// Length of a lap, m.
    pub lap_m: f64,
    /// Direction of the road, rad clockwise from north.
    pub heading_rad: f64,
    /// Rate of the direction, rad/s.
    pub turn_radps: f64,
    /// Offset to the right of the lane's centre, m.
    pub right_m: f64,
    /// Rate of the offset, m/s.
    pub right_mps: f64,
}

/// A reflected ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Reflection {
    /// Excess length over the direct ray, m.
    pub excess_m: f64,
    /// Rate of the excess length, m/s.
    pub excess_mps: f64,
    /// Loss at the façade, dB.
    pub loss_db: f64,
    /// Direction of arrival.
    pub from: Direction,
}

/// Effect of façades on signals: a random property of each piece.
#[derive(Clone, Copy, Debug)]
pub(super) struct Facades {
    pub streams: Streams,
    /// Fraction of the pieces that reflect, 0 to 1; the others scatter.
    pub reflecting: f64,
}

impl Facades {
    /// Loss of a reflection, dB; `None` for a façade that does not reflect.
    fn loss_db(&self, side: Side, along_m: f64, height_m: f64) -> Option<f64> {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // both are small and not negative
        let (along, up) = ((along_m / PIECE_M.0) as u32, (height_m / PIECE_M.1) as u16);
        let mut random = self.streams.facade(side == Side::Right, along, up);
        let (chance, loss) = (random.random::<f64>(), random.random::<f64>());
        (chance < self.reflecting).then_some(REFLECTION_LOSS_DB.0 + REFLECTION_LOSS_DB.1 * loss)
    }
}

/// Surroundings of one phone at one instant.
#[derive(Clone, Copy, Debug)]
pub(super) struct Surroundings<'a> {
    canyons: &'a [Canyon],
    place: RoadPlace,
}

/// Direction relative to the road.
struct Ray {
    /// Sine of the angle to the road (component across).
    across: f64,
    /// Cosine of the angle to the road (component along).
    along: f64,
    elevation_rad: f64,
    side: Side,
}

impl<'a> Surroundings<'a> {
    pub(super) const fn at(canyons: &'a [Canyon], place: RoadPlace) -> Self {
        Self { canyons, place }
    }

    /// Whether there are houses directly beside the phone.
    pub(super) fn in_canyon(&self) -> bool {
        [Side::Left, Side::Right].into_iter().any(|side| self.facade(side, self.place.road_m).is_some())
    }

    /// Whether the direct signal from a direction is received.
    pub(super) fn is_visible(&self, direction: Direction) -> bool {
        let ray = self.ray(direction);
        direction.elevation_rad > HORIZON_RAD && !self.is_blocked(&ray, ray.side, 0.0)
    }

    /// The signal from a direction by reflection at the houses on the other side, if it is received.
    pub(super) fn reflection(&self, direction: Direction, facades: &Facades) -> Option<Reflection> {
        let ray = self.ray(direction);
        if direction.elevation_rad <= HORIZON_RAD || facades.reflecting <= 0.0 {
            return None;
        }
        let mirror = ray.side.opposite();
        // The mirror's distance depends on the point where the ray meets it, and vice versa.
        let (distance_m, facade) = self.met(&ray, mirror, 0.0, 0.0)?;
        let reach_m = distance_m / ray.across.abs();
        let height_m = reach_m * ray.elevation_rad.tan();
        if height_m >= facade.height_m || self.is_blocked(&ray, ray.side, reach_m) {
            return None;
        }
        let loss_db = facades.loss_db(mirror, self.lap(reach_m * ray.along), height_m)?;
        let cos_elevation = ray.elevation_rad.cos();
        let towards_mps = if mirror == Side::Right { -self.place.right_mps } else { self.place.right_mps };
        let across_rate = -ray.along * self.place.turn_radps * ray.across.signum();
        Some(Reflection {
            excess_m: 2.0 * distance_m * ray.across.abs() * cos_elevation,
            excess_mps: 2.0 * cos_elevation * (towards_mps * ray.across.abs() + distance_m * across_rate),
            loss_db,
            from: Direction {
                azimuth_rad: 2.0 * self.place.heading_rad - direction.azimuth_rad,
                elevation_rad: direction.elevation_rad,
            },
        })
    }

    fn ray(&self, direction: Direction) -> Ray {
        let (across, along) = (direction.azimuth_rad - self.place.heading_rad).sin_cos();
        let side = if across >= 0.0 { Side::Right } else { Side::Left };
        Ray { across, along, elevation_rad: direction.elevation_rad, side }
    }

    /// Whether houses on a side block a ray that was reflected after `reflected_m` (0 without reflection): the ray then starts
    /// at the phone's image, twice as far from the houses.
    fn is_blocked(&self, ray: &Ray, side: Side, reflected_m: f64) -> bool {
        let before_m = 2.0 * reflected_m;
        self.met(ray, side, before_m, before_m * ray.along).is_some_and(|(distance_m, facade)| {
            (before_m + distance_m / ray.across.abs()) * ray.elevation_rad.tan() < facade.height_m
        })
    }

    /// The façade on a side that is met by a ray starting `ahead_m` along the road from the phone, after a length of `before_m`,
    /// and the phone's distance from the façade.
    fn met(&self, ray: &Ray, side: Side, before_m: f64, ahead_m: f64) -> Option<(f64, Facade)> {
        let sign = if side == Side::Right { 1.0 } else { -1.0 };
        self.canyons.iter().find_map(|canyon| {
            let facade = canyon.facade(side)?;
            let distance_m = (facade.distance_m - sign * self.place.right_m).max(CLOSEST_M);
            let reach_m = distance_m / ray.across.abs();
            let place_m = self.lap(ahead_m + reach_m * ray.along);
            let within = reach_m + before_m <= REACH_M && (canyon.from_m..canyon.to_m).contains(&place_m);
            within.then_some((distance_m, facade))
        })
    }

    fn facade(&self, side: Side, road_m: f64) -> Option<Facade> {
        let place_m = road_m.rem_euclid(self.place.lap_m);
        let mut here = self.canyons.iter().filter(|canyon| (canyon.from_m..canyon.to_m).contains(&place_m));
        here.find_map(|canyon| canyon.facade(side))
    }

    /// Place `ahead_m` from the phone, from the start of a lap.
    fn lap(&self, ahead_m: f64) -> f64 {
        (self.place.road_m + ahead_m).rem_euclid(self.place.lap_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADING_DEG: f64 = 30.0;

    fn place(road_m: f64) -> RoadPlace {
        RoadPlace {
            road_m,
            lap_m: 1_000.0,
            heading_rad: HEADING_DEG.to_radians(),
            turn_radps: 0.0,
            right_m: 0.0,
            right_mps: 0.0,
        }
    }

    /// A direction `from_road_deg` degrees clockwise from the road's.
    fn direction(from_road_deg: f64, elevation_deg: f64) -> Direction {
        Direction {
            azimuth_rad: (HEADING_DEG + from_road_deg).to_radians(),
            elevation_rad: elevation_deg.to_radians(),
        }
    }

    fn facades() -> Facades {
        Facades { streams: Streams::new(1), reflecting: 1.0 }
    }

    #[test]
    fn houses_hide_what_is_across_and_not_what_is_along() {
        let canyon = Canyon::symmetric(100.0, 200.0, Facade { height_m: 20.0, distance_m: 10.0 });
        let seen = |road_m: f64, from_road_deg: f64, elevation_deg: f64| {
            Surroundings::at(&[canyon], place(road_m)).is_visible(direction(from_road_deg, elevation_deg))
        };
        // atan(20/10) = 63.4°
        assert!(!seen(150.0, 90.0, 63.0) && seen(150.0, 90.0, 64.0));
        assert!(!seen(150.0, 270.0, 63.0) && seen(1_150.0, 270.0, 64.0));
        assert!(!seen(1_150.0, 90.0, 63.0), "one lap later");
        assert!(seen(150.0, 0.0, 10.0) && seen(150.0, 90.0, 4.0) == seen(20.0, 90.0, 4.0));
        // 45° ahead the ray meets the façade 10 m further on, at 14.1 m: hidden up to 54.7°.
        assert!(!seen(150.0, 45.0, 54.0) && seen(150.0, 45.0, 55.5) && seen(195.0, 45.0, 10.0));
        assert!(!seen(95.0, 45.0, 54.0) && seen(85.0, 45.0, 10.0), "from outside");
    }

    #[test]
    fn one_side_hides_one_side() {
        let right = Some(Facade { height_m: 20.0, distance_m: 10.0 });
        let canyon = Canyon { from_m: 0.0, to_m: 500.0, left: None, right };
        let nearer = RoadPlace { right_m: 5.0, ..place(250.0) };
        let at = |place, from_road_deg, elevation_deg| {
            Surroundings::at(&[canyon], place).is_visible(direction(from_road_deg, elevation_deg))
        };
        assert!(!at(place(250.0), 90.0, 50.0) && at(place(250.0), -90.0, 50.0));
        assert!(at(place(250.0), 90.0, 65.0) && !at(nearer, 90.0, 65.0), "atan(20/5) = 76°");
    }

    /// Length of the reflected ray by the image of the phone, for a satellite far away.
    #[test]
    fn reflections_are_longer_by_the_way_to_the_image() {
        let left = Some(Facade { height_m: 30.0, distance_m: 12.0 });
        let canyon = Canyon { from_m: 0.0, to_m: 500.0, left, right: None };
        let canyons = [canyon];
        let at = |right_m| Surroundings::at(&canyons, RoadPlace { right_m, ..place(250.0) });
        let reflection = at(0.0).reflection(direction(60.0, 40.0), &facades()).unwrap();
        let towards = |right: f64, ahead: f64, up: f64| {
            let (sin, cos) = 60.0_f64.to_radians().sin_cos();
            let elevation = 40.0_f64.to_radians();
            right * sin * elevation.cos() + ahead * cos * elevation.cos() + up * elevation.sin()
        };
        // The image is 24 m to the left, so it is that much further from a satellite to the right.
        let expected_m = towards(0.0, 0.0, 0.0) - towards(-24.0, 0.0, 0.0);
        assert!((reflection.excess_m - expected_m).abs() < 1e-9, "{reflection:?} {expected_m}");
        assert!((4.0..=14.0).contains(&reflection.loss_db));
        let from_deg = (reflection.from.azimuth_rad.to_degrees() - HEADING_DEG).rem_euclid(360.0);
        assert!((from_deg - 300.0).abs() < 1e-9, "mirrored: {from_deg}");
        // No reflection above the mirror, along the road, without a mirror, and behind houses on the satellite's side.
        assert!(at(0.0).reflection(direction(90.0, 70.0), &facades()).is_none());
        assert!(at(0.0).reflection(direction(-60.0, 40.0), &facades()).is_none());
        let high = Some(Facade { height_m: 60.0, distance_m: 10.0 });
        let closed = [Canyon { right: high, ..canyon }];
        let closed = Surroundings::at(&closed, place(250.0));
        assert!(closed.reflection(direction(60.0, 40.0), &facades()).is_none());
        let none = Facades { reflecting: 0.0, ..facades() };
        assert!(at(0.0).reflection(direction(60.0, 40.0), &none).is_none());
    }

    #[test]
    fn the_rate_of_a_reflection_is_its_derivative() {
        let facade = Some(Facade { height_m: 40.0, distance_m: 12.0 });
        for (left, right, from_road_deg) in [(facade, None, 60.0), (None, facade, -110.0)] {
            let canyons = [Canyon { from_m: 0.0, to_m: 500.0, left, right }];
            let at = |time_s: f64| {
                let place = RoadPlace {
                    heading_rad: HEADING_DEG.to_radians() + 0.05 * time_s,
                    turn_radps: 0.05,
                    right_m: 0.3 * time_s,
                    right_mps: 0.3,
                    ..place(250.0)
                };
                Surroundings::at(&canyons, place).reflection(direction(from_road_deg, 40.0), &facades())
            };
            let derivative = (at(1e-3).unwrap().excess_m - at(-1e-3).unwrap().excess_m) / 2e-3;
            let rate = at(0.0).unwrap().excess_mps;
            assert!((derivative - rate).abs() < 1e-6, "{derivative} {rate}");
        }
    }

    #[test]
    fn the_old_town_has_side_streets_and_ends_where_it_should() {
        let town = Canyon::old_town(1_000.0, 1_700.0);
        assert!(town.iter().all(|block| block.from_m < block.to_m && block.to_m <= 1_700.0));
        assert!(town.windows(2).any(|pair| pair[1].from_m - pair[0].to_m > 10.0));
        assert!(town.last().is_some_and(|block| block.to_m > 1_650.0));
    }
}
