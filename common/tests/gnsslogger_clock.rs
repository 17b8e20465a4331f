//! From the phone's clock fields to pseudoranges where it is easy to go wrong: midnights of every system's week or day, times
//! known modulo 100 ms, restarts, code types that cannot be.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod beside;

use std::fmt::Write as _;

use cofix_common::constants::SPEED_OF_LIGHT_MPS;
use cofix_common::formats::decode::{Decoder, Record};
use cofix_common::formats::gnsslogger::{BiasReference, GnssLoggerDecoder, Masks, Options, state};
use cofix_common::gnss::{Constellation, ObservationEpoch};
use cofix_common::skips::{Reason, Skips};
use cofix_common::time::GpsTime;

const HEADER: &str = "# Raw,TimeNanos,FullBiasNanos,BiasNanos,HardwareClockDiscontinuityCount,ConstellationType,Svid,State,\
ReceivedSvTimeNanos,CarrierFrequencyHz,CodeType,Cn0DbHz,AccumulatedDeltaRangeState,AccumulatedDeltaRangeMeters";
const SECOND_NS: i64 = 1_000_000_000;
const DAY_NS: i64 = 86_400 * SECOND_NS;
const WEEK_NS: i64 = 7 * DAY_NS;

/// A line with a sound signal of Galileo.
#[derive(Clone, Copy, Debug)]
struct Line {
    time_ns: i64,
    full_bias_ns: i64,
    discontinuities: i64,
    system: u8,
    svid: u8,
    state: u32,
    received_ns: i64,
    frequency: &'static str,
    code: &'static str,
}

/// At an instant of GPS time, with the phone's clock at `time_ns`, of a signal that travelled so long.
fn galileo(gps_ns: i64, time_ns: i64, travel_ns: i64) -> Line {
    Line {
        time_ns,
        full_bias_ns: time_ns - gps_ns,
        discontinuities: 0,
        system: 6,
        svid: 11,
        state: state::GAL_E1BC_CODE_LOCK | state::TOW_DECODED,
        received_ns: (gps_ns - travel_ns).rem_euclid(WEEK_NS),
        frequency: "",
        code: "",
    }
}

fn at(time: &str) -> i64 {
    time.parse::<GpsTime>().unwrap().nanos()
}

fn decode_bytes(text: &[u8], options: Options) -> (Vec<ObservationEpoch>, Skips) {
    let mut decoder = GnssLoggerDecoder::new(options);
    decoder.feed(text).unwrap();
    decoder.finish().unwrap();
    let epochs = std::iter::from_fn(|| decoder.next_record()).filter_map(|record| match record {
        Record::Epoch(epoch) => Some(epoch),
        Record::Ephemeris(_) | Record::Glonass(_) | Record::Event(_) => None,
    });
    (epochs.collect(), decoder.skips().clone())
}

fn decode(lines: &[Line], options: Options) -> (Vec<ObservationEpoch>, Skips) {
    let mut text = format!("{HEADER}\n");
    for l in lines {
        let Line {
            time_ns,
            full_bias_ns,
            discontinuities,
            system,
            svid,
            state,
            received_ns,
            frequency,
            code,
        } = l;
        writeln!(
            text,
            "Raw,{time_ns},{full_bias_ns},0.0,{discontinuities},{system},{svid},{state},{received_ns},{frequency},{code},35,1,5.5"
        )
        .unwrap();
    }
    decode_bytes(text.as_bytes(), options)
}

fn untimed() -> Options {
    let masks = Masks::default();
    Options { masks: Masks { states: masks.states.untimed(), ..masks }, ..Options::default() }
}

fn metres(ns: i64) -> f64 {
    ns as f64 * (SPEED_OF_LIGHT_MPS * 1e-9)
}

