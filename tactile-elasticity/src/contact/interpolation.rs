//! Interpolation in tables.

/// The value and slope at `at` of the cubic through four points (Lagrange).
pub(crate) fn cubic(points: [(f64, f64); 4], at: f64) -> (f64, f64) {
    let (mut value, mut slope) = (0.0, 0.0);
    for (i, point) in points.iter().enumerate() {
        let (mut basis, mut derivative) = (1.0, 0.0);
        for (_, other) in points.iter().enumerate().filter(|&(j, _)| j != i) {
            let width = point.0 - other.0;
            derivative = (derivative * (at - other.0) + basis) / width;
            basis *= (at - other.0) / width;
        }
        value += point.1 * basis;
        slope += point.1 * derivative;
    }
    (value, slope)
}

/// A Chebyshev interpolant on [0, 1].
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Chebyshev<const N: usize> {
    coefficients: [f64; N],
}

impl<const N: usize> Chebyshev<N> {
    /// The nodes at which [`through`](Self::through) wants values.
    pub(crate) fn nodes() -> [f64; N] {
        std::array::from_fn(|j| 0.5 + 0.5 * Self::angle(j).cos())
    }

    pub(crate) fn through(values: &[f64; N]) -> Self {
        let coefficients = std::array::from_fn(|m| {
            let projected = values.iter().enumerate();
            let sum: f64 = projected
                .map(|(j, value)| value * (m as f64 * Self::angle(j)).cos())
                .sum();
            let norm = if m == 0 { 1.0 } else { 2.0 };
            norm * sum / N as f64
        });
        Self { coefficients }
    }

    /// By Clenshaw's recurrence.
    pub(crate) fn value(&self, x: f64) -> f64 {
        let t = 2.0 * x - 1.0;
        let (mut next, mut after) = (0.0, 0.0);
        for c in self.coefficients[1..].iter().rev() {
            (next, after) = (c + 2.0 * t * next - after, next);
        }
        self.coefficients[0] + t * next - after
    }

    fn angle(j: usize) -> f64 {
        std::f64::consts::PI * (j as f64 + 0.5) / N as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_are_interpolated_exactly() {
        let cube = |x: f64| 2.0 * x * x * x - x + 0.5;
        let points = [0.1, 0.4, 0.5, 0.9].map(|x| (x, cube(x)));
        let (value, slope) = cubic(points, 0.7);
        assert!((value - cube(0.7)).abs() < 1e-14);
        assert!((slope - (6.0 * 0.49 - 1.0)).abs() < 1e-13);
        let chebyshev = Chebyshev::<4>::through(&Chebyshev::<4>::nodes().map(cube));
        for x in [0.0, 0.3, 1.0] {
            assert!((chebyshev.value(x) - cube(x)).abs() < 1e-14);
        }
    }
}
