//! Columns of lines, found by the names in the log's own header.

/// The columns of a kind of lines.
pub(super) struct Kind<const N: usize> {
    /// The names of each column in headers.
    names: [&'static [&'static str]; N],
    /// Columns without which a line cannot be used.
    needed: &'static [usize],
    /// The names in the order of lines without a header.
    standard: &'static str,
}

/// Columns that are used of a kind of lines, with their names.
macro_rules! columns {
    ($(#[$doc:meta])* $column:ident, $count:ident, $kind:ident, needed: [$($needed:ident),+],
     standard: $standard:expr, $($name:ident: $($text:literal)|+,)+) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(super) enum $column {
            $($name),+
        }
        /// Their number.
        pub(super) const $count: usize = [$($column::$name),+].len();
        $(#[$doc])*
        pub(super) const $kind: Kind<$count> = Kind {
            names: [$(&[$($text),+]),+],
            needed: &[$($column::$needed as usize),+],
            standard: $standard,
        };
    };
}

columns! {
    /// Columns of `Raw` lines. Names as the app prints them, from the first version on; those of satellites and of the ionosphere since
    /// 2022, and as challenge tables call them. Without the needed ones no pseudorange can be formed. The standard is that of the first
    /// public version (2016). Later versions kept these places and added further columns, the code type at field 35.
    Raw, RAW_COLUMNS, RAW,
    needed: [TimeNanos, FullBiasNanos, Svid, State, ReceivedSvTimeNanos, ConstellationType],
    standard: "Raw,ElapsedRealtimeMillis,TimeNanos,LeapSecond,TimeUncertaintyNanos,FullBiasNanos,\
    BiasNanos,BiasUncertaintyNanos,DriftNanosPerSecond,DriftUncertaintyNanosPerSecond,\
    HardwareClockDiscontinuityCount,Svid,TimeOffsetNanos,State,ReceivedSvTimeNanos,\
    ReceivedSvTimeUncertaintyNanos,Cn0DbHz,PseudorangeRateMetersPerSecond,\
    PseudorangeRateUncertaintyMetersPerSecond,AccumulatedDeltaRangeState,AccumulatedDeltaRangeMeters,\
    AccumulatedDeltaRangeUncertaintyMeters,CarrierFrequencyHz,CarrierCycles,CarrierPhase,\
    CarrierPhaseUncertainty,MultipathIndicator,SnrInDb,ConstellationType",
    TimeNanos: "TimeNanos",
    LeapSecond: "LeapSecond",
    FullBiasNanos: "FullBiasNanos",
    BiasNanos: "BiasNanos",
    BiasUncertaintyNanos: "BiasUncertaintyNanos",
    HardwareClockDiscontinuityCount: "HardwareClockDiscontinuityCount",
    Svid: "Svid",
    TimeOffsetNanos: "TimeOffsetNanos",
    State: "State",
    ReceivedSvTimeNanos: "ReceivedSvTimeNanos",
    ReceivedSvTimeUncertaintyNanos: "ReceivedSvTimeUncertaintyNanos",
    Cn0DbHz: "Cn0DbHz",
    PseudorangeRate: "PseudorangeRateMetersPerSecond",
    PseudorangeRateUncertainty: "PseudorangeRateUncertaintyMetersPerSecond",
    AccumulatedDeltaRangeState: "AccumulatedDeltaRangeState",
    AccumulatedDeltaRange: "AccumulatedDeltaRangeMeters",
    CarrierFrequencyHz: "CarrierFrequencyHz",
    MultipathIndicator: "MultipathIndicator",
    ConstellationType: "ConstellationType",
    CodeType: "CodeType",
    SvPositionX: "SvPositionEcefXMeters" | "SvPositionXEcefMeters",
    SvPositionY: "SvPositionEcefYMeters" | "SvPositionYEcefMeters",
    SvPositionZ: "SvPositionEcefZMeters" | "SvPositionZEcefMeters",
    SvVelocityX: "SvVelocityEcefXMetersPerSecond" | "SvVelocityXEcefMetersPerSecond",
    SvVelocityY: "SvVelocityEcefYMetersPerSecond" | "SvVelocityYEcefMetersPerSecond",
    SvVelocityZ: "SvVelocityEcefZMetersPerSecond" | "SvVelocityZEcefMetersPerSecond",
    SvClockBias: "SvClockBiasMeters",
    SvClockDrift: "SvClockDriftMetersPerSecond",
    IonosphericDelay: "IonosphericDelayMeters",
    TroposphericDelay: "TroposphericDelayMeters",
    KlobucharAlpha0: "KlobucharAlpha0",
    KlobucharAlpha1: "KlobucharAlpha1",
    KlobucharAlpha2: "KlobucharAlpha2",
    KlobucharAlpha3: "KlobucharAlpha3",
    KlobucharBeta0: "KlobucharBeta0",
    KlobucharBeta1: "KlobucharBeta1",
    KlobucharBeta2: "KlobucharBeta2",
    KlobucharBeta3: "KlobucharBeta3",
}

columns! {
    /// Columns of `Fix` lines. The standard is that of 2016.
    Fix, FIX_COLUMNS, FIX,
    needed: [Latitude, Longitude, UnixTimeMillis],
    standard: "Fix,Provider,Latitude,Longitude,Altitude,Speed,Accuracy,(UTC)TimeInMs",
    Provider: "Provider",
    Latitude: "Latitude" | "LatitudeDegrees",
    Longitude: "Longitude" | "LongitudeDegrees",
    Altitude: "Altitude" | "AltitudeMeters",
    Speed: "Speed" | "SpeedMps",
    Accuracy: "Accuracy" | "AccuracyMeters",
    Bearing: "Bearing" | "BearingDegrees",
    UnixTimeMillis: "(UTC)TimeInMs" | "UnixTimeMillis",
}

columns! {
    /// Columns of `Status` lines. The standard is that of 2021 to 2023, and of other loggers.
    Status, STATUS_COLUMNS, STATUS,
    needed: [SignalIndex, ConstellationType, Svid],
    standard: "Status,UnixTimeMillis,SignalCount,SignalIndex,ConstellationType,Svid,\
    CarrierFrequencyHz,Cn0DbHz,AzimuthDegrees,ElevationDegrees,UsedInFix,HasAlmanacData,HasEphemerisData,\
    BasebandCn0DbHz",
    UnixTimeMillis: "UnixTimeMillis",
    SignalIndex: "SignalIndex",
    ConstellationType: "ConstellationType",
    Svid: "Svid",
    CarrierFrequencyHz: "CarrierFrequencyHz",
    Cn0DbHz: "Cn0DbHz",
    AzimuthDegrees: "AzimuthDegrees",
    ElevationDegrees: "ElevationDegrees",
    UsedInFix: "UsedInFix",
    HasAlmanacData: "HasAlmanacData",
    HasEphemerisData: "HasEphemerisData",
    BasebandCn0DbHz: "BasebandCn0DbHz",
}

/// The places of `N` columns in a line.
#[derive(Clone, Debug)]
pub(super) struct Layout<const N: usize> {
    /// For each field of a line the column that it fills.
    slots: Vec<Option<usize>>,
}

impl<const N: usize> Kind<N> {
    /// The order of lines without a header.
    pub(super) fn standard(&self) -> Layout<N> {
        self.layout(self.standard)
    }

    /// From a header line, without its `#`.
    ///
    /// # Errors
    /// The name of a needed column that is not in it.
    pub(super) fn of_header(&self, header: &str) -> Result<Layout<N>, &'static str> {
        let layout = self.layout(header);
        match self.needed.iter().find(|column| !layout.slots.contains(&Some(**column))) {
            Some(missing) => {
                Err(self.names.get(*missing).and_then(|n| n.first()).copied().unwrap_or_default())
            }
            None => Ok(layout),
        }
    }

    fn layout(&self, header: &str) -> Layout<N> {
        let column = |name: &str| {
            let name = name.trim();
            self.names.iter().position(|known| known.iter().any(|k| k.eq_ignore_ascii_case(name)))
        };
        Layout { slots: header.split(',').map(column).collect() }
    }
}

