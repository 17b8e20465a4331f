//! A link between agent and hub with a delay.

use std::io::{Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

/// Bytes that are carried at once.
const PORTION_BYTES: usize = 16_384;

/// A TCP relay on loopback whose delay may be changed.
pub struct SlowLink {
    /// The endpoint for agents.
    pub endpoint: String,
    delay_ms: Arc<AtomicU64>,
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
        let delay_ms = Arc::new(AtomicU64::new(0));
        let delay = Arc::clone(&delay_ms);
        std::thread::spawn(move || {
            for agent in listener.incoming().flatten() {
                let Ok(hub) = TcpStream::connect(&hub) else { continue };
                for (from, to) in [(&agent, &hub), (&hub, &agent)] {
                    if let (Ok(from), Ok(to)) = (from.try_clone(), to.try_clone()) {
                        carry(from, to, &delay);
                    }
                }
            }
        });
        Ok(Self { endpoint, delay_ms })
    }

    /// Delays bytes that are sent from now on by `delay`, in both directions.
    pub fn set_delay(&self, delay: Duration) {
        let milliseconds = u64::try_from(delay.as_millis()).unwrap_or(u64::MAX);
        self.delay_ms.store(milliseconds, Ordering::Relaxed);
    }
}

/// Carries bytes one way, on threads of its own.
fn carry(from: TcpStream, to: TcpStream, delay_ms: &Arc<AtomicU64>) {
    let (sender, portions) = channel();
    let delay_ms = Arc::clone(delay_ms);
    std::thread::spawn(move || read(from, &sender, &delay_ms));
    std::thread::spawn(move || write(to, &portions));
}

fn read(mut from: TcpStream, portions: &Sender<(Instant, Vec<u8>)>, delay_ms: &AtomicU64) {
    let mut buffer = vec![0; PORTION_BYTES];
    while let Ok(count @ 1..) = from.read(&mut buffer) {
        let due = Instant::now() + Duration::from_millis(delay_ms.load(Ordering::Relaxed));
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
