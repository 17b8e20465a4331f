//! Integrity in a recording, from its own rows: verdicts, protection levels against errors, events.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use cofix_common::accuracy::percentile;
use cofix_common::recording::{
    ENU, EPOCH_WISE, ERROR, FUSED, FUSED_LEVELS, HORIZONTAL, INTEGRITY, LEVELS, LOG, PHONES, QUALITY,
    TIMELINE, VERTICAL,
};
use rerun::log::Chunk;
use rerun::{ComponentIdentifier, EntityPathPart, Points3D, Scalars, StateChange, TextLog};

/// Rows by time, ns.
type Rows<T> = BTreeMap<i64, T>;

/// Positions with a verdict: epochs by kind of verdict.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Verdicts {
    /// Reliable.
    pub reliable: usize,
    /// Unreliable for any cause.
    pub unreliable: usize,
    /// Neither: they could not be checked.
    pub unchecked: usize,
}

/// Protection levels of the reliable positions of one phone by one method.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Levels {
    /// Median HPL, m; `None` without levels.
    pub hpl_p50_m: Option<f64>,
    /// Median VPL, m.
    pub vpl_p50_m: Option<f64>,
    /// Reliable positions whose error is recorded.
    pub with_truth: usize,
    /// Those whose horizontal error the HPL bounds. An epoch without a level is not bounded.
    pub bounded_horizontally: usize,
    /// Those whose vertical error the VPL bounds.
    pub bounded_vertically: usize,
    /// Those with an error beyond a level, or without levels.
    pub misleading: usize,
}

/// Integrity of one phone's positions by one method.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MethodIntegrity {
    /// Epochs by verdict.
    pub verdicts: Verdicts,
    /// Protection levels of the reliable ones.
    pub levels: Levels,
}

/// Integrity of one phone.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PhoneIntegrity {
    /// Of the fused positions.
    pub fused: MethodIntegrity,
    /// Of the epoch-wise solutions.
    pub epoch_wise: MethodIntegrity,
}

/// Integrity of a session.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Integrity {
    /// By phone.
    pub phones: BTreeMap<String, PhoneIntegrity>,
    /// The group's events in order of time, in words.
    pub events: Vec<String>,
}

/// Rows of one phone by one method.
#[derive(Debug, Default)]
struct MethodRows {
    /// Times of positions.
    positions: BTreeSet<i64>,
    /// Verdicts where they change; an empty one where there is none any more.
    verdicts: Rows<String>,
    levels_m: [Rows<f64>; 2],
    errors_m: [Rows<f64>; 2],
}

/// Rows of one phone.
#[derive(Debug, Default)]
struct PhoneRows {
    fused: MethodRows,
    epoch_wise: MethodRows,
}

/// Rows of a recording that tell of integrity.
#[derive(Debug, Default)]
pub(crate) struct IntegrityRows {
    phones: BTreeMap<String, PhoneRows>,
    events: Rows<Vec<String>>,
}

impl IntegrityRows {
    /// Takes what a chunk tells of integrity.
    pub fn add(&mut self, chunk: &Chunk) {
        let parts: Vec<&str> = chunk.entity_path().iter().map(EntityPathPart::unescaped_str).collect();
        match parts[..] {
            [INTEGRITY, LOG] => {
                for (time, text) in texts(chunk, TextLog::descriptor_text().component) {
                    self.events.entry(time).or_default().extend(text);
                }
            }
            [PHONES, phone, ref rest @ ..] => {
                self.phones.entry(phone.to_owned()).or_default().add(rest, chunk);
            }
            _ => (),
        }
    }

    /// The integrity that the rows tell.
    pub fn integrity(self) -> Integrity {
        let judged = |rows: &PhoneRows| PhoneIntegrity {
            fused: rows.fused.integrity(),
            epoch_wise: rows.epoch_wise.integrity(),
        };
        Integrity {
            phones: self.phones.iter().map(|(phone, rows)| (phone.clone(), judged(rows))).collect(),
            events: self.events.into_values().flatten().collect(),
        }
    }
}

