//! Jumps of the receiver's clock: jumps of the pseudoranges that all satellites share.

use std::collections::{BTreeMap, VecDeque};

use cofix_common::gnss::{ObservationEpoch, SatelliteId, SignalCode};
use cofix_common::time::GpsTime;
use serde::Serialize;

use super::LISTED;

/// Drifts that are told apart.
const DISTINCT: usize = 10_000;
/// Jumps below this are not told from noise and drift, m (0.3 µs).
const SMALLEST_M: f64 = 100.0;
/// Epochs further apart than this are not compared, s: the Doppler of two epochs does not predict what lies between.
const LONGEST_S: f64 = 5.0;
/// Satellites that must agree.
const ENOUGH: usize = 4;
/// Most of them must agree with the median within this share of it, and within [`SMALLEST_M`].
const AGREE: f64 = 0.1;

/// The drift between pseudoranges and Doppler is the median over so many epochs,
const HISTORY: usize = 15;
/// and known once there were so many.
const KNOWN_AFTER: usize = 3;

/// A jump.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ClockJump {
    /// The first epoch after it, GPS time.
    pub at_gps: String,
    /// Its size, m; positive when pseudoranges grew.
    pub jump_m: f64,
    /// Signals compared.
    pub signals: usize,
}

/// Jumps in a recording.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ClockJumps {
    /// How many.
    pub count: u64,
    /// The largest, m.
    pub largest_m: f64,
    /// How fast pseudoranges drift away from what their Doppler says, in the median, m/s: many phones give Doppler of the
    /// free oscillator and pseudoranges of a steered clock. Jumps are counted beyond it.
    pub drift_mps: Option<f64>,
    /// The first ones.
    pub first: Vec<ClockJump>,
}

/// A pseudorange and its rate.
#[derive(Clone, Copy, Debug)]
struct Range {
    pseudorange_m: f64,
    rate_mps: f64,
}

type Ranges = BTreeMap<(SatelliteId, SignalCode), Range>;

/// Compares each epoch with the one before.
#[derive(Clone, Debug, Default)]
pub(super) struct Clock {
    before: Option<(GpsTime, Ranges)>,
    /// The last common drifts, m/s.
    history: VecDeque<f64>,
    /// All of them, counted to 0.1 m/s.
    drifts: BTreeMap<i64, u64>,
    jumps: ClockJumps,
}

impl Clock {
    pub(super) fn epoch(&mut self, epoch: &ObservationEpoch) {
        let now = ranges(epoch);
        if let Some((time, before)) = &self.before {
            let elapsed_s = epoch.time_gps - *time;
            let mut changes: Vec<f64> = if elapsed_s > LONGEST_S {
                Vec::new()
            } else {
                now.iter()
                    .filter_map(|(signal, range)| Some(unexplained_m(before.get(signal)?, range, elapsed_s)))
                    .collect()
            };
            if let Some(change_m) = common_m(&mut changes) {
                self.change(epoch.time_gps, change_m, elapsed_s, changes.len());
            }
        }
        self.before = Some((epoch.time_gps, now));
    }

    /// A change that the signals share is a jump when it is more than the usual drift.
    fn change(&mut self, at: GpsTime, change_m: f64, elapsed_s: f64, signals: usize) {
        let mut drifts: Vec<f64> = self.history.iter().copied().collect();
        drifts.sort_unstable_by(f64::total_cmp);
        let usual_mps = drifts.get(drifts.len() / 2).filter(|_| drifts.len() >= KNOWN_AFTER);
        let jump_m = usual_mps.map_or(0.0, |usual_mps| change_m - usual_mps * elapsed_s);
        if jump_m.abs() >= SMALLEST_M {
            self.add(at, jump_m, signals);
        }
        self.history.push_back(change_m / elapsed_s);
        if self.history.len() > HISTORY {
            self.history.pop_front();
        }
        #[allow(clippy::cast_possible_truncation)] // saturates
        let tenths = (10.0 * change_m / elapsed_s).round() as i64;
        if self.drifts.len() < DISTINCT || self.drifts.contains_key(&tenths) {
            *self.drifts.entry(tenths).or_default() += 1;
        }
    }

    fn add(&mut self, at: GpsTime, jump_m: f64, signals: usize) {
        self.jumps.count += 1;
        if jump_m.abs() > self.jumps.largest_m.abs() {
            self.jumps.largest_m = jump_m;
        }
        if self.jumps.first.len() < LISTED {
            self.jumps.first.push(ClockJump { at_gps: at.iso(), jump_m, signals });
        }
    }

