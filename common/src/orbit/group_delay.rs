//! Group delay corrections between the reference of a product's clock and a single signal.
//!
//! A satellite clock refers to one signal or combination; another signal leaves the satellite earlier or later.
//! All terms are metres to be *added* to a pseudorange, along with c·dT_s. IS-GPS-200, 20.3.3.3.3.2; Galileo OS
//! SIS ICD, 5.1.5; BDS-SIS-ICD-B1I, 5.2.4.10; IS-QZSS-PNT.

use super::{ClockReference, NavigationMessage};
use crate::constants::SPEED_OF_LIGHT_MPS;
use crate::gnss::{Constellation, SatelliteId, SignalCode};

/// Group delays of a satellite, s; NaN if unknown.
#[derive(Clone, Copy, Debug)]
pub(super) struct GroupDelays {
    /// GPS, QZSS: TGD. Galileo: BGD E1-E5a. BeiDou: TGD1.
    pub(super) first_s: f64,
    /// Galileo: BGD E1-E5b. BeiDou: TGD2.
    pub(super) second_s: f64,
}

impl GroupDelays {
    /// Correction of a pseudorange on a signal, m; `None` if unknown. `message` is the source of a broadcast clock.
    pub(super) fn correction_m(
        self,
        satellite: SatelliteId,
        signal: SignalCode,
        reference: ClockReference,
        message: NavigationMessage,
    ) -> Option<f64> {
        let delay_s = match satellite.constellation {
            Constellation::Gps | Constellation::Qzss => self.gps(signal),
            Constellation::Galileo => self.galileo(signal, reference, message),
            Constellation::Beidou => self.beidou(satellite, signal, reference),
            _ => None,
        }?;
        delay_s.is_finite().then_some(SPEED_OF_LIGHT_MPS * delay_s)
    }

    /// L1 −TGD, L2 −γ·TGD, both for the broadcast clock and for that of the L1/L2 pair. L5 needs ISC_L5, which
    /// LNAV does not contain.
    fn gps(self, signal: SignalCode) -> Option<f64> {
        match signal.band {
            b'1' => Some(-self.first_s),
            b'2' => Some(-ratio_squared(Constellation::Gps, b'1', b'2')? * self.first_s),
            _ => None,
        }
    }

    /// E1 by the BGD of the clock's own pair; E5a and E5b relative to E1 by their BGD.
    fn galileo(
        self,
        signal: SignalCode,
        reference: ClockReference,
        message: NavigationMessage,
    ) -> Option<f64> {
        let inav = reference == ClockReference::Broadcast && message == NavigationMessage::GalileoInav;
        let e1 = if inav { -self.second_s } else { -self.first_s };
        let own = match signal.band {
            b'1' => return Some(e1),
            b'5' => self.first_s,
            b'7' => self.second_s,
            _ => return None,
        };
        let gamma = ratio_squared(Constellation::Galileo, b'1', signal.band)?;
        // With the clock of the signal's own pair the sum of both terms is −γ·BGD, so only that BGD is needed.
        let own_pair = inav == (signal.band == b'7');
        Some(if own_pair { -gamma * own } else { e1 - (gamma - 1.0) * own })
    }

    /// B1I −TGD1, B2I −TGD2, B3I none, for the broadcast clock, which refers to B3I; the clock of the B1I/B3I pair is behind it by
    /// f₁²/(f₁² − f₃²)·TGD1.
    ///
    /// BeiDou-3 has no B2I. A code without an attribute is treated as the open signal of the band.
    fn beidou(self, satellite: SatelliteId, signal: SignalCode, reference: ClockReference) -> Option<f64> {
        let from_b3 = match (signal.band, signal.attribute) {
            (b'2', _) => -self.first_s,
            (b'6', b'I' | b'Q' | b'X' | b' ') => 0.0,
            (b'7', b'I' | b'Q' | b'X' | b' ') if !satellite.is_beidou_3() => -self.second_s,
            _ => return None,
        };
        match reference {
            ClockReference::Broadcast => Some(from_b3),
            ClockReference::IonosphereFree => {
                let gamma = ratio_squared(Constellation::Beidou, b'2', b'6')?;
                Some(from_b3 + gamma / (gamma - 1.0) * self.first_s)
            }
        }
    }
}

