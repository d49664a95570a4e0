//! Contact without slip on a half-space.
//!
//! What touches keeps its place beneath the indenter, so a growing load adds flat punches that stick, one of each contact radius
//! (Mossakovskii 1963): with θ = ln(3 − 4ν)/2π,
//!
//! dF/dδ = 2E* a c, c = (1 − ν) ln(3 − 4ν)/(1 − 2ν) (Spence 1968),
//!
//! and a surface that a punch of radius b has lifted by 1 − cos(θ ln((t + b)/(t − b))) in Abel's transform lies on a profile z = B rᵈ from
//! (Borodich and Keer 2004)
//!
//! δ(a) I(d) = B aᵈ ∫₀¹ xᵈ⁻¹/√(1 − x²) dx, I(d) = ∫₀¹ sᵈ⁻¹ cos(θ ln((1 + s)/(1 − s))) ds.
//!
//! F = 2c d/(d + 1) E* a δ therefore differs from a contact without friction, θ = 0 and I(d) = 1/d, by factors of ν alone: at ν = ½ by none, for a
//! sphere's force at one indentation by 1.6 % at ν = 0.3 and 5.3 % at ν = 0.

use super::{ConeLaw, ContactLaw, LogForce, Punch, Sphere};
use crate::contact::gauss_panels;
use crate::error::ElasticityError;
use crate::modulus::EstimatorKind;

/// A law of contact without friction, with the factors by which sticking changes it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoSlipLaw<L> {
    frictionless: L,
    kind: EstimatorKind,
    /// ln of the force's factor at one contact radius.
    at_radius: f64,
    /// ln of the force's factor at one indentation.
    at_indentation: f64,
    /// The contact radius's factor at one indentation.
    radius: f64,
}

impl NoSlipLaw<Sphere> {
    /// Of a sphere of radius R (m) on a half-space of Poisson ratio ν.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`].
    pub fn sphere(radius_m: f64, nu: f64) -> Result<Self, ElasticityError> {
        // δ I = a²/2R: at one indentation a² grows as 2I.
        let integral = 2.0 * parabola_integral(theta(nu));
        Ok(Self {
            frictionless: Sphere::new(radius_m)?,
            kind: EstimatorKind::SphereWithoutSlip,
            at_radius: (stiffening(nu) / integral).ln(),
            at_indentation: (stiffening(nu) * integral.sqrt()).ln(),
            radius: integral.sqrt(),
        })
    }
}

impl NoSlipLaw<Punch> {
    /// Of a flat punch of radius a (m).
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`].
    pub fn punch(radius_m: f64, nu: f64) -> Result<Self, ElasticityError> {
        Ok(Self {
            frictionless: Punch::new(radius_m)?,
            kind: EstimatorKind::FlatPunchWithoutSlip,
            at_radius: stiffening(nu).ln(),
            at_indentation: stiffening(nu).ln(),
            radius: 1.0,
        })
    }
}

impl NoSlipLaw<ConeLaw> {
    /// Of a cone, by the tangent of its half angle.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`].
    pub fn cone(half_angle_tangent: f64, nu: f64) -> Result<Self, ElasticityError> {
        // δ I = (π/2) a cot α: at one indentation a grows as I.
        let integral = cone_integral(theta(nu));
        Ok(Self {
            frictionless: ConeLaw::new(half_angle_tangent)?,
            kind: EstimatorKind::ConeWithoutSlip,
            at_radius: (stiffening(nu) / integral).ln(),
            at_indentation: (stiffening(nu) * integral).ln(),
            radius: integral,
        })
    }
}

impl<L: ContactLaw> ContactLaw for NoSlipLaw<L> {
    fn kind(&self) -> EstimatorKind {
        self.kind
    }

    fn of_contact_radius(&self, a: f64, share: f64) -> Option<LogForce> {
        let slides = self.frictionless.of_contact_radius(a, share)?;
        Some(stiffer(slides, self.at_radius))
    }

    fn of_indentation(&self, d: f64, share: f64) -> Option<LogForce> {
        let slides = self.frictionless.of_indentation(d, share)?;
        Some(stiffer(slides, self.at_indentation))
    }

