//! Recordings of any format to RINEX 3.05.

mod overlap;

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use cofix_common::decode::Record;
use cofix_common::rinex::{
    ObservationLayout, ObservationWriter, RecordingInfo, glonass_record, leap_seconds_at, navigation_header,
    navigation_record,
};
use cofix_common::skips::Skips;
use cofix_common::time::{Calendar, GpsTime};

use self::overlap::Overlap;
use crate::Stop;
use crate::products::{OwnNavigation, is_navigation_file, navigation_file};
use crate::source::{self, Reading, SourceError};

/// What to write.
#[derive(Clone, Debug, Default)]
pub struct Outputs {
    /// Observation file.
    pub observations: Option<PathBuf>,
    /// Navigation file.
    pub navigation: Option<PathBuf>,
}

/// What was written.
#[derive(Clone, Debug, Default)]
pub struct Converted {
    /// Epochs.
    pub epochs: u64,
    /// Events between them.
    pub events: u64,
    /// Ephemerides.
    pub ephemerides: u64,
    /// What was skipped in reading and in writing.
    pub skips: Skips,
}

/// Why a conversion failed.
#[derive(Debug, thiserror::Error)]
pub enum ConvertError {
    /// A source cannot be used.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// An output cannot be written.
    #[error("{}: cannot write: {cause}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        cause: io::Error,
    },
    /// An output is one of the sources.
    #[error("{}: is read and would be overwritten; name another output", .0.display())]
    Overwrites(PathBuf),
    /// The sources have nothing to write into an output.
    #[error("{}: nothing to write: the recording has no {what}", path.display())]
    Nothing {
        /// The file.
        path: PathBuf,
        /// What is lacking.
        what: &'static str,
    },
}

/// What a first reading of the recordings finds.
#[derive(Default)]
struct Contents {
    layout: ObservationLayout,
    navigation: OwnNavigation,
    info: RecordingInfo,
    epochs: u64,
    /// The files with observations; the others are navigation files.
    recordings: Vec<PathBuf>,
}

/// Converts recordings and navigation files, one after the other in order of time, into one observation file and one navigation file. Each is
/// read twice, in portions: RINEX names its columns before the first epoch.
///
/// # Errors
/// When a source cannot be used or an output cannot be written.
pub fn convert(
    files: &[PathBuf],
    outputs: &Outputs,
    reading: &Reading,
    stop: &Stop,
) -> Result<Converted, ConvertError> {
    for output in [&outputs.observations, &outputs.navigation].into_iter().flatten() {
        check_output(output, files)?;
    }
    let mut converted = Converted::default();
    let mut contents = Contents::default();
    contents.info.created = now();
    for path in files {
        let skips = if is_navigation_file(path, stop) {
            contents.read_navigation(path)?
        } else {
            contents.recordings.push(path.clone());
            contents.read(path, reading, stop)?
        };
        converted.skips.merge(&skips);
    }
    if let Some(path) = &outputs.observations {
        if contents.epochs == 0 {
            return Err(ConvertError::Nothing { path: path.clone(), what: "epoch" });
        }
        let writer = ObservationWriter::new(contents.layout.clone());
        write_observations(
            (path, &contents.recordings),
            &contents.info,
            writer,
            (reading, stop),
            &mut converted,
        )?;
    }
    if let Some(path) = &outputs.navigation {
        if contents.navigation.is_empty() {
            return Err(ConvertError::Nothing { path: path.clone(), what: "navigation message" });
        }
        write_navigation(path, &contents, &mut converted)?;
    }
    Ok(converted)
}

impl Contents {
    fn read(&mut self, path: &Path, reading: &Reading, stop: &Stop) -> Result<Skips, SourceError> {
        let mut records = source::open_file(path, reading)?;
        let mut navigation = OwnNavigation::default();
        while let Some(record) = records.next(stop).map_err(|error| source::file_error(path, error))? {
            if let Record::Event(event) = &record {
                self.layout.include_event(event);
            }
            if let Some(epoch) = navigation.take(record) {
                self.layout.include(&epoch);
                self.epochs += 1;
            }
        }
        let decoder = records.decoder();
        navigation.take_terms(decoder);
        self.info.leap_seconds = self.info.leap_seconds.or(navigation.file.leap_seconds);
        self.info.glonass_channels.extend(decoder.glonass_channels());
        // What events changed in the header is written where they stand.
        if let Some(header) = decoder.first_header() {
            if self.info.marker_name.is_empty() {
                self.info.marker_name.clone_from(&header.marker_name);
            }
            self.info.approximate_position = self.info.approximate_position.or(header.approximate_position);
        }
        self.info.equipment.fill(&decoder.equipment());
        self.info.approximate_position =
            self.info.approximate_position.or_else(|| decoder.approximate_position());
        self.navigation.extend(navigation);
        Ok(records.skips())
    }

