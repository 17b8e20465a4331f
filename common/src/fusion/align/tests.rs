use crate::integrity::{RaimReport, Verdict};
use crate::skips::Reason;
use proptest::prelude::*;

use super::*;

pub(super) fn at(seconds: f64) -> GpsTime {
    GpsTime::from_week_tow(2118, 397_000.0) + seconds
}

pub(super) fn message(phone: usize, sequence: u64, seconds: f64) -> EpochMessage {
    EpochMessage {
        phone: format!("p{phone}"),
        sequence,
        time_gps: at(seconds),
        observations: Vec::new(),
        changes_since_gps: None,
        wls: None,
        local: None,
        local_integrity: None,
        raim: RaimReport::of(Verdict::CannotBeChecked),
    }
}

/// Pushes whole series one after the other and returns the buckets as seconds by phone.
fn buckets(series: &[&[f64]]) -> Vec<Vec<Option<f64>>> {
    let mut aligner = Aligner::new(series.len(), AlignOptions::default());
    for (phone, times) in series.iter().enumerate() {
        for (sequence, &seconds) in times.iter().enumerate() {
            aligner.push(phone, message(phone, sequence as u64, seconds), Duration::ZERO);
        }
        aligner.finish(phone);
    }
    seconds(&drain(&mut aligner))
}

pub(super) fn drain(aligner: &mut Aligner) -> Vec<Bucket> {
    std::iter::from_fn(|| aligner.pop_ready()).collect()
}

pub(super) fn seconds(buckets: &[Bucket]) -> Vec<Vec<Option<f64>>> {
    let second = |m: &Option<EpochMessage>| m.as_ref().map(|m| ((m.time_gps - at(0.0)) * 1e6).round() / 1e6);
    buckets.iter().map(|bucket| bucket.iter().map(second).collect()).collect()
}

#[test]
fn jitter_around_the_second_does_not_part_phones() {
    let found = buckets(&[&[0.0004, 1.0004, 2.0004], &[-0.0003, 0.9997, 1.9996]]);
    assert_eq!(
        found,
        [[Some(0.0004), Some(-0.0003)], [Some(1.0004), Some(0.9997)], [Some(2.0004), Some(1.9996)]]
    );
}

#[test]
fn phones_half_a_second_apart_pair_up() {
    let found = buckets(&[&[0.0, 1.0, 2.0], &[0.5, 1.5, 2.5]]);
    assert_eq!(found, [[Some(0.0), Some(0.5)], [Some(1.0), Some(1.5)], [Some(2.0), Some(2.5)]]);
}

#[test]
fn different_starts_stops_and_gaps_leave_holes() {
    let found = buckets(&[&[0.0, 1.0, 4.0], &[1.001, 2.001, 3.001, 4.001, 5.001]]);
    assert_eq!(
        found,
        [
            [Some(0.0), None],
            [Some(1.0), Some(1.001)],
            [None, Some(2.001)],
            [None, Some(3.001)],
            [Some(4.0), Some(4.001)],
            [None, Some(5.001)]
        ]
    );
}

#[test]
fn the_extra_epochs_of_a_fast_phone_stand_alone() {
    let found = buckets(&[&[0.0, 1.0], &[0.6, 0.8, 1.0, 1.2]]);
    assert_eq!(
        found,
        [[Some(0.0), None], [None, Some(0.6)], [None, Some(0.8)], [Some(1.0), Some(1.0)], [None, Some(1.2)]]
    );
}

#[test]
fn a_bucket_waits_for_running_phones_only() {
    let mut aligner = Aligner::new(2, AlignOptions::default());
    aligner.push(0, message(0, 0, 0.0), Duration::ZERO);
    aligner.push(0, message(0, 1, 1.0), Duration::ZERO);
    assert_eq!(aligner.pop_ready(), None);
    aligner.finish(1);
    assert_eq!(seconds(&drain(&mut aligner)), [[Some(0.0), None], [Some(1.0), None]]);
}

#[test]
fn simultaneous_epochs_need_no_look_ahead_but_others_do() {
    let mut aligner = Aligner::new(2, AlignOptions::default());
    for (sequence, seconds) in [(0, 0.0), (1, 1.0)] {
        aligner.push(0, message(0, sequence, seconds), Duration::ZERO);
        aligner.push(1, message(1, sequence, seconds + 0.0007), Duration::ZERO);
    }
    assert_eq!(drain(&mut aligner).len(), 2);
    aligner.push(0, message(0, 2, 2.0), Duration::ZERO);
    aligner.push(1, message(1, 2, 2.3), Duration::ZERO);
    assert_eq!(aligner.pop_ready(), None, "phone 0 might be fast and have one at 2.2 s");
    aligner.push(0, message(0, 3, 2.2), Duration::ZERO);
    assert_eq!(seconds(&drain(&mut aligner)), [[Some(2.0), None]]);
}

