//! The two generations' columns, found by name.

use crate::formats::text::without_mark;

/// Positions of the columns in a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Columns {
    /// Which generation.
    pub(super) generation: Generation,
    /// Of the columns in [`Generation::required`], in that order.
    required: [usize; REQUIRED],
    /// Of the columns in [`Generation::optional`], in that order.
    optional: [Option<usize>; OPTIONAL],
}

const REQUIRED: usize = 17;
const OPTIONAL: usize = 11;

/// Generation of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Generation {
    /// `*_derived.csv` of 2021.
    Derived2021,
    /// `device_gnss.csv` since 2022.
    Device2022,
}

/// A required column; the discriminants are positions in [`Generation::required`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Required {
    /// 2021: epoch, ms of GPS time. 2022: arrival, ns of GPS time.
    Time,
    Constellation,
    Satellite,
    Signal,
    /// Transmission by the satellite's clock, ns of GPS time.
    Transmission,
    PositionX,
    PositionY,
    PositionZ,
    VelocityX,
    VelocityY,
    VelocityZ,
    ClockBias,
    ClockDrift,
    Pseudorange,
    ReceiverBias,
    Ionosphere,
    Troposphere,
}

/// A column that only one generation has, or that only raw observations need.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Optional {
    Cn0,
    PseudorangeRate,
    DeltaRange,
    DeltaRangeState,
    CarrierFrequency,
    CodeType,
    PseudorangeUncertainty,
    State,
    Multipath,
    BiasUncertainty,
    ReceivedTimeUncertainty,
}

impl Generation {
    const fn required(self) -> [&'static str; REQUIRED] {
        match self {
            Self::Derived2021 => [
                "millisSinceGpsEpoch",
                "constellationType",
                "svid",
                "signalType",
                "receivedSvTimeInGpsNanos",
                "xSatPosM",
                "ySatPosM",
                "zSatPosM",
                "xSatVelMps",
                "ySatVelMps",
                "zSatVelMps",
                "satClkBiasM",
                "satClkDriftMps",
                "rawPrM",
                "isrbM",
                "ionoDelayM",
                "tropoDelayM",
            ],
            Self::Device2022 => [
                "ArrivalTimeNanosSinceGpsEpoch",
                "ConstellationType",
                "Svid",
                "SignalType",
                "ReceivedSvTimeNanosSinceGpsEpoch",
                "SvPositionXEcefMeters",
                "SvPositionYEcefMeters",
                "SvPositionZEcefMeters",
                "SvVelocityXEcefMetersPerSecond",
                "SvVelocityYEcefMetersPerSecond",
                "SvVelocityZEcefMetersPerSecond",
                "SvClockBiasMeters",
                "SvClockDriftMetersPerSecond",
                "RawPseudorangeMeters",
                "IsrbMeters",
                "IonosphericDelayMeters",
                "TroposphericDelayMeters",
            ],
        }
    }

    const fn optional(self) -> [Option<&'static str>; OPTIONAL] {
        match self {
            Self::Derived2021 => {
                [None, None, None, None, None, None, Some("rawPrUncM"), None, None, None, None]
            }
            Self::Device2022 => [
                Some("Cn0DbHz"),
                Some("PseudorangeRateMetersPerSecond"),
                Some("AccumulatedDeltaRangeMeters"),
                Some("AccumulatedDeltaRangeState"),
                Some("CarrierFrequencyHz"),
                Some("CodeType"),
                Some("RawPseudorangeUncertaintyMeters"),
                Some("State"),
                Some("MultipathIndicator"),
                Some("BiasUncertaintyNanos"),
                Some("ReceivedSvTimeUncertaintyNanos"),
            ],
        }
    }
}

/// The fields of a line: cut at commas, without blanks, quotes and the carriage return around them. Bytes that are no text
/// give an empty field.
pub(super) fn fields(line: &[u8]) -> Vec<&str> {
    without_mark(line)
        .split(|byte| *byte == b',')
        .map(|field| std::str::from_utf8(field).unwrap_or_default().trim().trim_matches('"').trim())
        .collect()
}

impl Columns {
    /// From the header's fields.
    ///
    /// # Errors
    /// What is missing, in words.
    pub(super) fn find(header: &[&str]) -> Result<Self, String> {
        let header: Vec<&str> = header.iter().map(|name| name.trim_start_matches('\u{feff}')).collect();
        let missing = |generation: Generation| -> Vec<&'static str> {
            generation.required().into_iter().filter(|name| !header.contains(name)).collect()
        };
        let generation = [Generation::Derived2021, Generation::Device2022]
            .into_iter()
            .min_by_key(|generation| missing(*generation).len())
            .unwrap_or(Generation::Derived2021);
        let lacking = missing(generation);
        if lacking.len() == REQUIRED {
            return Err("not a challenge table: the first line names no column of *_derived.csv (2021) or \
                        device_gnss.csv (since 2022)"
                .to_owned());
        }
        if !lacking.is_empty() {
            let file = match generation {
                Generation::Derived2021 => "*_derived.csv of 2021",
                Generation::Device2022 => "device_gnss.csv since 2022",
            };
            return Err(format!("the header lacks columns of {file}: {}", lacking.join(", ")));
        }
        let position = |name: &str| header.iter().position(|found| *found == name);
        Ok(Self {
            generation,
            required: generation.required().map(|name| position(name).unwrap_or(usize::MAX)),
            optional: generation.optional().map(|name| position(name?)),
        })
    }

    /// A required field; empty when the row is too short.
    pub(super) fn required<'a>(&self, fields: &[&'a str], column: Required) -> &'a str {
        let position = self.required.get(column as usize);
        position.and_then(|at| fields.get(*at)).copied().unwrap_or_default()
    }

    /// The name of a required column.
    pub(super) fn name(&self, column: Required) -> &'static str {
        self.generation.required().get(column as usize).copied().unwrap_or_default()
    }

    /// The name of an optional column.
    pub(super) fn optional_name(&self, column: Optional) -> &'static str {
        self.generation.optional().get(column as usize).copied().flatten().unwrap_or_default()
    }

    /// An optional field; empty when the file has no such column.
    pub(super) fn optional<'a>(&self, fields: &[&'a str], column: Optional) -> &'a str {
        let position = self.optional.get(column as usize).copied().flatten();
        position.and_then(|at| fields.get(at)).copied().unwrap_or_default()
    }
}
