//! Interpolation of precise orbits and clocks.
//!
//! Positions are rotated into an inertial frame, in which an orbit is smooth, and interpolated there by a
//! polynomial through 8 to 11 equidistant nodes (Horemuž and Andersson 2006: ten and more at 15 min give
//! millimetres). One rotation leads back to the Earth-fixed frame of the instant.

use nalgebra::Vector3;

use super::clocks::ClockState;
use super::records::Sp3Position;
use super::{ClockReference, OrbitError, SatelliteState};
use crate::constants::{EARTH_ROTATION_RADPS, GRAVITY_M3PS2, SPEED_OF_LIGHT_MPS};
use crate::frames::{Ecef, EcefVector};
use crate::gnss::SatelliteId;
use crate::time::GpsTime;

/// Minimum number of nodes of an interpolation.
pub const MIN_NODES: usize = 8;
/// Maximum number of nodes of an interpolation.
pub const MAX_NODES: usize = 11;
/// Standard deviation of precise orbit and 15-minute clock together, m.
const SIGMA_M: f64 = 0.1;

/// Reciprocal node products of equidistant Lagrange interpolation, by number of nodes: for n nodes and node j,
/// 1 / Π(j − i) over i ≠ j.
const NODE_FACTORS: [[f64; MAX_NODES]; MAX_NODES + 1] = node_factors();

const fn node_factors() -> [[f64; MAX_NODES]; MAX_NODES + 1] {
    let mut factors = [[0.0; MAX_NODES]; MAX_NODES + 1];
    let mut n = 1;
    while n <= MAX_NODES {
        let mut j = 0;
        while j < n {
            let mut product = 1.0;
            let mut i = 0;
            while i < n {
                if i != j {
                    product *= j as f64 - i as f64;
                }
                i += 1;
            }
            factors[n][j] = 1.0 / product;
            j += 1;
        }
        n += 1;
    }
    factors
}

/// One node, in the inertial frame that coincides with the Earth-fixed frame at the first node of the run.
#[derive(Clone, Copy, Debug)]
struct Node {
    position: Vector3<f64>,
    clock_s: Option<f64>,
}

/// Equidistant nodes without a gap.
#[derive(Clone, Debug)]
struct Run {
    first: GpsTime,
    interval_s: f64,
    nodes: Vec<Node>,
}

/// A satellite's precise orbit.
#[derive(Clone, Debug, Default)]
pub(super) struct PreciseOrbit {
    runs: Vec<Run>,
    span: Option<(GpsTime, GpsTime)>,
}

impl PreciseOrbit {
    /// Adds positions of one file, in order of time. Positions covered by a run of the same interval are dropped.
    pub(super) fn add(&mut self, interval_s: f64, positions: &[Sp3Position]) {
        for node in positions {
            self.push(interval_s, node);
        }
    }

    fn push(&mut self, interval_s: f64, node: &Sp3Position) {
        if self.runs.iter().any(|run| run.interval_s == interval_s && run.covers(node.time)) {
            return;
        }
        let (first, last) = self.span.unwrap_or((node.time, node.time));
        self.span = Some((first.min(node.time), last.max(node.time)));
        match self.runs.iter_mut().find(|run| run.continues(interval_s, node.time)) {
            Some(run) => run.push(node),
            None => self.runs.push(Run::new(interval_s, node)),
        }
    }

    /// State at an instant, with the given clock or else the orbit's own.
    pub(super) fn state(
        &self,
        satellite: SatelliteId,
        time: GpsTime,
        clock: Option<ClockState>,
    ) -> Result<SatelliteState, OrbitError> {
        let (first, last) = self.span.ok_or(OrbitError::Unknown { satellite })?;
        let mut why = OrbitError::NotCovered { satellite, time, first, last };
        for run in &self.runs {
            match run.state(time, clock) {
                Ok(state) => return Ok(state),
                Err(Lack::Position) => {}
                Err(Lack::Clock) => why = OrbitError::NoClock { satellite, time },
                Err(Lack::Nodes) => {
                    why = OrbitError::TooFewNodes { satellite, time, nodes: run.nodes.len() };
                }
            }
        }
        Err(why)
    }
}

/// Reason for a missing state in a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Lack {
    /// The instant is outside the run.
    Position,
    /// The run is too short.
    Nodes,
    Clock,
}

/// Position and velocity in an inertial frame.
struct Inertial {
    position: Vector3<f64>,
    velocity: Vector3<f64>,
}

impl Run {
    fn new(interval_s: f64, node: &Sp3Position) -> Self {
        let mut run = Self { first: node.time, interval_s, nodes: Vec::new() };
        run.push(node);
        run
    }

    fn covers(&self, time: GpsTime) -> bool {
        let last = self.first + self.interval_s * self.nodes.len().saturating_sub(1) as f64;
        self.first <= time && time <= last
    }

    fn continues(&self, interval_s: f64, time: GpsTime) -> bool {
        self.interval_s == interval_s && self.first + interval_s * self.nodes.len() as f64 == time
    }

