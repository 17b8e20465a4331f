//! Position of a key in the text of a file.

use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Line number, from 1, of `key` in the table `table` (as `stochastic.code`; empty for the root) of a TOML text, or else of the innermost
/// existing table around it.
pub fn line_of(text: &str, table: &str, key: &str) -> Option<usize> {
    let root = DeTable::parse(text).ok()?;
    let mut within = Some(root.get_ref());
    let mut start = None;
    for name in table.split('.').filter(|name| !name.is_empty()).chain([key]) {
        let Some((at, value)) = within.and_then(|table| member(table, name)) else { break };
        start = Some(at);
        within = value.get_ref().as_table();
    }
    let before = text.get(..start?)?;
    Some(before.matches('\n').count() + 1)
}

/// Start and value of a member of a table.
fn member<'t, 'i>(table: &'t DeTable<'i>, name: &str) -> Option<(usize, &'t Spanned<DeValue<'i>>)> {
    let (key, value) = table.iter().find(|(key, _)| key.get_ref() == name)?;
    Some((key.span().start, value))
}
