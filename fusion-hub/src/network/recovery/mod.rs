//! When and how often agents are asked for missing epochs, and when these are given up. No I/O, no clock of its own.
//!
//! - An agent that appears is asked which epochs of its run it keeps, and for its statuses, until it answers.
//! - A gap in a run that does not close by itself within a moment is asked for, in portions, one at a time; again when an answer ends
//!   without progress.
//! - Epochs that the agent no longer keeps are given up; so is, live, a gap before later epochs that stays without progress for as long as the
//!   group waits for a phone.
//!
//! The group waits for a phone whose gap is being closed as for any other ([`cofix_common::fusion::align`]). For a phone that it does not wait for, a gap that
//! takes longer than that ([`Recovery::slow`]) is given up: its newest epochs count.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::network::intake::{Gap, Intake};

/// Time after which an agent that does not state which epochs it keeps is no longer asked.
const PATIENCE: Duration = Duration::from_secs(10);
/// Time in which a gap may close by itself: messages may be in transit.
const SETTLING: Duration = Duration::from_millis(100);
/// Interval after which a question without progress is repeated.
const RETRY: Duration = Duration::from_millis(500);
/// Longest wait for the end of one answer.
pub const ANSWER: Duration = Duration::from_secs(5);
/// Most epochs asked for at once: some hundred kilobytes, so that a slow link has them well before the question expires.
const PORTION: u64 = 64;

/// A question for an agent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Question {
    /// The phone's index.
    pub phone: usize,
    /// The sender of the run, the first sequence number, and one more than the last; `None`: all agents of the phone, and no epochs.
    pub epochs: Option<(String, u64, u64)>,
}

/// A step of recovery.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Step {
    /// Ask.
    Ask(Question),
    /// Give up a run's missing epochs before a sequence number.
    GiveUp {
        /// The phone's index.
        phone: usize,
        /// The sender of the run.
        sender: String,
        /// One more than the last sequence number to give up.
        to: u64,
        /// Why.
        why: &'static str,
    },
}

/// An agent that appeared and has not stated which epochs it keeps.
#[derive(Debug)]
struct Introduction {
    since: Duration,
    asked: Option<Duration>,
}

/// A gap that is being closed.
#[derive(Debug)]
struct Repair {
    /// Its first sequence number, and since when it begins there.
    from: u64,
    since: Duration,
    /// Since when there is a gap in the run.
    begun: Duration,
    /// When it was last asked for, and its first sequence number then.
    asked: Option<(Duration, u64)>,
    /// Whether the answer has not ended yet.
    pending: bool,
}

/// Closes gaps.
#[derive(Debug)]
pub struct Recovery {
    introductions: BTreeMap<usize, Introduction>,
    repairs: BTreeMap<(usize, String), Repair>,
    /// After how long without progress a gap is given up; `None`: never.
    patience: Option<Duration>,
}

impl Recovery {
    /// Gaps that cannot be closed are given up after `patience`, as long as the group waits for a phone.
    pub const fn live(patience: Duration) -> Self {
        Self { introductions: BTreeMap::new(), repairs: BTreeMap::new(), patience: Some(patience) }
    }

    /// Gaps that cannot be closed are an error, found at the end.
    pub const fn of_a_replay() -> Self {
        Self { introductions: BTreeMap::new(), repairs: BTreeMap::new(), patience: None }
    }

    /// The phone's agent appeared.
    pub fn appeared(&mut self, phone: usize, now: Duration) {
        self.introductions.insert(phone, Introduction { since: now, asked: None });
    }

    /// The phone's agent disappeared.
    pub fn disappeared(&mut self, phone: usize) {
        self.introductions.remove(&phone);
    }

    /// No question will be answered any more: another hub goes on.
    pub fn forget(&mut self) {
        self.introductions.clear();
        self.repairs.clear();
    }

    /// The phone's agent stated which epochs it keeps.
    pub fn introduced(&mut self, phone: usize) {
        self.introductions.remove(&phone);
    }

    /// The answer to a question for a run's epochs has ended.
    pub fn answered(&mut self, phone: usize, sender: &str) {
        if let Some(repair) = self.repairs.get_mut(&(phone, sender.to_owned())) {
            repair.pending = false;
        }
    }

    /// The phones with gaps that are being closed for longer than the group waits for a phone.
    pub fn slow(&self, now: Duration) -> Vec<usize> {
        let Some(patience) = self.patience else { return Vec::new() };
        let slow = self.repairs.iter().filter(|(_, repair)| now.saturating_sub(repair.begun) >= patience);
        slow.map(|((phone, _), _)| *phone).collect()
    }

    /// The steps that are due at `now`.
    pub fn steps(&mut self, intake: &Intake, now: Duration) -> Vec<Step> {
        let mut steps = self.introduce(now);
        let mut repairs = BTreeMap::new();
        for (phone, sender, gap) in intake.gaps() {
            let key = (phone, sender.to_owned());
            let known = self.repairs.remove(&key);
            let new = Repair { from: gap.from, since: now, begun: now, asked: None, pending: false };
            let mut repair = known.unwrap_or(new);
            steps.extend(self.step(&key, gap, &mut repair, now));
            repairs.insert(key, repair);
        }
        self.repairs = repairs;
        steps
    }

    fn introduce(&mut self, now: Duration) -> Vec<Step> {
        self.introductions.retain(|_, introduction| now.saturating_sub(introduction.since) < PATIENCE);
        let mut steps = Vec::new();
        for (phone, introduction) in &mut self.introductions {
            if introduction.asked.is_none_or(|asked| now.saturating_sub(asked) >= RETRY) {
                introduction.asked = Some(now);
                steps.push(Step::Ask(Question { phone: *phone, epochs: None }));
            }
        }
        steps
    }

    fn step(
        &self,
        (phone, sender): &(usize, String),
        gap: Gap,
        repair: &mut Repair,
        now: Duration,
    ) -> Option<Step> {
        if gap.from != repair.from {
            (repair.from, repair.since) = (gap.from, now);
        }
        let age = now.saturating_sub(repair.since);
        let give_up = |to, why| Some(Step::GiveUp { phone: *phone, sender: sender.clone(), to, why });
        if gap.kept_from > gap.from && (repair.asked.is_some() || age >= SETTLING) {
            return give_up(gap.kept_from.min(gap.to), "its agent does not keep them any more");
        }
        if gap.waited_on && self.patience.is_some_and(|patience| age >= patience) {
            return give_up(gap.to, "its agent was asked and did not send them");
        }
        let may_ask = match repair.asked {
            None => age >= SETTLING,
            Some((asked, _)) if repair.pending => now.saturating_sub(asked) >= 2 * ANSWER,
            Some((asked, from)) => gap.from != from || now.saturating_sub(asked) >= RETRY,
        };
        if !may_ask {
            return None;
        }
        (repair.asked, repair.pending) = (Some((now, gap.from)), true);
        let to = gap.to.min(gap.from.saturating_add(PORTION));
        Some(Step::Ask(Question { phone: *phone, epochs: Some((sender.clone(), gap.from, to)) }))
    }
}

#[cfg(test)]
mod tests;
