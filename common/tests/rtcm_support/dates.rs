//! Streams with a date: observations of one satellite, ephemerides with their week.

use cofix_common::formats::decode::{Decoder, Record};
use cofix_common::formats::rtcm::{Dating, DatingHint, RtcmDecoder, RtcmOptions, StreamDates};
use cofix_common::skips::Skips;
use cofix_common::time::GpsTime;
use rtcm_rs::Message;
use rtcm_rs::msg::{Msg1019T, Msg1042T, Msg1044T, Msg1045T, Msg1046T};

use super::{Writer, frame, lnav};

pub const DAY_S: f64 = 86_400.0;
pub const WEEK_S: f64 = 7.0 * DAY_S;
pub const GPS: u64 = 1_074;
pub const GLONASS: u64 = 1_084;
pub const GALILEO: u64 = 1_094;
pub const BEIDOU: u64 = 1_124;

pub fn at(text: &str) -> GpsTime {
    text.parse().unwrap()
}

/// Milliseconds of a week or a day.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // below a week
fn millis_of(time: GpsTime, period_s: f64) -> u64 {
    ((time.tow_s() % period_s) * 1e3).round() as u64
}

/// An MSM4 message of an instant with one signal of satellite 7, which is the last of its epoch; GLONASS with its day of the week.
pub fn observed(number: u64, time: GpsTime) -> Vec<u8> {
    match number {
        GLONASS => {
            let moscow = time + (3.0 * 3_600.0 - 18.0);
            glonass(time, millis_of(moscow, WEEK_S) / 86_400_000)
        }
        BEIDOU => msm(number, millis_of(time + -14.0, WEEK_S)),
        _ => msm(number, millis_of(time, WEEK_S)),
    }
}

/// The same of GLONASS with a day of the week of choice.
pub fn glonass(time: GpsTime, day: u64) -> Vec<u8> {
    msm(GLONASS, day << 27 | millis_of(time + (3.0 * 3_600.0 - 18.0), DAY_S))
}

