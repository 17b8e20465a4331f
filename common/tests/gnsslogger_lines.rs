//! Small logs written here: every constellation, every mask, every kind of damage.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod broadcast_words;
mod log_lines;

use broadcast_words::PRN4;
use cofix_common::constants::SPEED_OF_LIGHT_MPS;
use cofix_common::formats::decode::{Decoder, Record};
use cofix_common::formats::gnsslogger::{
    FixProvider, GnssLoggerDecoder, Masks, ModularTime, Options, StateRule, StateRules, state,
};
use cofix_common::formats::stream::ObservationStream;
use cofix_common::skips::{Reason, Skips};
use cofix_common::time::GpsTime;
use log_lines::{
    DAY_NS, HEADER, Line, TRAVEL_NS, WEEK_NS, decode, decode_with, gps, log, metres, only, refusal,
};
use proptest::prelude::*;

#[test]
fn every_constellation_gives_the_same_pseudorange() {
    let gps_ns = gps(0).gps_ns;
    let sent = gps_ns - TRAVEL_NS;
    let week = sent.rem_euclid(WEEK_NS);
    let beidou = (sent - 14_000_000_000).rem_euclid(WEEK_NS);
    let glonass = (sent + 3 * 3_600_000_000_000 - 18_000_000_000).rem_euclid(DAY_NS);
    let tod = state::CODE_LOCK | state::GLO_TOD_DECODED;
    let tow = state::CODE_LOCK | state::TOW_DECODED;
    let e1 = state::GAL_E1BC_CODE_LOCK | state::TOW_KNOWN;
    let second = state::GAL_E1BC_CODE_LOCK | state::GAL_E1C_2ND_CODE_LOCK;
    for (system, svid, frequency, code, state, received, expected) in [
        (1, 5, "1575420030", "C", tow, week, "G05 1C"),
        (1, 5, "", "", tow, week, "G05 1C"),
        (1, 5, "1176450050", "Q", tow, week, "G05 5Q"),
        (1, 5, "1227600000", "", tow, week, "G05 2L"),
        (2, 133, "1575420030", "C", tow, week, "S33 1C"),
        (3, 21, "1604249980", "C", tod, glonass, "R21 1C"),
        (4, 194, "1575420030", "C", tow, week, "J02 1C"),
        (5, 21, "1561097980", "I", tow, beidou, "C21 2I"),
        (5, 60, "", "", tow, beidou, "C60 2I"),
        (5, 21, "1575420030", "P", tow, beidou, "C21 1P"),
        (5, 221, "1176450050", "", tow, beidou, "C21 5P"),
        (6, 11, "1575420030", "C", e1, week, "E11 1C"),
        (6, 11, "1575420030", "B", e1, week, "E11 1B"),
        (6, 11, "1207140000", "X", tow, week, "E11 7X"),
        (6, 11, "1575420030", "C", second, week.rem_euclid(100_000_000), "E11 1C"),
        (6, 11, "1575420030", "C", second, week, "E11 1C"),
        (7, 6, "1176450050", "A", tow, week, "I06 5A"),
    ] {
        let line = Line { svid, state, received, frequency, system, code, ..gps(0) };
        let o = only(&line);
        assert_eq!(format!("{} {}", o.satellite, o.signal), expected);
        assert_eq!(o.pseudorange_m, Some(metres(TRAVEL_NS as f64)), "{expected}");
        assert!(o.doppler_hz.unwrap() > 0.0, "approaching: {expected}");
    }
}

#[test]
fn rollovers_of_week_and_day() {
    // 10 ms after midnight of a Sunday in GPS time, sent in the week before; BeiDou: 14.01 s after.
    let at = |time: &str, ahead_ns: i64, period_ns: i64, line: Line| {
        let gps_ns = time.parse::<GpsTime>().unwrap().nanos() + 10_000_000;
        let received = (gps_ns - TRAVEL_NS + ahead_ns).rem_euclid(period_ns);
        assert!(received > period_ns - TRAVEL_NS, "sent before the rollover");
        assert_eq!(only(&Line { gps_ns, received, ..line }).pseudorange_m, Some(metres(TRAVEL_NS as f64)));
    };
    at("2023-11-05T00:00:00", 0, WEEK_NS, gps(0));
    at(
        "2023-11-05T00:00:14",
        -14_000_000_000,
        WEEK_NS,
        Line { system: 5, svid: 21, frequency: "", code: "", ..gps(0) },
    );
    let glonass = Line { system: 3, frequency: "1602000000", state: 129, ..gps(0) };
    at("2023-11-07T21:00:18", 10_800_000_000_000 - 18_000_000_000, DAY_NS, glonass.clone());
    // Before 2017 GPS time was ahead by 17 s.
    at("2016-11-07T21:00:17", 10_800_000_000_000 - 17_000_000_000, DAY_NS, glonass);
}

