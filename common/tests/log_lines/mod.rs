//! Small GnssLogger text logs, line by line.

#![allow(dead_code, clippy::unwrap_used, clippy::panic)] // not every test uses everything; helpers of tests

use cofix_common::constants::SPEED_OF_LIGHT_MPS;
use cofix_common::formats::decode::{Decoder, Record};
use cofix_common::formats::gnsslogger::{GnssLoggerDecoder, Options};
use cofix_common::gnss::{Observation, ObservationEpoch};
use cofix_common::orbit::KeplerEphemeris;
use cofix_common::skips::Skips;
use cofix_common::time::GpsTime;

pub const HEADER: &str = "# Raw,utcTimeMillis,TimeNanos,LeapSecond,TimeUncertaintyNanos,FullBiasNanos,BiasNanos,\
BiasUncertaintyNanos,DriftNanosPerSecond,DriftUncertaintyNanosPerSecond,HardwareClockDiscontinuityCount,Svid,\
TimeOffsetNanos,State,ReceivedSvTimeNanos,ReceivedSvTimeUncertaintyNanos,Cn0DbHz,PseudorangeRateMetersPerSecond,\
PseudorangeRateUncertaintyMetersPerSecond,AccumulatedDeltaRangeState,AccumulatedDeltaRangeMeters,\
AccumulatedDeltaRangeUncertaintyMeters,CarrierFrequencyHz,CarrierCycles,CarrierPhase,CarrierPhaseUncertainty,\
MultipathIndicator,SnrInDb,ConstellationType,AgcDb,CodeType";

pub const WEEK_NS: i64 = 604_800_000_000_000;
pub const DAY_NS: i64 = 86_400_000_000_000;
pub const TRAVEL_NS: i64 = 81_234_567;

/// A `Raw` line with sound values; tests change what they are about.
#[derive(Clone, Debug)]
pub struct Line {
    pub time_ns: i64,
    pub gps_ns: i64,
    pub bias: &'static str,
    pub bias_uncertainty: f64,
    pub discontinuities: i64,
    pub svid: i64,
    pub time_offset: f64,
    pub state: u32,
    pub received: i64,
    pub uncertainty: i64,
    pub cn0: f64,
    pub rate: &'static str,
    pub rate_uncertainty: f64,
    pub range_state: u32,
    pub range: &'static str,
    pub frequency: &'static str,
    pub multipath: &'static str,
    pub system: i64,
    pub code: &'static str,
}

/// 2023-11-07 12:00:00.3 GPS time, TimeNanos `seconds` after the phone's start.
pub fn gps(seconds: i64) -> Line {
    let gps_ns = "2023-11-07T12:00:00.3".parse::<GpsTime>().unwrap().nanos() + seconds * 1_000_000_000;
    Line {
        time_ns: 7_000_000_000_000 + seconds * 1_000_000_000,
        gps_ns,
        bias: "0.0",
        bias_uncertainty: 20.0,
        discontinuities: 3,
        svid: 5,
        time_offset: 0.0,
        state: 16_431,
        received: (gps_ns - TRAVEL_NS).rem_euclid(WEEK_NS),
        uncertainty: 20,
        cn0: 35.0,
        rate: "-190.5",
        rate_uncertainty: 0.1,
        range_state: 1,
        range: "1000.0",
        frequency: "1575420030",
        multipath: "0",
        system: 1,
        code: "C",
    }
}

impl Line {
    /// As a line of the log.
    pub fn text(&self) -> String {
        let full_bias = self.time_ns - self.gps_ns;
        let Self {
            time_ns, bias, bias_uncertainty, discontinuities, svid, time_offset, state, received, ..
        } = self;
        let Self { uncertainty, cn0, rate, rate_uncertainty, range_state, range, frequency, .. } = self;
        let Self { multipath, system, code, .. } = self;
        format!(
            "Raw,1699358382300,{time_ns},,,{full_bias},{bias},{bias_uncertainty},,,{discontinuities},{svid},\
             {time_offset},{state},{received},{uncertainty},{cn0},{rate},{rate_uncertainty},{range_state},{range},\
             0.1,{frequency},,,,{multipath},,{system},,{code}"
        )
    }
}

pub fn log(lines: &[Line]) -> String {
    let mut text = format!("# Header Description:\n#\n{HEADER}\n#\n");
    for line in lines {
        text += &line.text();
        text.push('\n');
    }
    text
}

pub struct Decoded {
    pub epochs: Vec<ObservationEpoch>,
    pub ephemerides: Vec<KeplerEphemeris>,
    pub skips: Skips,
    pub decoder: GnssLoggerDecoder,
}

pub fn decode_with(bytes: &[u8], options: Options) -> Decoded {
    let mut decoder = GnssLoggerDecoder::new(options);
    decoder.feed(bytes).unwrap();
    decoder.finish().unwrap();
    let (mut epochs, mut ephemerides) = (Vec::new(), Vec::new());
    while let Some(record) = decoder.next_record() {
        match record {
            Record::Epoch(epoch) => epochs.push(epoch),
            Record::Ephemeris(ephemeris) => ephemerides.push(*ephemeris),
            other @ (Record::Glonass(_) | Record::Event(_)) => panic!("{other:?}: such logs give none"),
        }
    }
    Decoded { epochs, ephemerides, skips: decoder.skips().clone(), decoder }
}

pub fn decode(text: &str) -> Decoded {
    decode_with(text.as_bytes(), Options::default())
}

/// The observation of a log of one line.
pub fn only(line: &Line) -> Observation {
    let decoded = decode(&log(std::slice::from_ref(line)));
    assert!(decoded.skips.is_empty(), "{}", decoded.skips);
    assert_eq!((decoded.epochs.len(), decoded.epochs[0].observations.len()), (1, 1));
    decoded.epochs[0].observations[0]
}

/// The reasons of a log of one line that gives nothing.
pub fn refusal(line: &Line) -> Vec<String> {
    refusal_with(line, Options::default())
}

pub fn refusal_with(line: &Line, options: Options) -> Vec<String> {
    let decoded = decode_with(log(std::slice::from_ref(line)).as_bytes(), options);
    assert!(decoded.epochs.is_empty());
    decoded
        .skips
        .iter()
        .map(|(reason, _)| reason.to_owned())
        .filter(|r| !r.starts_with("epoch without"))
        .collect()
}

pub fn metres(ns: f64) -> f64 {
    ns * SPEED_OF_LIGHT_MPS * 1e-9
}
