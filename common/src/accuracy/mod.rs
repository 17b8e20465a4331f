//! Truth, errors against it, percentiles: what a position is worth.

mod score;
mod truth;

pub use score::{Accuracy, Solution, score};
pub(crate) use truth::TableRow;
pub use truth::{Truth, TruthError, TruthPoint};
