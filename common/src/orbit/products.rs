//! Orbits, clocks, group delays and ionosphere terms from all available files.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::biases::Biases;
use super::broadcast::BroadcastOrbit;
use super::clocks::Clocks;
use super::glonass::GlonassOrbit;
use super::group_delay::{GroupDelays, glonass_correction_m};
use super::precise::PreciseOrbit;
use super::{
    BiasFile, ClockFile, ClockReference, GlonassEphemeris, KeplerEphemeris, NavigationFile, OrbitError,
    SatelliteState, Sp3, Sp3Position,
};
use crate::atmosphere::{IonosphereMaps, KlobucharCoefficients, effective_ionisation_sfu};
use crate::gnss::{Constellation, SatelliteId, SignalCode};
use crate::time::GpsTime;

/// Number of satellite slots: a hundred numbers in each of seven systems.
const PLACES: usize = 700;
const NUMBERS: usize = 100;

/// All products of a session.
#[derive(Clone, Debug, Default)]
pub struct Products {
    /// By system and number; empty without any products.
    satellites: Vec<Satellite>,
    /// Shared, like biases and maps, because they are large and products are copied for new messages.
    clocks: Arc<Clocks>,
    biases: Arc<Biases>,
    pub(super) maps: Arc<IonosphereMaps>,
    ionosphere: Option<KlobucharCoefficients>,
    beidou_ionosphere: Option<KlobucharCoefficients>,
    galileo_ionisation_sfu: Option<f64>,
    precise_span: Option<(GpsTime, GpsTime)>,
    leap_seconds: Option<i64>,
    glonass_channels: BTreeMap<u8, i8>,
}

/// Products of one satellite.
#[derive(Clone, Debug, Default)]
struct Satellite {
    precise: PreciseOrbit,
    broadcast: BroadcastOrbit,
    glonass: GlonassOrbit,
}

impl Satellite {
    fn has_broadcast(&self) -> bool {
        !self.broadcast.is_empty() || !self.glonass.is_empty()
    }

    fn broadcast_state(&self, satellite: SatelliteId, time: GpsTime) -> Result<SatelliteState, OrbitError> {
        match satellite.constellation {
            Constellation::Glonass => self.glonass.state(satellite, time),
            _ => self.broadcast.state(satellite, time),
        }
    }
}

impl Products {
    /// Products from any number of precise and broadcast files. Where SP3 files overlap, the one with the earliest start is
    /// used, and of those the first.
    pub fn new(mut sp3: Vec<Sp3>, navigation: Vec<NavigationFile>) -> Self {
        let mut products = Self { satellites: vec![Satellite::default(); PLACES], ..Self::default() };
        // In order of time, so that the nodes of one day continue those of the day before.
        sp3.sort_by_key(|file| file.positions.first().map(|position| position.time));
        for file in sp3 {
            products.add_sp3(file);
        }
        for file in navigation {
            products.add_navigation(file);
        }
        products
    }

    /// Adds a precise file.
    fn add_sp3(&mut self, mut file: Sp3) {
        // The sort is stable, so the positions of each satellite stay in order of time.
        file.positions.sort_by_key(|position| position.satellite);
        for positions in file.positions.chunk_by(|a, b| a.satellite == b.satellite) {
            self.add_positions(file.interval_s, positions);
        }
    }

    fn add_positions(&mut self, interval_s: f64, positions: &[Sp3Position]) {
        let Some(first) = positions.first() else { return };
        let Some(satellite) = place(first.satellite).and_then(|at| self.satellites.get_mut(at)) else {
            return;
        };
        satellite.precise.add(interval_s, positions);
        for Sp3Position { time, .. } in positions {
            let (a, b) = self.precise_span.unwrap_or((*time, *time));
            self.precise_span = Some((a.min(*time), b.max(*time)));
        }
    }

    /// Adds satellite clocks, which complete the positions of SP3 files and are of no use without them. Where files overlap, the one with
    /// the earliest start is used, and of those the first. All files must be given in one call: records earlier than those of a former call
    /// are left out.
    pub fn add_clocks(&mut self, files: Vec<ClockFile>) {
        Arc::make_mut(&mut self.clocks).add(files);
    }

    /// Adds code biases, which belong to the clocks of SP3 and clock files. Of several valid biases the one with the latest start
    /// is used, and of those the first added.
    pub fn add_biases(&mut self, file: BiasFile) {
        Arc::make_mut(&mut self.biases).add(file);
    }

