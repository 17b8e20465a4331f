//! What is in a recording: span, gaps, signals, strength, slips, clock jumps, what is skipped.

mod clock;
mod signals;
mod steps;
mod table;

use std::path::Path;

use cofix_common::decode::Record;
use cofix_common::gnss::{EpochFlag, ObservationEpoch};
use cofix_common::measurement::CorrectionOptions;
use cofix_common::skips::Skips;
use cofix_common::time::GpsTime;
use serde::Serialize;

pub use clock::{ClockJump, ClockJumps};
pub use signals::{ConstellationReport, SignalReport, Spread};
pub use steps::{Gap, Gaps};

use crate::Stop;
use crate::format::Format;
use crate::source::{self, SourceError};

/// Gaps and jumps listed one by one; the rest is counted.
const LISTED: usize = 20;

/// What a recording holds.
#[derive(Clone, Debug, Serialize)]
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
    /// Satellites per epoch.
    pub satellites_per_epoch: Option<Spread>,
    /// What was observed.
    pub constellations: Vec<ConstellationReport>,
    /// Jumps of the receiver's clock.
    pub clock_jumps: ClockJumps,
    /// Signals most of whose phases begin anew at each epoch: the receiver switches itself off in between.
    pub duty_cycled: Vec<String>,
    /// What the agent's masks would leave out, beside what is in `skips`. Elevations need orbits, and are not here.
    pub masks: Vec<Mask>,
    /// Navigation messages in the recording itself.
    pub ephemerides: u64,
    /// Whether it carries Klobuchar coefficients.
    pub ionosphere: bool,
    /// What was skipped in reading, by reason.
    pub skips: Skips,
}

/// A mask and what it would leave out.
#[derive(Clone, Debug, Serialize)]
pub struct Mask {
    /// The mask.
    pub name: String,
    /// How many observations.
    pub count: u64,
}

/// Inspects a recording, in bounded memory. `near` as in [`source::open_file`].
///
/// # Errors
/// When the file cannot be read or is of no format that is read.
pub fn inspect(path: &Path, near: Option<GpsTime>, stop: &Stop) -> Result<Inspection, SourceError> {
    let mut records = source::open_file(path, near)?;
    let mut tally = Tally::default();
    let mut ephemerides = 0;
    while let Some(record) = records.next(stop).map_err(|error| source::file_error(path, error))? {
        match record {
            Record::Epoch(epoch) => tally.epoch(&epoch),
            Record::Ephemeris(_) | Record::Glonass(_) => ephemerides += 1,
        }
    }
    let channels = records.decoder().glonass_channels();
    Ok(Inspection {
        file: path.display().to_string(),
        format: records.decoder().format(),
        ephemerides,
        ionosphere: records.decoder().ionosphere().is_some(),
        skips: records.skips(),
        ..tally.report(&channels)
    })
}

/// Everything that is counted.
#[derive(Default)]
struct Tally {
    epochs: u64,
    span: Option<(GpsTime, GpsTime)>,
    power_failures: u64,
    satellites: signals::Sum,
    steps: steps::Steps,
    signals: signals::Signals,
    clock: clock::Clock,
}

impl Tally {
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
        let minimum_cn0_dbhz = CorrectionOptions::default().minimum_cn0_dbhz;
        let (interval_s, gaps) = self.steps.report();
        Inspection {
            file: String::new(),
            format: None,
            epochs: self.epochs,
            first_gps: self.span.map(|(first, _)| first.to_string()),
            last_gps: self.span.map(|(_, last)| last.to_string()),
            span_s: self.span.map_or(0.0, |(first, last)| last - first),
            interval_s,
            gaps,
            power_failures: self.power_failures,
            satellites_per_epoch: self.satellites.spread(),
            duty_cycled: self.signals.duty_cycled(),
            masks: vec![
                Mask {
                    name: format!("C/N0 below {minimum_cn0_dbhz} dB-Hz"),
                    count: self.signals.weaker_than_mask(),
                },
                Mask { name: "no pseudorange".to_owned(), count: self.signals.without_pseudorange() },
            ],
            constellations: self.signals.report(channels),
            clock_jumps: self.clock.report(),
            ephemerides: 0,
            ionosphere: false,
            skips: Skips::default(),
        }
    }
}
