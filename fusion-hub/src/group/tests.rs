use std::sync::mpsc::sync_channel;

use cofix_common::fusion::align::AlignOptions;
use cofix_common::fusion::engine::EngineOptions;
use cofix_common::skips::{Reason, Skips};
use cofix_common::wire::{KeptMessage, PhoneStatus, StatusMessage, encode};

use super::*;
use crate::network::FusedPublisher;
use crate::network::recovery::Question;
use crate::report::scores::Scores;
use crate::testing::numbered;

/// A live group of two phones, `a` and `b`, whose clock is told; its questions to agents come here.
struct Bench {
    group: Group,
    questions: Receiver<(String, Question)>,
    /// Tenths of a second since the start.
    tenth: u32,
    events: Vec<Event>,
}

fn at(seconds: f64) -> GpsTime {
    GpsTime::from_week_tow(2118, 397_000.0) + seconds
}

fn epoch_bytes(phone: &str, sequence: u64, second: f64) -> Vec<u8> {
    encode(&numbered(phone, sequence, at(second))).unwrap()
}

fn arrival(phone: &str, bytes: Vec<u8>) -> Arrival {
    Arrival { phone: phone.to_owned(), sender: Some(format!("run of {phone}")), bytes }
}

impl Bench {
    fn new() -> Self {
        let phones = ["a".to_owned(), "b".to_owned()];
        let (sender, questions) = sync_channel(10_000);
        let truths = phones.iter().map(|name| (name.clone(), None)).collect();
        let group = Group::new(Parts {
            name: "g".to_owned(),
            course: Course::Live { until_finished: true },
            aligner: Aligner::live(2, AlignOptions::default()),
            engine: Engine::new(&phones, Vec::new(), EngineOptions::default()),
            receipts: Receipts::default(),
            history: HistoryQuestions::into(sender),
            outputs: Outputs::new(&phones, FusedPublisher::nowhere(), Scores::new(truths, vec![1])),
            phones: phones.to_vec(),
        });
        Self { group, questions, tenth: 0, events: Vec::new() }
    }

    fn now_s(&self) -> f64 {
        f64::from(self.tenth) / 10.0
    }

    /// An epoch of now.
    fn say(&mut self, phone: &str, sequence: u64) {
        let bytes = epoch_bytes(phone, sequence, self.now_s());
        self.events.push(Event::Epoch(arrival(phone, bytes)));
    }

    fn finish(&mut self, phone: &str, epochs_published: u64) {
        let status = PhoneStatus::Finished { epochs_published, skips: Skips::default(), error: None };
        let bytes = encode(&StatusMessage { phone: phone.to_owned(), status }).unwrap();
        self.events.push(Event::Status(arrival(phone, bytes)));
    }

    /// A tenth of a second passes.
    fn step(&mut self) {
        let now = Duration::from_millis(100) * self.tenth;
        let events = std::mem::take(&mut self.events);
        self.group.step(events.into_iter(), now, at(self.now_s())).unwrap();
        self.tenth += 1;
    }

    fn fused(&mut self, phone: &str) -> u64 {
        self.group.report().0.phones[phone].epochs
    }

    /// Steps for some seconds, in which `a` speaks every second and must be fused within the latency; `more` says what else happens.
    fn go(&mut self, seconds: u32, mut more: impl FnMut(&mut Self)) {
        for _ in 0..10 * seconds {
            if self.tenth.is_multiple_of(10) {
                self.say("a", u64::from(self.tenth / 10));
            }
            more(self);
            self.step();
            let due = f64::from(self.tenth - 1) / 10.0 - 5.1;
            let fused = self.fused("a");
            assert!(fused as f64 > due, "{fused} epochs after {} s", self.now_s());
        }
    }
}

#[test]
fn history_that_comes_slowly_holds_up_neither_the_group_nor_its_phone() {
    // One epoch a second of sixty that are missing, or none at all.
    for answers in [true, false] {
        let mut bench = Bench::new();
        let mut answered = 0;
        bench.go(40, |bench| {
            if bench.tenth.is_multiple_of(10) {
                bench.say("b", 60 + u64::from(bench.tenth / 10));
            }
            if answers && bench.tenth % 10 == 5 {
                let second = answered as f64 - 60.0;
                let kept = KeptMessage { phone: "b".to_owned(), first: 0, next: 60 };
                bench.events.push(Event::History(arrival("b", encode(&kept).unwrap())));
                bench.events.push(Event::History(arrival("b", epoch_bytes("b", answered, second))));
                answered += 1;
            }
        });
        assert!(bench.questions.try_iter().count() > 0);
        assert!(bench.fused("b") >= 34, "answers {answers}: {}", bench.fused("b"));
        let losses = bench.group.losses().unwrap();
        assert!(losses.contains("b: ") && losses.contains("× published epochs did not arrive"), "{losses}");
        let lost = bench.group.report().0.lost;
        assert!(lost["a"] == 0 && lost["b"] > 0, "{lost:?}");
    }
}

