//! Numerical tools: minimum of a function, quadrature and interpolation.

/// The minimum of a function that has only one in [low, high]: the better of the two inner points
/// of the last bracket.
///
/// Each section takes one evaluation and leaves 0.62 of the bracket. At most `sections` are made,
/// and fewer if the bracket reaches rounding.
pub(crate) fn golden_section(
    mut low: f64,
    mut high: f64,
    sections: usize,
    at: impl Fn(f64) -> f64,
) -> f64 {
    // Fraction of a bracket that remains after a golden section.
    let ratio = 0.618_033_988_749_894_8;
    let evaluated = |x: f64| (x, at(x));
    let left = |low: f64, high: f64| evaluated(high - ratio * (high - low));
    let right = |low: f64, high: f64| evaluated(low + ratio * (high - low));
    let (mut a, mut b) = (left(low, high), right(low, high));
    for _ in 0..sections {
        if a.1 <= b.1 {
            high = low + ratio * (high - low);
            (a, b) = (left(low, high), a);
        } else {
            low = high - ratio * (high - low);
            (a, b) = (b, right(low, high));
        }
        if high - low <= 1e-12 * (high.abs() + low.abs()) {
            break;
        }
    }
    if a.1 <= b.1 { a.0 } else { b.0 }
}

/// Gauss–Legendre nodes and weights on [0, 1], by Newton's method on P_n from the cosine guess.
pub(crate) fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
    (0..n)
        .map(|i| {
            let mut x = (std::f64::consts::PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..100 {
                let (p, previous) = legendre(n, x);
                slope = n as f64 * (x * p - previous) / (x * x - 1.0);
                let step = p / slope;
                x -= step;
                if step.abs() < 1e-16 {
                    break;
                }
            }
            (0.5 * (1.0 - x), 1.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}

/// The Legendre polynomials P_n(x) and P_{n−1}(x).
fn legendre(n: usize, x: f64) -> (f64, f64) {
    let (mut p, mut previous) = (1.0, 0.0);
    for k in 0..n {
        let k = k as f64;
        (p, previous) = (((2.0 * k + 1.0) * x * p - k * previous) / (k + 1.0), p);
    }
    (p, previous)
}

/// Edges from 0 to `end`. The first panel has the width `first`; each next one is half as wide as
/// everything before, up to `widest`.
pub(crate) fn panel_edges(end: f64, first: f64, widest: f64) -> Vec<f64> {
    let mut edges = vec![0.0];
    let mut last = 0.0;
    while last < end {
        last += (0.5 * last).max(first).min(widest);
        edges.push(last);
    }
    edges
}

/// Nodes and weights between the edges, with 16 points per panel.
pub(crate) fn gauss_panels(edges: &[f64]) -> Vec<(f64, f64)> {
    let unit = gauss_legendre(16);
    edges
        .windows(2)
        .flat_map(|edge| {
            let (start, width) = (edge[0], edge[1] - edge[0]);
            unit.iter()
                .map(move |&(x, w)| (start + x * width, w * width))
        })
        .collect()
}

/// Value and slope at `at` of the cubic through four points (Lagrange).
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
    /// The nodes at which [`through`](Self::through) needs values.
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

    /// Evaluates by Clenshaw's recurrence.
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
