//! A sphere on a layer: the integral equation solved.
//!
//! With P(ξ) = ∫₀ᵃ φ(t) cos ξt dt for the transform of the pressure, the mixed boundary problem becomes Fredholm's
//! equation of the second kind (Lebedev & Ufliand 1958)
//!
//! φ(s) − (2/π) ∫₀ᵃ K(s, t) φ(t) dt = (E*/π)(δ − s²/R),  K = ∫₀^∞ (1 − L(ξh)) cos ξs cos ξt dξ,
//!
//! with φ(a) = 0 where the pressure ends smoothly, and F = 2π ∫ φ. Both bodies may yield: with 1/E* their sum, the deficit 1 − L counts
//! with the layer's share of it. K is analytic, so that Nyström's method on Gauss nodes converges exponentially.

use super::layer_kernel::{LayerKernel, samples};
use super::quadrature::gauss_legendre;
use crate::error::{ElasticityError, Quantity, positive};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::FRAC_2_PI;

/// The contact of a sphere with a layer at one ratio of contact radius to thickness.
///
/// ```
/// use tactile_elasticity::contact::{Bond, LayerEquation, LayerKernel};
///
/// // A contact small beside the layer is Hertz's.
/// let contact = LayerEquation::new(&LayerKernel::new(Bond::Bonded, 0.5)?).solve(1e-4)?;
/// assert!((contact.force_ratio - 1.0_f64).abs() < 2e-4 && (contact.indentation_ratio - 1.0).abs() < 2e-4);
/// assert!((contact.chi / contact.a_over_h - 1.0).abs() < 2e-4);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct LayerContact {
    /// a/h.
    pub a_over_h: f64,
    /// χ = √(Rδ)/h.
    pub chi: f64,
    /// F over Hertz's force at the same indentation, 4⁄3 E*√R δ^{3⁄2}.
    pub force_ratio: f64,
    /// F over Hertz's force at the same contact radius, 4E*a³/(3R).
    pub force_ratio_same_radius: f64,
    /// δ over Hertz's a²/R.
    pub indentation_ratio: f64,
}

/// The largest a/h solved for; beyond, a thin-layer asymptote is the better theory.
pub(crate) const LARGEST_A_OVER_H: f64 = 20.0;

/// Solves contacts of one layer.
#[derive(Debug, Clone, PartialEq)]
pub struct LayerEquation {
    kernel: LayerKernel,
    share: f64,
}

impl LayerEquation {
    /// Of a layer kernel, for a sphere that does not yield.
    pub fn new(kernel: &LayerKernel) -> Self {
        Self {
            kernel: *kernel,
            share: 1.0,
        }
    }

    /// Of a sphere that yields too: `share` is the layer's part of 1/E*, in [0, 1].
    ///
    /// A share outside is taken as its nearer end.
    ///
    /// ```
    /// use tactile_elasticity::contact::{Bond, LayerEquation, LayerKernel};
    ///
    /// // The more the sphere itself yields, the less the layer's depth matters.
    /// let layer = LayerEquation::new(&LayerKernel::new(Bond::Bonded, 0.5)?);
    /// let half = layer.clone().with_share(0.5).solve(1.0)?.force_ratio;
    /// assert!(1.0 < half && half < layer.solve(1.0)?.force_ratio);
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn with_share(mut self, share: f64) -> Self {
        self.share = share.clamp(0.0, 1.0);
        self
    }

