//! A sphere on layers with a rigid base: solution of the integral equation.
//!
//! With P(ξ) = ∫₀ᵃ φ(t) cos ξt dt for the transform of the pressure, the mixed boundary problem
//! becomes a Fredholm equation of the second kind (Lebedev & Ufliand 1958)
//!
//! φ(s) − (2/π) ∫₀ᵃ K(s, t) φ(t) dt = (E*/π)(δ − s²/R),  K = ∫₀^∞ (1 − L(ξh)) cos ξs cos ξt dξ,
//!
//! with φ(a) = 0 because the pressure ends smoothly, and F = 2π ∫ φ. Both bodies may be elastic.
//! 1/E* is then the sum of the compliances of the sphere and the touched layer, and the deficit 1 −
//! L is multiplied by the fraction of the layer. K is analytic, so Nyström's method on Gauss nodes
//! converges exponentially.

use super::{Layer, Waveguide};
use crate::error::{ElasticityError, Quantity, poisson};
use crate::numerics::{Chebyshev, cubic, gauss_legendre, gauss_panels, panel_edges};
use nalgebra::{DMatrix, DVector, Matrix2, Matrix2x4, Matrix4, Matrix4x2, Vector4};
use std::f64::consts::FRAC_2_PI;

/// The contact of a sphere with layers, for one ratio of contact radius to their thickness.
///
/// ```
/// use tactile_elasticity::contact::{Bond, LayerEquation};
///
/// // A contact that is small compared with the layer follows Hertz.
/// let contact = LayerEquation::new(Bond::Bonded, 0.5)?.solve(1e-4)?;
/// assert!(
///     (contact.force_ratio - 1.0_f64).abs() < 2e-4
///         && (contact.indentation_ratio - 1.0).abs() < 2e-4
/// );
/// assert!((contact.chi / contact.a_over_h - 1.0).abs() < 2e-4);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct LayerContact {
    /// a/h, with h the thickness of all layers.
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

// Largest a/h that is solved. For larger ratios a thin-layer asymptote is the better theory.
const LARGEST_A_OVER_H: f64 = 20.0;

/// The contact of a sphere with layers on a rigid base.
///
/// ```
/// use tactile_elasticity::contact::{Bond, Layer, LayerEquation, Waveguide};
///
/// // A soft layer below a stiff one yields more than a rigid base.
/// let layer = |thickness_m, youngs_modulus_pa| Layer {
///     thickness_m,
///     youngs_modulus_pa,
///     poisson_ratio: 0.5_f64,
/// };
/// let on_soft = Waveguide::new(vec![layer(2e-3, 1e5), layer(8e-3, 1e4)])?;
/// let on_rigid = Waveguide::new(vec![layer(10e-3, 1e5)])?;
/// let force = |guide| {
///     LayerEquation::of_layers(&guide, Bond::Bonded)?
///         .solve(0.2)
///         .map(|c| c.force_ratio_same_radius)
/// };
/// assert!(force(on_soft)? < 0.9 * force(on_rigid)?);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct LayerEquation {
    kernel: LayerKernel,
    share: f64,
}

impl LayerEquation {
    /// One layer with Poisson ratio ν under a rigid sphere.
    ///
    /// # Errors
    /// [`ElasticityError::PoissonRatio`].
    pub fn new(bond: Bond, poisson_ratio: f64) -> Result<Self, ElasticityError> {
        Ok(Self::of_kernel(&LayerKernel::new(bond, poisson_ratio)?))
    }

    /// Layers bonded to one another, the touched one first, under a rigid sphere. `bond` is that of
    /// the lowest layer to the rigid base.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`] for the thickness of a rigid waveguide, which has no
    /// layers.
    pub fn of_layers(waveguide: &Waveguide, bond: Bond) -> Result<Self, ElasticityError> {
        Ok(Self::of_kernel(&LayerKernel::of_layers(waveguide, bond)?))
    }

    /// Uses an elastic sphere: `share` is the touched layer's part of 1/E*, in [0, 1].
    ///
    /// A share outside this range is moved to the nearer end.
    ///
    /// ```
    /// use tactile_elasticity::contact::{Bond, LayerEquation};
    ///
    /// // The softer the sphere, the less the depth of the layer matters.
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
    fn kernel(&self) -> &LayerKernel {
        &self.kernel
    }

