//! Conversion of settings to the options of the parts, and back for the presets. Every option is named, so that an option without a setting
//! does not compile.

use std::time::Duration;

use super::tables::{
    AlignmentSettings, BaseSettings, Carrier, CodeVariance, Combination, ConstraintSettings,
    CorrectionSettings, DistanceForm, FilterSettings, IntegritySettings, Preset, RateVariance, Settings,
    StochasticSettings, VarianceForm, Widening,
};
use crate::constraint::{ConstraintOptions, DistanceModel, Enlargement, HeadingGate, Method};
use crate::filter::{CodeNoise, FilterOptions, LateCodes, Motion, ProcessNoise, RobustWeights, SharedErrors};
use crate::fusion::align::AlignOptions;
use crate::fusion::engine::EngineOptions;
use crate::integrity::{AlarmLimits, DopLimits, ProtectionOptions, RaimOptions};
use crate::measurement::{
    CorrectionOptions, DifferentialOptions, StochasticModel, Uncorrected, VarianceModel,
};
use crate::pipeline::PipelineOptions;
use crate::statistics::{ChiSquareThresholds, DetectableNoncentrality};

/// Standard deviation of uncorrected signals in the settings if they are dropped, m.
const UNCORRECTED_SIGMA_M: f64 = 5.0;

impl Default for Settings {
    fn default() -> Self {
        Self::of(&PipelineOptions::default(), &EngineOptions::default())
    }
}

impl Settings {
    /// Values printed in Peng 2023, section 4; integrity, alignment and corrections as by default.
    pub fn peng2023() -> Self {
        Self::of(&PipelineOptions::peng2023(), &EngineOptions::peng2023())
    }

    /// The settings of a preset.
    pub fn preset(preset: Preset) -> Self {
        match preset {
            Preset::Default => Self::default(),
            Preset::Peng2023 => Self::peng2023(),
            Preset::Cappello2023 => Self::of(&PipelineOptions::cappello2023(), &EngineOptions::default()),
            Preset::Peng2023Doppler => {
                let peng = Self::peng2023();
                Self { filter: FilterSettings { doppler: true, ..peng.filter }, ..peng }
            }
        }
    }

    /// Options of a phone's pipeline. Masks, and the use of a recording's own corrections, are set elsewhere.
    pub fn pipeline(&self) -> PipelineOptions {
        PipelineOptions {
            correction: self.correction_options(),
            raim: self.integrity.options(),
            filter: self.filter.options(),
            recorded_corrections: false,
        }
    }

    /// Options of the joint estimator.
    pub fn engine(&self) -> EngineOptions {
        EngineOptions {
            filter: self.filter.options(),
            constraints: self.constraints.options(),
            feedback: self.constraints.feedback,
            biased_sigmas: self.integrity.biased_satellite_sigmas,
            integrity: self.integrity.options(),
            cooperative: self.integrity.cooperative,
        }
    }

    /// Options of base station corrections.
    pub fn differential(&self) -> DifferentialOptions {
        let CorrectionSettings { maximum_age_s, base, .. } = self.correction;
        DifferentialOptions {
            maximum_age_s,
            base_code: base.code.model(),
            age_sigma_mps: base.age_sigma_mps,
            distance_sigma: base.distance_sigma_mpm,
            other_code_sigma_m: base.other_code_sigma_m,
            uncorrected: if base.keep_uncorrected {
                Uncorrected::Kept { sigma_m: base.uncorrected_sigma_m }
            } else {
                Uncorrected::Dropped
            },
            outlier_sigmas: base.outlier_sigmas,
        }
    }

    /// Options of the alignment of epochs.
    pub fn align(&self) -> AlignOptions {
        let AlignmentSettings { tolerance_s, simultaneous_s, maximum_step_s, maximum_wait_s } =
            self.alignment;
        // Times beyond the range of a duration are refused by `Settings::check`.
        let maximum_wait = Duration::try_from_secs_f64(maximum_wait_s).unwrap_or(Duration::MAX);
        AlignOptions { tolerance_s, simultaneous_s, maximum_step_s, maximum_wait }
    }

