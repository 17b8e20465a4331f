//! Groups whose phones have certificates: who is let in, and what those who are let in may do.

#![allow(clippy::unwrap_used, clippy::panic)] // helpers of tests

use std::time::Duration;

use cofix_agent::publication::link;
use cofix_agent::publication::secured::{Credentials, Guard};
use cofix_agent::{AgentConfig, AgentError, Stop};
use cofix_common::skips::{Reason, Skips};
use cofix_common::wire::{
    FusedMessage, PhoneStatus, Receipt, ReceiptMessage, StatusMessage, all_fused_key, decode, encode,
    epoch_key, fused_key, history_key, integrity_key, liveliness_key, receipt_key, status_key,
};
use cofix_hub::group::Course;
use cofix_hub::replay::{Plan, ReplayOptions, replay};
use cofix_hub::report::Report;
use cofix_tests::enrolled::{Enrolled, LIAR, Stranger, run_impatient};
use cofix_tests::{Hub, agent_config, by_hand, run_agents, small_plan, start_agent};
use zenoh::handlers::FifoChannelHandler;
use zenoh::pubsub::Subscriber;
use zenoh::qos::CongestionControl;
use zenoh::sample::{Locality, Sample};
use zenoh::{Session, Wait};

const LIVE: Course = Course::Live { until_finished: true };
/// Where reports are compared: live, the first epochs of an agent that starts late may be of a time that is fused already.
const WAITING: Course = Course::Replay;

fn undisturbed(plan: &Plan) -> Report {
    replay(plan, &ReplayOptions::default(), &Stop::default()).unwrap().report
}

fn assert_same(report: &Report, clean: &Report) {
    assert_eq!(report.methods, clean.methods);
    assert_eq!((report.epochs, &report.skips), (clean.epochs, &clean.skips));
    for (name, phone) in &report.phones {
        assert_eq!(phone.skips, clean.phones[name].skips, "{name}");
    }
}

#[test]
fn enrolled_phones_are_fused_as_over_plain_connections() {
    let plan = small_plan(2, 30.0).unwrap();
    let enrolled = Enrolled::new(&plan).unwrap();
    let hub = Hub::start_for(&plan, WAITING, &enrolled.listening(false).unwrap()).unwrap();
    assert!(hub.endpoints[0].starts_with("tls/"), "{:?}", hub.endpoints);
    enrolled.run_agents(&plan, &hub.endpoints).unwrap();
    assert_same(&hub.join().unwrap(), &undisturbed(&plan));
}

#[test]
fn an_enrolled_phone_is_asked_for_its_history() {
    let plan = small_plan(1, 30.0).unwrap();
    let enrolled = Enrolled::new(&plan).unwrap();
    let mut listening = enrolled.listening(false).unwrap();
    let first = Hub::start_for(&plan, Course::Live { until_finished: false }, &listening).unwrap();
    listening.endpoints.clone_from(&first.endpoints);
    let agent = enrolled.agent(&plan, 0, &first.endpoints).unwrap();
    let mut publication = by_hand::publication_of(&agent).unwrap();
    let sent = by_hand::messages(&plan, 0).unwrap();
    for message in &sent {
        publication.epoch(message).unwrap();
    }
    first.end().unwrap();
    // What the second hub knows of them is from the agent's history.
    let second = Hub::start_for(&plan, LIVE, &listening).unwrap();
    assert!(publication.wait_for_listener(Duration::from_secs(20), &Stop::default()).unwrap());
    let epochs_published = sent.len() as u64;
    let skips = Skips::default();
    publication.status(PhoneStatus::Finished { epochs_published, skips, error: None }).unwrap();
    let received = publication.wait_for_receipt(Duration::from_secs(20), &Stop::default());
    assert_eq!(received, Some(epochs_published));
    assert_eq!(second.join().unwrap().phones["SIM1"].epochs, epochs_published);
}

