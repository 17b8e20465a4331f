//! What a phone says of itself, in an inspection.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../../common/tests/beside/mod.rs"]
mod beside;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use cofix_agent::inspect::{InspectOptions, Inspection, inspect};
use cofix_agent::{ProductSource, Stop};
use cofix_common::constants::SPEED_OF_LIGHT_MPS;
use cofix_common::formats::phone::{PhoneReport, SystemStatus, Typical};
use cofix_common::frames::{Direction, LocalFrame};
use cofix_common::gnss::{Constellation, SatelliteId};
use cofix_common::simulation::{Scenario, SimulatedEpoch, Simulation};

const HEADER: &str = "# Raw,TimeNanos,FullBiasNanos,Svid,State,ReceivedSvTimeNanos,CarrierFrequencyHz,ConstellationType,Cn0DbHz
# Fix,Provider,LatitudeDegrees,LongitudeDegrees,AltitudeMeters,SpeedMps,AccuracyMeters,BearingDegrees,UnixTimeMillis
# Status,UnixTimeMillis,SignalCount,SignalIndex,ConstellationType,Svid,CarrierFrequencyHz,Cn0DbHz,AzimuthDegrees,ElevationDegrees,UsedInFix,HasAlmanacData,HasEphemerisData,BasebandCn0DbHz
";

fn run(path: &Path, options: &InspectOptions) -> Inspection {
    inspect(path, options, &Stop::default()).unwrap()
}

fn write(folder: &Path, text: &str) -> PathBuf {
    let path = folder.join("phone.txt");
    std::fs::write(&path, text).unwrap();
    path
}

#[test]
fn fixes_and_reports_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let mut text = HEADER.to_owned();
    for second in 0..10 {
        let millis = 1_699_358_382_000_i64 + second * 1_000;
        writeln!(text, "Fix,gps,48.0,11.0,500,0.1,{},90,{millis}", 3.0 + second as f64).unwrap();
        // One line more in the second half, of a satellite that is not received.
        writeln!(text, "Status,,3,0,1,5,1575420030,35,90,45,1,1,1,").unwrap();
        writeln!(text, "Status,,3,1,1,7,1575420030,25,180,20,{},1,1,", second % 2).unwrap();
        if second >= 5 {
            writeln!(text, "Status,,3,2,6,11,,0,0,0,0,1,0,").unwrap();
        }
    }
    text += "Fix,network,48.0,11.0,,,,,1699358382000\n";
    let inspection = run(&write(folder.path(), &text), &InspectOptions::default());
    let table = inspection.to_string();
    let PhoneReport { fixes, status } = inspection.phone.clone().unwrap();
    let shape: Vec<_> = fixes.iter().map(|f| (f.provider, f.count, f.span_s, f.accuracy_m)).collect();
    let typical = Typical { median: 7.0, p90: 11.0 };
    assert_eq!(shape, [("gnss", 10, 9.0, Some(typical)), ("network", 1, 0.0, None)]);
    assert_eq!(fixes[0].first_gps, "2023-11-07T12:00:00.000");
    let status = status.unwrap();
    assert_eq!(status.reports, 10);
    let system = |system, satellites, [listed, received, used_in_fix, with_ephemeris]: [f64; 4]| {
        SystemStatus { system, satellites, listed, received, used_in_fix, with_ephemeris }
    };
    assert_eq!(status.systems, [system('G', 2, [2.0, 2.0, 1.5, 2.0]), system('E', 1, [0.5, 0.0, 0.0, 0.0])]);
    for line in ["own fixes   gnss 10, ", "7.0 m in the median, 90 % within 11.0 m", "own status  10 reports"]
    {
        assert!(table.contains(line), "{line}: {table}");
    }
    let json = serde_json::to_value(&inspection).unwrap();
    assert_eq!(json["phone"]["fixes"][0]["accuracy_m"]["p90"], 11.0);
    assert_eq!(json["phone"]["status"]["systems"][0]["used_in_fix"], 1.5);
    // A recording without such lines says nothing.
    let silent = run(&write(folder.path(), HEADER), &InspectOptions::default());
    assert_eq!(silent.phone, None);
}