/// Half a minute around the midnights at which a system's week or day begins anew, four epochs a second: no pseudorange
/// knows of it.
#[test]
fn no_midnight_shows() {
    let week = state::CODE_LOCK | state::TOW_DECODED;
    let day = state::CODE_LOCK | state::GLO_TOD_DECODED;
    // System, satellite, state, period, how far the system's clock is ahead of GPS time.
    let systems = [
        (1, 5, week, WEEK_NS, 0),
        (2, 133, week, WEEK_NS, 0),
        (3, 7, day, DAY_NS, 3 * 3_600 * SECOND_NS - 18 * SECOND_NS),
        (4, 194, week, WEEK_NS, 0),
        (5, 30, week, WEEK_NS, -14 * SECOND_NS),
        (6, 11, week, WEEK_NS, 0),
        (7, 6, week, WEEK_NS, 0),
    ];
    let travel_ns = |place: i64, quarter: i64| 70_000_000 + 9_000_000 * place + 250 * quarter;
    // Saturday to Sunday in GPS time, with BeiDou's 14 s later, and a day of Moscow's.
    for (start, resets) in [("2023-11-04T23:59:50", 6), ("2023-11-08T21:00:05", 1)] {
        let mut lines = Vec::new();
        let mut seen = std::collections::BTreeSet::new();
        for quarter in 0..120_i64 {
            let gps_ns = at(start) + quarter * SECOND_NS / 4;
            for (place, (system, svid, state, period_ns, ahead_ns)) in (0..).zip(systems) {
                let travel_ns = travel_ns(place, quarter);
                let received_ns = (gps_ns - travel_ns + ahead_ns).rem_euclid(period_ns);
                if received_ns < 30 * SECOND_NS {
                    seen.insert(system);
                }
                let line = galileo(gps_ns, 5_000 * SECOND_NS + quarter * SECOND_NS / 4, 0);
                lines.push(Line { system, svid, state, received_ns, ..line });
            }
        }
        assert_eq!(seen.len(), resets, "systems that begin anew: {seen:?}");
        let (epochs, skips) = decode(&lines, Options::default());
        assert!(skips.iter().all(|(reason, _)| reason.starts_with("Doppler and phase without")), "{skips}");
        assert_eq!(epochs.len(), 120);
        for (quarter, epoch) in (0..).zip(&epochs) {
            assert_eq!(epoch.observations.len(), systems.len());
            for (place, o) in (0..).zip(&epoch.observations) {
                let expected = Some(metres(travel_ns(place, quarter)));
                assert_eq!(o.pseudorange_m, expected, "{start} {quarter} {}", o.satellite);
            }
        }
    }
}

/// Galileo's secondary code tells the time modulo 100 ms. The travel time of 77 to 97 ms makes it unique also when the phone's
/// clock is off by 30 ms, which all satellites share.
#[test]
fn a_hundred_milliseconds_bear_a_clock_that_is_off() {
    let second_code = state::GAL_E1BC_CODE_LOCK | state::GAL_E1C_2ND_CODE_LOCK;
    for clock_ns in [-30_000_000, -5_000_000, 0, 5_000_000, 30_000_000] {
        for travel_ns in [77_400_000, 97_000_000] {
            let gps_ns = at("2023-11-07T12:00:00.3");
            let line = galileo(gps_ns + clock_ns, 7_000 * SECOND_NS, travel_ns + clock_ns);
            let line = Line { state: second_code, received_ns: line.received_ns % 100_000_000, ..line };
            let (epochs, skips) = decode(&[line], Options::default());
            assert!(skips.is_empty(), "{clock_ns} {travel_ns}: {skips}");
            assert_eq!(epochs[0].observations[0].pseudorange_m, Some(metres(travel_ns + clock_ns)));
        }
    }
}

