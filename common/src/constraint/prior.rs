//! The distribution of phones before constraints, as one joint state or as independent phones.

use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVector, Vector3};

use super::rows::{Terms, part, position};
use crate::filter::STATES_PER_PHONE;
use crate::frames::{Ecef, LocalFrame};

/// What constraints need of a distribution.
pub trait Prior {
    /// Number of phones.
    fn phones(&self) -> usize;

    /// Mean of a vector; `None` without its phones.
    fn mean(&self, terms: &Terms) -> Option<Vector3<f64>>;

    /// Covariance of a vector; `None` without its phones.
    fn covariance(&self, terms: &Terms) -> Option<Matrix3<f64>>;

    /// Local frame of a phone; `None` without the phone, or if its position is not finite.
    fn frame(&self, phone: usize) -> Option<&LocalFrame>;
}

/// A joint state of nine elements per phone.
pub(super) struct Joint<'a> {
    state: &'a DVector<f64>,
    covariance: &'a DMatrix<f64>,
    frames: &'a [Option<LocalFrame>],
}

/// One of several phones that are independent of each other.
#[derive(Clone, Debug)]
pub struct FreePhone {
    /// Mean of the nine states.
    pub mean: SVector<f64, STATES_PER_PHONE>,
    /// Their covariance, which decides the gains.
    pub covariance: SMatrix<f64, STATES_PER_PHONE, STATES_PER_PHONE>,
    frame: Option<LocalFrame>,
}

impl FreePhone {
    /// A phone with its distribution.
    pub fn new(
        mean: SVector<f64, STATES_PER_PHONE>,
        covariance: SMatrix<f64, STATES_PER_PHONE, STATES_PER_PHONE>,
    ) -> Self {
        let place = Ecef(mean.fixed_rows::<3>(0).into_owned());
        Self { mean, covariance, frame: place.is_finite().then(|| LocalFrame::at(place)) }
    }
}

impl<'a> Joint<'a> {
    /// A joint state; `frames` are those of [`Joint::frames`].
    pub fn new(
        state: &'a DVector<f64>,
        covariance: &'a DMatrix<f64>,
        frames: &'a [Option<LocalFrame>],
    ) -> Self {
        Self { state, covariance, frames }
    }

    /// The local frames of the phones of a joint state.
    pub fn frames(state: &DVector<f64>) -> Vec<Option<LocalFrame>> {
        let phones = state.len() / STATES_PER_PHONE;
        (0..phones).map(|phone| position(state, phone).map(LocalFrame::at)).collect()
    }
}

impl Prior for Joint<'_> {
    fn phones(&self) -> usize {
        let n = self.state.len();
        if self.covariance.shape() == (n, n) { n / STATES_PER_PHONE } else { 0 }
    }

    fn mean(&self, terms: &Terms) -> Option<Vector3<f64>> {
        terms.sum(|phone, which| part(self.state, phone, which))
    }

    fn covariance(&self, terms: &Terms) -> Option<Matrix3<f64>> {
        let placed = terms.placed(|phone, part| {
            part.offset_in_joint(phone).filter(|offset| offset + 3 <= self.covariance.nrows())
        })?;
        Some(placed.covariance(self.covariance))
    }

    fn frame(&self, phone: usize) -> Option<&LocalFrame> {
        self.frames.get(phone)?.as_ref()
    }
}

impl Prior for [FreePhone] {
    fn phones(&self) -> usize {
        self.len()
    }

    fn mean(&self, terms: &Terms) -> Option<Vector3<f64>> {
        terms.sum(|phone, part| Some(self.get(phone)?.mean.fixed_rows::<3>(part.offset()).into_owned()))
    }

    fn covariance(&self, terms: &Terms) -> Option<Matrix3<f64>> {
        let mut sum = Matrix3::zeros();
        for one in terms.iter() {
            let covariance = &self.get(one.phone)?.covariance;
            for other in terms.iter().filter(|other| other.phone == one.phone) {
                let block = covariance.fixed_view::<3, 3>(one.part.offset(), other.part.offset());
                sum += block * (one.factor * other.factor);
            }
        }
        Some(sum)
    }

    fn frame(&self, phone: usize) -> Option<&LocalFrame> {
        self.get(phone)?.frame.as_ref()
    }
}
