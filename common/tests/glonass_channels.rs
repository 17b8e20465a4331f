//! Slots of GLONASS satellites of which a phone knows the frequency channel only.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::sync::Arc;

use cofix_common::constants::{EARTH_ROTATION_RADPS, SPEED_OF_LIGHT_MPS};
use cofix_common::frames::{Ecef, EcefVector, Enu, Geodetic, LocalFrame};
use cofix_common::gnss::{
    Constellation, EpochFlag, LossOfLock, Observation, ObservationEpoch, SatelliteId, SignalCode,
};
use cofix_common::measurement::{ChannelObservation, CorrectionOptions, Corrector};
use cofix_common::orbit::NavigationFile;
use cofix_common::orbit::{GlonassEphemeris, Products};
use cofix_common::skips::Reason;
use cofix_common::time::GpsTime;

const RADIUS_M: f64 = 25_510e3;
const CLOCK_M: f64 = 12_345.0;

fn now() -> GpsTime {
    "2020-06-25T12:10:00".parse().unwrap()
}

fn site() -> Ecef {
    Geodetic::from_degrees(48.0, 11.0, 500.0).geodetic_to_ecef()
}

fn slot(number: u8) -> SatelliteId {
    SatelliteId::new(Constellation::Glonass, number)
}

/// A satellite that is seen in a direction at the reference time.
fn satellite(number: u8, channel: i8, azimuth_deg: f64, elevation_deg: f64) -> GlonassEphemeris {
    let (azimuth, elevation) = (azimuth_deg.to_radians(), elevation_deg.to_radians());
    let (flat, up) = (elevation.cos(), elevation.sin());
    let towards = LocalFrame::at(site())
        .vector_enu_to_ecef(Enu { east: flat * azimuth.sin(), north: flat * azimuth.cos(), up })
        .0;
    // Along the line of sight up to the orbit's radius.
    let along = site().0.dot(&towards);
    let distance = -along + (along * along + RADIUS_M * RADIUS_M - site().0.norm_squared()).sqrt();
    let position = Ecef(site().0 + distance * towards);
    let velocity = EcefVector(position.0.cross(&nalgebra_z()).normalize() * 3_500.0);
    GlonassEphemeris {
        satellite: slot(number),
        toe: now(),
        position,
        velocity,
        acceleration: EcefVector::new(0.0, 0.0, 0.0),
        tau_s: 2e-5,
        gamma: 0.0,
        l2_delay_s: None,
        frequency_channel: channel,
        health: Some(0),
        health_flags: Some(0),
        age_days: 0.0,
        accuracy_m: 2.0,
    }
}

fn nalgebra_z() -> nalgebra::Vector3<f64> {
    nalgebra::Vector3::new(0.3, 0.2, 1.0)
}

/// The satellite of the same channel on the other side of the orbit.
fn opposite(e: &GlonassEphemeris, number: u8) -> GlonassEphemeris {
    GlonassEphemeris {
        satellite: slot(number),
        position: Ecef(-e.position.0),
        velocity: EcefVector(-e.velocity.0),
        ..*e
    }
}

/// What a phone at the site measures of a satellite.
fn observe(products: &Products, satellite: SatelliteId) -> Observation {
    let mut pseudorange_m = 2e7;
    for _ in 0..10 {
        let sent = now() - pseudorange_m / SPEED_OF_LIGHT_MPS;
        let state = products.satellite_state(satellite, sent).unwrap();
        let (s, r) = (state.position.0, site().0);
        let sagnac_m = EARTH_ROTATION_RADPS / SPEED_OF_LIGHT_MPS * (s.x * r.y - s.y * r.x);
        pseudorange_m = (s - r).norm() + sagnac_m + CLOCK_M - SPEED_OF_LIGHT_MPS * state.clock_s;
    }
    Observation {
        satellite,
        signal: SignalCode::new(b'1', b'C'),
        pseudorange_m: Some(pseudorange_m),
        carrier_phase_cycles: None,
        doppler_hz: None,
        cn0_dbhz: Some(40.0),
        loss_of_lock: LossOfLock::default(),
    }
}

