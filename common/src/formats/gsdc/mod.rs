//! Recordings of the Google Smartphone Decimeter Challenge: tables of pseudoranges with the satellites' positions and all
//! corrections, and their ground truths.
//!
//! Two generations are read, told apart by the names in the header: `*_derived.csv` of 2021 and `device_gnss.csv` since
//! 2022. Fu, Khider, van Diggelen, "Android raw GNSS measurement datasets for precise positioning", ION GNSS+ 2020, and
//! the data descriptions of the two challenges. By these, satellites are broadcast ones at the transmission by GPS time
//! (received time less satellite clock), clocks contain relativity and the satellite's group delay and are added to pseudoranges,
//! biases between signals, ionosphere (Klobuchar) and troposphere (EGNOS: Penna, Dodson, Chen 2001) are taken from them.

mod columns;
mod derived;
mod fields;
mod losses;
mod masks;
mod row;
mod signal;
mod times;
mod truth;

pub(crate) use columns::is_table_header;
pub use derived::{DerivedDecoder, DerivedFile};
pub use truth::{ground_truth, is_ground_truth};
