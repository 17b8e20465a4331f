//! Recordings of a session for the Rerun viewer: one `.rrd` file with all data and its layout.
//!
//! # Contents
//!
//! The timeline is `gps_time`: GPS time, which Rerun shows as if it were UTC, with a `Z`. Everything of a phone's own epoch is at the
//! receive time of its message, everything after fusion at the common time of the group; errors are against
//! the truth at the same instant. `<method>` is `wls`, `local`, `joint` or `truth`.
//!
//! | entity | content |
//! |---|---|
//! | `/phones/<phone>/map/<method>` | `GeoPoints`, one position per epoch; longitudes within 180° of the group's first fix |
//! | `/phones/<phone>/map/<method>/track` | `GeoLineStrings`, the whole track, static |
//! | `/phones/<phone>/enu/<method>` | `Points3D`, m east, north, up of the group's first fix |
//! | `/phones/<phone>/enu/<method>/sigma` | `Ellipsoids3D`, the 1σ surface of the position's covariance |
//! | `/phones/<phone>/enu/<method>/track` | `LineStrips3D`, the whole track, static |
//! | `/phones/<phone>/error/horizontal/<method>` | `Scalars`, m, ≥ 0 |
//! | `/phones/<phone>/error/vertical/<method>` | `Scalars`, m, positive up |
//! | `/phones/<phone>/satellites/cn0/<G07 1C>` | `Scalars`, dB-Hz |
//! | `/phones/<phone>/satellites/residual/<G07 1C>` | `Scalars`, m, observed − computed of the epoch-wise solution |
//! | `/phones/<phone>/satellites/usage/<G07 1C>` | `StateChange`, `used` or `excluded` (by RAIM), one row per change |
//! | `/phones/<phone>/quality/satellites` | `Scalars`, satellites used |
//! | `/phones/<phone>/quality/pdop` | `Scalars` |
//! | `/phones/<phone>/quality/hpl`, `…/vpl` | `Scalars`: protection levels of the epoch-wise solution, m |
//! | `/phones/<phone>/quality/fused_hpl`, `…/fused_vpl` | `Scalars`: protection levels of the fused position, m; `…/fused_vpl_below` is the negative of the latter |
//! | `/phones/<phone>/quality/code_nis`, `…/rejected` | `Scalars`: innovation of the code squared per row (1 if the model is right), measurements without weight, of the filter without constraints |
//! | `/phones/<phone>/raim` | `TextLog`, verdicts that changed or are not reliable |
//! | `/phones/<phone>/integrity/verdict/<method>` | `StateChange`, verdict on the position by `wls` or `joint`, one row per change |
//! | `/phones/<phone>/integrity/group` | `StateChange`, `with the group` or `isolated`, one row per change |
//! | `/phones/<phone>/integrity/diagram/<direction>/<method>/bounded`, `…/misleading` | `Points2D`, m, (error, −level) of reliable epochs with a truth, static; `horizontal` and `vertical`, `wls` and `joint` |
//! | `/integrity/diagram/diagonal`, `…/axes`, `…/scale` | the same for all diagrams, static |
//! | `/integrity/counts` | `TextDocument`, reliable epochs with a truth, how many the levels bound, how many mislead, static |
//! | `/integrity/log` | `TextLog`, phones isolated and taken in again, contradicted constraints, contradictions that are open |
//! | `/constraints/<constraint>/shift` | `Scalars`, m, only where the constraint acted |
//! | `/constraints/<constraint>/log` | `TextLog`, before → after |
//! | `/distances/<a>–<b>/distance`, `…/sigma` | `Scalars`, m |
//! | `/distances/<a>–<b>/minimum`, `…/maximum` | `Scalars`, m; no maximum when it is infinite |
//! | `/focus` | `Boxes3D`, invisible: around the group, followed by the eye of the 3D view |
//! | `/accuracy` | `TextDocument`, the accuracy table in Markdown, static |
//!
//! Where a value ends (a phone without an epoch, a satellite that sets), one empty row follows, so that the
//! viewer does not hold the old value. Values that are not finite are not recorded but counted.
//!
//! # Size
//!
//! Rows are collected and written as columns, a few hundred epochs at a time; whole tracks once, at the end.
//! Logging row by row is several times as large, re-logging a growing track quadratic.

mod blueprint;
mod entity;
mod focus;
mod group;
mod integrity;
mod layout;
mod phone;
mod rows;
mod rrd;
mod series;
mod signals;
mod stanford;
mod track;

use std::path::Path;
use std::time::{Duration, Instant};