/// Why an agent with these credentials is not let in.
fn refusal(plan: &Plan, hub: &Hub, credentials: Option<Credentials>) -> AgentError {
    let mut connect = hub.endpoints.clone();
    if credentials.is_none() {
        connect = vec![connect[0].replace("tls/", "tcp/")];
    }
    let config = agent_config(plan, 0, &connect).unwrap();
    run_impatient(AgentConfig { credentials, ..config }).unwrap_err()
}

/// Time of a live run at full speed, with and without TLS. `cargo test --workspace --test who_may_speak -- --ignored --nocapture`
#[test]
#[ignore = "a measurement"]
fn time_with_and_without_tls() {
    let plan = small_plan(4, 900.0).unwrap();
    let enrolled = Enrolled::new(&plan).unwrap();
    for _ in 0..3 {
        let plainly = Hub::start(&plan, LIVE).unwrap();
        let begun = std::time::Instant::now();
        run_agents(&plan, &plainly.endpoints).unwrap();
        plainly.join().unwrap();
        let plain_s = begun.elapsed().as_secs_f64();
        let secured = Hub::start_for(&plan, LIVE, &enrolled.listening(false).unwrap()).unwrap();
        let begun = std::time::Instant::now();
        enrolled.run_agents(&plan, &secured.endpoints).unwrap();
        secured.join().unwrap();
        println!("{plain_s:.2} s in TCP, {:.2} s in TLS", begun.elapsed().as_secs_f64());
    }
}

#[test]
fn whoever_is_not_enrolled_is_not_let_in() {
    let plan = small_plan(1, 20.0).unwrap();
    let (enrolled, other) = (Enrolled::new(&plan).unwrap(), Enrolled::new(&plan).unwrap());
    let hub = Hub::start_for(&plan, WAITING, &enrolled.listening(false).unwrap()).unwrap();
    // Plain TCP; another authority; a certificate of another authority with belief in this one.
    let (own, foreign) = (enrolled.credentials("SIM1").unwrap(), other.credentials("SIM1").unwrap());
    let mixed = Credentials { authority: own.authority.clone(), ..foreign.clone() };
    for credentials in [None, Some(foreign), Some(mixed)] {
        let error = refusal(&plan, &hub, credentials);
        assert!(matches!(error, AgentError::Link(_)), "{error}");
    }
    for mode in ["client", "peer", "router"] {
        let stranger = Stranger { mode, credentials: Some(own.clone()), shows_certificate: false };
        assert!(stranger.connect(&hub.endpoints).is_err(), "{mode} without a certificate");
        stranger_with(&own, mode).connect(&hub.endpoints).unwrap().close().wait().unwrap();
    }
    enrolled.run_agents(&plan, &hub.endpoints).unwrap();
    assert_same(&hub.join().unwrap(), &undisturbed(&plan));
}

fn stranger_with(credentials: &Credentials, mode: &'static str) -> Stranger {
    Stranger { mode, ..Stranger::with(credentials.clone()) }
}

#[test]
fn a_revoked_phone_is_not_heard_and_its_old_certificate_stays_revoked() {
    let plan = small_plan(1, 20.0).unwrap();
    let enrolled = Enrolled::new(&plan).unwrap();
    let old = enrolled.credentials("SIM1").unwrap();
    enrolled.change(Vec::new(), vec!["SIM1".to_owned()]).unwrap();
    let hub = Hub::start_for(&plan, LIVE, &enrolled.listening(false).unwrap()).unwrap();
    let error = refusal(&plan, &hub, Some(old.clone()));
    assert!(error.to_string().contains("no hub listens"), "{error}");
    hub.end().unwrap();

    enrolled.change(vec!["SIM1".to_owned()], Vec::new()).unwrap();
    let hub = Hub::start_for(&plan, WAITING, &enrolled.listening(false).unwrap()).unwrap();
    let error = refusal(&plan, &hub, Some(old));
    assert!(error.to_string().contains("no hub listens"), "{error}");
    enrolled.run_agents(&plan, &hub.endpoints).unwrap();
    assert_same(&hub.join().unwrap(), &undisturbed(&plan));
}

