//! Physical constants as the interface control documents print them.

/// Speed of light in vacuum, m/s (IS-GPS-200, 20.3.4.3).
pub const SPEED_OF_LIGHT_MPS: f64 = 299_792_458.0;

/// Earth rotation rate of WGS-84 as GPS and Galileo use it, rad/s (IS-GPS-200, table 20-IV).
pub const EARTH_ROTATION_RADPS: f64 = 7.292_115_146_7e-5;

/// Earth rotation rate of CGCS2000 as BeiDou uses it, rad/s (BDS-SIS-ICD-B1I, 5.2.4.12).
pub const EARTH_ROTATION_BEIDOU_RADPS: f64 = 7.292_115_0e-5;

/// Semi-major axis of the WGS-84 ellipsoid, m.
pub const WGS84_SEMI_MAJOR_M: f64 = 6_378_137.0;

/// Flattening of the WGS-84 ellipsoid.
pub const WGS84_FLATTENING: f64 = 1.0 / 298.257_223_563;
