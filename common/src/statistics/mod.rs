//! Distributions and quantiles.
