//! Messages between agents, hub and listeners: vocabulary, key expressions, encoding, plausibility.
//!
//! A message on the wire is `CX`, the wire version (u16, little endian), one byte for its kind, and the
//! body in postcard. Floats are sent as their eight bytes, so that they arrive bit for bit.
//!
//! Decoding checks size, version, kind and length. A decoded message may still contain implausible
//! values, for which there are [`EpochMessage::validate`], [`EpochMessage::sanitise`] and [`PaceMessage::validate`].
//!
//! Queries are Zenoh selectors, all answers are messages. Versions:
//!
//! - 2: the hub answers queries for receipts and pace with [`ReceiptMessage`] and [`PaceMessage`].
//! - 1: the hub answered them with decimal text.
//!
//! ```
//! # use std::sync::Arc;
//! # use cofix_common::simulation::{Scenario, Simulation};
//! # let simulation = Simulation::new(Scenario { duration_s: 10.0, ..Scenario::default() })?;
//! # let simulated = simulation.epochs(0).next().ok_or("no epoch")?;
//! # let (epoch, products) = (simulated.epoch, Arc::new(simulation.products()));
//! use cofix_common::wire::{EpochMessage, decode, encode, epoch_key};
//! # use cofix_common::pipeline::{PhonePipeline, PipelineOptions};
//!
//! # let message = PhonePipeline::new("SIM1", products, PipelineOptions::default()).process(&epoch);
//! let key = epoch_key("group", &message.phone);
//! let bytes = encode(&message)?;
//! assert_eq!(decode::<EpochMessage>(&bytes)?, message, "{key:?}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#[cfg(test)]
mod document;
mod encoding;
#[cfg(test)]
mod example;
mod key;
mod message;
mod plausible;

pub use encoding::{
    MAXIMUM_MESSAGE_BYTES, MessageKind, WIRE_VERSION, WireError, WireMessage, decode, encode,
};
pub use key::{
    KeyNameError, MAXIMUM_NAME_BYTES, all_epochs_key, all_fused_key, all_liveliness_key, all_paces_key,
    all_receipts_key, all_status_key, check_name, epoch_key, fused_json_key, fused_key, history_key,
    hub_status_key, integrity_key, liveliness_key, pace_key, phone_of_key, receipt_key, status_key,
};
pub use message::{
    EpochMessage, FusedMessage, IntegrityMessage, KeptMessage, PaceMessage, PhoneStatus, Receipt,
    ReceiptMessage, StatusMessage,
};
pub use plausible::{Implausible, InvalidMessage, MAXIMUM_OBSERVATIONS};
