//! A stream decoder fed in portions.

use cofix_common::formats::decode::{Decoder, Record, WrongStream};
use cofix_common::skips::Skips;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Everything that a decoder says about a stream.
#[derive(Clone, Debug)]
pub(crate) struct Outcome {
    pub(crate) records: Vec<Record>,
    pub(crate) skips: Skips,
    pub(crate) end: Result<(), WrongStream>,
}

/// Feeds a stream in the portions given, taking records out after each.
pub(crate) fn feed<'a>(decoder: &mut impl Decoder, portions: impl IntoIterator<Item = &'a [u8]>) -> Outcome {
    let mut records = Vec::new();
    let mut end = Ok(());
    for portion in portions {
        end = decoder.feed(portion);
        records.extend(std::iter::from_fn(|| decoder.next_record()));
        if end.is_err() {
            break;
        }
    }
    end = end.and_then(|()| decoder.finish());
    records.extend(std::iter::from_fn(|| decoder.next_record()));
    Outcome { records, skips: decoder.skips().clone(), end }
}

/// Feeds a stream at once and in portions of random sizes, which must make no difference. The sizes follow from the bytes,
/// so that a failure comes again.
pub(crate) fn feed_both_ways<D: Decoder>(begin: impl Fn() -> D, bytes: &[u8]) -> Outcome {
    let whole = feed(&mut begin(), [bytes]);
    let cut = feed(&mut begin(), random_portions(bytes));
    assert_eq!(cut.end, whole.end, "in portions and at once");
    // Fed at once, a decoder may go on counting up to the end of the portion that shows another kind of stream.
    assert!(
        whole.end.is_err() || cut.skips == whole.skips,
        "in portions {}, at once {}",
        cut.skips,
        whole.skips
    );
    assert!(same(&cut.records, &whole.records), "in portions {:?}, at once {:?}", cut.records, whole.records);
    whole
}

/// Equal, where an unknown number equals another unknown one.
pub(crate) fn same(one: &[Record], other: &[Record]) -> bool {
    one == other || format!("{one:?}") == format!("{other:?}")
}

/// Cuts into one to some hundred bytes, or into single bytes.
pub(crate) fn random_portions(bytes: &[u8]) -> Vec<&[u8]> {
    let seed = bytes
        .iter()
        .fold(bytes.len() as u64, |sum, byte| sum.wrapping_mul(31).wrapping_add(u64::from(*byte)));
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let longest = *[1, 7, 90, 600].get(random.random_range(0..4_usize)).unwrap_or(&1);
    let mut portions = Vec::new();
    let mut rest = bytes;
    while !rest.is_empty() {
        let (portion, after) = rest.split_at(random.random_range(1..=longest).min(rest.len()));
        portions.push(portion);
        rest = after;
    }
    portions
}
