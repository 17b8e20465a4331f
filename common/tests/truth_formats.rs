//! Reference trajectories of RTKLIB and NMEA.

#![allow(clippy::unwrap_used)] // helpers of tests

use cofix_common::accuracy::Truth;
use cofix_common::formats::truth::{nmea, recognise, rtklib_pos};
use cofix_common::frames::LocalFrame;
use cofix_common::skips::{Reason, Skips};
use cofix_common::time::GpsTime;
use proptest::prelude::*;

mod beside;

const ALL: [u8; 6] = [1, 2, 3, 4, 5, 6];

fn read(text: &str) -> (Truth, Skips) {
    recognise(text.as_bytes()).read(text.as_bytes(), GpsTime::default()).unwrap()
}

fn place(truth: &Truth, time: &str) -> (f64, f64, f64) {
    let point = truth.at(time.parse().unwrap(), &ALL).unwrap();
    let place = LocalFrame::at(point.position).geodetic();
    (place.latitude_deg(), place.longitude_deg(), place.height_m)
}

fn is_near((a, b, c): (f64, f64, f64), (x, y, z): (f64, f64, f64)) -> bool {
    (a - x).abs() < 1e-9 && (b - y).abs() < 1e-9 && (c - z).abs() < 1e-3
}

const DEGREES: &str = "\
% program   : RTKLIB ver.2.4.3
% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix,2:float,3:sbas,4:dgps,5:single,6:ppp,ns=# of satellites)
%  GPST                  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)
2020/08/13 14:19:00.000   30.500000000  114.250000000    25.5000   1  12   0.0100   0.0100   0.0200
2020/08/13 14:19:01.000   30.500010000  114.250000000    25.5000   2  12   0.0100   0.0100   0.0200
2020/08/13 14:19:02.000   30.500020000  114.250000000    25.5000   5  12   0.0100   0.0100   0.0200
2020/08/13 14:19:03.000   30.5000300xx  114.250000000    25.5000   1  12   0.0100   0.0100   0.0200
";

#[test]
fn a_solution_in_degrees_has_velocities_by_its_positions() {
    assert_eq!(recognise(DEGREES.as_bytes()).name, "RTKLIB solution");
    let (truth, skips) = read(DEGREES);
    assert!(is_near(place(&truth, "2020-08-13T14:19:01"), (30.500_01, 114.25, 25.5)));
    let point = truth.at("2020-08-13T14:19:01".parse().unwrap(), &ALL).unwrap();
    let velocity = LocalFrame::at(point.position).vector_ecef_to_enu(point.velocity);
    assert!((velocity.north - 1.1086).abs() < 1e-3 && velocity.east.abs() < 1e-6, "{velocity:?}");
    assert_eq!((truth.times(&[1]).count(), truth.times(&[2]).count(), truth.times(&[5]).count()), (1, 1, 1));
    assert_eq!((skips.count(Reason::TruthRowUnreadable), skips.total()), (1, 1), "{skips}");
}

#[test]
fn every_clock_and_every_form_of_a_solution_is_the_same_trajectory() {
    let expected = (30.5, 114.25, 25.5);
    let at = "2020-08-13T14:19:00";
    let second = |text: &str| text.replace("14:19:00", "14:19:01");
    for (header, row) in [
        ("%  GPST  latitude(deg) longitude(deg) height(m) Q ns", "2118 397140.000 30.5 114.25 25.5 1 9"),
        (
            "%  UTC  latitude(deg) longitude(deg) height(m) Q ns",
            "2020/08/13 14:18:42.000 30.5 114.25 25.5 1 9",
        ),
        (
            "%  JST  latitude(deg) longitude(deg) height(m) Q ns",
            "2020/08/13 23:18:42.000 30.5 114.25 25.5 1 9",
        ),
        (
            "%  GPST,latitude(deg),longitude(deg),height(m),Q,ns",
            "2020/08/13 14:19:00.000,30.5,114.25,25.5,1,9",
        ),
        (
            "%  GPST  latitude(d'\") longitude(d'\") height(m) Q ns",
            "2020/08/13 14:19:00.000 30 30 0.0 114 15 0.0 25.5 1 9",
        ),
        (
            "%  GPST  latitude(deg) longitude(deg) height(m) Q ns vn(m/s) ve(m/s) vu(m/s)",
            "2020/08/13 14:19:00.000 30.5 114.25 25.5 1 9 0.0 0.0 0.0",
        ),
    ] {
        let next = if row.starts_with("2118") { row.replace("140.", "141.") } else { second(row) };
        let next = next.replace(":18:42", ":18:43");
        let (truth, skips) = read(&format!("{header}\n{row}\n{next}\n"));
        assert!(is_near(place(&truth, at), expected), "{header}: {:?}", place(&truth, at));
        assert!(skips.is_empty(), "{header}: {skips}");
    }
}

