//! A sphere on layers with a rigid base: the integral equation solved.
//!
//! With P(ξ) = ∫₀ᵃ φ(t) cos ξt dt for the transform of the pressure, the mixed boundary problem becomes Fredholm's
//! equation of the second kind (Lebedev & Ufliand 1958)
//!
//! φ(s) − (2/π) ∫₀ᵃ K(s, t) φ(t) dt = (E*/π)(δ − s²/R),  K = ∫₀^∞ (1 − L(ξh)) cos ξs cos ξt dξ,
//!
//! with φ(a) = 0 where the pressure ends smoothly, and F = 2π ∫ φ. Both bodies may yield: with 1/E* the sum of the sphere's
//! compliance and the touched layer's, the deficit 1 − L counts with the layer's share of it. K is analytic, so that Nyström's
//! method on Gauss nodes converges exponentially.

use super::layer_kernel::{Bond, LayerKernel};
use super::quadrature::gauss_legendre;
use super::waveguide::Waveguide;
use crate::error::{ElasticityError, Quantity, positive};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::FRAC_2_PI;

/// The contact of a sphere with layers at one ratio of contact radius to their thickness.
///
/// ```
/// use tactile_elasticity::contact::{Bond, LayerEquation};
///
/// // A contact small beside the layer is Hertz's.
/// let contact = LayerEquation::new(Bond::Bonded, 0.5)?.solve(1e-4)?;
/// assert!((contact.force_ratio - 1.0_f64).abs() < 2e-4 && (contact.indentation_ratio - 1.0).abs() < 2e-4);
/// assert!((contact.chi / contact.a_over_h - 1.0).abs() < 2e-4);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct LayerContact {
    /// a/h, h the thickness of all layers.
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

/// The contact of a sphere with layers on a rigid base.
///
/// ```
/// use tactile_elasticity::contact::{Bond, Layer, LayerEquation, Waveguide};
///
/// // A soft layer below makes a stiff one yield more than a rigid base does.
/// let layer = |thickness_m, youngs_modulus_pa| Layer { thickness_m, youngs_modulus_pa, poisson_ratio: 0.5_f64 };
/// let on_soft = Waveguide::new(vec![layer(2e-3, 1e5), layer(8e-3, 1e4)])?;
/// let on_rigid = Waveguide::new(vec![layer(10e-3, 1e5)])?;
/// let force = |guide| LayerEquation::of_layers(&guide, Bond::Bonded)?.solve(0.2).map(|c| c.force_ratio_same_radius);
/// assert!(force(on_soft)? < 0.9 * force(on_rigid)?);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct LayerEquation {
    kernel: LayerKernel,
    share: f64,
}

impl LayerEquation {
    /// Of one layer with Poisson ratio ν under a rigid sphere.
    ///
    /// # Errors
    /// [`ElasticityError::PoissonRatio`].
    pub fn new(bond: Bond, poisson_ratio: f64) -> Result<Self, ElasticityError> {
        Ok(Self {
            kernel: LayerKernel::new(bond, poisson_ratio)?,
            share: 1.0,
        })
    }

    /// Of layers bonded to one another, the touched one first, under a rigid sphere; `bond` is that of the lowest layer to the rigid
    /// base.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`] thickness: a rigid waveguide has no layers.
    pub fn of_layers(waveguide: &Waveguide, bond: Bond) -> Result<Self, ElasticityError> {
        Ok(Self {
            kernel: LayerKernel::of_layers(waveguide, bond)?,
            share: 1.0,
        })
    }

    /// With a sphere that yields too: `share` is the touched layer's part of 1/E*, in [0, 1].
    ///
    /// A share outside is taken as its nearer end.
    ///
    /// ```
    /// use tactile_elasticity::contact::{Bond, LayerEquation};
    ///
    /// // The more the sphere itself yields, the less the layer's depth matters.
    /// let layer = LayerEquation::new(Bond::Bonded, 0.5)?;
    /// let half = layer.clone().with_share(0.5).solve(1.0)?.force_ratio;
    /// assert!(1.0 < half && half < layer.solve(1.0)?.force_ratio);
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn with_share(mut self, share: f64) -> Self {
        self.share = share.clamp(0.0, 1.0);
        self
    }

    pub(crate) fn of_kernel(kernel: &LayerKernel) -> Self {
        Self {
            kernel: kernel.clone(),
            share: 1.0,
        }
    }

    #[cfg(test)]
    pub(crate) fn kernel(&self) -> &LayerKernel {
        &self.kernel
    }

