//! The status of a running live hub: a line for each phone, and alarms at once.

use std::collections::BTreeMap;
use std::time::Duration;

use cofix_agent::status::{Board, LastEpochs, Moment};
use cofix_common::constraint::{ConstraintOutcome, SkipReason};
use cofix_common::fusion::engine::FusedEpoch;

use crate::outputs::{Fused, Sink, Written};
use crate::report::describe;

/// Shortest time between two alarms about a contradicted constraint.
const QUIET: Duration = Duration::from_mins(1);

/// The status of a group, from its last epochs. No clock of its own.
#[derive(Debug, Default)]
pub struct GroupStatus {
    names: Vec<String>,
    phones: Vec<LastEpochs>,
    /// When constraints were last named as contradicted.
    contradicted: BTreeMap<String, Duration>,
}

impl GroupStatus {
    /// For phones of these names.
    pub fn new(names: &[String]) -> Self {
        let phones = vec![LastEpochs::default(); names.len()];
        Self { names: names.to_vec(), phones, contradicted: BTreeMap::new() }
    }

    /// Takes an epoch. Returns alarms to be logged at once.
    pub fn epoch(&mut self, epoch: &FusedEpoch, moment: Moment) -> Vec<String> {
        let mut alarms = Vec::new();
        for ((name, last), phone) in self.names.iter().zip(&mut self.phones).zip(&epoch.phones) {
            let Some(message) = &phone.message else { continue };
            let said = last.epoch(message, phone.state.as_ref(), moment);
            alarms.extend(said.into_iter().map(|alarm| format!("{name}: {alarm}")));
        }
        for action in &epoch.actions {
            if action.outcome == ConstraintOutcome::Skipped(SkipReason::Contradicted) {
                alarms.extend(self.contradicted(describe(&action.constraint, &self.names), moment.now));
            }
        }
        alarms
    }

    fn contradicted(&mut self, constraint: String, now: Duration) -> Option<String> {
        let last = self.contradicted.get(&constraint);
        if last.is_some_and(|last| now.saturating_sub(*last) < QUIET) {
            return None;
        }
        let alarm = format!("{constraint}: the positions contradict it, so it is not applied");
        self.contradicted.insert(constraint, now);
        Some(alarm)
    }

    /// A line for each phone.
    pub fn lines(&mut self, moment: Moment) -> Vec<String> {
        self.names.iter().zip(&mut self.phones).map(|(name, last)| last.line(name, moment)).collect()
    }
}

/// The sink that shows the status on a terminal or in the log.
pub struct Status {
    group: GroupStatus,
    board: Board,
    moment: Moment,
}

impl Status {
    /// For phones of these names.
    pub fn new(names: &[String], moment: Moment) -> Self {
        let board = Board::new(names.len(), |line| tracing::info!("{line}"));
        Self { group: GroupStatus::new(names), board, moment }
    }
}

impl Sink for Status {
    fn epoch(&mut self, fused: &Fused<'_>) -> anyhow::Result<()> {
        for alarm in self.group.epoch(fused.epoch, self.moment) {
            tracing::warn!("{alarm}");
        }
        Ok(())
    }

    fn tick(&mut self, moment: Moment) -> anyhow::Result<()> {
        self.moment = moment;
        if self.board.is_due(moment.now) {
            self.board.show(&self.group.lines(moment));
        }
        Ok(())
    }

    fn finish(self: Box<Self>, _text: &str) -> Result<Option<Written>, String> {
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use cofix_common::constraint::{ConstraintAction, Distance};
    use cofix_common::fusion::engine::FusedPhone;
    use cofix_common::integrity::{Cause, Verdict};
    use cofix_common::time::GpsTime;

    use super::*;
    use crate::testing::judged;

    fn at(seconds: f64) -> GpsTime {
        GpsTime::from_week_tow(2118, 397_000.0) + seconds
    }

    fn epoch(second: f64, verdict: Verdict, outcome: ConstraintOutcome) -> FusedEpoch {
        let message = judged("a", at(second), verdict);
        let constraint = Distance { phones: [0, 1], minimum_m: 0.0, maximum_m: 2.0 }.into();
        let action = ConstraintAction {
            index: 0,
            constraint,
            before: 1.0,
            free_sigmas: 0.0,
            after: 1.0,
            shift_m: 0.0,
            enlargements: 0,
            outcome,
        };
        FusedEpoch {
            time_gps: at(second),
            phones: vec![
                FusedPhone { message: Some(message), state: None, ..FusedPhone::default() },
                FusedPhone { message: None, state: None, ..FusedPhone::default() },
            ],
            actions: vec![action],
            distances: Vec::new(),
            events: Vec::new(),
        }
    }

    #[test]
    fn phones_and_constraints_are_put_into_words() {
        let mut status = GroupStatus::new(&["a".to_owned(), "b".to_owned()]);
        let mut said = Vec::new();
        for second in 0..100_u32 {
            let bad = second == 50;
            let verdict = if bad { Verdict::Unreliable(Cause::Geometry) } else { Verdict::Reliable };
            let contradicted = ConstraintOutcome::Skipped(SkipReason::Contradicted);
            let outcome = if second < 10 { ConstraintOutcome::Holds } else { contradicted };
            let second = f64::from(second);
            let moment = Moment { now: Duration::from_secs_f64(second), wall_gps: at(second) };
            for alarm in status.epoch(&epoch(second, verdict, outcome), moment) {
                said.push((second, alarm));
            }
        }
        let constraint =
            "distance a–b, 0 to 2 m: the positions contradict it, so it is not applied".to_owned();
        assert_eq!(
            said,
            [
                (10.0, constraint.clone()),
                (50.0, "a: its position is unreliable: geometry".to_owned()),
                (70.0, constraint)
            ]
        );
        let moment = Moment { now: Duration::from_secs(99), wall_gps: at(99.0) };
        let lines = status.lines(moment);
        assert_eq!(
            lines,
            ["a: 0.0 s old, 1.0 Hz, 0 satellites, no sigma, reliable; 100 epochs", "b: no epoch yet"]
        );
    }
}
