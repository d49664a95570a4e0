//! Worst error of each case over its tolerance.
use test_support::Worst;

/// Sums and roots of a few thousand numbers in another order or unit: the fit of the profile loses
/// a hundred roundings, nothing more.
pub(crate) const EXACT: f64 = 1e-12;

/// Of a mean strain along x, y and z from n = 200 matched points. Where points are placed anew, a
/// partner is known to the points' spacing, √(πa²/n), that is to a twelfth of its square in the
/// variance. Points spread by a/2 along x and y, so a mean gradient is known to √(π/12)·2/n = 1/n;
/// a hemisphere's heights spread by a/√18, which makes it 2.1/n along z. Six of these.
pub(crate) const STRAIN: [f64; 3] = [6.0 / 200.0, 6.0 / 200.0, 12.7 / 200.0];

/// Worst errors of the cases over their tolerances.
pub(crate) struct Table(Worst);

impl Table {
    pub(crate) fn new() -> Self {
        Self(Worst::new("pipeline, for ε · cond the tolerance"))
    }

    pub(crate) fn enter(&mut self, case: &str, error: f64, tolerance: f64) {
        // No error needs no tolerance.
        let ratio = if error == 0.0 { 0.0 } else { error / tolerance };
        self.0.enter(case, ratio, 1.0);
    }

    /// Prints the table and fails where an error is above its tolerance or NaN.
    pub(crate) fn finish(self) {
        self.0.finish();
    }
}
