//! Streams written by another implementation (rtcm-rs), and damage to them.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

use std::f64::consts::PI;

use cofix_common::constants::SPEED_OF_LIGHT_MPS;
use cofix_common::decode::{Decoder, Record};
use cofix_common::gnss::{Observation, ObservationEpoch};
use cofix_common::orbit::{KeplerEphemeris, NavigationMessage, is_healthy};
use cofix_common::rtcm::{RtcmDecoder, RtcmOptions};
use cofix_common::skips::Skips;
use cofix_common::time::GpsTime;
use proptest::prelude::*;
use rtcm_rs::msg::{
    BdsSigId, GalSigId, GloSigId, GpsSigId, Msg1005T, Msg1019T, Msg1020T, Msg1042T, Msg1044T, Msg1045T,
    Msg1046T, Msg1074Data, Msg1074Sig, Msg1074T, Msg1077Data, Msg1077Sig, Msg1077T, Msg1084Data, Msg1084Sig,
    Msg1084T, Msg1087Data, Msg1087Sig, Msg1087T, Msg1095Data, Msg1095Sig, Msg1095T, Msg1107T, Msg1117Data,
    Msg1117Sig, Msg1117T, Msg1125Data, Msg1125Sig, Msg1125T, Msm46Sat, Msm57GloSat, Msm57Sat, QzssSigId,
};
use rtcm_rs::util::DataVec;
use rtcm_rs::{Message, MessageBuilder};

/// A Thursday, second 397193 of week 2118.
const NOW: &str = "2020-08-13T14:19:53";
const TOW_MS: u32 = 397_193_000;

fn frame(message: &Message) -> Vec<u8> {
    MessageBuilder::new().build_message(message).unwrap().to_vec()
}

/// A frame of any content.
fn frame_of(content: &[u8]) -> Vec<u8> {
    let length = u16::try_from(content.len()).unwrap().to_be_bytes();
    let mut frame = [&[0xd3][..], &length, content].concat();
    let mut crc = 0_u32;
    for byte in &frame {
        crc ^= u32::from(*byte) << 16;
        for _ in 0..8 {
            crc = if crc & 0x80_0000 == 0 { crc << 1 } else { crc << 1 ^ 0x186_4cfb };
        }
    }
    frame.extend_from_slice(&crc.to_be_bytes()[1..]);
    frame
}

fn list<T: Default + Clone, const N: usize>(items: impl IntoIterator<Item = T>) -> DataVec<T, N> {
    let mut list = DataVec::new();
    items.into_iter().for_each(|item| list.push(item));
    list
}

/// Everything that comes out of portions of a stream.
fn decode(portions: &[&[u8]]) -> (Vec<Record>, Skips) {
    let mut decoder = RtcmDecoder::new(RtcmOptions::near(NOW.parse().unwrap()));
    let mut records = Vec::new();
    for portion in portions {
        let outcome = decoder.feed(portion);
        records.extend(std::iter::from_fn(|| decoder.next_record()));
        if outcome.is_err() {
            return (records, decoder.skips().clone());
        }
    }
    let _ = decoder.finish();
    records.extend(std::iter::from_fn(|| decoder.next_record()));
    (records, decoder.skips().clone())
}

fn epochs(frames: &[Vec<u8>]) -> (Vec<ObservationEpoch>, Skips) {
    let (records, skips) = decode(&[&frames.concat()]);
    let epochs = records.into_iter().filter_map(|record| match record {
        Record::Epoch(epoch) => Some(epoch),
        Record::Ephemeris(_) => None,
    });
    (epochs.collect(), skips)
}

fn ephemeris(message: &Message) -> KeplerEphemeris {
    match decode(&[&frame(message)]) {
        (records, skips) if skips.is_empty() => match records.as_slice() {
            [Record::Ephemeris(ephemeris)] => **ephemeris,
            other => panic!("{other:?}"),
        },
        (_, skips) => panic!("{skips}"),
    }
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
    let two = [gps(TOW_MS, 1), beidou(beidou_ms, 0), gps(TOW_MS + 1_000, 1), beidou(beidou_ms + 1_000, 0)];
    let two: Vec<_> = two.iter().map(frame).collect();
    let (by_bit, skips) = epochs(&two);
    assert!(skips.is_empty(), "{skips}");
    assert_eq!(by_bit.iter().map(names).collect::<Vec<_>>(), vec!["G07-1C G07-5Q G12-1C G31-5Q C21-2I"; 2]);
    assert_eq!(by_bit[1].time_gps - by_bit[0].time_gps, 1.0);
    // Without a last message the next instant ends the epoch, and the stream's end the last one.
    let (by_time, skips) = epochs(&[two[0].clone(), two[2].clone()]);
    assert!(skips.is_empty(), "{skips}");
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
    assert_eq!(
        (skips.total(), skips.count("message after the one marked as its epoch's last")),
        (1, 1),
        "{skips}"
    );
}

