//! Sources of bytes: a recorded file, a growing file, standard input, a TCP server, an NTRIP caster, a port that an app sends to.
//!
//! Every input checks for a request to stop at least every [`LOOK`], and sleeps in between.

mod connection;
mod file;
mod follow;
mod kept;
mod listen;
pub mod ntrip;
mod pipe;
mod tcp;
mod tls;

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;
use std::time::Duration;

use cofix_common::skips::Skips;

use crate::Stop;

pub use connection::{Backoff, Connected, Dial, DialError};
pub use file::Recorded;
pub use follow::Followed;
pub(crate) use kept::Kept;
pub use kept::RawFiles;
pub use listen::{IDLE, Port, TcpListening, Transport, UdpListening};
pub use pipe::Piped;
pub use tls::{Trust, TrustError};

/// Interval at which an idle source checks for a request to stop, and a growing file for growth.
pub const LOOK: Duration = Duration::from_millis(100);
/// Bytes in a portion.
const PORTION_BYTES: usize = 65_536;

/// The next portion of a source.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Portion {
    /// Bytes that continue those before; they are in the caller's buffer.
    Bytes,
    /// The next bytes do not continue those before: a connection was lost.
    Broken,
    /// The next bytes are another file's, from its beginning.
    Restarted,
    /// The end, or a request to stop.
    End,
    /// The source failed before its end: the reason is in [`Bytes::failure_reason`].
    Lost,
}

/// A source of bytes.
pub trait Bytes {
    /// Puts the next bytes into `buffer`, in place of its content. Blocks until there are some, the source ends, or a stop is requested.
    ///
    /// # Errors
    /// When the source fails before it gave anything.
    fn next(&mut self, buffer: &mut Vec<u8>, stop: &Stop) -> std::io::Result<Portion>;

    /// Why the source was [`Portion::Lost`].
    fn failure_reason(&self) -> Option<&str> {
        None
    }

    /// Takes note that what came is of no format that is read, and why. Returns whether the source goes on with another sender.
    fn rejected(&mut self, reason: &str) -> bool {
        let _ = reason;
        false
    }

    /// What the source itself left out, and why.
    fn skips(&self) -> Option<&Skips> {
        None
    }
}

/// A live source by name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LiveSource {
    /// A file that is being written.
    Follow(PathBuf),
    /// Standard input, `-`.
    Standard,
    /// `tcp://HOST:PORT`: a server that sends bytes.
    Tcp {
        /// `HOST:PORT`.
        address: String,
        /// How its connection is tried again.
        backoff: Backoff,
    },
    /// `tcp-listen://ADDRESS:PORT`, `udp-listen://ADDRESS:PORT`: a port of this computer that an app sends to.
    Listen(Port),
    /// `ntrip://USER:PASSWORD@HOST:PORT/MOUNT`: a stream of an NTRIP caster; `ntrips://…` within TLS.
    Ntrip {
        /// Caster, account and mount point.
        mount: ntrip::Mount,
        /// How its connection is tried again.
        backoff: Backoff,
    },
}

/// Invalid address of a live source.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AddressError {
    /// Neither `-` nor a TCP server.
    #[error(
        "'{text}' is not a source: write tcp://HOST:PORT, for example tcp://192.168.1.20:5000, tcp-listen://ADDRESS:PORT or \
         udp-listen://ADDRESS:PORT with an IP address of this computer, or ntrip://USER:PASSWORD@HOST:PORT/MOUNT (ntrips:// with TLS)"
    )]
    Unknown {
        /// The text, without a password.
        text: String,
    },
    /// A caster's address that cannot be used.
    #[error(transparent)]
    Ntrip(#[from] ntrip::CasterError),
}

impl FromStr for LiveSource {
    type Err = AddressError;

