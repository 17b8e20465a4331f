//! The group: epochs of several phones brought together ([`align`]) and fused under constraints ([`engine`]). No I/O.

pub mod align;
pub mod engine;
