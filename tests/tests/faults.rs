//! What others put on the wire, and agents and hubs that come late or vanish.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

use std::time::Duration;

use cofix_agent::publication::Publication;
use cofix_agent::{AgentConfig, AgentError, Source, Speed, Stop};
use cofix_common::simulation::PhoneOptions;
use cofix_common::skips::{Reason, Skips};
use cofix_common::time::GpsTime;
use cofix_common::wire::{
    EpochMessage, FusedMessage, PhoneStatus, all_epochs_key, all_fused_key, decode, encode, epoch_key,
    status_key,
};
use cofix_hub::group::Course;
use cofix_hub::replay::{Plan, ReplayOptions, replay};
use cofix_tests::slow_link::SlowLink;
use cofix_tests::{Hub, agent_config, by_hand, limits, plan_of, run_agents, small_plan, start_agent};
use zenoh::Wait;
use zenoh::qos::CongestionControl;
use zenoh::sample::Locality;

fn messages(plan: &Plan, phone: usize) -> Vec<EpochMessage> {
    by_hand::messages(plan, phone).unwrap()
}

fn publication(plan: &Plan, phone: usize, endpoints: &[String]) -> Publication {
    by_hand::publication(plan, phone, endpoints).unwrap()
}

#[test]
fn garbage_of_others_is_counted_and_changes_nothing() {
    let plan = small_plan(2, 30.0).unwrap();
    let clean = replay(&plan, &ReplayOptions::default(), &Stop::default()).unwrap().report;

    let hub = Hub::start(&plan, Course::Replay).unwrap();
    let session = hub.foreign_session().unwrap();
    let mut absurd = messages(&plan, 0).swap_remove(0);
    absurd.time_gps = absurd.time_gps + 1e9;
    let mut nameless = absurd.clone();
    nameless.phone = "SIM2".to_owned();
    let mut future = absurd.clone();
    future.time_gps = GpsTime::from_nanos(i64::MAX);
    let good = encode(&absurd).unwrap();
    let epochs = epoch_key(&plan.group, "SIM1").unwrap();
    // What is put may be dropped by default.
    let put = |key: &str, bytes: Vec<u8>| {
        session.put(key, bytes).congestion_control(CongestionControl::Block).wait().unwrap();
    };
    for bytes in [b"hello".to_vec(), vec![], good[..40].to_vec(), vec![0xff; 300_000], good.clone()] {
        put(&epochs, bytes);
    }
    put(&epochs, encode(&nameless).unwrap());
    put(&epochs, encode(&future).unwrap());
    put(&status_key(&plan.group, "SIM1").unwrap(), b"hello".to_vec());
    put(&epoch_key(&plan.group, "SIM9").unwrap(), good);
    run_agents(&plan, &hub.endpoints).unwrap();
    let report = hub.join().unwrap();

    assert_eq!(report.methods, clean.methods);
    assert_eq!(report.epochs, clean.epochs);
    let skips = &report.phones["SIM1"].skips;
    assert_eq!(skips.count(Reason::MessageUnreadable), 4, "{skips}");
    assert_eq!(skips.count(Reason::StatusUnreadable), 1, "{skips}");
    assert_eq!(skips.count(Reason::EpochFarFromNeighbours), 1, "{skips}");
    assert_eq!(report.skips.count(Reason::PhoneUnknown), 1);
    assert!(report.phones["SIM2"].skips == clean.phones["SIM2"].skips);
}

