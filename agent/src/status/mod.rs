//! The status of phones while agent and hub run: a line for each phone, and alarms at once.
//!
//! [`LastEpochs`] describes a phone's last epochs; it has no clock of its own. [`Board`] shows lines on a terminal, where they are redrawn
//! every second, or logs them every minute.

mod board;

use std::collections::VecDeque;
use std::time::Duration;

use cofix_common::filter::PhoneState;
use cofix_common::frames::LocalFrame;
use cofix_common::integrity::Verdict;
use cofix_common::time::GpsTime;
use cofix_common::wire::EpochMessage;

pub use board::Board;

/// Span over which the rate of epochs is counted.
const RATE_WINDOW: Duration = Duration::from_secs(10);
/// Shortest time between two alarms of the same kind about a phone.
const QUIET: Duration = Duration::from_mins(1);
/// Difference from the computer's clock beyond which epochs are those of a recording, s.
const RECORDING_S: f64 = 30.0 * 86_400.0;
/// Difference between the clocks of a live phone and the computer beyond which one of the two is wrong, s.
const WRONG_CLOCK_S: f64 = 60.0;
/// Age of its epochs beyond which a live phone falls behind, s.
const LATE_S: f64 = 10.0;

/// An instant by a steady clock, and in GPS time by the computer's clock.
#[derive(Clone, Copy, Debug)]
pub struct Moment {
    /// Time since the start.
    pub now: Duration,
    /// GPS time by the computer's clock.
    pub wall_gps: GpsTime,
}

/// A phone's last epoch.
#[derive(Clone, Copy, Debug)]
struct Last {
    at: Duration,
    time_gps: GpsTime,
    satellites: usize,
    sigma_m: Option<f64>,
    verdict: Verdict,
}

/// Figures of a phone's last epochs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figures {
    /// Age of the last epoch by the computer's clock, s; of a recording, time since it came.
    pub age_s: f64,
    /// Whether the last epoch is of a recording.
    pub is_recorded: bool,
    /// Epochs per second in the last ten seconds, Hz.
    pub rate_hz: f64,
    /// Satellites used in the last epoch.
    pub satellites: usize,
    /// Horizontal standard deviation of the last position, m; `None`: there is none.
    pub horizontal_sigma_m: Option<f64>,
    /// The agent's verdict on the last epoch.
    pub verdict: Verdict,
    /// How many epochs have come.
    pub epochs: u64,
}

/// A phone's last epochs.
#[derive(Clone, Debug, Default)]
pub struct LastEpochs {
    epochs: u64,
    arrivals: VecDeque<Duration>,
    last: Option<Last>,
    verdict_alarm: Option<Duration>,
    late_alarm: Option<Duration>,
    clock_alarm: bool,
}

impl LastEpochs {
    /// Takes an epoch, with the phone's state, if there is one. Returns alarms to be logged at once.
    pub fn epoch(
        &mut self,
        message: &EpochMessage,
        state: Option<&PhoneState>,
        moment: Moment,
    ) -> Vec<String> {
        let last = Last {
            at: moment.now,
            time_gps: message.time_gps,
            satellites: message.satellites_used(),
            sigma_m: state.and_then(horizontal_sigma_m),
            verdict: message.raim.verdict,
        };
        let mut alarms = Vec::new();
        alarms.extend(self.verdict_alarm(last.verdict, moment.now));
        alarms.extend(self.clock_alarm(moment.wall_gps - last.time_gps, moment.now));
        self.epochs += 1;
        self.arrivals.push_back(moment.now);
        self.last = Some(last);
        alarms
    }

    fn verdict_alarm(&mut self, verdict: Verdict, now: Duration) -> Option<String> {
        let was_unreliable = self.last.is_some_and(|last| matches!(last.verdict, Verdict::Unreliable(_)));
        if was_unreliable || !matches!(verdict, Verdict::Unreliable(_)) || !may_alarm(self.verdict_alarm, now)
        {
            return None;
        }
        self.verdict_alarm = Some(now);
        Some(format!("its position is {verdict}"))
    }

    fn clock_alarm(&mut self, age_s: f64, now: Duration) -> Option<String> {
        if age_s.abs() >= RECORDING_S {
            return None;
        }
        if age_s.abs() >= WRONG_CLOCK_S {
            let side = if age_s > 0.0 { "behind" } else { "ahead of" };
            return (!std::mem::replace(&mut self.clock_alarm, true)).then(|| {
                format!("its epochs are {:.0} s {side} this computer's clock: one of the two is wrong, or it is a recording", age_s.abs())
            });
        }
        if age_s < LATE_S || !may_alarm(self.late_alarm, now) {
            return None;
        }
        self.late_alarm = Some(now);
        Some(format!("its epochs are {age_s:.0} s late"))
    }

    /// The figures at an instant; `None` before the first epoch.
    pub fn figures(&mut self, moment: Moment) -> Option<Figures> {
        let last = self.last?;
        let Moment { now, wall_gps } = moment;
        while self.arrivals.pop_front_if(|at| now.saturating_sub(*at) >= RATE_WINDOW).is_some() {}
        let window_s = RATE_WINDOW.min(now).as_secs_f64().max(1.0);
        let rate_hz = self.arrivals.len() as f64 / window_s;
        let age_s = wall_gps - last.time_gps;
        let is_recorded = age_s.abs() >= RECORDING_S;
        Some(Figures {
            age_s: if is_recorded { now.saturating_sub(last.at).as_secs_f64() } else { age_s },
            is_recorded,
            rate_hz,
            satellites: last.satellites,
            horizontal_sigma_m: last.sigma_m,
            verdict: last.verdict,
            epochs: self.epochs,
        })
    }

    /// The phone in a line: age of its last epoch, rate, satellites, horizontal standard deviation, verdict.
    pub fn line(&mut self, name: &str, moment: Moment) -> String {
        let Some(figures) = self.figures(moment) else { return format!("{name}: no epoch yet") };
        let Figures { age_s, is_recorded, rate_hz, satellites, horizontal_sigma_m, verdict, epochs } =
            figures;
        let age = if is_recorded { format!("came {age_s:.1} s ago") } else { format!("{age_s:.1} s old") };
        let sigma = horizontal_sigma_m
            .map_or_else(|| "no sigma".to_owned(), |sigma_m| format!("sigma {sigma_m:.1} m"));
        format!(
            "{name}: {age}, {rate_hz:.1} Hz, {satellites} satellites, {sigma}, {verdict}; {epochs} epochs"
        )
    }
}

fn may_alarm(last: Option<Duration>, now: Duration) -> bool {
    last.is_none_or(|last| now.saturating_sub(last) >= QUIET)
}

/// Standard deviation of a horizontal position, m: the root of the trace of its covariance.
fn horizontal_sigma_m(state: &PhoneState) -> Option<f64> {
    let frame = LocalFrame::at(state.position());
    let enu = frame.covariance_ecef_to_enu(&state.covariance.fixed_view::<3, 3>(0, 0).into_owned());
    let sigma_m = (enu[(0, 0)] + enu[(1, 1)]).sqrt();
    sigma_m.is_finite().then_some(sigma_m)
}

#[cfg(test)]
mod tests;