#[test]
fn late_and_repeated_messages_are_counted_and_a_stream_set_back_goes_on() {
    let at = |seconds: u32| frame(&gps(TOW_MS + seconds * 1_000, 0));
    let (good, skips) = epochs(&[at(0), at(0), at(5), at(4), at(6)]);
    assert_eq!(good.len(), 3);
    assert_eq!(skips.count("message repeated"), 1, "{skips}");
    assert_eq!(skips.count("message older than the epoch before it"), 1, "{skips}");
    let back: Vec<_> = std::iter::once(at(5_000)).chain((0..30).map(at)).collect();
    let (good, skips) = epochs(&back);
    assert_eq!(good.len(), 1 + 20, "{skips}");
    assert_eq!(skips.count("the stream's time stepped back"), 1, "{skips}");
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
    assert_eq!(skips.count("phase and Doppler without a known GLONASS channel"), 1, "{skips}");
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
    let (_, skips) =
        decode(&[&[frame(&sbas), frame(&station), frame(&station), frame(&glonass), frame_of(&[])].concat()]);
    assert_eq!(skips.count("SBAS observations are not used"), 1, "{skips}");
    assert_eq!(skips.count("message 1005 is not read"), 2, "{skips}");
    assert_eq!(skips.count("GLONASS ephemeris not supported yet"), 1, "{skips}");
    assert_eq!(skips.count("frame without a message"), 1, "{skips}");
    assert_eq!(skips.total(), 5, "{skips}");
}

/// More cells than are allowed, reserved signals, and messages cut short have valid checksums all the same.
#[test]
fn impossible_messages_in_valid_frames_are_counted() {
    let mut content = vec![0xff; 1_000];
    let number: u16 = 1077;
    content[0] = (number >> 4) as u8;
    content[1] = (number << 4) as u8;
    let (records, skips) = decode(&[&frame_of(&content)]);
    assert!(records.is_empty());
    assert_eq!(skips.count("message with more than 64 signals"), 1, "{skips}");
    let whole = frame(&gps(TOW_MS, 0));
    let content = &whole[3..whole.len() - 3];
    for length in 2..content.len() {
        let (records, skips) = decode(&[&frame_of(&content[..length])]);
        assert!(records.is_empty(), "{length} of {} bytes", content.len());
        assert_eq!(skips.count("message shorter than its type demands"), 1, "{length}: {skips}");
    }
    let (records, skips) = decode(&[&frame(&gps(604_800_000, 0))]);
    assert!(records.is_empty() && skips.count("message with an impossible time") == 1, "{skips}");
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
    assert_eq!(skips.count("reserved signal number"), 1, "{skips}");
}

#[test]
fn another_kind_of_stream_is_refused() {
    let mut decoder = RtcmDecoder::new(RtcmOptions::near(GpsTime::default()));
    assert!(decoder.feed(&[b'x'; 1_000]).is_ok());
    assert!(decoder.finish().unwrap_err().to_string().contains("no RTCM 3 frame"));
    let mut decoder = RtcmDecoder::new(RtcmOptions::near(GpsTime::default()));
    assert!(decoder.feed(&[0xd3; 100_000]).is_err());
    let mut empty = RtcmDecoder::new(RtcmOptions::near(GpsTime::default()));
    assert!(empty.feed(&[]).is_ok() && empty.finish().is_ok());
}

