//! Spare logs of the WHU-Smartphone dataset, written by hand.

#![allow(clippy::unwrap_used, clippy::indexing_slicing)] // helpers of tests

use cofix_common::formats::decode::{Decoder, Record};
use cofix_common::formats::whu::SpareLogDecoder;
use cofix_common::gnss::{Observation, ObservationEpoch};
use cofix_common::skips::{Reason, Skips};
use cofix_common::time::GpsTime;

fn decode(text: &str) -> (Vec<ObservationEpoch>, Skips) {
    let mut decoder = SpareLogDecoder::default();
    decoder.feed(text.as_bytes()).unwrap();
    decoder.finish().unwrap();
    let mut epochs = Vec::new();
    while let Some(record) = decoder.next_record() {
        let Record::Epoch(epoch) = record else { continue };
        epochs.push(epoch);
    }
    (epochs, decoder.skips().clone())
}

/// An epoch's line, `second` s after 2020-08-13 14:19.
fn line(second: f64, signals: &[&str]) -> String {
    format!(
        "{{\"gga\":\"\",\"obsd_t\":{{\"d\":[{}],\"satnum\":{},\"t\":{{\"day\":13,\"hour\":14,\"minute\":19,\"month\":8,\"sec\":{second:?},\"year\":2020}}}}}}\n",
        signals.join(","),
        signals.len()
    )
}

fn start() -> GpsTime {
    GpsTime::from_week_tow(2118, 397_140.0)
}

const GPS: &str = r#"{"d":-2921.6,"l":4652187.0,"lli":0,"p":2.1489716E7,"prn":10,"snr":44.5,"type":"L1C","vd":0.001,"vl":5.5E-4,"vp":2.9979246}"#;

#[test]
fn values_are_those_of_the_line() {
    let beidou = r#"{"d":104.5,"l":0.0,"lli":0,"p":3.6E7,"prn":109,"snr":31.0,"type":"L1I","vd":0.55,"vl":0.0,"vp":3.6}"#;
    let text = format!(
        "current_Start_Timestamp:2020_08_13_22_18_42.366\n{}",
        line(7.000_147_000_013, &[GPS, beidou])
    );
    let (epochs, skips) = decode(&text);
    assert!(skips.is_empty(), "{skips}");
    let epoch = &epochs[0];
    assert_eq!(epoch.time_gps, start() + 7.000_147);
    let names: Vec<_> = epoch.observations.iter().map(|o| format!("{} {}", o.satellite, o.signal)).collect();
    assert_eq!(names, ["G10 1C", "C09 2I"]);
    let Observation { pseudorange_m, carrier_phase_cycles, doppler_hz, cn0_dbhz, .. } = epoch.observations[0];
    assert_eq!((pseudorange_m, carrier_phase_cycles), (Some(21_489_716.0), Some(4_652_187.0)));
    assert_eq!((doppler_hz, cn0_dbhz), (Some(-2_921.6), Some(44.5)));
    assert_eq!(epoch.observations[1].carrier_phase_cycles, None);
}

#[test]
fn zero_and_null_are_missing() {
    let signal = r#"{"d":0.0,"l":null,"p":2.1E7,"prn":10,"snr":0.0,"type":"L1C","vd":0.1,"vp":0.0}"#;
    let nothing = r#"{"d":0.0,"l":0.0,"lli":0,"p":0.0,"prn":11,"snr":0.0,"type":"L1C"}"#;
    let (epochs, skips) = decode(&line(0.0, &[signal, nothing]));
    let epoch = &epochs[0];
    let Observation { carrier_phase_cycles, doppler_hz, cn0_dbhz, .. } = epoch.observations[0];
    assert_eq!((carrier_phase_cycles, doppler_hz, cn0_dbhz), (None, None, None));
    assert_eq!((epoch.observations.len(), skips.count(Reason::SignalWithoutValue)), (1, 1));
}