    /// The contact at a/h. O(n³ + n² q) with n ≈ 24 + 6 a/h₁ nodes, where h₁ is the thickness of
    /// the touched layer, and several hundred wavenumbers q.
    ///
    /// [`ElasticityError::NotPositive`], and [`ElasticityError::OutOfRange`] for a/h above 20.
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

/// The kernel on the nodes for one a/h, valid for every share.
struct DiscreteKernel {
    a_over_h: f64,
    /// Gauss nodes on [0, 1] with their weights.
    rule: Vec<(f64, f64)>,
    /// Wavenumbers s with the weights of an integral over them.
    wavenumbers: Vec<(f64, f64)>,
    /// cos(sρσ) at the nodes σ and the wavenumbers s. The last row belongs to the rim, σ = 1.
    cosines: DMatrix<f64>,
    /// ∫(1 − L) cos(uρσ) cos(uρτ) du at the nodes σ, τ. The last row belongs to the rim, σ = 1.
    values: DMatrix<f64>,
}

impl DiscreteKernel {
    fn new(kernel: &LayerKernel, a_over_h: f64) -> Result<Self, ElasticityError> {
        Quantity::ContactRadius.positive(a_over_h)?;
        if a_over_h > LARGEST_A_OVER_H {
            return Err(out_of_range(a_over_h));
        }
        // The pressure bends within h₁ of the rim: six nodes over this length leave an error of
        // 10⁻⁹. A skin thinner than a/40 is smoothed, because the cost is the third power of the
        // number of nodes.
        let per_top_layer = (a_over_h / kernel.top_thickness()).min(40.0);
        let rule = gauss_legendre(24 + (6.0 * per_top_layer) as usize);
        let wavenumbers = kernel.wavenumbers(a_over_h);
        let deficits: Vec<f64> = wavenumbers
            .iter()
            .map(|&(s, w)| w * kernel.deficit(s))
            .collect();
        let node = |i: usize| rule.get(i).map_or(1.0, |r| r.0);
        let cosines = DMatrix::from_fn(rule.len() + 1, wavenumbers.len(), |i, q| {
            (wavenumbers[q].0 * a_over_h * node(i)).cos()
        });
        let weighted = DMatrix::from_fn(wavenumbers.len(), rule.len(), |q, j| {
            cosines[(j, q)] * deficits[q]
        });
        Ok(Self {
            a_over_h,
            rule,
            values: &cosines * weighted,
            wavenumbers,
            cosines,
        })
    }

    /// φ for the right sides 1, s² and K(1, s), one column each: a flat punch, the curvature of the
    /// sphere, and a shift of the rim.
    fn solutions(&self, share: f64) -> Result<Solutions, ElasticityError> {
        let (rule, kernel) = (&self.rule, &self.values);
        let n = rule.len();
        let scale = FRAC_2_PI * self.a_over_h * share;
        let matrix = DMatrix::from_fn(n, n, |i, j| {
            f64::from(i == j) - scale * kernel[(i, j)] * rule[j].1
        });
        let right = DMatrix::from_fn(n, 3, |i, side| match side {
            0 => 1.0,
            1 => rule[i].0 * rule[i].0,
            _ => scale * kernel[(n, i)],
        });
        let phi = matrix.lu().solve(&right);
        let phi = phi.ok_or(out_of_range(self.a_over_h))?;
        let integral = |side: usize| (0..n).map(|j| rule[j].1 * phi[(j, side)]).sum::<f64>();
        // φ at the rim by Nyström interpolation. The last row of the kernel belongs to s = a.
        let rim = |side: usize| {
            let integral = (0..n).map(|j| kernel[(n, j)] * rule[j].1 * phi[(j, side)]);
            1.0 + scale * integral.sum::<f64>()
        };
        Ok(Solutions {
            scale,
            integrals: [integral(0), integral(1)],
            rims: [rim(0), rim(1)],
            phi,
        })
    }

