//! Epochs of a base and their corrections.

use super::clock::mean_and_outliers;
use super::{CorrectedObservation, Corrector, DifferentialOptions, code_variance_m2};
use crate::constants::SPEED_OF_LIGHT_MPS;
use crate::frames::Ecef;
use crate::gnss::{ClockGroup, Constellation, ObservationEpoch, SatelliteId, SignalCode};
use crate::measurement::pair::pair_factor;
use crate::orbit::{ClockReference, Products, SatelliteState};
use crate::skips::{Reason, Skips};
use crate::time::GpsTime;

/// Limit on a base's corrections, m. If more than half of them exceed it, the stated position of the base is wrong; model errors are
/// smaller.
const CONTRADICTION_M: f64 = 30.0;

/// Minimum number of signals of a constellation and band for a correction.
const FEWEST_FELLOWS: usize = 2;

/// One epoch of a base; its corrections are computed at the first use.
#[derive(Clone, Debug)]
pub(super) struct BaseEpoch {
    epoch: ObservationEpoch,
    position: Ecef,
    corrections: Option<Vec<BaseCorrection>>,
    /// Whether refused signals have been counted.
    is_counted: bool,
}

/// Correction of one signal of one satellite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BaseCorrection {
    pub(super) satellite: SatelliteId,
    pub(super) signal: SignalCode,
    /// Correction to subtract from the rover's pseudorange, m.
    pub(super) correction_m: f64,
    /// Variance of the correction at the base at its own time, m².
    pub(super) variance_m2: f64,
    /// Whether the value differs too much from the other signals of its group.
    pub(super) is_refused: bool,
    /// Time of transmission of the base's observation.
    sent: GpsTime,
}

impl BaseEpoch {
    pub(super) const fn new(epoch: ObservationEpoch, position: Ecef) -> Self {
        Self { epoch, position, corrections: None, is_counted: false }
    }

    pub(super) const fn time_gps(&self) -> GpsTime {
        self.epoch.time_gps
    }

    pub(super) const fn position(&self) -> Ecef {
        self.position
    }

    /// Discards the computed corrections.
    pub(super) fn forget(&mut self) {
        self.corrections = None;
    }

    /// The corrections; refused signals are counted once.
    pub(super) fn corrections(
        &mut self,
        corrector: &mut Corrector,
        options: &DifferentialOptions,
        skips: &mut Skips,
    ) -> &[BaseCorrection] {
        if self.corrections.is_none() {
            let mut news = Skips::default();
            self.corrections = Some(compute(&self.epoch, self.position, corrector, options, &mut news));
            if !std::mem::replace(&mut self.is_counted, true) {
                skips.merge(&news);
            }
        }
        self.corrections.as_deref().unwrap_or_default()
    }
}

fn compute(
    epoch: &ObservationEpoch,
    position: Ecef,
    corrector: &mut Corrector,
    options: &DifferentialOptions,
    skips: &mut Skips,
) -> Vec<BaseCorrection> {
    let prepared = corrector.prepare(epoch);
    let (observations, masked) = corrector.finish(&prepared, position, epoch.time_gps);
    skips.merge(&masked.with_prefix("base: "));
    let mut groups: Vec<ClockGroup> = observations.iter().map(CorrectedObservation::clock_group).collect();
    groups.sort();
    groups.dedup();
    let mut corrections = Vec::with_capacity(observations.len());
    for group in groups {
        let fellows: Vec<_> = observations.iter().filter(|o| o.clock_group() == group).collect();
        // The error of a single signal cannot be separated from the base's clock.
        if fellows.len() < FEWEST_FELLOWS {
            for alone in fellows {
                skips.add(Reason::BaseSignalAlone, || {
                    format!("{} {} at {}", alone.satellite, alone.signal, epoch.time_gps)
                });
            }
            continue;
        }
        let left = |o: &CorrectedObservation| o.pseudorange_m - o.satellite_position.distance_m(position);
        let values: Vec<_> = fellows.iter().map(|o| (left(o), o.pseudorange_sigma_m)).collect();
        let Some((clock_m, outliers)) = mean_and_outliers(&values, options.outlier_sigmas) else { continue };
        for ((observation, (left_m, sigma_m)), is_refused) in fellows.iter().zip(values).zip(outliers) {
            let correction_m = left_m - clock_m;
            if is_refused {
                skips.add(Reason::BaseValueApart, || {
                    let (satellite, signal, time) =
                        (observation.satellite, observation.signal, epoch.time_gps);
                    format!(
                        "{satellite} {signal} at {time}: {correction_m:.1} m, expected are {sigma_m:.1} m"
                    )
                });
            }
            corrections.push(BaseCorrection {
                satellite: observation.satellite,
                signal: observation.signal,
                correction_m,
                variance_m2: code_variance_m2(options.base_code, observation),
                is_refused,
                sent: epoch.time_gps + -(observation.pseudorange_m / SPEED_OF_LIGHT_MPS),
            });
        }
    }
    if contradicts(&corrections) {
        skips.add(Reason::BaseContradictsItsPosition, || {
            format!("{}: more than half of them are more than {CONTRADICTION_M} m off", epoch.time_gps)
        });
        corrections.clear();
    }
    corrections
}

