//! Strain of a deformation gradient.
//!
//! F = ∂x/∂X = I + H maps material to space, H = ∂u/∂X. All measures agree to first order in H and
//! are functions of the stretch U of F = R U:
//!
//! | measure | tensor | of a stretch λ |
//! |---|---|---|
//! | [`GreenLagrange`] | ½(FᵀF − I) | ½(λ² − 1) |
//! | [`EulerAlmansi`] | ½(I − F⁻ᵀF⁻¹) | ½(1 − λ⁻²) |
//! | [`Hencky`] | ln U | ln λ |
//! | [`Biot`] | U − I | λ − 1 |
//! | [`Infinitesimal`] | ½(H + Hᵀ) | λ − 1 |

use crate::error::{ElasticityError, Quantity};
use nalgebra::Matrix3;
use std::ops::Deref;

/// A strain measure: a symmetric tensor that vanishes under translation and rotation (for the
/// infinitesimal one, under translation only).
///
/// The trait is object safe, and boxed or shared measures implement it, so that a program can
/// choose at run time. Green–Lagrange and infinitesimal strain take about 10 ns, the others a small
/// eigenvalue problem.
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::strain::{GreenLagrange, Hencky, StrainMeasure};
/// let mut h = Matrix3::zeros();
/// h[(0, 0)] = 0.05; // 5 % stretch along x
/// let measures: [&dyn StrainMeasure; 2] = [&GreenLagrange, &Hencky];
/// let exx = measures.map(|m| m.strain(&h).unwrap()[(0, 0)]);
/// assert!((exx[0] - 0.05125).abs() < 1e-15);
/// assert!((exx[1] - 1.05f64.ln()).abs() < 1e-15);
/// ```
pub trait StrainMeasure: Send + Sync {
    /// The strain of a deformation.
    ///
    /// # Errors
    /// [`ElasticityError::NotFinite`]. For measures that need F⁻¹ or U, also
    /// [`ElasticityError::SingularDeformation`] and [`ElasticityError::InvertedDeformation`].
    ///
    /// ```
    /// use nalgebra::Matrix3;
    /// use tactile_elasticity::strain::{Deformation, Hencky, StrainMeasure};
    ///
    /// // An inverted deformation has no logarithm.
    /// let inverted =
    ///     Deformation::from_deformation_gradient(Matrix3::from_diagonal_element(-1.0_f64));
    /// assert!(Hencky.of(&inverted).is_err());
    /// ```
    fn of(&self, deformation: &Deformation) -> Result<Matrix3<f64>, ElasticityError>;

    /// The name of the measure as used in the literature.
    ///
    /// ```
    /// use tactile_elasticity::strain::{GreenLagrange, Hencky, StrainMeasure};
    ///
    /// let measures: [&dyn StrainMeasure; 2] = [&GreenLagrange, &Hencky];
    /// assert_eq!(measures.map(|m| m.name()), ["Green-Lagrange", "Hencky"]);
    /// ```
    fn name(&self) -> &'static str;

    /// The strain of a displacement gradient H (F = I + H). Errors are those of [`of`](Self::of).
    fn strain(&self, h: &Matrix3<f64>) -> Result<Matrix3<f64>, ElasticityError> {
        self.of(&Deformation::from_displacement_gradient(*h))
    }