    /// The contact if `share` is the touched layer's part of 1/E*.
    fn contact(&self, share: f64) -> Result<LayerContact, ElasticityError> {
        let solutions = self.solutions(share)?;
        let ratio = solutions.indentation_ratio();
        let same_radius = solutions.force_ratio();
        Ok(LayerContact {
            a_over_h: self.a_over_h,
            chi: self.a_over_h * ratio.sqrt(),
            force_ratio: same_radius / ratio.powf(1.5),
            force_ratio_same_radius: same_radius,
            indentation_ratio: ratio,
        })
    }

    /// Change of ln F at constant contact radius under a rigid sphere, per unit change of the
    /// deficit at each wavenumber, times its weight.
    ///
    /// The kernel is symmetric. To first order, a change dK of the kernel changes ∫φ of a right
    /// side b by ⟨g, dK φ⟩, with g the solution of a flat punch. It changes φ at the rim by dK φ
    /// projected on the solution of K(1, ·) and on the rim itself. Together, ln F changes by 1.5 ⟨g
    /// − p ∫g/g(1), dK (ρg − r)⟩, with ρg − r the φ of the contact. By wavenumbers dK is diagonal.
    fn log_force_by_deficit(&self) -> Result<Vec<f64>, ElasticityError> {
        let solutions = self.solutions(1.0)?;
        let n = self.rule.len();
        let by_rim = solutions.integrals[0] / solutions.rims[0];
        let ratio = solutions.indentation_ratio();
        // Cosine transforms of both factors: weights for the cosines of the nodes, then for that of
        // the rim.
        let factor = |of: &dyn Fn(f64, f64, f64) -> f64, rim: f64| {
            DVector::from_fn(n + 1, |i, _| match self.rule.get(i) {
                Some((_, w)) => {
                    let phi = solutions.phi.row(i);
                    w * of(phi[0], phi[1], phi[2])
                }
                None => rim,
            })
        };
        let contact = factor(&|flat, round, _| ratio * flat - round, 0.0);
        let moved = factor(&|flat, _, rim| flat - by_rim * rim, -by_rim);
        let [contact, moved] = [contact, moved].map(|factor| self.cosines.tr_mul(&factor));
        let scale = 1.5 * solutions.scale / solutions.force_ratio();
        let of = |(q, (_, w)): (usize, &(f64, f64))| scale * w * contact[q] * moved[q];
        Ok(self.wavenumbers.iter().enumerate().map(of).collect())
    }
}

/// Solutions of the integral equation from [`DiscreteKernel::solutions`].
struct Solutions {
    /// (2/π) a/h times the share.
    scale: f64,
    phi: DMatrix<f64>,
    /// For the first two: integrals over \[0, 1\], and values at the rim.
    integrals: [f64; 2],
    rims: [f64; 2],
}

impl Solutions {
    fn indentation_ratio(&self) -> f64 {
        self.rims[1] / self.rims[0]
    }

    /// F over Hertz's force at the same contact radius.
    fn force_ratio(&self) -> f64 {
        let [flat, round] = self.integrals;
        1.5 * (self.indentation_ratio() * flat - round)
    }
}

/// Derivatives of ln F by parameters of the layers, for a rigid sphere with a contact of radius a
/// (m). F is relative to the force on a half-space of the touched layer. Each entry of `moved`
/// holds the layers with one parameter lower and higher, and the difference of the two values.
///
/// # Errors
/// Those of [`LayerEquation::solve`].
pub(super) fn log_force_slopes(
    guide: &Waveguide,
    radius_m: f64,
    moved: impl IntoIterator<Item = ([Vec<Layer>; 2], f64)>,
) -> Result<Vec<f64>, ElasticityError> {
    let unit_m = guide.thickness_m();
    let kernel = LayerKernel::of_layers(guide, Bond::Bonded)?;
    let discrete = DiscreteKernel::new(&kernel, radius_m / unit_m)?;
    let by_deficit = discrete.log_force_by_deficit()?;
    let slope = |(layers, width): ([Vec<Layer>; 2], f64)| {
        let kernels = layers.map(|layers| LayerKernel::in_units_of(unit_m, &layers, Bond::Bonded));
        let wavenumbers = discrete.wavenumbers.iter().zip(&by_deficit);
        let change = wavenumbers.map(|(&(s, _), by_deficit)| {
            let [low, high] = kernels.each_ref().map(|kernel| kernel.deficit(s));
            by_deficit * (high - low)
        });
        change.sum::<f64>() / width
    };
    Ok(moved.into_iter().map(slope).collect())
}

fn out_of_range(found: f64) -> ElasticityError {
    Quantity::ContactRadius.beyond(found, LARGEST_A_OVER_H)
}

// The stiffness of layers on a rigid base relative to a half-space, by wavenumber.
//
// Under a pressure of wavenumber ξ the surface of a half-space is displaced by 2p/(E*ξ). For layers
// of total thickness h it is L(ξh) times this, with E* of the touched layer: L → 0 for long waves
// and L → 1 for short ones.

/// Bond of the layer to its rigid base.
///
/// ```
/// use tactile_elasticity::contact::{Bond, LayerEquation};
///
/// // A layer that is bonded to its base is stiffer than one that slides.
/// let ratio = |bond| LayerEquation::new(bond, 0.5)?.solve(1.0).map(|contact| contact.force_ratio);
/// assert!(ratio(Bond::Bonded)? > 1.5 * ratio(Bond::Free)?);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Bond {
    /// No displacement at the base.
    #[default]
    Bonded,
    /// The base supports the layer, which slides on it without friction.
    Free,
}

