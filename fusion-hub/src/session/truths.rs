//! The truths that a session file names.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, anyhow, bail};
use cofix_agent::Stop;
use cofix_agent::source::{self, Reading};
use cofix_common::accuracy::Truth;
use cofix_common::formats::decode::Record;
use cofix_common::formats::packing::decompress;
use cofix_common::formats::{gnsslogger, truth};
use cofix_common::skips::Skips;
use cofix_common::time::GpsTime;

use super::SessionPhone;

/// Phones' names and truths.
pub type NamedTruths = Vec<(String, Option<Truth>)>;

/// Reads the phones' truths, each file once, in the order of the phones; with the rows skipped.
///
/// # Errors
/// When a file cannot be read or holds no truth.
pub fn read_truths(phones: &[SessionPhone]) -> anyhow::Result<(NamedTruths, Skips)> {
    let mut skips = Skips::default();
    let mut known: BTreeMap<&Path, Truth> = BTreeMap::new();
    let mut truths = Vec::with_capacity(phones.len());
    for phone in phones {
        let truth = match phone.truth.as_deref() {
            None => None,
            Some(path) => match known.get(path) {
                Some(truth) => Some(truth.clone()),
                None => Some(known.entry(path).or_insert(read_truth(path, phone, &mut skips)?).clone()),
            },
        };
        truths.push((phone.name.clone(), truth));
    }
    Ok((truths, skips))
}

/// Reads a phone's truth of any format; a truth without a date takes it from the phone's date or recording.
fn read_truth(path: &Path, phone: &SessionPhone, skips: &mut Skips) -> anyhow::Result<Truth> {
    let unreadable = || format!("{}: cannot read the truth file", path.display());
    let bytes = std::fs::read(path).with_context(unreadable)?;
    let bytes = decompress(&bytes).with_context(unreadable)?;
    let format = truth::recognise(&bytes);
    let near = if format.needs_date(&bytes) {
        recorded_near(phone).with_context(|| format!("{}: {} without a date", path.display(), format.name))?
    } else {
        GpsTime::default()
    };
    let (truth, skipped) =
        format.read(&bytes, near).with_context(|| format!("{}: not usable as truth", path.display()))?;
    merge_named(skips, "truth", &skipped, &path.display().to_string());
    Ok(truth)
}

/// An instant near a phone's recording: the date of the session file, else the recording's first epoch.
fn recorded_near(phone: &SessionPhone) -> anyhow::Result<GpsTime> {
    if let Some(date) = phone.date {
        return Ok(date);
    }
    let advice = || format!("write `date = \"YYYY-MM-DDThh:mm:ss\"` for phone '{}'", phone.name);
    let path = phone
        .observations
        .as_deref()
        .ok_or_else(|| anyhow!("no observations tell it"))
        .with_context(advice)?;
    let log =
        gnsslogger::Options { shift_weeks: phone.shift_weeks.unwrap_or(0), ..gnsslogger::Options::default() };
    let mut records = source::open_file(path, &Reading { log, ..Reading::default() }).with_context(advice)?;
    loop {
        let record = records
            .next(&Stop::default())
            .with_context(|| path.display().to_string())
            .with_context(advice)?;
        match record {
            Some(Record::Epoch(epoch)) => return Ok(epoch.time_gps),
            Some(_) => {}
            None => bail!("{}: no epoch tells it; {}", path.display(), advice()),
        }
    }
}

/// Adds counts, with `doing` before their reasons and `place` before their first instances.
pub(crate) fn merge_named(skips: &mut Skips, doing: &str, more: &Skips, place: &str) {
    skips.merge(&more.with_prefix(&format!("{doing}: ")).with_place(place));
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;

    const TRUTH_WITHOUT_WEEK: &str =
        "GPSTime Latitude Longitude H-Ell Vel-N Vel-E Vel-U Q\n397140.0 30 114 20 0 0 0 1\n";
    const LOG: &str = "{\"obsd_t\":{\"d\":[{\"prn\":7,\"type\":\"L1C\",\"p\":2.2E7}],\"t\":{\"year\":2020,\"month\":8,\"day\":13,\
                       \"hour\":14,\"minute\":19,\"sec\":0.0}}}\n";

    #[test]
    fn a_truth_without_a_week_takes_it_from_the_date_or_the_recording() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        let truth = file("truth.txt", TRUTH_WITHOUT_WEEK);
        let log = file("log.txt", LOG);
        let shifted_week_of = |shift_weeks, observations: Option<&PathBuf>, date: Option<GpsTime>| {
            let phone = SessionPhone {
                name: "a".to_owned(),
                observations: observations.cloned(),
                truth: Some(truth.clone()),
                recorded_corrections: false,
                shift_weeks,
                date,
                exclude: Vec::new(),
            };
            let (truths, _) = read_truths(&[phone]).map_err(|error| format!("{error:#}"))?;
            Ok::<_, String>(truths[0].1.as_ref().unwrap().span().unwrap().0.week())
        };
        let week_of = |observations, date| shifted_week_of(None, observations, date);
        assert_eq!(week_of(Some(&log), None), Ok(2118));
        assert_eq!(shifted_week_of(Some(-1_024), Some(&log), None), Ok(1094));
        assert_eq!(week_of(Some(&log), Some(GpsTime::from_week_tow(2119, 300_000.0))), Ok(2119));
        let said = week_of(None, None).unwrap_err();
        assert!(
            said.contains("truth.txt: WHU-Smartphone truth table without a date") && said.contains("date ="),
            "{said}"
        );
        let said = week_of(Some(&file("empty.txt", "\n")), None).unwrap_err();
        assert!(said.contains("empty.txt") && said.contains("date ="), "{said}");
    }

    #[test]
    fn bad_rows_of_a_truth_are_counted_under_its_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("truth.csv");
        let text = "gps_week,gps_tow_s,latitude_deg,longitude_deg,ellipsoidal_height_m,velocity_north_mps,\
            velocity_east_mps,velocity_up_mps,quality\n2118,1.0,30.0,114.0,20.0,0,0,0,1\n2118,nonsense,30.0,114.0,20.0,0,0,0,1\n";
        std::fs::write(&path, text).unwrap();
        let phone = |name: &str| SessionPhone {
            name: name.to_owned(),
            observations: None,
            truth: Some(path.clone()),
            recorded_corrections: false,
            shift_weeks: None,
            date: None,
            exclude: Vec::new(),
        };
        let (truths, skips) = read_truths(&[phone("a"), phone("b")]).unwrap();
        assert!(truths.iter().all(|(_, truth)| truth.is_some()));
        assert_eq!(skips.total(), 1, "one file, read once: {skips}");
        let (reason, skip) = skips.iter().next().unwrap();
        assert!(reason.starts_with("truth: ") && skip.first.contains("truth.csv: "), "{skips}");
    }
}
