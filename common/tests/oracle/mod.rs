//! Rows of numbers from the vectors that lie beside the repository, when they are there.

#[path = "../beside/mod.rs"]
mod beside;

/// All rows of a file of numbers under one heading line, or `None` (said aloud) when the file is not there.
///
/// A field that is no number becomes NaN, which fails every comparison.
pub fn rows(file: &str) -> Option<Vec<Vec<f64>>> {
    let text = String::from_utf8_lossy(&beside::shared(&format!("oracle/{file}"))?).into_owned();
    let parse = |line: &str| line.split(',').map(|field| field.parse::<f64>().unwrap_or(f64::NAN)).collect();
    Some(text.lines().filter(|line| !line.starts_with('#')).skip(1).map(parse).collect())
}
