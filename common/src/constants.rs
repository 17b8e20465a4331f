//! Physical constants with the values of the interface control documents.

/// Speed of light in vacuum, m/s (IS-GPS-200, 20.3.4.3).
pub const SPEED_OF_LIGHT_MPS: f64 = 299_792_458.0;

/// Earth rotation rate of WGS-84 as GPS and Galileo use it, rad/s (IS-GPS-200, table 20-IV).
pub const EARTH_ROTATION_RADPS: f64 = 7.292_115_146_7e-5;

/// Earth rotation rate of CGCS2000 as BeiDou uses it, rad/s (BDS-SIS-ICD-B1I, 5.2.4.12).
pub const EARTH_ROTATION_BEIDOU_RADPS: f64 = 7.292_115_0e-5;

/// Gravitational constant of the Earth as GPS and QZSS use it, m³/s² (IS-GPS-200, table 20-IV).
pub const GRAVITY_GPS_M3PS2: f64 = 3.986_005e14;

/// Gravitational constant of the Earth as used by Galileo, BeiDou (OS SIS ICD, 5.1.1; BDS-SIS-ICD-B1I, 5.2.4.12) and
/// for precise orbits, m³/s².
pub const GRAVITY_M3PS2: f64 = 3.986_004_418e14;

/// Gravitational constant of PZ-90 as GLONASS uses it, m³/s² (GLONASS ICD, L1 and L2, edition 5.1, A.3.1.2).
pub const GRAVITY_PZ90_M3PS2: f64 = 3.986_004_4e14;

/// Semi-major axis of the WGS-84 ellipsoid, m.
pub const WGS84_SEMI_MAJOR_M: f64 = 6_378_137.0;

/// Flattening of the WGS-84 ellipsoid.
pub const WGS84_FLATTENING: f64 = 1.0 / 298.257_223_563;