fn msm(number: u64, epoch_time: u64) -> Vec<u8> {
    let mut writer = Writer::default()
        .unsigned(12, number)
        .unsigned(12, 1)
        .unsigned(30, epoch_time)
        .unsigned(1, u64::from(number != BEIDOU))
        .unsigned(18, 0)
        .unsigned(64, 1 << (64 - 7))
        .unsigned(32, 1 << 30) // signal 2
        .unsigned(1, 1);
    for (value, count) in [(74, 8), (512, 10), (100, 15), (200, 22), (9, 4), (0, 1), (45, 6)] {
        writer = writer.unsigned(count, value);
    }
    writer.frame()
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // weeks
fn week(time: GpsTime, offset: i64, period: i64) -> u16 {
    (time.week() - offset).rem_euclid(period) as u16
}

/// A GPS ephemeris sent at an instant, which the week is of, for a reference time.
pub fn gps(satellite: u8, sent: GpsTime, toe: GpsTime) -> Vec<u8> {
    #[allow(clippy::cast_possible_truncation)] // multiples of 16 s
    let toe_s = toe.tow_s() as f32;
    frame(&Message::Msg1019(Msg1019T {
        gps_satellite_id: satellite,
        gps_week_number: week(sent, 0, 1_024),
        toe_s,
        toc_s: toe_s,
        ..lnav()
    }))
}

/// Ephemerides of the other systems that have weeks; BeiDou's reference time is 14 s later, which is the same number there.
#[allow(clippy::cast_possible_truncation)] // whole minutes
pub fn others(toe: GpsTime) -> [Vec<u8>; 4] {
    let g = lnav();
    let (sqrt_a_sqrt_m, toe_s) = (g.sqrt_a_sqrt_m, toe.tow_s() as f32);
    let galileo_week = week(toe, 1_024, 4_096);
    [
        frame(&Message::Msg1042(Msg1042T {
            bds_satellite_id: 21,
            bds_week_number: week(toe, 1_356, 8_192),
            toc_s: toe_s,
            toe_s,
            sqrt_a_sqrt_m,
            ..Msg1042T::default()
        })),
        frame(&Message::Msg1044(Msg1044T {
            qzss_satellite_id: 2,
            qzss_week_number: week(toe, 0, 1_024),
            toc_s: toe_s,
            toe_s,
            sqrt_a_sqrt_m,
            ..Msg1044T::default()
        })),
        frame(&Message::Msg1045(Msg1045T {
            gal_satellite_id: 11,
            gal_week_number: galileo_week,
            toc_s: toe_s,
            toe_s,
            sqrt_a_sqrt_m,
            ..Msg1045T::default()
        })),
        frame(&Message::Msg1046(Msg1046T {
            gal_satellite_id: 12,
            gal_week_number: galileo_week,
            toc_s: toe_s,
            toe_s,
            sqrt_a_sqrt_m,
            ..Msg1046T::default()
        })),
    ]
}

/// A GLONASS ephemeris for a quarter of an hour, sent on a day whose number it carries, and with that of the four years from 1996.
pub fn glonass_ephemeris(slot: u64, sent: GpsTime, toe: GpsTime, four_years: u64) -> Vec<u8> {
    let moscow = |time: GpsTime| time + (3.0 * 3_600.0 - 18.0);
    let days = (moscow(sent) - at("2020-01-01T00:00:00")).div_euclid(DAY_S);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a year
    let day = days as u64 + 1;
    let quarter = millis_of(moscow(toe), DAY_S) / 900_000;
    Writer::default()
        .unsigned(12, 1020)
        .unsigned(6, slot)
        .unsigned(5, 8)
        .unsigned(2 + 2 + 12 + 2, 0)
        .unsigned(7, quarter)
        .signed(24, -2_159_766)
        .signed(27, 40_218_254)
        .signed(5, 0)
        .signed(24, 885_946)
        .signed(27, 67_807)
        .signed(5, 0)
        .signed(24, -2_618_952)
        .signed(27, -33_212_595)
        .signed(5, 0)
        .unsigned(1 + 11 + 2 + 1 + 22 + 5 + 5 + 1 + 4, 0)
        .unsigned(11, day)
        .unsigned(2, 1)
        .unsigned(1, u64::from(four_years > 0))
        .unsigned(11 + 32, 0)
        .unsigned(5, four_years)
        .unsigned(22 + 1 + 7, 0)
        .frame()
}

/// What a stream gives.
#[derive(Debug)]
pub struct Read {
    pub epochs: Vec<GpsTime>,
    pub toes: Vec<GpsTime>,
    /// Observations by the first letter of their satellites.
    pub systems: String,
    pub skips: Skips,
}

/// Reads a stream as it comes.
pub fn read(stream: &[Vec<u8>], near: GpsTime) -> Read {
    read_by(RtcmDecoder::new(RtcmOptions::near(near)), stream)
}

/// Reads a recording whose dates are found first.
pub fn read_recording(stream: &[Vec<u8>], hint: DatingHint) -> (Read, StreamDates) {
    let mut dating = Dating::new(hint, 18);
    for message in stream {
        dating.feed(message);
    }
    let dates = dating.finish().unwrap();
    let decoder = RtcmDecoder::new(RtcmOptions::near(dates.begins())).with_dates(&dates);
    (read_by(decoder, stream), dates)
}

fn read_by(mut decoder: RtcmDecoder, stream: &[Vec<u8>]) -> Read {
    let (mut epochs, mut toes, mut systems) = (Vec::new(), Vec::new(), Vec::new());
    for message in stream {
        decoder.feed(message).unwrap();
    }
    decoder.finish().unwrap();
    while let Some(record) = decoder.next_record() {
        match record {
            Record::Epoch(epoch) => {
                epochs.push(epoch.time_gps);
                let letters = epoch.observations.iter().map(|o| o.satellite.constellation.letter());
                systems.push(letters.collect::<String>());
            }
            Record::Ephemeris(ephemeris) => toes.push(ephemeris.toe),
            Record::Glonass(ephemeris) => toes.push(ephemeris.toe),
            Record::Event(_) => {}
        }
    }
    Read { epochs, toes, systems: systems.join(" "), skips: decoder.skips().clone() }
}
