//! Connections to servers that send bytes: opened again when they are lost.

use std::io::{self, Read};
use std::time::{Duration, Instant};

use super::{Bytes, PORTION_BYTES, Portion};
use crate::Stop;

/// A way to connect to a server.
pub trait Dial {
    /// The server's name for messages, without secrets.
    fn name(&self) -> String;

    /// Advice for connections without data.
    fn advice(&self) -> Option<&'static str> {
        None
    }

    /// Makes one attempt. The reader returns bytes as they arrive, 0 at the end, and an error of kind `WouldBlock` or `TimedOut` when none
    /// arrived for [`super::LOOK`].
    ///
    /// # Errors
    /// When there is no connection.
    fn dial(&mut self, stop: &Stop) -> Result<Box<dyn Read>, DialError>;
}

/// Why there is no connection.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DialError {
    /// Another attempt may help.
    Failed(String),
    /// The server refuses: unless it has served before, another attempt will not help.
    Refused(String),
}

impl From<io::Error> for DialError {
    fn from(error: io::Error) -> Self {
        Self::Failed(error.to_string())
    }
}

/// How a lost connection is tried again: after `first`, then after twice as long each time, but never longer than
/// `longest`, until `attempts` in a row brought no byte. After a connection that lasted longer than the wait before it, the waits start with `first` again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Backoff {
    /// The first wait.
    pub first: Duration,
    /// The longest wait.
    pub longest: Duration,
    /// Attempts in a row without a byte before giving up.
    pub attempts: u32,
    /// Time without a byte after which a connection counts as lost.
    pub silence: Duration,
}

impl Default for Backoff {
    /// Waits of 0.5 s to 30 s and twelve attempts, four minutes in all; one minute of silence.
    fn default() -> Self {
        Self {
            first: Duration::from_millis(500),
            longest: Duration::from_secs(30),
            attempts: 12,
            silence: Duration::from_mins(1),
        }
    }
}

impl Backoff {
    /// The wait before the next attempt after `number` attempts; the first is made at once.
    fn wait(&self, number: u32) -> Duration {
        match number.checked_sub(1) {
            None => Duration::ZERO,
            Some(doublings) => {
                self.first.saturating_mul(1_u32.checked_shl(doublings).unwrap_or(u32::MAX)).min(self.longest)
            }
        }
    }
}

/// A connection that is opened again when it is lost.
pub struct Connected {
    dial: Box<dyn Dial>,
    backoff: Backoff,
    stream: Option<Box<dyn Read>>,
    /// Attempts since the last byte, including the attempt that brought it.
    attempts: u32,
    /// The last wait.
    waited: Duration,
    /// When the present connection was made.
    since: Instant,
    /// Connections in a row that brought bytes and ended before the wait before them was over again.
    short_lived: u32,
    /// Time of the last byte.
    silent_since: Instant,
    /// Whether bytes arrived before the connection was lost.
    interrupted: bool,
    /// Whether bytes have ever arrived.
    has_served: bool,
    failure_reason: Option<String>,
}

impl Connected {
    /// A connection made by `dial` when bytes are first asked for.
    pub fn by(dial: Box<dyn Dial>, backoff: Backoff) -> Self {
        Self {
            dial,
            backoff,
            stream: None,
            attempts: 0,
            waited: Duration::ZERO,
            since: Instant::now(),
            short_lived: 0,
            silent_since: Instant::now(),
            interrupted: false,
            has_served: false,
            failure_reason: None,
        }
    }

    /// The wait that is due before the next attempt.
    fn wait_due(&self) -> Duration {
        let number = if self.attempts == 0 { 0 } else { self.attempts.max(self.short_lived + 1) };
        self.backoff.wait(number)
    }

    /// Tries once to connect, after the wait that is due.
    fn connect(&mut self, stop: &Stop) {
        let wait = self.wait_due();
        self.attempts += 1;
        if stop.is_requested() || !wait.is_zero() && stop.sleep(wait) {
            return;
        }
        match self.dial.dial(stop) {
            Ok(stream) => {
                tracing::info!("connected to {}", self.dial.name());
                self.stream = Some(stream);
                self.waited = wait;
                self.since = Instant::now();
                self.silent_since = self.since;
            }
            Err(_) if stop.is_requested() => {}
            Err(DialError::Refused(reason)) if !self.has_served => {
                self.attempts = self.backoff.attempts;
                self.failure_reason = Some(format!("{}: {reason}", self.dial.name()));
            }
            Err(DialError::Failed(reason) | DialError::Refused(reason)) => self.failed(&reason),
        }
    }

