//! Standard input, or any other reader that blocks.

use std::io::{self, Read};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};

use super::{Bytes, LOOK, PORTION_BYTES, Portion};
use crate::Stop;

/// Most portions that wait for the pipeline; beyond them the reader waits.
const WAITING: usize = 16;

/// A blocking reader on a thread of its own, so that a request to stop is noticed while no byte arrives.
pub struct Piped {
    portions: Receiver<io::Result<Vec<u8>>>,
    failure_reason: Option<String>,
}

impl Piped {
    /// Starts reading. The thread ends with its input, or with the process: nothing can interrupt a read of standard input.
    ///
    /// # Errors
    /// When no thread can be started.
    pub fn start(reader: impl Read + Send + 'static) -> io::Result<Self> {
        let (sender, portions) = sync_channel(WAITING);
        std::thread::Builder::new().name("input".to_owned()).spawn(move || pump(reader, &sender))?;
        Ok(Self { portions, failure_reason: None })
    }
}

fn pump(mut reader: impl Read, sender: &SyncSender<io::Result<Vec<u8>>>) {
    let mut buffer = vec![0; PORTION_BYTES];
    loop {
        let portion = match reader.read(&mut buffer) {
            Ok(0) => return,
            Ok(count) => Ok(buffer.get(..count).unwrap_or_default().to_vec()),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(error) => Err(error),
        };
        let failed = portion.is_err();
        if sender.send(portion).is_err() || failed {
            return;
        }
    }
}

impl Bytes for Piped {
    fn next(&mut self, buffer: &mut Vec<u8>, stop: &Stop) -> io::Result<Portion> {
        loop {
            if stop.is_requested() {
                return Ok(Portion::End);
            }
            match self.portions.recv_timeout(LOOK) {
                Ok(Ok(bytes)) => {
                    *buffer = bytes;
                    return Ok(Portion::Bytes);
                }
                Ok(Err(error)) => {
                    self.failure_reason = Some(format!("the input failed: {error}"));
                    return Ok(Portion::Lost);
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Ok(Portion::End),
            }
        }
    }

    fn failure_reason(&self) -> Option<&str> {
        self.failure_reason.as_deref()
    }
}
