//! The agent beside one phone.

pub mod pipeline;