/// GLONASS: the broadcast clock τ_n refers to L1, and L2 leaves the satellite Δτ_n later (ICD 4.4). The clock of the
/// L1/L2 pair is Δτ_n/(γ − 1) ahead of L1, with γ = (9/7)². The delay of L3 is unknown.
pub(super) fn glonass_correction_m(
    signal: SignalCode,
    reference: ClockReference,
    l2_delay_s: Option<f64>,
) -> Option<f64> {
    const GAMMA: f64 = 81.0 / 49.0;
    let factor = match (signal.band, reference) {
        (b'1', ClockReference::Broadcast) => return Some(0.0),
        (b'1', ClockReference::IonosphereFree) => 1.0 / (GAMMA - 1.0),
        (b'2', ClockReference::Broadcast) => 1.0,
        (b'2', ClockReference::IonosphereFree) => GAMMA / (GAMMA - 1.0),
        _ => return None,
    };
    l2_delay_s.map(|delay_s| -SPEED_OF_LIGHT_MPS * factor * delay_s)
}

/// (f_a / f_b)² of two bands of a system.
fn ratio_squared(constellation: Constellation, a: u8, b: u8) -> Option<f64> {
    let frequency = |band: u8| SignalCode::new(band, b'X').frequency_hz(constellation, None);
    let ratio = frequency(a)? / frequency(b)?;
    Some(ratio * ratio)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ClockReference::{Broadcast, IonosphereFree};
    use Constellation::{Beidou, Galileo, Gps};
    use NavigationMessage::{BeidouD1D2, GalileoFnav, GalileoInav, Lnav};

    const DELAYS: GroupDelays = GroupDelays { first_s: 1e-9, second_s: 4e-9 };

    fn correction_ns(
        constellation: Constellation,
        band: u8,
        reference: ClockReference,
        message: NavigationMessage,
    ) -> Option<f64> {
        let signal = SignalCode::new(band, b'X');
        let satellite = SatelliteId::new(constellation, 1);
        let metres = DELAYS.correction_m(satellite, signal, reference, message)?;
        Some(metres / SPEED_OF_LIGHT_MPS * 1e9)
    }

    /// The clock of a combination of two signals from the corrections of both; it must be that of the combination, because
    /// the weights f² make the terms cancel.
    fn combined(
        constellation: Constellation,
        (a, b): (u8, u8),
        reference: ClockReference,
        message: NavigationMessage,
    ) -> f64 {
        let gamma = ratio_squared(constellation, a, b).unwrap();
        let (a, b) = (
            correction_ns(constellation, a, reference, message).unwrap(),
            correction_ns(constellation, b, reference, message).unwrap(),
        );
        (gamma * a - b) / (gamma - 1.0)
    }

    #[test]
    fn the_pair_that_a_clock_refers_to_needs_no_correction() {
        for (constellation, pair, reference, message) in [
            (Gps, (b'1', b'2'), Broadcast, Lnav),
            (Gps, (b'1', b'2'), IonosphereFree, Lnav),
            (Galileo, (b'1', b'7'), Broadcast, GalileoInav),
            (Galileo, (b'1', b'5'), Broadcast, GalileoFnav),
            (Galileo, (b'1', b'5'), IonosphereFree, GalileoInav),
            (Beidou, (b'2', b'6'), IonosphereFree, BeidouD1D2),
        ] {
            let left = combined(constellation, pair, reference, message);
            assert!(left.abs() < 1e-12, "{constellation:?} {pair:?} {reference:?}: {left} ns");
        }
    }

    #[test]
    fn single_signals_have_the_icds_terms() {
        let close = |value: Option<f64>, expected: f64| {
            assert!((value.unwrap() - expected).abs() < 1e-3, "{value:?}");
        };
        close(correction_ns(Gps, b'1', Broadcast, Lnav), -1.0);
        close(correction_ns(Gps, b'2', Broadcast, Lnav), -1.647);
        close(correction_ns(Galileo, b'1', Broadcast, GalileoInav), -4.0);
        close(correction_ns(Galileo, b'1', Broadcast, GalileoFnav), -1.0);
        close(correction_ns(Galileo, b'5', IonosphereFree, GalileoInav), -1.793);
        close(correction_ns(Beidou, b'2', Broadcast, BeidouD1D2), -1.0);
        close(correction_ns(Beidou, b'6', Broadcast, BeidouD1D2), 0.0);
        close(correction_ns(Beidou, b'2', IonosphereFree, BeidouD1D2), 1.944);
        assert_eq!(correction_ns(Gps, b'5', Broadcast, Lnav), None);
        assert_eq!(correction_ns(Beidou, b'5', Broadcast, BeidouD1D2), None);
        assert_eq!(correction_ns(Constellation::Glonass, b'1', Broadcast, Lnav), None);
    }

    #[test]
    fn glonass_clocks_are_those_of_l1_or_of_the_pair() {
        let correct = |band, reference, delay| {
            glonass_correction_m(SignalCode::new(band, b'C'), reference, delay)
                .map(|m| m / SPEED_OF_LIGHT_MPS * 1e9)
        };
        assert_eq!(correct(b'1', Broadcast, None), Some(0.0));
        assert_eq!(correct(b'1', IonosphereFree, None), None);
        assert_eq!(correct(b'2', Broadcast, None), None);
        assert_eq!(correct(b'3', Broadcast, Some(5e-9)), None);
        assert!((correct(b'2', Broadcast, Some(5e-9)).unwrap() + 5.0).abs() < 1e-12);
        // The pair needs no correction relative to its own clock.
        let gamma = 81.0 / 49.0;
        let of = |band| correct(band, IonosphereFree, Some(5e-9)).unwrap();
        assert!((gamma * of(b'1') - of(b'2')).abs() < 1e-12);
    }

    /// The two Galileo messages' clocks differ by their group delays, so the corrected E5a and E5b agree.
    #[test]
    fn both_galileo_messages_lead_to_the_same_signal_clock() {
        let between = |band: u8| {
            correction_ns(Galileo, band, Broadcast, GalileoInav).unwrap()
                - correction_ns(Galileo, band, Broadcast, GalileoFnav).unwrap()
        };
        assert!((between(b'1') - between(b'5')).abs() < 1e-12);
        assert!((between(b'1') - between(b'7')).abs() < 1e-12);
    }

    #[test]
    fn a_missing_delay_is_not_taken_for_zero() {
        let unknown = GroupDelays { first_s: f64::NAN, second_s: f64::NAN };
        let (gps, beidou) = (SatelliteId::new(Gps, 1), SatelliteId::new(Beidou, 1));
        assert_eq!(unknown.correction_m(gps, SignalCode::new(b'1', b'C'), Broadcast, Lnav), None);
        let b3 = SignalCode::new(b'6', b'I');
        assert_eq!(unknown.correction_m(beidou, b3, Broadcast, BeidouD1D2), Some(0.0));
        assert_eq!(unknown.correction_m(beidou, b3, IonosphereFree, BeidouD1D2), None);
    }

    #[test]
    fn beidous_second_delay_is_that_of_b2i() {
        let known = |number: u8, code: &[u8; 2]| {
            let signal = SignalCode::new(code[0], code[1]);
            DELAYS.correction_m(SatelliteId::new(Beidou, number), signal, Broadcast, BeidouD1D2).is_some()
        };
        for (code, of_2, of_3) in [
            (b"7I", true, false),
            (b"7 ", true, false),
            (b"7D", false, false),
            (b"2 ", true, true),
            (b"6 ", true, true),
            (b"6A", false, false),
            (b"1P", false, false),
        ] {
            assert_eq!((known(18, code), known(19, code)), (of_2, of_3), "{}", code.escape_ascii());
        }
    }
}
