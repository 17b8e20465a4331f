//! Streams written by another implementation (rtcm-rs), and damage to them.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

mod rtcm_support;

use cofix_common::constants::SPEED_OF_LIGHT_MPS;
use cofix_common::formats::decode::{Decoder, Record};
use cofix_common::formats::rtcm::{RtcmDecoder, RtcmOptions};
use cofix_common::gnss::{Observation, ObservationEpoch};
use cofix_common::skips::{Reason, Skips};
use cofix_common::time::GpsTime;
use proptest::prelude::*;
use rtcm_rs::Message;
use rtcm_rs::msg::{
    BdsSigId, GalSigId, GloSigId, GpsSigId, Msg1005T, Msg1020T, Msg1074Data, Msg1074Sig, Msg1074T,
    Msg1077Data, Msg1077Sig, Msg1077T, Msg1084Data, Msg1084Sig, Msg1084T, Msg1087Data, Msg1087Sig, Msg1087T,
    Msg1095Data, Msg1095Sig, Msg1095T, Msg1107T, Msg1117Data, Msg1117Sig, Msg1117T, Msg1125Data, Msg1125Sig,
    Msg1125T, Msm46Sat, Msm57GloSat, Msm57Sat, QzssSigId,
};
use rtcm_rs::util::DataVec;
use rtcm_support::{NOW, TOW_MS, decode, frame, frame_of, lnav, number};

fn list<T: Default + Clone, const N: usize>(items: impl IntoIterator<Item = T>) -> DataVec<T, N> {
    let mut list = DataVec::new();
    items.into_iter().for_each(|item| list.push(item));
    list
}

fn epochs(frames: &[Vec<u8>]) -> (Vec<ObservationEpoch>, Skips) {
    let (records, skips) = decode(&[&frames.concat()]);
    let epochs = records.into_iter().filter_map(|record| match record {
        Record::Epoch(epoch) => Some(epoch),
        Record::Ephemeris(_) | Record::Glonass(_) | Record::Event(_) => None,
    });
    (epochs.collect(), skips)
}

fn names(epoch: &ObservationEpoch) -> String {
    let name = |o: &Observation| format!("{}-{}", o.satellite, o.signal);
    epoch.observations.iter().map(name).collect::<Vec<_>>().join(" ")
}

fn close(value: Option<f64>, expected: f64, tolerance: f64) {
    assert!((value.expect("a value") - expected).abs() <= tolerance, "{value:?} is not {expected}");
}

fn gps(time_ms: u32, more: u8) -> Message {
    let satellite = |satellite_id, whole, fraction, rate| Msm57Sat {
        satellite_id,
        gnss_satellite_rough_range_integer_ms: whole,
        gnss_satellite_rough_range_mod1ms_ms: fraction,
        gnss_satellite_rough_phaserange_rates_m_s: rate,
        ..Msm57Sat::default()
    };
    let signal = |satellite_id, signal_id| Msg1077Sig {
        satellite_id,
        signal_id,
        gnss_signal_fine_pseudorange_ext_ms: Some(3e-4),
        gnss_signal_fine_phaserange_ext_ms: Some(-2e-4),
        gnss_phaserange_lock_time_ext_ind: 704,
        half_cycle_ambiguity_ind: 0,
        gnss_signal_cnr_ext_dbhz: Some(43.5),
        gnss_signal_fine_phaserange_rate_m_s: Some(-0.1234),
    };
    let empty = Msg1077Sig {
        gnss_signal_fine_phaserange_ext_ms: None,
        gnss_signal_cnr_ext_dbhz: None,
        gnss_signal_fine_phaserange_rate_m_s: None,
        half_cycle_ambiguity_ind: 1,
        ..signal(31, GpsSigId::new(5, 'Q'))
    };
    Message::Msg1077(Msg1077T {
        gps_epoch_time_ms: time_ms,
        msm_multiple_message_flag: more,
        data_segment: Msg1077Data {
            satellite_data: list([
                satellite(7, Some(70), 0.5, Some(-321)),
                satellite(12, None, 0.25, None),
                satellite(31, Some(81), 0.0, Some(5)),
            ]),
            signal_data: list([
                signal(7, GpsSigId::new(1, 'C')),
                signal(7, GpsSigId::new(5, 'Q')),
                signal(12, GpsSigId::new(1, 'C')),
                empty,
            ]),
        },
        ..Msg1077T::default()
    })
}

