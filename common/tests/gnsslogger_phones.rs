//! What phones and the tools after them write that looks wrong and is usable: numbers as floating point, slips without a phase,
//! ambiguous milliseconds beside a known time of week, times modulo subframes, weeks that were not rolled over.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod log_lines;

use cofix_common::formats::gnsslogger::{Options, state};
use cofix_common::formats::stream::ObservationStream;
use cofix_common::skips::Reason;
use log_lines::{
    DAY_NS, HEADER, Line, TRAVEL_NS, WEEK_NS, decode, decode_with, gps, log, metres, only, refusal,
};

const SECOND_NS: i64 = 1_000_000_000;

/// A log with these columns of all `Raw` lines written in another way.
fn rewritten(lines: &[Line], columns: &[&str], write: impl Fn(&str) -> String) -> String {
    let names: Vec<&str> = HEADER.split(',').collect();
    let mut text = format!("{HEADER}\n");
    for line in lines {
        let line = line.text();
        let fields = line.split(',').zip(&names).map(|(field, name)| {
            let is_rewritten = columns.contains(name) && !field.is_empty();
            if is_rewritten { write(field) } else { field.to_owned() }
        });
        text += &(fields.collect::<Vec<_>>().join(",") + "\n");
    }
    text
}

/// As tools that turn columns with blanks into doubles print them: what such a double holds.
fn through_a_double(field: &str) -> String {
    let value: f64 = field.parse().unwrap();
    if value.abs() < 1e16 { format!("{value:?}") } else { format!("{value:e}").replace('e', "e+") }
}

#[test]
fn integers_as_floating_point_numbers_are_integers() {
    let lines = [
        gps(0),
        Line { svid: 7, range_state: 5, ..gps(0) },
        Line { multipath: "1", svid: 9, ..gps(0) },
        gps(1),
    ];
    let good = decode(&rewritten(&lines, &[], str::to_owned));
    let columns = [
        "TimeNanos",
        "HardwareClockDiscontinuityCount",
        "Svid",
        "State",
        "ReceivedSvTimeNanos",
        "AccumulatedDeltaRangeState",
        "MultipathIndicator",
        "ConstellationType",
        "LeapSecond",
    ];
    for write in
        [through_a_double, |field: &str| format!("{field}.0"), |field: &str| format!("{field}000e-3")]
    {
        let decoded = decode(&rewritten(&lines, &columns, write));
        assert_eq!((&decoded.epochs, &decoded.skips), (&good.epochs, &good.skips));
    }
    // The bias has 19 digits: a double keeps it to 128 ns, which is common to all satellites.
    let decoded = decode(&rewritten(&lines, &["FullBiasNanos"], through_a_double));
    assert_eq!(decoded.skips, good.skips);
    for (epoch, exact) in decoded.epochs.iter().zip(&good.epochs) {
        assert!((epoch.time_gps - exact.time_gps).abs() <= 256e-9);
        let off: Vec<f64> = epoch
            .observations
            .iter()
            .zip(&exact.observations)
            .map(|(o, exact)| o.pseudorange_m.unwrap() - exact.pseudorange_m.unwrap())
            .collect();
        assert!(
            off.iter().all(|off_m| (off_m - off[0]).abs() < 1e-6 && off_m.abs() < metres(256.0)),
            "{off:?}"
        );
    }
}

#[test]
fn what_is_no_integer_is_refused() {
    for bad in ["nan", "inf", "-inf", "1.5", "1e400", "5e", ""] {
        let decoded = decode(&rewritten(&[gps(0)], &["Svid"], |_| bad.to_owned()));
        assert!(decoded.epochs.is_empty(), "{bad}");
        let reason = if bad.is_empty() {
            Reason::NeededValueMissing.text()
        } else {
            Reason::NeededValueUnreadable.text()
        };
        assert_eq!(decoded.skips.count(format!("Raw line: {reason}")), 1, "{bad}: {}", decoded.skips);
    }
}

