//! Point sets whose partners are known.

use nalgebra::Point;

/// A model, where its points truly go, and targets, of which the first have the model rows of
/// `order` as partners.
pub(crate) struct Scene<const D: usize> {
    pub(crate) model: Vec<Point<f64, D>>,
    pub(crate) truth: Vec<Point<f64, D>>,
    pub(crate) target: Vec<Point<f64, D>>,
    pub(crate) order: Vec<usize>,
}

impl<const D: usize> Scene<D> {
    pub(crate) fn is_right(&self, i: usize, j: usize) -> bool {
        self.order.get(j) == Some(&i)
    }
}