#[test]
fn what_is_no_position_is_refused() {
    let baseline = "%  GPST  e-baseline(m) n-baseline(m) u-baseline(m) Q ns\n2118 397140.0 1 2 3 1 9\n";
    assert!(!rtklib_pos::is_solution(baseline.as_bytes()));
    let error = rtklib_pos::read(baseline.as_bytes()).unwrap_err().to_string();
    assert!(error.contains("latitude(deg)"), "{error}");
    let geodetic = DEGREES.replace("ellipsoidal", "geodetic");
    let (_, skips) = read(&geodetic);
    assert_eq!(skips.count(Reason::HeightsAboveGeoid), 1);
}

fn sentence(body: &str) -> String {
    let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
    format!("${body}*{sum:02X}\r\n")
}

fn gga(time: &str, latitude: &str, quality: u8) -> String {
    sentence(&format!("GNGGA,{time},{latitude},N,11415.0000000,E,{quality},12,0.8,40.500,M,-15.000,M,,"))
}

fn rmc(time: &str, date: &str) -> String {
    sentence(&format!("GNRMC,{time},A,3030.0000000,N,11415.0000000,E,0.0,0.0,{date},,,A"))
}

#[test]
fn nmea_has_dates_heights_and_qualities() {
    let text = [
        gga("141842.00", "3030.0000000", 4),
        rmc("141842.00", "130820"),
        "$PUBX,00,1*00\r\nnoise\r\n".to_owned(),
        gga("141843.00", "3030.0006000", 5),
        rmc("141843.00", "130820"),
        gga("141844.00", "3030.0012000", 1),
        gga("141845.00", "", 0),
        gga("141846.00", "3030.0024000", 1).replace("3030", "3031"),
    ]
    .concat();
    assert_eq!(recognise(text.as_bytes()).name, "NMEA");
    assert!(!recognise(text.as_bytes()).needs_date(text.as_bytes()));
    let (truth, skips) = read(&text);
    assert!(is_near(place(&truth, "2020-08-13T14:19:00"), (30.5, 114.25, 25.5)));
    assert!(is_near(place(&truth, "2020-08-13T14:19:01"), (30.500_01, 114.25, 25.5)));
    let of = |quality: u8| truth.times(&[quality]).count();
    assert_eq!((of(1), of(2), of(5)), (1, 1, 1));
    assert_eq!(skips.count(Reason::NmeaSentenceWrongChecksum), 2, "{skips}");
}

#[test]
fn nmea_goes_on_over_midnight_with_and_without_a_date() {
    let fixes = [gga("235959.00", "3030.0", 4), gga("000000.00", "3030.0", 4), gga("000001.00", "3030.0", 4)]
        .concat();
    let dated = fixes.clone() + &rmc("000001.00", "140820");
    let (truth, _) = read(&dated);
    let expected = ("2020-08-14T00:00:17".parse().unwrap(), "2020-08-14T00:00:19".parse().unwrap());
    assert_eq!(truth.span(), Some(expected));
    assert!(!nmea::has_date(fixes.as_bytes()));
    for near in ["2020-08-13T20:00:00", "2020-08-14T00:00:18", "2020-08-14T11:00:00"] {
        let (truth, _) = nmea::read(fixes.as_bytes(), near.parse().unwrap()).unwrap();
        assert_eq!(truth.span(), Some(expected), "{near}");
    }
}

#[test]
#[ignore = "needs the reference data"]
fn solutions_of_rtklib_are_read_whole() {
    let folder = beside::path("oracle/pos");
    let mut files = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|extension| extension != "pos") {
            continue;
        }
        let bytes = std::fs::read(&path).unwrap();
        let rows = String::from_utf8_lossy(&bytes).lines().filter(|line| !line.starts_with('%')).count();
        let (truth, skips) = rtklib_pos::read(&bytes).unwrap();
        let stated_velocities = skips.count(Reason::VelocityContradictsPositions);
        assert_eq!(truth.times(&ALL).count(), rows, "{}: {skips}", path.display());
        assert_eq!(skips.total(), stated_velocities, "{}: {skips}", path.display());
        files += 1;
    }
    assert!(files >= 10, "{files}");
}

proptest! {
    #[test]
    fn no_bytes_are_a_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400), cut in 0..600_usize, at in 0..600_usize, byte: u8) {
        let mut damaged = DEGREES.as_bytes().to_vec();
        damaged.truncate(cut.max(1));
        let at = at % damaged.len();
        damaged[at] = byte;
        for bytes in [bytes, damaged] {
            let _ = rtklib_pos::read(&bytes);
            let _ = nmea::read(&bytes, GpsTime::default());
        }
    }
}
