//! How fast each format is read, in bytes per second, from memory to records.
//!
//! Uses recordings beside the repository; what is not there is named and left out.
#![allow(clippy::unwrap_used, missing_docs)]

use cofix_common::decode::Decoder;
use cofix_common::gnsslogger::{GnssLoggerDecoder, Options};
use cofix_common::gsdc::DerivedFile;
use cofix_common::orbit::Sp3;
use cofix_common::rinex::{NavigationFile, ObservationFile, decompress};
use cofix_common::rtcm::{RtcmDecoder, RtcmOptions};
use cofix_common::time::GpsTime;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};

const SHARED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared");

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

fn parsing(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("parsing");
    group.sample_size(20);
    for (name, path, read) in CASES {
        let Ok(packed) = std::fs::read(format!("{SHARED}/{path}")) else {
            println!("{name}: left out, {path} is not here");
            continue;
        };
        let bytes = decompress(&packed).unwrap();
        group.throughput(Throughput::Bytes(bytes.len() as u64));
        group.bench_function(name, |b| b.iter(|| read(&bytes)));
    }
    group.finish();
}

criterion_group!(benches, parsing);
criterion_main!(benches);
