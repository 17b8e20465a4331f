//! The agent beside one phone.
//!
//! [`run`] reads a phone's observations and publishes one message per epoch:
//!
//! ```text
//! input (bytes) ─▶ decoder ─▶ records ─▶ source
//!        ─▶ pipeline (correct → solve → RAIM → local filter) ─▶ pace ─▶ publication ─▶ Zenoh
//! ```
//!
//! Everything here blocks: run an agent on a thread of its own. The hub's `replay` runs several in one process, each with
//! a Zenoh session of its own.

pub mod clock;
mod config;
pub mod convert;
pub mod corrections;
pub mod files;
pub mod input;
pub mod inspect;
pub mod join;
pub mod publication;
mod run;
pub mod settings;
pub mod source;
pub mod status;
pub mod stop;

pub use config::{
    AgentConfig, CorrectionSource, CorrectionSourceError, Corrections, ProductFiles, ProductSource, Source,
    Speed, SpeedError,
};
pub use run::{AgentError, AgentReport, run, run_watched};
pub use stop::Stop;
