//! A TCP server that sends bytes.

use std::io::{self, Read};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

use super::LOOK;
use super::connection::{Backoff, Connected, Dial, DialError};
use crate::Stop;

/// Longest wait for a server to accept a connection, or to take written bytes.
const ACCEPT: Duration = Duration::from_secs(5);

impl Connected {
    /// A connection to `HOST:PORT`, opened when bytes are first asked for.
    pub fn new(address: &str, backoff: Backoff) -> Self {
        Self::by(Box::new(Plain::new(address)), backoff)
    }
}

/// A server that sends as soon as somebody connects.
pub(super) struct Plain {
    address: String,
}

impl Plain {
    /// The server at `HOST:PORT`.
    pub(super) fn new(address: &str) -> Self {
        Self { address: address.to_owned() }
    }
}

impl Dial for Plain {
    fn name(&self) -> String {
        format!("tcp://{}", self.address)
    }

    fn dial(&mut self, _: &Stop) -> Result<Box<dyn Read>, DialError> {
        Ok(Box::new(open(&self.address)?))
    }
}

/// Connects to the first of the address's hosts that accepts. Reads return within [`LOOK`].
pub(super) fn open(address: &str) -> io::Result<TcpStream> {
    let mut last = io::Error::new(io::ErrorKind::NotFound, "no such host");
    for host in address.to_socket_addrs()? {
        match TcpStream::connect_timeout(&host, ACCEPT) {
            Ok(stream) => {
                stream.set_read_timeout(Some(LOOK))?;
                stream.set_write_timeout(Some(ACCEPT))?;
                return Ok(stream);
            }
            Err(error) => last = error,
        }
    }
    Err(last)
}
