//! Tatara's large-deformation sphere.
//!
//! A sphere pressed from both sides deforms at each contact as Hertz's law says, less the displacement that the force on the far
//! side causes in the contact region: Boussinesq's displacement at (a, 2R) under a point force,
//!
//! δ = a²/R − (F/πE)·[(1 − ν²)/√(a² + 4R²) + 2(1 + ν)R²/(a² + 4R²)^{3⁄2}],  a³ = 3FR/(4E*)
//!
//! per contact. Source: Y. Tatara, J. Eng. Mater. Technol. 113 (1991) 285–291, the extensive term; his lateral spreading of the
//! free surface and the stiffening of rubber are not included.

use crate::error::{ElasticityError, Quantity, not_negative, poisson, positive};
use std::f64::consts::PI;

/// δ (m) of one contact with contact radius a (m) of a sphere of radius R (m) and Poisson ratio ν between rigid plates.
///
/// # Errors
/// [`ElasticityError::NotPositive`] radius, [`ElasticityError::Negative`] contact radius, [`ElasticityError::PoissonRatio`].
///
/// ```
/// // At a/R = 0.1 the far side takes 4 % off Hertz's a²/R; at 0.5 a fifth.
/// let ratio = |a: f64| tactile_elasticity::contact::tatara_indentation_m(a, 1.0, 0.5).unwrap() / (a * a);
/// assert!((ratio(0.1) - 0.958).abs() < 1e-3 && (ratio(0.5) - 0.800).abs() < 1e-3);
/// ```
pub fn tatara_indentation_m(
    contact_radius_m: f64,
    radius_m: f64,
    poisson_ratio: f64,
) -> Result<f64, ElasticityError> {
    let a = not_negative(contact_radius_m, Quantity::ContactRadius)?;
    let squeeze = Squeeze::new(
        positive(radius_m, Quantity::Radius)?,
        poisson(poisson_ratio)?,
        1.0,
    );
    Ok(squeeze.indentation(a))
}

/// The law in units of R: the far side counts with the sphere's share of the compliance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Squeeze {
    radius_m: f64,
    poisson_ratio: f64,
    share: f64,
}

impl Squeeze {
    pub(crate) fn new(radius_m: f64, poisson_ratio: f64, share: f64) -> Self {
        Self {
            radius_m,
            poisson_ratio,
            share,
        }
    }

    pub(crate) fn indentation(&self, a: f64) -> f64 {
        let x = a / self.radius_m;
        self.radius_m * (x * x - self.share * self.far_side(x))
    }

    /// (4x³/3π)·[1/√(x² + 4) + 2/((1 − ν)(x² + 4)^{3⁄2})].
    fn far_side(&self, x: f64) -> f64 {
        let q = x * x + 4.0;
        4.0 * x.powi(3) / (3.0 * PI)
            * (1.0 / q.sqrt() + 2.0 / ((1.0 - self.poisson_ratio) * q.powf(1.5)))
    }

    /// dδ/da.
    pub(crate) fn slope(&self, a: f64) -> f64 {
        let x = a / self.radius_m;
        let (q, m) = (x * x + 4.0, 2.0 / (1.0 - self.poisson_ratio));
        let bracket = 1.0 / q.sqrt() + m / q.powf(1.5);
        let derivative = -x / q.powf(1.5) - 3.0 * m * x / q.powf(2.5);
        2.0 * x - self.share * 4.0 / (3.0 * PI) * (3.0 * x * x * bracket + x.powi(3) * derivative)
    }

    /// The contact radius (m) of an indentation (m), by Newton from Hertz's; None where the law has none below a = R.
    pub(crate) fn contact_radius(&self, indentation: f64) -> Option<f64> {
        let mut a = (self.radius_m * indentation).sqrt();
        for _ in 0..60 {
            let step = (self.indentation(a) - indentation) / self.slope(a);
            a -= step;
            if !(a > 0.0 && a <= self.radius_m) {
                return None;
            }
            if step.abs() <= 1e-14 * a {
                return Some(a);
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slope_is_the_derivative_and_the_radius_the_inverse() {
        let squeeze = Squeeze::new(3e-3, 0.47, 0.8);
        for a in [1e-5, 5e-4, 1.5e-3, 2.2e-3] {
            let h = 1e-6 * a;
            let slope = (squeeze.indentation(a + h) - squeeze.indentation(a - h)) / (2.0 * h);
            assert!((slope / squeeze.slope(a) - 1.0).abs() < 1e-8); // central difference, h² and ε/h
            let back = squeeze.contact_radius(squeeze.indentation(a)).unwrap();
            assert!((back / a - 1.0).abs() < 1e-12);
        }
    }
}
