//! Landmarks as the annealing sees them.

/// A landmark in the units of the frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Known<const D: usize> {
    pub(crate) row: usize,
    pub(crate) position: [f64; D],
    /// Variance along an axis.
    pub(crate) variance: f64,
}

impl<const D: usize> Known<D> {
    /// Energy of a model point that was put there: minus the logarithm of its density, but for a constant.
    pub(crate) fn energy(&self, warped: &[f64; D]) -> f64 {
        let square: f64 = (0..D).map(|k| (warped[k] - self.position[k]).powi(2)).sum();
        0.5 * square / self.variance
    }
}
