//! RINEX files: recordings where they are at hand, small ones written here everywhere.

#![allow(clippy::unwrap_used)] // helpers of tests

mod beside;

use beside::required;
use cofix_common::formats::rinex::{ObservationDecoder, ObservationFile, RinexError};
use cofix_common::gnss::{EpochFlag, Observation, ObservationEpoch};
use cofix_common::orbit::NavigationFile;
use cofix_common::skips::Reason;

#[test]
#[ignore = "needs the reference data"]
fn recordings_have_all_their_epochs() {
    for (path, epochs) in [
        ("WH-3-08/HP20", 640),
        ("WH-3-08/HP30", 640),
        ("WH-3-08/MXT", 703),
        ("WH-3-08/VX30", 642),
        ("WH-3-08/XIM8", 640),
        ("WH-3-09/HP20", 480),
        ("WH-3-09/HP30", 479),
        ("WH-3-09/MXT", 493),
        ("WH-3-09/VX30", 480),
        ("WH-3-09/XIM8", 479),
        ("WH-4-06/HP20", 488),
        ("WH-4-06/HP30", 489),
        ("WH-4-06/VX30", 485),
        ("WH-4-06/XIM8", 490),
    ] {
        let bytes = required(&format!("data/whu-wuhan-2020-08-13/{path}.rnx"));
        let file = ObservationFile::parse(&bytes).unwrap();
        let observations: usize = file.epochs.iter().map(|e| e.observations.len()).sum();
        println!(
            "{path}: {} epochs, {observations} observations, skipped: {}",
            file.epochs.len(),
            file.skips
        );
        assert_eq!(file.epochs.len(), epochs, "{path}");
        assert!(file.skips.is_empty(), "{path}: {}", file.skips);
    }
}

#[test]
#[ignore = "needs the reference data"]
fn navigation_files_are_read() {
    for path in [
        "data/ESBC00DNK_R_20201770000_01D_MN.rnx.gz",
        "oracle/inputs/BRD400DLR_20230710000_as_rnx305_GRECJI.rnx.gz",
        "oracle/inputs/CORD00ARG_R_20240920000_01D_MN.rnx.gz",
        "oracle/inputs/mat_base.nav.gz",
    ] {
        let bytes = required(path);
        let file = NavigationFile::parse(&bytes).unwrap();
        println!("{path}: {} ephemerides, {:?}, {}", file.ephemerides.len(), file.ionosphere, file.skips);
    }
}

fn find<'a>(epoch: &'a ObservationEpoch, satellite: &str, signal: &str) -> &'a Observation {
    let named = |o: &&Observation| o.satellite.to_string() == satellite && o.signal.to_string() == signal;
    epoch.observations.iter().find(named).unwrap()
}

#[test]
#[ignore = "needs the reference data"]
fn recordings_have_the_values_that_are_printed() {
    let bytes = required("data/whu-wuhan-2020-08-13/WH-3-08/HP30.rnx");
    let file = ObservationFile::parse(&bytes).unwrap();
    assert_eq!(file.header.version, 304);
    assert_eq!(file.header.marker_name, "HP30");
    assert_eq!(file.header.equipment.receiver_type, "HUAWEI P30");
    let first = &file.epochs[0];
    assert_eq!(first.time_gps, "2020-08-13T14:19:01.999759".parse().unwrap());
    let g10 = find(first, "G10", "5X");
    assert_eq!(g10.pseudorange_m, Some(21_111_615.124));
    assert_eq!(g10.carrier_phase_cycles, Some(12_459.633));
    assert_eq!(g10.doppler_hz, Some(-1_882.131));
    assert_eq!(g10.cn0_dbhz, Some(35.0));
    let g22 = find(first, "G22", "1C");
    assert_eq!((g22.pseudorange_m, g22.carrier_phase_cycles), (Some(25_058_881.092), None));
    assert!(!first.observations.iter().any(|o| o.satellite == g22.satellite && o.signal != g22.signal));
}

