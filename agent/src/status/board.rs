//! Status lines on a terminal or in the log.

use std::io::{self, IsTerminal, Write};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use indicatif::{MultiProgress, ProgressBar, ProgressStyle};

/// How often lines are redrawn on a terminal.
const REDRAW: Duration = Duration::from_secs(1);
/// How often they are logged elsewhere.
const LOG: Duration = Duration::from_mins(1);

/// The lines that are on the terminal now.
static SHOWN: Mutex<Option<MultiProgress>> = Mutex::new(None);

/// Writes to the standard error, above the lines of a [`Board`].
fn write_above(bytes: &[u8]) -> io::Result<usize> {
    match SHOWN.lock().unwrap_or_else(PoisonError::into_inner).as_ref() {
        Some(lines) => lines.suspend(|| io::stderr().write(bytes)),
        None => io::stderr().write(bytes),
    }
}

/// Lines that are redrawn on a terminal, or logged every minute.
pub struct Board {
    terminal: Option<(MultiProgress, Vec<ProgressBar>)>,
    log: fn(&str),
    shown: Duration,
}

impl Board {
    /// A board on standard error; `log` takes a line where that is no terminal.
    pub fn new(lines: usize, log: fn(&str)) -> Self {
        cofix_console::write_log_through(write_above);
        let terminal = io::stderr().is_terminal().then(|| bars(lines));
        *SHOWN.lock().unwrap_or_else(PoisonError::into_inner) = terminal.as_ref().map(|(all, _)| all.clone());
        Self { terminal, log, shown: Duration::ZERO }
    }

    /// Whether lines should be shown at `now`; the caller shows them then.
    pub fn is_due(&mut self, now: Duration) -> bool {
        let interval = if self.terminal.is_some() { REDRAW } else { LOG };
        let is_due = is_due(self.shown, now, interval);
        if is_due {
            self.shown = now;
        }
        is_due
    }

    /// Shows lines in place of the last ones, or logs them.
    pub fn show(&self, lines: &[String]) {
        match &self.terminal {
            Some((_, bars)) => {
                for (bar, line) in bars.iter().zip(lines) {
                    bar.set_message(line.clone());
                }
            }
            None => lines.iter().for_each(|line| (self.log)(line)),
        }
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        if let Some((all, _)) = &self.terminal {
            *SHOWN.lock().unwrap_or_else(PoisonError::into_inner) = None;
            // Lines that cannot be cleared stay.
            let _ = all.clear();
        }
    }
}

fn bars(lines: usize) -> (MultiProgress, Vec<ProgressBar>) {
    let all = MultiProgress::new();
    let style = ProgressStyle::with_template("{msg}").unwrap_or_else(|_| ProgressStyle::default_spinner());
    let bar = |_| all.add(ProgressBar::new_spinner().with_style(style.clone()));
    let bars = (0..lines).map(bar).collect();
    (all, bars)
}

fn is_due(shown: Duration, now: Duration, interval: Duration) -> bool {
    now.saturating_sub(shown) >= interval
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_due_every_second_on_a_terminal_and_every_minute_in_a_log() {
        let mut board = Board { terminal: None, log: |_| {}, shown: Duration::ZERO };
        let due = (0..180).filter(|second| board.is_due(Duration::from_secs(*second)));
        assert_eq!(due.collect::<Vec<_>>(), [60, 120]);
        board.terminal = Some(bars(2));
        let due = (180..184).filter(|second| board.is_due(Duration::from_secs(*second)));
        assert_eq!(due.count(), 4);
    }
}
