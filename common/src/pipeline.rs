//! Processing of one phone, epoch by epoch: corrections → least squares → RAIM → time of reception → local filter. No I/O.

mod receive_time;

use std::sync::Arc;

use crate::filter::{Admitted, FilterOptions, JointFilter, PhoneEpoch, PhoneState, Unsound, UpdateReport};
use crate::frames::Ecef;
use crate::gnss::{EpochFlag, ObservationEpoch};
use crate::integrity::{
    Monitored, ProtectionLevels, RaimOptions, RaimReport, SatelliteFaults, StateReport, Verdict,
    levels_about, solve_with_raim, state_levels, velocity_report,
};
use crate::measurement::{
    Carriers, CorrectedObservation, CorrectionOptions, Corrector, Differential, DifferentialCounts,
    DifferentialOptions, Finished, PreparedObservation, RecordedEpoch, StochasticModel, VarianceModel,
    without_position,
};
use crate::orbit::{BroadcastAccuracy, Products};
use crate::phase::{CarrierEpoch, PhaseTracker};
use crate::skips::{Reason, Skips};
use crate::solve::{PointSolution, SolveError, fit_velocity};
use crate::time::GpsTime;
use crate::wire::EpochMessage;

use crate::formats::stream::StreamDecoder;

use receive_time::ReceiveTimes;

/// Distance, m, between an epoch-wise position and the position used for its corrections, above which the corrections are made again.
const RECORRECT_M: f64 = 1_000.0;
/// Maximum number of corrections per epoch.
const MOST_CORRECTIONS: usize = 4;

/// Options of the pipeline.
#[derive(Clone, Debug, Default)]
pub struct PipelineOptions {
    /// Masks, corrections and stochastic models.
    pub correction: CorrectionOptions,
    /// Options of the integrity tests.
    pub raim: RaimOptions,
    /// Options of the local filter.
    pub filter: FilterOptions,
    /// Whether a recording's own satellite states and delays take precedence over products. Otherwise they serve only satellites without
    /// products.
    pub recorded_corrections: bool,
}

impl PipelineOptions {
    /// Masks (10°, 25 dB-Hz), stochastic model and filter of Peng 2023, section 4.1; other corrections and RAIM as by default.
    pub fn peng2023() -> Self {
        let correction = CorrectionOptions {
            elevation_mask_rad: 10_f64.to_radians(),
            minimum_cn0_dbhz: 25.0,
            stochastic: StochasticModel::peng2023(),
            ..CorrectionOptions::default()
        };
        Self { correction, filter: FilterOptions::peng2023(), ..Self::default() }
    }

    /// RAIM of Cappello 2023: variances by elevation and URA, 15° and 20 dB-Hz, no exclusion of groups. The paper does not print the standard
    /// deviation at the zenith; it is 1 m here. Corrections and filter are as by default.
    pub fn cappello2023() -> Self {
        let usual = StochasticModel::default();
        let correction = CorrectionOptions {
            elevation_mask_rad: 15_f64.to_radians(),
            minimum_cn0_dbhz: 20.0,
            // What products state for the satellite is added to every model.
            stochastic: StochasticModel { code: VarianceModel::Elevation { ura: 0.0, zenith: 1.0 }, ..usual },
            broadcast_accuracy: BroadcastAccuracy::Stated,
            ..CorrectionOptions::default()
        };
        let raim = RaimOptions { exclude_groups: false, ..RaimOptions::default() };
        Self { correction, raim, ..Self::default() }
    }
}

/// Pipeline of one phone.
pub struct PhonePipeline {
    phone: String,
    sequence: u64,
    corrector: Corrector,
    options: PipelineOptions,
    position: Option<Ecef>,
    times: ReceiveTimes,
    phases: PhaseTracker,
    filter: JointFilter,
    /// Differential corrections from base stations, if used.
    differential: Option<Differential>,
    differential_counts: DifferentialCounts,
    skips: Skips,
}

