//! Distributions and quantiles with full relative precision in the far tails, as needed by tests and truncation.
//!
//! - [`normal`]: the standard normal distribution, with logarithms and quantiles.
//! - [`chi_square`]: tail probability and thresholds for an integer number of degrees of freedom.
//! - [`truncated`]: moments of a standard normal variable within an interval.

pub mod chi_square;
pub mod normal;
pub(crate) mod quadrature;
pub mod truncated;

pub use chi_square::{ChiSquareThresholds, chi_square_threshold, chi_square_upper_tail};
pub use truncated::{TruncatedMoments, log_interval_probability, truncated_moments};
