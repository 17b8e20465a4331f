//! A caster of our own on loopback, in the clear or in TLS.

#![allow(dead_code)] // not every test needs everything

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::time::Duration;

use cofix_agent::Stop;
use cofix_agent::input::ntrip::{Client, Mount, RoverPosition};
use cofix_agent::input::{Backoff, Connected, Trust};
use cofix_agent::source::records::{Records, RecordsError};
use rustls::{ServerConfig, ServerConnection, StreamOwned};

use super::limits::{self, Running};
use super::recordings;

/// A connection of either kind.
trait Wire: Read + Write {}
impl<T: Read + Write> Wire for T {}

/// A caster that gives each connection one script and closes it; it hands back the requests that it got.
pub struct TestCaster {
    pub address: String,
    pub thread: Running<Vec<String>>,
}

impl TestCaster {
    /// Each script is sent in the given portions.
    pub fn start(scripts: Vec<Vec<Vec<u8>>>) -> Self {
        Self::serve(scripts, |connection| Box::new(connection))
    }

    /// The same in TLS. A connection whose handshake fails counts, with an empty request.
    pub fn start_secured(scripts: Vec<Vec<Vec<u8>>>, config: &Arc<ServerConfig>) -> Self {
        let config = Arc::clone(config);
        Self::serve(scripts, move |connection| {
            let session = ServerConnection::new(Arc::clone(&config)).unwrap();
            Box::new(StreamOwned::new(session, connection))
        })
    }

    fn serve(scripts: Vec<Vec<Vec<u8>>>, wrap: impl Fn(TcpStream) -> Box<dyn Wire> + Send + 'static) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let thread = limits::spawn(move || {
            let serve = |script: Vec<Vec<u8>>| {
                let (connection, _) = listener.accept().unwrap();
                connection.set_nodelay(true).unwrap();
                let mut connection = wrap(connection);
                let request = read_head(connection.as_mut());
                for portion in script.iter().filter(|_| !request.is_empty()) {
                    connection.write_all(portion).unwrap();
                }
                request
            };
            scripts.into_iter().map(serve).collect()
        });
        Self { address, thread }
    }

    /// Its stream.
    pub fn mount(&self) -> Mount {
        self.mount_as("ntrip")
    }

    /// Its stream, with a scheme of choice.
    pub fn mount_as(&self, scheme: &str) -> Mount {
        format!("{scheme}://me:se%3Acret@{}/BASE", self.address).parse().unwrap()
    }

    /// Its stream's records.
    pub fn records(&self, rover: &RoverPosition, attempts: u32) -> Records {
        records_of(self.mount(), rover, attempts)
    }

    /// Its stream's records in TLS.
    pub fn secured_records(&self, trust: &Trust, attempts: u32) -> Records {
        let Mount { caster, mount } = self.mount_as("ntrips");
        records_of(Mount { caster: caster.trusting(trust), mount }, &RoverPosition::default(), attempts)
    }

    pub fn requests(self) -> Vec<String> {
        self.thread.join().unwrap()
    }
}

fn records_of(mount: Mount, rover: &RoverPosition, attempts: u32) -> Records {
    let millisecond = Duration::from_millis(1);
    let silence = Duration::from_hours(1);
    let backoff = Backoff { first: millisecond, longest: millisecond, attempts, silence };
    let bytes = Connected::by(Box::new(Client::new(mount, rover.clone())), backoff);
    Records::new(Box::new(bytes), "2024-06-24T08:20:00".parse().unwrap())
}

/// A request's head; empty when the connection ends before it does.
pub fn read_head(connection: &mut (impl Read + ?Sized)) -> String {
    let mut head = Vec::new();
    while !head.ends_with(b"\r\n\r\n") {
        let mut byte = [0];
        if connection.read_exact(&mut byte).is_err() {
            return String::new();
        }
        head.push(byte[0]);
    }
    String::from_utf8(head).unwrap()
}

/// A frame of an RTCM 3 message that is not read, by its number.
pub fn frame(number: u16) -> Vec<u8> {
    recordings::frame(&(number << 4).to_be_bytes())
}

/// This number of messages 1024.
pub fn frames(count: usize) -> Vec<u8> {
    frame(1024).repeat(count)
}

/// How its frames are counted.
pub const NOT_READ: &str = "message 1024 is not read";

pub fn chunked(body: &[u8], size: usize) -> Vec<u8> {
    let chunk = |data: &[u8]| [format!("{:x}\r\n", data.len()).as_bytes(), data, b"\r\n"].concat();
    [body.chunks(size).flat_map(chunk).collect(), b"0\r\n\r\n".to_vec()].concat()
}

pub fn in_portions(bytes: &[u8], size: usize) -> Vec<Vec<u8>> {
    bytes.chunks(size).map(<[u8]>::to_vec).collect()
}

/// Reads to the end; there are no epochs.
pub fn exhaust(records: &mut Records) -> Result<(), RecordsError> {
    while records.next(&Stop::default())?.is_some() {}
    Ok(())
}

pub fn head(text: &str) -> Vec<u8> {
    format!("{text}\r\n\r\n").into_bytes()
}

pub const CHUNKED: &str =
    "HTTP/1.1 200 OK\r\nNtrip-Version: Ntrip/2.0\r\nContent-Type: gnss/data\r\nTransfer-Encoding: chunked";
