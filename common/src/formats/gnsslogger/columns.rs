//! Which field of a line means what: columns by the names in the log's own header.

/// Columns of `Raw` lines that are used. Names as the app prints them, from the first version on; those of satellites and of the
/// ionosphere since 2022, and as challenge tables call them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Raw {
    TimeNanos,
    LeapSecond,
    FullBiasNanos,
    BiasNanos,
    BiasUncertaintyNanos,
    HardwareClockDiscontinuityCount,
    Svid,
    TimeOffsetNanos,
    State,
    ReceivedSvTimeNanos,
    ReceivedSvTimeUncertaintyNanos,
    Cn0DbHz,
    PseudorangeRate,
    PseudorangeRateUncertainty,
    AccumulatedDeltaRangeState,
    AccumulatedDeltaRange,
    CarrierFrequencyHz,
    MultipathIndicator,
    ConstellationType,
    CodeType,
    SvPositionX,
    SvPositionY,
    SvPositionZ,
    SvVelocityX,
    SvVelocityY,
    SvVelocityZ,
    SvClockBias,
    SvClockDrift,
    IonosphericDelay,
    TroposphericDelay,
    KlobucharAlpha0,
    KlobucharAlpha1,
    KlobucharAlpha2,
    KlobucharAlpha3,
    KlobucharBeta0,
    KlobucharBeta1,
    KlobucharBeta2,
    KlobucharBeta3,
}

/// Number of [`Raw`] columns.
pub(super) const RAW_COLUMNS: usize = 38;

/// Names of the [`Raw`] columns in their order.
const RAW_NAMES: [&[&str]; RAW_COLUMNS] = [
    &["TimeNanos"],
    &["LeapSecond"],
    &["FullBiasNanos"],
    &["BiasNanos"],
    &["BiasUncertaintyNanos"],
    &["HardwareClockDiscontinuityCount"],
    &["Svid"],
    &["TimeOffsetNanos"],
    &["State"],
    &["ReceivedSvTimeNanos"],
    &["ReceivedSvTimeUncertaintyNanos"],
    &["Cn0DbHz"],
    &["PseudorangeRateMetersPerSecond"],
    &["PseudorangeRateUncertaintyMetersPerSecond"],
    &["AccumulatedDeltaRangeState"],
    &["AccumulatedDeltaRangeMeters"],
    &["CarrierFrequencyHz"],
    &["MultipathIndicator"],
    &["ConstellationType"],
    &["CodeType"],
    &["SvPositionEcefXMeters", "SvPositionXEcefMeters"],
    &["SvPositionEcefYMeters", "SvPositionYEcefMeters"],
    &["SvPositionEcefZMeters", "SvPositionZEcefMeters"],
    &["SvVelocityEcefXMetersPerSecond", "SvVelocityXEcefMetersPerSecond"],
    &["SvVelocityEcefYMetersPerSecond", "SvVelocityYEcefMetersPerSecond"],
    &["SvVelocityEcefZMetersPerSecond", "SvVelocityZEcefMetersPerSecond"],
    &["SvClockBiasMeters"],
    &["SvClockDriftMetersPerSecond"],
    &["IonosphericDelayMeters"],
    &["TroposphericDelayMeters"],
    &["KlobucharAlpha0"],
    &["KlobucharAlpha1"],
    &["KlobucharAlpha2"],
    &["KlobucharAlpha3"],
    &["KlobucharBeta0"],
    &["KlobucharBeta1"],
    &["KlobucharBeta2"],
    &["KlobucharBeta3"],
];

/// Without these no pseudorange can be formed.
const RAW_REQUIRED: [Raw; 6] = [
    Raw::TimeNanos,
    Raw::FullBiasNanos,
    Raw::Svid,
    Raw::State,
    Raw::ReceivedSvTimeNanos,
    Raw::ConstellationType,
];

