//! A seeded, simulated convoy with truth.
