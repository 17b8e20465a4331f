//! Every format with every defect: what is wrong is counted and named in the one summary at the end, and the good epochs are
//! used.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

mod recordings;

use std::io::Write;
use std::path::{Path, PathBuf};

use cofix_agent::convert::{Outputs, convert};
use cofix_agent::inspect::{InspectOptions, Inspection, inspect};
use cofix_agent::source::{Reading, survey};
use cofix_agent::{Source, Stop};
use cofix_common::formats::rinex::ObservationFile;
use cofix_common::skips::Reason;
use cofix_common::time::GpsTime;
use flate2::Compression;
use flate2::write::GzEncoder;

use recordings::{Recording, compact, frame, log, msm4, rinex_2, rinex_3, rtcm, spare_log, table};

/// Epochs of an undamaged recording.
const EPOCHS: u64 = 12;

fn all() -> [Recording; 7] {
    [rinex_2, rinex_3, compact, log, table, spare_log, rtcm].map(|format| format(12))
}

fn named(name: &str) -> Recording {
    all().into_iter().find(|recording| recording.name == name).unwrap()
}

/// An instant of the recordings, for RTCM 3.
fn near() -> GpsTime {
    "2020-08-13T14:00:00".parse().unwrap()
}

fn options() -> InspectOptions {
    InspectOptions {
        reading: Reading { near: Some(near()), ..Reading::default() },
        ..InspectOptions::default()
    }
}

struct Bench {
    folder: tempfile::TempDir,
}

impl Bench {
    fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    fn file(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.folder.path().join(name.replace(' ', "-"));
        std::fs::write(&path, bytes).unwrap();
        path
    }

    /// Inspects, surveys and converts damaged bytes: all agree on the epochs, and all name the reason.
    fn check(&self, what: &str, bytes: &[u8], epochs: u64, reason: &str) -> Inspection {
        let path = self.file("damaged", bytes);
        let inspection = inspect(&path, &options(), &Stop::default());
        let inspection = inspection.unwrap_or_else(|error| panic!("{what}: {error}"));
        let said = inspection.skips.to_string();
        assert_eq!(inspection.epochs, epochs, "{what}: {said}");
        let named = |skips: &str| reason.is_empty() == skips.is_empty() && skips.contains(reason);
        assert!(named(&said), "{what}: '{reason}' is not in: {said}");
        assert!(inspection.to_string().contains(reason), "{what}: {inspection}");
        let source = Source::File { path: path.clone(), near: Some(near()) };
        let survey = survey(&source, &Reading::default(), &Stop::default()).unwrap();
        assert_eq!((survey.epochs, survey.skips.to_string()), (epochs, said), "{what}");
        self.converts(what, &path, epochs, reason);
        inspection
    }

    fn converts(&self, what: &str, path: &Path, epochs: u64, reason: &str) {
        let output = self.folder.path().join("out.rnx");
        let outputs = Outputs { observations: Some(output.clone()), navigation: None, overwrite: true };
        let converted = convert(&[path.to_owned()], &outputs, &options().reading, &Stop::default()).unwrap();
        assert_eq!(converted.epochs, epochs, "{what}: {}", converted.skips);
        assert!(converted.skips.to_string().contains(reason), "{what}: {}", converted.skips);
        let again = ObservationFile::parse(&std::fs::read(&output).unwrap()).unwrap();
        assert_eq!(again.epochs.len() as u64, epochs, "{what}: {}", again.skips);
    }
}

/// The error of a file that cannot be used; it names the file.
fn refused(what: &str, path: &Path) -> String {
    let error = inspect(path, &options(), &Stop::default()).unwrap_err().to_string();
    assert!(error.contains(&path.display().to_string()), "{what}: {error}");
    let source = Source::File { path: path.to_owned(), near: Some(near()) };
    let surveyed = survey(&source, &Reading::default(), &Stop::default()).unwrap_err().to_string();
    assert_eq!(surveyed, error, "{what}");
    error
}

#[test]
fn undamaged_recordings_are_read_in_full() {
    let bench = Bench::new();
    for recording in all() {
        let inspection = bench.check(recording.name, &recording.bytes(), EPOCHS, "");
        let observations: u64 =
            inspection.constellations.iter().flat_map(|c| &c.signals).map(|s| s.observations).sum();
        assert_eq!(observations, 2 * EPOCHS, "{}", recording.name);
    }
}

#[test]
fn truncated_files() {
    let bench = Bench::new();
    for (recording, reason) in all().into_iter().zip([
        Reason::LastEpochCutOff.text(),
        Reason::LastEpochCutOff.text(),
        Reason::LastEpochCutOff.text(),
        Reason::LastLineCutOff.text(),
        Reason::LastLineCutOff.text(),
        Reason::LastLineCutOff.text(),
        Reason::FrameCutOff.text(),
    ]) {
        let mut bytes = recording.bytes();
        bytes.truncate(bytes.len() - recording.epochs[0].len() * 3 / 5);
        bench.check(recording.name, &bytes, EPOCHS - 1, reason);
    }
}