/// The indicator of an epoch without a phase holds for the next phase.
#[test]
fn a_slip_without_a_phase_is_told_by_the_next_phase() {
    let with = |l: f64, lli: u8| {
        GPS.replace("4652187.0", &format!("{l:?}")).replace("\"lli\":0", &format!("\"lli\":{lli}"))
    };
    let other = GPS.replace("\"prn\":10", "\"prn\":12");
    let lines: Vec<String> = [with(4e6, 0), with(0.0, 1), with(0.0, 0), with(5e6, 2), with(5e6, 0)]
        .iter()
        .zip([0.0, 1.0, 2.0, 3.0, 4.0])
        .map(|(signal, second)| line(second, &[signal, &other]))
        .collect();
    let (epochs, _) = decode(&lines.concat());
    let slips: Vec<_> = epochs
        .iter()
        .map(|epoch| {
            let [ten, twelve] = [0, 1].map(|at| epoch.observations[at].loss_of_lock);
            (ten.cycle_slip, ten.half_cycle, twelve.cycle_slip)
        })
        .collect();
    let none = (false, false, false);
    assert_eq!(slips, [none, none, none, (true, true, false), none]);
}

#[test]
fn whole_numbers_may_be_written_as_floating_point() {
    let text = line(0.0, &[&GPS.replace("\"prn\":10", "\"prn\":10.0").replace("\"lli\":0", "\"lli\":1.0")]);
    let text = text.replace("\"year\":2020", "\"year\":2020.0").replace("\"hour\":14", "\"hour\":1.4E1");
    let (epochs, skips) = decode(&text);
    assert!(skips.is_empty(), "{skips}");
    assert_eq!(epochs[0].time_gps, start());
    assert!(epochs[0].observations[0].loss_of_lock.cycle_slip);
}

#[test]
fn a_bad_signal_costs_itself() {
    for (bad, reason) in [
        ("7", Reason::SatelliteIndexOfNoSatellite.text()),
        ("null", Reason::SatelliteIndexOfNoSatellite.text()),
        ("{}", Reason::SatelliteIndexOfNoSatellite.text()),
        (r#"{"prn":300,"type":"L1C","p":2.1E7}"#, Reason::SatelliteIndexOfNoSatellite.text()),
        (r#"{"prn":1.5,"type":"L1C","p":2.1E7}"#, Reason::SatelliteIndexOfNoSatellite.text()),
        (r#"{"prn":36,"type":"L5X","p":2.1E7}"#, Reason::ObservationCodeOfNoSignal.text()),
        (r#"{"prn":101,"type":"L1X","p":2.1E7}"#, Reason::ObservationCodeOfNoSignal.text()),
        (r#"{"prn":10,"type":"L1C","p":2.1E7}"#, Reason::SignalRepeated.text()),
        (r#"{"prn":12,"type":"L1C","p":5.0}"#, Reason::PseudorangeOutOfRange.text()),
    ] {
        let (epochs, skips) = decode(&line(0.0, &[GPS, bad]));
        assert_eq!(epochs[0].observations.len(), 1, "{bad}");
        assert_eq!(skips.count(reason), 1, "{bad}: {skips}");
    }
}

#[test]
fn ends_and_line_ends() {
    let text = [line(0.0, &[GPS]), line(1.0, &[GPS])].concat();
    let crlf = format!("\u{feff}\r\n{}", text.replace('\n', "\r\n"));
    assert_eq!((decode(&crlf).0.len(), decode(&crlf).1.total()), (2, 0));
    let without_end = text.trim_end();
    assert_eq!((decode(without_end).0.len(), decode(without_end).1.total()), (2, 0), "it is complete");
    let cut = &text[..text.len() - 30];
    assert_eq!((decode(cut).0.len(), decode(cut).1.count(Reason::LastLineCutOff)), (1, 1));
}

#[test]
fn another_stream_is_refused() {
    for (text, portion) in [("name,value\n1,2\n", 3), ("", 1), ("{\"a\":1}\n", 2)] {
        let mut decoder = SpareLogDecoder::default();
        let fed = text.as_bytes().chunks(portion).try_for_each(|bytes| decoder.feed(bytes));
        let error = fed.and_then(|()| decoder.finish()).unwrap_err();
        assert!(error.reason.contains("not a spare log"), "{error}");
    }
    let mut decoder = SpareLogDecoder::default();
    assert!(decoder.feed("x\n".repeat(101).as_bytes()).is_err(), "after a hundred lines");
}
