//! Frames as types: Earth-centred Earth-fixed, geodetic, local east-north-up.
//!
//! An [`Ecef`] is a point; an [`EcefVector`] is a difference or a velocity. The compiler prevents mixing them:
//!
//! ```compile_fail
//! use cofix_common::frames::Ecef;
//! let (a, b) = (Ecef::new(1.0, 0.0, 0.0), Ecef::new(0.0, 1.0, 0.0));
//! let sum = a + b; // two points have no sum
//! ```
//!
//! The types do *not* distinguish realisations of the terrestrial frame (WGS-84, ITRF14, CGCS2000). They agree to centimetres, far below
//! the accuracy of phones, and are treated as identical.

use std::ops::{Add, Sub};

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use crate::constants::{WGS84_FLATTENING, WGS84_SEMI_MAJOR_M};

/// A point in the Earth-centred Earth-fixed frame, m.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ecef(pub Vector3<f64>);

/// A displacement (m) or velocity (m/s) in the Earth-centred Earth-fixed frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct EcefVector(pub Vector3<f64>);

/// A displacement (m) or velocity (m/s) in a local east, north, up frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Enu {
    /// East component.
    pub east: f64,
    /// North component.
    pub north: f64,
    /// Up component.
    pub up: f64,
}

/// Geodetic coordinates on the WGS-84 ellipsoid.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Geodetic {
    /// Latitude, rad, positive north.
    pub latitude_rad: f64,
    /// Longitude, rad, positive east, in (−π, π].
    pub longitude_rad: f64,
    /// Height above the ellipsoid, m.
    pub height_m: f64,
}

/// A local east-north-up frame: an origin and the rotation from ECEF.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalFrame {
    origin: Ecef,
    geodetic: Geodetic,
    ecef_to_enu: Matrix3<f64>,
}

/// Direction in a local frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Direction {
    /// Azimuth, rad, clockwise from north, in [0, 2π).
    pub azimuth_rad: f64,
    /// Elevation above the horizon, rad.
    pub elevation_rad: f64,
}

impl Ecef {
    /// A point from coordinates in metres.
    pub const fn new(x_m: f64, y_m: f64, z_m: f64) -> Self {
        Self(Vector3::new(x_m, y_m, z_m))
    }

    /// Distance to another point, m.
    pub fn distance_m(self, other: Self) -> f64 {
        (self.0 - other.0).norm()
    }

    /// Whether all three coordinates are finite.
    pub fn is_finite(self) -> bool {
        self.0.iter().all(|c| c.is_finite())
    }

    /// Geodetic coordinates, by Bowring's initial value and fixed-point iteration on the latitude; accurate to 1e-9 rad
    /// and a micrometre from the Earth's core out to the satellites.
    pub fn ecef_to_geodetic(self) -> Geodetic {
        let e2 = WGS84_FLATTENING * (2.0 - WGS84_FLATTENING);
        let (x, y, z) = (self.0.x, self.0.y, self.0.z);
        let p2 = x.mul_add(x, y * y);
        let mut n = WGS84_SEMI_MAJOR_M;
        let mut zn = z;
        for _ in 0..20 {
            let r = p2.sqrt().hypot(zn);
            let sin_latitude = if r > 0.0 { zn / r } else { 0.0 };
            n = WGS84_SEMI_MAJOR_M / (1.0 - e2 * sin_latitude * sin_latitude).sqrt();
            let next = z + n * e2 * sin_latitude;
            let change = (next - zn).abs();
            zn = next;
            if change < 1e-6 {
                break;
            }
        }
        let p = p2.sqrt();
        Geodetic {
            latitude_rad: zn.atan2(p),
            longitude_rad: if p > 0.0 { y.atan2(x) } else { 0.0 },
            height_m: p.hypot(zn) - n,
        }
    }
}

impl EcefVector {
    /// A vector from its components (m or m/s).
    pub const fn new(x: f64, y: f64, z: f64) -> Self {
        Self(Vector3::new(x, y, z))
    }

    /// Length.
    pub fn norm(self) -> f64 {
        self.0.norm()
    }

    /// Whether all three components are finite.
    pub fn is_finite(self) -> bool {
        self.0.iter().all(|c| c.is_finite())
    }
}

impl Sub for Ecef {
    type Output = EcefVector;
    fn sub(self, other: Self) -> EcefVector {
        EcefVector(self.0 - other.0)
    }
}

impl Add<EcefVector> for Ecef {
    type Output = Self;
    fn add(self, displacement: EcefVector) -> Self {
        Self(self.0 + displacement.0)
    }
}