    fn correction_options(&self) -> CorrectionOptions {
        let masks = CorrectionOptions::default();
        let correction = &self.correction;
        CorrectionOptions {
            elevation_mask_rad: masks.elevation_mask_rad,
            stated_elevation_mask_rad: correction.stated_elevation_deg.to_radians(),
            ionosphere: correction.ionosphere,
            minimum_cn0_dbhz: masks.minimum_cn0_dbhz,
            exclude: masks.exclude,
            stochastic: StochasticModel {
                code: self.stochastic.code.model(),
                rate: self.stochastic.rate.model(),
            },
            unknown_group_delay_sigma_m: correction.unknown_group_delay_sigma_m,
            broadcast_accuracy: correction.broadcast_accuracy,
            beidou_bias_sigma_m: correction.beidou_bias_sigma_m,
            beidou2_code_bias: correction.beidou2_code_bias,
            glonass_bias_sigma_m: correction.glonass_bias_sigma_m,
            troposphere_mapping: correction.troposphere_mapping,
            relative_humidity: correction.relative_humidity,
        }
    }

    fn of(pipeline: &PipelineOptions, engine: &EngineOptions) -> Self {
        let stochastic = &pipeline.correction.stochastic;
        Self {
            correction: CorrectionSettings::of(&pipeline.correction, &DifferentialOptions::default()),
            stochastic: StochasticSettings {
                code: CodeVariance::of(stochastic.code),
                rate: RateVariance::of(stochastic.rate),
            },
            integrity: IntegritySettings::of(&pipeline.raim, engine),
            filter: FilterSettings::of(&engine.filter),
            constraints: ConstraintSettings::of(&engine.constraints, engine.feedback),
            alignment: AlignmentSettings::of(AlignOptions::default()),
        }
    }
}

impl Preset {
    /// Corrections with the masks of the preset.
    pub fn masked(self, correction: CorrectionOptions) -> CorrectionOptions {
        let of_preset = match self {
            Self::Default => CorrectionOptions::default(),
            Self::Peng2023 | Self::Peng2023Doppler => PipelineOptions::peng2023().correction,
            Self::Cappello2023 => PipelineOptions::cappello2023().correction,
        };
        let CorrectionOptions { elevation_mask_rad, minimum_cn0_dbhz, .. } = of_preset;
        CorrectionOptions { elevation_mask_rad, minimum_cn0_dbhz, ..correction }
    }
}

impl CorrectionSettings {
    fn of(options: &CorrectionOptions, differential: &DifferentialOptions) -> Self {
        Self {
            ionosphere: options.ionosphere,
            unknown_group_delay_sigma_m: options.unknown_group_delay_sigma_m,
            broadcast_accuracy: options.broadcast_accuracy,
            beidou_bias_sigma_m: options.beidou_bias_sigma_m,
            beidou2_code_bias: options.beidou2_code_bias,
            glonass_bias_sigma_m: options.glonass_bias_sigma_m,
            troposphere_mapping: options.troposphere_mapping,
            relative_humidity: options.relative_humidity,
            stated_elevation_deg: options.stated_elevation_mask_rad.to_degrees(),
            maximum_age_s: differential.maximum_age_s,
            base: BaseSettings::of(differential),
        }
    }
}

impl BaseSettings {
    const fn of(options: &DifferentialOptions) -> Self {
        let (keep_uncorrected, uncorrected_sigma_m) = match options.uncorrected {
            Uncorrected::Kept { sigma_m } => (true, sigma_m),
            Uncorrected::Dropped => (false, UNCORRECTED_SIGMA_M),
        };
        Self {
            age_sigma_mps: options.age_sigma_mps,
            distance_sigma_mpm: options.distance_sigma,
            other_code_sigma_m: options.other_code_sigma_m,
            keep_uncorrected,
            uncorrected_sigma_m,
            outlier_sigmas: options.outlier_sigmas,
            code: CodeVariance::of(options.base_code),
        }
    }
}