#[test]
fn absurd_values_cost_their_satellite_and_nothing_else() {
    let plan = small_plan(1, 30.0).unwrap();
    let hub = Hub::start(&plan, Course::Replay).unwrap();
    let mut publication = publication(&plan, 0, &hub.endpoints);
    let mut sent = messages(&plan, 0);
    for message in &mut sent {
        message.observations[0].pseudorange_m = f64::NAN;
        message.observations[1].satellite_position.0.x = 1e300;
        if let Some(state) = &mut message.local {
            state.mean[0] = f64::INFINITY;
        }
    }
    for message in &sent {
        publication.epoch(message).unwrap();
    }
    let status =
        PhoneStatus::Finished { epochs_published: sent.len() as u64, skips: Skips::default(), error: None };
    publication.status(status).unwrap();
    let report = hub.join().unwrap();
    publication.close().unwrap();
    let phone = &report.phones["SIM1"];
    assert_eq!(phone.epochs, sent.len() as u64);
    assert_eq!(phone.skips.count(Reason::ObservationInMessage), 2 * sent.len() as u64);
    assert!(phone.skips.count(Reason::PartOfMessage) > 0);
    assert!(report.methods.joint["SIM1"].unwrap().availability > 0.95);
    assert_eq!(report.methods.local["SIM1"], None, "every local state was absurd");
}

#[test]
fn echoed_messages_are_dropped_and_counted() {
    let plan = small_plan(2, 30.0).unwrap();
    let clean = replay(&plan, &ReplayOptions::default(), &Stop::default()).unwrap().report;
    let hub = Hub::start(&plan, Course::Replay).unwrap();
    let session = hub.foreign_session().unwrap();
    let echo = session.clone();
    let _subscriber = session
        .declare_subscriber(all_epochs_key(&plan.group).unwrap())
        .callback(move |sample| {
            let put = echo.put(sample.key_expr().clone(), sample.payload().clone());
            put.allowed_destination(Locality::Remote).wait().unwrap();
        })
        .wait()
        .unwrap();
    run_agents(&plan, &hub.endpoints).unwrap();
    let report = hub.join().unwrap();
    assert_eq!(report.methods, clean.methods);
    assert_eq!(report.epochs, clean.epochs);
}

#[test]
fn a_late_hub_gets_everything_from_the_start() {
    let plan = small_plan(2, 30.0).unwrap();
    let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let endpoint = format!("tcp/127.0.0.1:{port}");
    let agents: Vec<_> = (0..2)
        .map(|phone| start_agent(agent_config(&plan, phone, std::slice::from_ref(&endpoint)).unwrap()))
        .collect();
    std::thread::sleep(Duration::from_millis(500));
    let hub = Hub::start_at(&plan, Course::Replay, &endpoint).unwrap();
    for agent in agents {
        assert!(agent.join().unwrap().is_ok());
    }
    let report = hub.join().unwrap();
    assert_eq!(report.phones["SIM1"].epochs, messages(&plan, 0).len() as u64);
    assert_eq!(report.phones["SIM2"].epochs, messages(&plan, 1).len() as u64);
}

#[test]
fn a_subscriber_that_comes_after_the_epochs_gets_them_from_the_agent() {
    let plan = small_plan(1, 30.0).unwrap();
    let first = Hub::start(&plan, Course::Live { until_finished: false }).unwrap();
    let endpoints = first.endpoints.clone();
    let mut publication = publication(&plan, 0, &endpoints);
    let sent = messages(&plan, 0);
    let (early, late) = sent.split_at(10);
    for message in early {
        publication.epoch(message).unwrap();
    }
    assert_eq!(publication.wait_for_receipt(Duration::from_secs(10), &Stop::default()), Some(10));
    first.end().unwrap();
    // The agent reconnects on its own; what it publishes meanwhile is kept.
    for message in late {
        publication.epoch(message).unwrap();
    }
    let second = Hub::start_at(&plan, Course::Live { until_finished: true }, &endpoints[0]).unwrap();
    assert!(publication.wait_for_listener(Duration::from_secs(20), &Stop::default()).unwrap());
    let published = sent.len() as u64;
    let received = publication.wait_for_receipt(Duration::from_secs(20), &Stop::default());
    assert_eq!(received, Some(published));
    let skips = Skips::default();
    publication.status(PhoneStatus::Finished { epochs_published: published, skips, error: None }).unwrap();
    let report = second.join().unwrap();
    assert_eq!(report.phones["SIM1"].epochs, published);
}

