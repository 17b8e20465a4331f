//! The WHU-Smartphone dataset as it is published: spare logs of phones, and truth tables.
//!
//! Wang, Qian, Liu, "WHU-Smartphone: A large-scale multi-traffic scene GNSS dataset of Android smartphones and a low-cost
//! GNSS module", IEEE Transactions on Intelligent Transportation Systems, 2024, and the description beside the files.
//!
//! A **spare log** (`*_spare_log_*.txt`) has two lines for each epoch. The first, `current_Start_Timestamp:` with the phone's local
//! time, is not used. The second is a JSON object:
//!
//! | key | meaning |
//! |:--|:--|
//! | `gga` | position by the phone's chip, an NMEA 0183 sentence |
//! | `obsd_t.t` | receive time: `year`, `month`, `day`, `hour`, `minute`, `sec` of GPS time |
//! | `obsd_t.d[]` | one object for each signal of a satellite |
//! | `prn`, `type` | index of the satellite ([`SatelliteId`](crate::gnss::SatelliteId) by ranges of RTKLIB's kind), observation code |
//! | `p`, `l`, `d`, `snr` | pseudorange, m; carrier phase, cycles, growing with the range; Doppler, Hz, positive when approaching; C/N0, dB-Hz |
//! | `vp`, `vl`, `vd` | the phone's own standard deviations of `p`, `l`, `d` in their units; not used |
//! | `lli` | loss-of-lock bits of RINEX |
//!
//! A zero stands for a value that was not recorded.

mod decoder;
mod epoch;
mod names;
mod truth;

pub use decoder::{SpareLogDecoder, is_spare_log_line};
pub use truth::{is_truth_table, truth_table};