/// Form, floor, noise, ura and zenith of a model.
const fn terms(model: VarianceModel) -> (VarianceForm, [Option<f64>; 4]) {
    match model {
        VarianceModel::Cn0 { a, b } => (VarianceForm::Cn0, [Some(a), Some(b), None, None]),
        VarianceModel::Elevation { ura, zenith } => {
            (VarianceForm::Elevation, [None, None, Some(ura), Some(zenith)])
        }
        VarianceModel::Sum { a, b, zenith } => (VarianceForm::Sum, [Some(a), Some(b), None, Some(zenith)]),
        VarianceModel::Product { a, b } => (VarianceForm::Product, [Some(a), Some(b), None, None]),
    }
}

/// The inverse of [`terms`]. A missing value counts as 0; `Settings::check` refuses it.
fn model(form: VarianceForm, terms: [Option<f64>; 4]) -> VarianceModel {
    let [a, b, ura, zenith] = terms.map(Option::unwrap_or_default);
    match form {
        VarianceForm::Cn0 => VarianceModel::Cn0 { a, b },
        VarianceForm::Elevation => VarianceModel::Elevation { ura, zenith },
        VarianceForm::Sum => VarianceModel::Sum { a, b, zenith },
        VarianceForm::Product => VarianceModel::Product { a, b },
    }
}

impl CodeVariance {
    const fn of(model: VarianceModel) -> Self {
        let (model, [floor_m2, noise_m2, ura_m, zenith_m]) = terms(model);
        Self { model, floor_m2, noise_m2, ura_m, zenith_m }
    }

    fn model(&self) -> VarianceModel {
        model(self.model, [self.floor_m2, self.noise_m2, self.ura_m, self.zenith_m])
    }
}

impl RateVariance {
    const fn of(model: VarianceModel) -> Self {
        let (model, [floor_m2ps2, noise_m2ps2, ura_mps, zenith_mps]) = terms(model);
        Self { model, floor_m2ps2, noise_m2ps2, ura_mps, zenith_mps }
    }

    fn model(&self) -> VarianceModel {
        model(self.model, [self.floor_m2ps2, self.noise_m2ps2, self.ura_mps, self.zenith_mps])
    }
}

impl IntegritySettings {
    fn of(options: &RaimOptions, engine: &EngineOptions) -> Self {
        let DopLimits { pdop, hdop, vdop } = options.dop_limits;
        Self {
            method: options.method,
            p_fa: options.global.false_alarm_probability(),
            local_false_alarm: options.local_false_alarm,
            separability: options.separability,
            maximum_exclusions: u32::try_from(options.maximum_exclusions).unwrap_or(u32::MAX),
            maximum_subsets: u32::try_from(options.maximum_subsets).unwrap_or(u32::MAX),
            exclude_groups: options.exclude_groups,
            alarm_limit_horizontal_m: options.alarm_limits.horizontal_m,
            alarm_limit_vertical_m: options.alarm_limits.vertical_m,
            misleading_probability: options.protection.misleading,
            satellite_fault_probability: options.protection.satellite_fault,
            constellation_fault_probability: options.protection.constellation_fault,
            separation_false_alarm: options.protection.false_alarm,
            missed_detection: options.protection.detectable.missed_detection(),
            nominal_bias_m: options.protection.nominal_bias_m,
            ionosphere_share: options.protection.ionosphere_share,
            biased_satellite_sigmas: engine.biased_sigmas,
            cooperative: engine.cooperative,
            maximum_pdop: pdop,
            maximum_hdop: hdop,
            maximum_vdop: vdop,
        }
    }

