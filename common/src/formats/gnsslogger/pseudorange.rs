//! Pseudoranges from times of reception and transmission.
//!
//! P = c·(t_rx − t_tx), t_rx = TimeNanos + TimeOffsetNanos − (FullBiasNanos + BiasNanos), t_tx = ReceivedSvTimeNanos
//! (Android API; GSA White Paper "Using GNSS raw measurements on Android devices", 2.4). Whole nanoseconds, numbers near
//! 10¹⁸, are integers throughout: a double would lose 128 ns, or 38 m. t_tx is known modulo a period (a week, a day, a subframe, page,
//! string or secondary code), and so is the difference; travel times of 0.07 to 0.14 s make it unique.

use crate::constants::SPEED_OF_LIGHT_MPS;
use crate::gnss::Constellation;
use crate::time::GpsTime;

const NANOS: i64 = 1_000_000_000;
const WEEK_NS: i64 = 604_800 * NANOS;
const DAY_NS: i64 = 86_400 * NANOS;
const NANOS_PER_MILLI: i64 = NANOS / 1_000;
/// Times of travel that are known modulo a period are taken from half of it before this on to half of it after. Galileo's,
/// of 77 to 97 ms, stand in the middle of 100 ms then, so that a clock may be off by 40 ms either way.
const MIDDLE_TRAVEL_NS: i64 = 87 * NANOS_PER_MILLI;
const BEIDOU_BEHIND_GPS_NS: i64 = 14 * NANOS;
const GLONASS_AHEAD_OF_UTC_NS: i64 = 3 * 3_600 * NANOS;
/// Metres that light travels in a nanosecond.
const METRES_PER_NS: f64 = SPEED_OF_LIGHT_MPS * 1e-9;

/// Time of a measurement by the phone's estimate of GPS time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ReceiveTime {
    /// Nanoseconds since 1980-01-06.
    pub(super) whole_ns: i64,
    /// Addition to the whole nanoseconds, ns; may be longer than 1 ns.
    pub(super) fraction_ns: f64,
}

impl ReceiveTime {
    /// The nearest nanosecond.
    pub(super) fn gps(self) -> GpsTime {
        #[allow(clippy::cast_possible_truncation)] // saturates; absurd values fail the range check
        let rounded = self.fraction_ns.round() as i64;
        GpsTime::from_nanos(self.whole_ns.saturating_add(rounded))
    }
}

/// The scale in which a satellite's time counts, against GPS time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(clippy::struct_field_names)] // the unit
pub(super) struct TransmitScale {
    period_ns: i64,
    /// The scale's reading minus GPS time.
    ahead_ns: i64,
    /// Shortest time of travel, by a clock that may be wrong.
    shortest_ns: i64,
}

impl TransmitScale {
    /// Time of week; GLONASS: time of day of UTC + 3 h. Any clock error below a hundredth of the period is let pass.
    pub(super) fn full(constellation: Constellation, leap_seconds: i64) -> Self {
        let (period_ns, ahead_ns) = match constellation {
            Constellation::Glonass => (DAY_NS, GLONASS_AHEAD_OF_UTC_NS - leap_seconds * NANOS),
            Constellation::Beidou => (WEEK_NS, -BEIDOU_BEHIND_GPS_NS),
            _ => (WEEK_NS, 0),
        };
        Self { period_ns, ahead_ns, shortest_ns: -period_ns / 100 }
    }

    /// The same where the time is known only modulo a period, of which weeks and days are multiples.
    pub(super) fn modulo(self, period_ms: u32) -> Self {
        let period_ns = i64::from(period_ms.max(1)) * NANOS_PER_MILLI;
        Self { period_ns, shortest_ns: MIDDLE_TRAVEL_NS - period_ns / 2, ..self }
    }