impl PhoneRows {
    fn add(&mut self, entity: &[&str], chunk: &Chunk) {
        match *entity {
            [ENU, method] => {
                let Some(rows) = self.of(method) else { return };
                let positions = chunk.iter_slices::<[f32; 3]>(Points3D::descriptor_positions().component);
                let drawn = times(chunk).zip(positions).filter(|(_, points)| !points.is_empty());
                rows.positions.extend(drawn.map(|(time, _)| time));
            }
            [INTEGRITY, "verdict", method] => {
                let Some(rows) = self.of(method) else { return };
                let states = texts(chunk, StateChange::descriptor_state().component);
                rows.verdicts.extend(states.map(|(time, state)| (time, state.unwrap_or_default())));
            }
            [ERROR, direction, method] => {
                let direction = [HORIZONTAL, VERTICAL].iter().position(|known| *known == direction);
                let rows = self.of(method).zip(direction);
                extend(rows.and_then(|(rows, direction)| rows.errors_m.get_mut(direction)), chunk);
            }
            [QUALITY, figure] => {
                let among = |names: [&str; 2]| names.iter().position(|name| *name == figure);
                if let Some(direction) = among(LEVELS) {
                    extend(self.epoch_wise.levels_m.get_mut(direction), chunk);
                } else if let Some(direction) = among(FUSED_LEVELS) {
                    extend(self.fused.levels_m.get_mut(direction), chunk);
                }
            }
            _ => (),
        }
    }

    fn of(&mut self, method: &str) -> Option<&mut MethodRows> {
        match method {
            FUSED => Some(&mut self.fused),
            EPOCH_WISE => Some(&mut self.epoch_wise),
            _ => None,
        }
    }
}

impl MethodRows {
    fn integrity(&self) -> MethodIntegrity {
        let mut verdicts = Verdicts::default();
        let mut reliable = Vec::new();
        for time in &self.positions {
            let verdict = self.verdicts.range(..=*time).next_back().map_or("", |(_, verdict)| verdict);
            match verdict.split(':').next() {
                Some("reliable") => {
                    verdicts.reliable += 1;
                    reliable.push(*time);
                }
                Some("unreliable") => verdicts.unreliable += 1,
                Some("cannot be checked") => verdicts.unchecked += 1,
                _ => (), // no message, so nothing is said
            }
        }
        MethodIntegrity { verdicts, levels: self.levels(&reliable) }
    }

    fn levels(&self, reliable: &[i64]) -> Levels {
        let [hpl_p50_m, vpl_p50_m] =
            [0, 1].map(|d| median(reliable.iter().filter_map(|time| self.levels_m[d].get(time)).copied()));
        let mut levels = Levels { hpl_p50_m, vpl_p50_m, ..Levels::default() };
        for time in reliable {
            let Some([horizontal, vertical]) = self.are_bounded(*time) else { continue };
            levels.with_truth += 1;
            levels.bounded_horizontally += usize::from(horizontal);
            levels.bounded_vertically += usize::from(vertical);
            levels.misleading += usize::from(!(horizontal && vertical));
        }
        levels
    }

    /// Whether the levels bound the errors of a time, by direction; `None` where no error is recorded.
    fn are_bounded(&self, time: i64) -> Option<[bool; 2]> {
        let is_bounded = |direction: usize| {
            let error_m = self.errors_m[direction].get(&time)?.abs();
            Some(self.levels_m[direction].get(&time).is_some_and(|level_m| error_m <= *level_m))
        };
        Some([is_bounded(0)?, is_bounded(1)?])
    }
}

