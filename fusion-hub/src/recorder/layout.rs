//! The default layout of a recording.

use rerun::blueprint::components::{Corner2D, LinkAxis, PanelState, PlayState, TimeRange, TimelineName};
use rerun::external::re_sdk_types::blueprint::archetypes::{
    PanelBlueprint, PlotLegend, TimeAxis, TimePanelBlueprint,
};
use rerun::external::re_sdk_types::datatypes::{TimeInt, TimeRange as Range, TimeRangeBoundary};

use super::blueprint::{Entities, Node, View, entities, horizontal, tabs, vertical};
use super::entity::{Method, path, phone_path, subtree};
use super::rrd::TIMELINE;

/// The layout for the named phones and the recording's time span.
pub(super) fn layout(phones: &[String], span_ns: Option<(i64, i64)>) -> Entities {
    let plots = Plots { span_ns };
    let left = vertical(vec![(3.0, map(phones)), (3.0, enu(phones))]);
    let middle =
        vertical(vec![(3.0, plots.errors(phones)), (2.0, plots.distances()), (3.0, plots.signals(phones))]);
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
    View::new("3D", "East, north, up of the first fix (m), 1σ", all(phones, &["enu"])).into()
}

fn accuracy() -> Node {
    View::new("TextDocument", "Accuracy", vec![subtree(&path(["accuracy"]))]).into()
}

fn log(phones: &[String]) -> Node {
    let constraints = View::new("TextLog", "Constraints", vec![subtree(&path(["constraints"]))]);
    let raim = View::new("TextLog", "RAIM", all(phones, &["raim"]));
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

    fn distances(&self) -> Node {
        let view = self.view("Distances (m)", vec![subtree(&path(["distances"]))]);
        let shifts = self.view("Shifts by constraints (m)", vec![subtree(&path(["constraints"]))]);
        tabs("Constraints", vec![view.into(), shifts.into()])
    }

    fn signals(&self, phones: &[String]) -> Node {
        let of_phone = |what: &'static str, title: &str, phone: &String| {
            let contents = vec![subtree(&phone_path(phone, ["satellites", what]))];
            self.view(format!("{phone} {title}"), contents)
                .with("PlotLegend", PlotLegend::new().with_visible(false))
                .into()
        };
        let mut children = Vec::new();
        for phone in phones {
            children.push(of_phone("cn0", "C/N0 (dB-Hz)", phone));
            children.push(of_phone("residual", "residuals (m)", phone));
        }
        tabs("Signals", children)
    }
}