#[test]
#[ignore = "needs the reference data"]
fn a_geodetic_receivers_file_has_all_bands() {
    let bytes = required("oracle/inputs/mat_rover.obs.gz");
    let file = ObservationFile::parse(&bytes).unwrap();
    assert_eq!(file.epochs.len(), 301);
    assert!(file.skips.is_empty(), "{}", file.skips);
    assert_eq!(file.header.glonass_channels.get(&2), Some(&-4));
    let c02 = find(&file.epochs[0], "C02", "7I");
    assert_eq!(c02.carrier_phase_cycles, Some(157_502_405.032));
    assert_eq!(c02.cn0_dbhz, Some(40.594));
}

#[test]
#[ignore = "needs the reference data"]
fn a_phones_own_file_is_read() {
    let bytes = required("data/pixel6-2023/pixel6.23o");
    let file = ObservationFile::parse(&bytes).unwrap();
    println!("{} epochs, {}", file.epochs.len(), file.skips);
    assert_eq!(file.header.glonass_channels.len(), 6);
    let g04 = find(&file.epochs[0], "G04", "1C");
    assert_eq!(g04.pseudorange_m, Some(23_440_243.757));
    assert!(g04.loss_of_lock.half_cycle && !g04.loss_of_lock.cycle_slip);
}

#[test]
#[ignore = "needs the reference data"]
fn a_base_stations_file_is_read() {
    let bytes = required("data/gsdc-2020-05-14-mtv1/slac1350.obs");
    let file = ObservationFile::parse(&bytes).unwrap();
    println!("{} epochs, {}", file.epochs.len(), file.skips);
    assert!(file.epochs.len() > 100 && file.skips.is_empty(), "{}", file.skips);
    assert_eq!(find(&file.epochs[0], "R11", "1P").pseudorange_m, Some(22_231_781.355));
}

/// A header line: content and label.
fn header(content: &str, label: &str) -> String {
    format!("{content:<60}{label}\n")
}

fn small_file(version: &str, time_system: &str, extra: &str, body: &str) -> String {
    header(&format!("     {version}           OBSERVATION DATA    M"), "RINEX VERSION / TYPE")
        + &header("G    4 C1C L1C D1C S1C", "SYS / # / OBS TYPES")
        + &header("C    2 C2I S2I", "SYS / # / OBS TYPES")
        + extra
        + &header(
            &format!("  2020     8    13    14    19    2.0000000     {time_system}"),
            "TIME OF FIRST OBS",
        )
        + &header("", "END OF HEADER")
        + body
}

fn read(body: &str) -> ObservationFile {
    ObservationFile::parse(small_file("3.04", "GPS", "", body).as_bytes()).unwrap()
}

const EPOCH_2: &str = "> 2020 08 13 14 19  2.0000000  0  1\n";
const G10: &str = "G10  21111612.436   291795067.81413     -2520.506          37.000\n";

#[test]
fn events_and_slip_records_do_not_disturb_the_epochs() {
    let body = format!(
        "{EPOCH_2}{G10}>                              4  2\n{}{}> 2020 08 13 14 19  3.0000000  6  1\n{G10}\
         > 2020 08 13 14 19  3.0000000  5  0\n> 2020 08 13 14 19  4.0000000  1  1\n{}",
        header("new antenna", "COMMENT"),
        header("G    1 S1C", "SYS / # / OBS TYPES"),
        "G10        37.000\n",
    );
    let file = read(&body);
    assert_eq!(file.epochs.len(), 2, "{}", file.skips);
    let slip = find(&file.epochs[0], "G10", "1C").loss_of_lock;
    assert!(slip.cycle_slip && !slip.half_cycle);
    // The event brought a new list of observation types.
    assert_eq!(file.epochs[1].flag, EpochFlag::PowerFailure);
    assert_eq!(find(&file.epochs[1], "G10", "1C").cn0_dbhz, Some(37.0));
    assert_eq!(file.events.len(), 3);
    // The record of slips is read by the new list, too.
    assert_eq!(file.skips.count(Reason::Cn0OutOfRange), 1);
    assert_eq!(file.skips.count(Reason::TextAfterObservationTypes), 1);
    assert_eq!(file.skips.total(), 2, "{}", file.skips);
}

