//! When the messages of a stream are, which lack the week or the day: by what stands for the date, by the week that ephemerides state, and although a
//! receiver, a satellite or a file's last change says otherwise.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

mod rtcm_support;

use cofix_common::formats::rtcm::DatingHint;
use cofix_common::skips::Reason;
use cofix_common::time::GpsTime;
use rtcm_support::dates::{
    BEIDOU, DAY_S, GALILEO, GLONASS, GPS, WEEK_S, at, glonass, glonass_ephemeris, gps, observed, others,
    read, read_recording,
};

/// When a message is sent, and the message.
type Sent = (GpsTime, Vec<u8>);

/// A Thursday, and not next to the end of a week or day.
const NOON: &str = "2020-06-25T12:00:00";
/// The last seconds of a week.
const WEEKS_END: &str = "2020-06-27T23:59:58";

/// Epochs a second apart of these messages each.
fn epochs(begin: GpsTime, count: i32, of: &[u64]) -> Vec<Vec<u8>> {
    let epoch = |second| of.iter().map(move |number| observed(*number, begin + f64::from(second)));
    (0..count).flat_map(epoch).collect()
}

fn seconds(times: &[GpsTime], since: GpsTime) -> Vec<f64> {
    times.iter().map(|time| *time - since).collect()
}

/// Ephemerides alone for three weeks: of GPS every two hours, of GLONASS every half hour.
#[test]
fn streams_of_ephemerides_keep_their_week() {
    let begin = at("2020-06-22T00:00:00");
    let hours = |step: f64, count: i32| (0..count).map(move |k| begin + f64::from(k) * step * 3_600.0);
    let quarter = |time: GpsTime| time + 18.0;
    let of_gps = |time: GpsTime| (time, gps(5, time + -1_800.0, time));
    let of_glonass = |four_years| {
        move |time| (quarter(time), glonass_ephemeris(1, time + -600.0, quarter(time), four_years))
    };
    let of_beidou = |time: GpsTime| (time + 14.0, others(time)[0].clone());
    let of_galileo = |time: GpsTime| (time, others(time)[3].clone());
    let streams: [(&str, Vec<Sent>); 6] = [
        ("GPS", hours(2.0, 252).map(of_gps).collect()),
        ("GLONASS", hours(0.5, 1_008).map(of_glonass(0)).collect()),
        ("GLONASS with the year", hours(0.5, 1_008).map(of_glonass(7)).collect()),
        ("BeiDou", hours(1.0, 504).map(of_beidou).collect()),
        ("Galileo", hours(1.0, 504).map(of_galileo).collect()),
        ("GPS, once a day", hours(24.0, 21).map(of_gps).collect()),
    ];
    for (name, stream) in streams {
        let (toes, messages): (Vec<GpsTime>, Vec<Vec<u8>>) = stream.into_iter().unzip();
        let as_it_comes = read(&messages, begin);
        assert_eq!(as_it_comes.toes, toes, "{name}");
        assert!(as_it_comes.skips.is_empty(), "{name}: {}", as_it_comes.skips);
        for hint_days in [-30.0, -4.0, 3.0, 9.0, 300.0] {
            let hint = begin + hint_days * DAY_S;
            let (recording, dates) = read_recording(&messages, DatingHint::Near(hint));
            assert_eq!(recording.toes, toes, "{name}, {hint_days} days off");
            assert!(dates.are_stated());
        }
    }
}

