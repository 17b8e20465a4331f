//! A small log with `Nav` lines of every message that is decoded, and of those that are not.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod broadcast_words;
mod navbits_encoder;

use std::fmt::Write as _;

use broadcast_words::{C06, E01, c01, e01_fnav, r01};
use cofix_common::atmosphere::KlobucharCoefficients;
use cofix_common::formats::decode::{Decoder, Record};
use cofix_common::formats::gnsslogger::GnssLoggerDecoder;
use cofix_common::formats::navbits::{
    BeidouAssembler, GlonassAssembler, GlonassClock, GlonassLabel, GlonassName, ReceiverCheck,
};
use cofix_common::formats::stream::ObservationStream;
use cofix_common::orbit::{GlonassEphemeris, KeplerEphemeris, NavigationMessage};
use cofix_common::skips::{Reason, Skips};
use cofix_common::time::GpsTime;
use navbits_encoder::glonass::{Frame, strings};
use navbits_encoder::{LnavFields, beidou, page};

const HEADER: &str = "# Raw,TimeNanos,FullBiasNanos,Svid,State,ReceivedSvTimeNanos,Cn0DbHz,PseudorangeRateMetersPerSecond,\
    CarrierFrequencyHz,ConstellationType\n";
const WEEK_NS: i64 = 604_800_000_000_000;
const DAY_NS: i64 = 86_400_000_000_000;
const TRAVEL_NS: i64 = 75_000_000;
/// Moscow is three hours ahead of UTC, GPS time 18 s.
const MOSCOW_NS: i64 = (10_800 - 18) * 1_000_000_000;

/// The instant of the log: when the quoted Galileo pages were sent, and the others are made.
fn then() -> GpsTime {
    GpsTime::from_week_tow(2038, 518_400.0)
}

fn klobuchar() -> KlobucharCoefficients {
    let alpha = [2_f64.powi(-28), 0.0, -(2_f64.powi(-24)), 2_f64.powi(-22)];
    KlobucharCoefficients { alpha, beta: [98_304.0, 0.0, -65_536.0, 131_072.0] }
}

/// A satellite's signal a number of seconds after the log's instant.
fn raw(seconds: i64, (system, svid): (i64, i64), frequency: &str) -> String {
    const START_NS: i64 = 1_000_000_000_000_000_000;
    let gps_ns = then().nanos() + seconds * 1_000_000_000;
    let (state, received) = match system {
        3 => (129, (gps_ns - TRAVEL_NS + MOSCOW_NS).rem_euclid(DAY_NS)),
        _ => (16_431, (gps_ns - TRAVEL_NS).rem_euclid(WEEK_NS)),
    };
    format!("Raw,{},-{START_NS},{svid},{state},{received},40.0,0.0,{frequency},{system}\n", gps_ns - START_NS)
}

fn nav(svid: i64, kind: i64, (frame, piece): (i64, usize), bytes: &[u8]) -> String {
    let mut line = format!("Nav,{svid},{kind},1,{frame},{piece}");
    for byte in bytes {
        write!(line, ",{}", byte.cast_signed()).unwrap();
    }
    line + "\n"
}

fn in_bytes(words: &[u32; 10]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_be_bytes()).collect()
}

/// Lines of one satellite's pieces.
fn lines(svid: i64, kind: i64, frame: i64, pieces: impl IntoIterator<Item = Vec<u8>>) -> String {
    pieces.into_iter().zip(1..).map(|(bytes, piece)| nav(svid, kind, (frame, piece), &bytes)).collect()
}

fn lnav() -> Vec<Vec<u8>> {
    let fields =
        LnavFields { week: 2038, tow_s: 518_400.0, toe: 32_400, toc: 32_400, ..LnavFields::like_prn4() };
    fields.subframes().iter().map(in_bytes).collect()
}

/// A BeiDou ephemeris as it was broadcast, moved to the log's time.
fn beidou_ephemeris(name: &str, subframes: &[[u32; 10]]) -> KeplerEphemeris {
    let (mut assembler, satellite) = (BeidouAssembler::default(), name.parse().unwrap());
    let sent = GpsTime::from_beidou_week_tow(810, 345_614.0);
    let feed = |words: &[u32; 10]| {
        assembler.subframe(satellite, &in_bytes(words), ReceiverCheck::Unknown, sent).unwrap()
    };
    let e = subframes.iter().filter_map(feed).last().unwrap();
    let toe = GpsTime::from_beidou_week_tow(2038 - 1356, 518_400.0);
    KeplerEphemeris { toe, toc: toe, toe_own_tow_s: 518_400.0, ..e }
}

/// A GLONASS ephemeris as it was broadcast, moved to the log's time.
fn glonass_ephemeris() -> GlonassEphemeris {
    let sent = "2015-06-27T00:40:16".parse().unwrap();
    let mut assembler = GlonassAssembler::default();
    let label =
        GlonassLabel { name: GlonassName::Slot(1), frame: 1, string: None, receiver: ReceiverCheck::Unknown };
    let clock = GlonassClock { now: sent, leap_seconds: 16 };
    let message = r01().iter().find_map(|string| assembler.string(label, string, clock).unwrap()).unwrap();
    GlonassEphemeris { toe: then() + 918.0, ..message.on_channel(1) }
}

fn glonass(slot: u8) -> Vec<Vec<u8>> {
    let mut e = glonass_ephemeris();
    e.satellite.number = slot;
    strings(&e, Frame { sent: then() + 18.0, leap_seconds: 18, is_modern: true }).to_vec()
}

