//! A UDP port.

use std::io;
use std::net::{SocketAddr, UdpSocket};
use std::time::Duration;

use cofix_common::skips::{Reason, Skips};

use super::{Port, Silence, Transport};
use crate::Stop;
use crate::input::connection::is_no_news;
use crate::input::{Bytes, LOOK, PORTION_BYTES, Portion};

/// A UDP port that takes datagrams of one sender at a time as portions of one stream, until a stop is requested. A line may go on in the next datagram.
///
/// Another sender is taken when the one before has been silent for the idle time; until then its datagrams are counted and dropped. What the
/// network loses or exchanges nobody is told: the lines that it tears are counted by the decoder.
#[derive(Debug)]
pub struct UdpListening {
    socket: UdpSocket,
    port: Port,
    idle: Duration,
    sender: Option<SocketAddr>,
    /// The first datagram of a new sender, once the stream was interrupted.
    first: Option<Vec<u8>>,
    silence: Silence,
    skips: Skips,
}

impl UdpListening {
    /// Listens on an address.
    ///
    /// # Errors
    /// When the address is not one of this computer, or the port is taken.
    pub fn bind(address: SocketAddr, idle: Duration) -> io::Result<Self> {
        let socket = UdpSocket::bind(address)?;
        socket.set_read_timeout(Some(LOOK))?;
        let port = Port { transport: Transport::Udp, address: socket.local_addr()? };
        tracing::info!("listening on {port}");
        let (silence, skips) = (Silence::new(), Skips::default());
        Ok(Self { socket, port, idle, sender: None, first: None, silence, skips })
    }

    /// The address with the port that the system chose.
    pub const fn address(&self) -> SocketAddr {
        self.port.address
    }

    /// The portion that a datagram in `buffer` makes; `None` if it is of a sender that is not taken.
    fn portion(&mut self, buffer: &mut Vec<u8>, from: SocketAddr) -> Option<Portion> {
        let present = self.sender;
        if let Some(present) = present.filter(|present| *present != from)
            && !self.silence.exceeds(self.idle)
        {
            self.skips.add(Reason::OtherSenderRefused, || format!("{from}, while {present} sends"));
            return None;
        }
        self.silence = Silence::new();
        if self.sender.replace(from) == Some(from) {
            return Some(Portion::Bytes);
        }
        tracing::info!("{}: {from} sends", self.port);
        if present.is_none() {
            return Some(Portion::Bytes);
        }
        self.first = Some(std::mem::take(buffer));
        Some(Portion::Broken)
    }
}

impl Bytes for UdpListening {
    fn next(&mut self, buffer: &mut Vec<u8>, stop: &Stop) -> io::Result<Portion> {
        if let Some(first) = self.first.take() {
            *buffer = first;
            return Ok(Portion::Bytes);
        }
        loop {
            if stop.is_requested() {
                return Ok(Portion::End);
            }
            buffer.resize(PORTION_BYTES, 0);
            match self.socket.recv_from(buffer) {
                Ok((count, from)) => {
                    buffer.truncate(count);
                    if let Some(portion) = self.portion(buffer, from) {
                        return Ok(portion);
                    }
                }
                Err(error) if is_no_news(&error) => {}
                Err(error) => {
                    // An answer to what nobody sent, or the network is down for now.
                    tracing::warn!("{}: {error}", self.port);
                    stop.sleep(LOOK);
                }
            }
            self.silence.tell(self.port);
        }
    }

    fn rejected(&mut self, reason: &str) -> bool {
        if let Some(from) = self.sender.take() {
            tracing::warn!("{}: {from} sends no observations: {reason}", self.port);
            self.skips.add(Reason::SenderOfNoObservations, || format!("{from}: {reason}"));
        }
        true
    }

    fn skips(&self) -> Option<&Skips> {
        Some(&self.skips)
    }
}
