//! Phones check each other: which phone contradicts the others, or which constraint is wrong.
//!
//! The evidence are the contradictions between the phones' own filters and the constraints on pairs (module `doubt`), which last for seconds
//! before they count, and the phones' epoch-wise solutions (module `solutions`), which no filter holds back. A phone that contradicts at least two others, and is part of every contradiction and every doubt, is coupled to no other phone; if that lasts it is named and isolated: no
//! constraint couples it to the others until it agrees with them again for ten seconds, in which they move if they moved when it was isolated. Where no single phone explains the contradictions, the group cannot tell. A bound that
//! contradicts phones which agree with each other otherwise is wrong itself. Between two phones alone it is open whether a phone or the bound is wrong: the bound is told
//! with them, and not applied. What kind of error a named phone has is told by the module `kind`.

mod kind;
mod solutions;

use std::collections::BTreeMap;

use nalgebra::Matrix2x3;
use serde::{Deserialize, Serialize};

pub use kind::ErrorKind;
use kind::History;
pub(super) use kind::Seen;
use solutions::Solutions;

use super::doubt::Doubt;
use crate::frames::{Ecef, LocalFrame};
use crate::time::GpsTime;

/// Time for which doubts must name the same phone, s, unless its own solutions show what kind of error it has.
const SUSPECTED_S: f64 = 6.0;
/// Time at the end of it for which the doubts must be firm, s.
const FIRM_S: f64 = 2.0;
/// Share of the limit of a contradiction beyond which a doubt is firm.
const FIRM_SHARE: f64 = 0.6;
/// Share of the limit beyond which all bounds of a phone count if the mean of its epoch-wise solutions is so many standard deviations of one solution
/// beyond them too, and time for which that must last, s, unless its solutions show what kind of error it has. In 160 hours of simulated honest
/// phones a share of 0.49 was seen with 2.6 and one of 0.43 with 3.0.
const NEARLY_SHARE: f64 = 0.45;
const CONFIRMING_SIGMAS: f64 = 3.0;
const CONFIRMED_S: f64 = 4.0;
/// Excess of the mean of its epoch-wise solutions over the bounds, in standard deviations of one solution, with which a phone is not taken in again.
const DISAGREEING_SIGMAS: f64 = 2.0;
/// Share of the limit beyond which a wrong constraint is told.
const TOLD_SHARE: f64 = 0.7;
/// Time for which contradictions must last that no phone explains, s: one that walks away contradicts the others one after another.
const UNEXPLAINED_S: f64 = 10.0;
/// Time without a contradiction after which a phone is taken in again, and an event may be told again, s.
const AGREED_S: f64 = 10.0;
/// Share of the others' speed when a phone was isolated at which its agreement counts, and the speed from which on it always does, m/s: an error of
/// time, or a position that does not move, agrees while the others stand.
const AGREEING_SHARE: f64 = 0.5;
const AGREEING_MPS: f64 = 8.0;
/// Minimum number of phones that one must contradict to be named.
const FEWEST_PARTNERS: usize = 2;
/// Upper bound of a distance up to which two phones are companions, by whom the kind of an error is told, m.
const COMPANIONS_M: f64 = 10.0;

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
    /// The constraint, by its place in the engine's list, if it is about a single one.
    pub constraint: Option<usize>,
    /// What happened.
    pub kind: EventKind,
    /// What kind of error an isolated phone has.
    pub error: Option<ErrorKind>,
}

/// A constraint in force and whether the phones' filters contradict it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Evidence<'a> {
    /// Place of the constraint.
    pub place: usize,
    pub phones: &'a [usize],
    pub doubt: Doubt,
    /// Excess over the bounds, as a share of the limit of a contradiction.
    pub share: f64,
    /// Upper bound of the phones' distance, m; infinite if it bounds none.
    pub within_m: f64,
}

