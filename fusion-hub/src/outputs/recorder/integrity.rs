//! A phone's integrity: verdicts, protection levels of the fused position, and whether the other phones contradict it.

use cofix_common::fusion::engine::FusedPhone;
use cofix_common::fusion::peers::{EventKind, IntegrityEvent};
use cofix_common::integrity::{Cause, ProtectionLevels, Verdict};
use cofix_common::recording::{FUSED_LEVELS, INTEGRITY, QUALITY};
use cofix_common::skips::Skips;
use rerun::{Color, StateConfiguration};

use super::entity::{Method, bound_colour, phone_path};
use super::rrd::{RecorderError, RrdFile};
use super::series::{Series, StateLane, Style};
use super::stanford::Claims;

/// The methods whose positions have a verdict and protection levels.
pub(super) const JUDGED: [Method; 2] = [Method::Wls, Method::Joint];

/// Names of the states of a phone in its group.
const WITH_THE_GROUP: &str = "with the group";
const ISOLATED: &str = "isolated";

/// What is said of a position.
#[derive(Clone, Copy, Debug)]
pub(super) struct Said {
    /// The verdict; `None` where there is no position, or no message.
    pub verdict: Option<Verdict>,
    /// Its protection levels.
    pub levels: Option<ProtectionLevels>,
    /// Its horizontal and vertical error, m, where the truth is known.
    pub error_m: Option<(f64, f64)>,
}

/// A phone's integrity over time.
#[derive(Debug)]
pub(super) struct PhoneIntegrity {
    verdicts: [StateLane; 2],
    group: StateLane,
    is_isolated: bool,
    fused_levels: [Series; 2],
    /// The negative vertical level: vertical errors have a sign.
    lower_level: Series,
    claims: [Claims; 2],
}

/// Entity of a phone's verdicts by a method.
pub(super) fn verdict_path(phone: &str, method: Method) -> rerun::EntityPath {
    phone_path(phone, [INTEGRITY, "verdict", method.name()])
}

/// Entity of a phone's state in its group.
pub(super) fn group_path(phone: &str) -> rerun::EntityPath {
    phone_path(phone, [INTEGRITY, "group"])
}

/// Entity of a phone's negative vertical protection level.
pub(super) fn lower_level_path(phone: &str) -> rerun::EntityPath {
    phone_path(phone, [QUALITY, "fused_vpl_below"])
}

impl PhoneIntegrity {
    pub fn new(phone: &str) -> Self {
        let line = |name: &str| Style::Line {
            name: format!("{phone} {name}"),
            colour: bound_colour(),
            width: 2.5, // wider than those of errors
        };
        let level = |name, what| Series::new(phone_path(phone, [QUALITY, what]), line(name));
        let [horizontal, vertical] = FUSED_LEVELS;
        Self {
            verdicts: JUDGED.map(|method| StateLane::new(verdict_path(phone, method))),
            group: StateLane::new(group_path(phone)),
            is_isolated: false,
            fused_levels: [level("fused HPL", horizontal), level("fused VPL", vertical)],
            lower_level: Series::new(lower_level_path(phone), line("fused −VPL")),
            claims: JUDGED.map(|method| Claims::new(phone, method)),
        }
    }

    /// Takes an event that is about this phone.
    pub fn take(&mut self, event: &IntegrityEvent) {
        match event.kind {
            EventKind::Isolated => self.is_isolated = true,
            EventKind::Readmitted => self.is_isolated = false,
            EventKind::ConstraintContradicted | EventKind::CannotTell => (),
        }
    }

    /// Adds an epoch of the group after its events.
    pub fn push_fused(&mut self, time_ns: i64, phone: &FusedPhone, skips: &mut Skips) {
        let state = if self.is_isolated { ISOLATED } else { WITH_THE_GROUP };
        self.group.push(time_ns, phone.state.is_some().then(|| state.into()));
        let horizontal_m = phone.protection.map(|levels| levels.horizontal_m);
        let vertical_m = phone.protection.map(|levels| levels.vertical_m);
        for (series, value) in self.fused_levels.iter_mut().zip([horizontal_m, vertical_m]) {
            series.push(time_ns, value, skips);
        }
        self.lower_level.push(time_ns, vertical_m.map(|level_m| -level_m), skips);
    }

    /// Adds what is said of a position by one of the methods [`JUDGED`].
    pub fn push_said(&mut self, time_ns: i64, method: Method, said: Said) {
        let Some(index) = JUDGED.iter().position(|judged| *judged == method) else { return };
        if let Some(lane) = self.verdicts.get_mut(index) {
            lane.push(time_ns, said.verdict.map(|verdict| verdict.to_string().into()));
        }
        if let (Some(claims), Some(Verdict::Reliable), Some((horizontal_m, up_m))) =
            (self.claims.get_mut(index), said.verdict, said.error_m)
        {
            claims.push([horizontal_m, up_m.abs()], said.levels);
        }
    }

    /// What was claimed of reliable positions, by method.
    pub const fn claims(&self) -> &[Claims] {
        &self.claims
    }

    /// Writes the rows since the last call.
    pub fn write_segment(&mut self, file: &mut RrdFile) -> Result<(), RecorderError> {
        let style = verdict_style();
        self.verdicts.iter_mut().try_for_each(|lane| lane.write_segment(file, &style))?;
        self.group.write_segment(file, &group_style())?;
        self.fused_levels.iter_mut().try_for_each(|series| series.write_segment(file))?;
        self.lower_level.write_segment(file)
    }
}

fn quiet() -> Color {
    Color::from_rgb(0x2E, 0x5A, 0x4A)
}

fn alarming() -> Color {
    Color::from_rgb(0xE0, 0x40, 0x30)
}

fn group_style() -> StateConfiguration {
    StateConfiguration::new().with_values([WITH_THE_GROUP, ISOLATED]).with_colors([quiet(), alarming()])
}

fn verdict_style() -> StateConfiguration {
    let causes = [
        Cause::InsufficientRedundancy,
        Cause::Geometry,
        Cause::Constraint,
        Cause::Peers,
        Cause::AlarmLimit,
        Cause::TestsFailed,
        Cause::Inseparable,
        Cause::Tie,
        Cause::SearchLimit,
    ];
    let checked =
        [(Verdict::Reliable, quiet()), (Verdict::CannotBeChecked, Color::from_rgb(0xE6, 0x9F, 0x00))];
    let unreliable = causes.map(|cause| (Verdict::Unreliable(cause), alarming()));
    let (verdicts, colours): (Vec<String>, Vec<Color>) =
        checked.into_iter().chain(unreliable).map(|(verdict, colour)| (verdict.to_string(), colour)).unzip();
    StateConfiguration::new().with_values(verdicts).with_colors(colours)
}
