//! A `[[constraint]]` becomes one constraint for each pair or phone.

use cofix_common::fusion::engine::ScheduledConstraint;
use cofix_common::time::GpsTime;

use super::constraint::ConstraintEntry;

/// The constraints that `entry` stands for, among phones of these names.
pub(super) fn expand(entry: &ConstraintEntry, names: &[&str]) -> Result<Vec<ScheduledConstraint>, String> {
    let constraint = entry.constraint()?;
    let phones = chosen(entry, names)?;
    if phones.len() < constraint.phones().len() {
        return Err(format!("a {} needs at least two phones", constraint.name()));
    }
    let (from_gps, to_gps) = window(entry)?;
    let scheduled = |constraint| ScheduledConstraint { constraint, from_gps, to_gps };
    Ok(constraint.among(&phones).into_iter().map(scheduled).collect())
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