    pub(super) fn report(self) -> ClockJumps {
        let total: u64 = self.drifts.values().sum();
        let mut below = 0;
        let drift_mps = self.drifts.iter().find_map(|(tenths, count)| {
            below += count;
            (2 * below >= total).then_some(*tenths as f64 * 0.1)
        });
        ClockJumps { drift_mps, ..self.jumps }
    }
}

/// Ranges with a rate. GLONASS is left out: its wavelengths need channels, and the others are enough.
fn ranges(epoch: &ObservationEpoch) -> Ranges {
    let range = |o: &cofix_common::gnss::Observation| {
        let wavelength_m = o.signal.wavelength_m(o.satellite.constellation, None)?;
        let range = Range { pseudorange_m: o.pseudorange_m?, rate_mps: -wavelength_m * o.doppler_hz? };
        Some(((o.satellite, o.signal), range))
    };
    epoch.observations.iter().filter_map(range).collect()
}

/// What the rates do not explain of a change of pseudorange, m.
fn unexplained_m(before: &Range, now: &Range, elapsed_s: f64) -> f64 {
    now.pseudorange_m - before.pseudorange_m - 0.5 * (before.rate_mps + now.rate_mps) * elapsed_s
}

/// The change that most signals share.
fn common_m(changes_m: &mut [f64]) -> Option<f64> {
    if changes_m.len() < ENOUGH {
        return None;
    }
    changes_m.sort_unstable_by(f64::total_cmp);
    let median = *changes_m.get(changes_m.len() / 2)?;
    let tolerance = (AGREE * median.abs()).clamp(0.5 * SMALLEST_M, SMALLEST_M);
    let agreeing = changes_m.iter().filter(|change| (*change - median).abs() < tolerance).count();
    (4 * agreeing >= 3 * changes_m.len()).then_some(median)
}

#[cfg(test)]
mod tests {
    use super::*;
    use cofix_common::gnss::{Constellation, EpochFlag, LossOfLock, Observation};

    /// Satellites with rates of −500 to 500 m/s on a clock that drifts by 30 m/s.
    fn epoch(second: u32, clock_m: f64) -> ObservationEpoch {
        let observations = (1..=6_u8).map(|number| {
            let rate_mps = 200.0 * f64::from(number) - 700.0 + 30.0;
            let satellite = SatelliteId::new(Constellation::Gps, number);
            let signal = SignalCode::new(b'1', b'C');
            let wavelength = signal.wavelength_m(Constellation::Gps, None).unwrap();
            Observation {
                satellite,
                signal,
                pseudorange_m: Some(2.2e7 + f64::from(second) * rate_mps + clock_m + f64::from(number)),
                carrier_phase_cycles: None,
                doppler_hz: Some(-rate_mps / wavelength),
                cn0_dbhz: None,
                loss_of_lock: LossOfLock::default(),
            }
        });
        ObservationEpoch {
            time_gps: GpsTime::from_week_tow(2118, f64::from(second)),
            flag: EpochFlag::Ok,
            observations: observations.collect(),
        }
    }

    #[test]
    fn a_millisecond_is_found_and_drift_is_not_one() {
        let mut clock = Clock::default();
        for second in 0..10 {
            clock.epoch(&epoch(second, if second < 5 { 0.0 } else { -299_792.458 }));
        }
        let jumps = clock.report();
        assert_eq!((jumps.count, jumps.first.len()), (1, 1));
        assert!((jumps.largest_m + 299_792.458).abs() < 1e-3);
        assert_eq!(jumps.drift_mps, Some(0.0));
        assert_eq!(jumps.first[0].at_gps, GpsTime::from_week_tow(2118, 5.0).iso());
    }

    #[test]
    fn a_drift_that_doppler_does_not_know_is_no_jump() {
        let mut clock = Clock::default();
        for second in 0..10 {
            clock.epoch(&epoch(second, -150.0 * f64::from(second)));
        }
        let jumps = clock.report();
        assert_eq!((jumps.count, jumps.drift_mps), (0, Some(-150.0)));
    }

    #[test]
    fn a_jump_of_one_satellite_is_no_clock_jump() {
        let mut clock = Clock::default();
        clock.epoch(&epoch(0, 0.0));
        let mut odd = epoch(1, 0.0);
        odd.observations[0].pseudorange_m = Some(2.3e7);
        clock.epoch(&odd);
        assert_eq!(clock.report().count, 0);
    }
}