/// Whether the phase of each epoch carries a slip, of a log with one signal; `None` where there is no phase.
fn slips(text: &str) -> Vec<Option<bool>> {
    let phase = |o: &cofix_common::gnss::Observation| {
        assert!(o.carrier_phase_cycles.is_some() || !o.loss_of_lock.cycle_slip, "a slip without a phase");
        o.carrier_phase_cycles.map(|_| o.loss_of_lock.cycle_slip)
    };
    decode(text).epochs.iter().map(|epoch| phase(&epoch.observations[0])).collect()
}

#[test]
fn a_slip_is_told_by_the_next_phase() {
    let with = |line: Line| log(&[gps(0), line, gps(2), gps(3)]);
    let (yes, no) = (Some(true), Some(false));
    for (line, expected) in [
        // Declared on a line whose phase is not valid: slip, reset, both, half cycle reported beside.
        (Line { range_state: 4, ..gps(1) }, vec![no, None, yes, no]),
        (Line { range_state: 2, ..gps(1) }, vec![no, None, yes, no]),
        (Line { range_state: 20, ..gps(1) }, vec![no, None, yes, no]),
        (Line { range_state: 6, range: "", ..gps(1) }, vec![no, None, yes, no]),
        (Line { range_state: 5, range: "1e300", ..gps(1) }, vec![no, None, yes, no]),
        // On a line that is not used: a mask, no state, a range that cannot be, a measurement far from its epoch.
        (Line { range_state: 29, uncertainty: 900, ..gps(1) }, vec![no, yes, no]),
        (Line { range_state: 5, cn0: 1.0, ..gps(1) }, vec![no, yes, no]),
        (Line { range_state: 3, state: 0, ..gps(1) }, vec![no, yes, no]),
        (Line { range_state: 5, received: 0, ..gps(1) }, vec![no, yes, no]),
        (Line { range_state: 5, multipath: "1", ..gps(1) }, vec![no, yes, no]),
        (Line { range_state: 5, time_offset: 1e8, ..gps(1) }, vec![no, yes, no]),
        (Line { range_state: 5, gps_ns: 5, ..gps(1) }, vec![no, yes, no]),
        // A repeated line, and one of a wrong time.
        (Line { range_state: 5, ..gps(0) }, vec![no, yes, no]),
        (Line { range_state: 5, ..gps(200_000) }, vec![no, yes, no]),
        // None, however the line fares.
        (Line { range_state: 1, uncertainty: 900, ..gps(1) }, vec![no, no, no]),
        (Line { range_state: 0, ..gps(1) }, vec![no, None, no, no]),
        (Line { range_state: 5, uncertainty: 900, svid: 6, ..gps(1) }, vec![no, no, no]),
    ] {
        assert_eq!(slips(&with(line.clone())), expected, "{line:?}");
    }
    // A line of which a needed value is missing.
    for column in ["ReceivedSvTimeNanos", "TimeNanos", "FullBiasNanos", "State"] {
        let names: Vec<&str> = HEADER.split(',').collect();
        let at = names.iter().position(|name| *name == column).unwrap();
        let broken = Line { range_state: 5, ..gps(1) }.text();
        let broken: Vec<&str> =
            broken.split(',').enumerate().map(|(k, field)| if k == at { "" } else { field }).collect();
        let text = [gps(0).text(), broken.join(","), gps(2).text(), gps(3).text()].join("\n");
        assert_eq!(slips(&format!("{HEADER}\n{text}\n")), [no, yes, no], "{column}");
    }
}

