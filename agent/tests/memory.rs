//! A long recording takes no more memory than a short one.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

mod recordings;

use std::path::Path;

use cofix_agent::convert::{Outputs, convert};
use cofix_agent::inspect::{InspectOptions, inspect};
use cofix_agent::source::{Reading, survey};
use cofix_agent::{Source, Stop};
use cofix_common::time::GpsTime;
use peak_alloc::PeakAlloc;

use recordings::{Recording, compact, log, rinex_2, rinex_3, rtcm, table};

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

const SHORT: i64 = 2_000;
const LONG: i64 = 20_000;
/// A long recording may take so much more, bytes. Four bytes for each epoch would be more than this.
const MORE: usize = 64 * 1_024;

/// The largest memory in use while `work` runs, beyond what was in use before.
fn peak(work: impl FnOnce()) -> usize {
    let before = MEMORY.current_usage();
    MEMORY.reset_peak_usage();
    work();
    MEMORY.peak_usage() - before
}

fn file(folder: &Path, recording: &Recording) -> std::path::PathBuf {
    let path = folder.join(recording.name.replace(' ', "-"));
    let phone = "Fix,GPS,37.4,-122.1,30.5,1.5,4.0,1597328340000\n\
                 Status,,2,0,1,5,1575420030,35.5,192.5,31.5,1,1,1,31\n\
                 Status,,2,1,6,11,,,10.5,5.25,0,1,0,\n";
    let own = if recording.name == "GnssLogger" { phone } else { "" };
    let epochs =
        recording.epochs.iter().flat_map(|epoch| [epoch.as_slice(), own.as_bytes()]).collect::<Vec<_>>();
    std::fs::write(&path, [recording.header.as_slice(), &epochs.concat()].concat()).unwrap();
    path
}

/// Peaks of inspection, survey and conversion of a recording.
fn peaks(format: fn(i64) -> Recording, epochs: i64) -> [usize; 3] {
    let folder = tempfile::tempdir().unwrap();
    let path = file(folder.path(), &format(epochs));
    let near: GpsTime = "2020-08-13T14:00:00".parse().unwrap();
    let reading = Reading { near: Some(near), ..Reading::default() };
    let options = InspectOptions { reading: reading.clone(), ..InspectOptions::default() };
    let stop = Stop::default();
    let count = u64::try_from(epochs).unwrap();
    let source = Source::File { path: path.clone(), near: Some(near) };
    let outputs = Outputs { observations: Some(folder.path().join("out.rnx")), ..Outputs::default() };
    let converted = || convert(std::slice::from_ref(&path), &outputs, &reading, &stop).unwrap().epochs;
    [
        peak(|| assert_eq!(inspect(&path, &options, &stop).unwrap().epochs, count)),
        peak(|| assert_eq!(survey(&source, &reading, &stop).unwrap().epochs, count)),
        peak(|| assert_eq!(converted(), count)),
    ]
}

/// One test, because all threads share the memory that is measured.
#[test]
fn memory_does_not_grow_with_the_recording() {
    for format in [rinex_2, rinex_3, compact, log, table, rtcm] {
        let (short, long) = (peaks(format, SHORT), peaks(format, LONG));
        let name = format(0).name;
        for ((what, short), long) in ["inspect", "survey", "convert"].into_iter().zip(short).zip(long) {
            assert!(
                long <= short + MORE,
                "{what} {name}: {short} bytes for {SHORT} epochs, {long} for {LONG}"
            );
        }
    }
}
