//! A request to stop, shared between threads.

mod signals;

use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::Duration;

pub use signals::{asked_to_end, run_until_asked_to_end};

/// A flag that is set once, and that a sleeper notices at once. Clones share it.
#[derive(Clone, Debug, Default)]
pub struct Stop {
    shared: Arc<(Mutex<bool>, Condvar)>,
}

impl Stop {
    /// Asks to stop.
    pub fn request(&self) {
        let (flag, changed) = &*self.shared;
        *flag.lock().unwrap_or_else(PoisonError::into_inner) = true;
        changed.notify_all();
    }

    /// Whether a stop was requested.
    pub fn is_requested(&self) -> bool {
        *self.shared.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sleeps; returns early, and `true`, when asked to stop.
    pub fn sleep(&self, duration: Duration) -> bool {
        let (flag, changed) = &*self.shared;
        let asked = flag.lock().unwrap_or_else(PoisonError::into_inner);
        let (asked, _) = changed
            .wait_timeout_while(asked, duration, |asked| !*asked)
            .unwrap_or_else(PoisonError::into_inner);
        *asked
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sleeper_wakes_when_asked() {
        let stop = Stop::default();
        assert!(!stop.sleep(Duration::from_millis(1)));
        let other = stop.clone();
        let sleeper = std::thread::spawn(move || other.sleep(Duration::from_hours(1)));
        stop.request();
        assert!(sleeper.join().unwrap());
        assert!(stop.is_requested());
    }
}
