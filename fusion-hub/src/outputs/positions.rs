//! Fused positions as a table (CSV): a row for each phone at each epoch of the group.
//!
//! | column | content |
//! |---|---|
//! | `gps_week`, `gps_tow_s` | GPS time of the state, the common time of the epoch |
//! | `phone` | its name |
//! | `latitude_deg`, `longitude_deg`, `ellipsoidal_height_m` | on WGS-84, the frame of the orbits |
//! | `velocity_north_mps`, `velocity_east_mps`, `velocity_up_mps` | velocity |
//! | `quality` | by the verdict: 1 reliable, 2 unreliable, 3 cannot be checked, 4 carried by prediction, without an epoch |
//! | `sigma_north_m`, `sigma_east_m`, `sigma_up_m` | standard deviations of the position |
//! | `sigma_velocity_north_mps`, `…_east_…`, `…_up_…` | standard deviations of the velocity |
//! | `satellites` | in use by the phone's own solution; empty without an epoch |
//! | `verdict` | on the fused position: that of its innovations, and unreliable where the phone contradicts a constraint or the others; empty without an epoch |
//! | `method` | `joint` |
//!
//! The rows of one phone are a truth table (see [`cofix_common::accuracy::Truth::parse_csv`]).

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::Context;
use cofix_agent::files::{Named, OutputFile};
use cofix_common::accuracy::TRUTH_COLUMNS;
use cofix_common::filter::PhoneState;
use cofix_common::frames::{Enu, LocalFrame};
use cofix_common::fusion::engine::FusedEpoch;
use cofix_common::integrity::Verdict;
use cofix_common::skips::Skips;
use nalgebra::Matrix3;

use crate::outputs::{Fused, Opening, Sink, Written};

/// The columns: those of a truth table, the phone after the time, and more.
const COLUMNS: [&str; 19] = {
    let [week, tow, latitude, longitude, height, north, east, up, quality] = TRUTH_COLUMNS;
    [
        week,
        tow,
        "phone",
        latitude,
        longitude,
        height,
        north,
        east,
        up,
        quality,
        "sigma_north_m",
        "sigma_east_m",
        "sigma_up_m",
        "sigma_velocity_north_mps",
        "sigma_velocity_east_mps",
        "sigma_velocity_up_mps",
        "satellites",
        "verdict",
        "method",
    ]
};

/// The table in a file.
struct PositionFile {
    table: csv::Writer<OutputFile>,
    path: PathBuf,
}

/// Opens the table in a file.
///
/// # Errors
/// When the file cannot be created.
pub(super) fn open(opening: &Opening<'_>) -> anyhow::Result<Box<dyn Sink>> {
    let path = opening.path.to_owned();
    let file = OutputFile::create(Named::new("the positions", &path), opening.overwrite)?;
    let mut table = csv::Writer::from_writer(file);
    table.write_record(COLUMNS).with_context(|| cannot_write(&path))?;
    Ok(Box::new(PositionFile { table, path }))
}

impl Sink for PositionFile {
    fn epoch(&mut self, fused: &Fused<'_>) -> anyhow::Result<()> {
        write(&mut self.table, fused.epoch, fused.phones).with_context(|| cannot_write(&self.path))
    }

    fn finish(self: Box<Self>, _text: &str) -> Result<Option<Written>, String> {
        let Self { table, path } = *self;
        let file = table.into_inner().map_err(csv::IntoInnerError::into_error);
        let file = file.map_err(|error| format!("{}: {error}", cannot_write(&path)))?;
        file.commit().map_err(|error| error.to_string())?;
        Ok(Some(Written { title: "Positions", path, figures: String::new(), skips: Skips::default() }))
    }
}

/// Writes the rows of the phones that have a state.
fn write(table: &mut csv::Writer<impl Write>, epoch: &FusedEpoch, names: &[String]) -> csv::Result<()> {
    let time = epoch.time_gps;
    for (name, phone) in names.iter().zip(&epoch.phones) {
        let Some(state) = &phone.state else { continue };
        let message = phone.message.as_ref();
        let mut row = vec![time.week().to_string(), format!("{:.9}", time.tow_s()), name.clone()];
        row.extend(place(state));
        row.push(quality(phone.verdict).to_string());
        row.extend(sigmas(state));
        row.push(message.map_or_else(String::new, |m| m.satellites_used().to_string()));
        row.push(phone.verdict.map_or_else(String::new, |verdict| verdict.to_string()));
        row.push("joint".to_owned());
        table.write_record(row)?;
    }
    Ok(())
}

fn cannot_write(path: &Path) -> String {
    format!("{}: cannot write the positions", path.display())
}

