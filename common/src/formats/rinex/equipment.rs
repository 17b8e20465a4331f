//! Receiver, antenna and people of a recording, by its header lines. Positioning does not use them; files should keep them.

use crate::formats::decimal::real;
use crate::formats::text::{columns, text};

/// Receiver, antenna and people, as a header has them. Texts are empty where nothing is known.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Equipment {
    /// Number of the marker.
    pub marker_number: String,
    /// Kind of the marker (RINEX 3.05, table 8), for example `GROUND_CRAFT`.
    pub marker_type: String,
    /// Observer.
    pub observer: String,
    /// Agency of the observer.
    pub agency: String,
    /// Serial number of the receiver.
    pub receiver_number: String,
    /// Type of the receiver; of a phone manufacturer and model.
    pub receiver_type: String,
    /// Version of the receiver's software.
    pub receiver_version: String,
    /// Serial number of the antenna.
    pub antenna_number: String,
    /// Type of the antenna.
    pub antenna_type: String,
    /// Height of the antenna's reference point above the marker and its offsets to the east and north, m.
    pub antenna_delta_hen_m: Option<[f64; 3]>,
}

impl Equipment {
    /// Takes a header line; lines of other labels change nothing.
    pub(super) fn header_line(&mut self, label: &[u8], line: &[u8]) {
        let part = |k: usize| text(columns(line, 20 * k, (20 * k + 20).min(60)));
        match label {
            b"MARKER NUMBER" => self.marker_number = part(0),
            b"MARKER TYPE" => self.marker_type = part(0),
            b"OBSERVER / AGENCY" => (self.observer, self.agency) = (part(0), text(columns(line, 20, 60))),
            b"REC # / TYPE / VERS" => {
                (self.receiver_number, self.receiver_type, self.receiver_version) =
                    (part(0), part(1), part(2));
            }
            b"ANT # / TYPE" => (self.antenna_number, self.antenna_type) = (part(0), part(1)),
            b"ANTENNA: DELTA H/E/N" => {
                let [h, e, n] = [0, 1, 2].map(|k| real(columns(line, 14 * k, 14 * k + 14)));
                self.antenna_delta_hen_m = h.zip(e).zip(n).map(|((h, e), n)| [h, e, n]);
            }
            _ => {}
        }
    }

    /// Fills unknown entries from another.
    pub fn fill(&mut self, other: &Self) {
        let pairs = [
            (&mut self.marker_number, &other.marker_number),
            (&mut self.marker_type, &other.marker_type),
            (&mut self.observer, &other.observer),
            (&mut self.agency, &other.agency),
            (&mut self.receiver_number, &other.receiver_number),
            (&mut self.receiver_type, &other.receiver_type),
            (&mut self.receiver_version, &other.receiver_version),
            (&mut self.antenna_number, &other.antenna_number),
            (&mut self.antenna_type, &other.antenna_type),
        ];
        for (mine, theirs) in pairs {
            if mine.is_empty() {
                mine.clone_from(theirs);
            }
        }
        self.antenna_delta_hen_m = self.antenna_delta_hen_m.or(other.antenna_delta_hen_m);
    }
}