#[test]
fn an_agent_that_vanishes_does_not_stop_the_others_and_may_come_back() {
    let plan = small_plan(2, 30.0).unwrap();
    let hub = Hub::start(&plan, Course::Live { until_finished: true }).unwrap();
    let sent = messages(&plan, 0);
    let mut first = publication(&plan, 0, &hub.endpoints);
    for message in &sent[..10] {
        first.epoch(message).unwrap();
    }
    assert_eq!(first.wait_for_receipt(Duration::from_secs(10), &Stop::default()), Some(10));
    drop(first); // without a word

    let other = start_agent(agent_config(&plan, 1, &hub.endpoints).unwrap());
    assert!(other.join().unwrap().is_ok());

    // A new run counts from 0; what it repeats is dropped, what is new is fused.
    let mut again = publication(&plan, 0, &hub.endpoints);
    let mut rest = sent[5..].to_vec();
    for (sequence, message) in rest.iter_mut().enumerate() {
        message.sequence = sequence as u64;
        message.time_gps = message.time_gps + 60.0;
        again.epoch(message).unwrap();
    }
    let skips = Skips::default();
    again.status(PhoneStatus::Finished { epochs_published: rest.len() as u64, skips, error: None }).unwrap();
    let report = hub.join().unwrap();
    again.close().unwrap();
    assert_eq!(report.phones["SIM1"].epochs, 10 + rest.len() as u64);
    // Its first epochs are of a time that was fused already when it came.
    let other = &report.phones["SIM2"];
    assert_eq!(other.epochs + other.skips.count(Reason::EpochTooLate), messages(&plan, 1).len() as u64);
    assert!(other.epochs >= 20, "{}", other.epochs);
}

#[test]
fn a_lost_message_fails_a_replay() {
    let plan = small_plan(1, 10.0).unwrap();
    let hub = Hub::start(&plan, Course::Replay).unwrap();
    let mut publication = publication(&plan, 0, &hub.endpoints);
    let sent = messages(&plan, 0);
    for message in sent.iter().filter(|message| message.sequence != 3) {
        publication.epoch(message).unwrap();
    }
    let skips = Skips::default();
    let epochs_published = sent.len() as u64;
    publication.status(PhoneStatus::Finished { epochs_published, skips, error: None }).unwrap();
    let error = hub.join().unwrap_err().to_string();
    assert_eq!(error, "SIM1: 1 published epochs did not arrive");
}

#[test]
fn fused_states_reach_listeners() {
    let plan = small_plan(2, 20.0).unwrap();
    let hub = Hub::start(&plan, Course::Replay).unwrap();
    let session = hub.foreign_session().unwrap();
    let fused = session.declare_subscriber(all_fused_key(&plan.group).unwrap()).wait().unwrap();
    run_agents(&plan, &hub.endpoints).unwrap();
    let report = hub.join().unwrap();
    let mut count = 0;
    while let Ok(Some(sample)) = fused.recv_timeout(Duration::from_secs(1)) {
        let message: FusedMessage = decode(&sample.payload().to_bytes()).unwrap();
        assert!(sample.key_expr().as_str().ends_with(&message.phone));
        count += 1;
        if count == 2 * report.common_epochs {
            break;
        }
    }
    assert!(count >= 2 * report.common_epochs - 2, "{count} of {}", 2 * report.common_epochs);
}

/// Four phones whose recordings start one and two seconds apart.
fn staggered(duration_s: f64) -> Plan {
    let phones = [0.0, 1.0, 1.0, 2.0].into_iter().enumerate().map(|(rank, starts_after_s)| PhoneOptions {
        starts_after_s,
        stops_before_s: 0.0,
        ..PhoneOptions::of_vehicle(rank)
    });
    plan_of(phones.collect(), duration_s).unwrap()
}

/// A live group of agents started together: every epoch is fused.
fn nothing_is_lost_live(plan: &Plan, speed: Speed) {
    let hub = Hub::start(plan, Course::Live { until_finished: true }).unwrap();
    let agents: Vec<_> = (0..plan.phones.len())
        .map(|phone| start_agent(AgentConfig { speed, ..agent_config(plan, phone, &hub.endpoints).unwrap() }))
        .collect();
    for agent in agents {
        assert!(agent.join().unwrap().is_ok());
    }
    let report = hub.join().unwrap();
    for (index, phone) in plan.phones.iter().enumerate() {
        let found = &report.phones[&phone.name];
        assert_eq!(found.skips.count(Reason::EpochTooLate), 0, "{}: {}", phone.name, found.skips);
        assert_eq!(found.epochs, messages(plan, index).len() as u64, "{}", phone.name);
    }
}