fn beidou(time_ms: u32, more: u8) -> Message {
    Message::Msg1125(Msg1125T {
        bds_epoch_time_ms: time_ms,
        msm_multiple_message_flag: more,
        data_segment: Msg1125Data {
            satellite_data: list([Msm57Sat {
                satellite_id: 21,
                gnss_satellite_rough_range_integer_ms: Some(120),
                ..Msm57Sat::default()
            }]),
            signal_data: list([Msg1125Sig {
                satellite_id: 21,
                signal_id: BdsSigId::new(2, 'I'),
                gnss_signal_fine_pseudorange_ms: Some(0.0),
                ..Msg1125Sig::default()
            }]),
        },
        ..Msg1125T::default()
    })
}

#[test]
fn ranges_rates_and_strengths_have_their_scales() {
    let (epochs, skips) = epochs(&[frame(&gps(TOW_MS, 0))]);
    assert!(skips.is_empty(), "{skips}");
    let [epoch] = epochs.as_slice() else { panic!("{epochs:?}") };
    assert_eq!(epoch.time_gps, NOW.parse().unwrap());
    assert_eq!(names(epoch), "G07-1C G07-5Q G12-1C G31-5Q");
    let millis = SPEED_OF_LIGHT_MPS / 1e3;
    let half_unit = millis / f64::powi(2.0, 30);
    for (observation, frequency) in epoch.observations.iter().zip([1_575.42e6, 1_176.45e6]) {
        close(observation.pseudorange_m, (70.5 + 3e-4) * millis, half_unit);
        close(
            observation.carrier_phase_cycles,
            (70.5 - 2e-4) * 1e-3 * frequency,
            half_unit * frequency / SPEED_OF_LIGHT_MPS,
        );
        close(observation.doppler_hz, 321.1234 * frequency / SPEED_OF_LIGHT_MPS, 1e-9);
        close(observation.cn0_dbhz, 43.5, 0.0);
        assert!(!observation.loss_of_lock.cycle_slip && !observation.loss_of_lock.half_cycle);
    }
    let without_range = epoch.observations[2];
    assert_eq!((without_range.pseudorange_m, without_range.carrier_phase_cycles), (None, None));
    assert_eq!((without_range.doppler_hz, without_range.cn0_dbhz), (None, Some(43.5)));
    let code_only = epoch.observations[3];
    assert!(code_only.pseudorange_m.is_some() && code_only.carrier_phase_cycles.is_none());
    assert_eq!((code_only.doppler_hz, code_only.cn0_dbhz), (None, None));
    assert!(!code_only.loss_of_lock.half_cycle, "there is no phase that it could concern");
}

#[test]
fn messages_of_an_instant_become_one_epoch() {
    let beidou_ms = TOW_MS - 14_000;
    let two = [
        frame(&gps(TOW_MS, 1)),
        frame(&beidou(beidou_ms, 0)),
        frame(&gps(TOW_MS + 1_000, 1)),
        frame(&beidou(beidou_ms + 1_000, 0)),
    ];
    let (by_bit, skips) = epochs(&two);
    assert!(skips.is_empty(), "{skips}");
    assert_eq!(by_bit.iter().map(names).collect::<Vec<_>>(), vec!["G07-1C G07-5Q G12-1C G31-5Q C21-2I"; 2]);
    assert_eq!(by_bit[1].time_gps - by_bit[0].time_gps, 1.0);
    // Without a last message the next instant ends the epoch, and the stream's end the last one.
    let (by_time, skips) = epochs(&[two[0].clone(), two[2].clone()]);
    assert_eq!((skips.total(), skips.count(Reason::LastEpochLacksMessages)), (1, 1), "{skips}");
    assert_eq!(by_time.iter().map(names).collect::<Vec<_>>(), vec!["G07-1C G07-5Q G12-1C G31-5Q"; 2]);
}

