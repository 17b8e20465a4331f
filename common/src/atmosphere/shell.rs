//! Thin-shell model of the ionosphere around a sphere: pierce point and slant factor.

use std::f64::consts::FRAC_PI_2;

use crate::frames::Direction;

/// A shell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shell {
    base_radius_m: f64,
    height_m: f64,
}

/// Intersection of a signal with a shell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PiercePoint {
    pub(crate) latitude_rad: f64,
    /// Longitude, not reduced to one turn.
    pub(crate) longitude_rad: f64,
    /// 1 / cos z': ratio of the path through the shell to a vertical path.
    pub(crate) slant: f64,
}

/// Angles where a signal crosses a shell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Crossing {
    /// At the sphere's centre, between receiver and pierce point, rad.
    pub(crate) centre_rad: f64,
    /// Of the signal with the vertical at the pierce point, rad.
    pub(crate) zenith_rad: f64,
}

impl Shell {
    /// A shell from the radius of the sphere and the height of the shell above it.
    pub(crate) const fn new(base_radius_m: f64, height_m: f64) -> Self {
        Self { base_radius_m, height_m }
    }

    /// The same in kilometres, as in files; `None` for invalid values.
    pub(crate) fn from_kilometres(base_radius_km: f64, height_km: f64) -> Option<Self> {
        let possible = (6_000.0..=7_000.0).contains(&base_radius_km) && (50.0..=2_000.0).contains(&height_km);
        possible.then_some(Self::new(base_radius_km * 1e3, height_km * 1e3))
    }

    /// How a signal crosses the shell. An elevation below the horizon counts as the horizon.
    pub(crate) fn crossing(self, elevation_rad: f64) -> Crossing {
        let Self { base_radius_m, height_m } = self;
        let elevation_rad = elevation_rad.clamp(0.0, FRAC_PI_2);
        let zenith_rad = (base_radius_m / (base_radius_m + height_m) * elevation_rad.cos()).asin();
        Crossing { centre_rad: FRAC_PI_2 - elevation_rad - zenith_rad, zenith_rad }
    }

    /// Pierce point of a signal to a receiver at a latitude and longitude on the sphere, rad. An elevation below
    /// the horizon counts as the horizon.
    pub(crate) fn pierce(self, latitude_rad: f64, longitude_rad: f64, direction: Direction) -> PiercePoint {
        let Crossing { centre_rad, zenith_rad } = self.crossing(direction.elevation_rad);
        let (sin_centre, cos_centre) = centre_rad.sin_cos();
        let (sin_azimuth, cos_azimuth) = direction.azimuth_rad.sin_cos();
        let (sin_latitude, cos_latitude) = latitude_rad.sin_cos();
        let sin_pierce = sin_latitude * cos_centre + cos_latitude * sin_centre * cos_azimuth;
        let east = sin_centre * sin_azimuth;
        let along = cos_centre * cos_latitude - sin_centre * sin_latitude * cos_azimuth;
        PiercePoint {
            latitude_rad: sin_pierce.clamp(-1.0, 1.0).asin(),
            longitude_rad: longitude_rad + east.atan2(along),
            slant: 1.0 / zenith_rad.cos(),
        }
    }
}
