//! A smooth surface through tabulated contacts.

use nalgebra::{DMatrix, DVector};

/// Degree in a/R and the largest in ln E: what they leave of contacts that finite elements computed is the elements' own scatter in
/// the contact radius, some 0.1 % (`the_surface_leaves_the_scatter_of_the_contact_radius`).
const DEGREE_IN_RATIO: usize = 6;
const DEGREE_IN_MODULUS: usize = 5;

/// One tabulated contact in the surface's variables.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    /// a/R.
    pub(super) ratio: f64,
    /// ln E.
    pub(super) log_modulus: f64,
    /// ln of the force over Hertz's of the same radius on a rigid flat.
    pub(super) value: f64,
}

/// The value and its slopes in ln a and ln E.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Value {
    pub(super) value: f64,
    pub(super) ratio_slope: f64,
    pub(super) modulus_slope: f64,
}

/// A product of Chebyshev series in a/R and ln E, fitted by least squares.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Surface {
    ratio: Range,
    log_modulus: Range,
    /// Rows by degree in a/R, columns by degree in ln E.
    coefficients: DMatrix<f64>,
    /// Root mean square of what each sample that has others on both sides misses when it is left out of the fit.
    error: f64,
}

/// A range mapped to [−1, 1]; a single value is mapped to 0.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Range {
    lower: f64,
    upper: f64,
}

impl Range {
    fn of(values: impl Iterator<Item = f64> + Clone) -> Self {
        Self {
            lower: values.clone().fold(f64::INFINITY, f64::min),
            upper: values.fold(f64::NEG_INFINITY, f64::max),
        }
    }

    fn place(self, value: f64) -> f64 {
        if self.upper > self.lower {
            (2.0 * value - self.lower - self.upper) / (self.upper - self.lower)
        } else {
            0.0
        }
    }

    /// d place/d value.
    fn scale(self) -> f64 {
        if self.upper > self.lower {
            2.0 / (self.upper - self.lower)
        } else {
            0.0
        }
    }
}

/// T₀ … T_n at t and their derivatives.
fn chebyshev(t: f64, polynomials: &mut [f64], derivatives: &mut [f64]) {
    for k in 0..polynomials.len() {
        (polynomials[k], derivatives[k]) = match k {
            0 => (1.0, 0.0),
            1 => (t, 1.0),
            _ => (
                2.0 * t * polynomials[k - 1] - polynomials[k - 2],
                2.0 * polynomials[k - 1] + 2.0 * t * derivatives[k - 1] - derivatives[k - 2],
            ),
        };
    }
}

impl Surface {
    /// Through samples of `moduli` different moduli; None where they do not determine it.
    pub(super) fn fit(samples: &[Sample], moduli: usize) -> Option<Self> {
        let per_modulus = samples.len() / moduli.max(1);
        // Two samples more than coefficients in each direction leave something to judge the fit by.
        let rows = (DEGREE_IN_RATIO + 1).min(per_modulus.saturating_sub(2).max(1));
        let columns = (DEGREE_IN_MODULUS + 1).min(moduli);
        let mut surface = Self {
            ratio: Range::of(samples.iter().map(|s| s.ratio)),
            log_modulus: Range::of(samples.iter().map(|s| s.log_modulus)),
            coefficients: DMatrix::zeros(rows, columns),
            error: 0.0,
        };
        let unknowns = rows * columns;
        let basis = DMatrix::from_fn(samples.len(), unknowns, |i, k| {
            let polynomials = surface.basis(samples[i].ratio, samples[i].log_modulus);
            polynomials.ratio[k % rows] * polynomials.modulus[k / rows]
        });
        let values = DVector::from_iterator(samples.len(), samples.iter().map(|s| s.value));
        let factors = basis.clone().qr();
        let orthogonal = factors.q();
        let solution = factors
            .r()
            .solve_upper_triangular(&(orthogonal.transpose() * &values))?;
        let residuals = &values - &basis * &solution;
        let left_out = |i: usize| {
            let leverage = orthogonal.row(i).norm_squared();
            residuals[i] / (1.0 - leverage).max(1e-6)
        };
        let between = (0..samples.len()).filter(|&i| surface.surrounds(samples, i));
        let (mut squares, mut count) = (0.0, 0);
        for i in between {
            squares += left_out(i).powi(2);
            count += 1;
        }
        if count == 0 {
            squares = (0..samples.len()).map(|i| left_out(i).powi(2)).sum();
            count = samples.len();
        }
        surface.error = (squares / count as f64).sqrt();
        surface.coefficients = DMatrix::from_column_slice(rows, columns, solution.as_slice());
        solution.iter().all(|c| c.is_finite()).then_some(surface)
    }

