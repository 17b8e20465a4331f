//! What a stream of RTCM 3 states beside its records.

use std::collections::BTreeMap;

use super::RtcmDecoder;
use crate::formats::decode::WrongStream;
use crate::formats::rinex::Equipment;
use crate::formats::stream::ObservationStream;
use crate::frames::Ecef;

impl ObservationStream for RtcmDecoder {
    /// A frame with the right checksum has come.
    fn is_recognised(&self) -> bool {
        self.frames() > 0
    }

    fn glonass_channels(&self) -> BTreeMap<u8, i8> {
        Self::glonass_channels(self).clone()
    }

    fn station(&self) -> Option<Ecef> {
        Self::station(self).map(|station| station.position)
    }

    fn equipment(&self) -> Equipment {
        Self::equipment(self).clone()
    }

    /// Its messages state no week that could be wrong.
    fn shifts_weeks_itself(&self) -> bool {
        true
    }

    /// Frames find their own beginning.
    fn interrupt(&mut self) -> Result<(), WrongStream> {
        Ok(())
    }
}