/// The deficit 1 − L(s) of layers on a rigid base, with s = ξh and h the total thickness.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LayerKernel {
    /// Layers, the touched one first. Never empty.
    layers: Vec<StackLayer>,
    bond: Bond,
}

impl LayerKernel {
    /// One layer with Poisson ratio ν.
    ///
    /// # Errors
    /// [`ElasticityError::PoissonRatio`].
    pub(crate) fn new(bond: Bond, poisson_ratio: f64) -> Result<Self, ElasticityError> {
        let layer = StackLayer {
            thickness: 1.0,
            shear_modulus: 1.0,
            poisson_ratio: poisson(poisson_ratio)?,
        };
        Ok(Self {
            layers: vec![layer],
            bond,
        })
    }

    /// Layers bonded to one another, the touched one first. `bond` is that of the lowest layer to
    /// the rigid base.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`] for the thickness of a rigid waveguide, which has no
    /// layers.
    pub(crate) fn of_layers(waveguide: &Waveguide, bond: Bond) -> Result<Self, ElasticityError> {
        let total = Quantity::Thickness.positive(waveguide.thickness_m())?;
        Ok(Self::in_units_of(total, waveguide.layers(), bond))
    }

    /// Layers with a thickness above zero in total. s is ξ times `unit_m`.
    fn in_units_of(unit_m: f64, layers: &[Layer], bond: Bond) -> Self {
        let layers: Vec<_> = layers
            .iter()
            .map(|layer| StackLayer {
                thickness: layer.thickness_m / unit_m,
                shear_modulus: 0.5 * layer.youngs_modulus_pa / (1.0 + layer.poisson_ratio),
                poisson_ratio: layer.poisson_ratio,
            })
            .filter(|layer| layer.thickness > 0.0)
            .collect();
        let top = layers[0].shear_modulus;
        let in_units_of_top = |layer: StackLayer| StackLayer {
            shear_modulus: layer.shear_modulus / top,
            ..layer
        };
        let layers = layers.into_iter().map(in_units_of_top).collect();
        Self { layers, bond }
    }

    /// 1 − L(s): the relative reduction of the surface compliance at s = kh compared with a
    /// half-space of the touched layer. It is 1 for long waves and 0 for short ones, and negative
    /// if a soft layer lies under a stiff one.
    pub(super) fn deficit(&self, s: f64) -> f64 {
        let Some((top, lower)) = self.layers.split_first().filter(|_| s > 1e-9) else {
            return 1.0; // long waves displace nothing
        };
        let mut below = Face::Base(self.bond);
        for layer in lower.iter().rev() {
            below = Face::Compliant(layer.compliance(s, &below));
        }
        let half_space = top.half_space()[(0, 0)];
        let y = s * top.thickness;
        if y > 1.0 {
            top.less_than_half_space(y, &below)[(0, 0)] / half_space
        } else {
            1.0 - top.compliance(s, &below)[(0, 0)] / half_space
        }
    }

