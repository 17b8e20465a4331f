//! One `.rrd` file, written from the calling thread: every call returns its own failure.
//!
//! Rerun's own file sink writes in a thread of its own and only logs errors there, and its
//! recording stream keeps the time per thread. A recorder needs neither: it builds chunks and encodes them.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use cofix_common::recording::{APPLICATION_ID, TIMELINE};
use rerun::external::re_build_info::CrateVersion;
use rerun::external::re_log_encoding::{EncodeError, Encoder, EncodingOptions};
use rerun::external::re_log_types::{
    BlueprintActivationCommand, LogMsg, SetStoreInfo, StoreId, StoreInfo, StoreSource,
};
use rerun::external::re_sdk_types::SerializationError;
use rerun::log::{Chunk, ChunkError, ChunkId, RowId};
use rerun::{AsComponents, EntityPath, SerializedComponentColumn, StoreKind, TimeColumn, TimePoint};

/// Why a recording could not be written.
#[derive(Debug, thiserror::Error)]
pub enum RecorderError {
    /// The file could not be created.
    #[error("cannot create the recording {}: {source}; check that the folder exists and may be written", path.display())]
    Create {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// The file could not be written to its end.
    #[error("cannot write the recording {}: {message}; is the disk full?", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What went wrong.
        message: String,
    },
    /// A chunk of data could not be laid out.
    #[error("cannot lay out {entity} for the recording: {message}")]
    Layout {
        /// The entity's path.
        entity: String,
        /// What went wrong.
        message: String,
    },
}

impl RecorderError {
    pub(super) fn layout(entity: &EntityPath, error: &dyn std::fmt::Display) -> Self {
        Self::Layout { entity: entity.to_string(), message: error.to_string() }
    }
}

/// The file and the recording in it.
pub(super) struct RrdFile {
    path: PathBuf,
    encoder: Encoder<BufWriter<File>>,
    recording: StoreId,
}

impl RrdFile {
    /// Creates the file, with a recording id that no other file has.
    pub fn create(path: &Path) -> Result<Self, RecorderError> {
        let create = |source| RecorderError::Create { path: path.to_owned(), source };
        let file = BufWriter::new(File::create(path).map_err(create)?);
        let encoder = Encoder::new_eager(CrateVersion::LOCAL, EncodingOptions::PROTOBUF_COMPRESSED, file)
            .map_err(|error| write_error(path, &error))?;
        let recording = StoreId::random(StoreKind::Recording, APPLICATION_ID);
        let mut this = Self { path: path.to_owned(), encoder, recording };
        this.begin_store(this.recording.clone())?;
        Ok(this)
    }

    /// Writes values that hold at all times.
    pub fn write_static(
        &mut self,
        entity: &EntityPath,
        components: &dyn AsComponents,
    ) -> Result<(), RecorderError> {
        let recording = self.recording.clone();
        self.write_row(&recording, entity, TimePoint::default(), components)
    }

    /// Writes columns of values over time, one row per time.
    pub fn write_columns<I>(
        &mut self,
        entity: &EntityPath,
        times_ns: &[i64],
        columns: Result<I, SerializationError>,
    ) -> Result<(), RecorderError>
    where
        I: Iterator<Item = SerializedComponentColumn>,
    {
        let components = columns.map_err(|error| RecorderError::layout(entity, &error))?.collect();
        let time = TimeColumn::new_timestamp_nanos_since_epoch(TIMELINE, times_ns.iter().copied());
        let timelines = std::iter::once((*time.timeline().name(), time)).collect();
        let chunk = Chunk::from_auto_row_ids(ChunkId::new(), entity.clone(), timelines, components);
        let recording = self.recording.clone();
        self.write_chunk(&recording, entity, chunk)
    }

    /// Writes a blueprint: all its entities, then the command that makes it the layout in use.
    pub fn write_blueprint(
        &mut self,
        entities: &[(EntityPath, Box<dyn AsComponents>)],
    ) -> Result<(), RecorderError> {
        let blueprint = StoreId::random(StoreKind::Blueprint, APPLICATION_ID);
        self.begin_store(blueprint.clone())?;
        for (entity, components) in entities {
            let time = TimePoint::default().with(rerun::Timeline::new_sequence("blueprint"), 0);
            self.write_row(&blueprint, entity, time, components.as_ref())?;
        }
        self.append(&LogMsg::BlueprintActivationCommand(BlueprintActivationCommand::make_active(blueprint)))
    }

    /// Flushes everything to the operating system.
    pub fn flush(&mut self) -> Result<(), RecorderError> {
        let Self { path, encoder, .. } = self;
        encoder.flush_blocking().map_err(|error| write_error(path, &error))
    }

    /// Ends the file; returns its size, bytes.
    pub fn finish(mut self) -> Result<u64, RecorderError> {
        let Self { path, encoder, .. } = &mut self;
        encoder.finish().map_err(|error| write_error(path, &error))?;
        let Self { path, encoder, .. } = self;
        let buffer = encoder.into_inner().map_err(|error| write_error(&path, &error))?;
        let file = buffer.into_inner().map_err(|error| write_error(&path, error.error()))?;
        file.sync_all().map_err(|error| write_error(&path, &error))?;
        let metadata = file.metadata().map_err(|error| write_error(&path, &error))?;
        Ok(metadata.len())
    }

    fn begin_store(&mut self, store_id: StoreId) -> Result<(), RecorderError> {
        let source = StoreSource::Other(format!("cofix {}", env!("CARGO_PKG_VERSION")));
        let info = StoreInfo::new(store_id, source);
        self.append(&LogMsg::SetStoreInfo(SetStoreInfo { row_id: *RowId::new(), info }))
    }

    fn write_row(
        &mut self,
        store: &StoreId,
        entity: &EntityPath,
        time: TimePoint,
        components: &dyn AsComponents,
    ) -> Result<(), RecorderError> {
        let chunk = Chunk::builder(entity.clone()).with_archetype(RowId::new(), time, components).build();
        self.write_chunk(store, entity, chunk)
    }

    fn write_chunk(
        &mut self,
        store: &StoreId,
        entity: &EntityPath,
        chunk: Result<Chunk, ChunkError>,
    ) -> Result<(), RecorderError> {
        let message = chunk
            .and_then(|chunk| chunk.to_arrow_msg())
            .map_err(|error| RecorderError::layout(entity, &error))?;
        self.append(&LogMsg::ArrowMsg(store.clone(), message))
    }

    fn append(&mut self, message: &LogMsg) -> Result<(), RecorderError> {
        let Self { path, encoder, .. } = self;
        encoder.append(message).map(drop).map_err(|error: EncodeError| write_error(path, &error))
    }
}

fn write_error(path: &Path, error: &dyn std::fmt::Display) -> RecorderError {
    RecorderError::Write { path: path.to_owned(), message: error.to_string() }
}
