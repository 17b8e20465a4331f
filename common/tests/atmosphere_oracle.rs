//! Klobuchar and Saastamoinen against grids made by RTKLIB.

mod oracle;

use cofix_common::atmosphere::{KlobucharCoefficients, klobuchar_delay_l1_m, saastamoinen_delay_m};
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
        let delay_m = saastamoinen_delay_m(receiver, direction, row[4]);
        assert!((delay_m - row[5]).abs() < 1e-9, "{row:?}: {delay_m}");
    }
}
