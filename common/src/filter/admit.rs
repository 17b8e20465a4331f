//! One epoch of one phone in a filter: prediction, comparison, start, update, and the ends of states that are not worth going on with.

use super::{JointFilter, Start, UpdateReport};
use crate::integrity::{RaimOptions, Verdict};
use crate::measurement::CorrectedObservation;
use crate::solve::PointSolution;
use crate::time::GpsTime;

/// An epoch of one phone, as a filter takes it.
#[derive(Clone, Copy, Debug)]
pub struct PhoneEpoch<'a> {
    /// Receive time, GPS time.
    pub time_gps: GpsTime,
    /// Corrected observations.
    pub observations: &'a [CorrectedObservation],
    /// Time of the phone's epoch to which the observations' changes of range refer.
    pub changes_since_gps: Option<GpsTime>,
    /// Solution of the epoch and RAIM's verdict on it.
    pub wls: Option<(&'a PointSolution, Verdict)>,
    /// Tests of the innovations; `None`: they are not tested.
    pub tests: Option<&'a RaimOptions>,
}

/// What became of an epoch in a filter.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Admitted {
    /// Time, s, by which the epoch is before the filter's; it was not used.
    pub late_s: Option<f64>,
    /// Phones that were removed because prediction does not bridge their silence, with its length, s.
    pub silent: Vec<(usize, f64)>,
    /// Whether the phone was lost (see [`JointFilter::is_lost`]) and removed, or started anew.
    pub was_lost: bool,
    /// What the filter made of the observations; `None` where they did not update it.
    pub update: Option<UpdateReport>,
    /// Phones that were removed because the state was not sound after the update.
    pub unsound: Unsound,
}

/// Phones removed from a state that is not sound.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Unsound {
    /// None.
    #[default]
    None,
    /// The phone of the epoch.
    Phone,
    /// All phones, since the state was not sound without that phone either.
    All,
}

/// Number of changes of range that tie one position to the next: displacement and clock.
const FEWEST_TYING: usize = 4;

impl JointFilter {
    /// Takes an epoch of a phone: updates it, or starts it from the epoch's solution if it is not there or lost.
    pub fn admit(&mut self, phone: usize, epoch: &PhoneEpoch<'_>) -> Admitted {
        let late_s = self.time_gps() - epoch.time_gps;
        if !self.is_empty() && late_s > 0.0 {
            return Admitted { late_s: Some(late_s), ..Admitted::default() };
        }
        let silent = self.drop_silent(epoch.time_gps);
        self.predict(epoch.time_gps);
        let was_lost = self.remove_lost(phone, epoch);
        let mut update = None;
        match (self.slot(phone), epoch.wls) {
            (None, Some((solution, verdict))) => {
                self.insert(phone, epoch.time_gps, &Start::at_solution(solution, verdict));
            }
            (Some(slot), _) if !epoch.observations.is_empty() => {
                let since = epoch.changes_since_gps;
                let tied = since.map(|since| self.update_changes(slot, epoch.observations, since));
                let (changes, change) = tied.unwrap_or_default();
                self.forget_position(slot);
                self.slots[slot].is_tied = changes.kept >= FEWEST_TYING;
                let (change_nis, change_rows) = (change.nis, change.rows);
                let others = self.update_tested(slot, epoch.observations, epoch.tests);
                update = Some(UpdateReport { changes, change_nis, change_rows, ..others });
            }
            _ => {}
        }
        if let Some(slot) = self.slot(phone) {
            self.keep_position(slot);
        }
        Admitted { late_s: None, silent, was_lost, update, unsound: self.remove_unsound(phone) }
    }

    /// Compares a phone with the epoch's solution, and removes it if it is lost.
    fn remove_lost(&mut self, phone: usize, epoch: &PhoneEpoch<'_>) -> bool {
        let Some(slot) = self.slot(phone) else { return false };
        if let Some((solution, verdict)) = epoch.wls {
            self.compare(slot, solution, verdict);
        }
        let is_lost = self.is_lost(slot);
        if is_lost {
            self.remove(slot);
        }
        is_lost
    }

    /// Removes the phone whose epoch made the state unsound; if that does not help, all phones.
    fn remove_unsound(&mut self, phone: usize) -> Unsound {
        if self.is_sound() {
            return Unsound::None;
        }
        if let Some(slot) = self.slot(phone) {
            self.remove(slot);
        }
        if self.is_sound() {
            return Unsound::Phone;
        }
        self.clear();
        Unsound::All
    }
}
