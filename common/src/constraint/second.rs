//! The second covariance of independent phones under the gains of their constraints.
//!
//! The sites of the constraints, rows C with precisions T, change the error e of the touched states of a component to
//!
//! ```text
//! e ← e + Re − P'CᵀTη        R = −P'CᵀTC        η ~ N(0, T⁻¹)
//! ```
//!
//! with the covariance P' after them. If the errors really have the covariance P₂ (see [`crate::filter::SharedErrors`]), the result has
//! (I + R)P₂(I + R)ᵀ − RP'. The other states of a phone follow by its regression A. Only the blocks that are needed are computed: those of the
//! phones, and those of the positions of pairs.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, Matrix3, OMatrix, SMatrix, U3, U9};

use super::rows::Part;
use super::separate::{Component, Member, Separated};
use crate::filter::STATES_PER_PHONE;

type PhoneMatrix = SMatrix<f64, STATES_PER_PHONE, STATES_PER_PHONE>;
type PhoneColumns = OMatrix<f64, nalgebra::Dyn, U9>;

/// Covariances of the errors of different phones.
pub trait Between {
    /// Covariance of the first N states of two different phones.
    fn between<const N: usize>(&self, a: usize, b: usize) -> SMatrix<f64, N, N>;
}

/// The second covariance.
#[derive(Clone, Debug)]
pub struct Stated {
    /// Of each phone.
    pub own: Vec<PhoneMatrix>,
    /// Of the positions of each pair, in the order given.
    pub pairs: Vec<Matrix3<f64>>,
}

/// Carries the second covariance of phones, `own` and `between`, through constraints. Where the result is not finite a phone's covariance
/// stays as it is, which is an upper bound.
pub fn carry(
    separated: &Separated,
    own: &[PhoneMatrix],
    between: &impl Between,
    pairs: &[(usize, usize)],
) -> Stated {
    let mut result = own.to_vec();
    let carried: Vec<Carried<'_>> =
        separated.components.iter().map(|component| Carried::new(component, own, between)).collect();
    for carried in &carried {
        for (member, columns) in carried.component.members.iter().zip(&carried.columns) {
            let covariance = carried.own(member, columns, &own[member.phone]);
            if covariance.iter().all(|element| element.is_finite()) {
                result[member.phone] = covariance;
            }
        }
    }
    let mut apart = Apart { separated, between, known: BTreeMap::new() };
    let of_pair = |(a, b): &(usize, usize)| match (separated.seats[*a], separated.seats[*b]) {
        (None, None) => between.between::<3>(*a, *b),
        (Some((one, a)), Some((other, b))) if one == other => carried[one].positions(a, b),
        _ => apart.positions(*a, *b),
    };
    Stated { own: result, pairs: pairs.iter().map(of_pair).collect() }
}

/// P₂ of the touched states of a component, and what the constraints make of it.
struct Carried<'a> {
    component: &'a Component,
    /// Of each member: P₂ of all touched states with all states of the member.
    columns: Vec<PhoneColumns>,
    /// P₂ of the touched states.
    before: DMatrix<f64>,
    /// P₂Rᵀ.
    reacted: DMatrix<f64>,
    /// P₂Rᵀ − P'.
    rest: DMatrix<f64>,
}

impl<'a> Carried<'a> {
    fn new(component: &'a Component, own: &[PhoneMatrix], between: &impl Between) -> Self {
        let (members, n) = (&component.members, component.covariance.nrows());
        let mut columns = vec![PhoneColumns::zeros(n); members.len()];
        for (place, member) in members.iter().enumerate() {
            copy_touched(&mut columns[place], member, &own[member.phone]);
            for (earlier, other) in members.iter().enumerate().take(place) {
                let block = between.between::<STATES_PER_PHONE>(member.phone, other.phone);
                copy_touched(&mut columns[earlier], member, &block);
                copy_touched(&mut columns[place], other, &block.transpose());
            }
        }
        let mut before = DMatrix::zeros(n, n);
        for (member, columns) in members.iter().zip(&columns) {
            for (part, offset) in member.touched() {
                let touched = columns.fixed_columns::<3>(part.offset());
                before.fixed_columns_mut::<3>(offset).copy_from(&touched);
            }
        }
        let reacted = &before * &component.reaction;
        let rest = &reacted - &component.covariance;
        Self { component, columns, before, reacted, rest }
    }

    /// Covariance of all states of a member: P₂ + AV + VᵀAᵀ + ASAᵀ with V = R·P₂ of the touched states with those of the member, and S = R(P₂Rᵀ − P')
    /// of the member's touched states.
    fn own(&self, member: &Member, columns: &PhoneColumns, own: &PhoneMatrix) -> PhoneMatrix {
        let (mut v, mut s) = (PhoneMatrix::zeros(), PhoneMatrix::zeros());
        for (part, offset) in member.touched() {
            let reaction = self.component.reaction.fixed_columns::<3>(offset);
            v.fixed_rows_mut::<3>(part.offset()).copy_from(&reaction.tr_mul(columns));
            for (other, to) in member.touched() {
                let block = reaction.tr_mul(&self.rest.fixed_columns::<3>(to));
                s.fixed_view_mut::<3, 3>(part.offset(), other.offset()).copy_from(&block);
            }
        }
        let a = &member.regression;
        let half = a * (v + s * a.transpose() * 0.5);
        own + half + half.transpose()
    }

