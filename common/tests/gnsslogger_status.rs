//! `Status` lines: what they say, what is refused of them, in any columns and portions.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use cofix_common::formats::decode::Decoder;
use cofix_common::formats::gnsslogger::{GnssLoggerDecoder, SignalStatus};
use cofix_common::skips::{Reason, Skips};
use proptest::prelude::*;

const HEADER: &str = "# Status,UnixTimeMillis,SignalCount,SignalIndex,ConstellationType,Svid,CarrierFrequencyHz,\
Cn0DbHz,AzimuthDegrees,ElevationDegrees,UsedInFix,HasAlmanacData,HasEphemerisData,BasebandCn0DbHz";

/// One GPS signal at 2023-11-07 12:00:00.3 GPS time.
const RAW: &str = "Raw,0,7000000000000,,,-1383386600300000000,0.0,20,,,3,5,0,16431,216000218765433,20,35,-190.5,0.1,1,\
1000.0,0.1,1575420030,,,,0,,1";

fn decode(text: &str) -> (Vec<SignalStatus>, Skips) {
    let mut decoder = GnssLoggerDecoder::default();
    decoder.feed(text.as_bytes()).unwrap();
    decoder.finish().unwrap();
    let statuses = decoder.take_statuses();
    assert!(decoder.take_statuses().is_empty());
    (statuses, decoder.skips().clone())
}

/// The statuses of lines under the usual header.
fn lines(lines: &[&str]) -> (Vec<SignalStatus>, Skips) {
    decode(&format!("{HEADER}\n{}\n", lines.join("\n")))
}

#[test]
fn a_report_of_a_phone() {
    let (statuses, skips) = lines(&[
        "Status,,5,0,1,2,1575420030,25.7,192.285,31.194557,1,1,1,22.1",
        "Status,,5,1,6,11,1176450050,30.5,300.0,5.0,0,1,0,",
        "Status,,5,2,5,60,,0.0,0.0,0.0,0,0,0,",
        "Status,,5,3,4,194,1575420030,41,90.0,89.5,1,0,1,38",
        "Status,,5,4,3,3,1604812480,20,45.0,-2.0,0,1,0,16",
    ]);
    assert!(skips.is_empty(), "{skips}");
    let names: Vec<_> = statuses.iter().map(|s| format!("{} {}", s.satellite, s.signal)).collect();
    assert_eq!(names, ["G02 1C", "E11 5Q", "C60 2I", "J02 1C", "R03 1C"]);
    let first = &statuses[0];
    assert_eq!((first.cn0_dbhz, first.baseband_cn0_dbhz), (Some(25.7), Some(22.1)));
    let direction = first.direction.unwrap();
    assert!((direction.azimuth_rad - 192.285_f64.to_radians()).abs() < 1e-15);
    assert!((direction.elevation_rad - 31.194_557_f64.to_radians()).abs() < 1e-15);
    let flags = |s: &SignalStatus| (s.used_in_fix, s.has_almanac, s.has_ephemeris);
    assert_eq!(flags(first), (true, true, true));
    assert_eq!(flags(&statuses[1]), (false, true, false));
    // Not received, and nobody knows where it is.
    assert_eq!((statuses[2].cn0_dbhz, statuses[2].direction), (None, None));
    assert_eq!(flags(&statuses[3]), (true, false, true));
    assert!(statuses[4].direction.unwrap().elevation_rad < 0.0);
    assert!(statuses.iter().all(|s| s.time_gps.is_none() && s.after_epoch.is_none() && s.report == 0));
}

/// Google's app leaves the time out; others write 0 before the first position.
#[test]
fn times_and_places_of_reports() {
    let at = |time: &str, index: u8| format!("Status,{time},2,{index},1,{},,30,10,20,1,1,1,", index + 1);
    let (none, zero, later) = (at("", 0), [at("0", 0), at("0", 1)].join("\n"), "1699358383000");
    let text = format!("{HEADER}\n{zero}\n{RAW}\n{none}\n{}\n{}\n", at(later, 0), at(later, 1));
    let (statuses, skips) = decode(&text);
    // The raw line has no header, and is used.
    assert_eq!(skips.total(), 1, "{skips}");
    let reports: Vec<_> = statuses.iter().map(|s| s.report).collect();
    assert_eq!(reports, [0, 0, 1, 2, 2]);
    let times: Vec<_> = statuses.iter().map(|s| s.time_gps.map(|t| t.to_string())).collect();
    let time = Some("2023-11-07T12:00:01.000 GPS".to_owned());
    assert_eq!(times, [None, None, None, time.clone(), time]);
    let after: Vec<_> = statuses.iter().map(|s| s.after_epoch.map(|t| t.to_string())).collect();
    let epoch = Some("2023-11-07T12:00:00.300 GPS".to_owned());
    assert_eq!(after, [None, None, epoch.clone(), epoch.clone(), epoch]);
}

