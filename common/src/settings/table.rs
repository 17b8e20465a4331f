//! What a table of settings is. [`tables!`] makes everything about a key from one place: the field with its documentation, the key as a
//! file may give it, the check of its range, and the comment that is printed before it.

use std::fmt::Write as _;
use std::ops::RangeInclusive;

use toml::Value;

/// A key of the settings with its value.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// The table, as `stochastic.code`.
    pub table: String,
    /// What the table is about.
    pub about: String,
    /// The key within its table.
    pub key: &'static str,
    /// What the key means.
    pub meaning: String,
    /// The unit, or what else the value is: a word, a switch.
    pub unit: &'static str,
    /// The values that are allowed, in words.
    pub range: String,
    /// The value; `None` where what is chosen elsewhere in the table has no use for the key.
    pub value: Option<Value>,
    /// Whether the value is one of those that are allowed.
    pub is_within: bool,
}

impl Entry {
    /// Table and key, as `stochastic.code.floor_m2`.
    pub fn path(&self) -> String {
        join(&self.table, self.key)
    }
}

/// The path of `key` within the table `path`, which is empty for the root.
pub(super) fn join(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") }
}

/// The lines of a documentation comment as one text.
pub(super) fn text(lines: &[&str]) -> String {
    lines.iter().map(|line| line.trim()).collect::<Vec<_>>().join(" ")
}

/// A value of a key.
pub(super) trait Leaf {
    /// How the values that are allowed are told.
    type Range;

    /// The value as TOML has it, if there is one.
    fn value(&self) -> Option<Value>;

    /// Whether the value is one of those that are allowed.
    fn is_within(&self, range: &Self::Range) -> bool;

    /// The values that are allowed, in words.
    fn range(range: &Self::Range) -> String;
}

/// A word out of a few.
pub(super) trait Word: Copy + 'static {
    /// The words and what they stand for.
    const WORDS: &'static [(&'static str, Self)];

    /// Whether both are the same.
    fn is(self, other: Self) -> bool;

    /// The word.
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

/// Of a key that goes with one choice and not with another.
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
        // Writing into a text cannot fail.
        let _ = write!(text, "{between}\"{word}\"");
    }
    text
}

/// A number as people write it.
pub(super) fn number(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 || !size.is_finite() || (1e-3..1e5).contains(&size) {
        value.to_string()
    } else {
        format!("{value:e}")
    }
}

/// What a table's keys have to do with one another.
pub(super) trait Rules {
    /// Drops or fills what a choice of the table has no use for or needs; `is_given` tells which keys a file gave.
    fn settle(&mut self, is_given: &dyn Fn(&str) -> bool) {
        let _ = is_given;
    }

    /// A key whose value does not go with the other keys of the table, and why.
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

/// Makes tables of settings. Each has keys with unit and range, then tables within it, then keys that a file may have in it although
/// they are no settings.
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
            /// Takes over what a file gives.
            pub(super) fn take(&mut self, given: &$Keys) {
                $(if let Some(value) = given.$key { self.$key = value; })*
                $(self.$sub.take(&given.$sub);)*
                crate::settings::table::Rules::settle(self, &|key| {
                    $(if key == stringify!($key) { return given.$key.is_some(); })*
                    let _ = key;
                    false
                });
            }

            /// Shows every key in order; `path` is the table's own.
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

            /// The first key that does not go with the others, by table and key, and why.
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

/// A range for the documentation of the code.
macro_rules! range_text {
    (()) => { "all values of the type" };
    ($($range:tt)+) => { concat!("`", stringify!($($range)+), "`") };
}

pub(super) use {range_text, tables, words};
