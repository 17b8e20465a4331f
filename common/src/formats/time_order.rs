//! Epochs in order of time, each once, although a date may be damaged.
//!
//! An epoch long after its predecessor either is the first after a gap or has a wrong date. It is held until the next epoch
//! comes: if that goes on from there, both are given; if it goes on from before, the held epoch was wrong. So a damaged date costs
//! its own epoch and no other, and a gap costs nothing.

use std::cmp::Ordering;

use crate::formats::decode::Record;
use crate::gnss::ObservationEpoch;
use crate::skips::{Reason, Skips};
use crate::time::GpsTime;

/// A longer step forward waits for the next epoch, s.
pub(crate) const LONG_STEP_S: f64 = 60.0;
/// Longest step, s, that is believed at the end of the recording, where no epoch follows; and largest distance of the first epoch from the
/// beginning stated in a header at which it is believed at once.
pub(crate) const DAY_S: f64 = 86_400.0;

/// Whether a time equals another or follows it without a long step.
pub(crate) fn follows(before: GpsTime, time: GpsTime) -> bool {
    (0.0..=LONG_STEP_S).contains(&(time - before))
}

/// What a time says about an earlier one that was far ahead and waits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// The recording goes on from before the waiting time, or from another earlier time: the waiting time is wrong.
    Wrong,
    /// Both times are equal.
    Same,
    /// The recording goes on after the waiting time.
    Confirmed,
}

impl Verdict {
    /// The verdict on the `waiting` time by a `time` that is not late; `goes_on`: whether `time` goes on from before.
    pub(crate) fn on(waiting: GpsTime, time: GpsTime, goes_on: bool) -> Self {
        match time.cmp(&waiting) {
            _ if goes_on => Self::Wrong,
            Ordering::Less => Self::Wrong,
            Ordering::Equal => Self::Same,
            Ordering::Greater => Self::Confirmed,
        }
    }
}

/// Keeps the epochs in order of time.
#[derive(Clone, Debug)]
pub(crate) struct TimeOrder {
    /// Unit of the numbers in messages: line or frame.
    unit: &'static str,
    /// The last epoch that is believed.
    last: Option<GpsTime>,
    held: Option<Held>,
}

/// An epoch that waits for the next one.
#[derive(Clone, Debug)]
struct Held {
    time: GpsTime,
    /// The line or frame that it began in.
    number: u64,
    /// The epoch, and other records after it.
    records: Vec<Record>,
}

/// Takes records.
type Out<'a> = &'a mut dyn FnMut(Record);

impl Default for TimeOrder {
    fn default() -> Self {
        Self::of("line")
    }
}

impl TimeOrder {
    /// Of a recording of lines or frames.
    pub(crate) const fn of(unit: &'static str) -> Self {
        Self { unit, last: None, held: None }
    }

    /// Why a time cannot be that of a new epoch, and against which time.
    pub(crate) fn refuses(&self, time: GpsTime) -> Option<(Reason, GpsTime)> {
        let held = self.held.as_ref().map(|held| held.time);
        if let Some(same) = self.last.into_iter().chain(held).find(|known| *known == time) {
            return Some((Reason::EpochRepeatsTime, same));
        }
        self.last.filter(|last| time < *last).map(|last| (Reason::EpochStepsBack, last))
    }

    /// Whether a time goes on from the last one without a long step; before the first epoch, whether it is near the `stated` one.
    pub(crate) fn goes_on(&self, time: GpsTime, stated: Option<GpsTime>) -> bool {
        match (self.last, stated) {
            (Some(last), _) => follows(last, time),
            (None, Some(stated)) => (time - stated).abs() <= DAY_S,
            (None, None) => true,
        }
    }

    /// Takes an epoch that [`TimeOrder::refuses`] does not, and the line or frame that it began in. `stated`: where the recording says that
    /// it begins.
    pub(crate) fn epoch(
        &mut self,
        (number, epoch): (u64, ObservationEpoch),
        stated: Option<GpsTime>,
        skips: &mut Skips,
        out: Out<'_>,
    ) {
        let time = epoch.time_gps;
        let goes_on = self.goes_on(time, stated);
        if let Some(held) = self.held.take() {
            if Verdict::on(held.time, time, goes_on) == Verdict::Wrong {
                self.drop(held, time, skips, out);
            } else {
                self.last = Some(held.time);
                held.records.into_iter().for_each(&mut *out);
            }
        }
        if goes_on || self.goes_on(time, stated) {
            self.last = Some(time);
            out(Record::Epoch(epoch));
        } else {
            self.held = Some(Held { time, number, records: vec![Record::Epoch(epoch)] });
        }
    }

    /// Takes a record of another kind, which keeps its place among the epochs.
    pub(crate) fn other(&mut self, record: Record, out: Out<'_>) {
        match &mut self.held {
            Some(held) => held.records.push(record),
            None => out(record),
        }
    }

