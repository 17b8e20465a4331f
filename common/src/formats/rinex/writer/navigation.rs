//! Navigation files.

use super::{calendar_columns, labelled, program_line, scientific};
use crate::atmosphere::KlobucharCoefficients;
use crate::gnss::Constellation;
use crate::orbit::IonosphereTerms;
use crate::orbit::{KeplerEphemeris, NavigationMessage, UNKNOWN_ACCURACY_M};
use crate::time::{BEIDOU_BEHIND_GPS_S, BEIDOU_WEEK_OFFSET};

/// Data sources of Galileo messages (RINEX 3.05, table A8): E1-B and E5b-I with the clock for E5b and E1; E5a-I with
/// the clock for E5a and E1.
const INAV_SOURCES: f64 = 517.0;
const FNAV_SOURCES: f64 = 258.0;
/// A time of transmission that is not known.
const UNKNOWN_TRANSMISSION: f64 = 0.9999e9;

/// The header of a navigation file, with END OF HEADER. `created` as in [`super::RecordingInfo::created`].
pub fn navigation_header(created: &str, ionosphere: &IonosphereTerms, leap_seconds: Option<i64>) -> String {
    let version = format!("{:>9}{:11}{:<20}{:<20}", "3.05", "", "N: GNSS NAV DATA", "M: MIXED");
    let mut text = labelled(&version, "RINEX VERSION / TYPE");
    text += &program_line(created);
    let klobuchar = [("GPSA", "GPSB", ionosphere.gps), ("BDSA", "BDSB", ionosphere.beidou)];
    for (first, second, terms) in klobuchar {
        if let Some(KlobucharCoefficients { alpha, beta }) = terms {
            text += &ionosphere_line(first, &alpha);
            text += &ionosphere_line(second, &beta);
        }
    }
    if let Some(terms) = ionosphere.galileo {
        text += &ionosphere_line("GAL", &terms);
    }
    if let Some(leap_seconds) = leap_seconds {
        text += &labelled(&format!("{leap_seconds:6}"), "LEAP SECONDS");
    }
    text + &labelled("", "END OF HEADER")
}

fn ionosphere_line(name: &str, numbers: &[f64]) -> String {
    let numbers: String = numbers.iter().map(|value| scientific(*value, 12, 4)).collect();
    labelled(&format!("{name:<5}{numbers}"), "IONOSPHERIC CORR")
}

/// The record of an ephemeris (RINEX 3.05, tables A6, A8, A12, A14). `None` for systems whose records have another
/// form, or when the calendar cannot show its time.
///
/// Fields that [`KeplerEphemeris`] does not keep are written as unknown: time of transmission, fit interval, codes on L2.
pub fn navigation_record(ephemeris: &KeplerEphemeris) -> Option<String> {
    let constellation = ephemeris.satellite.constellation;
    let (behind_s, week_offset) = match constellation {
        Constellation::Gps | Constellation::Galileo | Constellation::Qzss => (0.0, 0),
        Constellation::Beidou => (BEIDOU_BEHIND_GPS_S, BEIDOU_WEEK_OFFSET),
        Constellation::Glonass | Constellation::Navic | Constellation::Sbas => return None,
    };
    let mut text = format!("{} {}", ephemeris.satellite, calendar_columns(ephemeris.toc - behind_s)?);
    let (af0, af1, af2) = ephemeris.clock;
    for value in [af0, af1, af2] {
        text += &scientific(value, 19, 12);
    }
    text.push('\n');
    let week = (ephemeris.toe - behind_s).week() - week_offset;
    for line in lines(ephemeris, week as f64) {
        text += "    ";
        for value in line {
            text += &scientific(value, 19, 12);
        }
        text.truncate(text.trim_end().len());
        text.push('\n');
    }
    Some(text)
}

/// The accuracy. An unknown one is −1 of Galileo (RINEX 3.05, table A8); for the others RINEX has no word, and files
/// have zero.
fn accuracy_m(e: &KeplerEphemeris) -> f64 {
    match e.satellite.constellation {
        _ if (e.accuracy_m - UNKNOWN_ACCURACY_M).abs() > 0.0 => e.accuracy_m,
        Constellation::Galileo => -1.0,
        _ => 0.0,
    }
}

/// The seven lines after the first.
fn lines(e: &KeplerEphemeris, week: f64) -> [[f64; 4]; 7] {
    let sources = match e.message {
        NavigationMessage::GalileoInav => INAV_SOURCES,
        NavigationMessage::GalileoFnav => FNAV_SOURCES,
        NavigationMessage::Lnav | NavigationMessage::BeidouD1D2 => 0.0,
    };
    let (issue, issue_of_clock) = (f64::from(e.issue_of_data), f64::from(e.issue_of_clock));
    let (first_delay, second_delay) = e.group_delays_s;
    let (second_delay, last) = match e.message {
        NavigationMessage::Lnav => (issue_of_clock, f64::NAN),
        NavigationMessage::BeidouD1D2 => (second_delay, issue_of_clock),
        NavigationMessage::GalileoInav | NavigationMessage::GalileoFnav => (second_delay, f64::NAN),
    };
    [
        [issue, e.crc_crs_m.1, e.delta_n_radps, e.m0_rad],
        [e.cuc_cus_rad.0, e.eccentricity, e.cuc_cus_rad.1, e.sqrt_a],
        [e.toe_own_tow_s, e.cic_cis_rad.0, e.omega0_rad, e.cic_cis_rad.1],
        [e.i0_rad, e.crc_crs_m.0, e.omega_rad, e.omega_dot_radps],
        [e.i_dot_radps, sources, week, 0.0],
        [accuracy_m(e), e.health, first_delay, second_delay],
        [UNKNOWN_TRANSMISSION, last, f64::NAN, f64::NAN],
    ]
}
