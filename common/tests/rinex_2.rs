//! RINEX 2: recordings where they are at hand, small files written here everywhere.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

mod beside;
#[macro_use]
mod navigation_records;

use std::fmt::Write as _;

use beside::required;
use cofix_common::formats::rinex::ObservationFile;
use cofix_common::gnss::{Constellation, EpochFlag, Observation, ObservationEpoch};
use cofix_common::orbit::NavigationFile;
use cofix_common::skips::Reason;
use cofix_common::time::GpsTime;

fn find(epoch: &ObservationEpoch, satellite: &str, signal: &str) -> Observation {
    let wanted = |o: &&Observation| o.satellite.to_string() == satellite && o.signal.to_string() == signal;
    *epoch.observations.iter().find(wanted).unwrap_or_else(|| panic!("no {satellite} {signal}"))
}

fn header(content: &str, label: &str) -> String {
    format!("{content:<60}{label}\n")
}

/// An observation file with seven types, so that a satellite has two lines.
fn observations(system: &str, extra: &str, body: &str) -> ObservationFile {
    let text = header(&format!("     2.11           OBSERVATION DATA    {system}"), "RINEX VERSION / TYPE")
        + &header("     7    L1    L2    C1    P2    S1    D1    P1", "# / TYPES OF OBSERV")
        + extra
        + &header("", "END OF HEADER")
        + body;
    ObservationFile::parse(text.as_bytes()).unwrap()
}

/// The two lines of a satellite.
const VALUES: &str = "  55923622.16015  43647388.24243  24767686.375    24767684.822          45.000
     -2520.506    24767686.125\n";

#[test]
#[ignore = "needs the reference data"]
fn recordings_have_all_their_epochs() {
    for (path, pseudorange_m) in
        [("oracle/inputs/07590920.05o", 24_767_686.375), ("oracle/inputs/30400920.05o", 24_801_780.917)]
    {
        let bytes = required(path);
        let file = ObservationFile::parse(&bytes).unwrap();
        println!("{path}: {} epochs, {}", file.epochs.len(), file.skips);
        assert_eq!(file.epochs.len(), 120);
        assert!(file.skips.is_empty(), "{}", file.skips);
        assert_eq!(file.epochs[0].time_gps, GpsTime::from_week_tow(1316, 518_400.0));
        let g03 = find(&file.epochs[0], "G03", "1C");
        assert_eq!(g03.pseudorange_m, Some(pseudorange_m));
        assert!(find(&file.epochs[0], "G03", "2W").pseudorange_m.is_some());
    }
}

#[test]
#[ignore = "needs the reference data"]
fn hourly_broadcast_files_are_read() {
    for path in [
        "data/google-static-2016/hour1820.16n",
        "data/google-static-2016/hour2350.16n",
        "data/gsdc-2020-05-14-mtv1/hour1350.20n",
    ] {
        let bytes = required(path);
        let file = NavigationFile::parse(&bytes).unwrap();
        println!("{path}: {} ephemerides, {}", file.ephemerides.len(), file.skips);
        // The header and every record have eight lines.
        let records = String::from_utf8_lossy(&bytes).lines().count() / 8 - 1;
        assert_eq!((file.ephemerides.len(), file.skips.total()), (records, 0), "{}", file.skips);
        assert!(file.ionosphere.gps.is_some());
    }
}

#[test]
fn satellites_go_on_over_lines_and_take_the_files_system() {
    let list = "G 1  2 R 3G 4G 5G 6G 7G 8G 9G10G11G12".replace("G 1  2 ", "G 1  2");
    let body = format!(
        " 05  4  2  0  0 30.0000000  0 14{list}{}\n{}G13E14\n{}",
        "   0.000001234",
        " ".repeat(32),
        VALUES.repeat(14)
    );
    let file = observations("M (MIXED)", "", &body);
    assert!(file.skips.is_empty(), "{}", file.skips);
    let epoch = &file.epochs[0];
    assert_eq!(epoch.time_gps, "2005-04-02T00:00:30".parse().unwrap());
    let g02 = find(epoch, "G02", "1C");
    assert_eq!((g02.pseudorange_m, g02.cn0_dbhz), (Some(24_767_686.375), Some(45.0)));
    assert_eq!((g02.carrier_phase_cycles, g02.doppler_hz), (Some(55_923_622.160), Some(-2_520.506)));
    assert!(g02.loss_of_lock.cycle_slip && !g02.loss_of_lock.half_cycle);
    assert_eq!(find(epoch, "G02", "1W").pseudorange_m, Some(24_767_686.125));
    assert!(!find(epoch, "G13", "2W").loss_of_lock.half_cycle);
    assert_eq!(find(epoch, "R03", "2P").pseudorange_m, Some(24_767_684.822));
    assert_eq!(find(epoch, "E14", "1X").pseudorange_m, Some(24_767_686.125));
}