    /// Thickness of the touched layer relative to the total.
    fn top_thickness(&self) -> f64 {
        self.layers[0].thickness
    }

    /// Nodes s and weights of ∫(1 − L(s)) ds, for integrands that oscillate as fast as cos²(s·x).
    pub(super) fn wavenumbers(&self, x: f64) -> Vec<(f64, f64)> {
        // The deficit decays as s²e^(−2s) in units of the touched layer: at 25 it is below 10⁻¹⁸.
        let end = 25.0 / self.top_thickness();
        // Sixteen Gauss points resolve a decay by e⁻⁵ and an argument of 16 to the last digit.
        let widest = (2.5 / self.top_thickness()).min(8.0 / x.max(f64::MIN_POSITIVE));
        gauss_panels(&panel_edges(end, 0.5, widest))
    }
}

// The surface of bonded elastic layers under a pressure wave.
//
// Under a normal traction p̂ J₀(kr) each layer deforms as W(z) J₀(kr), U(z) J₁(kr) with the
// tractions Σ and T, in units of 2kG. With y = kz pointing upwards, the state v = (W, U, Σ, T)
// obeys dv/dy = Mv,
//
// Ẇ = −nU + (1 − n)Σ,  U̇ = W + 2T,  Σ̇ = −T,  Ṫ = (1 + n)U + nΣ,  n = ν/(1 − ν),
//
// which is regular at ν = ½. As (M² − 1)² = 0, the transfer matrix exp(yM) is a cubic in M. It is
// not chained, because this would lose all digits at large y. Instead the compliance F with (W, U)
// = F (Σ, T) is propagated from the base to the surface, layer by layer: the growing waves dominate
// numerator and denominator alike, and their ratio keeps its digits at every kh.
//
// If the touched layer is deep compared with the wavelength, 1 − L is small and would be lost in
// rounding. There the wave reflected by its lower face, e^(−2y) times a reflection coefficient,
// gives 1 − L directly.

/// A layer in units of the total thickness and of the top layer's shear modulus.
#[derive(Debug, Clone, Copy, PartialEq)]
struct StackLayer {
    thickness: f64,
    shear_modulus: f64,
    poisson_ratio: f64,
}

// Above this kh a layer is a half-space to the last digit: the layers below contribute y²e^(−2y).
const DEEP: f64 = 30.0;

/// The support of a layer's lower face.
enum Face {
    Base(Bond),
    /// Layers with this compliance, in units of the touched layer's modulus.
    Compliant(Matrix2<f64>),
}

impl StackLayer {
    /// F at the layer's upper face.
    fn compliance(&self, s: f64, below: &Face) -> Matrix2<f64> {
        let y = s * self.thickness;
        if y > DEEP {
            return self.half_space();
        }
        let identity = Matrix2::identity();
        let normal = Matrix2::new(1.0, 0.0, 0.0, 0.0);
        // Displacements and tractions of two independent solutions at the lower face, one column
        // each.
        let (displacements, tractions) = match below {
            Face::Compliant(compliance) => (*compliance, identity),
            Face::Base(Bond::Bonded) => (Matrix2::zeros(), identity),
            Face::Base(Bond::Free) => (identity - normal, normal),
        };
        let state = self.transfer(y) * stacked(displacements, tractions / self.shear_modulus);
        let displacements = state.fixed_rows::<2>(0).into_owned();
        let tractions = state.fixed_rows::<2>(2) * self.shear_modulus;
        displacements * inverse(tractions)
    }