use cofix_common::filter::PhoneState;
use cofix_common::frames::{Ecef, LocalFrame};
use cofix_common::fusion::engine::{FusedEpoch, FusedPhone};
use cofix_common::recording::ACCURACY;
use cofix_common::skips::{Reason, Skips};
use rerun::{RecordingInfo, TextDocument, components::MediaType};

use self::entity::palette;
use self::focus::Focus;
use self::group::GroupRecorder;
use self::layout::Shape;
use self::phone::{Epoch, PhoneRecorder, recordable};
pub use self::rrd::RecorderError;
use self::rrd::RrdFile;
use self::stanford::Claims;
use self::track::drawable;
use crate::outputs::Late;
use crate::report::scores::Reference;

/// Epochs between two writes. A crash loses at most these; fewer make a larger file.
const EPOCHS_PER_SEGMENT: usize = 512;

/// The configuration of a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecorderConfig {
    /// The group's name.
    pub group: String,
    /// The phones' names in the group's order.
    pub phones: Vec<String>,
}

/// Figures of a finished recording.
#[derive(Clone, Debug)]
pub struct Recorded {
    /// Epochs of the group.
    pub epochs: usize,
    /// Size of the file, bytes.
    pub bytes: u64,
    /// Values that were not recorded.
    pub skips: Skips,
}

/// Writes one recording. Without [`Recorder::finish`] the file lacks its last epochs, whole tracks and layout.
pub struct Recorder {
    file: RrdFile,
    config: RecorderConfig,
    phones: Vec<PhoneRecorder>,
    group: GroupRecorder,
    focus: Focus,
    frame: Option<LocalFrame>,
    span_ns: Option<(i64, i64)>,
    epochs: usize,
    /// Longest time that an epoch waits to be written.
    maximum_age: Option<Duration>,
    /// Arrival of the oldest epoch that is not written.
    unwritten_since: Option<Instant>,
    skips: Skips,
}

impl Recorder {
    /// Creates the file; an existing file is replaced.
    ///
    /// # Errors
    /// When the file cannot be created or written.
    pub fn to_file(path: &Path, config: &RecorderConfig) -> Result<Self, RecorderError> {
        let mut file = RrdFile::create(path)?;
        file.write_static(
            &rerun::EntityPath::properties(),
            &RecordingInfo::new().with_name(config.group.as_str()),
        )?;
        let phones: Vec<_> = config
            .phones
            .iter()
            .enumerate()
            .map(|(index, name)| PhoneRecorder::new(name, palette(index)))
            .collect();
        phones.iter().try_for_each(|phone| phone.write_style(&mut file))?;
        Focus::write_style(&mut file)?;
        Ok(Self {
            file,
            config: config.clone(),
            phones,
            group: GroupRecorder::new(&config.phones),
            focus: Focus::default(),
            frame: None,
            span_ns: None,
            epochs: 0,
            maximum_age: None,
            unwritten_since: None,
            skips: Skips::default(),
        })
    }

    /// Lets [`Recorder::tick`] write epochs older than `age`: for live sessions, which may end by a power cut. A smaller age makes a larger
    /// file.
    pub fn write_after(&mut self, age: Duration) {
        self.maximum_age = Some(age);
    }

    /// Writes the epochs that are due.
    ///
    /// # Errors
    /// When the file cannot be written. The recording is then incomplete.
    pub fn tick(&mut self) -> Result<(), RecorderError> {
        let age = self.unwritten_since.map(|since| since.elapsed());
        if !matches!((age, self.maximum_age), (Some(age), Some(maximum)) if age >= maximum) {
            return Ok(());
        }
        self.write_segment()?;
        self.file.flush()
    }