#[test]
fn a_discontinuous_clock_breaks_phases_that_come_later() {
    let after = |line: Line| Line { discontinuities: 4, ..line };
    let other = |line: Line| Line { svid: 7, ..line };
    let lines = [
        gps(0),
        other(gps(0)),
        after(gps(1)),
        after(Line { range_state: 0, ..other(gps(1)) }),
        after(gps(2)),
        after(other(gps(2))),
        after(gps(3)),
        after(other(gps(3))),
    ];
    let slips: Vec<(bool, bool)> = decode(&log(&lines))
        .epochs
        .iter()
        .map(|epoch| {
            let of = |k: usize| epoch.observations[k].loss_of_lock.cycle_slip;
            (of(0), of(1))
        })
        .collect();
    assert_eq!(slips, [(false, false), (true, false), (false, true), (false, false)]);
}

/// L5 of chips of 2018: the code's milliseconds are called ambiguous though the time of week puts them right.
#[test]
fn ambiguous_milliseconds_beside_a_known_time_are_used() {
    let tod = gps(0).gps_ns - TRAVEL_NS + 3 * 3_600 * SECOND_NS - 18 * SECOND_NS;
    for (system, state, received) in [
        (1, 16_409, gps(0).received),
        (6, 17_466, gps(0).received),
        (1, state::CODE_LOCK | state::TOW_KNOWN | state::MSEC_AMBIGUOUS, gps(0).received),
        (
            5,
            state::CODE_LOCK | state::TOW_DECODED | state::MSEC_AMBIGUOUS,
            (gps(0).gps_ns - TRAVEL_NS - 14 * SECOND_NS).rem_euclid(WEEK_NS),
        ),
        (3, state::CODE_LOCK | state::GLO_TOD_DECODED | state::MSEC_AMBIGUOUS, tod.rem_euclid(DAY_NS)),
    ] {
        let frequency = if system == 3 { "1602000000" } else { "" };
        let line = Line { system, state, received, frequency, code: "", range: "", rate: "", ..gps(0) };
        assert_eq!(only(&line).pseudorange_m, Some(metres(TRAVEL_NS as f64)), "{system} {state}");
    }
}

/// Subframes, pages, strings: what of the time they leave open the phone's own time tells.
#[test]
fn times_modulo_a_period_are_resolved() {
    let sent = gps(0).gps_ns - TRAVEL_NS;
    let beidou = sent - 14 * SECOND_NS;
    let glonass = sent + 3 * 3_600 * SECOND_NS - 18 * SECOND_NS;
    for (system, svid, bit, reading, period_ns) in [
        (1, 5, state::SUBFRAME_SYNC, sent, 6 * SECOND_NS),
        (4, 194, state::SUBFRAME_SYNC, sent, 6 * SECOND_NS),
        (7, 5, state::SUBFRAME_SYNC, sent, 6 * SECOND_NS),
        (6, 11, state::GAL_E1B_PAGE_SYNC, sent, 2 * SECOND_NS),
        (6, 11, state::GAL_E1B_PAGE_SYNC | state::GAL_E1C_2ND_CODE_LOCK, sent, 2 * SECOND_NS),
        (3, 5, state::GLO_STRING_SYNC, glonass, 2 * SECOND_NS),
        (5, 21, state::SUBFRAME_SYNC, beidou, 6 * SECOND_NS),
        (5, 3, state::BDS_D2_SUBFRAME_SYNC, beidou, 600_000_000),
        (5, 3, state::SUBFRAME_SYNC, beidou, 600_000_000),
        (2, 133, state::SBAS_SYNC, sent, SECOND_NS),
    ] {
        let frequency = if system == 3 { "1602000000" } else { "" };
        // The time may be more complete than the bits promise.
        for received in [reading.rem_euclid(period_ns), reading.rem_euclid(DAY_NS)] {
            let line = Line {
                system,
                svid,
                received,
                frequency,
                state: state::CODE_LOCK | bit,
                code: "",
                range: "",
                rate: "",
                ..gps(0)
            };
            let said = format!("{system} {svid} {bit} {received}");
            assert_eq!(only(&line).pseudorange_m, Some(metres(TRAVEL_NS as f64)), "{said}");
            let ambiguous = Line { state: line.state | state::MSEC_AMBIGUOUS, ..line };
            assert_eq!(refusal(&ambiguous), [Reason::MaskStateBits.text()], "{said}");
        }
    }
}