#[test]
fn damage_costs_only_what_is_damaged() {
    let lines = [
        "> 2020 08 13 14 19  2.0000000  0  9\r\n",
        "G01  21111612.436   291795067.814             NaN          37.000\r\n",
        "G02    111612.436   291795067.814      999999.000          99.000\r\n",
        "G03  2111161.436   291795067.814       -2520.506          37.000\r\n",
        "X04  21111612.436\r\n",
        "R05  21111612.436\r\n",
        "G01  21111612.436\r\n",
        "G06         0.000                                           0.000\r\n",
        "C07  36678876.628          29.000\r\n",
        "G08  21111612.4\r\n",
    ];
    let file = read(&lines.concat());
    println!("{}", file.skips);
    let epoch = &file.epochs[0];
    let satellites: Vec<String> = epoch.observations.iter().map(|o| o.satellite.to_string()).collect();
    assert_eq!(satellites, ["G01", "G02", "C07"]);
    let g01 = find(epoch, "G01", "1C");
    assert_eq!((g01.pseudorange_m, g01.doppler_hz, g01.cn0_dbhz), (Some(21_111_612.436), None, Some(37.0)));
    let g02 = find(epoch, "G02", "1C");
    assert_eq!((g02.pseudorange_m, g02.carrier_phase_cycles), (None, Some(291_795_067.814)));
    for (reason, count) in [
        (Reason::ValueNotF14.text(), 6),
        (Reason::PseudorangeOutOfRange.text(), 1),
        (Reason::DopplerOutOfRange.text(), 1),
        (Reason::Cn0OutOfRange.text(), 1),
        (Reason::UnknownSatellite.text(), 1),
        (Reason::SystemWithoutObservationTypes.text(), 1),
        (Reason::SatelliteTwice.text(), 1),
    ] {
        assert_eq!(file.skips.count(reason), count, "{reason}: {}", file.skips);
    }
}

#[test]
fn epochs_come_in_order_and_once() {
    let epoch = |text: &str| format!("> {text}  0  1\n{G10}");
    let body = [
        "2020 08 13 14 19  2.0000000",
        "2020 08 13 14 19  2.0000000",
        "2020 08 13 14 19  1.0000000",
        "2030 08 13 14 19  3.0000000",
        "2020 08 13 14 19  3.0000000",
        "2020 13 13 14 19  4.0000000",
        "2020 08 13 14 19  5.0000000",
    ]
    .map(epoch)
    .concat();
    let file = read(&body);
    let seconds: Vec<f64> = file.epochs.iter().map(|e| e.time_gps.calendar().second).collect();
    assert_eq!(seconds, [2.0, 3.0, 5.0]);
    for reason in [
        Reason::EpochRepeatsTime.text(),
        Reason::EpochStepsBack.text(),
        Reason::EpochFarFromNext.text(),
        Reason::EpochLineUnreadable.text(),
    ] {
        assert_eq!(file.skips.count(reason), 1, "{reason}: {}", file.skips);
    }
}

#[test]
fn short_epochs_and_a_cut_end_are_told_apart() {
    let body =
        format!("> 2020 08 13 14 19  2.0000000  0  2\n{G10}> 2020 08 13 14 19  3.0000000  0  2\n{G10}");
    let file = read(&body);
    assert_eq!(file.epochs.len(), 1);
    assert_eq!(file.skips.count(Reason::EpochLacksSatellites), 1);
    assert_eq!(file.skips.count(Reason::LastEpochCutOff), 1);
    let (_, cut) = file.skips.iter().find(|(reason, _)| *reason == Reason::LastEpochCutOff.text()).unwrap();
    assert!(cut.first.starts_with("line 8: 2020-08-13T14:19:03.000 GPS: 1 of 2"), "{}", cut.first);
}

