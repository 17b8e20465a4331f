//! The science and the vocabulary of cooperative smartphone positioning.
//!
//! This crate knows no sockets, no asynchronous runtime, no Zenoh and no Rerun. Parsers take bytes and
//! return records; estimation is plain structs. Everything inside is in SI units and radians; degrees
//! appear only in files and on the command line.

pub mod accuracy;
pub mod atmosphere;
pub mod constants;
pub mod constraint;
pub mod filter;
pub mod formats;
pub mod frames;
pub mod fusion;
pub mod gnss;
pub mod integrity;
pub mod measurement;
pub mod orbit;
pub mod pipeline;
pub mod settings;
pub mod simulation;
pub mod skips;
pub mod solve;
pub mod statistics;
pub mod time;
pub mod wire;
