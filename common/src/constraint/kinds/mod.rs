//! The kinds of constraints, a file each, which holds everything about its kind.
//!
//! A kind is a struct of its phones and bounds that implements [`Kind`], and its line in the list below. The list makes the
//! enum [`Constraint`] of it, and gives the kind its one name, which session files, reports and recordings have.

mod distance;
mod fields;
mod heading;
mod speed;
mod vertical_velocity;

use nalgebra::{DMatrix, DVector, Vector3};
use serde::{Deserialize, Serialize};

pub use distance::Distance;
pub use heading::Heading;
pub use speed::Speed;
pub use vertical_velocity::VerticalVelocity;

use super::SkipReason;
use super::options::ConstraintOptions;
use super::rows::Rows;
use super::truncation::Interval;

/// Vectors shorter than this have no direction: 1 mm, 1 mm/s.
pub(super) const NO_DIRECTION: f64 = 1e-3;

/// What a kind of constraint has to say of itself.
pub trait Kind {
    /// The phones that it concerns, by their index in the state.
    fn phones(&self) -> &[usize];

    /// The same, to be replaced.
    fn phones_mut(&mut self) -> &mut [usize];

    /// Whether the bounds make sense.
    fn has_valid_bounds(&self) -> bool;

    /// Where the value lies (see [`Kind::value`]), in its unit.
    fn bounds(&self) -> Interval;

    /// The constrained quantity in a joint state. Velocities are mean ones over `horizon_s` to come, v + ½a·horizon; 0 takes the
    /// velocity itself. `None` when the state does not hold the phones or the quantity, or is not finite.
    fn value(&self, state: &DVector<f64>, horizon_s: f64) -> Option<f64>;

    /// Whether it has something to say of a state at all. A constraint that has not is left alone and not reported.
    ///
    /// # Errors
    /// [`SkipReason::NotFinite`] when the state cannot tell.
    fn applies(&self, at: &At<'_>) -> Result<bool, SkipReason> {
        let _ = at;
        Ok(true)
    }

    /// Its bounded rows, linearised at a state; none when it has nothing to say there.
    ///
    /// # Errors
    /// [`SkipReason::NotFinite`] when the state has no rows.
    fn rows(&self, at: &At<'_>) -> Result<Rows, SkipReason>;

    /// The vector whose length the kind bounds, when it does: its rows are turned with the vector. `None`: rows are linear
    /// and hold wherever the state goes.
    fn length(&self) -> Option<&dyn Length> {
        None
    }

    /// Whether an enlargement widens the bounds of the kind (see [`Kind::widened`]) instead of the interval of each row.
    fn widens_as_a_whole(&self) -> bool {
        false
    }

    /// The constraint with bounds `factor` times as wide; `None` when they cannot be wider.
    fn widened(&self, factor: f64) -> Option<Constraint> {
        let _ = factor;
        None
    }

    /// How its value is written for people.
    fn unit(&self) -> Unit;

    /// Its bounds in words, with their unit.
    fn bounds_in_words(&self) -> String;
}

/// A vector that is linear in the state, and whose length is bounded.
pub trait Length {
    /// The vector in a state; `None` when the state does not hold the phones or is not finite.
    fn vector(&self, at: &At<'_>) -> Option<Vector3<f64>>;

    /// By how much the vector changes when the state changes by this.
    fn change(&self, at: &At<'_>, change: &DVector<f64>) -> Option<Vector3<f64>>;

    /// The rows when the length is linearised along `direction`, a unit vector. The first is the one along it.
    fn rows_along(&self, at: &At<'_>, direction: &Vector3<f64>) -> Option<Rows>;
}

/// A state that constraints are asked about, and how they are applied.
#[derive(Clone, Copy)]
pub struct At<'a> {
    /// Mean of the joint state.
    pub state: &'a DVector<f64>,
    /// Its covariance.
    pub covariance: &'a DMatrix<f64>,
    /// How constraints are applied.
    pub options: &'a ConstraintOptions,
}

/// How a value is written for people.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    /// The unit as it follows a number, as ` m/s`.
    pub name: &'static str,
    /// How many there are in one SI unit.
    pub per_si: f64,
    /// Decimals that are worth reading.
    pub decimals: usize,
}

impl Unit {
    const METRES: Self = Self { name: " m", per_si: 1.0, decimals: 2 };
    const METRES_PER_SECOND: Self = Self { name: " m/s", per_si: 1.0, decimals: 2 };

