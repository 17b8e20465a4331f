//! Compact RINEX from RINEX, for tests and benchmarks.

#![allow(clippy::unwrap_used, clippy::indexing_slicing)] // trusts what it is given

use std::collections::BTreeMap;
use std::fmt::Write as _;

const ORDER: usize = 3;

/// Values of one satellite and type: the differences of the epoch before, lowest order first.
#[derive(Clone, Default)]
struct Arc(Vec<i64>);

impl Arc {
    fn encode(&mut self, field: &str) -> String {
        let Some(value) = thousandths(field) else {
            self.0.clear();
            return String::new();
        };
        if self.0.is_empty() {
            self.0 = vec![value];
            return format!("{ORDER}&{value}");
        }
        let mut now = vec![value];
        for before in &self.0 {
            now.push(now.last().unwrap() - before);
        }
        now.truncate(ORDER + 1);
        let text = now.last().unwrap().to_string();
        self.0 = now;
        text
    }
}

/// An F14.3 field as an integer.
fn thousandths(field: &str) -> Option<i64> {
    let field = field.trim();
    (!field.is_empty()).then(|| field.replace('.', "").parse().unwrap())
}

/// The difference of texts, blanks at the end left out.
fn text_difference(old: &str, new: &str) -> String {
    let length = old.len().max(new.len());
    let pad = |text: &str| format!("{text:length$}").into_bytes();
    let one = |(old, new): (&u8, &u8)| match (old, new) {
        (a, b) if a == b => ' ',
        (_, b' ') => '&',
        (_, b) => *b as char,
    };
    let (old, new) = (pad(old), pad(new));
    let text: String = old.iter().zip(&new).map(one).collect();
    text.trim_end().to_owned()
}

/// Compresses RINEX 2 or 3; `restart` says before which epochs everything starts anew.
pub fn encode(text: &str, restart: impl Fn(usize) -> bool) -> String {
    let two = text.starts_with("     2");
    let version = if two { "1.0" } else { "3.0" };
    let mut out =
        format!("{:<60}CRINEX VERS   / TYPE\n", format!("{version}                 COMPACT RINEX FORMAT"));
    writeln!(out, "{:<60}CRINEX PROG / DATE", "test").unwrap();
    let (header, body) = text.split_once("END OF HEADER").unwrap();
    let (rest, body) = body.split_once('\n').unwrap();
    writeln!(out, "{header}END OF HEADER{rest}").unwrap();
    let mut types = types_of(header);
    let mut lines = body.lines();
    let (mut epoch_before, mut before) = (String::new(), BTreeMap::<String, (Vec<Arc>, String)>::new());
    let (flag_at, list_at) = if two { (28, 32) } else { (31, 41) };
    let mut epochs = 0;
    while let Some(line) = lines.next() {
        let count: usize = line[flag_at + 1..flag_at + 4].trim().parse().unwrap();
        if line.as_bytes()[flag_at] > b'1' {
            writeln!(out, "{}{}", if two { "&" } else { ">" }, &line[1..]).unwrap();
            for line in lines.by_ref().take(count) {
                if line.contains("TYPES") {
                    types.extend(types_of(line));
                }
                writeln!(out, "{line}").unwrap();
            }
            epoch_before.clear();
            continue;
        }
        if restart(epochs) {
            epoch_before.clear();
        }
        epochs += 1;
        let (ids, rows) = rows(two, line, count, &types, &mut lines);
        let epoch = format!("{:<list_at$}{}", line[..line.len().min(flag_at + 4)].trim_end(), ids.concat());
        if epoch_before.is_empty() {
            before.clear();
            writeln!(out, "{}{}", if two { '&' } else { '>' }, &epoch[1..]).unwrap();
        } else {
            writeln!(out, "{}", text_difference(&epoch_before, &epoch)).unwrap();
        }
        epoch_before = epoch;
        // No receiver clock.
        out.push('\n');
        let mut now = BTreeMap::new();
        for (id, row) in ids.iter().zip(rows) {
            let (mut arcs, flags_before) = before.remove(id).unwrap_or_default();
            arcs.resize(row.len() / 16, Arc::default());
            let (mut fields, mut flags) = (String::new(), String::new());
            for (arc, field) in arcs.iter_mut().zip(row.as_bytes().chunks(16)) {
                let field = std::str::from_utf8(field).unwrap();
                write!(fields, "{} ", arc.encode(&field[..14])).unwrap();
                flags.push_str(&field[14..]);
            }
            let line = fields + &text_difference(&flags_before, &flags);
            writeln!(out, "{}", line.trim_end()).unwrap();
            now.insert(id.clone(), (arcs, flags));
        }
        before = now;
    }
    out
}

/// Satellites of an epoch, and for each its values in full width.
fn rows<'a>(
    two: bool,
    epoch: &str,
    count: usize,
    types: &BTreeMap<char, usize>,
    lines: &mut impl Iterator<Item = &'a str>,
) -> (Vec<String>, Vec<String>) {
    if !two {
        let lines: Vec<&str> = lines.take(count).collect();
        let row = |line: &&str| format!("{:1$}", &line[3..], 16 * types[&line.chars().next().unwrap()]);
        return (lines.iter().map(|l| l[..3].to_owned()).collect(), lines.iter().map(row).collect());
    }
    let types = types[&' '];
    let mut list = format!("{epoch:68}")[32..68].to_owned();
    for _ in 1..count.div_ceil(12) {
        list += &format!("{:68}", lines.next().unwrap())[32..68];
    }
    let ids = (0..count).map(|k| list[3 * k..3 * k + 3].to_owned()).collect();
    let mut row = || {
        let text: Vec<String> = lines.take(types.div_ceil(5)).map(|line| format!("{line:80}")).collect();
        text.concat()[..16 * types].to_owned()
    };
    (ids, (0..count).map(|_| row()).collect())
}

/// Number of types by system letter; a blank stands for all systems of RINEX 2.
fn types_of(header: &str) -> BTreeMap<char, usize> {
    let mut types = BTreeMap::new();
    for line in header.lines() {
        if line.contains("SYS / # / OBS TYPES") && !line.starts_with(' ') {
            types.insert(line.chars().next().unwrap(), line[3..6].trim().parse().unwrap());
        }
        if line.contains("# / TYPES OF OBSERV") && !line[..6].trim().is_empty() {
            types.insert(' ', line[..6].trim().parse().unwrap());
        }
    }
    types
}
