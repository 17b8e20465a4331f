//! Small recordings of every format, of the same seconds and satellites.

#![allow(dead_code)] // not every test uses everything

use std::fmt::Write as _;

/// A recording in parts.
#[derive(Clone)]
pub struct Recording {
    pub name: &'static str,
    pub header: Vec<u8>,
    pub epochs: Vec<Vec<u8>>,
    /// A GLONASS satellite whose channel is not told, to be added to an epoch.
    pub glonass: Vec<u8>,
    /// Whether it consists of lines.
    pub is_text: bool,
}

/// Milliseconds of GPS time of the first epoch, 2020-08-13 14:19:00.
const START_MS: i64 = (2_118 * 604_800 + 397_140) * 1_000;
const C_MPS: f64 = 299_792_458.0;
const RANGES_M: [(u8, f64); 2] = [(7, 22.1e6), (8, 23.4e6)];

fn text(
    name: &'static str,
    header: &str,
    count: i64,
    epoch: impl Fn(i64) -> String,
    glonass: &str,
) -> Recording {
    Recording {
        name,
        header: header.as_bytes().to_vec(),
        epochs: (0..count).map(|second| epoch(second).into_bytes()).collect(),
        glonass: glonass.as_bytes().to_vec(),
        is_text: true,
    }
}

/// Hour, minute and second of an epoch.
fn clock(second: i64) -> String {
    let of_day = 51_540 + second;
    format!("{:02} {:02} {:2}", of_day / 3_600, of_day / 60 % 60, of_day % 60)
}

const VALUES: &str = " 116000000.000 8     -1200.000 8        45.000 8";

/// Header of RINEX 3 for [`one_satellite_epoch`].
pub const ONE_SATELLITE_HEADER: &str =
    "     3.04           OBSERVATION DATA    M                   RINEX VERSION / TYPE
G    4 C1C L1C D1C S1C                                      SYS / # / OBS TYPES
                                                            END OF HEADER
";

/// RINEX 3 of one satellite at a second after 2020-08-13 14:19:00.
pub fn one_satellite_epoch(second: u32) -> String {
    format!("> 2020 08 13 14 19 {second:2}.0000000  0  1\nG07  22100000.000 8{VALUES}\n")
}

pub fn rinex_3(count: i64) -> Recording {
    let mut header = format!("{:<60}RINEX VERSION / TYPE\n", "     3.04           OBSERVATION DATA    M");
    for system in ['G', 'R'] {
        let _ = writeln!(header, "{:<60}SYS / # / OBS TYPES", format!("{system}    4 C1C L1C D1C S1C"));
    }
    let _ = writeln!(header, "{:<60}END OF HEADER", "");
    let epoch = |second| {
        let mut text = format!("> 2020 08 13 {}.0000000  0  2\n", clock(second));
        for (number, range_m) in RANGES_M {
            let _ = writeln!(text, "G{number:02}{range_m:14.3} 8{VALUES}");
        }
        text
    };
    let glonass = format!("> 2020 08 13 14 19 59.0000000  0  1\nR03{:14.3} 8{VALUES}\n", 20.1e6);
    text("RINEX 3", &header, count, epoch, &glonass)
}

pub fn rinex_2(count: i64) -> Recording {
    let header = [
        ("     2.11           OBSERVATION DATA    M", "RINEX VERSION / TYPE"),
        ("     4    C1    L1    D1    S1", "# / TYPES OF OBSERV"),
        ("  2020     8    13    14    19    0.0000000     GPS", "TIME OF FIRST OBS"),
        ("", "END OF HEADER"),
    ]
    .map(|(text, label)| format!("{text:<60}{label}\n"))
    .concat();
    let epoch = |second| {
        let mut text = format!(" 20  8 13 {}.0000000  0  2G 7G 8\n", clock(second));
        for (_, range_m) in RANGES_M {
            let _ = writeln!(text, "{range_m:14.3} 8{VALUES}");
        }
        text
    };
    let glonass = format!(" 20  8 13 14 19 59.0000000  0  1R 3\n{:14.3} 8{VALUES}\n", 20.1e6);
    text("RINEX 2", &header, count, epoch, &glonass)
}