impl PhonePipeline {
    /// A pipeline for the phone `name`.
    pub fn new(name: &str, products: Arc<Products>, options: PipelineOptions) -> Self {
        Self {
            phone: name.to_owned(),
            sequence: 0,
            corrector: Corrector::new(products, options.correction.clone()),
            filter: JointFilter::new(options.filter),
            options,
            position: None,
            times: ReceiveTimes::default(),
            phases: PhaseTracker::default(),
            differential: None,
            differential_counts: DifferentialCounts::default(),
            skips: Skips::default(),
        }
    }

    /// Applies differential corrections from base stations from now on.
    pub fn use_bases(&mut self, options: DifferentialOptions) {
        let products = Arc::clone(self.corrector.products());
        self.differential = Some(Differential::new(products, self.options.correction.clone(), options));
    }

    /// Takes an epoch of base number `base` with its antenna at `position`; without effect before [`PhonePipeline::use_bases`].
    pub fn add_base_epoch(&mut self, base: usize, epoch: ObservationEpoch, position: Ecef) {
        if let Some(differential) = &mut self.differential {
            differential.add(base, epoch, position);
        }
    }

    /// Numbers of observations with and without a differential correction.
    pub const fn differential_counts(&self) -> DifferentialCounts {
        self.differential_counts
    }

    /// Position of the last epoch with an epoch-wise solution.
    pub const fn position(&self) -> Option<Ecef> {
        self.position
    }

    /// Replaces the products, for example after new navigation messages.
    pub fn set_products(&mut self, products: Arc<Products>) {
        if let Some(differential) = &mut self.differential {
            differential.set_products(Arc::clone(&products));
        }
        self.corrector.set_products(products);
    }

    /// Processes one epoch. Epochs must be in order of time.
    pub fn process(&mut self, epoch: &ObservationEpoch) -> EpochMessage {
        let prepared = self.corrector.prepare(epoch);
        if epoch.flag == EpochFlag::PowerFailure {
            self.phases.interrupt();
        }
        self.process_prepared(epoch.time_gps, &prepared)
    }

    /// Processes one epoch of a recording that contains more than observations: satellite states and corrections, used before those of
    /// products if the options say so, and GLONASS satellites known by their channel only.
    pub fn process_recorded(&mut self, epoch: &RecordedEpoch) -> EpochMessage {
        let mut prepared = if self.options.recorded_corrections {
            epoch.prepare(&mut self.corrector)
        } else {
            epoch.prepare_with_products(&mut self.corrector)
        };
        if !epoch.by_channel.is_empty() {
            let identified = self.identify(epoch, &prepared);
            prepared.extend(self.corrector.prepare(&identified));
        }
        self.process_prepared(epoch.time_gps, &prepared)
    }

    /// Assigns slots to the GLONASS satellites known by their channel only, by comparison with the orbits seen from the last position, or
    /// from a position without atmosphere.
    fn identify(&mut self, epoch: &RecordedEpoch, prepared: &[PreparedObservation]) -> ObservationEpoch {
        let position = self.position.unwrap_or_else(|| self.rough_position(prepared));
        self.corrector.identify(&epoch.by_channel, prepared, position, epoch.time_gps)
    }

    /// Processes the epoch that `decoder` returned last, with the decoder's additional data on it.
    pub fn process_last(&mut self, epoch: &ObservationEpoch, decoder: &StreamDecoder) -> EpochMessage {
        match decoder.recorded_epoch() {
            Some(recorded) => self.process_recorded(recorded),
            None => self.process(epoch),
        }
    }

