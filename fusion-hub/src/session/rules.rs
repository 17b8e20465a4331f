//! A `[[constraint]]` becomes one constraint for each pair or phone.

use cofix_common::constraint::Constraint;
use cofix_common::time::GpsTime;

use super::text::{ConstraintEntry, ConstraintKind};
use cofix_common::fusion::engine::ScheduledConstraint;

/// The constraints that `entry` stands for, among phones of these names.
pub(super) fn expand(entry: &ConstraintEntry, names: &[&str]) -> Result<Vec<ScheduledConstraint>, String> {
    refuse_keys_of_other_kinds(entry)?;
    let phones = chosen(entry, names)?;
    let (from_gps, to_gps) = window(entry)?;
    let constraints = match entry.kind {
        ConstraintKind::Distance => distances(entry, &phones)?,
        ConstraintKind::VerticalVelocity => {
            let maximum_mps = positive("maximum_mps", entry.maximum_mps)?;
            phones.iter().map(|&phone| Constraint::VerticalVelocity { phone, maximum_mps }).collect()
        }
        ConstraintKind::Heading => headings(entry, &phones)?,
    };
    Ok(constraints
        .into_iter()
        .map(|constraint| ScheduledConstraint { constraint, from_gps, to_gps })
        .collect())
}

fn distances(entry: &ConstraintEntry, phones: &[usize]) -> Result<Vec<Constraint>, String> {
    let maximum_m = positive("maximum_m", entry.maximum_m)?;
    let minimum_m = entry.minimum_m.unwrap_or(0.0);
    if !(0.0..f64::INFINITY).contains(&minimum_m) {
        return Err(format!("minimum_m is {minimum_m}; it must be a number of metres from 0 up"));
    }
    if minimum_m > maximum_m {
        return Err(format!("minimum_m {minimum_m} is above maximum_m {maximum_m}"));
    }
    if phones.len() < 2 {
        return Err("a distance needs at least two phones".to_owned());
    }
    let pairs = phones.iter().enumerate().flat_map(|(n, &i)| phones.iter().skip(n + 1).map(move |&j| (i, j)));
    Ok(pairs.map(|phones| Constraint::Distance { phones, minimum_m, maximum_m }).collect())
}

fn headings(entry: &ConstraintEntry, phones: &[usize]) -> Result<Vec<Constraint>, String> {
    let course_deg = entry.course_deg.ok_or("course_deg is missing")?;
    if !(-360.0..=360.0).contains(&course_deg) {
        return Err(format!("course_deg is {course_deg}; it must lie between -360 and 360"));
    }
    let tolerance_deg = positive("tolerance_deg", entry.tolerance_deg)?;
    if tolerance_deg >= 90.0 {
        return Err(format!("tolerance_deg is {tolerance_deg}; it must be below 90"));
    }
    let course_rad = course_deg.rem_euclid(360.0).to_radians();
    let tolerance_rad = tolerance_deg.to_radians();
    Ok(phones.iter().map(|&phone| Constraint::Heading { phone, course_rad, tolerance_rad }).collect())
}

fn chosen(entry: &ConstraintEntry, names: &[&str]) -> Result<Vec<usize>, String> {
    let Some(phones) = &entry.phones else { return Ok((0..names.len()).collect()) };
    if phones.is_empty() {
        return Err("phones is empty: name phones, or leave the key out for all".to_owned());
    }
    let mut indices = Vec::with_capacity(phones.len());
    for phone in phones {
        let index = names.iter().position(|name| name == phone);
        let index = index.ok_or_else(|| format!("phone '{phone}' is not one of {}", names.join(", ")))?;
        if indices.contains(&index) {
            return Err(format!("phone '{phone}' is named twice"));
        }
        indices.push(index);
    }
    Ok(indices)
}

fn window(entry: &ConstraintEntry) -> Result<(Option<GpsTime>, Option<GpsTime>), String> {
    let time = |key: &str, text: &Option<String>| {
        text.as_ref().map(|t| t.parse::<GpsTime>().map_err(|error| format!("{key}: {error}"))).transpose()
    };
    let from_gps = time("from_gps", &entry.from_gps)?;
    let to_gps = time("to_gps", &entry.to_gps)?;
    match (from_gps, to_gps) {
        (Some(from), Some(to)) if from > to => Err(format!("from_gps {from} is after to_gps {to}")),
        window => Ok(window),
    }
}

fn refuse_keys_of_other_kinds(entry: &ConstraintEntry) -> Result<(), String> {
    use ConstraintKind::{Distance, Heading, VerticalVelocity};
    let keys = [
        ("minimum_m", entry.minimum_m, Distance),
        ("maximum_m", entry.maximum_m, Distance),
        ("maximum_mps", entry.maximum_mps, VerticalVelocity),
        ("course_deg", entry.course_deg, Heading),
        ("tolerance_deg", entry.tolerance_deg, Heading),
    ];
    match keys.iter().find(|(_, value, kind)| value.is_some() && *kind != entry.kind) {
        Some((key, _, kind)) => {
            Err(format!("unknown key `{key}` for kind {}: it belongs to {}", name(entry.kind), name(*kind)))
        }
        None => Ok(()),
    }
}

const fn name(kind: ConstraintKind) -> &'static str {
    match kind {
        ConstraintKind::Distance => "distance",
        ConstraintKind::VerticalVelocity => "vertical-velocity",
        ConstraintKind::Heading => "heading",
    }
}

/// A bound that must be given, and above zero; infinity is allowed.
fn positive(key: &str, value: Option<f64>) -> Result<f64, String> {
    let value = value.ok_or_else(|| format!("{key} is missing"))?;
    if value > 0.0 { Ok(value) } else { Err(format!("{key} is {value}; it must be above 0")) }
}
