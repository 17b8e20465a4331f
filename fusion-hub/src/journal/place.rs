//! Where a journal is that nobody named.

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use cofix_agent::clock;

use super::{Entry, JournalReader, segment};

/// Age after which an unfinished journal is no longer taken for that of a hub that was killed and is started again.
const LONGEST_PAUSE: Duration = Duration::from_hours(24);

/// The journal in a folder for a hub that starts now: the latest one of its group that did not come to its end, was written to within the last day
/// and that no hub writes; else a new one, `GROUP-20201231-235959.mcap` by GPS time. With `anew` always a new one.
pub fn of_group(folder: &Path, group: &str, anew: bool, now: SystemTime) -> PathBuf {
    let unfinished = if anew { None } else { unfinished(folder, group, now) };
    unfinished.unwrap_or_else(|| {
        let stem = format!("{group}-{}", text_of(now));
        let numbered = (2_u32..).map(|number| folder.join(format!("{stem}-{number}.mcap")));
        let mut names = std::iter::once(folder.join(format!("{stem}.mcap"))).chain(numbered);
        names.find(|path| !path.exists()).unwrap_or_default()
    })
}

fn unfinished(folder: &Path, group: &str, now: SystemTime) -> Option<PathBuf> {
    let names = std::fs::read_dir(folder).ok()?.filter_map(|entry| Some(entry.ok()?.path()));
    let mut journals: Vec<(SystemTime, PathBuf)> = names
        .filter(|path| is_of_group(path, group))
        .filter_map(|path| {
            let written = last_segment(&path).metadata().ok()?.modified().ok()?;
            (now.duration_since(written).unwrap_or_default() < LONGEST_PAUSE).then_some((written, path))
        })
        .collect();
    journals.sort();
    let mut paths = journals.into_iter().rev().map(|(_, path)| path);
    paths.find(|path| !in_use(path) && JournalReader::open(path).is_ok() && !has_ended(path))
}

/// Whether a name is one that [`of_group`] gives, of a first segment.
fn is_of_group(path: &Path, group: &str) -> bool {
    let name = path.file_name().map(|name| name.to_string_lossy()).unwrap_or_default();
    let stem = name.strip_suffix(".mcap").and_then(|name| name.strip_prefix(group)?.strip_prefix('-'));
    stem.is_some_and(|stem| stem.bytes().all(|byte| byte.is_ascii_digit() || byte == b'-'))
}

/// Whether a hub writes the journal now. Where files cannot be locked nobody knows, and the answer is no.
pub fn in_use(path: &Path) -> bool {
    File::open(last_segment(path)).is_ok_and(|file| matches!(file.try_lock(), Err(TryLockError::WouldBlock)))
}

/// Whether the session of a journal came to its end. Its last segment alone tells.
pub fn has_ended(path: &Path) -> bool {
    let last = JournalReader::open(&last_segment(path));
    last.is_ok_and(|mut last| last.any(|entry| matches!(entry, Entry::Ended)))
}

/// Number of segments that were begun.
pub fn segments(path: &Path) -> u32 {
    (1..=u32::MAX).take_while(|number| segment(path, *number).exists()).last().unwrap_or_default()
}

fn last_segment(path: &Path) -> PathBuf {
    segment(path, segments(path))
}

/// `20201231-235959`, GPS time.
fn text_of(time: SystemTime) -> String {
    let iso = clock::gps_time_of(time).iso();
    let second = iso.split('.').next().unwrap_or_default();
    second.replace(['-', ':'], "").replace('T', "-")
}

#[cfg(test)]
mod tests {
    use cofix_common::time::GpsTime;

    use super::super::{Header, Journal};
    use super::*;

    fn time(second: u64) -> SystemTime {
        SystemTime::UNIX_EPOCH + Duration::from_secs(1_609_459_181 + second)
    }

    fn begin(path: &Path) -> Journal {
        let header = Header {
            group: "my-drive".to_owned(),
            phones: vec!["a".to_owned()],
            latency: Duration::from_secs(5),
            session_path: PathBuf::from("s.toml"),
            data: None,
        };
        Journal::create(path, header, "", GpsTime::from_week_tow(2_100, 0.0)).unwrap()
    }

    #[test]
    fn a_journal_that_nobody_named_is_gone_on_with_or_new() {
        let folder = tempfile::tempdir().unwrap();
        let now = SystemTime::now();
        let place = |anew| of_group(folder.path(), "my-drive", anew, now);
        let first = of_group(folder.path(), "my-drive", false, time(0));
        assert_eq!(first, folder.path().join("my-drive-20201231-235959.mcap"));
        let journal = begin(&first);
        assert!(in_use(&first));
        assert_ne!(place(false), first, "a hub writes it");
        assert_eq!(
            of_group(folder.path(), "my-drive", false, time(0)),
            folder.path().join("my-drive-20201231-235959-2.mcap")
        );
        drop(journal);
        assert!(!in_use(&first));
        assert_eq!(place(false), first, "its hub was killed");
        assert_ne!(place(true), first);
        let later = now + LONGEST_PAUSE + Duration::from_secs(9);
        assert_ne!(of_group(folder.path(), "my-drive", false, later), first, "too old");
        assert_ne!(of_group(folder.path(), "my", false, now), first, "of another group");
        std::fs::remove_file(&first).unwrap();
        let mut journal = begin(&first);
        journal.end().unwrap();
        journal.finish().unwrap();
        assert_ne!(place(false), first, "it has ended");
    }
}
