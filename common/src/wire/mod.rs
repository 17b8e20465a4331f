//! Messages between agents, hub and listeners: vocabulary, key expressions, encoding.

mod message;

pub use message::{EpochMessage, FusedMessage};
