//! The default layout of a recording.

use cofix_common::recording::{ACCURACY, CONSTRAINTS, DISTANCES, SATELLITES, TIMELINE};
use rerun::blueprint::components::{
    BackgroundKind, Corner2D, LinkAxis, PanelState, PlayState, TextLogColumn, TimeRange, TimelineColumn,
    TimelineName,
};
use rerun::blueprint::datatypes::{self, TextLogColumnKind};
use rerun::external::re_sdk_types::blueprint::archetypes::{
    Background, EyeControls3D, PanelBlueprint, PlotLegend, ScalarAxis, TextLogColumns, TimeAxis,
    TimePanelBlueprint,
};
use rerun::external::re_sdk_types::datatypes::{TimeInt, TimeRange as Range, TimeRangeBoundary};

use super::blueprint::{Entities, Node, View, entities, horizontal, tabs, vertical};
use super::entity::{Method, path, phone_path, subtree};
use super::focus::focus_path;

/// Position of the eye of the 3D view relative to its target: only the direction counts.
const EYE_ENU_M: [f32; 3] = [0.0, -10.0, 20.0];
/// Range of the plots of C/N0, dB-Hz.
const CN0_RANGE_DBHZ: [f64; 2] = [10.0, 55.0];

/// The layout for the named phones and the recording's time span.
pub(super) fn layout(phones: &[String], pairs: &[String], span_ns: Option<(i64, i64)>) -> Entities {
    let plots = Plots { span_ns };
    let left = vertical(vec![(3.0, map(phones)), (3.0, enu(phones))]);
    let middle = vertical(vec![
        (3.0, plots.errors(phones)),
        (2.0, plots.distances(pairs)),
        (3.0, plots.signals(phones)),
    ]);
    let right = vertical(vec![(2.0, accuracy()), (3.0, log(phones))]);
    let root = horizontal(vec![(3.0, left), (4.0, middle), (3.0, right)]);
    let mut entities = match root {
        Node::Container(root) => entities(root),
        Node::View(_) => Entities::new(),
    };
    entities.extend(panels());
    entities
}

fn panels() -> Entities {
    let time = TimePanelBlueprint::new()
        .with_state(PanelState::Collapsed)
        .with_timeline(TimelineName(TIMELINE.into()))
        .with_play_state(PlayState::Following);
    let hidden = || PanelBlueprint::new().with_state(PanelState::Hidden);
    vec![
        ("time_panel".into(), Box::new(time)),
        ("blueprint_panel".into(), Box::new(hidden())),
        ("selection_panel".into(), Box::new(hidden())),
    ]
}

fn all(phones: &[String], parts: &[&str]) -> Vec<String> {
    phones.iter().map(|phone| subtree(&phone_path(phone, parts.iter().copied()))).collect()
}

fn map(phones: &[String]) -> Node {
    View::new("Map", "Map", all(phones, &["map"])).into()
}

fn enu(phones: &[String]) -> Node {
    let mut contents = all(phones, &["enu"]);
    contents.push(subtree(&focus_path()));
    let eye = EyeControls3D::new()
        .with_position(EYE_ENU_M)
        .with_look_target([0.0, 0.0, 0.0])
        .with_tracking_entity(focus_path().to_string());
    let black = Background::new(BackgroundKind::SolidColor).with_color(rerun::Color::from_rgb(0, 0, 0));
    View::new("3D", "East, north, up (m) with 1σ ellipsoids", contents)
        .with("Background", black)
        .with("EyeControls3D", eye)
        .into()
}

fn accuracy() -> Node {
    View::new("TextDocument", "Accuracy", vec![subtree(&path([ACCURACY]))]).into()
}