    /// A change of a value: `12.00 → 5.00 m`.
    pub fn change(&self, before: f64, after: f64) -> String {
        let Self { name, per_si, decimals } = *self;
        format!("{:.decimals$} → {:.decimals$}{name}", before * per_si, after * per_si)
    }
}

/// Makes the enum of all kinds. Each line: name, type.
macro_rules! kinds {
    ($($(#[$doc:meta])* $name:literal $kind:ident;)*) => {
        /// A constraint on the phones of a joint state, by their index in it.
        ///
        /// Its written form is the name of its kind as `kind`, and the keys of that kind: bounds with their unit, and any
        /// other key is an error. Phones are no part of it, for files have their names: see [`Constraint::among`].
        #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(tag = "kind")]
        pub enum Constraint {
            $($(#[$doc])* #[serde(rename = $name)] $kind($kind),)*
        }

        impl Constraint {
            /// The names of all kinds.
            pub const KINDS: &'static [&'static str] = &[$($name),*];

            /// The name of its kind.
            pub const fn name(&self) -> &'static str {
                match self {
                    $(Self::$kind(_) => $name,)*
                }
            }

            /// The keys of the kind of this name; none when there is no such kind.
            pub fn keys(name: &str) -> &'static [&'static str] {
                match name {
                    $($name => fields::of::<$kind>(),)*
                    _ => &[],
                }
            }

            pub(super) const fn kind(&self) -> &dyn Kind {
                match self {
                    $(Self::$kind(kind) => kind,)*
                }
            }

            const fn kind_mut(&mut self) -> &mut dyn Kind {
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
}

impl Constraint {
    /// The phones that it concerns.
    pub fn phones(&self) -> &[usize] {
        self.kind().phones()
    }

    /// The constraint with other indices of its phones; `None` when a phone has none.
    pub fn mapped(mut self, index: impl Fn(usize) -> Option<usize>) -> Option<Self> {
        for phone in self.kind_mut().phones_mut() {
            *phone = index(*phone)?;
        }
        Some(self)
    }

    /// The constraint for each of the phones, or, if it concerns two, for each pair, in their order.
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

    /// The constrained quantity in a joint state: distance (m), vertical velocity (m/s, positive up), speed (m/s) or angle off the course (rad, in
    /// (−π, π], positive to the right).
    ///
    /// The velocity is the mean one over `horizon_s` to come, v + ½a·horizon; 0 takes the velocity itself. `None` when
    /// the state does not hold the phones, is not finite, or a course is asked of a phone without horizontal velocity.
    pub fn value(&self, state: &DVector<f64>, horizon_s: f64) -> Option<f64> {
        self.kind().value(state, horizon_s).filter(|value| value.is_finite())
    }

    /// Whether a value (see [`Constraint::value`]) is within the bounds.
    pub fn holds(&self, value: f64) -> bool {
        self.excess(value) == 0.0
    }

    /// How far a value is outside of the bounds, in its unit; 0 inside, NaN for NaN.
    pub fn excess(&self, value: f64) -> f64 {
        self.kind().bounds().excess(value)
    }

    /// Its bounds in words, with their unit.
    pub fn bounds_in_words(&self) -> String {
        self.kind().bounds_in_words()
    }

    /// How its value is written for people.
    pub fn unit(&self) -> Unit {
        self.kind().unit()
    }
}

/// A bound that must be above zero; infinity is allowed.
fn positive(key: &str, value: f64) -> Result<f64, String> {
    if value > 0.0 { Ok(value) } else { Err(format!("{key} is {value}; it must be above 0")) }
}

/// A finite bound from zero up.
fn not_negative(key: &str, value: f64, unit: &str) -> Result<f64, String> {
    if (0.0..f64::INFINITY).contains(&value) {
        Ok(value)
    } else {
        Err(format!("{key} is {value}; it must be a number of {unit} from 0 up"))
    }
}