#[test]
fn a_stream_that_marks_every_message_as_the_last_costs_one_message() {
    let beidou_ms = TOW_MS - 14_000;
    let frames: Vec<_> = (0..4)
        .flat_map(|i| [gps(TOW_MS + i * 1_000, 0), beidou(beidou_ms + i * 1_000, 0)])
        .map(|message| frame(&message))
        .collect();
    let (epochs, skips) = epochs(&frames);
    let sizes: Vec<_> = epochs.iter().map(|epoch| epoch.observations.len()).collect();
    assert_eq!(sizes, [4, 5, 5, 5], "{skips}");
    assert_eq!((skips.total(), skips.count(Reason::MessageAfterLastOfEpoch)), (1, 1), "{skips}");
}

#[test]
fn late_and_repeated_messages_are_counted_and_a_stream_set_back_goes_on() {
    let at = |seconds: u32| frame(&gps(TOW_MS + seconds * 1_000, 0));
    let (good, skips) = epochs(&[at(0), at(0), at(5), at(4), at(6)]);
    assert_eq!(good.len(), 3);
    assert_eq!(skips.count(Reason::MessageRepeated), 1, "{skips}");
    assert_eq!(skips.count(Reason::MessageOlderThanEpoch), 1, "{skips}");
    // One wrong time within the stream costs its message.
    let jump: Vec<_> = (0..5).chain([5_000]).chain(5..30).map(at).collect();
    let (good, skips) = epochs(&jump);
    assert!(good.is_sorted_by(|a, b| a.time_gps < b.time_gps), "{skips}");
    assert_eq!((good.len(), skips.count(Reason::MessageFarAhead)), (30, 1), "{skips}");
    // At the beginning it is the stream that is set back.
    let back: Vec<_> = std::iter::once(at(5_000)).chain((0..30).map(at)).collect();
    let (good, skips) = epochs(&back);
    assert_eq!(good.len(), 1 + 20, "{skips}");
    assert_eq!(skips.count(Reason::StreamTimeSteppedBack), 1, "{skips}");
}

#[test]
fn glonass_phase_needs_the_channel_that_other_messages_tell() {
    // 14:19:53 GPST is 17:19:35 in Moscow on day 4.
    let time_ms = ((17 * 60 + 19) * 60 + 35) * 1_000;
    let coarse = |time_ms| {
        frame(&Message::Msg1084(Msg1084T {
            glo_day_of_week: Some(4),
            glo_epoch_time_ms: time_ms,
            data_segment: Msg1084Data {
                satellite_data: list([Msm46Sat {
                    satellite_id: 3,
                    gnss_satellite_rough_range_integer_ms: Some(66),
                    ..Msm46Sat::default()
                }]),
                signal_data: list([Msg1084Sig {
                    satellite_id: 3,
                    signal_id: GloSigId::new(1, 'C'),
                    gnss_signal_fine_pseudorange_ms: Some(0.0),
                    gnss_signal_fine_phaserange_ms: Some(0.0),
                    ..Msg1084Sig::default()
                }]),
            },
            ..Msg1084T::default()
        }))
    };
    let fine = frame(&Message::Msg1087(Msg1087T {
        glo_day_of_week: Some(4),
        glo_epoch_time_ms: time_ms + 1_000,
        data_segment: Msg1087Data {
            satellite_data: list([Msm57GloSat {
                satellite_id: 3,
                gnss_satellite_rough_range_integer_ms: Some(66),
                glonass_satellite_frequency_channel_number: Some(5),
                gnss_satellite_rough_phaserange_rates_m_s: Some(100),
                ..Msm57GloSat::default()
            }]),
            signal_data: list([Msg1087Sig {
                satellite_id: 3,
                signal_id: GloSigId::new(1, 'C'),
                gnss_signal_fine_pseudorange_ext_ms: Some(0.0),
                gnss_signal_fine_phaserange_ext_ms: Some(0.0),
                gnss_signal_fine_phaserange_rate_m_s: Some(0.0),
                ..Msg1087Sig::default()
            }]),
        },
        ..Msg1087T::default()
    }));
    let (epochs, skips) = epochs(&[coarse(time_ms), fine, coarse(time_ms + 2_000)]);
    assert_eq!(epochs.len(), 3);
    assert_eq!(epochs[0].time_gps, NOW.parse().unwrap());
    let phases: Vec<_> = epochs.iter().map(|e| e.observations[0].carrier_phase_cycles).collect();
    assert_eq!(phases[0], None);
    let frequency = 1_602e6 + 5.0 * 562_500.0;
    close(phases[1], 0.066 * frequency, 1e-6);
    close(phases[2], 0.066 * frequency, 1e-6);
    close(epochs[1].observations[0].doppler_hz, -100.0 * frequency / SPEED_OF_LIGHT_MPS, 1e-9);
    assert_eq!(skips.count(Reason::PhaseWithoutGlonassChannel), 1, "{skips}");
}

