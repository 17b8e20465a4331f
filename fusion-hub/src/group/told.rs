//! The status of a group, told to whoever asks.

use cofix_agent::status::Moment;
use cofix_common::fusion::engine::FusedEpoch;
use cofix_common::skips::Reason;

use super::Group;
use crate::status::{Counts, Watcher};

impl Group {
    /// Tells the status through `watcher` from now on.
    pub fn tell_through(&mut self, watcher: Watcher) {
        self.watcher = Some(watcher);
    }

    pub(super) fn watch(&mut self, fused: &FusedEpoch) {
        let moment = Moment { now: self.now, wall_gps: self.wall_gps };
        if let Some(watcher) = &mut self.watcher {
            watcher.epoch(fused, moment);
        }
    }

    pub(super) fn tell(&mut self, moment: Moment) {
        let Some(mut watcher) = self.watcher.take() else { return };
        if watcher.is_due(moment.now) {
            let phones = (0..self.parts.phones.len()).filter_map(|phone| self.counts(phone)).collect();
            watcher.tell(&self.parts.name, self.parts.outputs.tally.epochs, phones, moment);
        }
        self.watcher = Some(watcher);
    }

    fn counts(&self, phone: usize) -> Option<(String, Counts)> {
        let name = self.parts.phones.get(phone)?.clone();
        let lost = self.lost().get(&name).copied().unwrap_or_default();
        let skips = self.phone_skips(phone);
        Some((name, Counts { lost, late: skips.count(Reason::EpochTooLate), skips }))
    }
}
