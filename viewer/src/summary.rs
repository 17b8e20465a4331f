//! The summary of a recording.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use cofix_common::recording::{
    ACCURACY, APPLICATION_ID, CONSTRAINTS, DISTANCES, INCOMPLETE, PHONES, SATELLITES, TIMELINE,
};
use cofix_common::time::GpsTime;
use rerun::external::re_log_types::StoreId;
use rerun::log::Chunk;
use rerun::{EntityPath, EntityPathPart, RecordingInfo, TextDocument};

pub use crate::error::SummaryError;
use crate::integrity::{Integrity, IntegrityRows};
use crate::read::{Contents, read};

/// Size of an entity, or of a group of like entities.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Amount {
    /// Entities.
    pub entities: usize,
    /// Rows of data.
    pub rows: usize,
}

/// The summary of a recording.
#[derive(Clone, Debug)]
pub struct Summary {
    /// The file.
    pub path: PathBuf,
    /// Its size, bytes.
    pub bytes: u64,
    /// The group's name.
    pub group: Option<String>,
    /// The phones' names, in alphabetical order.
    pub phones: Vec<String>,
    /// First and last time on the timeline.
    pub span_gps: Option<(GpsTime, GpsTime)>,
    /// Every entity.
    pub entities: BTreeMap<String, Amount>,
    /// The same, phones, satellites, pairs and constraints taken together.
    pub groups: BTreeMap<String, Amount>,
    /// Verdicts, protection levels and events.
    pub integrity: Integrity,
    /// The accuracy table, Markdown.
    pub accuracy: Option<String>,
    /// Whether the file brings its layout.
    pub has_layout: bool,
    /// Warnings about the file.
    pub warnings: Vec<String>,
}

impl Summary {
    /// Reads a recording. A recording that was cut off is read as far as it goes, with a warning.
    ///
    /// # Errors
    /// When the file cannot be read at all or is not one of ours.
    pub fn read(path: &Path) -> Result<Self, SummaryError> {
        let open = |source| SummaryError::Open { path: path.to_owned(), source };
        let bytes = std::fs::metadata(path).map_err(open)?.len();
        let contents = read(path)?;
        let id = our_recording(path, &contents)?.clone();
        let mut summary = Self::empty(path, bytes, &contents);
        let mut span_ns: Option<(i64, i64)> = None;
        let mut phones = BTreeSet::new();
        let mut integrity = IntegrityRows::default();
        for (_, chunk) in contents.chunks.iter().filter(|(store, _)| *store == id) {
            summary.add(chunk, &mut phones);
            integrity.add(chunk);
            if let Some(column) = chunk.timelines().values().find(|c| c.name() == TIMELINE) {
                for &time in column.times_raw() {
                    let (first, last) = span_ns.unwrap_or((time, time));
                    span_ns = Some((first.min(time), last.max(time)));
                }
            }
        }
        summary.integrity = integrity.integrity();
        summary.phones = phones.into_iter().collect();
        summary.span_gps = span_ns.map(|(first, last)| (gps_time(first), gps_time(last)));
        for (entity, amount) in &summary.entities {
            let group = summary.groups.entry(group_of(entity)).or_default();
            group.entities += 1;
            group.rows += amount.rows;
        }
        summary.warn();
        Ok(summary)
    }

    /// The summary as text; `all` lists every entity instead of groups.
    pub fn render(&self, all: bool) -> String {
        let mut text = String::new();
        // Writing to a string cannot fail.
        let _ = self.write(&mut text, all);
        text
    }

    fn empty(path: &Path, bytes: u64, contents: &Contents) -> Self {
        let mut warnings: Vec<String> = contents.damage.iter().cloned().collect();
        if contents.recordings.len() > 1 {
            let count = contents.recordings.len();
            warnings
                .push(format!("{count} recordings in one file; this is the first one of {APPLICATION_ID}"));
        }
        Self {
            path: path.to_owned(),
            bytes,
            group: None,
            phones: Vec::new(),
            span_gps: None,
            entities: BTreeMap::new(),
            groups: BTreeMap::new(),
            integrity: Integrity::default(),
            accuracy: None,
            has_layout: contents.has_layout,
            warnings,
        }
    }