    fn push(&mut self, node: &Sp3Position) {
        let turned = EARTH_ROTATION_RADPS * (node.time - self.first);
        self.nodes.push(Node { position: turn(&node.position.0, turned), clock_s: node.clock_s });
    }

    fn state(&self, time: GpsTime, clock: Option<ClockState>) -> Result<SatelliteState, Lack> {
        let elapsed_s = time - self.first;
        let steps = elapsed_s / self.interval_s;
        if !(0.0..=self.nodes.len().saturating_sub(1) as f64).contains(&steps) {
            return Err(Lack::Position);
        }
        if self.nodes.len() < MIN_NODES {
            return Err(Lack::Nodes);
        }
        let clock = match clock {
            Some(clock) => clock,
            None => self.clock(steps).ok_or(Lack::Clock)?,
        };
        let inertial = self.interpolate(steps).ok_or(Lack::Position)?;
        let turned = -EARTH_ROTATION_RADPS * elapsed_s;
        let position = turn(&inertial.position, turned);
        let carried = Vector3::new(-position.y, position.x, 0.0) * EARTH_ROTATION_RADPS;
        let velocity = turn(&inertial.velocity, turned) - carried;
        let relativity = Relativity::of(&inertial);
        Ok(SatelliteState {
            position: Ecef(position),
            velocity: EcefVector(velocity),
            clock_s: clock.offset_s + relativity.offset_s,
            clock_drift_sps: clock.drift_sps + relativity.drift_sps,
            sigma_m: SIGMA_M,
            clock_reference: ClockReference::IonosphereFree,
        })
    }

    /// Clock offset and drift, linear between the two adjacent nodes.
    fn clock(&self, steps: f64) -> Option<ClockState> {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within the nodes
        let left = (steps as usize).min(self.nodes.len() - 2);
        let (a, b) = (self.nodes.get(left)?.clock_s?, self.nodes.get(left + 1)?.clock_s?);
        Some(ClockState {
            offset_s: a + (b - a) * (steps - left as f64),
            drift_sps: (b - a) / self.interval_s,
        })
    }

    /// Polynomial through the nodes around `steps` (in node distances from the first), with its derivative.
    fn interpolate(&self, steps: f64) -> Option<Inertial> {
        let count = self.nodes.len().min(MAX_NODES);
        // An odd number of nodes is centred on the nearest node, an even number on the interval.
        let centre = if count % 2 == 1 { steps.round() } else { steps.floor() };
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within the nodes
        let start = (centre as usize).saturating_sub((count - 1) / 2).min(self.nodes.len() - count);
        let nodes = self.nodes.get(start..start + count)?;
        let weights = lagrange(steps - start as f64, count);
        let mut position = Vector3::zeros();
        let mut velocity = Vector3::zeros();
        for (node, (value, slope)) in nodes.iter().zip(weights) {
            position += node.position * value;
            velocity += node.position * slope;
        }
        Some(Inertial { position, velocity: velocity / self.interval_s })
    }
}

/// Lagrange weights at `x` for nodes 0, 1, … `count` − 1, and their derivatives, from products of the
/// differences left and right of each node. Without a division the nodes are no special case.
fn lagrange(x: f64, count: usize) -> [(f64, f64); MAX_NODES] {
    let mut weights = [(0.0, 0.0); MAX_NODES];
    let mut left = (1.0, 0.0);
    for (node, weight) in weights.iter_mut().enumerate().take(count) {
        *weight = left;
        let factor = x - node as f64;
        left = (left.0 * factor, left.1 * factor + left.0);
    }
    let mut right = (1.0, 0.0);
    let factors = NODE_FACTORS.get(count).unwrap_or(&[0.0; MAX_NODES]);
    for (node, (weight, scale)) in weights.iter_mut().zip(factors).enumerate().take(count).rev() {
        let (value, slope) = *weight;
        *weight = (scale * value * right.0, scale * (slope * right.0 + value * right.1));
        let factor = x - node as f64;
        right = (right.0 * factor, right.1 * factor + right.0);
    }
    weights
}

/// Rotation of a vector about the Earth's axis by an angle, rad.
fn turn(vector: &Vector3<f64>, angle_rad: f64) -> Vector3<f64> {
    let (sin, cos) = angle_rad.sin_cos();
    Vector3::new(cos * vector.x - sin * vector.y, sin * vector.x + cos * vector.y, vector.z)
}

/// Periodic relativistic clock term −2 r·v/c² (IS-GPS-200, 20.3.3.3.3.1) and its rate on a Kepler orbit.
struct Relativity {
    offset_s: f64,
    drift_sps: f64,
}

impl Relativity {
    fn of(state: &Inertial) -> Self {
        let scale = -2.0 / (SPEED_OF_LIGHT_MPS * SPEED_OF_LIGHT_MPS);
        let energy = state.velocity.norm_squared() - GRAVITY_M3PS2 / state.position.norm();
        Self { offset_s: scale * state.position.dot(&state.velocity), drift_sps: scale * energy }
    }
}