    /// F of a half-space of this layer minus F at its upper face: e^(−2y)(D − F T)ρ(T₀ + e^(−2y)
    /// Tρ)⁻¹. D and T are the displacements and tractions of the waves that decay upwards, T₀ those
    /// of the waves that grow, and ρ is the reflection at the lower face.
    fn less_than_half_space(&self, y: f64, below: &Face) -> Matrix2<f64> {
        let unit = self.shear_modulus;
        // The two rows that vanish at the lower face.
        let condition = match below {
            Face::Compliant(f) => {
                let mut rows = Matrix2x4::identity();
                rows.fixed_columns_mut::<2>(2).copy_from(&(f * -unit));
                rows
            }
            Face::Base(Bond::Bonded) => Matrix2x4::identity(),
            Face::Base(Bond::Free) => Matrix2x4::new(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
        };
        let reflection = inverse(condition * self.decaying(0.0)) * (condition * self.growing(-y));
        let returned = self.decaying(y) * reflection * (-2.0 * y).exp();
        let displacements = returned.fixed_rows::<2>(0);
        let tractions = returned.fixed_rows::<2>(2) * unit;
        let growing = self.growing(0.0).fixed_rows::<2>(2) * unit;
        (displacements - self.half_space() * tractions) * inverse(growing - tractions)
    }

    /// The two waves that decay upwards, at height y above their origin, without the factor e^(−y).
    fn decaying(&self, y: f64) -> Matrix4x2<f64> {
        let nu = self.poisson_ratio;
        let w = Vector4::new(1.0, 1.0, -1.0, -1.0);
        let yw = Vector4::new(
            y,
            y - (3.0 - 4.0 * nu),
            1.0 - 2.0 * nu - y,
            2.0 - 2.0 * nu - y,
        );
        Matrix4x2::from_columns(&[w, yw])
    }

    /// The two waves that grow upwards, at height y, without the factor e^y.
    fn growing(&self, y: f64) -> Matrix4x2<f64> {
        let nu = self.poisson_ratio;
        let w = Vector4::new(1.0, -1.0, 1.0, -1.0);
        let yw = Vector4::new(
            y,
            -y - (3.0 - 4.0 * nu),
            1.0 - 2.0 * nu + y,
            -(2.0 - 2.0 * nu) - y,
        );
        Matrix4x2::from_columns(&[w, yw])
    }

    fn half_space(&self) -> Matrix2<f64> {
        let (own, other) = (
            2.0 * (1.0 - self.poisson_ratio),
            1.0 - 2.0 * self.poisson_ratio,
        );
        Matrix2::new(own, other, other, own) / self.shear_modulus
    }

    /// e^(−y) exp(yM) = c₀ + c₁M + c₂M² + c₃M³, Hermite's interpolation of the exponential at the
    /// double eigenvalues ±1.
    fn transfer(&self, y: f64) -> Matrix4<f64> {
        let n = self.poisson_ratio / (1.0 - self.poisson_ratio);
        #[rustfmt::skip]
        let m = Matrix4::new(
            0.0, -n, 1.0 - n, 0.0,
            1.0, 0.0, 0.0, 2.0,
            0.0, 0.0, 0.0, -1.0,
            0.0, 1.0 + n, n, 0.0,
        );
        let decay = (-2.0 * y).exp();
        let (cosh, sinh) = (0.5 * (1.0 + decay), -0.5 * (-2.0 * y).exp_m1());
        let c3 = 0.5 * y_cosh_less_sinh(y, cosh, sinh);
        let c2 = 0.5 * y * sinh;
        let square = m * m;
        Matrix4::identity() * (cosh - c2) + m * (sinh - c3) + square * c2 + square * m * c3
    }
}

/// e^(−y) (y cosh y − sinh y), replaced by a series that starts with y³/3 for small y, where the
/// terms cancel.
fn y_cosh_less_sinh(y: f64, cosh: f64, sinh: f64) -> f64 {
    if y > 0.5 {
        return y * cosh - sinh;
    }
    // Σ 2k y^(2k+1)/(2k+1)!. At y = ½ the first neglected term is 10⁻¹⁷ of the sum.
    let square = y * y;
    let tail = 1.0 + square / 54.0 * (1.0 + square / 88.0 * (1.0 + square / 130.0));
    let series = 1.0 + square / 10.0 * (1.0 + square / 28.0 * tail);
    (-y).exp() * square * y / 3.0 * series
}

fn stacked(upper: Matrix2<f64>, lower: Matrix2<f64>) -> Matrix4x2<f64> {
    let mut rows = Matrix4x2::zeros();
    rows.fixed_rows_mut::<2>(0).copy_from(&upper);
    rows.fixed_rows_mut::<2>(2).copy_from(&lower);
    rows
}

/// Inverse of tractions or conditions of independent solutions. It exists because a load has one
/// solution.
fn inverse(matrix: Matrix2<f64>) -> Matrix2<f64> {
    matrix.try_inverse().unwrap_or_else(Matrix2::zeros)
}

/// A contact of given a/h relative to Hertz's with the same radius, with slopes in ln a.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SharedContact {
    /// ln of the force relative to Hertz's, and its slope.
    pub(crate) force: [f64; 2],
    /// ln of the indentation relative to Hertz's, and its slope.
    pub(crate) indentation: [f64; 2],
}

