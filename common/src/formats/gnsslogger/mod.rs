//! Text logs of Google's GnssLogger app, all versions from 2016 on.
//!
//! Lines are comma-separated and begin with their kind: `Raw` (one signal of one epoch), `Fix` (the phone's own position),
//! `Nav` (a piece of a navigation message), `Status` (reception and use of one signal), and sensor lines, which are not
//! used. Columns are found by the names in header lines like `# Raw,…`. A line may stand in Android's system log (`adb logcat`).
//!
//! Pseudoranges are c·(t_rx − t_tx) with t_rx by the phone's clock fields, in whole nanoseconds. Masks
//! ([`Masks`]) and all other reasons that cost a measurement are counted by name.

mod beyond;
mod clock;
mod columns;
mod decoder;
mod device;
mod epochs;
mod fields;
mod fix;
mod logcat;
mod measure;
mod names;
mod nav;
mod nav_message;
mod options;
mod pseudorange;
mod raw;
mod recognition;
mod stated;
mod status;
mod table;

pub use super::android::state;
pub use decoder::GnssLoggerDecoder;
pub use fix::{Fix, FixProvider};
pub use options::{BiasReference, KnownTime, Masks, ModularTime, Options, StateRule, StateRules};
pub(crate) use recognition::is_log_line;
pub use status::SignalStatus;