/// Beside ephemerides of one satellite whose week is wrong.
#[test]
fn a_satellite_with_a_wrong_week_moves_nothing() {
    let begin = at(NOON);
    let lying = gps(9, begin + 3.0 * WEEK_S, begin + 3.0 * WEEK_S);
    let honest = |satellite| gps(satellite, begin, begin + 3_600.0);
    let mut alone = vec![lying.clone(), lying.clone()];
    for satellite in 1..6 {
        alone.extend([honest(satellite), lying.clone(), lying.clone()]);
    }
    alone.push(glonass_ephemeris(1, begin, begin + 18.0, 0));
    let toes = |read: &[GpsTime]| read.iter().filter(|toe| (**toe - begin).abs() < DAY_S).count();
    assert_eq!(toes(&read(&alone, begin).toes), 6, "all but the lying one");
    let (recording, dates) = read_recording(&alone, DatingHint::NotAfter(begin + 20.0 * DAY_S));
    assert_eq!((toes(&recording.toes), dates.begins()), (6, begin + 3_600.0));

    let mut observations = epochs(begin, 5, &[GPS, GALILEO]);
    observations.insert(0, lying.clone());
    observations.splice(4..4, (1..4).map(honest));
    observations.push(lying);
    let (recording, dates) = read_recording(&observations, DatingHint::Near(begin + 15.0 * DAY_S));
    assert_eq!(seconds(&recording.epochs, begin), [0.0, 1.0, 2.0, 3.0, 4.0], "{}", recording.skips);
    assert_eq!(toes(&recording.toes), 3);
    assert_eq!(dates.moved_s(), -2.0 * WEEK_S);
}

/// Each kind of ephemeris with a week tells it, whatever stands for the date; without any, the end is not after the last change.
#[test]
fn ephemerides_tell_the_week_of_a_recording() {
    let begin = at(NOON);
    let toe = at("2020-06-25T13:00:00");
    let all = others(toe);
    let stated: [(&str, Vec<Vec<u8>>); 6] = [
        ("1019", vec![gps(3, begin, toe)]),
        ("1042", vec![all[0].clone()]),
        ("1044", vec![all[1].clone()]),
        ("1045", vec![all[2].clone()]),
        ("1046", vec![all[3].clone()]),
        ("1020", vec![glonass_ephemeris(4, begin, at("2020-06-25T12:15:18"), 7)]),
    ];
    let expected = [0.0, 1.0, 2.0, 3.0];
    for (name, ephemeris) in stated {
        let stream = [epochs(begin, 2, &[GPS]), ephemeris, epochs(begin + 2.0, 2, &[GPS])].concat();
        for days in [-1_000.0, -20.0, -3.6, 0.0, 3.6, 5.0, 20.0, 1_000.0] {
            for hint in [DatingHint::Near(begin + days * DAY_S), DatingHint::NotAfter(begin + days * DAY_S)] {
                let (recording, dates) = read_recording(&stream, hint);
                assert_eq!(seconds(&recording.epochs, begin), expected, "{name} {days}: {}", recording.skips);
                assert!(dates.are_stated() && (recording.toes[0] - begin).abs() < 4_000.0, "{name} {days}");
            }
        }
    }
    let unstated = epochs(begin, 4, &[GPS]);
    for days in [0.01, 0.5, 3.0, 5.0, 6.3] {
        let hint = DatingHint::NotAfter(begin + days * DAY_S);
        let (recording, dates) = read_recording(&unstated, hint);
        assert_eq!(seconds(&recording.epochs, begin), expected, "{days} days later");
        assert!(!dates.are_stated());
    }
}

/// At the end of a week the number sent is that of the transmission, or of the reference time; the stream goes on in the next week.
#[test]
fn recordings_go_over_the_end_of_a_week() {
    let begin = at(WEEKS_END);
    let next = at("2020-06-28T02:00:00");
    for (name, sent) in [("transmission", begin), ("reference time", next)] {
        let stream = [
            vec![gps(3, sent, next), gps(4, sent, next)],
            epochs(begin, 4, &[GPS, GLONASS, GALILEO, BEIDOU]),
            vec![gps(5, next, next)],
            // For ten days, an hour apart.
            (1..240).map(|hour| observed(GPS, begin + f64::from(hour) * 3_600.0)).collect(),
        ]
        .concat();
        for (days, near) in [(-3.0, true), (3.0, true), (11.0, false), (16.0, false)] {
            let hint = begin + days * DAY_S;
            let hint = if near { DatingHint::Near(hint) } else { DatingHint::NotAfter(hint) };
            let (recording, _) = read_recording(&stream, hint);
            let epochs = seconds(&recording.epochs, begin);
            assert_eq!(epochs[..4], [0.0, 1.0, 2.0, 3.0], "{name} {days}: {}", recording.skips);
            assert_eq!(epochs.last(), Some(&(239.0 * 3_600.0)), "{name} {days}");
            assert!(recording.toes.iter().all(|toe| *toe == next), "{name} {days}: {:?}", recording.toes);
        }
        let as_it_comes = read(&stream, begin);
        assert_eq!(as_it_comes.epochs.len(), 243);
        assert!(as_it_comes.toes.iter().all(|toe| *toe == next), "{name}: {:?}", as_it_comes.toes);
    }
}

