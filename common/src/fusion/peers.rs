//! Phones check each other: which phone contradicts the others, or which constraint is wrong.
//!
//! The evidence are the contradictions between the phones' own filters and the constraints on pairs (module `doubt`), which last for seconds
//! before they count. A phone that contradicts at least two others, and is part of every contradiction and every doubt, is named and isolated: no
//! constraint couples it to the others until it agrees with them again for ten seconds. Where no single phone explains the contradictions, the group cannot tell. A bound that
//! contradicts phones which agree with each other otherwise is wrong itself.

use serde::{Deserialize, Serialize};

use super::doubt::Doubt;
use crate::time::GpsTime;

/// Time for which contradictions must name the same phone, s, and doubts alone.
const CONFIRMED_S: f64 = 2.0;
const DOUBTED_S: f64 = 3.0;
/// Time for which contradictions must last that no phone explains, s: one that walks away contradicts the others one after another.
const UNEXPLAINED_S: f64 = 10.0;
/// Time without a contradiction after which a phone is taken in again, and an event may be told again, s.
const AGREED_S: f64 = 10.0;
/// Minimum number of phones that one must contradict to be named.
const FEWEST_PARTNERS: usize = 2;

/// What happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EventKind {
    /// A phone contradicts the others and is isolated.
    Isolated,
    /// An isolated phone agrees with the others again.
    Readmitted,
    /// A constraint contradicts the phones, which do not contradict each other.
    ConstraintContradicted,
    /// Phones contradict each other, and which of them is wrong is open.
    CannotTell,
}

/// An event of the group's integrity.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct IntegrityEvent {
    /// Time, GPS time.
    pub time_gps: GpsTime,
    /// The phones that it is about.
    pub phones: Vec<usize>,
    /// The constraint, by its place in the engine's list, if it is about one.
    pub constraint: Option<usize>,
    /// What happened.
    pub kind: EventKind,
}

/// A constraint in force and whether the phones' filters contradict it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Evidence<'a> {
    /// Place of the constraint.
    pub place: usize,
    pub phones: &'a [usize],
    pub doubt: Doubt,
}

impl Evidence<'_> {
    fn is_contradicted(&self) -> bool {
        self.doubt == Doubt::Contradicted
    }
}

/// Something that was told, until it has not been so for a while.
#[derive(Clone, Copy, Debug, Default)]
struct Told {
    since: Option<GpsTime>,
    last: Option<GpsTime>,
    was_said: bool,
}

impl Told {
    /// Takes whether it is so. Returns whether it is to be told now, because it has been so for a time.
    fn take(&mut self, is_so: bool, time_gps: GpsTime, lasting_s: f64) -> bool {
        if is_so {
            let since = *self.since.get_or_insert(time_gps);
            self.last = Some(time_gps);
            let is_new = !self.was_said && time_gps - since >= lasting_s;
            self.was_said |= is_new;
            return is_new;
        }
        if !self.was_said || self.is_over(time_gps) {
            *self = Self::default();
        }
        false
    }

    fn is_over(&self, time_gps: GpsTime) -> bool {
        self.last.is_none_or(|last| time_gps - last >= AGREED_S)
    }
}

/// What the group knows of its phones.
#[derive(Clone, Debug)]
pub(super) struct Peers {
    is_active: bool,
    /// By phone: named as the one that is wrong.
    named: Vec<Told>,
    isolated: Vec<bool>,
    /// The phone that explains all contradictions and doubts of this epoch.
    suspect: Option<usize>,
    /// By constraint: told to be wrong.
    wrong: Vec<Told>,
    open: Told,
}

impl Peers {
    pub fn new(phones: usize, constraints: usize, is_active: bool) -> Self {
        Self {
            is_active,
            named: vec![Told::default(); phones],
            isolated: vec![false; phones],
            suspect: None,
            wrong: vec![Told::default(); constraints],
            open: Told::default(),
        }
    }

    /// Whether a phone is isolated.
    pub fn is_isolated(&self, phone: usize) -> bool {
        self.isolated.get(phone).is_some_and(|is_isolated| *is_isolated)
    }

