//! Signals of the operating system that ask a process to end.

use crate::Stop;

/// Runs `work` to its end on a thread of its own, inside the multi-threaded runtime that Zenoh needs around it; its [`Stop`] is
/// requested when the process is asked to end (see [`asked_to_end`]).
///
/// # Errors
/// When the runtime cannot be built, or `work` fails or panics.
pub fn run_until_asked_to_end<T: Send + 'static>(
    work: impl FnOnce(&Stop) -> anyhow::Result<T> + Send + 'static,
) -> anyhow::Result<T> {
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build()?;
    runtime.block_on(async {
        let stop = Stop::default();
        let interrupted = stop.clone();
        tokio::spawn(async move {
            if asked_to_end().await.is_ok() {
                interrupted.request();
            }
        });
        tokio::task::spawn_blocking(move || work(&stop)).await?
    })
}

/// Returns when the process is asked to end: Ctrl-C, and on Unix SIGTERM and, unless the process was told to ignore it (`nohup`), SIGHUP.
///
/// # Errors
/// When the system does not let the process listen to signals.
#[cfg(unix)]
pub async fn asked_to_end() -> std::io::Result<()> {
    use tokio::signal::unix::{SignalKind, signal};
    let mut terminate = signal(SignalKind::terminate())?;
    let mut hang_up = if ignores_hang_up() { None } else { Some(signal(SignalKind::hangup())?) };
    let hung_up = async {
        match &mut hang_up {
            Some(hang_up) => hang_up.recv().await,
            None => std::future::pending().await,
        }
    };
    tokio::select! {
        interrupted = tokio::signal::ctrl_c() => interrupted,
        _ = terminate.recv() => Ok(()),
        _ = hung_up => Ok(()),
    }
}

/// Returns when the process is asked to end: Ctrl-C.
///
/// # Errors
/// When the system does not let the process listen to signals.
#[cfg(not(unix))]
pub async fn asked_to_end() -> std::io::Result<()> {
    tokio::signal::ctrl_c().await
}

/// Whether the process was started with SIGHUP ignored. Where this cannot be read (not Linux), it counts as not.
#[cfg(unix)]
fn ignores_hang_up() -> bool {
    std::fs::read_to_string("/proc/self/status").is_ok_and(|status| ignored_first_signal(&status))
}

/// Whether the lowest bit, SIGHUP's, is set in the line `SigIgn:` of a process's status.
#[cfg(unix)]
fn ignored_first_signal(status: &str) -> bool {
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|mask| mask & 1 == 1)
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn the_first_bit_is_the_one_that_nohup_sets() {
        assert!(ignored_first_signal("Name:\tx\nSigIgn:\t0000000000001001\n"));
        assert!(!ignored_first_signal("SigIgn:\t0000000000001000\n"));
        assert!(!ignored_first_signal("nothing"));
    }
}
