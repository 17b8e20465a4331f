//! Key expressions of messages and queries.
//!
//! | key | content |
//! |---|---|
//! | `cofix/<group>/phone/<phone>/epoch` | [`EpochMessage`](super::EpochMessage)s of an agent |
//! | `cofix/<group>/phone/<phone>/status` | [`StatusMessage`](super::StatusMessage)s of an agent |
//! | `cofix/<group>/phone/<phone>/alive` | liveliness token of an agent |
//! | `cofix/<group>/phone/<phone>/receipt` | query to the hub, with `?run=<Zenoh id of the agent>`: the [`ReceiptMessage`](super::ReceiptMessage) of that run |
//! | `cofix/<group>/phone/<phone>/history` | query to an agent: the [`KeptMessage`](super::KeptMessage), its status messages and, with `?run=<Zenoh id of the agent>;from=<n>;to=<m>`, the epochs of sequence numbers n to m − 1 that it keeps |
//! | `cofix/<group>/phone/<phone>/pace` | query to the hub of an agent that plays a recording at the speed of time or a multiple of it, with `?first=<its first epoch, ns of GPS time>;speed=<multiple>`: the [`PaceMessage`](super::PaceMessage) for that epoch, so that all agents of a group play the same time |
//! | `cofix/<group>/fused/<phone>` | [`FusedMessage`](super::FusedMessage)s of the hub |
//! | `cofix/<group>/fused/<phone>/json` | the same states as JSON, of a hub that was told to |
//! | `cofix/<group>/integrity` | [`IntegrityMessage`](super::IntegrityMessage)s of the hub |
//! | `cofix/<group>/status` | query to the hub: its status as JSON |

/// Maximum length of the name of a group or phone, bytes.
pub const MAXIMUM_NAME_BYTES: usize = 64;

/// Error for a name that cannot be a chunk of a key expression.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum KeyNameError {
    /// Empty name.
    #[error("the name is empty; give it at least one character")]
    Empty,
    /// Name longer than [`MAXIMUM_NAME_BYTES`].
    #[error("the name '{name}…' has {bytes} bytes; {MAXIMUM_NAME_BYTES} are allowed")]
    TooLong {
        /// First characters of the name.
        name: String,
        /// Length of the name.
        bytes: usize,
    },
    /// A character with a meaning in key expressions, or an invisible one.
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

/// Checks whether a name may be a chunk of a key expression.
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

/// Key expression of a phone's epochs: `cofix/<group>/phone/<phone>/epoch`.
///
/// # Errors
/// If a name cannot be a chunk of a key.
pub fn epoch_key(group: &str, phone: &str) -> Result<String, KeyNameError> {
    phone_key(group, phone, "epoch")
}

/// Key expression of the status messages of a phone's agent: `cofix/<group>/phone/<phone>/status`.
///
/// # Errors
/// If a name cannot be a chunk of a key.
pub fn status_key(group: &str, phone: &str) -> Result<String, KeyNameError> {
    phone_key(group, phone, "status")
}

/// Key expression of the liveliness token of a phone's agent: `cofix/<group>/phone/<phone>/alive`.
///
/// # Errors
/// If a name cannot be a chunk of a key.
pub fn liveliness_key(group: &str, phone: &str) -> Result<String, KeyNameError> {
    phone_key(group, phone, "alive")
}

/// Key expression of an agent's query for its receipt: `cofix/<group>/phone/<phone>/receipt`.
///
/// # Errors
/// If a name cannot be a chunk of a key.
pub fn receipt_key(group: &str, phone: &str) -> Result<String, KeyNameError> {
    phone_key(group, phone, "receipt")
}

/// Key expression of the query of an agent with a paced recording for the time of its first epoch: `cofix/<group>/phone/<phone>/pace`.
///
/// # Errors
/// If a name cannot be a chunk of a key.
pub fn pace_key(group: &str, phone: &str) -> Result<String, KeyNameError> {
    phone_key(group, phone, "pace")
}

/// Key expression of the pace queries of all phones of a group.
///
/// # Errors
/// If the group's name cannot be a chunk of a key.
pub fn all_paces_key(group: &str) -> Result<String, KeyNameError> {
    check_name(group).map(|()| format!("cofix/{group}/phone/*/pace"))
}

