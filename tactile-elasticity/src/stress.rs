//! Stress measures, conversions between them, and the strain each belongs to.
//!
//! Work per volume of the undeformed material is the same in every conjugate pair: S : Ė = P : Ḟ =
//! τ : d. Equation (31) divides components of one pair: the second Piola–Kirchhoff stress by
//! Green–Lagrange strain.

use crate::error::{ElasticityError, Quantity, poisson};
use crate::strain::{Biot, Deformation, StrainMeasure, deviator, scaled_norm, upright};
use nalgebra::Matrix3;

/// A measure of stress: force over area, each of the deformed or the undeformed state.
///
/// | stress | force | area | conjugate strain |
/// |---|---|---|---|
/// | Cauchy σ | deformed | deformed | (the rate of) Euler–Almansi, through τ |
/// | Kirchhoff τ = Jσ | deformed | deformed, per undeformed volume | Euler–Almansi (rotated) |
/// | first Piola–Kirchhoff P = τF⁻ᵀ | deformed | undeformed | F itself |
/// | second Piola–Kirchhoff S = F⁻¹τF⁻ᵀ | pulled back | undeformed | Green–Lagrange |
/// | Biot sym(RᵀP) = sym(US) | rotated back | undeformed | Biot |
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::{
///     strain::Deformation,
///     stress::{StressMeasure, convert_stress},
/// };
///
/// // Stretched to twice its length in every direction, J = 8: a unit of S is ½ of σ, 4 of τ and 2
/// // of
/// // P and Biot's.
/// let twice = Deformation::from_deformation_gradient(Matrix3::from_diagonal_element(2.0));
/// let expected = [
///     (StressMeasure::Cauchy, 0.5_f64),
///     (StressMeasure::Kirchhoff, 4.0),
///     (StressMeasure::FirstPiolaKirchhoff, 2.0),
///     (StressMeasure::Biot, 2.0),
/// ];
/// for (to, value) in expected {
///     let stress_pa = convert_stress(
///         &Matrix3::identity(),
///         StressMeasure::SecondPiolaKirchhoff,
///         to,
///         &twice,
///     )?;
///     assert!((stress_pa[(0, 0)] - value).abs() < 1e-14, "{to:?}");
/// }
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StressMeasure {
    /// σ, the true stress.
    Cauchy,
    /// τ = Jσ.
    Kirchhoff,
    /// P = τF⁻ᵀ, the nominal stress. Not symmetric.
    FirstPiolaKirchhoff,
    /// S = F⁻¹τF⁻ᵀ, the stress of equation (31).
    SecondPiolaKirchhoff,
    /// sym(RᵀP) = sym(US).
    Biot,
}

/// Converts a stress tensor in Pa from one measure to another.
///
/// All go by way of Kirchhoff's stress. Biot's stress is solved for S in the principal directions
/// of U: S_ij = 2B_ij/(λ_i + λ_j).
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::{
///     strain::Deformation,
///     stress::{StressMeasure, convert_stress},
/// };
///
/// // There and back again.
/// let h = Matrix3::new(0.1, 0.2, 0.0, 0.0, -0.1, 0.0, 0.0, 0.0, 0.3);
/// let deformation = Deformation::from_displacement_gradient(h);
/// let cauchy = Matrix3::new(3.0, 1.0, 0.0, 1.0, 2.0, 0.0, 0.0, 0.0, 1.0);
/// for measure in [
///     StressMeasure::SecondPiolaKirchhoff,
///     StressMeasure::FirstPiolaKirchhoff,
///     StressMeasure::Biot,
/// ] {
///     let there = convert_stress(&cauchy, StressMeasure::Cauchy, measure, &deformation)?;
///     let back = convert_stress(&there, measure, StressMeasure::Cauchy, &deformation)?;
///     assert!((back - cauchy).norm() < 1e-13, "{measure:?}");
/// }
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
///
/// # Errors
/// [`ElasticityError::SingularDeformation`] or [`ElasticityError::InvertedDeformation`] unless det
/// F > 0.
pub fn convert_stress(
    stress_pa: &Matrix3<f64>,
    from: StressMeasure,
    to: StressMeasure,
    deformation: &Deformation,
) -> Result<Matrix3<f64>, ElasticityError> {
    upright(deformation)?;
    let (f, j) = (deformation.deformation_gradient(), deformation.jacobian());
    let kirchhoff = match from {
        StressMeasure::Cauchy => stress_pa * j,
        StressMeasure::Kirchhoff => *stress_pa,
        StressMeasure::FirstPiolaKirchhoff => stress_pa * f.transpose(),
        StressMeasure::SecondPiolaKirchhoff => f * stress_pa * f.transpose(),
        StressMeasure::Biot => {
            let second = second_of_biot(stress_pa, &stretch(deformation)?);
            f * second * f.transpose()
        }
    };
    let inverse = deformation
        .inverse()
        .ok_or(ElasticityError::SingularDeformation)?;
    let second = || inverse * kirchhoff * inverse.transpose();
    Ok(match to {
        StressMeasure::Cauchy => symmetric(&(kirchhoff / j)),
        StressMeasure::Kirchhoff => symmetric(&kirchhoff),
        StressMeasure::FirstPiolaKirchhoff => kirchhoff * inverse.transpose(),
        StressMeasure::SecondPiolaKirchhoff => symmetric(&second()),
        StressMeasure::Biot => symmetric(&(stretch(deformation)? * second())),
    })
}

/// Von Mises' equivalent stress √(3⁄2 dev σ : dev σ) of a Cauchy stress, in its unit.
///
/// ```
/// use nalgebra::Matrix3;
/// // A bar under 100 kPa along x.
/// let cauchy = Matrix3::from_partial_diagonal(&[1e5]);
/// assert!((tactile_elasticity::stress::von_mises_stress(&cauchy) - 1e5_f64).abs() < 1e-9);
/// ```
pub fn von_mises_stress(cauchy: &Matrix3<f64>) -> f64 {
    scaled_norm(&deviator(cauchy), 1.5)
}

/// S = λ tr(E) I + 2μE in Pa of an isotropic (St. Venant–Kirchhoff) solid under a Green–Lagrange
/// strain E. Incompressible solids have no such law.
///
/// # Errors
/// [`ElasticityError::NotPositive`] modulus, [`ElasticityError::PoissonRatio`] for ν outside (−1,
/// ½).
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::stress::saint_venant_kirchhoff;
///
/// // The same strain along all axes: 3K e with K = E/(3(1 − 2ν)).
/// let stress_pa = saint_venant_kirchhoff(&Matrix3::from_diagonal_element(0.01_f64), 60e3, 0.25)?;
/// assert!((stress_pa[(0, 0)] - 60e3 / 0.5 * 0.01).abs() < 1e-9);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub fn saint_venant_kirchhoff(
    green_lagrange: &Matrix3<f64>,
    youngs_modulus_pa: f64,
    poisson_ratio: f64,
) -> Result<Matrix3<f64>, ElasticityError> {
    Quantity::YoungsModulus.positive(youngs_modulus_pa)?;
    let found = poisson(poisson_ratio)?;
    if found == 0.5 {
        return Err(ElasticityError::PoissonRatio { found });
    }
    let (nu, one) = (poisson_ratio, 1.0);
    let twice_mu = youngs_modulus_pa / (one + nu);
    let lambda = twice_mu * nu / (one - nu - nu);
    let volumetric = Matrix3::from_diagonal_element(lambda * green_lagrange.trace());
    Ok(volumetric + green_lagrange * twice_mu)
}

/// The right stretch U.
fn stretch(deformation: &Deformation) -> Result<Matrix3<f64>, ElasticityError> {
    Ok(Biot.of(deformation)? + Matrix3::identity())
}

/// S with sym(US) = `biot`.
fn second_of_biot(biot: &Matrix3<f64>, stretch: &Matrix3<f64>) -> Matrix3<f64> {
    let principal = stretch.symmetric_eigen();
    let (axes, stretches) = (principal.eigenvectors, principal.eigenvalues);
    let mut second = axes.transpose() * biot * axes;
    for row in 0..3 {
        for column in 0..3 {
            let mean = (stretches[row] + stretches[column]) * 0.5;
            second[(row, column)] /= mean;
        }
    }
    axes * second * axes.transpose()
}

fn symmetric(m: &Matrix3<f64>) -> Matrix3<f64> {
    (m + m.transpose()) * 0.5
}
