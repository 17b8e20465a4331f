//! Phones of a real drive that are made to lie: named by the others, and without harm to them.

#![allow(clippy::unwrap_used)] // helpers of tests

mod beside;
mod displaced;

use std::sync::Arc;
use std::time::Duration;

use cofix_common::accuracy::{Solution, Truth, score};
use cofix_common::formats::rinex::ObservationFile;
use cofix_common::frames::EcefVector;
use cofix_common::fusion::align::{AlignOptions, Aligner};
use cofix_common::fusion::engine::{Engine, EngineOptions, FusedEpoch, ScheduledConstraint};
use cofix_common::fusion::peers::{ErrorKind, EventKind};
use cofix_common::orbit::{NavigationFile, Products, Sp3};
use cofix_common::pipeline::{PhonePipeline, PipelineOptions};
use cofix_common::wire::EpochMessage;
use displaced::{bounds, displace, east_of};

const PHONES: [&str; 4] = ["HP30", "HP20", "VX30", "XIM8"];
/// Number of the epoch from which on a phone lies.
const LIES_AT: usize = 150;
const WH: &str = "data/whu-wuhan-2020-08-13";

type Messages = Vec<Vec<EpochMessage>>;

/// The messages of the four phones on WH-3-09.
fn drive() -> Messages {
    let sp3 = Sp3::parse(&beside::required(&format!("{WH}/orbits.sp3"))).unwrap();
    let navigation =
        NavigationFile::parse(&beside::required("data/ESBC00DNK_R_20201770000_01D_MN.rnx.gz")).unwrap();
    let products = Arc::new(Products::new(vec![sp3], vec![navigation]));
    let run = |name: &str| {
        let file = ObservationFile::parse(&beside::required(&format!("{WH}/WH-3-09/{name}.rnx"))).unwrap();
        let mut pipeline = PhonePipeline::new(name, Arc::clone(&products), PipelineOptions::default());
        file.epochs.iter().map(|epoch| pipeline.process(epoch)).collect()
    };
    PHONES.into_iter().map(run).collect()
}

/// Moves what a message says of the phone's place; its own solution is near enough to where it is.
fn move_by(message: &mut EpochMessage, by: EcefVector) {
    if let Some(place) = message.wls.as_ref().map(|solution| solution.position) {
        displace(message, place, by);
    }
}

fn east(message: &EpochMessage, metres: f64) -> EcefVector {
    east_of(message.wls.as_ref().unwrap().position, metres)
}

/// Two metres between all pairs, as in the session file.
fn fused(messages: &Messages) -> Vec<FusedEpoch> {
    let mut aligner = Aligner::new(PHONES.len(), AlignOptions::default());
    for (phone, messages) in messages.iter().enumerate() {
        for message in messages {
            aligner.push(phone, message.clone(), Duration::ZERO);
        }
        aligner.finish(phone);
    }
    let always = |constraint| ScheduledConstraint { constraint, from_gps: None, to_gps: None };
    let scheduled = bounds(PHONES.len()).into_iter().map(always).collect();
    let mut engine = Engine::new(&PHONES.map(str::to_owned), scheduled, EngineOptions::default());
    std::iter::from_fn(|| aligner.pop_ready()).map(|bucket| engine.step(bucket)).collect()
}

/// 95th percentile of the horizontal error of a phone, m.
fn p95_m(phone: usize, epochs: &[FusedEpoch]) -> f64 {
    let name = if PHONES[phone] == "XIM8" { "XIM8" } else { "HP30" };
    let truth = beside::required(&format!("{WH}/WH-3-09/{name}.truth.csv"));
    let truth = Truth::parse_csv(&truth).unwrap().0;
    let solution = |epoch: &FusedEpoch| {
        let state = epoch.phones[phone].state.as_ref()?;
        Some(Solution {
            time_gps: epoch.time_gps,
            position: state.position(),
            covariance: state.covariance.fixed_view::<3, 3>(0, 0).into_owned(),
        })
    };
    let solutions: Vec<Solution> = epochs.iter().filter_map(solution).collect();
    let span = (epochs[0].time_gps, epochs[epochs.len() - 1].time_gps);
    score(&truth, &[1], span, &solutions).unwrap().horizontal_p95_m
}

