//! What a phone's log tells beside its records.

use std::collections::BTreeMap;

use super::{Fix, GnssLoggerDecoder};
use crate::formats::phone::PhoneTally;
use crate::formats::rinex::Equipment;
use crate::formats::stream::ObservationStream;
use crate::frames::Ecef;
use crate::measurement::RecordedEpoch;
use crate::orbit::IonosphereTerms;

/// Kinds of lines that no other format has.
const KINDS: [&[u8]; 4] = [b"Raw,", b"Fix,", b"Nav,", b"Status,"];

/// Whether a line is one of a log: of measurements, or of the names of their columns.
pub(crate) fn is_log_line(line: &[u8]) -> bool {
    let comment = line.strip_prefix(b"#").map(<[u8]>::trim_ascii_start);
    let kind = comment.unwrap_or(line);
    KINDS.iter().any(|name| kind.starts_with(name))
        || comment.is_some_and(|text| text.starts_with(b"Header Description"))
}

impl ObservationStream for GnssLoggerDecoder {
    fn ionosphere(&self) -> IonosphereTerms {
        Self::ionosphere(self)
    }

    fn recorded_epoch(&self) -> Option<&RecordedEpoch> {
        self.last_recorded()
    }

    fn leap_seconds(&self) -> Option<i64> {
        Self::leap_seconds(self)
    }

    fn glonass_channels(&self) -> BTreeMap<u8, i8> {
        Self::glonass_channels(self).clone()
    }

    fn approximate_position(&self) -> Option<Ecef> {
        self.own_fix().map(Fix::position)
    }

    fn equipment(&self) -> Equipment {
        self.device().map_or_else(Equipment::default, |device| Equipment {
            receiver_type: device.name(),
            receiver_version: device.software(),
            ..Equipment::default()
        })
    }

    fn tell_phone(&mut self, tally: &mut PhoneTally) {
        tally.take(self);
    }

    fn shifts_weeks_itself(&self) -> bool {
        true
    }
}