    /// The stress conjugate to this measure for a nominal stress P along an axis with stretch λ: S
    /// de = P dλ. For Green–Lagrange it is the second Piola–Kirchhoff stress.
    ///
    /// dλ/de is computed by differences, to 10⁻¹¹.
    ///
    /// # Errors
    /// [`ElasticityError::NoConjugateStress`] if the strain along the axis depends on the
    /// transverse stretches or does not increase with λ, and those of [`of`](Self::of).
    ///
    /// ```
    /// use tactile_elasticity::strain::{GreenLagrange, Hencky, StrainMeasure};
    ///
    /// // ½(λ² − 1) grows by λ dλ, ln λ by dλ/λ.
    /// let measures: [&dyn StrainMeasure; 2] = [&GreenLagrange, &Hencky];
    /// let stress = measures.map(|m| m.conjugate_stress(1e3, 0.8).unwrap());
    /// assert!((stress[0] / 1250.0 - 1.0).abs() < 1e-10);
    /// assert!((stress[1] / 800.0 - 1.0).abs() < 1e-10);
    /// ```
    fn conjugate_stress(&self, nominal: f64, stretch: f64) -> Result<f64, ElasticityError> {
        let along = |lateral: f64, axial: f64| {
            let h = Matrix3::from_diagonal(&[lateral - 1.0, lateral - 1.0, axial - 1.0].into());
            self.strain(&h).map(|strain| strain[(2, 2)])
        };
        let here = along(1.0, stretch)?;
        let coupling = along(1.0 + LATERAL_STEP, stretch)? - here;
        let slope = (along(1.0, stretch + AXIAL_STEP)? - along(1.0, stretch - AXIAL_STEP)?)
            / (2.0 * AXIAL_STEP);
        // NaN has no conjugate stress either.
        let conjugate = coupling.abs() <= LATERAL_COUPLING * here.abs().max(1.0) && slope > 0.0;
        if !conjugate {
            let measure = self.name();
            return Err(ElasticityError::NoConjugateStress { measure });
        }
        Ok(nominal / slope)
    }
}

// Half the step of a stretch for dλ/de. The error is the third derivative times its square.
const AXIAL_STEP: f64 = 1e-5;
// Step of a transverse stretch, and the strain along the axis that counts as more than rounding.
const LATERAL_STEP: f64 = 0.01;
const LATERAL_COUPLING: f64 = 1e-9;

/// Implements the trait for boxed, shared and borrowed measures.
impl<P: Deref<Target: StrainMeasure> + Send + Sync> StrainMeasure for P {
    fn of(&self, deformation: &Deformation) -> Result<Matrix3<f64>, ElasticityError> {
        (**self).of(deformation)
    }

    fn name(&self) -> &'static str {
        (**self).name()
    }

    fn strain(&self, h: &Matrix3<f64>) -> Result<Matrix3<f64>, ElasticityError> {
        (**self).strain(h)
    }

    fn conjugate_stress(&self, nominal: f64, stretch: f64) -> Result<f64, ElasticityError> {
        (**self).conjugate_stress(nominal, stretch)
    }
}

/// E = ½(FᵀF − I) = ½(H + Hᵀ + HᵀH): Lagrangian, conjugate to the second Piola–Kirchhoff stress.
///
/// In (26)–(30) the paper prints exponents 3 instead of 2. There f is the map of positions, so that
/// ∇u = ∇f − I.
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::strain::{Deformation, GreenLagrange, StrainMeasure};
///
/// // A stretch of λ: ½(λ² − 1).
/// let stretched = Deformation::from_displacement_gradient(Matrix3::from_diagonal_element(0.1));
/// assert!((GreenLagrange.of(&stretched)?[(0, 0)] - 0.105_f64).abs() < 1e-16);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct GreenLagrange;

/// e = ½(I − F⁻ᵀF⁻¹) = F⁻ᵀ E F⁻¹: Eulerian, in the deformed state.
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::strain::{EulerAlmansi, StrainMeasure};
///
/// // A stretch of λ: ½(1 − λ⁻²).
/// let strain = EulerAlmansi.strain(&Matrix3::from_diagonal_element(1.0))?;
/// assert!((strain[(0, 0)] - 0.375_f64).abs() < 1e-15);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct EulerAlmansi;

/// ln U, the logarithmic strain in material axes. Its trace is ln J, and coaxial steps are
/// additive.
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::strain::{Hencky, StrainMeasure};
///
/// // Steps along the same axes are additive: 10 % twice is 21 % once.
/// let strain = |stretch: f64| {
///     Hencky
///         .strain(&Matrix3::from_diagonal_element(stretch))
///         .map(|e| e[(0, 0)])
/// };
/// assert!((2.0 * strain(0.10)? - strain(0.21)?).abs() < 1e-15);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Hencky;

