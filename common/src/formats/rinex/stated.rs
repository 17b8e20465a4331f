//! Statements of a RINEX stream beside its records.

use std::collections::BTreeMap;

use super::{Equipment, ObservationDecoder, ObservationHeader, label};
use crate::formats::stream::ObservationStream;
use crate::frames::Ecef;

/// Whether a line is the first one of a RINEX file of any kind; the decoder says which kind it is.
pub(crate) fn is_first_line(line: &[u8]) -> bool {
    label(line) == b"RINEX VERSION / TYPE"
}

/// Whether a line is the first one of Compact RINEX.
pub(crate) fn is_compact_first_line(line: &[u8]) -> bool {
    label(line).starts_with(b"CRINEX VERS")
}

impl ObservationStream for ObservationDecoder {
    fn leap_seconds(&self) -> Option<i64> {
        Self::header(self).and_then(|header| header.leap_seconds)
    }

    fn glonass_channels(&self) -> BTreeMap<u8, i8> {
        Self::header(self).map(|header| header.glonass_channels.clone()).unwrap_or_default()
    }

    fn first_header(&self) -> Option<&ObservationHeader> {
        Self::first_header(self)
    }

    fn header(&self) -> Option<&ObservationHeader> {
        Self::header(self)
    }

    fn station(&self) -> Option<Ecef> {
        Self::header(self).and_then(|header| header.approximate_position)
    }

    fn equipment(&self) -> Equipment {
        Self::first_header(self).map(|header| header.equipment.clone()).unwrap_or_default()
    }
}