    /// Notes a lost or failed connection, and logs when it is tried again.
    fn failed(&mut self, reason: &str) {
        let was_open = self.stream.take().is_some();
        if was_open {
            self.short_lived = if self.since.elapsed() > self.waited { 0 } else { self.short_lived + 1 };
        }
        let (name, attempts) = (self.dial.name(), self.attempts);
        // A connection that was made and brought nothing.
        let advice = self.dial.advice().filter(|_| was_open && !self.has_served);
        let reason = advice.map_or(reason.to_owned(), |advice| format!("{reason}: {advice}"));
        if attempts < self.backoff.attempts {
            let wait_s = self.wait_due().as_secs_f64();
            tracing::warn!("{name}: {reason}; trying again in {wait_s} s");
        }
        self.failure_reason = Some(format!("{name}: {reason}; {attempts} attempts in a row brought no byte"));
    }

    /// Reads once; `None` when no byte arrived in time or the connection was lost.
    fn read(&mut self, buffer: &mut [u8]) -> Option<usize> {
        let stream = self.stream.as_mut()?;
        match stream.read(buffer) {
            Ok(0) => self.failed("the server closed the connection"),
            Ok(count) => {
                self.silent_since = Instant::now();
                // The next attempt waits: a server that accepts and drops must not be asked without pause.
                self.attempts = 1;
                self.has_served = true;
                return Some(count);
            }
            Err(error) if is_no_news(&error) => {
                if self.silent_since.elapsed() > self.backoff.silence {
                    let silence_s = self.backoff.silence.as_secs_f64();
                    self.failed(&format!("nothing came for {silence_s} s"));
                }
            }
            Err(error) => self.failed(&error.to_string()),
        }
        None
    }
}

/// Whether an error of a read only says that no byte arrived in time.
pub(super) fn is_no_news(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut | io::ErrorKind::Interrupted)
}

impl Bytes for Connected {
    fn next(&mut self, buffer: &mut Vec<u8>, stop: &Stop) -> io::Result<Portion> {
        loop {
            if stop.is_requested() {
                return Ok(Portion::End);
            }
            if self.stream.is_none() {
                if self.attempts >= self.backoff.attempts {
                    return Ok(Portion::Lost);
                }
                self.connect(stop);
                if self.stream.is_some() && std::mem::take(&mut self.interrupted) {
                    return Ok(Portion::Broken);
                }
                continue;
            }
            buffer.resize(PORTION_BYTES, 0);
            if let Some(count) = self.read(buffer) {
                buffer.truncate(count);
                self.interrupted = true;
                return Ok(Portion::Bytes);
            }
        }
    }

    fn failure_reason(&self) -> Option<&str> {
        self.failure_reason.as_deref()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waits_double_up_to_the_longest() {
        let backoff = Backoff::default();
        let waits: Vec<_> = (0..9).map(|number| backoff.wait(number).as_secs_f64()).collect();
        assert_eq!(waits, [0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 30.0, 30.0]);
        assert_eq!(backoff.wait(u32::MAX), backoff.longest);
    }

    /// Greets and closes.
    struct Greeter;

    impl Dial for Greeter {
        fn name(&self) -> String {
            "greeter".to_owned()
        }

        fn dial(&mut self, _: &Stop) -> Result<Box<dyn Read>, DialError> {
            Ok(Box::new(&b"hello"[..]))
        }
    }

    #[test]
    fn a_server_that_greets_and_closes_is_asked_ever_more_seldom() {
        let first = Duration::from_millis(10);
        let backoff = Backoff { first, ..Backoff::default() };
        let mut connected = Connected::by(Box::new(Greeter), backoff);
        let (began, mut buffer, mut greetings) = (Instant::now(), Vec::new(), 0);
        while greetings < 5 {
            greetings += u32::from(connected.next(&mut buffer, &Stop::default()).unwrap() == Portion::Bytes);
        }
        assert!(began.elapsed() >= first * (1 + 2 + 4 + 8), "{:?}", began.elapsed());
        assert_eq!(connected.wait_due(), first * 8);
        // One that has lasted begins anew.
        connected.since = began.checked_sub(first * 100).unwrap();
        connected.failed("closed");
        assert_eq!(connected.wait_due(), first);
    }
}