/// Whether the corrections contradict the stated position of the base.
fn contradicts(corrections: &[BaseCorrection]) -> bool {
    let off = corrections.iter().filter(|c| c.correction_m.abs() > CONTRADICTION_M).count();
    2 * off > corrections.len()
}

impl BaseCorrection {
    /// Change of the correction, m, between the navigation messages in force at the base's observation and at `sent`, as seen from the
    /// base, or between a message and precise orbits that begin or end in between. Zero for the same message, and with precise orbits at
    /// both instants.
    pub(super) fn change_of_message_m(&self, products: &Products, sent: GpsTime, base: Ecef) -> f64 {
        let satellite = self.satellite;
        let state = |at| products.satellite_state(satellite, at).ok();
        let (Some(then), Some(now)) = (state(self.sent), state(sent)) else { return 0.0 };
        let observed =
            |state: SatelliteState| SPEED_OF_LIGHT_MPS * state.clock_s - state.position.distance_m(base);
        let change_m = match (then.clock_reference, now.clock_reference) {
            (ClockReference::IonosphereFree, ClockReference::IonosphereFree) => None,
            // Precise orbits at the base's instant only.
            (ClockReference::IonosphereFree, ClockReference::Broadcast) => {
                state_by(products, satellite, sent, self.sent).map(|new| observed(new) - observed(then))
            }
            // The base's navigation message, if it covers the rover's instant.
            (ClockReference::Broadcast, _) => has_changed(products, satellite, self.sent, sent, &now)
                .then(|| state_by(products, satellite, self.sent, sent))
                .flatten()
                .map(|old| observed(now) - observed(old)),
        };
        let delay_m =
            |reference, at| group_delay_m(products, satellite, self.signal, reference, at).unwrap_or(0.0);
        change_m.map_or(0.0, |change_m| {
            change_m + delay_m(now.clock_reference, sent) - delay_m(then.clock_reference, self.sent)
        })
    }
}

/// Group delay correction of a signal or of a pair.
fn group_delay_m(
    products: &Products,
    satellite: SatelliteId,
    signal: SignalCode,
    reference: ClockReference,
    time: GpsTime,
) -> Option<f64> {
    let of = |signal| products.group_delay_correction_m(satellite, signal, reference, time);
    let Some((first, second)) = signal.bands_of_pair() else { return of(signal) };
    let of_band = |band| of(SignalCode::new(band, signal.attribute)).unwrap_or(0.0);
    let factor = pair_factor(signal, satellite.constellation)?;
    Some(factor * of_band(first) - (factor - 1.0) * of_band(second))
}

/// Whether the state at the second of two instants uses another navigation message than that at the first.
fn has_changed(
    products: &Products,
    satellite: SatelliteId,
    a: GpsTime,
    b: GpsTime,
    state: &SatelliteState,
) -> bool {
    if state.clock_reference == ClockReference::IonosphereFree {
        return true;
    }
    if satellite.constellation == Constellation::Glonass {
        return products.glonass_ephemeris(satellite, a) != products.glonass_ephemeris(satellite, b);
    }
    // Group delays may be NaN, which never compares equal.
    let issue =
        |time| products.ephemeris(satellite, time).map(|e| (e.toe, e.toc, e.issue_of_data, e.message));
    issue(a) != issue(b)
}

/// State at one instant by the navigation message in force at another.
fn state_by(
    products: &Products,
    satellite: SatelliteId,
    chosen: GpsTime,
    at: GpsTime,
) -> Option<SatelliteState> {
    if satellite.constellation == Constellation::Glonass {
        return products.glonass_ephemeris(satellite, chosen).map(|message| message.state(at));
    }
    products.ephemeris(satellite, chosen).map(|message| message.state(at))
}
