//! Reads an `.rrd` file message by message, as far as it goes.

use std::fs::File;
use std::io::{BufReader, Read as _, Seek as _, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use rerun::external::re_log_encoding::{CodecError, DecodeError, DecoderApp};
use rerun::external::re_log_types::{LogMsg, StoreId};
use rerun::log::Chunk;

use crate::error::SummaryError;

/// The content of a file.
pub(crate) struct Contents {
    /// Recordings in the order in which they begin; blueprints are not among them.
    pub recordings: Vec<StoreId>,
    /// Whether a blueprint is there and made active.
    pub has_layout: bool,
    /// All readable data, with the store that they belong to.
    pub chunks: Vec<(StoreId, Chunk)>,
    /// Why the file could not be read to its end.
    pub damage: Option<String>,
}

/// Reads the file.
///
/// # Errors
/// When it cannot be opened, or is no Rerun recording at all.
pub(crate) fn read(path: &Path) -> Result<Contents, SummaryError> {
    let mut file = File::open(path).map_err(|source| SummaryError::Open { path: path.to_owned(), source })?;
    let damaged_mark = damaged_end_mark(&mut file);
    let end = damaged_mark.unwrap_or(u64::MAX);
    let mut decoder = guarded(|| DecoderApp::decode_eager(BufReader::new(file.take(end))))
        .map_err(|message| SummaryError::NotARecording { path: path.to_owned(), message })?
        .map_err(|error| not_a_recording(path, &error))?;
    let mut contents =
        Contents { recordings: Vec::new(), has_layout: false, chunks: Vec::new(), damage: None };
    let mut messages = 0_usize;
    loop {
        let added = guarded(|| {
            let message = decoder.next()?.map_err(|error| error.to_string());
            Some(message.and_then(|message| contents.add(message)))
        });
        match added.transpose().map(Result::flatten) {
            None => break,
            Some(Ok(())) => messages += 1,
            Some(Err(error)) => {
                contents.damage = Some(format!("message {messages} cannot be read: {error}"));
                return Ok(contents);
            }
        }
    }
    let ends = guarded(|| decoder.rrd_manifests().is_ok_and(|manifests| !manifests.is_empty()));
    if damaged_mark.is_some() {
        contents.damage = Some(format!("the file's end mark, after message {messages}, is damaged"));
    } else if ends != Ok(true) {
        contents.damage = Some(format!("the file ends after message {messages}, without its end mark"));
    }
    Ok(contents)
}

/// Where a file's end mark begins if its number of entries is damaged: for that number the decoder would take gigabytes of memory and end the
/// program. A recording has one entry. `None` also for what is no file, as a pipe.
fn damaged_end_mark(file: &mut File) -> Option<u64> {
    const MARK: &[u8] = b"RRF2FOOT";
    let mut last = [0; 12]; // the mark and the number of entries
    let length = file.seek(SeekFrom::End(0)).ok()?;
    let start = length.checked_sub(last.len() as u64);
    let is_read = start
        .is_some_and(|start| file.seek(SeekFrom::Start(start)).is_ok() && file.read_exact(&mut last).is_ok());
    file.rewind().ok()?;
    let is_damaged = is_read && last.strip_prefix(MARK).is_some_and(|count| count != 1_u32.to_le_bytes());
    start.filter(|_| is_damaged)
}

/// Calls the decoder, which panics on some damaged files instead of returning an error.
fn guarded<T>(decode: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(decode)).map_err(|_| "the data are damaged".to_owned())
}

impl Contents {
    fn add(&mut self, message: LogMsg) -> Result<(), String> {
        match message {
            LogMsg::SetStoreInfo(info) => {
                let id = info.info.store_id;
                if id.is_recording() && !self.recordings.contains(&id) {
                    self.recordings.push(id);
                }
            }
            LogMsg::ArrowMsg(store, message) => {
                let chunk = Chunk::from_arrow_msg(&message).map_err(|error| error.to_string())?;
                self.chunks.push((store, chunk));
            }
            LogMsg::BlueprintActivationCommand(command) => self.has_layout |= command.make_active,
        }
        Ok(())
    }
}

fn not_a_recording(path: &Path, error: &DecodeError) -> SummaryError {
    let path = path.to_owned();
    match error {
        DecodeError::Read(source) => {
            SummaryError::Open { path, source: std::io::Error::new(source.kind(), source.to_string()) }
        }
        DecodeError::Codec(CodecError::OldRrdVersion) => {
            SummaryError::NotARecording { path, message: "written by an older version of Rerun".to_owned() }
        }
        DecodeError::Codec(error) => SummaryError::NotARecording { path, message: error.to_string() },
    }
}
