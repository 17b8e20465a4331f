//! The fusion hub.

pub mod align;
pub mod engine;
pub mod recorder;
pub mod session;
