//! Bits of navigation messages to ephemerides: GPS and QZSS LNAV, Galileo I/NAV and F/NAV, BeiDou D1 and D2, GLONASS.
//!
//! A receiver gives the messages in pieces (subframes, pages, strings), with gaps. The assemblers here keep the pieces of each
//! satellite and give an ephemeris when all of its pieces have come and belong together: they carry the same issue of data, or,
//! where a piece does not carry it, follow each other in time. Check bits, where a piece has them, only detect errors, for a damaged
//! piece is sent again. Impossible values are refused with the value and the limit.

mod beidou;
mod beidou_fields;
mod beidou_words;
mod fnav;
mod galileo_time;
mod glonass;
mod glonass_string;
mod inav;
mod inav_page;
mod lnav;
mod lnav_words;
mod pieces;
mod week;
mod words;

pub use beidou::BeidouAssembler;
pub use fnav::FnavAssembler;
pub use glonass::{GlonassAssembler, GlonassClock, GlonassLabel, GlonassMessage, GlonassName};
pub use inav::InavAssembler;
pub use lnav::{LnavAssembler, LnavSystem};

use crate::gnss::SatelliteId;
use crate::orbit::{Implausible, KeplerEphemeris, check_reference_s};
use crate::skips::Reason;

/// Why a piece of a message, or the ephemeris that it completes, is not used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{reason}: {detail}")]
pub struct Refused {
    /// The reason, to count under.
    pub reason: Reason,
    /// Satellite and values.
    pub detail: String,
}

/// The receiver's own check of a piece of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReceiverCheck {
    /// Parity or CRC was right, or was made right. A piece whose check bits the receiver has blanked is then believed.
    Passed,
    /// No statement: only the check here counts.
    Unknown,
}

impl Refused {
    /// The same with the satellite's name in front of the detail.
    fn of(self, name: impl std::fmt::Display) -> Self {
        Self { detail: format!("{name}: {}", self.detail), ..self }
    }
}

const fn refused(reason: Reason, detail: String) -> Refused {
    Refused { reason, detail }
}

/// An ephemeris with a value that no satellite broadcasts.
fn impossible(satellite: SatelliteId, value: &Implausible) -> Refused {
    refused(Reason::EphemerisImpossible, format!("{satellite}: {value}"))
}

/// Refuses reference times that are in no week.
fn check_references(satellite: SatelliteId, toe_s: f64, toc_s: f64) -> Result<(), Refused> {
    let check = check_reference_s("toe", toe_s).and_then(|()| check_reference_s("toc", toc_s));
    check.map_err(|value| impossible(satellite, &value))
}

/// The ephemeris of a satellite's pieces, unless it equals the last one given.
///
/// # Errors
/// When it cannot be one.
fn news(
    given: &mut Option<KeplerEphemeris>,
    ephemeris: KeplerEphemeris,
) -> Result<Option<KeplerEphemeris>, Refused> {
    if given.is_some_and(|given| given.is_same_as(&ephemeris)) {
        return Ok(None);
    }
    ephemeris.check().map_err(|value| impossible(ephemeris.satellite, &value))?;
    *given = Some(ephemeris);
    Ok(*given)
}