/// Where the satellite is, seen from where the phone is.
fn direction(simulation: &Simulation, simulated: &SimulatedEpoch, satellite: SatelliteId) -> Direction {
    let truth = &simulated.truth;
    let state = simulation.satellite_state(satellite, truth.time_gps).unwrap();
    let frame = LocalFrame::at(truth.position);
    let enu = frame.ecef_to_enu(state.position);
    Direction { azimuth_rad: enu.east.atan2(enu.north), elevation_rad: enu.up.atan2(enu.horizontal()) }
}

/// A log of the simulation's GPS and Galileo L1 signals, with the phone's directions turned by this angle, degrees.
fn log(simulation: &Simulation, turned_deg: f64) -> String {
    let mut text = HEADER.to_owned();
    for (time_ns, simulated) in (7_000_000_000_000_i64..).step_by(1_000_000_000).zip(simulation.epochs(0)) {
        let gps_ns = simulated.epoch.time_gps.nanos();
        let mut reports = String::new();
        for (index, o) in simulated.epoch.observations.iter().enumerate() {
            let system = match o.satellite.constellation {
                Constellation::Gps => 1,
                Constellation::Galileo => 6,
                _ => continue,
            };
            let Some(pseudorange_m) = o.pseudorange_m.filter(|_| o.signal.band == b'1') else { continue };
            #[allow(clippy::cast_possible_truncation)]
            let travel_ns = (pseudorange_m / SPEED_OF_LIGHT_MPS * 1e9).round() as i64;
            let (svid, received_ns) =
                (o.satellite.number, (gps_ns - travel_ns).rem_euclid(604_800_000_000_000));
            let full_bias_ns = time_ns - gps_ns;
            writeln!(text, "Raw,{time_ns},{full_bias_ns},{svid},9,{received_ns},1575420030,{system},40")
                .unwrap();
            let Direction { azimuth_rad, elevation_rad } = direction(simulation, &simulated, o.satellite);
            let azimuth_deg = (azimuth_rad.to_degrees() + turned_deg).round().rem_euclid(360.0);
            let elevation_deg = elevation_rad.to_degrees().round();
            writeln!(reports, "Status,,9,{index},{system},{svid},,40,{azimuth_deg},{elevation_deg},1,1,1,")
                .unwrap();
        }
        text += &reports;
    }
    text
}

#[test]
fn the_phone_s_directions_are_held_against_the_orbits() {
    let simulation = Simulation::new(Scenario { seed: 2, duration_s: 30.0, ..Scenario::default() }).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let products = ProductSource::Loaded(Arc::new(simulation.products()));
    let options = InspectOptions { products, ..InspectOptions::default() };
    let compare = |turned_deg| {
        let inspection = run(&write(folder.path(), &log(&simulation, turned_deg)), &options);
        let text = inspection.to_string();
        assert!(text.contains("  directions  "), "{text}");
        let trial = inspection.trial.unwrap();
        let directions = trial.directions.unwrap();
        assert!(directions.compared >= trial.used, "{text}");
        directions
    };
    // Whole degrees are a quarter of a degree off in the median, and never more than a half.
    let right = compare(0.0);
    assert!((0.1..0.4).contains(&right.elevation_deg.median) && right.elevation_deg.p90 < 0.55, "{right:?}");
    assert!(right.across_deg.median < 0.3 && right.across_deg.p90 < 0.55, "{right:?}");
    let turned = compare(40.0);
    assert_eq!(turned.elevation_deg, right.elevation_deg);
    assert!((10.0..40.0).contains(&turned.across_deg.median), "{turned:?}");
}

#[test]
#[ignore = "needs the reference data"]
fn a_pixel_s_own_positions() {
    let path = beside::file("data/pixel6-2023/pixel6.txt");
    let inspection = run(&path, &InspectOptions::default());
    println!("{inspection}");
    let PhoneReport { fixes, status } = inspection.phone.unwrap();
    assert_eq!(status, None, "the log has no Status lines");
    let shape: Vec<_> =
        fixes.iter().map(|f| (f.provider, f.count, f.span_s, f.accuracy_m.unwrap())).collect();
    let typical = |median, p90| Typical { median, p90 };
    let expected = [
        ("gnss", 94, 558.0, typical(3.49, 4.03)),
        ("fused", 95, 556.114, typical(5.58, 7.28)),
        ("network", 54, 552.437, typical(33.2, 67.2)),
    ];
    assert_eq!(shape, expected);
}
