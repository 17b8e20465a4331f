//! `simulate`: a scenario as files, for this system and for others.
//!
//! For every phone RINEX 3.05 observations and a truth table, the navigation messages of all satellites, and a session file of them. A sample of one scenario, seed and version is the same byte for byte.

mod folder;
mod sample;

use std::path::PathBuf;

use anyhow::{Context, bail};
use clap::ValueEnum;
use cofix_agent::Stop;
use cofix_common::simulation::{Scenario, Simulation};

use folder::Folder;
use sample::Sample;

/// Shortest sample, s: the phones start and stop some seconds apart.
const SHORTEST_S: f64 = 30.0;
/// Longest sample, s.
const LONGEST_S: f64 = 86_400.0;
/// Most phones: the joint filter is dense.
const MOST_PHONES: u8 = 12;

/// Truth rows of a simulation count as fixed.
pub(crate) const QUALITY: u8 = 1;

/// A scenario by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Kind {
    /// Cars with one phone each on the roof, 15 to 27 m apart, on a road with bends, stops and a street of four storeys
    Convoy,
    /// Phones in one car (windscreen, cup holder, side windows), on the same road
    Car,
    /// Two cars with half of the phones each (windscreen, cup holder, roof), in and around an old town of narrow
    /// streets: the scenario of `demo`
    Canyon,
    /// Phones on a table under an open sky
    Static,
}

impl Kind {
    /// All scenarios.
    pub const ALL: [Self; 4] = [Self::Convoy, Self::Car, Self::Canyon, Self::Static];

    /// The name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Convoy => "convoy",
            Self::Car => "car",
            Self::Canyon => "canyon",
            Self::Static => "static",
        }
    }

    /// The scenario with `phones` phones, or with its usual number.
    pub fn scenario(self, phones: Option<u8>) -> Scenario {
        let phones = |usually: u8| usize::from(phones.unwrap_or(usually));
        match self {
            Self::Convoy => Scenario::convoy(phones(3)),
            Self::Car => Scenario::car(phones(4)),
            Self::Canyon => Scenario::canyon(phones(6)),
            Self::Static => Scenario::stationary(phones(3)),
        }
    }
}

/// What `simulate` may be told.
#[derive(Clone, Debug, clap::Args)]
pub struct Arguments {
    /// What happens
    #[arg(value_enum)]
    pub scenario: Kind,
    /// Folder to write into; it is made if need be
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Everything random follows from it: orbits, clocks, noise
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// How long, at one epoch a second, from 30 s to a day
    #[arg(long, value_name = "SECONDS", default_value_t = 600.0, value_parser = duration)]
    pub duration: f64,
    /// How many phones; as a rule 3 in convoy and static, 4 in car, 6 in canyon
    #[arg(long, value_parser = clap::value_parser!(u8).range(1..=i64::from(MOST_PHONES)))]
    pub phones: Option<u8>,
    /// Replace files of the same names
    #[arg(long)]
    pub overwrite: bool,
}

impl Arguments {
    /// The requested scenario.
    pub fn scenario(&self) -> Scenario {
        let scenario = self.scenario.scenario(self.phones);
        Scenario { seed: self.seed, duration_s: self.duration, ..scenario }
    }

    /// These arguments on a command line, without those that concern the folder.
    fn command(&self, phones: usize) -> String {
        let Self { scenario, seed, duration, .. } = self;
        format!(
            "cofix-hub simulate {} --seed {seed} --duration {duration} --phones {phones}",
            scenario.name()
        )
    }
}

fn duration(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if (SHORTEST_S..=LONGEST_S).contains(&seconds) => Ok(seconds),
        _ => Err(format!("write seconds from {SHORTEST_S} to {LONGEST_S}")),
    }
}

/// Writes a sample; returns its session file.
///
/// # Errors
/// When a file is there already and must not be replaced, cannot be written, or `stop` is requested. Nothing of the
/// sample is then left behind.
pub fn simulate(arguments: &Arguments, stop: &Stop) -> anyhow::Result<PathBuf> {
    let simulation = Simulation::new(arguments.scenario()).context("the simulation cannot start")?;
    let sample = Sample { simulation: &simulation, group: arguments.scenario.name() };
    let names: Vec<String> = sample.file_names();
    let mut folder = Folder::open(&arguments.out, &names, arguments.overwrite)?;
    for (phone, name) in simulation.phone_names().into_iter().enumerate() {
        if stop.is_requested() {
            bail!("stopped before the sample was complete; nothing was written");
        }
        folder.write(&sample::observations_name(name), |put| sample.observations(phone, put))?;
        folder.write(&sample::truth_name(name), |put| sample.truth(phone, put))?;
    }
    folder.write(sample::NAVIGATION, |put| sample.navigation(put))?;
    let command = arguments.command(simulation.phone_names().len());
    folder.write(sample::SESSION, |put| put(&sample.session(&command)?))?;
    folder.finish()?;
    Ok(arguments.out.join(sample::SESSION))
}

#[cfg(test)]
mod tests;
