//! A spare log states nothing beside its records.

use super::SpareLogDecoder;
use crate::formats::stream::ObservationStream;

impl ObservationStream for SpareLogDecoder {}