impl Integrity {
    /// Writes the section of a summary; nothing where a recording tells nothing of integrity.
    pub(crate) fn write(&self, text: &mut String) -> std::fmt::Result {
        let is_told =
            |phone: &PhoneIntegrity| phone.fused.verdicts.total() + phone.epoch_wise.verdicts.total() > 0;
        if !self.phones.values().any(is_told) {
            return Ok(());
        }
        let width = self.phones.keys().map(|name| name.chars().count()).max().unwrap_or(0).max(5);
        writeln!(text, "\nIntegrity")?;
        writeln!(
            text,
            "{:width$}  position    epochs  reliable  unreliable  cannot be checked  HPL p50 m  VPL p50 m",
            "phone"
        )?;
        for (name, method, of) in self.rows() {
            let share = |count| percent(count, of.verdicts.total(), 1);
            writeln!(
                text,
                "{name:width$}  {method:10}  {:6}  {:>8}  {:>10}  {:>17}  {:>9}  {:>9}",
                of.verdicts.total(),
                share(of.verdicts.reliable),
                share(of.verdicts.unreliable),
                share(of.verdicts.unchecked),
                metres(of.levels.hpl_p50_m),
                metres(of.levels.vpl_p50_m),
            )?;
        }
        self.write_against_truth(text, width)?;
        match self.events.len() {
            0 => writeln!(text, "\nno event of the group's integrity"),
            count => {
                let events = if count == 1 { "event" } else { "events" };
                writeln!(text, "\n{count} {events} of the group's integrity")?;
                self.events.iter().try_for_each(|event| writeln!(text, "{event}"))
            }
        }
    }

    fn write_against_truth(&self, text: &mut String, width: usize) -> std::fmt::Result {
        let scored: Vec<_> = self.rows().filter(|(_, _, of)| of.levels.with_truth > 0).collect();
        if scored.is_empty() {
            return Ok(());
        }
        writeln!(
            text,
            "\nreliable epochs whose truth is known; misleading: an error beyond its level, or without a level\n\
             {:width$}  position    epochs  HPL bounds  VPL bounds  misleading",
            "phone"
        )?;
        for (name, method, MethodIntegrity { levels, .. }) in scored {
            let share = |count| percent(count, levels.with_truth, 2);
            writeln!(
                text,
                "{name:width$}  {method:10}  {:6}  {:>10}  {:>10}  {:10}",
                levels.with_truth,
                share(levels.bounded_horizontally),
                share(levels.bounded_vertically),
                levels.misleading,
            )?;
        }
        Ok(())
    }

    /// Phone, method in words, and figures; the fused positions first.
    fn rows(&self) -> impl Iterator<Item = (&str, &'static str, MethodIntegrity)> {
        let fused = self.phones.iter().map(|(name, phone)| (name.as_str(), "fused", phone.fused));
        let own = self.phones.iter().map(|(name, phone)| (name.as_str(), "epoch-wise", phone.epoch_wise));
        fused.chain(own)
    }
}

impl Verdicts {
    /// All of them.
    pub const fn total(&self) -> usize {
        self.reliable + self.unreliable + self.unchecked
    }
}

fn percent(count: usize, of: usize, digits: usize) -> String {
    match of {
        0 => "-".to_owned(),
        of => format!("{:.digits$} %", 100.0 * count as f64 / of as f64),
    }
}

fn metres(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_owned(), |value_m| format!("{value_m:.1}"))
}

fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    (!values.is_empty()).then(|| percentile(&values, 0.5))
}

/// Times of a chunk's rows, ns; none of static data.
fn times(chunk: &Chunk) -> impl Iterator<Item = i64> {
    let column = chunk.timelines().values().find(|column| column.name() == TIMELINE);
    column.into_iter().flat_map(|column| column.times_raw().iter().copied())
}

fn texts(chunk: &Chunk, component: ComponentIdentifier) -> impl Iterator<Item = (i64, Option<String>)> {
    let texts = chunk.iter_slices::<String>(component);
    times(chunk).zip(texts.map(|row| row.first().map(|text| text.as_str().to_owned())))
}

fn extend(rows: Option<&mut Rows<f64>>, chunk: &Chunk) {
    let values = chunk.iter_slices::<f64>(Scalars::descriptor_scalars().component);
    let valued = times(chunk).zip(values).filter_map(|(time, values)| Some((time, *values.first()?)));
    if let Some(rows) = rows {
        rows.extend(valued);
    }
}
