//! The group's part of a recording: constraints that acted, distances with their bounds, events of integrity.

use std::collections::BTreeMap;

use cofix_common::constraint::{ConstraintAction, ConstraintOutcome};
use cofix_common::fusion::engine::{FusedEpoch, PairDistance};
use cofix_common::fusion::peers::EventKind;
use cofix_common::recording::{CONSTRAINTS, DISTANCES, INTEGRITY, LOG};
use cofix_common::skips::Skips;
use rerun::{Color, TextLogLevel};

use super::entity::{Method, bound_colour, pair_name, palette, path};
use super::rrd::{RecorderError, RrdFile};
use super::series::{LogLines, Series, Style};
use crate::report::{EventReport, label};

/// One constraint's actions.
#[derive(Debug)]
struct Actions {
    shift: Series,
    log: LogLines,
}

/// One pair's distance.
#[derive(Debug)]
struct PairSeries {
    distance: Series,
    sigma: Series,
    minimum: Series,
    maximum: Series,
}

/// The group's part of a recording.
#[derive(Debug)]
pub(super) struct GroupRecorder {
    phones: Vec<String>,
    actions: BTreeMap<String, Actions>,
    distances: BTreeMap<(usize, usize), PairSeries>,
    events: LogLines,
}

impl Actions {
    fn new(name: &str, colour: Color) -> Self {
        let style = Style::Marks { name: name.to_owned(), colour };
        Self {
            shift: Series::new(path([CONSTRAINTS, name, "shift"]), style),
            log: LogLines::new(path([CONSTRAINTS, name, LOG])),
        }
    }
}

impl PairSeries {
    fn new(pair: &str, colour: Color) -> Self {
        let entity = |what| path([DISTANCES, pair, what]);
        let line = |what: &str, colour, width| Style::Line { name: format!("{pair}{what}"), colour, width };
        Self {
            distance: Series::new(entity("distance"), line("", colour, 1.5)),
            sigma: Series::new(entity("sigma"), line(" 1σ", Method::Wls.colour(), 1.0)),
            minimum: Series::new(entity("minimum"), line(" minimum", bound_colour(), 1.0)),
            maximum: Series::new(entity("maximum"), line(" maximum", bound_colour(), 1.0)),
        }
    }

    fn push(&mut self, time_ns: i64, pair: &PairDistance, skips: &mut Skips) {
        self.distance.push(time_ns, Some(pair.distance_m), skips);
        self.sigma.push(time_ns, Some(pair.sigma_m), skips);
        self.minimum.push(time_ns, Some(pair.minimum_m), skips);
        // No upper bound is a bound at infinity: nothing to draw, and nothing wrong.
        let maximum = (pair.maximum_m != f64::INFINITY).then_some(pair.maximum_m);
        self.maximum.push(time_ns, maximum, skips);
    }
}

impl GroupRecorder {
    pub fn new(phones: &[String]) -> Self {
        Self {
            phones: phones.to_vec(),
            actions: BTreeMap::new(),
            distances: BTreeMap::new(),
            events: LogLines::new(path([INTEGRITY, LOG])),
        }
    }

    pub fn push_events(&mut self, time_ns: i64, epoch: &FusedEpoch) {
        for event in &epoch.events {
            let level = match event.kind {
                EventKind::Isolated => TextLogLevel::ERROR,
                EventKind::ConstraintContradicted | EventKind::CannotTell => TextLogLevel::WARN,
                EventKind::Readmitted => TextLogLevel::INFO,
            };
            self.events.push(time_ns, level, &EventReport::of(event, epoch, &self.phones).detail);
        }
    }

    pub fn push_actions(&mut self, time_ns: i64, actions: &[ConstraintAction], skips: &mut Skips) {
        for action in actions {
            let name = label(&action.constraint, &self.phones);
            let change = action.constraint.unit().change(action.before, action.after);
            let (level, text) = match (action.outcome, action.enlargements) {
                (ConstraintOutcome::Skipped(reason), _) => {
                    (TextLogLevel::WARN, format!("{name}: not applied ({reason:?}), {change}"))
                }
                (_, 0) => (TextLogLevel::INFO, format!("{name}: {change}, moved by {:.3} m", action.shift_m)),
                (_, count) => {
                    let moved_m = action.shift_m;
                    let text =
                        format!("{name}: {change}, moved by {moved_m:.3} m, interval enlarged {count} times");
                    (TextLogLevel::WARN, text)
                }
            };
            let colour = palette(self.actions.len());
            let series = self.actions.entry(name).or_insert_with_key(|name| Actions::new(name, colour));
            series.shift.push(time_ns, Some(action.shift_m), skips);
            series.log.push(time_ns, level, &text);
        }
    }

    pub fn push_distances(&mut self, time_ns: i64, distances: &[PairDistance], skips: &mut Skips) {
        for pair in distances {
            let name = pair_name(&self.name(pair.phones.0), &self.name(pair.phones.1));
            let colour = palette(self.distances.len());
            let series = self.distances.entry(pair.phones).or_insert_with(|| PairSeries::new(&name, colour));
            series.push(time_ns, pair, skips);
        }
    }

    pub fn write_segment(&mut self, file: &mut RrdFile) -> Result<(), RecorderError> {
        for actions in self.actions.values_mut() {
            actions.shift.write_segment(file)?;
            actions.log.write_segment(file)?;
        }
        for distance in self.distances.values_mut() {
            distance.distance.write_segment(file)?;
            distance.sigma.write_segment(file)?;
            distance.minimum.write_segment(file)?;
            distance.maximum.write_segment(file)?;
        }
        self.events.write_segment(file)
    }

    /// Names of all pairs so far.
    pub fn pairs(&self) -> Vec<String> {
        self.distances.keys().map(|&(a, b)| pair_name(&self.name(a), &self.name(b))).collect()
    }

    fn name(&self, phone: usize) -> String {
        self.phones.get(phone).cloned().unwrap_or_else(|| format!("phone {phone}"))
    }
}
