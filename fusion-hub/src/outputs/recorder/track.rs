//! Positions of one phone by one method: on the map, in the local frame with its 1σ ellipsoid, as whole tracks.

use cofix_common::constraint::wrap_rad;
use cofix_common::frames::{Ecef, LocalFrame};
use nalgebra::{Matrix3, Quaternion, Rotation3, SymmetricEigen, UnitQuaternion};
use rerun::{Ellipsoids3D, GeoLineStrings, GeoPoints, LineStrips3D, Points3D};

use super::entity::{Method, phone_path};
use super::rows::{Rows, Segment};
use super::rrd::{RecorderError, RrdFile};

/// The 1σ surface of a position's covariance in the local frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ellipsoid {
    /// Standard deviations along the axes, m.
    pub half_sizes_m: [f32; 3],
    /// Rotation from its axes to east, north, up; x, y, z, w.
    pub quaternion_xyzw: [f32; 4],
}

/// One position in the forms that are recorded.
#[derive(Clone, Copy, Debug)]
struct Fix {
    latitude_longitude_deg: [f64; 2],
    enu_m: [f32; 3],
}

/// A stretch of track without a gap.
#[derive(Debug, Default)]
struct Stretch {
    latitude_longitude_deg: Vec<[f64; 2]>,
    enu_m: Vec<[f32; 3]>,
}

/// A recording's positions of one phone by one method.
#[derive(Debug)]
pub(super) struct Track {
    phone: String,
    method: Method,
    fixes: Rows<Fix>,
    ellipsoids: Rows<([f32; 3], Ellipsoid)>,
    stretches: Vec<Stretch>,
    open: bool,
}

/// Whether a position can be drawn: finite, and not beyond what single precision and maps can show.
pub(super) fn drawable(position: Ecef) -> bool {
    const FARTHEST_M: f64 = 1e8;
    position.is_finite() && position.0.amax() < FARTHEST_M
}

/// The ellipsoid of an ECEF covariance; `None` when that is not positive semidefinite, or not finite in
/// single precision.
pub(super) fn ellipsoid(frame: &LocalFrame, covariance_ecef_m2: &Matrix3<f64>) -> Option<Ellipsoid> {
    let covariance = frame.covariance_ecef_to_enu(covariance_ecef_m2);
    if !covariance.iter().all(|c| c.is_finite()) {
        return None;
    }
    let symmetric = (covariance + covariance.transpose()) * 0.5;
    let SymmetricEigen { mut eigenvectors, eigenvalues } = SymmetricEigen::try_new(symmetric, 1e-15, 200)?;
    let tolerance = -1e-9 * eigenvalues.amax();
    if eigenvalues.iter().any(|&v| v < tolerance) {
        return None;
    }
    if eigenvectors.determinant() < 0.0 {
        eigenvectors.column_mut(2).neg_mut();
    }
    let rotation = Rotation3::from_matrix_unchecked(eigenvectors);
    let quaternion: Quaternion<f64> = *UnitQuaternion::from_rotation_matrix(&rotation);
    let half_sizes_m = eigenvalues.map(|v| single(v.max(0.0).sqrt()));
    let quaternion_xyzw = quaternion.coords.map(single);
    let finite = half_sizes_m.iter().chain(&quaternion_xyzw).all(|v| v.is_finite());
    finite.then(|| Ellipsoid { half_sizes_m: half_sizes_m.into(), quaternion_xyzw: quaternion_xyzw.into() })
}

/// Latitude and longitude, degrees. The longitude is within half a turn of the recording's origin and so may pass 180°: a map
/// shows tracks across the date line in one piece then.
fn on_map(frame: &LocalFrame, position: Ecef) -> [f64; 2] {
    let geodetic = position.ecef_to_geodetic();
    let origin_rad = frame.geodetic().longitude_rad;
    let longitude_rad = origin_rad + wrap_rad(geodetic.longitude_rad - origin_rad);
    [geodetic.latitude_deg(), longitude_rad.to_degrees()]
}

#[allow(clippy::cast_possible_truncation)] // pictures: metres from a near origin
fn single(value: f64) -> f32 {
    value as f32
}