#[test]
fn a_phones_certificate_makes_no_hub() {
    let plan = small_plan(1, 10.0).unwrap();
    let enrolled = Enrolled::new(&plan).unwrap();
    let guard = Guard {
        credentials: enrolled.credentials(LIAR).unwrap(),
        access_control: serde_json::json!({ "enabled": false }),
    };
    let false_hub = link::listen(&["tls/127.0.0.1:0".to_owned()], Some(&guard)).unwrap();
    let connect: Vec<String> = false_hub.info().locators().wait().iter().map(ToString::to_string).collect();
    let error = run_impatient(enrolled.agent(&plan, 0, &connect).unwrap()).unwrap_err();
    assert!(matches!(error, AgentError::Link(_)), "{error}");
    false_hub.close().wait().unwrap();
}

/// What somebody who speaks the wire tries under the name of another.
struct Attack {
    session: Session,
    heard: Vec<Subscriber<FifoChannelHandler<Sample>>>,
    /// Who is there.
    tokens: Subscriber<FifoChannelHandler<Sample>>,
}

impl Attack {
    /// Tries everything on phone SIM1, before its agent is there.
    fn begin(plan: &Plan, session: Session) -> Self {
        let group = &plan.group;
        let put = |key: String, bytes: Vec<u8>| {
            session.put(key, bytes).congestion_control(CongestionControl::Block).wait().unwrap();
        };
        let mut epochs = by_hand::messages(plan, 0).unwrap();
        for epoch in &mut epochs {
            epoch.time_gps = epoch.time_gps + 5_000.0;
        }
        for epoch in &epochs[..3] {
            put(epoch_key(group, "SIM1").unwrap(), encode(epoch).unwrap());
        }
        let finished = PhoneStatus::Finished { epochs_published: 3, skips: Skips::default(), error: None };
        for phone in ["SIM1", "SIM2"] {
            let status = StatusMessage { phone: phone.to_owned(), status: finished.clone() };
            put(status_key(group, phone).unwrap(), encode(&status).unwrap());
        }
        let token = session.liveliness().declare_token(liveliness_key(group, "SIM1").unwrap());
        std::mem::forget(token.wait().unwrap());
        let history = epochs.swap_remove(0);
        session
            .declare_queryable(history_key(group, "SIM1").unwrap())
            .complete(true)
            .callback(move |query| {
                let _ = query.reply(query.key_expr(), encode(&history).unwrap()).wait();
            })
            .background()
            .wait()
            .unwrap();
        session
            .declare_queryable(receipt_key(group, "SIM1").unwrap())
            .complete(true)
            .callback(|query| {
                let receipt = ReceiptMessage::Run(Receipt { received: 1_000_000, lost: 0 });
                let _ = query.reply(query.key_expr(), encode(&receipt).unwrap()).wait();
            })
            .background()
            .wait()
            .unwrap();
        let keys = ["**".to_owned(), epoch_key(group, "SIM1").unwrap(), all_fused_key(group).unwrap()];
        // What it says itself is no matter.
        let listen = |key| session.declare_subscriber(key).allowed_origin(Locality::Remote).wait().unwrap();
        let heard = keys.map(listen).into();
        let tokens = session.liveliness().declare_subscriber("cofix/**").history(true).wait().unwrap();
        Self { session, heard, tokens }
    }

    /// Puts a fused state of nobody under SIM1's name.
    fn forge_fused(&self, plan: &Plan) {
        let key = fused_key(&plan.group, "SIM1").unwrap();
        self.session
            .put(key, b"forged".to_vec())
            .congestion_control(CongestionControl::Block)
            .wait()
            .unwrap();
    }

