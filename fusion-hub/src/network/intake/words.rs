//! Words of agents, which go into logs, tables and reports: no line of a log can be made by them, and none fills it.

use cofix_common::wire::PhoneStatus;

/// Most characters of a text that are kept.
const MAXIMUM_CHARACTERS: usize = 300;
/// Most reasons of an agent's skips that are kept.
const MAXIMUM_REASONS: usize = 512;

/// A text in one line without invisible characters, cut where it is too long.
pub(crate) fn tamed(text: &str) -> String {
    let mut tamed = String::new();
    for (rank, character) in text.chars().enumerate() {
        if rank >= MAXIMUM_CHARACTERS {
            let cut = format!("… ({} bytes)", text.len());
            tamed.push_str(&cut);
            break;
        }
        if is_visible(character) {
            tamed.push(character);
        } else {
            tamed.extend(character.escape_default());
        }
    }
    tamed
}

/// Neither a control character, nor one that breaks lines or turns the direction of writing.
fn is_visible(character: char) -> bool {
    let others = ['\u{200e}', '\u{200f}', '\u{2028}', '\u{2029}', '\u{feff}'];
    let turns = matches!(character, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    !(character.is_control() || turns || others.contains(&character))
}

/// A status with tamed texts.
pub(super) fn tamed_status(status: PhoneStatus) -> PhoneStatus {
    match status {
        PhoneStatus::Started { summary, epochs_expected } => {
            PhoneStatus::Started { summary: tamed(&summary), epochs_expected }
        }
        PhoneStatus::Finished { epochs_published, skips, error } => PhoneStatus::Finished {
            epochs_published,
            skips: skips.with_texts(MAXIMUM_REASONS, tamed),
            error: error.as_deref().map(tamed),
        },
    }
}

#[cfg(test)]
mod tests {
    use cofix_common::skips::{Reason, Skips};

    use super::*;

    #[test]
    fn words_make_no_line_of_a_log() {
        assert_eq!(tamed("drive.rnx, 20 times real time"), "drive.rnx, 20 times real time");
        assert_eq!(tamed("Мой-телефон"), "Мой-телефон");
        let forged = "ok\n2026-11-28T10:00:00Z  INFO cofix_hub: all is well\r\u{1b}[2K\u{202e}\u{2028}";
        assert_eq!(
            tamed(forged),
            "ok\\n2026-11-28T10:00:00Z  INFO cofix_hub: all is well\\r\\u{1b}[2K\\u{202e}\\u{2028}"
        );
        assert_eq!(tamed(&"ä".repeat(100_000)), "ä".repeat(300) + "… (200000 bytes)");
    }

    #[test]
    fn statuses_keep_their_counts() {
        let mut skips = Skips::default();
        skips.add_many(Reason::EpochReceivedTwice, 7, || "a\nb".to_owned());
        skips.add_within("x\ny", Reason::EpochOutOfOrder, String::new);
        let status = PhoneStatus::Finished { epochs_published: 5, skips, error: Some("\t".to_owned()) };
        let PhoneStatus::Finished { epochs_published, skips, error } = tamed_status(status) else { panic!() };
        assert_eq!((epochs_published, error.as_deref()), (5, Some("\\t")));
        let twice = skips.get(Reason::EpochReceivedTwice).unwrap();
        assert_eq!((twice.count, twice.first.as_str()), (7, "a\\nb"));
        assert_eq!(skips.iter().filter(|(reason, _)| reason.contains('\n')).count(), 0);
        assert_eq!(skips.total(), 8);
    }
}
