//! Constraints on phones that are independent of each other before them.
//!
//! Constraints touch only some states: positions, or velocities, of some phones. They are applied to the distribution of these states alone,
//! and the others follow by the regression A = P_xk P_kk⁻¹ of a phone's states x on its touched ones k: x ← x + A(k' − k). Phones that no
//! acting constraint connects are in states of their own (*components*). The result is that of one joint state.
//!
//! A constraint that is idle at the prior acts only if others move its phones until it is violated. So it connects nothing, and a phone on
//! which every constraint is idle is left out. An idle constraint between two components is examined at every sweep; if it is violated, the
//! components become one, and all begins anew.

use nalgebra::{Cholesky, DMatrix, DVector, SMatrix, SVector, Vector3};

use super::engine::Propagation;
use super::options::ConstraintOptions;
use super::prior::FreePhone;
use super::rows::{Part, Terms};
use super::sites::Posterior;
use super::task::{Seat, Task};
use super::{Constraint, ConstraintAction};
use crate::filter::STATES_PER_PHONE;

type PhoneMatrix = SMatrix<f64, STATES_PER_PHONE, STATES_PER_PHONE>;

/// Result of constraints on independent phones.
pub struct Separated {
    /// Effect of each constraint that acted, was violated or could not be applied.
    pub actions: Vec<ConstraintAction>,
    /// Means of the phones.
    pub means: Vec<SVector<f64, STATES_PER_PHONE>>,
    /// The components of the phones that constraints touch.
    pub(super) components: Vec<Component>,
    /// Component of each phone, and its place there.
    pub(super) seats: Vec<Option<(usize, usize)>>,
}

/// Phones that constraints connect.
pub(super) struct Component {
    pub members: Vec<Member>,
    /// Covariance of the touched states after the constraints.
    pub covariance: DMatrix<f64>,
    /// Change of the errors of the touched states by the constraints, transposed: Rᵀ of e ← e + Re + noise.
    pub reaction: DMatrix<f64>,
}

/// One phone of a component.
#[derive(Clone)]
pub(super) struct Member {
    pub phone: usize,
    pub offsets: Offsets,
    /// A, with a column for each of the phone's states; zero for those that are not touched.
    pub regression: PhoneMatrix,
}

/// Offsets of a phone's parts in the state of its component; `None` for a part that no constraint touches.
type Offsets = [Option<usize>; Part::ALL.len()];

impl Member {
    /// Touched parts with their offsets in the state of the component.
    pub fn touched(&self) -> impl Iterator<Item = (Part, usize)> + Clone + use<> {
        let offsets = self.offsets;
        Part::ALL.into_iter().zip(offsets).filter_map(|(part, offset)| Some((part, offset?)))
    }
}

/// Applies constraints to independent phones. Both phones of each pair in `pairs` keep their positions among the touched states, so that
/// the covariance between them can be computed (see [`super::second`]).
pub fn constrain_separately(
    phones: &[FreePhone],
    constraints: &[Constraint],
    pairs: &[(usize, usize)],
    options: &ConstraintOptions,
) -> Separated {
    let mut connecting = vec![false; constraints.len()];
    loop {
        let mut tasks = Task::all(constraints, phones, options);
        for (task, connecting) in tasks.iter().zip(&mut connecting) {
            *connecting |= task.is_able() && !task.idle;
        }
        let layout = Layout::new(phones.len(), &tasks, &connecting, pairs);
        let mut propagation = Propagation::new(layout.posteriors(phones), options);
        for task in tasks.iter_mut().filter(|task| task.is_able()) {
            task.seat = layout.seat(&task.terms);
        }
        let is_violated = |task: &Task<'_>, posteriors: &[Posterior]| {
            layout.vector(&task.terms, phones, posteriors).is_some_and(|vector| task.is_violated(&vector))
        };
        if let Err(place) = propagation.run(&mut tasks, is_violated) {
            connecting[place] = true;
        } else {
            propagation.finish(&tasks);
            return layout.separated(phones, &tasks, &propagation.components);
        }
    }
}

/// Which states are in which component.
struct Layout {
    components: Vec<Vec<Member>>,
    seats: Vec<Option<(usize, usize)>>,
}

