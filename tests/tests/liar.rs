//! A phone that lies, through Zenoh and hub: named on the wire and in the report.

#![allow(clippy::unwrap_used)] // helpers of tests

#[path = "../../common/tests/displaced/mod.rs"]
mod displaced;

use std::time::Duration;

use cofix_common::fusion::peers::{ErrorKind, EventKind};
use cofix_common::integrity::{Cause, Verdict};
use cofix_common::simulation::Scenario;
use cofix_common::skips::Skips;
use cofix_common::wire::{
    EpochMessage, FusedMessage, IntegrityMessage, PhoneStatus, decode, fused_key, integrity_key,
};
use cofix_hub::group::Course;
use cofix_tests::{Hub, by_hand};
use displaced::{displace, east_of};
use zenoh::Wait;

/// Number of epochs of a phone before it lies.
const HONEST_EPOCHS: usize = 60;

/// Measurements and solution of a place 30 m to the east.
fn lie(message: &mut EpochMessage) {
    if let Some(place) = message.wls.as_ref().map(|solution| solution.position) {
        displace(message, place, east_of(place, 30.0));
    }
}

#[test]
fn a_phone_that_lies_is_named_to_listeners() {
    let plan = cofix_hub::demo::plan(Scenario { duration_s: 100.0, ..Scenario::car(3) }).unwrap();
    let hub = Hub::start(&plan, Course::Replay).unwrap();
    let listener = hub.foreign_session().unwrap();
    let events = listener.declare_subscriber(integrity_key(&plan.group).unwrap()).wait().unwrap();
    let liar = plan.phones[2].name.clone();
    let fused = listener.declare_subscriber(fused_key(&plan.group, &liar).unwrap()).wait().unwrap();
    let mut publications = Vec::new();
    for phone in 0..3 {
        let mut publication = by_hand::publication(&plan, phone, &hub.endpoints).unwrap();
        let mut messages = by_hand::messages(&plan, phone).unwrap();
        if phone == 2 {
            messages.iter_mut().skip(HONEST_EPOCHS).for_each(lie);
        }
        for message in &messages {
            publication.epoch(message).unwrap();
        }
        let (epochs_published, skips) = (messages.len() as u64, Skips::default());
        publication.status(PhoneStatus::Finished { epochs_published, skips, error: None }).unwrap();
        publications.push(publication);
    }
    let report = hub.join().unwrap();
    let sample = events.recv_timeout(Duration::from_secs(10)).unwrap().unwrap();
    let told: IntegrityMessage = decode(&sample.payload().to_bytes()).unwrap();
    assert_eq!((told.kind, &told.phones), (EventKind::Isolated, &vec![liar.clone()]), "{told:?}");
    assert_eq!(told.error, Some(ErrorKind::WrongPlace));
    let reported: Vec<(EventKind, &str, &str)> =
        report.integrity_events.iter().map(|e| (e.kind, e.phone.as_str(), e.detail.as_str())).collect();
    assert_eq!(reported, [(told.kind, liar.as_str(), told.detail.as_str())]);
    let messages = std::iter::from_fn(|| fused.try_recv().ok().flatten());
    let messages = messages.map(|sample| decode::<FusedMessage>(&sample.payload().to_bytes()).unwrap());
    // Epochs at the end, without one of the phone, have no verdict.
    let verdicts: Vec<Verdict> = messages
        .filter(|message| message.time_gps > told.time_gps)
        .filter_map(|message| message.verdict)
        .collect();
    let expected = Verdict::Unreliable(Cause::Peers);
    assert!(verdicts.len() > 10 && verdicts.iter().all(|verdict| *verdict == expected), "{verdicts:?}");
}
