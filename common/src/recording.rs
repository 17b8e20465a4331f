//! Names of entities in recordings, used by the hub and the viewer.
//!
//! Entities are `phones/PHONE/…`, `phones/PHONE/satellites/WHAT/SIGNAL`, `constraints/NAME/…`, `distances/PAIR/…` and `accuracy`.

/// The application id of all recordings of this project.
pub const APPLICATION_ID: &str = "cofix";
/// The timeline of all recordings: GPS time, shown as if it were UTC.
pub const TIMELINE: &str = "gps_time";
/// Beginning of the text that replaces the accuracy table of an incomplete session.
pub const INCOMPLETE: &str = "Incomplete";

/// First part of the entities of phones; the second is the phone's name.
pub const PHONES: &str = "phones";
/// Third part of the entities of a phone's satellites.
pub const SATELLITES: &str = "satellites";
/// First part of the entities of constraints; the second is the constraint's name.
pub const CONSTRAINTS: &str = "constraints";
/// First part of the entities of distances; the second names the pair of phones.
pub const DISTANCES: &str = "distances";
/// The entity of the accuracy table.
pub const ACCURACY: &str = "accuracy";