#[test]
fn fractions_of_nanoseconds_count() {
    let line = Line { bias: "-0.25", time_offset: 300.5, ..gps(0) };
    let o = only(&line);
    // t_rx = TimeNanos + TimeOffsetNanos − (FullBiasNanos + BiasNanos)
    let expected = metres(TRAVEL_NS as f64 + 0.25 + 300.5);
    assert!((o.pseudorange_m.unwrap() - expected).abs() < 1e-8);
    let decoded = decode(&log(&[line]));
    assert_eq!(
        decoded.epochs[0].time_gps.nanos(),
        gps(0).gps_ns,
        "the tag is the epoch's, to the nanosecond"
    );
}

#[test]
fn carrier_values_and_their_flags() {
    let wavelength = SPEED_OF_LIGHT_MPS / 1_575.42e6;
    let o = only(&gps(0));
    assert!((o.doppler_hz.unwrap() - 190.5 / wavelength).abs() < 1e-9);
    assert!((o.carrier_phase_cycles.unwrap() - 1000.0 / wavelength).abs() < 1e-9);
    for (range_state, slip, half) in [
        (1, false, false),
        (1 | 2, true, false),
        (1 | 4, true, false),
        (1 | 16, false, true),
        (1 | 8 | 16, false, false),
        (1 | 4 | 16, true, true),
    ] {
        let o = only(&Line { range_state, ..gps(0) });
        assert_eq!((o.loss_of_lock.cycle_slip, o.loss_of_lock.half_cycle), (slip, half), "{range_state}");
    }
    for range_state in [0, 2, 4, 16, 24] {
        assert_eq!(only(&Line { range_state, ..gps(0) }).carrier_phase_cycles, None, "{range_state}");
    }
    // GLONASS' wavelength goes with the channel.
    let tod = gps(0).gps_ns - TRAVEL_NS + 10_800_000_000_000 - 18_000_000_000;
    let glonass = Line { system: 3, svid: 2, state: 129, received: tod.rem_euclid(DAY_NS), ..gps(0) };
    let o = only(&Line { frequency: "1599750020", ..glonass.clone() });
    assert!((o.doppler_hz.unwrap() - 190.5 * 1_599.75e6 / SPEED_OF_LIGHT_MPS).abs() < 1e-9);
    let decoded = decode(&log(&[Line { frequency: "", ..glonass }]));
    assert_eq!(decoded.epochs[0].observations[0].doppler_hz, None);
    assert_eq!(decoded.skips.count(Reason::DopplerWithoutCarrierFrequency), 1);
}

#[test]
fn each_mask_has_its_option_and_its_count() {
    let with = |change: fn(&mut Masks)| {
        let mut options = Options::default();
        change(&mut options.masks);
        options
    };
    let cases: [(Line, Options, &str); 6] = [
        (
            Line { multipath: "1", ..gps(0) },
            with(|m| m.reject_multipath = false),
            Reason::MaskMultipath.text(),
        ),
        (
            Line { bias_uncertainty: 2e7, ..gps(0) },
            with(|m| m.max_bias_uncertainty_ns = 3e7),
            Reason::MaskClockBiasUncertainty.text(),
        ),
        (
            Line { uncertainty: 501, ..gps(0) },
            with(|m| m.max_received_time_uncertainty_ns = 501.0),
            Reason::MaskReceivedTimeUncertainty.text(),
        ),
        (Line { cn0: 14.9, ..gps(0) }, with(|m| m.min_cn0_dbhz = 10.0), Reason::MaskCn0.text()),
        (
            Line { received: gps(0).received - 100_000_000, ..gps(0) },
            with(|m| m.pseudorange_m.1 = 6e7),
            Reason::MaskPseudorange.text(),
        ),
        (
            Line { state: state::CODE_LOCK, ..gps(0) },
            with(|m| {
                let lax =
                    StateRule { tracked: 1, timed: 1, modular: [ModularTime::default(); 2], forbidden: 0 };
                m.states = StateRules { gps: lax, ..StateRules::default() };
            }),
            Reason::MaskStateBits.text(),
        ),
    ];
    for (line, off, reason) in cases {
        assert_eq!(refusal(&line), [reason]);
        let decoded = decode_with(log(&[line]).as_bytes(), off);
        assert!(decoded.skips.is_empty() && decoded.epochs.len() == 1, "{reason}: {}", decoded.skips);
    }
    let vague = Line { rate_uncertainty: 11.0, ..gps(0) };
    let decoded = decode(&log(std::slice::from_ref(&vague)));
    assert_eq!(decoded.epochs[0].observations[0].doppler_hz, None);
    assert!(decoded.epochs[0].observations[0].pseudorange_m.is_some());
    assert_eq!(decoded.skips.count(Reason::MaskPseudorangeRateUncertainty), 1);
}

