use super::*;
use crate::atmosphere::{IonosphereMaps, NoTec};
use crate::frames::{Direction, Geodetic};
use crate::skips::Reason;

fn labelled(content: &str, label: &str) -> String {
    format!("{content:<60}{label:<20}\n")
}

fn header(heights: &str) -> String {
    [
        ("     1.0            IONOSPHERE MAPS     GPS", "IONEX VERSION / TYPE"),
        ("  COSZ", "MAPPING FUNCTION"),
        ("  6371.0", "BASE RADIUS"),
        ("     2", "MAP DIMENSION"),
        (heights, "HGT1 / HGT2 / DHGT"),
        ("    10.0 -10.0 -10.0", "LAT1 / LAT2 / DLAT"),
        ("  -180.0 180.0  20.0", "LON1 / LON2 / DLON"),
        ("    -1", "EXPONENT"),
        ("Reason::DifferentialBias CODE BIASES", "START OF AUX DATA"),
        ("Reason::DifferentialBias CODE BIASES", "END OF AUX DATA"),
        ("", "END OF HEADER"),
    ]
    .iter()
    .map(|(content, label)| labelled(content, label))
    .collect()
}

/// A map of three parallels with 19 values each: one value everywhere.
fn map(kind: &str, number: u32, epoch: &str, value: &str) -> String {
    let mut text = labelled(&format!("{number:6}"), &format!("START OF {kind} MAP"));
    text += &labelled(epoch, "EPOCH OF CURRENT MAP");
    for latitude in ["10.0", " 0.0", "-10.0"] {
        text += &labelled(&format!("  {latitude:>6}-180.0 180.0  20.0 450.0"), "LAT/LON1/LON2/DLON/H");
        let value = format!("{value:>5}");
        text += &[value.repeat(16), value.repeat(3), String::new()].join("\n");
    }
    text + &labelled(&format!("{number:6}"), &format!("END OF {kind} MAP"))
}

const FIRST: &str = "  2020     8    13     0     0     0";
const SECOND: &str = "  2020     8    13     2     0     0";

fn file() -> String {
    header("   450.0 450.0   0.0")
        + &map("TEC", 1, FIRST, "100")
        + &map("TEC", 2, SECOND, "300")
        + &map("RMS", 1, FIRST, "7")
        + &labelled("", "END OF FILE")
}

fn tecu(file: &Ionex, minute: f64) -> Result<f64, NoTec> {
    let mut maps = IonosphereMaps::default();
    maps.add(file.maps.clone());
    let up = Direction { azimuth_rad: 0.0, elevation_rad: std::f64::consts::FRAC_PI_2 };
    let start: GpsTime = "2020-08-13T00:00:18".parse().unwrap();
    // The frequency at which one unit delays by one metre.
    let frequency_hz = 40.3e16_f64.sqrt();
    maps.delay_m(Geodetic::from_degrees(5.0, 114.0, 0.0), up, start + 60.0 * minute, frequency_hz)
}

#[test]
fn maps_are_read_with_exponent_and_epoch() {
    let file = Ionex::parse(file().as_bytes()).unwrap();
    assert_eq!(file.maps.len(), 2);
    assert!(file.skips.is_empty(), "{}", file.skips);
    // Epochs are UTC, 18 s behind GPS time.
    assert!((tecu(&file, 0.0).unwrap() - 10.0).abs() < 1e-9);
    assert!((tecu(&file, 60.0).unwrap() - 20.0).abs() < 1e-9);
    assert!((tecu(&file, 120.0).unwrap() - 30.0).abs() < 1e-9);
    assert_eq!(tecu(&file, 120.1), Err(NoTec::NotCovered));
}

#[test]
fn an_exponent_within_a_map_holds_for_that_map() {
    let changed = labelled(SECOND, "EPOCH OF CURRENT MAP") + &labelled("    -2", "EXPONENT");
    let text = file().replacen(&labelled(SECOND, "EPOCH OF CURRENT MAP"), &changed, 1);
    let file = Ionex::parse(text.as_bytes()).unwrap();
    assert!((tecu(&file, 0.0).unwrap() - 10.0).abs() < 1e-9);
    assert!((tecu(&file, 120.0).unwrap() - 3.0).abs() < 1e-9);
}

