//! The status of a hub, asked for while agents come and go.

#![allow(clippy::unwrap_used)] // helpers of tests

use std::time::{Duration, Instant};

use cofix_agent::Stop;
use cofix_common::skips::Reason;
use cofix_common::wire::epoch_key;
use cofix_hub::group::Course;
use cofix_hub::status::{StatusDocument, ask};
use cofix_tests::enrolled::{Enrolled, Stranger};
use cofix_tests::{Hub, agent_config, by_hand, small_plan};
use zenoh::Wait;
use zenoh::qos::CongestionControl;
use zenoh::sample::Locality;

const LIVE: Course = Course::Live { until_finished: false };
/// Longest wait for what the hub will tell.
const PATIENCE: Duration = Duration::from_mins(1);

/// The first status that is as expected.
fn status_when(group: &str, hub: &Hub, is_it: impl Fn(&StatusDocument) -> bool) -> StatusDocument {
    let start = Instant::now();
    loop {
        let told = ask(group, &hub.endpoints, None, &Stop::default());
        if let Ok(document) = &told
            && is_it(document)
        {
            return document.clone();
        }
        assert!(start.elapsed() < PATIENCE, "{told:?}");
        std::thread::sleep(Duration::from_millis(200));
    }
}

#[test]
fn a_hub_tells_how_its_phones_are() {
    let plan = small_plan(2, 20.0).unwrap();
    let hub = Hub::start(&plan, LIVE).unwrap();
    let before = status_when(&plan.group, &hub, |_| true);
    assert_eq!((before.group.as_str(), before.epochs_fused), (plan.group.as_str(), 0));
    let said = before.check(1e9).unwrap_err().to_string();
    assert_eq!(said, "SIM1: no epoch yet; SIM2: no epoch yet");
    // Only the first phone's agent is there.
    let mut publication = by_hand::publication_of(&agent_config(&plan, 0, &hub.endpoints).unwrap()).unwrap();
    let sent = by_hand::messages(&plan, 0).unwrap();
    for message in &sent {
        publication.epoch(message).unwrap();
    }
    let expected = u64::try_from(sent.len()).unwrap();
    let told = status_when(&plan.group, &hub, |told| told.phones[0].epochs == expected);
    assert_eq!(told.epochs_fused, expected);
    let first = &told.phones[0];
    // The epochs are those of a recording, so their age is the time since they came.
    assert!(first.age_s.unwrap() >= 0.0 && first.age_s.unwrap() < PATIENCE.as_secs_f64(), "{first:?}");
    assert!(first.satellites.unwrap() > 4 && first.horizontal_sigma_m.unwrap() > 0.0, "{first:?}");
    assert!(first.verdict.is_some() && !first.isolated, "{first:?}");
    assert_eq!((first.lost, first.late), (0, 0));
    let age_s = first.age_s.unwrap();
    status_when(&plan.group, &hub, |told| told.phones[0].age_s.unwrap() > age_s);
    let said = told.check(1e9).unwrap_err().to_string();
    assert_eq!(said, "SIM2: no epoch yet");
    let error = ask("other", &hub.endpoints, None, &Stop::default()).unwrap_err().to_string();
    assert!(error.contains("none of group 'other'"), "{error}");
    hub.end().unwrap();
}

#[test]
fn with_certificates_the_hubs_folder_alone_is_told_the_status() {
    let plan = small_plan(1, 10.0).unwrap();
    let enrolled = Enrolled::new(&plan).unwrap();
    let hub = Hub::start_for(&plan, LIVE, &enrolled.listening(true).unwrap()).unwrap();
    let session = Stranger::with(enrolled.credentials("SIM1").unwrap()).connect(&hub.endpoints).unwrap();
    let question = session.get(format!("cofix/{}/status", plan.group)).timeout(Duration::from_secs(2));
    assert_eq!(question.wait().unwrap().into_iter().filter(|reply| reply.result().is_ok()).count(), 0);
    session.close().wait().unwrap();
    // Until the group is at work, there is no status.
    let start = Instant::now();
    let told = loop {
        let told = ask(&plan.group, &hub.endpoints, Some(enrolled.of_hub().unwrap()), &Stop::default());
        if told.is_ok() || start.elapsed() > PATIENCE {
            break told.unwrap();
        }
    };
    assert_eq!(told.phones[0].phone, "SIM1");
    // The hub's certificate hears nothing else.
    let session = Stranger::with(enrolled.of_hub().unwrap()).connect(&hub.endpoints).unwrap();
    let heard = session.declare_subscriber("**").allowed_origin(Locality::Remote).wait().unwrap();
    let put = session.put(epoch_key(&plan.group, "SIM1").unwrap(), b"forged".to_vec());
    put.congestion_control(CongestionControl::Block).wait().unwrap();
    enrolled.run_agents(&plan, &hub.endpoints).unwrap();
    assert_eq!(heard.drain().count(), 0);
    session.close().wait().unwrap();
    let report = hub.end().unwrap();
    assert_eq!(report.phones["SIM1"].skips.count(Reason::MessageUnreadable), 0);
}
