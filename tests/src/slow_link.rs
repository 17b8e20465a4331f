//! A link between agent and hub that may be slow or cut.

use std::io::{Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

/// Bytes that are carried at once.
const PORTION_BYTES: usize = 16_384;

/// A TCP relay on loopback whose delay may be changed, and that may be cut.
pub struct SlowLink {
    /// The endpoint for agents.
    pub endpoint: String,
    state: Arc<State>,
}

#[derive(Default)]
struct State {
    delay_ms: AtomicU64,
    is_cut: AtomicBool,
}

impl SlowLink {
    /// A relay without delay to a hub's endpoint `tcp/HOST:PORT`. It ends with the process.
    ///
    /// # Errors
    /// When it cannot listen.
    pub fn to(hub: &str) -> anyhow::Result<Self> {
        let hub = hub.trim_start_matches("tcp/").to_owned();
        let listener = TcpListener::bind("127.0.0.1:0")?;
        let endpoint = format!("tcp/{}", listener.local_addr()?);
        let state = Arc::new(State::default());
        let shared = Arc::clone(&state);
        std::thread::spawn(move || {
            for agent in listener.incoming().flatten() {
                if shared.is_cut.load(Ordering::Relaxed) {
                    continue;
                }
                let Ok(hub) = TcpStream::connect(&hub) else { continue };
                for (from, to) in [(&agent, &hub), (&hub, &agent)] {
                    if let (Ok(from), Ok(to)) = (from.try_clone(), to.try_clone()) {
                        carry(from, to, &shared);
                    }
                }
            }
        });
        Ok(Self { endpoint, state })
    }

    /// Delays bytes that are sent from now on by `delay`, in both directions.
    pub fn set_delay(&self, delay: Duration) {
        let milliseconds = u64::try_from(delay.as_millis()).unwrap_or(u64::MAX);
        self.state.delay_ms.store(milliseconds, Ordering::Relaxed);
    }

    /// Cuts the link, or mends it: connections end with the next bytes, and new ones are closed.
    pub fn set_cut(&self, is_cut: bool) {
        self.state.is_cut.store(is_cut, Ordering::Relaxed);
    }
}

/// Carries bytes one way, on threads of its own.
fn carry(from: TcpStream, to: TcpStream, state: &Arc<State>) {
    let (sender, portions) = channel();
    let state = Arc::clone(state);
    std::thread::spawn(move || read(from, &sender, &state));
    std::thread::spawn(move || write(to, &portions));
}

fn read(mut from: TcpStream, portions: &Sender<(Instant, Vec<u8>)>, state: &State) {
    let mut buffer = vec![0; PORTION_BYTES];
    while let Ok(count @ 1..) = from.read(&mut buffer) {
        if state.is_cut.load(Ordering::Relaxed) {
            let _ = from.shutdown(Shutdown::Both);
            break;
        }
        let due = Instant::now() + Duration::from_millis(state.delay_ms.load(Ordering::Relaxed));
        let portion = buffer.get(..count).unwrap_or_default().to_vec();
        if portions.send((due, portion)).is_err() {
            break;
        }
    }
}

fn write(mut to: TcpStream, portions: &Receiver<(Instant, Vec<u8>)>) {
    for (due, portion) in portions {
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
        if to.write_all(&portion).is_err() {
            break;
        }
    }
    // The other side may have gone already.
    let _ = to.shutdown(Shutdown::Both);
}
