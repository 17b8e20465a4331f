//! What a challenge table states beside its records.

use super::DerivedDecoder;
use crate::formats::stream::ObservationStream;
use crate::measurement::RecordedEpoch;

/// Columns of times, of which every table has one.
const TIMES: [&[u8]; 2] = [b"millisSinceGpsEpoch", b"ArrivalTimeNanosSinceGpsEpoch"];

/// Whether a line names the columns of a table of observations.
pub(crate) fn is_table_header(line: &[u8]) -> bool {
    line.split(|byte| *byte == b',').any(|field| TIMES.contains(&field.trim_ascii()))
}

impl ObservationStream for DerivedDecoder {
    fn recorded_epoch(&self) -> Option<&RecordedEpoch> {
        self.last_epoch()
    }

    fn shifts_weeks_itself(&self) -> bool {
        true
    }
}
