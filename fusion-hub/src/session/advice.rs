//! Advice for mistakes in session files: what to write instead.

use cofix_agent::settings::{LogOptions, Masks};
use cofix_common::constraint::Constraint;
use cofix_common::settings::{
    AlignmentKeys, BaseKeys, CodeVarianceKeys, ConstraintKeys, CorrectionKeys, FilterKeys, IntegrityKeys,
    RateVarianceKeys, StochasticKeys,
};
use serde::de::DeserializeOwned;

use super::constraint::ConstraintEntry;
use super::text::{EvaluationTable, PhoneEntry, ProductsTable, SessionFile};

/// Least similarity (Jaro-Winkler, 0 to 1) at which a name is taken for a typing error.
const SIMILAR: f64 = 0.75;
/// The same where the name as it is written is a key elsewhere.
const NEARLY_THE_SAME: f64 = 0.95;

/// Names of tables of which there may be several, each in two brackets.
const LISTS_OF_TABLES: [&str; 2] = ["phone", "constraint"];

/// Advice on the TOML parser's error in `text`, if there is any.
pub(super) fn advice(error: &toml::de::Error, text: &str) -> Option<String> {
    let message = error.message();
    if let Some(advice) = on_doubled_brackets(text) {
        return Some(advice);
    }
    if let Some(key) = quoted_after(message, "unknown field ") {
        return on_unknown_key(key, message);
    }
    if let Some(word) = quoted_after(message, "unknown variant ") {
        let known = listed(message);
        return nearest(word, &known).map(|(_, known)| did_you_mean(&known));
    }
    if message.contains("missing field `group`") {
        return Some("write group = \"NAME\" at the head of the file, before the first table".to_owned());
    }
    if message.contains("missing field `name`") {
        return Some("give every [[phone]] a name = \"NAME\"".to_owned());
    }
    if message.contains("missing field `kind`") {
        return Some(format!("give every [[constraint]] a kind: \"{}\"", Constraint::KINDS.join("\", \"")));
    }
    if message.contains("escape") {
        return Some("write text with backslashes in single quotes: 'C:\\drive\\a.rnx'".to_owned());
    }
    let place = Place::of(error, text)?;
    if message.starts_with("invalid type") || message.starts_with("invalid value") {
        return place.on_type(message);
    }
    place.on_syntax()
}

/// Advice on two brackets around the name of a single table.
fn on_doubled_brackets(text: &str) -> Option<String> {
    let doubled = |line: &str| {
        let name = line.trim().strip_prefix("[[")?.split("]]").next()?.trim().to_owned();
        let table = name.split('.').next()?;
        let is_single =
            !LISTS_OF_TABLES.contains(&table) && keys::<SessionFile>().iter().any(|key| key == table);
        is_single.then_some(name)
    };
    let name = text.lines().find_map(doubled)?;
    Some(if name == "constraints" {
        "write [[constraint]] for what is known of phones; the table [constraints] says how constraints act"
            .to_owned()
    } else {
        format!("write [{name}], with one bracket: there is one")
    })
}

/// The place where the parser stopped.
struct Place<'a> {
    /// The key before it, if there is one.
    key: Option<&'a str>,
    /// The text of the error.
    value: &'a str,
}

impl<'a> Place<'a> {
    fn of(error: &toml::de::Error, text: &'a str) -> Option<Self> {
        let span = error.span()?;
        let before = text.get(..span.start)?;
        let line = before.rsplit('\n').next().unwrap_or_default();
        let key = line.rsplit_once('=').map_or(line, |(key, _)| key);
        let key = key.trim().trim_start_matches('[').trim();
        Some(Self { key: Some(key).filter(|key| !key.is_empty()), value: text.get(span)?.trim() })
    }

    fn on_type(&self, message: &str) -> Option<String> {
        let Self { key, value } = self;
        let key = key.unwrap_or("the key");
        let table = value.trim_matches(['[', ']', ' ']);
        if LISTS_OF_TABLES.contains(&table) && value.starts_with('[') {
            return Some(format!("write [[{table}]], with two brackets: there may be several"));
        }
        let expects = |what: &str| message.contains(&format!("expected {what}"));
        if LISTS_OF_TABLES.contains(&key) && (expects("a sequence") || expects("struct")) {
            return Some(format!("write a table [[{key}]] for each"));
        }
        if expects("a sequence") || expects("an array") {
            return Some(format!("write a list: {key} = [{}]", first_line(value)));
        }
        let is_text = expects("a string") || expects("path string");
        if is_text && looks_like_a_time(value) {
            let time = value.trim_end_matches(['Z', 'z']);
            return Some(format!("write the time in quotes, in GPS time: {key} = \"{time}\""));
        }
        if is_text && value.starts_with('[') {
            return Some(format!(
                "write one text, not a list: {key} = {}",
                value.trim_matches(['[', ']']).trim()
            ));
        }
        if is_text {
            return Some(format!("write the text in quotes: {key} = \"{}\"", first_line(value)));
        }
        let unquoted = value.trim_matches(['"', '\'']);
        let is_number = unquoted.parse::<f64>().is_ok();
        let is_boolean = matches!(unquoted, "true" | "false");
        if unquoted.len() < value.len() && (is_number || is_boolean) {
            return Some(format!("write it without quotes: {key} = {unquoted}"));
        }
        if expects("a boolean") {
            return Some(format!("write {key} = true or {key} = false"));
        }
        None
    }