/// Every epoch begins anew.
pub fn compact(count: i64) -> Recording {
    let plain = rinex_3(0).header;
    let mut header = format!("{:<60}CRINEX VERS   / TYPE\n", "3.0                 COMPACT RINEX FORMAT");
    let _ = writeln!(header, "{:<60}CRINEX PROG / DATE", "by hand");
    header += &String::from_utf8(plain).unwrap();
    let satellite = |range_m: f64| format!("3&{:.0} 3&116000000000 3&-1200000 3&45000\n", range_m * 1e3);
    let epoch = |second| {
        let ranges = RANGES_M.map(|(_, range_m)| satellite(range_m)).concat();
        format!("> 2020 08 13 {}.0000000  0  2      G07G08\n\n{ranges}", clock(second))
    };
    let glonass = format!("> 2020 08 13 14 19 59.0000000  0  1      R03\n\n{}", satellite(20.1e6));
    text("Compact RINEX", &header, count, epoch, &glonass)
}

pub fn log(count: i64) -> Recording {
    let header = "# Raw,TimeNanos,FullBiasNanos,BiasNanos,Svid,TimeOffsetNanos,State,ReceivedSvTimeNanos,Cn0DbHz,\
                  PseudorangeRateMetersPerSecond,CarrierFrequencyHz,ConstellationType\n";
    let line = |second: i64, svid: u8, state: u32, received: i64, frequency: &str, system: u8| {
        let time_ns = 1_000_000_000 * (second + 50);
        let full_bias_ns = time_ns - (START_MS + 1_000 * second) * 1_000_000;
        format!(
            "Raw,{time_ns},{full_bias_ns},0.0,{svid},0.0,{state},{received},45.0,-190.5,{frequency},{system}\n"
        )
    };
    let travel_ns = |range_m: f64| nanos(range_m / C_MPS);
    let epoch = |second: i64| {
        let gps = |(svid, range_m)| {
            let received =
                ((START_MS + 1_000 * second) * 1_000_000 - travel_ns(range_m)) % 604_800_000_000_000;
            line(second, svid, 16_431, received, "1575420030", 1)
        };
        RANGES_M.map(gps).concat()
    };
    // GLONASS time of day: UTC + 3 h.
    let day_ns = ((START_MS + 59_000) / 1_000 % 86_400 - 18 + 10_800) * 1_000_000_000;
    let glonass = line(59, 3, 193, day_ns - travel_ns(20.1e6), "", 3);
    text("GnssLogger", header, count, epoch, &glonass)
}

pub fn table(count: i64) -> Recording {
    let header = "millisSinceGpsEpoch,constellationType,svid,signalType,receivedSvTimeInGpsNanos,xSatPosM,ySatPosM,\
                  zSatPosM,xSatVelMps,ySatVelMps,zSatVelMps,satClkBiasM,satClkDriftMps,rawPrM,rawPrUncM,isrbM,ionoDelayM,\
                  tropoDelayM\n";
    let row = |second: i64, system: u8, svid: u8, signal: &str, range_m: f64| {
        let time_ms = START_MS + 1_000 * second;
        let sent_ns = time_ms * 1_000_000 - nanos(range_m / C_MPS);
        format!(
            "{time_ms},{system},{svid},{signal},{sent_ns},15600000.0,7500000.0,20100000.0,1000.0,-2000.0,1500.0,0.0,0.0,\
             {range_m:.3},3.0,0.0,5.0,3.0\n"
        )
    };
    let epoch = |second| RANGES_M.map(|(svid, range_m)| row(second, 1, svid, "GPS_L1", range_m)).concat();
    text("challenge table", header, count, epoch, &row(59, 3, 3, "GLO_G1", 20.1e6))
}

/// Two lines an epoch.
pub fn spare_log(count: i64) -> Recording {
    let epoch = |second: i64, signals: &[(u8, f64)]| {
        let of_day = 51_540 + second;
        let (hour, minute, sec) = (of_day / 3_600, of_day / 60 % 60, of_day % 60);
        let signal = |(index, range_m): &(u8, f64)| {
            format!(
                "{{\"d\":-1200.0,\"l\":1.16E8,\"lli\":0,\"p\":{range_m:.3},\"prn\":{index},\"snr\":45.0,\"type\":\"L1C\",\"vd\":0.01,\
                 \"vl\":0.1,\"vp\":1.5}}"
            )
        };
        let signals: Vec<String> = signals.iter().map(signal).collect();
        format!(
            "current_Start_Timestamp:2020_08_13_{:02}_{minute:02}_{sec:02}.345\n{{\"gga\":\"\",\"imei\":\"0\",\"obsd_t\":{{\"d\":[{}],\
             \"satnum\":{},\"t\":{{\"day\":13,\"hour\":{hour},\"minute\":{minute},\"month\":8,\"sec\":{sec}.0,\"year\":2020}}}}}}\n",
            hour + 8,
            signals.join(","),
            signals.len(),
        )
    };
    let header = "current_Start_Timestamp:2020_08_13_22_18_59.345\n";
    text("spare log", header, count, |second| epoch(second, &RANGES_M), &epoch(59, &[(38, 20.1e6)]))
}

