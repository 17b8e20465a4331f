//! A seeded, simulated convoy with truth.

mod convoy;
mod profile;
mod road;

pub use convoy::{Convoy, ConvoyOptions, VehicleState};
