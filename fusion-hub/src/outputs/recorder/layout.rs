//! The default layout of a recording.

use cofix_common::recording::{
    ACCURACY, CONSTRAINTS, DISTANCES, ERROR, FUSED, FUSED_LEVELS, HORIZONTAL, INTEGRITY, LOG, QUALITY,
    SATELLITES, TIMELINE, VERTICAL,
};
use rerun::EntityPath;
use rerun::blueprint::components::{
    BackgroundKind, Corner2D, LinkAxis, PanelState, PlayState, TextLogColumn, TimeRange, TimelineColumn,
    TimelineName,
};
use rerun::blueprint::datatypes::{self, TextLogColumnKind};
use rerun::external::re_sdk_types::blueprint::archetypes::{
    Background, EyeControls3D, PanelBlueprint, PlotLegend, ScalarAxis, TextLogColumns, TimeAxis,
    TimePanelBlueprint, VisualBounds2D,
};
use rerun::external::re_sdk_types::datatypes::{Range2D, TimeInt, TimeRange as Range, TimeRangeBoundary};

use super::blueprint::{Entities, Node, View, entities, horizontal, tabs, vertical};
use super::entity::{Method, path, phone_path, subtree};
use super::focus::focus_path;
use super::integrity::{group_path, lower_level_path, verdict_path};
use super::stanford::{counts_path, diagram_path, scale_path};

/// Position of the eye of the 3D view relative to its target: only the direction counts.
const EYE_ENU_M: [f32; 3] = [0.0, -10.0, 20.0];
/// Range of the plots of C/N0, dB-Hz.
const CN0_RANGE_DBHZ: [f64; 2] = [10.0, 55.0];

/// What a layout is for.
#[derive(Clone, Copy)]
pub(super) struct Shape<'a> {
    /// The phones' names.
    pub phones: &'a [String],
    /// Names of the pairs of phones with a distance.
    pub pairs: &'a [String],
    /// First and last time of the recording.
    pub span_ns: Option<(i64, i64)>,
    /// Length of the axes of the diagrams of levels and errors, m; `None` without a truth.
    pub diagram_m: Option<f64>,
}

/// The layout: a page with everything, and one of integrity.
pub(super) fn layout(shape: Shape<'_>) -> Entities {
    let root = tabs("", vec![session(shape), integrity(shape)]);
    let mut entities = match root {
        Node::Container(root) => entities(root),
        Node::View(_) => Entities::new(),
    };
    entities.extend(panels());
    entities
}

fn session(Shape { phones, pairs, span_ns, .. }: Shape<'_>) -> Node {
    let plots = Plots { span_ns };
    let left = vertical("", vec![(3.0, map(phones)), (3.0, enu(phones))]);
    let middle = vertical(
        "",
        vec![(3.0, plots.errors(phones)), (2.0, plots.distances(pairs)), (3.0, plots.signals(phones))],
    );
    let right = vertical("", vec![(2.0, accuracy()), (3.0, log(phones))]);
    horizontal("Session", vec![(3.0, left), (4.0, middle), (3.0, right)])
}

fn integrity(Shape { phones, span_ns, diagram_m, .. }: Shape<'_>) -> Node {
    let plots = Plots { span_ns };
    let events = log_view("Events", vec![subtree(&path([INTEGRITY, LOG]))]);
    let mut columns = Vec::new();
    if let Some(axes_m) = diagram_m {
        let of_phone = |phone: &String| {
            let [level_of_heights, level] =
                [VERTICAL, HORIZONTAL].map(|direction| diagram(phone, direction, axes_m));
            vertical(phone, vec![(1.0, level), (1.0, level_of_heights)])
        };
        columns.push((3.0, tabs("Levels over errors", phones.iter().map(of_phone).collect())));
    }
    columns.push((4.0, vertical("", vec![(3.0, plots.levels("Levels", phones)), (2.0, states(phones))])));
    let counts = View::new("TextDocument", "Reliable epochs", vec![subtree(&counts_path())]);
    let mut right = Vec::from_iter(diagram_m.map(|_| (2.0, counts.into())));
    right.push((3.0, events.into()));
    columns.push((3.0, vertical("", right)));
    horizontal("Integrity", columns)
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
    View::new("3D", "East, north, up (m) with 1σ ellipsoids", contents)
        .with("Background", black())
        .with("EyeControls3D", eye)
        .into()
}

