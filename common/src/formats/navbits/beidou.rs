//! BeiDou D1 and D2 subframes to ephemerides (BDS-SIS-ICD-B1I 3.0, 5.2 and 5.3).
//!
//! Geostationary satellites send D2, the others D1. Only the first piece of a message names its issue of data, and toe is cut in
//! two; so pieces belong together when they follow each other in time: those of one frame of D1 (30 s), of ten frames of D2 (30 s).

use std::collections::BTreeMap;

use super::beidou_fields::{Joined, ephemeris, join, references_s, week};
use super::beidou_words::{Data, data, number, seconds_of_week};
use super::lnav::klobuchar;
use super::week::{nearest, rollover_hint};
use super::{ReceiverCheck, Refused, check_references, news, refused};
use crate::atmosphere::KlobucharCoefficients;
use crate::formats::bits::unsigned;
use crate::gnss::SatelliteId;
use crate::orbit::KeplerEphemeris;
use crate::skips::Reason;
use crate::time::{BEIDOU_BEHIND_GPS_S, BEIDOU_WEEK_OFFSET, GpsTime, SECONDS_PER_WEEK};

/// Weeks are sent modulo this.
const WEEKS: i64 = 8192;
/// Pages of subframe 1 of D2 with ephemeris and clock; D1 has three subframes.
const PIECES: usize = 10;
const D1_PIECES: usize = 3;
/// Page 2 of D2 has nothing but ionosphere terms: an ephemeris does without it.
const D2_IONOSPHERE_PAGE: usize = 1;
/// Time between the beginnings of successive pieces of D1 and of D2, s.
const D1_STEP_S: f64 = 6.0;
const D2_STEP_S: f64 = 3.0;
/// Words with data in a D1 subframe, and in a page of subframe 1 of D2, the rest of which is reserved.
const D1_WORDS: usize = 10;
const D2_WORDS: usize = 5;

/// Puts subframes together. One serves all satellites.
#[derive(Clone, Debug, Default)]
pub struct BeidouAssembler {
    satellites: BTreeMap<SatelliteId, Frame>,
    klobuchar: Option<KlobucharCoefficients>,
}

/// The pieces of one message of a satellite, as far as they have come.
#[derive(Clone, Debug, Default)]
struct Frame {
    /// When the first piece began, whether or not it has come.
    start: GpsTime,
    pieces: [Option<Data>; PIECES],
    given: Option<KeplerEphemeris>,
}

impl BeidouAssembler {
    /// Takes a subframe: 40 bytes, ten words of 30 bits in four bytes each, of D2 if the satellite is geostationary and of D1
    /// if not. `now` resolves the week; it may be days off. Gives the ephemeris that the subframe completes, unless it equals
    /// the last one given.
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
        let geostationary = satellite.is_beidou_geostationary();
        let (used, step_s) = if geostationary { (D2_WORDS, D2_STEP_S) } else { (D1_WORDS, D1_STEP_S) };
        let data = data(bytes, used, receiver).map_err(|refused| refused.of(satellite))?;
        let sent = sent(&data, satellite, now)?;
        let Some(index) = piece_index(&data, satellite)? else { return Ok(None) };
        if index == if geostationary { D2_IONOSPHERE_PAGE } else { 0 } {
            self.klobuchar = Some(klobuchar(&data, if geostationary { 42 } else { 98 }));
        }
        let frame = self.satellites.entry(satellite).or_default();
        frame.put(index, data, sent - step_s * index as f64);
        frame.complete(satellite)
    }

    /// BeiDou's own ionosphere coefficients, the latest (BDS-SIS-ICD-B1I, 5.2.4.7).
    pub const fn klobuchar(&self) -> Option<KlobucharCoefficients> {
        self.klobuchar
    }
}

/// Place of a subframe among the pieces of its message; `None` if it carries no ephemeris.
fn piece_index(data: &Data, satellite: SatelliteId) -> Result<Option<usize>, Refused> {
    let subframe = number(data);
    let geostationary = satellite.is_beidou_geostationary();
    let page = unsigned(data, 38, 4);
    let (index, pieces) = match (subframe, geostationary) {
        (1, true) => (page, PIECES),
        (1..=3, false) => (subframe, D1_PIECES),
        (2..=5, true) | (4 | 5, false) => return Ok(None),
        _ => (0, 0),
    };
    usize::try_from(index)
        .ok()
        .and_then(|index| index.checked_sub(1))
        .filter(|index| *index < pieces)
        .map(Some)
        .ok_or_else(|| {
            let detail = format!("{satellite}: subframe {subframe}, page {page}");
            refused(Reason::BeidouSubframeImpossibleNumber, detail)
        })
}

/// When the subframe (of D2, its frame) began.
fn sent(data: &Data, satellite: SatelliteId, now: GpsTime) -> Result<GpsTime, Refused> {
    let seconds = seconds_of_week(data) as f64;
    if seconds < SECONDS_PER_WEEK {
        return Ok(nearest(seconds + BEIDOU_BEHIND_GPS_S, now));
    }
    let detail = format!("{satellite}: {seconds} s, limit {SECONDS_PER_WEEK} s");
    Err(refused(Reason::BeidouSubframeImpossibleTime, detail))
}

impl Frame {
    /// Takes a piece of the message that began at `start`, and drops the pieces of another message.
    fn put(&mut self, index: usize, data: Data, start: GpsTime) {
        if self.start != start {
            self.pieces = [None; PIECES];
            self.start = start;
        }
        if let Some(place) = self.pieces.get_mut(index) {
            *place = Some(data);
        }
    }

    fn complete(&mut self, satellite: SatelliteId) -> Result<Option<KeplerEphemeris>, Refused> {
        let geostationary = satellite.is_beidou_geostationary();
        let needed = if geostationary { PIECES } else { D1_PIECES };
        let dispensable = |index: usize| geostationary && index == D2_IONOSPHERE_PAGE;
        let mut pieces = self.pieces.iter().take(needed).enumerate();
        if pieces.any(|(index, piece)| piece.is_none() && !dispensable(index)) {
            return Ok(None);
        }
        let joined = join(&self.pieces, geostationary);
        check_week(satellite, &joined, self.start)?;
        let ephemeris = ephemeris(satellite, &joined, references(satellite, &joined, self.start)?);
        news(&mut self.given, ephemeris)
    }
}

/// The week of the message must be that of its transmission.
fn check_week(satellite: SatelliteId, joined: &Joined, start: GpsTime) -> Result<(), Refused> {
    let broadcast = week(joined);
    let expected = ((start - BEIDOU_BEHIND_GPS_S).week() - BEIDOU_WEEK_OFFSET).rem_euclid(WEEKS);
    if i64::try_from(broadcast) == Ok(expected) {
        return Ok(());
    }
    let hint = i64::try_from(broadcast).map_or(String::new(), |sent| rollover_hint(sent - expected));
    let detail = format!("{satellite}: week {broadcast}, {expected} expected at {start}{hint}");
    Err(refused(Reason::EphemerisOfOtherWeek, detail))
}

/// toe and toc as instants.
fn references(
    satellite: SatelliteId,
    joined: &Joined,
    start: GpsTime,
) -> Result<(GpsTime, GpsTime), Refused> {
    let (toe_s, toc_s) = references_s(joined);
    check_references(satellite, toe_s, toc_s)?;
    Ok((nearest(toe_s + BEIDOU_BEHIND_GPS_S, start), nearest(toc_s + BEIDOU_BEHIND_GPS_S, start)))
}