impl Track {
    pub fn new(phone: &str, method: Method) -> Self {
        Self {
            phone: phone.to_owned(),
            method,
            fixes: Rows::default(),
            ellipsoids: Rows::default(),
            stretches: Vec::new(),
            open: false,
        }
    }

    /// Adds an epoch: a [`drawable`] position, or none.
    pub fn push(
        &mut self,
        time_ns: i64,
        frame: &LocalFrame,
        position: Option<Ecef>,
        ellipsoid: Option<Ellipsoid>,
    ) {
        let Some(position) = position else {
            self.open = false;
            self.fixes.push(time_ns, None);
            self.ellipsoids.push(time_ns, None);
            return;
        };
        let fix = Fix {
            latitude_longitude_deg: on_map(frame, position),
            enu_m: frame.ecef_to_enu(position).vector().map(single).into(),
        };
        if !self.open || self.goes_round_the_map(&fix) {
            self.stretches.push(Stretch::default());
            self.open = true;
        }
        if let Some(stretch) = self.stretches.last_mut() {
            stretch.latitude_longitude_deg.push(fix.latitude_longitude_deg);
            stretch.enu_m.push(fix.enu_m);
        }
        self.ellipsoids.push(time_ns, ellipsoid.map(|e| (fix.enu_m, e)));
        self.fixes.push(time_ns, Some(fix));
    }

    /// Begins a new line with the next position.
    pub fn break_off(&mut self) {
        self.open = false;
    }

    /// Whether a line from the last fix would cross the whole map: within one step the other side of the Earth is passed only
    /// next to a pole, or by a wild estimate.
    fn goes_round_the_map(&self, next: &Fix) -> bool {
        let last = self.stretches.last().and_then(|stretch| stretch.latitude_longitude_deg.last());
        last.is_some_and(|last| (last[1] - next.latitude_longitude_deg[1]).abs() > 180.0)
    }

    /// Writes static data: colours, sizes, labels.
    pub fn write_style(&self, file: &mut RrdFile) -> Result<(), RecorderError> {
        let colour = [self.method.colour()];
        let map = GeoPoints::update_fields()
            .with_colors(colour)
            .with_radii([rerun::Radius::new_ui_points(4.0 + self.method.width())]);
        file.write_static(&self.path("map", None), &map)?;
        let mut points = Points3D::update_fields()
            .with_colors(colour)
            .with_radii([rerun::Radius::new_ui_points(3.0 + self.method.width())]);
        if self.method == Method::Joint {
            points = points.with_labels([self.phone.as_str()]);
        }
        file.write_static(&self.path("enu", None), &points)?;
        if self.method != Method::Truth {
            let ellipsoids = Ellipsoids3D::update_fields()
                .with_colors(colour)
                .with_fill_mode(rerun::FillMode::MajorWireframe)
                .with_line_radii([self.radius()]);
            file.write_static(&self.path("enu", Some("sigma")), &ellipsoids)?;
        }
        Ok(())
    }

    /// Writes the rows since the last call.
    pub fn write_segment(&mut self, file: &mut RrdFile) -> Result<(), RecorderError> {
        if let Some(Segment { times_ns, lengths, values }) = self.fixes.take_segment() {
            let map = GeoPoints::from_lat_lon(values.iter().map(|f| f.latitude_longitude_deg));
            file.write_columns(&self.path("map", None), &times_ns, map.columns(lengths.iter().copied()))?;
            let points = Points3D::new(values.iter().map(|f| f.enu_m));
            file.write_columns(&self.path("enu", None), &times_ns, points.columns(lengths.iter().copied()))?;
        }
        if let Some(Segment { times_ns, lengths, values }) = self.ellipsoids.take_segment() {
            let ellipsoids = Ellipsoids3D::from_half_sizes(values.iter().map(|(_, e)| e.half_sizes_m))
                .with_centers(values.iter().map(|&(centre, _)| centre))
                .with_quaternions(
                    values.iter().map(|(_, e)| rerun::Quaternion::from_xyzw(e.quaternion_xyzw)),
                );
            let columns = ellipsoids.columns(lengths.iter().copied());
            file.write_columns(&self.path("enu", Some("sigma")), &times_ns, columns)?;
        }
        Ok(())
    }

