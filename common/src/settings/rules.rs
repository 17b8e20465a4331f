//! Dependencies between the keys of a table.

use super::table::{Rules, Word};
use super::tables::{
    AlignmentSettings, BaseSettings, CodeVariance, Combination, ConstraintSettings, CorrectionSettings,
    FilterSettings, IntegritySettings, RateVariance, Settings, StochasticSettings, VarianceForm, Widening,
};

/// Values of Algorithm 1 for files that choose it without further keys.
const PENG_CONFIDENCE: f64 = 0.1;
const PENG_FACTOR: f64 = 1.5;
const PENG_ENLARGEMENTS: u32 = 50;

impl Rules for Settings {}
impl Rules for CorrectionSettings {}
impl Rules for BaseSettings {}
impl Rules for StochasticSettings {}
impl Rules for IntegritySettings {}

impl VarianceForm {
    /// Whether the form has floor, noise, ura and zenith.
    const fn terms(self) -> [bool; 4] {
        match self {
            Self::Cn0 | Self::Product => [true, true, false, false],
            Self::Elevation => [false, false, true, true],
            Self::Sum => [true, true, false, true],
        }
    }

    /// Drops the values that the form does not use, unless a file gave them.
    fn apply_choices(self, keys: [&str; 4], values: [&mut Option<f64>; 4], is_given: &dyn Fn(&str) -> bool) {
        for ((has, key), value) in self.terms().into_iter().zip(keys).zip(values) {
            if !has && !is_given(key) {
                *value = None;
            }
        }
    }

    fn contradiction(
        self,
        keys: [&'static str; 4],
        values: [Option<f64>; 4],
    ) -> Option<(&'static str, String)> {
        let model = format!("model = \"{}\"", self.word());
        let terms = || self.terms().into_iter().zip(keys).zip(values);
        if let Some(((has, key), _)) = terms().find(|((has, _), value)| *has != value.is_some()) {
            let reason = if has { "is missing; it belongs to" } else { "has no effect; leave it out with" };
            return Some((key, format!("{reason} {model}")));
        }
        let is_zero = terms().all(|(_, value)| value.is_none_or(|value| value == 0.0));
        is_zero.then(|| ("model", "makes a variance of 0; give one of its values above 0".to_owned()))
    }
}

const CODE: [&str; 4] = ["floor_m2", "noise_m2", "ura_m", "zenith_m"];
const RATE: [&str; 4] = ["floor_m2ps2", "noise_m2ps2", "ura_mps", "zenith_mps"];

impl Rules for CodeVariance {
    fn apply_choices(&mut self, is_given: &dyn Fn(&str) -> bool) {
        let Self { model, floor_m2, noise_m2, ura_m, zenith_m } = self;
        model.apply_choices(CODE, [floor_m2, noise_m2, ura_m, zenith_m], is_given);
    }

    fn contradiction(&self) -> Option<(&'static str, String)> {
        self.model.contradiction(CODE, [self.floor_m2, self.noise_m2, self.ura_m, self.zenith_m])
    }
}

impl Rules for RateVariance {
    fn apply_choices(&mut self, is_given: &dyn Fn(&str) -> bool) {
        let Self { model, floor_m2ps2, noise_m2ps2, ura_mps, zenith_mps } = self;
        model.apply_choices(RATE, [floor_m2ps2, noise_m2ps2, ura_mps, zenith_mps], is_given);
    }

    fn contradiction(&self) -> Option<(&'static str, String)> {
        let values = [self.floor_m2ps2, self.noise_m2ps2, self.ura_mps, self.zenith_mps];
        self.model.contradiction(RATE, values)
    }
}

impl Rules for FilterSettings {
    fn apply_choices(&mut self, is_given: &dyn Fn(&str) -> bool) {
        let Some(motion) = self.motion.motion().filter(|_| is_given("motion")) else { return };
        let process = motion.process();
        let values = [
            ("horizontal_jerk_m2ps5", &mut self.horizontal_jerk_m2ps5, process.horizontal_m2ps5),
            ("vertical_jerk_m2ps5", &mut self.vertical_jerk_m2ps5, process.vertical_m2ps5),
            ("acceleration_time_s", &mut self.acceleration_time_s, process.acceleration_time_s),
            ("start_speed_mps", &mut self.start_speed_mps, motion.speed_mps()),
        ];
        for (key, value, of_motion) in values {
            if !is_given(key) {
                *value = of_motion;
            }
        }
    }

    fn contradiction(&self) -> Option<(&'static str, String)> {
        let Self { robust_keep_sigmas: keep, robust_reject_sigmas: reject, .. } = self;
        (keep > reject).then(|| {
            ("robust_reject_sigmas", format!("is {reject}; it must not be below robust_keep_sigmas, {keep}"))
        })
    }
}

impl Rules for ConstraintSettings {
    fn apply_choices(&mut self, is_given: &dyn Fn(&str) -> bool) {
        match self.method {
            Combination::ExpectationPropagation => _ = self.damping.get_or_insert(0.0),
            Combination::Sequential if !is_given("damping") => self.damping = None,
            Combination::Sequential => {}
        }
        match self.enlargement {
            Widening::Peng => {
                self.enlargement_confidence.get_or_insert(PENG_CONFIDENCE);
                self.enlargement_factor.get_or_insert(PENG_FACTOR);
                self.maximum_enlargements.get_or_insert(PENG_ENLARGEMENTS);
            }
            Widening::Fixed => {
                let drop = |key| !is_given(key);
                self.enlargement_confidence.take_if(|_| drop("enlargement_confidence"));
                self.enlargement_factor.take_if(|_| drop("enlargement_factor"));
                self.maximum_enlargements.take_if(|_| drop("maximum_enlargements"));
            }
        }
    }

    fn contradiction(&self) -> Option<(&'static str, String)> {
        let is_peng = self.enlargement == Widening::Peng;
        let method = ("method", self.method.word());
        let enlargement = ("enlargement", self.enlargement.word());
        let keys = [
            ("damping", self.damping.is_some(), self.method == Combination::ExpectationPropagation, method),
            ("enlargement_confidence", self.enlargement_confidence.is_some(), is_peng, enlargement),
            ("enlargement_factor", self.enlargement_factor.is_some(), is_peng, enlargement),
            ("maximum_enlargements", self.maximum_enlargements.is_some(), is_peng, enlargement),
        ];
        let (key, _, belongs, (choice, word)) = keys.into_iter().find(|(_, is, belongs, _)| is != belongs)?;
        let reason = if belongs { "is missing; it belongs to" } else { "has no effect; leave it out with" };
        Some((key, format!("{reason} {choice} = \"{word}\"")))
    }
}

impl Rules for AlignmentSettings {
    fn contradiction(&self) -> Option<(&'static str, String)> {
        let Self { simultaneous_s, tolerance_s, .. } = *self;
        let tolerance_s = tolerance_s?;
        (simultaneous_s > tolerance_s).then(|| {
            (
                "simultaneous_s",
                format!("is {simultaneous_s}; it must not be above tolerance_s, {tolerance_s}"),
            )
        })
    }
}
