use proptest::prelude::*;

use super::super::{PhoneStatus, Receipt, example};
use super::*;
use crate::fusion::peers::EventKind;
use crate::skips::{Reason, Skips};

fn finished() -> StatusMessage {
    let mut skips = Skips::default();
    skips.add(Reason::LineTooLong, || "line 12".to_owned());
    let status = PhoneStatus::Finished { epochs_published: 640, skips, error: Some("disk".to_owned()) };
    StatusMessage { phone: "HP30".to_owned(), status }
}

fn fused() -> FusedMessage {
    let message = example::message(1);
    FusedMessage {
        phone: message.phone,
        time_gps: message.time_gps,
        state: message.local.unwrap(),
        verdict: Some(message.raim.verdict),
        test: message.raim.velocity,
        protection: message.raim.protection,
        constraints_acted: 3,
    }
}

#[test]
fn every_kind_comes_back_as_it_went() {
    let epoch = example::message(40);
    assert_eq!(decode::<EpochMessage>(&encode(&epoch).unwrap()).unwrap(), epoch);
    assert_eq!(decode::<FusedMessage>(&encode(&fused()).unwrap()).unwrap(), fused());
    assert_eq!(decode::<StatusMessage>(&encode(&finished()).unwrap()).unwrap(), finished());
}

#[test]
fn the_first_bytes_are_the_documented_ones() {
    assert_eq!(encode(&example::message(1)).unwrap()[..5], [b'C', b'X', 6, 0, 0]);
    assert_eq!(encode(&fused()).unwrap()[..5], [b'C', b'X', 6, 0, 1]);
    assert_eq!(encode(&finished()).unwrap()[..5], [b'C', b'X', 6, 0, 2]);
}

#[test]
fn the_largest_plausible_message_fits() {
    let mut message = example::message(1);
    message.observations = vec![example::observation(7); super::super::MAXIMUM_OBSERVATIONS];
    assert!(encode(&message).unwrap().len() < MAXIMUM_MESSAGE_BYTES / 4);
}

fn refused(bytes: &[u8]) -> WireError {
    decode::<EpochMessage>(bytes).unwrap_err()
}

#[test]
fn what_an_agent_keeps_comes_back() {
    let kept = KeptMessage { phone: "HP30".to_owned(), first: 40, next: u64::MAX };
    let bytes = encode(&kept).unwrap();
    assert_eq!(decode::<KeptMessage>(&bytes), Ok(kept));
    let (found, expected) = (MessageKind::Kept, MessageKind::Status);
    assert_eq!(decode::<StatusMessage>(&bytes), Err(WireError::WrongKind { found, expected }));
}

#[test]
fn what_the_hub_answers_comes_back() {
    let run = ReceiptMessage::Run(Receipt { received: 640, lost: 2 });
    let unknown = ReceiptMessage::UnknownPhone { known: vec!["HP30".to_owned()] };
    for message in [run, unknown] {
        assert_eq!(decode(&encode(&message).unwrap()), Ok(message));
    }
    let pace = PaceMessage { due_in_s: -7.5 };
    assert_eq!(decode(&encode(&pace).unwrap()), Ok(pace));
}

#[test]
fn what_happens_to_the_integrity_comes_back() {
    let message = IntegrityMessage {
        time_gps: example::message(1).time_gps,
        phones: vec!["HP30".to_owned(), "XIM8".to_owned()],
        kind: EventKind::CannotTell,
        error: None,
        detail: "HP30, XIM8 contradict each other, and which is wrong is open".to_owned(),
    };
    let bytes = encode(&message).unwrap();
    assert_eq!(bytes[4], 6);
    assert_eq!(decode(&bytes), Ok(message));
}

