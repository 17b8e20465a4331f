//! Epochs of a simulated phone with phases of any quality.

use nalgebra::Vector3;

use super::*;
use crate::gnss::LossOfLock;
use crate::measurement::RangeRate;
use crate::measurement::sky::{OPEN_SKY_DEG, Receiver};

/// What a phone reports.
#[derive(Clone, Copy)]
struct Phone {
    /// Standard deviation of the phase, m.
    phase_noise_m: f64,
    /// Whether its Doppler is the mean over the interval before the epoch.
    mean_doppler: bool,
    /// Acceleration that changes its sign every four seconds, m/s².
    acceleration_mps2: f64,
    /// Drift of the phases' clock against that of the Dopplers, m/s.
    steering_mps: f64,
}

const GOOD: Phone =
    Phone { phase_noise_m: 0.003, mean_doppler: false, acceleration_mps2: 1.5, steering_mps: 0.0 };

fn at(second: f64) -> GpsTime {
    GpsTime::from_week_tow(2118, 100.0 + second)
}

/// A number between −1 and 1 that looks random, with a variance of 1/3.
fn scatter(seed: usize) -> f64 {
    let mixed = (seed as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0x5851_F42D;
    (mixed.wrapping_mul(0xD134_2543_DE82_EF95) >> 40) as f64 / f64::from(1 << 23) - 1.0
}

struct Epoch {
    time_gps: GpsTime,
    observations: Vec<CorrectedObservation>,
    carriers: Carriers,
    /// Displacement since the epoch a second before, m.
    moved: Vector3<f64>,
}

impl Phone {
    fn position(&self, second: f64) -> Ecef {
        let phase = second.rem_euclid(8.0);
        // Velocity up and down again, continuous position.
        let a = self.acceleration_mps2;
        let along =
            if phase < 4.0 { 0.5 * a * phase * phase } else { 16.0 * a - 0.5 * a * (8.0 - phase).powi(2) };
        let along = along + 16.0 * a * (second / 8.0).floor();
        Ecef(Receiver::in_wuhan().position.0 + Vector3::new(0.6, -0.3, 0.74) * along)
    }

    fn epoch(&self, k: usize) -> Epoch {
        let second = k as f64;
        let sky = Receiver::in_wuhan().observe(&OPEN_SKY_DEG);
        let (mut observations, mut carriers) = (Vec::new(), Carriers::new());
        for (i, seen) in sky.iter().enumerate() {
            let satellite = |t: f64| Ecef(seen.satellite_position.0 + seen.satellite_velocity.0 * t);
            let range = |t: f64| satellite(t).distance_m(self.position(t)) + 12.0 * t;
            let rate = if self.mean_doppler {
                range(second) - range(second - 1.0)
            } else {
                (range(second + 0.01) - range(second - 0.01)) / 0.02
            };
            let noise_m = 3.0_f64.sqrt() * self.phase_noise_m * scatter(i + 97 * k);
            observations.push(CorrectedObservation {
                satellite_position: satellite(second),
                range_rate: Some(RangeRate {
                    range_rate_mps: rate + 0.002 * scatter(i + 89 * k + 7),
                    sigma_mps: 0.1,
                    averaged_s: 0.0,
                }),
                ..seen.clone()
            });
            let carrier = Carrier {
                phase_m: Some(range(second) + self.steering_mps * second + noise_m - 1e7 * i as f64),
                delay_m: 0.0,
                loss_of_lock: LossOfLock::default(),
            };
            carriers.insert((seen.satellite, seen.signal), carrier);
        }
        let moved = self.position(second) - self.position(second - 1.0);
        Epoch { time_gps: at(second), observations, carriers, moved: moved.0 }
    }
}

/// A tracker with what it counted.
#[derive(Default)]
struct Run {
    tracker: PhaseTracker,
    skips: Skips,
}

impl Run {
    fn take(&mut self, epoch: &mut Epoch) -> Option<GpsTime> {
        let position = Receiver::in_wuhan().position;
        let carrier_epoch =
            CarrierEpoch { time_gps: epoch.time_gps, carriers: &epoch.carriers, position, velocity: None };
        self.tracker.take(&carrier_epoch, &mut epoch.observations, &mut self.skips)
    }

    /// After `epochs` seconds of a phone.
    fn after(phone: Phone, epochs: usize) -> Self {
        let mut run = Self::default();
        for k in 0..epochs {
            run.take(&mut phone.epoch(k));
        }
        run
    }
}

/// Largest error of the stated changes against the true ones, clock removed, m, and their number.
fn errors(epoch: &Epoch, phone: &Phone) -> (f64, usize) {
    let second = epoch.time_gps - at(0.0);
    let off: Vec<f64> = epoch
        .observations
        .iter()
        .filter_map(|o| {
            let change = o.range_change?;
            let now = o.satellite_position.distance_m(phone.position(second));
            let before = change.satellite_before.distance_m(phone.position(second - 1.0));
            Some(change.change_m - (now - before))
        })
        .collect();
    let mean = off.iter().sum::<f64>() / off.len() as f64;
    (off.iter().map(|error| (error - mean).abs()).fold(0.0, f64::max), off.len())
}

#[test]
fn good_phases_give_changes_of_millimetres_with_their_noise() {
    let mut run = Run::after(GOOD, 60);
    let mut epoch = GOOD.epoch(60);
    assert_eq!(run.take(&mut epoch), Some(at(59.0)));
    let (largest_m, count) = errors(&epoch, &GOOD);
    assert_eq!(count, OPEN_SKY_DEG.len());
    assert!(largest_m < 0.015, "{largest_m}");
    assert!(epoch.moved.norm() > 0.5, "the phone moves");
    for change in epoch.observations.iter().filter_map(|o| o.range_change) {
        assert!((LEAST_SIGMA_M..0.012).contains(&change.sigma_m), "{change:?}");
    }
    assert!(run.skips.count(Reason::PhaseContradictsOthers) <= 2, "{}", run.skips);
    // The learnt noise is that of the difference of two phases.
    let sigma_m = run.tracker.noise.largest_sigma_m();
    assert!((0.7..1.5).contains(&(sigma_m / (2.0_f64.sqrt() * GOOD.phase_noise_m))), "{sigma_m}");
}

#[test]
fn a_start_is_harmless_and_soon_over() {
    let mut run = Run::after(GOOD, 1);
    assert_eq!(run.take(&mut GOOD.epoch(1)), None, "nothing is known of the noise");
    let stated = (2..12).map(|k| run.take(&mut GOOD.epoch(k)).is_some()).collect::<Vec<_>>();
    assert!(stated[9] && !stated[0], "{stated:?}");
}

#[test]
fn a_phone_whose_phases_are_worthless_states_none() {
    let noisy = Phone { phase_noise_m: 0.1, ..GOOD };
    let mut run = Run::after(noisy, 60);
    assert_eq!(run.take(&mut noisy.epoch(60)), None);
    assert!(run.skips.count(Reason::PhaseTooNoisy) > 600);
}

#[test]
fn slips_are_left_out_by_name() {
    // A wavelength, half one, and five metres. The Doppler tells only the last.
    for (slip_m, reason) in [
        (0.19, Reason::PhaseContradictsOthers),
        (-0.095, Reason::PhaseContradictsOthers),
        (5.0, Reason::PhaseContradictsDoppler),
    ] {
        let mut run = Run::after(GOOD, 60);
        let mut epoch = GOOD.epoch(60);
        let key = (epoch.observations[3].satellite, epoch.observations[3].signal);
        epoch.carriers.get_mut(&key).unwrap().phase_m.as_mut().map(|phase_m| *phase_m += slip_m).unwrap();
        let before = run.skips.count(reason);
        run.take(&mut epoch);
        assert_eq!(run.skips.count(reason), before + 1, "{slip_m} m: {}", run.skips);
        assert!(epoch.observations[3].range_change.is_none());
        assert!(errors(&epoch, &GOOD).0 < 0.015, "the others are right");
    }
}

#[test]
fn flags_of_the_receiver_are_believed() {
    let flags: [fn(&mut LossOfLock); 2] = [|flags| flags.cycle_slip = true, |flags| flags.half_cycle = true];
    for raise in flags {
        let mut run = Run::after(GOOD, 60);
        let mut epoch = GOOD.epoch(60);
        let key = (epoch.observations[3].satellite, epoch.observations[3].signal);
        raise(&mut epoch.carriers.get_mut(&key).unwrap().loss_of_lock);
        run.take(&mut epoch);
        assert_eq!(run.skips.count(Reason::PhaseLockLost), 1);
        assert!(epoch.observations[3].range_change.is_none());
    }
}

#[test]
fn a_gap_or_an_interruption_has_no_changes() {
    let mut run = Run::after(GOOD, 60);
    run.tracker.interrupt();
    assert_eq!(run.take(&mut GOOD.epoch(60)), None);
    assert!(run.take(&mut GOOD.epoch(61)).is_some());
    // Longer than the limit of a minute.
    let after_the_limit = 125;
    assert_eq!(run.take(&mut GOOD.epoch(after_the_limit)), None);
    assert!(run.take(&mut GOOD.epoch(after_the_limit + 1)).is_some());
    assert_eq!(run.take(&mut GOOD.epoch(after_the_limit)), None, "an earlier epoch");
}

#[test]
fn a_mean_doppler_is_learnt_and_replaces_missing_phases() {
    let mean = Phone { mean_doppler: true, steering_mps: 30.0, ..GOOD };
    let mut run = Run::default();
    let mut last = None;
    for k in 0..100 {
        let mut epoch = mean.epoch(k);
        let key = |i: usize| (epoch.observations[i].satellite, epoch.observations[i].signal);
        // The phase of one signal is lost and comes back, and another has none.
        let (comes_and_goes, without) = (key(3), key(5));
        epoch.carriers.get_mut(&comes_and_goes).unwrap().phase_m.take_if(|_| k % 2 == 0);
        epoch.carriers.get_mut(&without).unwrap().phase_m = None;
        run.take(&mut epoch);
        last = Some(epoch);
    }
    let epoch = last.unwrap();
    for (i, observation) in epoch.observations.iter().enumerate() {
        let averaged_s = observation.range_rate.unwrap().averaged_s;
        assert_eq!(averaged_s > 0.0, i != 5, "without a phase the Doppler is that of the epoch");
        assert_eq!(observation.range_change.is_some(), i != 5, "{i}");
    }
    assert!(errors(&epoch, &mean).0 < 0.02);
}

#[test]
fn a_doppler_of_the_epoch_is_not_taken_for_a_mean() {
    for acceleration_mps2 in [0.0, 1.5] {
        let phone = Phone { acceleration_mps2, ..GOOD };
        let mut run = Run::after(phone, 100);
        let mut epoch = phone.epoch(100);
        run.take(&mut epoch);
        assert!(epoch.observations.iter().all(|o| o.range_rate.unwrap().averaged_s == 0.0));
    }
}