#[test]
fn an_absurd_time_costs_one_message() {
    let year = 365.25 * 86_400.0;
    for absurd in [[year, 0.0, 1.0, 2.0], [0.0, year, 1.0, 2.0], [0.0, 1.0, year, 2.0], [0.0, 1.0, 2.0, year]]
    {
        let mut aligner = Aligner::new(1, AlignOptions::default());
        for (sequence, &seconds) in absurd.iter().enumerate() {
            aligner.push(0, message(0, sequence as u64, seconds), Duration::ZERO);
        }
        aligner.finish(0);
        assert_eq!(seconds(&drain(&mut aligner)), [[Some(0.0)], [Some(1.0)], [Some(2.0)]], "{absurd:?}");
        assert_eq!(aligner.skips(0).unwrap().count(Reason::EpochFarFromNeighbours), 1, "{absurd:?}");
    }
}

#[test]
fn a_long_pause_is_believed_when_it_goes_on() {
    assert_eq!(buckets(&[&[0.0, 1.0, 5_000.0, 5_001.0]]).len(), 4);
    assert_eq!(buckets(&[&[7.0]]), [[Some(7.0)]], "a single epoch is believed");
}

/// Epochs every two hours, two such epochs, and a series with one wrong date: nothing else is lost.
#[test]
fn long_regular_steps_are_believed() {
    let hours = |hours: &[f64]| hours.iter().map(|hour| 3_600.0 * hour).collect::<Vec<_>>();
    for (series, lost) in [
        (hours(&[0.0, 2.0, 4.0, 6.0, 8.0, 10.0]), 0),
        (hours(&[0.0, 2.0]), 0),
        (hours(&[0.0, 2.0, 4.5, 7.0, 9.0]), 0),
        (hours(&[0.0, 2.0, 4.0, 800.0, 6.0, 8.0]), 1),
    ] {
        let fused = buckets(&[&series]);
        assert_eq!(fused.len(), series.len() - lost, "{series:?}: {fused:?}");
    }
}

#[test]
fn duplicates_and_disorder_are_counted_and_named() {
    let mut aligner = Aligner::new(1, AlignOptions::default());
    for (sequence, seconds) in [(0, 0.0), (1, 1.0), (1, 1.0), (0, 0.0), (2, 1.01), (3, 2.0)] {
        aligner.push(0, message(0, sequence, seconds), Duration::ZERO);
    }
    assert_eq!(aligner.waiting(), 3);
    let skips = aligner.skips(0).unwrap();
    assert_eq!(skips.count(Reason::EpochReceivedTwice), 1);
    assert_eq!(skips.count(Reason::EpochOutOfOrder), 1);
    assert_eq!(skips.count(Reason::EpochTooSoon), 1);
    let first = &skips.iter().next().unwrap().1.first;
    assert!(first.contains("sequence 0 at 2020-08-13T14:16:40.000"), "{first}");
    aligner.push(7, message(7, 0, 0.0), Duration::ZERO);
    assert_eq!(aligner.waiting(), 3, "an index beyond the group is ignored");
}

/// Increasing times of one phone with a rate, a phase, jitter and gaps.
fn series() -> impl Strategy<Value = Vec<f64>> {
    let rate = prop::sample::select(vec![1.0, 0.2, 0.1, 2.0, 5.0, 15.0]);
    (rate, 0.0..1.0_f64, 0.0..5.0_f64, prop::collection::vec((-0.001..0.001_f64, 0.0..1.0_f64), 0..25))
        .prop_map(|(interval, phase, start, steps)| {
            let epochs = steps.iter().enumerate().filter(|(_, (_, gap))| *gap < 0.9);
            epochs.map(|(i, (jitter, _))| start.floor() + phase + i as f64 * interval + jitter).collect()
        })
}

/// Feeds the phones' series in the given order and pops as early as possible.
fn interleaved(all: &[Vec<f64>], order: &[usize], options: AlignOptions) -> Vec<Bucket> {
    let mut aligner = Aligner::new(all.len(), options);
    let mut sent = vec![0; all.len()];
    let mut buckets = Vec::new();
    let rest = (0..all.len()).flat_map(|phone| std::iter::repeat_n(phone, all[phone].len() + 1));
    for phone in order.iter().map(|i| i % all.len()).chain(rest) {
        match all[phone].get(sent[phone]) {
            Some(&seconds) => {
                aligner.push(phone, message(phone, sent[phone] as u64, seconds), Duration::ZERO);
            }
            None => aligner.finish(phone),
        }
        sent[phone] += 1;
        buckets.extend(drain(&mut aligner));
    }
    assert_eq!(aligner.waiting(), 0);
    buckets
}

