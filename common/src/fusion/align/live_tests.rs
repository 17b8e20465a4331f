use crate::skips::Reason;
use crate::wire::EpochMessage;
use proptest::prelude::*;

use super::tests::{at, drain, message, seconds};
use super::*;

/// Latency of these groups, s.
const WAIT_S: f64 = 5.0;

const fn ms(milliseconds: u64) -> Duration {
    Duration::from_millis(milliseconds)
}

/// A live group with numbered messages and simulated clocks.
struct Live {
    aligner: Aligner,
    sent: u64,
    fused: Vec<Vec<Option<f64>>>,
    notices: Vec<Notice>,
    /// Lead of the hub's own clock over the time since the start, s; `None`: unknown.
    wall_s: Option<f64>,
    now_s: f64,
    longest_wait: Duration,
}

impl Live {
    fn of(phones: usize) -> Self {
        let aligner = Aligner::live(phones, AlignOptions::default());
        let (fused, notices) = (Vec::new(), Vec::new());
        Self { aligner, sent: 0, fused, notices, wall_s: None, now_s: 0.0, longest_wait: Duration::ZERO }
    }

    /// A group whose hub's clock shows 0 at the start.
    fn with_clock(phones: usize) -> Self {
        Self { wall_s: Some(0.0), ..Self::of(phones) }
    }

    /// Sends a message of `phone` for `seconds` at `now_s`, and aligns.
    fn say(&mut self, phone: usize, seconds: f64, now_s: f64) {
        self.fuse(now_s);
        self.say_only(phone, message(phone, self.sent, seconds));
        self.fuse(now_s);
    }

    fn say_only(&mut self, phone: usize, message: EpochMessage) {
        self.aligner.push(phone, message, Duration::from_secs_f64(self.now_s));
        self.sent += 1;
    }

    /// Calls [`Self::look`] ten times a second until `now_s`.
    fn fuse(&mut self, now_s: f64) {
        while self.now_s + 0.1 < now_s {
            self.look(self.now_s + 0.1);
        }
        self.look(now_s.max(self.now_s));
    }

    fn look(&mut self, now_s: f64) {
        self.now_s = now_s;
        let now = Duration::from_secs_f64(now_s);
        let wall = self.wall_s.map(|wall_s| at(wall_s + now_s));
        self.fused.extend(seconds(&drain(&mut self.aligner)));
        while self.aligner.go_on(now, wall) {
            self.fused.extend(seconds(&drain(&mut self.aligner)));
        }
        self.notices.extend(self.aligner.notices());
        self.longest_wait = self.longest_wait.max(self.aligner.longest_wait(now));
    }

    fn count(&self, phone: usize, reason: Reason) -> u64 {
        self.aligner.skips(phone).unwrap().count(reason)
    }

    fn late(&self) -> u64 {
        (0..self.aligner.tracks.len()).map(|phone| self.count(phone, Reason::EpochTooLate)).sum()
    }

    fn fused_of(&self, phone: usize) -> usize {
        self.fused.iter().filter(|bucket| bucket[phone].is_some()).count()
    }

    /// Phones and kinds of all notices.
    fn told(&self) -> Vec<(usize, NoticeKind)> {
        self.notices.iter().map(|notice| (notice.phone, notice.kind)).collect()
    }
}

#[test]
fn a_silent_phone_delays_a_live_group_once() {
    let mut live = Live::of(2);
    for second in [0.0, 1.0] {
        live.say(0, second, second);
        live.say(1, second, second);
    }
    live.say(0, 2.0, 2.0);
    live.fuse(6.9);
    assert_eq!(live.fused.len(), 2);
    live.fuse(7.0);
    assert_eq!(live.fused[2..], [[Some(2.0), None]]);
    assert_eq!(live.told(), [(1, NoticeKind::Silent)]);
    live.say(0, 3.0, 7.1);
    assert_eq!(live.fused.len(), 4, "phone 1 is left behind");
    live.say(1, 2.0, 7.2);
    assert_eq!(live.count(1, Reason::EpochTooLate), 1);
    live.say(0, 4.0, 7.3);
    assert_eq!(live.fused.len(), 5, "that was more than five seconds late");
    live.say(1, 3.5, 7.4);
    assert_eq!(live.count(1, Reason::EpochTooLate), 2);
    live.say(0, 5.0, 7.5);
    assert_eq!(live.fused.len(), 5, "that was 0.1 s late: phone 1 is on time again, and waited for");
    assert_eq!(live.told().last(), Some(&(1, NoticeKind::OnTime)));
    live.say(1, 5.0, 7.6);
    assert_eq!(live.fused[5..], [[Some(5.0), Some(5.0)]]);
    live.say(1, 6.0, 8.5);
    live.aligner.leave(0);
    live.fuse(8.5);
    assert_eq!(live.fused[6..], [[None, Some(6.0)]]);
    assert!(!live.aligner.go_on(ms(99_000), None));
}