#[test]
fn time_systems_become_gps_time() {
    let body = format!("{EPOCH_2}{G10}");
    let leap = header("    18", "LEAP SECONDS");
    let first = |system: &str, extra: &str| {
        ObservationFile::parse(small_file("3.04", system, extra, &body).as_bytes())
            .map(|file| file.epochs[0].time_gps.calendar().second)
    };
    assert_eq!(first("GPS", ""), Ok(2.0));
    assert_eq!(first("GAL", ""), Ok(2.0));
    assert_eq!(first("BDT", ""), Ok(16.0));
    assert_eq!(first("BDS", ""), Ok(16.0), "as some writers call it");
    assert_eq!(first("GLO", &leap), Ok(20.0));
    // Without the line, by the date.
    assert_eq!(first("GLO", ""), Ok(20.0));
    // The date decides, whatever the header says, until a leap second may have come that the table does not have.
    assert_eq!(first("UTC", &header("    17", "LEAP SECONDS")), Ok(20.0));
    assert_eq!(first("TAI", ""), Ok(43.0));
    assert_eq!(first("glo", ""), Ok(20.0));
    // A column farther to the right than the format says.
    assert_eq!(first(" BDT", ""), Ok(16.0));
    assert_eq!(first("XYZ", ""), Err(RinexError::TimeSystem { found: "XYZ".to_owned() }));
}

#[test]
fn a_header_without_a_readable_first_time_is_used() {
    let good = small_file("3.04", "BDT", "", &format!("{EPOCH_2}{G10}"));
    for time in ["  2020     8    13    14    19    .2.000000", "                                           "]
    {
        let text = good.replace("  2020     8    13    14    19    2.0000000", time);
        let file = ObservationFile::parse(text.as_bytes()).unwrap();
        assert_eq!(file.epochs[0].time_gps.calendar().second, 16.0);
        assert_eq!(file.header.first_observation, None);
        let reason = Reason::HeaderFirstTimeUnreadable.text();
        assert_eq!((file.skips.count(reason), file.skips.total()), (1, 1), "{}", file.skips);
    }
}

#[test]
fn other_files_are_refused_with_what_was_found() {
    let message = |bytes: &[u8]| ObservationFile::parse(bytes).unwrap_err().to_string();
    for version in ["1.00", "2.50", "3.06", "5.00", "x.yz"] {
        let error = message(small_file(version, "GPS", "", "").as_bytes());
        assert!(error.contains(version), "{error}");
    }
    let navigation = header("     3.04           N: GNSS NAV DATA    M: MIXED", "RINEX VERSION / TYPE");
    assert!(message(navigation.as_bytes()).contains("N: GNSS NAV DATA"));
    assert!(message(b"Raw,12345,6789\n").contains("Raw,12345,6789"));
    assert_eq!(message(b""), RinexError::HeaderIncomplete { lines: 0 }.to_string());
    let hatanaka = header("2.0                 COMPACT RINEX FORMAT", "CRINEX VERS   / TYPE");
    assert!(message(hatanaka.as_bytes()).contains("2.0"));
}

#[test]
fn scale_factors_and_old_beidou_codes_are_understood() {
    // D8X is none of the file's types.
    let extra =
        header("G   10   2 D8X D1C", "SYS / SCALE FACTOR") + &header("C    1 C1I", "SYS / # / OBS TYPES");
    let epoch = EPOCH_2.replace("  1\n", "  2\n");
    let body = format!("{epoch}G10  21111612.436                      -25205.060\nC10  36678876.628\n");
    let file = ObservationFile::parse(small_file("3.02", "GPS", &extra, &body).as_bytes()).unwrap();
    assert_eq!(find(&file.epochs[0], "G10", "1C").doppler_hz, Some(-2_520.506));
    assert_eq!(find(&file.epochs[0], "C10", "2I").pseudorange_m, Some(36_678_876.628));
    assert!(file.skips.is_empty(), "{}", file.skips);
}

#[test]
fn an_epoch_is_given_with_its_last_line() {
    let text = small_file("3.04", "GPS", "", &format!("{EPOCH_2}{G10}"));
    let mut decoder = ObservationDecoder::default();
    let lines: Vec<&str> = text.lines().collect();
    for (index, line) in (1_u64..).zip(&lines) {
        let mut given = 0;
        decoder.line(index, line.as_bytes(), &mut |_| given += 1).unwrap();
        assert_eq!(given, usize::from(index == lines.len() as u64));
    }
    assert!(decoder.finish(&mut |_| {}).is_ok() && decoder.header().is_some() && decoder.skips().is_empty());
}
