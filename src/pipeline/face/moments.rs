//! Sums from which area, centre and second moment of a face follow.

/// Sums for moments: of one, x, y and x² + y².
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Moments(pub(super) [f64; 4]);

impl Moments {
    pub(super) fn add(&mut self, weight: f64, x: f64, y: f64) {
        self.0[0] += weight;
        self.0[1] += weight * x;
        self.0[2] += weight * y;
        self.0[3] += weight * (x * x + y * y);
    }

    /// A row's sums of the weights, and of them with the column and its square.
    pub(super) fn add_row(&mut self, [one, column, square]: [f64; 3], hx: f64, y: f64) {
        self.0[0] += one;
        self.0[1] += column * hx;
        self.0[2] += one * y;
        self.0[3] += square * hx * hx + one * y * y;
    }

    /// Σ w r² about (x, y), over Σ w.
    pub(super) fn about(&self, x: f64, y: f64) -> f64 {
        let [w, wx, wy, wrr] = self.0;
        (wrr - 2.0 * (x * wx + y * wy)) / w + x * x + y * y
    }
}