    /// Writes the whole track, once, for all times.
    pub fn write_lines(&self, file: &mut RrdFile) -> Result<(), RecorderError> {
        let stretches: Vec<_> = self.stretches.iter().filter(|s| s.enu_m.len() > 1).collect();
        if stretches.is_empty() {
            return Ok(());
        }
        let (colour, radius) = ([self.method.colour()], [self.radius()]);
        let map = GeoLineStrings::from_lat_lon(stretches.iter().map(|s| s.latitude_longitude_deg.clone()))
            .with_colors(colour)
            .with_radii(radius);
        file.write_static(&self.path("map", Some("track")), &map)?;
        let lines = LineStrips3D::new(stretches.iter().map(|s| s.enu_m.clone()))
            .with_colors(colour)
            .with_radii(radius);
        file.write_static(&self.path("enu", Some("track")), &lines)
    }

    fn radius(&self) -> rerun::Radius {
        rerun::Radius::new_ui_points(0.5 * self.method.width())
    }

    fn path(&self, kind: &str, part: Option<&str>) -> rerun::EntityPath {
        phone_path(&self.phone, [kind, self.method.name()].into_iter().chain(part))
    }
}

#[cfg(test)]
mod tests {
    use cofix_common::frames::Geodetic;
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn ellipsoid_reproduces_the_covariance() {
        let frame = LocalFrame::at(Ecef::new(-2_267_000.0, 5_009_000.0, 3_220_000.0));
        let root = Matrix3::new(2.0, 0.3, -0.1, 0.0, 1.0, 0.4, 0.2, 0.0, 5.0);
        let covariance = root * root.transpose();
        let e = ellipsoid(&frame, &covariance).unwrap();
        let [x, y, z, w] = e.quaternion_xyzw.map(f64::from);
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)).to_rotation_matrix();
        let variances = Vector3::from(e.half_sizes_m.map(|s| f64::from(s).powi(2)));
        let back = rotation.matrix() * Matrix3::from_diagonal(&variances) * rotation.matrix().transpose();
        let expected = frame.covariance_ecef_to_enu(&covariance);
        assert!((back - expected).amax() < 1e-4, "{back} {expected}");
    }

    #[test]
    fn tracks_across_the_date_line_are_drawn_in_one_piece_where_they_are() {
        let at = |longitude_deg| Geodetic::from_degrees(-17.0, longitude_deg, 10.0).geodetic_to_ecef();
        let longitudes = |origin_deg, fixes: &[f64]| {
            let frame = LocalFrame::at(at(origin_deg));
            let mut track = Track::new("a", Method::Joint);
            for &fix in fixes {
                track.push(0, &frame, Some(at(fix)), None);
            }
            let of =
                |stretch: &Stretch| stretch.latitude_longitude_deg.iter().map(|p| p[1]).collect::<Vec<_>>();
            track.stretches.iter().map(of).collect::<Vec<_>>()
        };
        let near = |a: &[Vec<f64>], b: &[Vec<f64>]| {
            a.len() == b.len()
                && a.iter()
                    .zip(b)
                    .all(|(a, b)| a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9))
        };
        for (origin_deg, fixes, expected) in [
            (179.999, vec![179.999, 180.0, -179.999], vec![vec![179.999, 180.0, 180.001]]),
            (-179.999, vec![-179.999, 179.999, -179.998], vec![vec![-179.999, -180.001, -179.998]]),
            (114.0, vec![114.0, 114.1], vec![vec![114.0, 114.1]]),
            // The other side of the Earth is passed.
            (0.0, vec![179.0, -179.0], vec![vec![179.0], vec![-179.0]]),
            (0.0, vec![-1.0, 1.0], vec![vec![-1.0, 1.0]]),
        ] {
            let drawn = longitudes(origin_deg, &fixes);
            assert!(near(&drawn, &expected), "{origin_deg} {fixes:?}: {drawn:?}");
        }
    }

    #[test]
    fn covariances_that_are_none_give_no_ellipsoid() {
        let frame = LocalFrame::at(Ecef::new(6_378_137.0, 0.0, 0.0));
        assert!(ellipsoid(&frame, &Matrix3::from_element(f64::NAN)).is_none());
        assert!(ellipsoid(&frame, &Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0))).is_none());
        assert!(ellipsoid(&frame, &Matrix3::zeros()).is_some());
    }
}
