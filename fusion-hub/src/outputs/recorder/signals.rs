//! Per satellite and signal: C/N0, residual, whether it was used.

use std::collections::BTreeMap;

use cofix_common::gnss::{Constellation, SatelliteId, SignalCode};
use cofix_common::measurement::{CorrectedObservation, Usage};
use cofix_common::recording::SATELLITES;
use cofix_common::skips::{Reason, Skips};
use rerun::{Color, StateConfiguration};

use super::entity::phone_path;
use super::rrd::{RecorderError, RrdFile};
use super::series::{Series, StateLane, Style};

/// The series of one satellite's signal.
#[derive(Debug)]
struct SignalSeries {
    cn0: Series,
    residual: Series,
    usage: StateLane,
    /// Epoch number of the last observation.
    last_epoch: u64,
}

/// All signals of a phone that have been observed.
#[derive(Debug)]
pub(super) struct Signals {
    phone: String,
    series: BTreeMap<(SatelliteId, SignalCode), SignalSeries>,
    epoch: u64,
}

impl SignalSeries {
    fn new(phone: &str, satellite: SatelliteId, signal: SignalCode) -> Self {
        let name = format!("{satellite} {signal}");
        let colour = colour(satellite);
        let entity = |what| phone_path(phone, [SATELLITES, what, name.as_str()]);
        let line = Style::Line { name: name.clone(), colour, width: 1.0 };
        Self {
            cn0: Series::new(entity("cn0"), line.clone()),
            residual: Series::new(entity("residual"), line),
            usage: StateLane::new(entity("usage")),
            last_epoch: 0,
        }
    }

    fn push(&mut self, time_ns: i64, observation: Option<&CorrectedObservation>, skips: &mut Skips) {
        self.cn0.push(time_ns, observation.and_then(|o| o.cn0_dbhz), skips);
        self.residual.push(time_ns, observation.and_then(|o| o.residual_m), skips);
        self.usage.push(time_ns, observation.map(|o| usage_name(o.usage).into()));
    }
}

impl Signals {
    pub fn new(phone: &str) -> Self {
        Self { phone: phone.to_owned(), series: BTreeMap::new(), epoch: 0 }
    }

    /// Adds an epoch; signals that it does not have end here.
    pub fn push(&mut self, time_ns: i64, observations: &[CorrectedObservation], skips: &mut Skips) {
        self.epoch += 1;
        for observation in observations {
            let (satellite, signal) = (observation.satellite, observation.signal);
            let series = self
                .series
                .entry((satellite, signal))
                .or_insert_with(|| SignalSeries::new(&self.phone, satellite, signal));
            if series.last_epoch == self.epoch {
                let describe = || format!("{} {satellite} {signal} at {time_ns} ns", self.phone);
                skips.add(Reason::SignalTwiceNotRecorded, describe);
                continue;
            }
            series.last_epoch = self.epoch;
            series.push(time_ns, Some(observation), skips);
        }
        for series in self.series.values_mut().filter(|s| s.last_epoch != self.epoch) {
            series.push(time_ns, None, skips);
        }
    }

    pub fn write_segment(&mut self, file: &mut RrdFile) -> Result<(), RecorderError> {
        for series in self.series.values_mut() {
            series.cn0.write_segment(file)?;
            series.residual.write_segment(file)?;
            series.usage.write_segment(file, &usage_style())?;
        }
        Ok(())
    }
}

/// The state's name in the recording.
const fn usage_name(usage: Usage) -> &'static str {
    match usage {
        Usage::Used => "used",
        Usage::Excluded => "excluded",
    }
}

fn usage_style() -> StateConfiguration {
    StateConfiguration::new()
        .with_values([Usage::Used, Usage::Excluded].map(usage_name))
        .with_labels([" ", "excluded"]) // the rule goes without saying
        .with_colors([Color::from_rgb(0x2E, 0x5A, 0x4A), Color::from_rgb(0xE0, 0x40, 0x30)])
}

/// A colour that shows the constellation, in a shade by the satellite's number.
fn colour(satellite: SatelliteId) -> Color {
    let (red, green, blue) = match satellite.constellation {
        Constellation::Gps => (0x56, 0xB4, 0xE9),
        Constellation::Glonass => (0xF0, 0xE4, 0x42),
        Constellation::Galileo => (0xE6, 0x9F, 0x00),
        Constellation::Beidou => (0xE0, 0x60, 0x9C),
        Constellation::Qzss => (0x00, 0xC8, 0x8C),
        Constellation::Navic | Constellation::Sbas => (0xBB, 0xBB, 0xBB),
    };
    let percent = 55 + 45 * (u32::from(satellite.number) % 8) / 7;
    let shade = |channel: u32| u8::try_from(channel * percent / 100).unwrap_or(u8::MAX);
    Color::from_rgb(shade(red), shade(green), shade(blue))
}