impl Layout {
    fn new(phones: usize, tasks: &[Task<'_>], connecting: &[bool], pairs: &[(usize, usize)]) -> Self {
        let mut roots: Vec<usize> = (0..phones).collect();
        let mut touched = vec![false; phones];
        let connects = |(task, connecting): (&Task<'_>, &bool)| connecting.then_some(task.constraint);
        for constraint in tasks.iter().zip(connecting).filter_map(connects) {
            let Some(first) = constraint.phones().first() else { continue };
            for phone in constraint.phones() {
                touched[*phone] = true;
                let (one, other) = (root(&mut roots, *first), root(&mut roots, *phone));
                roots[one.max(other)] = one.min(other);
            }
        }
        let mut parts = vec![[false; Part::ALL.len()]; phones];
        for term in tasks.iter().filter(|task| task.is_able()).flat_map(|task| task.terms.iter()) {
            parts[term.phone][term.part as usize] = true;
        }
        for phone in pairs.iter().flat_map(|(a, b)| [*a, *b]).filter(|phone| *phone < phones) {
            parts[phone][Part::Position as usize] = true;
        }
        let mut layout = Self { components: Vec::new(), seats: vec![None; phones] };
        for phone in (0..phones).filter(|phone| touched[*phone]) {
            let of_root = layout.seats[root(&mut roots, phone)];
            let component = of_root.map_or(layout.components.len(), |(component, _)| component);
            if component == layout.components.len() {
                layout.components.push(Vec::new());
            }
            layout.add(phone, component, parts[phone]);
        }
        layout
    }

    /// Adds a phone at the end of a component.
    fn add(&mut self, phone: usize, component: usize, parts: [bool; Part::ALL.len()]) {
        let members = &mut self.components[component];
        let mut end = states(members);
        let offsets = parts.map(|is_touched| {
            is_touched.then(|| {
                end += 3;
                end - 3
            })
        });
        self.seats[phone] = Some((component, members.len()));
        members.push(Member { phone, offsets, regression: PhoneMatrix::zeros() });
    }

    fn member(&self, phone: usize) -> Option<(usize, &Member)> {
        let (component, place) = (*self.seats.get(phone)?)?;
        Some((component, self.components.get(component)?.get(place)?))
    }

    /// The touched states of each component.
    fn posteriors(&self, phones: &[FreePhone]) -> Vec<Posterior> {
        let posterior = |members: &Vec<Member>| {
            let n = states(members);
            let (mut state, mut covariance) = (DVector::zeros(n), DMatrix::zeros(n, n));
            for member in members {
                let FreePhone { mean, covariance: own, .. } = &phones[member.phone];
                for (part, offset) in member.touched() {
                    state.fixed_rows_mut::<3>(offset).copy_from(&mean.fixed_rows::<3>(part.offset()));
                    for (other, to) in member.touched() {
                        let block = own.fixed_view::<3, 3>(part.offset(), other.offset());
                        covariance.fixed_view_mut::<3, 3>(offset, to).copy_from(&block);
                    }
                }
            }
            Posterior::new(state, covariance)
        };
        self.components.iter().map(posterior).collect()
    }

    /// Where the vector of a constraint stands.
    fn seat(&self, terms: &Terms) -> Seat {
        let mut of_phones = terms.iter().map(|term| self.member(term.phone).map(|(component, _)| component));
        let first = of_phones.next().flatten();
        if of_phones.any(|component| component != first) {
            return Seat::Apart;
        }
        let placed = terms.placed(|phone, part| self.member(phone)?.1.offsets[part as usize]);
        first.zip(placed).map_or(Seat::None, |(component, placed)| Seat::In { component, placed })
    }

    /// Vector of a constraint in the present states; phones that nothing touches stay where they are.
    fn vector(&self, terms: &Terms, phones: &[FreePhone], posteriors: &[Posterior]) -> Option<Vector3<f64>> {
        terms.sum(|phone, part| {
            let Some((component, member)) = self.member(phone) else {
                return Some(phones.get(phone)?.mean.fixed_rows::<3>(part.offset()).into_owned());
            };
            let offset = member.offsets[part as usize]?;
            Some(posteriors.get(component)?.state.fixed_rows::<3>(offset).into_owned())
        })
    }

    /// The result, with all states of the phones.
    fn separated(self, phones: &[FreePhone], tasks: &[Task<'_>], posteriors: &[Posterior]) -> Separated {
        let mut means: Vec<_> = phones.iter().map(|phone| phone.mean).collect();
        let vector = |terms: &Terms| self.vector(terms, phones, posteriors);
        let mut components = Vec::with_capacity(posteriors.len());
        for (mut members, posterior) in self.components.iter().cloned().zip(posteriors) {
            for member in &mut members {
                member.regression = member.regression_on_touched(&phones[member.phone].covariance);
                means[member.phone] = member.follow(&phones[member.phone].mean, &posterior.state);
            }
            let (covariance, n) = (posterior.covariance.clone(), posterior.state.len());
            components.push(Component { members, covariance, reaction: DMatrix::zeros(n, n) });
        }
        let shift_m = |phone: usize| {
            let moved = means.get(phone).zip(phones.get(phone));
            moved.map_or(0.0, |(to, from)| (to - from.mean).fixed_rows::<3>(0).norm())
        };
        let actions = tasks.iter().filter_map(|task| task.report(vector, shift_m)).collect();
        for task in tasks {
            if let Seat::In { component, .. } = task.seat {
                components[component].react(task);
            }
        }
        Separated { actions, means, components, seats: self.seats }
    }
}

impl Member {
    /// A; a covariance that cannot be factorised leaves the states that are not touched as they are.
    fn regression_on_touched(&self, covariance: &PhoneMatrix) -> PhoneMatrix {
        let mut regression = PhoneMatrix::zeros();
        if self.touched().count() < Part::ALL.len() {
            // The states that are not touched are replaced by independent ones, so that they have no weight.
            let (mut known, mut cross) = (PhoneMatrix::identity(), PhoneMatrix::zeros());
            for (part, _) in self.touched() {
                for (other, _) in self.touched() {
                    let block = covariance.fixed_view::<3, 3>(part.offset(), other.offset());
                    known.fixed_view_mut::<3, 3>(part.offset(), other.offset()).copy_from(&block);
                }
                let rows = covariance.fixed_rows::<3>(part.offset());
                cross.fixed_rows_mut::<3>(part.offset()).copy_from(&rows);
            }
            if let Some(factor) = Cholesky::new(known) {
                factor.solve_mut(&mut cross);
                regression = cross.transpose();
            }
        }
        for (part, _) in self.touched() {
            regression.fixed_rows_mut::<3>(part.offset()).fill(0.0);
            regression.fixed_view_mut::<3, 3>(part.offset(), part.offset()).fill_diagonal(1.0);
        }
        regression
    }

    /// Mean of all states for the touched ones after constraints.
    fn follow(
        &self,
        mean: &SVector<f64, STATES_PER_PHONE>,
        touched: &DVector<f64>,
    ) -> SVector<f64, STATES_PER_PHONE> {
        let mut moved = SVector::<f64, STATES_PER_PHONE>::zeros();
        for (part, offset) in self.touched() {
            let change = touched.fixed_rows::<3>(offset) - mean.fixed_rows::<3>(part.offset());
            moved.fixed_rows_mut::<3>(part.offset()).copy_from(&change);
        }
        mean + self.regression * moved
    }
}

impl Component {
    /// Adds the sites of a constraint: R = −P'CᵀTC for all rows C with precisions T.
    fn react(&mut self, task: &Task<'_>) {
        let Seat::In { placed, .. } = task.seat else { return };
        let mut precision = nalgebra::Matrix3::zeros();
        for site in task.sites.iter().flatten() {
            precision += site.precision * site.axis * site.axis.transpose();
        }
        if precision.trace() <= 0.0 {
            return;
        }
        for (to, to_factor) in placed.iter() {
            for (from, from_factor) in placed.iter() {
                // The row block `to` of −CᵀTC P', for the columns of all states.
                let weight = precision * (-to_factor * from_factor);
                let rows = self.covariance.fixed_columns::<3>(from);
                let mut target = self.reaction.fixed_rows_mut::<3>(to);
                for (mut column, row) in target.column_iter_mut().zip(rows.row_iter()) {
                    column += weight * row.transpose();
                }
            }
        }
    }
}

/// Number of states of a component.
fn states(members: &[Member]) -> usize {
    3 * members.iter().map(|member| member.touched().count()).sum::<usize>()
}

/// The first phone of a phone's component.
fn root(roots: &mut [usize], mut phone: usize) -> usize {
    while roots[phone] != phone {
        roots[phone] = roots[roots[phone]];
        phone = roots[phone];
    }
    phone
}

#[cfg(test)]
mod tests;
