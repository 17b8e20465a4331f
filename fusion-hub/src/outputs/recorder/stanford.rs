//! Stanford diagrams: protection levels over errors of the epochs that were called reliable and have a truth.
//!
//! A diagram is a 2D view, whose vertical axis points down: a point is at (error, −level), in metres. Above the diagonal the level bounds the
//! error; a point below it is misleading, and stands in an entity of its own, in large marks.

use std::fmt::Write as _;

use cofix_common::integrity::ProtectionLevels;
use cofix_common::recording::{HORIZONTAL, INTEGRITY, VERTICAL};
use rerun::components::MediaType;
use rerun::{Color, EntityPath, LineStrips2D, Points2D, Radius, TextDocument};

use super::entity::{Method, bound_colour, path, phone_path};
use super::rrd::{RecorderError, RrdFile};

/// Directions of the diagrams.
pub(super) const DIRECTIONS: [&str; 2] = [HORIZONTAL, VERTICAL];
/// Share of the levels within the initial view.
const SHOWN: f64 = 0.95;
/// Distance of the levels' scale from its axis, where many points are, as a share of its length.
const BESIDE: f32 = 0.1;

/// Levels and errors of one phone's reliable positions by one method.
#[derive(Debug)]
pub(super) struct Claims {
    phone: String,
    method: Method,
    counts: Counts,
    /// By direction.
    points: [Points; 2],
}

/// Epochs that were called reliable and have a truth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Counts {
    epochs: u64,
    /// Those whose error the level bounds, by direction.
    bounded: [u64; 2],
    /// Those with an error beyond a level, or without levels.
    misleading: u64,
}

/// Points of one diagram: error and level, m.
#[derive(Debug, Default)]
struct Points {
    bounded: Vec<[f32; 2]>,
    misleading: Vec<[f32; 2]>,
}

impl Points {
    fn all(&self) -> impl Iterator<Item = &[f32; 2]> {
        self.bounded.iter().chain(&self.misleading)
    }
}

impl Claims {
    pub fn new(phone: &str, method: Method) -> Self {
        Self { phone: phone.to_owned(), method, counts: Counts::default(), points: Default::default() }
    }

    /// Adds a reliable epoch with its errors by direction, ≥ 0.
    pub fn push(&mut self, errors_m: [f64; 2], levels: Option<ProtectionLevels>) {
        let levels_m = levels.map(|levels| [levels.horizontal_m, levels.vertical_m]);
        let mut is_misleading = levels.is_none();
        self.counts.epochs += 1;
        for (direction, level_m) in levels_m.into_iter().flatten().enumerate() {
            let error_m = errors_m[direction];
            let is_bounded = error_m <= level_m;
            is_misleading |= !is_bounded;
            self.counts.bounded[direction] += u64::from(is_bounded);
            let Points { bounded, misleading } = &mut self.points[direction];
            if error_m.is_finite() && level_m.is_finite() {
                if is_bounded { bounded } else { misleading }.push([single(error_m), single(level_m)]);
            }
        }
        self.counts.misleading += u64::from(is_misleading);
    }

    fn write(&self, file: &mut RrdFile) -> Result<(), RecorderError> {
        for (direction, points) in DIRECTIONS.into_iter().zip(&self.points) {
            let entity = diagram_path(&self.phone, direction);
            let path = |what: &str| entity.join(&path([self.method.name(), what]));
            let radius = 1.0 + 0.5 * self.method.width();
            write_points(file, &path("bounded"), &points.bounded, self.method.colour(), radius)?;
            write_points(file, &path("misleading"), &points.misleading, bound_colour(), 4.0 * radius)?;
        }
        Ok(())
    }
}

/// Entity of the points of a phone's diagram.
pub(super) fn diagram_path(phone: &str, direction: &str) -> EntityPath {
    phone_path(phone, [INTEGRITY, "diagram", direction])
}

