//! The messages of its run that an agent keeps, and its answers to a hub that missed some.
//!
//! The hub asks for a range of sequence numbers at `cofix/<group>/phone/<phone>/history`. Every answer begins with the range that is kept
//! ([`KeptMessage`]) and the agent's status messages, so that a hub that started late, or was restarted, knows which epochs to ask for.

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use cofix_common::wire::{KeptMessage, WireError, encode};
use zenoh::bytes::ZBytes;
use zenoh::query::{Query, Queryable};
use zenoh::sample::SourceInfo;
use zenoh::session::EntityGlobalId;
use zenoh::{Session, Wait};

use crate::publication::link;
use crate::publication::spool::Spool;

/// Most questions that wait for the thread that answers. Further ones are not answered; the hub repeats them.
const WAITING_QUESTIONS: usize = 8;
/// Most epochs in one answer.
const MAXIMUM_ANSWER: usize = 1_024;
/// The first and the last status of a run.
const KEPT_STATUSES: usize = 2;

/// The last messages of a run, encoded.
#[derive(Debug)]
pub(crate) struct Ring {
    limit: usize,
    /// Sequence number of the next epoch.
    next: u64,
    /// With sequence numbers, in ascending order.
    epochs: VecDeque<(u64, ZBytes)>,
    statuses: VecDeque<ZBytes>,
    /// All epochs, on disk.
    spool: Option<Spool>,
}

impl Ring {
    fn new(limit: usize, spool: Option<Spool>) -> Self {
        Self { limit: limit.max(1), next: 0, epochs: VecDeque::new(), statuses: VecDeque::new(), spool }
    }

    /// Keeps an epoch, and forgets the oldest beyond the limit. One whose number is not higher than the last one's is not kept.
    pub(crate) fn keep_epoch(&mut self, sequence: u64, bytes: ZBytes) {
        if sequence < self.next {
            return;
        }
        self.next = sequence.saturating_add(1);
        let spooled = self.spool.as_mut().map(|spool| spool.append(sequence, &bytes.to_bytes()));
        if let Some(Err(error)) = spooled {
            tracing::error!("the spool ends: {error}; the last {} epochs are kept in memory", self.limit);
            self.spool = None;
        }
        if self.epochs.len() >= self.limit {
            self.epochs.pop_front();
        }
        self.epochs.push_back((sequence, bytes));
    }

    /// Keeps a status.
    pub(crate) fn keep_status(&mut self, bytes: ZBytes) {
        if self.statuses.len() >= KEPT_STATUSES {
            self.statuses.pop_front();
        }
        self.statuses.push_back(bytes);
    }

    /// The answer to a question for the epochs from sequence number `from` to before `to`.
    fn answer(&self, phone: &str, from: u64, to: u64) -> Result<Vec<ZBytes>, WireError> {
        let in_memory = self.epochs.front().map_or(self.next, |(sequence, _)| *sequence);
        let on_disk = self.spool.as_ref().and_then(Spool::first);
        let first = on_disk.map_or(in_memory, |first| first.min(in_memory));
        let kept = KeptMessage { phone: phone.to_owned(), first, next: self.next };
        let start = self.epochs.partition_point(|(sequence, _)| *sequence < from);
        let asked = self.epochs.iter().skip(start).take_while(|(sequence, _)| *sequence < to);
        let mut answer = vec![ZBytes::from(encode(&kept)?)];
        answer.extend(self.statuses.iter().cloned());
        let spooled = self.spool.as_ref().map(|spool| spool.read(from, to.min(in_memory), MAXIMUM_ANSWER));
        let spooled = spooled.unwrap_or_else(|| Ok(Vec::new())).unwrap_or_else(|error| {
            tracing::error!("{error}");
            Vec::new()
        });
        let room = MAXIMUM_ANSWER - spooled.len();
        answer.extend(spooled.into_iter().map(ZBytes::from));
        answer.extend(asked.take(room).map(|(_, bytes)| bytes.clone()));
        Ok(answer)
    }
}

/// A [`Ring`] that hubs can ask; it answers on a thread of its own until it is dropped.
pub(crate) struct History {
    ring: Arc<Mutex<Ring>>,
    queryable: Queryable<()>,
}

/// The address of a history, and its phone.
pub(crate) struct Address {
    /// The key.
    pub(crate) key: String,
    /// The phone.
    pub(crate) phone: String,
    /// The publisher's id.
    pub(crate) source: EntityGlobalId,
}

impl History {
    /// Declares it on a session; `limit` epochs are kept in memory.
    pub(crate) fn declare(
        session: &Session,
        address: Address,
        limit: usize,
        spool: Option<Spool>,
    ) -> zenoh::Result<Self> {
        let ring = Arc::new(Mutex::new(Ring::new(limit, spool)));
        let (sender, questions) = sync_channel(WAITING_QUESTIONS);
        let key = address.key.clone();
        let answers = Arc::clone(&ring);
        // Not on Zenoh's thread: it would read nothing while a long answer is on its way.
        std::thread::Builder::new()
            .name(format!("history-{}", address.phone))
            .spawn(move || answer_all(&questions, &answers, &address))?;
        let queryable = session.declare_queryable(key).callback(move |query| queue(&sender, query)).wait()?;
        Ok(Self { ring, queryable })
    }