#[test]
fn recordings_that_start_at_different_seconds_lose_nothing_live_at_full_speed() {
    nothing_is_lost_live(&staggered(200.0), Speed::Maximum);
}

#[test]
fn recordings_that_start_at_different_seconds_lose_nothing_live_in_real_time() {
    nothing_is_lost_live(&staggered(8.0), Speed::Times(1.0));
    nothing_is_lost_live(&staggered(60.0), Speed::Times(20.0));
}

#[test]
fn a_late_live_hub_loses_nothing_of_two_phones() {
    let plan = small_plan(2, 60.0).unwrap();
    let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let endpoint = format!("tcp/127.0.0.1:{port}");
    let first = Hub::start_at(&plan, Course::Live { until_finished: false }, &endpoint).unwrap();
    let mut publications = [0, 1].map(|phone| publication(&plan, phone, std::slice::from_ref(&endpoint)));
    let sent = [0, 1].map(|phone| messages(&plan, phone));
    for (publication, sent) in publications.iter_mut().zip(&sent) {
        for message in &sent[..40] {
            publication.epoch(message).unwrap();
        }
    }
    first.end().unwrap();
    let second = Hub::start_at(&plan, Course::Live { until_finished: true }, &endpoint).unwrap();
    for (publication, sent) in publications.iter_mut().zip(&sent) {
        assert!(publication.wait_for_listener(Duration::from_secs(20), &Stop::default()).unwrap());
        for message in &sent[40..] {
            publication.epoch(message).unwrap();
        }
        let epochs_published = sent.len() as u64;
        let skips = Skips::default();
        publication.status(PhoneStatus::Finished { epochs_published, skips, error: None }).unwrap();
    }
    for (publication, sent) in publications.iter().zip(&sent) {
        let received = publication.wait_for_receipt(Duration::from_secs(20), &Stop::default());
        assert_eq!(received, Some(sent.len() as u64));
    }
    for publication in publications {
        publication.close().unwrap();
    }
    let report = second.join().unwrap();
    for (phone, sent) in ["SIM1", "SIM2"].iter().zip(&sent) {
        let found = &report.phones[*phone];
        assert_eq!(
            (found.epochs, found.skips.count(Reason::EpochTooLate)),
            (sent.len() as u64, 0),
            "{phone}"
        );
    }
}

#[test]
fn a_lost_message_is_counted_live_and_the_session_ends() {
    let plan = small_plan(1, 20.0).unwrap();
    let hub = Hub::start(&plan, Course::Live { until_finished: true }).unwrap();
    let mut publication = publication(&plan, 0, &hub.endpoints);
    let sent = messages(&plan, 0);
    for message in &sent {
        publication.epoch(message).unwrap();
    }
    let epochs_published = sent.len() as u64 + 2;
    let skips = Skips::default();
    publication.status(PhoneStatus::Finished { epochs_published, skips, error: None }).unwrap();
    let report = hub.join().unwrap();
    assert_eq!(report.phones["SIM1"].epochs, sent.len() as u64);
    assert_eq!(report.phones["SIM1"].skips.count(Reason::EpochsNotArrived), 2);
    publication.close().unwrap();
}

#[test]
fn a_phone_that_the_session_does_not_name_is_told_so_at_once() {
    let plan = small_plan(2, 20.0).unwrap();
    let hub = Hub::start(&plan, Course::Live { until_finished: false }).unwrap();
    let mut config = agent_config(&plan, 0, &hub.endpoints).unwrap();
    config.phone = "SIM9".to_owned();
    let error = start_agent(config).join().unwrap().unwrap_err().to_string();
    assert_eq!(error, "the hub refuses the phone: the session has no phone 'SIM9'; it has SIM1, SIM2");
    let report = hub.end().unwrap();
    assert!(report.skips.is_empty(), "{}", report.skips);
}