/// Columns of the first public version (2016). Later versions kept these places and added further columns, the code type
/// at field 35.
const RAW_STANDARD: &str = "Raw,ElapsedRealtimeMillis,TimeNanos,LeapSecond,TimeUncertaintyNanos,FullBiasNanos,\
    BiasNanos,BiasUncertaintyNanos,DriftNanosPerSecond,DriftUncertaintyNanosPerSecond,\
    HardwareClockDiscontinuityCount,Svid,TimeOffsetNanos,State,ReceivedSvTimeNanos,\
    ReceivedSvTimeUncertaintyNanos,Cn0DbHz,PseudorangeRateMetersPerSecond,\
    PseudorangeRateUncertaintyMetersPerSecond,AccumulatedDeltaRangeState,AccumulatedDeltaRangeMeters,\
    AccumulatedDeltaRangeUncertaintyMeters,CarrierFrequencyHz,CarrierCycles,CarrierPhase,\
    CarrierPhaseUncertainty,MultipathIndicator,SnrInDb,ConstellationType";

/// Columns of `Fix` lines that are used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fix {
    Provider,
    Latitude,
    Longitude,
    Altitude,
    Speed,
    Accuracy,
    Bearing,
    UnixTimeMillis,
}

/// Number of [`Fix`] columns.
pub(super) const FIX_COLUMNS: usize = 8;

const FIX_NAMES: [&[&str]; FIX_COLUMNS] = [
    &["Provider"],
    &["Latitude", "LatitudeDegrees"],
    &["Longitude", "LongitudeDegrees"],
    &["Altitude", "AltitudeMeters"],
    &["Speed", "SpeedMps"],
    &["Accuracy", "AccuracyMeters"],
    &["Bearing", "BearingDegrees"],
    &["(UTC)TimeInMs", "UnixTimeMillis"],
];

const FIX_REQUIRED: [Fix; 3] = [Fix::Latitude, Fix::Longitude, Fix::UnixTimeMillis];

const FIX_STANDARD: &str = "Fix,Provider,Latitude,Longitude,Altitude,Speed,Accuracy,(UTC)TimeInMs";

/// Columns of `Status` lines that are used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Status {
    UnixTimeMillis,
    SignalIndex,
    ConstellationType,
    Svid,
    CarrierFrequencyHz,
    Cn0DbHz,
    AzimuthDegrees,
    ElevationDegrees,
    UsedInFix,
    HasAlmanacData,
    HasEphemerisData,
    BasebandCn0DbHz,
}

/// Number of [`Status`] columns.
pub(super) const STATUS_COLUMNS: usize = 12;

const STATUS_NAMES: [&[&str]; STATUS_COLUMNS] = [
    &["UnixTimeMillis"],
    &["SignalIndex"],
    &["ConstellationType"],
    &["Svid"],
    &["CarrierFrequencyHz"],
    &["Cn0DbHz"],
    &["AzimuthDegrees"],
    &["ElevationDegrees"],
    &["UsedInFix"],
    &["HasAlmanacData"],
    &["HasEphemerisData"],
    &["BasebandCn0DbHz"],
];

const STATUS_REQUIRED: [Status; 3] = [Status::SignalIndex, Status::ConstellationType, Status::Svid];

/// The columns of 2021 to 2023, and of other loggers.
const STATUS_STANDARD: &str = "Status,UnixTimeMillis,SignalCount,SignalIndex,ConstellationType,Svid,\
    CarrierFrequencyHz,Cn0DbHz,AzimuthDegrees,ElevationDegrees,UsedInFix,HasAlmanacData,HasEphemerisData,\
    BasebandCn0DbHz";

/// The places of `N` columns in a line.
#[derive(Clone, Debug)]
pub(super) struct Layout<const N: usize> {
    /// For each field of a line the column that it fills.
    slots: Vec<Option<usize>>,
}

impl Layout<RAW_COLUMNS> {
    /// The order of 2016.
    pub(super) fn raw_standard() -> Self {
        Self::from_names(RAW_STANDARD, &RAW_NAMES)
    }

    /// From a header line, without its `#`; the name of a needed column that is not in it otherwise.
    pub(super) fn raw(header: &str) -> Result<Self, &'static str> {
        Self::checked(header, &RAW_NAMES, RAW_REQUIRED.map(|column| column as usize))
    }
}

