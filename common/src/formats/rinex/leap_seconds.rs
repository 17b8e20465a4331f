//! The LEAP SECONDS line of headers.

use crate::formats::decimal::integer;
use crate::formats::text::columns;

/// Reads a LEAP SECONDS line as seconds that GPS time is ahead of UTC. The line may count them for BeiDou time instead.
pub(super) fn header_line(line: &[u8]) -> Option<i64> {
    let seconds = integer(columns(line, 0, 6)).filter(|s| (0..=100).contains(s))?;
    Some(if columns(line, 24, 27) == b"BDS" { seconds + 14 } else { seconds })
}
