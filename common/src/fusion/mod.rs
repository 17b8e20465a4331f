//! Fusion of the group: alignment of the phones' epochs ([`align`]) and the joint filter with its constraints ([`engine`]). No I/O.

pub mod align;
mod biased;
mod doubt;
pub mod engine;
mod group;
pub mod peers;
