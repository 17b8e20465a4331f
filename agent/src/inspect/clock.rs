//! Jumps of the receiver's clock: jumps of the pseudoranges that all satellites share.

use std::collections::{BTreeMap, VecDeque};
use std::fmt;

use cofix_common::gnss::{ObservationEpoch, SatelliteId, SignalCode};
use cofix_common::time::GpsTime;
use serde::Serialize;

use super::LISTED;

/// Most different drifts that are counted.
const DISTINCT: usize = 10_000;
/// Smallest jump, m (0.3 µs): smaller ones cannot be distinguished from noise and drift.
const SMALLEST_M: f64 = 100.0;
/// Epochs further apart than this are not compared, s: the rates of two epochs do not predict what lies between.
const LONGEST_S: f64 = 5.0;
/// Fewest satellites by which a clock is compared.
const ENOUGH: usize = 4;
/// Share of the median within which most satellites must agree with it, beside [`SMALLEST_M`].
const AGREE: f64 = 0.1;

/// Number of epochs whose median gives the drift between pseudoranges and Doppler.
const HISTORY: usize = 15;
/// Number of epochs after which that drift counts as known.
const KNOWN_AFTER: usize = 3;

/// A jump of the clock.
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
    /// Steps from epoch to epoch in which a jump would have been found.
    pub compared: u64,
    /// Steps in which it would not, by reason.
    pub unknown: BTreeMap<&'static str, u64>,
}

/// Reasons why a step is not compared.
const TOO_FAR: &str = "epochs too far apart";
const NO_DOPPLER: &str = "no Doppler";
const TOO_FEW: &str = "fewer than four signals in both epochs";
const DISAGREE: &str = "signals disagree";
const TOO_SHORT: &str = "recording too short to tell a jump from drift";

/// A pseudorange, and its rate as far as it is known.
#[derive(Clone, Copy, Debug)]
struct Range {
    pseudorange_m: f64,
    /// By Doppler, m/s.
    rate_mps: Option<f64>,
    /// By the pseudorange before, without jumps, m/s.
    trend_mps: Option<f64>,
}

type Ranges = BTreeMap<(SatelliteId, SignalCode), Range>;

/// The change that the signals of two epochs share beyond their rates.
#[derive(Clone, Copy, Debug)]
struct Change {
    at: GpsTime,
    elapsed_s: f64,
    shared_m: f64,
    signals: usize,
}

/// Compares each epoch with the one before: by Doppler, or, where there is too little, by the change of pseudoranges in the
/// step before, whose own change (satellites: below 0.2 m/s²) is small in a few seconds.
#[derive(Clone, Debug, Default)]
pub(super) struct Clock {
    before: Option<(GpsTime, Ranges)>,
    /// Whether the last step is known to be free of a jump that was not taken out: its trends can be compared with.
    is_trend_sure: bool,
    /// The last common drifts, m/s.
    history: VecDeque<f64>,
    /// Changes that wait until the drift is known.
    waiting: Vec<Change>,
    /// All drifts, counted to 0.1 m/s.
    drifts: BTreeMap<i64, u64>,
    jumps: ClockJumps,
}

impl Clock {
    pub(super) fn epoch(&mut self, epoch: &ObservationEpoch) {
        let mut now = ranges(epoch);
        if let Some((time, before)) = self.before.take() {
            match self.step(epoch.time_gps, epoch.time_gps - time, &before, &now) {
                Ok(jump_m) => set_trends(&mut now, &before, epoch.time_gps - time, jump_m),
                Err(reason) => {
                    self.is_trend_sure = false;
                    *self.jumps.unknown.entry(reason).or_default() += 1;
                }
            }
        }
        self.before = Some((epoch.time_gps, now));
    }