#[test]
fn a_week_that_was_not_rolled_over_is_named_and_shifted() {
    let right = log(&[gps(0), gps(1)]);
    for times in [1, 2] {
        let weeks = 1_024 * times;
        let old = |line: Line| Line { gps_ns: line.gps_ns - weeks * WEEK_NS, ..line };
        let text = log(&[old(gps(0)), old(gps(1))]);
        let decoded = decode(&text);
        assert!(decoded.epochs.is_empty());
        let (_, skip) =
            decoded.skips.iter().find(|(name, _)| *name == Reason::ClockOutside2010To2100.text()).unwrap();
        assert!(skip.first.contains(&format!("shift_weeks = {weeks}")), "{}", skip.first);
        assert!(skip.first.contains("2023-11-07T12:00:00.3"), "{}", skip.first);
        let shifted = decode_with(text.as_bytes(), Options { shift_weeks: weeks, ..Options::default() });
        assert_eq!(shifted.epochs, decode(&right).epochs);
        assert!(shifted.skips.is_empty(), "{}", shifted.skips);
    }
    // A clock that was never set is no week of long ago.
    let decoded = decode(&log(&[Line { gps_ns: 5 * SECOND_NS, ..gps(0) }]));
    assert!(!decoded.skips.to_string().contains("shift_weeks"), "{}", decoded.skips);
    let absurd = Options { shift_weeks: i64::MAX, ..Options::default() };
    assert!(decode_with(right.as_bytes(), absurd).epochs.is_empty());
}

/// A header and lines with further columns at the end.
fn with_columns(columns: &str, lines: &[(Line, &str)]) -> String {
    let mut text = format!("{HEADER},{columns}\n");
    for (line, more) in lines {
        text += &(line.text() + "," + more + "\n");
    }
    text
}

const STATES: &str = "SvPositionEcefXMeters,SvPositionEcefYMeters,SvPositionEcefZMeters,SvVelocityEcefXMetersPerSecond,\
    SvVelocityEcefYMetersPerSecond,SvVelocityEcefZMetersPerSecond,SvClockBiasMeters,SvClockDriftMetersPerSecond";

#[test]
fn satellite_states_of_lines_go_with_their_epoch() {
    use cofix_common::formats::decode::{Decoder, Record};
    let state = "1.5e7,-1e7,1.9e7,100.0,-2000.0,1500.0,-12345.5,0.25";
    let text = with_columns(
        STATES,
        &[
            (gps(0), state),
            (Line { svid: 7, ..gps(0) }, ",,,,,,,"),
            (Line { svid: 8, ..gps(0) }, "0.0,0.0,0.0,0.0,0.0,0.0,0.0,0.0"),
            (Line { svid: 9, ..gps(0) }, "1.5e7,-1e7,1.9e7,100.0,-2000.0,1500.0,,"),
            (Line { svid: 10, ..gps(0) }, "1.5e8,-1e7,1.9e7,100.0,-2000.0,1500.0,5.0,0.0"),
            (gps(1), ",,,,,,,"),
            (gps(2), state),
        ],
    );
    let mut decoder = cofix_common::formats::gnsslogger::GnssLoggerDecoder::default();
    decoder.feed(text.as_bytes()).unwrap();
    decoder.finish().unwrap();
    let mut found = Vec::new();
    while let Some(record) = decoder.next_record() {
        let Record::Epoch(epoch) = record else { panic!("{record:?}") };
        let recorded = decoder.recorded_epoch();
        assert!(recorded.is_none_or(|recorded| recorded.to_observations() == epoch));
        found.push(recorded.map(|recorded| {
            recorded.observations.iter().map(|o| o.given.map(|given| given.clock_m)).collect::<Vec<_>>()
        }));
    }
    let clock = Some(-12_345.5);
    assert_eq!(found, [Some(vec![clock, None, None, None, None]), None, Some(vec![clock])]);
    let reason = "Raw line: a satellite's state that cannot be (the rest is used)";
    assert_eq!((decoder.skips().count(reason), decoder.skips().total()), (1, 1), "{}", decoder.skips());
}