    pub(crate) fn ring(&self) -> MutexGuard<'_, Ring> {
        lock(&self.ring)
    }

    pub(crate) fn undeclare(self) -> zenoh::Result<()> {
        self.queryable.undeclare().wait()
    }
}

fn lock(ring: &Mutex<Ring>) -> MutexGuard<'_, Ring> {
    ring.lock().unwrap_or_else(PoisonError::into_inner)
}

fn queue(sender: &SyncSender<Query>, query: Query) {
    if let Err(TrySendError::Full(query)) = sender.try_send(query) {
        tracing::warn!("too many questions for the history; not answered: {}", query.selector());
    }
}

fn answer_all(questions: &Receiver<Query>, ring: &Mutex<Ring>, address: &Address) {
    let run = address.source.zid().to_string();
    for query in questions {
        let parameters = query.parameters();
        if parameters.get("run").is_some_and(|asked| asked != run) {
            continue;
        }
        let number = |name| parameters.get(name).and_then(|text| text.parse().ok()).unwrap_or(0);
        let answer = lock(ring).answer(&address.phone, number("from"), number("to"));
        if let Err(error) = answer.map_err(Into::into).and_then(|answer| send(&query, answer, address)) {
            tracing::warn!("history of {} not sent: {}", address.phone, link::plain(&error));
        }
    }
}

fn send(query: &Query, answer: Vec<ZBytes>, address: &Address) -> zenoh::Result<()> {
    for (rank, bytes) in (0..).zip(answer) {
        query.reply(&address.key, bytes).source_info(SourceInfo::new(address.source, rank)).wait()?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use cofix_common::wire::decode;

    use super::*;

    fn ring(limit: usize, sequences: impl IntoIterator<Item = u64>) -> Ring {
        let mut ring = Ring::new(limit, None);
        for sequence in sequences {
            ring.keep_epoch(sequence, ZBytes::from(sequence.to_string()));
        }
        ring
    }

    /// First and next of an answer, and the rest as text.
    fn answer(ring: &Ring, from: u64, to: u64) -> (u64, u64, Vec<String>) {
        let mut answer = ring.answer("p", from, to).unwrap().into_iter();
        let kept: KeptMessage = decode(&answer.next().unwrap().to_bytes()).unwrap();
        assert_eq!(kept.phone, "p");
        (kept.first, kept.next, answer.map(|bytes| bytes.try_to_string().unwrap().into_owned()).collect())
    }

    #[test]
    fn the_last_epochs_are_kept_in_order() {
        let ring = ring(3, 0..5);
        assert_eq!(answer(&ring, 0, 100), (2, 5, vec!["2".to_owned(), "3".to_owned(), "4".to_owned()]));
        assert_eq!(answer(&ring, 3, 4), (2, 5, vec!["3".to_owned()]));
        assert_eq!(answer(&ring, 0, 0), (2, 5, vec![]));
        assert_eq!(answer(&ring, 4, 2), (2, 5, vec![]));
        assert_eq!(answer(&ring, u64::MAX, u64::MAX), (2, 5, vec![]));
    }

    #[test]
    fn what_memory_does_not_keep_comes_from_the_spool() {
        let folder = tempfile::tempdir().unwrap();
        let mut ring = Ring::new(3, Some(Spool::create(folder.path(), "p", 1_000_000).unwrap()));
        (0..10).for_each(|sequence: u64| ring.keep_epoch(sequence, ZBytes::from(sequence.to_string())));
        let expected =
            |range: std::ops::Range<u64>| range.map(|sequence| sequence.to_string()).collect::<Vec<_>>();
        assert_eq!(answer(&ring, 0, 100), (0, 10, expected(0..10)));
        assert_eq!(answer(&ring, 2, 5), (0, 10, expected(2..5)));
        assert_eq!(answer(&ring, 6, 9), (0, 10, expected(6..9)));
        assert_eq!(answer(&ring, 8, 9), (0, 10, expected(8..9)));
    }

    #[test]
    fn a_number_that_is_left_out_or_comes_again_does_no_harm() {
        let ring = ring(10, [0, 1, 3, 3, 2, 4]);
        let expected: Vec<String> = [1, 3, 4].iter().map(u64::to_string).collect();
        assert_eq!(answer(&ring, 1, 5), (0, 5, expected));
    }

    #[test]
    fn every_answer_has_the_first_and_the_last_word_and_an_end() {
        assert_eq!(answer(&ring(3, []), 0, 9), (0, 0, vec![]));
        let mut ring = ring(5_000, 0..5_000);
        for word in ["once", "started", "finished"] {
            ring.keep_status(ZBytes::from(word));
        }
        assert_eq!(answer(&ring, 0, 0).2, ["started", "finished"]);
        assert_eq!(answer(&ring, 0, 5_000).2.len(), 2 + MAXIMUM_ANSWER);
    }
}
