//! One group at work: events in, fused epochs out, on one thread.

mod in_order;
mod journalled;
mod load;
mod losses;
mod missing;
mod result;
mod screened;
mod steady;
mod told;

use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use anyhow::bail;
use cofix_agent::status::Moment;
use cofix_agent::{Stop, clock};
use cofix_common::fusion::align::{Aligner, NoticeKind};
use cofix_common::fusion::engine::Engine;
use cofix_common::time::GpsTime;

use crate::journal::Journal;
use crate::network::intake::words::tamed;
use crate::network::intake::{Answer, Arrival, Intake, Notice};
use crate::network::recovery::Recovery;
use crate::network::{Event, HistoryQuestions, Receipts};
use crate::outputs::Outputs;
use crate::status::Watcher;

use load::Load;
use screened::warn_of_stranger;
use steady::Steady;

/// Longest wait of the thread for an event before it looks at the clock.
const TICK: Duration = Duration::from_millis(50);
/// Longest wait for agents that have finished and still have to ask whether everything arrived: on a slow link the question takes a while.
const LONGEST_STAY: Duration = Duration::from_secs(30);
/// Most events that are handled before the thread looks at the clock: whether a phone is late is decided when all its events are known.
const BATCH: usize = 256;
/// Most events that are handled after the request to stop.
const LAST_EVENTS: usize = 10_000;

/// How a group comes to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Course {
    /// Every phone of the group has an agent in this process; the end is when all have ended. Every message counts.
    Replay,
    /// Phones come and go; the end is on request, or, with `until_finished`, when all agents have ended.
    Live {
        /// Whether to end when all agents of the group have ended.
        until_finished: bool,
    },
}

/// A group at work.
pub struct Group {
    parts: Parts,
    intake: Intake,
    recovery: Recovery,
    /// Time of the current step, since the start.
    now: Duration,
    /// GPS time of the current step, by the computer's clock.
    wall_gps: GpsTime,
    /// Tells the status to whoever asks.
    watcher: Option<Watcher>,
    /// When gaps were last looked at.
    recovered_at: Option<Duration>,
    /// By phone: number of missing epochs of agents that have ended, and since when the number has not changed.
    missing: Vec<Option<(u64, Duration)>>,
    /// By phone, whether an agent is there.
    alive: Vec<bool>,
    grace: Duration,
    longest_stay: Duration,
    journal: Option<Journal>,
    /// Why the journal is incomplete, if it is.
    journal_failure: Option<String>,
    /// Events of a journal that no step used.
    unused: Vec<Event>,
}

/// The parts of a group.
pub struct Parts {
    /// The group's name.
    pub name: String,
    /// The phones' names.
    pub phones: Vec<String>,
    /// How it ends.
    pub course: Course,
    /// Alignment.
    pub aligner: Aligner,
    /// Estimation.
    pub engine: Engine,
    /// Receipts for agents.
    pub receipts: Receipts,
    /// Questions to agents for missing epochs.
    pub history: HistoryQuestions,
    /// Consumers.
    pub outputs: Outputs,
}

impl Group {
    /// Longest wait for the epochs of an agent that has finished: its last status may overtake them.
    pub const GRACE: Duration = Duration::from_secs(10);

    /// Puts a group together.
    pub fn new(mut parts: Parts) -> Self {
        let phones = parts.phones.len();
        let recovery = match parts.course {
            Course::Replay => Recovery::of_a_replay(),
            Course::Live { .. } => Recovery::live(parts.aligner.maximum_wait()),
        };
        parts.outputs.tally.schedule(parts.engine.constraints());
        Self {
            intake: Intake::new(&parts.phones),
            parts,
            recovery,
            recovered_at: None,
            now: Duration::ZERO,
            wall_gps: GpsTime::default(),
            watcher: None,
            missing: vec![None; phones],
            alive: vec![false; phones],
            grace: Self::GRACE,
            longest_stay: LONGEST_STAY,
            journal: None,
            journal_failure: None,
            unused: Vec::new(),
        }
    }

    /// With another limit than [`Group::GRACE`], which holds for the last questions of agents too.
    pub fn with_grace(self, grace: Duration) -> Self {
        Self { grace, longest_stay: grace, ..self }
    }

    /// The phones' names.
    pub fn phones(&self) -> &[String] {
        &self.parts.phones
    }

