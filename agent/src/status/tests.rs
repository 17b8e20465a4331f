use cofix_common::integrity::{Cause, RaimReport};
use nalgebra::SMatrix;

use super::*;

fn at(seconds: f64) -> GpsTime {
    GpsTime::from_week_tow(2118, 397_000.0) + seconds
}

fn message(seconds: f64, verdict: Verdict) -> EpochMessage {
    EpochMessage {
        phone: "pixel".to_owned(),
        sequence: 0,
        time_gps: at(seconds),
        observations: Vec::new(),
        changes_since_gps: None,
        wls: None,
        local: None,
        local_integrity: None,
        raim: RaimReport::of(verdict),
    }
}

/// A moment `seconds` after the start, at which the computer's clock is ahead of the epochs by `ahead_s`.
fn moment(seconds: f64, ahead_s: f64) -> Moment {
    Moment { now: Duration::from_secs_f64(seconds), wall_gps: at(seconds + ahead_s) }
}

fn state() -> PhoneState {
    let mean = [-2.27e6, 5.01e6, 3.22e6, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    PhoneState { mean: mean.into(), covariance: SMatrix::identity() * 2.0 }
}

#[test]
fn a_line_says_age_rate_satellites_sigma_and_verdict() {
    let mut last = LastEpochs::default();
    assert_eq!(last.line("pixel", moment(3.0, 0.0)), "pixel: no epoch yet");
    for second in 0..30_u32 {
        let second = f64::from(second);
        let said = last.epoch(&message(second, Verdict::Reliable), Some(&state()), moment(second, 0.4));
        assert!(said.is_empty(), "{said:?}");
    }
    let line = last.line("pixel", moment(31.0, 0.4));
    assert_eq!(line, "pixel: 2.4 s old, 0.8 Hz, 0 satellites, sigma 2.0 m, reliable; 30 epochs");
    // A recording, years ago.
    let line = last.line("pixel", moment(31.0, 2e8));
    assert!(line.starts_with("pixel: came 2.0 s ago, 0.8 Hz"), "{line}");
}

#[test]
fn a_verdict_that_turns_bad_is_said_at_once_and_not_all_the_time() {
    let mut last = LastEpochs::default();
    let mut said = Vec::new();
    for second in 0..180_u32 {
        let bad = Verdict::Unreliable(Cause::TestsFailed);
        let verdict = if second % 4 == 3 { bad } else { Verdict::Reliable };
        let second = f64::from(second);
        for alarm in last.epoch(&message(second, verdict), None, moment(second, 0.0)) {
            said.push((second, alarm));
        }
    }
    let seconds: Vec<f64> = said.iter().map(|(second, _)| *second).collect();
    assert_eq!(seconds, [3.0, 63.0, 123.0]);
    assert_eq!(said[0].1, "its position is unreliable: tests failed");
}

#[test]
fn clocks_that_disagree_are_said_once_and_lateness_every_minute() {
    for (ahead_s, count, text) in [
        (0.5, 0, ""),
        (12.0, 2, "its epochs are 12 s late"),
        (-12.0, 0, ""),
        (1_800.0, 1, "its epochs are 1800 s behind this computer's clock"),
        (-1_800.0, 1, "its epochs are 1800 s ahead of this computer's clock"),
        (2e8, 0, ""),
    ] {
        let mut last = LastEpochs::default();
        let mut said = Vec::new();
        for second in 0..90_u32 {
            let second = f64::from(second);
            said.extend(last.epoch(&message(second, Verdict::Reliable), None, moment(second, ahead_s)));
        }
        assert_eq!(said.len(), count, "{ahead_s}: {said:?}");
        assert!(said.iter().all(|alarm| alarm.starts_with(text)), "{said:?}");
    }
}
