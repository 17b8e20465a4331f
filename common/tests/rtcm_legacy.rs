//! Legacy observation messages (1001 to 1004, 1009 to 1012): their values, what is missing, and streams that have MSM too.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

mod rtcm_support;

use cofix_common::constants::SPEED_OF_LIGHT_MPS;
use cofix_common::formats::decode::{Decoder, Record};
use cofix_common::formats::rtcm::{RtcmDecoder, RtcmOptions};
use cofix_common::skips::Reason;
use rtcm_rs::Message;
use rtcm_rs::msg::{GpsSigId, Msg1074Data, Msg1074Sig, Msg1074T, Msm46Sat};
use rtcm_support::legacy::{
    LIGHT_MS_M, NO_CODE, NO_PHASE, SENT, Second, Sent, epochs, is_glonass, list, message, names, raw, write,
};
use rtcm_support::{NOW, TOW_MS, decode, frame, frame_of};

fn close(value: Option<f64>, expected: f64, tolerance: f64) {
    assert!((value.expect("a value") - expected).abs() <= tolerance, "{value:?} is not {expected}");
}

fn cycles(range_m: f64, frequency_hz: f64) -> f64 {
    range_m / SPEED_OF_LIGHT_MPS * frequency_hz
}

#[test]
fn messages_of_both_systems_become_one_epoch_with_their_scales() {
    let (epochs, skips) = epochs(&[message(1_004, 0, 1, &[SENT]), message(1_012, 0, 0, &[SENT])]);
    assert!(skips.is_empty(), "{skips}");
    let [epoch] = epochs.as_slice() else { panic!("{epochs:?}") };
    assert_eq!(epoch.time_gps, NOW.parse().unwrap());
    assert_eq!(names(epoch), "G07-1C G07-2X R07-1C R07-2C");
    let ranges = [70.0 * LIGHT_MS_M + 1_000.0, 140.0 * LIGHT_MS_M + 1_000.0];
    // channel 5
    let frequencies = [[1_575.42e6, 1_227.6e6], [1_604.812_5e6, 1_248.187_5e6]];
    for ((pair, range_m), frequencies) in epoch.observations.chunks(2).zip(ranges).zip(frequencies) {
        close(pair[0].pseudorange_m, range_m, 1e-8);
        close(pair[1].pseudorange_m, range_m - 2.0, 1e-8);
        close(pair[0].carrier_phase_cycles, cycles(range_m + 1.0, frequencies[0]), 1e-6);
        close(pair[1].carrier_phase_cycles, cycles(range_m - 1.5, frequencies[1]), 1e-6);
        assert_eq!((pair[0].cn0_dbhz, pair[1].cn0_dbhz), (Some(42.5), Some(37.5)));
        assert!(pair.iter().all(|o| o.doppler_hz.is_none() && !o.loss_of_lock.cycle_slip));
    }
}

#[test]
fn indicators_name_the_signals() {
    let of = |number, first, second| Sent {
        number,
        indicator: first,
        second: Second { indicator: second, ..SENT.second },
        ..SENT
    };
    let satellites = [of(1, 0, 0), of(2, 1, 1), of(3, 0, 2), of(4, 0, 3)];
    let (gps, skips) = epochs(&[message(1_004, 0, 0, &satellites)]);
    assert_eq!(names(&gps[0]), "G01-1C G01-2X G02-1P G02-2P G03-1C G03-2D G04-1C G04-2W", "{skips}");
    let (glonass, skips) = epochs(&[message(1_012, 0, 0, &satellites)]);
    assert_eq!(names(&glonass[0]), "R01-1C R01-2C R02-1P R02-2P R03-1C R04-1C");
    assert_eq!((skips.total(), skips.count(Reason::ReservedSignalNumber)), (2, 2), "{skips}");
    let single = epochs(&[message(1_002, 0, 1, &satellites), message(1_010, 0, 0, &satellites[..1])]).0;
    assert_eq!(names(&single[0]), "G01-1C G02-1P G03-1C G04-1C R01-1C");
}

