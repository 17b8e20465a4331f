//! Plain or compressed bytes.

mod unix_compress;

use std::borrow::Cow;
use std::fmt;
use std::io::{BufReader, Read};

use flate2::read::MultiGzDecoder;

use unix_compress::{COMPRESS_MAGIC, UnixCompress};

/// Largest size that a compressed file may expand to, bytes.
pub const MAX_DECOMPRESSED_BYTES: u64 = 2 << 30;
const GZIP_MAGIC: [u8; 2] = [0x1f, 0x8b];

/// Why compressed bytes cannot be expanded.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum DecompressError {
    /// The container is damaged or cut off.
    #[error("{packing} data is damaged after {expanded} expanded bytes ({cause}); fetch the file again")]
    Damaged {
        /// The kind of packing.
        packing: Packing,
        /// Bytes expanded before the damage.
        expanded: usize,
        /// Message of the decoder.
        cause: String,
    },
    /// The expanded size exceeds the limit.
    #[error("compressed data expands to more than {limit} bytes; split the file")]
    TooLarge {
        /// The limit, bytes.
        limit: u64,
    },
}

/// Kind of packing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Packing {
    /// gzip (.gz), also several in a row.
    Gzip,
    /// The older `compress` (.Z).
    Compress,
}

impl Packing {
    /// By the first two bytes; `None` for bytes that are not packed.
    pub fn of(start: &[u8]) -> Option<Self> {
        match start.first_chunk() {
            Some(&GZIP_MAGIC) => Some(Self::Gzip),
            Some(&COMPRESS_MAGIC) => Some(Self::Compress),
            _ => None,
        }
    }

    /// A reader of the expanded bytes.
    pub fn expand<'a>(self, packed: impl Read + Send + 'a) -> Box<dyn Read + Send + 'a> {
        let packed = BufReader::new(packed);
        match self {
            Self::Gzip => Box::new(MultiGzDecoder::new(packed)),
            Self::Compress => Box::new(UnixCompress::new(packed)),
        }
    }
}

impl fmt::Display for Packing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Gzip => "gzip",
            Self::Compress => "compress (.Z)",
        })
    }
}

/// Expands compressed data (recognised by its first two bytes); anything else passes through.
///
/// # Errors
/// When the container is damaged or expands to more than [`MAX_DECOMPRESSED_BYTES`].
pub fn decompress(bytes: &[u8]) -> Result<Cow<'_, [u8]>, DecompressError> {
    match Packing::of(bytes) {
        Some(packing) => expand(packing, bytes, MAX_DECOMPRESSED_BYTES).map(Cow::Owned),
        None => Ok(Cow::Borrowed(bytes)),
    }
}

fn expand(packing: Packing, bytes: &[u8], limit: u64) -> Result<Vec<u8>, DecompressError> {
    let mut expanded = Vec::new();
    let result = packing.expand(bytes).take(limit + 1).read_to_end(&mut expanded);
    if expanded.len() as u64 > limit {
        return Err(DecompressError::TooLarge { limit });
    }
    match result {
        Ok(_) => Ok(expanded),
        Err(cause) => {
            Err(DecompressError::Damaged { packing, expanded: expanded.len(), cause: cause.to_string() })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::{Compression, write::GzEncoder};
    use std::io::Write;

    fn gzip(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
        encoder.write_all(bytes).unwrap();
        encoder.finish().unwrap()
    }

    #[test]
    fn plain_passes_and_gzip_expands() {
        assert_eq!(&*decompress(b"plain").unwrap(), b"plain");
        assert_eq!(&*decompress(b"").unwrap(), b"");
        assert_eq!(&*decompress(&gzip(b"text")).unwrap(), b"text");
    }

    #[test]
    fn cut_and_oversized_data_are_refused() {
        let packed = gzip(&[7; 10_000]);
        let cut = &packed[..packed.len() / 2];
        assert!(matches!(decompress(cut), Err(DecompressError::Damaged { .. })));
        assert_eq!(expand(Packing::Gzip, &packed, 9_999), Err(DecompressError::TooLarge { limit: 9_999 }));
        assert_eq!(expand(Packing::Gzip, &packed, 10_000).unwrap().len(), 10_000);
    }
}
