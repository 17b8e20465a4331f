//! Galileo I/NAV words to ephemerides (Galileo OS SIS ICD 2.1, 4.3.5 and 5.1).

use super::galileo_time::{check_number, check_week, reference};
use super::inav_page::{Word, word};
use super::pieces::Pieces;
use super::{ReceiverCheck, Refused, news};
use crate::formats::bits::{angle, number, positive, unsigned};
use crate::gnss::SatelliteId;
use crate::orbit::{KeplerEphemeris, NavigationMessage, sisa_m};
use crate::skips::Reason;
use crate::time::GpsTime;

/// Puts I/NAV words 1 to 5 together. One serves all satellites.
#[derive(Clone, Debug, Default)]
pub struct InavAssembler {
    words: Pieces<Word, 5>,
}

impl InavAssembler {
    /// Takes a page: 29 bytes, the even half and the odd one of 114 bits each, without synchronisation and tail bits.
    /// `now` resolves the week; it may be days off. Gives the ephemeris that the page completes, unless it equals the last one
    /// given.
    ///
    /// # Errors
    /// When the page is damaged, or the ephemeris that it completes cannot be one.
    pub fn page(
        &mut self,
        satellite: SatelliteId,
        bytes: &[u8],
        receiver: ReceiverCheck,
        now: GpsTime,
    ) -> Result<Option<KeplerEphemeris>, Refused> {
        let word = word(bytes, receiver).map_err(|refused| refused.of(satellite))?;
        let Some(word) = word else { return Ok(None) };
        let number = unsigned(&word, 0, 6);
        let Some((words, given)) = self.words.put(satellite, number, word) else { return Ok(None) };
        let [one, two, three, four, five] = &words;
        let issue = unsigned(one, 6, 10);
        if [two, three, four].iter().any(|word| unsigned(*word, 6, 10) != issue) {
            return Ok(None);
        }
        check_number(satellite, unsigned(four, 16, 6), Reason::INavWordsOfOtherSatellite)?;
        check_week(satellite, unsigned(five, 73, 12), now)?;
        news(given, ephemeris(satellite, &words, now)?)
    }
}

/// Tables 42 to 46 and 67 of the ICD. Words count from 0 here.
fn ephemeris(
    satellite: SatelliteId,
    [one, two, three, four, five]: &[Word; 5],
    now: GpsTime,
) -> Result<KeplerEphemeris, Refused> {
    Ok(KeplerEphemeris {
        satellite,
        message: NavigationMessage::GalileoInav,
        toe: reference("toe", unsigned(one, 16, 14), satellite, now)?,
        toe_own_tow_s: unsigned(one, 16, 14) as f64 * 60.0,
        toc: reference("toc", unsigned(four, 54, 14), satellite, now)?,
        sqrt_a: positive(one, 94, 32, -19),
        eccentricity: positive(one, 62, 32, -33),
        i0_rad: angle(two, 48, 32, -31),
        i_dot_radps: angle(two, 112, 14, -43),
        omega0_rad: angle(two, 16, 32, -31),
        omega_dot_radps: angle(three, 16, 24, -43),
        omega_rad: angle(two, 80, 32, -31),
        m0_rad: angle(one, 30, 32, -31),
        delta_n_radps: angle(three, 40, 16, -43),
        cuc_cus_rad: (number(three, 56, 16, -29), number(three, 72, 16, -29)),
        crc_crs_m: (number(three, 88, 16, -5), number(three, 104, 16, -5)),
        cic_cis_rad: (number(four, 22, 16, -29), number(four, 38, 16, -29)),
        clock: (number(four, 68, 31, -34), number(four, 99, 21, -46), number(four, 120, 6, -59)),
        group_delays_s: (number(five, 47, 10, -32), number(five, 57, 10, -32)),
        accuracy_m: sisa_m(unsigned(three, 120, 8)),
        health: health(five),
        issue_of_data: u32::try_from(unsigned(one, 6, 10)).unwrap_or_default(),
        issue_of_clock: u32::try_from(unsigned(one, 6, 10)).unwrap_or_default(),
    })
}

/// Health as RINEX 3.05 (table A8) packs it: bit 0 E1-B DVS, 1-2 E1-B HS, 6 E5b DVS, 7-8 E5b HS. E5a is not in I/NAV.
fn health(five: &Word) -> f64 {
    let (e5b_hs, e1b_hs) = (unsigned(five, 67, 2), unsigned(five, 69, 2));
    let (e5b_dvs, e1b_dvs) = (unsigned(five, 71, 1), unsigned(five, 72, 1));
    (e1b_dvs | e1b_hs << 1 | e5b_dvs << 6 | e5b_hs << 7) as f64
}