#[test]
fn values_that_are_marked_as_missing_are_missing() {
    let no_phases =
        Sent { phase: NO_PHASE, second: Second { phase: NO_PHASE, ..SENT.second }, number: 1, ..SENT };
    let second = Second { code: NO_CODE, phase: NO_PHASE, cn0: 0, ..SENT.second };
    let only_first = Sent { second, cn0: 0, number: 2, ..SENT };
    let only_second = Sent { phase: NO_PHASE, cn0: 0, number: 3, ..SENT };
    let all_ones = Sent { code: u64::MAX, number: 4, ..SENT };
    let second = Second { code: NO_CODE, ..SENT.second };
    let phase_alone = Sent { second, number: 5, ..SENT };
    let satellites = [no_phases, only_first, only_second, all_ones, phase_alone];
    for (number, system, signal) in [(1_004, 'G', "2X"), (1_012, 'R', "2C")] {
        let (epochs, skips) = epochs(&[message(number, 0, 0, &satellites)]);
        let s = system;
        let expected = format!("{s}01-1C {s}01-{signal} {s}02-1C {s}03-{signal} {s}05-1C {s}05-{signal}");
        assert_eq!(names(&epochs[0]), expected);
        let has: Vec<_> = epochs[0]
            .observations
            .iter()
            .map(|o| (o.pseudorange_m.is_some(), o.carrier_phase_cycles.is_some(), o.cn0_dbhz.is_some()))
            .collect();
        let (code, all) = ((true, false, true), (true, true, true));
        assert_eq!(has, [code, code, (true, true, false), all, all, (false, true, true)]);
        assert_eq!(skips.count(Reason::L1PseudorangeNotValid), 1, "{skips}");
        assert_eq!(skips.count(Reason::PseudorangeBeyondModulus), 1, "{skips}");
        assert_eq!(skips.total(), 2, "{skips}");
    }
}

#[test]
fn satellites_that_are_none_are_counted() {
    let of = |number| Sent { number, ..SENT };
    let numbers = [0, 1, 32, 33, 39, 40, 58, 59, 63].map(of);
    let (gps, skips) = epochs(&[message(1_002, 0, 0, &numbers)]);
    assert_eq!(names(&gps[0]), "G01-1C G32-1C");
    assert_eq!(skips.count(Reason::SbasObservationsNotUsed), 2, "{skips}");
    assert_eq!(skips.count(Reason::ReservedSatelliteNumber), 5, "{skips}");
    let near = Sent { ambiguity: 3, ..of(4) };
    let (glonass, skips) = epochs(&[message(1_010, 0, 0, &[of(0), of(1), of(24), of(38), near])]);
    assert_eq!(names(&glonass[0]), "R01-1C R24-1C R04-1C");
    let nearer = Sent { ambiguity: 1, ..near };
    assert_eq!(epochs(&[message(1_010, 0, 0, &[nearer])]).1.count(Reason::PseudorangeTooShort), 1);
    assert_eq!(skips.count(Reason::GlonassSatelliteUnknownSlot), 1, "{skips}");
    assert_eq!(skips.count(Reason::SbasObservationsNotUsed), 1, "{skips}");
}