/// The `Nav` lines of a satellite of every kind.
fn all_nav_lines() -> String {
    let d1 = beidou::d1(&beidou_ephemeris("C06", &C06), &klobuchar(), then() + 14.0);
    let d2 = beidou::d2(&beidou_ephemeris("C01", &c01()), &klobuchar(), then() + 14.0);
    lines(4, 0x0101, -1, lnav())
        + &lines(193, 0x0401, -1, lnav())
        + &lines(1, 0x0601, 1, E01.iter().map(|word| page(word, true)))
        + &lines(1, 0x0602, 1, e01_fnav())
        + &lines(6, 0x0501, 1, d1.iter().map(in_bytes))
        + &lines(1, 0x0502, 1, d2.iter().map(in_bytes))
        + &lines(1, 0x0301, 3, glonass(1))
        // On channel −4, of unknown slot.
        + &lines(96, 0x0301, 3, glonass(7))
}

struct Decoded {
    kepler: Vec<KeplerEphemeris>,
    glonass: Vec<GlonassEphemeris>,
    skips: Skips,
    decoder: GnssLoggerDecoder,
}

fn decode(text: &str) -> Decoded {
    let mut decoder = GnssLoggerDecoder::default();
    decoder.feed(text.as_bytes()).unwrap();
    decoder.finish().unwrap();
    let (mut kepler, mut glonass) = (Vec::new(), Vec::new());
    while let Some(record) = decoder.next_record() {
        match record {
            Record::Epoch(_) | Record::Event(_) => {}
            Record::Ephemeris(ephemeris) => kepler.push(*ephemeris),
            Record::Glonass(ephemeris) => glonass.push(*ephemeris),
        }
    }
    Decoded { kepler, glonass, skips: decoder.skips().clone(), decoder }
}

/// Signals of which one tells the channel of R01.
fn epoch(seconds: i64) -> String {
    raw(seconds, (1, 4), "1575420030") + &raw(seconds, (3, 1), "1602562500")
}

#[test]
fn every_system_comes_from_its_lines() {
    for text in [
        format!("{HEADER}{}{}{}", epoch(0), all_nav_lines(), epoch(1)),
        // Lines that come before the first epoch wait for it, and those of R01 for its signal.
        format!("{HEADER}{}{}{}", all_nav_lines(), epoch(0), epoch(1)),
        format!("{HEADER}{}{}{}", raw(0, (1, 4), "1575420030"), all_nav_lines(), epoch(1)),
    ] {
        let decoded = decode(&text);
        assert!(decoded.skips.is_empty(), "{}", decoded.skips);
        let mut found: Vec<_> = decoded.kepler.iter().map(|e| (e.satellite.to_string(), e.message)).collect();
        found.sort_by(|a, b| a.0.cmp(&b.0));
        let named = |name: &str, message| (name.to_owned(), message);
        assert_eq!(
            found,
            [
                named("C01", NavigationMessage::BeidouD1D2),
                named("C06", NavigationMessage::BeidouD1D2),
                named("E01", NavigationMessage::GalileoInav),
                named("E01", NavigationMessage::GalileoFnav),
                named("G04", NavigationMessage::Lnav),
                named("J01", NavigationMessage::Lnav),
            ]
        );
        for (name, subframes) in [("C01", c01()), ("C06", C06.to_vec())] {
            let expected = beidou_ephemeris(name, &subframes);
            assert!(decoded.kepler.contains(&expected), "{name}");
        }
        let mut glonass = decoded.glonass.clone();
        glonass.sort_by_key(|e| e.satellite);
        let mut by_channel = GlonassEphemeris { frequency_channel: -4, ..glonass_ephemeris() };
        by_channel.satellite.number = 7;
        assert_eq!(glonass, [glonass_ephemeris(), by_channel]);
        assert_eq!(decoded.decoder.ionosphere().beidou, Some(klobuchar()));
        assert_eq!(decoded.decoder.ionosphere().gps, None);
    }
}

#[test]
fn the_rest_is_counted() {
    let mut text = format!("{HEADER}{}", epoch(0));
    // GPS CNAV and CNAV-2, SBAS, BeiDou CNAV, NavIC.
    for (svid, kind) in
        [(4, 0x0102), (4, 0x0103), (4, 0x0104), (120, 0x0201), (20, 0x0503), (20, 0x0504), (3, 0x0701)]
    {
        text += &nav(svid, kind, (1, 1), &[0; 40]);
    }
    text += &nav(1, 0x0501, (1, 1), &in_bytes(&c01()[0]));
    text += &nav(6, 0x0502, (1, 1), &in_bytes(&C06[0]));
    text += &nav(33, 0x0301, (1, 1), &r01()[0]);
    text += &nav(1, 0x0301, (1, 2), &r01()[0]);
    let skips = decode(&text).skips;
    assert_eq!(skips.count(Reason::NavLineNotDecoded), 7);
    assert_eq!(skips.count(Reason::NavLineOfWrongBeidouMessage), 2);
    assert_eq!(skips.count(Reason::SatelliteNumberOutOfRange), 1);
    assert_eq!(skips.count(Reason::GlonassStringOfOtherNumber), 1);
    assert_eq!(skips.total(), 11, "{skips}");
}

/// Old logs have no carrier frequencies, so no channels.
#[test]
fn glonass_without_a_channel_is_counted() {
    let text = format!("{HEADER}{}{}", raw(0, (1, 4), ""), lines(1, 0x0301, 3, glonass(1)));
    let decoded = decode(&text);
    assert!(decoded.glonass.is_empty());
    let reason = Reason::GlonassEphemerisWithoutChannel.text();
    assert_eq!(decoded.skips.count(reason), 1, "{}", decoded.skips);
    let (_, skip) = decoded.skips.iter().find(|(name, _)| *name == reason).unwrap();
    assert_eq!(skip.first, "line 6: R01");
}