    /// Adds a broadcast file or messages from another source. Ionosphere terms and leap seconds of the first file that has them are kept.
    pub fn add_navigation(&mut self, file: NavigationFile) {
        self.satellites.resize(PLACES, Satellite::default());
        self.ionosphere = self.ionosphere.or(file.ionosphere.gps);
        self.beidou_ionosphere = self.beidou_ionosphere.or(file.ionosphere.beidou);
        let ionisation_sfu = || file.ionosphere.galileo.and_then(effective_ionisation_sfu);
        self.galileo_ionisation_sfu = self.galileo_ionisation_sfu.or_else(ionisation_sfu);
        self.leap_seconds = self.leap_seconds.or(file.leap_seconds);
        for ephemeris in file.ephemerides {
            if let Some(satellite) = place(ephemeris.satellite).and_then(|at| self.satellites.get_mut(at)) {
                satellite.broadcast.add(ephemeris);
            }
        }
        for ephemeris in file.glonass {
            if let Some(satellite) = place(ephemeris.satellite).and_then(|at| self.satellites.get_mut(at)) {
                satellite.glonass.add(ephemeris);
            }
        }
    }

    /// Whether there is an orbit of any satellite at any time.
    pub fn has_orbits(&self) -> bool {
        self.precise_span.is_some() || self.satellites.iter().any(Satellite::has_broadcast)
    }

    /// Satellite position, velocity and clock at an instant (of transmission, for a user), in the Earth-fixed
    /// frame of that instant: from SP3 where it covers the instant, with the clock of a clock file or else of the SP3 file;
    /// else by the broadcast ephemeris in force.
    ///
    /// # Errors
    /// If no product covers the satellite at that time, or the broadcast message declares it unhealthy.
    pub fn satellite_state(
        &self,
        satellite: SatelliteId,
        time: GpsTime,
    ) -> Result<SatelliteState, OrbitError> {
        let known = self.known(satellite).ok_or(OrbitError::Unknown { satellite })?;
        match known.precise.state(satellite, time, self.clocks.state(satellite, time)) {
            Ok(state) => Ok(state),
            Err(no_precise) if !known.has_broadcast() => Err(no_precise),
            Err(OrbitError::Unknown { .. }) => known.broadcast_state(satellite, time),
            // If neither serves, the error of the precise orbits is more informative than that of the messages.
            Err(no_precise) => known.broadcast_state(satellite, time).map_err(|error| match error {
                OrbitError::Unhealthy { .. } => error,
                _ => no_precise,
            }),
        }
    }

    /// Metres to add to a pseudorange on `signal` for a satellite clock of the given reference. `None` if unknown (for example GPS L5
    /// without biases): a bias or a larger standard deviation must cover it.
    ///
    /// The source is a Bias-SINEX file, −c·OSB, for a network's clock and a signal with a bias. Otherwise it is the navigation
    /// message nearest in time, at any age, because group delays change slowly; see [`Products::group_delay_age_s`]. If the
    /// biases cover the signal for other satellites of the system, a correction by message is shifted by the constant between both
    /// (the median over satellites with both), so that all satellites of the system agree.
    pub fn group_delay_correction_m(
        &self,
        satellite: SatelliteId,
        signal: SignalCode,
        reference: ClockReference,
        time: GpsTime,
    ) -> Option<f64> {
        let biases = self.biases.as_ref();
        if self.precise_span.is_none() || !biases.cover(satellite.constellation, signal, time) {
            return self.message_correction_m(satellite, signal, reference, time);
        }
        if reference == ClockReference::IonosphereFree
            && let Some(correction_m) = biases.correction_m(satellite, signal, time)
        {
            return Some(correction_m);
        }
        let by_message_m = self.message_correction_m(satellite, signal, reference, time)?;
        let datum_m = biases.datum_m(satellite.constellation, signal, time, |other| {
            self.message_correction_m(other, signal, ClockReference::IonosphereFree, time)
        })?;
        Some(by_message_m + datum_m)
    }

