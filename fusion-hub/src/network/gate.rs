//! How much each phone may send to a hub. What is beyond that is not let in, and counted: a flood costs the phone that sends it.
//!
//! Whatever a phone sends takes from its allowance, long messages more than short ones. Presence that is told too often is told once there is room for it.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use cofix_agent::publication::rate::Allowance;

/// Units that a phone may send at once: what an agent sends at once ([`cofix_agent::publication`]), and an hour of its history.
const AT_ONCE: f64 = 8_192.0;
/// Units a second beyond that.
const PER_S: f64 = 1_000.0;
/// Bytes that one unit holds; an epoch of 60 signals.
const UNIT_BYTES: usize = 16 * 1024;
/// Units of a change of presence.
const PRESENCE: f64 = 50.0;
/// How often the hub's thread is told of messages that were not let in.
const TELL: Duration = Duration::from_secs(1);

/// The allowances of a group's phones.
#[derive(Debug)]
pub(super) struct Gate {
    accounts: Mutex<Accounts>,
}

#[derive(Debug)]
struct Accounts {
    phones: BTreeMap<String, Account>,
    /// Of all phones that the group does not know.
    strangers: Account,
}

#[derive(Debug)]
struct Account {
    allowance: Allowance,
    /// Messages that were not let in and of which nobody was told yet.
    shed: u64,
    told: Instant,
    /// Presence that is not told yet.
    untold: Option<bool>,
}

/// What to tell of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Passage {
    /// Whether it is let in.
    pub(super) is_open: bool,
    /// Before it: how many messages were not, if it is time to tell that.
    pub(super) shed: Option<u64>,
    /// Before it: presence that has changed meanwhile.
    pub(super) alive: Option<bool>,
}

impl Gate {
    /// For the phones of a group.
    pub(super) fn new(phones: &[String], now: Instant) -> Self {
        let account =
            || Account { allowance: Allowance::new(AT_ONCE, PER_S, now), shed: 0, told: now, untold: None };
        let phones = phones.iter().map(|name| (name.clone(), account())).collect();
        Self { accounts: Mutex::new(Accounts { phones, strangers: account() }) }
    }

    /// A message of so many bytes under a phone's name.
    pub(super) fn message(&self, phone: &str, bytes: usize, now: Instant) -> Passage {
        self.with(phone, |account| {
            let units = (1 + bytes / UNIT_BYTES) as f64;
            let is_open = account.allowance.take(units, now);
            account.shed += u64::from(!is_open);
            let alive = is_open.then(|| account.untold.take()).flatten();
            let is_due = now.saturating_duration_since(account.told) >= TELL;
            let shed = (account.shed > 0 && is_due).then(|| std::mem::take(&mut account.shed));
            if shed.is_some() {
                account.told = now;
            }
            Passage { is_open, shed, alive }
        })
    }

    /// A phone's presence. `None`: it is told later.
    pub(super) fn presence(&self, phone: &str, alive: bool, now: Instant) -> Option<bool> {
        self.with(phone, |account| {
            let is_open = account.allowance.take(PRESENCE, now);
            account.untold = (!is_open).then_some(alive);
            is_open.then_some(alive)
        })
    }

    fn with<T>(&self, phone: &str, change: impl FnOnce(&mut Account) -> T) -> T {
        let mut accounts = self.accounts.lock().unwrap_or_else(PoisonError::into_inner);
        let Accounts { phones, strangers } = &mut *accounts;
        change(phones.get_mut(phone).unwrap_or(strangers))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gate(start: Instant) -> Gate {
        Gate::new(&["a".to_owned(), "b".to_owned()], start)
    }

    #[test]
    fn a_flood_of_one_phone_costs_that_phone() {
        let start = Instant::now();
        let gate = gate(start);
        let passed =
            |phone, count, bytes, now| (0..count).filter(|_| gate.message(phone, bytes, now).is_open).count();
        assert_eq!(passed("a", 100_000, 100, start), 8_192);
        assert_eq!(passed("b", 8_000, 100, start), 8_000);
        assert_eq!(passed("stranger", 5_000, 100, start), 5_000);
        assert_eq!(passed("another", 5_000, 100, start), 3_192, "strangers share one allowance");
        let later = start + Duration::from_secs(1);
        assert_eq!(passed("a", 100_000, 100, later), 1_000);
        let much_later = start + Duration::from_hours(1);
        assert_eq!(passed("a", 100_000, 250_000, much_later), 512, "long messages take more");
    }

    #[test]
    fn what_is_not_let_in_is_told_once_a_second() {
        let start = Instant::now();
        let gate = gate(start);
        let at = |ms: u64| start + Duration::from_millis(ms);
        let told: Vec<u64> = (0..10_000).filter_map(|_| gate.message("a", 1, start).shed).collect();
        assert!(told.is_empty(), "{told:?}");
        let passages: Vec<Passage> = (0..2_000).map(|_| gate.message("a", 1, at(1_500))).collect();
        assert_eq!(passages[0], Passage { is_open: true, shed: Some(10_000 - 8_192), alive: None });
        assert!(passages[1..].iter().all(|passage| passage.shed.is_none()));
        assert_eq!(gate.message("a", 1, at(2_600)).shed, Some(500));
        assert_eq!(gate.message("a", 1, at(9_000)).shed, None);
    }

    #[test]
    fn presence_that_is_told_too_often_is_told_with_the_next_message() {
        let start = Instant::now();
        let gate = gate(start);
        let told = (0..1_000).filter_map(|n| gate.presence("a", n % 2 == 0, start)).count();
        assert_eq!(told, 163);
        let later = start + Duration::from_millis(100);
        assert_eq!(gate.message("a", 1, later).alive, Some(false));
        assert_eq!(gate.message("a", 1, later).alive, None);
        assert_eq!(gate.presence("a", true, later), Some(true));
    }
}
