//! Asks a caster for a stream and reads it.

use std::io::{self, Read, Write};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use cofix_common::frames::Ecef;

use super::address::{Caster, Mount};
use super::chunks::{Chunks, Damaged};
use super::gga;
use super::reply::{Reply, read_reply};
use crate::Stop;
use crate::clock;
use crate::input::connection::{Dial, DialError, is_no_news};
use crate::input::{PORTION_BYTES, tcp, tls};

/// Longest wait for a caster's reply.
const REPLY: Duration = Duration::from_secs(10);
/// Interval at which a caster is sent the rover's position.
const REPORT: Duration = Duration::from_secs(10);

/// Silence of a granted stream after which it is logged that the caster may wait for a position.
const SILENCE: Duration = Duration::from_secs(10);
/// Distance of a rover from the Earth's centre, m: from the bottom of the sea at a pole to an aeroplane at the equator.
const RADIUS_BOUNDS_M: std::ops::RangeInclusive<f64> = 6.33e6..=6.41e6;
/// Advice for a caster that waits for a position.
const NO_POSITION: &str = "no position could be told to the caster, and some send nothing before they know it: give --approximate-position \
                           LATITUDE,LONGITUDE,HEIGHT";

/// Advice for a caster that answers in TLS.
pub(super) const SPEAKS_TLS: &str =
    "the caster speaks TLS at this port: write ntrips:// in place of ntrip://";

/// Advice for a web server.
const WEB_PAGE: &str = "a web page is answered in place of a stream: is this the caster's port?";

/// The rover's position, if it is known. Clones share it.
#[derive(Clone, Debug, Default)]
pub struct RoverPosition(Arc<Mutex<Option<Ecef>>>);

impl RoverPosition {
    /// Sets it.
    pub fn set(&self, position: Ecef) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(position);
    }

    /// Sets an approximate position, where none is known and `position` is near the Earth's surface: headers may have zeros.
    pub fn suppose(&self, position: Option<Ecef>) {
        let position = position.filter(|position| RADIUS_BOUNDS_M.contains(&position.0.norm()));
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        *known = known.or(position);
    }

    /// The last position set.
    pub fn get(&self) -> Option<Ecef> {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The revision of the protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Revision {
    First,
    Second,
}

/// A client for one stream of a caster.
pub struct Client {
    mount: Mount,
    rover: RoverPosition,
    revision: Revision,
}

impl Client {
    /// A client that sends the caster the position of `rover`.
    pub const fn new(mount: Mount, rover: RoverPosition) -> Self {
        Self { mount, rover, revision: Revision::Second }
    }

    fn refusal(&mut self, reply: Reply) -> DialError {
        let Mount { caster, mount } = &self.mount;
        match reply {
            Reply::Unauthorized(text) => DialError::Refused(unauthorized(caster, &text)),
            Reply::NotFound(text) => DialError::Refused(no_such_mount(caster, mount, &text)),
            Reply::Sourcetable { .. } => {
                DialError::Refused(no_such_mount(caster, mount, "it sent its sourcetable"))
            }
            Reply::NotUnderstood(text) if self.revision == Revision::Second => {
                self.revision = Revision::First;
                DialError::Failed(format!(
                    "the caster does not understand NTRIP 2 ({text}): asking as NTRIP 1"
                ))
            }
            Reply::NotUnderstood(text) | Reply::Other(text) => {
                DialError::Failed(format!("the caster answers '{text}'"))
            }
            Reply::WebPage { .. } => DialError::Refused(WEB_PAGE.to_owned()),
            Reply::Tls => DialError::Refused(SPEAKS_TLS.to_owned()),
            Reply::Stream { .. } => DialError::Failed("the stream is there".to_owned()),
        }
    }
}

/// Advice for a refused account.
pub(super) fn unauthorized(caster: &Caster, said: &str) -> String {
    if let Some(user) = caster.user() {
        return format!("the caster refuses user '{user}' ({said}): check user, password and their rights");
    }
    let scheme = caster.scheme();
    format!("the caster wants an account ({said}): write {scheme}USER:PASSWORD@HOST:PORT/MOUNT")
}

fn no_such_mount(caster: &Caster, mount: &str, said: &str) -> String {
    format!(
        "the caster has no mount point '{mount}' now ({said}): list them with 'cofix-agent sourcetable {caster}'"
    )
}

impl Dial for Client {
    fn name(&self) -> String {
        self.mount.to_string()
    }

    fn advice(&self) -> Option<&'static str> {
        self.rover.get().is_none().then_some(NO_POSITION)
    }

    fn dial(&mut self, stop: &Stop) -> Result<Box<dyn Read>, DialError> {
        let mut wire = connect(&self.mount.caster, stop)?;
        let position = self.rover.get().map(sentence_now);
        let gga = position.filter(|_| self.revision == Revision::Second);
        let path = format!("/{}", self.mount.mount);
        wire.write_all(request(&self.mount.caster, &path, self.revision, gga.as_deref()).as_bytes())?;
        let (reply, body) = await_reply(wire.as_mut(), &self.mount.caster, stop)?;
        match reply {
            Reply::Stream { chunked } => {
                let mut stream = Stream::new(wire, chunked, self.rover.clone(), self.name());
                stream.body.take(&body);
                Ok(Box::new(stream))
            }
            refusal => Err(self.refusal(refusal)),
        }
    }
}

