//! Mounting of a phone in its vehicle.

use crate::frames::Direction;

/// Place and orientation of a phone in its vehicle, and the attenuation by the vehicle's body.
///
/// A phone behind glass receives the sky on its own side directly and the rest through roof and doors. The loss of a signal is
/// C + L·(1 − cos e·cos δ)/2, with its elevation e and the angle δ between its azimuth and the side that the phone faces:
/// C at the horizon in front, C + L/2 at the zenith, C + L behind.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mount {
    /// Distance ahead of the vehicle's reference point, m.
    pub forward_m: f64,
    /// Distance to the right of the reference point, m.
    pub right_m: f64,
    /// Height above the reference point, m.
    pub up_m: f64,
    /// Direction that the phone faces, rad clockwise from the vehicle's heading.
    pub faces_rad: f64,
    /// Loss L, dB.
    pub body_loss_db: f64,
    /// Loss C in all directions, dB.
    pub cabin_loss_db: f64,
}

impl Mount {
    /// A phone in the open, without losses.
    pub const fn open(forward_m: f64, right_m: f64, up_m: f64) -> Self {
        Self { forward_m, right_m, up_m, faces_rad: 0.0, body_loss_db: 0.0, cabin_loss_db: 0.0 }
    }

    /// A phone behind glass that faces `faces_deg` degrees clockwise from the vehicle's heading.
    pub const fn behind_glass(forward_m: f64, right_m: f64, faces_deg: f64) -> Self {
        let faces_rad = faces_deg.to_radians();
        Self { faces_rad, body_loss_db: BODY_LOSS_DB, ..Self::open(forward_m, right_m, 0.0) }
    }

    /// A phone low in the cabin, as in a cup holder, with losses by roof and doors in all directions.
    pub const fn in_cabin(forward_m: f64, right_m: f64, up_m: f64) -> Self {
        Self { cabin_loss_db: BODY_LOSS_DB, ..Self::open(forward_m, right_m, up_m) }
    }

    /// Distance from another place in the same vehicle, m.
    pub fn distance_m(&self, other: &Self) -> f64 {
        let across_m = (self.forward_m - other.forward_m).hypot(self.right_m - other.right_m);
        across_m.hypot(self.up_m - other.up_m)
    }

    /// Loss (dB) of a signal from `direction` in a vehicle with heading `heading_rad`.
    pub(super) fn loss_db(&self, heading_rad: f64, direction: Direction) -> f64 {
        let off_rad = direction.azimuth_rad - heading_rad - self.faces_rad;
        self.cabin_loss_db + 0.5 * self.body_loss_db * (1.0 - direction.elevation_rad.cos() * off_rad.cos())
    }
}

/// Loss through the body of a car, dB.
const BODY_LOSS_DB: f64 = 12.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_phone_at_the_rear_window_sees_what_is_behind() {
        let mount = Mount::behind_glass(-1.0, 0.0, 180.0);
        let loss_db = |azimuth_deg: f64, elevation_deg: f64| {
            let (azimuth_rad, elevation_rad) = (azimuth_deg.to_radians(), elevation_deg.to_radians());
            mount.loss_db(90.0_f64.to_radians(), Direction { azimuth_rad, elevation_rad })
        };
        // The vehicle points east, so the phone faces west.
        for (azimuth_deg, elevation_deg, expected_db) in
            [(270.0, 0.0, 0.0), (90.0, 0.0, 12.0), (123.0, 90.0, 6.0), (0.0, 30.0, 6.0), (270.0, 60.0, 3.0)]
        {
            assert!((loss_db(azimuth_deg, elevation_deg) - expected_db).abs() < 1e-9);
        }
        let anywhere = Direction { azimuth_rad: 2.0, elevation_rad: 1.0 };
        assert_eq!(Mount::open(0.0, 1.0, 0.5).loss_db(1.0, anywhere), 0.0);
        assert_eq!(Mount::in_cabin(0.0, 1.0, 0.5).loss_db(1.0, anywhere), 12.0);
        assert!((Mount::open(0.0, 1.0, 0.5).distance_m(&Mount::open(2.0, 3.0, 1.5)) - 3.0).abs() < 1e-12);
    }
}
