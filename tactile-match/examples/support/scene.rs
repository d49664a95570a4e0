//! Point sets with known partners.

use nalgebra::Point;

/// A model, the true positions of its points, and targets. The partners of the first targets are
/// the model rows of `order`.
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
