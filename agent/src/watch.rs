//! The status line of a running agent.

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use cofix_agent::clock;
use cofix_agent::status::{Board, LastEpochs, Moment};
use cofix_common::wire::EpochMessage;

/// How often the thread looks at the clock.
const TICK: Duration = Duration::from_millis(250);

/// A status line on a thread of its own, so that its age grows when no epoch comes. Ends when it is dropped.
pub(crate) struct Watch {
    /// `None` at the end.
    epochs: Option<Sender<EpochMessage>>,
    thread: Option<JoinHandle<()>>,
}

impl Watch {
    /// Starts it.
    ///
    /// # Errors
    /// When no thread can be started.
    pub(crate) fn start(phone: &str) -> std::io::Result<Self> {
        let (epochs, published) = channel();
        let phone = phone.to_owned();
        let thread = std::thread::Builder::new().name("status".to_owned());
        let thread = thread.spawn(move || watch(&phone, &published))?;
        Ok(Self { epochs: Some(epochs), thread: Some(thread) })
    }

    /// Notes a message that was published.
    pub(crate) fn epoch(&mut self, message: &EpochMessage) {
        if let Some(epochs) = &self.epochs {
            // Fails only when the thread has ended.
            let _ = epochs.send(message.clone());
        }
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        self.epochs = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn watch(phone: &str, published: &Receiver<EpochMessage>) {
    let start = Instant::now();
    let mut last = LastEpochs::default();
    let mut board = Board::new(1, |line| tracing::info!("{line}"));
    loop {
        let moment = |now| Moment { now, wall_gps: clock::now() };
        match published.recv_timeout(TICK) {
            Ok(message) => {
                for alarm in last.epoch(&message, message.local.as_ref(), moment(start.elapsed())) {
                    tracing::warn!("{phone}: {alarm}");
                }
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return,
        }
        let now = start.elapsed();
        if board.is_due(now) {
            board.show(&[last.line(phone, moment(now))]);
        }
    }
}