    /// Works until the end.
    ///
    /// # Errors
    /// When an agent fails or a message is lost.
    pub fn work(&mut self, events: &Receiver<Event>, stop: &Stop) -> anyhow::Result<()> {
        let mut clock = Steady::at(self.now);
        let mut load = Load::default();
        while !self.is_over() && !stop.is_requested() {
            let first = match events.recv_timeout(TICK) {
                Ok(event) => Some(event),
                Err(RecvTimeoutError::Timeout) => None,
                Err(RecvTimeoutError::Disconnected) => break,
            };
            let begin = Instant::now();
            let batch: Vec<Event> = first.into_iter().chain(events.try_iter().take(BATCH)).collect();
            let batch = self.screen(batch);
            let (now, wall_gps) = (clock.tick(), clock::now());
            self.note_step(&batch, now, wall_gps);
            let unused = std::mem::take(&mut self.unused);
            self.step(unused.into_iter().chain(batch), now, wall_gps)?;
            self.tell_load(load.take(begin.elapsed(), now));
        }
        if stop.is_requested() && self.parts.course == Course::Replay {
            bail!("stopped before the end of the session");
        }
        let last = self.screen(events.try_iter().take(LAST_EVENTS).collect());
        self.note_end(&last);
        let ended = self.end(last);
        self.close_journal();
        ended
    }

    /// Says that a live group does not keep up: agents keep what it has not taken yet, and what it takes too late is not fused.
    fn tell_load(&self, share: Option<f64>) {
        if let (Some(share), Course::Live { .. }) = (share, self.parts.course) {
            tracing::warn!(
                "the hub does not keep up: it was at work {:.0} % of the last half minute, and epochs that it takes too late are not fused; leave out constraints or phones, or outputs \
                 (--no-journal, no --recording), or give it a faster computer",
                100.0 * share
            );
        }
    }

    /// Handles the last events, and ends.
    fn end(&mut self, last: Vec<Event>) -> anyhow::Result<()> {
        let unused = std::mem::take(&mut self.unused);
        for event in unused.into_iter().chain(last) {
            self.handle(event)?;
        }
        self.intake.release_all();
        for phone in 0..self.parts.phones.len() {
            self.align(phone);
            self.parts.aligner.finish(phone);
        }
        self.score_late();
        self.fuse_ready();
        Ok(())
    }

    /// Handles the events until `now`, the time since the start, and everything that is due then; `wall_gps` is the time by the computer's
    /// clock.
    ///
    /// # Errors
    /// When an agent fails or a message is lost.
    fn step(
        &mut self,
        events: impl Iterator<Item = Event>,
        now: Duration,
        wall_gps: GpsTime,
    ) -> anyhow::Result<()> {
        (self.now, self.wall_gps) = (now, wall_gps);
        self.intake.set_time(now);
        for event in events {
            self.handle(event)?;
        }
        self.recover();
        self.fuse_ready();
        self.fuse_overdue(wall_gps);
        let moment = Moment { now, wall_gps };
        self.parts.outputs.tick(moment);
        self.tell(moment);
        self.check_stragglers()
    }

    fn note_alive(&mut self, phone: &str, alive: bool) {
        if let Some(slot) = self.intake.index(phone).and_then(|index| self.alive.get_mut(index)) {
            *slot = alive;
        }
    }

    fn is_over(&self) -> bool {
        self.parts.course != Course::Live { until_finished: false }
            && (0..self.parts.phones.len()).all(|phone| self.intake.is_complete(phone))
    }

    fn handle(&mut self, event: Event) -> anyhow::Result<()> {
        match event {
            Event::Epoch(arrival) => self.epoch(&arrival),
            Event::Status(arrival) => self.status(&arrival),
            Event::History(arrival) => self.history(&arrival),
            Event::Answered { phone, sender } => {
                if let Some(phone) = self.intake.index(&phone) {
                    self.recovery.answered(phone, &sender);
                    self.recovered_at = None;
                }
            }
            Event::Alive { phone, alive } => self.alive(&phone, alive),
            Event::Shed { phone, count } => {
                if self.intake.shed(&phone, count) {
                    tracing::warn!("{}: sends more than a phone may; the rest is not let in", tamed(&phone));
                }
            }
            Event::Refused { phone, skips } => self.intake.refuse(phone.as_deref(), &skips),
            Event::AgentEnded { phone, outcome: Err(error) } => bail!("{phone}: {error}"),
            Event::AgentEnded { .. } => {}
        }
        Ok(())
    }