#[test]
fn names_are_checked_before_files_are_read() {
    let plan = small_plan(1, 10.0).unwrap();
    let mut config = agent_config(&plan, 0, &["tcp/127.0.0.1:9".to_owned()]).unwrap();
    config.phone = "a/b".to_owned();
    config.source = Source::File { path: "no/such/file.rnx".into(), near: None };
    let error = start_agent(config).join().unwrap().unwrap_err().to_string();
    assert!(error.contains("'a/b'"), "{error}");
}

#[test]
fn a_second_agent_of_one_name_is_refused_while_the_first_is_there() {
    let plan = small_plan(1, 20.0).unwrap();
    let hub = Hub::start(&plan, Course::Live { until_finished: true }).unwrap();
    let mut both = [0, 0].map(|phone| publication(&plan, phone, &hub.endpoints));
    let sent = messages(&plan, 0);
    for (publication, part) in both.iter_mut().zip([&sent[..10], &sent[10..]]) {
        let epochs_expected = None;
        publication.status(PhoneStatus::Started { summary: String::new(), epochs_expected }).unwrap();
        for (sequence, message) in part.iter().enumerate() {
            publication.epoch(&EpochMessage { sequence: sequence as u64, ..message.clone() }).unwrap();
        }
    }
    let patience = Duration::from_secs(10);
    let [first, second] = &both;
    assert_eq!(first.wait_for_receipt(patience, &Stop::default()), Some(10));
    assert_eq!(second.wait_for_receipt(Duration::from_secs(1), &Stop::default()), Some(0));
    for publication in &both {
        assert!(!hub.is_over(), "one of them still runs");
        let epochs_published = publication.published();
        let skips = Skips::default();
        publication.status(PhoneStatus::Finished { epochs_published, skips, error: None }).unwrap();
        // What was refused of the second is asked for once the first has ended.
        assert_eq!(publication.wait_for_receipt(patience, &Stop::default()), Some(epochs_published));
    }
    let report = hub.join().unwrap();
    let skips = &report.phones["SIM1"].skips;
    assert_eq!(skips.count(Reason::TwoAgentsOfOneName), 1);
    assert_eq!(skips.count(Reason::MessageOfSecondAgent), sent.len() as u64 - 10, "{skips}");
    assert_eq!(report.phones["SIM1"].epochs, sent.len() as u64);
    for publication in both {
        publication.close().unwrap();
    }
}

#[test]
fn an_agent_that_is_stopped_without_a_receipt_fails() {
    let plan = small_plan(1, 60.0).unwrap();
    let hub = Hub::start(&plan, Course::Live { until_finished: false }).unwrap();
    let stop = Stop::default();
    let config = AgentConfig { speed: Speed::Times(10.0), ..agent_config(&plan, 0, &hub.endpoints).unwrap() };
    let asked = stop.clone();
    let agent = limits::spawn(move || cofix_agent::run(&config, &asked));
    std::thread::sleep(Duration::from_secs(1));
    hub.end().unwrap();
    std::thread::sleep(Duration::from_millis(500));
    stop.request();
    let error = agent.join().unwrap().unwrap_err().to_string();
    assert!(error.contains("confirmed"), "{error}");
}

#[test]
fn an_agent_gives_up_on_a_hub_of_another_group() {
    let plan = small_plan(1, 10.0).unwrap();
    let hub = Hub::start(&plan, Course::Live { until_finished: false }).unwrap();
    let mut config = agent_config(&plan, 0, &hub.endpoints).unwrap();
    config.group = "another".to_owned();
    config.patience = Duration::from_millis(300);
    let error = start_agent(config).join().unwrap().unwrap_err().to_string();
    assert!(error.contains("no hub listens for group 'another'"), "{error}");
    hub.end().unwrap();
}

