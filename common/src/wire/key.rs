//! Key expressions: who says what where.
//!
//! | key | what |
//! |---|---|
//! | `cofix/<group>/phone/<phone>/epoch` | [`EpochMessage`](super::EpochMessage)s of an agent |
//! | `cofix/<group>/phone/<phone>/status` | [`StatusMessage`](super::StatusMessage)s of an agent |
//! | `cofix/<group>/phone/<phone>/alive` | liveliness token of an agent |
//! | `cofix/<group>/phone/<phone>/receipt` | query to the hub, with `?run=<Zenoh id of the agent>`: the [`ReceiptMessage`](super::ReceiptMessage) of that run |
//! | `cofix/<group>/phone/<phone>/history` | query to an agent: the [`KeptMessage`](super::KeptMessage), its status messages and, with `?run=<Zenoh id of the agent>;from=<n>;to=<m>`, the epochs of sequence numbers n to m − 1 that it keeps |
//! | `cofix/<group>/phone/<phone>/pace` | query to the hub of an agent that plays a recording at the speed of time or a multiple of it, with `?first=<its first epoch, ns of GPS time>;speed=<multiple>`: the [`PaceMessage`](super::PaceMessage) for that epoch, so that all agents of a group play the same time |
//! | `cofix/<group>/fused/<phone>` | [`FusedMessage`](super::FusedMessage)s of the hub |

/// Longest name of a group or phone, bytes.
pub const MAXIMUM_NAME_BYTES: usize = 64;

/// A name that cannot be one chunk of a key expression.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum KeyNameError {
    /// Nothing.
    #[error("the name is empty; give it at least one character")]
    Empty,
    /// Longer than [`MAXIMUM_NAME_BYTES`].
    #[error("the name '{name}…' has {bytes} bytes; {MAXIMUM_NAME_BYTES} are allowed")]
    TooLong {
        /// Its first characters.
        name: String,
        /// Its length.
        bytes: usize,
    },
    /// A character with a meaning in key expressions, or one that cannot be seen.
    #[error(
        "the name '{name}' contains {character:?}; letters, digits, '-', '_' and '.' are safe, and / * $ ? # @, blanks and control characters are not allowed"
    )]
    Forbidden {
        /// The name.
        name: String,
        /// The first such character.
        character: char,
    },
}

/// Whether a name may be a chunk of a key expression, and if not, why.
///
/// # Errors
/// See [`KeyNameError`].
pub fn check_name(name: &str) -> Result<(), KeyNameError> {
    if name.is_empty() {
        return Err(KeyNameError::Empty);
    }
    if name.len() > MAXIMUM_NAME_BYTES {
        return Err(KeyNameError::TooLong { name: name.chars().take(16).collect(), bytes: name.len() });
    }
    let forbidden =
        |c: &char| matches!(c, '/' | '*' | '$' | '?' | '#' | '@') || c.is_whitespace() || c.is_control();
    match name.chars().find(forbidden) {
        Some(character) => Err(KeyNameError::Forbidden { name: name.escape_debug().to_string(), character }),
        None => Ok(()),
    }
}

/// Where a phone's epochs are published.
///
/// # Errors
/// When a name cannot be a chunk of a key.
pub fn epoch_key(group: &str, phone: &str) -> Result<String, KeyNameError> {
    phone_key(group, phone, "epoch")
}

/// Where a phone's agent says that it started and finished.
///
/// # Errors
/// When a name cannot be a chunk of a key.
pub fn status_key(group: &str, phone: &str) -> Result<String, KeyNameError> {
    phone_key(group, phone, "status")
}

/// The liveliness token of a phone's agent.
///
/// # Errors
/// When a name cannot be a chunk of a key.
pub fn liveliness_key(group: &str, phone: &str) -> Result<String, KeyNameError> {
    phone_key(group, phone, "alive")
}

/// Where an agent asks how many of its epochs the hub has received.
///
/// # Errors
/// When a name cannot be a chunk of a key.
pub fn receipt_key(group: &str, phone: &str) -> Result<String, KeyNameError> {
    phone_key(group, phone, "receipt")
}

/// Where an agent that plays a recording asks when its first epoch is due.
///
/// # Errors
/// When a name cannot be a chunk of a key.
pub fn pace_key(group: &str, phone: &str) -> Result<String, KeyNameError> {
    phone_key(group, phone, "pace")
}

/// All phones' questions for the pace of a group.
///
/// # Errors
/// When the group's name cannot be a chunk of a key.
pub fn all_paces_key(group: &str) -> Result<String, KeyNameError> {
    check_name(group).map(|()| format!("cofix/{group}/phone/*/pace"))
}

/// Where an agent answers with what it keeps of its run.
///
/// # Errors
/// When a name cannot be a chunk of a key.
pub fn history_key(group: &str, phone: &str) -> Result<String, KeyNameError> {
    phone_key(group, phone, "history")
}

/// All phones' receipts of a group.
///
/// # Errors
/// When the group's name cannot be a chunk of a key.
pub fn all_receipts_key(group: &str) -> Result<String, KeyNameError> {
    check_name(group).map(|()| format!("cofix/{group}/phone/*/receipt"))
}