#[test]
fn an_absent_phone_delays_the_start_once_and_no_more() {
    let mut live = Live::of(2);
    for second in 0..30_u32 {
        live.say(0, f64::from(second), f64::from(second));
        let expected = if second < 5 { 0 } else { second as usize + 1 };
        assert_eq!(live.fused.len(), expected, "{second}");
    }
}

#[test]
fn files_that_start_at_different_seconds_lose_nothing_at_any_speed() {
    let starts = [1.0, 2.0, 2.0, 3.0];
    for speed in [1.0, 20.0, 1e6] {
        let mut live = Live::of(4);
        for epoch in 0..60_u32 {
            for (phone, start) in starts.iter().enumerate() {
                live.say(phone, start + f64::from(epoch), f64::from(epoch) / speed);
            }
        }
        for phone in 0..4 {
            live.aligner.finish(phone);
        }
        live.fuse(61.0);
        assert_eq!(live.late(), 0, "speed {speed}");
        assert!((0..4).all(|phone| live.fused_of(phone) == 60), "speed {speed}");
        assert_eq!(live.fused.len(), 62, "speed {speed}");
    }
}

#[test]
fn agents_that_start_some_seconds_apart_lose_nothing_at_any_speed() {
    for speed in [1.0, 20.0, 1e6] {
        let mut live = Live::of(2);
        let mut sayings: Vec<(f64, usize, f64)> = (0..2_000_u32)
            .flat_map(|epoch| {
                [0.0, 4.5]
                    .into_iter()
                    .enumerate()
                    .map(move |(phone, late_s)| (late_s + f64::from(epoch) / speed, phone, f64::from(epoch)))
            })
            .collect();
        sayings.sort_by(|one, other| one.0.total_cmp(&other.0));
        for (now_s, phone, second) in sayings {
            live.say(phone, second, now_s);
        }
        assert_eq!((live.fused.len(), live.late(), live.told()), (2_000, 0, vec![]), "speed {speed}");
    }
}

#[test]
fn a_recording_that_is_read_more_slowly_than_the_others_loses_nothing() {
    let mut live = Live::of(2);
    for second in 0..20_000_u32 {
        // 2,000 times real time against 1,000.
        live.say(0, f64::from(2 * second), f64::from(second) * 0.001);
        live.say(0, f64::from(2 * second + 1), f64::from(second) * 0.001);
        live.say(1, f64::from(second), f64::from(second) * 0.001);
        if live.sent > 30_000 {
            break;
        }
    }
    live.aligner.finish(0);
    let (done, now_s) = (live.fused_of(1), live.now_s);
    for second in done..15_000 {
        live.say(1, second as f64, now_s + (second - done) as f64 * 0.001);
    }
    assert_eq!((live.late(), live.fused_of(0), live.told()), (0, live.fused.len(), vec![]));
}

#[test]
fn a_slow_link_delays_the_others_up_to_the_latency_and_is_named() {
    for with_clock in [false, true] {
        let mut live = Live::of(3);
        live.wall_s = with_clock.then_some(0.0);
        let (mut sent, mut third_waits) = (0.0, 0);
        for tenth in 0..6_000_u32 {
            let now_s = f64::from(tenth) / 10.0;
            if tenth.is_multiple_of(10) {
                live.say(0, now_s, now_s);
                live.say(1, now_s, now_s);
            }
            // Two of three epochs arrive.
            if tenth.is_multiple_of(15) {
                live.say(2, sent, now_s);
                sent += 1.0;
            }
            third_waits += u64::from(live.aligner.awaits(2));
        }
        assert!(live.longest_wait <= ms(5_100), "{:?}", live.longest_wait);
        live.fuse(604.0);
        assert_eq!((live.fused_of(0), live.fused_of(1)), (600, 600), "with a clock: {with_clock}");
        assert_eq!(live.told(), [(2, NoticeKind::Behind)], "the slow one, once");
        assert!(live.notices[0].text.contains("0.67 times the speed of time"), "{}", live.notices[0].text);
        assert!(third_waits < 200, "{third_waits}");
        assert_eq!(live.fused_of(2) as u64 + live.late(), 400, "counted");
    }
}

