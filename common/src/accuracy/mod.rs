//! Truth trajectories, errors of positions and their percentiles.

mod claims;
mod score;
mod shift;
mod truth;
mod truth_table;

pub use claims::{Claim, Protection};
pub use score::{Accuracy, Solution, Spans, percentile, score};
pub use shift::{TimeShift, time_shift};
pub use truth::{TRUTH_COLUMNS, Truth, TruthError, TruthPoint};
pub(crate) use truth::{TableRow, TruthPosition};
pub use truth_table::{truth_csv_header, truth_csv_row};