fn lnav() -> Msg1019T {
    Msg1019T {
        gps_satellite_id: 7,
        gps_week_number: 2118 % 1024,
        ura_index: 2,
        idot_sc_s: -1.5e-10,
        iode: 58,
        toc_s: 396_000.0,
        af2_s_s2: 0.0,
        af1_s_s: 7.048_584e-12,
        af0_s: -1.604_342_833_161e-5,
        iodc: 58,
        crs_m: -39.6875,
        delta_n_sc_s: 1.37e-9,
        m0_sc: -0.2,
        cuc_rad: -2.177_432e-6,
        eccentricity: 0.010_003_942_297,
        cus_rad: 1.937_151e-6,
        sqrt_a_sqrt_m: 5_153.707_128_525,
        toe_s: 396_000.0,
        cic_rad: -1.508_743e-7,
        omega0_sc: 0.8189,
        cis_rad: 1.359_731e-7,
        i0_sc: 0.312,
        crc_m: 353.968_75,
        omega_sc: -0.2527,
        omegadot_sc_s: -2.669e-9,
        tgd_s: 5.122_274e-9,
        sv_health_ind: 0,
        ..Msg1019T::default()
    }
}

/// What an orbit must be like, with half a unit of the last bit as tolerance. Sign and order of all fields are told apart.
fn check_orbit(e: &KeplerEphemeris) {
    let near = |value: f64, expected: f64, unit: f64| {
        assert!((value - expected).abs() <= unit, "{value:e} is not {expected:e} in {}", e.satellite);
    };
    let semicircle = PI * f64::powi(2.0, -31);
    near(e.sqrt_a, 5_153.707_128_525, f64::powi(2.0, -19));
    near(e.eccentricity, 0.010_003_942_297, f64::powi(2.0, -33));
    near(e.m0_rad, -0.2 * PI, semicircle);
    near(e.omega0_rad, 0.8189 * PI, semicircle);
    near(e.i0_rad, 0.312 * PI, semicircle);
    near(e.omega_rad, -0.2527 * PI, semicircle);
    near(e.delta_n_radps, 1.37e-9 * PI, PI * f64::powi(2.0, -43));
    near(e.i_dot_radps, -1.5e-10 * PI, PI * f64::powi(2.0, -43));
    near(e.omega_dot_radps, -2.669e-9 * PI, PI * f64::powi(2.0, -43));
    near(e.cuc_cus_rad.0, -2.177_432e-6, f64::powi(2.0, -29));
    near(e.cuc_cus_rad.1, 1.937_151e-6, f64::powi(2.0, -29));
    near(e.cic_cis_rad.0, -1.508_743e-7, f64::powi(2.0, -29));
    near(e.cic_cis_rad.1, 1.359_731e-7, f64::powi(2.0, -29));
    near(e.crc_crs_m.0, 353.968_75, 0.0);
    near(e.crc_crs_m.1, -39.6875, 0.0);
    near(e.clock.0, -1.604_342_833_161e-5, f64::powi(2.0, -31));
    near(e.clock.1, 7.048_584e-12, f64::powi(2.0, -43));
    assert!(is_healthy(e));
}

#[test]
fn gps_and_qzss_ephemerides() {
    let gps = ephemeris(&Message::Msg1019(lnav()));
    check_orbit(&gps);
    assert_eq!(
        (gps.satellite.to_string(), gps.message, gps.issue_of_data),
        ("G07".into(), NavigationMessage::Lnav, 58)
    );
    assert_eq!(gps.toe, GpsTime::from_week_tow(2118, 396_000.0));
    assert_eq!((gps.toc, gps.toe_own_tow_s, gps.accuracy_m), (gps.toe, 396_000.0, 4.0));
    assert!((gps.group_delays_s.0 - 5.122_274e-9).abs() < 1e-15);
    let unhealthy = ephemeris(&Message::Msg1019(Msg1019T { sv_health_ind: 63, ..lnav() }));
    assert_eq!((unhealthy.health, is_healthy(&unhealthy)), (63.0, false));

    let g = lnav();
    let qzss = ephemeris(&Message::Msg1044(Msg1044T {
        qzss_satellite_id: 2,
        toc_s: g.toc_s,
        af1_s_s: g.af1_s_s,
        af0_s: g.af0_s,
        iode: 58,
        crs_m: g.crs_m,
        delta_n_sc_s: g.delta_n_sc_s.into(),
        m0_sc: g.m0_sc,
        cuc_rad: g.cuc_rad,
        eccentricity: g.eccentricity,
        cus_rad: g.cus_rad,
        sqrt_a_sqrt_m: g.sqrt_a_sqrt_m,
        toe_s: g.toe_s,
        cic_rad: g.cic_rad,
        omega0_sc: g.omega0_sc,
        cis_rad: g.cis_rad,
        i0_sc: g.i0_sc,
        crc_m: g.crc_m,
        omega_sc: g.omega_sc,
        omegadot_sc_s: g.omegadot_sc_s,
        idot_sc_s: g.idot_sc_s,
        qzss_week_number: g.gps_week_number,
        ura_index: 2,
        tgd_s: g.tgd_s,
        ..Msg1044T::default()
    }));
    check_orbit(&qzss);
    assert_eq!(qzss.satellite.to_string(), "J02");
    assert_eq!(KeplerEphemeris { satellite: gps.satellite, ..qzss }, gps);
}

