//! The dataset's truth tables.

use crate::accuracy::{TableRow, Truth, TruthError};
use crate::skips::{Reason, Skips};
use crate::time::{GpsTime, SECONDS_PER_WEEK};

/// Columns by the names in the header, in the order of [`Fields`].
const COLUMNS: [&str; 8] = ["GPSTime", "Latitude", "Longitude", "H-Ell", "Vel-N", "Vel-E", "Vel-U", "Q"];
/// Metres in a degree of latitude, to tell north from east.
const METRES_PER_DEGREE: f64 = 111_000.0;
/// Rows this far apart tell no velocity, s.
const LONGEST_STEP_S: f64 = 2.5;

/// Whether a table begins with the header of the dataset's truth tables.
pub fn is_truth_table(bytes: &[u8]) -> bool {
    let header = header(bytes).map(|(_, names)| names).unwrap_or_default();
    header.contains(&"GPSTime") && header.contains(&"H-Ell")
}

/// Reads a truth table: columns `GPSTime` (s of week), `Latitude`, `Longitude` (degrees), `H-Ell` (m), `Vel-N`, `Vel-E`, `Vel-U` (m/s) and
/// `Q` (1 fixed, 2 float, 3 differential, 4 single, 0 invalid), in any order, separated by blanks.
///
/// The table has no week: every row's is that which brings it nearest to `near`, an instant within half a week of all rows. In the tables of
/// Wuhan `Vel-N` is the velocity east and `Vel-E` that north, in those of Beijing they are what they say. So the positions decide, and the
/// exchange is counted.
///
/// # Errors
/// [`TruthError`] when a column is missing or no row is usable.
pub fn truth_table(bytes: &[u8], near: GpsTime) -> Result<(Truth, Skips), TruthError> {
    let (header_line, names) = header(bytes).unwrap_or_default();
    let mut columns = [0; COLUMNS.len()];
    for (place, column) in columns.iter_mut().zip(COLUMNS) {
        let found = names.iter().position(|name| *name == column);
        *place = found.ok_or_else(|| TruthError::Column { column, expected: COLUMNS.join(", ") })?;
    }
    let lines = bytes.split(|byte| *byte == b'\n').enumerate().skip(header_line + 1);
    let mut rows: Vec<_> = lines
        .map(|(index, line)| (index, words(line)))
        .filter(|(_, words)| words.first().is_some_and(|word| !word.starts_with('(')))
        .map(|(index, words)| {
            row(&words, columns, near).map_err(|error| format!("line {}: {error}", index + 1))
        })
        .collect();
    let mut skips = Skips::default();
    if are_velocities_exchanged(&rows) {
        skips.add(Reason::VelocityColumnsExchanged, || "the positions say so".to_owned());
        for row in rows.iter_mut().flatten() {
            std::mem::swap(&mut row.velocity_north_mps, &mut row.velocity_east_mps);
        }
    }
    Truth::from_table(rows, skips)
}

/// The first line that is not blank: its index and words.
fn header(bytes: &[u8]) -> Option<(usize, Vec<&str>)> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let lines = bytes.split(|byte| *byte == b'\n').map(words).enumerate();
    lines.into_iter().find(|(_, words)| !words.is_empty())
}

/// The words of a line; bytes that are no text give one empty word.
fn words(line: &[u8]) -> Vec<&str> {
    std::str::from_utf8(line).map_or_else(|_| vec![""], |text| text.split_ascii_whitespace().collect())
}

fn row(words: &[&str], columns: [usize; COLUMNS.len()], near: GpsTime) -> Result<TableRow, String> {
    let mut values = [0.0; COLUMNS.len()];
    for ((value, at), column) in values.iter_mut().zip(columns).zip(COLUMNS) {
        let word = words.get(at).ok_or_else(|| format!("{} words, {column} is missing", words.len()))?;
        *value =
            word.parse().map_err(|_| format!("{column} '{}'", word.chars().take(40).collect::<String>()))?;
    }
    let [gps_tow_s, latitude_deg, longitude_deg, ellipsoidal_height_m, north, east, up, quality] = values;
    let quality = (0..=u8::MAX).find(|q| f64::from(*q) == quality).ok_or_else(|| format!("Q {quality}"))?;
    Ok(TableRow {
        gps_week: week(gps_tow_s, near),
        gps_tow_s,
        latitude_deg,
        longitude_deg,
        ellipsoidal_height_m,
        velocity_north_mps: north,
        velocity_east_mps: east,
        velocity_up_mps: up,
        quality,
    })
}

/// The week that brings a time of week nearest to an instant.
fn week(tow_s: f64, near: GpsTime) -> i64 {
    #[allow(clippy::cast_possible_truncation)]
    // saturates on absurd input, which no row with a plausible time has
    let weeks_on = ((near.tow_s() - tow_s) / SECONDS_PER_WEEK).round() as i64;
    near.week().saturating_add(weeks_on)
}

/// Whether more rows agree with their neighbours' positions when north and east change places.
fn are_velocities_exchanged(rows: &[Result<TableRow, String>]) -> bool {
    let mut votes = 0_i64;
    for neighbours in rows.windows(3) {
        let [Ok(before), Ok(row), Ok(after)] = neighbours else { continue };
        let span_s = after.gps_tow_s - before.gps_tow_s;
        if !(span_s > 0.0 && span_s <= LONGEST_STEP_S) {
            continue;
        }
        let degrees_per_metre = 1.0 / METRES_PER_DEGREE;
        let north_mps = (after.latitude_deg - before.latitude_deg) / degrees_per_metre / span_s;
        let east_mps = (after.longitude_deg - before.longitude_deg) * row.latitude_deg.to_radians().cos()
            / degrees_per_metre
            / span_s;
        let miss = |north: f64, east: f64| (north - north_mps).hypot(east - east_mps);
        let as_named = miss(row.velocity_north_mps, row.velocity_east_mps);
        let exchanged = miss(row.velocity_east_mps, row.velocity_north_mps);
        votes += i64::from(exchanged < as_named) - i64::from(as_named < exchanged);
    }
    votes > 0
}
