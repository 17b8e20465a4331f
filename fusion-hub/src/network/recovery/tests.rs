use cofix_common::time::GpsTime;
use cofix_common::wire::{KeptMessage, encode};

use super::*;
use crate::network::intake::Arrival;
use crate::testing::numbered;

fn arrival(bytes: Vec<u8>) -> Arrival {
    Arrival { phone: "a".to_owned(), sender: Some("x".to_owned()), bytes }
}

fn send(intake: &mut Intake, sequences: impl IntoIterator<Item = u64>) {
    for sequence in sequences {
        let message = numbered("a", sequence, GpsTime::from_week_tow(2118, sequence as f64));
        intake.epoch(&arrival(encode(&message).unwrap()));
    }
}

fn kept(intake: &mut Intake, first: u64, next: u64) {
    let message = KeptMessage { phone: "a".to_owned(), first, next };
    intake.history(&arrival(encode(&message).unwrap()));
}

fn intake() -> Intake {
    Intake::new(&["a".to_owned()])
}

fn ask(from: u64, to: u64) -> Vec<Step> {
    vec![Step::Ask(Question { phone: 0, epochs: Some(("x".to_owned(), from, to)) })]
}

fn given_up(steps: &[Step]) -> Option<u64> {
    match steps {
        [Step::GiveUp { phone: 0, to, .. }] => Some(*to),
        _ => None,
    }
}

fn after(milliseconds: u64) -> Duration {
    Duration::from_millis(milliseconds)
}

#[test]
fn a_gap_is_asked_for_in_portions_when_it_has_not_closed_by_itself() {
    let (mut intake, mut recovery) = (intake(), Recovery::live(PATIENCE));
    send(&mut intake, [600]);
    assert_eq!(recovery.steps(&intake, after(0)), []);
    assert_eq!(recovery.slow(PATIENCE), [0]);
    assert_eq!(recovery.steps(&intake, after(100)), ask(0, PORTION));
    send(&mut intake, 0..30);
    assert_eq!(recovery.steps(&intake, after(900)), [], "the answer goes on");
    send(&mut intake, 30..PORTION);
    recovery.answered(0, "x");
    assert_eq!(recovery.steps(&intake, after(950)), ask(PORTION, 2 * PORTION));
    send(&mut intake, PORTION..600);
    recovery.answered(0, "x");
    assert_eq!(recovery.steps(&intake, after(1_000)), []);
    assert!(recovery.slow(2 * PATIENCE).is_empty(), "it is closed");
}

#[test]
fn a_question_without_an_answer_is_asked_again_and_live_the_gap_is_given_up() {
    let (mut intake, mut recovery) = (intake(), Recovery::live(PATIENCE));
    let mut replay = Recovery::of_a_replay();
    send(&mut intake, [3]);
    let mut asked = 0;
    for milliseconds in (0..10_000).step_by(50) {
        let steps = recovery.steps(&intake, after(milliseconds));
        assert_eq!(replay.steps(&intake, after(milliseconds)), steps);
        asked += steps.len();
        assert!(steps.is_empty() || steps == ask(0, 3));
        for recovery in [&mut recovery, &mut replay] {
            recovery.answered(0, "x");
        }
    }
    assert_eq!(asked, 20, "twice a second");
    assert_eq!(given_up(&recovery.steps(&intake, PATIENCE)), Some(3));
    assert_eq!(given_up(&replay.steps(&intake, PATIENCE)), None, "an error, found at the end");
}

#[test]
fn an_answer_whose_end_is_lost_is_not_waited_for_without_end() {
    let (mut intake, mut recovery) = (intake(), Recovery::live(PATIENCE));
    send(&mut intake, [3]);
    recovery.steps(&intake, after(0));
    assert_eq!(recovery.steps(&intake, after(100)), ask(0, 3));
    send(&mut intake, [0]);
    assert_eq!(recovery.steps(&intake, after(5_000)), []);
    assert_eq!(recovery.steps(&intake, after(100) + 2 * ANSWER), ask(1, 3));
}

#[test]
fn what_the_agent_does_not_keep_is_given_up_at_once_and_the_rest_asked_for() {
    for is_live in [true, false] {
        let (mut intake, mut recovery) =
            (intake(), if is_live { Recovery::live(PATIENCE) } else { Recovery::of_a_replay() });
        kept(&mut intake, 5, 9);
        assert_eq!(recovery.steps(&intake, after(0)), [], "they may be on their way");
        assert_eq!(given_up(&recovery.steps(&intake, after(100))), Some(5));
        intake.skip(0, "x", 5, "");
        assert_eq!(recovery.steps(&intake, after(150)), []);
        assert_eq!(recovery.steps(&intake, after(250)), ask(5, 9));
    }
}

#[test]
fn an_agent_that_appears_is_asked_until_it_answers() {
    let (intake, mut recovery) = (intake(), Recovery::live(PATIENCE));
    let who = [Step::Ask(Question { phone: 0, epochs: None })];
    recovery.appeared(0, after(0));
    assert_eq!(recovery.steps(&intake, after(0)), who);
    assert_eq!(recovery.steps(&intake, after(400)), []);
    assert_eq!(recovery.steps(&intake, after(500)), who);
    recovery.introduced(0);
    assert_eq!(recovery.steps(&intake, after(1_000)), []);
    recovery.appeared(0, after(2_000));
    recovery.disappeared(0);
    assert_eq!(recovery.steps(&intake, after(2_000)), []);
    recovery.appeared(0, after(3_000));
    assert_eq!(recovery.steps(&intake, after(3_000) + PATIENCE), [], "it does not answer");
}
