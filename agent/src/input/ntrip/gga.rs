//! A position as a GGA sentence of NMEA 0183.

use cofix_common::frames::Ecef;
use cofix_common::time::GpsTime;
use cofix_common::time::leap_seconds_at;

/// The sentence for a position at an instant. The geoid's height is not known here: the height above the ellipsoid is given as that above the
/// sea, with a geoid separation of zero, so that their sum is right. Number of satellites and dilution of precision are those of an
/// ordinary fix.
pub(super) fn sentence(position: Ecef, time: GpsTime) -> String {
    let geodetic = position.ecef_to_geodetic();
    let utc = (time + -(leap_seconds_at(time) as f64)).calendar();
    let (latitude, north) = degrees_and_minutes(geodetic.latitude_deg(), 2, ('N', 'S'));
    let (longitude, east) = degrees_and_minutes(geodetic.longitude_deg(), 3, ('E', 'W'));
    let (hour, minute, second) = (utc.hour, utc.minute, utc.second.min(59.99));
    let content = format!(
        "GPGGA,{hour:02}{minute:02}{second:05.2},{latitude},{north},{longitude},{east},1,10,1.0,{:.3},M,0.0,M,,",
        geodetic.height_m
    );
    let checksum = content.bytes().fold(0, |sum, byte| sum ^ byte);
    format!("${content}*{checksum:02X}\r\n")
}

/// `ddmm.mmmmm` with `digits` digits of degrees, and the letter of the sign.
fn degrees_and_minutes(angle_deg: f64, digits: usize, (positive, negative): (char, char)) -> (String, char) {
    // Rounded first: 59.999999 minutes are a degree.
    let minutes = (angle_deg.abs() * 60.0 * 1e5).round() / 1e5;
    let degrees = (minutes / 60.0).floor();
    let letter = if angle_deg < 0.0 { negative } else { positive };
    (format!("{degrees:0digits$.0}{:08.5}", minutes - 60.0 * degrees), letter)
}

#[cfg(test)]
mod tests {
    use cofix_common::frames::Geodetic;

    use super::*;

    fn of(latitude_deg: f64, longitude_deg: f64, height_m: f64) -> String {
        let position = Geodetic::from_degrees(latitude_deg, longitude_deg, height_m).geodetic_to_ecef();
        sentence(position, "2024-06-24T08:20:18.25".parse().unwrap())
    }

    #[test]
    fn a_sentence_has_its_fields_and_checksum() {
        let known = of(35.134_699, 136.977_575_49, 104.8626);
        assert_eq!(known, "$GPGGA,082000.25,3508.08194,N,13658.65453,E,1,10,1.0,104.863,M,0.0,M,,*5B\r\n");
        let southern = of(-0.5, -7.25, -3.0);
        assert!(southern.contains(",0030.00000,S,00715.00000,W,1,10,1.0,-3.000,M,"), "{southern}");
        assert!(of(59.999_999_999, 0.0, 0.0).contains(",6000.00000,N,"));
    }
}
