//! A simulated group from observations to fused epochs, as agents and hub do it.
#![allow(dead_code)]

use std::sync::Arc;
use std::time::Duration;

use cofix_common::accuracy::{Accuracy, Solution, Truth, TruthPoint, score};
use cofix_common::constraint::Constraint;
use cofix_common::filter::PhoneState;
use cofix_common::frames::{Ecef, EcefVector, Enu, LocalFrame};
use cofix_common::fusion::align::{AlignOptions, Aligner};
use cofix_common::fusion::engine::{Engine, EngineOptions, FusedEpoch, ScheduledConstraint};
use cofix_common::gnss::ObservationEpoch;
use cofix_common::pipeline::{PhonePipeline, PipelineOptions};
use cofix_common::simulation::{Scenario, Simulation};
use cofix_common::time::GpsTime;
use cofix_common::wire::EpochMessage;

/// A simulation with the messages of its phones.
pub struct Group {
    pub simulation: Simulation,
    pub messages: Vec<Vec<EpochMessage>>,
    pub engine: EngineOptions,
}

impl Group {
    /// All phones of a scenario from its start to its end, with the default options.
    pub fn simulated(scenario: Scenario) -> Self {
        Self::with(scenario, &PipelineOptions::default(), EngineOptions::default(), |epoch| epoch)
    }

    /// The same with options and changed observations.
    pub fn with(
        mut scenario: Scenario,
        pipeline: &PipelineOptions,
        engine: EngineOptions,
        change: impl Fn(ObservationEpoch) -> ObservationEpoch,
    ) -> Self {
        for phone in &mut scenario.phones {
            (phone.starts_after_s, phone.stops_before_s) = (0.0, 0.0);
        }
        let simulation = Simulation::new(scenario).unwrap();
        let products = Arc::new(simulation.products());
        let run = |index: usize| {
            let mut phone = PhonePipeline::new("phone", Arc::clone(&products), pipeline.clone());
            simulation.epochs(index).map(|simulated| phone.process(&change(simulated.epoch))).collect()
        };
        let messages = (0..simulation.scenario().phones.len()).map(run).collect();
        Self { simulation, messages, engine }
    }

    /// Fused epochs with their time after the scenario's start, s.
    pub fn fused(&self, constraints: &[Constraint]) -> Vec<(f64, FusedEpoch)> {
        let always = |constraint: &Constraint| ScheduledConstraint {
            constraint: *constraint,
            from_gps: None,
            to_gps: None,
        };
        self.fused_by(constraints.iter().map(always).collect())
    }

    /// The same with periods of validity.
    pub fn fused_by(&self, scheduled: Vec<ScheduledConstraint>) -> Vec<(f64, FusedEpoch)> {
        let names: Vec<String> = self.simulation.phone_names().iter().map(ToString::to_string).collect();
        let mut aligner = Aligner::new(names.len(), AlignOptions::default());
        for (phone, messages) in self.messages.iter().enumerate() {
            for message in messages {
                aligner.push(phone, message.clone(), Duration::ZERO);
            }
            aligner.finish(phone);
        }
        let mut engine = Engine::new(&names, scheduled, self.engine.clone());
        let start = self.simulation.scenario().start_gps;
        let buckets = std::iter::from_fn(|| aligner.pop_ready());
        buckets.map(|bucket| engine.step(bucket)).map(|epoch| (epoch.time_gps - start, epoch)).collect()
    }

    fn frame(&self, phone: usize, time_gps: GpsTime) -> LocalFrame {
        LocalFrame::at(self.simulation.truth_at(phone, time_gps).position)
    }

    /// Error of a position, m.
    pub fn error_of(&self, phone: usize, time_gps: GpsTime, position: Ecef) -> Enu {
        self.frame(phone, time_gps).ecef_to_enu(position)
    }

    /// Error of a fused position, m.
    pub fn error_m(&self, phone: usize, epoch: &FusedEpoch) -> Enu {
        epoch.phones[phone].state.as_ref().map_or(Enu { east: 0.0, north: 0.0, up: 0.0 }, |state| {
            self.error_of(phone, epoch.time_gps, state.position())
        })
    }

    /// Accuracy of states of one phone.
    pub fn accuracy(&self, phone: usize, states: &[(GpsTime, PhoneState)]) -> Accuracy {
        let point = |(time_gps, _): &(GpsTime, PhoneState)| {
            let position = self.simulation.truth_at(phone, *time_gps).position;
            (*time_gps, TruthPoint { position, velocity: EcefVector::new(0.0, 0.0, 0.0) })
        };
        let truth = Truth::from_points(states.iter().map(point), 1);
        let solution = |(time_gps, state): &(GpsTime, PhoneState)| Solution {
            time_gps: *time_gps,
            position: state.position(),
            covariance: state.covariance.fixed_view::<3, 3>(0, 0).into_owned(),
        };
        let solutions: Vec<Solution> = states.iter().map(solution).collect();
        score(&truth, &[1], (states[0].0, states[states.len() - 1].0), &solutions).unwrap()
    }
}
