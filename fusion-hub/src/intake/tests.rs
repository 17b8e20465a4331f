use cofix_common::integrity::{RaimReport, Verdict};
use cofix_common::time::GpsTime;
use cofix_common::wire::encode;

use super::*;

fn intake() -> Intake {
    Intake::new(&["a".to_owned(), "b".to_owned()])
}

fn epoch(phone: &str, sequence: u64) -> EpochMessage {
    EpochMessage {
        phone: phone.to_owned(),
        sequence,
        time_gps: GpsTime::from_week_tow(2118, sequence as f64),
        observations: Vec::new(),
        wls: None,
        local: None,
        raim: RaimReport { verdict: Verdict::CannotBeChecked, global_test: None, excluded: 0 },
    }
}

fn from(sender: &str, key_phone: &str, bytes: Vec<u8>) -> Arrival {
    Arrival { phone: key_phone.to_owned(), sender: Some(sender.to_owned()), bytes }
}

fn status(phone: &str, status: PhoneStatus) -> Vec<u8> {
    encode(&StatusMessage { phone: phone.to_owned(), status }).unwrap()
}

fn finished(phone: &str, epochs_published: u64) -> Vec<u8> {
    status(phone, PhoneStatus::Finished { epochs_published, skips: Skips::default(), error: None })
}

#[test]
fn a_run_is_complete_when_all_its_epochs_are_here() {
    let mut intake = intake();
    let started = PhoneStatus::Started { summary: "file".to_owned(), epochs_expected: Some(3) };
    assert!(matches!(
        intake.status(&from("x", "a", status("a", started))),
        Some(Notice::Started { phone: 0, .. })
    ));
    assert_eq!(intake.expected(), 3);
    for sequence in 0..2 {
        assert!(intake.epoch(&from("x", "a", encode(&epoch("a", sequence)).unwrap())).is_some());
    }
    assert_eq!(intake.shortfall(0), None, "it still runs");
    intake.status(&from("x", "a", finished("a", 3)));
    assert_eq!((intake.shortfall(0), intake.is_complete(0)), (Some(1), false));
    intake.epoch(&from("x", "a", encode(&epoch("a", 2)).unwrap()));
    assert!(intake.is_complete(0) && !intake.is_complete(1));
    assert_eq!((intake.received(0, "x"), intake.received(0, "y"), intake.received(1, "x")), (3, 0, 0));
}

#[test]
fn a_lost_message_leaves_a_shortfall() {
    let mut intake = intake();
    for sequence in [0, 2] {
        intake.epoch(&from("x", "a", encode(&epoch("a", sequence)).unwrap()));
    }
    intake.status(&from("x", "a", finished("a", 3)));
    assert_eq!(intake.shortfall(0), Some(1));
}

#[test]
fn a_restarted_agent_is_a_new_run() {
    let mut intake = intake();
    intake.epoch(&from("x", "a", encode(&epoch("a", 0)).unwrap()));
    intake.status(&from("x", "a", finished("a", 1)));
    assert!(intake.is_complete(0));
    intake.status(&from(
        "y",
        "a",
        status("a", PhoneStatus::Started { summary: String::new(), epochs_expected: None }),
    ));
    assert!(!intake.is_complete(0));
    assert!(
        intake.epoch(&from("y", "a", encode(&epoch("a", 0)).unwrap())).is_some(),
        "sequence starts again"
    );
    intake.status(&from("y", "a", finished("a", 1)));
    assert!(intake.is_complete(0));
}

#[test]
fn what_cannot_be_used_is_counted_and_named() {
    let mut intake = intake();
    assert!(intake.epoch(&from("x", "c", encode(&epoch("c", 0)).unwrap())).is_none());
    assert_eq!(intake.skips().count("phone unknown to the session"), 1);
    assert!(intake.epoch(&from("x", "a", b"hello".to_vec())).is_none());
    assert!(intake.epoch(&from("x", "a", encode(&epoch("b", 0)).unwrap())).is_none());
    intake.epoch(&from("x", "a", encode(&epoch("a", 1)).unwrap()));
    assert!(intake.epoch(&from("x", "a", encode(&epoch("a", 1)).unwrap())).is_none());
    assert!(intake.status(&from("x", "a", finished("b", 1))).is_none());
    assert!(intake.status(&from("x", "a", vec![])).is_none());
    let skips = intake.phone_skips(0).unwrap();
    for reason in [
        "message unreadable",
        "message refused",
        "message received twice",
        "status of another phone",
        "status unreadable",
    ] {
        assert_eq!(skips.count(reason), 1, "{reason}");
    }
    assert!(intake.phone_skips(1).unwrap().is_empty());
}

fn started(phone: &str) -> Vec<u8> {
    status(phone, PhoneStatus::Started { summary: String::new(), epochs_expected: None })
}

#[test]
fn restarts_without_end_neither_fill_the_memory_nor_lock_the_phone_out() {
    let mut intake = intake();
    for run in 0..1_000 {
        let sender = run.to_string();
        intake.status(&from(&sender, "a", started("a")));
        assert!(intake.epoch(&from(&sender, "a", encode(&epoch("a", 0)).unwrap())).is_some(), "{run}");
        intake.status(&from(&sender, "a", finished("a", 1)));
        assert!(intake.is_complete(0));
    }
    assert_eq!(intake.desks[0].runs.len(), MAXIMUM_RUNS);
    let skips = intake.phone_skips(0).unwrap();
    assert_eq!(skips.count("run of an agent forgotten: too many"), 1_000 - MAXIMUM_RUNS as u64);
    assert_eq!(skips.total(), 1_000 - MAXIMUM_RUNS as u64, "{skips}");
}

#[test]
fn anonymous_senders_do_not_push_out_the_current_run() {
    let mut intake = intake();
    intake.status(&from("x", "a", started("a")));
    intake.epoch(&from("x", "a", encode(&epoch("a", 0)).unwrap()));
    for sender in 0..1_000 {
        intake.epoch(&from(&format!("s{sender}"), "a", encode(&epoch("a", 0)).unwrap()));
    }
    assert_eq!(intake.received(0, "x"), 1);
}

#[test]
fn lost_epochs_are_given_up_and_counted() {
    let mut intake = intake();
    intake.epoch(&from("x", "a", encode(&epoch("a", 0)).unwrap()));
    intake.status(&from("x", "a", finished("a", 4)));
    assert!(!intake.is_complete(0));
    assert_eq!(intake.give_up(0), 3);
    assert!(intake.is_complete(0));
    assert_eq!(intake.phone_skips(0).unwrap().count("published epochs did not arrive"), 3);
    intake.status(&from("y", "a", finished("a", u64::MAX)));
    assert_eq!(intake.give_up(0), u64::MAX, "any number may be claimed");
}

#[test]
fn two_agents_of_one_name_are_noticed_and_both_waited_for() {
    let mut intake = intake();
    intake.status(&from("x", "a", started("a")));
    let notice = intake.status(&from("y", "a", started("a")));
    assert!(matches!(notice, Some(Notice::Started { twice: true, .. })));
    assert_eq!(intake.phone_skips(0).unwrap().count("two agents of one name at a time"), 1);
    intake.status(&from("y", "a", finished("a", 0)));
    assert!(!intake.is_complete(0), "the other still runs");
    intake.gone(0);
    assert!(intake.is_complete(0));
    let notice = intake.status(&from("z", "a", started("a")));
    assert!(matches!(notice, Some(Notice::Started { twice: false, .. })), "a restart is no twin");
}