#[test]
fn a_glonass_file_is_in_utc() {
    let body = format!(" 05  4  2  0  0 30.0000000  0  1  7\n{VALUES}");
    let file = observations("R (GLONASS)", "", &body);
    assert_eq!(file.epochs[0].time_gps, "2005-04-02T00:00:43".parse().unwrap());
    assert_eq!(file.epochs[0].observations[0].satellite.constellation, Constellation::Glonass);
}

#[test]
fn years_have_two_digits() {
    for (year, full) in [("80", "1980"), ("99", "1999"), (" 0", "2000"), ("26", "2026"), ("79", "2079")] {
        let file = observations("G", "", &format!(" {year}  6  2  0  0 30.0000000  0  1G07\n{VALUES}"));
        assert_eq!(file.epochs[0].time_gps, format!("{full}-06-02T00:00:30").parse().unwrap());
    }
}

#[test]
fn events_slips_and_damage_cost_only_themselves() {
    let epoch =
        |second: u32, flag: u32| format!(" 05  4  2  0  0 {second:2}.0000000  {flag}  1G07\n{VALUES}");
    let body = [
        epoch(1, 0),
        // An event without time that shortens the list of types: then one line per satellite.
        format!("{}4  3\n", " ".repeat(28)),
        header("     2    C1    L1", "# / TYPES OF OBSERV"),
        header("  2005     4     2     0     0    0.0000000     GPS", "TIME OF FIRST OBS"),
        header("THE ANTENNA MOVED", "COMMENT"),
        " 05  4  2  0  0  2.0000000  1  1G07\n  24767686.375    55923622.160\n".to_owned(),
        // A cycle slip record, then an epoch that repeats its time.
        " 05  4  2  0  0  2.0000000  6  1G07\n                       123.000\n".to_owned(),
        " 05  4  2  0  0  2.0000000  0  1G07\n  24767686.375    55923622.160\n".to_owned(),
        // Satellites are missing.
        " 05  4  2  0  0  3.0000000  0  3G07G08G09\n  24767686.375    55923622.160\n".to_owned(),
        // Values that are not numbers, a satellite that is none.
        " 05  4  2  0  0  4.0000000  0  3G07X08G09\n  24767#86.375    55923622.160\n".to_owned(),
        "  24767686.375    55923622.160\n  24767686.375    55923622.160\n".to_owned(),
        // The last epoch is cut off.
        " 05  4  2  0  0  5.0000000  0  2G07G08\n  24767686.375    55923622.160\n".to_owned(),
    ]
    .concat();
    let file = observations("G", "", &body);
    let seconds: Vec<f64> = file.epochs.iter().map(|e| e.time_gps.calendar().second).collect();
    assert_eq!(seconds, [1.0, 2.0, 3.0, 4.0], "{}", file.skips);
    assert_eq!(file.epochs[1].flag, EpochFlag::PowerFailure);
    assert_eq!(find(&file.epochs[1], "G07", "1C").pseudorange_m, Some(24_767_686.375));
    let last: Vec<String> = file.epochs[3].observations.iter().map(|o| o.satellite.to_string()).collect();
    assert_eq!(last, ["G07", "G09"]);
    assert_eq!(file.epochs[3].observations[0].pseudorange_m, None);
    for reason in [
        Reason::EpochRepeatsTime.text(),
        Reason::EpochLacksSatellites.text(),
        Reason::ValueNotF14.text(),
        Reason::UnknownSatellite.text(),
        Reason::LastEpochCutOff.text(),
    ] {
        assert_eq!(file.skips.count(reason), 1, "{reason}: {}", file.skips);
    }
    assert_eq!((file.skips.total(), file.events.len()), (5, 2), "{}", file.skips);
}

const GLONASS: &str = "     2.01           GLONASS NAV DATA                        RINEX VERSION / TYPE
                                                            END OF HEADER
 3 98  2 15  0 15  0.0 0.163525342941D-03 0.363797880709D-11 0.108000000000D+05
    0.106275903320D+05-0.348924636841D+00 0.931322574615D-09 0.000000000000D+00
   -0.944422070313D+04 0.288163375854D+01 0.931322574615D-09 0.210000000000D+02
    0.212257280273D+05 0.144599342346D+01-0.186264514923D-08 0.300000000000D+01
 4 98  2 15  0 15  0.0 0.179599039257D-03 0.636646291241D-11 0.122400000000D+05
    0.562136621094D+04-0.289074897766D+00-0.931322574615D-09 0.000000000000D+00
   -0.236819248047D+05 0.102263259888D+01 0.931322574615D-09 0.120000000000D+02
    0.762532910156D+04 0.339257907867D+01 0.000000000000D+00 0.300000000000D+01