    /// Pseudorange, m. `None` on overflow.
    pub(super) fn pseudorange_m(self, receive: ReceiveTime, received_sv_time_ns: i64) -> Option<f64> {
        let reading = receive.whole_ns.checked_add(self.ahead_ns)?;
        let difference = reading.checked_sub(received_sv_time_ns)?;
        let travel_ns =
            difference.checked_sub(self.shortest_ns)?.rem_euclid(self.period_ns) + self.shortest_ns;
        Some((travel_ns as f64 + receive.fraction_ns) * METRES_PER_NS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn receive(time: &str) -> ReceiveTime {
        ReceiveTime { whole_ns: time.parse::<GpsTime>().unwrap().nanos(), fraction_ns: 0.0 }
    }

    #[test]
    fn a_signal_sent_before_the_week_ends_arrives_after() {
        let scale = TransmitScale::full(Constellation::Gps, 18);
        let sunday = receive("2023-11-05T00:00:00.02");
        let range = scale.pseudorange_m(sunday, WEEK_NS - 50_000_000).unwrap();
        assert!((range - 0.07 * SPEED_OF_LIGHT_MPS).abs() < 1e-6, "{range}");
    }

    #[test]
    fn glonass_days_end_at_21_h_utc() {
        let scale = TransmitScale::full(Constellation::Glonass, 18);
        // 21:00:00.01 UTC is 0:00:00.01 in Moscow.
        let after = receive("2023-11-07T21:00:18.01");
        let range = scale.pseudorange_m(after, DAY_NS - 60_000_000).unwrap();
        assert!((range - 0.07 * SPEED_OF_LIGHT_MPS).abs() < 1e-6, "{range}");
    }

    #[test]
    fn beidou_is_14_s_behind() {
        let scale = TransmitScale::full(Constellation::Beidou, 18);
        let start = receive("2023-11-05T00:00:14.00");
        let range = scale.pseudorange_m(start, WEEK_NS - 120_000_000).unwrap();
        assert!((range - 0.12 * SPEED_OF_LIGHT_MPS).abs() < 1e-6, "{range}");
    }

    #[test]
    fn numbers_at_the_end_of_their_type_are_no_pseudorange() {
        let scale = TransmitScale::full(Constellation::Gps, 18);
        let late = ReceiveTime { whole_ns: i64::MAX, fraction_ns: 0.0 };
        assert_eq!(scale.pseudorange_m(late, -1), None);
        assert_eq!(scale.pseudorange_m(ReceiveTime { whole_ns: i64::MIN, fraction_ns: 0.0 }, 1), None);
    }

    proptest! {
        /// Whatever the week, the nanoseconds come through: a double's 128 ns would be 38 m.
        #[test]
        fn nanoseconds_survive(week in 1_900_i64..3_000, tow_ns in 0..WEEK_NS, travel_ns in 60_000_000_i64..150_000_000) {
            let sent = week * WEEK_NS + tow_ns;
            let receive = ReceiveTime { whole_ns: sent + travel_ns, fraction_ns: 0.25 };
            let expected = (travel_ns as f64 + 0.25) * METRES_PER_NS;
            let scale = TransmitScale::full(Constellation::Gps, 18);
            prop_assert_eq!(scale.pseudorange_m(receive, tow_ns), Some(expected));
            let beidou = TransmitScale::full(Constellation::Beidou, 18);
            let tow_beidou = (tow_ns - BEIDOU_BEHIND_GPS_NS).rem_euclid(WEEK_NS);
            prop_assert_eq!(beidou.pseudorange_m(receive, tow_beidou), Some(expected));
            let glonass = TransmitScale::full(Constellation::Glonass, 18);
            let of_day = (sent + GLONASS_AHEAD_OF_UTC_NS - 18 * NANOS).rem_euclid(DAY_NS);
            prop_assert_eq!(glonass.pseudorange_m(receive, of_day), Some(expected));
        }

        /// Times modulo a period are enough for clocks that are off by less than half of it, whatever else the time has.
        #[test]
        fn periods_are_resolved_by_the_phones_time(
            sent in 1_000_000_000_000_000_000_i64..1_500_000_000_000_000_000,
            travel_ns in 38_000_000_i64..136_000_000,
            leap_seconds in 15..20_i64,
        ) {
            let receive = ReceiveTime { whole_ns: sent + travel_ns, fraction_ns: 0.0 };
            for (system, period_ms) in [
                (Constellation::Galileo, 100),
                (Constellation::Galileo, 2_000),
                (Constellation::Gps, 6_000),
                (Constellation::Beidou, 600),
                (Constellation::Beidou, 6_000),
                (Constellation::Glonass, 2_000),
                (Constellation::Sbas, 1_000),
            ] {
                let ahead_ns = match system {
                    Constellation::Glonass => GLONASS_AHEAD_OF_UTC_NS - leap_seconds * NANOS,
                    Constellation::Beidou => -BEIDOU_BEHIND_GPS_NS,
                    _ => 0,
                };
                let scale = TransmitScale::full(system, leap_seconds).modulo(period_ms);
                let reading = (sent + ahead_ns).rem_euclid(i64::from(period_ms) * NANOS_PER_MILLI);
                let half_ns = i64::from(period_ms) * NANOS_PER_MILLI / 2;
                for off_ns in [0, 70_000_000 - half_ns, half_ns - 70_000_000] {
                    let off = ReceiveTime { whole_ns: receive.whole_ns + off_ns, ..receive };
                    let expected = (travel_ns + off_ns) as f64 * METRES_PER_NS;
                    if period_ms == 100 && off_ns != 0 {
                        continue;
                    }
                    prop_assert_eq!(scale.pseudorange_m(off, reading), Some(expected), "{:?} {}", system, period_ms);
                }
            }
        }
    }
}
