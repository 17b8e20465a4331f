//! Readers and writers of files and streams, a module for each format, and the parts that they share.
//!
//! Readers take bytes and give records; lines and messages that cannot be read are counted in [`crate::skips::Skips`]. The types of the
//! records belong to the modules that use them: observations to [`crate::gnss`], ephemerides and precise products to [`crate::orbit`], maps of the ionosphere
//! to [`crate::atmosphere`].

mod android;
pub mod bias_sinex;
mod bits;
mod decimal;
pub mod decode;
pub mod format;
pub mod gnsslogger;
pub mod gsdc;
mod integer;
pub mod ionex;
pub mod kinds;
mod lines;
mod lost_locks;
mod moscow;
pub mod navbits;
pub mod packing;
pub mod phone;
pub mod rinex;
pub mod rinex_clocks;
pub mod rtcm;
pub mod sp3;
pub mod stream;
pub mod text;
mod time_order;
mod time_system;
pub mod truth;
pub mod whu;
