//! Names of entities in recordings, used by the hub and the viewer.
//!
//! Entities are `phones/PHONE/…`, `phones/PHONE/satellites/WHAT/SIGNAL`, `constraints/NAME/…`, `distances/PAIR/…`, `integrity/…` and `accuracy`.

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
/// First part of the entities of the group's integrity, and third part of those of a phone.
pub const INTEGRITY: &str = "integrity";
/// The last part of log entities.
pub const LOG: &str = "log";

/// Third part of the entities of a phone's positions in the local frame; the fourth is the method.
pub const ENU: &str = "enu";
/// Third part of the entities of a phone's errors; the fourth is the direction, the fifth the method.
pub const ERROR: &str = "error";
/// The direction of horizontal errors.
pub const HORIZONTAL: &str = "horizontal";
/// The direction of vertical errors.
pub const VERTICAL: &str = "vertical";
/// Third part of the entities of figures of a phone's quality.
pub const QUALITY: &str = "quality";
/// Horizontal and vertical protection level of the epoch-wise solution, among the figures of quality.
pub const LEVELS: [&str; 2] = ["hpl", "vpl"];
/// Horizontal and vertical protection level of the fused position, among the figures of quality.
pub const FUSED_LEVELS: [&str; 2] = ["fused_hpl", "fused_vpl"];
/// The method of epoch-wise solutions.
pub const EPOCH_WISE: &str = "wls";
/// The method of fused positions.
pub const FUSED: &str = "joint";
