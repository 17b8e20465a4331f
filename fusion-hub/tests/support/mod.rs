//! A synthetic session: phones side by side on a winding road, with seeded noise. No estimation is involved.

#![allow(dead_code)] // each test binary uses a part
#![allow(clippy::unwrap_used, clippy::cast_possible_truncation)] // small numbers made here

use cofix_common::constraint::{Constraint, ConstraintAction, ConstraintOutcome, Distance};
use cofix_common::filter::PhoneState;
use cofix_common::frames::{Direction, Ecef, EcefVector, Enu, Geodetic, LocalFrame};
use cofix_common::fusion::engine::{FusedEpoch, FusedPhone, PairDistance};
use cofix_common::gnss::{SatelliteId, SignalCode};
use cofix_common::integrity::{Cause, GlobalTest, ProtectionLevels, RaimReport, Verdict};
use cofix_common::measurement::{CorrectedObservation, SharedError, Usage};
use cofix_common::solve::{Dops, PointSolution};
use cofix_common::time::GpsTime;
use cofix_common::wire::EpochMessage;
use cofix_hub::outputs::recorder::{Recorder, RecorderConfig};
use cofix_hub::report::scores::Reference;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// First epoch of the session: 2020-08-13 14:30:00 GPS time.
pub fn start() -> GpsTime {
    GpsTime::from_week_tow(2118, 397_800.0)
}

/// The time by which a phone's messages precede the common time, s.
pub const MESSAGE_LEAD_S: f64 = 0.25;

/// Size and seed of a session.
#[derive(Clone, Copy)]
pub struct Session {
    pub epochs: usize,
    pub phones: usize,
    pub satellites: usize,
    pub seed: u64,
}

/// Numbers in [-1, 1) from a 64-bit linear congruential generator (Knuth's MMIX constants).
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    /// Roughly normal, unit variance.
    fn normal(&mut self) -> f64 {
        (0..4).map(|_| self.next()).sum::<f64>() * 0.866
    }
}

impl Session {
    pub fn config(self) -> RecorderConfig {
        let phones = (0..self.phones).map(|p| format!("P{}", p + 1)).collect();
        RecorderConfig { group: "synthetic".to_owned(), phones }
    }

    /// The true place of a phone at a time, in the local frame of the road.
    fn truth_enu(phone: usize, time: GpsTime) -> Enu {
        let t = time - start();
        let along = 9.0 * t;
        let bend = (along / 700.0).sin();
        Enu {
            east: along * 0.9 + 1.2 * phone as f64,
            north: 420.0 * bend + 250.0 * (along / 260.0).cos() + 0.8 * phone as f64,
            up: 3.0 * bend,
        }
    }

    /// The truth as a recorder takes it.
    pub fn reference(epoch: &FusedEpoch, phone: usize) -> Reference {
        let frame = road();
        Reference::look_up(epoch, phone, |time| Some(frame.enu_to_ecef(Self::truth_enu(phone, time))))
    }

    /// All epochs. Phone 2 has no messages in the middle tenth.
    pub fn epochs(self) -> impl Iterator<Item = FusedEpoch> {
        let mut noise = Noise(self.seed);
        let mut wander = vec![Vector3::zeros(); self.phones];
        (0..self.epochs).map(move |index| {
            let time_gps = start() + index as f64;
            let gap = index * 10 / self.epochs == 5;
            let phones = wander
                .iter_mut()
                .enumerate()
                .map(|(phone, wander)| {
                    *wander = *wander * 0.98 + Vector3::from_fn(|_, _| 0.25 * noise.normal());
                    self.phone(phone, index, *wander, gap && phone == 1, &mut noise)
                })
                .collect();
            FusedEpoch {
                time_gps,
                phones,
                actions: self.actions(index, &mut noise),
                distances: self.distances(&mut noise),
                events: Vec::new(),
            }
        })
    }

    fn phone(
        self,
        phone: usize,
        index: usize,
        wander: Vector3<f64>,
        gap: bool,
        noise: &mut Noise,
    ) -> FusedPhone {
        let time_gps = start() + index as f64;
        let at = |time, scale: f64, white: f64, noise: &mut Noise| {
            let error = wander * scale + Vector3::from_fn(|_, _| white * noise.normal());
            road().enu_to_ecef((Self::truth_enu(phone, time).vector() + error).into())
        };
        let time = time_gps - MESSAGE_LEAD_S;
        let message = (!gap).then(|| EpochMessage {
            phone: format!("P{}", phone + 1),
            sequence: index as u64,
            time_gps: time,
            observations: self.observations(phone, index, noise),
            changes_since_gps: None,
            wls: Some(point_solution(at(time, 1.6, 1.3, noise), self.satellites)),
            local: Some(state(at(time, 1.1, 0.1, noise), 1.2)),
            local_integrity: None,
            raim: raim(index),
        });
        let state = Some(state(at(time_gps, 0.55, 0.05, noise), 0.6));
        FusedPhone {
            verdict: message.as_ref().map(|message| message.raim.verdict),
            protection: Some(ProtectionLevels { horizontal_m: 8.0, vertical_m: 14.0 }),
            message,
            state,
            ..FusedPhone::default()
        }
    }