    fn options(&self) -> RaimOptions {
        RaimOptions {
            method: self.method,
            global: ChiSquareThresholds::new(self.p_fa),
            local_false_alarm: self.local_false_alarm,
            separability: self.separability,
            maximum_exclusions: self.maximum_exclusions as usize,
            maximum_subsets: self.maximum_subsets as usize,
            exclude_groups: self.exclude_groups,
            alarm_limits: AlarmLimits {
                horizontal_m: self.alarm_limit_horizontal_m,
                vertical_m: self.alarm_limit_vertical_m,
            },
            protection: ProtectionOptions {
                misleading: self.misleading_probability,
                satellite_fault: self.satellite_fault_probability,
                constellation_fault: self.constellation_fault_probability,
                false_alarm: self.separation_false_alarm,
                nominal_bias_m: self.nominal_bias_m,
                ionosphere_share: self.ionosphere_share,
                detectable: DetectableNoncentrality::new(self.p_fa, self.missed_detection),
            },
            dop_limits: DopLimits {
                pdop: self.maximum_pdop,
                hdop: self.maximum_hdop,
                vdop: self.maximum_vdop,
            },
        }
    }
}

impl FilterSettings {
    fn of(options: &FilterOptions) -> Self {
        let ProcessNoise { horizontal_m2ps5, vertical_m2ps5, acceleration_time_s } = options.process;
        let RobustWeights { keep, reject } = options.robust;
        let shared = options.shared;
        Self {
            motion: Carrier::of(options.process),
            horizontal_jerk_m2ps5: horizontal_m2ps5,
            vertical_jerk_m2ps5: vertical_m2ps5,
            acceleration_time_s,
            start_speed_mps: options.start_speed_mps,
            code_correlated_share: options.code_noise.correlated_share,
            code_tied_share: options.code_noise.tied_share,
            code_correlation_time_s: options.code_noise.correlation_time_s,
            lasting_weight: options.lasting_weight,
            tied_lasting_weight: options.tied_lasting_weight,
            rate_sigma_scale: options.rate_sigma_scale,
            robust_keep_sigmas: keep,
            robust_reject_sigmas: reject,
            late_code_factor: options.late_codes.factor,
            late_code_cn0_dbhz: options.late_codes.cn0_dbhz,
            doppler: options.use_rates,
            carrier_phase: options.use_changes,
            standing_still: options.use_standing,
            raim_selection: options.only_used,
            bias_walk_m2ps: options.bias_walk_m2ps,
            shared_satellite_sigma_m: shared.satellite_sigma_m,
            shared_satellite_share: shared.satellite_share,
            shared_ionosphere_share: shared.ionosphere_share,
            shared_gradient_share: shared.gradient_share,
            shared_time_constant_s: shared.time_constant_s,
            maximum_gap_s: options.maximum_gap_s,
        }
    }

    const fn options(&self) -> FilterOptions {
        FilterOptions {
            process: ProcessNoise {
                horizontal_m2ps5: self.horizontal_jerk_m2ps5,
                vertical_m2ps5: self.vertical_jerk_m2ps5,
                acceleration_time_s: self.acceleration_time_s,
            },
            start_speed_mps: self.start_speed_mps,
            code_noise: CodeNoise {
                correlated_share: self.code_correlated_share,
                tied_share: self.code_tied_share,
                correlation_time_s: self.code_correlation_time_s,
            },
            lasting_weight: self.lasting_weight,
            tied_lasting_weight: self.tied_lasting_weight,
            rate_sigma_scale: self.rate_sigma_scale,
            robust: RobustWeights { keep: self.robust_keep_sigmas, reject: self.robust_reject_sigmas },
            late_codes: LateCodes { factor: self.late_code_factor, cn0_dbhz: self.late_code_cn0_dbhz },
            use_rates: self.doppler,
            use_changes: self.carrier_phase,
            use_standing: self.standing_still,
            only_used: self.raim_selection,
            bias_walk_m2ps: self.bias_walk_m2ps,
            shared: SharedErrors {
                satellite_sigma_m: self.shared_satellite_sigma_m,
                satellite_share: self.shared_satellite_share,
                ionosphere_share: self.shared_ionosphere_share,
                gradient_share: self.shared_gradient_share,
                time_constant_s: self.shared_time_constant_s,
            },
            maximum_gap_s: self.maximum_gap_s,
        }
    }
}