/// Contacts of an elastic sphere with the layers: cubic in ln(a/h), Chebyshev in the touched
/// layer's share of 1/E*.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SharedLayerTable {
    first: f64,
    rows: Vec<Row>,
}

// Twelve shares leave an error of 10⁻⁷ at a/h = 3 (see the test). Each costs one factorisation per
// row.
const SHARES: usize = 12;

// Width of a row in ln a. The error of the cubic is proportional to its fourth power, and is 5·10⁻⁶
// here.
const STEP: f64 = 0.1;

#[derive(Debug, Clone, PartialEq)]
struct Row {
    force: Chebyshev<SHARES>,
    indentation: Chebyshev<SHARES>,
}

impl SharedLayerTable {
    /// A table for a/h in `range`, whose upper end is at most [`LARGEST_A_OVER_H`]. `None` if a row
    /// cannot be solved.
    pub(crate) fn new(kernel: &LayerKernel, range: (f64, f64)) -> Option<Self> {
        let (first, last) = (range.0.ln(), range.1.min(LARGEST_A_OVER_H).ln());
        let count = ((last - first) / STEP).ceil().max(3.0) as usize + 1;
        let at = |k: usize| (first + STEP * k as f64).exp().min(LARGEST_A_OVER_H);
        let rows: Option<Vec<_>> = (0..count).map(|k| Row::solve(kernel, at(k))).collect();
        Some(Self { first, rows: rows? })
    }

    /// The contact at a/h and a share in [0, 1]. `None` outside the table.
    pub(crate) fn at(&self, a_over_h: f64, share: f64) -> Option<SharedContact> {
        let (rows, at) = (&self.rows, a_over_h.ln());
        let place = (at - self.first) / STEP;
        if place > (rows.len() - 1) as f64 {
            return None;
        }
        if place < 0.0 {
            // The contact is small compared with the layer: ln(1 + c a) ≈ c a.
            let shrink = (at - self.first).exp();
            let (force, indentation) = rows[0].at(share);
            return Some(SharedContact {
                force: [force * shrink; 2],
                indentation: [indentation * shrink; 2],
            });
        }
        let start = (place as usize).saturating_sub(1).min(rows.len() - 4);
        let window: [(f64, (f64, f64)); 4] = std::array::from_fn(|i| {
            let k = start + i;
            (self.first + STEP * k as f64, rows[k].at(share))
        });
        Some(SharedContact {
            force: cubic(window.map(|(x, v)| (x, v.0)), at).into(),
            indentation: cubic(window.map(|(x, v)| (x, v.1)), at).into(),
        })
    }
}

impl Row {
    fn solve(kernel: &LayerKernel, a_over_h: f64) -> Option<Self> {
        let kernel = DiscreteKernel::new(kernel, a_over_h).ok()?;
        let (mut force, mut indentation) = ([0.0; SHARES], [0.0; SHARES]);
        for (j, share) in Chebyshev::<SHARES>::nodes().into_iter().enumerate() {
            let contact = kernel.contact(share).ok()?;
            force[j] = contact.force_ratio_same_radius.ln();
            indentation[j] = contact.indentation_ratio.ln();
        }
        let finite = force.iter().chain(&indentation).all(|x| x.is_finite());
        finite.then(|| Self {
            force: Chebyshev::through(&force),
            indentation: Chebyshev::through(&indentation),
        })
    }

    fn at(&self, share: f64) -> (f64, f64) {
        (self.force.value(share), self.indentation.value(share))
    }
}

#[cfg(test)]
#[path = "layers_tests.rs"]
mod tests;
