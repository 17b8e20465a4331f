//! Truth tables of the WHU-Smartphone dataset, written by hand.

#![allow(clippy::unwrap_used)] // helpers of tests

use cofix_common::accuracy::{Truth, TruthError};
use cofix_common::formats::whu::{is_truth_table, truth_table};
use cofix_common::frames::LocalFrame;
use cofix_common::skips::{Reason, Skips};
use cofix_common::time::GpsTime;

const HEADER: &str = "   GPSTime         Latitude        Longitude      H-Ell      Vel-N      Vel-E    Vel-U   Q\r\n     (sec)            (Deg)            (Deg)        (m)      (m/s)      (m/s)    (m/s)  \r\n";
const EXCHANGED: &str = Reason::VelocityColumnsExchanged.text();

fn near() -> GpsTime {
    GpsTime::from_week_tow(2118, 397_140.0)
}

fn read(rows: &str, near: GpsTime) -> (Truth, Skips) {
    let table = format!("{HEADER}{rows}");
    assert!(is_truth_table(table.as_bytes()));
    truth_table(table.as_bytes(), near).unwrap()
}

/// Rows of a car that drives north with 13.0 m/s and east with 0.6 m/s.
fn rows(first_s: f64, velocities: &str) -> String {
    let row = |k: f64| {
        let tow_s = (first_s + k) % 604_800.0;
        let (latitude, longitude) = (30.6 + k * 1.1728e-4, 114.08 + k * 6.26e-6);
        format!(
            " {tow_s:.2}    {latitude:.10}   {longitude:.10}     14.470   {velocities}    0.1       1 \r\n"
        )
    };
    [0.0, 1.0, 2.0, 3.0, 4.0].map(row).concat()
}

fn velocity(truth: &Truth, time: GpsTime) -> (f64, f64) {
    let point = truth.at(time, &[1]).unwrap();
    let velocity = LocalFrame::at(point.position).vector_ecef_to_enu(point.velocity);
    (velocity.north, velocity.east)
}

#[test]
fn velocities_are_told_by_the_positions() {
    for (columns, exchanged) in [("0.600 13.000", 1), ("13.000 0.600", 0)] {
        let (truth, skips) = read(&rows(397_138.0, columns), near());
        assert_eq!((skips.count(EXCHANGED), skips.total()), (exchanged, exchanged), "{skips}");
        let (north, east) = velocity(&truth, near());
        assert!((north - 13.0).abs() < 1e-3 && (east - 0.6).abs() < 1e-3, "{columns}: {north} {east}");
    }
}

/// One row with a wrong position or velocity does not turn the table.
#[test]
fn a_standing_car_and_a_wrong_row_turn_nothing() {
    let standing =
        rows(397_138.0, "0.002 -0.001").replace("30.6001", "30.6000").replace("30.6002", "30.6000");
    assert_eq!(read(&standing, near()).1.count(EXCHANGED), 0);
    let text = rows(397_138.0, "13.000 0.600");
    let wrong = text.replacen("13.000 0.600", "0.600 13.000", 1);
    assert_eq!(read(&wrong, near()).1.count(EXCHANGED), 0);
}

#[test]
fn rows_are_in_the_week_that_is_near() {
    for (first_s, near, week) in [
        (604_798.0, GpsTime::from_week_tow(2118, 604_790.0), 2118),
        (604_798.0, GpsTime::from_week_tow(2119, 10.0), 2118),
        (10.0, GpsTime::from_week_tow(2118, 604_790.0), 2119),
        (10.0, GpsTime::from_week_tow(2118, 302_000.0), 2118),
    ] {
        let (truth, skips) = read(&rows(first_s, "13.000 0.600"), near);
        assert!(skips.is_empty(), "{skips}");
        let first = GpsTime::from_week_tow(week, first_s);
        assert_eq!(truth.span().unwrap(), (first, first + 4.0), "{first_s} near {near}");
    }
}

#[test]
fn qualities_and_bad_rows() {
    let rows = " 1.0 30 114 20 0 0 0 1\n 2.0 30 114 20 0 0 0 4\n 3.0 30 114 20 0 0 0\n 4.0 30 x 20 0 0 0 1\n 5.0 300 114 20 0 0 0 1\n\n \
                6.0 30 114 20 0 0 0 1.5\n 7.0 30 114 nan 0 0 0 1\n \u{e9} 30 114 20 0 0 0 1\n";
    let (truth, skips) = read(rows, near());
    assert_eq!((truth.times(&[1]).count(), truth.times(&[4]).count()), (1, 1));
    assert_eq!(
        (skips.count(Reason::TruthRowUnreadable), skips.count(Reason::TruthRowOutOfRange)),
        (4, 2),
        "{skips}"
    );
}

#[test]
fn columns_go_by_their_names() {
    let table =
        "\u{feff}\nQ Vel-U Vel-E Vel-N H-Ell Longitude Latitude GPSTime\n1 0 0 0 20.5 114 30 397140.000\n";
    let (truth, _) = truth_table(table.as_bytes(), near()).unwrap();
    let position = truth.at(near(), &[1]).unwrap().position;
    let expected = cofix_common::frames::Geodetic::from_degrees(30.0, 114.0, 20.5).geodetic_to_ecef();
    assert!(position.distance_m(expected) < 1e-6);
    let without = "GPSTime Latitude Longitude H-Ell Pitch Roll Heading\n1 2 3 4 5 6 7\n";
    let error = truth_table(without.as_bytes(), near()).unwrap_err();
    assert!(matches!(error, TruthError::Column { column: "Vel-N", .. }), "{error}");
    let empty = truth_table(HEADER.as_bytes(), near()).unwrap_err();
    assert!(matches!(empty, TruthError::Empty { rows: 0, .. }), "{empty}");
    assert!(!is_truth_table(b"gps_week,gps_tow_s\n") && !is_truth_table(b"") && !is_truth_table(b"\xff\n"));
}