#[test]
fn mixed_line_ends() {
    let bench = Bench::new();
    for recording in all().into_iter().filter(|recording| recording.is_text) {
        let text = String::from_utf8(recording.bytes()).unwrap();
        let end = |index: usize| if index.is_multiple_of(2) { "\r\n" } else { "\n" };
        let mixed: String =
            text.lines().enumerate().map(|(index, line)| line.to_owned() + end(index)).collect();
        bench.check(recording.name, mixed.as_bytes(), EPOCHS, "");
    }
}

#[test]
fn wrong_versions_are_refused_with_what_is_read() {
    let bench = Bench::new();
    for (format, from, to) in [
        ("RINEX 2", "     2.11", "     1.00"),
        ("RINEX 3", "     3.04", "     5.01"),
        ("RINEX 3", "     3.04", "     x.yz"),
        ("Compact RINEX", "3.0                 COMPACT", "7.0                 COMPACT"),
        ("Compact RINEX", "     3.04", "     9.04"),
    ] {
        let recording = named(format);
        let text = String::from_utf8(recording.bytes()).unwrap().replacen(from, to, 1);
        let path = bench.file("wrong version", text.as_bytes());
        let error = refused(format, &path);
        assert!(error.contains("version"), "{format}: {error}");
    }
}

#[test]
fn epochs_twice_and_out_of_order() {
    let bench = Bench::new();
    for (name, twice, (back, epochs)) in [
        ("RINEX 2", Reason::EpochRepeatsTime.text(), (Reason::EpochStepsBack.text(), 11)),
        ("RINEX 3", Reason::EpochRepeatsTime.text(), (Reason::EpochStepsBack.text(), 11)),
        ("Compact RINEX", Reason::EpochRepeatsTime.text(), (Reason::EpochStepsBack.text(), 11)),
        ("GnssLogger", Reason::SignalRepeated.text(), (Reason::LineStepsBack.text(), 11)),
        ("challenge table", Reason::SignalTwice.text(), ("", 12)),
        ("spare log", Reason::EpochRepeatsTime.text(), (Reason::EpochStepsBack.text(), 11)),
        ("RTCM 3", Reason::MessageRepeated.text(), (Reason::MessageOlderThanEpoch.text(), 11)),
    ] {
        let recording = named(name);
        let mut again = recording.clone();
        again.epochs.insert(5, again.epochs[4].clone());
        bench.check(&format!("{} twice", recording.name), &again.bytes(), EPOCHS, twice);
        let mut swapped = recording.clone();
        swapped.epochs.swap(5, 6);
        bench.check(&format!("{} out of order", recording.name), &swapped.bytes(), epochs, back);
    }
}

#[test]
fn satellites_out_of_range() {
    let bench = Bench::new();
    for (recording, from, to, reason) in [
        (rinex_2(12), "G 7", "G00", Reason::UnknownSatellite.text()),
        (rinex_2(12), "G 7", "X 7", Reason::UnknownSatellite.text()),
        (rinex_3(12), "G07", "G00", Reason::UnknownSatellite.text()),
        (rinex_3(12), "G07", "?\u{7}7", Reason::UnknownSatellite.text()),
        (rinex_3(12), "G07", "E07", Reason::SystemWithoutObservationTypes.text()),
        (compact(12), "G07", "G00", Reason::UnknownSatellite.text()),
        (log(12), ",0.0,7,", ",0.0,207,", "satellite"),
        (log(12), ",0.0,7,", ",0.0,-7,", "satellite"),
        (table(12), ",1,7,", ",1,0,", Reason::SatelliteNotUsed.text()),
        (table(12), ",1,7,", ",19,7,", Reason::SatelliteNotUsed.text()),
        (spare_log(12), "\"prn\":7,", "\"prn\":0,", Reason::SatelliteIndexOfNoSatellite.text()),
        (spare_log(12), "\"prn\":7,", "\"prn\":166,", Reason::SatelliteIndexOfNoSatellite.text()),
        (spare_log(12), "\"prn\":7,", "\"prn\":-7,", Reason::SatelliteIndexOfNoSatellite.text()),
        (spare_log(12), "\"prn\":7,", "", Reason::SatelliteIndexOfNoSatellite.text()),
        (
            spare_log(12),
            "\"prn\":7,\"snr\":45.0,\"type\":\"L1C\"",
            "\"prn\":7,\"type\":\"L1I\"",
            "code of no signal",
        ),
    ] {
        let what = format!("{} '{to}'", recording.name);
        let inspection = bench.check(&what, &recording.replaced(3..5, from, to.as_bytes()), EPOCHS, reason);
        assert_eq!(inspection.constellations[0].signals[0].observations, 22, "{what}: {}", inspection.skips);
    }
    let mut stream = rtcm(12);
    stream.epochs[4] = frame(&msm4(1_074, 397_144_000, &[7, 8, 64], 74));
    bench.check("RTCM 3", &stream.bytes(), EPOCHS, Reason::ReservedSatelliteNumber.text());
}