#[test]
fn a_delayed_link_is_fused_within_the_latency_and_left_behind_beyond_it() {
    for (delay_s, is_fused) in [(0.3, true), (4.5, true), (5.5, false), (30.0, false)] {
        for with_clock in [false, true] {
            let mut live = Live::of(2);
            live.wall_s = with_clock.then_some(0.0);
            for tenth in 0..1_000_u32 {
                let now_s = f64::from(tenth) / 10.0;
                if tenth.is_multiple_of(10) {
                    live.say(0, now_s, now_s);
                }
                let epoch_s = now_s - delay_s;
                if epoch_s >= 0.0 && (epoch_s - epoch_s.round()).abs() < 1e-6 {
                    live.say(1, epoch_s.round(), now_s);
                }
            }
            assert!(live.longest_wait <= ms(5_100), "{delay_s}: {:?}", live.longest_wait);
            assert!(live.fused_of(0) >= 95, "{delay_s}: {}", live.fused_of(0));
            assert_eq!(live.late() == 0, is_fused, "{delay_s}: {}", live.late());
            assert!(live.told().iter().all(|(phone, _)| *phone == 1), "{delay_s}: {:?}", live.notices);
        }
    }
}

/// Two phones, the second with a clock error of `off_s` and a start `late_s` after the first.
fn wrong_clock(off_s: f64, late_s: f64, with_clock: bool) -> Live {
    let mut live = Live::of(2);
    live.wall_s = with_clock.then_some(0.0);
    for second in 0..120_u32 {
        let second = f64::from(second);
        live.say(0, second, second);
        if second >= late_s {
            live.say(1, second + off_s, second + 0.3);
        }
    }
    live.fuse(123.0);
    live
}

#[test]
fn of_two_phones_the_one_that_agrees_with_the_hubs_clock_is_fused() {
    for off_s in [-1_800.0, 1_800.0, -60.0, 60.0, -7.0, 7.0, -86_400.0, 6e8] {
        for late_s in [0.0, 30.0] {
            let live = wrong_clock(off_s, late_s, true);
            assert_eq!(live.fused_of(0), 120, "off by {off_s} s, {late_s} s later");
            assert!(live.longest_wait <= ms(5_100), "{off_s}: {:?}", live.longest_wait);
            assert!(live.told().iter().all(|(phone, _)| *phone == 1), "{off_s}: {:?}", live.notices);
            assert!(!live.told().is_empty() || late_s > 0.0, "{off_s}");
        }
    }
}

#[test]
fn without_a_clock_the_group_keeps_its_time_and_none_is_waited_for() {
    for off_s in [-1_800.0, 1_800.0] {
        let live = wrong_clock(off_s, 30.0, false);
        assert!(live.longest_wait <= ms(5_100), "{off_s}: {:?}", live.longest_wait);
    }
    let live = wrong_clock(-1_800.0, 0.0, false);
    assert_eq!(live.fused_of(0), 120, "the later one");
    assert_eq!(live.told(), [(1, NoticeKind::Behind)]);
}

#[test]
fn a_phone_that_was_wrong_alone_does_not_lock_the_others_out() {
    let mut live = Live::with_clock(2);
    for second in 0..60_u32 {
        let second = f64::from(second);
        live.say(0, second + 1_800.0, second);
        if second >= 30.0 {
            live.say(1, second, second);
        }
    }
    live.fuse(66.0);
    assert!(live.aligner.went_back());
    assert!(live.fused_of(1) >= 28, "{}", live.fused_of(1));
    assert_eq!(live.told()[..2], [(1, NoticeKind::Silent), (1, NoticeKind::WentBack)]);
}

#[test]
fn a_phone_far_ahead_waits_and_does_not_stop_the_others() {
    let day = 86_400.0;
    let mut live = Live::of(3);
    for second in 0..60_u32 {
        let second = f64::from(second);
        live.say(2, day + second, second);
        live.say(0, second, second + 0.1);
        live.say(1, second, second + 0.2);
    }
    assert_eq!((live.fused_of(0), live.fused_of(1), live.fused_of(2), live.late()), (60, 60, 0, 0));
    assert_eq!(live.told(), [(2, NoticeKind::Ahead)]);
    // The others are silent for half a minute, so phone 2 is alone.
    live.fuse(90.0);
    assert_eq!(live.fused_of(2), 60);
    for second in 90..120_u32 {
        let second = f64::from(second);
        live.say(2, day + second, second);
        live.say(0, second, second + 0.1);
        live.say(1, second, second + 0.2);
    }
    assert!(live.fused_of(0) >= 88 && live.fused_of(1) >= 88, "{} {}", live.fused_of(0), live.fused_of(1));
    assert_eq!(live.fused_of(2), 61, "the group went back to the time of the two");
    live.aligner.finish(0);
    live.aligner.finish(1);
    live.fuse(121.0);
    assert_eq!(live.fused_of(2), 90, "they were waiting");
}

