//! What is asked of agents for the hub to have their runs from the first epoch on: when, how often, and when no more. No I/O, no clock of
//! its own.
//!
//! - An agent that appears is asked what it keeps of its run and what it has said of itself, until it answers.
//! - A gap in a run that does not close by itself within a moment is asked for, in portions, one at a time; again when an answer ends
//!   without progress.
//! - What the agent says that it does not keep any more is given up; so is, live, a gap before later epochs that stays without progress for
//!   as long as the group waits for a phone.
//!
//! The group waits for a phone whose gap is being closed as for any other ([`cofix_common::fusion::align`]). For one that it does not wait for, a gap that takes
//! longer than that ([`Recovery::slow`]) is given up: its newest epochs count.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::network::intake::{Gap, Intake};

/// An agent that does not say what it keeps is not asked any more after this.
const PATIENCE: Duration = Duration::from_secs(10);
/// So long a gap may take to close by itself: messages may be on their way.
const SETTLING: Duration = Duration::from_millis(100);
/// A question that has brought nothing is asked again after this.
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
    /// Which of its runs and which sequence numbers, first and one more than the last; `None`: whoever is there, and no epochs.
    pub epochs: Option<(String, u64, u64)>,
}

/// What is to be done.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Step {
    /// Ask.
    Ask(Question),
    /// Give up a run's missing epochs before a sequence number.
    GiveUp {
        /// The phone's index.
        phone: usize,
        /// Whose run.
        sender: String,
        /// One more than the last sequence number to give up.
        to: u64,
        /// Why.
        why: &'static str,
    },
}

/// An agent that appeared and has not said what it keeps.
#[derive(Debug)]
struct Introduction {
    since: Duration,
    asked: Option<Duration>,
}

/// A gap that is being closed.
#[derive(Debug)]
struct Repair {
    /// Where it begins, and since when.
    from: u64,
    since: Duration,
    /// Since when there is a gap in the run.
    begun: Duration,
    /// When it was last asked for, and where it began then.
    asked: Option<(Duration, u64)>,
    /// Whether the answer goes on.
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

    /// The phone's agent said what it keeps.
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

    /// What is to be done at `now`.
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