    fn process_prepared(&mut self, tag_gps: GpsTime, prepared: &[PreparedObservation]) -> EpochMessage {
        let (Seen { mut observations, carriers }, Monitored { fit, mut report }) =
            self.solve(tag_gps, prepared);
        let wls = match &fit {
            Ok(fit) => {
                let rates = fit_velocity(&observations, fit.position());
                report.velocity = rates.as_ref().map(|rates| velocity_report(rates, &self.options.raim));
                let solution = fit.to_solution(rates.map(|rates| rates.solution));
                if solution.is_none() {
                    self.skips.add(Reason::EpochWithSingularGeometry, || tag_gps.to_string());
                }
                solution
            }
            Err(error) => {
                let reason = match error {
                    SolveError::Contradictory { .. } => Reason::EpochContradictory,
                    _ => Reason::EpochWithoutSolution,
                };
                self.skips.add(reason, || format!("{tag_gps}: {error}"));
                None
            }
        };
        if let Some(solution) = &wls {
            self.position = Some(solution.position);
        }
        let time_gps = self.receive_time(tag_gps, wls.as_ref(), report.verdict);
        let changes_since_gps = self.range_changes(time_gps, &mut observations, &carriers, wls.as_ref());
        let solution = wls.as_ref().map(|solution| (solution, report.verdict));
        let raim = &self.options.raim;
        let epoch = PhoneEpoch {
            time_gps,
            observations: &observations,
            changes_since_gps,
            wls: solution,
            tests: Some(raim),
        };
        let update = filter(&mut self.filter, &epoch, &mut self.skips);
        let local = self.filter.state(0);
        let local_integrity = local.as_ref().map(|state| {
            let about = wls.as_ref().map(|solution| (solution, time_gps));
            let protection = ProtectionLevels::smallest(
                self.local_levels(state),
                about.and_then(|about| levels_about(about, &report, (state, time_gps))),
            );
            StateReport::new(update.and_then(|update| update.test), &report, protection, raim)
        });
        let message = EpochMessage {
            phone: self.phone.clone(),
            sequence: self.sequence,
            time_gps,
            observations,
            changes_since_gps,
            wls,
            local,
            local_integrity,
            raim: report,
        };
        self.sequence += 1;
        message
    }

    /// Gives observations their changes of range since the epoch before. Returns that epoch's time.
    fn range_changes(
        &mut self,
        time_gps: GpsTime,
        observations: &mut [CorrectedObservation],
        carriers: &Carriers,
        wls: Option<&PointSolution>,
    ) -> Option<GpsTime> {
        let position = self.position?;
        let velocity = wls.and_then(|solution| solution.velocity).map(|velocity| velocity.velocity);
        let epoch = CarrierEpoch { time_gps, carriers, position, velocity };
        self.phases.take(&epoch, observations, &mut self.skips)
    }

    /// Time of reception by the receiver's clock of a solution that passed the integrity tests or could not be tested.
    fn receive_time(&mut self, tag_gps: GpsTime, wls: Option<&PointSolution>, verdict: Verdict) -> GpsTime {
        let trusted = wls.filter(|_| !matches!(verdict, Verdict::Unreliable(_)));
        self.times.next(tag_gps, trusted.and_then(PointSolution::receiver_clock_m), &mut self.skips)
    }

    /// Counts of skips by reason. Masks that named nothing in all epochs are included.
    pub fn skips(&self) -> Skips {
        let mut all = self.skips.clone();
        all.merge(self.corrector.skips());
        for exclusion in self.corrector.idle_exclusions().filter(|_| self.sequence > 0) {
            all.add_about(Reason::MaskNamesNothing, exclusion, || {
                format!("none of it in {} epochs", self.sequence)
            });
        }
        if let Some(differential) = &self.differential {
            all.merge(&differential.skips());
        }
        all
    }

    /// Corrects and solves one epoch. Corrections are made for the last known position, or else for a solution without atmosphere, and made
    /// again if the solution is far from it. Where the last known position leads to no solution, it may be wrong, and the solution without
    /// atmosphere is tried. If that leads to none either, because there are too few satellites, the corrections for the last known position
    /// remain, and the filter goes on with them.
    fn solve(&mut self, time_gps: GpsTime, prepared: &[PreparedObservation]) -> (Seen, Monitored) {
        let known = self.position.take();
        let start = known.unwrap_or_else(|| self.rough_position(prepared));
        let solved = self.solve_from(prepared, start, time_gps);
        if solved.1.fit.is_err() && known.is_some() {
            let anew = self.solve_from(prepared, self.rough_position(prepared), time_gps);
            if anew.1.fit.is_ok() {
                return anew;
            }
            self.position = known;
        }
        solved
    }

