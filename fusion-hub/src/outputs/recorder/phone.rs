//! A phone's part of a recording.

use cofix_common::frames::{Ecef, LocalFrame};
use cofix_common::fusion::engine::FusedPhone;
use cofix_common::fusion::peers::IntegrityEvent;
use cofix_common::integrity::{Cause, RaimReport, Verdict};
use cofix_common::recording::{ERROR, HORIZONTAL, LEVELS, QUALITY, VERTICAL};
use cofix_common::skips::{Reason, Skips};
use cofix_common::time::GpsTime;
use cofix_common::wire::EpochMessage;
use nalgebra::Matrix3;
use rerun::{Color, TextLogLevel};

use super::entity::{Method, phone_path};
use super::integrity::{PhoneIntegrity, Said};
use super::rrd::{RecorderError, RrdFile};
use super::series::{LogLines, Series, Style};
use super::signals::Signals;
use super::stanford::Claims;
use super::track::{Ellipsoid, Track, drawable, ellipsoid};
use crate::outputs::Late;
use crate::report::scores::Reference;

/// The frame and the times at which a phone's epoch is recorded.
#[derive(Clone, Copy)]
pub(super) struct Epoch<'a> {
    /// Local frame of the recording.
    pub frame: &'a LocalFrame,
    /// The common time.
    pub time_ns: i64,
    /// The receive time of the phone's message, or the common time without one.
    pub message_time_ns: i64,
}

/// A position with its covariance, ECEF.
struct Estimate {
    position: Ecef,
    covariance_m2: Matrix3<f64>,
}

/// Errors of one method.
#[derive(Debug)]
struct Errors {
    horizontal: Series,
    vertical: Series,
}

/// The epoch-wise position of an agent and that of its filter, each with its covariance.
fn own_estimates(message: &EpochMessage) -> [Option<(Ecef, Matrix3<f64>)>; 2] {
    [
        message.wls.as_ref().map(|s| (s.position, s.position_covariance)),
        message.local.as_ref().map(|s| (s.position(), position_covariance(s))),
    ]
}

/// One phone's part of a recording.
#[derive(Debug)]
pub(super) struct PhoneRecorder {
    name: String,
    tracks: [Track; 4],
    errors: [Errors; 3],
    satellites: Series,
    pdop: Series,
    /// Normalised innovation squared of the code per row.
    code_nis: Series,
    /// Protection levels of the epoch-wise solution, m.
    levels: [Series; 2],
    /// Measurements whose innovation left them without weight.
    rejected: Series,
    signals: Signals,
    raim: LogLines,
    last_verdict: Option<Verdict>,
    integrity: PhoneIntegrity,
}

impl PhoneRecorder {
    /// `colour` is for plots that show all phones.
    pub fn new(name: &str, colour: Color) -> Self {
        let quality = |what: &str| {
            let style = Style::Line { name: name.to_owned(), colour, width: 1.5 };
            Series::new(phone_path(name, [QUALITY, what]), style)
        };
        Self {
            name: name.to_owned(),
            tracks: Method::ALL.map(|method| Track::new(name, method)),
            errors: Method::SCORED.map(|method| Errors::new(name, method)),
            satellites: quality("satellites"),
            pdop: quality("pdop"),
            code_nis: quality("code_nis"),
            levels: LEVELS.map(quality),
            rejected: quality("rejected"),
            signals: Signals::new(name),
            raim: LogLines::new(phone_path(name, ["raim"])),
            last_verdict: None,
            integrity: PhoneIntegrity::new(name),
        }
    }

    /// Writes static data.
    pub fn write_style(&self, file: &mut RrdFile) -> Result<(), RecorderError> {
        self.tracks.iter().try_for_each(|track| track.write_style(file))
    }

    /// Adds an epoch.
    pub fn push(&mut self, epoch: Epoch<'_>, phone: &FusedPhone, reference: Reference, skips: &mut Skips) {
        let message = phone.message.as_ref();
        let [wls, local] = message.map_or([None, None], own_estimates);
        let estimates = [wls, local, phone.state.as_ref().map(|s| (s.position(), position_covariance(s)))];
        let mut errors_m = [None; 3];
        for ((index, estimate), error_m) in estimates.into_iter().enumerate().zip(&mut errors_m) {
            let estimate = estimate.map(|(position, covariance_m2)| Estimate { position, covariance_m2 });
            *error_m = self.push_estimate(epoch, index, estimate, reference, skips);
        }
        self.push_integrity(epoch, phone, errors_m, skips);
        let truth = self.drawable(reference.at_epoch, Method::Truth, epoch.time_ns, skips);
        if let Some(track) = self.tracks.last_mut() {
            track.push(epoch.time_ns, epoch.frame, truth, None);
        }
        let update = phone.update;
        let rejected =
            update.map(|u| (u.codes.offered - u.codes.kept + u.rates.offered - u.rates.kept) as f64);
        self.code_nis.push(epoch.message_time_ns, update.and_then(|u| u.code_nis_per_row()), skips);
        self.rejected.push(epoch.message_time_ns, rejected, skips);
        self.push_message(epoch.message_time_ns, message, skips);
    }