#[test]
fn states_that_leave_the_time_open() {
    for (system, state) in [
        (1, state::TOW_DECODED),
        (1, state::CODE_LOCK | state::MSEC_AMBIGUOUS),
        (1, state::CODE_LOCK | state::SUBFRAME_SYNC | state::MSEC_AMBIGUOUS),
        (6, state::CODE_LOCK | state::SUBFRAME_SYNC),
        (3, state::CODE_LOCK | state::SUBFRAME_SYNC),
        (1, state::SUBFRAME_SYNC),
        (1, state::CODE_LOCK | state::GLO_TOD_DECODED),
        (1, state::CODE_LOCK | state::GAL_E1C_2ND_CODE_LOCK),
        (3, state::CODE_LOCK | state::TOW_DECODED),
        (5, state::CODE_LOCK),
        (6, state::GAL_E1BC_CODE_LOCK),
        (6, state::GAL_E1C_2ND_CODE_LOCK),
        (6, state::GAL_E1BC_CODE_LOCK | state::GAL_E1C_2ND_CODE_LOCK | state::MSEC_AMBIGUOUS),
    ] {
        let line = Line { system, state, svid: 5, frequency: "", code: "", ..gps(0) };
        assert_eq!(refusal(&line), [Reason::MaskStateBits.text()], "{system} {state}");
    }
    assert_eq!(
        refusal(&Line { system: 3, svid: 93, ..gps(0) }),
        [Reason::GlonassSatelliteByChannelOnly.text()]
    );
    assert_eq!(refusal(&Line { system: 9, ..gps(0) }), [Reason::UnknownConstellationType.text()]);
    assert_eq!(refusal(&Line { svid: 40, ..gps(0) }), [Reason::SatelliteNumberOutOfRange.text()]);
    let frequency = Line { frequency: "1600000000", ..gps(0) };
    assert_eq!(refusal(&frequency), [Reason::CarrierFrequencyOfNoSignal.text()]);
    assert_eq!(refusal(&Line { gps_ns: 5_000_000_000, ..gps(0) }), [Reason::ClockOutside2010To2100.text()]);
    assert_eq!(refusal(&Line { time_offset: 1.1e7, ..gps(0) }), [Reason::MeasurementFarFromEpoch.text()]);
}

fn two_epochs() -> Vec<Line> {
    vec![gps(0), Line { svid: 7, ..gps(0) }, gps(1), Line { svid: 7, ..gps(1) }]
}

#[test]
fn lines_of_one_time_are_one_epoch() {
    let decoded = decode(&log(&two_epochs()));
    assert!(decoded.skips.is_empty());
    let shape: Vec<_> = decoded.epochs.iter().map(|e| (e.time_gps.nanos(), e.observations.len())).collect();
    assert_eq!(shape, [(gps(0).gps_ns, 2), (gps(1).gps_ns, 2)]);
}

