//! Groups with a phone that lies, and what is told of it.

use cofix_common::frames::{EcefVector, Enu, LocalFrame};
use cofix_common::fusion::engine::FusedEpoch;
use cofix_common::fusion::peers::{ErrorKind, EventKind};
use cofix_common::simulation::{ConvoyOptions, OwnMotion, Scenario, Traffic};
use cofix_common::time::GpsTime;
use cofix_common::wire::EpochMessage;

use crate::displaced::{displace, east_of};
use crate::group::Group;

const DURATION_S: f64 = 180.0;

/// What happened: time since the begin, s, phones, kind.
pub type Told = (f64, Vec<usize>, EventKind);

/// A car of which the last phone lies from some second on. It drives at 14 m/s from 22 to 67 s, at 9 m/s to 92 s, at 14 m/s from 97 to 137 s, and
/// stands from 151 to 169 s.
#[derive(Clone, Copy)]
pub struct Car {
    pub phones: usize,
    pub seed: u64,
    pub begin_s: f64,
}

impl Car {
    pub const fn of(phones: usize) -> Self {
        Self { phones, seed: 1, begin_s: 60.0 }
    }

    pub const fn liar(self) -> usize {
        self.phones - 1
    }

    fn scenario(self) -> Scenario {
        Scenario { seed: self.seed, duration_s: DURATION_S, ..Scenario::car(self.phones) }
    }

    fn begin(self) -> GpsTime {
        self.scenario().start_gps + self.begin_s
    }

    pub fn honest(self) -> Group {
        Group::simulated(self.scenario())
    }

    /// The liar's messages are changed or dropped; `lie` gets the seconds since the begin.
    pub fn lying(self, lie: impl Fn(&Group, EpochMessage, f64) -> Option<EpochMessage>) -> Group {
        let mut group = self.honest();
        let messages = std::mem::take(&mut group.messages[self.liar()]);
        let told = |message: EpochMessage| {
            let lying_s = message.time_gps - self.begin();
            if lying_s < 0.0 { Some(message) } else { lie(&group, message, lying_s) }
        };
        group.messages[self.liar()] = messages.into_iter().filter_map(told).collect();
        group
    }

    /// The liar's pseudoranges and positions are those of a displaced place.
    pub fn displaced(self, by: impl Fn(&Group, f64) -> EcefVector) -> Group {
        self.lying(|group, mut message, lying_s| {
            let place = group.simulation.truth_at(self.liar(), message.time_gps).position;
            displace(&mut message, place, by(group, lying_s));
            Some(message)
        })
    }

    /// The way back to where the liar was at the begin.
    pub fn back(self, group: &Group, lying_s: f64) -> EcefVector {
        let at = |time_gps| group.simulation.truth_at(self.liar(), time_gps).position;
        at(self.begin()) - at(self.begin() + lying_s)
    }

    /// The liar's epochs belong to another second.
    pub fn of_another_second(self, by_s: f64) -> Group {
        self.lying(|_, mut message, lying_s| {
            message.time_gps = message.time_gps + by_s;
            message.changes_since_gps = message.changes_since_gps.map(|time_gps| time_gps + by_s);
            // What would come before an honest epoch is not sent.
            (lying_s + by_s >= 0.0).then_some(message)
        })
    }

    /// From the begin on the liar stands so far north of where it was then.
    pub fn standing(self, north_m: f64) -> Group {
        let mut group = self.honest();
        let there = group.simulation.truth_at(self.liar(), self.begin()).position;
        let north = LocalFrame::at(there).vector_enu_to_ecef(Enu { east: 0.0, north: north_m, up: 0.0 });
        let origin = (there + north).ecef_to_geodetic();
        let convoy = ConvoyOptions { traffic: Traffic::Standing, ..ConvoyOptions::default() };
        let elsewhere = Scenario { origin, convoy, canyons: Vec::new(), ..self.scenario() };
        let by = Group::simulated(elsewhere).messages.swap_remove(self.liar());
        let messages = &mut group.messages[self.liar()];
        messages.retain(|message| message.time_gps < self.begin());
        messages.extend(by.into_iter().filter(|message| message.time_gps >= self.begin()));
        group
    }

    /// From the begin on the liar moves with a velocity of its own relative to the car.
    pub fn leaving(self, velocity_mps: Enu) -> Group {
        let mut scenario = self.scenario();
        scenario.phones[self.liar()].motion = OwnMotion::departure(self.begin_s, velocity_mps);
        Group::simulated(scenario)
    }
}

/// Metres to the east.
pub fn east(group: &Group, metres: f64) -> EcefVector {
    let start = group.simulation.scenario().start_gps;
    east_of(group.simulation.truth_at(0, start).position, metres)
}

pub fn events(epochs: &[(f64, FusedEpoch)]) -> Vec<Told> {
    let told = |(second, epoch): &(f64, FusedEpoch)| {
        epoch.events.iter().map(|event| (*second, event.phones.clone(), event.kind)).collect::<Vec<_>>()
    };
    epochs.iter().flat_map(told).collect()
}

/// The kind of error of the first phone that is isolated.
pub fn first_error(epochs: &[(f64, FusedEpoch)]) -> Option<ErrorKind> {
    epochs.iter().flat_map(|(_, epoch)| &epoch.events).find_map(|event| event.error)
}

/// 95th percentile of a phone's horizontal error from a second on, m.
pub fn p95_m(group: &Group, phone: usize, epochs: &[(f64, FusedEpoch)], from_s: f64) -> f64 {
    let settled = epochs.iter().filter(|(second, _)| *second > from_s);
    let states: Vec<_> =
        settled.filter_map(|(_, epoch)| Some((epoch.time_gps, epoch.phones[phone].state.clone()?))).collect();
    group.accuracy(phone, &states).horizontal_p95_m
}