    fn add(&mut self, chunk: &Chunk, phones: &mut BTreeSet<String>) {
        let entity = chunk.entity_path();
        if let Some(text) = text(chunk, TextDocument::descriptor_text().component)
            && *entity == EntityPath::from(ACCURACY)
        {
            self.accuracy = Some(text);
        }
        if *entity == EntityPath::properties() {
            self.group = text(chunk, RecordingInfo::descriptor_name().component).or(self.group.take());
            return;
        }
        if let [first, phone, ..] = entity.as_slice()
            && first.unescaped_str() == PHONES
        {
            phones.insert(phone.unescaped_str().to_owned());
        }
        let amount = self.entities.entry(entity.to_string()).or_default();
        amount.entities = 1;
        amount.rows += chunk.num_rows();
    }

    fn warn(&mut self) {
        if self.span_gps.is_none() {
            self.warnings.push(format!("nothing on the timeline {TIMELINE}"));
        }
        if self.accuracy.is_none() {
            self.warnings.push("no accuracy table: the recording was not finished".to_owned());
        }
        if let Some(why) = self.accuracy.as_deref().filter(|text| text.starts_with(INCOMPLETE)) {
            self.warnings.push(why.to_owned());
        }
        if !self.has_layout {
            self.warnings.push("no layout: the viewer will choose one of its own".to_owned());
        }
    }

    fn write(&self, text: &mut String, all: bool) -> std::fmt::Result {
        let megabytes = self.bytes as f64 / 1e6;
        let group = self.group.as_deref().unwrap_or("without a name");
        writeln!(text, "{}: group {group}, {megabytes:.2} MB", self.path.display())?;
        for warning in &self.warnings {
            writeln!(text, "warning: {warning}")?;
        }
        if let Some((first, last)) = self.span_gps {
            writeln!(text, "{TIMELINE}: {} to {last}, {:.1} s", first.iso(), last - first)?;
        }
        writeln!(text, "phones: {} ({})", self.phones.len(), self.phones.join(", "))?;
        self.integrity.write(text)?;
        if let Some(accuracy) = &self.accuracy {
            writeln!(text, "\n{}", accuracy.trim_end())?;
        }
        let total = self.entities.len();
        if all {
            writeln!(text, "\n{total} entities\n{:>9}  path", "rows")?;
            for (entity, amount) in &self.entities {
                writeln!(text, "{:>9}  {entity}", amount.rows)?;
            }
        } else {
            writeln!(text, "\n{total} entities (--all lists them)\n{:>9} {:>9}  path", "entities", "rows")?;
            for (group, amount) in &self.groups {
                writeln!(text, "{:>9} {:>9}  {group}", amount.entities, amount.rows)?;
            }
        }
        Ok(())
    }
}

fn our_recording<'a>(path: &Path, contents: &'a Contents) -> Result<&'a StoreId, SummaryError> {
    let ours = |id: &&StoreId| id.application_id().as_str() == APPLICATION_ID;
    match (contents.recordings.iter().find(ours), contents.recordings.first()) {
        (Some(id), _) => Ok(id),
        (None, Some(id)) => {
            let application = id.application_id().as_str().to_owned();
            Err(SummaryError::OtherApplication { path: path.to_owned(), application })
        }
        (None, None) => Err(SummaryError::Empty { path: path.to_owned() }),
    }
}

fn text(chunk: &Chunk, component: rerun::ComponentIdentifier) -> Option<String> {
    let values = chunk.iter_slices::<String>(component).last()?;
    values.first().map(|text| text.as_str().to_owned())
}

fn gps_time(unix_calendar_ns: i64) -> GpsTime {
    let epoch_ns = GpsTime::from_nanos(0).as_unix_calendar_nanos();
    GpsTime::from_nanos(unix_calendar_ns.saturating_sub(epoch_ns))
}

/// The entity's path with a star for the name of the phone, satellite, pair or constraint.
fn group_of(entity: &str) -> String {
    let path = EntityPath::parse_forgiving(entity);
    let parts: Vec<&str> = path.iter().map(EntityPathPart::unescaped_str).collect();
    let starred = |index: usize| match parts.first() {
        Some(&PHONES) => index == 1 || (index == 4 && parts.get(2) == Some(&SATELLITES)),
        Some(&(CONSTRAINTS | DISTANCES)) => index == 1,
        _ => false,
    };
    let shown = parts.iter().enumerate().map(|(index, part)| if starred(index) { "*" } else { *part });
    shown.fold(String::new(), |path, part| path + "/" + part)
}
