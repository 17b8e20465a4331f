//! Streams of NTRIP casters: corrections and ephemerides over the Internet (RTCM 10410.1, NTRIP 2.0; revision 1 replies are understood).
//!
//! - The request is of revision 2 (HTTP/1.1). A caster of revision 1 ignores its unknown headers and answers `ICY 200 OK`; a caster that
//!   does not understand it is asked again by revision 1.
//! - A caster is sent the rover's position, once it is known and every ten seconds from then on, as a GGA sentence: virtual reference
//!   stations need it. Casters of real stations ignore it.
//! - `ntrips://` is the same in TLS ([`super::Trust`]). Without it the password goes over the network unencrypted; it appears in no message.

mod address;
mod chunks;
mod client;
mod gga;
mod reply;
mod sourcetable;

pub use address::{Caster, CasterError, Mount, without_password};
pub use client::{Body, Client, RoverPosition};
pub use reply::{Reply, read_reply};
pub use sourcetable::{Sourcetable, SourcetableError, StreamEntry, sourcetable};