    fn observations(self, phone: usize, index: usize, noise: &mut Noise) -> Vec<CorrectedObservation> {
        (0..self.satellites)
            .filter(|s| (index + 37 * s) % 400 > 12)
            .map(|s| {
                let (letter, band, attribute) =
                    [(b'G', b'1', b'C'), (b'E', b'1', b'C'), (b'C', b'2', b'I')][s % 3];
                let number = (s / 3 + 1) as u8;
                let satellite =
                    SatelliteId::from_bytes([letter, b'0' + number / 10, b'0' + number % 10]).unwrap();
                let cn0 = 28.0
                    + (s * 7 % 17) as f64
                    + 3.0 * (index as f64 / 90.0 + s as f64).sin()
                    + noise.normal();
                let excluded = (index * 13 + s * 29 + phone).is_multiple_of(61);
                let residual = if excluded { 22.0 } else { 3.0 } * noise.normal();
                CorrectedObservation {
                    satellite,
                    signal: SignalCode::new(band, attribute),
                    pseudorange_m: 2.2e7,
                    pseudorange_sigma_m: 3.0,
                    shared: SharedError::default(),
                    range_rate: None,
                    range_change: None,
                    cn0_dbhz: Some((cn0 * 10.0).round() / 10.0),
                    direction: Direction { azimuth_rad: 1.0, elevation_rad: 0.7 },
                    satellite_position: Ecef::new(2.0e7, 1.0e7, 1.0e7),
                    satellite_velocity: EcefVector::new(0.0, 3_000.0, 0.0),
                    usage: if excluded { Usage::Excluded } else { Usage::Used },
                    residual_m: Some(residual),
                }
            })
            .collect()
    }

    fn actions(self, index: usize, noise: &mut Noise) -> Vec<ConstraintAction> {
        if self.phones < 2 || !index.is_multiple_of(6) {
            return Vec::new();
        }
        let constraint = Constraint::Distance(Distance { phones: [0, 1], minimum_m: 0.0, maximum_m: 2.0 });
        let excess = noise.next().abs();
        vec![ConstraintAction {
            index: 0,
            constraint,
            before: 2.0 + excess,
            free_sigmas: 0.0,
            after: 1.99,
            shift_m: excess / 2.0,
            enlargements: u32::from(excess > 0.9),
            outcome: ConstraintOutcome::Holds,
        }]
    }

    fn distances(self, noise: &mut Noise) -> Vec<PairDistance> {
        let pairs = (0..self.phones).flat_map(|a| (a + 1..self.phones).map(move |b| (a, b)));
        pairs
            .map(|phones| PairDistance {
                phones,
                distance_m: (1.4 + 0.25 * noise.normal()).clamp(0.0, 2.0),
                sigma_m: 0.4,
                minimum_m: 0.0,
                maximum_m: 2.0,
            })
            .collect()
    }

    /// Records the whole session.
    pub fn record(self, mut recorder: Recorder) -> cofix_hub::outputs::recorder::Recorded {
        for epoch in self.epochs() {
            let truth: Vec<_> = (0..self.phones).map(|phone| Self::reference(&epoch, phone)).collect();
            recorder.record(&epoch, &truth).unwrap();
        }
        recorder.finish(ACCURACY).unwrap()
    }
}

/// The accuracy table that is put into the recordings.
pub const ACCURACY: &str = "\
| method | phone | p50 m | p68 m | p95 m | availability |
|---|---|---:|---:|---:|---:|
| wls | P1 | 2.81 | 3.64 | 6.02 | 1.000 |
| local | P1 | 1.50 | 1.94 | 3.20 | 1.000 |
| joint | P1 | 0.75 | 0.97 | 1.61 | 1.000 |
";

fn road() -> LocalFrame {
    LocalFrame::at(Geodetic::from_degrees(30.528, 114.356, 25.0).geodetic_to_ecef())
}

/// A state at rest with a position covariance that is an ellipsoid standing on its end.
pub fn state(position: Ecef, sigma_m: f64) -> PhoneState {
    let mut mean: SVector<f64, 9> = SVector::zeros();
    mean.fixed_rows_mut::<3>(0).copy_from(&position.0);
    let mut covariance: SMatrix<f64, 9, 9> = SMatrix::identity();
    covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(&covariance_ecef(sigma_m));
    PhoneState { mean, covariance }
}

fn covariance_ecef(sigma_m: f64) -> Matrix3<f64> {
    let enu = Matrix3::from_diagonal(&Vector3::new(1.0, 1.5, 4.0)) * sigma_m.powi(2);
    let rotation = *road().rotation_ecef_to_enu();
    rotation.transpose() * enu * rotation
}

fn point_solution(position: Ecef, satellites: usize) -> PointSolution {
    PointSolution {
        position,
        position_covariance: covariance_ecef(2.5),
        clocks_m: Vec::new(),
        velocity: None,
        dops: Dops { gdop: 2.0, pdop: 1.7, hdop: 0.9, vdop: 1.4 },
        used: satellites as u16,
    }
}

fn raim(index: usize) -> RaimReport {
    let statistic = if index % 71 == 5 { 61.2 } else { 17.4 };
    let verdict = if index % 71 == 5 { Verdict::Unreliable(Cause::TestsFailed) } else { Verdict::Reliable };
    let global_test = Some(GlobalTest { statistic, threshold: 38.6, degrees_of_freedom: 19 });
    RaimReport {
        global_test,
        excluded: u16::from(index % 71 == 5) * 3,
        protection: Some(ProtectionLevels { horizontal_m: 12.0, vertical_m: 18.0 }),
        ..RaimReport::of(verdict)
    }
}
