//! The texts of a sample's files.

use std::fmt::Write as _;
use std::io;

use cofix_common::accuracy::{TruthPoint, truth_csv_header, truth_csv_row};
use cofix_common::constraint::Constraint;
use cofix_common::formats::rinex::{
    Equipment, ObservationLayout, ObservationWriter, RecordingInfo, navigation_header, navigation_record,
};
use cofix_common::simulation::Simulation;

use super::QUALITY;
use super::folder::Put;

/// The file of the navigation messages.
pub(super) const NAVIGATION: &str = "navigation.rnx";
/// The session file.
pub(super) const SESSION: &str = "session.toml";

/// The file of a phone's observations.
pub(super) fn observations_name(phone: &str) -> String {
    format!("{phone}.rnx")
}

/// The file of a phone's truth.
pub(super) fn truth_name(phone: &str) -> String {
    format!("{phone}.truth.csv")
}

/// A simulation to be written.
pub(super) struct Sample<'a> {
    pub simulation: &'a Simulation,
    pub group: &'static str,
}

impl Sample<'_> {
    /// All files.
    pub(super) fn file_names(&self) -> Vec<String> {
        let phones = self.simulation.phone_names();
        let of_phones = phones.into_iter().flat_map(|phone| [observations_name(phone), truth_name(phone)]);
        of_phones.chain([NAVIGATION.to_owned(), SESSION.to_owned()]).collect()
    }

    /// A phone's observations. They are simulated twice, so that memory does not grow with the duration: a header names all
    /// signals.
    pub(super) fn observations(&self, phone: usize, put: &mut Put<'_>) -> io::Result<()> {
        let mut layout = ObservationLayout::default();
        for simulated in self.simulation.epochs(phone) {
            layout.include(&simulated.epoch);
        }
        let mut writer = ObservationWriter::new(layout);
        let scenario = self.simulation.scenario();
        let navigation = self.simulation.navigation();
        put(&writer.header(&RecordingInfo {
            marker_name: self.name(phone).to_owned(),
            equipment: Equipment { receiver_type: "simulated phone".to_owned(), ..Equipment::default() },
            // As a phone's first fix: near, and not the truth.
            approximate_position: Some(scenario.origin.geodetic_to_ecef()),
            interval_s: Some(scenario.interval_s),
            leap_seconds: navigation.leap_seconds,
            ..RecordingInfo::default()
        }))?;
        self.simulation.epochs(phone).try_for_each(|simulated| put(&writer.epoch(&simulated.epoch)))?;
        match writer.skips() {
            skips if skips.is_empty() => Ok(()),
            skips => Err(io::Error::other(format!("RINEX does not hold the simulated values: {skips}"))),
        }
    }

    /// All navigation messages, with the terms of the ionosphere.
    pub(super) fn navigation(&self, put: &mut Put<'_>) -> io::Result<()> {
        let navigation = self.simulation.navigation();
        put(&navigation_header("", &navigation.ionosphere, navigation.leap_seconds))?;
        navigation.ephemerides.iter().try_for_each(|ephemeris| {
            let record = navigation_record(ephemeris);
            put(&record.ok_or_else(|| io::Error::other(format!("no record for {}", ephemeris.satellite)))?)
        })
    }

    /// A phone's truth at every full second.
    pub(super) fn truth(&self, phone: usize, put: &mut Put<'_>) -> io::Result<()> {
        put(&truth_csv_header())?;
        self.simulation.truth_table(phone).into_iter().try_for_each(|state| {
            let point = TruthPoint { position: state.position, velocity: state.velocity };
            put(&truth_csv_row(state.time_gps, &point, QUALITY))
        })
    }

    /// The session file; `command` is the command line that wrote the sample.
    pub(super) fn session(&self, command: &str) -> io::Result<String> {
        let mut text = format!(
            "# Simulated by: {command}\n# Nobody was there. The bounds below are those that the simulated truth keeps.\n\
             group = \"{}\"\n\n[products]\nnavigation = [\"{NAVIGATION}\"]\n",
            self.group
        );
        for name in self.simulation.phone_names() {
            let (observations, truth) = (observations_name(name), truth_name(name));
            // Writing to a string cannot fail.
            let _ = write!(
                text,
                "\n[[phone]]\nname = \"{name}\"\nobservations = \"{observations}\"\ntruth = \"{truth}\"\n"
            );
        }
        let constraints = self.simulation.distance_constraints();
        for constraint in constraints.into_iter().chain(self.simulation.vertical_velocity_constraints()) {
            text.push_str("\n[[constraint]]\n");
            text.push_str(&self.constraint(&constraint)?);
        }
        Ok(text)
    }

    fn constraint(&self, constraint: &Constraint) -> io::Result<String> {
        let phones: Vec<&str> = constraint.phones().iter().map(|&phone| self.name(phone)).collect();
        let written = toml::to_string(constraint).map_err(io::Error::other)?;
        Ok(format!("{written}phones = [\"{}\"]\n", phones.join("\", \"")))
    }

    fn name(&self, phone: usize) -> &str {
        self.simulation.phone_names().get(phone).copied().unwrap_or("?")
    }
}