    /// Whether a phone is coupled to no other at this epoch: it is isolated, or suspected and not yet named.
    pub fn is_apart(&self, phone: usize) -> bool {
        self.is_isolated(phone) || self.suspect == Some(phone)
    }

    /// Takes the constraints in force. Returns what happened.
    pub fn take(&mut self, time_gps: GpsTime, evidence: &[Evidence<'_>]) -> Vec<IntegrityEvent> {
        let mut events = Vec::new();
        if !self.is_active {
            return events;
        }
        let event =
            |phones: Vec<usize>, constraint, kind| IntegrityEvent { time_gps, phones, constraint, kind };
        self.readmit(time_gps, evidence, &mut |phone| {
            events.push(event(vec![phone], None, EventKind::Readmitted));
        });

        let among_others =
            |evidence: &&Evidence<'_>| evidence.phones.iter().all(|phone| !self.is_isolated(*phone));
        let counted: Vec<Evidence<'_>> = evidence.iter().filter(among_others).copied().collect();
        let judged = judge(&counted, self.named.len());
        self.suspect = judged.phone;
        for (phone, (named, isolated)) in self.named.iter_mut().zip(&mut self.isolated).enumerate() {
            if !*isolated && named.take(judged.phone == Some(phone), time_gps, judged.lasting_s) {
                *isolated = true;
                events.push(event(vec![phone], None, EventKind::Isolated));
            }
        }
        for (place, wrong) in self.wrong.iter_mut().enumerate() {
            if wrong.take(judged.constraints.contains(&place), time_gps, UNEXPLAINED_S) {
                let phones =
                    counted.iter().find(|e| e.place == place).map_or(Vec::new(), |e| e.phones.to_vec());
                events.push(event(phones, Some(place), EventKind::ConstraintContradicted));
            }
        }
        if self.open.take(!judged.open.is_empty(), time_gps, UNEXPLAINED_S) {
            events.push(event(judged.open, None, EventKind::CannotTell));
        }
        events
    }

    fn readmit(&mut self, time_gps: GpsTime, evidence: &[Evidence<'_>], tell: &mut dyn FnMut(usize)) {
        for phone in (0..self.isolated.len()).filter(|phone| self.isolated[*phone]).collect::<Vec<_>>() {
            let contradicts = evidence.iter().any(|e| e.doubt >= Doubt::Doubted && e.phones.contains(&phone));
            if contradicts {
                self.named[phone].last = Some(time_gps);
            } else if self.named[phone].is_over(time_gps) {
                self.isolated[phone] = false;
                self.named[phone] = Told::default();
                tell(phone);
            }
        }
    }
}

/// What one epoch's contradictions say.
#[derive(Debug, Default)]
struct Judged {
    /// The phone that explains all contradictions between phones.
    phone: Option<usize>,
    /// For how long it must do so.
    lasting_s: f64,
    /// Constraints that are wrong.
    constraints: Vec<usize>,
    /// Phones of contradictions that nothing explains.
    open: Vec<usize>,
}

fn judge(evidence: &[Evidence<'_>], phones: usize) -> Judged {
    let mut judged = Judged::default();
    let alone = evidence.iter().filter(|e| e.phones.len() == 1 && e.is_contradicted());
    judged.constraints.extend(alone.map(|e| e.place));
    let pairs: Vec<&Evidence<'_>> = evidence.iter().filter(|e| e.phones.len() == 2).collect();
    let doubted: Vec<&Evidence<'_>> = pairs.iter().copied().filter(|e| e.doubt >= Doubt::Doubted).collect();
    let contradicted: Vec<&Evidence<'_>> = pairs.iter().copied().filter(|e| e.is_contradicted()).collect();
    let partners = |phone: usize, is_doubted: bool| {
        let with =
            pairs.iter().filter(|e| e.phones.contains(&phone) && (e.doubt >= Doubt::Doubted) == is_doubted);
        let mut others: Vec<usize> =
            with.flat_map(|e| e.phones.iter().copied()).filter(|p| *p != phone).collect();
        others.sort_unstable();
        others.dedup();
        others
    };
    let explains = |phone: &usize| {
        let against = partners(*phone, true).len();
        doubted.iter().all(|e| e.phones.contains(phone))
            && against >= FEWEST_PARTNERS
            && against > partners(*phone, false).len()
    };
    let explaining: Vec<usize> = (0..phones).filter(explains).collect();
    if let [phone] = explaining[..] {
        judged.phone = Some(phone);
        judged.lasting_s = if contradicted.is_empty() { DOUBTED_S } else { CONFIRMED_S };
        return judged;
    }
    if contradicted.is_empty() {
        return judged;
    }
    let mut involved: Vec<usize> = contradicted.iter().flat_map(|e| e.phones.iter().copied()).collect();
    involved.sort_unstable();
    involved.dedup();
    // A bound between two phones that both agree with a third, and bounds that all phones contradict.
    let shares_a_friend = |e: &Evidence<'_>| {
        let [a, b] = [0, 1].map(|i| partners(e.phones[i], false));
        a.iter().any(|phone| b.contains(phone))
    };
    if contradicted.iter().all(|e| shares_a_friend(e))
        || (contradicted.len() == pairs.len() && involved.len() > 2)
    {
        judged.constraints.extend(contradicted.iter().map(|e| e.place));
    } else {
        judged.open = involved;
    }
    judged
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAIRS: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

    /// Events over some seconds among four phones; `wrong` says whether a pair is contradicted at a second.
    fn events(seconds: u8, wrong: impl Fn(u8, [usize; 2]) -> bool) -> Vec<(f64, Vec<usize>, EventKind)> {
        let mut peers = Peers::new(4, 6, true);
        let start = GpsTime::from_week_tow(2118, 100.0);
        let mut told = Vec::new();
        for second in 0..seconds {
            let evidence: Vec<Evidence<'_>> = PAIRS
                .iter()
                .enumerate()
                .map(|(place, pair)| {
                    let doubt = if wrong(second, *pair) { Doubt::Contradicted } else { Doubt::None };
                    Evidence { place, phones: pair, doubt }
                })
                .collect();
            for event in peers.take(start + f64::from(second), &evidence) {
                told.push((event.time_gps - start, event.phones, event.kind));
            }
        }
        told
    }

    #[test]
    fn one_phone_against_all_others_is_isolated_and_comes_back() {
        let told = events(60, |second, pair| (10..30).contains(&second) && pair.contains(&2));
        let expected = [(12.0, vec![2], EventKind::Isolated), (39.0, vec![2], EventKind::Readmitted)];
        assert_eq!(told, expected);
        // A second of contradiction is not enough.
        assert!(events(20, |second, pair| second == 10 && pair.contains(&2)).is_empty());
    }

    #[test]
    fn two_that_lie_alike_cannot_be_told_from_two_that_do_not() {
        let told = events(20, |_, pair| pair.contains(&0) != pair.contains(&1) && pair != [0, 1]);
        assert_eq!(told, [(10.0, vec![0, 1, 2, 3], EventKind::CannotTell)]);
    }

    #[test]
    fn a_bound_that_two_phones_contradict_whom_others_confirm_is_wrong() {
        let told = events(20, |_, pair| pair == [1, 3]);
        assert_eq!(told, [(10.0, vec![1, 3], EventKind::ConstraintContradicted)]);
        let all = events(20, |_, _| true);
        assert_eq!(all.len(), 6);
        assert!(all.iter().all(|(_, _, kind)| *kind == EventKind::ConstraintContradicted), "{all:?}");
    }

    #[test]
    fn of_two_phones_alone_neither_is_named() {
        let mut peers = Peers::new(2, 1, true);
        let start = GpsTime::from_week_tow(2118, 100.0);
        let evidence = [Evidence { place: 0, phones: &[0, 1], doubt: Doubt::Contradicted }];
        let told: Vec<IntegrityEvent> =
            (0..15).flat_map(|second| peers.take(start + f64::from(second), &evidence)).collect();
        assert_eq!(told.len(), 1);
        assert_eq!((told[0].kind, &told[0].phones[..]), (EventKind::CannotTell, &[0, 1][..]));
        assert!(Peers::new(2, 1, false).take(start, &evidence).is_empty());
    }
}
