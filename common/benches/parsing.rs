//! How fast each format is read, in bytes per second, from memory to records.
//!
//! Uses recordings beside the repository; what is not there is named and left out. Compact RINEX is made from one of them; clock
//! files, biases and ionosphere maps are made up.
#![allow(clippy::unwrap_used, missing_docs)]

#[path = "../tests/beside/mod.rs"]
mod beside;
#[path = "../tests/hatanaka_encoder/mod.rs"]
mod hatanaka_encoder;

use std::fmt::Write as _;

use cofix_common::atmosphere::Ionex;
use cofix_common::formats::decode::Decoder;
use cofix_common::formats::gnsslogger::{GnssLoggerDecoder, Options};
use cofix_common::formats::gsdc::DerivedFile;
use cofix_common::formats::packing::decompress;
use cofix_common::formats::rinex::ObservationFile;
use cofix_common::formats::rtcm::{RtcmDecoder, RtcmOptions};
use cofix_common::orbit::NavigationFile;
use cofix_common::orbit::{BiasFile, ClockFile, Sp3};
use cofix_common::time::GpsTime;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};

/// A format, a recording of it, and how it is read; what comes out is a number that cannot be left out.
type Case = (&'static str, &'static str, fn(&[u8]) -> usize);

const CASES: [Case; 7] = [
    ("RINEX 3 observations", "data/whu-wuhan-2020-08-13/WH-3-08/HP30.rnx", observations),
    ("RINEX 2 observations", "oracle/inputs/07590920.05o", observations),
    ("RINEX 3 navigation", "data/ESBC00DNK_R_20201770000_01D_MN.rnx.gz", navigation),
    ("SP3", "data/whu-wuhan-2020-08-13/orbits.sp3", |bytes| Sp3::parse(bytes).unwrap().positions.len()),
    ("GnssLogger text", "data/pixel6-2023/pixel6.txt", |bytes| {
        drain(GnssLoggerDecoder::new(Options::default()), bytes)
    }),
    ("RTCM 3", "data/whu-wuhan-2020-08-13/WH-3-08/MXT.rtcm3", |bytes| {
        let near = GpsTime::from_week_tow(2118, 397_000.0);
        drain(RtcmDecoder::new(RtcmOptions::near(near)), bytes)
    }),
    ("challenge table of 2021", "data/gsdc-2020-05-14-mtv1/Pixel4_processed/0.csv", |bytes| {
        DerivedFile::parse(bytes).unwrap().epochs.len()
    }),
];

fn observations(bytes: &[u8]) -> usize {
    ObservationFile::parse(bytes).unwrap().epochs.len()
}

fn navigation(bytes: &[u8]) -> usize {
    NavigationFile::parse(bytes).unwrap().ephemerides.len()
}

fn drain(mut decoder: impl Decoder, bytes: &[u8]) -> usize {
    let mut records = 0;
    for portion in bytes.chunks(64 * 1024) {
        decoder.feed(portion).unwrap();
        while decoder.next_record().is_some() {
            records += 1;
        }
    }
    decoder.finish().unwrap();
    records
}

