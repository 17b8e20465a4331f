//! Messages whose checksums random bytes seldom get right: here they are given right ones.

use cofix_common::formats::decode::Decoder;
use cofix_common::formats::rtcm::{RtcmDecoder, RtcmOptions};
use cofix_common::skips::Skips;
use cofix_common::wire::{
    EpochMessage, FusedMessage, IntegrityMessage, KeptMessage, MAXIMUM_OBSERVATIONS, PaceMessage,
    ReceiptMessage, StatusMessage, WIRE_VERSION, WireMessage, decode, encode,
};

use crate::streams::{near, rtcm_stream};

/// RTCM 3 messages, each with its length in two bytes before it (modulo 1024), put into frames.
pub fn rtcm_messages(bytes: &[u8]) {
    let mut stream = Vec::with_capacity(2 * bytes.len());
    let mut rest = bytes;
    while let Some((length, after)) = rest.split_first_chunk::<2>() {
        let length = usize::from(u16::from_be_bytes(*length) % 1024).min(after.len());
        let (message, after) = after.split_at(length);
        stream.extend(frame(message));
        rest = after;
    }
    rtcm_stream(&stream);
    let mut decoder = RtcmDecoder::new(RtcmOptions::near(near()));
    if decoder.feed(&stream).is_ok() {
        assert!(decoder.glonass_channels().values().all(|channel| (-7..=13).contains(channel)));
        if let Some(station) = decoder.station() {
            assert!((6.33e6..=6.41e6).contains(&station.position.0.norm()), "{station:?}");
            assert!(
                station.antenna_height_m.is_none_or(|height_m| (0.0..6.6).contains(&height_m)),
                "{station:?}"
            );
        }
    }
}

/// A message of at most 1023 bytes as a frame (RTCM 10403.3, transport layer).
fn frame(message: &[u8]) -> Vec<u8> {
    let [.., high, low] = message.len().to_be_bytes();
    let mut frame = vec![0xd3, high & 3, low];
    frame.extend_from_slice(message);
    let mut crc = 0_u32;
    for byte in &frame {
        crc ^= u32::from(*byte) << 16;
        for _ in 0..8 {
            crc = if crc & 0x80_0000 == 0 { crc << 1 } else { crc << 1 ^ 0x0186_4cfb };
        }
    }
    let [_, checksum @ ..] = crc.to_be_bytes();
    frame.extend(checksum);
    frame
}

/// Messages between agents and hub: nothing absurd is left after sanitising, and what is encoded comes back.
pub fn wire(bytes: &[u8]) {
    for kind in 0..7 {
        // The header is given, too, so that bodies alone can be tried.
        let with_header = [b"CX".as_slice(), &WIRE_VERSION.to_le_bytes(), &[kind], bytes].concat();
        for bytes in [bytes, &with_header] {
            comes_back::<FusedMessage>(bytes);
            comes_back::<StatusMessage>(bytes);
            comes_back::<KeptMessage>(bytes);
            comes_back::<ReceiptMessage>(bytes);
            comes_back::<PaceMessage>(bytes);
            comes_back::<IntegrityMessage>(bytes);
            if let Some(message) = comes_back::<EpochMessage>(bytes) {
                sanitised(message);
            }
        }
    }
}

fn comes_back<M: WireMessage + std::fmt::Debug>(bytes: &[u8]) -> Option<M> {
    let message: M = decode(bytes).ok()?;
    let once = encode(&message).unwrap_or_default();
    assert!(once.len() <= bytes.len(), "the encoding is the shortest");
    let again: Result<M, _> = decode(&once);
    let twice = again.as_ref().ok().and_then(|again| encode(again).ok());
    assert_eq!(twice, Some(once), "{again:?}");
    Some(message)
}

fn sanitised(message: EpochMessage) {
    let phone = message.phone.clone();
    let valid = message.validate().is_ok();
    let count = message.observations.len();
    let mut skips = Skips::default();
    let Some(clean) = message.sanitise(&phone, &mut skips) else {
        assert!(!valid && skips.total() == 1, "{skips}");
        return;
    };
    assert_eq!(clean.validate(), Ok(()));
    assert_eq!(valid, skips.is_empty(), "{skips}");
    assert!(count <= MAXIMUM_OBSERVATIONS && clean.observations.len() <= count);
}
