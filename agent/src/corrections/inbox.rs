//! A live source of corrections on a thread of its own.

use std::collections::VecDeque;
use std::io;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

use cofix_common::formats::decode::Record;
use cofix_common::skips::{Reason, Skips};
use cofix_common::time::GpsTime;

use super::Arrived;
use crate::Stop;
use crate::input::LiveSource;
use crate::input::ntrip::RoverPosition;
use crate::source::error::once_named;
use crate::source::records::{Records, RecordsError};

/// Most records that wait for the rover's next epoch: a quarter of an hour of epochs at 1 Hz.
const MOST_WAITING: usize = 1_000;

/// Records that have arrived and were not taken yet. Neither side ever waits for the other.
#[derive(Debug, Default)]
pub(super) struct Inbox(Mutex<Content>);

#[derive(Debug, Default)]
struct Content {
    waiting: VecDeque<Arrived>,
    /// Whether an epoch of a base has arrived, or the source has ended.
    has_begun: bool,
    /// Whether a record has arrived.
    has_brought: bool,
    skips: Skips,
}

impl Inbox {
    fn content(&self) -> MutexGuard<'_, Content> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a record. When the inbox is full, the oldest epoch is dropped, or, without an epoch, the oldest record.
    fn put(&self, arrived: Arrived) {
        let mut content = self.content();
        content.has_begun |= is_epoch(&arrived);
        content.has_brought = true;
        if content.waiting.len() >= MOST_WAITING {
            let oldest = content.waiting.iter().position(is_epoch).unwrap_or(0);
            content.waiting.remove(oldest);
            content
                .skips
                .add(Reason::OldestCorrectionDropped, || format!("more than {MOST_WAITING} records"));
        }
        content.waiting.push_back(arrived);
    }

    /// Takes everything out.
    pub(super) fn take(&self) -> VecDeque<Arrived> {
        std::mem::take(&mut self.content().waiting)
    }

    /// Whether an epoch of a base has arrived, or the source has ended.
    pub(super) fn has_begun(&self) -> bool {
        self.content().has_begun
    }

    fn end(&self, skips: &Skips) {
        let mut content = self.content();
        content.skips.merge(skips);
        content.has_begun = true;
    }

    /// Everything skipped. The decoder's part is complete when the thread has ended.
    pub(super) fn skips(&self, name: &str) -> Skips {
        let content = self.content();
        let mut skips = content.skips.clone();
        if !content.has_brought {
            skips.add(Reason::SourceBroughtNothing, || name.to_owned());
        }
        skips
    }
}

fn is_epoch(arrived: &Arrived) -> bool {
    matches!(arrived.record, Record::Epoch(_))
}

/// Starts reading a source into an inbox, until it ends or a stop is requested.
pub(super) fn start(
    source: &LiveSource,
    rover: &RoverPosition,
    inbox: &Arc<Inbox>,
    stop: &Stop,
    near: GpsTime,
) -> io::Result<JoinHandle<()>> {
    let (source, rover, inbox, stop) = (source.clone(), rover.clone(), Arc::clone(inbox), stop.clone());
    std::thread::Builder::new().name("corrections".to_owned()).spawn(move || {
        let mut skips = Skips::default();
        if let Err(error) = pump(&source, &rover, &inbox, &stop, near, &mut skips) {
            let said = once_named(&source.to_string(), &error);
            tracing::error!("no corrections: {said}");
            skips.add(Reason::SourceFailed, || said);
        }
        inbox.end(&skips);
    })
}

/// Reads to the end.
fn pump(
    source: &LiveSource,
    rover: &RoverPosition,
    inbox: &Inbox,
    stop: &Stop,
    near: GpsTime,
    skips: &mut Skips,
) -> Result<(), RecordsError> {
    let mut records = Records::new(source.open_near(rover)?, near);
    let outcome = loop {
        match records.next(stop) {
            Ok(Some(Record::Event(_))) => {}
            Ok(Some(record)) => {
                inbox.put(Arrived { record, station: records.decoder().station() });
            }
            Ok(None) => break Ok(()),
            Err(error) => break Err(error),
        }
    };
    *skips = records.skips();
    outcome
}

#[cfg(test)]
mod tests {
    use cofix_common::gnss::{EpochFlag, ObservationEpoch};

    use super::*;

    fn epoch(second: f64) -> Arrived {
        let time_gps = GpsTime::from_week_tow(2320, second);
        let epoch = ObservationEpoch { time_gps, flag: EpochFlag::Ok, observations: Vec::new() };
        Arrived { record: Record::Epoch(epoch), station: None }
    }

    #[test]
    fn a_full_inbox_keeps_the_newest() {
        let inbox = Inbox::default();
        assert!(!inbox.has_begun());
        assert_eq!(inbox.skips("x").count(Reason::SourceBroughtNothing), 1);
        let silent = Inbox::default();
        silent.end(&Skips::default());
        assert!(silent.has_begun(), "nobody waits for it any more");
        assert_eq!(silent.skips("x").count(Reason::SourceBroughtNothing), 1, "its end is no epoch");
        for second in 0..MOST_WAITING + 3 {
            inbox.put(epoch(second as f64));
        }
        assert!(inbox.has_begun());
        assert_eq!(inbox.skips("x").count(Reason::OldestCorrectionDropped), 3);
        let taken = inbox.take();
        assert_eq!(taken.len(), MOST_WAITING);
        let Some(Arrived { record: Record::Epoch(first), .. }) = taken.front() else { panic!("an epoch") };
        assert_eq!(first.time_gps, GpsTime::from_week_tow(2320, 3.0));
        assert!(inbox.take().is_empty());
    }
}