fn log(phones: &[String]) -> Node {
    let view = |name, contents| {
        let columns = TextLogColumns::new()
            .with_timeline_columns([TimelineColumn(datatypes::TimelineColumn {
                visible: true.into(),
                timeline: TIMELINE.into(),
            })])
            .with_text_log_columns(
                [TextLogColumnKind::LogLevel, TextLogColumnKind::Body]
                    .map(|kind| TextLogColumn(datatypes::TextLogColumn { visible: true.into(), kind })),
            );
        View::new("TextLog", name, contents).with("TextLogColumns", columns)
    };
    let constraints = view("Constraints", vec![subtree(&path([CONSTRAINTS]))]);
    let raim = view("RAIM", all(phones, &["raim"]));
    tabs("Log", vec![raim.into(), constraints.into()])
}

/// Plots over the whole recording.
struct Plots {
    span_ns: Option<(i64, i64)>,
}

impl Plots {
    fn view(&self, name: impl Into<String>, contents: Vec<String>) -> View {
        let view = View::new("TimeSeries", name, contents);
        let Some((first, last)) = self.span_ns else { return view };
        let boundary = |ns: i64| TimeRangeBoundary::Absolute(TimeInt(ns));
        let range = TimeRange(Range { start: boundary(first), end: boundary(last) });
        view.with("TimeAxis", TimeAxis::new().with_link(LinkAxis::Independent).with_view_range(range))
    }

    fn errors(&self, phones: &[String]) -> Node {
        let joint = phones
            .iter()
            .map(|phone| subtree(&phone_path(phone, ["error", "horizontal", Method::Joint.name()])));
        let all_phones = self.view("Horizontal error, joint (m)", joint.collect());
        let of_phone = |direction: &'static str, phone: &String| {
            let contents = vec![subtree(&phone_path(phone, ["error", direction]))];
            self.view(format!("{phone} {direction} error (m)"), contents)
                .with("PlotLegend", PlotLegend::new().with_corner(Corner2D::RightTop))
        };
        let mut children: Vec<Node> = phones.iter().map(|p| of_phone("horizontal", p).into()).collect();
        children.push(all_phones.into());
        children.extend(phones.iter().map(|p| of_phone("vertical", p).into()));
        tabs("Errors", children)
    }

    fn distances(&self, pairs: &[String]) -> Node {
        let mut contents = vec![subtree(&path([DISTANCES]))];
        contents.extend(pairs.iter().map(|pair| format!("- {}", path([DISTANCES, pair, "sigma"]))));
        let view = self
            .view("Distances and bounds (m)", contents)
            .with("PlotLegend", PlotLegend::new().with_visible(false));
        let shifts = self.view("Shifts by constraints (m)", vec![subtree(&path([CONSTRAINTS]))]);
        tabs("Constraints", vec![view.into(), shifts.into()])
    }

    fn signals(&self, phones: &[String]) -> Node {
        let no_legend = || PlotLegend::new().with_visible(false);
        let of_phone = |what: &'static str, title: &str, phone: &String| {
            let contents = vec![subtree(&phone_path(phone, [SATELLITES, what]))];
            self.view(format!("{phone} {title}"), contents).with("PlotLegend", no_legend())
        };
        let mut children: Vec<Node> = Vec::new();
        for phone in phones {
            let cn0 = of_phone("cn0", "C/N0 (dB-Hz)", phone);
            let range = ScalarAxis::new().with_range(CN0_RANGE_DBHZ);
            children.push(cn0.with("ScalarAxis", range).into());
            children.push(of_phone("residual", "residuals (m)", phone).into());
            let contents = vec![subtree(&phone_path(phone, [SATELLITES, "usage"]))];
            children.push(View::new("StateTimeline", format!("{phone} use"), contents).into());
        }
        children.push(self.view("Satellites used", all(phones, &["quality", "satellites"])).into());
        children.push(self.view("PDOP", all(phones, &["quality", "pdop"])).into());
        children.push(self.view("Horizontal protection level", all(phones, &["quality", "hpl"])).into());
        children.push(self.view("Vertical protection level", all(phones, &["quality", "vpl"])).into());
        children.push(self.view("Innovation of the code", all(phones, &["quality", "code_nis"])).into());
        children.push(self.view("Rejected measurements", all(phones, &["quality", "rejected"])).into());
        tabs("Signals", children)
    }
}
