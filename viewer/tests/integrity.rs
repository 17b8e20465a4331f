//! The section on integrity of a summary, of a simulated car in which one phone lies for a while.

#![allow(clippy::unwrap_used)] // helpers of tests, too

#[path = "../../common/tests/displaced/mod.rs"]
mod displaced;
#[path = "../../common/tests/group/mod.rs"]
mod group;

use std::path::Path;

use cofix_common::accuracy::{Claim, Protection, Truth, TruthPoint};
use cofix_common::frames::EcefVector;
use cofix_common::fusion::engine::FusedEpoch;
use cofix_common::simulation::Scenario;
use cofix_hub::outputs::recorder::{Recorder, RecorderConfig};
use cofix_hub::report::scores::Reference;
use cofix_viewer::integrity::{Levels, Verdicts};
use cofix_viewer::summary::Summary;
use displaced::{bounds, displace, east_of};
use group::Group;

const PHONES: usize = 4;
const LIAR: usize = 3;

/// A car of which the last phone is 30 m to the east of its place from 60 s to 90 s, by its pseudoranges and its solution.
fn lying() -> Group {
    let mut group = Group::simulated(Scenario { duration_s: 130.0, ..Scenario::car(PHONES) });
    let start = group.simulation.scenario().start_gps;
    let mut messages = std::mem::take(&mut group.messages[LIAR]);
    for message in messages.iter_mut().filter(|m| (60.0..90.0).contains(&(m.time_gps - start))) {
        let place = group.simulation.truth_at(LIAR, message.time_gps).position;
        displace(message, place, east_of(place, 30.0));
    }
    group.messages[LIAR] = messages;
    group
}

fn fused(group: &Group) -> Vec<FusedEpoch> {
    group.fused(&bounds(PHONES)).into_iter().map(|(_, epoch)| epoch).collect()
}

fn record(path: &Path, group: &Group, epochs: &[FusedEpoch], has_truth: bool) {
    let phones = (0..PHONES).map(|phone| format!("P{phone}")).collect();
    let config = RecorderConfig { group: "car".to_owned(), phones };
    let mut recorder = Recorder::to_file(path, &config).unwrap();
    for epoch in epochs {
        let reference = |phone: usize| {
            Reference::look_up(epoch, phone, |time| Some(group.simulation.truth_at(phone, time).position))
        };
        let truth: Vec<Reference> = if has_truth { (0..PHONES).map(reference).collect() } else { Vec::new() };
        recorder.record(epoch, &truth).unwrap();
    }
    recorder.finish("").unwrap();
}

/// What the report would say of one phone, fused and epoch-wise.
fn scored(group: &Group, epochs: &[FusedEpoch], phone: usize) -> [Protection; 2] {
    let fused = epochs.iter().filter_map(|epoch| {
        let FusedEpoch { time_gps, phones, .. } = epoch;
        let (state, verdict) = phones[phone].state.as_ref().zip(phones[phone].verdict)?;
        Some(Claim::of(*time_gps, state.position(), verdict, phones[phone].protection))
    });
    let own = epochs.iter().filter_map(|epoch| {
        let message = epoch.phones[phone].message.as_ref()?;
        let solution = message.wls.as_ref()?;
        Some(Claim::of(message.time_gps, solution.position, message.raim.verdict, message.raim.protection))
    });
    [fused.collect::<Vec<_>>(), own.collect()].map(|claims: Vec<Claim>| {
        let point = |claim: &Claim| {
            let position = group.simulation.truth_at(phone, claim.time_gps).position;
            (claim.time_gps, TruthPoint { position, velocity: EcefVector::new(0.0, 0.0, 0.0) })
        };
        Protection::score(&Truth::from_points(claims.iter().map(point), 1), &[1], &claims)
    })
}

fn assert_equal(levels: Levels, verdicts: Verdicts, expected: &Protection) {
    let share = |count: usize, of: usize| count as f64 / of as f64;
    let near = |a: f64, b: Option<f64>| assert!((a - b.unwrap()).abs() < 1e-9, "{levels:?} {expected:?}");
    assert_eq!(levels.with_truth, verdicts.reliable);
    near(share(verdicts.reliable, verdicts.total()), expected.reliable_availability);
    near(share(levels.bounded_horizontally, levels.with_truth), expected.hpl_bounds);
    near(share(levels.bounded_vertically, levels.with_truth), expected.vpl_bounds);
    near(levels.hpl_p50_m.unwrap(), expected.hpl_p50_m);
    near(levels.vpl_p50_m.unwrap(), expected.vpl_p50_m);
    assert_eq!(levels.misleading as u64, expected.misleading_epochs.unwrap());
}

#[test]
fn a_summary_tells_what_the_report_tells() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("car.rrd");
    let group = lying();
    let epochs = fused(&group);
    record(&path, &group, &epochs, true);
    let summary = Summary::read(&path).unwrap();
    let text = summary.render(false);
    println!("{text}");
    for phone in 0..PHONES {
        let of = summary.integrity.phones[&format!("P{phone}")];
        let [fused, own] = scored(&group, &epochs, phone);
        assert_equal(of.fused.levels, of.fused.verdicts, &fused);
        assert_equal(of.epoch_wise.levels, of.epoch_wise.verdicts, &own);
    }
    let liar = summary.integrity.phones["P3"];
    assert!(liar.epoch_wise.levels.misleading >= 25, "RAIM does not notice: {liar:?}");
    assert!(liar.fused.levels.misleading < 5 && liar.fused.verdicts.unreliable >= 25, "{liar:?}");
    let [isolated, readmitted] = &summary.integrity.events[..] else { panic!("{text}") };
    assert!(isolated.contains(" GPS P3 contradicts the other phones and is isolated: "), "{text}");
    assert!(readmitted.ends_with(" GPS P3 agrees with the other phones again"), "{text}");
    assert!(
        text.contains(&format!("\n2 events of the group's integrity\n{isolated}\n{readmitted}\n")),
        "{text}"
    );
    // Columns are aligned.
    let rows = text.lines().filter(|line| line.starts_with("P0  ")).map(|line| line.chars().count());
    let heads = text.lines().filter(|line| line.starts_with("phone  ")).map(|line| line.chars().count());
    let (rows, heads): (Vec<_>, Vec<_>) = (rows.collect(), heads.collect());
    assert_eq!(rows, [heads[0], heads[0], heads[1], heads[1]], "{text}");
}

#[test]
fn without_a_truth_verdicts_and_levels_are_told() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("car.rrd");
    let group = Group::simulated(Scenario { duration_s: 20.0, ..Scenario::car(PHONES) });
    let epochs = fused(&group);
    record(&path, &group, &epochs, false);
    let summary = Summary::read(&path).unwrap();
    let text = summary.render(false);
    let of = summary.integrity.phones["P0"];
    assert_eq!((of.fused.levels.with_truth, of.fused.levels.misleading), (0, 0));
    assert!(of.fused.verdicts.reliable > 15 && of.fused.levels.hpl_p50_m.is_some(), "{text}");
    assert!(text.contains("no event of the group's integrity") && !text.contains("misleading"), "{text}");
}
