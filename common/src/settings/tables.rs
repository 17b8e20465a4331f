//! All settings tables with their keys.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::table::{tables, words};
use crate::atmosphere::TroposphereMapping;
use crate::integrity::Method as ExclusionMethod;
use crate::measurement::Ionosphere;
use crate::orbit::BroadcastAccuracy;

/// Settings with a name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Preset {
    /// Our values, tuned on real drives.
    #[default]
    Default,
    /// The values printed in Peng 2023, section 4.
    Peng2023,
    /// The same with Doppler.
    #[serde(rename = "peng2023-doppler")]
    Peng2023Doppler,
    /// RAIM of Cappello 2023: weights by elevation and URA, 15° and 20 dB-Hz, no exclusion of groups; else as by default.
    Cappello2023,
}

/// The form of a variance model; see [`crate::measurement::VarianceModel`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum VarianceForm {
    /// floor + noise·10^(−C/N0/10).
    Cn0,
    /// ura² + (zenith/sin e)².
    Elevation,
    /// floor + noise·10^(−C/N0/10) + (zenith/sin e)².
    Sum,
    /// (floor + noise·10^(−C/N0/10))/sin² e.
    Product,
}

/// Method for several constraints; see [`crate::constraint::Method`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Combination {
    /// Each constraint given all others, until convergence.
    ExpectationPropagation,
    /// One by one in the given order.
    Sequential,
}

/// Model of a distance constraint; see [`crate::constraint::DistanceModel`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DistanceForm {
    /// Three axes, and equally likely anywhere in the ball.
    Ball,
    /// Three axes.
    Box,
    /// The line between the phones.
    Radial,
}

/// How phones are carried; see [`crate::filter::Motion`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Carrier {
    /// In a road vehicle.
    Road,
    /// On foot, on a bicycle, in a lift.
    Walk,
    /// On an aircraft or a drone.
    Air,
    /// Standing still.
    Static,
    /// As the keys of the motion model say.
    Own,
}

/// Treatment of an interval that the state contradicts; see [`crate::constraint::Enlargement`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Widening {
    /// The interval is kept.
    Fixed,
    /// The interval is widened as by Algorithm 1 of Peng 2023.
    Peng,
}

words! {
    Preset {
        "default" => Self::Default, "peng2023" => Self::Peng2023, "peng2023-doppler" => Self::Peng2023Doppler,
        "cappello2023" => Self::Cappello2023,
    }
    Ionosphere { "model" => Self::Model, "pair" => Self::Pair, "pair-only" => Self::PairOnly }
    ExclusionMethod {
        "forward-backward" => Self::ForwardBackward, "subset" => Self::Subset, "none" => Self::None,
    }
    BroadcastAccuracy { "usual" => Self::Usual, "stated" => Self::Stated }
    TroposphereMapping { "niell" => Self::Niell, "cosecant" => Self::Cosecant }
    VarianceForm {
        "cn0" => Self::Cn0, "elevation" => Self::Elevation, "sum" => Self::Sum, "product" => Self::Product,
    }
    Combination {
        "expectation-propagation" => Self::ExpectationPropagation, "sequential" => Self::Sequential,
    }
    DistanceForm { "ball" => Self::Ball, "box" => Self::Box, "radial" => Self::Radial }
    Carrier {
        "road" => Self::Road, "walk" => Self::Walk, "air" => Self::Air, "static" => Self::Static, "own" => Self::Own,
    }
    Widening { "fixed" => Self::Fixed, "peng" => Self::Peng }
}

