//! Losses of lock that are told when no phase is given.

use std::collections::BTreeMap;

pub(crate) use crate::gnss::SignalKey;

/// Keeps for each signal whether its lock was lost since its last phase. A receiver may say so while it gives no phase, or on an
/// observation that is not used; the next phase then does not continue those before.
#[derive(Clone, Debug, Default)]
pub(crate) struct LostLocks {
    untold: BTreeMap<SignalKey, bool>,
}

impl LostLocks {
    /// Takes an observation and gives whether its phase is to be marked: `is_lost`, or the lock was lost since the phase before.
    pub(crate) fn observe(&mut self, signal: SignalKey, is_lost: bool, has_phase: bool) -> bool {
        let untold = self.untold.entry(signal).or_default();
        let is_lost = is_lost || *untold;
        *untold = is_lost && !has_phase;
        is_lost && has_phase
    }

    /// No phase from now on continues one from before.
    pub(crate) fn lose_all(&mut self) {
        self.untold.values_mut().for_each(|untold| *untold = true);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gnss::{Constellation, SatelliteId, SignalCode};

    #[test]
    fn the_next_phase_tells_a_loss_once() {
        let of = |number| (SatelliteId::new(Constellation::Gps, number), SignalCode::new(b'1', b'C'));
        let mut locks = LostLocks::default();
        for (number, is_lost, has_phase, is_marked) in [
            (7, false, true, false),
            (7, true, false, false),
            (8, false, true, false),
            (7, false, false, false),
            (7, false, true, true),
            (7, false, true, false),
            (7, true, true, true),
            (7, false, true, false),
        ] {
            assert_eq!(locks.observe(of(number), is_lost, has_phase), is_marked);
        }
        locks.lose_all();
        assert!(locks.observe(of(7), false, true) && !locks.observe(of(8), false, false));
        assert!(!locks.observe(of(9), false, true), "nothing before it that it could continue");
        assert!(locks.observe(of(8), false, true));
    }
}