    fn read_navigation(&mut self, path: &Path) -> Result<Skips, SourceError> {
        let file = navigation_file(path)?;
        self.info.leap_seconds = self.info.leap_seconds.or(file.leap_seconds);
        let skips = file.skips.clone();
        self.navigation.add_file(file);
        Ok(skips)
    }
}

/// The date and time for headers, UTC.
fn now() -> String {
    let gps = source::now();
    let Calendar { year, month, day, hour, minute, second } = (gps - leap_seconds_at(gps) as f64).calendar();
    format!("{year:04}{month:02}{day:02} {hour:02}{minute:02}{:02.0} UTC", second.floor())
}

fn check_output(output: &Path, files: &[PathBuf]) -> Result<(), ConvertError> {
    let Ok(there) = output.canonicalize() else { return Ok(()) };
    let is_read = files.iter().any(|file| file.canonicalize().is_ok_and(|file| file == there));
    if is_read { Err(ConvertError::Overwrites(output.to_owned())) } else { Ok(()) }
}

/// Writes a file through a function.
fn to_file(
    path: &Path,
    work: impl FnOnce(&mut dyn FnMut(&str) -> io::Result<()>) -> Result<(), ConvertError>,
) -> Result<(), ConvertError> {
    let failed = |cause| ConvertError::Write { path: path.to_owned(), cause };
    let mut file = BufWriter::new(File::create(path).map_err(failed)?);
    work(&mut |text| file.write_all(text.as_bytes()))?;
    file.flush().map_err(failed)
}

fn write_observations(
    (path, files): (&Path, &[PathBuf]),
    info: &RecordingInfo,
    mut writer: ObservationWriter,
    (reading, stop): (&Reading, &Stop),
    converted: &mut Converted,
) -> Result<(), ConvertError> {
    let failed = |cause| ConvertError::Write { path: path.to_owned(), cause };
    let mut last: Option<GpsTime> = None;
    to_file(path, |put| {
        put(&writer.header(info)).map_err(failed)?;
        for file in files {
            let mut overlap = Overlap::new(last);
            let mut records = source::open_file(file, reading)?;
            while let Some(record) = records.next(stop).map_err(|error| source::file_error(file, error))? {
                if let Some(left_out) = overlap.leaves_out(&record) {
                    converted.skips.add(left_out, || overlap::describe(&record, file));
                    continue;
                }
                let text = match &record {
                    Record::Epoch(epoch) => {
                        last = Some(epoch.time_gps);
                        converted.epochs += 1;
                        writer.epoch(epoch)
                    }
                    Record::Event(event) => {
                        let text = writer.event(event);
                        converted.events += u64::from(!text.is_empty());
                        text
                    }
                    Record::Ephemeris(_) | Record::Glonass(_) => continue,
                };
                put(&text).map_err(failed)?;
            }
        }
        Ok(())
    })?;
    converted.skips.merge(writer.skips());
    Ok(())
}

fn write_navigation(path: &Path, contents: &Contents, converted: &mut Converted) -> Result<(), ConvertError> {
    let failed = |cause| ConvertError::Write { path: path.to_owned(), cause };
    let navigation = &contents.navigation.file;
    to_file(path, |put| {
        let leap_seconds = contents.info.leap_seconds;
        put(&navigation_header(&contents.info.created, &navigation.ionosphere, leap_seconds))
            .map_err(failed)?;
        for ephemeris in &navigation.ephemerides {
            let Some(record) = navigation_record(ephemeris) else {
                converted.skips.add("ephemeris that is not written", || ephemeris.satellite.to_string());
                continue;
            };
            converted.ephemerides += 1;
            put(&record).map_err(failed)?;
        }
        for ephemeris in &navigation.glonass {
            let Some(record) = glonass_record(ephemeris, leap_seconds) else {
                converted.skips.add("GLONASS ephemeris off the quarter of an hour, not written", || {
                    format!("{} at {}", ephemeris.satellite, ephemeris.toe)
                });
                continue;
            };
            converted.ephemerides += 1;
            put(&record).map_err(failed)?;
        }
        Ok(())
    })
}
