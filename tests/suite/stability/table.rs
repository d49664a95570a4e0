//! Worst error of each case relative to its tolerance.
use test_support::Worst;

/// Sums and roots of a few thousand numbers in another order or unit: the fit of the profile loses
/// no more than a hundred roundings.
pub(crate) const EXACT: f64 = 1e-12;

/// Tolerance of a mean strain along x, y and z from n = 200 matched points. If points are placed
/// anew, a partner is uncertain by the spacing of the points, √(πa²/n), with a twelfth of its
/// square as variance. The standard deviation of the points along x and y is a/2, so that of a mean
/// gradient is √(π/12)·2/n = 1/n. The heights of a hemisphere have a/√18, which gives 2.1/n along
/// z. The tolerance is six times this.
pub(crate) const STRAIN: [f64; 3] = [6.0 / 200.0, 6.0 / 200.0, 12.7 / 200.0];

/// Worst errors of the cases relative to their tolerances.
pub(crate) struct Table(Worst);

impl Table {
    pub(crate) fn new() -> Self {
        Self(Worst::new("pipeline, for ε · cond the tolerance"))
    }

    pub(crate) fn enter(&mut self, case: &str, error: f64, tolerance: f64) {
        // An error of zero needs no tolerance.
        let ratio = if error == 0.0 { 0.0 } else { error / tolerance };
        self.0.enter(case, ratio, 1.0);
    }

    /// Prints the table and panics if an error is above its tolerance or NaN.
    pub(crate) fn finish(self) {
        self.0.finish();
    }
}