impl Carrier {
    /// The motion of this name; `None` for values of one's own.
    pub(super) const fn motion(self) -> Option<Motion> {
        match self {
            Self::Road => Some(Motion::Road),
            Self::Walk => Some(Motion::Walk),
            Self::Air => Some(Motion::Air),
            Self::Static => Some(Motion::Static),
            Self::Own => None,
        }
    }

    fn of(process: ProcessNoise) -> Self {
        let named = [Self::Road, Self::Walk, Self::Air, Self::Static];
        let is_it = |carrier: &Self| carrier.motion().is_some_and(|motion| motion.process() == process);
        named.into_iter().find(is_it).unwrap_or(Self::Own)
    }
}

impl ConstraintSettings {
    const fn of(options: &ConstraintOptions, feedback: bool) -> Self {
        let (method, maximum_sweeps, damping) = match options.method {
            Method::Sequential { max_sweeps } => (Combination::Sequential, max_sweeps, None),
            Method::ExpectationPropagation { max_sweeps, damping } => {
                (Combination::ExpectationPropagation, max_sweeps, Some(damping))
            }
        };
        let (enlargement, confidence, factor, times) = match options.enlargement {
            Enlargement::Fixed => (Widening::Fixed, None, None, None),
            Enlargement::Peng { confidence, factor, max_iterations } => {
                (Widening::Peng, Some(confidence), Some(factor), Some(max_iterations))
            }
        };
        Self {
            method,
            maximum_sweeps,
            damping,
            enlargement,
            enlargement_confidence: confidence,
            enlargement_factor: factor,
            maximum_enlargements: times,
            act_when_inside: options.act_when_inside,
            distance_model: match options.distance_model {
                DistanceModel::Radial => DistanceForm::Radial,
                DistanceModel::Box => DistanceForm::Box,
                DistanceModel::Ball => DistanceForm::Ball,
            },
            horizon_s: options.horizon_s,
            heading_minimum_speed_mps: options.heading_gate.minimum_speed_mps,
            heading_minimum_sigmas: options.heading_gate.minimum_sigmas,
            contradiction_sigmas: options.contradiction_sigmas,
            maximum_relinearisations: options.max_relinearisations,
            feedback,
        }
    }

    fn options(&self) -> ConstraintOptions {
        let max_sweeps = self.maximum_sweeps;
        ConstraintOptions {
            method: match self.method {
                Combination::Sequential => Method::Sequential { max_sweeps },
                Combination::ExpectationPropagation => {
                    Method::ExpectationPropagation { max_sweeps, damping: self.damping.unwrap_or_default() }
                }
            },
            enlargement: self.enlargement_options(),
            act_when_inside: self.act_when_inside,
            distance_model: match self.distance_model {
                DistanceForm::Radial => DistanceModel::Radial,
                DistanceForm::Box => DistanceModel::Box,
                DistanceForm::Ball => DistanceModel::Ball,
            },
            horizon_s: self.horizon_s,
            heading_gate: HeadingGate {
                minimum_speed_mps: self.heading_minimum_speed_mps,
                minimum_sigmas: self.heading_minimum_sigmas,
            },
            contradiction_sigmas: self.contradiction_sigmas,
            max_relinearisations: self.maximum_relinearisations,
        }
    }

    fn enlargement_options(&self) -> Enlargement {
        let values = (self.enlargement_confidence, self.enlargement_factor, self.maximum_enlargements);
        match (self.enlargement, values) {
            (Widening::Peng, (Some(confidence), Some(factor), Some(max_iterations))) => {
                Enlargement::Peng { confidence, factor, max_iterations }
            }
            // Incomplete settings are refused by `Settings::check`.
            (Widening::Peng | Widening::Fixed, _) => Enlargement::Fixed,
        }
    }
}

impl AlignmentSettings {
    const fn of(options: AlignOptions) -> Self {
        let AlignOptions { tolerance_s, simultaneous_s, maximum_step_s, maximum_wait } = options;
        Self { tolerance_s, simultaneous_s, maximum_step_s, maximum_wait_s: maximum_wait.as_secs_f64() }
    }
}