type MadeUp = (&'static str, String, fn(&[u8]) -> usize);

fn made_up() -> [MadeUp; 3] {
    [
        ("RINEX clocks", clocks(), |bytes| ClockFile::parse(bytes).unwrap().records.len()),
        ("Bias-SINEX", biases(), |bytes| BiasFile::parse(bytes).unwrap().biases.len()),
        ("IONEX", maps(), |bytes| Ionex::parse(bytes).unwrap().maps.len()),
    ]
}

/// Two hours of 32 satellites at 30 s.
fn clocks() -> String {
    let mut text = format!("{:<60}RINEX VERSION / TYPE\n{:60}END OF HEADER\n", "     3.00           C", "");
    for second in (0..7_200).step_by(30) {
        let (hour, minute, second) = (second / 3_600, second / 60 % 60, second % 60);
        for satellite in 1..=32 {
            writeln!(
                text,
                "AS G{satellite:02}  2020 08 13 {hour:02} {minute:02} {second:2}.000000  1    1.000000000000e-04"
            )
            .unwrap();
        }
    }
    text
}

/// Ten signals of 32 satellites.
fn biases() -> String {
    let mut text = "%=BIA 1.00 TST 2020:227:30548 TST 2020:226:00000 2020:227:00000 A 00000320\n\
                    +BIAS/DESCRIPTION\nBIAS_MODE                               ABSOLUTE\n\
                    TIME_SYSTEM                             G\n-BIAS/DESCRIPTION\n+BIAS/SOLUTION\n"
        .to_owned();
    for satellite in 1..=32 {
        for code in ["C1C", "C1L", "C1W", "C1X", "C2C", "C2L", "C2W", "C2X", "C5Q", "C5X"] {
            writeln!(
                text,
                " OSB  G063 G{satellite:02}           {code}       2020:226:00000 2020:227:00000 ns   {:>20.4} {:>11.4}",
                7.4, 0.02
            )
            .unwrap();
        }
    }
    text + "-BIAS/SOLUTION\n%=ENDBIA\n"
}

/// A day of two-hourly maps of 2.5° by 5°.
fn maps() -> String {
    let labelled = |content: String, label: &str| format!("{content:<60}{label}\n");
    let mut text = labelled("     1.0            I".to_owned(), "IONEX VERSION / TYPE");
    for (content, label) in [
        ("  COSZ", "MAPPING FUNCTION"),
        ("  6371.0", "BASE RADIUS"),
        ("     2", "MAP DIMENSION"),
        ("   450.0 450.0   0.0", "HGT1 / HGT2 / DHGT"),
        ("    87.5 -87.5  -2.5", "LAT1 / LAT2 / DLAT"),
        ("  -180.0 180.0   5.0", "LON1 / LON2 / DLON"),
        ("    -1", "EXPONENT"),
        ("", "END OF HEADER"),
    ] {
        text += &labelled(content.to_owned(), label);
    }
    for map in 0..12 {
        text += &labelled(format!("{:6}", map + 1), "START OF TEC MAP");
        text += &labelled(format!("  2020     8    13{:6}     0     0", 2 * map), "EPOCH OF CURRENT MAP");
        for row in 0..71 {
            let latitude_deg = 87.5 - 2.5 * f64::from(row);
            text +=
                &labelled(format!("  {latitude_deg:6.1}-180.0 180.0   5.0 450.0"), "LAT/LON1/LON2/DLON/H");
            for line in [16, 16, 16, 16, 9] {
                text += &format!("{:>5}", 100 + row).repeat(line);
                text.push('\n');
            }
        }
        text += &labelled(format!("{:6}", map + 1), "END OF TEC MAP");
    }
    text + &labelled(String::new(), "END OF FILE")
}

fn parsing(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("parsing");
    group.sample_size(20);
    for (name, path, read) in CASES {
        let path = beside::path(path);
        let Ok(packed) = std::fs::read(&path) else {
            println!("{name}: left out, {} is missing", path.display());
            continue;
        };
        let bytes = decompress(&packed).unwrap();
        group.throughput(Throughput::Bytes(bytes.len() as u64));
        group.bench_function(name, |b| b.iter(|| read(&bytes)));
        if name == "RINEX 3 observations" {
            let compact =
                hatanaka_encoder::encode(std::str::from_utf8(&bytes).unwrap(), |_| false).into_bytes();
            group.throughput(Throughput::Bytes(compact.len() as u64));
            group.bench_function("Compact RINEX 3", |b| b.iter(|| observations(&compact)));
        }
    }
    for (name, text, read) in made_up() {
        assert!(read(text.as_bytes()) > 0, "{name} is empty");
        group.throughput(Throughput::Bytes(text.len() as u64));
        group.bench_function(name, |b| b.iter(|| read(text.as_bytes())));
    }
    group.finish();
}

criterion_group!(benches, parsing);
criterion_main!(benches);
