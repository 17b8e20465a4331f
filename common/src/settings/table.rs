//! Tables of settings. [`tables!`] generates everything about a key from one place: the documented field, the key in
//! files, the check of its range, and its printed comment.

use std::fmt::Write as _;
use std::ops::RangeInclusive;

use toml::Value;

/// A key of the settings with its value and description.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Table of the key, as `stochastic.code`.
    pub table: String,
    /// Description of the table.
    pub about: String,
    /// Name of the key in its table.
    pub key: &'static str,
    /// Meaning of the key.
    pub meaning: String,
    /// Unit, or the type of a value without unit: a word, a switch.
    pub unit: &'static str,
    /// Allowed values in words.
    pub range: String,
    /// Value; `None` if the choices in the table do not use the key.
    pub value: Option<Value>,
    /// Whether the value is allowed.
    pub is_within: bool,
}

impl Entry {
    /// Path of table and key, as `stochastic.code.floor_m2`.
    pub fn path(&self) -> String {
        join(&self.table, self.key)
    }
}

/// Path of `key` in the table `path`, which is empty for the root.
pub(super) fn join(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") }
}

/// Joins the lines of a documentation comment to one text.
pub(super) fn text(lines: &[&str]) -> String {
    lines.iter().map(|line| line.trim()).collect::<Vec<_>>().join(" ")
}

/// Type of a key's value.
pub(super) trait Leaf {
    /// Type of the allowed range.
    type Range;

    /// Value in TOML, if there is one.
    fn value(&self) -> Option<Value>;

    /// Whether the value is in the range.
    fn is_within(&self, range: &Self::Range) -> bool;

    /// Text of the range.
    fn range(range: &Self::Range) -> String;
}

/// An enumeration written as a word.
pub(super) trait Word: Copy + 'static {
    /// All words with their values.
    const WORDS: &'static [(&'static str, Self)];

    /// Whether both values are equal.
    fn is(self, other: Self) -> bool;

    /// Word of the value.
    fn word(self) -> &'static str {
        Self::WORDS.iter().find(|(_, value)| self.is(*value)).map_or("", |(word, _)| word)
    }
}

impl Leaf for f64 {
    type Range = RangeInclusive<Self>;

    fn value(&self) -> Option<Value> {
        Some(Value::Float(*self))
    }

    fn is_within(&self, range: &Self::Range) -> bool {
        range.contains(self)
    }

    fn range(range: &Self::Range) -> String {
        format!("{} to {}", number(*range.start()), number(*range.end()))
    }
}

impl Leaf for u32 {
    type Range = RangeInclusive<Self>;

    fn value(&self) -> Option<Value> {
        Some(Value::Integer(i64::from(*self)))
    }

    fn is_within(&self, range: &Self::Range) -> bool {
        range.contains(self)
    }

    fn range(range: &Self::Range) -> String {
        format!("{} to {}, whole", range.start(), range.end())
    }
}

impl Leaf for bool {
    type Range = ();

    fn value(&self) -> Option<Value> {
        Some(Value::Boolean(*self))
    }

    fn is_within(&self, (): &()) -> bool {
        true
    }

    fn range((): &()) -> String {
        "true or false".to_owned()
    }
}

/// Value of a key that only some choices use.
impl<T: Leaf> Leaf for Option<T> {
    type Range = T::Range;

    fn value(&self) -> Option<Value> {
        self.as_ref().and_then(T::value)
    }

    fn is_within(&self, range: &Self::Range) -> bool {
        self.as_ref().is_none_or(|value| value.is_within(range))
    }

    fn range(range: &Self::Range) -> String {
        T::range(range)
    }
}

/// The words of `W` as a text: `"a", "b" or "c"`.
pub(super) fn words_of<W: Word>() -> String {
    let mut text = String::new();
    for (index, (word, _)) in W::WORDS.iter().enumerate() {
        let between = match index {
            0 => "",
            _ if index + 1 == W::WORDS.len() => " or ",
            _ => ", ",
        };
        // Writing to a string cannot fail.
        let _ = write!(text, "{between}\"{word}\"");
    }
    text
}

/// Text of a number.
pub(super) fn number(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 || !size.is_finite() || (1e-3..1e5).contains(&size) {
        value.to_string()
    } else {
        format!("{value:e}")
    }
}

/// Dependencies between the keys of a table.
pub(super) trait Rules {
    /// Drops unused and fills missing values according to the table's choices; `is_given` tells whether a file gave a key.
    fn apply_choices(&mut self, is_given: &dyn Fn(&str) -> bool) {
        let _ = is_given;
    }

