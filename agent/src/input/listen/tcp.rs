//! A TCP port.

use std::io::{self, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::time::Duration;

use cofix_common::skips::{Reason, Skips};

use super::{Port, Silence, Transport};
use crate::Stop;
use crate::input::connection::is_no_news;
use crate::input::{Bytes, LOOK, PORTION_BYTES, Portion};

/// Most connections that are looked at before bytes are read again.
const ACCEPTED_AT_ONCE: usize = 16;

/// A TCP port that takes bytes from one client at a time, until a stop is requested.
///
/// A client that comes after the one before has gone, or has been silent for the idle time, goes on with the stream; any other is told that the port
/// is busy, closed and counted.
#[derive(Debug)]
pub struct TcpListening {
    listener: TcpListener,
    port: Port,
    idle: Duration,
    client: Option<(TcpStream, SocketAddr)>,
    silence: Silence,
    /// Whether bytes came before the present client.
    has_served: bool,
    skips: Skips,
}

impl TcpListening {
    /// Listens on an address.
    ///
    /// # Errors
    /// When the address is not one of this computer, or the port is taken.
    pub fn bind(address: SocketAddr, idle: Duration) -> io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        let port = Port { transport: Transport::Tcp, address: listener.local_addr()? };
        tracing::info!("listening on {port}");
        let (silence, skips) = (Silence::new(), Skips::default());
        Ok(Self { listener, port, idle, client: None, silence, has_served: false, skips })
    }

    /// The address with the port that the system chose.
    pub const fn address(&self) -> SocketAddr {
        self.port.address
    }

    /// Takes waiting connections; `true` when one has become the client.
    fn accept(&mut self) -> bool {
        for _ in 0..ACCEPTED_AT_ONCE {
            let (stream, from) = match self.listener.accept() {
                Ok(accepted) => accepted,
                Err(error) if is_no_news(&error) => return false,
                Err(error) => {
                    tracing::warn!("{}: a connection failed: {error}", self.port);
                    return false;
                }
            };
            if let Some(present) = self.present() {
                self.refuse(stream, from, present);
            } else if self.take(stream, from) {
                return true;
            }
        }
        false
    }

    /// The client, if it is there and not idle. One that has closed its connection gives way at once, although nobody has read so far.
    fn present(&self) -> Option<SocketAddr> {
        let (stream, from) = self.client.as_ref()?;
        let _ = stream.set_nonblocking(true);
        let is_closed = matches!(stream.peek(&mut [0]), Ok(0));
        let _ = stream.set_nonblocking(false);
        (!is_closed && !self.silence.exceeds(self.idle)).then_some(*from)
    }

    /// Makes a connection the client; `false` when it cannot be read.
    fn take(&mut self, stream: TcpStream, from: SocketAddr) -> bool {
        if let Err(error) = stream.set_nonblocking(false).and_then(|()| stream.set_read_timeout(Some(LOOK))) {
            tracing::warn!("{}: {from} cannot be read: {error}", self.port);
            return false;
        }
        if let Some((_, before)) = &self.client {
            tracing::warn!("{}: {before} gives way to {from}", self.port);
        } else {
            tracing::info!("{}: {from} is connected", self.port);
        }
        self.silence = Silence::new();
        self.client = Some((stream, from));
        true
    }

    /// Tells a client that there is another one, and closes the connection.
    fn refuse(&mut self, mut stream: TcpStream, from: SocketAddr, present: SocketAddr) {
        self.skips.add(Reason::OtherSenderRefused, || format!("{from}, while {present} sends"));
        // It may be gone already.
        let _ = stream.set_nonblocking(true);
        let _ = stream.write_all(b"busy: another client sends\r\n");
        let _ = stream.shutdown(Shutdown::Both);
    }

    /// Reads once; `None` when no byte arrived in time or the client is gone.
    fn read(&mut self, buffer: &mut [u8]) -> Option<usize> {
        let (stream, from) = self.client.as_mut()?;
        let gone = match stream.read(buffer) {
            Ok(0) => format!("{from} has closed the connection"),
            Ok(count) => return Some(count),
            Err(error) if is_no_news(&error) => return None,
            Err(error) => format!("{from}: {error}"),
        };
        tracing::warn!("{}: {gone}; waiting for another one", self.port);
        self.client = None;
        None
    }
}

impl Bytes for TcpListening {
    fn next(&mut self, buffer: &mut Vec<u8>, stop: &Stop) -> io::Result<Portion> {
        loop {
            if stop.is_requested() {
                return Ok(Portion::End);
            }
            // What the client has sent is read first: it may have closed the connection, and a new one be its own.
            buffer.resize(PORTION_BYTES, 0);
            if let Some(count) = self.read(buffer) {
                buffer.truncate(count);
                self.silence = Silence::new();
                self.has_served = true;
                return Ok(Portion::Bytes);
            }
            if self.accept() && std::mem::take(&mut self.has_served) {
                return Ok(Portion::Broken);
            }
            if self.client.is_none() {
                stop.sleep(LOOK);
            }
            self.silence.tell(self.port);
        }
    }

    fn rejected(&mut self, reason: &str) -> bool {
        if let Some((stream, from)) = self.client.take() {
            tracing::warn!("{}: {from} sends no observations and is closed: {reason}", self.port);
            self.skips.add(Reason::SenderOfNoObservations, || format!("{from}: {reason}"));
            let _ = stream.shutdown(Shutdown::Both);
        }
        self.has_served = false;
        true
    }

    fn skips(&self) -> Option<&Skips> {
        Some(&self.skips)
    }
}