    /// The contact at a/h; O(n³ + n q) with n ≈ 24 + 6 a/h nodes and q ≈ 192 + 32 a/h wavenumbers.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`], and [`ElasticityError::OutOfRange`] beyond a/h = 20.
    ///
    /// ```
    /// use tactile_elasticity::contact::{Bond, LayerEquation, LayerKernel};
    /// let layer = LayerEquation::new(&LayerKernel::new(Bond::Bonded, 0.5)?);
    /// let contact = layer.solve(1.0)?;
    /// assert!((contact.chi - 0.747_940_830_3f64).abs() < 1e-9);
    /// assert!((contact.force_ratio - 3.371_098_31f64).abs() < 1e-7);
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn solve(&self, a_over_h: f64) -> Result<LayerContact, ElasticityError> {
        positive(a_over_h, Quantity::ContactRadius)?;
        let unsolvable = ElasticityError::OutOfRange {
            quantity: Quantity::ContactRadius,
            found: a_over_h,
            limit: LARGEST_A_OVER_H,
        };
        if a_over_h > LARGEST_A_OVER_H {
            return Err(unsolvable);
        }
        let rule = gauss_legendre(24 + (6.0 * a_over_h) as usize);
        let n = rule.len();
        let kernel = self.kernel(&rule, a_over_h);
        let scale = FRAC_2_PI * a_over_h * self.share;
        let (flat, round) = flat_and_round(&rule, &kernel, scale).ok_or(unsolvable)?;
        // φ at the rim by Nyström's own interpolation; the last row of the kernel belongs to s = a.
        let rim = |phi: &DVector<f64>, rhs: f64| {
            rhs + scale
                * (0..n)
                    .map(|j| kernel[(n, j)] * rule[j].1 * phi[j])
                    .sum::<f64>()
        };
        let ratio = rim(&round, 1.0) / rim(&flat, 1.0);
        let integral = |phi: &DVector<f64>| (0..n).map(|j| rule[j].1 * phi[j]).sum::<f64>();
        let same_radius = 1.5 * (ratio * integral(&flat) - integral(&round));
        Ok(LayerContact {
            a_over_h,
            chi: a_over_h * ratio.sqrt(),
            force_ratio: same_radius / ratio.powf(1.5),
            force_ratio_same_radius: same_radius,
            indentation_ratio: ratio,
        })
    }

    /// ∫(1 − L) cos(uρσ) cos(uρτ) du for all nodes σ, and σ = 1 as the last row.
    fn kernel(&self, rule: &[(f64, f64)], a_over_h: f64) -> DMatrix<f64> {
        let samples = samples(&self.kernel, a_over_h);
        let cosine = |s: f64, x: f64| (s * a_over_h * x).cos();
        let rows = rule.len() + 1;
        let at = |i: usize| rule.get(i).map_or(1.0, |r| r.0);
        let cosines = DMatrix::from_fn(rows, samples.len(), |i, q| cosine(samples[q].0, at(i)));
        let weighted = DMatrix::from_fn(samples.len(), rule.len(), |q, j| {
            cosines[(j, q)] * samples[q].1
        });
        cosines * weighted
    }
}

/// φ for the right sides 1 and s², those of a flat punch and of the sphere's roundness.
fn flat_and_round(
    rule: &[(f64, f64)],
    kernel: &DMatrix<f64>,
    scale: f64,
) -> Option<(DVector<f64>, DVector<f64>)> {
    let n = rule.len();
    let matrix = DMatrix::from_fn(n, n, |i, j| {
        f64::from(i == j) - scale * kernel[(i, j)] * rule[j].1
    });
    let ones = DVector::from_element(n, 1.0);
    let squares = DVector::from_fn(n, |i, _| rule[i].0 * rule[i].0);
    let lu = matrix.lu();
    Some((lu.solve(&ones)?, lu.solve(&squares)?))
}

/// ln(F/F_Hertz) over ln χ, tabulated once and interpolated.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LayerTable {
    rows: Vec<(f64, f64)>,
}

const NODES: usize = 81;
const SMALLEST_A_OVER_H: f64 = 1e-5;

impl LayerTable {
    pub(crate) fn new(equation: &LayerEquation) -> Self {
        let span = (LARGEST_A_OVER_H / SMALLEST_A_OVER_H).ln();
        let at = |k: usize| SMALLEST_A_OVER_H * (span * k as f64 / (NODES - 1) as f64).exp();
        let solved = (0..NODES).filter_map(|k| equation.solve(at(k).min(LARGEST_A_OVER_H)).ok());
        Self {
            rows: solved.map(|c| (c.chi.ln(), c.force_ratio.ln())).collect(),
        }
    }