impl Evidence<'_> {
    fn is_contradicted(&self) -> bool {
        self.doubt == Doubt::Contradicted
    }

    /// Whether it is contradicted so much that it is told.
    fn is_told(&self) -> bool {
        self.is_contradicted() && self.share > TOLD_SHARE
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

/// Since when something is so.
#[derive(Clone, Copy, Debug, Default)]
struct Since(Option<GpsTime>);

impl Since {
    fn take(&mut self, is_so: bool, time_gps: GpsTime) {
        self.0 = is_so.then(|| self.0.unwrap_or(time_gps));
    }

    fn lasts(self, time_gps: GpsTime, lasting_s: f64) -> bool {
        self.0.is_some_and(|since| time_gps - since >= lasting_s)
    }
}

/// Since when a phone is suspected.
#[derive(Clone, Copy, Debug, Default)]
struct Suspicion {
    /// It explains all doubts.
    lasting: Since,
    /// Two of the doubts are firm.
    firm: Since,
    /// All bounds are nearly doubted, and its epoch-wise solutions disagree.
    confirmed: Since,
    /// Every epoch-wise solution lies beyond the bounds.
    displaced: Since,
}

impl Suspicion {
    /// Whether it is enough to name a phone with this kind of error.
    fn is_enough(&self, time_gps: GpsTime, kind: impl Fn() -> ErrorKind) -> bool {
        let lasts = |since: Since, lasting_s| since.lasts(time_gps, lasting_s);
        let is_seen = lasts(self.firm, FIRM_S) || lasts(self.confirmed, FIRM_S) || lasts(self.displaced, 0.0);
        let is_lasting = lasts(self.lasting, SUSPECTED_S)
            || lasts(self.confirmed, CONFIRMED_S)
            || lasts(self.displaced, CONFIRMED_S);
        is_seen && (is_lasting || kind() != ErrorKind::Unknown)
    }
}

/// A phone that is isolated.
#[derive(Clone, Copy, Debug)]
struct Isolation {
    /// Speed of the others when it began, m/s.
    others_mps: f64,
    /// Last time without an agreement that counts.
    last: GpsTime,
}

/// What the group knows of its phones.
#[derive(Clone, Debug)]
pub(super) struct Peers {
    is_active: bool,
    /// By phone.
    suspicions: Vec<Suspicion>,
    /// By phone.
    isolated: Vec<Option<Isolation>>,
    /// The phone that explains all contradictions and doubts of this epoch.
    suspect: Option<usize>,
    /// By constraint: told to be wrong.
    wrong: Vec<Told>,
    open: Told,
    /// By phone.
    histories: Vec<History>,
    solutions: Solutions,
}

impl Peers {
    pub fn new(phones: usize, constraints: usize, is_active: bool) -> Self {
        Self {
            is_active,
            suspicions: vec![Suspicion::default(); phones],
            isolated: vec![None; phones],
            suspect: None,
            wrong: vec![Told::default(); constraints],
            open: Told::default(),
            histories: vec![History::default(); phones],
            solutions: Solutions::default(),
        }
    }

    /// Whether a phone is isolated.
    pub fn is_isolated(&self, phone: usize) -> bool {
        self.isolated.get(phone).is_some_and(Option::is_some)
    }

    /// Whether a phone is coupled to no other at this epoch: it is isolated, or suspected and not yet named.
    pub fn is_apart(&self, phone: usize) -> bool {
        self.is_isolated(phone) || self.suspect == Some(phone)
    }

    /// Takes the constraints in force and the phones that are seen. Returns what happened.
    pub fn take(
        &mut self,
        time_gps: GpsTime,
        evidence: &[Evidence<'_>],
        seen: &[Option<Seen>],
    ) -> Vec<IntegrityEvent> {
        let mut events = Vec::new();
        if !self.is_active {
            return events;
        }
        self.remember(time_gps, evidence, seen);
        self.solutions.take(time_gps, evidence, seen);
        let event = |phones: Vec<usize>, constraint, kind| IntegrityEvent {
            time_gps,
            phones,
            constraint,
            kind,
            error: None,
        };
        let others_mps: Vec<f64> =
            (0..self.isolated.len()).map(|phone| self.speed_of_others_mps(phone, seen)).collect();
        self.readmit(time_gps, evidence, &others_mps, &mut |phone| {
            events.push(event(vec![phone], None, EventKind::Readmitted));
        });

        let among_others =
            |evidence: &&Evidence<'_>| evidence.phones.iter().all(|phone| !self.is_isolated(*phone));
        let counted: Vec<Evidence<'_>> = evidence.iter().filter(among_others).copied().collect();
        let judged = judge(&counted, self.isolated.len());
        self.suspect = judged.phone;
        for phone in self.newly_named(time_gps, &judged) {
            self.isolated[phone] = Some(Isolation { others_mps: others_mps[phone], last: time_gps });
            let error = Some(self.histories[phone].kind());
            events.push(IntegrityEvent { error, ..event(vec![phone], None, EventKind::Isolated) });
        }
        for (place, wrong) in self.wrong.iter_mut().enumerate() {
            if wrong.take(judged.constraints.contains(&place), time_gps, UNEXPLAINED_S) {
                let phones =
                    counted.iter().find(|e| e.place == place).map_or(Vec::new(), |e| e.phones.to_vec());
                events.push(event(phones, Some(place), EventKind::ConstraintContradicted));
            }
        }
        if self.open.take(!judged.open.is_empty(), time_gps, UNEXPLAINED_S) {
            let constraint = judged.open_constraint;
            events.push(event(judged.open, constraint, EventKind::CannotTell));
        }
        events
    }

    /// Phones that have been suspected for long enough.
    fn newly_named(&mut self, time_gps: GpsTime, judged: &Judged) -> Vec<usize> {
        let displaced = self.solutions.displaced(time_gps, |phone| self.is_isolated(phone));
        let is_displaced =
            |phone: usize| displaced == Some(phone) && judged.phone.is_none_or(|suspect| suspect == phone);
        let mut named = Vec::new();
        for (phone, suspicion) in self.suspicions.iter_mut().enumerate() {
            let explains = judged.phone == Some(phone);
            suspicion.firm.take(explains && judged.is_firm, time_gps);
            suspicion.lasting.take(explains, time_gps);
            let sigmas = || self.solutions.excess_sigmas(phone, time_gps);
            suspicion.confirmed.take(judged.nearly == Some(phone) && sigmas() > CONFIRMING_SIGMAS, time_gps);
            let kind = || self.histories[phone].kind();
            suspicion.displaced.take(is_displaced(phone), time_gps);
            if suspicion.is_enough(time_gps, kind) {
                named.push(phone);
            }
        }
        named
    }

    /// Remembers where each phone was beside its companions.
    fn remember(&mut self, time_gps: GpsTime, evidence: &[Evidence<'_>], seen: &[Option<Seen>]) {
        let at = |phone: usize| seen.get(phone).copied().flatten();
        for phone in 0..self.histories.len() {
            let Some(own) = at(phone) else { continue };
            let near = evidence.iter().filter(|e| e.within_m <= COMPANIONS_M && e.phones.contains(&phone));
            let mut companions: Vec<usize> = near.flat_map(|e| e.phones.iter().copied()).collect();
            companions.sort_unstable();
            companions.dedup();
            companions.retain(|other| *other != phone && !self.is_isolated(*other));
            let companions: Vec<Seen> = companions.into_iter().filter_map(at).collect();
            self.histories[phone].take(time_gps, &own, &companions);
        }
    }

    /// Mean speed of the phones that are not isolated, without one of them, m/s.
    fn speed_of_others_mps(&self, phone: usize, seen: &[Option<Seen>]) -> f64 {
        let others =
            seen.iter().enumerate().filter(|(other, _)| *other != phone && !self.is_isolated(*other));
        let speeds_mps: Vec<f64> = others.filter_map(|(_, seen)| Some(seen.as_ref()?.speed_mps())).collect();
        speeds_mps.iter().sum::<f64>() / speeds_mps.len().max(1) as f64
    }

    fn readmit(
        &mut self,
        time_gps: GpsTime,
        evidence: &[Evidence<'_>],
        others_mps: &[f64],
        tell: &mut dyn FnMut(usize),
    ) {
        for (phone, isolated) in self.isolated.iter_mut().enumerate() {
            let Some(isolation) = isolated else { continue };
            let contradicts = self.solutions.excess_sigmas(phone, time_gps) > DISAGREEING_SIGMAS
                || evidence.iter().any(|e| e.doubt >= Doubt::Doubted && e.phones.contains(&phone));
            let telling_mps = (AGREEING_SHARE * isolation.others_mps).min(AGREEING_MPS);
            if contradicts || others_mps[phone] < telling_mps {
                isolation.last = time_gps;
            } else if time_gps - isolation.last >= AGREED_S {
                *isolated = None;
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
    /// Whether it contradicts enough others firmly.
    is_firm: bool,
    /// The phone beside which every bound is nearly doubted.
    nearly: Option<usize>,
    /// Constraints that are wrong.
    constraints: Vec<usize>,
    /// Phones of contradictions that nothing explains.
    open: Vec<usize>,
    /// The constraint that they contradict, if it is a single one.
    open_constraint: Option<usize>,
}

fn judge(evidence: &[Evidence<'_>], phones: usize) -> Judged {
    let mut judged = Judged::default();
    let alone = evidence.iter().filter(|e| e.phones.len() == 1 && e.is_told());
    judged.constraints.extend(alone.map(|e| e.place));
    let pairs: Vec<&Evidence<'_>> = evidence.iter().filter(|e| e.phones.len() == 2).collect();
    let doubted: Vec<&Evidence<'_>> = pairs.iter().copied().filter(|e| e.doubt >= Doubt::Doubted).collect();
    let contradicted: Vec<&Evidence<'_>> = pairs.iter().copied().filter(|e| e.is_contradicted()).collect();
    // Of several constraints on one pair the worst counts.
    let is_at_odds = |pair: &Evidence<'_>| {
        let mut same = doubted.iter().filter(|e| e.phones.iter().all(|phone| pair.phones.contains(phone)));
        same.next().is_some()
    };
    let partners = |phone: usize, is_doubted: bool| {
        let with = pairs.iter().filter(|e| e.phones.contains(&phone) && is_at_odds(e) == is_doubted);
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
    judged.nearly = nearly_explaining(&pairs, phones);
    let explaining: Vec<usize> = (0..phones).filter(explains).collect();
    if let [phone] = explaining[..] {
        judged.phone = Some(phone);
        judged.is_firm = firmly_contradicted(&pairs, phone) >= FEWEST_PARTNERS;
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
        judged.constraints.extend(contradicted.iter().filter(|e| e.is_told()).map(|e| e.place));
    } else {
        judged.open = involved;
        judged.open_constraint = if let [single] = contradicted[..] { Some(single.place) } else { None };
    }
    judged
}

/// The only phone of which the bounds to all others, of whom there are enough, are nearly doubted.
fn nearly_explaining(pairs: &[&Evidence<'_>], phones: usize) -> Option<usize> {
    let is_nearly = |phone: &usize| {
        let mut shares: BTreeMap<usize, f64> = BTreeMap::new();
        for pair in pairs.iter().filter(|pair| pair.phones.contains(phone)) {
            for other in pair.phones.iter().filter(|other| *other != phone) {
                let share = shares.entry(*other).or_default();
                *share = share.max(pair.share);
            }
        }
        shares.len() >= FEWEST_PARTNERS && shares.values().all(|share| *share > NEARLY_SHARE)
    };
    let nearly: Vec<usize> = (0..phones).filter(is_nearly).collect();
    if let [phone] = nearly[..] { Some(phone) } else { None }
}

/// From vectors in ECEF to east and north at a place.
fn plane_at(place: Ecef) -> Matrix2x3<f64> {
    LocalFrame::at(place).rotation_ecef_to_enu().fixed_view::<2, 3>(0, 0).into_owned()
}

/// Number of phones that a phone contradicts firmly.
fn firmly_contradicted(pairs: &[&Evidence<'_>], phone: usize) -> usize {
    let firm = pairs.iter().filter(|e| e.share > FIRM_SHARE && e.phones.contains(&phone));
    let mut others: Vec<usize> =
        firm.flat_map(|e| e.phones.iter().copied()).filter(|other| *other != phone).collect();
    others.sort_unstable();
    others.dedup();
    others.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAIRS: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

    fn doubt(is_wrong: bool) -> (Doubt, f64) {
        if is_wrong { (Doubt::Contradicted, 1.1) } else { (Doubt::None, 0.0) }
    }

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
                    let (doubt, share) = doubt(wrong(second, *pair));
                    Evidence { place, phones: pair, doubt, share, within_m: 2.0 }
                })
                .collect();
            for event in peers.take(start + f64::from(second), &evidence, &[]) {
                told.push((event.time_gps - start, event.phones, event.kind));
            }
        }
        told
    }

    #[test]
    fn one_phone_against_all_others_is_isolated_and_comes_back() {
        let told = events(60, |second, pair| (10..30).contains(&second) && pair.contains(&2));
        let expected = [(16.0, vec![2], EventKind::Isolated), (39.0, vec![2], EventKind::Readmitted)];
        assert_eq!(told, expected);
        // Five seconds of contradiction are not enough.
        assert!(events(20, |second, pair| (10..16).contains(&second) && pair.contains(&2)).is_empty());
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
        let evidence =
            [Evidence { place: 0, phones: &[0, 1], doubt: Doubt::Contradicted, share: 1.1, within_m: 1.0 }];
        let told: Vec<IntegrityEvent> =
            (0..15).flat_map(|second| peers.take(start + f64::from(second), &evidence, &[])).collect();
        assert_eq!(told.len(), 1);
        assert_eq!((told[0].kind, &told[0].phones[..]), (EventKind::CannotTell, &[0, 1][..]));
        assert_eq!(told[0].constraint, Some(0));
        assert!(Peers::new(2, 1, false).take(start, &evidence, &[]).is_empty());
    }

    #[test]
    fn a_second_constraint_that_a_liar_keeps_does_not_hide_it() {
        let distances = [[0, 1], [0, 2], [1, 2]];
        let evidence: Vec<Evidence<'_>> = distances
            .iter()
            .chain(&distances)
            .enumerate()
            .map(|(place, phones)| {
                let (doubt, share) = doubt(place < 3 && phones.contains(&2));
                Evidence { place, phones, doubt, share, within_m: 2.0 }
            })
            .collect();
        let mut peers = Peers::new(3, 6, true);
        let start = GpsTime::from_week_tow(2118, 100.0);
        let told: Vec<IntegrityEvent> =
            (0..9).flat_map(|second| peers.take(start + f64::from(second), &evidence, &[])).collect();
        assert_eq!((told[0].kind, &told[0].phones[..]), (EventKind::Isolated, &[2][..]));
        assert_eq!(told[0].error, Some(ErrorKind::Unknown));
    }
}