";

/// The example of the format's own description (RINEX 2.10, table A15), in the part that it gives.
#[test]
fn the_glonass_example_is_read() {
    let file = NavigationFile::parse(GLONASS.as_bytes()).unwrap();
    // Slot 3 then had channel 21, as there are none any more.
    assert_eq!((file.glonass.len(), file.skips.count(Reason::RecordImpossible)), (1, 1));
    let r04 = file.glonass[0];
    // 12 s between GPS time and UTC in 1998.
    assert_eq!(r04.toe, "1998-02-15T00:15:12".parse().unwrap());
    assert_eq!((r04.tau_s, r04.gamma), (-0.179599039257e-3, 0.636646291241e-11));
    assert_eq!(r04.frequency_channel, 12);
    assert!((r04.position.0.x - 5_621_366.210_94).abs() < 1e-6 && r04.health == Some(0));
}

const GPS: &str = concat!(
    "     2.10           N: GPS NAV DATA                         RINEX VERSION / TYPE
                                                            END OF HEADER
",
    gps_2!(),
);

/// A Galileo or QZSS record of RINEX 3 in the form of RINEX 2.12, with the system's letter or without.
fn as_2(record: &str, lettered: bool) -> String {
    let mut text = String::new();
    for (index, line) in record.lines().enumerate() {
        let (id, number) = if lettered { (&line[..3], 0) } else { (&line[1..3], 1) };
        match index {
            // A year of two digits, and the second with its tenth.
            0 => writeln!(text, "{id} {}{}.0{}", &line[6..20], &line[20..23], &line[23..]).unwrap(),
            _ => writeln!(text, "{}", &line[number..]).unwrap(),
        }
    }
    text
}

#[test]
fn systems_of_2_12_are_read_as_those_of_3() {
    let record = |id: &str| {
        let lines = [
            &format!("{id} 2024 01 02 03 10 00-4.250000000000E-04-8.125000000000E-12 0.000000000000E+00"),
            "     7.100000000000E+01-1.250000000000E+01 3.062500000000E-09-1.375000000000E+00",
            "    -6.250000000000E-07 1.812500000000E-03 7.750000000000E-06 5.440625000000E+03",
            "     1.842000000000E+05-3.125000000000E-08 2.562500000000E+00 4.687500000000E-08",
            "     9.687500000000E-01 1.937500000000E+02-5.125000000000E-01-5.375000000000E-09",
            "    -2.250000000000E-10 5.170000000000E+02 2.295000000000E+03",
            "     3.120000000000E+00 0.000000000000E+00 2.500000000000E-09 3.125000000000E-09",
            "     1.848650000000E+05",
        ];
        lines.join("\n") + "\n"
    };
    let file = |first: &str, body: &str| {
        let first = header(first, "RINEX VERSION / TYPE");
        let text = format!("{first}{}{body}", header("", "END OF HEADER"));
        let file = NavigationFile::parse(text.as_bytes()).unwrap();
        assert!(file.skips.is_empty(), "{}", file.skips);
        file.ephemerides
    };
    for (id, galileo) in [("E05", true), ("J02", false)] {
        let record = record(id);
        let three = file("     3.04           N: GNSS NAV DATA    M: MIXED", &record);
        assert_eq!((three.len(), three[0].satellite.to_string()), (1, id.to_owned()));
        let first = if galileo {
            "     2.12           E: GALILEO NAV DATA"
        } else {
            "     2.12           N                   J"
        };
        for lettered in [false, true] {
            let two = as_2(&record, lettered);
            assert_eq!(file(first, &two), three, "{two}");
        }
        // A blank for the first digit.
        let two = as_2(&record, true).replacen(id, &id.replace('0', " "), 1);
        assert_eq!(file(first, &two), three, "{two}");
    }
}

#[test]
fn weeks_may_have_rolled_over() {
    let read =
        |week: &str| NavigationFile::parse(GPS.replace("1.316000000000D+03", week).as_bytes()).unwrap();
    for week in ["1.316000000000D+03", "2.920000000000D+02", "1.315000000000D+03"] {
        let file = read(week);
        assert_eq!(file.ephemerides[0].toe, GpsTime::from_week_tow(1316, 525_600.0), "{week}");
    }
    let file = read("1.300000000000D+03");
    assert_eq!((file.ephemerides.len(), file.skips.count(Reason::RecordImpossible)), (0, 1));
}