/// Damage costs the damaged line and is named with its number; the other lines give what they gave.
#[test]
fn damaged_lines_cost_themselves() {
    let lines = two_epochs();
    let good = decode(&log(&lines)).epochs;
    let text = log(&lines);
    let extra = |insert: &str| {
        // Before the last line, which is line 8.
        let at = text.trim_end().rfind('\n').unwrap() + 1;
        format!("{}{insert}\n{}", &text[..at], &text[at..])
    };
    let other = Line { svid: 9, ..gps(1) };
    let field = |index: usize, value: &str| {
        let text = other.text();
        let mut fields: Vec<&str> = text.split(',').collect();
        fields[index] = value;
        fields.join(",")
    };
    for (insert, reason) in [
        (other.text()[..90].to_owned(), "Raw line with another number of fields"),
        (format!("{}{}", &other.text()[..60], other.text()), "Raw line with another number of fields"),
        (field(5, ""), "Raw line: a needed value is missing"),
        (field(14, "NaN"), "Raw line: a needed value cannot be read"),
        (field(14, "99999999999999999999"), "Raw line: a needed value cannot be read"),
        (field(14, "9223372036854775807"), Reason::MaskPseudorange.text()),
        (field(2, "-9223372036854775808"), Reason::ClockOutside2010To2100.text()),
        (gps(1).text(), Reason::SignalRepeated.text()),
        (Line { svid: 9, ..gps(0) }.text(), Reason::LineStepsBack.text()),
        (Line { svid: 9, ..gps(-5) }.text(), Reason::LineStepsBack.text()),
        (Line { svid: 9, ..gps(200_000) }.text(), Reason::LineTimeFar.text()),
        (Line { svid: 9, ..gps(3_600) }.text(), Reason::LineTimeFar.text()),
        (Line { svid: 9, time_ns: 1, ..gps(1) }.text(), Reason::LineRepeatsTime.text()),
        ("Whatever,1,2,3".to_owned(), Reason::LineOfUnknownKind.text()),
        ("Status,1,2,3".to_owned(), "Status line with another number of fields"),
        ("Agc,1,2".to_owned(), Reason::SensorLines.text()),
        ("Fix,GPS,95.0,10.0,5.0,,,1699358382300".to_owned(), "Fix line: position or time out of range"),
        ("Nav,5,257,1,1,1,3,4,x".to_owned(), Reason::NavLineUnreadable.text()),
        ("Nav,5,259,1,1,1,3,4".to_owned(), Reason::NavLineNotDecoded.text()),
        ("Nav,5,257,1,1,1,3,4".to_owned(), Reason::LnavSubframeWrongLength.text()),
        ("x".repeat(100_000), Reason::LineTooLong.text()),
    ] {
        let decoded = decode(&extra(&insert));
        assert_eq!(decoded.epochs, good, "{insert}");
        assert_eq!(decoded.skips.count(reason), 1, "{insert}: {}", decoded.skips);
        let (_, skip) = decoded.skips.iter().find(|(name, _)| *name == reason).unwrap();
        assert!(skip.first.starts_with("line 8:") || skip.first == "line 8", "{}", skip.first);
    }
    // Not numbers where the value is not needed: the rest of the line is used.
    for (index, value) in [(16, "NaN"), (17, "Infinity"), (10, "x"), (6, "?"), (22, "\u{fffd}")] {
        let decoded = decode(&extra(&field(index, value)));
        assert_eq!(decoded.skips.count("Raw line: a value cannot be read (the rest is used)"), 1);
        assert_eq!(decoded.epochs[1].observations.len(), 3);
    }
    // Invalid UTF-8.
    let mut bytes = extra(&field(14, "@")).into_bytes();
    let at = bytes.iter().position(|b| *b == b'@').unwrap();
    bytes[at] = 0xff;
    assert_eq!(decode_with(&bytes, Options::default()).epochs, good);
    // Windows line ends, empty lines, trailing blanks.
    for text in [text.replace('\n', "\r\n"), text.replace('\n', "\n\n"), text.replace('\n', "  \n")] {
        let decoded = decode(&text);
        assert_eq!(decoded.epochs, good);
        assert!(decoded.skips.is_empty(), "{}", decoded.skips);
    }
    // A last line without its end may be cut.
    let decoded = decode(text.trim_end());
    assert_eq!(decoded.epochs[1].observations.len(), 1);
    assert_eq!(decoded.skips.count(Reason::LastLineCutOff), 1);
}

#[test]
fn a_gap_of_days_is_believed_when_it_is_confirmed() {
    let mut lines = two_epochs();
    lines.extend([gps(200_000), Line { svid: 7, ..gps(200_000) }, gps(200_001)]);
    let decoded = decode(&log(&lines));
    let sizes: Vec<_> = decoded.epochs.iter().map(|e| e.observations.len()).collect();
    assert_eq!(sizes, [2, 2, 2, 1]);
    assert!(decoded.skips.is_empty(), "{}", decoded.skips);
    // Also when no epoch after the gap has a second line.
    let decoded = decode(&log(&[gps(0), gps(3_600), gps(3_601), gps(9_000)]));
    assert_eq!((decoded.epochs.len(), decoded.skips.total()), (3, 1), "{}", decoded.skips);
}

