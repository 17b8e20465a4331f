//! The two generations' columns, found by name.

use crate::formats::text::without_mark;

/// Positions of the columns in a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Columns {
    /// The generation.
    pub(super) generation: Generation,
    required: [Option<usize>; Required::NAMES.len()],
    optional: [Option<usize>; Optional::NAMES.len()],
}

/// Generation of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Generation {
    /// `*_derived.csv` of 2021.
    Derived2021,
    /// `device_gnss.csv` since 2022.
    Device2022,
}

/// Columns with their names in both generations, empty where one does not have it.
macro_rules! columns {
    ($(#[$doc:meta])* $columns:ident, $($(#[$own:meta])* $column:ident: $first:literal, $second:literal;)+) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(super) enum $columns {
            $($(#[$own])* $column),+
        }

        impl $columns {
            const NAMES: [[&'static str; 2]; [$(Self::$column),+].len()] = [$([$first, $second]),+];
        }
    };
}

columns! {
    /// A column that must be there.
    Required,
    /// 2021: epoch, ms of GPS time. 2022: arrival, ns of GPS time.
    Time: "millisSinceGpsEpoch", "ArrivalTimeNanosSinceGpsEpoch";
    Constellation: "constellationType", "ConstellationType";
    Satellite: "svid", "Svid";
    Signal: "signalType", "SignalType";
    /// Transmission by the satellite's clock, ns of GPS time.
    Transmission: "receivedSvTimeInGpsNanos", "ReceivedSvTimeNanosSinceGpsEpoch";
    PositionX: "xSatPosM", "SvPositionXEcefMeters";
    PositionY: "ySatPosM", "SvPositionYEcefMeters";
    PositionZ: "zSatPosM", "SvPositionZEcefMeters";
    VelocityX: "xSatVelMps", "SvVelocityXEcefMetersPerSecond";
    VelocityY: "ySatVelMps", "SvVelocityYEcefMetersPerSecond";
    VelocityZ: "zSatVelMps", "SvVelocityZEcefMetersPerSecond";
    ClockBias: "satClkBiasM", "SvClockBiasMeters";
    ClockDrift: "satClkDriftMps", "SvClockDriftMetersPerSecond";
    Pseudorange: "rawPrM", "RawPseudorangeMeters";
    ReceiverBias: "isrbM", "IsrbMeters";
    Ionosphere: "ionoDelayM", "IonosphericDelayMeters";
    Troposphere: "tropoDelayM", "TroposphericDelayMeters";
}

columns! {
    /// A column that only one generation has, or that only raw observations need.
    Optional,
    Cn0: "", "Cn0DbHz";
    PseudorangeRate: "", "PseudorangeRateMetersPerSecond";
    DeltaRange: "", "AccumulatedDeltaRangeMeters";
    DeltaRangeState: "", "AccumulatedDeltaRangeState";
    CarrierFrequency: "", "CarrierFrequencyHz";
    CodeType: "", "CodeType";
    PseudorangeUncertainty: "rawPrUncM", "RawPseudorangeUncertaintyMeters";
    State: "", "State";
    Multipath: "", "MultipathIndicator";
    BiasUncertainty: "", "BiasUncertaintyNanos";
    ReceivedTimeUncertainty: "", "ReceivedSvTimeUncertaintyNanos";
}

impl Generation {
    const fn name(self, [first, second]: [&'static str; 2]) -> &'static str {
        match self {
            Self::Derived2021 => first,
            Self::Device2022 => second,
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

/// Whether a line names the column of times, which a table of either generation has.
pub(crate) fn is_table_header(line: &[u8]) -> bool {
    let [times, ..] = Required::NAMES;
    line.split(|byte| *byte == b',')
        .any(|field| times.iter().any(|name| name.as_bytes() == field.trim_ascii()))
}

impl Columns {
    /// From the header's fields.
    ///
    /// # Errors
    /// A message with the missing columns.
    pub(super) fn find(header: &[&str]) -> Result<Self, String> {
        let header: Vec<&str> = header.iter().map(|name| name.trim_start_matches('\u{feff}')).collect();
        let missing = |generation: Generation| -> Vec<&'static str> {
            let names = Required::NAMES.into_iter().map(|names| generation.name(names));
            names.filter(|name| !header.contains(name)).collect()
        };
        let generation = [Generation::Derived2021, Generation::Device2022]
            .into_iter()
            .min_by_key(|generation| missing(*generation).len())
            .unwrap_or(Generation::Derived2021);
        let lacking = missing(generation);
        if lacking.len() == Required::NAMES.len() {
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
        let position = |names: [&'static str; 2]| {
            let name = generation.name(names);
            header.iter().position(|found| !found.is_empty() && *found == name)
        };
        let (required, optional) = (Required::NAMES.map(position), Optional::NAMES.map(position));
        Ok(Self { generation, required, optional })
    }

    /// A required field; empty when the row is too short.
    pub(super) fn required<'a>(&self, fields: &[&'a str], column: Required) -> &'a str {
        field(fields, self.required.get(column as usize))
    }

    /// An optional field; empty when the file has no such column.
    pub(super) fn optional<'a>(&self, fields: &[&'a str], column: Optional) -> &'a str {
        field(fields, self.optional.get(column as usize))
    }

    /// The name of a required column.
    pub(super) fn name(&self, column: Required) -> &'static str {
        Required::NAMES.get(column as usize).map(|names| self.generation.name(*names)).unwrap_or_default()
    }

    /// The name of an optional column.
    pub(super) fn optional_name(&self, column: Optional) -> &'static str {
        Optional::NAMES.get(column as usize).map(|names| self.generation.name(*names)).unwrap_or_default()
    }
}

fn field<'a>(fields: &[&'a str], position: Option<&Option<usize>>) -> &'a str {
    position.copied().flatten().and_then(|at| fields.get(at)).copied().unwrap_or_default()
}