#[test]
fn glonass_without_a_channel() {
    let bench = Bench::new();
    for (recording, reason) in all().into_iter().zip([
        "",
        "",
        "",
        Reason::DopplerWithoutCarrierFrequency.text(),
        "",
        "",
        Reason::PhaseWithoutGlonassChannel.text(),
    ]) {
        let bytes = [recording.bytes(), recording.glonass.clone()].concat();
        let inspection = bench.check(recording.name, &bytes, EPOCHS + 1, reason);
        let glonass = inspection.constellations.iter().find(|system| system.system == 'R').unwrap();
        assert_eq!(glonass.without_channel, ["R03"], "{}", recording.name);
    }
}

#[test]
fn lines_of_a_million_columns() {
    let bench = Bench::new();
    for mut recording in all() {
        let noise = vec![if recording.is_text { b'7' } else { 0xd3 }; 1_000_000];
        recording.epochs[4].extend([&noise, &b"\n"[..]].concat());
        let reason =
            if recording.is_text { Reason::LineTooLong.text() } else { Reason::ByteOutsideAnyFrame.text() };
        bench.check(recording.name, &recording.bytes(), EPOCHS, reason);
        // And one that never ends.
        let mut endless = recording.bytes();
        endless.extend(&noise);
        let reason = if recording.is_text { "line" } else { Reason::ByteOutsideAnyFrame.text() };
        bench.check(&format!("{} at the end", recording.name), &endless, EPOCHS, reason);
    }
}

#[test]
fn invalid_text() {
    let bench = Bench::new();
    for (recording, from, reason) in [
        (rinex_2(12), "22100000.000", Reason::ValueNotF14.text()),
        (rinex_3(12), "22100000.000", Reason::ValueNotF14.text()),
        (compact(12), "3&22100000000", "Hatanaka"),
        (log(12), "16431", "State"),
        (table(12), "22100000.000", Reason::ValueMissing.text()),
    ] {
        let bytes = recording.replaced(3..5, from, b"\xff\xfe\xc3\x28\xed\xa0\x80");
        bench.check(recording.name, &bytes, EPOCHS, reason);
    }
    // All of an epoch is one line.
    let bytes = spare_log(12).replaced(3..5, "22100000.000", b"\xff\xfe\xc3\x28\xed\xa0\x80");
    bench.check("spare log", &bytes, EPOCHS - 2, Reason::LineNotJson.text());
    for mut recording in all() {
        let reason = if recording.is_text { "line" } else { Reason::ByteOutsideAnyFrame.text() };
        recording.epochs[6].extend(b"\xff\xfe\xc3\x28\x80\n");
        bench.check(recording.name, &recording.bytes(), EPOCHS, reason);
    }
}

#[test]
fn absurd_values() {
    let bench = Bench::new();
    for (recording, from, to, reason) in [
        (rinex_2(12), "  22100000.000", "9999999999.999", "pseudorange"),
        (rinex_3(12), "  22100000.000", "        -1.000", "pseudorange"),
        (rinex_3(12), "     -1200.000", "9999999999.999", "Doppler"),
        (rinex_3(12), "        45.000", "       999.000", "C/N0"),
        (compact(12), "3&22100000000", "3&9223372036854775807", "Hatanaka value cannot be read"),
        (compact(12), "3&22100000000", "3&9999999999999", "pseudorange"),
        (log(12), ",45.0,", ",1e300,", Reason::Cn0OutOfRange.text()),
        (log(12), ",-190.5,", ",1e300,", Reason::DopplerOutOfRange.text()),
        (log(12), ",0.0,7,", ",nan,7,", "BiasNanos"),
        (table(12), "22100000.000", "1e30", Reason::ImpossibleValue.text()),
        (table(12), "15600000.0", "-inf", "no corrections in the row"),
        (spare_log(12), "22100000.000", "-1.0", Reason::PseudorangeOutOfRange.text()),
        (spare_log(12), "22100000.000", "\"22100000\"", Reason::ValueMissing.text()),
        (spare_log(12), "1.16E8", "-3.86E10", "phase beyond 9e9 cycles"),
        (spare_log(12), "-1200.0", "1e300", Reason::DopplerOutOfRange.text()),
        (spare_log(12), "45.0", "70.1", Reason::Cn0OutOfRange.text()),
        (spare_log(12), "\"lli\":0", "\"lli\":8", Reason::LossOfLockIndicatorOutOfRange.text()),
    ] {
        let what = format!("{} '{to}'", recording.name);
        bench.check(&what, &recording.replaced(3..5, from, to.as_bytes()), EPOCHS, reason);
    }
    let mut stream = rtcm(12);
    stream.epochs[4] = frame(&msm4(1_074, 397_144_000, &[7, 8], 1));
    bench.check("RTCM 3", &stream.bytes(), EPOCHS - 1, Reason::PseudorangeTooShort.text());
}