#[test]
fn an_epoch_with_a_wrong_clock_costs_no_other() {
    for ahead_s in [100, 18_000, 200_000] {
        let mut lines = two_epochs();
        lines.extend([
            gps(ahead_s),
            Line { svid: 7, ..gps(ahead_s) },
            gps(2),
            Line { svid: 7, ..gps(2) },
            gps(3),
        ]);
        let decoded = decode(&log(&lines));
        let sizes: Vec<_> = decoded.epochs.iter().map(|e| e.observations.len()).collect();
        assert_eq!(sizes, [2, 2, 2, 1], "{ahead_s} s");
        assert_eq!(decoded.skips.count(Reason::EpochFarFromNext), 1, "{}", decoded.skips);
        assert_eq!(decoded.skips.total(), 1);
    }
}

#[test]
fn a_discontinuous_clock_breaks_the_phases() {
    let lines =
        [gps(0), gps(1), Line { discontinuities: 4, ..gps(2) }, Line { discontinuities: 4, ..gps(3) }];
    let decoded = decode(&log(&lines));
    let slips: Vec<_> = decoded.epochs.iter().map(|e| e.observations[0].loss_of_lock.cycle_slip).collect();
    assert_eq!(slips, [false, false, true, false]);
}

#[test]
fn epochs_without_anything_are_counted() {
    let mut lines = two_epochs();
    lines.insert(
        2,
        Line {
            state: 0,
            gps_ns: gps(0).gps_ns + 500_000_000,
            time_ns: gps(0).time_ns + 500_000_000,
            ..gps(0)
        },
    );
    let decoded = decode(&log(&lines));
    assert_eq!(decoded.epochs.len(), 2);
    assert_eq!(decoded.skips.count(Reason::EpochWithoutMeasurement), 1);
}

#[test]
fn columns_by_name_in_any_order_and_number() {
    let lines = two_epochs();
    let good = decode(&log(&lines)).epochs;
    let turn = |row: &str| {
        let (kind, rest) = row.split_once(',').unwrap();
        let mut fields: Vec<&str> = rest.split(',').collect();
        fields.reverse();
        fields.insert(4, "Novelty");
        format!("{kind},{}", fields.join(","))
    };
    let mut text = turn(HEADER) + "\n";
    for line in &lines {
        text += &(turn(&line.text()) + "\n");
    }
    let decoded = decode(&text);
    assert_eq!(decoded.epochs, good);
    assert!(decoded.skips.is_empty());
    // A header that is missing: the order of 2016, which all versions kept, read to the constellation type.
    let bare: String =
        lines.iter().map(|l| l.text().rsplitn(3, ',').last().unwrap().to_owned() + "\n").collect();
    let decoded = decode(&bare);
    assert_eq!(decoded.epochs, good);
    assert_eq!(decoded.skips.count(Reason::RawLineWithoutHeader), 4);
    // A header that lacks a needed column is not used.
    let decoded = decode(&text.replace("ReceivedSvTimeNanos", "Received"));
    assert_eq!(decoded.skips.count(Reason::HeaderLineWithoutColumn), 1);
}

/// The columns of a version: what comes first, what comes after the constellation type, and how its header begins.
const VERSIONS: [(&str, &str, &str, &str); 5] = [
    ("2016, 1.4", "# ", "ElapsedRealtimeMillis", ""),
    ("2019, 2.0", "# ", "ElapsedRealtimeMillis", "AgcDb,CarrierFrequencyHz"),
    ("other loggers of 2019", "#   ", "ElapsedRealtimeMillis", "AgcDb,CarrierFrequencyHz"),
    (
        "2021, 3.0",
        "# ",
        "utcTimeMillis",
        "AgcDb,BasebandCn0DbHz,FullInterSignalBiasNanos,FullInterSignalBiasUncertaintyNanos,\
         SatelliteInterSignalBiasNanos,SatelliteInterSignalBiasUncertaintyNanos,CodeType,\
         ChipsetElapsedRealtimeNanos",
    ),
    (
        "2023, 3.1",
        "# ",
        "utcTimeMillis",
        "AgcDb,BasebandCn0DbHz,FullInterSignalBiasNanos,FullInterSignalBiasUncertaintyNanos,\
         SatelliteInterSignalBiasNanos,SatelliteInterSignalBiasUncertaintyNanos,CodeType,\
         ChipsetElapsedRealtimeNanos,IsFullTracking,SvPositionEcefXMeters,SvPositionEcefYMeters,\
         SvPositionEcefZMeters,SvVelocityEcefXMetersPerSecond,SvVelocityEcefYMetersPerSecond,\
         SvVelocityEcefZMetersPerSecond,SvClockBiasMeters,SvClockDriftMetersPerSecond,KlobucharAlpha0,\
         KlobucharAlpha1,KlobucharAlpha2,KlobucharAlpha3,KlobucharBeta0,KlobucharBeta1,KlobucharBeta2,\
         KlobucharBeta3",
    ),
];