#[test]
fn missing_values_and_bad_rows_stay_holes() {
    let missing = file().replace("  300", " 9999");
    assert_eq!(tecu(&Ionex::parse(missing.as_bytes()).unwrap(), 60.0), Err(NoTec::Missing));
    let row = file().replacen("   -10.0-180.0 180.0  20.0 450.0", "   -12.0-180.0 180.0  20.0 450.0", 1);
    let row = Ionex::parse(row.as_bytes()).unwrap();
    assert_eq!(row.skips.count(Reason::IonexRowOffGrid), 1, "{}", row.skips);
    assert!(tecu(&row, 60.0).is_ok(), "the other parallels serve");
    let value = file().replacen("  100", "  1x0", 1);
    let value = Ionex::parse(value.as_bytes()).unwrap();
    assert_eq!(value.skips.count(Reason::IonexValueUnreadable), 1, "{}", value.skips);
}

#[test]
fn absurd_contents_stay_holes() {
    let exponent = file().replacen("    -1", "    10", 1);
    let file = Ionex::parse(exponent.as_bytes()).unwrap();
    assert_eq!(file.skips.count(Reason::IonexValueImpossiblyLarge), 2 * 57, "{}", file.skips);
    assert!(file.skips.to_string().contains("1000000000000 TECU"), "{}", file.skips);
    assert_eq!(tecu(&file, 60.0), Err(NoTec::Missing));
}

#[test]
fn several_layers_and_other_files_are_refused_by_name() {
    let layers = header("   250.0 450.0  50.0") + &map("TEC", 1, FIRST, "100");
    let error = Ionex::parse(layers.as_bytes()).unwrap_err();
    assert_eq!(error, IonexError::Layers { heights: "250 / 450 / 50 km".to_owned() });
    let observations = "     3.04           OBSERVATION DATA    M                   RINEX VERSION / TYPE\n";
    assert!(matches!(Ionex::parse(observations.as_bytes()), Err(IonexError::NotIonex { .. })));
    assert!(matches!(Ionex::parse(b""), Err(IonexError::NotIonex { .. })));
    let only_header = header("   450.0 450.0   0.0");
    assert!(matches!(Ionex::parse(only_header.as_bytes()), Err(IonexError::Empty { .. })));
    let no_grid = file().replace("LAT1 / LAT2 / DLAT", "LAT1 / LAT3 / DLAT");
    assert_eq!(Ionex::parse(no_grid.as_bytes()), Err(IonexError::Header { label: "LAT1 / LAT2 / DLAT" }));
    let version = file().replacen("1.0", "2.0", 1);
    assert!(matches!(Ionex::parse(version.as_bytes()), Err(IonexError::NotIonex { .. })));
}

#[test]
fn a_map_of_few_values_is_left_out() {
    let row = labelled("    10.0-180.0 180.0  20.0 450.0", "LAT/LON1/LON2/DLON/H");
    let empty = labelled("     3", "START OF TEC MAP")
        + &labelled("  2020     8    13     4     0     0", "EPOCH OF CURRENT MAP")
        + &row
        + "  100  100\n"
        + &labelled("     3", "END OF TEC MAP");
    let file = Ionex::parse((file() + &empty).as_bytes()).unwrap();
    assert_eq!(file.maps.len(), 2);
    assert!(file.skips.to_string().contains("line 53: 2 of 57"), "{}", file.skips);
}

#[test]
fn a_cut_map_is_not_used_and_named() {
    let text = file();
    let at = text.find("START OF RMS").unwrap() - 60 - 81 - 20;
    let cut = Ionex::parse(&text.as_bytes()[..at]).unwrap();
    assert_eq!(cut.maps.len(), 1);
    assert_eq!(cut.skips.count(Reason::IonexMapWithoutEnd), 1, "{}", cut.skips);
}

#[test]
fn hour_24_is_the_next_day_and_an_unknown_mapping_is_said() {
    let text =
        file().replacen(SECOND, "  2020     8    13    24     0     0", 1).replacen("  COSZ", "  MSLM", 1);
    let file = Ionex::parse(text.as_bytes()).unwrap();
    assert_eq!(file.maps[1].time().to_string(), "2020-08-14T00:00:18.000 GPS");
    assert_eq!(file.skips.total(), 1, "{}", file.skips);
}