    /// The jump between two epochs, which may be 0, m; or why it is unknown.
    fn step(
        &mut self,
        at: GpsTime,
        elapsed_s: f64,
        before: &Ranges,
        now: &Ranges,
    ) -> Result<f64, &'static str> {
        if elapsed_s > LONGEST_S {
            return Err(TOO_FAR);
        }
        let changes = |unexplained_m: fn(&Range, &Range, f64) -> Option<f64>| -> Vec<f64> {
            now.iter()
                .filter_map(|(signal, range)| unexplained_m(before.get(signal)?, range, elapsed_s))
                .collect()
        };
        let by_rate = changes(beyond_rate_m);
        let signals = by_rate.len();
        if signals >= ENOUGH {
            let shared_m = common_m(by_rate).ok_or(DISAGREE)?;
            return Ok(self.beyond_drift(Change { at, elapsed_s, shared_m, signals }));
        }
        let by_trend = changes(beyond_trend_m);
        let signals = by_trend.len();
        if signals >= ENOUGH {
            let jump_m = common_m(by_trend).ok_or(DISAGREE)?;
            if self.is_trend_sure || jump_m.abs() < SMALLEST_M {
                self.is_trend_sure = true;
                return Ok(self.judge(at, jump_m, signals));
            }
            // It may be in this step or, with the other sign, in the one before.
        }
        let shared = now.keys().filter(|signal| before.contains_key(signal)).count();
        if shared < ENOUGH {
            return Err(TOO_FEW);
        }
        self.is_trend_sure = false;
        *self.jumps.unknown.entry(NO_DOPPLER).or_default() += 1;
        Ok(0.0)
    }

    /// A change that the signals share is a jump when it is more than the usual drift against Doppler.
    fn beyond_drift(&mut self, change: Change) -> f64 {
        let drift_mps = change.shared_m / change.elapsed_s;
        let known = self.usual_mps();
        self.is_trend_sure = known.is_some();
        self.history.push_back(drift_mps);
        if self.history.len() > HISTORY {
            self.history.pop_front();
        }
        #[allow(clippy::cast_possible_truncation)] // saturates
        let tenths = (10.0 * drift_mps).round() as i64;
        if self.drifts.len() < DISTINCT || self.drifts.contains_key(&tenths) {
            *self.drifts.entry(tenths).or_default() += 1;
        }
        if let Some(usual_mps) = known {
            return self.judge(change.at, change.shared_m - usual_mps * change.elapsed_s, change.signals);
        }
        self.waiting.push(change);
        if let Some(usual_mps) = self.usual_mps() {
            for Change { at, elapsed_s, shared_m, signals } in std::mem::take(&mut self.waiting) {
                self.judge(at, shared_m - usual_mps * elapsed_s, signals);
            }
        }
        0.0
    }

    fn usual_mps(&self) -> Option<f64> {
        let mut drifts: Vec<f64> = self.history.iter().copied().collect();
        drifts.sort_unstable_by(f64::total_cmp);
        drifts.get(drifts.len() / 2).copied().filter(|_| drifts.len() >= KNOWN_AFTER)
    }

    /// Counts a step that was compared. Gives the jump, 0 when it is none.
    fn judge(&mut self, at: GpsTime, jump_m: f64, signals: usize) -> f64 {
        self.jumps.compared += 1;
        if jump_m.abs() < SMALLEST_M {
            return 0.0;
        }
        self.add(at, jump_m, signals);
        jump_m
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

    pub(super) fn report(mut self) -> ClockJumps {
        let total: u64 = self.drifts.values().sum();
        let mut below = 0;
        let drift_mps = self.drifts.iter().find_map(|(tenths, count)| {
            below += count;
            (2 * below >= total).then_some(*tenths as f64 * 0.1)
        });
        for change in std::mem::take(&mut self.waiting) {
            if change.shared_m.abs() < SMALLEST_M {
                self.jumps.compared += 1;
            } else {
                *self.jumps.unknown.entry(TOO_SHORT).or_default() += 1;
            }
        }
        ClockJumps { drift_mps, ..self.jumps }
    }
}

impl fmt::Display for ClockJumps {
    /// The jumps, or none, or why that is unknown, and in how many steps.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { count, largest_m, compared, .. } = self;
        let unknown: u64 = self.unknown.values().sum();
        match (count, compared, unknown) {
            (0, 0, 0) => return write!(f, "unknown: fewer than two epochs"),
            (0, 0, _) => return write!(f, "unknown: {}", self.reasons()),
            (0, ..) => write!(f, "none")?,
            _ => write!(f, "{count}, largest {largest_m:.1} m")?,
        }
        if unknown > 0 {
            write!(f, "; unknown in {unknown} of {} steps: {}", compared + unknown, self.reasons())?;
        }
        Ok(())
    }
}

impl ClockJumps {
    fn reasons(&self) -> String {
        let mut reasons: Vec<_> = self.unknown.iter().collect();
        reasons.sort_by_key(|(_, count)| std::cmp::Reverse(**count));
        match reasons.as_slice() {
            [(reason, _)] => (**reason).to_owned(),
            several => {
                let named = several.iter().map(|(reason, count)| format!("{reason} ({count})"));
                named.collect::<Vec<_>>().join(", ")
            }
        }
    }
}

/// Ranges, with a rate where Doppler tells it. GLONASS has none: its wavelengths need channels, and the others are enough.
fn ranges(epoch: &ObservationEpoch) -> Ranges {
    let range = |o: &cofix_common::gnss::Observation| {
        let wavelength_m = o.signal.wavelength_m(o.satellite.constellation, None);
        let rate_mps =
            wavelength_m.zip(o.doppler_hz).map(|(wavelength_m, doppler_hz)| -wavelength_m * doppler_hz);
        let range = Range { pseudorange_m: o.pseudorange_m?, rate_mps, trend_mps: None };
        Some(((o.satellite, o.signal), range))
    };
    epoch.observations.iter().filter_map(range).collect()
}

/// Gives ranges the rate at which they came from those before, the clock's jump taken out.
fn set_trends(now: &mut Ranges, before: &Ranges, elapsed_s: f64, jump_m: f64) {
    for (signal, range) in now {
        let trend = |before: &Range| (range.pseudorange_m - before.pseudorange_m - jump_m) / elapsed_s;
        range.trend_mps = before.get(signal).map(trend);
    }
}

