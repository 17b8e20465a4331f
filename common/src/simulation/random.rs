//! Random streams: one seed, and an independent ChaCha stream for each independent process.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Number of bits for the satellite in the stream numbers of phones and vehicles.
const SATELLITE_BITS: u32 = 16;
/// First stream number of the vehicles, beyond those of the phones.
const VEHICLES: u64 = 1 << 40;
/// First stream number of the satellites' slow biases.
const SATELLITE_BIASES: u64 = 1 << 41;
/// Stream number of the ionosphere residual.
const IONOSPHERE: u64 = 1 << 42;
/// First stream number of the façades.
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

    /// Orbits, clocks and delays of the satellites.
    pub(super) fn world(self) -> ChaCha8Rng {
        self.stream(0)
    }

    /// Errors of the satellites that are not in the navigation messages.
    pub(super) fn satellite_errors(self) -> ChaCha8Rng {
        self.stream(1)
    }

    /// Slow bias of a satellite, the same at all phones.
    pub(super) fn satellite_bias(self, satellite: usize) -> ChaCha8Rng {
        self.stream(SATELLITE_BIASES | satellite as u64)
    }

    /// Ionosphere residual, the same at all phones.
    pub(super) fn ionosphere(self) -> ChaCha8Rng {
        self.stream(IONOSPHERE)
    }

    /// Clock and receiver biases of a phone.
    pub(super) fn phone(self, phone: usize) -> ChaCha8Rng {
        self.stream((phone as u64 + 1) << SATELLITE_BITS)
    }

    /// Processes of a satellite at a phone.
    pub(super) fn satellite(self, phone: usize, satellite: usize) -> ChaCha8Rng {
        self.stream((phone as u64 + 1) << SATELLITE_BITS | (satellite as u64 + 1))
    }

    /// Processes of a satellite at a vehicle.
    pub(super) fn vehicle(self, vehicle: usize, satellite: usize) -> ChaCha8Rng {
        self.stream(VEHICLES | (vehicle as u64 + 1) << SATELLITE_BITS | (satellite as u64 + 1))
    }

    /// Reflectivity of a piece of a façade by its place along the road and in height.
    pub(super) fn facade(self, right: bool, along: u32, up: u16) -> ChaCha8Rng {
        self.stream(FACADES | u64::from(right) << 48 | u64::from(along) << 16 | u64::from(up))
    }

    fn stream(self, stream: u64) -> ChaCha8Rng {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(stream);
        random
    }
}