/// Recordings put together: each has its own week, if its ephemerides tell.
#[test]
fn recordings_joined_have_each_its_week() {
    // A multiple of the reference times' unit.
    const STEP_S: f64 = 3_200.0;
    let first = at(NOON);
    let part = |begin: GpsTime| {
        let ephemerides: Vec<_> = (1..4).map(|satellite| gps(satellite, begin, begin + 3_600.0)).collect();
        [epochs(begin, 20, &[GPS, GLONASS]), ephemerides, epochs(begin + 20.0, 20, &[GPS, GLONASS])].concat()
    };
    for days in [1.0, 3.0, 5.0, 10.0, 100.0] {
        let second = first + days * DAY_S + STEP_S;
        let stream = [part(first), part(second)].concat();
        let (recording, _) = read_recording(&stream, DatingHint::Near(first));
        let mut expected: Vec<f64> = (0..40).map(f64::from).collect();
        expected.extend((0..40).map(|second_of| f64::from(second_of) + days * DAY_S + STEP_S));
        assert_eq!(seconds(&recording.epochs, first), expected, "{days} days: {}", recording.skips);
        assert_eq!(recording.toes, [vec![first + 3_600.0; 3], vec![second + 3_600.0; 3]].concat());
    }
}

/// Some receivers send GLONASS' day as Sunday, or as one day, for ever, and legacy messages send none.
#[test]
fn glonass_days_that_are_wrong_cost_nothing() {
    let begin = at(NOON);
    for day in 0..=7 {
        for glonass_first in [false, true] {
            let epoch = |second| {
                let time = begin + f64::from(second);
                let mut messages = [observed(GPS, time), glonass(time, day), observed(BEIDOU, time)];
                if glonass_first {
                    messages.swap(0, 1);
                }
                messages
            };
            let stream: Vec<_> = (0..30).flat_map(epoch).collect();
            let expected: Vec<_> = (0..30).map(f64::from).collect();
            let systems = if glonass_first { "RGC" } else { "GRC" };
            for hours in [-70.0, -13.0, -1.0, 0.0, 1.0, 13.0, 70.0] {
                let near = begin + hours * 3_600.0;
                let (recording, _) = read_recording(&stream, DatingHint::Near(near));
                for read in [read(&stream, near), recording] {
                    assert_eq!(
                        seconds(&read.epochs, begin),
                        expected,
                        "day {day}, {hours} h: {}",
                        read.skips
                    );
                    assert_eq!(read.systems, vec![systems; 30].join(" "), "day {day}, {hours} h");
                    let wrong = if [4, 7].contains(&day) { 0 } else { 30 };
                    assert_eq!(
                        read.skips.count(Reason::GlonassDayContradictsStream),
                        wrong,
                        "day {day}: {}",
                        read.skips
                    );
                }
            }
        }
    }
}

/// GLONASS alone over Moscow's midnight for ten days, hourly; the day of the week right, unknown or always Sunday.
#[test]
fn glonass_alone_goes_on_from_day_to_day() {
    let begin = at(NOON);
    let expected: Vec<_> = (0..240).map(|hour| f64::from(hour) * 3_600.0).collect();
    for (name, day) in [("right", None), ("unknown", Some(7)), ("Sunday", Some(0))] {
        let message = |hour: &f64| {
            let time = begin + *hour;
            day.map_or_else(|| observed(GLONASS, time), |day| glonass(time, day))
        };
        let mut stream: Vec<_> = expected.iter().map(message).collect();
        for near in [begin + -3_600.0, begin + 3_600.0] {
            assert_eq!(seconds(&read(&stream, near).epochs, begin), expected, "{name}");
            let (recording, _) = read_recording(&stream, DatingHint::Near(near));
            assert_eq!(seconds(&recording.epochs, begin), expected, "{name}");
        }
        let (recording, _) = read_recording(&stream, DatingHint::NotAfter(begin + 240.0 * 3_600.0));
        assert_eq!(seconds(&recording.epochs, begin), expected, "{name}, by the last change");
        // An ephemeris tells the day.
        stream.insert(3, glonass_ephemeris(7, begin + 7_200.0, at("2020-06-25T14:15:18"), 7));
        let (recording, dates) = read_recording(&stream, DatingHint::Near(begin + 30.0 * DAY_S));
        assert_eq!(seconds(&recording.epochs, begin), expected, "{name}, by an ephemeris");
        assert!(dates.are_stated());
    }
}

