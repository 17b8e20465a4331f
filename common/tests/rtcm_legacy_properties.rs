//! Any values through legacy observation messages, written bit by bit here and by another implementation (rtcm-rs).

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests

mod rtcm_support;

use cofix_common::constants::SPEED_OF_LIGHT_MPS;
use cofix_common::gnss::{Constellation, Observation, SatelliteId, SignalCode};
use proptest::prelude::*;
use rtcm_rs::Message;
use rtcm_rs::msg::{Msg1004Sat, Msg1004T, Msg1012Sat, Msg1012T};
use rtcm_support::legacy::{
    LIGHT_MS_M, MOSCOW_MS, SENT, Second, Sent, epochs, is_glonass, list, message, raw,
};
use rtcm_support::{TOW_MS, Writer, frame};

/// Values of one satellite in their own units.
#[derive(Clone, Copy, Debug)]
struct Truth {
    number: u8,
    channel: i8,
    range_m: f64,
    difference_m: f64,
    phases_m: [f64; 2],
    cn0s_dbhz: [f64; 2],
}

fn truth(number: u8) -> impl Strategy<Value = Truth> {
    let phase = || -262.0..262.0;
    let cn0 = || 0.3..63.7;
    (-7..=13_i8, 1.9e7..2.9e7, -163.0..163.0, [phase(), phase()], [cn0(), cn0()]).prop_map(
        move |(channel, range_m, difference_m, phases_m, cn0s_dbhz)| Truth {
            number,
            channel,
            range_m,
            difference_m,
            phases_m,
            cn0s_dbhz,
        },
    )
}

fn truths() -> impl Strategy<Value = Vec<Truth>> {
    (1..=24_u8).prop_map(truth).prop_flat_map(|one| one).prop_flat_map(|first| {
        proptest::collection::vec(truth(0), 0..20).prop_map(move |others| {
            let numbered = (0..).zip(std::iter::once(first).chain(others));
            numbered.map(|(i, t)| Truth { number: 1 + (first.number + i) % 24, ..t }).collect()
        })
    })
}

impl Truth {
    /// As numbers of the message, phases less the pseudorange that is sent.
    fn sent(&self, modulus_m: f64) -> Sent {
        let ambiguity = (self.range_m / modulus_m).floor();
        let code = raw(self.range_m - ambiguity * modulus_m, 0.02);
        let base_m = ambiguity * modulus_m + code as f64 * 0.02;
        let phase = |index: usize| raw(self.range_m + self.phases_m[index] - base_m, 0.000_5);
        Sent {
            number: self.number.into(),
            channel: (i64::from(self.channel) + 7).unsigned_abs(),
            code: code.unsigned_abs(),
            phase: phase(0),
            ambiguity: raw(ambiguity, 1.0).unsigned_abs(),
            cn0: raw(self.cn0s_dbhz[0], 0.25).unsigned_abs(),
            second: Second {
                code: raw(self.range_m + self.difference_m - base_m, 0.02),
                phase: phase(1),
                cn0: raw(self.cn0s_dbhz[1], 0.25).unsigned_abs(),
                ..SENT.second
            },
            ..SENT
        }
    }
}

fn gps_by_another(truths: &[Truth]) -> Vec<u8> {
    let satellites = truths.iter().map(|truth| {
        let sent = truth.sent(LIGHT_MS_M);
        Msg1004Sat {
            gps_satellite_id: truth.number,
            gps_l1_code_ind: 0,
            l1_pseudorange_m: Some(sent.code as f64 * 0.02),
            l1_phase_pseudorange_diff_m: Some(sent.phase as f64 * 0.000_5),
            l1_lock_time_index: 127,
            l1_pseudorange_amb_m: sent.ambiguity as f64 * LIGHT_MS_M,
            l1_cnr_dbhz: Some(sent.cn0 as f32 * 0.25),
            gps_l2_code_ind: 0,
            l2_l1_pseudorange_diff_m: Some(sent.second.code as f32 * 0.02),
            l2_phase_l1_pseudorange_diff_m: Some(sent.second.phase as f64 * 0.000_5),
            l2_lock_time_index: 127,
            l2_cnr_dbhz: Some(sent.second.cn0 as f32 * 0.25),
        }
    });
    frame(&Message::Msg1004(Msg1004T {
        reference_station_id: 42,
        gps_epoch_time_ms: TOW_MS,
        satellites: list(satellites),
        ..Msg1004T::default()
    }))
}