#[allow(clippy::cast_possible_truncation)] // a fraction of a second
fn nanos(seconds: f64) -> i64 {
    (seconds * 1e9).round() as i64
}

pub fn rtcm(count: i64) -> Recording {
    let epoch = |second: i64| {
        let time_ms = u64::try_from(START_MS + 1_000 * second).unwrap() % 604_800_000;
        frame(&msm4(1_074, time_ms, &[7, 8], 74))
    };
    // Two-bit-shifted: day of the week, then time of day of UTC + 3 h.
    let day_ms = u64::try_from((START_MS + 59_000) % 86_400_000).unwrap() - 18_000 + 10_800_000;
    Recording {
        name: "RTCM 3",
        header: Vec::new(),
        epochs: (0..count).map(epoch).collect(),
        glonass: frame(&msm4(1_084, 4 << 27 | day_ms, &[3], 67)),
        is_text: false,
    }
}

/// An MSM4 message with one signal of each satellite (RTCM 10403.3, tables 3.5-78 to 3.5-81), `rough_ms` away.
pub fn msm4(number: u64, epoch_time: u64, satellites: &[u8], rough_ms: u64) -> Vec<u8> {
    // Signal 2 is C/A of GPS and GLONASS.
    msm4_of((number, 2), epoch_time, satellites, rough_ms)
}

/// The same of another signal, 1 to 32.
pub fn msm4_of((number, signal): (u64, u32), epoch_time: u64, satellites: &[u8], rough_ms: u64) -> Vec<u8> {
    let mut bits: Vec<bool> = Vec::new();
    let mut put = |value: u64, count: u32| bits.extend((0..count).rev().map(|place| value >> place & 1 == 1));
    put(number, 12);
    put(1, 12);
    put(epoch_time, 30);
    put(0, 1 + 3 + 7 + 2 + 2 + 1 + 3);
    put(satellites.iter().map(|satellite| 1 << (64 - satellite)).sum(), 64);
    put(1 << (32 - signal), 32);
    put((1 << satellites.len()) - 1, u32::try_from(satellites.len()).unwrap());
    for (value, count) in [(rough_ms, 8), (512, 10), (100, 15), (200, 22), (9, 4), (0, 1), (45, 6)] {
        for _ in satellites {
            put(value, count);
        }
    }
    bits.chunks(8)
        .map(|byte| (0..8).fold(0, |sum, place| sum << 1 | u8::from(byte.get(place) == Some(&true))))
        .collect()
}

/// A message in its frame.
pub fn frame(message: &[u8]) -> Vec<u8> {
    let [.., high, low] = message.len().to_be_bytes();
    let mut frame = [&[0xd3, high, low], message].concat();
    let mut crc = 0_u32;
    for byte in &frame {
        crc ^= u32::from(*byte) << 16;
        for _ in 0..8 {
            crc = if crc & 0x80_0000 == 0 { crc << 1 } else { crc << 1 ^ 0x0186_4cfb };
        }
    }
    frame.extend_from_slice(&crc.to_be_bytes()[1..]);
    frame
}

impl Recording {
    /// All of it.
    pub fn bytes(&self) -> Vec<u8> {
        [self.header.clone(), self.epochs.concat()].concat()
    }

    /// With a text of all epochs, or of one, replaced.
    pub fn replaced(&self, epochs: std::ops::Range<usize>, from: &str, to: &[u8]) -> Vec<u8> {
        let mut copy = self.clone();
        for epoch in &mut copy.epochs[epochs] {
            let at = epoch.windows(from.len()).position(|window| window == from.as_bytes());
            let at = at.unwrap_or_else(|| panic!("{}: no '{from}' to replace", self.name));
            epoch.splice(at..at + from.len(), to.iter().copied());
        }
        copy.bytes()
    }
}