#[test]
fn the_other_systems_have_their_names() {
    let qzss = Message::Msg1117(Msg1117T {
        qzss_epoch_time_ms: TOW_MS,
        msm_multiple_message_flag: 1,
        data_segment: Msg1117Data {
            satellite_data: list([Msm57Sat {
                satellite_id: 2,
                gnss_satellite_rough_range_integer_ms: Some(125),
                ..Msm57Sat::default()
            }]),
            signal_data: list([Msg1117Sig {
                satellite_id: 2,
                signal_id: QzssSigId::new(5, 'X'),
                gnss_signal_fine_pseudorange_ext_ms: Some(0.0),
                ..Msg1117Sig::default()
            }]),
        },
        ..Msg1117T::default()
    });
    let galileo = Message::Msg1095(Msg1095T {
        gal_epoch_time_ms: TOW_MS,
        data_segment: Msg1095Data {
            satellite_data: list([Msm57Sat {
                satellite_id: 36,
                gnss_satellite_rough_range_integer_ms: Some(80),
                ..Msm57Sat::default()
            }]),
            signal_data: list([Msg1095Sig {
                satellite_id: 36,
                signal_id: GalSigId::new(7, 'Q'),
                gnss_signal_fine_pseudorange_ms: Some(0.0),
                ..Msg1095Sig::default()
            }]),
        },
        ..Msg1095T::default()
    });
    let (epochs, skips) = epochs(&[frame(&qzss), frame(&galileo)]);
    assert!(skips.is_empty(), "{skips}");
    assert_eq!(names(&epochs[0]), "J02-5X E36-7Q");
}

#[test]
fn what_is_not_read_is_counted_by_its_number() {
    let sbas = Message::Msg1107(Msg1107T {
        data_segment: rtcm_rs::msg::Msg1107Data {
            satellite_data: list([Msm57Sat { satellite_id: 1, ..Msm57Sat::default() }]),
            signal_data: list([rtcm_rs::msg::Msg1107Sig {
                satellite_id: 1,
                signal_id: rtcm_rs::msg::SbasSigId::new(1, 'C'),
                ..rtcm_rs::msg::Msg1107Sig::default()
            }]),
        },
        ..Msg1107T::default()
    });
    let station = Message::Msg1005(Msg1005T::default());
    let glonass = Message::Msg1020(Msg1020T { glo_m_n4_year: 1996, ..Msg1020T::default() });
    let (_, skips) = decode(&[&[
        frame(&sbas),
        frame(&station),
        frame(&station),
        frame(&glonass),
        frame_of(&number(1013)),
        frame_of(&[]),
    ]
    .concat()]);
    assert_eq!(skips.count(Reason::SbasObservationsNotUsed), 1, "{skips}");
    assert_eq!(skips.count(Reason::StationPositionImpossible), 2, "the Earth's centre: {skips}");
    assert_eq!(skips.count(Reason::EphemerisImpossible), 1, "{skips}");
    assert_eq!(skips.count("message 1013 is not read"), 1, "{skips}");
    assert_eq!(skips.count(Reason::FrameWithoutMessage), 1, "{skips}");
    assert_eq!(skips.total(), 6, "{skips}");
}

