//! The kinds of constraints, one file each with everything about its kind.
//!
//! A kind is a struct of phones and bounds that implements [`ConstraintKind`], and a line in the list below. The list generates the
//! enum [`Constraint`] and gives the kind its one name in session files, reports and recordings.

mod distance;
mod fields;
mod heading;
mod height;
mod same_vehicle;
mod shell;
mod speed;
mod vertical_velocity;

use nalgebra::{DVector, Matrix3, Vector3};
use serde::{Deserialize, Serialize};

pub use distance::Distance;
pub use heading::Heading;
pub use height::Height;
pub use same_vehicle::SameVehicle;
pub use speed::Speed;
pub use vertical_velocity::VerticalVelocity;

use super::SkipReason;
use super::options::ConstraintOptions;
use super::prior::{FreePhone, Prior};
use super::rows::{Rows, Terms, part, position};
use super::truncation::Interval;
use crate::frames::{EcefVector, Enu, LocalFrame};

/// Length below which a vector has no direction: 1 mm, 1 mm/s.
pub(super) const NO_DIRECTION: f64 = 1e-3;

/// Properties of a kind of constraint.
pub trait ConstraintKind {
    /// The constrained phones, by their index in the state.
    fn phones(&self) -> &[usize];

    /// The same indices, mutable.
    fn phones_mut(&mut self) -> &mut [usize];

    /// Whether the bounds are valid.
    fn has_valid_bounds(&self) -> bool;

    /// Interval of the value (see [`ConstraintKind::value`]) in its unit.
    fn bounds(&self) -> Interval;

    /// The vector that the constraint bounds. Velocities are means over the next `horizon_s`, v + ½a·horizon; 0 uses the velocity itself.
    fn terms(&self, horizon_s: f64) -> Terms;

    /// The constrained quantity for a vector and the local frame of the first phone; `None` if it is not defined there.
    fn value(&self, vector: &Vector3<f64>, frame: &LocalFrame) -> Option<f64>;

    /// Whether the constraint applies to the state. Otherwise it is left out and not reported.
    ///
    /// # Errors
    /// [`SkipReason::NotFinite`] if the state is not finite.
    fn applies(&self, at: &Quantity<'_>) -> Result<bool, SkipReason> {
        let _ = at;
        Ok(true)
    }

    /// The bounded rows, linearised at a distribution; no rows if the constraint does not apply there.
    ///
    /// # Errors
    /// [`SkipReason::NotFinite`] if the covariance is not finite.
    fn rows(&self, at: &Quantity<'_>) -> Result<Rows, SkipReason>;

    /// The vector whose length is bounded, if any: its rows are relinearised along the vector. `None`: the rows are linear and valid for
    /// all states.
    fn length(&self) -> Option<&dyn BoundedLength> {
        None
    }

    /// Whether an enlargement widens the bounds of the constraint (see [`ConstraintKind::widened`]) instead of the interval of each row.
    fn widens_as_a_whole(&self) -> bool {
        false
    }

    /// The constraint with bounds `factor` times as wide; `None` if they cannot be wider.
    fn widened(&self, factor: f64) -> Option<Constraint> {
        let _ = factor;
        None
    }

    /// Unit of the value in text.
    fn unit(&self) -> Unit;

    /// The bounds in words, with their unit.
    fn bounds_in_words(&self) -> String;
}

/// A vector with a bounded length that is linear in the constraint's vector; by default it is that vector.
pub trait BoundedLength: ConstraintKind {
    /// The vector of bounded length for the constraint's vector, or its change for a change of that.
    fn bounded(&self, vector: &Vector3<f64>, frame: &LocalFrame) -> Vector3<f64> {
        let _ = frame;
        *vector
    }