#[test]
fn a_channel_is_learnt_and_a_reserved_one_is_not() {
    let reserved = Sent { channel: 21, ..SENT };
    let frames =
        [message(1_012, 0, 0, &[reserved]), message(1_012, 1, 0, &[SENT]), message(1_012, 2, 0, &[reserved])];
    let mut decoder = RtcmDecoder::new(RtcmOptions::near(NOW.parse().unwrap()));
    decoder.feed(&frames.concat()).unwrap();
    // GLONASS alone waits for the time of the week.
    decoder.finish().unwrap();
    assert_eq!(decoder.glonass_channels().get(&7), Some(&5));
    let phases: Vec<_> = std::iter::from_fn(|| decoder.next_record())
        .map(|record| match record {
            Record::Epoch(epoch) => epoch.observations[0].carrier_phase_cycles.is_some(),
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(phases, [false, true, true]);
    assert_eq!(decoder.skips().count(Reason::PhaseWithoutGlonassChannel), 2);
}

/// Of a phase whose channel is not known nothing is left where the message has nothing else of the signal.
#[test]
fn a_phase_alone_without_a_channel_is_no_observation() {
    let second = Second { code: NO_CODE, cn0: 0, ..SENT.second };
    let (epochs, skips) = epochs(&[message(1_012, 0, 0, &[Sent { channel: 21, second, ..SENT }])]);
    assert_eq!(epochs[0].observations.len(), 1, "{epochs:?}");
    assert_eq!(skips.count(Reason::PhaseWithoutGlonassChannel), 2, "{skips}");
}

/// The indicator counts seconds first.
#[test]
fn lock_times_tell_slips() {
    let at = |seconds, first, second| {
        let second = Second { lock: second, ..SENT.second };
        message(1_004, seconds, 0, &[Sent { lock: first, second, ..SENT }])
    };
    let (epochs, skips) = epochs(&[at(0, 10, 0), at(1, 11, 0), at(2, 5, 1), at(10, 5, 9), at(11, 6, 10)]);
    assert!(skips.is_empty(), "{skips}");
    let slips: Vec<_> = epochs
        .iter()
        .map(|epoch| {
            (epoch.observations[0].loss_of_lock.cycle_slip, epoch.observations[1].loss_of_lock.cycle_slip)
        })
        .collect();
    assert_eq!(slips, [(false, false), (false, true), (true, false), (true, false), (false, false)]);
}

/// Code and phase diverge slowly; what is sent of them is brought back by 1500 cycles again and again, which must not show.
#[test]
fn rollovers_of_the_phase_are_undone_until_the_lock_is_lost() {
    let wavelengths = [SPEED_OF_LIGHT_MPS / 1_575.42e6, SPEED_OF_LIGHT_MPS / 1_227.6e6];
    let rolled = |difference_m: f64, wavelength_m: f64| {
        let mut difference_m = difference_m;
        while difference_m < -262.0 {
            difference_m += 1_500.0 * wavelength_m;
        }
        raw(difference_m, 0.000_5)
    };
    let drift = |seconds: u32| -f64::from(seconds) * 2.5;
    let at = |seconds: u32, lock| {
        let [first, second] = wavelengths.map(|wavelength_m| rolled(drift(seconds), wavelength_m));
        let second = Second { phase: second, lock, ..SENT.second };
        message(1_004, seconds, 0, &[Sent { phase: first, lock, second, ..SENT }])
    };
    let held: Vec<_> = (0..500).map(|seconds| at(seconds, 127)).chain([at(500, 0)]).collect();
    let (epochs, skips) = epochs(&held);
    assert!(skips.is_empty(), "{skips}");
    let range_m = 70.0 * LIGHT_MS_M + 1_000.0;
    let (last, before) = epochs.split_last().unwrap();
    for (seconds, epoch) in (0..).zip(before) {
        for (o, wavelength_m) in epoch.observations.iter().zip(wavelengths) {
            close(o.carrier_phase_cycles, (range_m + drift(seconds)) / wavelength_m, 0.000_26 / wavelength_m);
            assert!(!o.loss_of_lock.cycle_slip);
        }
    }
    for (o, wavelength_m) in last.observations.iter().zip(wavelengths) {
        let sent_m = rolled(drift(500), wavelength_m) as f64 * 0.000_5;
        close(o.carrier_phase_cycles, (range_m + sent_m) / wavelength_m, 1e-5);
        assert!(o.loss_of_lock.cycle_slip);
    }
}

#[test]
fn messages_without_whole_milliseconds_are_counted_with_the_reason() {
    for number in [1_001, 1_003, 1_009, 1_011] {
        let (epochs, skips) = epochs(&[message(number, 0, 0, &[SENT]), message(number, 1, 0, &[SENT])]);
        assert!(epochs.is_empty());
        let reason = format!("message {number} is not used: pseudoranges without whole milliseconds");
        assert_eq!((skips.total(), skips.count(&reason)), (2, 2), "{skips}");
    }
}

#[test]
fn messages_cut_short_and_impossible_times_are_counted() {
    for number in [1_002, 1_004, 1_010, 1_012] {
        let whole = message(number, 0, 0, &[SENT, Sent { number: 8, ..SENT }]);
        let content = &whole[3..whole.len() - 3];
        for length in 2..content.len() {
            let (records, skips) = decode(&[&frame_of(&content[..length])]);
            assert!(records.is_empty(), "{number}: {length} of {} bytes", content.len());
            assert_eq!(skips.count(Reason::MessageTooShort), 1, "{length}: {skips}");
        }
        let late = write(number, if is_glonass(number) { 86_401_000 } else { 604_800_000 }, 0, &[SENT]);
        let (records, skips) = decode(&[&late.frame()]);
        assert!(records.is_empty() && skips.count(Reason::MessageImpossibleTime) == 1, "{skips}");
    }
}

/// Satellite 7 by MSM4, on L1 C/A and L2 Z-tracking, with the pseudorange of `SENT`.
fn msm(seconds: u32, more: u8) -> Vec<u8> {
    let range_ms = 70.0 + 1_000.0 / LIGHT_MS_M;
    let rough = (range_ms % 1.0 * 1_024.0).floor() / 1_024.0;
    frame(&Message::Msg1074(Msg1074T {
        gps_epoch_time_ms: TOW_MS + seconds * 1_000,
        msm_multiple_message_flag: more,
        data_segment: Msg1074Data {
            satellite_data: list([Msm46Sat {
                satellite_id: 7,
                gnss_satellite_rough_range_integer_ms: Some(70),
                gnss_satellite_rough_range_mod1ms_ms: rough,
            }]),
            signal_data: list([GpsSigId::new(1, 'C'), GpsSigId::new(2, 'W')].map(|signal_id| Msg1074Sig {
                satellite_id: 7,
                signal_id,
                gnss_signal_fine_pseudorange_ms: Some(range_ms - 70.0 - rough),
                gnss_signal_fine_phaserange_ms: Some(0.0),
                gnss_phaserange_lock_time_ind: 15,
                ..Msg1074Sig::default()
            })),
        },
        ..Msg1074T::default()
    }))
}

/// The other satellite has legacy observations alone.
#[test]
fn multiple_signal_messages_outrank_legacy_ones_of_the_same_epoch() {
    let both = [SENT, Sent { number: 8, ..SENT }];
    let legacy_first = [message(1_004, 0, 1, &both), msm(0, 0)];
    let legacy_last = [msm(0, 1), message(1_004, 0, 0, &both)];
    for (frames, expected) in
        [(legacy_first, "G08-1C G08-2X G07-1C G07-2W"), (legacy_last, "G07-1C G07-2W G08-1C G08-2X")]
    {
        let (epochs, skips) = epochs(&frames);
        assert_eq!(epochs.iter().map(names).collect::<Vec<_>>(), [expected]);
        assert_eq!((skips.total(), skips.count(Reason::LegacyObservationOutranked)), (2, 2), "{skips}");
    }
}

/// The first epoch is given out with its legacy message; where the kind of message changes, phases may have a step.
#[test]
fn a_stream_that_marks_the_legacy_message_as_the_last_costs_one_message() {
    let frames: Vec<_> = (0..4).flat_map(|s| [message(1_004, s, 0, &[SENT]), msm(s, 0)]).collect();
    let (epochs, skips) = epochs(&frames);
    let named: Vec<_> = epochs.iter().map(names).collect();
    assert_eq!(named, ["G07-1C G07-2X", "G07-1C G07-2W", "G07-1C G07-2W", "G07-1C G07-2W"]);
    let slips: Vec<_> = epochs.iter().map(|e| e.observations[0].loss_of_lock.cycle_slip).collect();
    assert_eq!(slips, [false, true, false, false]);
    assert_eq!(skips.count(Reason::MessageAfterLastOfEpoch), 1, "{skips}");
    assert_eq!((skips.total(), skips.count(Reason::LegacyObservationOutranked)), (7, 6), "{skips}");
}

#[test]
fn a_legacy_message_after_the_last_multiple_signal_message_costs_nothing() {
    let frames: Vec<_> = (0..3).flat_map(|s| [msm(s, 0), message(1_004, s, 0, &[SENT])]).collect();
    let (epochs, skips) = epochs(&frames);
    assert_eq!(epochs.iter().map(names).collect::<Vec<_>>(), ["G07-1C G07-2W"; 3]);
    assert_eq!((skips.total(), skips.count(Reason::LegacyObservationOutranked)), (6, 6), "{skips}");
}
