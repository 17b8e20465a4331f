//! Fused states as JSON lines: one object for each phone at each epoch of the group (`docs/states.md` has the keys).

use std::io::{self, Write};

use anyhow::Context;
use cofix_agent::files::{Named, OutputFile};
use cofix_common::filter::PhoneState;
use cofix_common::frames::LocalFrame;
use cofix_common::fusion::engine::FusedPhone;
use cofix_common::skips::Skips;
use cofix_common::time::GpsTime;
use cofix_common::wire::EpochMessage;
use nalgebra::Matrix3;
use serde::Serialize;

use super::sink::{Fused, Opening, Sink, Written};

/// One line. Vectors are east, north, up.
#[derive(Serialize)]
struct Line<'a> {
    time_gps: Time,
    phone: &'a str,
    latitude_deg: f64,
    longitude_deg: f64,
    height_m: f64,
    velocity_enu_mps: [f64; 3],
    position_sigma_enu_m: [f64; 3],
    position_covariance_enu_m2: [[f64; 3]; 3],
    satellites: Option<usize>,
    verdict: Option<String>,
    protection_level_horizontal_m: Option<f64>,
    protection_level_vertical_m: Option<f64>,
}

#[derive(Serialize)]
struct Time {
    week: i64,
    tow_s: f64,
}

/// The lines in a file.
struct StateFile(OutputFile);

/// Opens the file.
///
/// # Errors
/// When it cannot be created.
pub(super) fn open(opening: &Opening<'_>) -> anyhow::Result<Box<dyn Sink>> {
    let named = Named::new("the states", opening.path);
    Ok(Box::new(StateFile(OutputFile::create(named, opening.overwrite)?)))
}

impl Sink for StateFile {
    fn epoch(&mut self, fused: &Fused<'_>) -> anyhow::Result<()> {
        let time_gps = fused.epoch.time_gps;
        let mut phones = fused.phones.iter().zip(&fused.epoch.phones);
        phones
            .try_for_each(|(name, phone)| match json(time_gps, name, phone)? {
                Some(text) => writeln!(self.0, "{text}"),
                None => Ok(()),
            })
            .with_context(|| format!("{}: cannot write the states", self.0.path().display()))
    }

    fn finish(self: Box<Self>, _text: &str) -> Result<Option<Written>, String> {
        let path = self.0.path().to_owned();
        self.0.commit().map_err(|error| error.to_string())?;
        Ok(Some(Written { title: "States", path, figures: String::new(), skips: Skips::default() }))
    }
}

/// A phone's line without its end; `None` for a phone without a state.
pub(super) fn json(time_gps: GpsTime, name: &str, phone: &FusedPhone) -> io::Result<Option<String>> {
    let line = phone.state.as_ref().map(|state| line(time_gps, name, phone, state));
    Ok(line.map(|line| serde_json::to_string(&line)).transpose()?)
}

fn line<'a>(time_gps: GpsTime, name: &'a str, phone: &FusedPhone, state: &PhoneState) -> Line<'a> {
    let position = state.position().ecef_to_geodetic();
    let frame = LocalFrame::at(state.position());
    let velocity = frame.vector_ecef_to_enu(state.velocity());
    let covariance: Matrix3<f64> = state.covariance.fixed_view::<3, 3>(0, 0).into_owned();
    let enu = frame.covariance_ecef_to_enu(&covariance);
    let message = phone.message.as_ref();
    Line {
        time_gps: Time { week: time_gps.week(), tow_s: time_gps.tow_s() },
        phone: name,
        latitude_deg: position.latitude_deg(),
        longitude_deg: position.longitude_deg(),
        height_m: position.height_m,
        velocity_enu_mps: [velocity.east, velocity.north, velocity.up],
        position_sigma_enu_m: [enu.m11, enu.m22, enu.m33].map(|variance| variance.max(0.0).sqrt()),
        position_covariance_enu_m2: [
            [enu.m11, enu.m12, enu.m13],
            [enu.m21, enu.m22, enu.m23],
            [enu.m31, enu.m32, enu.m33],
        ],
        satellites: message.map(EpochMessage::satellites_used),
        verdict: phone.verdict.map(|verdict| verdict.to_string()),
        protection_level_horizontal_m: phone.protection.map(|levels| levels.horizontal_m),
        protection_level_vertical_m: phone.protection.map(|levels| levels.vertical_m),
    }
}