    /// The rows for a linearisation along `direction`, a unit vector. The first row is that along the direction.
    fn rows_along(&self, at: &Quantity<'_>, direction: &Vector3<f64>) -> Rows {
        self.bounds().shell_along(at, direction)
    }
}

/// Distribution of a constraint's vector, with what its rows depend on.
#[derive(Clone, Copy)]
pub struct Quantity<'a> {
    /// Mean of the vector.
    pub mean: Vector3<f64>,
    /// Covariance of the vector.
    pub covariance: Matrix3<f64>,
    /// Local frame of the constraint's first phone.
    pub frame: &'a LocalFrame,
    /// Options of the constraints.
    pub options: &'a ConstraintOptions,
}

impl Quantity<'_> {
    /// A vector as a velocity in the local frame, m/s.
    pub fn velocity(&self) -> Enu {
        self.frame.vector_ecef_to_enu(EcefVector(self.mean))
    }

    /// The row along a direction of the local frame.
    pub fn axis(&self, direction: Enu) -> Vector3<f64> {
        self.frame.vector_enu_to_ecef(direction).0
    }

    /// Variance of the component along a direction of the local frame.
    pub fn variance(&self, direction: Enu) -> f64 {
        let axis = self.axis(direction);
        axis.dot(&(self.covariance * axis))
    }

    /// Standard deviation of the horizontal component: root of the sum of the east and north variances.
    pub fn horizontal_sigma(&self) -> f64 {
        let east = self.variance(Enu { east: 1.0, north: 0.0, up: 0.0 });
        let north = self.variance(Enu { east: 0.0, north: 1.0, up: 0.0 });
        (east + north).sqrt()
    }
}

/// Unit and format of a value in text.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    /// Name of the unit with the preceding space, as ` m/s`.
    pub name: &'static str,
    /// Number of units per SI unit.
    pub per_si: f64,
    /// Number of decimals.
    pub decimals: usize,
}

impl Unit {
    const METRES: Self = Self { name: " m", per_si: 1.0, decimals: 2 };
    const METRES_PER_SECOND: Self = Self { name: " m/s", per_si: 1.0, decimals: 2 };

    /// Text of a change of a value: `12.00 → 5.00 m`.
    pub fn change(&self, before: f64, after: f64) -> String {
        let Self { name, per_si, decimals } = *self;
        format!("{:.decimals$} → {:.decimals$}{name}", before * per_si, after * per_si)
    }
}