struct Sky {
    products: Arc<Products>,
    known: ObservationEpoch,
}

/// Slots 2, 3 and 4 are known; 1 and 5 share channel 1, 7 and 8 channel −4, all four in one plane each.
fn sky() -> Sky {
    let first = satellite(1, 1, 40.0, 50.0);
    let second = satellite(8, -4, 200.0, 20.0);
    let glonass = vec![
        first,
        satellite(2, -7, 100.0, 30.0),
        satellite(3, 5, 180.0, 60.0),
        satellite(4, 6, 300.0, 15.0),
        opposite(&first, 5),
        opposite(&second, 7),
        second,
    ];
    let products = Products::new(Vec::new(), vec![NavigationFile { glonass, ..NavigationFile::default() }]);
    let observations = [2, 3, 4].map(|number| observe(&products, slot(number))).to_vec();
    let known = ObservationEpoch { time_gps: now(), flag: EpochFlag::Ok, observations };
    Sky { products: Arc::new(products), known }
}

fn by_channel(channel: i8, observation: Observation) -> ChannelObservation {
    ChannelObservation { channel, observation: Observation { satellite: slot(100), ..observation } }
}

#[test]
fn the_satellite_above_the_horizon_that_fits_is_taken() {
    let Sky { products, known } = sky();
    let mut corrector = Corrector::new(Arc::clone(&products), CorrectionOptions::default());
    let prepared = corrector.prepare(&known);
    let [one, eight] = [1, 8].map(|number| observe(&products, slot(number)));
    let far = Observation { pseudorange_m: one.pseudorange_m.map(|range| range + 1e5), ..one };
    let off = site() + EcefVector::new(3_000.0, -2_000.0, 1_000.0);
    let observations = [by_channel(1, one), by_channel(-4, eight), by_channel(1, far), by_channel(0, one)];
    for seen_from in [site(), off] {
        let found = corrector.identify(&observations, &prepared, seen_from, now());
        assert_eq!(found.observations, [one, eight], "{}", corrector.skips());
    }
    let count = |reason| corrector.skips().count(reason);
    assert_eq!(count(Reason::GlonassSlotFound), 4);
    assert_eq!(count(Reason::GlonassSlotUnexplained), 4);
    // A signal that is there already, by its slot or by its channel.
    let two = observe(&products, slot(2));
    let twice = [by_channel(-7, two), by_channel(1, one), by_channel(1, one)];
    assert_eq!(corrector.identify(&twice, &prepared, site(), now()).observations, [one]);
}

#[test]
fn two_satellites_that_fit_are_none() {
    let Sky { products, .. } = sky();
    let first = *products.glonass_ephemeris(slot(1), now()).unwrap();
    let near = GlonassEphemeris {
        satellite: slot(9),
        position: first.position + EcefVector::new(10.0, 0.0, 0.0),
        ..first
    };
    let mut more = Products::clone(&products);
    more.add_navigation(NavigationFile { glonass: vec![near], ..NavigationFile::default() });
    let mut corrector = Corrector::new(Arc::new(more), CorrectionOptions::default());
    let prepared = corrector.prepare(&sky().known);
    let observation = by_channel(1, observe(&products, slot(1)));
    assert!(corrector.identify(&[observation], &prepared, site(), now()).observations.is_empty());
}

#[test]
fn without_other_satellites_nothing_tells() {
    let Sky { products, .. } = sky();
    let mut corrector = Corrector::new(Arc::clone(&products), CorrectionOptions::default());
    let observation = by_channel(1, observe(&products, slot(1)));
    assert!(corrector.identify(&[observation], &[], site(), now()).observations.is_empty());
    assert_eq!(corrector.skips().count(Reason::GlonassSlotWithoutOthers), 1);
}