/// Entity of the diagonal, the axes and their scale, which all diagrams share.
pub(super) fn scale_path() -> EntityPath {
    path([INTEGRITY, "diagram"])
}

/// Entity of the table of counts.
pub(super) fn counts_path() -> EntityPath {
    path([INTEGRITY, "counts"])
}

/// Writes all diagrams and the table of counts. Returns the length of the axes, m; `None` where no epoch has a truth.
pub(super) fn write(all: &[&Claims], file: &mut RrdFile) -> Result<Option<f64>, RecorderError> {
    if all.iter().all(|claims| claims.counts.epochs == 0) {
        return Ok(None);
    }
    all.iter().try_for_each(|claims| claims.write(file))?;
    let document = TextDocument::new(table(all)).with_media_type(MediaType::MARKDOWN);
    file.write_static(&counts_path(), &document)?;
    let shown_m = shown_m(all);
    write_scale(file, all, shown_m)?;
    Ok(Some(shown_m))
}

fn points<'a>(all: &'a [&Claims]) -> impl Iterator<Item = &'a Points> {
    all.iter().flat_map(|claims| &claims.points)
}

/// The length of the axes, m: most levels, and all misleading errors.
fn shown_m(all: &[&Claims]) -> f64 {
    let mut levels_m: Vec<f32> = points(all).flat_map(Points::all).map(|point| point[1]).collect();
    levels_m.sort_by(f32::total_cmp);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a share of a length
    let usual_m = levels_m.get((SHOWN * levels_m.len() as f64) as usize).copied().unwrap_or(1.0);
    let errors_m = points(all).flat_map(|points| &points.misleading).map(|point| point[0]);
    f64::from(errors_m.fold(usual_m, f32::max)).max(1.0) * 1.1
}

/// Writes the diagonal and the axes with their scale.
fn write_scale(file: &mut RrdFile, all: &[&Claims], shown_m: f64) -> Result<(), RecorderError> {
    let farthest = points(all).flat_map(Points::all).flatten().copied().fold(single(shown_m), f32::max);
    let line = |strip: Vec<[f32; 2]>| LineStrips2D::new([strip]).with_radii([Radius::new_ui_points(1.0)]);
    let grey = Color::from_rgb(0x77, 0x77, 0x77);
    let diagonal =
        line(vec![[0.0, 0.0], [farthest, -farthest]]).with_colors([Color::from_rgb(0xFF, 0xFF, 0xFF)]);
    file.write_static(&scale_path().join(&path(["diagonal"])), &diagonal)?;
    let length = single(shown_m);
    let axes = line(vec![[0.0, -length], [0.0, 0.0], [length, 0.0]]).with_colors([grey]);
    file.write_static(&scale_path().join(&path(["axes"])), &axes)?;
    let (places, labels): (Vec<[f32; 2]>, Vec<String>) = ticks(shown_m).into_iter().unzip();
    let ticks = Points2D::new(places)
        .with_labels(labels)
        .with_show_labels(true)
        .with_colors([grey])
        .with_radii([Radius::new_ui_points(2.0)]);
    file.write_static(&scale_path().join(&path(["scale"])), &ticks)
}

/// Places and labels of the axes' marks, in steps of 1, 2 or 5 times a power of ten.
fn ticks(shown_m: f64) -> Vec<([f32; 2], String)> {
    let decade = 10_f64.powf((shown_m / 5.0).log10().floor());
    let step_m = [1.0, 2.0, 5.0, 10.0].map(|factor| factor * decade).into_iter().find(|m| shown_m / m <= 5.0);
    let step_m = step_m.unwrap_or(shown_m);
    let mut ticks = Vec::new();
    for number in 1..=5_u8 {
        let at_m = f64::from(number) * step_m;
        if at_m <= shown_m {
            ticks.push(([single(at_m), 0.0], format!("error {at_m} m")));
            ticks.push(([-BESIDE * single(shown_m), -single(at_m)], format!("level {at_m} m")));
        }
    }
    ticks
}

