//! LNAV subframes to ephemerides (IS-GPS-200, 20.3.3; IS-QZSS-PNT has the same layout).

use super::lnav_words::{Data, data};
use super::pieces::Pieces;
use super::week::nearest;
use super::{ReceiverCheck, Refused, check_references, news, refused};
use crate::atmosphere::KlobucharCoefficients;
use crate::formats::bits::{angle, number, positive, signed, unsigned};
use crate::gnss::{Constellation, SatelliteId};
use crate::orbit::{KeplerEphemeris, NavigationMessage, ura_m};
use crate::skips::Reason;
use crate::time::GpsTime;

/// Subframes that are farther apart than this do not belong together even with equal issues of data, s: an issue may come
/// back after six hours.
const MAX_APART_S: f64 = 7_200.0;
/// Page of subframe 4 with ionosphere and UTC terms: its satellite number.
const IONOSPHERE_PAGE: u64 = 56;

/// The terms of GPS satellites' messages that concern the whole system.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LnavSystem {
    /// Klobuchar coefficients.
    pub klobuchar: Option<KlobucharCoefficients>,
    /// Seconds that GPS time is ahead of UTC, before the event that the message may announce.
    pub leap_seconds: Option<i64>,
}

/// Puts subframes together. One serves all satellites.
#[derive(Clone, Debug, Default)]
pub struct LnavAssembler {
    subframes: Pieces<Subframe, 3>,
    system: LnavSystem,
}

#[derive(Clone, Copy, Debug, Default)]
struct Subframe {
    data: Data,
    sent: GpsTime,
}

impl LnavAssembler {
    /// Takes a subframe: 40 bytes, ten words of 30 bits in four bytes each. `now` resolves the week; it may be days off.
    /// Gives the ephemeris that the subframe completes, unless it equals the last one given.
    ///
    /// # Errors
    /// When the subframe is damaged, or the ephemeris that it completes cannot be one.
    pub fn subframe(
        &mut self,
        satellite: SatelliteId,
        bytes: &[u8],
        receiver: ReceiverCheck,
        now: GpsTime,
    ) -> Result<Option<KeplerEphemeris>, Refused> {
        let data = data(bytes, receiver).map_err(|refused| refused.of(satellite))?;
        let number = unsigned(&data, 24 + 19, 3);
        let sent = sent(&data, satellite, now)?;
        match number {
            1..=3 => match self.subframes.put(satellite, number, Subframe { data, sent }) {
                Some((subframes, given)) => complete(satellite, &subframes, given),
                None => Ok(None),
            },
            4 => {
                // QZSS sends coefficients that are fitted to Japan alone.
                if satellite.constellation == Constellation::Gps {
                    self.page(&data);
                }
                Ok(None)
            }
            5 => Ok(None),
            _ => Err(refused(Reason::LnavSubframeImpossibleNumber, format!("{satellite}: {number}"))),
        }
    }

    /// Ionosphere and leap seconds, as far as they have come.
    pub const fn system(&self) -> LnavSystem {
        self.system
    }

    /// Subframe 4, page 18 (IS-GPS-200, 20.3.3.5.1.6 and .7).
    fn page(&mut self, data: &Data) {
        if unsigned(data, 50, 6) != IONOSPHERE_PAGE {
            return;
        }
        self.system.klobuchar = Some(klobuchar(data, 56));
        self.system.leap_seconds = Some(signed(data, 192, 8));
    }
}

/// The eight Klobuchar coefficients from bit `start` on, as GPS and BeiDou send them (IS-GPS-200, table 20-X; BDS-SIS-ICD-B1I,
/// 5.2.4.7).
pub(super) fn klobuchar(bytes: &[u8], start: usize) -> KlobucharCoefficients {
    let term = |k: usize, exponent: i32| number(bytes, start + 8 * k, 8, exponent);
    KlobucharCoefficients {
        alpha: [term(0, -30), term(1, -27), term(2, -24), term(3, -24)],
        beta: [term(4, 11), term(5, 14), term(6, 16), term(7, 16)],
    }
}