impl<const N: usize> Layout<N> {
    /// Number of fields that the header announces.
    pub(super) fn fields(&self) -> usize {
        self.slots.len()
    }

    /// The used fields of a line, trimmed, and the number of all its fields. Where the header has a name twice, the first field
    /// that is filled counts: one version printed the carrier frequency in two places.
    pub(super) fn split<'a>(&self, line: &'a [u8]) -> ([&'a [u8]; N], usize) {
        let mut values: [&[u8]; N] = [&[]; N];
        let mut slots = self.slots.iter();
        let mut count = 0;
        for field in line.split(|byte| *byte == b',') {
            count += 1;
            let Some(slot) = slots.next() else { continue };
            if let Some(value) = slot.and_then(|column| values.get_mut(column))
                && value.is_empty()
            {
                *value = field.trim_ascii();
            }
        }
        (values, count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_found_wherever_they_stand() {
        let layout = RAW.of_header(
            "Raw,utcTimeMillis,State, Svid,TimeNanos,FullBiasNanos,ReceivedSvTimeNanos,New,constellationtype",
        )
        .unwrap();
        let (fields, count) = layout.split(b"Raw,1,2,3,4,5,6,7,8");
        assert_eq!(count, 9);
        assert_eq!(fields[Raw::State as usize], b"2");
        assert_eq!(fields[Raw::Svid as usize], b"3");
        assert_eq!(fields[Raw::ConstellationType as usize], b"8");
        assert_eq!(fields[Raw::CodeType as usize], b"");
        assert_eq!(RAW.of_header("Raw,TimeNanos,FullBiasNanos").unwrap_err(), "Svid");
    }

    #[test]
    fn a_column_printed_twice_is_taken_where_it_is_filled() {
        let header = format!("{},AgcDb,CarrierFrequencyHz", RAW.standard);
        let layout = RAW.of_header(&header).unwrap();
        let mut line = vec!["Raw"; layout.fields()];
        line[22] = "";
        line[30] = "1575420030";
        let text = line.join(",");
        let (fields, _) = layout.split(text.as_bytes());
        assert_eq!(fields[Raw::CarrierFrequencyHz as usize], b"1575420030");
    }
}