fn sentence_now(position: Ecef) -> String {
    gga::sentence(position, clock::now())
}

/// A connection to a caster, in TLS or not.
pub(super) trait Wire: Read + Write {}

impl<T: Read + Write> Wire for T {}

/// Connects to a caster. Reads return within [`crate::input::LOOK`].
pub(super) fn connect(caster: &Caster, stop: &Stop) -> Result<Box<dyn Wire>, DialError> {
    Ok(match caster.trust() {
        None => Box::new(tcp::open(&caster.address())?),
        Some(trust) => Box::new(tls::open(&caster.host, caster.port, trust, stop)?),
    })
}

/// The request for a path, with the position in revision 2's header.
pub(super) fn request(caster: &Caster, path: &str, revision: Revision, gga: Option<&str>) -> String {
    let mut lines = match revision {
        Revision::First => vec![format!("GET {path} HTTP/1.0")],
        Revision::Second => vec![
            format!("GET {path} HTTP/1.1"),
            format!("Host: {}", caster.address()),
            "Ntrip-Version: Ntrip/2.0".to_owned(),
        ],
    };
    lines.push(format!("User-Agent: NTRIP cofix-agent/{}", env!("CARGO_PKG_VERSION")));
    lines.extend(caster.authorization().map(|authorization| format!("Authorization: {authorization}")));
    lines.extend(gga.map(|gga| format!("Ntrip-GGA: {}", gga.trim_end())));
    lines.extend(["Accept: */*", "Connection: close", "", ""].map(str::to_owned));
    lines.join("\r\n")
}

/// Reads a caster's reply, and the part of its data that arrived with it.
pub(super) fn await_reply(
    wire: &mut dyn Wire,
    caster: &Caster,
    stop: &Stop,
) -> Result<(Reply, Vec<u8>), DialError> {
    let asked = Instant::now();
    let (mut bytes, mut buffer) = (Vec::new(), vec![0; 4_096]);
    while asked.elapsed() < REPLY && !stop.is_requested() {
        let ended = match wire.read(&mut buffer) {
            Ok(count) => {
                bytes.extend_from_slice(buffer.get(..count).unwrap_or_default());
                count == 0
            }
            Err(error) if is_no_news(&error) => continue,
            Err(error) if error.kind() == io::ErrorKind::ConnectionReset => true,
            Err(error) => return Err(error.into()),
        };
        if ended && bytes.is_empty() {
            return Err(DialError::Failed(without_reply(caster)));
        }
        if let Some((reply, length)) = read_reply(&bytes, ended) {
            return Ok((reply, bytes.split_off(length.min(bytes.len()))));
        }
    }
    let waited_s = REPLY.as_secs();
    Err(DialError::Failed(format!("the caster did not reply within {waited_s} s")))
}