    /// Advice on invalid TOML, such as text without quotes.
    fn on_syntax(&self) -> Option<String> {
        let Self { key, value } = self;
        let word = first_line(value);
        let is_bare = word.chars().next().is_some_and(|c| c.is_alphabetic() || c == '/' || c == '.');
        (key.is_some() && is_bare)
            .then(|| format!("write text in quotes: {} = \"{word}\"", key.unwrap_or_default()))
    }
}

fn first_line(text: &str) -> &str {
    text.lines().next().unwrap_or_default().trim()
}

fn looks_like_a_time(value: &str) -> bool {
    let digits = value.bytes().take(4).filter(u8::is_ascii_digit).count();
    digits == 4 && value.as_bytes().get(4) == Some(&b'-')
}

fn on_unknown_key(key: &str, message: &str) -> Option<String> {
    let known = listed(message);
    let similar = nearest(key, &known);
    if let Some((_, known)) = similar.as_ref().filter(|(similarity, _)| *similarity >= NEARLY_THE_SAME) {
        return Some(did_you_mean(known));
    }
    if let Some((table, _)) = tables().into_iter().find(|(_, keys)| keys.iter().any(|known| known == key)) {
        return Some(format!("`{key}` belongs {table}"));
    }
    similar.map(|(_, known)| did_you_mean(&known))
}

fn did_you_mean(known: &str) -> String {
    format!("did you mean `{known}`?")
}

/// Abbreviations written out.
fn spelled_out(key: &str) -> String {
    let whole = |part: &str| {
        match part {
            "max" => "maximum",
            "min" => "minimum",
            "obs" => "observations",
            "nav" => "navigation",
            "vel" => "velocity",
            "deg" | "degrees" => "deg",
            part => part,
        }
        .to_owned()
    };
    key.to_lowercase().split(['_', '-', ' ']).map(whole).collect::<Vec<_>>().join("_")
}

/// The most similar name, and how similar it is.
fn nearest(word: &str, known: &[String]) -> Option<(f64, String)> {
    let word = spelled_out(word);
    known
        .iter()
        .map(|known| (strsim::jaro_winkler(&word, &spelled_out(known)), known.clone()))
        .filter(|(similarity, _)| *similarity >= SIMILAR)
        .max_by(|a, b| a.0.total_cmp(&b.0))
}

/// The tables of a session file and their keys.
fn tables() -> Vec<(String, Vec<String>)> {
    let in_table = |name: &str| format!("in the table {name}");
    vec![
        ("at the head of the file, before the first table".to_owned(), keys::<SessionFile>()),
        (in_table("[products]"), keys::<ProductsTable>()),
        (in_table("[[phone]]"), keys::<PhoneEntry>()),
        (in_table("[[constraint]]"), keys::<ConstraintEntry>()),
        (in_table("[evaluation]"), keys::<EvaluationTable>()),
        (in_table("[correction]"), keys::<CorrectionKeys>()),
        (in_table("[correction.base]"), keys::<BaseKeys>()),
        (in_table("[stochastic]"), keys::<StochasticKeys>()),
        (in_table("[stochastic.code]"), keys::<CodeVarianceKeys>()),
        (in_table("[stochastic.rate]"), keys::<RateVarianceKeys>()),
        (in_table("[filter]"), keys::<FilterKeys>()),
        (in_table("[integrity]"), keys::<IntegrityKeys>()),
        (in_table("[constraints]"), keys::<ConstraintKeys>()),
        (in_table("[alignment]"), keys::<AlignmentKeys>()),
        (in_table("[masks]"), keys::<Masks>()),
        (in_table("[log]"), keys::<LogOptions>()),
    ]
}

/// The keys of a table, as its refusal of an unknown key lists them.
fn keys<T: DeserializeOwned>() -> Vec<String> {
    toml::from_str::<T>("\"\" = 0").err().map(|error| listed(error.message())).unwrap_or_default()
}