fn glonass_by_another(truths: &[Truth]) -> Vec<u8> {
    let satellites = truths.iter().map(|truth| {
        let sent = truth.sent(2.0 * LIGHT_MS_M);
        Msg1012Sat {
            glo_satellite_id: truth.number,
            glo_satellite_freq_chan_number: truth.channel,
            l1_pseudorange_m: Some(sent.code as f64 * 0.02),
            l1_phase_pseudorange_diff_m: Some(sent.phase as f64 * 0.000_5),
            l1_lock_time_index: 127,
            l1_pseudorange_amb_m: sent.ambiguity as f64 * 2.0 * LIGHT_MS_M,
            l1_cnr_dbhz: Some(sent.cn0 as f32 * 0.25),
            l2_l1_pseudorange_diff_m: Some(sent.second.code as f32 * 0.02),
            l2_phase_l1_pseudorange_diff_m: Some(sent.second.phase as f64 * 0.000_5),
            l2_lock_time_index: 127,
            l2_cnr_dbhz: Some(sent.second.cn0 as f32 * 0.25),
            ..Msg1012Sat::default()
        }
    });
    frame(&Message::Msg1012(Msg1012T {
        reference_station_id: 42,
        glo_epoch_time_ms: MOSCOW_MS,
        satellites: list(satellites),
        ..Msg1012T::default()
    }))
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(300) })]

    #[test]
    fn what_is_written_comes_back_to_the_messages_resolution(
        truths in truths(),
        kind in prop_oneof![Just(1_002_u64), Just(1_004), Just(1_010), Just(1_012)],
    ) {
        let (system, modulus_m) = if is_glonass(kind) {
            (Constellation::Glonass, 2.0 * LIGHT_MS_M)
        } else {
            (Constellation::Gps, LIGHT_MS_M)
        };
        let sent: Vec<_> = truths.iter().map(|truth| truth.sent(modulus_m)).collect();
        let (epochs, skips) = epochs(&[message(kind, 0, 0, &sent)]);
        prop_assert!(skips.is_empty(), "{}", skips);
        let both = kind % 4 == 0;
        prop_assert_eq!(epochs[0].observations.len(), truths.len() * if both { 2 } else { 1 });
        for truth in &truths {
            let second = if is_glonass(kind) { b'C' } else { b'X' };
            let signals = [(b'1', b'C', 0.0), (b'2', second, truth.difference_m)];
            for (index, (band, attribute, difference_m)) in signals.iter().enumerate().take(1 + usize::from(both)) {
                let signal = SignalCode::new(*band, *attribute);
                let satellite = SatelliteId::new(system, truth.number);
                let of = |o: &&Observation| (o.satellite, o.signal) == (satellite, signal);
                let o = epochs[0].observations.iter().find(of).unwrap();
                let frequency_hz = signal.frequency_hz(system, Some(truth.channel)).unwrap();
                let phase_m = o.carrier_phase_cycles.unwrap() / frequency_hz * SPEED_OF_LIGHT_MPS;
                let error = |value: f64, expected: f64| (value - expected).abs();
                prop_assert!(error(o.pseudorange_m.unwrap(), truth.range_m + difference_m) < 0.010_001);
                prop_assert!(error(phase_m, truth.range_m + truth.phases_m[index]) < 0.000_251, "{:?}", o);
                prop_assert!(error(o.cn0_dbhz.unwrap(), truth.cn0s_dbhz[index]) <= 0.125);
            }
        }
    }

    #[test]
    fn another_implementation_writes_the_same_message(truths in truths()) {
        let sent = |modulus_m| truths.iter().map(|truth| truth.sent(modulus_m)).collect::<Vec<_>>();
        prop_assert_eq!(message(1_004, 0, 0, &sent(LIGHT_MS_M)), gps_by_another(&truths));
        prop_assert_eq!(message(1_012, 0, 0, &sent(2.0 * LIGHT_MS_M)), glonass_by_another(&truths));
    }

    #[test]
    fn any_content_is_survived(
        kind in 1_001..1_013_u64,
        count in 0..32_u64,
        content in proptest::collection::vec(any::<u64>(), 0..90),
        seconds in 0..100_u32,
    ) {
        let start = if is_glonass(kind) { MOSCOW_MS } else { TOW_MS };
        let time_bits = if is_glonass(kind) { 27 } else { 30 };
        let header = Writer::default()
            .unsigned(12, kind)
            .unsigned(12, 1)
            .unsigned(time_bits, (start + seconds).into())
            .unsigned(1, 0)
            .unsigned(5, count);
        let whole = content.iter().fold(header, |writer, bits| writer.unsigned(64, *bits)).frame();
        let (epochs, _) = epochs(&[whole]);
        for o in epochs.iter().flat_map(|epoch| &epoch.observations) {
            prop_assert!(o.pseudorange_m.is_none_or(|p| (1e6..1e8).contains(&p)), "{:?}", o);
            prop_assert!(o.carrier_phase_cycles.is_none_or(|p| (1e6..1e9).contains(&p)), "{:?}", o);
            prop_assert!(o.cn0_dbhz.is_none_or(|c| (0.25..64.0).contains(&c)), "{:?}", o);
        }
    }
}