/// Believing times that no bit vouches for does not make a time modulo 100 ms one of the week.
#[test]
#[ignore = "needs the reference data"]
fn untimed_signals_cost_no_others() {
    let line = galileo(at("2023-11-07T12:00:00.3"), 7_000 * SECOND_NS, 80_000_000);
    let second_code = state::GAL_E1BC_CODE_LOCK | state::GAL_E1C_2ND_CODE_LOCK;
    let modulo = Line { state: second_code, received_ns: line.received_ns % 100_000_000, ..line };
    for (line, by_default) in
        [(modulo, true), (line, true), (Line { state: state::GAL_E1BC_CODE_LOCK, ..line }, false)]
    {
        let (epochs, _) = decode(&[line], Options::default());
        assert_eq!(epochs.len(), usize::from(by_default), "{line:?}");
        let (epochs, skips) = decode(&[line], untimed());
        assert!(skips.is_empty(), "{line:?}: {skips}");
        assert_eq!(epochs[0].observations[0].pseudorange_m, Some(metres(80_000_000)), "{line:?}");
    }
    let path = "data/google-static-2016/pseudoranges_log_2016_08_22_14_45_50.txt";
    let log = beside::required(path);
    let signals = |options: Options, system| {
        let (epochs, _) = decode_bytes(&log, options);
        let all = epochs.iter().flat_map(|epoch| &epoch.observations);
        all.filter(|o| o.satellite.constellation == system).count()
    };
    // 282 lines of Galileo know their time modulo 100 ms only, 311 of GPS modulo 6 s.
    for (system, vouched) in
        [(Constellation::Gps, 2_366), (Constellation::Galileo, 352), (Constellation::Beidou, 204)]
    {
        let loose = Options { masks: Masks::none(), ..Options::default() };
        assert_eq!(signals(loose.clone(), system), vouched, "{system:?}");
        let states = loose.masks.states.untimed();
        let loose = Options { masks: Masks { states, ..loose.masks }, ..loose };
        assert!(signals(loose, system) >= vouched, "{system:?}");
    }
}

/// A receiver that restarts begins its clock anew; what the first epoch's bias made of that would lie in the past, and all that
/// follows would be lost.
#[test]
fn a_restart_begins_a_clock() {
    let start = at("2023-11-07T12:00:00.3");
    let line = |second: i64, time_s: i64| galileo(start + second * SECOND_NS, time_s * SECOND_NS, 80_000_000);
    let lines = [line(0, 7_000), line(1, 7_001), line(20, 3), line(21, 4)];
    for bias_reference in [BiasReference::FirstEpoch, BiasReference::EachEpoch] {
        let (epochs, skips) = decode(&lines, Options { bias_reference, ..Options::default() });
        assert!(skips.is_empty(), "{bias_reference:?}: {skips}");
        let seconds: Vec<_> =
            epochs.iter().map(|epoch| (epoch.time_gps.nanos() - start) / SECOND_NS).collect();
        assert_eq!(seconds, [0, 1, 20, 21], "{bias_reference:?}");
        let slips: Vec<_> =
            epochs.iter().map(|epoch| epoch.observations[0].loss_of_lock.cycle_slip).collect();
        assert_eq!(slips, [false, false, true, false], "{bias_reference:?}");
    }
}

#[test]
fn code_types_that_cannot_be_are_counted() {
    let line = galileo(at("2023-11-07T12:00:00.3"), 7_000 * SECOND_NS, 80_000_000);
    for (frequency, code, expected, odd) in [
        ("1176450050", "Q", "5Q", 0),
        ("1176450050", "X", "5X", 0),
        ("1176450050", "C", "5Q", 1),
        ("", "Q", "1C", 1),
        ("1575420030", "UNKNOWN", "1C", 0),
    ] {
        let (epochs, skips) = decode(&[Line { frequency, code, ..line }], Options::default());
        assert_eq!(epochs[0].observations[0].signal.to_string(), expected, "{frequency} {code}");
        let reason = Reason::CodeTypeOfNoSignal.text();
        assert_eq!((skips.count(reason), skips.total()), (odd, odd), "{skips}");
    }
}