#[test]
fn absurd_times() {
    let bench = Bench::new();
    for (recording, from, to, reason) in [
        (rinex_2(12), " 20  8 13", " 20 13 13", Reason::LineOutsideAnyEpoch.text()),
        (rinex_2(12), " 20  8 13", " 79  8 13", Reason::EpochFarFromNext.text()),
        (rinex_3(12), "> 2020", "> 9999", Reason::EpochLineUnreadable.text()),
        (rinex_3(12), "> 2020", "> 2120", Reason::EpochFarFromNext.text()),
        (compact(12), "> 2020", "> 2120", Reason::EpochFarFromNext.text()),
        // An hour of the same day.
        (rinex_2(12), " 20  8 13 14", " 20  8 13 19", Reason::EpochFarFromNext.text()),
        (rinex_3(12), "> 2020 08 13 14", "> 2020 08 13 19", Reason::EpochFarFromNext.text()),
        (compact(12), "> 2020 08 13 14", "> 2020 08 13 19", Reason::EpochFarFromNext.text()),
        (spare_log(12), "\"hour\":14", "\"hour\":19", Reason::EpochFarFromNext.text()),
        (spare_log(12), "\"year\":2020", "\"year\":2120", Reason::EpochFarFromNext.text()),
        (spare_log(12), "\"month\":8", "\"month\":13", Reason::EpochTimeInvalid.text()),
        (spare_log(12), "\"month\":8,", "", Reason::LineLacksObservationsOrTime.text()),
    ] {
        let bytes = recording.replaced(4..5, from, to.as_bytes());
        bench.check(&format!("{} '{to}'", recording.name), &bytes, EPOCHS - 1, reason);
    }
    let mut stream = rtcm(12);
    stream.epochs[4] = frame(&msm4(1_074, 700_000_000, &[7, 8], 74));
    bench.check("RTCM 3", &stream.bytes(), EPOCHS - 1, Reason::MessageImpossibleTime.text());
    stream.epochs[4] = frame(&msm4(1_074, 450_000_000, &[7, 8], 74));
    bench.check("RTCM 3", &stream.bytes(), EPOCHS - 1, Reason::MessageFarAhead.text());
    // One line of two; the other satellite keeps the epoch.
    let bytes = log(12).replaced(4..5, "Raw,5", b"Raw,9995");
    bench.check("GnssLogger", &bytes, EPOCHS, Reason::MaskPseudorange.text());
}

#[test]
fn empty_files_and_folders_are_refused() {
    let bench = Bench::new();
    let error = refused("empty", &bench.file("empty", b""));
    assert!(error.contains("it is empty"), "{error}");
    let error = refused("folder", bench.folder.path());
    assert!(error.contains("directory"), "{error}");
    for recording in all().into_iter().filter(|recording| recording.is_text) {
        let path = bench.file("header alone", &recording.header);
        let source = Source::File { path, near: Some(near()) };
        let error = survey(&source, &Reading::default(), &Stop::default()).unwrap_err().to_string();
        assert!(error.contains("it holds no epoch"), "{}: {error}", recording.name);
    }
}

#[test]
fn archives_with_a_broken_tail() {
    let bench = Bench::new();
    for format in [rinex_2, rinex_3, compact, log, table, spare_log, rtcm] {
        let recording = format(50);
        let mut encoder = GzEncoder::new(Vec::new(), Compression::none());
        encoder.write_all(&recording.bytes()).unwrap();
        let whole = encoder.finish().unwrap();
        // The checksum is cut off; everything before it is used.
        bench.check(recording.name, &whole[..whole.len() - 4], 50, "gzip data is damaged or cut off");
        let path = bench.file("cut in the middle", &whole[..whole.len() / 2]);
        let inspection = inspect(&path, &options(), &Stop::default()).unwrap();
        let said = inspection.skips.to_string();
        assert!((20..=26).contains(&inspection.epochs), "{}: {} {said}", recording.name, inspection.epochs);
        assert!(said.contains("gzip data is damaged or cut off"), "{}: {said}", recording.name);
    }
}