/// The log as a version of the app would have written it.
fn log_of_version((_, begin, first, last): (&str, &str, &str, &str), lines: &[Line]) -> String {
    let names: Vec<&str> = HEADER.trim_start_matches("# ").split(',').collect();
    let common = names.iter().position(|name| *name == "ConstellationType").unwrap();
    let extra: Vec<&str> = last.split(',').filter(|name| !name.is_empty()).collect();
    let all: Vec<&str> = names[2..=common].iter().chain(&extra).copied().collect();
    let header = format!("{begin}Raw,{first},{}", all.join(","));
    let mut text = format!("# \n# Header Description:\n# \n# Version: v0 Platform: 9\n# \n{header}\n# \n");
    text += "# Nav,Svid,Type,Status,MessageId,Sub-messageId,Data(Bytes)\n# \n";
    for line in lines {
        let plain = line.text();
        let values: Vec<&str> = plain.split(',').collect();
        let value = |name: &&str| match *name {
            "AgcDb" => "-0.5".to_owned(),
            name => {
                names.iter().position(|n| *n == name).map_or("7.25".to_owned(), |at| values[at].to_owned())
            }
        };
        let rest: String = extra.iter().map(|name| ",".to_owned() + &value(name)).collect();
        text += &(values[..=common].join(",") + &rest + "\n");
    }
    text
}

#[test]
fn every_version_of_the_app_is_read_alike() {
    let lines = two_epochs();
    let good = decode(&log(&lines)).epochs;
    assert_eq!(good.len(), 2);
    for version in VERSIONS {
        let text = log_of_version(version, &lines);
        let decoded = decode(&text);
        assert_eq!(decoded.epochs, good, "{}: {text}", version.0);
        assert!(decoded.skips.is_empty(), "{}: {}", version.0, decoded.skips);
        // Windows line ends, and gain and status lines of later versions between.
        let other = text.replace('\n', "\r\n").replacen(
            "\r\nRaw,",
            "\r\nAgc,1,2,3,,,4,0.0,5,,,6,19.7,1176450000,1\r\nStatus,,18,0,1,1,,12.8,90,45,1,1,1,\r\nRaw,",
            1,
        );
        let mut decoded = decode(&other);
        assert_eq!(decoded.epochs, good, "{}", version.0);
        assert_eq!(decoded.skips.total(), 1, "{}: {}", version.0, decoded.skips);
        assert_eq!(decoded.decoder.take_statuses().len(), 1, "{}", version.0);
    }
}

/// Lines that agree with each other and not with the header are believed from the second on.
#[test]
fn a_header_that_is_one_column_short() {
    let text = log(&two_epochs()).replace(",AgcDb,CodeType", ",AgcDb");
    let decoded = decode(&text);
    let sizes: Vec<_> = decoded.epochs.iter().map(|e| e.observations.len()).collect();
    assert_eq!(sizes, [1, 2]);
    assert_eq!(decoded.skips.count("Raw line with another number of fields"), 1);
}

