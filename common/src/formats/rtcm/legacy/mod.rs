//! Observations of GPS and GLONASS by messages 1001 to 1004 and 1009 to 1012, which the multiple signal messages have replaced.
//!
//! The extended ones (1002, 1004, 1010, 1012) are used. The others say a pseudorange modulo one light-millisecond (GLONASS: two)
//! and nothing about the whole ones: only who knows where the station is could add them, so they are counted.

mod fields;

use std::collections::BTreeMap;

use super::epoch::{Family, Part};
use super::lock::LockTimes;
use super::{MIN_PSEUDORANGE_M, RtcmDecoder};
use crate::constants::SPEED_OF_LIGHT_MPS;
use crate::gnss::{Constellation, LossOfLock, Observation, SatelliteId, SignalCode};
use crate::skips::Reason;
use crate::time::GpsTime;
use fields::{Kind, Satellite, Tracked};

/// When the difference of phase and pseudorange leaves its field, it is brought back by this many cycles (DF012).
const ROLLOVER_CYCLES: f64 = 1_500.0;
/// DF009: GPS satellites; and DF038: GLONASS slots. Higher numbers are of SBAS or reserved.
const MAX_SATELLITE: u8 = 32;

/// What the decoder remembers of one message for the next. Lock times have another scale than those of multiple signal messages.
#[derive(Clone, Debug, Default)]
pub(super) struct Memory {
    locks: LockTimes,
    /// Phase less pseudorange, cycles, with the rollovers undone.
    differences: BTreeMap<(SatelliteId, SignalCode), f64>,
}

impl Memory {
    /// Undoes rollovers since the signal's last phase. A phase that was lost begins anew.
    fn unrolled(&mut self, of: (SatelliteId, SignalCode), cycles: f64, lost: bool) -> f64 {
        let before = self.differences.get(&of).filter(|_| !lost);
        let unrolled = before.map_or(cycles, |before| {
            cycles + ROLLOVER_CYCLES * ((before - cycles) / ROLLOVER_CYCLES).round()
        });
        self.differences.insert(of, unrolled);
        unrolled
    }
}

/// Whose observations a message is of, by its number; `None` of any other message.
pub(super) fn constellation(number: u32) -> Option<Constellation> {
    Kind::of(number).map(|kind| kind.constellation)
}

/// Whether a number is of one of these messages.
pub(super) const fn is_legacy(number: u32) -> bool {
    Kind::of(number).is_some()
}

impl RtcmDecoder {
    /// Takes a message whose number is one of these.
    pub(super) fn legacy_observations(&mut self, bytes: &[u8], number: u32) {
        let Some(kind) = Kind::of(number) else { return };
        if !kind.is_extended {
            self.skips.add_about(Reason::MessageWithoutWholeMilliseconds, number, || {
                format!("message {} of the station would have them", number + 1)
            });
            return;
        }
        let Ok(message) = fields::decode(bytes, kind) else { return self.too_short(bytes, number) };
        let Some(time) = self.admitted(bytes, kind.constellation, message.sent) else { return };
        let mut observations = Vec::with_capacity(2 * message.satellites.len());
        for sent in &message.satellites {
            let Some(satellite) = self.legacy_satellite(time, kind.constellation, sent) else { continue };
            if sent.is_beyond_modulus {
                self.skips.add(Reason::PseudorangeBeyondModulus, || format!("{satellite} at {time}"));
                continue;
            }
            let signals = std::iter::once(&sent.first).chain(&sent.second);
            observations.extend(signals.filter_map(|tracked| self.tracked(time, satellite, tracked)));
        }
        let part = Part { time, family: Family::Legacy, more_follow: message.more_follow, observations };
        let complete = self.assembler.add(part, &mut self.skips);
        self.give(complete.into_iter().flatten());
    }

    /// The satellite that a number means; its channel is learnt.
    fn legacy_satellite(
        &mut self,
        time: GpsTime,
        constellation: Constellation,
        sent: &Satellite,
    ) -> Option<SatelliteId> {
        let reason = match (constellation, sent.number) {
            (_, 1..=MAX_SATELLITE) => {
                if let Some(channel) = sent.glonass_channel {
                    self.glonass_channels.insert(sent.number, channel);
                }
                return Some(SatelliteId::new(constellation, sent.number));
            }
            (Constellation::Glonass, 0) => Reason::GlonassSatelliteUnknownSlot,
            (Constellation::Gps, 40..=58) | (Constellation::Glonass, 33..) => Reason::SbasObservationsNotUsed,
            _ => Reason::ReservedSatelliteNumber,
        };
        self.skips.add(reason, || format!("{constellation:?} {} at {time}", sent.number));
        None
    }

    fn tracked(&mut self, time: GpsTime, satellite: SatelliteId, tracked: &Tracked) -> Option<Observation> {
        let Some(signal) = tracked.signal else {
            self.skips.add(Reason::ReservedSignalNumber, || format!("{satellite} on L2 at {time}"));
            return None;
        };
        if tracked.code.is_none() && tracked.phase_difference.is_none() && tracked.cn0_dbhz.is_none() {
            // Of L2 it is the rule that not every satellite has it.
            if signal.band == b'1' {
                self.skips.add(Reason::L1PseudorangeNotValid, || format!("{satellite} {signal} at {time}"));
            }
            return None;
        }
        let pseudorange_m = tracked.code.map(metres);
        if pseudorange_m.is_some_and(|p| p < MIN_PSEUDORANGE_M) || metres(tracked.base) < MIN_PSEUDORANGE_M {
            self.skips.add(Reason::PseudorangeTooShort, || format!("{satellite} {signal} at {time}"));
            return None;
        }
        let of = (satellite, signal);
        let channel = self.glonass_channels.get(&satellite.number).copied();
        let frequency_hz = signal.frequency_hz(satellite.constellation, channel);
        if tracked.phase_difference.is_some() && frequency_hz.is_none() {
            self.skips.add(Reason::PhaseWithoutGlonassChannel, || format!("{satellite} {signal} at {time}"));
        }
        let phase = tracked.phase_difference.zip(frequency_hz);
        let cycle_slip = self.legacy.locks.lost(of, time, tracked.lock, phase.is_some());
        let carrier_phase_cycles = phase.map(|(difference, frequency_hz)| {
            let per_metre = frequency_hz / SPEED_OF_LIGHT_MPS;
            let cycles = metres(i64::from(difference)) * per_metre;
            metres(tracked.base) * per_metre + self.legacy.unrolled(of, cycles, cycle_slip)
        });
        // Of a phase without a channel, counted above, nothing may be left.
        let is_empty =
            pseudorange_m.is_none() && carrier_phase_cycles.is_none() && tracked.cn0_dbhz.is_none();
        (!is_empty).then_some(Observation {
            satellite,
            signal,
            pseudorange_m,
            carrier_phase_cycles,
            doppler_hz: None,
            cn0_dbhz: tracked.cn0_dbhz,
            loss_of_lock: LossOfLock { cycle_slip, ..LossOfLock::default() },
        })
    }
}

fn metres(units: i64) -> f64 {
    units as f64 * fields::UNIT_M
}