    /// Correction by the group delays of navigation messages.
    fn message_correction_m(
        &self,
        satellite: SatelliteId,
        signal: SignalCode,
        reference: ClockReference,
        time: GpsTime,
    ) -> Option<f64> {
        let known = self.known(satellite)?;
        if satellite.constellation == Constellation::Glonass {
            let l2_delay_s = known.glonass.nearest(time).and_then(|e| e.l2_delay_s);
            return glonass_correction_m(signal, reference, l2_delay_s);
        }
        let broadcast = &known.broadcast;
        let (main, fnav) = broadcast.nearest(time);
        let nearest = main.or(fnav)?;
        let message = broadcast.in_force(satellite, time).unwrap_or(nearest).message;
        let (first_s, second_s) = nearest.group_delays_s;
        GroupDelays { first_s, second_s }.correction_m(satellite, signal, reference, message)
    }

    /// Seconds between `time` and the nearest navigation message of any satellite, `None` without messages.
    /// Group delays older than a few weeks deserve a warning.
    pub fn group_delay_age_s(&self, time: GpsTime) -> Option<f64> {
        self.satellites
            .iter()
            .filter_map(|satellite| {
                let (main, fnav) = satellite.broadcast.nearest(time);
                main.or(fnav)
            })
            .map(|ephemeris| (time - ephemeris.toe).abs())
            .min_by(f64::total_cmp)
    }

    /// GPS Klobuchar coefficients of the first navigation file that has them; see also [`Products::ionosphere_delay_m`].
    pub const fn ionosphere(&self) -> Option<KlobucharCoefficients> {
        self.ionosphere
    }

    /// Coefficients of BeiDou's own model from the first navigation file that has them; see [`Products::ionosphere_delay_m`].
    pub const fn beidou_ionosphere(&self) -> Option<KlobucharCoefficients> {
        self.beidou_ionosphere
    }

    /// Effective ionisation by Galileo's coefficients of the first navigation file that has them, sfu; see [`Products::ionosphere_delay_m`].
    pub const fn galileo_ionisation_sfu(&self) -> Option<f64> {
        self.galileo_ionisation_sfu
    }

    /// Seconds by which GPS time is ahead of UTC, from the first navigation file that states them.
    pub const fn leap_seconds(&self) -> Option<i64> {
        self.leap_seconds
    }

    /// First and last epoch of the SP3 files, `None` without any.
    pub const fn coverage(&self) -> Option<(GpsTime, GpsTime)> {
        self.precise_span
    }

    /// First and last record of the clock files, `None` without any.
    pub fn clock_coverage(&self) -> Option<(GpsTime, GpsTime)> {
        self.clocks.span()
    }

    /// From the earliest start to the latest end of the biases, `None` without any.
    pub fn bias_coverage(&self) -> Option<(GpsTime, GpsTime)> {
        self.biases.span()
    }

    /// The broadcast ephemeris in force for a satellite, regardless of its health.
    pub fn ephemeris(&self, satellite: SatelliteId, time: GpsTime) -> Option<&KeplerEphemeris> {
        self.known(satellite)?.broadcast.in_force(satellite, time)
    }

    /// The GLONASS message in force for a satellite, regardless of its health.
    pub fn glonass_ephemeris(&self, satellite: SatelliteId, time: GpsTime) -> Option<&GlonassEphemeris> {
        self.known(satellite)?.glonass.in_force(time)
    }

    /// Frequency channel of a GLONASS satellite by the message nearest to `time`, at any age, because satellites keep
    /// their channel for months. Without a message that of [`Products::set_glonass_channels`]; `None` for other
    /// systems and unknown channels.
    pub fn glonass_channel(&self, satellite: SatelliteId, time: GpsTime) -> Option<i8> {
        if satellite.constellation != Constellation::Glonass {
            return None;
        }
        let nearest = self.known(satellite).and_then(|known| known.glonass.nearest(time));
        let stated = || self.glonass_channels.get(&satellite.number).copied();
        nearest.map(|ephemeris| ephemeris.frequency_channel).or_else(stated)
    }

    /// Takes GLONASS frequency channels by slot, from observation headers, for satellites without a navigation
    /// message (precise orbits do not contain the channel). Channels set before are kept.
    pub fn set_glonass_channels(&mut self, channels: &BTreeMap<u8, i8>) {
        for (slot, channel) in channels {
            self.glonass_channels.entry(*slot).or_insert(*channel);
        }
    }

    fn known(&self, satellite: SatelliteId) -> Option<&Satellite> {
        self.satellites.get(place(satellite)?)
    }
}

/// Slot of a satellite in the table.
fn place(satellite: SatelliteId) -> Option<usize> {
    let number = usize::from(satellite.number);
    (number < NUMBERS).then_some(satellite.constellation as usize * NUMBERS + number)
}
