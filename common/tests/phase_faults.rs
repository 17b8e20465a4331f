//! Faults of carrier phases, put into the recordings of a phone with good ones: each is named, and positions hardly change.

#![allow(clippy::unwrap_used)] // helpers of tests

mod beside;

use std::sync::Arc;

use cofix_common::accuracy::{Accuracy, Solution, Truth, score};
use cofix_common::constants::SPEED_OF_LIGHT_MPS;
use cofix_common::filter::FilterOptions;
use cofix_common::formats::rinex::ObservationFile;
use cofix_common::gnss::{Observation, ObservationEpoch};
use cofix_common::orbit::{NavigationFile, Products, Sp3};
use cofix_common::pipeline::{PhonePipeline, PipelineOptions};
use cofix_common::skips::{Reason, Skips};

/// Largest growth of the 95th percentile of the horizontal error by any fault.
const WORSE: f64 = 1.10;

/// A phone's recording with its truth.
struct Drive {
    epochs: Vec<ObservationEpoch>,
    truth: Truth,
    products: Arc<Products>,
}

impl Drive {
    fn read(session: &str, phone: &str) -> Self {
        let whu = "data/whu-wuhan-2020-08-13";
        let sp3 = Sp3::parse(&beside::required(&format!("{whu}/orbits.sp3"))).unwrap();
        let navigation = beside::required("data/ESBC00DNK_R_20201770000_01D_MN.rnx.gz");
        let products = Products::new(vec![sp3], vec![NavigationFile::parse(&navigation).unwrap()]);
        let read = |ending: &str| beside::required(&format!("{whu}/{session}/{phone}.{ending}"));
        Self {
            epochs: ObservationFile::parse(&read("rnx")).unwrap().epochs,
            truth: Truth::parse_csv(&read("truth.csv")).unwrap().0,
            products: Arc::new(products),
        }
    }

    /// Accuracy of the local filter, and what was counted, with `alter` applied to each epoch (by its number).
    fn run(&self, carrier_phase: bool, alter: impl Fn(usize, &mut ObservationEpoch)) -> (Accuracy, Skips) {
        let filter = FilterOptions { use_changes: carrier_phase, ..FilterOptions::default() };
        let options = PipelineOptions { filter, ..PipelineOptions::default() };
        let mut pipeline = PhonePipeline::new("phone", Arc::clone(&self.products), options);
        let mut solutions = Vec::new();
        for (k, epoch) in self.epochs.iter().enumerate() {
            let mut altered = epoch.clone();
            alter(k, &mut altered);
            let message = pipeline.process(&altered);
            solutions.extend(message.local.map(|state| Solution {
                time_gps: message.time_gps,
                position: state.position(),
                covariance: state.covariance.fixed_view::<3, 3>(0, 0).into_owned(),
            }));
        }
        let span = (self.epochs[0].time_gps, self.epochs.last().unwrap().time_gps);
        (score(&self.truth, &[1], span, &solutions).unwrap(), pipeline.skips())
    }
}

/// Adds to every phase of an epoch.
fn shift_phases(epoch: &mut ObservationEpoch, cycles: impl Fn(&Observation) -> f64) {
    for observation in &mut epoch.observations {
        let shift = cycles(observation);
        observation.carrier_phase_cycles = observation.carrier_phase_cycles.map(|phase| phase + shift);
    }
}

/// A fault, what names it, and how often at least.
struct Fault<'a> {
    name: &'static str,
    reason: Reason,
    least: u64,
    alter: &'a dyn Fn(usize, &mut ObservationEpoch),
}

fn faults() -> [Fault<'static>; 4] {
    [
        Fault {
            name: "a slip of some cycles a minute and satellite",
            reason: Reason::PhaseContradictsOthers,
            least: 30,
            alter: &|k, epoch| {
                shift_phases(epoch, |o| (1.0 + f64::from(o.satellite.number % 4)) * slips(k, o));
            },
        },
        Fault {
            name: "a slip of a thousand cycles a minute and satellite",
            reason: Reason::PhaseContradictsOthers,
            least: 30,
            alter: &|k, epoch| {
                shift_phases(epoch, |o| 1_000.0 * slips(k, o));
            },
        },
        Fault {
            name: "a slip of half a cycle a minute and satellite",
            reason: Reason::PhaseContradictsOthers,
            least: 30,
            alter: &|k, epoch| {
                shift_phases(epoch, |o| 0.5 * slips(k, o));
            },
        },
        Fault {
            name: "clock jumps of a millisecond",
            // Nothing is wrong: phases and codes share the clock.
            reason: Reason::EpochTimeLimited,
            least: 0,
            alter: &|k, epoch| {
                let jump_s = 1e-3 * (k / 100) as f64;
                epoch.time_gps = epoch.time_gps + jump_s;
                for observation in &mut epoch.observations {
                    let jumped = |p: f64| p + SPEED_OF_LIGHT_MPS * jump_s;
                    observation.pseudorange_m = observation.pseudorange_m.map(jumped);
                }
                shift_phases(epoch, |o| {
                    jump_s * o.signal.frequency_hz(o.satellite.constellation, Some(0)).unwrap_or_default()
                });
            },
        },
    ]
}

/// Number of slips of a satellite until epoch `k`: one a minute, at another second for each satellite.
fn slips(k: usize, observation: &Observation) -> f64 {
    ((k + 7 * usize::from(observation.satellite.number)) / 60) as f64
}

#[test]
#[ignore = "needs the reference data"]
fn faults_of_phases_are_named_and_cost_little() {
    for session in ["WH-3-08", "WH-3-09", "WH-4-06"] {
        let drive = Drive::read(session, "XIM8");
        let (sound, counted) = drive.run(true, |_, _| {});
        let (without, _) = drive.run(false, |_, _| {});
        println!(
            "{session}: p95 {:.2} m, {:.2} m without phases",
            sound.horizontal_p95_m, without.horizontal_p95_m
        );
        assert!(sound.horizontal_p95_m < 0.9 * without.horizontal_p95_m, "phases help");
        let check = |fault: &Fault<'_>, limit_m: f64| {
            let (accuracy, skips) = drive.run(true, fault.alter);
            let more = skips.count(fault.reason).saturating_sub(counted.count(fault.reason));
            let (name, p95_m) = (fault.name, accuracy.horizontal_p95_m);
            println!("{session} {name}: p95 {p95_m:.2} m, {more} more of '{}'", fault.reason.text());
            assert!(p95_m < WORSE * limit_m, "{name}: {p95_m} m");
            assert!(more >= fault.least, "{name}: {skips}");
            assert!(accuracy.availability >= sound.availability, "{name}");
        };
        for fault in faults() {
            check(&fault, sound.horizontal_p95_m);
        }
        // Without continuity phases say nothing.
        let duty_cycled = Fault {
            name: "duty cycling",
            reason: Reason::PhaseLockLost,
            least: 1_000,
            alter: &|_, epoch| epoch.observations.iter_mut().for_each(|o| o.loss_of_lock.cycle_slip = true),
        };
        check(&duty_cycled, without.horizontal_p95_m);
    }
}
