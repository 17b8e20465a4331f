//! The fusion hub.

pub mod engine;
