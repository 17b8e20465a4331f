//! Sources that are pushed: a TCP port that one client at a time sends to, and a UDP port.
//!
//! Whoever reaches the port can feed the agent: it belongs on loopback, or in a network that is trusted.

mod tcp;
mod udp;

use std::fmt;
use std::io;
use std::net::SocketAddr;
use std::time::{Duration, Instant};

pub use tcp::TcpListening;
pub use udp::UdpListening;

use super::Bytes;

/// A sender that has sent nothing for this long gives way to another one.
pub const IDLE: Duration = Duration::from_secs(10);
/// After this long without a byte the log says so, once.
const SILENCE: Duration = Duration::from_mins(1);

/// How bytes are pushed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transport {
    /// One connection at a time.
    Tcp,
    /// Datagrams of one sender at a time, in the order of their arrival.
    Udp,
}

/// A port of this computer to which an app sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Port {
    /// How.
    pub transport: Transport,
    /// Where; port 0 lets the system choose.
    pub address: SocketAddr,
}

impl Port {
    /// The schemes of all ports.
    pub const SCHEMES: [&str; 2] = ["tcp-listen://", "udp-listen://"];

    /// Reads `tcp-listen://ADDRESS:PORT` or `udp-listen://ADDRESS:PORT`, with an IP address; `None` if it is neither.
    pub fn parse(text: &str) -> Option<Self> {
        let transports = [Transport::Tcp, Transport::Udp];
        Self::SCHEMES.iter().zip(transports).find_map(|(scheme, transport)| {
            let address = text.strip_prefix(scheme)?.parse().ok()?;
            Some(Self { transport, address })
        })
    }

    /// Listens.
    ///
    /// # Errors
    /// When the address is not one of this computer, or the port is taken.
    pub fn open(self) -> io::Result<Box<dyn Bytes>> {
        if !self.address.ip().is_loopback() {
            tracing::warn!("{self}: anybody who reaches this address can feed the agent");
        }
        let opened: io::Result<Box<dyn Bytes>> = match self.transport {
            Transport::Tcp => TcpListening::bind(self.address, IDLE).map(|port| Box::new(port) as _),
            Transport::Udp => UdpListening::bind(self.address, IDLE).map(|port| Box::new(port) as _),
        };
        opened.map_err(|error| io::Error::new(error.kind(), format!("cannot listen on {self}: {error}")))
    }
}

impl fmt::Display for Port {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let transport = match self.transport {
            Transport::Tcp => "tcp",
            Transport::Udp => "udp",
        };
        write!(f, "{transport}-listen://{}", self.address)
    }
}

/// When the last byte came.
#[derive(Debug)]
struct Silence {
    since: Instant,
    is_told: bool,
}

impl Silence {
    fn new() -> Self {
        Self { since: Instant::now(), is_told: false }
    }

    /// Whether it has lasted for `idle`.
    fn exceeds(&self, idle: Duration) -> bool {
        self.since.elapsed() >= idle
    }

    /// Says once that nothing comes.
    fn tell(&mut self, port: Port) {
        if !self.is_told && self.exceeds(SILENCE) {
            self.is_told = true;
            tracing::warn!("{port}: nothing came for {} s; still listening", SILENCE.as_secs());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ports_are_read_as_they_are_shown() {
        for text in ["tcp-listen://127.0.0.1:5000", "udp-listen://[::]:65535", "tcp-listen://0.0.0.0:0"] {
            assert_eq!(Port::parse(text).unwrap().to_string(), text);
        }
        for text in ["tcp-listen://phone:5000", "tcp-listen://127.0.0.1", "udp://127.0.0.1:1", ""] {
            assert_eq!(Port::parse(text), None, "{text}");
        }
    }

    #[test]
    fn a_port_that_is_taken_is_named() {
        let taken = TcpListening::bind("127.0.0.1:0".parse().unwrap(), IDLE).unwrap();
        let port = Port { transport: Transport::Tcp, address: taken.address() };
        let error = port.open().err().unwrap().to_string();
        assert!(error.contains(&port.to_string()), "{error}");
    }
}
