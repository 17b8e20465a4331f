//! The hub's questions to agents about missing epochs.

use std::sync::mpsc::{SyncSender, sync_channel};

use cofix_common::wire::history_key;
use zenoh::qos::CongestionControl;
use zenoh::query::{ConsolidationMode, QueryTarget, Reply};
use zenoh::{Session, Wait};

use super::{Entrance, Event, zenoh_error};
use crate::network::recovery::{ANSWER, Question};

/// Most questions that wait for the thread that asks.
const WAITING_QUESTIONS: usize = 64;

/// Asks agents for what they keep; the answers become events.
///
/// A thread of its own asks: Zenoh may tell at once, on the thread that asks, that nobody answers, and that event may have to wait for
/// the hub's thread.
pub struct HistoryQuestions {
    /// `None`: nobody is asked.
    questions: Option<SyncSender<(String, Question)>>,
}

impl HistoryQuestions {
    pub(super) fn start(session: Session, group: String, entrance: Entrance) -> anyhow::Result<Self> {
        let (questions, waiting) = sync_channel::<(String, Question)>(WAITING_QUESTIONS);
        let ask_all = move || {
            for (phone, question) in waiting {
                if let Err(error) = ask(&session, &group, &phone, &question, &entrance) {
                    tracing::warn!("{phone}: not asked for its history: {error}");
                }
            }
        };
        std::thread::Builder::new().name("history".to_owned()).spawn(ask_all)?;
        Ok(Self { questions: Some(questions) })
    }

    /// Questions that only go into a channel.
    #[cfg(test)]
    pub(crate) const fn into(questions: SyncSender<(String, Question)>) -> Self {
        Self { questions: Some(questions) }
    }

    /// Questions that nobody gets: what the agents answered once is in a journal.
    pub const fn silent() -> Self {
        Self { questions: None }
    }

    /// Asks the agent of the phone of this name. Waits for nothing; `false` when too many questions wait already.
    pub fn ask(&self, phone: &str, question: Question) -> bool {
        let sent = |questions: &SyncSender<_>| questions.try_send((phone.to_owned(), question)).is_ok();
        self.questions.as_ref().is_none_or(sent)
    }
}

fn ask(
    session: &Session,
    group: &str,
    phone: &str,
    question: &Question,
    entrance: &Entrance,
) -> anyhow::Result<()> {
    let (mut selector, mut end) = (history_key(group, phone)?, None);
    if let Some((run, from, to)) = &question.epochs {
        selector = format!("{selector}?run={run};from={from};to={to}");
        let answered = Event::Answered { phone: phone.to_owned(), sender: run.clone() };
        end = Some(AtEnd { event: Some(answered), sender: entrance.sender.clone() });
    }
    let entrance = entrance.clone();
    let callback = move |reply: Reply| {
        // Zenoh drops this when the answer has ended.
        let _ = &end;
        if let Ok(sample) = reply.result() {
            entrance.take(sample, Event::History);
        }
    };
    session
        .get(selector)
        // Two agents may go by one name.
        .target(QueryTarget::All)
        .consolidation(ConsolidationMode::None)
        // The answers go as the question did.
        .congestion_control(CongestionControl::Block)
        .timeout(ANSWER)
        .callback(callback)
        .wait()
        .map_err(zenoh_error)
}

/// Sends an event when it is dropped.
struct AtEnd {
    event: Option<Event>,
    sender: SyncSender<Event>,
}

impl Drop for AtEnd {
    fn drop(&mut self) {
        if let Some(event) = self.event.take() {
            // Fails only when the hub has ended.
            let _ = self.sender.send(event);
        }
    }
}
