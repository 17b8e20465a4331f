//! The kind of a file that was named in the wrong place, and its right place.

use std::path::Path;

use cofix_common::formats::kinds::hint;

use crate::Stop;
use crate::input::{Bytes, Portion, Recorded};

/// Bytes of a file that are looked at.
const START: usize = 4_096;

/// [`hint`] of a file that may be packed; `None` also when it cannot be read.
pub fn hint_for(path: &Path, expected: &str) -> Option<&'static str> {
    hint(&start_of(path, &Stop::default()), expected)
}

/// The beginning of a recorded file, unpacked; empty when it cannot be read.
pub(crate) fn start_of(path: &Path, stop: &Stop) -> Vec<u8> {
    let (mut start, mut portion) = (Vec::new(), Vec::new());
    let Ok(mut file) = Recorded::open(path) else { return start };
    while start.len() < START && matches!(file.next(&mut portion, stop), Ok(Portion::Bytes)) {
        start.append(&mut portion);
    }
    start.truncate(START);
    start
}
