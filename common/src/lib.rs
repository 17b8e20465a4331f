//! The science and the vocabulary of cooperative smartphone positioning.
//!
//! This crate knows no sockets, no asynchronous runtime, no Zenoh and no Rerun. Parsers take bytes and
//! return records; estimation is plain structs. Everything inside is in SI units and radians; degrees
//! appear only in files and on the command line.

pub mod accuracy;
pub mod atmosphere;
pub mod constants;
pub mod constraint;
pub mod decode;
pub mod filter;
pub mod frames;
pub mod gnss;
pub mod gnsslogger;
pub mod gsdc;
mod integer;
pub mod integrity;
mod lost_locks;
pub mod measurement;
mod moscow;
pub mod navbits;
pub mod orbit;
pub mod rinex;
pub mod rtcm;
pub mod simulation;
pub mod skips;
pub mod solve;
pub mod statistics;
pub mod text;
pub mod time;
mod time_order;
mod time_system;
pub mod whu;
pub mod wire;