#[test]
fn galileo_and_beidou_ephemerides() {
    let g = lnav();
    let inav = Msg1046T {
        gal_satellite_id: 11,
        gal_week_number: 2118 - 1024,
        iodnav: 97,
        sisa_e1_e5b_index: 107,
        idot_sc_s: g.idot_sc_s as f32,
        toc_s: 396_600.0,
        af1_s_s: g.af1_s_s.into(),
        af0_s: g.af0_s,
        crs_m: g.crs_m,
        delta_n_sc_s: g.delta_n_sc_s,
        m0_sc: g.m0_sc,
        cuc_rad: g.cuc_rad,
        eccentricity: g.eccentricity,
        cus_rad: g.cus_rad,
        sqrt_a_sqrt_m: g.sqrt_a_sqrt_m,
        toe_s: 396_600.0,
        cic_rad: g.cic_rad,
        omega0_sc: g.omega0_sc,
        cis_rad: g.cis_rad,
        i0_sc: g.i0_sc,
        crc_m: g.crc_m,
        omega_sc: g.omega_sc,
        omegadot_sc_s: g.omegadot_sc_s,
        bgd_e1_e5a_s: -1.862_645e-9,
        bgd_e1_e5b_s: -2.095_476e-9,
        ..Msg1046T::default()
    };
    let e = ephemeris(&Message::Msg1046(inav.clone()));
    check_orbit(&e);
    assert_eq!(
        (e.satellite.to_string(), e.message, e.issue_of_data),
        ("E11".into(), NavigationMessage::GalileoInav, 97)
    );
    assert_eq!((e.toe, e.toc), (GpsTime::from_week_tow(2118, 396_600.0), e.toe));
    assert!((e.accuracy_m - 3.12).abs() < 1e-9);
    assert!(
        (e.group_delays_s.0 + 1.862_645e-9).abs() < 1e-15
            && (e.group_delays_s.1 + 2.095_476e-9).abs() < 1e-15
    );
    // RINEX, table A8: bits 0 E1-B validity, 1-2 E1-B health, 3 E5a validity, 4-5 E5a health, 6-8 E5b.
    let health = ephemeris(&Message::Msg1046(Msg1046T {
        e1_b_sig_health_ind: 2,
        e5b_data_validity_flag: 1,
        ..inav.clone()
    }));
    assert_eq!(health.health, f64::from(2 << 1 | 1 << 6));

    let fnav = ephemeris(&Message::Msg1045(Msg1045T {
        gal_satellite_id: 11,
        gal_week_number: inav.gal_week_number,
        sisa_e1_e5a_index: 255,
        idot_sc_s: inav.idot_sc_s,
        toc_s: inav.toc_s,
        af1_s_s: inav.af1_s_s,
        af0_s: inav.af0_s,
        crs_m: inav.crs_m,
        delta_n_sc_s: inav.delta_n_sc_s,
        m0_sc: inav.m0_sc,
        cuc_rad: inav.cuc_rad,
        eccentricity: inav.eccentricity,
        cus_rad: inav.cus_rad,
        sqrt_a_sqrt_m: inav.sqrt_a_sqrt_m,
        toe_s: inav.toe_s,
        cic_rad: inav.cic_rad,
        omega0_sc: inav.omega0_sc,
        cis_rad: inav.cis_rad,
        i0_sc: inav.i0_sc,
        crc_m: inav.crc_m,
        omega_sc: inav.omega_sc,
        omegadot_sc_s: inav.omegadot_sc_s,
        bgd_e1_e5a_s: inav.bgd_e1_e5a_s,
        ..Msg1045T::default()
    }));
    check_orbit(&fnav);
    assert_eq!((fnav.message, fnav.accuracy_m), (NavigationMessage::GalileoFnav, 10.0));
    assert!(fnav.group_delays_s.1.is_nan() && fnav.group_delays_s.0 == e.group_delays_s.0);

    let beidou = ephemeris(&Message::Msg1042(Msg1042T {
        bds_satellite_id: 21,
        bds_week_number: 2118 - 1356,
        ura_index: 0,
        idot_sc_s: g.idot_sc_s,
        aode: 3,
        toc_s: 396_000.0,
        a1_s_s: g.af1_s_s.into(),
        a0_s: g.af0_s,
        crs_m: g.crs_m,
        delta_n_sc_s: g.delta_n_sc_s,
        m0_sc: g.m0_sc,
        cuc_rad: g.cuc_rad,
        eccentricity: g.eccentricity,
        cus_rad: g.cus_rad,
        sqrt_a_sqrt_m: g.sqrt_a_sqrt_m,
        toe_s: 396_000.0,
        cic_rad: g.cic_rad,
        omega0_sc: g.omega0_sc,
        cis_rad: g.cis_rad,
        i0_sc: g.i0_sc,
        crc_m: g.crc_m,
        omega_sc: g.omega_sc,
        omegadot_sc_s: g.omegadot_sc_s,
        tgd1_s: 5.7e-9,
        tgd2_s: -9.3e-9,
        ..Msg1042T::default()
    }));
    check_orbit(&beidou);
    assert_eq!(
        (beidou.message, beidou.issue_of_data, beidou.accuracy_m),
        (NavigationMessage::BeidouD1D2, 3, 2.0)
    );
    assert_eq!(beidou.toe, GpsTime::from_beidou_week_tow(762, 396_000.0));
    assert_eq!((beidou.toc, beidou.toe_own_tow_s), (beidou.toe, 396_000.0));
    assert!(
        (beidou.group_delays_s.0 - 5.7e-9).abs() < 1e-15 && (beidou.group_delays_s.1 + 9.3e-9).abs() < 1e-15
    );
}

