//! Files that are read whole.

use std::io::{Read, Write};

use cofix_common::accuracy::Truth;
use cofix_common::formats::gsdc::ground_truth;
use cofix_common::formats::packing::{MAX_DECOMPRESSED_BYTES, Packing, decompress};
use cofix_common::formats::rinex::NavigationDecoder;
use cofix_common::formats::truth::{nmea, recognise, rtklib_pos};
use cofix_common::formats::whu::truth_table;
use cofix_common::orbit::NavigationFile;
use cofix_common::orbit::{Products, Sp3};
use flate2::Compression;
use flate2::write::GzEncoder;

use crate::portions::{feed_both_ways, random_portions};
use crate::streams::near;
use crate::{checks, round_trip};

/// RINEX 2, 3 and 4 navigation.
pub fn navigation(bytes: &[u8]) {
    let stream = feed_both_ways(NavigationDecoder::default, bytes);
    checks::records(&stream.records, bytes.len());
    if checks::is_packed(bytes) {
        return;
    }
    let file = NavigationFile::parse(bytes);
    assert_eq!(file.is_ok(), stream.end.is_ok());
    let Ok(file) = file else { return };
    assert_eq!(file.ephemerides.len() + file.glonass.len(), stream.records.len());
    assert_eq!(file.skips, stream.skips);
    round_trip::navigation(&file);
    products(Vec::new(), vec![file]);
}

/// SP3-c and SP3-d.
pub fn sp3(bytes: &[u8]) {
    let Ok(file) = Sp3::parse(bytes) else { return };
    assert!(file.interval_s > 0.0 && file.interval_s.is_finite(), "{}", file.interval_s);
    assert!(!file.positions.is_empty() && file.positions.len() <= bytes.len());
    for position in &file.positions {
        let radius_m = position.position.0.norm();
        assert!((6.4e6..=1e8).contains(&radius_m), "{position:?}");
        assert!(position.clock_s.is_none_or(|clock_s| clock_s.abs() <= 1.0), "{position:?}");
        assert!((1..=99).contains(&position.satellite.number), "{position:?}");
    }
    products(vec![file], Vec::new());
}

/// Whatever the products give is finite.
fn products(sp3: Vec<Sp3>, navigation: Vec<NavigationFile>) {
    let mut instants: Vec<_> = sp3
        .iter()
        .flat_map(|file| &file.positions)
        .map(|position| (position.satellite, position.time + 400.0))
        .collect();
    for file in &navigation {
        instants.extend(file.ephemerides.iter().map(|e| (e.satellite, e.toe + 600.0)));
        instants.extend(file.glonass.iter().map(|e| (e.satellite, e.toe + 600.0)));
    }
    instants.truncate(200);
    let products = Products::new(sp3, navigation);
    for (satellite, time) in instants {
        if let Ok(state) = products.satellite_state(satellite, time) {
            checks::finite(&state, &(satellite, time));
        }
    }
}

/// Ground truth of the challenge, truth tables of the WHU-Smartphone dataset, solutions of RTKLIB, NMEA, and our own table.
pub fn truth(bytes: &[u8]) {
    let by_content = recognise(bytes);
    by_content.needs_date(bytes);
    let readers = [
        by_content.read(bytes, near()),
        ground_truth(bytes),
        truth_table(bytes, near()),
        rtklib_pos::read(bytes),
        nmea::read(bytes, near()),
        Truth::parse_csv(bytes),
    ];
    for parsed in readers {
        let Ok((truth, _)) = parsed else { continue };
        let Some((first, last)) = truth.span() else { continue };
        assert!(first <= last && truth.interval_s().is_finite());
        let qualities: Vec<u8> = (0..=u8::MAX).collect();
        let rows: Vec<_> = truth.times(&qualities).take(100).collect();
        for time in rows {
            for offset_s in [0.0, 0.3, -0.05] {
                let Some(point) = truth.at(time + offset_s, &qualities) else { continue };
                assert!(
                    point.position.is_finite() && point.velocity.is_finite(),
                    "{time} + {offset_s}: {point:?}"
                );
            }
        }
    }
}

/// Compressed files, gzip and `compress`: what is compressed comes back, however it is read, what is not passes, what is
/// damaged is an error.
pub fn gzip(bytes: &[u8]) {
    match Packing::of(bytes) {
        None => assert_eq!(decompress(bytes).as_deref(), Ok(bytes)),
        Some(packing) => expanded_both_ways(packing, bytes),
    }
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    let compressed = encoder.write_all(bytes).and_then(|()| encoder.finish()).unwrap_or_default();
    assert_eq!(decompress(&compressed).as_deref(), Ok(bytes));
    let cut = compressed.get(..compressed.len() - 1).unwrap_or_default();
    assert!(decompress(cut).is_err(), "cut off by one byte");
    assert_eq!(decompress(&compressed_of_literals(bytes)).as_deref(), Ok(bytes));
}

/// Expands at once and in portions, which must make no difference but for how much comes out before damage.
fn expanded_both_ways(packing: Packing, bytes: &[u8]) {
    let whole = decompress(bytes);
    let (mut out, mut buffer) = (Vec::new(), [0; 37]);
    let mut expanding = packing.expand(Portions(random_portions(bytes)));
    let end = loop {
        match expanding.read(&mut buffer) {
            Ok(0) => break Ok(()),
            Ok(count) => out.extend_from_slice(buffer.get(..count).unwrap_or_default()),
            Err(error) => break Err(error),
        }
    };
    assert_eq!(whole.is_ok(), end.is_ok(), "{:?} {end:?}", whole.as_ref().err());
    assert!(out.len() as u64 <= MAX_DECOMPRESSED_BYTES);
    assert!(whole.is_err() || whole.as_deref() == Ok(&*out), "in portions and at once");
}

/// Bytes as `compress` writes them, each with a code of nine bits, and the table emptied before codes of ten come.
fn compressed_of_literals(bytes: &[u8]) -> Vec<u8> {
    /// With the code that empties the table, and padding up to a whole group of eight codes.
    const LITERALS: usize = 240;
    const CLEAR: [u16; 8] = [256, 0, 0, 0, 0, 0, 0, 0];
    let mut out = vec![0x1f, 0x9d, 0x90];
    for part in bytes.chunks(LITERALS) {
        let end = if part.len() == LITERALS { &CLEAR[..] } else { &[] };
        let codes: Vec<u16> = part.iter().map(|byte| u16::from(*byte)).chain(end.iter().copied()).collect();
        for group in codes.chunks(8) {
            let bits = group.iter().rev().fold(0_u128, |bits, code| bits << 9 | u128::from(*code));
            out.extend(bits.to_le_bytes().into_iter().take((9 * group.len()).div_ceil(8)));
        }
    }
    out
}

/// A source that gives what it has in portions.
struct Portions<'a>(Vec<&'a [u8]>);

impl Read for Portions<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let Some(first) = self.0.first_mut() else { return Ok(0) };
        let count = first.read(buffer)?;
        if first.is_empty() {
            self.0.remove(0);
        }
        Ok(count)
    }
}