/// U − I: relative elongations along the principal directions, conjugate to the Biot stress.
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::strain::{Biot, StrainMeasure};
///
/// // A rotation by 90° with a stretch of 5 %: the rotation has no effect.
/// let turned =
///     Matrix3::new(0.0, -1.05, 0.0, 1.05, 0.0, 0.0, 0.0, 0.0, 1.05) - Matrix3::identity();
/// assert!((Biot.strain(&turned)?[(0, 0)] - 0.05_f64).abs() < 1e-15);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Biot;

/// ε = ½(H + Hᵀ): linear in the displacement, with an error of second order in the rotation.
///
/// ```
/// use nalgebra::{Matrix3, Rotation3, Vector3};
/// use tactile_elasticity::strain::{Infinitesimal, StrainMeasure};
///
/// // A pure rotation by 0.1 rad appears as a compression of 1 − cos 0.1.
/// let turn = Rotation3::new(Vector3::z() * 0.1_f64).into_inner() - Matrix3::identity();
/// assert!((Infinitesimal.strain(&turn)?[(0, 0)] - (0.1_f64.cos() - 1.0)).abs() < 1e-15);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Infinitesimal;

impl StrainMeasure for GreenLagrange {
    fn of(&self, deformation: &Deformation) -> Result<Matrix3<f64>, ElasticityError> {
        finite(deformation).map(Deformation::green_lagrange)
    }

    fn name(&self) -> &'static str {
        "Green-Lagrange"
    }
}

impl StrainMeasure for EulerAlmansi {
    fn of(&self, deformation: &Deformation) -> Result<Matrix3<f64>, ElasticityError> {
        upright(deformation)?;
        let inverse = deformation
            .inverse()
            .ok_or(ElasticityError::SingularDeformation)?;
        let e = deformation.green_lagrange();
        let small = e.iter().all(|x| x.abs() < 0.25);
        let strain = if small {
            inverse.transpose() * e * inverse
        } else {
            (Matrix3::identity() - inverse.transpose() * inverse) * 0.5
        };
        Ok((strain + strain.transpose()) * 0.5)
    }

    fn name(&self) -> &'static str {
        "Euler-Almansi"
    }
}

impl StrainMeasure for Hencky {
    fn of(&self, deformation: &Deformation) -> Result<Matrix3<f64>, ElasticityError> {
        upright(deformation)?;
        let principal = PrincipalStretches::from(deformation);
        Ok(principal.compose(principal.logarithms))
    }

    fn name(&self) -> &'static str {
        "Hencky"
    }
}

impl StrainMeasure for Biot {
    fn of(&self, deformation: &Deformation) -> Result<Matrix3<f64>, ElasticityError> {
        upright(deformation)?;
        let principal = PrincipalStretches::from(deformation);
        Ok(principal.compose(principal.elongations))
    }

    fn name(&self) -> &'static str {
        "Biot"
    }
}

impl StrainMeasure for Infinitesimal {
    fn of(&self, deformation: &Deformation) -> Result<Matrix3<f64>, ElasticityError> {
        let h = finite(deformation)?.displacement_gradient();
        Ok((h + h.transpose()) * 0.5)
    }

    fn name(&self) -> &'static str {
        "infinitesimal"
    }
}

fn finite(deformation: &Deformation) -> Result<&Deformation, ElasticityError> {
    if deformation.is_finite() {
        Ok(deformation)
    } else {
        Err(ElasticityError::NotFinite {
            quantity: Quantity::DeformationGradient,
        })
    }
}

/// Rejects det F ≤ 0.
fn upright(deformation: &Deformation) -> Result<(), ElasticityError> {
    let determinant = finite(deformation)?.jacobian();
    if determinant > 0.0 {
        Ok(())
    } else if determinant == 0.0 {
        Err(ElasticityError::SingularDeformation)
    } else {
        Err(ElasticityError::InvertedDeformation { determinant })
    }
}

