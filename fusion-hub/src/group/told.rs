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
            watcher.tell(&self.parts.name, self.parts.outputs.tally.epochs, self.counts(), moment);
        }
        self.watcher = Some(watcher);
    }

    /// What is counted of each phone, in the session's order.
    fn counts(&self) -> Vec<(String, Counts)> {
        let mut lost = self.lost();
        let counts = |(phone, name): (usize, &String)| {
            let skips = self.phone_skips(phone);
            let (lost, late) = (lost.remove(name).unwrap_or_default(), skips.count(Reason::EpochTooLate));
            (name.clone(), Counts { lost, late, skips })
        };
        self.parts.phones.iter().enumerate().map(counts).collect()
    }
}