/// Key expression of the queries for an agent's kept epochs: `cofix/<group>/phone/<phone>/history`.
///
/// # Errors
/// If a name cannot be a chunk of a key.
pub fn history_key(group: &str, phone: &str) -> Result<String, KeyNameError> {
    phone_key(group, phone, "history")
}

/// Key expression of the receipt queries of all phones of a group.
///
/// # Errors
/// If the group's name cannot be a chunk of a key.
pub fn all_receipts_key(group: &str) -> Result<String, KeyNameError> {
    check_name(group).map(|()| format!("cofix/{group}/phone/*/receipt"))
}

/// Key expression of the events of a group's integrity: `cofix/<group>/integrity`.
///
/// # Errors
/// If the group's name cannot be a chunk of a key.
pub fn integrity_key(group: &str) -> Result<String, KeyNameError> {
    check_name(group).map(|()| format!("cofix/{group}/integrity"))
}

/// Key expression of the query to a group's hub for its status: `cofix/<group>/status`.
///
/// # Errors
/// If the group's name cannot be a chunk of a key.
pub fn hub_status_key(group: &str) -> Result<String, KeyNameError> {
    check_name(group).map(|()| format!("cofix/{group}/status"))
}

/// Key expression of a phone's fused states: `cofix/<group>/fused/<phone>`.
///
/// # Errors
/// If a name cannot be a chunk of a key.
pub fn fused_key(group: &str, phone: &str) -> Result<String, KeyNameError> {
    check_name(group)?;
    check_name(phone)?;
    Ok(format!("cofix/{group}/fused/{phone}"))
}

/// Key expression of a phone's fused states as JSON: `cofix/<group>/fused/<phone>/json`.
///
/// # Errors
/// If a name cannot be a chunk of a key.
pub fn fused_json_key(group: &str, phone: &str) -> Result<String, KeyNameError> {
    fused_key(group, phone).map(|key| key + "/json")
}

/// Key expression of the epochs of all phones of a group.
///
/// # Errors
/// If the group's name cannot be a chunk of a key.
pub fn all_epochs_key(group: &str) -> Result<String, KeyNameError> {
    check_name(group).map(|()| format!("cofix/{group}/phone/*/epoch"))
}

/// Key expression of the status messages of all agents of a group.
///
/// # Errors
/// If the group's name cannot be a chunk of a key.
pub fn all_status_key(group: &str) -> Result<String, KeyNameError> {
    check_name(group).map(|()| format!("cofix/{group}/phone/*/status"))
}

/// Key expression of the liveliness tokens of all agents of a group.
///
/// # Errors
/// If the group's name cannot be a chunk of a key.
pub fn all_liveliness_key(group: &str) -> Result<String, KeyNameError> {
    check_name(group).map(|()| format!("cofix/{group}/phone/*/alive"))
}

/// Key expression of all fused states of a group.
///
/// # Errors
/// If the group's name cannot be a chunk of a key.
pub fn all_fused_key(group: &str) -> Result<String, KeyNameError> {
    check_name(group).map(|()| format!("cofix/{group}/fused/*"))
}

/// The phone in a key `cofix/<group>/phone/<phone>/…`.
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
        assert_eq!(fused_json_key("g", "p").unwrap(), "cofix/g/fused/p/json");
        assert_eq!(receipt_key("g", "p").unwrap(), "cofix/g/phone/p/receipt");
        assert_eq!(history_key("g", "p").unwrap(), "cofix/g/phone/p/history");
        assert_eq!(pace_key("g", "p").unwrap(), "cofix/g/phone/p/pace");
        assert_eq!(all_paces_key("g").unwrap(), "cofix/g/phone/*/pace");
        assert_eq!(all_receipts_key("g").unwrap(), "cofix/g/phone/*/receipt");
        assert_eq!(all_epochs_key("g").unwrap(), "cofix/g/phone/*/epoch");
        assert_eq!(all_status_key("g").unwrap(), "cofix/g/phone/*/status");
        assert_eq!(all_liveliness_key("g").unwrap(), "cofix/g/phone/*/alive");
        assert_eq!(all_fused_key("g").unwrap(), "cofix/g/fused/*");
        assert_eq!(hub_status_key("g").unwrap(), "cofix/g/status");
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
