//! Events between epochs.

use super::observation::{ObservationWriter, PHASE, can_be, digits, distinct, epoch_line};
use crate::formats::rinex::label;
use crate::formats::rinex::pending::is_comment;
use crate::gnss::{CycleSlip, Event, EventKind};
use crate::skips::Reason;

/// Most lines that an event's line can announce.
const MOST_LINES: usize = 999;
/// Labels of header lines that say how a file is laid out. A file written here has one layout, said in its header.
const OF_LAYOUT: [&str; 13] = [
    "RINEX VERSION / TYPE",
    "SYS / # / OBS TYPES",
    "# / TYPES OF OBSERV",
    "SYS / SCALE FACTOR",
    "OBS SCALE FACTOR",
    "SYS / PHASE SHIFT",
    "SYS / PHASE SHIFTS",
    "WAVELENGTH FACT L1/2",
    "TIME OF FIRST OBS",
    "TIME OF LAST OBS",
    "# OF SATELLITES",
    "PRN / # OF OBS",
    "END OF HEADER",
];

impl ObservationWriter {
    /// An event: its epoch line and its lines. Empty when the file can have none of its lines.
    pub fn event(&mut self, event: &Event) -> String {
        if event.kind == EventKind::CycleSlips {
            return self.cycle_slips(event);
        }
        let mut lines: Vec<&str> = Vec::new();
        for line in &event.lines {
            if let Some(reason) = unfit(line, lines.len()) {
                self.skips.add(reason, || line.clone());
            } else {
                lines.push(line);
            }
        }
        if event.kind == EventKind::Header && lines.is_empty() && !event.lines.is_empty() {
            return String::new();
        }
        let mut text = epoch_line(event.time_gps, event.kind.flag(), lines.len());
        for line in lines {
            text += line;
            text.push('\n');
        }
        text
    }

    /// Satellites' lines with slips in place of phases.
    fn cycle_slips(&mut self, event: &Event) -> String {
        for CycleSlip { satellite, signal, .. } in &event.slips {
            if let Some(reason) = satellite.cannot_send(*signal) {
                self.skips.add(reason, || format!("slip of {satellite} {signal}"));
            }
        }
        let possible = event.slips.iter().filter(|slip| can_be(slip.satellite, slip.signal));
        let satellites = distinct(possible.map(|slip| slip.satellite));
        let mut text = epoch_line(event.time_gps, event.kind.flag(), satellites.len());
        for satellite in satellites {
            let mut line = satellite.to_string();
            for (signal, (letter, _)) in self.layout.columns(satellite.constellation) {
                let mut of_signal =
                    event.slips.iter().filter(|s| (s.satellite, s.signal) == (satellite, signal));
                let slip = of_signal.next().filter(|_| letter == PHASE && can_be(satellite, signal));
                let name = || format!("slip of {satellite} {signal}");
                line += &slip
                    .map_or_else(|| " ".repeat(14), |slip| digits(slip.slip_cycles, name, &mut self.skips));
                line += "  ";
            }
            text += line.trim_end();
            text.push('\n');
        }
        text
    }
}

/// Why a line cannot stand in an event of a file; `before`: number of the event's lines before it.
fn unfit(line: &str, before: usize) -> Option<Reason> {
    let label = label(line.as_bytes());
    if OF_LAYOUT.iter().any(|of_layout| of_layout.as_bytes() == label) {
        Some(Reason::LayoutLineOfEvent)
    } else if line.starts_with('>') && !is_comment(line.as_bytes()) {
        Some(Reason::EventLineLikeEpoch)
    } else if before == MOST_LINES {
        Some(Reason::EventLineBeyond999)
    } else {
        None
    }
}