fn write_points(
    file: &mut RrdFile,
    entity: &EntityPath,
    points: &[[f32; 2]],
    colour: Color,
    radius: f32,
) -> Result<(), RecorderError> {
    if points.is_empty() {
        return Ok(());
    }
    let upwards = points.iter().map(|&[error_m, level_m]| [error_m, -level_m]);
    let points = Points2D::new(upwards).with_colors([colour]).with_radii([Radius::new_ui_points(radius)]);
    file.write_static(entity, &points)
}

fn table(all: &[&Claims]) -> String {
    let mut text = "| method | phone | epochs | HPL bounds | VPL bounds | misleading |\n\
                    |:-------|:------|-------:|-----------:|-----------:|-----------:|\n"
        .to_owned();
    let of_method = |method| all.iter().filter(move |claims| claims.method == method);
    for claims in super::integrity::JUDGED.into_iter().flat_map(of_method) {
        let Counts { epochs, bounded: [horizontally, vertically], misleading } = claims.counts;
        let share = |count: u64| match epochs {
            0 => "-".to_owned(),
            epochs => format!("{:.2} %", 100.0 * count as f64 / epochs as f64),
        };
        let (method, phone) = (claims.method.name(), claims.phone.as_str());
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "| {method} | {phone} | {epochs} | {} | {} | {misleading} |",
            share(horizontally),
            share(vertically)
        );
    }
    text + "\nEpochs that were called reliable, where the truth is known. Misleading: an error is beyond its level, or there is no level. \
            In the diagrams these are the large points below the diagonal.\n"
}

#[allow(clippy::cast_possible_truncation)] // pictures
fn single(value: f64) -> f32 {
    value as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn claims(pairs: &[([f64; 2], Option<[f64; 2]>)]) -> Claims {
        let mut claims = Claims::new("a", Method::Joint);
        for (errors_m, levels_m) in pairs {
            let levels =
                levels_m.map(|[horizontal_m, vertical_m]| ProtectionLevels { horizontal_m, vertical_m });
            claims.push(*errors_m, levels);
        }
        claims
    }

    #[test]
    fn epochs_are_counted_by_the_side_of_the_diagonal() {
        let claims = claims(&[
            ([1.0, 2.0], Some([10.0, 20.0])),
            ([11.0, 2.0], Some([10.0, 20.0])),
            ([1.0, 21.0], Some([10.0, 20.0])),
            ([10.0, 20.0], Some([10.0, 20.0])),
            ([1.0, 1.0], None),
        ]);
        assert_eq!(claims.counts, Counts { epochs: 5, bounded: [3, 3], misleading: 3 });
        assert_eq!(claims.points[0].misleading, [[11.0, 10.0]]);
        assert_eq!(claims.points[1].misleading, [[21.0, 20.0]]);
        assert_eq!(claims.points[0].bounded.len(), 3);
        let text = table(&[&claims]);
        assert!(text.contains("| joint | a | 5 | 60.00 % | 60.00 % | 3 |"), "{text}");
    }

    #[test]
    fn the_axes_show_most_levels_and_all_misleading_errors() {
        let mut pairs = vec![([1.0, 1.0], Some([10.0, 10.0])); 99];
        pairs.push(([1.0, 1.0], Some([900.0, 10.0])));
        let usual = claims(&pairs);
        assert!((shown_m(&[&usual]) - 11.0).abs() < 1e-4);
        pairs.push(([50.0, 1.0], Some([10.0, 10.0])));
        let misled = claims(&pairs);
        assert!((shown_m(&[&misled]) - 55.0).abs() < 1e-4);
        let labels: Vec<String> = ticks(55.0).into_iter().map(|(_, label)| label).collect();
        assert_eq!(labels, ["error 20 m", "level 20 m", "error 40 m", "level 40 m"]);
    }
}