    fn epoch(&mut self, arrival: &Arrival) {
        self.intake.epoch(arrival);
        self.take_in(arrival);
    }

    /// A part of an agent's answer.
    fn history(&mut self, arrival: &Arrival) {
        match self.intake.history(arrival) {
            Some(Answer::Kept(phone)) => self.recovery.introduced(phone),
            Some(Answer::Status(notice)) => self.notice(arrival, notice),
            Some(Answer::Epoch(_)) | None => {}
        }
        self.take_in(arrival);
    }

    /// Passes the phone's messages on whose turn it is, after an arrival.
    fn take_in(&mut self, arrival: &Arrival) {
        let Some(phone) = self.intake.index(&arrival.phone) else { return };
        if let Some(sender) = &arrival.sender {
            self.parts.receipts.note(&arrival.phone, sender, self.intake.receipt(phone, sender));
        }
        self.align(phone);
        self.end_if_complete(phone);
    }

    fn align(&mut self, phone: usize) {
        while let Some(message) = self.intake.next_ready(phone) {
            self.parts.aligner.push(phone, message, self.now);
        }
        self.score_late();
    }

    /// Epochs that came after their time was fused: what their agents made of them counts all the same.
    fn score_late(&mut self) {
        for (phone, message) in self.parts.aligner.take_late() {
            self.parts.outputs.late(phone, &message);
        }
    }

    fn status(&mut self, arrival: &Arrival) {
        if let Some(notice) = self.intake.status(arrival) {
            self.notice(arrival, notice);
        }
    }

    fn notice(&mut self, arrival: &Arrival, notice: Notice) {
        match notice {
            Notice::Started { phone, summary, twice } => {
                if twice {
                    tracing::warn!(
                        "{}: two agents of that name are here; the second is refused until the first is gone",
                        arrival.phone
                    );
                }
                tracing::info!("{}: agent started: {summary}", arrival.phone);
                self.parts.outputs.expect(self.intake.expected());
                // Its last status may have arrived before.
                self.end_if_complete(phone);
            }
            Notice::Finished { phone, error } => {
                if let Some(error) = error {
                    tracing::warn!("{}: agent ended early: {error}", arrival.phone);
                } else {
                    tracing::info!("{}: agent finished", arrival.phone);
                }
                self.end_if_complete(phone);
            }
        }
    }

    fn alive(&mut self, phone: &str, alive: bool) {
        let Some(index) = self.intake.index(phone) else { return warn_of_stranger(phone) };
        self.note_alive(phone, alive);
        tracing::info!("{phone}: agent {}", if alive { "is here" } else { "is gone" });
        if alive {
            self.recovery.appeared(index, self.now);
        } else {
            self.recovery.disappeared(index);
        }
        // Its last epochs are ahead of the loss of its token only on the same link; in a replay its end is known exactly.
        if !alive && self.parts.course != Course::Replay {
            self.intake.gone(index);
        }
        if !alive && self.parts.course != Course::Replay && !self.intake.is_complete(index) {
            self.parts.aligner.leave(index);
        }
    }

    fn end_if_complete(&mut self, phone: usize) {
        if self.intake.is_complete(phone) {
            self.parts.aligner.finish(phone);
        }
    }

    fn fuse_ready(&mut self) {
        while let Some(bucket) = self.parts.aligner.pop_ready() {
            let fused = self.parts.engine.step(bucket);
            self.parts.outputs.push(&fused);
            self.watch(&fused);
            self.note_fused(&fused);
        }
    }

    fn fuse_overdue(&mut self, wall_gps: GpsTime) {
        if self.parts.course == Course::Replay {
            return;
        }
        loop {
            let goes_on = self.parts.aligner.go_on(self.now, Some(wall_gps));
            let notices = self.parts.aligner.notices();
            for notice in &notices {
                let name = self.parts.phones.get(notice.phone).map_or("?", String::as_str);
                tracing::warn!("{name}: {}", notice.text);
                if matches!(notice.kind, NoticeKind::Silent | NoticeKind::Behind) {
                    self.give_up_gaps(notice.phone);
                }
            }
            if self.parts.aligner.went_back() {
                self.parts.engine.restart();
            }
            if !goes_on && notices.is_empty() {
                return;
            }
            self.fuse_ready();
        }
    }
}

#[cfg(test)]
mod tests;
