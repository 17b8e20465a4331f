//! Signal delays in ionosphere and troposphere.
//!
//! The models of Klobuchar, Saastamoinen and Niell are closed formulas that are cheap enough for every signal of every epoch.
//! None contains the weather of the day: about half of the ionosphere (IS-GPS-200: 50 % rms) and a few
//! centimetres of zenith troposphere remain. Maps (IONEX) describe the ionosphere of the day to a few TEC units.

mod ionosphere_map;
mod klobuchar;
mod klobuchar_beidou;
mod map_axis;
mod niell;
mod ntcm;
mod saastamoinen;
mod shell;
mod troposphere;

pub use ionosphere_map::{Ionex, IonosphereMap, IonosphereMaps, NoTec};
pub use klobuchar::{KlobucharCoefficients, klobuchar_delay_l1_m, scale_from_l1};
pub(crate) use klobuchar::{L1_HZ, scale_delay};
pub use klobuchar_beidou::{B1I_HZ, beidou_klobuchar_delay_b1i_m};
pub(crate) use map_axis::Axis;
pub use niell::NiellMapping;
pub use ntcm::{effective_ionisation_sfu, mean_solar_flux_sfu, ntcm_delay_l1_m};
pub use saastamoinen::{STANDARD_RELATIVE_HUMIDITY, ZenithDelay, saastamoinen_zenith_delay};
pub(crate) use shell::{Crossing, Shell};
pub use troposphere::{Troposphere, TroposphereMapping};