#[test]
fn ephemerides_come_once_and_absurd_ones_not_at_all() {
    let message = |lnav| frame(&Message::Msg1019(lnav));
    let stream = [
        message(lnav()),
        message(lnav()),
        message(Msg1019T { iode: 59, toe_s: 403_200.0, toc_s: 403_200.0, ..lnav() }),
        message(Msg1019T { sqrt_a_sqrt_m: 100.0, ..lnav() }),
        message(Msg1019T { gps_satellite_id: 0, ..lnav() }),
        message(Msg1019T { toc_s: 100_000.0, ..lnav() }),
    ];
    let (records, skips) = decode(&[&stream.concat()]);
    assert_eq!(records.len(), 2);
    assert_eq!((skips.total(), skips.count("ephemeris with impossible values")), (3, 3), "{skips}");
}

/// An ephemeris of the first hours of a week is sent before that week begins.
#[test]
fn weeks_are_completed_across_their_end() {
    let near = GpsTime::from_week_tow(2118, 604_790.0);
    for (week, toe_s, expected) in
        [(2118, 0.0, 2119), (2119, 0.0, 2119), (2118, 597_600.0, 2118), (2119, 597_600.0, 2118)]
    {
        let mut decoder = RtcmDecoder::new(RtcmOptions::near(near));
        let message = Msg1019T { gps_week_number: week % 1024, toe_s, toc_s: toe_s, ..lnav() };
        decoder.feed(&frame(&Message::Msg1019(message))).unwrap();
        let Some(Record::Ephemeris(ephemeris)) = decoder.next_record() else { panic!("{}", decoder.skips()) };
        assert_eq!(
            ephemeris.toe,
            GpsTime::from_week_tow(expected, f64::from(toe_s)),
            "week {week}, toe {toe_s}"
        );
    }
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
        number in prop_oneof![1_070..1_138_u16, Just(1_019), Just(1_020), Just(1_042), 1_044..1_047_u16],
        mut content in proptest::collection::vec(any::<u8>(), 2..400),
        sparse: bool,
        nanos: i64,
    ) {
        content[0] = (number >> 4) as u8;
        content[1] = (number << 4) as u8 | content[1] & 0x0f;
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
