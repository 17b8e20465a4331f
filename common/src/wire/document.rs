//! `docs/wire.md` names every message, field and variant, and shows the bytes of each message.

use std::fmt::Write;

use serde_json::Value;

use super::*;
use crate::fusion::peers::{ErrorKind, EventKind};
use crate::integrity::{Cause, Verdict};
use crate::skips::{Reason, Skips};

const DOCUMENT: &str = include_str!("../../../docs/wire.md");

/// Name, bytes and JSON of a message.
type Example = (&'static str, Vec<u8>, Value);

fn of<M: WireMessage>(name: &'static str, message: &M) -> Example {
    (name, encode(message).unwrap(), serde_json::to_value(message).unwrap())
}

/// A message of each kind, with every optional field, in the order of the kinds.
fn examples() -> [Example; 7] {
    let epoch = example::message(1);
    let mut skips = Skips::default();
    skips.add(Reason::LineTooLong, || "line 12".to_owned());
    let finished =
        PhoneStatus::Finished { epochs_published: 640, skips, error: Some("disk full".to_owned()) };
    let fused = FusedMessage {
        phone: epoch.phone.clone(),
        time_gps: epoch.time_gps,
        state: epoch.local.clone().unwrap(),
        verdict: Some(Verdict::Unreliable(Cause::Peers)),
        test: epoch.raim.velocity,
        protection: epoch.raim.protection,
        constraints_acted: 3,
    };
    let integrity = IntegrityMessage {
        time_gps: epoch.time_gps,
        phones: vec!["HP30".to_owned()],
        kind: EventKind::Isolated,
        error: Some(ErrorKind::Drifting),
        detail: "HP30 drifts".to_owned(),
    };
    [
        of("EpochMessage", &epoch),
        of("FusedMessage", &fused),
        of("StatusMessage", &StatusMessage { phone: "HP30".to_owned(), status: finished }),
        of("KeptMessage", &KeptMessage { phone: "HP30".to_owned(), first: 40, next: 3_640 }),
        of("ReceiptMessage", &ReceiptMessage::Run(Receipt { received: 640, lost: 2 })),
        of("PaceMessage", &PaceMessage { due_in_s: -7.5 }),
        of("IntegrityMessage", &integrity),
    ]
}

/// A dump as the document shows it.
fn dump(name: &str, bytes: &[u8]) -> String {
    let mut text = format!("{name}, {} bytes:\n\n", bytes.len());
    let mut before: Option<&[u8]> = None;
    let mut is_elided = false;
    for (line, chunk) in bytes.chunks(32).enumerate() {
        let is_repeated = before.replace(chunk) == Some(chunk);
        if !is_repeated {
            let hex: Vec<String> = chunk.iter().map(|byte| format!("{byte:02x}")).collect();
            writeln!(text, "    {:04x}  {}", 32 * line, hex.join(" ")).unwrap();
        } else if !is_elided {
            text += "    *\n";
        }
        is_elided = is_repeated;
    }
    text
}

/// The names of fields in a value.
fn fields(value: &Value, into: &mut Vec<String>) {
    match value {
        Value::Object(object) => {
            // Reasons are names that messages carry.
            let names = object.keys().filter(|key| !key.contains(' ') && *key != "nanos");
            into.extend(names.cloned());
            object.values().for_each(|value| fields(value, into));
        }
        Value::Array(values) => values.iter().for_each(|value| fields(value, into)),
        _ => {}
    }
}

#[test]
fn every_field_is_named() {
    for (name, _, value) in examples() {
        assert!(DOCUMENT.contains(&format!("**{name}**")), "docs/wire.md lacks {name}");
        let mut names = Vec::new();
        fields(&value, &mut names);
        for field in names {
            assert!(DOCUMENT.contains(&format!("`{field}`")), "docs/wire.md lacks `{field}` of {name}");
        }
    }
}

#[test]
fn every_kind_version_and_limit_is_named() {
    for (index, kind) in MessageKind::ALL.iter().enumerate() {
        assert!(DOCUMENT.contains(&format!("{index} `{kind:?}`")), "docs/wire.md lacks {kind:?}");
    }
    assert!(DOCUMENT.contains(&format!("Wire version {WIRE_VERSION}.")));
    assert_eq!((MAXIMUM_MESSAGE_BYTES, MAXIMUM_NAME_BYTES, MAXIMUM_OBSERVATIONS), (262_144, 64, 256));
}

#[test]
fn every_key_is_named() {
    let keys = [
        epoch_key,
        status_key,
        liveliness_key,
        history_key,
        receipt_key,
        pace_key,
        fused_key,
        fused_json_key,
    ];
    let keys = keys.map(|key| key("GROUP", "PHONE").unwrap());
    for key in keys.into_iter().chain([integrity_key("GROUP").unwrap()]) {
        let key = key.replace("GROUP", "<group>").replace("PHONE", "<phone>");
        assert!(DOCUMENT.contains(&format!("| `{key}` |")), "docs/wire.md lacks {key}");
    }
}

#[test]
fn the_bytes_of_each_message_are_the_documented_ones() {
    let dumps: Vec<String> = examples().iter().map(|(name, bytes, _)| dump(name, bytes)).collect();
    let all = dumps.join("\n");
    assert!(DOCUMENT.ends_with(&all), "docs/wire.md ends with other bytes; the examples are\n{all}");
}
