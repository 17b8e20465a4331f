//! The content of a file: for a recording span, gaps, signals, strength, slips, clock jumps, skipped parts.

mod clock;
mod directions;
mod events;
mod navigation;
mod signals;
mod steps;
mod table;
mod trial;

use std::fmt;
use std::path::Path;

use cofix_common::formats::decode::Record;
use cofix_common::formats::format::Format;
use cofix_common::formats::phone::PhoneReport;
use cofix_common::gnss::{EpochFlag, ObservationEpoch};
use cofix_common::measurement::CorrectionOptions;
use cofix_common::pipeline::PipelineOptions;
use cofix_common::skips::Skips;
use cofix_common::time::GpsTime;
use serde::Serialize;

use crate::source::products::{Loaded, NAVIGATION, OwnNavigation, is_navigation_file};
use crate::source::{self, Reading, SourceError};
use crate::{ProductSource, Stop};

pub use clock::{ClockJump, ClockJumps};
pub use directions::DirectionReport;
pub use events::{EventReport, Events};
pub use navigation::{MessageReport, NavigationInspection, inspect_navigation};
pub use signals::{ConstellationReport, SignalReport, Spread};
pub use steps::{Gap, Gaps};
pub use trial::Trial;

/// Most gaps and jumps that are listed one by one; the rest is counted.
const LISTED: usize = 20;

/// The content of a recording.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Inspection {
    /// The file.
    pub file: String,
    /// Its format.
    pub format: Option<Format>,
    /// Epochs, in order of time.
    pub epochs: u64,
    /// First epoch, GPS time.
    pub first_gps: Option<String>,
    /// Last epoch, GPS time.
    pub last_gps: Option<String>,
    /// Seconds between them.
    pub span_s: f64,
    /// The usual step between epochs, s.
    pub interval_s: Option<f64>,
    /// Longer steps.
    pub gaps: Gaps,
    /// Epochs flagged as the first after a power failure.
    pub power_failures: u64,
    /// Events between the epochs.
    pub events: Events,
    /// Satellites per epoch.
    pub satellites_per_epoch: Option<Spread>,
    /// Signals by constellation.
    pub constellations: Vec<ConstellationReport>,
    /// Jumps of the receiver's clock.
    pub clock_jumps: ClockJumps,
    /// Signals most phases of which start with a loss of lock: the receiver switches itself off between epochs.
    pub duty_cycled: Vec<String>,
    /// Observations that the agent's masks would leave out, beside those in `skips`. Elevations need orbits: see `trial`.
    pub masks: Vec<Mask>,
    /// Navigation messages in the recording itself.
    pub ephemerides: u64,
    /// Whether it carries Klobuchar coefficients.
    pub ionosphere: bool,
    /// The phone's statements about itself, in GnssLogger text.
    pub phone: Option<PhoneReport>,
    /// Skipped in reading, by reason.
    pub skips: Skips,
    /// The result of processing the recording, when there are orbits.
    pub trial: Option<Trial>,
}

/// A mask and the observations that it would leave out.
#[derive(Clone, Debug, Serialize)]
pub struct Mask {
    /// The mask.
    pub name: String,
    /// How many observations.
    pub count: u64,
    /// Whether it excludes by name, and nothing of that name occurs.
    pub names_nothing: bool,
}

/// How a recording is inspected.
#[derive(Clone, Debug, Default)]
pub struct InspectOptions {
    /// How it is read.
    pub reading: Reading,
    /// Products, if any.
    pub products: ProductSource,
    /// How it is processed, where there are orbits.
    pub pipeline: PipelineOptions,
}

/// The content of a file of either kind.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub enum Inspected {
    /// A recording.
    Recording(Box<Inspection>),
    /// A navigation file.
    Navigation(NavigationInspection),
}

impl fmt::Display for Inspected {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Recording(inspection) => inspection.fmt(f),
            Self::Navigation(inspection) => inspection.fmt(f),
        }
    }
}

impl Inspected {
    /// Whether the file has content: an epoch, or, in a navigation file or a stream of RTCM 3 ephemerides, a message.
    ///
    /// # Errors
    /// When there is none; the error names the skipped parts.
    pub fn check(&self) -> Result<(), SourceError> {
        match self {
            Self::Recording(recording) => {
                let ephemerides = recording.format == Some(Format::Rtcm3) && recording.ephemerides > 0;
                if recording.epochs > 0 || ephemerides {
                    return Ok(());
                }
                Err(source::error::no_epoch(&recording.file, &recording.skips))
            }
            Self::Navigation(navigation) if navigation.messages.is_empty() => {
                Err(source::error::nothing_in(&navigation.file, NAVIGATION, "message", &navigation.skips))
            }
            Self::Navigation(_) => Ok(()),
        }
    }
}