    /// The contact at a/h; O(n³ + n² q) with n ≈ 24 + 6 a/h₁ nodes, h₁ the touched layer's thickness, and some hundreds of
    /// wavenumbers q.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`], and [`ElasticityError::OutOfRange`] beyond a/h = 20.
    ///
    /// ```
    /// use tactile_elasticity::contact::{Bond, LayerEquation};
    /// let layer = LayerEquation::new(Bond::Bonded, 0.5)?;
    /// let contact = layer.solve(1.0)?;
    /// assert!((contact.chi - 0.747_940_830_3f64).abs() < 1e-9);
    /// assert!((contact.force_ratio - 3.371_098_31f64).abs() < 1e-7);
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn solve(&self, a_over_h: f64) -> Result<LayerContact, ElasticityError> {
        DiscreteKernel::new(&self.kernel, a_over_h)?.contact(self.share)
    }
}

/// The kernel on the nodes of one a/h, which serves every share.
pub(crate) struct DiscreteKernel {
    a_over_h: f64,
    /// Gauss nodes on [0, 1] with their weights.
    rule: Vec<(f64, f64)>,
    /// ∫(1 − L) cos(uρσ) cos(uρτ) du at the nodes σ, τ; the last row is that of the rim, σ = 1.
    values: DMatrix<f64>,
}

impl DiscreteKernel {
    pub(crate) fn new(kernel: &LayerKernel, a_over_h: f64) -> Result<Self, ElasticityError> {
        positive(a_over_h, Quantity::ContactRadius)?;
        if a_over_h > LARGEST_A_OVER_H {
            return Err(out_of_range(a_over_h));
        }
        // The pressure bends within h₁ of the rim: six nodes for that length leave 10⁻⁹. A skin thinner than a/40 is
        // smoothed over rather than paid for with the third power of its nodes.
        let per_top_layer = (a_over_h / kernel.top_thickness()).min(40.0);
        let rule = gauss_legendre(24 + (6.0 * per_top_layer) as usize);
        let samples = kernel.samples(a_over_h);
        let node = |i: usize| rule.get(i).map_or(1.0, |r| r.0);
        let cosines = DMatrix::from_fn(rule.len() + 1, samples.len(), |i, q| {
            (samples[q].0 * a_over_h * node(i)).cos()
        });
        let weighted = DMatrix::from_fn(samples.len(), rule.len(), |q, j| {
            cosines[(j, q)] * samples[q].1
        });
        Ok(Self {
            a_over_h,
            rule,
            values: cosines * weighted,
        })
    }

    /// The contact with the touched layer's part of 1/E*.
    pub(crate) fn contact(&self, share: f64) -> Result<LayerContact, ElasticityError> {
        let (rule, kernel) = (&self.rule, &self.values);
        let n = rule.len();
        let scale = FRAC_2_PI * self.a_over_h * share;
        let (flat, round) =
            flat_and_round(rule, kernel, scale).ok_or(out_of_range(self.a_over_h))?;
        // φ at the rim by Nyström's own interpolation; the last row of the kernel belongs to s = a.
        let rim = |phi: &DVector<f64>, rhs: f64| {
            let integral = (0..n).map(|j| kernel[(n, j)] * rule[j].1 * phi[j]);
            rhs + scale * integral.sum::<f64>()
        };
        let ratio = rim(&round, 1.0) / rim(&flat, 1.0);
        let integral = |phi: &DVector<f64>| (0..n).map(|j| rule[j].1 * phi[j]).sum::<f64>();
        let same_radius = 1.5 * (ratio * integral(&flat) - integral(&round));
        Ok(LayerContact {
            a_over_h: self.a_over_h,
            chi: self.a_over_h * ratio.sqrt(),
            force_ratio: same_radius / ratio.powf(1.5),
            force_ratio_same_radius: same_radius,
            indentation_ratio: ratio,
        })
    }
}

fn out_of_range(found: f64) -> ElasticityError {
    ElasticityError::OutOfRange {
        quantity: Quantity::ContactRadius,
        found,
        limit: LARGEST_A_OVER_H,
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_deep_layer_is_a_half_space() {
        let equation = LayerEquation::new(Bond::Free, 0.3).unwrap();
        let contact = equation.solve(1e-6).unwrap();
        // The series' linear term is 0.74 χ.
        assert!((contact.force_ratio - 1.0).abs() < 1e-6);
        assert!((contact.indentation_ratio - 1.0).abs() < 1e-6);
    }

    #[test]
    fn without_a_share_the_layer_does_not_matter() {
        let equation = LayerEquation::new(Bond::Bonded, 0.5)
            .unwrap()
            .with_share(0.0);
        assert!((equation.solve(3.0).unwrap().force_ratio - 1.0).abs() < 1e-14);
    }

    #[test]
    fn gauss_nodes_are_enough() {
        // The force of a layer 20 times thinner than the contact changes by less than 10⁻⁹ with one more node: compare
        // with the solution at nearly the same a/h, whose node count differs.
        let equation = LayerEquation::new(Bond::Bonded, 0.3).unwrap();
        let (a, b) = (
            equation.solve(5.0 - 1e-9).unwrap(),
            equation.solve(5.0).unwrap(),
        );
        assert!((a.force_ratio / b.force_ratio - 1.0).abs() < 1e-8);
    }
}