    /// How many samples and replies it got of what is others'.
    fn overheard(&self, plan: &Plan) -> usize {
        let heard: usize = self.heard.iter().map(|subscriber| subscriber.drain().count()).sum();
        // Its own false token is told in its own session.
        let others = self.tokens.drain().filter(|token| !token.key_expr().as_str().contains("SIM1")).count();
        let history = format!("{}?from=0;to=1000", history_key(&plan.group, "SIM1").unwrap());
        let question = self.session.get(history).allowed_destination(Locality::Remote);
        let replies = question.timeout(Duration::from_secs(1)).wait().unwrap();
        heard + others + replies.into_iter().filter(|reply| reply.result().is_ok()).count()
    }
}

#[test]
fn without_certificates_the_attack_succeeds() {
    let plan = small_plan(2, 30.0).unwrap();
    let hub = Hub::start(&plan, LIVE).unwrap();
    let attack = Attack::begin(&plan, hub.foreign_session().unwrap());
    let _ = run_agents(&plan, &hub.endpoints);
    assert!(attack.overheard(&plan) > 0);
    let report = hub.end().unwrap();
    let clean = undisturbed(&plan);
    assert!(report.methods != clean.methods || report.phones["SIM1"].skips != clean.phones["SIM1"].skips);
    attack.session.close().wait().unwrap();
}

#[test]
fn an_enrolled_phone_speaks_for_no_other_and_hears_none() {
    let plan = small_plan(2, 30.0).unwrap();
    let clean = undisturbed(&plan);
    for mode in ["client", "peer", "router"] {
        let enrolled = Enrolled::new(&plan).unwrap();
        let hub = Hub::start_for(&plan, WAITING, &enrolled.listening(false).unwrap()).unwrap();
        let liar = stranger_with(&enrolled.credentials(LIAR).unwrap(), mode);
        let victim = Stranger::with(enrolled.credentials("SIM1").unwrap()).connect(&hub.endpoints).unwrap();
        let fused = victim.declare_subscriber(fused_key(&plan.group, "SIM1").unwrap()).wait().unwrap();
        let others = victim.declare_subscriber(fused_key(&plan.group, "SIM2").unwrap()).wait().unwrap();
        let attack = Attack::begin(&plan, liar.connect(&hub.endpoints).unwrap());
        attack.forge_fused(&plan);
        enrolled.run_agents(&plan, &hub.endpoints).unwrap();
        attack.forge_fused(&plan);
        assert_eq!(attack.overheard(&plan), 0, "{mode}");
        assert_same(&hub.join().unwrap(), &clean);
        let mut states = 0;
        while let Ok(Some(sample)) = fused.recv_timeout(Duration::from_millis(500)) {
            let message: FusedMessage = decode(&sample.payload().to_bytes()).unwrap();
            assert_eq!(message.phone, "SIM1");
            states += 1;
        }
        assert!(states >= clean.common_epochs - 2, "{states} of {}", clean.common_epochs);
        assert_eq!(others.drain().count(), 0, "{mode}");
        attack.session.close().wait().unwrap();
    }
}

#[test]
fn the_groups_fused_states_are_read_where_they_are_shared() {
    let plan = small_plan(2, 20.0).unwrap();
    let enrolled = Enrolled::new(&plan).unwrap();
    let hub = Hub::start_for(&plan, LIVE, &enrolled.listening(true).unwrap()).unwrap();
    let session = Stranger::with(enrolled.credentials("SIM1").unwrap()).connect(&hub.endpoints).unwrap();
    let fused = session.declare_subscriber(all_fused_key(&plan.group).unwrap()).wait().unwrap();
    session.declare_subscriber(integrity_key(&plan.group).unwrap()).wait().unwrap();
    enrolled.run_agents(&plan, &hub.endpoints).unwrap();
    hub.join().unwrap();
    let mut phones: Vec<String> = Vec::new();
    while let Ok(Some(sample)) = fused.recv_timeout(Duration::from_millis(500)) {
        phones.push(decode::<FusedMessage>(&sample.payload().to_bytes()).unwrap().phone);
    }
    assert!(phones.iter().any(|phone| phone == "SIM1") && phones.iter().any(|phone| phone == "SIM2"));
}