/// Where a phone's fused states are published.
///
/// # Errors
/// When a name cannot be a chunk of a key.
pub fn fused_key(group: &str, phone: &str) -> Result<String, KeyNameError> {
    check_name(group)?;
    check_name(phone)?;
    Ok(format!("cofix/{group}/fused/{phone}"))
}

/// All phones' epochs of a group.
///
/// # Errors
/// When the group's name cannot be a chunk of a key.
pub fn all_epochs_key(group: &str) -> Result<String, KeyNameError> {
    check_name(group).map(|()| format!("cofix/{group}/phone/*/epoch"))
}

/// All phones' status messages of a group.
///
/// # Errors
/// When the group's name cannot be a chunk of a key.
pub fn all_status_key(group: &str) -> Result<String, KeyNameError> {
    check_name(group).map(|()| format!("cofix/{group}/phone/*/status"))
}

/// All liveliness tokens of a group's agents.
///
/// # Errors
/// When the group's name cannot be a chunk of a key.
pub fn all_liveliness_key(group: &str) -> Result<String, KeyNameError> {
    check_name(group).map(|()| format!("cofix/{group}/phone/*/alive"))
}

/// All fused states of a group.
///
/// # Errors
/// When the group's name cannot be a chunk of a key.
pub fn all_fused_key(group: &str) -> Result<String, KeyNameError> {
    check_name(group).map(|()| format!("cofix/{group}/fused/*"))
}

/// The phone that a `cofix/<group>/phone/<phone>/…` key belongs to.
pub fn phone_of_key(key: &str) -> Option<&str> {
    let mut chunks = key.split('/');
    let prefix = chunks.next()? == "cofix" && chunks.next().is_some() && chunks.next()? == "phone";
    let phone = chunks.next()?;
    let last = chunks.next().is_some() && chunks.next().is_none();
    (prefix && last).then_some(phone)
}

fn phone_key(group: &str, phone: &str, what: &str) -> Result<String, KeyNameError> {
    check_name(group)?;
    check_name(phone)?;
    Ok(format!("cofix/{group}/phone/{phone}/{what}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_the_documented_ones() {
        assert_eq!(epoch_key("wh-3-09", "HP30").unwrap(), "cofix/wh-3-09/phone/HP30/epoch");
        assert_eq!(status_key("g", "p").unwrap(), "cofix/g/phone/p/status");
        assert_eq!(liveliness_key("g", "p").unwrap(), "cofix/g/phone/p/alive");
        assert_eq!(fused_key("g", "p").unwrap(), "cofix/g/fused/p");
        assert_eq!(receipt_key("g", "p").unwrap(), "cofix/g/phone/p/receipt");
        assert_eq!(history_key("g", "p").unwrap(), "cofix/g/phone/p/history");
        assert_eq!(pace_key("g", "p").unwrap(), "cofix/g/phone/p/pace");
        assert_eq!(all_paces_key("g").unwrap(), "cofix/g/phone/*/pace");
        assert_eq!(all_receipts_key("g").unwrap(), "cofix/g/phone/*/receipt");
        assert_eq!(all_epochs_key("g").unwrap(), "cofix/g/phone/*/epoch");
        assert_eq!(all_status_key("g").unwrap(), "cofix/g/phone/*/status");
        assert_eq!(all_liveliness_key("g").unwrap(), "cofix/g/phone/*/alive");
        assert_eq!(all_fused_key("g").unwrap(), "cofix/g/fused/*");
    }

    #[test]
    fn the_phone_is_read_back_from_its_key() {
        for key in [epoch_key("g", "HP30"), status_key("g", "HP30"), liveliness_key("g", "HP30")] {
            assert_eq!(phone_of_key(&key.unwrap()), Some("HP30"));
        }
        for key in [
            "cofix/g/fused/HP30",
            "cofix/g/phone/HP30",
            "cofix/g/phone/HP30/epoch/x",
            "x/g/phone/p/epoch",
            "",
        ] {
            assert_eq!(phone_of_key(key), None, "{key}");
        }
    }

    #[test]
    fn names_that_would_change_the_key_are_refused() {
        assert_eq!(check_name(""), Err(KeyNameError::Empty));
        for name in ["a/b", "*", "a$b", "a?", "a#b", "@a", "a b", "a\u{7}"] {
            let error = check_name(name).unwrap_err();
            assert!(matches!(error, KeyNameError::Forbidden { .. }), "{name:?}: {error}");
            assert!(epoch_key("g", name).is_err() && epoch_key(name, "p").is_err());
            assert!(fused_key("g", name).is_err() && all_epochs_key(name).is_err());
        }
        let long = "x".repeat(MAXIMUM_NAME_BYTES + 1);
        assert!(matches!(check_name(&long), Err(KeyNameError::TooLong { bytes: 65, .. })));
        for name in ["HP30", "wh-3-09", "Мой-телефон", "a.b_c"] {
            assert_eq!(check_name(name), Ok(()), "{name}");
        }
    }
}