#[test]
fn history_that_comes_at_once_is_fused_whole() {
    let mut bench = Bench::new();
    for sequence in 0..60 {
        let second = sequence as f64 - 60.0;
        bench.events.push(Event::Epoch(arrival("a", epoch_bytes("a", sequence, second))));
    }
    bench.events.push(Event::Epoch(arrival("b", epoch_bytes("b", 60, 0.0))));
    for _ in 0..20 {
        for (_, question) in bench.questions.try_iter().collect::<Vec<_>>() {
            let Some((_, from, to)) = question.epochs else { continue };
            for sequence in from..to {
                let bytes = epoch_bytes("b", sequence, sequence as f64 - 60.0);
                bench.events.push(Event::History(arrival("b", bytes)));
            }
        }
        bench.step();
    }
    bench.events.push(Event::Epoch(arrival("a", epoch_bytes("a", 60, 0.0))));
    bench.finish("a", 61);
    bench.finish("b", 61);
    bench.step();
    assert_eq!((bench.fused("a"), bench.fused("b"), bench.group.losses()), (61, 61, None));
    assert!(bench.group.is_over());
}

#[test]
fn a_token_that_comes_and_goes_holds_up_nobody() {
    let mut bench = Bench::new();
    bench.go(60, |bench| {
        let alive = bench.tenth % 14 < 7;
        if bench.tenth.is_multiple_of(7) {
            bench.events.push(Event::Alive { phone: "b".to_owned(), alive });
        }
    });
    assert_eq!(bench.fused("a"), 60);
    assert_eq!(bench.group.losses(), None);
}

#[test]
fn an_agent_restarted_on_an_older_log_holds_up_nobody_and_is_counted() {
    let mut bench = Bench::new();
    bench.go(60, |bench| {
        if bench.tenth.is_multiple_of(10) && bench.tenth < 200 {
            bench.say("b", u64::from(bench.tenth / 10));
        }
        if bench.tenth >= 250 && bench.tenth.is_multiple_of(10) {
            let sequence = u64::from(bench.tenth / 10) - 25;
            let old = Arrival {
                sender: Some("another run".to_owned()),
                ..arrival("b", epoch_bytes("b", sequence, bench.now_s() - 1_800.0))
            };
            bench.events.push(Event::Epoch(old));
        }
    });
    assert_eq!((bench.fused("a"), bench.fused("b")), (60, 20));
    let losses = bench.group.losses().unwrap();
    assert!(losses.contains("b: ") && losses.contains(Reason::EpochTooLate.text()), "{losses}");
    assert!(!losses.contains("a: "), "{losses}");
}

#[test]
fn a_slow_link_makes_losses_that_are_told() {
    let mut bench = Bench::new();
    let mut sent = 0;
    bench.go(120, |bench| {
        if bench.tenth.is_multiple_of(15) {
            bench.events.push(Event::Epoch(arrival("b", epoch_bytes("b", sent, sent as f64))));
            sent += 1;
        }
    });
    let fused = bench.fused("b");
    let late = sent - fused;
    let losses = bench.group.losses().unwrap();
    assert_eq!(losses, format!("{late} published epochs were not fused (b: {late} × epoch too late)"));
    let lost = bench.group.report().0.lost;
    assert_eq!((lost["a"], lost["b"]), (0, 0), "they were scored");
}

#[test]
fn what_an_agent_states_and_does_not_send_is_lost_at_the_end() {
    let mut bench = Bench::new();
    bench.go(3, |_| {});
    let kept = KeptMessage { phone: "b".to_owned(), first: 0, next: 7 };
    bench.events.push(Event::History(arrival("b", encode(&kept).unwrap())));
    bench.step();
    bench.group.end(Vec::new()).unwrap();
    let lost = bench.group.report().0.lost;
    assert_eq!((lost["a"], lost["b"]), (0, 7));
    assert!(bench.group.losses().unwrap().contains("b: 7 × published epochs did not arrive"));
}

/// Floods of garbage, of strangers and of what is there already come to counts, by reason and with the first instance, and to nothing else.
#[test]
fn what_is_refused_is_counted_and_not_kept() {
    let mut bench = Bench::new();
    bench.go(3, |_| {});
    let flood = |round: u64| {
        (0..100)
            .flat_map(|_| [0, 1, 2, 3])
            .map(move |kind| match kind {
                0 => Event::Epoch(arrival("a", vec![7; 2_000])),
                1 => Event::Status(arrival("a stranger", vec![7; 2_000])),
                2 => Event::Epoch(arrival("a", epoch_bytes("a", 1, 1.0))),
                _ => Event::Alive { phone: "a stranger".to_owned(), alive: true },
            })
            .chain([Event::Epoch(arrival("b", epoch_bytes("b", round - 1, 2.0 + round as f64)))])
    };
    let described = |events: &[Event]| -> usize {
        let refused = events.iter().filter_map(|event| match event {
            Event::Refused { skips, .. } => Some(skips),
            _ => None,
        });
        refused.flat_map(Skips::iter).map(|(_, skip)| skip.first.len()).sum()
    };
    for round in 1..=2_u64 {
        let events = bench.group.screen(flood(round).collect());
        assert!(matches!(
            events[..],
            [Event::Epoch(_), Event::Refused { phone: None, .. }, Event::Refused { .. }]
        ));
        assert_eq!(described(&events) > 0, round == 1, "what is known is not told again");
        bench.events = events;
        bench.step();
        let report = bench.group.report().0;
        assert_eq!(report.skips.count(Reason::PhoneUnknown), 100 * round);
        let of_a = &report.phones["a"].skips;
        assert_eq!(of_a.count(Reason::MessageUnreadable), 100 * round);
        assert_eq!(of_a.count(Reason::MessageReceivedTwice), 100 * round);
        assert!(of_a.get(Reason::MessageReceivedTwice).unwrap().first.contains("sequence 1"));
    }
}
