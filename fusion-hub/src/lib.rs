//! The fusion hub.
//!
//! ```text
//! Zenoh ─▶ network ─▶ intake (decode, sanitise, count) ─▶ align ─▶ engine ─▶ outputs: publisher, recorder, scores
//! ```
//!
//! Zenoh's threads only put bytes into a bounded channel; one thread does everything else, in [`group`]. Its results depend
//! on the messages of each phone and not on how those of different phones interleave.

pub mod demo;
pub mod enroll;
pub mod group;
pub mod journal;
pub mod live;
pub mod network;
pub mod outputs;
pub mod replay;
pub mod report;
pub mod session;
pub mod simulate;
pub mod status;
#[cfg(test)]
mod testing;
