//! Klobuchar, Saastamoinen and the mapping functions of Niell against grids made by RTKLIB.

mod oracle;

use cofix_common::atmosphere::{
    KlobucharCoefficients, NiellMapping, Troposphere, TroposphereMapping, klobuchar_delay_l1_m,
};
use cofix_common::frames::{Direction, Geodetic};
use cofix_common::time::GpsTime;

#[test]
#[ignore = "needs the reference data"]
fn klobuchar_grid() {
    let rows = oracle::rows("sat/klobuchar_grid.csv");
    assert!(rows.len() > 2_000, "{}", rows.len());
    for row in rows {
        let four = |from: usize| [row[from], row[from + 1], row[from + 2], row[from + 3]];
        let coefficients = KlobucharCoefficients { alpha: four(0), beta: four(4) };
        let receiver = Geodetic::from_degrees(row[9], row[10], 0.0);
        let direction = Direction { azimuth_rad: row[11].to_radians(), elevation_rad: row[12].to_radians() };
        let time = GpsTime::from_week_tow(2_000, row[8]);
        let delay_m = klobuchar_delay_l1_m(&coefficients, receiver, direction, time);
        assert!((delay_m - row[13]).abs() < 1e-9, "{row:?}: {delay_m}");
    }
}

#[test]
#[ignore = "needs the reference data"]
fn saastamoinen_grid() {
    let rows = oracle::rows("sat/saastamoinen_nmf_grid.csv");
    assert!(rows.len() > 1_600, "{}", rows.len());
    for row in rows {
        let receiver = Geodetic::from_degrees(row[1], 0.0, row[2]);
        let direction = Direction { azimuth_rad: 0.0, elevation_rad: row[3].to_radians() };
        let time = GpsTime::from_week_tow(2_000, 0.0);
        let troposphere = Troposphere::at(receiver, time, TroposphereMapping::Cosecant, row[4]);
        let delay_m = troposphere.delay_m(direction);
        assert!((delay_m - row[5]).abs() < 1e-9, "{row:?}: {delay_m}");
    }
}

#[test]
#[ignore = "needs the reference data"]
fn niell_grid() {
    for row in oracle::rows("sat/saastamoinen_nmf_grid.csv") {
        let mapping = NiellMapping::at(row[1].to_radians(), row[2], row[0]);
        let (hydrostatic, wet) = (mapping.hydrostatic(row[3].to_radians()), mapping.wet(row[3].to_radians()));
        assert!((hydrostatic - row[6]).abs() < 1e-9, "{row:?}: {hydrostatic}");
        assert!((wet - row[7]).abs() < 1e-9, "{row:?}: {wet}");
    }
}