    fn contact_ratio(&self, contact_radius: Option<f64>, indentation: Option<f64>) -> Option<f64> {
        match contact_radius {
            Some(_) => self.frictionless.contact_ratio(contact_radius, None),
            None => Some(self.radius * self.frictionless.contact_ratio(None, indentation)?),
        }
    }

    fn contact_ratio_limit(&self) -> f64 {
        self.frictionless.contact_ratio_limit()
    }
}

fn stiffer(law: LogForce, log_factor: f64) -> LogForce {
    LogForce {
        value: law.value + log_factor,
        ..law
    }
}

/// 2(1 − 2ν), by which 3 − 4ν exceeds one.
fn excess(nu: f64) -> f64 {
    2.0 - 4.0 * nu
}

/// θ = ln(3 − 4ν)/2π.
fn theta(nu: f64) -> f64 {
    excess(nu).ln_1p() / std::f64::consts::TAU
}

/// c = (1 − ν) ln(3 − 4ν)/(1 − 2ν), 1 at ν = ½.
fn stiffening(nu: f64) -> f64 {
    let excess = excess(nu);
    if excess == 0.0 {
        1.0
    } else {
        2.0 * (1.0 - nu) * excess.ln_1p() / excess
    }
}

/// I(1) = πθ/sinh πθ.
fn cone_integral(theta: f64) -> f64 {
    let argument = std::f64::consts::PI * theta;
    if argument == 0.0 {
        1.0
    } else {
        argument / argument.sinh()
    }
}

/// I(2), with s = tanh x: ∫ tanh x cos(2θx)/cosh² x dx, smooth, and below 10⁻¹⁶ beyond x = 20.
fn parabola_integral(theta: f64) -> f64 {
    let edges: Vec<f64> = (0..=10).map(|k| 2.0 * f64::from(k)).collect();
    let term = |x: f64| x.tanh() * (2.0 * theta * x).cos() / x.cosh().powi(2);
    gauss_panels(&edges).iter().map(|&(x, w)| w * term(x)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_changes_without_a_change_of_volume() {
        let [sphere, punch, cone] = factors(0.5);
        // A sum of 160 terms of order one.
        assert!(sphere.abs() < 1e-14 && punch == 0.0 && cone == 0.0);
    }

    /// ∫ tanh x cos(2θx)/cosh² x dx = ½ − θ ∫ sin(2θx)/cosh² x dx, the last by e⁻²ˣ's series: 4 Σ (−1)ᵏ⁺¹ k 2θ/(4k² + 4θ²).
    #[test]
    fn the_parabolas_integral_is_its_series() {
        for theta in [0.01, 0.1, 0.31] {
            // Alternating terms: the mean of two sums that follow each other is within the last difference's change, 10⁻¹¹ here.
            let term = |k: f64| 2.0 * theta * k / (k * k + theta * theta);
            let sign = |k: u32| if k % 2 == 1 { 1.0 } else { -1.0 };
            let sum: f64 = (1..400_000).map(|k| sign(k) * term(f64::from(k))).sum();
            let sum = sum + 0.5 * term(400_000.0) * sign(400_000);
            let found = parabola_integral(theta);
            assert!(
                (found - (0.5 - theta * sum)).abs() < 1e-11,
                "{theta}: {found}"
            );
        }
    }

    /// Spence's factor and those of Borodich and Keer at one indentation.
    fn factors(nu: f64) -> [f64; 3] {
        [
            NoSlipLaw::sphere(1.0, nu).unwrap().at_indentation,
            NoSlipLaw::punch(1.0, nu).unwrap().at_indentation,
            NoSlipLaw::cone(1.0, nu).unwrap().at_indentation,
        ]
    }

    #[test]
    fn sticking_stiffens_more_the_more_volume_changes() {
        let ratios = [0.5, 0.45, 0.3, 0.1, 0.0, -0.5].map(factors);
        for pair in ratios.windows(2) {
            assert!(pair[0].iter().zip(&pair[1]).all(|(less, more)| less < more));
        }
    }
}
