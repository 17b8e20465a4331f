//! Distributions and quantiles with full relative precision in the far tails, as needed by tests and truncation.
//!
//! - [`normal`]: the standard normal distribution, with logarithms and quantiles.
//! - [`chi_square`]: tail probability and thresholds for an integer number of degrees of freedom.
//! - [`noncentral`]: the same under a fault, and the faults that a test detects.
//! - [`ball`]: moments of a normal variable that is a component of a point in a ball.
//! - [`truncated`]: moments of a standard normal variable within an interval.

pub mod ball;
pub mod chi_square;
pub mod noncentral;
pub mod normal;
pub(crate) mod quadrature;
pub mod truncated;

pub use ball::ball_moments;
pub use chi_square::{ChiSquareThresholds, chi_square_threshold, chi_square_upper_tail};
pub use noncentral::{DetectableNoncentrality, detectable_noncentrality, noncentral_upper_tail};
pub use truncated::{TruncatedMoments, log_interval_probability, truncated_moments};
