//! Encoding of messages to bytes, and decoding.

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{
    EpochMessage, FusedMessage, IntegrityMessage, KeptMessage, PaceMessage, ReceiptMessage, StatusMessage,
};

/// First two bytes of every message.
const MAGIC: [u8; 2] = *b"CX";
/// Magic, version, kind.
const HEADER_BYTES: usize = 5;

/// Version of the layout of all messages. A change of any message's fields needs a new version.
pub const WIRE_VERSION: u16 = 6;

/// Maximum length of a message, header included, bytes. An epoch of 60 signals takes about 14 KiB.
pub const MAXIMUM_MESSAGE_BYTES: usize = 256 * 1024;

/// Kind of the message after the header; the kind byte is its position in this list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MessageKind {
    /// [`EpochMessage`].
    Epoch,
    /// [`FusedMessage`].
    Fused,
    /// [`StatusMessage`].
    Status,
    /// [`KeptMessage`].
    Kept,
    /// [`ReceiptMessage`].
    Receipt,
    /// [`PaceMessage`].
    Pace,
    /// [`IntegrityMessage`].
    Integrity,
}

impl MessageKind {
    pub(super) const ALL: [Self; 7] =
        [Self::Epoch, Self::Fused, Self::Status, Self::Kept, Self::Receipt, Self::Pace, Self::Integrity];

    fn from_byte(byte: u8) -> Option<Self> {
        Self::ALL.get(usize::from(byte)).copied()
    }
}

/// A message with its own kind on the wire.
pub trait WireMessage: Serialize + DeserializeOwned {
    /// Kind of the message.
    const KIND: MessageKind;
}

macro_rules! wire_messages {
    ($($message:ty: $kind:ident),*) => {
        $(impl WireMessage for $message {
            const KIND: MessageKind = MessageKind::$kind;
        })*
    };
}

wire_messages!(
    EpochMessage: Epoch,
    FusedMessage: Fused,
    StatusMessage: Status,
    KeptMessage: Kept,
    ReceiptMessage: Receipt,
    PaceMessage: Pace,
    IntegrityMessage: Integrity
);

/// Error of encoding or decoding.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WireError {
    /// Longer than [`MAXIMUM_MESSAGE_BYTES`].
    #[error("message of {bytes} bytes is longer than the limit of {MAXIMUM_MESSAGE_BYTES}")]
    TooLong {
        /// Length of the message.
        bytes: usize,
    },
    /// Shorter than a header.
    #[error("message of {bytes} bytes is shorter than its header of {HEADER_BYTES}")]
    TooShort {
        /// Length of the message.
        bytes: usize,
    },
    /// Does not start with `CX`.
    #[error("message starts with {found:02x?} instead of {MAGIC:02x?}: it was not sent by cofix")]
    NotCofix {
        /// The first two bytes.
        found: [u8; 2],
    },
    /// Other wire version.
    #[error(
        "message has wire version {found}, this program speaks {WIRE_VERSION}: use the same release on both sides"
    )]
    Version {
        /// Version of the message.
        found: u16,
    },
    /// Kind byte without a meaning in this version.
    #[error("message kind {found} is unknown to wire version {WIRE_VERSION}")]
    UnknownKind {
        /// The kind byte.
        found: u8,
    },
    /// Known kind in the wrong place.
    #[error("message is of kind {found:?}, expected {expected:?}")]
    WrongKind {
        /// The kind of the message.
        found: MessageKind,
        /// Expected kind.
        expected: MessageKind,
    },
    /// The body ends before the message is complete.
    #[error("body of {bytes} bytes ends before its {kind:?} message is complete")]
    Truncated {
        /// Length of the body.
        bytes: usize,
        /// The kind of the message.
        kind: MessageKind,
    },
    /// The body contains an invalid value (an unknown variant, text that is not UTF-8, …).
    #[error("body of {bytes} bytes is not a {kind:?} message: {reason}")]
    Malformed {
        /// Length of the body.
        bytes: usize,
        /// The kind of the message.
        kind: MessageKind,
        /// Error of the decoder.
        reason: String,
    },
    /// Bytes are left over after the message.
    #[error("{count} bytes are left over after the {kind:?} message")]
    TrailingBytes {
        /// Number of bytes left over.
        count: usize,
        /// The kind of the message.
        kind: MessageKind,
    },
}

/// Encodes a message.
///
/// # Errors
/// [`WireError::TooLong`] for a message beyond the limit; other errors are impossible for these messages.
pub fn encode<M: WireMessage>(message: &M) -> Result<Vec<u8>, WireError> {
    let mut bytes = Vec::with_capacity(8 * 1024);
    bytes.extend_from_slice(&MAGIC);
    bytes.extend_from_slice(&WIRE_VERSION.to_le_bytes());
    bytes.push(M::KIND as u8);
    let bytes = postcard::to_extend(message, bytes).map_err(|error| WireError::Malformed {
        bytes: 0,
        kind: M::KIND,
        reason: error.to_string(),
    })?;
    if bytes.len() > MAXIMUM_MESSAGE_BYTES {
        return Err(WireError::TooLong { bytes: bytes.len() });
    }
    Ok(bytes)
}

/// Decodes a message.
///
/// # Errors
/// The [`WireError`] for bytes that are not a message of this kind and version.
pub fn decode<M: WireMessage>(bytes: &[u8]) -> Result<M, WireError> {
    let (kind, body) = split_header(bytes)?;
    if kind != M::KIND {
        return Err(WireError::WrongKind { found: kind, expected: M::KIND });
    }
    let (message, rest) =
        postcard::take_from_bytes(body).map_err(|error| body_error(&error, body.len(), kind))?;
    if rest.is_empty() { Ok(message) } else { Err(WireError::TrailingBytes { count: rest.len(), kind }) }
}

fn split_header(bytes: &[u8]) -> Result<(MessageKind, &[u8]), WireError> {
    if bytes.len() > MAXIMUM_MESSAGE_BYTES {
        return Err(WireError::TooLong { bytes: bytes.len() });
    }
    let Some((&[m0, m1, v0, v1, kind], body)) = bytes.split_first_chunk::<HEADER_BYTES>() else {
        return Err(WireError::TooShort { bytes: bytes.len() });
    };
    if [m0, m1] != MAGIC {
        return Err(WireError::NotCofix { found: [m0, m1] });
    }
    let version = u16::from_le_bytes([v0, v1]);
    if version != WIRE_VERSION {
        return Err(WireError::Version { found: version });
    }
    let kind = MessageKind::from_byte(kind).ok_or(WireError::UnknownKind { found: kind })?;
    Ok((kind, body))
}

fn body_error(error: &postcard::Error, bytes: usize, kind: MessageKind) -> WireError {
    if *error == postcard::Error::DeserializeUnexpectedEnd {
        WireError::Truncated { bytes, kind }
    } else {
        WireError::Malformed { bytes, kind, reason: error.to_string() }
    }
}

#[cfg(test)]
mod tests;