/// Generates the enum of all kinds. Each line: name, type.
macro_rules! kinds {
    ($($(#[$doc:meta])* $name:literal $kind:ident;)*) => {
        /// A constraint on phones, by their index in the joint state.
        ///
        /// Its written form consists of the name of its kind as `kind` and the keys of that kind: bounds with their unit; any other key is
        /// an error. Phones are not part of it, because files use their names: see [`Constraint::among`].
        #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(tag = "kind")]
        pub enum Constraint {
            $($(#[$doc])* #[serde(rename = $name)] $kind($kind),)*
        }

        impl Constraint {
            /// The names of all kinds.
            pub const KINDS: &'static [&'static str] = &[$($name),*];

            /// Name of the kind.
            pub const fn name(&self) -> &'static str {
                match self {
                    $(Self::$kind(_) => $name,)*
                }
            }

            /// The keys of the kind with this name; empty if there is no such kind.
            pub fn keys(name: &str) -> &'static [&'static str] {
                match name {
                    $($name => fields::of::<$kind>(),)*
                    _ => &[],
                }
            }

            pub(super) const fn kind(&self) -> &dyn ConstraintKind {
                match self {
                    $(Self::$kind(kind) => kind,)*
                }
            }

            const fn kind_mut(&mut self) -> &mut dyn ConstraintKind {
                match self {
                    $(Self::$kind(kind) => kind,)*
                }
            }
        }

        $(impl From<$kind> for Constraint {
            fn from(kind: $kind) -> Self {
                Self::$kind(kind)
            }
        })*
    };
}

kinds! {
    /// The distance of two phones.
    "distance" Distance;
    /// The vertical velocity of a phone.
    "vertical-velocity" VerticalVelocity;
    /// The course of a phone.
    "heading" Heading;
    /// The horizontal speed of a phone.
    "speed" Speed;
    /// The ellipsoidal height of a phone.
    "height" Height;
    /// The difference of two phones' velocities.
    "same-vehicle" SameVehicle;
}

impl Constraint {
    /// The constrained phones.
    pub fn phones(&self) -> &[usize] {
        self.kind().phones()
    }

    /// The constraint with other phone indices; `None` if a phone has none.
    pub fn mapped(mut self, index: impl Fn(usize) -> Option<usize>) -> Option<Self> {
        for phone in self.kind_mut().phones_mut() {
            *phone = index(*phone)?;
        }
        Some(self)
    }

    /// The constraint for each phone, or, for a constraint on two phones, for each pair, in their order.
    pub fn among(&self, phones: &[usize]) -> Vec<Self> {
        let of = |chosen: &[usize]| {
            let mut constraint = *self;
            constraint.kind_mut().phones_mut().copy_from_slice(chosen);
            constraint
        };
        if self.phones().len() == 1 {
            return phones.iter().map(|&phone| of(&[phone])).collect();
        }
        let after = |n: usize| phones.iter().skip(n + 1);
        phones.iter().enumerate().flat_map(|(n, &i)| after(n).map(move |&j| of(&[i, j]))).collect()
    }

    /// The constrained quantity in a joint state: distance (m), vertical velocity (m/s, positive up), speed (m/s), height (m), difference of velocities (m/s) or angle off the course
    /// (rad, in (−π, π], positive to the right).
    ///
    /// Velocities are means over the next `horizon_s`, v + ½a·horizon; 0 uses the velocity itself. `None` if the state does not contain the
    /// phones or is not finite, and for the course of a phone without horizontal velocity.
    pub fn value(&self, state: &DVector<f64>, horizon_s: f64) -> Option<f64> {
        let frame = LocalFrame::at(position(state, *self.phones().first()?)?);
        let vector = self.kind().terms(horizon_s).sum(|phone, which| part(state, phone, which))?;
        self.value_of(&vector, &frame)
    }

    /// The same among independent phones.
    pub fn value_among(&self, phones: &[FreePhone], horizon_s: f64) -> Option<f64> {
        let frame = phones.frame(*self.phones().first()?)?;
        self.value_of(&phones.mean(&self.kind().terms(horizon_s))?, frame)
    }

    /// The constrained quantity for its vector and the local frame of the first phone.
    pub(super) fn value_of(&self, vector: &Vector3<f64>, frame: &LocalFrame) -> Option<f64> {
        self.kind().value(vector, frame).filter(|value| value.is_finite())
    }

    /// Whether a value (see [`Constraint::value`]) is within the bounds.
    pub fn holds(&self, value: f64) -> bool {
        self.excess(value) == 0.0
    }

    /// Distance of a value from the bounds in its unit; 0 inside, NaN for NaN.
    pub fn excess(&self, value: f64) -> f64 {
        self.kind().bounds().excess(value)
    }

    /// The bounds in words, with their unit.
    pub fn bounds_in_words(&self) -> String {
        self.kind().bounds_in_words()
    }

    /// Unit of the value in text.
    pub fn unit(&self) -> Unit {
        self.kind().unit()
    }
}

/// Checks a bound that must be above zero; infinity is allowed.
fn positive(key: &str, value: f64) -> Result<f64, String> {
    if value > 0.0 { Ok(value) } else { Err(format!("{key} is {value}; it must be above 0")) }
}

/// Checks a finite bound of at least zero.
fn not_negative(key: &str, value: f64, unit: &str) -> Result<f64, String> {
    if (0.0..f64::INFINITY).contains(&value) {
        Ok(value)
    } else {
        Err(format!("{key} is {value}; it must be a number of {unit} from 0 up"))
    }
}
