//! The fusion hub.

pub mod engine;
pub mod recorder;
