//! One phone's processing: correct → solve → RAIM → local filter, an epoch at a time. No I/O.

use std::sync::Arc;

use cofix_common::filter::{FilterOptions, JointFilter, Start};
use cofix_common::frames::Ecef;
use cofix_common::gnss::ObservationEpoch;
use cofix_common::integrity::{Monitored, RaimOptions, solve_with_raim};
use cofix_common::measurement::{
    CorrectedObservation, CorrectionOptions, Corrector, PreparedObservation, StochasticModel,
    without_position,
};
use cofix_common::orbit::Products;
use cofix_common::skips::Skips;
use cofix_common::solve::{PointSolution, solve_position, solve_velocity};
use cofix_common::time::GpsTime;
use cofix_common::wire::EpochMessage;

/// An epoch-wise position further than this from the last one is solved again from its own corrections, m.
const RECORRECT_M: f64 = 1_000.0;

/// What the pipeline may be told.
#[derive(Clone, Debug, Default)]
pub struct PipelineOptions {
    /// Masks, corrections and stochastic models.
    pub correction: CorrectionOptions,
    /// Integrity tests.
    pub raim: RaimOptions,
    /// The local filter.
    pub filter: FilterOptions,
}

impl PipelineOptions {
    /// The stochastic model and filter of Peng 2023; masks, corrections and RAIM as by default.
    pub fn peng2023() -> Self {
        let correction =
            CorrectionOptions { stochastic: StochasticModel::peng2023(), ..CorrectionOptions::default() };
        Self { correction, filter: FilterOptions::peng2023(), raim: RaimOptions::default() }
    }
}

/// One phone's pipeline.
pub struct PhonePipeline {
    phone: String,
    sequence: u64,
    corrector: Corrector,
    options: PipelineOptions,
    position: Option<Ecef>,
    filter: JointFilter,
    skips: Skips,
}

impl PhonePipeline {
    /// A pipeline for the phone `name`.
    pub fn new(name: &str, products: Arc<Products>, options: PipelineOptions) -> Self {
        Self {
            phone: name.to_owned(),
            sequence: 0,
            corrector: Corrector::new(products, options.correction),
            filter: JointFilter::new(options.filter),
            options,
            position: None,
            skips: Skips::default(),
        }
    }

    /// Goes on with other products: more messages have come.
    pub fn set_products(&mut self, products: Arc<Products>) {
        let corrector = Corrector::new(products, self.options.correction);
        let former = std::mem::replace(&mut self.corrector, corrector);
        self.skips.merge(former.skips());
    }

    /// Processes one epoch; epochs come in order of time.
    pub fn process(&mut self, epoch: &ObservationEpoch) -> EpochMessage {
        let (observations, Monitored { fit, report }) = self.solve(epoch);
        let wls = match &fit {
            Ok(fit) => fit.to_solution(solve_velocity(&observations, fit.position())),
            Err(error) => {
                self.skips.add("epoch without a solution", || format!("{}: {error}", epoch.time_gps));
                None
            }
        };
        if let Some(solution) = &wls {
            self.position = Some(solution.position);
        }
        self.filter(epoch.time_gps, &observations, wls.as_ref());
        let message = EpochMessage {
            phone: self.phone.clone(),
            sequence: self.sequence,
            time_gps: epoch.time_gps,
            observations,
            wls,
            local: self.filter.state(0),
            raim: report,
        };
        self.sequence += 1;
        message
    }

    /// What was skipped so far.
    pub fn skips(&self) -> Skips {
        let mut all = self.skips.clone();
        all.merge(self.corrector.skips());
        all
    }

    /// Corrects and solves. Corrections are made for the last known position, or, without one, for a first solution
    /// without atmosphere; when the solution turns out far from there, they are made again.
    fn solve(&mut self, epoch: &ObservationEpoch) -> (Vec<CorrectedObservation>, Monitored) {
        let prepared = self.corrector.prepare(epoch);
        let mut seen_from = self.position.unwrap_or_else(|| rough_position(&prepared));
        let mut rounds_left = 3;
        loop {
            rounds_left -= 1;
            let mut observations = self.corrector.finish(&prepared, seen_from, epoch.time_gps);
            let monitored = solve_with_raim(&mut observations, seen_from, &self.options.raim);
            let Ok(fit) = &monitored.fit else { return (observations, monitored) };
            let moved_m = fit.position().distance_m(seen_from);
            if moved_m <= RECORRECT_M || rounds_left == 0 {
                for observation in &mut observations {
                    observation.residual_m = fit.residual_of(observation);
                }
                return (observations, monitored);
            }
            seen_from = fit.position();
        }
    }

    fn filter(
        &mut self,
        time_gps: GpsTime,
        observations: &[CorrectedObservation],
        wls: Option<&PointSolution>,
    ) {
        self.filter.predict(time_gps);
        if let Some(reason) = self.restart_reason() {
            if !self.filter.is_empty() {
                self.skips.add("local filter restarted", || format!("{time_gps}: {reason}"));
                self.filter.remove(0);
            }
            if let Some(solution) = wls {
                self.filter.insert(0, time_gps, &Start::at_solution(solution));
            }
        } else if !observations.is_empty() {
            self.filter.update(0, observations);
        }
    }

    /// Why the local filter cannot go on, if it cannot.
    fn restart_reason(&self) -> Option<&'static str> {
        if self.filter.is_empty() {
            Some("no state yet")
        } else if self.filter.silence_s(0) > self.options.filter.maximum_gap_s {
            Some("gap in the observations")
        } else if self.filter.is_lost(0) {
            Some("most pseudoranges contradict the prediction")
        } else if !self.filter.is_sound() {
            Some("state not finite or variance not positive")
        } else {
            None
        }
    }
}

/// Where a phone about which nothing is known may be: a solution without atmosphere, else the Earth's centre.
fn rough_position(prepared: &[PreparedObservation]) -> Ecef {
    let centre = Ecef::new(0.0, 0.0, 0.0);
    solve_position(&without_position(prepared), centre).map_or(centre, |fit| fit.position())
}