/// F = I + H at a point. One of the two is given exactly, and the other is rounded.
///
/// Strains of 10⁻¹² and below are exact in H and lost if F is formed. Stretches of 10⁻⁸ are exact
/// in F and lost if H is formed. Each measure uses the one that keeps its digits.
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::strain::Deformation;
/// let stretch = Deformation::from_displacement_gradient(Matrix3::from_diagonal_element(1e-20));
/// assert!((stretch.volume_change() / 3e-20f64 - 1.0).abs() < 1e-15);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deformation {
    f: Matrix3<f64>,
    h: Matrix3<f64>,
    given: Given,
}

/// Which of F and H is exact.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Given {
    F,
    H,
}

impl Deformation {
    /// Creates the deformation from H = ∂u/∂X: row = component of u, column = direction of the
    /// derivative.
    pub fn from_displacement_gradient(h: Matrix3<f64>) -> Self {
        Self {
            f: h + Matrix3::identity(),
            h,
            given: Given::H,
        }
    }

    /// Creates the deformation from F = ∂x/∂X, the Jacobian of a map of positions.
    ///
    /// ```
    /// use nalgebra::Matrix3;
    /// use tactile_elasticity::strain::Deformation;
    ///
    /// let twice = Deformation::from_deformation_gradient(Matrix3::from_diagonal_element(2.0_f64));
    /// assert_eq!(twice.jacobian(), 8.0);
    /// assert_eq!(twice.displacement_gradient(), Matrix3::identity());
    /// assert_eq!(twice.deformation_gradient()[(2, 2)], 2.0);
    /// ```
    pub fn from_deformation_gradient(f: Matrix3<f64>) -> Self {
        Self {
            f,
            h: f - Matrix3::identity(),
            given: Given::F,
        }
    }

    /// F.
    pub fn deformation_gradient(&self) -> Matrix3<f64> {
        self.f
    }

    /// H = F − I.
    pub fn displacement_gradient(&self) -> Matrix3<f64> {
        self.h
    }

    /// True when every entry is a finite number.
    pub(crate) fn is_finite(&self) -> bool {
        self.h.iter().all(|x| x.is_finite())
    }

    /// J − 1 = tr H + II(H) + det H, the relative change of volume, without cancellation.
    pub fn volume_change(&self) -> f64 {
        match self.given {
            Given::F => determinant(&self.f).add(-1.0).value(),
            Given::H => self.volume_change_from_h(),
        }
    }

    /// The principal stretches, the singular values of F, with the largest first. Its entries must
    /// be finite.
    ///
    /// ```
    /// use nalgebra::{Matrix3, Vector3};
    /// use tactile_elasticity::strain::Deformation;
    ///
    /// let h = Matrix3::from_diagonal(&Vector3::new(0.0, 0.02, -0.05));
    /// let [first, _, third] = Deformation::from_displacement_gradient(h).stretches();
    /// assert!((first - 1.02_f64).abs() < 1e-15 && (third - 0.95_f64).abs() < 1e-15);
    /// ```
    #[must_use]
    pub fn stretches(&self) -> [f64; 3] {
        PrincipalStretches::from(self).stretches
    }

    /// J = det F. Negative if the material is inverted.
    pub fn jacobian(&self) -> f64 {
        match self.given {
            Given::F => determinant(&self.f).value(),
            Given::H => 1.0 + self.volume_change_from_h(),
        }
    }

    fn volume_change_from_h(&self) -> f64 {
        let h = &self.h;
        let [change, size] = volume_change_plain(h);
        if CANCELLED * change.abs() >= size {
            return change;
        }
        let mut sum = determinant(h);
        for i in 0..3 {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            sum = sum
                .add_product(h[(j, j)], h[(k, k)])
                .add_product(-h[(j, k)], h[(k, j)]);
        }
        sum.add(h[(0, 0)]).add(h[(1, 1)]).add(h[(2, 2)]).value()
    }

    /// F⁻¹ by cofactors, whose differences of products are summed in double-double precision.
    /// `None` if det F = 0.
    pub(crate) fn inverse(&self) -> Option<Matrix3<f64>> {
        let f = &self.f;
        let det = determinant(f).value();
        if det == 0.0 {
            return None;
        }
        Some(Matrix3::from_fn(|i, j| {
            let (r, s) = ((j + 1) % 3, (j + 2) % 3);
            let (p, q) = ((i + 1) % 3, (i + 2) % 3);
            let minor = DoubleDouble::zero().add_product(f[(r, p)], f[(s, q)]);
            minor.add_product(-f[(r, q)], f[(s, p)]).value() / det
        }))
    }

