//! Reference vectors of satellite states, with their columns by name.

#![allow(dead_code, clippy::unwrap_used, clippy::indexing_slicing)] // not every test uses everything; helpers of tests

#[path = "../beside/mod.rs"]
pub mod beside;

use beside::required;
use cofix_common::frames::{Ecef, EcefVector};
use cofix_common::gnss::{Constellation, SatelliteId};
use cofix_common::orbit::{GlonassEphemeris, KeplerEphemeris, NavigationMessage};
use cofix_common::time::GpsTime;

/// A table with its columns by name.
pub struct Table {
    names: Vec<String>,
    pub rows: Vec<Vec<String>>,
}

impl Table {
    pub fn read(path: &str) -> Self {
        let bytes = required(path);
        let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).flexible(true).from_reader(&bytes[..]);
        let names = reader.headers().unwrap().iter().map(str::to_owned).collect();
        let rows = reader.records().map(|r| r.unwrap().iter().map(str::to_owned).collect()).collect();
        Self { names, rows }
    }

    pub fn text<'a>(&self, row: &'a [String], name: &str) -> &'a str {
        &row[self.names.iter().position(|n| n == name).unwrap()]
    }

    pub fn number(&self, row: &[String], name: &str) -> f64 {
        self.text(row, name).parse().unwrap()
    }

    #[allow(clippy::cast_possible_truncation)] // whole weeks
    pub fn time(&self, row: &[String], prefix: &str) -> GpsTime {
        let week = self.number(row, &format!("{prefix}week")) as i64;
        GpsTime::from_week_tow(week, self.number(row, &format!("{prefix}tow_s")))
    }
}

/// The ephemeris that a row of the Kepler vectors is of.
pub fn kepler(table: &Table, row: &[String]) -> KeplerEphemeris {
    let satellite: SatelliteId = table.text(row, "sat").parse().unwrap();
    let n = |name: &str| table.number(row, name);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // small whole numbers
    KeplerEphemeris {
        satellite,
        message: match satellite.constellation {
            Constellation::Galileo => NavigationMessage::GalileoInav,
            Constellation::Beidou => NavigationMessage::BeidouD1D2,
            _ => NavigationMessage::Lnav,
        },
        toe: table.time(row, "toe_"),
        toe_own_tow_s: n("toes_s"),
        toc: table.time(row, "toc_"),
        sqrt_a: n("sqrtA"),
        eccentricity: n("e"),
        i0_rad: n("i0"),
        i_dot_radps: n("idot"),
        omega0_rad: n("Omega0"),
        omega_dot_radps: n("OmegaDot"),
        omega_rad: n("omega"),
        m0_rad: n("M0"),
        delta_n_radps: n("deltan"),
        cuc_cus_rad: (n("cuc"), n("cus")),
        crc_crs_m: (n("crc"), n("crs")),
        cic_cis_rad: (n("cic"), n("cis")),
        clock: (n("af0"), n("af1"), n("af2")),
        group_delays_s: (n("tgd0"), n("tgd1")),
        accuracy_m: 2.0,
        health: n("svh"),
        issue_of_data: n("iode") as u32,
        // Not among the columns.
        issue_of_clock: 3,
    }
}

/// The ephemeris that a row of the GLONASS vectors is of.
pub fn glonass(table: &Table, row: &[String]) -> GlonassEphemeris {
    let n = |name: &str| table.number(row, name);
    let vector = |names: [&str; 3]| nalgebra::Vector3::from(names.map(n));
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // small whole numbers
    GlonassEphemeris {
        satellite: table.text(row, "sat").parse().unwrap(),
        toe: table.time(row, "toe_"),
        position: Ecef(vector(["x0_m", "y0_m", "z0_m"])),
        velocity: EcefVector(vector(["vx0_mps", "vy0_mps", "vz0_mps"])),
        acceleration: EcefVector(vector(["ax_mps2", "ay_mps2", "az_mps2"])),
        tau_s: n("taun_s"),
        gamma: n("gamn"),
        l2_delay_s: None,
        frequency_channel: n("fcn") as i8,
        health: Some(n("svh") as u8),
        health_flags: None,
        age_days: 0.0,
        accuracy_m: 5.0,
    }
}

/// Distance of a position from the one that a row states, m.
pub fn distance_m(table: &Table, row: &[String], position: Ecef) -> f64 {
    let expected = ["x_m", "y_m", "z_m"].map(|name| table.number(row, name));
    (position.0 - nalgebra::Vector3::from(expected)).norm()
}
