//! Geodetic, Earth-fixed and local coordinates against RTKLIB, poles and the date line included.

mod oracle;

use cofix_common::frames::{Ecef, EcefVector, Geodetic, LocalFrame};

#[test]
#[ignore = "needs the reference data"]
fn geodetic_earth_fixed_and_local() {
    let rows = oracle::rows("geodesy_llh_ecef_enu.csv");
    assert!(rows.len() >= 350, "{}", rows.len());
    for row in rows {
        let geodetic = Geodetic::from_degrees(row[0], row[1], row[2]);
        let point = geodetic.geodetic_to_ecef();
        let printed = Ecef::new(row[3], row[4], row[5]);
        assert!(point.distance_m(printed) < 2e-6, "{row:?}: {point:?}");

        let back = point.ecef_to_geodetic();
        assert!((back.latitude_rad - geodetic.latitude_rad).abs() < 1e-12, "{row:?}: {back:?}");
        assert!((back.height_m - row[2]).abs() < 1e-6, "{row:?}: {back:?}");
        assert!(back.geodetic_to_ecef().distance_m(point) < 1e-6, "{row:?}: {back:?}");

        let at_pole = row[0].abs() == 90.0;
        if !at_pole {
            let turn = (back.longitude_rad - geodetic.longitude_rad).rem_euclid(std::f64::consts::TAU);
            assert!(turn.min(std::f64::consts::TAU - turn) < 1e-9, "{row:?}: {back:?}");
            let local = LocalFrame::at(point).vector_ecef_to_enu(EcefVector::new(100.0, 200.0, 300.0));
            let difference = local.vector() - nalgebra::Vector3::new(row[9], row[10], row[11]);
            assert!(difference.norm() < 1e-6, "{row:?}: {local:?}");
        }
    }
}