    /// E = ½(H + Hᵀ + HᵀH), summed in double-double precision if the terms cancel (large rotation,
    /// small strain).
    fn green_lagrange(&self) -> Matrix3<f64> {
        let plain = green_lagrange_plain(&self.h);
        if cancels(&self.h, &plain) {
            self.green_lagrange_double_double()
        } else {
            plain
        }
    }

    fn green_lagrange_double_double(&self) -> Matrix3<f64> {
        let mut e = Matrix3::zeros();
        for i in 0..3 {
            for j in i..3 {
                let column = |m: &Matrix3<f64>| {
                    (0..3).fold(DoubleDouble::zero(), |sum, k| {
                        sum.add_product(m[(k, i)], m[(k, j)])
                    })
                };
                let sum = match self.given {
                    Given::H => column(&self.h).add(self.h[(i, j)]).add(self.h[(j, i)]),
                    Given::F if i == j => column(&self.f).add(-1.0),
                    Given::F => column(&self.f),
                };
                e[(i, j)] = 0.5 * sum.value();
                e[(j, i)] = e[(i, j)];
            }
        }
        e
    }
}

/// ½(H + Hᵀ + HᵀH) in working precision.
#[inline(always)]
fn green_lagrange_plain(h: &Matrix3<f64>) -> Matrix3<f64> {
    let term = |i: usize, j: usize| {
        let product = h[(0, i)] * h[(0, j)] + h[(1, i)] * h[(1, j)] + h[(2, i)] * h[(2, j)];
        0.5 * ((h[(i, j)] + h[(j, i)]) + product)
    };
    let (xx, yy, zz) = (term(0, 0), term(1, 1), term(2, 2));
    let (xy, xz, yz) = (term(0, 1), term(0, 2), term(1, 2));
    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
}

/// tr H + II(H) + det H in working precision, and the sum of the absolute terms.
fn volume_change_plain(h: &Matrix3<f64>) -> [f64; 2] {
    let mut sums = [0.0; 2];
    let mut add = |term: f64| sums = [sums[0] + term, sums[1] + term.abs()];
    for i in 0..3 {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let (positive, negative) = (h[(1, j)] * h[(2, k)], h[(1, k)] * h[(2, j)]);
        add(h[(0, i)] * positive);
        add(-h[(0, i)] * negative);
        add(h[(j, j)] * h[(k, k)]);
        add(-h[(j, k)] * h[(k, j)]);
        add(h[(i, i)]);
    }
    sums
}

/// If a sum is smaller than its terms by this factor, it has lost two digits and is summed again in
/// double-double precision.
const CANCELLED: f64 = 128.0;

/// Whether E is so much smaller than its terms that more than two digits are lost.
#[inline(always)]
fn cancels(h: &Matrix3<f64>, e: &Matrix3<f64>) -> bool {
    // Summed as trees: a chain of additions would take longer than the strain itself.
    let of_h = ((h[(0, 0)].abs() + h[(1, 1)].abs()) + (h[(2, 2)].abs() + h[(0, 1)].abs()))
        + ((h[(1, 0)].abs() + h[(0, 2)].abs())
            + (h[(2, 0)].abs() + (h[(1, 2)].abs() + h[(2, 1)].abs())));
    let diagonal = (e[(0, 0)].abs() + e[(1, 1)].abs()) + e[(2, 2)].abs();
    let shear = (e[(0, 1)].abs() + e[(0, 2)].abs()) + e[(1, 2)].abs();
    (diagonal + shear) * CANCELLED < of_h
}

fn determinant(m: &Matrix3<f64>) -> DoubleDouble {
    let mut sum = DoubleDouble::zero();
    for i in 0..3 {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        sum = sum.add_triple(m[(0, i)], m[(1, j)], m[(2, k)]);
        sum = sum.add_triple(-m[(0, i)], m[(1, k)], m[(2, j)]);
    }
    sum
}