#[test]
fn a_message_that_is_too_large_for_the_wire_costs_its_sender_alone() {
    let plan = small_plan(2, 30.0).unwrap();
    let enrolled = Enrolled::new(&plan).unwrap();
    let hub = Hub::start_for(&plan, WAITING, &enrolled.listening(false).unwrap()).unwrap();
    let session = Stranger::with(enrolled.credentials("SIM1").unwrap()).connect(&hub.endpoints).unwrap();
    let put = |bytes: usize| {
        let key = epoch_key(&plan.group, "SIM1").unwrap();
        session.put(key, vec![0; bytes]).congestion_control(CongestionControl::Block).wait().unwrap();
    };
    for bytes in [300_000, 100_000_000, 300_000] {
        put(bytes);
    }
    enrolled.run_agents(&plan, &hub.endpoints).unwrap();
    let report = hub.join().unwrap();
    let clean = undisturbed(&plan);
    assert_eq!(report.methods, clean.methods);
    let unreadable = report.phones["SIM1"].skips.count(Reason::MessageUnreadable);
    assert!((1..=2).contains(&unreadable), "{unreadable}: those that Zenoh puts together");
    assert_eq!(report.phones["SIM2"].skips, clean.phones["SIM2"].skips);
    let _ = session.close().wait();
}

/// The report on SIM2, beside whom SIM1 sends nothing, or as many messages as it can.
fn beside(plan: &Plan, is_flooded: bool) -> Report {
    let enrolled = Enrolled::new(plan).unwrap();
    let course = Course::Live { until_finished: false };
    let hub = Hub::start_for(plan, course, &enrolled.listening(false).unwrap()).unwrap();
    let session = Stranger::with(enrolled.credentials("SIM1").unwrap()).connect(&hub.endpoints).unwrap();
    let key = epoch_key(&plan.group, "SIM1").unwrap();
    let stop = Stop::default();
    std::thread::scope(|scope| {
        scope.spawn(|| {
            while is_flooded && !stop.is_requested() {
                let put = session.put(&key, b"CXnothing".to_vec());
                put.congestion_control(CongestionControl::Block).wait().unwrap();
            }
        });
        if is_flooded {
            std::thread::sleep(Duration::from_secs(2));
        }
        let agent = start_agent(enrolled.agent(plan, 1, &hub.endpoints).unwrap());
        let outcome = agent.join().unwrap();
        stop.request();
        outcome.unwrap();
    });
    session.close().wait().unwrap();
    hub.end().unwrap()
}

#[test]
fn a_flood_costs_the_phone_that_sends_it() {
    let plan = small_plan(2, 30.0).unwrap();
    let (clean, flooded) = (beside(&plan, false), beside(&plan, true));
    assert_eq!(flooded.methods, clean.methods);
    let [found, expected] = [&flooded, &clean].map(|report| &report.phones["SIM2"]);
    assert_eq!((found.epochs, &found.skips), (expected.epochs, &expected.skips));
    assert!(found.epochs > 20, "{}", found.epochs);
    let skips = &flooded.phones["SIM1"].skips;
    assert!(skips.count(Reason::MessageBeyondRate) > 0, "{skips}");
}

#[test]
fn strangers_that_connect_and_say_nothing_keep_nobody_out() {
    let plan = small_plan(1, 20.0).unwrap();
    let enrolled = Enrolled::new(&plan).unwrap();
    let hub = Hub::start_for(&plan, WAITING, &enrolled.listening(false).unwrap()).unwrap();
    let address = hub.endpoints[0].trim_start_matches("tls/").to_owned();
    let idle: Vec<_> = (0..300).map(|_| std::net::TcpStream::connect(&address).unwrap()).collect();
    enrolled.run_agents(&plan, &hub.endpoints).unwrap();
    assert_same(&hub.join().unwrap(), &undisturbed(&plan));
    drop(idle);
}
