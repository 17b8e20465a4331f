//! Text form of a truth, as read by [`super::Truth::parse_csv`].

use super::truth::{TRUTH_COLUMNS, TruthPoint};
use crate::frames::LocalFrame;
use crate::time::GpsTime;

/// Header line with the names of the columns.
pub fn truth_csv_header() -> String {
    TRUTH_COLUMNS.join(",") + "\n"
}

/// Row with times to a microsecond, positions to 0.01 mm and velocities to 0.01 mm/s.
pub fn truth_csv_row(time_gps: GpsTime, point: &TruthPoint, quality: u8) -> String {
    let frame = LocalFrame::at(point.position);
    let place = frame.geodetic();
    let velocity = frame.vector_ecef_to_enu(point.velocity);
    format!(
        "{},{:.6},{:.10},{:.10},{:.5},{:.5},{:.5},{:.5},{quality}\n",
        time_gps.week(),
        time_gps.tow_s(),
        place.latitude_deg(),
        place.longitude_deg(),
        place.height_m,
        velocity.north,
        velocity.east,
        velocity.up,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accuracy::Truth;
    use crate::frames::{Ecef, EcefVector};

    #[test]
    fn a_written_row_reads_as_it_was() {
        let time = GpsTime::from_week_tow(2409, 208_801.25);
        let point = TruthPoint {
            position: Ecef::new(4_189_012.345_6, 852_111.222_2, 4_717_333.444_4),
            velocity: EcefVector::new(1.25, -12.5, 0.75),
        };
        let text = truth_csv_header() + &truth_csv_row(time, &point, 1);
        let (truth, skips) = Truth::parse_csv(text.as_bytes()).unwrap();
        let read = truth.at(time, &[1]).unwrap();
        assert!(skips.is_empty() && truth.span() == Some((time, time)));
        assert!(read.position.distance_m(point.position) < 2e-5, "{read:?}");
        assert!((read.velocity.0 - point.velocity.0).norm() < 2e-5, "{read:?}");
    }
}