    /// Adds the agent's positions of an epoch that came too late to be fused, each beside the track's lines.
    pub fn push_late(&mut self, epoch: Epoch<'_>, late: &Late<'_>, skips: &mut Skips) {
        let reference = Reference { at_message: late.truth, at_epoch: late.truth };
        for (index, estimate) in own_estimates(late.message).into_iter().enumerate() {
            let Some((position, covariance_m2)) = estimate else { continue };
            self.tracks.get_mut(index).into_iter().for_each(Track::break_off);
            self.push_estimate(epoch, index, Some(Estimate { position, covariance_m2 }), reference, skips);
            self.tracks.get_mut(index).into_iter().for_each(Track::break_off);
        }
    }

    /// Takes an event of the group that is about this phone.
    pub fn take(&mut self, event: &IntegrityEvent) {
        self.integrity.take(event);
    }

    /// What was claimed of the phone's reliable positions.
    pub const fn claims(&self) -> &[Claims] {
        self.integrity.claims()
    }

    /// Returns the horizontal and the vertical error, m, where the truth is known.
    fn push_estimate(
        &mut self,
        epoch: Epoch<'_>,
        index: usize,
        estimate: Option<Estimate>,
        reference: Reference,
        skips: &mut Skips,
    ) -> Option<(f64, f64)> {
        let &method = Method::SCORED.get(index)?;
        let (time_ns, truth) = match method {
            Method::Joint | Method::Truth => (epoch.time_ns, reference.at_epoch),
            Method::Wls | Method::Local => (epoch.message_time_ns, reference.at_message),
        };
        let position = self.drawable(estimate.as_ref().map(|e| e.position), method, time_ns, skips);
        let sigma = position.and(estimate).and_then(|e| self.sigma(epoch, method, &e, skips));
        let error = position.zip(truth.filter(|&t| drawable(t))).map(|(position, truth)| {
            let error = LocalFrame::at(truth).ecef_to_enu(position);
            (error.horizontal(), error.up)
        });
        if let Some(errors) = self.errors.get_mut(index) {
            errors.horizontal.push(time_ns, error.map(|e| e.0), skips);
            errors.vertical.push(time_ns, error.map(|e| e.1), skips);
        }
        if let Some(track) = self.tracks.get_mut(index) {
            track.push(time_ns, epoch.frame, position, sigma);
        }
        error
    }

    /// `errors_m` are horizontal and vertical, by method.
    fn push_integrity(
        &mut self,
        epoch: Epoch<'_>,
        phone: &FusedPhone,
        errors_m: [Option<(f64, f64)>; 3],
        skips: &mut Skips,
    ) {
        self.integrity.push_fused(epoch.time_ns, phone, skips);
        let message = phone.message.as_ref();
        let solved = message.filter(|message| message.wls.is_some());
        let [epoch_wise_m, _, fused_m] = errors_m;
        let epoch_wise = Said {
            verdict: solved.map(|message| message.raim.verdict),
            levels: solved.and_then(|message| message.raim.protection),
            error_m: epoch_wise_m,
        };
        let fused = Said {
            verdict: phone.verdict.filter(|_| phone.state.is_some()),
            levels: phone.protection,
            error_m: fused_m,
        };
        self.integrity.push_said(epoch.message_time_ns, Method::Wls, epoch_wise);
        self.integrity.push_said(epoch.time_ns, Method::Joint, fused);
    }

    fn push_message(&mut self, time_ns: i64, message: Option<&EpochMessage>, skips: &mut Skips) {
        let observations = message.map_or(&[][..], |m| &m.observations);
        self.signals.push(time_ns, observations, skips);
        self.satellites.push(time_ns, message.map(|m| m.satellites_used() as f64), skips);
        self.pdop.push(time_ns, message.and_then(|m| m.wls.as_ref()).map(|s| s.dops.pdop), skips);
        let protection = message.and_then(|m| m.raim.protection);
        let values =
            [protection.map(|levels| levels.horizontal_m), protection.map(|levels| levels.vertical_m)];
        for (series, value) in self.levels.iter_mut().zip(values) {
            series.push(time_ns, value, skips);
        }
        let Some(raim) = message.map(|m| m.raim) else { return };
        if raim.verdict != Verdict::Reliable || self.last_verdict != Some(raim.verdict) {
            self.raim.push(time_ns, level(raim.verdict), &describe(&self.name, &raim));
        }
        self.last_verdict = Some(raim.verdict);
    }

