//! The log as JSON objects, one a line.

use std::fmt;

use serde_json::json;
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::time::{FormatTime, SystemTime};
use tracing_subscriber::fmt::{FmtContext, FormatEvent, FormatFields};
use tracing_subscriber::registry::LookupSpan;

use crate::MAXIMUM_ENTRY_BYTES;

/// Format of JSON objects with time (UTC), level, target and message. A message is cut where its line would be too long.
pub(crate) struct JsonLines;

impl<S, N> FormatEvent<S, N> for JsonLines
where
    S: Subscriber + for<'a> LookupSpan<'a>,
    N: for<'a> FormatFields<'a> + 'static,
{
    fn format_event(
        &self,
        context: &FmtContext<'_, S, N>,
        mut writer: Writer<'_>,
        event: &Event<'_>,
    ) -> fmt::Result {
        let mut message = String::new();
        context.field_format().format_fields(Writer::new(&mut message), event)?;
        let metadata = event.metadata();
        writeln!(writer, "{}", line(&now(), *metadata.level(), metadata.target(), &message))
    }
}

/// An error that ends a program.
pub(crate) fn error(message: &str) -> String {
    line(&now(), Level::ERROR, "cofix", message)
}

/// The time of the computer's clock, UTC; empty if it cannot be written.
fn now() -> String {
    let mut time = String::new();
    SystemTime.format_time(&mut Writer::new(&mut time)).map_or_else(|_| String::new(), |()| time)
}

/// An entry of at most [`MAXIMUM_ENTRY_BYTES`], without the end of the line.
fn line(time: &str, level: Level, target: &str, message: &str) -> String {
    let whole = object(time, level, target, message);
    if whole.len() <= MAXIMUM_ENTRY_BYTES {
        return whole;
    }
    let cut = format!("… ({} bytes)", message.len());
    let room_bytes = MAXIMUM_ENTRY_BYTES.saturating_sub(object(time, level, target, &cut).len());
    let mut used_bytes = 0;
    let first_beyond = message.char_indices().find(|(_, character)| {
        used_bytes += bytes_of(*character);
        used_bytes > room_bytes
    });
    let kept = message.get(..first_beyond.map_or(message.len(), |(at, _)| at)).unwrap_or_default();
    object(time, level, target, &format!("{kept}{cut}"))
}

/// Most bytes that a character takes in [`object`].
const fn bytes_of(character: char) -> usize {
    match character {
        '"' | '\\' => 2,
        '\u{0}'..='\u{1f}' | '\u{2028}' | '\u{2029}' => 6,
        other => other.len_utf8(),
    }
}

fn object(time: &str, level: Level, target: &str, message: &str) -> String {
    let message = serde_json::Value::from(message);
    let entry = json!({ "time": time, "level": level.as_str(), "target": target, "message": message });
    // JSON allows these two in strings, and some readers end a line there.
    entry.to_string().replace('\u{2028}', "\\u2028").replace('\u{2029}', "\\u2029")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(line: &str) -> serde_json::Value {
        assert!(line.len() <= MAXIMUM_ENTRY_BYTES, "{}", line.len());
        assert!(!line.contains(['\n', '\r', '\u{2028}', '\u{2029}']), "{line}");
        // What comes to the writer stays as it is.
        assert_eq!(crate::one_entry(format!("{line}\n").as_bytes()), format!("{line}\n"));
        serde_json::from_str(line).unwrap()
    }

    #[test]
    fn an_entry_is_one_object_whatever_texts_are_in_it() {
        let foreign = "ok\r\n{\"level\":\"INFO\"}\u{2028}\u{2029}\u{1b}[31m\u{0}ä";
        let entry = read(&line("2026-01-01T00:00:00Z", Level::WARN, "cofix_hub::live", foreign));
        let expected = json!({
            "time": "2026-01-01T00:00:00Z", "level": "WARN", "target": "cofix_hub::live", "message": foreign
        });
        assert_eq!(entry, expected);
    }

    #[test]
    fn a_long_message_is_cut_and_the_line_is_whole() {
        for text in ["a", "ä", "\u{1}", "\u{2028}", "\"", "a\u{1}ä"] {
            let message = text.repeat(20_000);
            let entry = read(&line("2026-01-01T00:00:00Z", Level::ERROR, "cofix", &message));
            let said = entry["message"].as_str().unwrap();
            let end = format!("… ({} bytes)", message.len());
            let kept = said.strip_suffix(&end).unwrap();
            assert!(message.starts_with(kept), "{text:?}");
            assert!(kept.len() > 300, "{text:?}: {}", kept.len());
        }
    }
}