/// A system whose clock is hours off does not move that of the others.
#[test]
fn a_system_hours_off_costs_no_other() {
    let begin = at(NOON);
    for (off, hours) in [(GLONASS, 3.0), (GLONASS, -3.0), (GLONASS, 10.0), (BEIDOU, 5.0), (BEIDOU, -5.0)] {
        for place in 0..3 {
            let epoch = |second| {
                let time = begin + f64::from(second);
                let mut messages = vec![observed(GPS, time), observed(GALILEO, time)];
                messages.insert(place, observed(off, time + hours * 3_600.0));
                messages
            };
            let stream: Vec<_> = (0..60).flat_map(epoch).collect();
            let what = format!("{off} {hours} h off in place {place}");
            let (recording, _) = read_recording(&stream, DatingHint::Near(begin));
            for read in [read(&stream, begin), recording] {
                let right = read.systems.split(' ').filter(|systems| *systems == "GE").count();
                // One that leads from the first message on is believed until the others outweigh it.
                assert!(
                    right >= if place == 0 && off == BEIDOU { 52 } else { 59 },
                    "{what}: {right} {}",
                    read.skips
                );
                assert!(!read.skips.is_empty(), "{what}");
            }
        }
    }
}

/// After a gap the first message waits for the second; nothing is lost, whichever system comes first.
#[test]
fn gaps_cost_nothing() {
    let begin = at(NOON);
    for gap_s in [61.0, 3_000.0, 11.0 * 3_600.0, 20.0 * 3_600.0, 30.0 * 3_600.0, 3.0 * DAY_S] {
        for systems in [vec![GPS], vec![GPS, GLONASS], vec![GLONASS, GPS], vec![GLONASS, GPS, BEIDOU]] {
            let stream = [epochs(begin, 4, &systems), epochs(begin + gap_s, 4, &systems)].concat();
            let read = read(&stream, begin);
            let mut expected = vec![0.0, 1.0, 2.0, 3.0];
            expected.extend([0.0, 1.0, 2.0, 3.0].map(|second| second + gap_s));
            assert_eq!(seconds(&read.epochs, begin), expected, "{gap_s} s, {systems:?}: {}", read.skips);
            let observations = read.systems.chars().filter(|letter| *letter != ' ').count();
            assert_eq!(observations, 8 * systems.len(), "{gap_s} s, {systems:?}: {}", read.skips);
        }
    }
}

/// Live, a computer's clock may be weeks off: positions go on, in the week that was given, and it is said.
#[test]
fn ephemerides_of_another_week_go_along_with_live_observations() {
    let begin = at(NOON);
    let ephemerides: Vec<_> = (1..5).map(|satellite| gps(satellite, begin, begin + 3_600.0)).collect();
    let stream = [epochs(begin, 3, &[GPS]), ephemerides, epochs(begin + 3.0, 3, &[GPS])].concat();
    let read = read(&stream, begin + -5.0 * WEEK_S);
    assert_eq!(read.epochs.len(), 6);
    let weeks: Vec<_> = read.toes.iter().map(|toe| ((*toe - begin) / WEEK_S).round()).collect();
    assert_eq!(weeks, [0.0, -5.0, -5.0, -5.0], "the first alone is not believed");
    assert_eq!(read.skips.count(Reason::EphemeridesOfOtherWeekThanDate), 1, "{}", read.skips);
}
