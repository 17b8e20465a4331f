//! Scenarios with a name.

use super::convoy::{ConvoyOptions, Traffic};
use super::mount::Mount;
use super::scenario::{PhoneOptions, STREET, Scenario};
use super::street::Canyon;

/// Mounts behind the windscreen and in the cup holder.
const WINDSCREEN: Mount = Mount::behind_glass(0.7, -0.2, 0.0);
const CUP_HOLDER: Mount = Mount::in_cabin(0.2, 0.0, -0.4);
/// Mounts in the car of the car scenario, used in turn; the last two at the side windows.
const CAR: [Mount; 4] =
    [WINDSCREEN, CUP_HOLDER, Mount::behind_glass(0.1, 0.5, 90.0), Mount::behind_glass(0.1, -0.5, 270.0)];
/// Mounts in each car of the canyon scenario, used in turn; the last on the roof.
const CAR_WITH_ROOF: [Mount; 3] = [WINDSCREEN, CUP_HOLDER, Mount::open(0.3, 0.0, 0.5)];
/// Mounts on a table.
const TABLE: [Mount; 4] = [
    Mount::open(0.0, 0.0, 0.0),
    Mount::open(0.0, 0.3, 0.0),
    Mount::open(0.3, 0.0, 0.0),
    Mount::open(0.3, 0.3, 0.0),
];
/// The old town of the canyon scenario, as distance along the road, m: from the first bend on, four tenths of a lap.
const OLD_TOWN_M: (f64, f64) = (700.0, 3_100.0);

impl Scenario {
    /// Cars with one phone each on the roof, following each other on a road with a street of four storeys.
    pub fn convoy(phones: usize) -> Self {
        Self { phones: (0..phones).map(PhoneOptions::of_vehicle).collect(), ..Self::default() }
    }

    /// Phones in one car on the same road: behind the windscreen, in the cup holder and at the side windows.
    pub fn car(phones: usize) -> Self {
        let phones = (0..phones).map(|index| mounted(index, 0, in_turn(&CAR, index))).collect();
        Self { phones, canyons: vec![Canyon::symmetric(2_100.0, 2_950.0, STREET)], ..Self::default() }
    }

    /// Two cars, one behind the other, with half of the phones each, behind the windscreen, in the cup holder and on the
    /// roof, driving in and out of an old town with narrow streets and side streets.
    pub fn canyon(phones: usize) -> Self {
        let per_car = phones.div_ceil(2).max(1);
        let phone = |index: usize| mounted(index, index / per_car, in_turn(&CAR_WITH_ROOF, index % per_car));
        Self {
            phones: (0..phones).map(phone).collect(),
            convoy: ConvoyOptions { standstill_gap_m: 8.0, ..ConvoyOptions::default() },
            canyons: Canyon::old_town(OLD_TOWN_M.0, OLD_TOWN_M.1),
            ..Self::default()
        }
    }

    /// Phones on a table under an open sky.
    pub fn stationary(phones: usize) -> Self {
        let convoy = ConvoyOptions { traffic: Traffic::Standing, ..ConvoyOptions::default() };
        let phones = (0..phones).map(|index| mounted(index, 0, in_turn(&TABLE, index))).collect();
        Self { phones, convoy, canyons: Vec::new(), ..Self::default() }
    }
}

fn mounted(index: usize, vehicle: usize, mount: Mount) -> PhoneOptions {
    PhoneOptions { vehicle, mount, ..PhoneOptions::of_vehicle(index) }
}

/// The mounts in turn; from the second round on displaced by a few centimetres.
fn in_turn(places: &[Mount], index: usize) -> Mount {
    let round = (index / places.len().max(1)) as f64;
    let place = places.get(index % places.len().max(1)).copied().unwrap_or_default();
    Mount { forward_m: place.forward_m + 0.1 * round, ..place }
}