tables! {
    /// All settings.
    Settings by SettingsKeys {
        table /// From raw to corrected observations.
        correction: CorrectionSettings, CorrectionKeys;
        table /// How uncertain measurements are.
        stochastic: StochasticSettings, StochasticKeys;
        table /// The integrity tests of a phone's epochs.
        integrity: IntegritySettings, IntegrityKeys;
        table /// The phone's own filter and the joint one.
        filter: FilterSettings, FilterKeys;
        table /// How constraints act.
        constraints: ConstraintSettings, ConstraintKeys;
        table /// How epochs of different phones are brought together.
        alignment: AlignmentSettings, AlignmentKeys;
    }

    /// From raw to corrected observations.
    CorrectionSettings by CorrectionKeys {
        /// What is done about the ionosphere: every signal with a modelled delay; the ionosphere-free pair of satellites with two bands,
        /// the others modelled; or pairs and nothing else.
        ionosphere: Ionosphere = ["word", ()];
        /// Standard deviation that stands for a group delay which no product knows.
        unknown_group_delay_sigma_m: f64 = ["m", 0.0..=1e3];
        /// How large filters take the errors of broadcast orbits and clocks to be: what they usually are, or what the messages state, on which
        /// the solutions of single epochs and their tests rest.
        broadcast_accuracy: BroadcastAccuracy = ["word", ()];
        /// Standard deviation of the clocks and group delays of BeiDou satellites together, on precise clocks; half on broadcast ones.
        beidou_bias_sigma_m: f64 = ["m", 0.0..=1e3];
        /// Whether the variation of BeiDou-2's B1I pseudoranges with elevation is corrected (Wanninger and Beer 2015).
        beidou2_code_bias: bool = ["switch", ()];
        /// Standard deviation of the biases between the frequency channels of GLONASS.
        glonass_bias_sigma_m: f64 = ["m", 0.0..=1e3];
        /// Ratio of the tropospheric delay at an elevation to that at the zenith: the functions of Niell 1996, or 1/sin(elevation), which is
        /// 1 m too large at 7.5 degrees.
        troposphere_mapping: TroposphereMapping = ["word", ()];
        /// Relative humidity of the standard atmosphere: 0 is dry, 1 is saturated.
        relative_humidity: f64 = ["no unit", 0.0..=1.0];
        /// Elevation mask of satellites whose tropospheric delay the recording itself states; the mask of all others is elevation_deg in
        /// the table masks.
        stated_elevation_deg: f64 = ["degrees", 0.0..=90.0];
        /// Age of a base station's correction up to which it is used.
        maximum_age_s: f64 = ["s", 0.0..=3600.0];
        table /// What a base station's corrections are worth.
        base: BaseSettings, BaseKeys;
        beside /// Recordings of base stations and of ephemerides.
        sources: Vec<PathBuf>;
        beside /// The base's antenna, ECEF, m.
        base_position_m: [f64; 3];
    }

    /// What a base station's corrections are worth.
    BaseSettings by BaseKeys {
        /// Growth of a correction's standard deviation with its age.
        age_sigma_mps: f64 = ["m/s", 0.0..=10.0];
        /// Growth of a correction's standard deviation with the distance between base and phone, for a satellite at the zenith; more by
        /// 1/sin(elevation) near the horizon.
        distance_sigma_mpm: f64 = ["m/m", 0.0..=1e-2];
        /// Standard deviation that is added where the base has another code on the same band.
        other_code_sigma_m: f64 = ["m", 0.0..=1e3];
        /// Whether signals without a correction stay in use beside others that have one.
        keep_uncorrected: bool = ["switch", ()];
        /// Standard deviation that is added to signals without a correction that stay in use.
        uncorrected_sigma_m: f64 = ["m", 0.0..=1e3];
        /// A base's signal that is more robust standard deviations than this from the others of its group is refused; inf refuses none.
        outlier_sigmas: f64 = ["standard deviations", 1.0..=f64::INFINITY];
        table /// Variance of the base's pseudoranges.
        code: CodeVariance, CodeVarianceKeys;
    }

    /// How uncertain measurements are.
    StochasticSettings by StochasticKeys {
        table /// Variance of pseudoranges.
        code: CodeVariance, CodeVarianceKeys;
        table /// Variance of range rates.
        rate: RateVariance, RateVarianceKeys;
    }

    /// Variance of pseudoranges by C/N0 (dB-Hz) and elevation e.
    CodeVariance by CodeVarianceKeys {
        /// Form of the variance: cn0 is floor + noise·10^(-C/N0/10), elevation is ura² + (zenith/sin e)², sum is
        /// floor + noise·10^(-C/N0/10) + (zenith/sin e)², product is (floor + noise·10^(-C/N0/10))/sin² e.
        model: VarianceForm = ["word", ()];
        /// With the models cn0, sum and product: variance of a signal of any strength.
        floor_m2: Option<f64> = ["m²", 0.0..=1e6];
        /// With the models cn0, sum and product: factor of 10^(-C/N0/10).
        noise_m2: Option<f64> = ["m²", 0.0..=1e9];
        /// With the model elevation: standard deviation of orbit and clock.
        ura_m: Option<f64> = ["m", 0.0..=1e3];
        /// With the models elevation and sum: standard deviation at the zenith.
        zenith_m: Option<f64> = ["m", 0.0..=1e3];
    }

    /// Variance of range rates by C/N0 (dB-Hz) and elevation e.
    RateVariance by RateVarianceKeys {
        /// Form of the variance: cn0 is floor + noise·10^(-C/N0/10), elevation is ura² + (zenith/sin e)², sum is
        /// floor + noise·10^(-C/N0/10) + (zenith/sin e)², product is (floor + noise·10^(-C/N0/10))/sin² e.
        model: VarianceForm = ["word", ()];
        /// With the models cn0, sum and product: variance of a signal of any strength.
        floor_m2ps2: Option<f64> = ["m²/s²", 0.0..=1e6];
        /// With the models cn0, sum and product: factor of 10^(-C/N0/10).
        noise_m2ps2: Option<f64> = ["m²/s²", 0.0..=1e9];
        /// With the model elevation: standard deviation of orbit and clock.
        ura_mps: Option<f64> = ["m/s", 0.0..=1e3];
        /// With the models elevation and sum: standard deviation at the zenith.
        zenith_mps: Option<f64> = ["m/s", 0.0..=1e3];
    }

    /// The integrity tests (RAIM) of a phone's epochs.
    IntegritySettings by IntegrityKeys {
        /// How faulty measurements are excluded: one after another by their residuals, and back where that was needless; the largest subset that
        /// passes, if there is one only; or not at all.
        method: ExclusionMethod = ["word", ()];
        /// Probability with which the global test fails although nothing is wrong.
        p_fa: f64 = ["probability", 1e-12..=0.5];
        /// Probability with which the local test of one measurement fails although nothing is wrong.
        local_false_alarm: f64 = ["probability", 1e-12..=0.5];
        /// Correlation of two residuals from which on neither is excluded, because it cannot be told which of the two is wrong.
        separability: f64 = ["no unit", 0.0..=1.0];
        /// Largest number of measurements that are excluded from one epoch.
        maximum_exclusions: u32 = ["measurements", 0..=1000];
        /// With the method subset: largest number of subsets that are tried in one epoch.
        maximum_subsets: u32 = ["subsets", 1..=100_000];
        /// Whether a constellation or clock group with absurd residuals is excluded as a whole where single exclusions fail.
        exclude_groups: bool = ["switch", ()];
        /// Horizontal protection level up to which a position is called reliable; inf: any.
        alarm_limit_horizontal_m: f64 = ["m", 0.1..=f64::INFINITY];
        /// Vertical protection level up to which a position is called reliable; inf: any.
        alarm_limit_vertical_m: f64 = ["m", 0.1..=f64::INFINITY];
        /// Probability, at an epoch, that a position errs by more than its protection levels: half of it vertically, half horizontally.
        misleading_probability: f64 = ["probability", 1e-12..=0.5];
        /// Prior probability that the signals of one satellite are faulty at an epoch.
        satellite_fault_probability: f64 = ["probability", 1e-12..=0.5];
        /// Prior probability that a whole constellation is faulty at an epoch.
        constellation_fault_probability: f64 = ["probability", 1e-12..=0.5];
        /// Probability of false alarm of the solution separation tests of the protection levels.
        separation_false_alarm: f64 = ["probability", 1e-12..=0.5];
        /// Probability of missed detection of the protection levels by the largest slope.
        missed_detection: f64 = ["probability", 1e-12..=0.5];
        /// Largest error of a pseudorange that is neither random nor a fault.
        nominal_bias_m: f64 = ["m", 0.0..=100.0];
        /// For the protection levels: error of the modelled ionospheric delay, as a share of it.
        ionosphere_share: f64 = ["no unit", 0.0..=10.0];
        /// The hub leaves out a satellite whose residuals, averaged over all phones and a minute, exceed this; inf leaves none out.
        biased_satellite_sigmas: f64 = ["standard deviations", 1.0..=f64::INFINITY];
        /// Whether the hub lets the phones check each other: one that contradicts the others through the constraints between them is isolated.
        cooperative: bool = ["switch", ()];
        /// PDOP up to which a position is called reliable.
        maximum_pdop: f64 = ["no unit", 1.0..=f64::INFINITY];
        /// HDOP up to which a position is called reliable.
        maximum_hdop: f64 = ["no unit", 1.0..=f64::INFINITY];
        /// VDOP up to which a position is called reliable.
        maximum_vdop: f64 = ["no unit", 1.0..=f64::INFINITY];
        beside /// The same as preset in the table filter, where that is not given.
        preset: Preset;
    }

    /// How phones move, and how measurements are weighed; of the phone's own filter and of the joint one.
    FilterSettings by FilterKeys {
        /// How the phones are carried: in a road vehicle; on foot, on a bicycle or in a lift; on an aircraft or a drone; standing still.
        /// It decides the four keys of the motion model that a file does not give; own leaves them as they are.
        motion: Carrier = ["word", ()];
        /// Spectral density of the horizontal jerk.
        horizontal_jerk_m2ps5: f64 = ["m²/s⁵", 0.0..=1e6];
        /// Spectral density of the vertical jerk.
        vertical_jerk_m2ps5: f64 = ["m²/s⁵", 0.0..=1e6];
        /// Time constant with which an acceleration decays; inf keeps it constant.
        acceleration_time_s: f64 = ["s", 0.1..=f64::INFINITY];
        /// Standard deviation of each component of a phone's velocity at its start, without Doppler.
        start_speed_mps: f64 = ["m/s", 0.001..=1000.0];
        /// Share of the variance of a pseudorange that is correlated in time, as multipath is. A filter that takes it for white noise trusts
        /// it too much.
        code_correlated_share: f64 = ["no unit", 0.0..=1.0];
        /// The same share for epochs that changes of range by carrier phase tie to the one before.
        code_tied_share: f64 = ["no unit", 0.0..=1.0];
        /// Time constant of that correlation.
        code_correlation_time_s: f64 = ["s", 0.1..=3600.0];
        /// Factor on the variance of a satellite's orbit, clock and group delay in the weights: they last, and no mean over epochs removes
        /// them.
        lasting_weight: f64 = ["no unit", 0.0..=100.0];
        /// The same factor for epochs that changes of range by carrier phase tie to the one before.
        tied_lasting_weight: f64 = ["no unit", 0.0..=100.0];
        /// Factor on the standard deviation of range rates.
        rate_sigma_scale: f64 = ["no unit", 0.01..=100.0];
        /// Innovation up to which a measurement has its full weight; inf never weighs one down.
        robust_keep_sigmas: f64 = ["standard deviations", 0.1..=f64::INFINITY];
        /// Innovation from which on a measurement has no weight; not below robust_keep_sigmas.
        robust_reject_sigmas: f64 = ["standard deviations", 0.1..=f64::INFINITY];
        /// How many times as large an innovation counts where a pseudorange of a very weak signal is longer than predicted, as reflections make
        /// it; 1 treats long and short ones alike.
        late_code_factor: f64 = ["no unit", 0.1..=100.0];
        /// C/N0 at which half of what exceeds 1 in that factor applies; it fades over 3 dB.
        late_code_cn0_dbhz: f64 = ["dB-Hz", 0.0..=60.0];
        /// Whether the filter uses Doppler.
        doppler: bool = ["switch", ()];
        /// Whether changes of range by carrier phase are used.
        carrier_phase: bool = ["switch", ()];
        /// Whether a phone that stands still by its Doppler gets a velocity of zero, where phases do not say more.
        standing_still: bool = ["switch", ()];
        /// Whether the filter takes only the observations that RAIM kept; if not, it judges all by their innovations.
        raim_selection: bool = ["switch", ()];
        /// Spectral density of the random walk of the biases between a receiver's constellations and bands; inf gives each a clock of its own
        /// at every epoch.
        bias_walk_m2ps: f64 = ["m²/s", 0.0..=f64::INFINITY];
        /// For the stated covariance: smallest standard deviation of a satellite's orbit, clock and group delay together.
        shared_satellite_sigma_m: f64 = ["m", 0.0..=100.0];
        /// For the stated covariance: share of the standard deviation that products state for them, where that is larger.
        shared_satellite_share: f64 = ["no unit", 0.0..=10.0];
        /// For the stated covariance: error of the modelled ionospheric delay at the zenith, as a share of it.
        shared_ionosphere_share: f64 = ["no unit", 0.0..=10.0];
        /// For the stated covariance: change of that share towards a pierce point 0.05 rad (320 km) away, of what exceeds the night's delay.
        shared_gradient_share: f64 = ["no unit", 0.0..=10.0];
        /// Time constant of these errors, which all phones have alike.
        shared_time_constant_s: f64 = ["s", 1.0..=1e6];
        /// A phone that is silent for longer than this, and for 3.5 of its own intervals, begins anew in the filter.
        maximum_gap_s: f64 = ["s", 0.1..=3600.0];
        beside /// The values that all keys have which a file leaves out.
        preset: Preset;
    }

    /// How constraints act; the constraints themselves are the tables `[[constraint]]`.
    ConstraintSettings by ConstraintKeys {
        /// How several constraints are brought into one state: each given all others until nothing changes, or one by one in their order.
        method: Combination = ["word", ()];
        /// Largest number of sweeps over the constraints in one epoch.
        maximum_sweeps: u32 = ["sweeps", 1..=1000];
        /// With the method expectation-propagation: part of a constraint's former effect that is kept at its refresh.
        damping: Option<f64> = ["no unit", 0.0..=0.99];
        /// What becomes of an interval that the state contradicts: it stays, or it is widened as by Algorithm 1 of Peng 2023.
        enlargement: Widening = ["word", ()];
        /// With the enlargement peng: an interval is widened while its probability is below 1 less this.
        enlargement_confidence: Option<f64> = ["probability", 0.001..=0.999];
        /// With the enlargement peng: factor by which an interval is widened each time.
        enlargement_factor: Option<f64> = ["no unit", 1.01..=100.0];
        /// With the enlargement peng: largest number of times that an interval is widened.
        maximum_enlargements: Option<u32> = ["times", 1..=1000];
        /// Whether a constraint acts on a state whose mean is within its bounds already, for its tails are not.
        act_when_inside: bool = ["switch", ()];
        /// What a distance bounds: the difference of two phones as a vector in a ball, on three axes, or only on the line between them.
        distance_model: DistanceForm = ["word", ()];
        /// Time over which velocity constraints look ahead with the acceleration; 0 constrains the velocity itself.
        horizon_s: f64 = ["s", 0.0..=60.0];
        /// Horizontal speed from which on a heading constraint applies.
        heading_minimum_speed_mps: f64 = ["m/s", 0.0..=100.0];
        /// The same in standard deviations of the horizontal velocity; both must be reached.
        heading_minimum_sigmas: f64 = ["standard deviations", 0.0..=100.0];
        /// A constraint that the state contradicts by more than this is not applied but reported; inf applies every constraint.
        contradiction_sigmas: f64 = ["standard deviations", 0.1..=f64::INFINITY];
        /// Largest number of times that a distance is linearised anew at one refresh.
        maximum_relinearisations: u32 = ["times", 1..=100];
        /// Whether one joint filter goes on with the constrained state, as in Peng 2023; if not, every phone has a filter without constraints,
        /// and constraints act on the states that are given out.
        feedback: bool = ["switch", ()];
    }

    /// How epochs of different phones are brought together.
    AlignmentSettings by AlignmentKeys {
        /// Largest difference in time of the phones' epochs in a common epoch; without this key half of the longer interval of each two phones, as
        /// measured from their epochs.
        tolerance_s: Option<f64> = ["s", 0.001..=60.0];
        /// Epochs of two phones this close are simultaneous, and two epochs of one phone must be further apart; not above tolerance_s. At
        /// intervals shorter than four times this it is a quarter of the interval.
        simultaneous_s: f64 = ["s", 0.0..=1.0];
        /// An epoch further ahead of the phone's previous one must be confirmed by the next one, unless the steps are regular.
        maximum_step_s: f64 = ["s", 1.0..=86400.0];
        /// Live: longest time that an epoch waits for other phones from its arrival on; the option --latency of cofix-hub run overrides it.
        maximum_wait_s: f64 = ["s", 0.1..=3600.0];
    }
}