#[test]
fn an_agent_without_a_hub_says_so() {
    let plan = small_plan(1, 10.0).unwrap();
    let mut config = agent_config(&plan, 0, &["tcp/127.0.0.1:9".to_owned()]).unwrap();
    config.patience = Duration::from_millis(300);
    let error = start_agent(config.clone()).join().unwrap().unwrap_err().to_string();
    assert!(error.contains("no hub answers at tcp/127.0.0.1:9"), "{error}");
    config.connect = vec!["nonsense".to_owned()];
    let error = start_agent(config).join().unwrap().unwrap_err().to_string();
    assert!(error.contains("nonsense"), "{error}");
}

#[test]
fn an_agent_on_a_delayed_link_knows_that_its_epochs_are_fused() {
    let plan = small_plan(1, 30.0).unwrap();
    let hub = Hub::start(&plan, Course::Live { until_finished: true }).unwrap();
    let link = SlowLink::to(&hub.endpoints[0]).unwrap();
    let mut publication = publication(&plan, 0, std::slice::from_ref(&link.endpoint));
    // An answer takes three seconds, much longer than the agent's patience without a connection.
    link.set_delay(Duration::from_millis(1_500));
    let sent = messages(&plan, 0);
    for message in &sent {
        publication.epoch(message).unwrap();
    }
    let epochs_published = sent.len() as u64;
    let skips = Skips::default();
    publication.status(PhoneStatus::Finished { epochs_published, skips, error: None }).unwrap();
    let confirmed = publication.wait_for_receipt(Duration::from_millis(500), &Stop::default());
    assert_eq!(confirmed, Some(epochs_published));
    publication.close().unwrap();
    assert_eq!(hub.join().unwrap().phones["SIM1"].epochs, epochs_published);
}

/// Waits until a hub has published this number of fused states.
fn wait_for_fused(hub: &Hub, plan: &Plan, count: usize) {
    let session = hub.foreign_session().unwrap();
    let fused = session.declare_subscriber(all_fused_key(&plan.group).unwrap()).wait().unwrap();
    for _ in 0..count {
        fused.recv_timeout(Duration::from_mins(1)).unwrap().expect("the hub fuses");
    }
}

#[test]
fn hubs_that_end_abruptly_are_replaced_without_a_loss() {
    let plan = staggered(240.0);
    let clean = replay(&plan, &ReplayOptions::default(), &Stop::default()).unwrap().report;
    let mut hub = Hub::start(&plan, Course::Live { until_finished: true }).unwrap();
    let endpoints = hub.endpoints.clone();
    let agents: Vec<_> = (0..plan.phones.len())
        .map(|phone| {
            let config = agent_config(&plan, phone, &endpoints).unwrap();
            start_agent(AgentConfig { speed: Speed::Times(50.0), ..config })
        })
        .collect();
    for _ in 0..2 {
        wait_for_fused(&hub, &plan, 100);
        hub.end().unwrap();
        hub = Hub::start_at(&plan, Course::Live { until_finished: true }, &endpoints[0]).unwrap();
    }
    for agent in agents {
        agent.join().unwrap().unwrap();
    }
    let report = hub.join().unwrap();
    for (index, phone) in plan.phones.iter().enumerate() {
        let found = &report.phones[&phone.name];
        assert_eq!(found.epochs, messages(&plan, index).len() as u64, "{}: {}", phone.name, found.skips);
        assert!(found.skips == clean.phones[&phone.name].skips, "{}: {}", phone.name, found.skips);
    }
    assert_eq!((report.epochs, report.common_epochs), (clean.epochs, clean.common_epochs));
    assert_eq!(report.methods, clean.methods, "fused in order, as if nothing had been");
}