// Sums of products in twice the working precision.
//
// Knuth's two-sum and the fused two-product (Ogita, Rump & Oishi 2005, "Accurate sum and dot
// product").

/// An unevaluated sum `hi + lo` with |lo| at most half an ulp of `hi`.
#[derive(Clone, Copy, Debug)]
struct DoubleDouble {
    hi: f64,
    lo: f64,
}

/// a + b exactly.
fn two_sum(a: f64, b: f64) -> DoubleDouble {
    let hi = a + b;
    let of_b = hi - a;
    DoubleDouble {
        hi,
        lo: (a - (hi - of_b)) + (b - of_b),
    }
}

/// a · b exactly (unless it underflows).
fn two_product(a: f64, b: f64) -> DoubleDouble {
    let hi = a * b;
    DoubleDouble {
        hi,
        lo: a.mul_add(b, -hi),
    }
}

impl DoubleDouble {
    fn zero() -> Self {
        Self { hi: 0.0, lo: 0.0 }
    }

    fn add(self, x: f64) -> Self {
        let sum = two_sum(self.hi, x);
        let low = self.lo + sum.lo;
        let hi = sum.hi + low;
        Self {
            hi,
            lo: low - (hi - sum.hi),
        }
    }

    fn add_sum(self, other: Self) -> Self {
        self.add(other.lo).add(other.hi)
    }

    /// self + a·b.
    fn add_product(self, a: f64, b: f64) -> Self {
        self.add_sum(two_product(a, b))
    }

    /// self + a·b·c.
    fn add_triple(self, a: f64, b: f64, c: f64) -> Self {
        let ab = two_product(a, b);
        self.add(ab.lo * c).add_product(ab.hi, c)
    }

    fn value(self) -> f64 {
        self.hi + self.lo
    }
}

/// The right stretch U in its principal axes, with the largest stretch first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PrincipalStretches {
    /// λᵢ, the singular values of F.
    pub stretches: [f64; 3],
    /// λᵢ − 1, without cancellation if the strain is small.
    pub elongations: [f64; 3],
    /// ln λᵢ, also without cancellation. −∞ if λᵢ = 0.
    pub logarithms: [f64; 3],
    /// Column i is the material direction vᵢ, of length 1.
    pub directions: Matrix3<f64>,
}

impl From<&Deformation> for PrincipalStretches {
    /// Computes the stretches of a deformation, whose entries must be finite.
    ///
    /// Near the identity they come from the eigenvalues 2E of C − I, which keep every digit of a
    /// tiny strain. Otherwise they come from the singular values of F by one-sided Jacobi
    /// rotations, which keep every digit of a tiny stretch.
    fn from(deformation: &Deformation) -> Self {
        let e = deformation.green_lagrange();
        let largest = e.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        // |eigenvalue| ≤ 3 max |e|: within this bound C is between ½I and 3⁄2 I.
        if largest * 3.0 <= 0.25 {
            Self::from_small_strain(&e)
        } else {
            Self::from_singular_values(deformation)
        }
    }
}

impl PrincipalStretches {
    fn from_small_strain(e: &Matrix3<f64>) -> Self {
        let (values, directions) = symmetric_eigen(e);
        let elongation = |x: f64| 2.0 * x / (1.0 + (1.0 + 2.0 * x).sqrt());
        let elongations = values.map(elongation);
        Self {
            stretches: elongations.map(|x| 1.0 + x),
            elongations,
            logarithms: values.map(|x| (2.0 * x).ln_1p() / 2.0),
            directions,
        }
    }

    fn from_singular_values(deformation: &Deformation) -> Self {
        let (mut s, directions) = one_sided_jacobi(&deformation.deformation_gradient());
        if s[2] < s[0] * 1e-3 && s[1] > 0.0 {
            // λ₁λ₂λ₃ = |J|, and J is accurate to its last digit.
            s[2] = deformation.jacobian().abs() / s[0] / s[1];
        }
        Self {
            stretches: s,
            elongations: s.map(|x| x - 1.0),
            logarithms: s.map(|x| if x > 0.0 { x.ln() } else { f64::MIN }),
            directions,
        }
    }