fn without_reply(caster: &Caster) -> String {
    let perhaps = if caster.trust().is_some() { "" } else { ": a port for TLS is written ntrips://" };
    format!("the caster closed the connection without a reply{perhaps}")
}

/// The data of a reply, without the transfer coding.
#[derive(Debug)]
pub struct Body {
    chunks: Option<Chunks>,
    ready: Vec<u8>,
    given: usize,
    damaged: bool,
}

impl Body {
    /// For a reply in chunks, or without coding.
    pub fn new(chunked: bool) -> Self {
        Self { chunks: chunked.then(Chunks::default), ready: Vec::new(), given: 0, damaged: false }
    }

    /// Takes bytes as they arrived.
    pub fn take(&mut self, bytes: &[u8]) {
        match &mut self.chunks {
            None => self.ready.extend_from_slice(bytes),
            Some(chunks) => self.damaged |= chunks.feed(bytes, &mut self.ready).is_err(),
        }
    }

    /// Moves the decoded bytes to the buffer; returns their number.
    pub fn give(&mut self, buffer: &mut [u8]) -> usize {
        let ready = self.ready.get(self.given..).unwrap_or_default();
        let count = ready.len().min(buffer.len());
        for (to, from) in buffer.iter_mut().zip(ready) {
            *to = *from;
        }
        self.given += count;
        if self.given == self.ready.len() {
            self.ready.clear();
            self.given = 0;
        }
        count
    }

    /// Whether the body is complete, although the connection may stay.
    ///
    /// # Errors
    /// When the last bytes are damaged.
    pub fn is_complete(&self) -> io::Result<bool> {
        if self.damaged {
            return Err(io::Error::new(io::ErrorKind::InvalidData, Damaged));
        }
        Ok(self.chunks.as_ref().is_some_and(Chunks::is_complete))
    }
}

/// A stream that was granted.
struct Stream {
    wire: Box<dyn Wire>,
    body: Body,
    rover: RoverPosition,
    reported: Option<Instant>,
    raw: Vec<u8>,
    name: String,
    /// Since when no byte has arrived at all; `None` once a byte has arrived, or the silence was logged.
    silent_since: Option<Instant>,
}

impl Stream {
    fn new(wire: Box<dyn Wire>, chunked: bool, rover: RoverPosition, name: String) -> Self {
        let (body, raw, silent_since) = (Body::new(chunked), vec![0; PORTION_BYTES], Some(Instant::now()));
        Self { wire, body, rover, reported: None, raw, name, silent_since }
    }

    /// Logs once that the caster may wait for a position.
    fn say_silence(&mut self) {
        let is_long = self.silent_since.is_some_and(|since| since.elapsed() >= SILENCE);
        if is_long && self.reported.is_none() {
            self.silent_since = None;
            tracing::warn!("{}: nothing has come for {} s: {NO_POSITION}", self.name, SILENCE.as_secs());
        }
    }

    /// Sends the rover's position to the caster, when that is due.
    fn report(&mut self) -> io::Result<()> {
        let is_due = self.reported.is_none_or(|at| at.elapsed() >= REPORT);
        if let Some(position) = self.rover.get().filter(|_| is_due) {
            self.wire.write_all(sentence_now(position).as_bytes())?;
            self.reported = Some(Instant::now());
        }
        Ok(())
    }
}

impl Read for Stream {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.report()?;
        loop {
            let count = self.body.give(buffer);
            if count > 0 || self.body.is_complete()? {
                self.silent_since = None;
                return Ok(count);
            }
            let read = self.wire.read(&mut self.raw).inspect_err(|_| self.say_silence())?;
            if read == 0 {
                return Ok(0);
            }
            self.body.take(self.raw.get(..read).unwrap_or_default());
        }
    }
}
