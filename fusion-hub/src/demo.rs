//! The demonstration: a simulated group, through the same path as a recorded session.

use std::sync::Arc;

use anyhow::Context;
use cofix_agent::{ProductSource, Source};
use cofix_common::accuracy::{Truth, TruthPoint};
use cofix_common::fusion::engine::ScheduledConstraint;
use cofix_common::simulation::{Scenario, Simulation};
use cofix_common::skips::Skips;

use crate::replay::{Plan, PlannedPhone};
use crate::session::Settings;
use crate::simulate::{Kind, QUALITY};

/// The scenario of the demonstration: six phones in two cars, in and around an old town of narrow streets.
pub fn scenario() -> Scenario {
    Kind::Canyon.scenario(None)
}

/// A simulated scenario as a session: its phones, its products, and the constraints that its truth keeps.
///
/// # Errors
/// When the scenario cannot be simulated.
pub fn plan(scenario: Scenario) -> anyhow::Result<Plan> {
    let simulation = Simulation::new(scenario).context("the simulation cannot start")?;
    let names = simulation.phone_names();
    let phones = names.iter().enumerate().map(|(index, name)| phone(&simulation, index, name)).collect();
    let mut constraints = simulation.distance_constraints();
    constraints.extend(simulation.vertical_velocity_constraints());
    let always = |constraint| ScheduledConstraint { constraint, from_gps: None, to_gps: None };
    Ok(Plan {
        group: "demo".to_owned(),
        products: ProductSource::Loaded(Arc::new(simulation.products())),
        phones,
        constraints: constraints.into_iter().map(always).collect(),
        truth_quality: vec![QUALITY],
        settings: Settings::default(),
        truth_skips: Skips::default(),
    })
}

fn phone(simulation: &Simulation, index: usize, name: &str) -> PlannedPhone {
    let epochs = simulation.epochs(index).map(|simulated| simulated.epoch).collect();
    let rows = simulation
        .truth_table(index)
        .into_iter()
        .map(|state| (state.time_gps, TruthPoint { position: state.position, velocity: state.velocity }));
    PlannedPhone {
        name: name.to_owned(),
        source: Source::Epochs(Arc::new(epochs)),
        truth: Some(Truth::from_points(rows, QUALITY)),
        recorded_corrections: false,
        shift_weeks: None,
        exclude: Vec::new(),
    }
}