    /// Writes the rows since the last call.
    pub fn write_segment(&mut self, file: &mut RrdFile) -> Result<(), RecorderError> {
        self.tracks.iter_mut().try_for_each(|track| track.write_segment(file))?;
        for errors in &mut self.errors {
            errors.horizontal.write_segment(file)?;
            errors.vertical.write_segment(file)?;
        }
        self.satellites.write_segment(file)?;
        self.pdop.write_segment(file)?;
        self.code_nis.write_segment(file)?;
        self.levels.iter_mut().try_for_each(|series| series.write_segment(file))?;
        self.rejected.write_segment(file)?;
        self.raim.write_segment(file)?;
        self.integrity.write_segment(file)?;
        self.signals.write_segment(file)
    }

    /// Writes the whole tracks.
    pub fn write_lines(&self, file: &mut RrdFile) -> Result<(), RecorderError> {
        self.tracks.iter().try_for_each(|track| track.write_lines(file))
    }

    fn drawable(
        &self,
        position: Option<Ecef>,
        method: Method,
        time_ns: i64,
        skips: &mut Skips,
    ) -> Option<Ecef> {
        let position = position?;
        if !drawable(position) {
            let name = method.name();
            skips.add(Reason::PositionNotRecorded, || {
                let [x, y, z]: [f64; 3] = position.0.into();
                format!("{} {name} at {time_ns} ns: ({x}, {y}, {z}) m", self.name)
            });
            return None;
        }
        Some(position)
    }

    fn sigma(
        &self,
        epoch: Epoch<'_>,
        method: Method,
        estimate: &Estimate,
        skips: &mut Skips,
    ) -> Option<Ellipsoid> {
        let sigma = ellipsoid(epoch.frame, &estimate.covariance_m2);
        if sigma.is_none() {
            let (name, time_ns) = (method.name(), epoch.time_ns);
            skips.add(Reason::CovarianceNotRecorded, || {
                format!(
                    "{} {name} at {time_ns} ns: diagonal {:?} m²",
                    self.name,
                    estimate.covariance_m2.diagonal()
                )
            });
        }
        sigma
    }
}

impl Errors {
    fn new(phone: &str, method: Method) -> Self {
        let series = |direction: &str| {
            let (colour, width) = (method.colour(), method.width());
            let style = Style::Line { name: format!("{phone} {}", method.name()), colour, width };
            Series::new(phone_path(phone, [ERROR, direction, method.name()]), style)
        };
        Self { horizontal: series(HORIZONTAL), vertical: series(VERTICAL) }
    }
}

fn position_covariance(state: &cofix_common::filter::PhoneState) -> Matrix3<f64> {
    state.covariance.fixed_view::<3, 3>(0, 0).into_owned()
}

const fn level(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Reliable => TextLogLevel::INFO,
        Verdict::CannotBeChecked
        | Verdict::Unreliable(Cause::Geometry | Cause::AlarmLimit | Cause::Constraint) => TextLogLevel::WARN,
        Verdict::Unreliable(
            Cause::InsufficientRedundancy
            | Cause::Peers
            | Cause::TestsFailed
            | Cause::Inseparable
            | Cause::Tie
            | Cause::SearchLimit,
        ) => TextLogLevel::ERROR,
    }
}

fn describe(phone: &str, raim: &RaimReport) -> String {
    let test = raim.global_test.map_or_else(String::new, |test| {
        let relation = if test.passes() { "≤" } else { ">" };
        let (statistic, threshold, dof) = (test.statistic, test.threshold, test.degrees_of_freedom);
        format!("; D {statistic:.1} {relation} {threshold:.1}, {dof} dof")
    });
    let excluded = match raim.excluded {
        0 => String::new(),
        count => format!("; {count} excluded"),
    };
    let levels = raim.protection.map_or_else(String::new, |levels| {
        format!("; HPL {:.1} m, VPL {:.1} m", levels.horizontal_m, levels.vertical_m)
    });
    let velocity = match raim.velocity {
        Some(velocity) if matches!(velocity.verdict, Verdict::Unreliable(_)) => "; velocity unreliable",
        _ => "",
    };
    format!("{phone}: {}{test}{excluded}{levels}{velocity}", raim.verdict)
}

/// A time that a recording can hold: from GPS time's start into the 23rd century.
pub(super) fn recordable(time: GpsTime) -> Option<i64> {
    (0..8_000_000_000_000_000_000).contains(&time.nanos()).then(|| time.as_unix_calendar_nanos())
}