    /// The recording has ended.
    pub(crate) fn finish(&mut self, stated: Option<GpsTime>, skips: &mut Skips, out: Out<'_>) {
        let Some(held) = self.held.take() else { return };
        let reference = self.last.or(stated).filter(|reference| (held.time - *reference).abs() > DAY_S);
        let Some(reference) = reference else {
            return held.records.into_iter().for_each(out);
        };
        skips.add(Reason::LastEpochFar, || {
            format!("{} {}: {} after {reference}", self.unit, held.number, held.time)
        });
        others(held).for_each(out);
    }

    fn drop(&self, held: Held, next: GpsTime, skips: &mut Skips, out: Out<'_>) {
        skips.add(Reason::EpochFarFromNext, || {
            format!("{} {}: {}, then {next}", self.unit, held.number, held.time)
        });
        others(held).for_each(out);
    }
}

/// What is not in doubt.
fn others(held: Held) -> impl Iterator<Item = Record> {
    held.records.into_iter().filter(|record| !matches!(record, Record::Epoch(_)))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::gnss::EpochFlag;

    fn at(seconds: f64) -> GpsTime {
        GpsTime::from_week_tow(2_118, 100_000.0) + seconds
    }

    /// What is given of epochs at these seconds, and what is counted.
    fn order(seconds: &[f64], stated: Option<f64>) -> (Vec<f64>, Skips) {
        let (mut order, mut skips, mut given) = (TimeOrder::default(), Skips::default(), Vec::new());
        let stated = stated.map(at);
        let mut out = |record: Record| {
            if let Record::Epoch(epoch) = record {
                given.push(epoch.time_gps - at(0.0));
            }
        };
        for (line, seconds) in (1..).zip(seconds) {
            let time_gps = at(*seconds);
            if let Some((reason, _)) = order.refuses(time_gps) {
                skips.add(reason, || format!("line {line}"));
                continue;
            }
            let epoch = ObservationEpoch { time_gps, flag: EpochFlag::Ok, observations: Vec::new() };
            order.epoch((line, epoch), stated, &mut skips, &mut out);
        }
        order.finish(stated, &mut skips, &mut out);
        (given, skips)
    }

    #[test]
    fn a_damaged_date_costs_its_own_epoch() {
        for wrong in [3_600.0, 86_400.0 * 400.0, -5.0] {
            let (given, skips) = order(&[0.0, 1.0, wrong, 3.0, 4.0], None);
            assert_eq!((given, skips.total()), (vec![0.0, 1.0, 3.0, 4.0], 1), "{wrong} s");
        }
        let (given, skips) = order(&[0.0, 3_600.0, 3_601.0, 1.0, 2.0], None);
        assert_eq!(
            (given, skips.total()),
            (vec![0.0, 3_600.0, 3_601.0], 2),
            "two that confirm each other are believed"
        );
    }

    #[test]
    fn gaps_and_long_intervals_cost_nothing() {
        for times in
            [vec![0.0, 1.0, 4_000.0, 4_001.0], vec![0.0, 900.0, 1_800.0, 2_700.0], vec![0.0, 4_000.0]]
        {
            let (given, skips) = order(&times, None);
            assert_eq!((&given, skips.total()), (&times, 0));
        }
        let days = vec![0.0, 3.0 * 86_400.0, 3.0 * 86_400.0 + 1.0];
        assert_eq!(order(&days, None).0, days);
    }

    #[test]
    fn beginnings_far_from_the_stated_one_wait() {
        let year = 365.0 * 86_400.0;
        for (times, given) in [
            (vec![-year, 0.0, 1.0], vec![0.0, 1.0]),
            (vec![year, 0.0, 1.0], vec![0.0, 1.0]),
            (vec![year, year + 1.0], vec![year, year + 1.0]),
            (vec![0.0], vec![0.0]),
        ] {
            assert_eq!(order(&times, Some(0.0)).0, given, "{times:?}");
        }
        let (given, skips) = order(&[year], Some(0.0));
        assert_eq!((given.len(), skips.total()), (0, 1));
    }

    proptest! {
        #[test]
        fn what_is_given_rises_and_the_rest_is_counted(
            seconds in proptest::collection::vec(-300_000.0..300_000.0_f64, 0..30),
            stated in proptest::option::of(-300_000.0..300_000.0_f64),
        ) {
            let (given, skips) = order(&seconds, stated);
            prop_assert!(given.is_sorted_by(|a, b| a < b), "{given:?}");
            prop_assert_eq!(given.len() as u64 + skips.total(), seconds.len() as u64);
        }

        #[test]
        fn one_wrong_date_among_good_ones_costs_one(
            count in 3_usize..30,
            place in 0_usize..30,
            wrong in prop_oneof![100.0..1e7_f64, -1e7..-1.0_f64],
        ) {
            let place = 1 + place % (count - 2);
            let mut seconds: Vec<f64> = (0_u32..).take(count).map(f64::from).collect();
            let good: Vec<f64> = seconds.iter().enumerate().filter(|(k, _)| *k != place).map(|(_, s)| *s).collect();
            seconds[place] = wrong;
            let (given, skips) = order(&seconds, None);
            prop_assert_eq!((given, skips.total()), (good, 1));
        }
    }
}