#[test]
fn klobuchar_terms_of_lines_stand_in_for_those_of_messages() {
    let columns = "KlobucharAlpha0,KlobucharAlpha1,KlobucharAlpha2,KlobucharAlpha3,KlobucharBeta0,KlobucharBeta1,\
                   KlobucharBeta2,KlobucharBeta3";
    let terms = "1.2E-8,1.5E-8,-5.96E-8,-1.19E-7,94208.0,98304.0,-131072.0,-458752.0";
    let beidou = Line { system: 5, state: 0, ..gps(0) };
    for (lines, expected) in [
        (vec![(gps(0), terms)], Some(94_208.0)),
        (vec![(gps(0), ",,,,,,,"), (gps(1), terms)], Some(94_208.0)),
        (vec![(beidou, terms)], None),
        (vec![(gps(0), "0,0,0,0,0,0,0,0")], None),
        (vec![(gps(0), "1.2,1.5E-8,-5.96E-8,-1.19E-7,94208.0,98304.0,-131072.0,-458752.0")], None),
        (vec![(gps(0), "nan,1.5E-8,-5.96E-8,-1.19E-7,94208.0,98304.0,-131072.0,-458752.0")], None),
    ] {
        let decoded = decode(&with_columns(columns, &lines));
        let gps = decoded.decoder.ionosphere().gps;
        assert_eq!(gps.map(|terms| terms.beta[0]), expected, "{lines:?}");
        let counted = decoded.skips.count(Reason::KlobucharTermsOfRawLines);
        assert_eq!(counted, u64::from(expected.is_some()));
    }
}

#[test]
fn satellites_known_by_channel_are_kept_beside() {
    use cofix_common::formats::decode::Decoder;
    let tod = (gps(0).gps_ns - TRAVEL_NS + 3 * 3_600 * SECOND_NS - 18 * SECOND_NS).rem_euclid(DAY_NS);
    let glonass = |svid, frequency| Line { system: 3, svid, state: 129, received: tod, frequency, ..gps(0) };
    let lines = [
        gps(0),
        glonass(93, "1598062500"),
        glonass(101, ""),
        glonass(101, "1602562500"),
        glonass(106, "1602000000"),
        glonass(104, "1575420000"),
    ];
    let text = log(&lines);
    let mut decoder = cofix_common::formats::gnsslogger::GnssLoggerDecoder::default();
    decoder.feed(text.as_bytes()).unwrap();
    decoder.finish().unwrap();
    assert!(decoder.next_record().is_some());
    let recorded = decoder.recorded_epoch().unwrap();
    assert_eq!(recorded.observations.len(), 1);
    let channels: Vec<i8> = recorded.by_channel.iter().map(|known| known.channel).collect();
    assert_eq!(channels, [-7, 1], "{}", decoder.skips());
    for known in &recorded.by_channel {
        assert_eq!(known.observation.pseudorange_m, Some(metres(TRAVEL_NS as f64)));
        assert!(known.observation.doppler_hz.is_some(), "the channel tells the wavelength");
    }
    let count = |reason| decoder.skips().count(reason);
    assert_eq!(count(Reason::GlonassSatelliteByChannelOnly), 5);
    assert_eq!(count(Reason::SignalRepeated), 1);
    // Without anything else there is no epoch.
    assert_eq!(refusal(&glonass(93, "")), [Reason::GlonassSatelliteByChannelOnly.text()]);
}
