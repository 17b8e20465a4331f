//! Galileo F/NAV pages to ephemerides (Galileo OS SIS ICD 2.1, 4.2 and 5.1).

use super::galileo_time::{check_number, check_week, reference};
use super::pieces::Pieces;
use super::{ReceiverCheck, Refused, news, refused};
use crate::formats::bits::{angle, crc24q_of_bits, number, positive, unsigned};
use crate::gnss::SatelliteId;
use crate::orbit::{KeplerEphemeris, NavigationMessage, sisa_m};
use crate::skips::Reason;
use crate::time::GpsTime;

/// Bytes of a page as Android gives it: 238 bits, without synchronisation and tail bits.
const PAGE_BYTES: usize = 30;
/// Bits under the CRC, which follows them: page type and data.
const CHECKED: usize = 214;

/// A page.
type Page = [u8; PAGE_BYTES];

/// Puts F/NAV pages 1 to 4 together. One serves all satellites.
#[derive(Clone, Debug, Default)]
pub struct FnavAssembler {
    pages: Pieces<Page, 4>,
}

impl FnavAssembler {
    /// Takes a page of 30 bytes. `now` resolves the week; it may be days off. Gives the ephemeris that the page completes, unless
    /// it equals the last one given. F/NAV does not carry BGD E1-E5b, which is NaN then.
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
        let page = checked(bytes, receiver).map_err(|refused| refused.of(satellite))?;
        let number = unsigned(&page, 0, 6);
        let Some((pages, given)) = self.pages.put(satellite, number, page) else { return Ok(None) };
        let [one, two, three, four] = &pages;
        let issue = unsigned(one, 12, 10);
        if [two, three, four].iter().any(|page| unsigned(*page, 6, 10) != issue) {
            return Ok(None);
        }
        check_number(satellite, unsigned(one, 6, 6), Reason::FNavPagesOfOtherSatellite)?;
        check_week(satellite, unsigned(one, 155, 12), now)?;
        news(given, ephemeris(satellite, &pages, now)?)
    }
}

/// The page if its CRC is right, or blanked by a receiver that vouches for it. All its bits may be turned over, where the
/// receiver is locked half a cycle off.
fn checked(bytes: &[u8], receiver: ReceiverCheck) -> Result<Page, Refused> {
    let Ok(page) = Page::try_from(bytes) else {
        let detail = format!("{} bytes, {PAGE_BYTES} expected", bytes.len());
        return Err(refused(Reason::FNavPageWrongLength, detail));
    };
    let blanked = crc_of(&page) == 0 && receiver == ReceiverCheck::Passed;
    let inverted = page.map(|byte| !byte);
    if blanked {
        return Ok(page);
    }
    [page, inverted]
        .into_iter()
        .find(|page| u64::from(crc24q_of_bits(page, CHECKED)) == crc_of(page))
        .ok_or_else(|| refused(Reason::FNavPageWrongCrc, format!("{bytes:02x?}")))
}

/// The CRC that was sent.
fn crc_of(page: &Page) -> u64 {
    unsigned(page, CHECKED, 24)
}

/// Section 4.2 of the ICD. Pages count from 1 here, bits from 0.
fn ephemeris(
    satellite: SatelliteId,
    [one, two, three, four]: &[Page; 4],
    now: GpsTime,
) -> Result<KeplerEphemeris, Refused> {
    let issue = u32::try_from(unsigned(one, 12, 10)).unwrap_or_default();
    Ok(KeplerEphemeris {
        satellite,
        message: NavigationMessage::GalileoFnav,
        toe: reference("toe", unsigned(three, 160, 14), satellite, now)?,
        toe_own_tow_s: unsigned(three, 160, 14) as f64 * 60.0,
        toc: reference("toc", unsigned(one, 22, 14), satellite, now)?,
        sqrt_a: positive(two, 104, 32, -19),
        eccentricity: positive(two, 72, 32, -33),
        i0_rad: angle(three, 16, 32, -31),
        i_dot_radps: angle(two, 168, 14, -43),
        omega0_rad: angle(two, 136, 32, -31),
        omega_dot_radps: angle(two, 48, 24, -43),
        omega_rad: angle(three, 48, 32, -31),
        m0_rad: angle(two, 16, 32, -31),
        delta_n_radps: angle(three, 80, 16, -43),
        cuc_cus_rad: (number(three, 96, 16, -29), number(three, 112, 16, -29)),
        crc_crs_m: (number(three, 128, 16, -5), number(three, 144, 16, -5)),
        cic_cis_rad: (number(four, 16, 16, -29), number(four, 32, 16, -29)),
        clock: (number(one, 36, 31, -34), number(one, 67, 21, -46), number(one, 88, 6, -59)),
        group_delays_s: (number(one, 143, 10, -32), f64::NAN),
        accuracy_m: sisa_m(unsigned(one, 94, 8)),
        health: health(one),
        issue_of_data: issue,
        issue_of_clock: issue,
    })
}

/// Health as RINEX 3.05 (table A8) packs it: bit 3 E5a DVS, bits 4 and 5 E5a HS. The others are not in F/NAV.
fn health(one: &Page) -> f64 {
    let (e5a_hs, e5a_dvs) = (unsigned(one, 153, 2), unsigned(one, 187, 1));
    (e5a_dvs << 3 | e5a_hs << 4) as f64
}