    /// Covariance of the positions of two members.
    fn positions(&self, a: usize, b: usize) -> Matrix3<f64> {
        let of = |place: usize| self.component.members[place].offsets[Part::Position as usize];
        let Some((a, b)) = of(a).zip(of(b)) else { return Matrix3::zeros() };
        let both = self.component.reaction.fixed_columns::<3>(a).tr_mul(&self.rest.fixed_columns::<3>(b));
        let of_a = self.reacted.fixed_view::<3, 3>(b, a).transpose();
        self.before.fixed_view::<3, 3>(a, b) + of_a + self.reacted.fixed_view::<3, 3>(a, b) + both
    }
}

/// Copies the rows of a member's touched states from the covariance of all its states with those of another phone.
fn copy_touched(columns: &mut PhoneColumns, member: &Member, block: &PhoneMatrix) {
    for (part, offset) in member.touched() {
        columns.fixed_rows_mut::<3>(offset).copy_from(&block.fixed_rows::<3>(part.offset()));
    }
}

/// Covariances of phones that no constraint connects.
struct Apart<'a, B> {
    separated: &'a Separated,
    between: &'a B,
    /// P₂ of the touched states of two sides.
    known: BTreeMap<(Side, Side), DMatrix<f64>>,
}

/// A component, or a phone that nothing touches.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Side {
    Component(usize),
    Phone(usize),
}

impl<B: Between> Apart<'_, B> {
    /// Covariance of the positions of two phones: (I + R)P₂(I + R)ᵀ, since they share no noise.
    fn positions(&mut self, a: usize, b: usize) -> Matrix3<f64> {
        let (one, other) = (self.side(a), self.side(b));
        let (separated, between) = (self.separated, self.between);
        let covariance = self
            .known
            .entry((one, other))
            .or_insert_with(|| covariance(&states_of(separated, one), &states_of(separated, other), between));
        self.separated
            .gain(a)
            .tr_mul(&(&*covariance * self.separated.gain(b)))
            .fixed_view::<3, 3>(0, 0)
            .into_owned()
    }

    fn side(&self, phone: usize) -> Side {
        self.separated.seats[phone].map_or(Side::Phone(phone), |(component, _)| Side::Component(component))
    }
}

/// Phones of a side with the offsets of their touched parts.
fn states_of(separated: &Separated, side: Side) -> Vec<(usize, Vec<(Part, usize)>)> {
    match side {
        Side::Phone(phone) => vec![(phone, vec![(Part::Position, 0)])],
        Side::Component(component) => separated.components[component]
            .members
            .iter()
            .map(|member| (member.phone, member.touched().collect()))
            .collect(),
    }
}

/// P₂ of the touched states of different phones.
fn covariance(
    ones: &[(usize, Vec<(Part, usize)>)],
    others: &[(usize, Vec<(Part, usize)>)],
    between: &impl Between,
) -> DMatrix<f64> {
    let size =
        |side: &[(usize, Vec<(Part, usize)>)]| 3 * side.iter().map(|(_, parts)| parts.len()).sum::<usize>();
    let mut covariance = DMatrix::zeros(size(ones), size(others));
    for (one, parts) in ones {
        for (other, to_parts) in others {
            let block = leading(between, (*one, *other), parts.iter().chain(to_parts).map(|(part, _)| *part));
            for (part, offset) in parts {
                for (to_part, to) in to_parts {
                    let part = block.fixed_view::<3, 3>(part.offset(), to_part.offset());
                    covariance.fixed_view_mut::<3, 3>(*offset, *to).copy_from(&part);
                }
            }
        }
    }
    covariance
}

/// P₂ of two different phones up to the last of some parts, and zeros behind it.
fn leading(between: &impl Between, (a, b): (usize, usize), parts: impl Iterator<Item = Part>) -> PhoneMatrix {
    let mut whole = PhoneMatrix::zeros();
    match parts.map(Part::offset).max() {
        None | Some(0) => whole.fixed_view_mut::<3, 3>(0, 0).copy_from(&between.between::<3>(a, b)),
        Some(3) => whole.fixed_view_mut::<6, 6>(0, 0).copy_from(&between.between::<6>(a, b)),
        Some(_) => return between.between(a, b),
    }
    whole
}

impl Separated {
    /// The rows of I + R of a phone's position, transposed.
    fn gain(&self, phone: usize) -> OMatrix<f64, nalgebra::Dyn, U3> {
        let seat = self.seats[phone].and_then(|(component, place)| {
            let component = &self.components[component];
            Some((component, component.members[place].offsets[Part::Position as usize]?))
        });
        let Some((component, offset)) = seat else { return OMatrix::<f64, nalgebra::Dyn, U3>::identity(3) };
        let mut gain = component.reaction.fixed_columns::<3>(offset).into_owned();
        let mut own = gain.fixed_rows_mut::<3>(offset);
        own += Matrix3::identity();
        gain
    }
}