/// More cells than are allowed, reserved signals, and messages cut short have valid checksums all the same.
#[test]
fn impossible_messages_in_valid_frames_are_counted() {
    let mut content = vec![0xff; 1_000];
    content[..2].copy_from_slice(&number(1077));
    let (records, skips) = decode(&[&frame_of(&content)]);
    assert!(records.is_empty());
    assert_eq!(skips.count(Reason::MessageWithTooManySignals), 1, "{skips}");
    let whole = frame(&gps(TOW_MS, 0));
    let content = &whole[3..whole.len() - 3];
    for length in 2..content.len() {
        let (records, skips) = decode(&[&frame_of(&content[..length])]);
        assert!(records.is_empty(), "{length} of {} bytes", content.len());
        assert_eq!(skips.count(Reason::MessageTooShort), 1, "{length}: {skips}");
    }
    let (records, skips) = decode(&[&frame(&gps(604_800_000, 0))]);
    assert!(records.is_empty() && skips.count(Reason::MessageImpossibleTime) == 1, "{skips}");
}

/// A signal that the standard reserves costs that signal alone.
#[test]
fn a_reserved_signal_does_not_cost_the_message() {
    let message = Message::Msg1074(Msg1074T {
        gps_epoch_time_ms: TOW_MS,
        data_segment: Msg1074Data {
            satellite_data: list([Msm46Sat {
                satellite_id: 7,
                gnss_satellite_rough_range_integer_ms: Some(70),
                ..Msm46Sat::default()
            }]),
            signal_data: list(['C', 'W'].map(|attribute| Msg1074Sig {
                satellite_id: 7,
                signal_id: GpsSigId::new(1, attribute),
                gnss_signal_fine_pseudorange_ms: Some(0.0),
                ..Msg1074Sig::default()
            })),
        },
        ..Msg1074T::default()
    });
    let whole = frame(&message);
    let mut content = whole[3..whole.len() - 3].to_vec();
    // The signal mask follows 73 + 64 bits: 1W is its fourth bit, 5 is reserved.
    let bit = |number: usize| 73 + 64 + number - 1;
    content[bit(4) / 8] &= !(0x80 >> (bit(4) % 8));
    content[bit(5) / 8] |= 0x80 >> (bit(5) % 8);
    let (epochs, skips) = epochs(&[frame_of(&content)]);
    assert_eq!(names(&epochs[0]), "G07-1C");
    assert_eq!(skips.count(Reason::ReservedSignalNumber), 1, "{skips}");
}

#[test]
fn another_kind_of_stream_is_refused() {
    let mut decoder = RtcmDecoder::new(RtcmOptions::near(GpsTime::default()));
    assert!(decoder.feed(&[b'x'; 1_000]).is_ok());
    assert!(decoder.finish().unwrap_err().to_string().contains("no RTCM 3 frame"));
    let mut decoder = RtcmDecoder::new(RtcmOptions::near(GpsTime::default()));
    assert!(decoder.feed(&vec![0xd3; 100_000]).is_err());
    let mut empty = RtcmDecoder::new(RtcmOptions::near(GpsTime::default()));
    assert!(empty.feed(&[]).is_ok() && empty.finish().is_ok());
}

/// A stream of all kinds of messages, as its frames.
fn all_kinds() -> Vec<Vec<u8>> {
    let mut frames = vec![frame(&Message::Msg1019(lnav())), frame(&Message::Msg1005(Msg1005T::default()))];
    for second in 0..3 {
        let time_ms = TOW_MS + second * 1_000;
        frames.push(frame(&gps(time_ms, 1)));
        frames.push(frame(&beidou(time_ms - 14_000, 0)));
    }
    frames
}

