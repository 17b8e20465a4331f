//! Published epochs that the hub did not fuse.

use std::collections::BTreeMap;

use cofix_common::fusion::align::LOSSES;
use cofix_common::skips::Reason;

use super::Group;

/// Reasons of losses for which an epoch was not even scored.
const UNSCORED: [Reason; 2] = [Reason::EpochWentBack, Reason::TooManyEpochsWait];

impl Group {
    /// By phone, how many published epochs were neither fused nor scored.
    pub(super) fn lost(&self) -> BTreeMap<String, u64> {
        let lost = |(phone, name): (usize, &String)| {
            let skips = self.parts.aligner.skips(phone);
            let unscored = UNSCORED.map(|reason| skips.map_or(0, |skips| skips.count(reason)));
            let lost = unscored.iter().fold(self.intake.lost(phone), |sum, count| sum.saturating_add(*count));
            (name.clone(), lost)
        };
        self.parts.phones.iter().enumerate().map(lost).collect()
    }

    /// How many published epochs were not fused, by phone and reason; `None` when all were.
    pub fn losses(&self) -> Option<String> {
        let (mut lost, mut phones) = (0, Vec::new());
        for (phone, name) in self.parts.phones.iter().enumerate() {
            let skips = self.phone_skips(phone);
            let reasons = LOSSES.into_iter().chain([Reason::EpochsNotArrived]);
            let counts = reasons.map(|reason| (reason, skips.count(reason))).filter(|(_, count)| *count > 0);
            let counts: Vec<(Reason, u64)> = counts.collect();
            lost += counts.iter().map(|(_, count)| count).sum::<u64>();
            let words: Vec<String> =
                counts.iter().map(|(reason, count)| format!("{count} × {reason}")).collect();
            if !words.is_empty() {
                phones.push(format!("{name}: {}", words.join(", ")));
            }
        }
        (lost > 0).then(|| format!("{lost} published epochs were not fused ({})", phones.join("; ")))
    }
}