    /// Position of a phone without prior knowledge: a solution without atmosphere, else the Earth's centre.
    fn rough_position(&self, prepared: &[PreparedObservation]) -> Ecef {
        let centre = Ecef::new(0.0, 0.0, 0.0);
        let monitored = solve_with_raim(&mut without_position(prepared), centre, &self.options.raim);
        monitored.fit.map_or(centre, |fit| fit.position())
    }

    fn solve_from(
        &mut self,
        prepared: &[PreparedObservation],
        start: Ecef,
        time_gps: GpsTime,
    ) -> (Seen, Monitored) {
        let mut seen_from = start;
        for _ in 0..MOST_CORRECTIONS {
            let Finished { mut observations, carriers, masked } =
                self.corrector.finish_with_carriers(prepared, seen_from, time_gps);
            let applied = self.differential.as_mut().map(|d| d.apply(&mut observations, seen_from, time_gps));
            let monitored = without_absurd(solve_with_raim(&mut observations, seen_from, &self.options.raim));
            let moved_m = monitored.fit.as_ref().map_or(0.0, |fit| fit.position().distance_m(seen_from));
            if moved_m <= RECORRECT_M {
                self.skips.merge(&masked);
                if let Some(applied) = applied {
                    self.skips.merge(&applied.skips);
                    self.differential_counts.add(applied.counts);
                }
                if let Ok(fit) = &monitored.fit {
                    for observation in &mut observations {
                        observation.residual_m = fit.residual_of(observation);
                    }
                }
                return (Seen { observations, carriers }, monitored);
            }
            seen_from = monitored.fit.map_or(seen_from, |fit| fit.position());
        }
        let step = SolveError::Diverged { step_m: RECORRECT_M };
        let report = RaimReport::of(Verdict::CannotBeChecked);
        (Seen::default(), Monitored { fit: Err(step), report })
    }

    /// Levels of the local state by the filter's faults.
    fn local_levels(&self, state: &PhoneState) -> Option<ProtectionLevels> {
        let faults = SatelliteFaults::new(state.position(), 1, &self.filter.faults(0)?);
        state_levels(state, &faults, &self.options.raim.protection)
    }
}

/// Corrected observations of an epoch and their carriers.
#[derive(Default)]
struct Seen {
    observations: Vec<CorrectedObservation>,
    carriers: Carriers,
}

/// Takes an epoch into the local filter.
fn filter(filter: &mut JointFilter, epoch: &PhoneEpoch<'_>, skips: &mut Skips) -> Option<UpdateReport> {
    let time_gps = epoch.time_gps;
    let Admitted { late_s, silent, was_lost, unsound, update } = filter.admit(0, epoch);
    if let Some(late_s) = late_s {
        skips.add(Reason::EpochBeforeFilterTime, || format!("{time_gps}, {late_s:.3} s late"));
    }
    let gap = silent.first().map(|(_, silence_s)| format!("no measurement for {silence_s:.1} s"));
    let lost = was_lost.then(|| "its measurements contradict the prediction".to_owned());
    let spoilt = (unsound != Unsound::None).then(|| "state not finite or variance not positive".to_owned());
    for reason in [gap, lost, spoilt].into_iter().flatten() {
        skips.add(Reason::LocalFilterRestarted, || format!("{time_gps}: {reason}"));
    }
    update
}

/// A solution whose residuals are absurd is none: neither a position nor a start of the filter. The report stays.
fn without_absurd(monitored: Monitored) -> Monitored {
    match monitored.report.global_test {
        Some(test) if monitored.fit.is_ok() && !monitored.report.may_start_filter() => {
            Monitored { fit: Err(SolveError::Contradictory { scale: test.posterior_scale() }), ..monitored }
        }
        _ => monitored,
    }
}

#[cfg(test)]
mod tests;