/// The part of a change of pseudorange that the rates of both epochs do not explain, m.
fn beyond_rate_m(before: &Range, now: &Range, elapsed_s: f64) -> Option<f64> {
    let rate_mps = 0.5 * (before.rate_mps? + now.rate_mps?);
    Some(now.pseudorange_m - before.pseudorange_m - rate_mps * elapsed_s)
}

/// The part of a change of pseudorange that the change before does not explain, m.
fn beyond_trend_m(before: &Range, now: &Range, elapsed_s: f64) -> Option<f64> {
    Some(now.pseudorange_m - before.pseudorange_m - before.trend_mps? * elapsed_s)
}

/// The change that most signals share.
fn common_m(mut changes_m: Vec<f64>) -> Option<f64> {
    changes_m.sort_unstable_by(f64::total_cmp);
    let median = *changes_m.get(changes_m.len() / 2)?;
    let tolerance = (AGREE * median.abs()).clamp(0.5 * SMALLEST_M, SMALLEST_M);
    let agreeing = changes_m.iter().filter(|change| (*change - median).abs() < tolerance).count();
    (4 * agreeing >= 3 * changes_m.len()).then_some(median)
}

#[cfg(test)]
mod tests {
    use cofix_common::gnss::{Constellation, EpochFlag, LossOfLock, Observation};

    use super::*;

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

    fn without_doppler(mut epoch: ObservationEpoch) -> ObservationEpoch {
        epoch.observations.iter_mut().for_each(|observation| observation.doppler_hz = None);
        epoch
    }

    /// The report on epochs at these seconds, with a millisecond more from `jump_at` on.
    fn report(seconds: impl IntoIterator<Item = u32>, jump_at: u32, doppler: bool) -> ClockJumps {
        let mut clock = Clock::default();
        for second in seconds {
            let epoch = epoch(second, if second < jump_at { 0.0 } else { 299_792.458 });
            clock.epoch(&if doppler { epoch } else { without_doppler(epoch) });
        }
        clock.report()
    }

    #[test]
    fn jumps_are_found_without_doppler_too() {
        let jumps = report(0..10, 5, false);
        assert_eq!((jumps.count, jumps.drift_mps), (1, None));
        assert!((jumps.largest_m - 299_792.458).abs() < 1e-3);
        assert_eq!(jumps.first[0].at_gps, "2020-08-09T00:00:05.000");
        assert_eq!(jumps.compared, 8);
        assert_eq!(jumps.to_string(), "1, largest 299792.5 m; unknown in 1 of 9 steps: no Doppler");
    }

    /// Which of the first steps it is in cannot be told, and nothing is made up.
    #[test]
    fn a_jump_at_the_beginning_without_doppler_is_unknown() {
        for (jump_at, unknown) in [(1, 2), (2, 3)] {
            let jumps = report(0..10, jump_at, false);
            assert_eq!((jumps.count, jumps.unknown[NO_DOPPLER], jumps.compared), (0, unknown, 9 - unknown));
        }
        assert_eq!(report(0..10, 3, false).count, 1);
    }

    #[test]
    fn a_jump_before_the_drift_is_known_is_found_afterwards() {
        for jump_at in 1..4 {
            assert_eq!(report(0..10, jump_at, true).count, 1, "at {jump_at}");
        }
    }

    #[test]
    fn what_cannot_be_known_is_not_called_none() {
        for (what, jumps, said) in [
            ("at 1 Hz", report(0..10, 99, true), "none"),
            ("two epochs", report(0..2, 99, true), "none"),
            (
                "two epochs with a jump",
                report(0..2, 1, true),
                "unknown: recording too short to tell a jump from drift",
            ),
            ("two epochs without Doppler", report(0..2, 1, false), "unknown: no Doppler"),
            ("one epoch", report(0..1, 99, true), "unknown: fewer than two epochs"),
            ("every 30 s", report((0..300).step_by(30), 99, true), "unknown: epochs too far apart"),
            (
                "every 30 s, no Doppler",
                report((0..300).step_by(30), 99, false),
                "unknown: epochs too far apart",
            ),
            (
                "one gap",
                report((0..5).chain(60..65), 99, true),
                "none; unknown in 1 of 9 steps: epochs too far apart",
            ),
            (
                "one gap, no Doppler",
                report((0..5).chain(60..65), 99, false),
                "none; unknown in 3 of 9 steps: no Doppler (2), epochs too far apart (1)",
            ),
        ] {
            assert_eq!(jumps.to_string(), said, "{what}");
        }
        let mut few = Clock::default();
        for second in 0..5 {
            let mut epoch = epoch(second, 0.0);
            epoch.observations.truncate(3);
            few.epoch(&epoch);
        }
        assert_eq!(few.report().to_string(), "unknown: fewer than four signals in both epochs");
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