/// A fixed tolerance of half a second.
fn fixed() -> AlignOptions {
    AlignOptions { tolerance_s: Some(0.5), ..AlignOptions::default() }
}

/// Half of the longest step of all series, at least half a second, and 5 % for the rounding of intervals, s.
fn widest_s(all: &[Vec<f64>]) -> f64 {
    let steps = all.iter().flat_map(|times| times.windows(2).map(|two| two[1] - two[0]));
    0.525 * steps.fold(1.0, f64::max)
}

/// Times at an interval from `start` on.
fn regular(start: f64, interval_s: f64, count: u32) -> Vec<f64> {
    (0..count).map(|epoch| start + interval_s * f64::from(epoch)).collect()
}

/// Differences between the first two phones in the buckets that have both, s, and the number of the other buckets.
fn apart_s(series: &[&[f64]]) -> (Vec<f64>, usize) {
    let found = buckets(series);
    let both = |bucket: &Vec<Option<f64>>| Some(((bucket[1]? - bucket[0]?) * 1e4).round() / 1e4);
    let apart: Vec<f64> = found.iter().filter_map(both).collect();
    let others = found.len() - apart.len();
    (apart, others)
}

#[test]
fn slow_phones_meet_at_any_offset() {
    for (interval_s, offset_s) in
        [(5.0, 1.0), (5.0, 2.0), (5.0, 2.5), (15.0, 4.0), (15.0, 7.0), (30.0, 0.3), (30.0, 14.0)]
    {
        // Their intervals are known from the third epoch on.
        let (apart, others) = apart_s(&[&regular(0.0, interval_s, 20), &regular(offset_s, interval_s, 20)]);
        assert!(apart.len() >= 18 && others <= 4, "{interval_s} s, {offset_s} s: {apart:?} {others}");
        assert!(apart.iter().all(|apart_s| apart_s.abs() == offset_s), "{apart:?}");
    }
    // Three seconds after one epoch and two before the next one.
    let (apart, others) = apart_s(&[&regular(0.0, 5.0, 20), &regular(3.0, 5.0, 20)]);
    assert!(apart.len() >= 17 && others <= 6, "{apart:?} {others}");
    assert!(apart.iter().all(|apart_s| *apart_s == -2.0), "{apart:?}");
}

#[test]
fn a_fixed_tolerance_replaces_that_by_intervals() {
    let slow = [regular(0.0, 5.0, 20), regular(2.0, 5.0, 20)];
    assert!(interleaved(&slow, &[], fixed()).iter().all(|bucket| bucket.iter().flatten().count() == 1));
    let wide = AlignOptions { tolerance_s: Some(2.0), ..AlignOptions::default() };
    assert_eq!(interleaved(&slow, &[], wide).len(), 20, "from the first epoch on");
    let close = AlignOptions { tolerance_s: Some(0.1), ..AlignOptions::default() };
    assert_eq!(interleaved(&[regular(0.0, 1.0, 20), regular(0.2, 1.0, 20)], &[], close).len(), 40);
}

#[test]
fn a_slow_phone_meets_the_nearest_epoch_of_a_fast_one() {
    // Interval of the fast phone, how many of its epochs come to one of the slow phone, and the offset of that, s.
    for (fast_s, ratio, offset_s) in [
        (0.1, 10_u32, 0.53),
        (0.1, 10, 0.0),
        (1.0, 5, 2.3),
        (1.0, 30, 0.4),
        (0.01, 100, 0.003),
        (0.01, 10, 0.0),
    ] {
        let slow_s = fast_s * f64::from(ratio);
        let (apart, others) = apart_s(&[&regular(0.0, fast_s, 10 * ratio), &regular(offset_s, slow_s, 10)]);
        assert_eq!((apart.len(), others), (10, 10 * ratio as usize - 10), "{fast_s} s and {slow_s} s");
        assert!(apart.iter().all(|apart_s| apart_s.abs() <= 0.5 * fast_s), "{apart:?}");
    }
}

#[test]
fn phones_at_a_hundred_hertz_lose_nothing_and_meet() {
    for offset_s in [0.0, 0.001, 0.004] {
        let (apart, others) = apart_s(&[&regular(0.0, 0.01, 500), &regular(offset_s, 0.01, 500)]);
        assert!(apart.len() >= 498 && others <= 4, "{} {others}", apart.len());
        assert!(apart.iter().all(|apart_s| *apart_s == offset_s), "{apart:?}");
    }
}

/// At 50 Hz an epoch 12 ms after one of the other phone is not simultaneous with it: the next one is nearer.
#[test]
fn what_is_simultaneous_depends_on_the_rate() {
    let (apart, _) = apart_s(&[&regular(0.0, 0.02, 100), &regular(0.012, 0.02, 100)]);
    assert!(apart.len() >= 97 && apart.iter().skip(2).all(|apart_s| *apart_s == -0.008), "{apart:?}");
}

