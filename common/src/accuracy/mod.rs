//! Truth, errors, percentiles, tables.
