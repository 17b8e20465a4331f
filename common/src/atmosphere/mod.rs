//! Signal delays in ionosphere and troposphere.
//!
//! Both models are closed formulas, cheap enough to be evaluated for every signal of every epoch. Neither
//! knows the weather of the day: expect half of the ionosphere (IS-GPS-200 says 50 % rms) and a few
//! centimetres of zenith troposphere to remain.

mod klobuchar;
mod saastamoinen;

pub use klobuchar::{KlobucharCoefficients, klobuchar_delay_l1_m, scale_from_l1};
pub use saastamoinen::{STANDARD_RELATIVE_HUMIDITY, saastamoinen_delay_m};