/// Of an absurd value the line keeps the rest; a line that names no signal is lost. All are counted by name.
#[test]
fn absurd_values_are_refused_and_counted() {
    let rest_stays = [
        (7, "-1", Reason::Cn0LeftOut.text()),
        (7, "99.5", Reason::Cn0LeftOut.text()),
        (7, "NaN", Reason::ValueUnreadable.text()),
        (9, "90.1", Reason::DirectionOutOfRange.text()),
        (9, "-91", Reason::DirectionOutOfRange.text()),
        (9, "NaN", Reason::ValueUnreadable.text()),
        (8, "361", Reason::DirectionOutOfRange.text()),
        (8, "Infinity", Reason::ValueUnreadable.text()),
        (10, "2", Reason::ValueUnreadable.text()),
        (13, "-3", Reason::Cn0LeftOut.text()),
        (1, "5", Reason::TimeOutOfRange.text()),
        (1, "soon", Reason::ValueUnreadable.text()),
    ];
    let lost = [
        (3, "", Reason::NeededValueMissing.text()),
        (4, "9", Reason::UnknownConstellationType.text()),
        (4, "x", Reason::NeededValueUnreadable.text()),
        (5, "77", Reason::SatelliteNumberOutOfRange.text()),
        (6, "1600000000", Reason::CarrierFrequencyOfNoSignal.text()),
    ];
    let good = "Status,1699358383000,1,0,1,2,1575420030,25.7,192.5,31.5,1,1,1,22.1";
    let whole = lines(&[good]).0[0];
    let with = |(at, value, reason): (usize, &str, &str)| {
        let mut fields: Vec<&str> = good.split(',').collect();
        fields[at] = value;
        let (statuses, skips) = lines(&[&fields.join(",")]);
        assert_eq!(skips.count(format!("Status line: {reason}")), 1, "{at} {value}: {skips}");
        assert_eq!(skips.total(), 1, "{at} {value}: {skips}");
        statuses
    };
    for case in rest_stays {
        let statuses = with(case);
        assert_eq!(statuses.len(), 1, "{case:?}");
        let s = statuses[0];
        assert_ne!(s, whole, "{case:?}");
        assert!(s.cn0_dbhz.is_none() == (case.0 == 7), "{case:?}");
        assert!(s.direction.is_none() == [8, 9].contains(&case.0), "{case:?}");
    }
    for case in lost {
        assert!(with(case).is_empty(), "{case:?}");
    }
    let (_, skips) = lines(&["Status,,1,0,3,93,1598062500,25.7,192.5,31.5,1,1,1,22.1"]);
    assert_eq!(skips.count("Status line: GLONASS satellite known by its frequency channel only"), 1);
}

#[test]
fn columns_by_name_in_any_order_and_number() {
    let line = "Status,,1,0,1,2,1575420030,25.7,192.5,31.5,1,0,1,22.1";
    let expected = lines(&[line]).0;
    // Without a header, under a wide one, and turned round with news in it.
    assert_eq!(decode(&format!("{line}\n")).0, expected);
    assert_eq!(decode(&format!("{}\n{line}\n", HEADER.replace("# ", "#   "))).0, expected);
    let turn = |row: &str, news: &str| {
        let (kind, rest) = row.split_once(',').unwrap();
        let mut fields: Vec<&str> = rest.split(',').collect();
        fields.reverse();
        fields.insert(2, news);
        format!("{kind},{}\n", fields.join(","))
    };
    let (statuses, skips) = decode(&(turn(HEADER, "IsMoonVisible") + &turn(line, "7")));
    assert_eq!((statuses, skips.is_empty()), (expected, true), "{skips}");
    let (_, skips) = decode(&format!("{}\n", HEADER.replace(",Svid,", ",Sv,")));
    assert_eq!(skips.count(Reason::HeaderLineWithoutColumn), 1);
}

proptest! {
    /// What comes out is sound and does not depend on portions.
    #[test]
    fn damaged_reports_in_any_portions(
        fields in prop::collection::vec("[-0-9.eN]{0,6}", 14..15),
        changed in prop::collection::vec(1_usize..14, 0..6),
        size in 1_usize..200,
    ) {
        let mut line: Vec<&str> = "Status,,2,0,1,2,1575420030,25.7,192.5,31.5,1,0,1,22.1".split(',').collect();
        for at in changed {
            line[at] = &fields[at];
        }
        let text = format!("{HEADER}\n{}\n{}\n", line.join(","), line.join(","));
        let mut cut = GnssLoggerDecoder::default();
        for portion in text.as_bytes().chunks(size) {
            cut.feed(portion).unwrap();
        }
        cut.finish().unwrap();
        let (statuses, skips) = decode(&text);
        prop_assert_eq!(cut.take_statuses(), statuses.clone());
        prop_assert_eq!(cut.skips(), &skips);
        for s in &statuses {
            prop_assert!([s.cn0_dbhz, s.baseband_cn0_dbhz].iter().flatten().all(|c| *c > 0.0 && *c <= 70.0));
            let sound = s.direction.is_none_or(|d| {
                (0.0..std::f64::consts::TAU).contains(&d.azimuth_rad) && d.elevation_rad.abs() <= std::f64::consts::FRAC_PI_2
            });
            prop_assert!(sound, "{s:?}");
        }
        if statuses.is_empty() {
            prop_assert!(!skips.is_empty());
        }
    }
}