#[test]
fn fixes_of_both_formats() {
    let text = "# Fix,Provider,Latitude,Longitude,Altitude,Speed,Accuracy,(UTC)TimeInMs\n\
                Fix,gps,37.5,-122.0,-33.0,1.5,3.0,1467321969000\n\
                # Fix,Provider,LatitudeDegrees,LongitudeDegrees,AltitudeMeters,SpeedMps,AccuracyMeters,BearingDegrees,UnixTimeMillis,X\n\
                Fix,FLP,37.5,-122.0,,,4.0,90.0,1699400582000,\n\
                Fix,NLP,,,,,,,,\n";
    let mut decoded = decode(text);
    let fixes = decoded.decoder.take_fixes();
    assert!(decoded.decoder.take_fixes().is_empty());
    assert_eq!(fixes.len(), 2);
    assert_eq!((fixes[0].provider, fixes[1].provider), (FixProvider::Gnss, FixProvider::Fused));
    assert_eq!(fixes[0].time_gps.to_string(), "2016-06-30T21:26:26.000 GPS");
    assert_eq!((fixes[0].height_m, fixes[0].speed_mps, fixes[0].bearing_rad), (Some(-33.0), Some(1.5), None));
    assert_eq!((fixes[1].height_m, fixes[1].accuracy_m), (None, Some(4.0)));
    assert!((fixes[1].bearing_rad.unwrap() - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
    assert_eq!(decoded.skips.count("Fix line: a needed value is missing"), 1);
}

/// Subframes 1 to 3 and the ionosphere page of a satellite as `Nav` lines.
fn nav_lines() -> Vec<String> {
    let line = |(number, words): (usize, &[u32; 10])| {
        let bytes: Vec<String> =
            words.iter().flat_map(|w| w.to_be_bytes()).map(|b| b.cast_signed().to_string()).collect();
        format!("Nav,4,257,1,-1,{},{}", number + 1, bytes.join(","))
    };
    PRN4.iter().enumerate().map(line).collect()
}

#[test]
fn nav_lines_become_ephemerides() {
    let week = GpsTime::from_week_tow(1869, 0.0).nanos();
    let at = |seconds: i64| {
        let gps_ns = week + seconds * 1_000_000_000;
        Line { gps_ns, received: (gps_ns - TRAVEL_NS).rem_euclid(WEEK_NS), ..gps(seconds) }.text() + "\n"
    };
    let nav = nav_lines().join("\n") + "\n";
    let after = decode(&format!("{HEADER}\n{}{nav}{}", at(31), at(32)));
    let before = decode(&format!("{HEADER}\n{nav}{}{}", at(31), at(32)));
    let unsigned = decode(&format!("{HEADER}\n{}{}", at(31), nav.replace(",-111", ",145")));
    for decoded in [after, before, unsigned] {
        assert!(decoded.skips.is_empty(), "{}", decoded.skips);
        assert_eq!(decoded.ephemerides.len(), 1);
        let e = &decoded.ephemerides[0];
        assert_eq!((e.satellite.to_string(), e.issue_of_data), ("G04".to_owned(), 74));
        assert_eq!(e.toe, GpsTime::from_week_tow(1869, 7_200.0));
        assert_eq!(decoded.decoder.leap_seconds(), Some(17));
        assert_eq!(decoded.decoder.ionosphere().gps.unwrap().beta[0], 129_024.0);
    }
    // Of eight years later: the message is of another week.
    let later = decode(&format!("{HEADER}\n{}\n{nav}", gps(0).text()));
    assert_eq!(later.skips.count(Reason::EphemerisOfOtherWeek), 1);
    assert!(later.ephemerides.is_empty());
    // Without any epoch the week stays open.
    let never = decode(&nav);
    assert_eq!(never.skips.count(Reason::NavLineWithoutWeek), 4);
}

#[test]
fn other_streams_are_refused() {
    let rinex =
        "     3.04           OBSERVATION DATA    M                   RINEX VERSION / TYPE\n".repeat(200);
    let long = "x".repeat(20_000_000);
    for (text, fed) in [(rinex.as_str(), false), ("", true), ("hello\n", true), (long.as_str(), true)] {
        let mut decoder = GnssLoggerDecoder::default();
        assert_eq!(decoder.feed(text.as_bytes()).is_ok(), fed);
        let error = decoder.finish().unwrap_err();
        assert!(error.reason.starts_with("not a GnssLogger text log"), "{error}");
        assert!(decoder.next_record().is_none());
        let portions: Vec<&[u8]> = text.as_bytes().chunks(4_093).collect();
        assert_eq!(outcome(&portions), outcome(&[text.as_bytes()]));
    }
}

/// Everything that comes out, for comparison.
fn outcome(portions: &[&[u8]]) -> (Vec<Record>, Skips, bool, usize) {
    let mut decoder = GnssLoggerDecoder::default();
    let mut records = Vec::new();
    let mut wrong = false;
    for portion in portions {
        wrong |= decoder.feed(portion).is_err();
        records.extend(std::iter::from_fn(|| decoder.next_record()));
    }
    wrong |= decoder.finish().is_err();
    records.extend(std::iter::from_fn(|| decoder.next_record()));
    (records, decoder.skips().clone(), wrong, decoder.take_fixes().len())
}

fn sample() -> Vec<u8> {
    let mut lines = vec![HEADER.to_owned()];
    for seconds in 0..4 {
        for svid in 1..6 {
            lines.push(Line { svid, ..gps(seconds) }.text());
        }
        lines.push("Fix,gps,37.5,-122.0,-33.0,1.5,3.0,1467321969000".to_owned());
        lines.extend(nav_lines());
    }
    lines.join("\n").into_bytes()
}

proptest! {
    #[test]
    fn any_bytes_in_any_portions(bytes in prop::collection::vec(any::<u8>(), 0..2_000), size in 1_usize..300) {
        let portions: Vec<&[u8]> = bytes.chunks(size).collect();
        prop_assert_eq!(outcome(&portions), outcome(&[&bytes]));
    }

    /// A log with bytes changed, taken out and doubled, fed in any portions.
    #[test]
    fn damaged_logs_in_any_portions(
        changes in prop::collection::vec((any::<prop::sample::Index>(), 0..4_u8, any::<u8>()), 0..40),
        sizes in prop::collection::vec(1_usize..900, 1..20),
    ) {
        let mut bytes = sample();
        for (at, kind, value) in changes {
            let at = at.index(bytes.len());
            match kind {
                0 => bytes[at] = value,
                1 => bytes[at] = b"0123456789,-.\n"[usize::from(value) % 14],
                2 => drop(bytes.drain(at..(at + usize::from(value)).min(bytes.len() - 1))),
                _ => {
                    let piece = bytes[at..(at + usize::from(value)).min(bytes.len())].to_vec();
                    bytes.splice(at..at, piece);
                }
            }
        }
        let mut portions = Vec::new();
        let mut rest = bytes.as_slice();
        for size in sizes.iter().cycle() {
            if rest.is_empty() {
                break;
            }
            let (portion, next) = rest.split_at((*size).min(rest.len()));
            portions.push(portion);
            rest = next;
        }
        let (records, skips, wrong, fixes) = outcome(&[&bytes]);
        prop_assert_eq!(outcome(&portions), (records.clone(), skips, wrong, fixes));
        let times: Vec<GpsTime> = records
            .iter()
            .filter_map(|r| match r { Record::Epoch(e) => Some(e.time_gps), _ => None })
            .collect();
        prop_assert!(times.is_sorted_by(|a, b| a < b), "epochs in time order");
        for record in &records {
            if let Record::Epoch(epoch) = record {
                prop_assert!(!epoch.observations.is_empty());
                for o in &epoch.observations {
                    prop_assert!(o.pseudorange_m.is_some_and(|p| (1e7..=5e7).contains(&p)));
                    prop_assert!(o.doppler_hz.is_none_or(f64::is_finite));
                }
            }
        }
    }
}

/// Numbers that no phone measures; other programs refuse them, and so do messages to the hub.
#[test]
fn absurd_strengths_rates_and_ranges_are_counted() {
    let absurd = [
        (Line { cn0: 75.0, ..gps(1) }, Reason::Cn0OutOfRange.text(), (false, false, false)),
        (Line { rate: "1e300", ..gps(1) }, Reason::DopplerOutOfRange.text(), (true, true, false)),
        (
            Line { range: "1e308", ..gps(1) },
            Reason::AccumulatedDeltaRangeOutOfRange.text(),
            (true, false, false),
        ),
    ];
    for (line, reason, left) in absurd {
        let decoded = decode(&log(&[gps(0), line, gps(2)]));
        assert_eq!(decoded.skips.count(reason), 1, "{}", decoded.skips);
        let middle = decoded.epochs.iter().find(|epoch| epoch.time_gps == decoded.epochs[0].time_gps + 1.0);
        let found = middle.map_or((false, false, false), |epoch| {
            let o = &epoch.observations[0];
            (o.pseudorange_m.is_some(), o.carrier_phase_cycles.is_some(), o.doppler_hz.is_some())
        });
        assert_eq!(found, left, "{reason}");
    }
}