/// When the subframe began, from the count of the next one in the handover word.
fn sent(data: &Data, satellite: SatelliteId, now: GpsTime) -> Result<GpsTime, Refused> {
    let next = unsigned(data, 24, 17);
    if next >= 100_800 {
        let detail = format!("{satellite}: count {next}, limit 100799");
        return Err(refused(Reason::LnavSubframeImpossibleTime, detail));
    }
    Ok(nearest(next as f64 * 6.0 - 6.0, now))
}

/// The ephemeris of subframes that belong together.
fn complete(
    satellite: SatelliteId,
    [first, second, third]: &[Subframe; 3],
    given: &mut Option<KeplerEphemeris>,
) -> Result<Option<KeplerEphemeris>, Refused> {
    let issue = unsigned(&second.data, 48, 8);
    let same_issue = unsigned(&third.data, 216, 8) == issue && unsigned(&first.data, 168, 8) == issue;
    let together = [second, third].iter().all(|other| (other.sent - first.sent).abs() <= MAX_APART_S);
    if !same_issue || !together {
        return Ok(None);
    }
    news(given, ephemeris(satellite, first, &second.data, &third.data)?)
}

/// IS-GPS-200, tables 20-I and 20-III, figure 20-1. Positions count data bits only, 24 to a word.
fn ephemeris(
    satellite: SatelliteId,
    first: &Subframe,
    second: &Data,
    third: &Data,
) -> Result<KeplerEphemeris, Refused> {
    let clock = &first.data;
    check_week(satellite, first)?;
    let toe_own_tow_s = positive(second, 216, 16, 4);
    let toc_tow_s = positive(clock, 176, 16, 4);
    check_references(satellite, toe_own_tow_s, toc_tow_s)?;
    Ok(KeplerEphemeris {
        satellite,
        message: NavigationMessage::Lnav,
        toe: nearest(toe_own_tow_s, first.sent),
        toe_own_tow_s,
        toc: nearest(toc_tow_s, first.sent),
        sqrt_a: positive(second, 184, 32, -19),
        eccentricity: positive(second, 136, 32, -33),
        i0_rad: angle(third, 112, 32, -31),
        i_dot_radps: angle(third, 224, 14, -43),
        omega0_rad: angle(third, 64, 32, -31),
        omega_dot_radps: angle(third, 192, 24, -43),
        omega_rad: angle(third, 160, 32, -31),
        m0_rad: angle(second, 88, 32, -31),
        delta_n_radps: angle(second, 72, 16, -43),
        cuc_cus_rad: (number(second, 120, 16, -29), number(second, 168, 16, -29)),
        crc_crs_m: (number(third, 144, 16, -5), number(second, 56, 16, -5)),
        cic_cis_rad: (number(third, 48, 16, -29), number(third, 96, 16, -29)),
        clock: (number(clock, 216, 22, -31), number(clock, 200, 16, -43), number(clock, 192, 8, -55)),
        group_delays_s: (number(clock, 160, 8, -31), 0.0),
        accuracy_m: ura_m(unsigned(clock, 60, 4)),
        health: unsigned(clock, 64, 6) as f64,
        issue_of_data: u32::try_from(unsigned(second, 48, 8)).unwrap_or_default(),
        issue_of_clock: u32::try_from(unsigned(clock, 70, 2) << 8 | unsigned(clock, 168, 8))
            .unwrap_or_default(),
    })
}

/// The week of the message, modulo 1024, must be that of its transmission.
fn check_week(satellite: SatelliteId, first: &Subframe) -> Result<(), Refused> {
    let broadcast = unsigned(&first.data, 48, 10);
    let expected = first.sent.week().rem_euclid(1024);
    if i64::try_from(broadcast) == Ok(expected) {
        return Ok(());
    }
    let detail = format!("{satellite}: week {broadcast}, {expected} expected at {}", first.sent);
    Err(refused(Reason::EphemerisOfOtherWeek, detail))
}
