//! Rows of numbers from the vectors of other programs.

#[path = "../beside/mod.rs"]
mod beside;

/// All rows of a file of numbers under one heading line.
///
/// A field that is no number becomes NaN, which fails every comparison.
pub fn rows(file: &str) -> Vec<Vec<f64>> {
    let text = String::from_utf8_lossy(&beside::required(&format!("oracle/{file}"))).into_owned();
    let parse = |line: &str| line.split(',').map(|field| field.parse::<f64>().unwrap_or(f64::NAN)).collect();
    text.lines().filter(|line| !line.starts_with('#')).skip(1).map(parse).collect()
}
