//! Limits of waiting, so that a test that hangs fails.

#![allow(dead_code, clippy::panic, clippy::unwrap_used, clippy::print_stderr)] // not every test uses everything; helpers of tests

use std::process::{Child, ExitStatus};
use std::sync::Once;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// How long a test waits for a thread or a process that should end.
pub const LIMIT: Duration = Duration::from_mins(3);
/// How long a whole test program may run that waits in other ways (for a connection, a line, a message).
const PROGRAM_LIMIT: Duration = Duration::from_mins(30);
const POLL: Duration = Duration::from_millis(5);

/// A thread that a test waits for.
#[derive(Debug)]
pub struct Running<T>(JoinHandle<T>);

/// Starts a thread.
pub fn spawn<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Running<T> {
    watch();
    Running(std::thread::spawn(work))
}

impl<T> Running<T> {
    /// Waits for the thread's end.
    ///
    /// # Errors
    /// When it panicked.
    ///
    /// # Panics
    /// When it does not end within [`LIMIT`].
    pub fn join(self) -> std::thread::Result<T> {
        let begun = Instant::now();
        while !self.0.is_finished() {
            assert!(begun.elapsed() < LIMIT, "a thread has not ended after {} s", LIMIT.as_secs());
            std::thread::sleep(POLL);
        }
        self.0.join()
    }

    /// Whether it has ended.
    pub fn is_finished(&self) -> bool {
        self.0.is_finished()
    }
}

/// Waits for a process's end; kills it after [`LIMIT`].
///
/// # Panics
/// When it had to be killed.
pub fn ended(child: &mut Child) -> ExitStatus {
    let begun = Instant::now();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return status;
        }
        if begun.elapsed() > LIMIT {
            child.kill().unwrap();
            panic!("process {} has not ended after {} s and was killed", child.id(), LIMIT.as_secs());
        }
        std::thread::sleep(POLL);
    }
}

/// Ends the test program with an error when it runs for longer than half an hour.
pub fn watch() {
    static WATCH: Once = Once::new();
    WATCH.call_once(|| {
        std::thread::spawn(|| {
            std::thread::sleep(PROGRAM_LIMIT);
            eprintln!("the test program still runs after {} s: a test hangs", PROGRAM_LIMIT.as_secs());
            std::process::exit(1);
        });
    });
}