    /// Adds an epoch. `truth` has one entry per phone in the group's order; missing ones mean no truth.
    ///
    /// # Errors
    /// When the file cannot be written. The recording is then incomplete; the epoch is lost.
    pub fn record(&mut self, epoch: &FusedEpoch, truth: &[Reference]) -> Result<(), RecorderError> {
        let Some(time_ns) = recordable(epoch.time_gps) else {
            self.skips.add(Reason::EpochOutside1980To2233, || format!("{} ns", epoch.time_gps.nanos()));
            return Ok(());
        };
        if epoch.phones.len() != self.phones.len() {
            let (found, expected) = (epoch.phones.len(), self.phones.len());
            self.skips.add(Reason::EpochOfOtherNumberOfPhones, || {
                format!("{}: {found} phones instead of {expected}", epoch.time_gps)
            });
        }
        let frame = self.local_frame(epoch, truth);
        for event in &epoch.events {
            for phone in &event.phones {
                if let Some(phone) = self.phones.get_mut(*phone) {
                    phone.take(event);
                }
            }
        }
        for (index, (recorder, phone)) in self.phones.iter_mut().zip(&epoch.phones).enumerate() {
            let message_time = phone.message.as_ref().map_or(epoch.time_gps, |m| m.time_gps);
            let Some(message_time_ns) = recordable(message_time) else {
                self.skips.add(Reason::MessageOutside1980To2233, || {
                    format!("phone {index}: {} ns", message_time.nanos())
                });
                continue;
            };
            let at = Epoch { frame: &frame, time_ns, message_time_ns };
            let reference = truth.get(index).copied().unwrap_or_default();
            recorder.push(at, phone, reference, &mut self.skips);
        }
        self.focus.push(time_ns, &frame, &epoch.phones);
        self.group.push_actions(time_ns, &epoch.actions, &mut self.skips);
        self.group.push_distances(time_ns, &epoch.distances, &mut self.skips);
        self.group.push_events(time_ns, epoch);
        let (first, last) = self.span_ns.unwrap_or((time_ns, time_ns));
        self.span_ns = Some((first.min(time_ns), last.max(time_ns)));
        self.epochs += 1;
        self.unwritten_since.get_or_insert_with(Instant::now);
        if self.epochs.is_multiple_of(EPOCHS_PER_SEGMENT) { self.write_segment() } else { Ok(()) }
    }

    /// Adds the agent's positions of an epoch that came too late to be fused.
    pub fn record_late(&mut self, late: &Late<'_>) {
        let (Some(frame), Some(time_ns)) = (self.frame, recordable(late.message.time_gps)) else { return };
        let at = Epoch { frame: &frame, time_ns, message_time_ns: time_ns };
        if let Some(recorder) = self.phones.get_mut(late.phone) {
            recorder.push_late(at, late, &mut self.skips);
            self.unwritten_since.get_or_insert_with(Instant::now);
        }
    }

    /// Values that were not recorded so far.
    pub fn skips(&self) -> &Skips {
        &self.skips
    }

    /// Writes the remaining rows, the whole tracks, the diagrams of levels and errors, the accuracy table (Markdown) and the layout;
    /// ends the file.
    ///
    /// # Errors
    /// When the file cannot be written to its end.
    pub fn finish(mut self, accuracy: &str) -> Result<Recorded, RecorderError> {
        self.write_segment()?;
        self.phones.iter().try_for_each(|phone| phone.write_lines(&mut self.file))?;
        let table = TextDocument::new(accuracy).with_media_type(MediaType::MARKDOWN);
        self.file.write_static(&entity::path([ACCURACY]), &table)?;
        let claims: Vec<&Claims> = self.phones.iter().flat_map(PhoneRecorder::claims).collect();
        let diagram_m = stanford::write(&claims, &mut self.file)?;
        let pairs = self.group.pairs();
        let shape = Shape { phones: &self.config.phones, pairs: &pairs, span_ns: self.span_ns, diagram_m };
        self.file.write_blueprint(&layout::layout(shape))?;
        let bytes = self.file.finish()?;
        Ok(Recorded { epochs: self.epochs, bytes, skips: self.skips })
    }

    fn write_segment(&mut self) -> Result<(), RecorderError> {
        self.unwritten_since = None;
        self.phones.iter_mut().try_for_each(|phone| phone.write_segment(&mut self.file))?;
        self.focus.write_segment(&mut self.file)?;
        self.group.write_segment(&mut self.file)
    }

    /// The local frame: at the first fix of the group.
    fn local_frame(&mut self, epoch: &FusedEpoch, truth: &[Reference]) -> LocalFrame {
        if self.frame.is_none() {
            let truth = truth.iter().find_map(|t| t.at_epoch.filter(|&p| drawable(p)));
            self.frame = epoch.phones.iter().find_map(first_fix).or(truth).map(LocalFrame::at);
        }
        // Without a position there is nothing to draw, so any frame will do.
        self.frame.unwrap_or_else(|| LocalFrame::at(Ecef::new(6_378_137.0, 0.0, 0.0)))
    }
}

fn first_fix(phone: &FusedPhone) -> Option<Ecef> {
    let message = phone.message.as_ref();
    [
        phone.state.as_ref().map(PhoneState::position),
        message.and_then(|m| m.local.as_ref()).map(PhoneState::position),
        message.and_then(|m| m.wls.as_ref()).map(|s| s.position),
    ]
    .into_iter()
    .flatten()
    .find(|&position| drawable(position))
}
