//! Statements of a stream of observations beside its records.

use std::collections::BTreeMap;
use std::fmt::Debug;

use crate::formats::decode::{Decoder, WrongStream};
use crate::formats::phone::PhoneTally;
use crate::formats::rinex::{Equipment, ObservationHeader};
use crate::frames::Ecef;
use crate::measurement::RecordedEpoch;
use crate::orbit::IonosphereTerms;

/// A decoder of observations. A format implements the statements that it can make; by default there are none.
pub trait ObservationStream: Decoder + Debug + Send {
    /// Whether the bytes so far can be of no other format. Of a format that is recognised by its text this is not asked.
    fn is_recognised(&self) -> bool {
        true
    }

    /// Ionosphere terms.
    fn ionosphere(&self) -> IonosphereTerms {
        IonosphereTerms::default()
    }

    /// The epoch of the last record with further statements of the stream, if it has any: satellite states and
    /// corrections (challenge tables, GnssLogger text since 2022), GLONASS satellites known by their channel only.
    fn recorded_epoch(&self) -> Option<&RecordedEpoch> {
        None
    }

    /// Seconds that GPS time is ahead of UTC.
    fn leap_seconds(&self) -> Option<i64> {
        None
    }

    /// GLONASS frequency channels by slot.
    fn glonass_channels(&self) -> BTreeMap<u8, i8> {
        BTreeMap::new()
    }

    /// The header of RINEX as it began, once it is complete.
    fn first_header(&self) -> Option<&ObservationHeader> {
        None
    }

    /// The header of RINEX with the changes by events, once it is complete.
    fn header(&self) -> Option<&ObservationHeader> {
        None
    }

    /// Where the antenna is: of RTCM 3 by messages 1005 and 1006, of RINEX by its header, which promises an approximate
    /// position only.
    fn station(&self) -> Option<Ecef> {
        None
    }

    /// Where the recording was made, roughly.
    fn approximate_position(&self) -> Option<Ecef> {
        self.station()
    }

    /// Receiver, antenna and people: by headers of RINEX and GnssLogger text, RTCM messages 1007, 1008 and 1033.
    fn equipment(&self) -> Equipment {
        Equipment::default()
    }

    /// Hands over the phone's own positions and states of signals since the last call.
    fn tell_phone(&mut self, _tally: &mut PhoneTally) {}

    /// Whether weeks to add to its times were given to the decoder, or make no sense for it.
    fn shifts_weeks_itself(&self) -> bool {
        false
    }

    /// The next bytes do not continue those before. Text ends a cut line, so that it spoils no other.
    ///
    /// # Errors
    /// As [`Decoder::feed`].
    fn interrupt(&mut self) -> Result<(), WrongStream> {
        self.feed(b"\n")
    }
}