/// Inspects a recording or a RINEX navigation file.
///
/// # Errors
/// When a file cannot be read or is of no kind that is read.
pub fn inspect_any(path: &Path, options: &InspectOptions, stop: &Stop) -> Result<Inspected, SourceError> {
    if is_navigation_file(path, stop) {
        return inspect_navigation(path).map(Inspected::Navigation);
    }
    inspect(path, options, stop).map(|inspection| Inspected::Recording(Box::new(inspection)))
}

/// Inspects a recording, in bounded memory. With orbits, from products or of its own, it is read a second time and processed.
///
/// # Errors
/// When a file cannot be read or is of no format that is read.
pub fn inspect(path: &Path, options: &InspectOptions, stop: &Stop) -> Result<Inspection, SourceError> {
    let loaded = Loaded::read(&options.products)?;
    let mut reading = options.reading.clone();
    reading.near = reading.near.or(loaded.near);
    let mut records = source::open_file(path, &reading)?;
    reading.dates = records.dates().cloned();
    let mut tally = Tally::new(&options.pipeline.correction);
    let mut navigation = OwnNavigation::default();
    while let Some(record) = records.next(stop).map_err(|error| source::file_error(path, error))? {
        if let Record::Event(event) = &record {
            tally.events.add(event, tally.span.map(|(_, last)| last));
        }
        if let Some(epoch) = navigation.take(record) {
            tally.epoch(&epoch);
        }
    }
    navigation.take_terms(records.decoder());
    let channels = records.decoder().glonass_channels();
    let Loaded { mut products, mut skips, .. } = loaded;
    let has_orbits = products.has_orbits() || !navigation.is_empty();
    skips.merge(&records.skips());
    let inspection = Inspection {
        file: path.display().to_string(),
        format: records.decoder().format(),
        ephemerides: (navigation.file.ephemerides.len() + navigation.file.glonass.len()) as u64,
        ionosphere: navigation.file.ionosphere.gps.is_some(),
        phone: records.decoder().phone().report(),
        skips,
        ..tally.report(&channels)
    };
    if !has_orbits {
        return Ok(inspection);
    }
    navigation.add_to(&mut products);
    let running = trial::Running::new(products, options.pipeline.clone());
    Ok(Inspection { trial: Some(trial(path, &reading, running, stop)?), ..inspection })
}

/// Runs the pipeline over a recording.
fn trial(
    path: &Path,
    reading: &Reading,
    mut running: trial::Running,
    stop: &Stop,
) -> Result<Trial, SourceError> {
    let mut records = source::open_file(path, reading)?;
    while let Some(record) = records.next(stop).map_err(|error| source::file_error(path, error))? {
        if let Record::Epoch(epoch) = record {
            running.epoch(&epoch, &records);
        }
    }
    Ok(running.end())
}

/// Counts of a recording.
#[derive(Default)]
struct Tally {
    epochs: u64,
    span: Option<(GpsTime, GpsTime)>,
    power_failures: u64,
    events: Events,
    satellites: signals::Sum,
    steps: steps::Steps,
    signals: signals::Signals,
    clock: clock::Clock,
}

impl Tally {
    fn new(masks: &CorrectionOptions) -> Self {
        Self { signals: signals::Signals::new(masks), ..Self::default() }
    }

    fn epoch(&mut self, epoch: &ObservationEpoch) {
        self.epochs += 1;
        let time = epoch.time_gps;
        let (first, last) = self.span.unwrap_or((time, time));
        if self.epochs > 1 {
            self.steps.add(last, time);
        }
        self.span = Some((first, time));
        self.power_failures += u64::from(epoch.flag == EpochFlag::PowerFailure);
        let mut satellites: Vec<_> = epoch.observations.iter().map(|o| o.satellite).collect();
        satellites.sort_unstable();
        satellites.dedup();
        self.satellites.add(satellites.len() as f64);
        self.signals.add(&epoch.observations);
        self.clock.epoch(epoch);
    }

    fn report(self, channels: &std::collections::BTreeMap<u8, i8>) -> Inspection {
        let (interval_s, gaps) = self.steps.report();
        Inspection {
            epochs: self.epochs,
            first_gps: self.span.map(|(first, _)| first.iso()),
            last_gps: self.span.map(|(_, last)| last.iso()),
            span_s: self.span.map_or(0.0, |(first, last)| last - first),
            interval_s,
            gaps,
            power_failures: self.power_failures,
            events: self.events,
            satellites_per_epoch: self.satellites.spread(),
            duty_cycled: self.signals.duty_cycled(),
            masks: self.signals.masks(),
            constellations: self.signals.report(channels),
            clock_jumps: self.clock.report(),
            ..Inspection::default()
        }
    }
}