    /// Reads `-`, `tcp://HOST:PORT`, `tcp-listen://ADDRESS:PORT`, `udp-listen://ADDRESS:PORT`, `ntrip://USER:PASSWORD@HOST:PORT/MOUNT` or `ntrips://…`.
    fn from_str(text: &str) -> Result<Self, AddressError> {
        if text == "-" {
            return Ok(Self::Standard);
        }
        if text.starts_with("ntrip") {
            return Ok(Self::Ntrip { mount: text.parse()?, backoff: Backoff::default() });
        }
        if let Some(port) = Port::parse(text) {
            return Ok(Self::Listen(port));
        }
        let address = text.strip_prefix("tcp://").unwrap_or_default();
        let port = address.rsplit_once(':').filter(|(host, _)| !host.is_empty());
        match port.and_then(|(_, port)| port.parse::<u16>().ok()) {
            Some(1..) => Ok(Self::Tcp { address: address.to_owned(), backoff: Backoff::default() }),
            _ => Err(AddressError::Unknown { text: ntrip::without_password(text) }),
        }
    }
}

impl fmt::Display for LiveSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Follow(path) => write!(f, "{}, as it grows", path.display()),
            Self::Standard => f.write_str("standard input"),
            Self::Tcp { address, .. } => write!(f, "tcp://{address}"),
            Self::Listen(port) => port.fmt(f),
            Self::Ntrip { mount, .. } => mount.fmt(f),
        }
    }
}

impl LiveSource {
    /// Whether a text names a live source, well-formed or not, and not a file.
    pub fn is_named_by(text: &str) -> bool {
        let mut schemes = ["tcp://", "ntrip://", "ntrips://"].into_iter().chain(Port::SCHEMES);
        text == "-" || schemes.any(|scheme| text.starts_with(scheme))
    }

    /// Whether its connection is in TLS.
    pub const fn is_secured(&self) -> bool {
        matches!(self, Self::Ntrip { mount, .. } if mount.caster.trust().is_some())
    }

    /// The same source with other trusted certificates; of effect in TLS only.
    #[must_use]
    pub fn trusting(self, trust: &Trust) -> Self {
        match self {
            Self::Ntrip { mount, backoff } => {
                let ntrip::Mount { caster, mount } = mount;
                Self::Ntrip { mount: ntrip::Mount { caster: caster.trusting(trust), mount }, backoff }
            }
            other => other,
        }
    }

    /// Opens it.
    ///
    /// # Errors
    /// When the file to follow cannot be opened, or standard input was given to another reader.
    pub fn open(&self) -> std::io::Result<Box<dyn Bytes>> {
        self.open_near(&ntrip::RoverPosition::default())
    }

    /// Opens it for a rover, whose position is sent to a caster.
    ///
    /// # Errors
    /// As of [`LiveSource::open`].
    pub fn open_near(&self, rover: &ntrip::RoverPosition) -> std::io::Result<Box<dyn Bytes>> {
        Ok(match self {
            Self::Follow(path) => Box::new(Followed::open(path)?),
            Self::Standard => Box::new(Piped::start(std::io::stdin())?),
            Self::Tcp { address, backoff } => Box::new(Connected::new(address, *backoff)),
            Self::Listen(port) => port.open()?,
            Self::Ntrip { mount, backoff } => {
                let client = ntrip::Client::new(mount.clone(), rover.clone());
                Box::new(Connected::by(Box::new(client), *backoff))
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sources_are_read_and_refused() {
        assert_eq!("-".parse(), Ok(LiveSource::Standard));
        for address in ["phone.local:5000", "192.168.1.20:1", "[::1]:65535"] {
            let source: LiveSource = format!("tcp://{address}").parse().unwrap();
            assert_eq!(source.to_string(), format!("tcp://{address}"));
        }
        for text in [
            "",
            "tcp://",
            "tcp://host",
            "tcp://:5000",
            "tcp://host:0",
            "tcp://host:65536",
            "udp://h:1",
            "tcp-listen://h:1",
        ] {
            let error = text.parse::<LiveSource>().unwrap_err().to_string();
            assert!(error.contains("tcp://HOST:PORT"), "{error}");
        }
    }
}
