//! Published epochs that the hub did not fuse.

use cofix_common::fusion::align::LOSSES;
use cofix_common::skips::Reason;

use super::Group;

impl Group {
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
