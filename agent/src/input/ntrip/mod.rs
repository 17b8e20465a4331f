//! Streams of NTRIP casters: corrections and ephemerides over the Internet (RTCM 10410.1, NTRIP 2.0; revision 1 replies are understood).
//!
//! - The request is one of revision 2 (HTTP/1.1). A caster of revision 1 ignores what it does not know of it and answers `ICY 200 OK`;
//!   one that answers that it does not understand is asked again as revision 1.
//! - A caster hears where the rover is, once that is known and every ten seconds from then on, as a GGA sentence: virtual reference
//!   stations need it. Casters of one real station ignore it.
//! - `ntrips://` is the same within TLS ([`super::Trust`]). Without it the password goes over the network unencrypted; it appears in no message.

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