#[test]
fn phones_that_change_their_rate_meet_again() {
    // Both at 1 Hz, from 30 s on at 10 Hz, from 60 s on every 5 s: six epochs later the interval is known.
    let changing = |offset_s: f64, late_s: f64| {
        let series =
            [regular(offset_s, 1.0, 30), regular(30.0 + offset_s, 0.1, 300), regular(60.0 + late_s, 5.0, 20)];
        series.concat()
    };
    let (first, second) = (changing(0.0, 0.0), changing(0.003, 2.0));
    let found = buckets(&[&first, &second]);
    let both = |from: f64, to: f64| {
        let within = |bucket: &&Vec<Option<f64>>| {
            bucket[0].is_some_and(|time| (from..to).contains(&time)) && bucket[1].is_some()
        };
        found.iter().filter(within).count()
    };
    assert_eq!((both(0.0, 30.0), both(30.0, 60.0)), (30, 300));
    assert!(both(60.0, 160.0) >= 14 && both(90.0, 160.0) == 14, "{found:?}");
    // A phone at 100 Hz after 1 Hz loses some epochs that seem too soon, and no more after a tenth of a second.
    let mut aligner = Aligner::new(1, AlignOptions::default());
    for (sequence, seconds) in
        [regular(0.0, 1.0, 20), regular(20.0, 0.01, 500)].concat().into_iter().enumerate()
    {
        aligner.push(0, message(0, sequence as u64, seconds), Duration::ZERO);
    }
    let lost = aligner.skips(0).unwrap().count(Reason::EpochTooSoon);
    assert!((1..10).contains(&lost), "{lost}");
}

proptest! {
    #[test]
    fn arrival_order_changes_nothing_and_nothing_is_lost(
        all in prop::collection::vec(series(), 1..5),
        order in prop::collection::vec(any::<usize>(), 0..120),
    ) {
        for (options, widest_s) in [(fixed(), 0.5), (AlignOptions::default(), widest_s(&all))] {
            let expected = interleaved(&all, &[], options);
            let found = interleaved(&all, &order, options);
            prop_assert_eq!(&found, &expected);
            for (phone, times) in all.iter().enumerate() {
                let of_phone = found.iter().filter_map(|b| b[phone].as_ref().map(|m| m.sequence));
                prop_assert_eq!(of_phone.collect::<Vec<_>>(), (0..times.len() as u64).collect::<Vec<_>>());
            }
            let mut done_to = None;
            for bucket in &found {
                let times: Vec<GpsTime> = bucket.iter().flatten().map(|m| m.time_gps).collect();
                let (first, last) = (*times.iter().min().unwrap(), *times.iter().max().unwrap());
                prop_assert!(last - first <= widest_s);
                prop_assert!(done_to <= Some(first), "a bucket begins before the one before it ended");
                done_to = Some(last);
            }
        }
    }

    /// With one gap in five epochs at most, the tolerance by intervals is half a second.
    #[test]
    fn phones_at_one_hertz_need_no_tolerance(
        phones in prop::collection::vec(
            (0.0..5.0_f64, prop::collection::vec((-0.001..0.001_f64, any::<bool>()), 0..40)), 1..5,
        ),
    ) {
        let of_phone = |(start, epochs): &(f64, Vec<(f64, bool)>)| -> Vec<f64> {
            let there = (0_u32..).zip(epochs).filter(|(epoch, (_, gap))| !(*gap && epoch % 5 == 4));
            there.map(|(epoch, (jitter, _))| start + f64::from(epoch) + jitter).collect()
        };
        let all: Vec<Vec<f64>> = phones.iter().map(of_phone).collect();
        prop_assert_eq!(interleaved(&all, &[], AlignOptions::default()), interleaved(&all, &[], fixed()));
    }

    #[test]
    fn phones_on_the_same_second_always_meet(
        phones in prop::collection::vec((0_u32..10, 10_u32..30), 2..5),
        jitter_ms in -0.5..0.5_f64,
    ) {
        let all: Vec<Vec<f64>> = phones
            .iter()
            .enumerate()
            .map(|(k, &(start, stop))| (start..stop).map(|s| f64::from(s) + jitter_ms * 1e-3 * k as f64).collect())
            .collect();
        for bucket in interleaved(&all, &[], AlignOptions::default()) {
            let second = bucket.iter().flatten().map(|m| (m.time_gps - at(0.0)).round()).next().unwrap();
            for (k, &(start, stop)) in phones.iter().enumerate() {
                let there = f64::from(start) <= second && second < f64::from(stop);
                prop_assert_eq!(bucket[k].is_some(), there);
            }
        }
    }
}