impl Enu {
    /// Horizontal length, m or m/s.
    pub fn horizontal(self) -> f64 {
        self.east.hypot(self.north)
    }

    /// Vector (east, north, up).
    pub const fn vector(self) -> Vector3<f64> {
        Vector3::new(self.east, self.north, self.up)
    }
}

impl From<Vector3<f64>> for Enu {
    fn from(v: Vector3<f64>) -> Self {
        Self { east: v.x, north: v.y, up: v.z }
    }
}

impl Geodetic {
    /// Coordinates from degrees and metres, for files and the command line.
    pub fn from_degrees(latitude_deg: f64, longitude_deg: f64, height_m: f64) -> Self {
        Self { latitude_rad: latitude_deg.to_radians(), longitude_rad: longitude_deg.to_radians(), height_m }
    }

    /// Latitude, degrees.
    pub fn latitude_deg(self) -> f64 {
        self.latitude_rad.to_degrees()
    }

    /// Longitude, degrees.
    pub fn longitude_deg(self) -> f64 {
        self.longitude_rad.to_degrees()
    }

    /// The point in ECEF.
    pub fn geodetic_to_ecef(self) -> Ecef {
        let e2 = WGS84_FLATTENING * (2.0 - WGS84_FLATTENING);
        let (sin_lat, cos_lat) = self.latitude_rad.sin_cos();
        let (sin_lon, cos_lon) = self.longitude_rad.sin_cos();
        let n = WGS84_SEMI_MAJOR_M / (1.0 - e2 * sin_lat * sin_lat).sqrt();
        Ecef::new(
            (n + self.height_m) * cos_lat * cos_lon,
            (n + self.height_m) * cos_lat * sin_lon,
            (n * (1.0 - e2) + self.height_m) * sin_lat,
        )
    }
}

impl LocalFrame {
    /// The frame with the origin `origin` and the ellipsoid's normal there as up axis.
    pub fn at(origin: Ecef) -> Self {
        let geodetic = origin.ecef_to_geodetic();
        let (sin_lat, cos_lat) = geodetic.latitude_rad.sin_cos();
        let (sin_lon, cos_lon) = geodetic.longitude_rad.sin_cos();
        let ecef_to_enu = Matrix3::new(
            -sin_lon,
            cos_lon,
            0.0,
            -sin_lat * cos_lon,
            -sin_lat * sin_lon,
            cos_lat,
            cos_lat * cos_lon,
            cos_lat * sin_lon,
            sin_lat,
        );
        Self { origin, geodetic, ecef_to_enu }
    }

    /// The origin.
    pub const fn origin(&self) -> Ecef {
        self.origin
    }

    /// The origin in geodetic coordinates.
    pub const fn geodetic(&self) -> Geodetic {
        self.geodetic
    }

    /// The rotation whose rows are east, north and up in ECEF.
    pub const fn rotation_ecef_to_enu(&self) -> &Matrix3<f64> {
        &self.ecef_to_enu
    }

    /// The up unit vector in ECEF.
    pub fn up(&self) -> Vector3<f64> {
        self.ecef_to_enu.row(2).transpose()
    }

    /// Displacement of a point from the origin.
    pub fn ecef_to_enu(&self, point: Ecef) -> Enu {
        self.vector_ecef_to_enu(point - self.origin)
    }

    /// Converts a displacement or velocity from ECEF.
    pub fn vector_ecef_to_enu(&self, vector: EcefVector) -> Enu {
        (self.ecef_to_enu * vector.0).into()
    }

    /// Converts a displacement or velocity to ECEF.
    pub fn vector_enu_to_ecef(&self, vector: Enu) -> EcefVector {
        EcefVector(self.ecef_to_enu.tr_mul(&vector.vector()))
    }

    /// The point at a displacement from the origin.
    pub fn enu_to_ecef(&self, displacement: Enu) -> Ecef {
        self.origin + self.vector_enu_to_ecef(displacement)
    }

    /// Converts a covariance matrix of an ECEF vector to east, north, up.
    pub fn covariance_ecef_to_enu(&self, covariance: &Matrix3<f64>) -> Matrix3<f64> {
        self.ecef_to_enu * covariance * self.ecef_to_enu.transpose()
    }

    /// Azimuth and elevation of a unit vector in ECEF.
    pub fn direction(&self, unit: &Vector3<f64>) -> Direction {
        let local = self.ecef_to_enu * unit;
        let azimuth = local.x.atan2(local.y);
        Direction {
            azimuth_rad: if azimuth < 0.0 { azimuth + std::f64::consts::TAU } else { azimuth },
            elevation_rad: local.z.clamp(-1.0, 1.0).asin(),
        }
    }
}