    /// ln(F/F_Hertz) at χ and its slope in ln χ, by four-point Lagrange interpolation; None beyond the table.
    pub(crate) fn of_chi(&self, chi: f64) -> Option<(f64, f64)> {
        let (at, rows) = (chi.ln(), &self.rows);
        if at > rows.last()?.0 {
            return None;
        }
        if at < rows[0].0 {
            // ln(1 + c χ) ≈ c χ.
            let value = rows[0].1 * (at - rows[0].0).exp();
            return Some((value, value));
        }
        let next = rows.partition_point(|r| r.0 < at).clamp(2, rows.len() - 2);
        let window = &rows[next - 2..next + 2];
        let (mut value, mut slope) = (0.0, 0.0);
        for (i, row) in window.iter().enumerate() {
            let (mut basis, mut derivative) = (1.0, 0.0);
            for (_, other) in window.iter().enumerate().filter(|&(j, _)| j != i) {
                let width = row.0 - other.0;
                derivative = (derivative * (at - other.0) + basis) / width;
                basis *= (at - other.0) / width;
            }
            value += row.1 * basis;
            slope += row.1 * derivative;
        }
        Some((value, slope))
    }
}

#[cfg(test)]
mod tests {
    use super::super::layer_kernel::Bond;
    use super::*;

    #[test]
    fn a_deep_layer_is_a_half_space() {
        let equation = LayerEquation::new(&LayerKernel::new(Bond::Free, 0.3).unwrap());
        let contact = equation.solve(1e-6).unwrap();
        // The series' linear term is 0.74 χ.
        assert!((contact.force_ratio - 1.0).abs() < 1e-6);
        assert!((contact.indentation_ratio - 1.0).abs() < 1e-6);
    }

    #[test]
    fn without_a_share_the_layer_does_not_matter() {
        let equation =
            LayerEquation::new(&LayerKernel::new(Bond::Bonded, 0.5).unwrap()).with_share(0.0);
        assert!((equation.solve(3.0).unwrap().force_ratio - 1.0).abs() < 1e-14);
    }

    #[test]
    fn the_table_agrees_with_the_equation_between_its_nodes() {
        let equation = LayerEquation::new(&LayerKernel::new(Bond::Bonded, 0.5).unwrap());
        let table = LayerTable::new(&equation);
        for a in [3e-6, 0.0123, 0.3, 0.77, 2.3, 11.0] {
            let exact = equation.solve(a).unwrap();
            let (value, _) = table.of_chi(exact.chi).unwrap();
            // Cubic interpolation with nodes 0.18 apart in ln a.
            assert!(
                (value - exact.force_ratio.ln()).abs() < 2e-5,
                "{a}: {:e}",
                value - exact.force_ratio.ln()
            );
        }
        assert!(table.of_chi(1e3).is_none());
    }

    #[test]
    fn the_slope_is_the_derivative() {
        let table = LayerTable::new(&LayerEquation::new(
            &LayerKernel::new(Bond::Bonded, 0.4).unwrap(),
        ));
        let (high, low) = (
            table.of_chi(0.5 * 1.001).unwrap().0,
            table.of_chi(0.5 / 1.001).unwrap().0,
        );
        let slope = (high - low) / (2.0 * 1.001f64.ln());
        assert!((table.of_chi(0.5).unwrap().1 - slope).abs() < 1e-5);
    }

    #[test]
    fn gauss_nodes_are_enough() {
        // The force of a layer 20 times thinner than the contact changes by less than 10⁻⁹ with one more node: compare
        // with the solution at nearly the same a/h, whose node count differs.
        let equation = LayerEquation::new(&LayerKernel::new(Bond::Bonded, 0.3).unwrap());
        let (a, b) = (
            equation.solve(5.0 - 1e-9).unwrap(),
            equation.solve(5.0).unwrap(),
        );
        assert!((a.force_ratio / b.force_ratio - 1.0).abs() < 1e-8);
    }
}
