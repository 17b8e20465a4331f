//! Recordings of any format to RINEX 3.05.

mod overlap;

use std::path::{Path, PathBuf};

use cofix_common::formats::decode::Record;
use cofix_common::formats::rinex::{
    ObservationLayout, ObservationWriter, RecordingInfo, glonass_record, navigation_header, navigation_record,
};
use cofix_common::skips::{Reason, Skips};
use cofix_common::time::leap_seconds_at;
use cofix_common::time::{Calendar, GpsTime};

use crate::Stop;
use crate::clock;
use crate::files::{Named, OutputError, OutputFile, check_outputs};
use crate::source::products::{OwnNavigation, is_navigation_file, navigation_file};
use crate::source::{self, Reading, SourceError};

use self::overlap::Overlap;

/// What to write.
#[derive(Clone, Debug, Default)]
pub struct Outputs {
    /// Observation file.
    pub observations: Option<PathBuf>,
    /// Navigation file.
    pub navigation: Option<PathBuf>,
    /// Whether files that are there may be replaced.
    pub overwrite: bool,
}

/// The opened outputs. They appear when both are whole.
#[derive(Default)]
struct Opened {
    observations: Option<OutputFile>,
    navigation: Option<OutputFile>,
}

/// The result of a conversion.
#[derive(Clone, Debug, Default)]
pub struct Converted {
    /// Epochs.
    pub epochs: u64,
    /// Events between them.
    pub events: u64,
    /// Ephemerides.
    pub ephemerides: u64,
    /// Skipped in reading and in writing.
    pub skips: Skips,
}

/// Why a conversion failed.
#[derive(Debug, thiserror::Error)]
pub enum ConvertError {
    /// A source cannot be used.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// An output cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// The sources have nothing to write into an output.
    #[error("{}: nothing to write: the recordings have no {what}{}", path.display(), source::error::and_skipped(skips))]
    Nothing {
        /// The file.
        path: PathBuf,
        /// What is lacking.
        what: &'static str,
        /// What was skipped in reading.
        skips: Skips,
    },
    /// Asked to stop before the end.
    #[error("stopped before the end; nothing was written")]
    Stopped,
}

/// The result of a first reading of the recordings.
#[derive(Default)]
struct Contents {
    layout: ObservationLayout,
    navigation: OwnNavigation,
    info: RecordingInfo,
    epochs: u64,
    /// The files with observations; the others are navigation files.
    recordings: Vec<Recording>,
}

/// A file with observations, and how it is read for the second time.
struct Recording {
    path: PathBuf,
    reading: Reading,
}

/// Converts recordings and navigation files, one after the other in order of time, into one observation file and one navigation file. Each is
/// read twice, in portions: RINEX names its columns before the first epoch.
///
/// # Errors
/// When a source cannot be used, a recording holds neither an epoch nor a navigation message, an output cannot be written, or the
/// work is stopped. No output is left behind then.
pub fn convert(
    files: &[PathBuf],
    outputs: &Outputs,
    reading: &Reading,
    stop: &Stop,
) -> Result<Converted, ConvertError> {
    let mut opened = outputs.open(files)?;
    let mut converted = Converted::default();
    let mut contents = Contents::default();
    contents.info.created = now();
    for path in files {
        let skips = if is_navigation_file(path, stop) {
            contents.read_navigation(path)?
        } else {
            contents.read(path, reading, stop)?
        };
        converted.skips.merge(&skips);
    }
    if let Some(output) = &mut opened.observations {
        if contents.epochs == 0 {
            return Err(nothing(output, "epoch", converted.skips, stop));
        }
        write_observations(output, &contents, stop, &mut converted)?;
    }
    if let Some(output) = &mut opened.navigation {
        if contents.navigation.is_empty() {
            return Err(nothing(output, "navigation message", converted.skips, stop));
        }
        write_navigation(output, &contents, &mut converted)?;
    }
    if stop.is_requested() {
        return Err(ConvertError::Stopped);
    }
    for output in [opened.observations, opened.navigation].into_iter().flatten() {
        output.commit()?;
    }
    Ok(converted)
}

fn nothing(output: &OutputFile, what: &'static str, skips: Skips, stop: &Stop) -> ConvertError {
    if stop.is_requested() {
        return ConvertError::Stopped;
    }
    ConvertError::Nothing { path: output.path().to_owned(), what, skips }
}

impl Outputs {
    /// Opens the outputs, after checking that they are files of their own.
    fn open(&self, files: &[PathBuf]) -> Result<Opened, OutputError> {
        let named = |what, path: &Option<PathBuf>| path.as_deref().map(|path| Named::new(what, path));
        let observations = named("the observation file", &self.observations);
        let navigation = named("the navigation file", &self.navigation);
        let outputs: Vec<Named> = observations.iter().chain(&navigation).cloned().collect();
        let inputs: Vec<Named> = files.iter().map(|file| Named::new("a file that is read", file)).collect();
        check_outputs(&outputs, &inputs)?;
        let open = |output: Option<Named>| {
            output.map(|output| OutputFile::create(output, self.overwrite)).transpose()
        };
        Ok(Opened { observations: open(observations)?, navigation: open(navigation)? })
    }
}

impl Contents {
    fn read(&mut self, path: &Path, reading: &Reading, stop: &Stop) -> Result<Skips, SourceError> {
        let mut records = source::open_file(path, reading)?;
        let again = Reading { dates: records.dates().cloned(), ..reading.clone() };
        self.recordings.push(Recording { path: path.to_owned(), reading: again });
        let mut navigation = OwnNavigation::default();
        let epochs_before = self.epochs;
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
        let skips = records.skips();
        if self.epochs == epochs_before && navigation.is_empty() && !stop.is_requested() {
            return Err(source::error::no_epoch(&path.display().to_string(), &skips));
        }
        self.navigation.extend(navigation);
        Ok(skips)
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
    let gps = clock::now();
    let Calendar { year, month, day, hour, minute, second } = (gps - leap_seconds_at(gps) as f64).calendar();
    format!("{year:04}{month:02}{day:02} {hour:02}{minute:02}{:02.0} UTC", second.floor())
}

fn write_observations(
    output: &mut OutputFile,
    contents: &Contents,
    stop: &Stop,
    converted: &mut Converted,
) -> Result<(), ConvertError> {
    let mut writer = ObservationWriter::new(contents.layout.clone());
    let mut last: Option<GpsTime> = None;
    output.put(&writer.header(&contents.info))?;
    for Recording { path: file, reading } in &contents.recordings {
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
            output.put(&text)?;
        }
    }
    converted.skips.merge(writer.skips());
    Ok(())
}

fn write_navigation(
    output: &mut OutputFile,
    contents: &Contents,
    converted: &mut Converted,
) -> Result<(), OutputError> {
    let navigation = &contents.navigation.file;
    let leap_seconds = contents.info.leap_seconds;
    output.put(&navigation_header(&contents.info.created, &navigation.ionosphere, leap_seconds))?;
    for ephemeris in &navigation.ephemerides {
        let Some(record) = navigation_record(ephemeris) else {
            converted.skips.add(Reason::EphemerisNotWritten, || ephemeris.satellite.to_string());
            continue;
        };
        converted.ephemerides += 1;
        output.put(&record)?;
    }
    for ephemeris in &navigation.glonass {
        let Some(record) = glonass_record(ephemeris, leap_seconds) else {
            converted.skips.add(Reason::GlonassEphemerisOffQuarterHour, || {
                format!("{} at {}", ephemeris.satellite, ephemeris.toe)
            });
            continue;
        };
        converted.ephemerides += 1;
        output.put(&record)?;
    }
    Ok(())
}