#[test]
fn a_message_that_comes_before_its_time_leaves_nobody_behind() {
    let mut live = Live::with_clock(2);
    for tenth in 0..100_u32 {
        let now_s = f64::from(tenth) / 10.0;
        match tenth {
            5 => live.say(1, 0.5, now_s),
            // This one waits for phone 0 until 5.9 s, which is between the epochs of phone 0.
            9 => live.say(1, 5.4, now_s),
            58 => live.say(1, 5.8, now_s),
            60 => live.say(1, 9.6, now_s - 0.05),
            _ => {}
        }
        if tenth.is_multiple_of(10) {
            live.say(0, now_s, now_s);
        }
    }
    assert_eq!((live.fused_of(0), live.told()), (10, vec![]));
    assert_eq!(live.fused_of(1), 3, "the last one waits");
}

#[test]
fn a_phone_far_behind_the_majority_does_not_stop_the_others() {
    for (behind_s, speed) in [(3_600.0, 1.0), (3_600.0, 20.0), (86_400.0, 1.0), (100.0, 1.0)] {
        let mut live = Live::of(3);
        for second in 0..60_u32 {
            let second = f64::from(second);
            for phone in 0..2 {
                live.say(phone, second * speed, second);
            }
            live.say(2, (second * speed) - behind_s, second);
        }
        live.fuse(66.0);
        assert_eq!((live.fused_of(0), live.fused_of(1)), (60, 60), "{behind_s}");
        assert_eq!(live.told(), [(2, NoticeKind::Behind)], "{behind_s}");
        assert!(live.longest_wait <= ms(5_100), "{behind_s}: {:?}", live.longest_wait);
        assert!(live.late() > 40);
    }
}

#[test]
fn an_agent_restarted_on_an_older_log_does_not_stop_the_others() {
    for older_s in [50.0, 200.0, 1_800.0, 1e6] {
        for pause_s in [0_u32, 20] {
            let mut live = Live::of(2);
            for second in 0..180_u32 {
                let second = f64::from(second);
                live.say(0, second, second);
                if second < 60.0 {
                    live.say(1, second, second);
                } else if second >= 60.0 + f64::from(pause_s) {
                    live.say(1, second - older_s, second);
                }
            }
            live.fuse(186.0);
            assert_eq!(live.fused_of(0), 180, "{older_s}");
            assert_eq!(live.fused_of(1), 60, "{older_s}");
            assert!(live.longest_wait <= ms(5_100), "{older_s}: {:?}", live.longest_wait);
            assert!(live.told().iter().all(|(phone, _)| *phone == 1), "{older_s}: {:?}", live.notices);
            let skips = live.aligner.skips(1).unwrap();
            let dropped = skips.total() - skips.count(Reason::PhoneBehind);
            assert!(dropped >= 100 - u64::from(pause_s), "{older_s}: {skips}");
        }
    }
}

#[test]
fn old_epochs_of_a_silent_phone_keep_nobody_waiting() {
    let mut live = Live::of(2);
    for second in 0..120_u32 {
        let second = f64::from(second);
        live.say(0, second, second);
        live.say(1, second % 20.0, second);
    }
    live.fuse(126.0);
    assert_eq!(live.fused_of(0), 120);
    assert!(live.longest_wait <= ms(5_100), "{:?}", live.longest_wait);
    let waits = live.told().iter().filter(|(_, kind)| *kind == NoticeKind::OnTime).count();
    assert_eq!(waits, 0, "left behind once: {:?}", live.notices);
}

#[test]
fn an_agent_that_comes_and_goes_without_a_word_keeps_nobody_waiting() {
    let mut live = Live::of(2);
    for epoch in 0..60 {
        let second = epoch as f64;
        live.aligner.leave(1);
        live.say(0, second, second);
        // The first epoch is confirmed by the second.
        assert_eq!(live.fused.len(), if epoch > 0 { epoch + 1 } else { 0 });
    }
    assert_eq!(live.longest_wait, Duration::ZERO);
}