#[test]
fn a_hub_that_comes_after_the_last_word_hears_everything() {
    let plan = small_plan(1, 30.0).unwrap();
    let first = Hub::start(&plan, Course::Live { until_finished: false }).unwrap();
    let endpoints = first.endpoints.clone();
    let mut publication = publication(&plan, 0, &endpoints);
    let sent = messages(&plan, 0);
    let published = sent.len() as u64;
    let summary = "simulated".to_owned();
    publication.status(PhoneStatus::Started { summary, epochs_expected: Some(published) }).unwrap();
    for message in &sent {
        publication.epoch(message).unwrap();
    }
    first.end().unwrap();
    let skips = Skips::default();
    publication.status(PhoneStatus::Finished { epochs_published: published, skips, error: None }).unwrap();
    let second = Hub::start_at(&plan, Course::Live { until_finished: true }, &endpoints[0]).unwrap();
    let received = publication.wait_for_receipt(Duration::from_secs(30), &Stop::default());
    assert_eq!(received, Some(published));
    publication.close().unwrap();
    let report = second.join().unwrap();
    assert_eq!(report.phones["SIM1"].epochs, published);
}

#[test]
fn what_an_agent_does_not_keep_is_counted_and_the_agent_knows() {
    let plan = small_plan(2, 120.0).unwrap();
    let first = Hub::start(&plan, Course::Live { until_finished: false }).unwrap();
    let endpoints = first.endpoints.clone();
    let agents = [20, AgentConfig::KEPT_MESSAGES].into_iter().enumerate().map(|(phone, kept_messages)| {
        let config = agent_config(&plan, phone, &endpoints).unwrap();
        start_agent(AgentConfig { kept_messages, speed: Speed::Times(50.0), ..config })
    });
    let agents: Vec<_> = agents.collect();
    wait_for_fused(&first, &plan, 100);
    first.end().unwrap();
    let second = Hub::start_at(&plan, Course::Live { until_finished: true }, &endpoints[0]).unwrap();
    let [forgetful, other] = <[_; 2]>::try_from(agents).unwrap().map(|agent| agent.join().unwrap());
    let report = second.join().unwrap();

    let total = messages(&plan, 0).len() as u64;
    let Err(AgentError::NotConfirmed { confirmed, published }) = forgetful else { panic!("{forgetful:?}") };
    assert_eq!(published, total);
    assert!((20..=total - 30).contains(&confirmed), "{confirmed}");
    let found = &report.phones["SIM1"];
    assert_eq!(found.epochs, confirmed);
    assert_eq!(found.skips.count(Reason::EpochsNotArrived), total - confirmed, "{}", found.skips);
    assert!(found.skips.to_string().contains("its agent does not keep them any more"), "{}", found.skips);
    assert!(other.is_ok(), "{other:?}");
    assert_eq!(report.phones["SIM2"].epochs, messages(&plan, 1).len() as u64);
}

/// A hub is down for longer than the agents' memory lasts; the next one, without a journal, gets everything from their spools.
#[test]
fn what_an_agent_keeps_on_disk_is_not_lost() {
    let plan = small_plan(2, 120.0).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let first = Hub::start(&plan, Course::Live { until_finished: false }).unwrap();
    let endpoints = first.endpoints.clone();
    let agents = [0, 1].map(|phone| {
        let config = agent_config(&plan, phone, &endpoints).unwrap();
        let spool = Some(folder.path().join("spool"));
        start_agent(AgentConfig { kept_messages: 20, spool, speed: Speed::Times(50.0), ..config })
    });
    wait_for_fused(&first, &plan, 100);
    first.end().unwrap();
    let second = Hub::start_at(&plan, Course::Live { until_finished: true }, &endpoints[0]).unwrap();
    for agent in agents {
        agent.join().unwrap().unwrap();
    }
    let report = second.join().unwrap();
    for (phone, name) in ["SIM1", "SIM2"].into_iter().enumerate() {
        assert_eq!(report.phones[name].epochs, messages(&plan, phone).len() as u64);
        assert_eq!(report.lost[name], 0);
    }
    let undisturbed = Hub::start(&plan, Course::Live { until_finished: true }).unwrap();
    let endpoints = undisturbed.endpoints.clone();
    let agents = [0, 1].map(|phone| start_agent(agent_config(&plan, phone, &endpoints).unwrap()));
    for agent in agents {
        agent.join().unwrap().unwrap();
    }
    let undisturbed = undisturbed.join().unwrap();
    assert_eq!(undisturbed.json().unwrap(), report.json().unwrap());
}
