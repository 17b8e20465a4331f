//! Scalars, states and log lines of one entity over time.

use std::borrow::Cow;

use cofix_common::skips::{Reason, Skips};
use rerun::{
    Color, EntityPath, Scalars, SeriesLines, SeriesPoints, StateChange, StateConfiguration, TextLog,
};

use super::rows::{Rows, Segment};
use super::rrd::{RecorderError, RrdFile};

/// How a series of scalars is drawn.
#[derive(Clone, Debug)]
pub(super) enum Style {
    /// A line of a width in points of the screen.
    Line { name: String, colour: Color, width: f32 },
    /// A mark for each value.
    Marks { name: String, colour: Color },
}

/// Scalars of one entity. The style is written with the first segment.
#[derive(Debug)]
pub(super) struct Series {
    entity: EntityPath,
    style: Option<Style>,
    rows: Rows<f64>,
}

/// Named states of one entity, one row per change.
#[derive(Debug)]
pub(super) struct StateLane {
    entity: EntityPath,
    styled: bool,
    state: Option<Cow<'static, str>>,
    rows: Rows<Cow<'static, str>>,
}

/// Log lines of one entity.
#[derive(Debug)]
pub(super) struct LogLines {
    entity: EntityPath,
    rows: Rows<(String, &'static str)>,
}

impl Series {
    pub fn new(entity: EntityPath, style: Style) -> Self {
        Self { entity, style: Some(style), rows: Rows::default() }
    }

    /// Adds an epoch; a value that is not finite counts as none.
    pub fn push(&mut self, time_ns: i64, value: Option<f64>, skips: &mut Skips) {
        let finite = value.filter(|v| v.is_finite());
        if let (Some(value), None) = (value, finite) {
            skips.add(Reason::NotFinite, || format!("{} at {time_ns} ns: {value}", self.entity));
        }
        self.rows.push(time_ns, finite);
    }

    pub fn write_segment(&mut self, file: &mut RrdFile) -> Result<(), RecorderError> {
        let Some(Segment { times_ns, lengths, values }) = self.rows.take_segment() else { return Ok(()) };
        if let Some(style) = self.style.take() {
            write_style(file, &self.entity, &style)?;
        }
        file.write_columns(&self.entity, &times_ns, Scalars::new(values).columns(lengths))
    }
}

fn write_style(file: &mut RrdFile, entity: &EntityPath, style: &Style) -> Result<(), RecorderError> {
    match style {
        Style::Line { name, colour, width } => {
            let lines = SeriesLines::new().with_names([name.as_str()]).with_colors([*colour]);
            file.write_static(entity, &lines.with_widths([*width]))
        }
        Style::Marks { name, colour } => {
            let marks = SeriesPoints::new().with_names([name.as_str()]).with_colors([*colour]);
            file.write_static(entity, &marks.with_marker_sizes([2.5]))
        }
    }
}

impl StateLane {
    pub fn new(entity: EntityPath) -> Self {
        Self { entity, styled: false, state: None, rows: Rows::default() }
    }

    /// Adds an epoch; only changes become rows.
    pub fn push(&mut self, time_ns: i64, state: Option<Cow<'static, str>>) {
        if state != self.state {
            self.state.clone_from(&state);
            self.rows.push(time_ns, state);
        }
    }

    pub fn write_segment(
        &mut self,
        file: &mut RrdFile,
        style: &StateConfiguration,
    ) -> Result<(), RecorderError> {
        let Some(Segment { times_ns, lengths, values }) = self.rows.take_segment() else { return Ok(()) };
        if !std::mem::replace(&mut self.styled, true) {
            file.write_static(&self.entity, style)?;
        }
        let changes = StateChange::new().with_state(values.into_iter().map(Cow::into_owned));
        file.write_columns(&self.entity, &times_ns, changes.columns(lengths))
    }
}

impl LogLines {
    pub fn new(entity: EntityPath) -> Self {
        Self { entity, rows: Rows::default() }
    }

    /// Adds a line, after its time of day in GPS time; `level` is one of [`rerun::TextLogLevel`]'s.
    pub fn push(&mut self, time_ns: i64, level: &'static str, text: &str) {
        let second_of_day = time_ns.div_euclid(1_000_000_000).rem_euclid(86_400);
        let (hour, minute, second) = (second_of_day / 3_600, second_of_day / 60 % 60, second_of_day % 60);
        self.rows.push(time_ns, Some((format!("{hour:02}:{minute:02}:{second:02} GPS {text}"), level)));
    }

    pub fn write_segment(&mut self, file: &mut RrdFile) -> Result<(), RecorderError> {
        let Some(Segment { times_ns, lengths, values }) = self.rows.take_segment() else { return Ok(()) };
        let lines = TextLog::update_fields()
            .with_many_text(values.iter().map(|(text, _)| text.as_str()))
            .with_many_level(values.iter().map(|&(_, level)| level));
        file.write_columns(&self.entity, &times_ns, lines.columns(lengths))
    }
}
