//! Where randomness comes from: one seed, and a ChaCha stream for everything that is independent of the rest.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Streams of phones and vehicles have this many bits for the satellite.
const SATELLITE_BITS: u32 = 16;
/// First stream of the vehicles, beyond those of the phones.
const VEHICLES: u64 = 1 << 40;
/// First stream of the façades.
const FACADES: u64 = 1 << 62;

/// The random streams of one seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Streams {
    seed: u64,
}

impl Streams {
    pub(super) const fn new(seed: u64) -> Self {
        Self { seed }
    }

    /// The world's: orbits, clocks and delays of the satellites.
    pub(super) fn world(self) -> ChaCha8Rng {
        self.stream(0)
    }

    /// What the navigation messages do not tell about the satellites.
    pub(super) fn untold(self) -> ChaCha8Rng {
        self.stream(1)
    }

    /// A phone's clock and receiver biases.
    pub(super) fn phone(self, phone: usize) -> ChaCha8Rng {
        self.stream((phone as u64 + 1) << SATELLITE_BITS)
    }

    /// A satellite at a phone.
    pub(super) fn satellite(self, phone: usize, satellite: usize) -> ChaCha8Rng {
        self.stream((phone as u64 + 1) << SATELLITE_BITS | (satellite as u64 + 1))
    }

    /// A satellite at a vehicle.
    pub(super) fn vehicle(self, vehicle: usize, satellite: usize) -> ChaCha8Rng {
        self.stream(VEHICLES | (vehicle as u64 + 1) << SATELLITE_BITS | (satellite as u64 + 1))
    }

    /// A piece of a façade by its place along the road and in height.
    pub(super) fn facade(self, right: bool, (along, up): (u32, u16)) -> ChaCha8Rng {
        self.stream(FACADES | u64::from(right) << 48 | u64::from(along) << 16 | u64::from(up))
    }

    fn stream(self, stream: u64) -> ChaCha8Rng {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(stream);
        random
    }
}