    pub(super) fn error(&self) -> f64 {
        self.error
    }

    /// Whether there are contacts on both sides of one: at the ends of its curve and for the smallest and the largest modulus leaving one out would
    /// show how well the fit extrapolates, which it does nowhere.
    fn surrounds(&self, samples: &[Sample], i: usize) -> bool {
        let own = samples[i].log_modulus;
        let same = |k: usize| samples.get(k).is_some_and(|s| s.log_modulus == own);
        let inside = i > 0 && same(i - 1) && same(i + 1);
        let of_one = self.log_modulus.lower == self.log_modulus.upper;
        inside && (of_one || (own > self.log_modulus.lower && own < self.log_modulus.upper))
    }

    /// At a/R and ln E; the caller keeps to the range of the samples.
    pub(super) fn at(&self, ratio: f64, log_modulus: f64) -> Value {
        let basis = self.basis(ratio, log_modulus);
        let (mut value, mut ratio_slope, mut modulus_slope) = (0.0, 0.0, 0.0);
        for (column, (m, dm)) in basis.modulus.iter().zip(basis.modulus_slope).enumerate() {
            if column >= self.coefficients.ncols() {
                break;
            }
            for row in 0..self.coefficients.nrows() {
                let c = self.coefficients[(row, column)];
                value += c * basis.ratio[row] * m;
                ratio_slope += c * basis.ratio_slope[row] * m;
                modulus_slope += c * basis.ratio[row] * dm;
            }
        }
        Value {
            value,
            ratio_slope: ratio_slope * self.ratio.scale() * ratio,
            modulus_slope: modulus_slope * self.log_modulus.scale(),
        }
    }

    fn basis(&self, ratio: f64, log_modulus: f64) -> Basis {
        let mut basis = Basis::default();
        chebyshev(
            self.ratio.place(ratio),
            &mut basis.ratio,
            &mut basis.ratio_slope,
        );
        chebyshev(
            self.log_modulus.place(log_modulus),
            &mut basis.modulus,
            &mut basis.modulus_slope,
        );
        basis
    }
}

#[derive(Default)]
struct Basis {
    ratio: [f64; DEGREE_IN_RATIO + 1],
    ratio_slope: [f64; DEGREE_IN_RATIO + 1],
    modulus: [f64; DEGREE_IN_MODULUS + 1],
    modulus_slope: [f64; DEGREE_IN_MODULUS + 1],
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(of: impl Fn(f64, f64) -> f64) -> Vec<Sample> {
        let grid = (0..8).flat_map(|i| (0..12).map(move |j| (i, j)));
        grid.map(|(i, j)| {
            let (ratio, log_modulus) = (0.1 + 0.1 * f64::from(j), 10.0 + 0.3 * f64::from(i));
            Sample {
                ratio,
                log_modulus,
                value: of(ratio, log_modulus),
            }
        })
        .collect()
    }

    #[test]
    fn a_polynomial_is_found_again_with_its_slopes() {
        let of =
            |x: f64, m: f64| 0.3 * x * x - 0.1 * x.powi(4) * (m - 11.0) + 0.2 * (m - 11.0).powi(3);
        let surface = Surface::fit(&samples(of), 8).unwrap();
        let (x, m) = (0.77, 11.4);
        let value = surface.at(x, m);
        assert!((value.value - of(x, m)).abs() < 1e-12);
        let in_ratio = x * (0.6 * x - 0.4 * x.powi(3) * (m - 11.0));
        let in_modulus = -0.1 * x.powi(4) + 0.6 * (m - 11.0).powi(2);
        assert!((value.ratio_slope - in_ratio).abs() < 1e-11);
        assert!((value.modulus_slope - in_modulus).abs() < 1e-11);
        assert!(surface.error() < 1e-12);
    }

    #[test]
    fn the_error_is_that_of_a_sample_left_out() {
        // ±0.1 % of alternating scatter, which no polynomial of degree 6 follows.
        let scatter = |x: f64| {
            1e-3 * if (x * 10.0).round() % 2.0 == 0.0 {
                1.0
            } else {
                -1.0
            }
        };
        let surface = Surface::fit(&samples(|x, m| x * m + scatter(x)), 8).unwrap();
        assert!(
            (1e-3..4e-3).contains(&surface.error()),
            "{}",
            surface.error()
        );
    }

    #[test]
    fn one_modulus_makes_a_surface_that_does_not_depend_on_it() {
        let one: Vec<_> = samples(|x, _| x).into_iter().take(12).collect();
        let value = Surface::fit(&one, 1).unwrap().at(0.5, 25.0);
        assert!((value.value - 0.5).abs() < 1e-12 && value.modulus_slope == 0.0);
    }
}