/// Cuts a stream into portions of the given sizes, repeated.
fn portions<'a>(mut stream: &'a [u8], sizes: &[usize]) -> Vec<&'a [u8]> {
    let mut portions = Vec::new();
    for size in sizes.iter().cycle() {
        if stream.is_empty() {
            break;
        }
        let (portion, rest) = stream.split_at((*size).min(stream.len()));
        portions.push(portion);
        stream = rest;
    }
    portions
}

fn noise() -> impl Strategy<Value = Vec<u8>> {
    // Preambles with plausible lengths are the nastiest noise.
    let false_start = (0_u8..4, any::<u8>()).prop_map(|(high, low)| vec![0xd3, high, low]);
    let piece = prop_oneof![
        proptest::collection::vec(any::<u8>(), 0..40),
        false_start,
        Just(vec![0xd3]),
        Just(vec![0xd3, 0x00])
    ];
    proptest::collection::vec(piece, 0..4).prop_map(|pieces| pieces.concat())
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(500) })]

    #[test]
    fn noise_between_frames_loses_no_frame(
        noises in proptest::collection::vec(noise(), 9),
        sizes in proptest::collection::vec(1..200_usize, 1..8),
    ) {
        let frames = all_kinds();
        let (clean, _) = decode(&[&frames.concat()]);
        let mut stream = Vec::new();
        let mut outside = 0;
        for (index, noise) in noises.iter().enumerate() {
            stream.extend_from_slice(noise);
            outside += noise.len() as u64;
            stream.extend_from_slice(frames.get(index).map_or(&[], Vec::as_slice));
        }
        let (noisy, skips) = decode(&portions(&stream, &sizes));
        prop_assert_eq!(noisy, clean);
        // One message is of a kind that is not read.
        prop_assert_eq!(skips.total(), outside + 1);
    }

    #[test]
    fn damaged_streams_never_panic_and_portions_do_not_matter(
        damages in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0..3_u8), 0..6),
        sizes in proptest::collection::vec(1..300_usize, 1..8),
    ) {
        let mut stream = all_kinds().concat();
        for (at, value, kind) in damages {
            let at = at.index(stream.len());
            match kind {
                0 => stream[at] ^= value,
                1 => stream.insert(at, value),
                _ => stream.truncate(at.max(1)),
            }
        }
        let whole = decode(&[&stream]);
        prop_assert_eq!(decode(&portions(&stream, &sizes)), whole);
    }

    #[test]
    fn any_content_in_a_valid_frame_is_survived(
        kind in prop_oneof![1_070..1_138_u16, 1_001..1_013_u16, Just(1_019), Just(1_020), Just(1_042), 1_044..1_047_u16],
        mut content in proptest::collection::vec(any::<u8>(), 2..400),
        sparse: bool,
        nanos: i64,
    ) {
        content[..2].copy_from_slice(&number(kind));
        if sparse {
            // Few satellites and signals, so that the cells are in bounds.
            for byte in content.iter_mut().skip(9).take(14) {
                *byte &= 0x11;
            }
        }
        let mut decoder = RtcmDecoder::new(RtcmOptions { near: GpsTime::from_nanos(nanos), leap_seconds: 18 });
        decoder.feed(&frame_of(&content)).unwrap();
        decoder.finish().unwrap();
        while let Some(record) = decoder.next_record() {
            if let Record::Epoch(epoch) = record {
                for o in &epoch.observations {
                    prop_assert!(o.pseudorange_m.is_none_or(|p| (1e6..1e9).contains(&p)), "{:?}", o);
                    prop_assert!(o.carrier_phase_cycles.is_none_or(f64::is_finite));
                    prop_assert!(o.doppler_hz.is_none_or(|d| d.abs() < 5e4));
                }
            }
        }
    }
}
