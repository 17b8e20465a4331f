use cofix_common::skips::Reason;
use cofix_common::time::GpsTime;
use cofix_common::wire::{KeptMessage, PhoneStatus, StatusMessage, encode};

use super::phone::MAXIMUM_RUNS;
use super::*;
use crate::testing::numbered;

fn intake() -> Intake {
    Intake::new(&["a".to_owned(), "b".to_owned()])
}

fn epoch(phone: &str, sequence: u64) -> EpochMessage {
    numbered(phone, sequence, GpsTime::from_week_tow(2118, sequence as f64))
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

/// Epochs that are here, and those that are given up.
fn receipt(intake: &Intake, phone: usize, sender: &str) -> (u64, u64) {
    let Receipt { received, lost } = intake.receipt(phone, sender);
    (received, lost)
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
    let received = [(0, "x"), (0, "y"), (1, "x")].map(|(phone, sender)| receipt(&intake, phone, sender));
    assert_eq!(received, [(3, 0), (0, 0), (0, 0)]);
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
    assert_eq!(intake.skips().count(Reason::PhoneUnknown), 1);
    assert!(intake.epoch(&from("x", "a", b"hello".to_vec())).is_none());
    assert!(intake.epoch(&from("x", "a", encode(&epoch("b", 0)).unwrap())).is_none());
    intake.epoch(&from("x", "a", encode(&epoch("a", 1)).unwrap()));
    assert!(intake.epoch(&from("x", "a", encode(&epoch("a", 1)).unwrap())).is_none());
    assert!(intake.status(&from("x", "a", finished("b", 1))).is_none());
    assert!(intake.status(&from("x", "a", vec![])).is_none());
    let skips = intake.phone_skips(0).unwrap();
    for reason in [
        Reason::MessageUnreadable.text(),
        Reason::MessageRefused.text(),
        Reason::MessageReceivedTwice.text(),
        Reason::StatusOfOtherPhone.text(),
        Reason::StatusUnreadable.text(),
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
    assert_eq!(intake.phones[0].runs.len(), MAXIMUM_RUNS);
    let skips = intake.phone_skips(0).unwrap();
    assert_eq!(skips.count(Reason::RunForgotten), 1_000 - MAXIMUM_RUNS as u64);
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
    assert_eq!(receipt(&intake, 0, "x"), (1, 0));
}

#[test]
fn lost_epochs_are_given_up_and_counted() {
    let mut intake = intake();
    intake.epoch(&from("x", "a", encode(&epoch("a", 0)).unwrap()));
    intake.status(&from("x", "a", finished("a", 4)));
    assert!(!intake.is_complete(0));
    assert_eq!(intake.shortfall(0), Some(3));
    intake.give_up(0);
    assert!(intake.is_complete(0));
    assert_eq!(intake.phone_skips(0).unwrap().count(Reason::EpochsNotArrived), 3);
    intake.status(&from("y", "a", finished("a", u64::MAX)));
    assert_eq!(intake.shortfall(0), Some(u64::MAX), "any number may be claimed");
    intake.give_up(0);
}

#[test]
fn two_agents_of_one_name_are_noticed_and_both_waited_for() {
    let mut intake = intake();
    intake.status(&from("x", "a", started("a")));
    let notice = intake.status(&from("y", "a", started("a")));
    assert!(matches!(notice, Some(Notice::Started { twice: true, .. })));
    assert_eq!(intake.phone_skips(0).unwrap().count(Reason::TwoAgentsOfOneName), 1);
    intake.status(&from("y", "a", finished("a", 0)));
    assert!(!intake.is_complete(0), "the other still runs");
    intake.gone(0);
    assert!(intake.is_complete(0));
    let notice = intake.status(&from("z", "a", started("a")));
    assert!(matches!(notice, Some(Notice::Started { twice: false, .. })), "a restart is no twin");
}

#[test]
fn a_second_agent_is_refused_until_the_first_is_silent_or_has_ended() {
    let mut intake = intake();
    let put = |intake: &mut Intake, sender: &str, sequence: u64| {
        intake.epoch(&from(sender, "a", encode(&epoch("a", sequence)).unwrap())).is_some()
    };
    let at = Duration::from_secs;
    intake.status(&from("x", "a", started("a")));
    assert!(put(&mut intake, "x", 0));
    intake.status(&from("y", "a", started("a")));
    assert!(!put(&mut intake, "y", 0) && put(&mut intake, "x", 1));
    intake.set_time(at(14));
    assert!(!put(&mut intake, "y", 1), "the first may be on a bad link");
    assert_eq!(intake.gaps().count(), 0, "nothing is asked of the second");
    intake.set_time(at(15));
    assert!(put(&mut intake, "y", 2), "the first is silent");
    assert_eq!(
        intake.gaps().map(|(_, sender, gap)| (sender, gap.from, gap.to)).collect::<Vec<_>>(),
        [("y", 0, 2)]
    );
    assert!(!put(&mut intake, "x", 2), "now it is the second");
    intake.status(&from("y", "a", finished("a", 3)));
    assert!(put(&mut intake, "x", 3));
    assert_eq!(intake.phone_skips(0).unwrap().count(Reason::MessageOfSecondAgent), 3);
}

#[test]
fn messages_that_were_not_let_in_are_counted_for_their_phone() {
    let mut intake = intake();
    assert!(intake.shed("a", 70_000) && !intake.shed("a", 5) && intake.shed("no\nbody", 3));
    assert_eq!(intake.phone_skips(0).unwrap().count(Reason::MessageBeyondRate), 70_005);
    let strangers = intake.skips().get(Reason::MessageBeyondRate).unwrap();
    assert_eq!((strangers.count, strangers.first.as_str()), (3, "no\\nbody"));
}

fn send(intake: &mut Intake, sequence: u64) {
    intake.epoch(&from("x", "a", encode(&epoch("a", sequence)).unwrap()));
}

fn kept(intake: &mut Intake, first: u64, next: u64) {
    let message = KeptMessage { phone: "a".to_owned(), first, next };
    assert_eq!(intake.history(&from("x", "a", encode(&message).unwrap())), Some(Answer::Kept(0)));
}

/// The sequence numbers of the messages of phone 0 whose turn it is.
fn ready(intake: &mut Intake) -> Vec<u64> {
    std::iter::from_fn(|| intake.next_ready(0)).map(|message| message.sequence).collect()
}

fn gap(intake: &Intake) -> Option<(u64, u64, bool)> {
    intake.gaps().next().map(|(_, _, gap)| (gap.from, gap.to, gap.waited_on))
}

#[test]
fn messages_wait_for_those_before_them() {
    let mut intake = intake();
    send(&mut intake, 3);
    send(&mut intake, 5);
    assert_eq!((ready(&mut intake), gap(&intake)), (vec![], Some((0, 3, true))));
    for sequence in [2, 0, 1] {
        let bytes = encode(&epoch("a", sequence)).unwrap();
        assert_eq!(intake.history(&from("x", "a", bytes)), Some(Answer::Epoch(0)));
    }
    assert_eq!((ready(&mut intake), gap(&intake)), (vec![0, 1, 2, 3], Some((4, 5, true))));
    send(&mut intake, 4);
    assert_eq!((ready(&mut intake), gap(&intake)), (vec![4, 5], None));
    assert!(intake.phone_skips(0).unwrap().is_empty());
}

#[test]
fn what_was_asked_for_and_came_by_itself_too_is_no_fault() {
    let mut intake = intake();
    send(&mut intake, 0);
    let again = |sequence| from("x", "a", encode(&epoch("a", sequence)).unwrap());
    assert_eq!(intake.history(&again(0)), None);
    assert_eq!(intake.history(&again(1)), Some(Answer::Epoch(0)));
    send(&mut intake, 1);
    assert!(intake.phone_skips(0).unwrap().is_empty());
    send(&mut intake, 2);
    send(&mut intake, 2);
    assert_eq!(intake.phone_skips(0).unwrap().count(Reason::MessageReceivedTwice), 1);
    assert_eq!(ready(&mut intake), [0, 1, 2]);
}

#[test]
fn an_agent_says_what_is_missing_at_the_end() {
    let mut intake = intake();
    kept(&mut intake, 0, 4);
    assert_eq!(gap(&intake), Some((0, 4, false)));
    for sequence in 0..4 {
        send(&mut intake, sequence);
    }
    assert_eq!(gap(&intake), None);
    intake.status(&from("x", "a", started("a")));
    intake.status(&from("x", "a", finished("a", 6)));
    assert_eq!(gap(&intake), Some((4, 6, false)));
    intake.gone(0);
    assert_eq!(gap(&intake), None, "nobody can be asked");
}

#[test]
fn what_is_given_up_is_counted_and_the_rest_goes_on() {
    let mut intake = intake();
    send(&mut intake, 7);
    kept(&mut intake, 5, 8);
    let gap = intake.gaps().next().unwrap().2;
    assert_eq!((gap.from, gap.to, gap.kept_from), (0, 7, 5));
    assert_eq!(intake.skip(0, "x", 5, "not kept"), 5);
    send(&mut intake, 5);
    assert_eq!(ready(&mut intake), [5]);
    assert_eq!(intake.skip(0, "x", 100, "not sent"), 1);
    assert_eq!(ready(&mut intake), [7]);
    assert_eq!((receipt(&intake, 0, "x"), intake.lost(0)), ((2, 6), 6));
    let skips = intake.phone_skips(0).unwrap();
    assert_eq!(skips.count(Reason::EpochsNotArrived), 6);
    assert!(skips.to_string().contains("5 from sequence 0 on: not kept"), "{skips}");
    intake.status(&from("x", "a", finished("a", 8)));
    assert_eq!(intake.shortfall(0), Some(0), "counted already");
}

#[test]
fn the_end_hands_out_what_waits() {
    let mut intake = intake();
    for sequence in [1, 3, 4] {
        send(&mut intake, sequence);
    }
    intake.release_all();
    assert_eq!(ready(&mut intake), [1, 3, 4]);
    assert_eq!((receipt(&intake, 0, "x"), gap(&intake)), ((3, 2), None));
}

#[test]
fn no_more_than_so_many_messages_wait() {
    let mut intake = intake();
    let most = MAXIMUM_PARKED as u64;
    for sequence in 1..=most + 10 {
        send(&mut intake, sequence);
    }
    assert_eq!(intake.receipt(0, "x").received, most);
    send(&mut intake, 0);
    assert_eq!(ready(&mut intake).len() as u64, most + 1);
    assert_eq!(gap(&intake), Some((most + 1, most + 11, false)), "the agent has them");
    assert!(intake.phone_skips(0).unwrap().is_empty());
}

#[test]
fn many_senders_of_one_phone_share_the_room_to_wait() {
    let mut intake = intake();
    let senders: Vec<String> = (0..60).map(|sender| format!("s{sender}")).collect();
    for sender in &senders {
        for sequence in 1..=100 {
            intake.epoch(&from(sender, "a", encode(&epoch("a", sequence)).unwrap()));
        }
    }
    let waiting: u64 = senders.iter().map(|sender| intake.receipt(0, sender).received).sum();
    assert_eq!(waiting, MAXIMUM_PARKED as u64);
}

#[test]
fn senders_without_a_name_are_not_asked() {
    let mut intake = intake();
    let bytes = |sequence| encode(&epoch("a", sequence)).unwrap();
    for sequence in [4, 9, 7] {
        intake.epoch(&Arrival { phone: "a".to_owned(), sender: None, bytes: bytes(sequence) });
    }
    assert_eq!((ready(&mut intake), gap(&intake)), (vec![4, 9], None));
    assert_eq!(intake.phone_skips(0).unwrap().count(Reason::MessageReceivedTwice), 1);
}

#[test]
fn statuses_that_come_again_are_no_news() {
    let mut intake = intake();
    for (bytes, is_news) in [(started("a"), true), (started("a"), false), (finished("a", 0), true)] {
        let answer = intake.history(&from("x", "a", bytes));
        assert_eq!(matches!(answer, Some(Answer::Status(_))), is_news);
    }
    assert_eq!(intake.status(&from("x", "a", finished("a", 0))), None);
    assert!(intake.is_complete(0));
    assert_eq!(intake.history(&from("x", "a", b"hello".to_vec())), None);
    let other = KeptMessage { phone: "b".to_owned(), first: 0, next: 1 };
    assert_eq!(intake.history(&from("x", "a", encode(&other).unwrap())), None);
    assert_eq!(intake.phone_skips(0).unwrap().count(Reason::HistoryUnreadable), 2);
}