/// Position and velocity. 11 digits of a degree are a micrometre.
fn place(state: &PhoneState) -> [String; 6] {
    let position = state.position().ecef_to_geodetic();
    let Enu { east, north, up } = LocalFrame::at(state.position()).vector_ecef_to_enu(state.velocity());
    [
        format!("{:.11}", position.latitude_deg()),
        format!("{:.11}", position.longitude_deg()),
        format!("{:.4}", position.height_m),
        format!("{north:.4}"),
        format!("{east:.4}"),
        format!("{up:.4}"),
    ]
}

/// Standard deviations north, east, up of the position and of the velocity.
fn sigmas(state: &PhoneState) -> impl Iterator<Item = String> {
    let frame = LocalFrame::at(state.position());
    [0, 3].into_iter().flat_map(move |block| {
        let covariance: Matrix3<f64> = state.covariance.fixed_view::<3, 3>(block, block).into_owned();
        let enu = frame.covariance_ecef_to_enu(&covariance);
        [enu.m22, enu.m11, enu.m33].map(|variance| format!("{:.4}", variance.max(0.0).sqrt()))
    })
}

const fn quality(verdict: Option<Verdict>) -> u8 {
    match verdict {
        None => 4,
        Some(Verdict::Reliable) => 1,
        Some(Verdict::Unreliable(_)) => 2,
        Some(Verdict::CannotBeChecked) => 3,
    }
}

#[cfg(test)]
mod tests {
    use cofix_common::accuracy::Truth;
    use cofix_common::frames::Geodetic;
    use cofix_common::fusion::engine::FusedPhone;
    use cofix_common::time::GpsTime;
    use nalgebra::{SMatrix, SVector};

    use super::*;
    use crate::testing::judged;

    fn epoch(time_gps: GpsTime, state: Option<PhoneState>, verdict: Option<Verdict>) -> FusedEpoch {
        let message = verdict.map(|verdict| judged("a, b", time_gps, verdict));
        FusedEpoch {
            time_gps,
            phones: vec![FusedPhone { message, state, verdict, ..FusedPhone::default() }],
            actions: vec![],
            distances: vec![],
            events: vec![],
        }
    }

    #[test]
    fn what_is_written_reads_back_as_a_truth() {
        let start = GpsTime::from_week_tow(2118, 604_799.999_876_543);
        let site = Geodetic::from_degrees(-17.5, 179.999_999_9, 31.25).geodetic_to_ecef();
        let frame = LocalFrame::at(site);
        let velocity = frame.vector_enu_to_ecef(Enu { east: 2.0, north: -1.0, up: 0.25 });
        let mut mean = SVector::<f64, 9>::zeros();
        mean.fixed_rows_mut::<3>(0).copy_from(&site.0);
        mean.fixed_rows_mut::<3>(3).copy_from(&velocity.0);
        let enu = Matrix3::from_diagonal(&nalgebra::Vector3::new(4.0, 9.0, 16.0));
        let mut covariance = SMatrix::<f64, 9, 9>::identity();
        let ecef = frame.rotation_ecef_to_enu().transpose() * enu * frame.rotation_ecef_to_enu();
        covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(&ecef);
        let state = PhoneState { mean, covariance };
        let mut table = csv::Writer::from_writer(Vec::new());
        table.write_record(COLUMNS).unwrap();
        let mut push = |epoch| write(&mut table, &epoch, &["a, b".to_owned()]).unwrap();
        push(epoch(start, None, Some(Verdict::CannotBeChecked)));
        push(epoch(start, Some(state.clone()), Some(Verdict::Reliable)));
        push(epoch(start + 1.0, Some(state), None));
        let bytes = table.into_inner().unwrap();
        let text = String::from_utf8(bytes.clone()).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], COLUMNS.join(","));
        assert_eq!(lines.len(), 3, "an epoch without a state has no row: {text}");
        assert!(lines[1].contains(",1,3.0000,2.0000,4.0000,1.0000,1.0000,1.0000,0,reliable,joint"), "{text}");
        assert!(lines[2].ends_with(",,,joint") && lines[2].contains(",4,3.0000"), "{text}");
        let (truth, skips) = Truth::parse_csv(&bytes).unwrap();
        assert!(skips.is_empty(), "{skips}");
        assert_eq!(truth.times(&[1]).collect::<Vec<_>>(), [start]);
        let point = truth.at(start, &[1]).unwrap();
        assert!(point.position.distance_m(site) < 1e-4);
        assert!((point.velocity.0 - velocity.0).norm() < 1e-3);
    }
}