    /// A key that contradicts other keys of the table, and the reason.
    fn contradiction(&self) -> Option<(&'static str, String)> {
        None
    }
}

/// Implements [`Leaf`] for words.
macro_rules! words {
    ($($type:ty { $($word:literal => $value:expr),+ $(,)? })+) => {$(
        impl crate::settings::table::Word for $type {
            const WORDS: &'static [(&'static str, Self)] = &[$(($word, $value)),+];

            fn is(self, other: Self) -> bool {
                self == other
            }
        }

        impl crate::settings::table::Leaf for $type {
            type Range = ();

            fn value(&self) -> Option<toml::Value> {
                Some(toml::Value::String(crate::settings::table::Word::word(*self).to_owned()))
            }

            fn is_within(&self, (): &()) -> bool {
                true
            }

            fn range((): &()) -> String {
                crate::settings::table::words_of::<Self>()
            }
        }
    )+};
}

/// Generates tables of settings. Each has keys with unit and range, then subtables, then keys that are allowed in a file without being
/// settings.
macro_rules! tables {
    ($(
        $(#[doc = $about:literal])+
        $Name:ident by $Keys:ident {
            $($(#[doc = $doc:literal])+ $key:ident: $type:ty = [$unit:literal, $($range:tt)+];)*
            $(table $(#[doc = $sub_doc:literal])+ $sub:ident: $Sub:ty, $SubKeys:ty;)*
            $(beside $(#[doc = $other_doc:literal])+ $other:ident: $other_type:ty;)*
        }
    )+) => {$(
        $(#[doc = $about])+
        #[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        pub struct $Name {
            $(
                $(#[doc = $doc])+
                #[doc = ""]
                #[doc = concat!("Unit: ", $unit, "; range: ", crate::settings::table::range_text!($($range)+), ".")]
                pub $key: $type,
            )*
            $($(#[doc = $sub_doc])+ pub $sub: $Sub,)*
        }

        #[doc = concat!("What a file may give of [`", stringify!($Name), "`]; what it leaves out is as the preset has it.")]
        #[derive(Clone, Debug, Default, PartialEq, serde::Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct $Keys {
            $($(#[doc = $doc])+ pub $key: Option<$type>,)*
            $($(#[doc = $sub_doc])+ pub $sub: $SubKeys,)*
            $($(#[doc = $other_doc])+ pub $other: Option<$other_type>,)*
        }

        impl $Name {
            /// Takes over the keys given in a file.
            pub(super) fn take(&mut self, given: &$Keys) {
                $(if let Some(value) = given.$key { self.$key = value; })*
                $(self.$sub.take(&given.$sub);)*
                crate::settings::table::Rules::apply_choices(self, &|key| {
                    $(if key == stringify!($key) { return given.$key.is_some(); })*
                    let _ = key;
                    false
                });
            }

            /// Visits all keys in order; `path` is the path of the table.
            pub(super) fn visit(&self, path: &str, visit: &mut dyn FnMut(crate::settings::Entry)) {
                let _ = &visit;
                let _about = crate::settings::table::text(&[$($about),+]);
                $(
                    let range: <$type as crate::settings::table::Leaf>::Range = $($range)+;
                    visit(crate::settings::Entry {
                        table: path.to_owned(),
                        about: _about.clone(),
                        key: stringify!($key),
                        meaning: crate::settings::table::text(&[$($doc),+]),
                        unit: $unit,
                        range: <$type as crate::settings::table::Leaf>::range(&range),
                        value: crate::settings::table::Leaf::value(&self.$key),
                        is_within: crate::settings::table::Leaf::is_within(&self.$key, &range),
                    });
                )*
                $(self.$sub.visit(&crate::settings::table::join(path, stringify!($sub)), visit);)*
            }

            /// The first contradiction between keys, with table, key and reason.
            pub(super) fn contradiction(&self, path: &str) -> Option<(String, &'static str, String)> {
                if let Some((key, reason)) = crate::settings::table::Rules::contradiction(self) {
                    return Some((path.to_owned(), key, reason));
                }
                $(
                    let within = crate::settings::table::join(path, stringify!($sub));
                    let found = self.$sub.contradiction(&within);
                    if found.is_some() {
                        return found;
                    }
                )*
                None
            }
        }
    )+};
}

/// Text of a range for the documentation of the code.
macro_rules! range_text {
    (()) => { "all values of the type" };
    ($($range:tt)+) => { concat!("`", stringify!($($range)+), "`") };
}

pub(super) use {range_text, tables, words};
