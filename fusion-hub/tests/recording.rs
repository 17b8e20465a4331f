//! Recordings read back with Rerun's own store.

mod support;

use std::fs::File;
use std::path::Path;

use cofix_hub::recorder::{APPLICATION_ID, Recorder, RecorderError, TIMELINE};
use rerun::external::re_log_types::StoreId;
use rerun::log::Chunk;
use rerun::{ChunkStore, ChunkStoreConfig};
use support::{MESSAGE_LEAD_S, Session, start};

const SMALL: Session = Session { epochs: 20, phones: 2, satellites: 6, seed: 7 };

fn read(path: &Path) -> Vec<(StoreId, ChunkStore)> {
    let mut file = File::open(path).unwrap();
    ChunkStore::from_rrd_reader(&ChunkStoreConfig::ALL_DISABLED, &mut file).unwrap().into_iter().collect()
}

fn recording(path: &Path) -> ChunkStore {
    read(path).into_iter().find(|(id, _)| id.is_recording()).unwrap().1
}

fn chunks<'a>(store: &'a ChunkStore, entity: &str) -> Vec<&'a Chunk> {
    let path = rerun::EntityPath::from(entity);
    store.iter_physical_chunks().filter(|c| c.entity_path() == &path).map(AsRef::as_ref).collect()
}

/// Times (ns) and values of a scalar entity.
fn scalars(store: &ChunkStore, entity: &str) -> Vec<(i64, f64)> {
    let component = rerun::Scalars::descriptor_scalars().component;
    let mut rows = Vec::new();
    for chunk in chunks(store, entity) {
        let Some(times) = chunk.timelines().values().next() else { continue };
        for (&time, values) in times.times_raw().iter().zip(chunk.iter_slices::<f64>(component)) {
            rows.extend(values.first().map(|&value| (time, value)));
        }
    }
    rows
}

#[test]
fn full_session_stays_small() {
    let directory = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let path = directory.join("full-session.rrd");
    let session = Session { epochs: 640, phones: 4, satellites: 25, seed: 1 };
    let begun = std::time::Instant::now();
    let recorded = session.record(Recorder::to_file(&path, &session.config()).unwrap());
    println!("{} bytes in {:?}: {}", recorded.bytes, begun.elapsed(), path.display());
    assert_eq!(recorded.epochs, 640);
    assert!(recorded.bytes < 20_000_000, "{} bytes", recorded.bytes);
    assert!(recorded.skips.is_empty(), "{}", recorded.skips);
}