    /// Σ gᵢ vᵢ vᵢᵀ.
    fn compose(&self, g: [f64; 3]) -> Matrix3<f64> {
        let sum = self.directions * Matrix3::from_diagonal(&g.into()) * self.directions.transpose();
        (sum + sum.transpose()) * 0.5
    }
}

/// Rotation (c, s) that makes the off-diagonal entry of [[app, apq], [apq, aqq]] vanish.
fn jacobi_rotation(app: f64, aqq: f64, apq: f64) -> (f64, f64, f64) {
    let theta = (aqq - app) / (2.0 * apq);
    let t = 1.0 / (theta.abs() + (theta * theta + 1.0).sqrt());
    let t = if theta < 0.0 { -t } else { t };
    let c = 1.0 / (t * t + 1.0).sqrt();
    (c, t * c, t)
}

/// Eigenvalues (largest first) and eigenvectors of a symmetric matrix by cyclic Jacobi rotations.
pub(crate) fn symmetric_eigen(m: &Matrix3<f64>) -> ([f64; 3], Matrix3<f64>) {
    let mut a = *m;
    let mut v = Matrix3::identity();
    for _ in 0..32 {
        let mut done = true;
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let apq = a[(p, q)];
            let scale = a[(p, p)].abs().max(a[(q, q)].abs());
            if apq == 0.0 || (scale + apq.abs() == scale && apq.abs() < scale * f64::EPSILON) {
                continue;
            }
            done = false;
            let (c, s, t) = jacobi_rotation(a[(p, p)], a[(q, q)], apq);
            let r = 3 - p - q;
            a[(p, p)] -= t * apq;
            a[(q, q)] += t * apq;
            (a[(p, q)], a[(q, p)]) = (0.0, 0.0);
            let (arp, arq) = (a[(r, p)], a[(r, q)]);
            (a[(r, p)], a[(r, q)]) = (c * arp - s * arq, s * arp + c * arq);
            (a[(p, r)], a[(q, r)]) = (a[(r, p)], a[(r, q)]);
            rotate_columns(&mut v, p, q, c, s);
        }
        if done {
            break;
        }
    }
    sorted([a[(0, 0)], a[(1, 1)], a[(2, 2)]], v)
}

/// Singular values (largest first) and right singular vectors of `f` by one-sided Jacobi
/// (Hestenes).
fn one_sided_jacobi(f: &Matrix3<f64>) -> ([f64; 3], Matrix3<f64>) {
    let scale = f.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    if scale == 0.0 {
        return ([0.0; 3], Matrix3::identity());
    }
    let mut w = f / scale;
    let mut v = Matrix3::identity();
    for _ in 0..32 {
        let mut done = true;
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let (app, aqq) = (w.column(p).norm_squared(), w.column(q).norm_squared());
            let apq = w.column(p).dot(&w.column(q));
            if apq.abs() <= f64::EPSILON * (app * aqq).sqrt() {
                continue;
            }
            done = false;
            let (c, s, _) = jacobi_rotation(app, aqq, apq);
            rotate_columns(&mut w, p, q, c, s);
            rotate_columns(&mut v, p, q, c, s);
        }
        if done {
            break;
        }
    }
    sorted([0, 1, 2].map(|i| w.column(i).norm() * scale), v)
}

fn rotate_columns(m: &mut Matrix3<f64>, p: usize, q: usize, c: f64, s: f64) {
    for r in 0..3 {
        let (a, b) = (m[(r, p)], m[(r, q)]);
        (m[(r, p)], m[(r, q)]) = (c * a - s * b, s * a + c * b);
    }
}

fn sorted(values: [f64; 3], v: Matrix3<f64>) -> ([f64; 3], Matrix3<f64>) {
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| {
        values[j]
            .partial_cmp(&values[i])
            .unwrap_or(core::cmp::Ordering::Equal)
    });
    let columns = order.map(|i| v.column(i).into_owned());
    (order.map(|i| values[i]), Matrix3::from_columns(&columns))
}