impl Layout<FIX_COLUMNS> {
    /// The order of 2016.
    pub(super) fn fix_standard() -> Self {
        Self::from_names(FIX_STANDARD, &FIX_NAMES)
    }

    /// From a header line, without its `#`; the name of a needed column that is not in it otherwise.
    pub(super) fn fix(header: &str) -> Result<Self, &'static str> {
        Self::checked(header, &FIX_NAMES, FIX_REQUIRED.map(|column| column as usize))
    }
}

impl Layout<STATUS_COLUMNS> {
    /// The order of the first version with such lines (2021).
    pub(super) fn status_standard() -> Self {
        Self::from_names(STATUS_STANDARD, &STATUS_NAMES)
    }

    /// From a header line, without its `#`; the name of a needed column that is not in it otherwise.
    pub(super) fn status(header: &str) -> Result<Self, &'static str> {
        Self::checked(header, &STATUS_NAMES, STATUS_REQUIRED.map(|column| column as usize))
    }
}

impl<const N: usize> Layout<N> {
    fn checked<const M: usize>(
        header: &str,
        names: &[&[&'static str]; N],
        required: [usize; M],
    ) -> Result<Self, &'static str> {
        let layout = Self::from_names(header, names);
        match required.into_iter().find(|column| !layout.slots.contains(&Some(*column))) {
            Some(missing) => Err(names.get(missing).and_then(|n| n.first()).copied().unwrap_or_default()),
            None => Ok(layout),
        }
    }

    fn from_names(header: &str, names: &[&[&str]; N]) -> Self {
        let column = |name: &str| {
            let name = name.trim();
            names.iter().position(|known| known.iter().any(|k| k.eq_ignore_ascii_case(name)))
        };
        Self { slots: header.split(',').map(column).collect() }
    }

    /// Number of fields that the header announces.
    pub(super) fn fields(&self) -> usize {
        self.slots.len()
    }

    /// The used fields of a line, trimmed, and how many fields it has in all. Of a name that the header has twice, the
    /// first field that is filled counts: one version printed the carrier frequency in two places.
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
        let layout = Layout::raw(
            "Raw,utcTimeMillis,State, Svid,TimeNanos,FullBiasNanos,ReceivedSvTimeNanos,New,constellationtype",
        )
        .unwrap();
        let (fields, count) = layout.split(b"Raw,1,2,3,4,5,6,7,8");
        assert_eq!(count, 9);
        assert_eq!(fields[Raw::State as usize], b"2");
        assert_eq!(fields[Raw::Svid as usize], b"3");
        assert_eq!(fields[Raw::ConstellationType as usize], b"8");
        assert_eq!(fields[Raw::CodeType as usize], b"");
        assert_eq!(Layout::raw("Raw,TimeNanos,FullBiasNanos").unwrap_err(), "Svid");
    }

    #[test]
    fn a_column_printed_twice_is_taken_where_it_is_filled() {
        let header = format!("{RAW_STANDARD},AgcDb,CarrierFrequencyHz");
        let layout = Layout::raw(&header).unwrap();
        let mut line = vec!["Raw"; layout.fields()];
        line[22] = "";
        line[30] = "1575420030";
        let text = line.join(",");
        let (fields, _) = layout.split(text.as_bytes());
        assert_eq!(fields[Raw::CarrierFrequencyHz as usize], b"1575420030");
    }

    #[test]
    fn indices_and_names_agree() {
        assert_eq!(RAW_NAMES[Raw::CodeType as usize], ["CodeType"]);
        assert_eq!(RAW_NAMES[Raw::Cn0DbHz as usize], ["Cn0DbHz"]);
        assert_eq!(RAW_NAMES[Raw::SvPositionX as usize][0], "SvPositionEcefXMeters");
        assert_eq!(RAW_NAMES[Raw::KlobucharBeta3 as usize], ["KlobucharBeta3"]);
        assert_eq!(FIX_NAMES[Fix::UnixTimeMillis as usize][1], "UnixTimeMillis");
        assert_eq!(STATUS_NAMES[Status::BasebandCn0DbHz as usize], ["BasebandCn0DbHz"]);
        assert_eq!(STATUS_NAMES[Status::Svid as usize], ["Svid"]);
    }
}