fn accuracy() -> Node {
    View::new("TextDocument", "Accuracy", vec![subtree(&path([ACCURACY]))]).into()
}

fn log(phones: &[String]) -> Node {
    let constraints = log_view("Constraints", vec![subtree(&path([CONSTRAINTS]))]);
    let raim = log_view("RAIM", all(phones, &["raim"]));
    tabs("Log", vec![raim.into(), constraints.into()])
}

fn log_view(name: &str, contents: Vec<String>) -> View {
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
}

/// Levels over errors of one phone. The vertical axis of a 2D view points down.
fn diagram(phone: &str, direction: &str, axes_m: f64) -> Node {
    let contents = vec![subtree(&diagram_path(phone, direction)), subtree(&scale_path())];
    let margin_m = 0.1 * axes_m;
    let bounds = Range2D {
        x_range: [-2.0 * margin_m, axes_m + margin_m].into(), // with room for the scale
        y_range: [-axes_m - margin_m, margin_m].into(),
    };
    let title = format!("{phone} {direction}: protection level over error (m), fused and epoch-wise");
    View::new("2D", title, contents)
        .with("VisualBounds2D", VisualBounds2D::new(bounds))
        .with("Background", black())
        .into()
}

/// Who was isolated when, and the verdicts.
fn states(phones: &[String]) -> Node {
    let entities = |of: &dyn Fn(&str) -> EntityPath| -> Vec<String> {
        phones.iter().map(|phone| subtree(&of(phone))).collect()
    };
    let verdicts = |method| entities(&|phone| verdict_path(phone, method));
    let view = |name, contents| View::new("StateTimeline", name, contents).into();
    let views = vec![
        view("Isolated phones", entities(&group_path)),
        view("Fused verdicts", verdicts(Method::Joint)),
        view("Epoch-wise verdicts", verdicts(Method::Wls)),
    ];
    tabs("States", views)
}

fn black() -> Background {
    Background::new(BackgroundKind::SolidColor).with_color(rerun::Color::from_rgb(0, 0, 0))
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
        let joint = phones.iter().map(|phone| subtree(&phone_path(phone, [ERROR, HORIZONTAL, FUSED])));
        let all_phones = self.view("Horizontal error, joint (m)", joint.collect());
        let of_phone = |direction: &'static str, phone: &String| {
            let contents = vec![subtree(&phone_path(phone, [ERROR, direction]))];
            self.view(format!("{phone} {direction} error (m)"), contents)
                .with("PlotLegend", PlotLegend::new().with_corner(Corner2D::RightTop))
        };
        let mut children: Vec<Node> = phones.iter().map(|p| of_phone(HORIZONTAL, p).into()).collect();
        children.push(all_phones.into());
        children.extend(phones.iter().map(|p| of_phone(VERTICAL, p).into()));
        children.push(self.levels("Levels", phones));
        tabs("Errors", children)
    }

    /// Protection levels of the fused positions over time, above their errors.
    fn levels(&self, name: &str, phones: &[String]) -> Node {
        let of_phone = |phone: &String| {
            let error = |direction| subtree(&phone_path(phone, [ERROR, direction, FUSED]));
            let [hpl, vpl] = FUSED_LEVELS.map(|level| subtree(&phone_path(phone, [QUALITY, level])));
            let lower = subtree(&lower_level_path(phone));
            let horizontal = format!("{phone} horizontal error and HPL, fused (m)");
            let heights = format!("{phone} vertical error and ±VPL, fused (m)");
            vertical(
                phone,
                vec![
                    (1.0, self.view(horizontal, vec![error(HORIZONTAL), hpl]).into()),
                    (1.0, self.view(heights, vec![error(VERTICAL), vpl, lower]).into()),
                ],
            )
        };
        tabs(name, phones.iter().map(of_phone).collect())
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
        children.push(self.view("Satellites used", all(phones, &[QUALITY, "satellites"])).into());
        children.push(self.view("PDOP", all(phones, &[QUALITY, "pdop"])).into());
        children.push(self.view("Horizontal protection level", all(phones, &[QUALITY, "hpl"])).into());
        children.push(self.view("Vertical protection level", all(phones, &[QUALITY, "vpl"])).into());
        children.push(self.view("Innovation of the code", all(phones, &[QUALITY, "code_nis"])).into());
        children.push(self.view("Rejected measurements", all(phones, &[QUALITY, "rejected"])).into());
        tabs("Signals", children)
    }
}