/// One of the lies: a change of the messages from [`LIES_AT`] on.
type Lie = (&'static str, ErrorKind, fn(&mut [EpochMessage], usize));

const LIES: [Lie; 4] = [
    ("30 m away", ErrorKind::WrongPlace, |messages, from| {
        for message in &mut messages[from..] {
            let by = east(message, 30.0);
            move_by(message, by);
        }
    }),
    ("walking", ErrorKind::Drifting, |messages, from| {
        let begin = messages[from].time_gps;
        for message in &mut messages[from..] {
            let by = east(message, 0.5 * (message.time_gps - begin));
            move_by(message, by);
        }
    }),
    ("frozen", ErrorKind::Frozen, |messages, from| {
        let begin = messages[from].wls.as_ref().unwrap().position;
        for message in &mut messages[from..] {
            let Some(solution) = &message.wls else { continue };
            let by = begin - solution.position;
            move_by(message, by);
        }
    }),
    ("a second late", ErrorKind::WrongClock, |messages, from| {
        let times: Vec<_> = messages.iter().map(|message| message.time_gps).collect();
        let before = messages.to_vec();
        for (index, message) in messages.iter_mut().enumerate().skip(from) {
            *message = EpochMessage {
                sequence: message.sequence,
                time_gps: times[index],
                ..before[index - 1].clone()
            };
            message.changes_since_gps = None;
            message.observations.iter_mut().for_each(|observation| observation.range_change = None);
        }
    }),
];

/// Every phone but the one with the best truth lies in each way. It is named and nobody else, and the others are as good as without it.
#[test]
#[ignore = "needs the reference data"]
fn each_liar_is_named_and_does_no_harm() {
    let honest = drive();
    let mut slowest_s = [0.0_f64; LIES.len()];
    let mut right = 0;
    for liar in 1..PHONES.len() {
        let mut without = honest.clone();
        without[liar].clear();
        let without = fused(&without);
        for ((name, expected, lie), slowest_s) in LIES.iter().zip(&mut slowest_s) {
            let mut lying = honest.clone();
            lie(&mut lying[liar], LIES_AT);
            let begin = lying[liar][LIES_AT].time_gps;
            let epochs = fused(&lying);
            let told: Vec<_> = epochs.iter().flat_map(|epoch| &epoch.events).collect();
            let seconds: Vec<(f64, EventKind)> =
                told.iter().map(|event| (event.time_gps - begin, event.kind)).collect();
            println!(
                "{} {name}: {seconds:.1?}, {:?}",
                PHONES[liar],
                told.first().and_then(|event| event.error)
            );
            assert!(told.iter().all(|event| event.phones == [liar]), "{name}: {told:?}");
            assert_eq!(seconds[0].1, EventKind::Isolated, "{name}");
            assert!(seconds[0].0 >= 0.0, "{name}: {seconds:?}");
            *slowest_s = slowest_s.max(seconds[0].0);
            right += usize::from(told[0].error == Some(*expected));
            let others = (0..PHONES.len()).filter(|phone| *phone != liar);
            let p95s: Vec<(f64, f64)> =
                others.map(|phone| (p95_m(phone, &epochs), p95_m(phone, &without))).collect();
            println!("  p95 with and without it: {p95s:.2?} m");
            let sums = p95s.iter().fold((0.0, 0.0), |sum, p95| (sum.0 + p95.0, sum.1 + p95.1));
            assert!(sums.0 < 1.1 * sums.1, "{} {name}: {p95s:.2?}", PHONES[liar]);
        }
    }
    // What was measured, with a tenth.
    for (slowest_s, measured_s) in slowest_s.into_iter().zip([8.0, 36.0, 25.0, 27.0]) {
        assert!(slowest_s <= 1.1 * measured_s, "{slowest_s} s, was {measured_s} s");
    }
    assert!(right >= 10, "{right} of 12 kinds are right");
}