/// The names that a message lists as expected.
fn listed(message: &str) -> Vec<String> {
    let expected = message.split_once("expected").map_or("", |(_, expected)| expected);
    expected.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

fn quoted_after<'a>(message: &'a str, words: &str) -> Option<&'a str> {
    message.split_once(words)?.1.strip_prefix('`')?.split('`').next()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn advice_on(text: &str) -> String {
        let error = toml::from_str::<SessionFile>(text).expect_err(text);
        advice(&error, text).unwrap_or_else(|| panic!("no advice on: {error}"))
    }

    #[test]
    fn what_to_write_is_said() {
        let phone = "[[phone]]\nname = 'a'\n";
        let with = |rest: &str| format!("group = 'g'\n{phone}{rest}");
        for (text, said) in [
            ("group = 'g'\n[phone]\nname = 'a'".to_owned(), "write [[phone]], with two brackets"),
            (with("[constraint]\nkind = 'distance'"), "write [[constraint]], with two brackets"),
            ("group = 'g'\nphone = ['a']".to_owned(), "write a table [[phone]] for each"),
            (with("[products]\nsp3 = 'a.sp3'"), "write a list: sp3 = ['a.sp3']"),
            (with("[products]\nnavigation = \"a.rnx\""), "write a list: navigation = [\"a.rnx\"]"),
            (with("[evaluation]\ntruth_quality = 1"), "write a list: truth_quality = [1]"),
            (with("[correction]\nsources = 'b.rtcm3'"), "write a list: sources = ['b.rtcm3']"),
            (with("date = 2020-08-13T14:00:00"), "in quotes, in GPS time: date = \"2020-08-13T14:00:00\""),
            (with("date = 2020-08-13T14:00:00Z"), "date = \"2020-08-13T14:00:00\""),
            (
                with("[[constraint]]\nkind = 'distance'\nfrom_gps = 2020-08-13 14:00:00"),
                "from_gps = \"2020-08-13 14:00:00\"",
            ),
            (with("observations = ['a.rnx']"), "write one text, not a list: observations = 'a.rnx'"),
            (with("truth = 3"), "write the text in quotes: truth = \"3\""),
            (with("observations = a.rnx"), "write text in quotes: observations = \"a.rnx\""),
            (with("[[constraint]]\nkind = 'distance'\nmaximum_m = '2.0'"), "without quotes: maximum_m = 2.0"),
            (with("recorded_corrections = 'true'"), "without quotes: recorded_corrections = true"),
            (with("recorded_corrections = 1"), "recorded_corrections = true or recorded_corrections = false"),
            (with("[[constraint]]\nkind = 'distance'\nmax_m = 2.0"), "did you mean `maximum_m`?"),
            (with("[[constraint]]\nkind = 'distance'\nmaximum = 2.0"), "did you mean `maximum_m`?"),
            (with("[[constraint]]\nkind = 'distance'\nmin_m = 2.0"), "did you mean `minimum_m`?"),
            (with("[[constraint]]\nkind = 'heading'\ncourse = 2.0"), "did you mean `course_deg`?"),
            (with("[[constraint]]\nkind = 'distance'\nphone = ['a']"), "did you mean `phones`?"),
            (with("[[constraint]]\nkind = 'vertical_velocity'"), "did you mean `vertical-velocity`?"),
            (with("[[constraint]]\nkind = 'Distance'"), "did you mean `distance`?"),
            (with("obs = 'a.rnx'"), "did you mean `observations`?"),
            (with("[[phones]]\nname = 'b'"), "did you mean `phone`?"),
            (with("[product]\nsp3 = []"), "did you mean `products`?"),
            (with("[products]\nnav = []"), "did you mean `navigation`?"),
            (with("[mask]\nelevation_deg = 5"), "did you mean `masks`?"),
            (with("[filter]\npreset = 'Peng2023'"), "did you mean `peng2023`?"),
            (with("[filter]\nmax_gap_s = 3"), "did you mean `maximum_gap_s`?"),
            (with("[filter]\nmaximum_gap_s = '3'"), "without quotes: maximum_gap_s = 3"),
            (with("[constraints]\nfeedback = 1"), "feedback = true or feedback = false"),
            (with("[filter]\nhorizon_s = 1"), "`horizon_s` belongs in the table [constraints]"),
            (
                with("[correction]\noutlier_sigmas = 4"),
                "`outlier_sigmas` belongs in the table [correction.base]",
            ),
            (with("[constraints]\nmaximum_m = 2.0"), "`maximum_m` belongs in the table [[constraint]]"),
            (with("[[stochastic.code]]\nmodel = 'cn0'"), "write [stochastic.code], with one bracket"),
            (with("[[constraints]]\nkind = 'distance'"), "write [[constraint]] for what is known of phones"),
            (with("sp3 = ['a.sp3']"), "`sp3` belongs in the table [products]"),
            (with("preset = 'peng2023'"), "`preset` belongs in the table [filter]"),
            (with("[masks]\ntruth_quality = [1]"), "`truth_quality` belongs in the table [evaluation]"),
            ("[products]\nsp3 = []\ngroup = 'g'".to_owned(), "`group` belongs at the head of the file"),
            ("[[phone]]\nname = 'a'".to_owned(), "write group = \"NAME\""),
            ("group = 'g'\n[[phone]]\nobservations = 'a'".to_owned(), "give every [[phone]] a name"),
            (with("[[constraint]]\nmaximum_m = 2.0"), "give every [[constraint]] a kind"),
            (with(r#"observations = "C:\data\a.rnx""#), r"in single quotes: 'C:\drive\a.rnx'"),
        ] {
            let advice = advice_on(&text);
            assert!(advice.contains(said), "expected '{said}' for\n{text}\nin: {advice}");
        }
    }
}
