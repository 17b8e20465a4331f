//! Orbits, clocks, group delays and ionosphere terms from whatever files there are.

/// All products of a session.
#[derive(Clone, Debug, Default)]
pub struct Products {}
