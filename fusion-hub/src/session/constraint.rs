//! A `[[constraint]]` as it is written: the keys of all constraints, and those of its kind.

use std::fmt;
use std::sync::LazyLock;

use cofix_common::constraint::Constraint;
use serde::de::{Deserialize, Deserializer, Error, MapAccess, Visitor};

/// The keys of all kinds together, beginning with those of every constraint.
static KEYS: LazyLock<Vec<&str>> = LazyLock::new(|| {
    let mut keys = vec!["kind", "phones", "from_gps", "to_gps"];
    for key in Constraint::KINDS.iter().flat_map(|kind| Constraint::keys(kind)) {
        if !keys.contains(key) {
            keys.push(key);
        }
    }
    keys
});

/// A `[[constraint]]`. A key that no kind has, and a value of a wrong type, are refused where they stand in the file.
#[derive(Debug)]
pub(super) struct ConstraintEntry {
    pub phones: Option<Vec<String>>,
    pub from_gps: Option<String>,
    pub to_gps: Option<String>,
    pub kind: &'static str,
    /// The bounds by their keys, which may be those of another kind.
    pub bounds: Vec<(&'static str, f64)>,
}

impl ConstraintEntry {
    /// The constraint, without its phones.
    pub(super) fn constraint(&self) -> Result<Constraint, String> {
        self.refuse_keys_of_other_kinds()?;
        let mut table = toml::Table::new();
        table.insert("kind".to_owned(), self.kind.into());
        table.extend(self.bounds.iter().map(|(key, value)| ((*key).to_owned(), (*value).into())));
        table.try_into().map_err(|error: toml::de::Error| error.message().to_owned())
    }

    fn refuse_keys_of_other_kinds(&self) -> Result<(), String> {
        let kind = self.kind;
        let own = Constraint::keys(kind);
        let Some((key, _)) = self.bounds.iter().find(|(key, _)| !own.contains(key)) else { return Ok(()) };
        let owners: Vec<&str> =
            Constraint::KINDS.iter().copied().filter(|kind| Constraint::keys(kind).contains(key)).collect();
        Err(format!(
            "unknown key `{key}` for kind {kind}, which has {}: it belongs to {}",
            own.join(", "),
            owners.join(" and ")
        ))
    }
}

impl<'de> Deserialize<'de> for ConstraintEntry {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_struct("ConstraintEntry", &KEYS, EntryVisitor)
    }
}

struct EntryVisitor;

impl<'de> Visitor<'de> for EntryVisitor {
    type Value = ConstraintEntry;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("struct ConstraintEntry")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
        let mut kind = None;
        let (mut phones, mut from_gps, mut to_gps, mut bounds) = (None, None, None, Vec::new());
        while let Some(Key(key)) = map.next_key()? {
            match key {
                "kind" => kind = Some(map.next_value::<KindName>()?.0),
                "phones" => phones = Some(map.next_value()?),
                "from_gps" => from_gps = Some(map.next_value()?),
                "to_gps" => to_gps = Some(map.next_value()?),
                bound => bounds.push((bound, map.next_value()?)),
            }
        }
        let kind = kind.ok_or_else(|| A::Error::missing_field("kind"))?;
        Ok(ConstraintEntry { phones, from_gps, to_gps, kind, bounds })
    }
}

/// One of [`KEYS`].
struct Key(&'static str);

impl<'de> Deserialize<'de> for Key {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let word = String::deserialize(deserializer)?;
        let known = KEYS.iter().find(|key| **key == word);
        known.map(|key| Self(key)).ok_or_else(|| D::Error::unknown_field(&word, &KEYS))
    }
}

/// The name of a kind.
struct KindName(&'static str);

impl<'de> Deserialize<'de> for KindName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let word = String::deserialize(deserializer)?;
        let known = Constraint::KINDS.iter().find(|kind| **kind == word);
        known.map(|kind| Self(kind)).ok_or_else(|| D::Error::unknown_variant(&word, Constraint::KINDS))
    }
}
