//! Worst error of each case beside its tolerance.

/// Sums and roots of a few thousand numbers in another order or unit: the fit of the profile loses
/// a hundred roundings, nothing more.
pub(crate) const EXACT: f64 = 1e-12;

/// Of a mean strain along x, y and z from n = 200 matched points. Where points are placed anew, a
/// partner is known to the points' spacing, √(πa²/n), that is to a twelfth of its square in the
/// variance. Points spread by a/2 along x and y, so a mean gradient is known to √(π/12)·2/n = 1/n;
/// a hemisphere's heights spread by a/√18, which makes it 2.1/n along z. Six of these.
pub(crate) const STRAIN: [f64; 3] = [6.0 / 200.0, 6.0 / 200.0, 12.7 / 200.0];

/// Rows of case, worst error and tolerance.
#[derive(Default)]
pub(crate) struct Table(Vec<(String, f64, f64)>);

impl Table {
    /// Enters an error; of several of one case the one closest to its tolerance is kept, NaN above
    /// all.
    pub(crate) fn enter(&mut self, case: &str, error: f64, tolerance: f64) {
        match self.0.iter_mut().find(|row| row.0 == case) {
            Some(row) if row.1.is_nan() || ratio(error, tolerance) <= ratio(row.1, row.2) => {}
            Some(row) => (row.1, row.2) = (error, tolerance),
            None => self.0.push((case.to_owned(), error, tolerance)),
        }
    }

    /// Prints the table and fails where an error is above its tolerance or NaN.
    #[allow(clippy::print_stdout)]
    pub(crate) fn finish(self) {
        println!("pipeline: worst error");
        println!(
            "  {:<56} {:>10} {:>10} {:>8}",
            "case", "worst", "allowed", "ratio"
        );
        for (case, error, tolerance) in &self.0 {
            println!(
                "  {case:<56} {error:>10.2e} {tolerance:>10.1e} {:>8.3}",
                ratio(*error, *tolerance)
            );
        }
        let within = |error: f64, tolerance: f64| error.is_finite() && error <= tolerance;
        let bad: Vec<_> = self.0.iter().filter(|row| !within(row.1, row.2)).collect();
        assert!(bad.is_empty(), "{bad:?}");
    }
}

/// No error needs no tolerance.
fn ratio(error: f64, tolerance: f64) -> f64 {
    if error == 0.0 { 0.0 } else { error / tolerance }
}
