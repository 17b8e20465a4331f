//! Plain or gzip-compressed bytes.

use std::borrow::Cow;
use std::io::Read;

use flate2::read::MultiGzDecoder;

/// Largest size that a compressed file may expand to, bytes.
pub const MAX_DECOMPRESSED_BYTES: u64 = 2 << 30;

/// Why compressed bytes cannot be expanded.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum DecompressError {
    /// The container is damaged or cut off.
    #[error("gzip data is damaged after {expanded} expanded bytes ({cause}); fetch the file again")]
    Damaged {
        /// Bytes that came out before.
        expanded: usize,
        /// What the decoder said.
        cause: String,
    },
    /// More than the limit comes out.
    #[error("gzip data expands to more than {limit} bytes; split the file")]
    TooLarge {
        /// The limit, bytes.
        limit: u64,
    },
}

/// Expands gzip data (recognised by its first two bytes); anything else passes through.
///
/// # Errors
/// When the container is damaged or expands to more than [`MAX_DECOMPRESSED_BYTES`].
pub fn decompress(bytes: &[u8]) -> Result<Cow<'_, [u8]>, DecompressError> {
    if bytes.starts_with(&[0x1f, 0x8b]) {
        expand(bytes, MAX_DECOMPRESSED_BYTES).map(Cow::Owned)
    } else {
        Ok(Cow::Borrowed(bytes))
    }
}

fn expand(bytes: &[u8], limit: u64) -> Result<Vec<u8>, DecompressError> {
    let mut expanded = Vec::new();
    let result = MultiGzDecoder::new(bytes).take(limit + 1).read_to_end(&mut expanded);
    if expanded.len() as u64 > limit {
        return Err(DecompressError::TooLarge { limit });
    }
    match result {
        Ok(_) => Ok(expanded),
        Err(cause) => Err(DecompressError::Damaged { expanded: expanded.len(), cause: cause.to_string() }),
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
        assert_eq!(expand(&packed, 9_999), Err(DecompressError::TooLarge { limit: 9_999 }));
        assert_eq!(expand(&packed, 10_000).unwrap().len(), 10_000);
    }
}
