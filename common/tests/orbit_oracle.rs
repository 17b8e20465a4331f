//! Satellite states against reference vectors and a synthetic orbit.

use std::path::PathBuf;

use cofix_common::gnss::{Constellation, SatelliteId};
use cofix_common::orbit::{KeplerEphemeris, NavigationMessage, Products, Sp3};
use cofix_common::time::GpsTime;

fn shared(path: &str) -> Option<Vec<u8>> {
    let path = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared")).join(path);
    let bytes = std::fs::read(&path).ok();
    if bytes.is_none() {
        println!("skipped: {} is not here", path.display());
    }
    bytes
}

/// A table with its columns by name.
struct Table {
    names: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    fn read(path: &str) -> Option<Self> {
        let bytes = shared(path)?;
        let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).flexible(true).from_reader(&bytes[..]);
        let names = reader.headers().unwrap().iter().map(str::to_owned).collect();
        let rows = reader.records().map(|r| r.unwrap().iter().map(str::to_owned).collect()).collect();
        Some(Self { names, rows })
    }

    fn text<'a>(&self, row: &'a [String], name: &str) -> &'a str {
        &row[self.names.iter().position(|n| n == name).unwrap()]
    }

    fn number(&self, row: &[String], name: &str) -> f64 {
        self.text(row, name).parse().unwrap()
    }

    #[allow(clippy::cast_possible_truncation)] // whole weeks
    fn time(&self, row: &[String], prefix: &str) -> GpsTime {
        let week = self.number(row, &format!("{prefix}week")) as i64;
        GpsTime::from_week_tow(week, self.number(row, &format!("{prefix}tow_s")))
    }
}

fn ephemeris(table: &Table, row: &[String]) -> KeplerEphemeris {
    let satellite: SatelliteId = table.text(row, "sat").parse().unwrap();
    let n = |name: &str| table.number(row, name);
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
        issue_of_data: 0,
    }
}

#[test]
fn kepler_orbits_match_the_vectors() {
    let Some(table) = Table::read("oracle/sat/kepler_vectors_brd4.csv") else { return };
    let (mut compared, mut geostationary) = (0, 0);
    let (mut worst_m, mut worst_s, mut worst_mps, mut worst_sps) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64);
    for row in table.rows.iter().filter(|row| !table.text(row, "sat").starts_with('I')) {
        let ephemeris = ephemeris(&table, row);
        let time = table.time(row, "");
        let state = ephemeris.state(time);
        let expected = ["x_m", "y_m", "z_m"].map(|name| table.number(row, name));
        let error = (state.position.0 - nalgebra::Vector3::from(expected)).norm();
        worst_m = worst_m.max(error);
        worst_s = worst_s.max((state.clock_s - table.number(row, "clk_s")).abs());
        let (before, after) = (ephemeris.state(time - 0.5), ephemeris.state(time + 0.5));
        let slope = after.position - before.position;
        worst_mps = worst_mps.max((slope.0 - state.velocity.0).norm());
        worst_sps = worst_sps.max((after.clock_s - before.clock_s - state.clock_drift_sps).abs());
        compared += 1;
        geostationary += u32::from(ephemeris.satellite.is_beidou_geostationary());
    }
    println!(
        "{compared} rows ({geostationary} geostationary): {worst_m:e} m, {worst_s:e} s, velocity {worst_mps:e} m/s, drift {worst_sps:e}"
    );
    assert!(compared > 700 && geostationary > 10);
    assert!(worst_m < 1e-5, "{worst_m} m");
    assert!(worst_s < 1e-9, "{worst_s} s");
    assert!(worst_mps < 1e-4, "{worst_mps} m/s");
    assert!(worst_sps < 1e-15, "{worst_sps} s/s");
}

#[test]
fn nodes_of_precise_orbits_come_back() {
    for path in [
        "data/whu-wuhan-2020-08-13/orbits.sp3",
        "data/sp3-only/Sta21233_1400-1545_excerpt.sp3",
        "data/sp3-only/Sta21241_0515-0700_excerpt.sp3",
    ] {
        let Some(bytes) = shared(path) else { return };
        let sp3 = Sp3::parse(&bytes).unwrap();
        println!("{path}: {} epochs, {} positions, {}", sp3.epochs, sp3.positions.len(), sp3.skips);
        let products = Products::new(vec![sp3.clone()], vec![]);
        let (mut worst, mut slowest) = (0.0_f64, 0.0_f64);
        for node in &sp3.positions {
            let state = products.satellite_state(node.satellite, node.time).unwrap();
            worst = worst.max(state.position.distance_m(node.position));
            let (a, b) = (node.time - 0.05, node.time + 0.05);
            if let (Ok(a), Ok(b)) =
                (products.satellite_state(node.satellite, a), products.satellite_state(node.satellite, b))
            {
                slowest = slowest.max(((b.position - a.position).0 / 0.1 - state.velocity.0).norm());
            }
        }
        println!("worst {worst:e} m, velocity {slowest:e} m/s, {:?}", products.coverage());
        assert!(worst < 1e-6, "{worst} m");
        assert!(slowest < 1e-5, "{slowest} m/s");
    }
}
