//! Bits of navigation messages to ephemerides: GPS and QZSS LNAV, Galileo I/NAV.
//!
//! A receiver gives the messages in pieces (subframes, pages), with gaps and in any order. The assemblers here keep the
//! pieces of each satellite and give an ephemeris when all of its pieces have come and carry the same issue of data.
//! Parity and CRC are checked where they are there; what is absurd is refused with the value and the limit.

mod bits;
mod galileo;
mod galileo_page;
mod lnav;
mod lnav_words;
mod plausible;

pub use galileo::InavAssembler;
pub use lnav::{LnavAssembler, LnavSystem};

/// Why a piece of a message, or the ephemeris that it completes, is not used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{reason}: {detail}")]
pub struct Refused {
    /// The reason, to count under.
    pub reason: &'static str,
    /// The facts.
    pub detail: String,
}

/// What the receiver says about a piece of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReceiverCheck {
    /// Parity or CRC was right, or was made right. A piece whose check bits the receiver has blanked is then believed.
    Passed,
    /// Nothing: only our own check counts.
    Unknown,
}

const fn refused(reason: &'static str, detail: String) -> Refused {
    Refused { reason, detail }
}