#[test]
fn every_defect_has_its_own_error() {
    let good = encode(&example::message(3)).unwrap();
    let body = good.len() - HEADER_BYTES;
    let changed = |index: usize, byte: u8| {
        let mut bytes = good.clone();
        bytes[index] = byte;
        bytes
    };
    assert_eq!(refused(&[]), WireError::TooShort { bytes: 0 });
    assert_eq!(refused(b"CX\x06\x00"), WireError::TooShort { bytes: 4 });
    assert_eq!(refused(&changed(0, b'X')), WireError::NotCofix { found: *b"XX" });
    assert_eq!(refused(&changed(3, 1)), WireError::Version { found: 262 });
    assert_eq!(refused(&changed(4, 9)), WireError::UnknownKind { found: 9 });
    let expected = MessageKind::Epoch;
    assert_eq!(
        refused(&encode(&fused()).unwrap()),
        WireError::WrongKind { found: MessageKind::Fused, expected }
    );
    let cut = &good[..good.len() - 1];
    assert_eq!(refused(cut), WireError::Truncated { bytes: body - 1, kind: expected });
    let longer = [good.as_slice(), &[0, 0, 0]].concat();
    assert_eq!(refused(&longer), WireError::TrailingBytes { count: 3, kind: expected });
    assert_eq!(
        refused(&vec![0; MAXIMUM_MESSAGE_BYTES + 1]),
        WireError::TooLong { bytes: MAXIMUM_MESSAGE_BYTES + 1 }
    );
    // The bytes of the name start after its length: 0xff is never UTF-8.
    assert!(matches!(refused(&changed(HEADER_BYTES + 1, 0xff)), WireError::Malformed { .. }));
}

#[test]
fn a_message_beyond_the_limit_is_not_encoded() {
    let mut message = finished();
    message.phone = "x".repeat(MAXIMUM_MESSAGE_BYTES);
    assert!(matches!(encode(&message), Err(WireError::TooLong { .. })));
}

#[test]
fn a_length_that_promises_gigabytes_is_refused() {
    // A name of 2^60 bytes.
    let bytes =
        [b"CX\x06\x00\x00".as_slice(), &[0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x10]].concat();
    assert!(matches!(refused(&bytes), WireError::Truncated { .. } | WireError::Malformed { .. }));
}

proptest! {
    #[test]
    fn any_values_come_back_bit_for_bit(
        ranges in prop::collection::vec(any::<f64>(), 0..40),
        sequence in any::<u64>(),
        nanos in any::<i64>(),
        phone in "\\PC{0,20}",
    ) {
        let mut message = example::message(0);
        message.sequence = sequence;
        message.phone = phone;
        message.time_gps = crate::time::GpsTime::from_nanos(nanos);
        for &range in &ranges {
            let mut observation = example::observation(3);
            observation.pseudorange_m = range;
            observation.residual_m = Some(-range);
            message.observations.push(observation);
        }
        let back = decode::<EpochMessage>(&encode(&message).unwrap()).unwrap();
        let bits = |m: &EpochMessage| m.observations.iter().map(|o| o.pseudorange_m.to_bits()).collect::<Vec<_>>();
        prop_assert_eq!(bits(&back), bits(&message));
        prop_assert_eq!((back.sequence, back.time_gps, back.phone), (message.sequence, message.time_gps, message.phone));
    }

    #[test]
    fn mutated_bytes_never_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..8),
        keep in any::<prop::sample::Index>(),
        cut in any::<bool>(),
    ) {
        let mut bytes = encode(&example::message(3)).unwrap();
        for (index, byte) in changes {
            let index = index.index(bytes.len());
            bytes[index] = byte;
        }
        if cut {
            bytes.truncate(keep.index(bytes.len()));
        }
        if let Ok(message) = decode::<EpochMessage>(&bytes) {
            let mut skips = Skips::default();
            let _ = message.validate();
            if let Some(kept) = message.sanitise("HP30", &mut skips) {
                prop_assert_eq!(kept.validate(), Ok(()));
            }
        }
        let _ = decode::<StatusMessage>(&bytes);
        let _ = decode::<FusedMessage>(&bytes);
    }

    #[test]
    fn noise_never_panics(bytes in prop::collection::vec(any::<u8>(), 0..600), kind in 0_u8..3) {
        let _ = decode::<EpochMessage>(&bytes);
        let framed = [b"CX\x06\x00".as_slice(), &[kind], &bytes].concat();
        let _ = decode::<EpochMessage>(&framed);
        let _ = decode::<StatusMessage>(&framed);
        let _ = decode::<FusedMessage>(&framed);
    }
}