#[test]
fn the_others_of_a_finished_recording_are_waited_for_as_long_as_they_go_on() {
    let mut live = Live::of(3);
    for phone in 0..2 {
        for second in 0..600_u32 {
            live.say(phone, f64::from(second), 0.0);
        }
        live.aligner.finish(phone);
    }
    for second in 0..600_u32 {
        live.say(2, f64::from(second), 1.0 + f64::from(second) * 0.1);
    }
    assert_eq!((live.fused_of(0), live.fused_of(2), live.late()), (600, 600, 0));
}

#[test]
fn history_that_comes_slowly_is_left_out_rather_than_waited_for() {
    let mut live = Live::with_clock(2);
    // Both connect to a new hub with an hour of history: one delivers it at once, the other at twenty times the speed of time.
    let hour = 3_600_u32;
    for second in 0..hour {
        live.say(0, f64::from(second) - 3_600.0, 0.5);
    }
    for twentieth in 0..20 * 60_u32 {
        let now_s = 1.0 + f64::from(twentieth) / 20.0;
        if twentieth.is_multiple_of(20) {
            live.say(0, now_s, now_s);
        }
        live.say(1, f64::from(twentieth) - 3_600.0, now_s);
    }
    live.fuse(66.0);
    assert!(live.longest_wait <= ms(5_100), "{:?}", live.longest_wait);
    assert_eq!(live.fused_of(0), 3_660);
    assert!(live.fused_of(1) >= 90, "{}", live.fused_of(1));
    assert_eq!(live.told(), [(1, NoticeKind::Behind)]);
}

/// Action of a phone in one step of a tenth of a second.
#[derive(Clone, Debug)]
enum Deed {
    Say { off_s: f64 },
    Burst { off_s: f64, count: u8 },
    Leave,
    Finish,
    Nothing,
}

fn deed() -> impl Strategy<Value = Deed> {
    let off_s = prop_oneof![
        Just(0.0),
        -4.0..4.0_f64,
        -40.0..40.0_f64,
        prop::sample::select(vec![-1_800.0, 1_800.0, 9e4, -9e4, 1e9]),
    ];
    prop_oneof![
        6 => off_s.clone().prop_map(|off_s| Deed::Say { off_s }),
        1 => (off_s, 0..40_u8).prop_map(|(off_s, count)| Deed::Burst { off_s, count }),
        1 => Just(Deed::Leave),
        1 => Just(Deed::Finish),
        4 => Just(Deed::Nothing),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn no_message_ever_waits_longer_than_the_latency(
        deeds in prop::collection::vec((0..4_usize, deed()), 0..600),
        with_clock in any::<bool>(),
    ) {
        let mut live = Live::of(4);
        live.wall_s = with_clock.then_some(0.0);
        for (step, (phone, deed)) in deeds.into_iter().enumerate() {
            let now_s = step as f64 / 10.0;
            match deed {
                Deed::Say { off_s } => live.say(phone, now_s + off_s, now_s),
                Deed::Burst { off_s, count } => {
                    for second in 0..count {
                        live.say(phone, now_s + off_s + f64::from(second), now_s);
                    }
                }
                Deed::Leave => live.aligner.leave(phone),
                Deed::Finish => live.aligner.finish(phone),
                Deed::Nothing => {}
            }
            live.fuse(now_s);
            prop_assert!(live.longest_wait.as_secs_f64() <= WAIT_S + 0.11, "{:?}", live.longest_wait);
        }
    }

    #[test]
    fn a_phone_that_agrees_with_the_hubs_clock_is_fused_whatever_another_one_does(
        deeds in prop::collection::vec(deed(), 0..600),
    ) {
        let mut live = Live::with_clock(2);
        let mut said = 0;
        for (step, deed) in deeds.into_iter().enumerate() {
            let now_s = step as f64 / 10.0;
            if step.is_multiple_of(10) {
                live.say(0, now_s, now_s);
                said += 1;
            }
            match deed {
                Deed::Say { off_s } => live.say(1, now_s + off_s, now_s),
                Deed::Burst { off_s, count } => {
                    for second in 0..count {
                        live.say(1, now_s + off_s + f64::from(second), now_s);
                    }
                }
                Deed::Leave => live.aligner.leave(1),
                Deed::Finish => live.aligner.finish(1),
                Deed::Nothing => {}
            }
        }
        let end_s = live.now_s;
        live.fuse(end_s + WAIT_S + 0.1);
        let missing = said - live.fused_of(0);
        // An epoch is not confirmed before the next one.
        prop_assert!(missing <= 1 + said / 10, "{missing} of {said} are not fused: {:?}", live.notices);
    }
}
