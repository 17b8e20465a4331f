//! An invisible box around the group, which the eye of the 3D view follows.

use cofix_common::filter::PhoneState;
use cofix_common::frames::LocalFrame;
use cofix_common::fusion::engine::FusedPhone;
use nalgebra::Vector3;
use rerun::{Boxes3D, Color, EntityPath, Radius};

use super::entity::path;
use super::rows::{Rows, Segment};
use super::rrd::{RecorderError, RrdFile};
use super::track::drawable;

/// Room around the outermost phones, m.
const MARGIN_M: f64 = 3.0;

/// The box over time.
#[derive(Debug, Default)]
pub(super) struct Focus {
    /// Centre and half of the edge, m.
    rows: Rows<([f32; 3], f32)>,
}

/// The entity's path.
pub(super) fn focus_path() -> EntityPath {
    path(["focus"])
}

impl Focus {
    /// Adds an epoch.
    pub fn push(&mut self, time_ns: i64, frame: &LocalFrame, phones: &[FusedPhone]) {
        let positions: Vec<Vector3<f64>> = phones
            .iter()
            .filter_map(|phone| phone.state.as_ref())
            .map(PhoneState::position)
            .filter(|&position| drawable(position))
            .map(|position| frame.ecef_to_enu(position).vector())
            .collect();
        if positions.is_empty() {
            return;
        }
        let centre = positions.iter().sum::<Vector3<f64>>() / positions.len() as f64;
        let reach = positions.iter().map(|p| (p - centre).norm()).fold(0.0, f64::max);
        #[allow(clippy::cast_possible_truncation)] // a picture
        let value = (centre.map(|c| c as f32).into(), (reach + MARGIN_M) as f32);
        self.rows.push(time_ns, Some(value));
    }

    /// Writes static data.
    pub fn write_style(file: &mut RrdFile) -> Result<(), RecorderError> {
        let invisible = Boxes3D::update_fields()
            .with_colors([Color::from_unmultiplied_rgba(0, 0, 0, 0)])
            .with_radii([Radius::new_scene_units(0.0)]);
        file.write_static(&focus_path(), &invisible)
    }

    /// Writes the rows since the last call.
    pub fn write_segment(&mut self, file: &mut RrdFile) -> Result<(), RecorderError> {
        let Some(Segment { times_ns, lengths, values }) = self.rows.take_segment() else { return Ok(()) };
        let half_sizes = values.iter().map(|&(_, half_m)| [half_m; 3]);
        let boxes = Boxes3D::from_centers_and_half_sizes(values.iter().map(|v| v.0), half_sizes);
        file.write_columns(&focus_path(), &times_ns, boxes.columns(lengths))
    }
}
