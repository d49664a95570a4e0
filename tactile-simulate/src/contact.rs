//! A sphere pressed on the waveguide: pressure, contact radius, indentation and surface displacement.

use std::f64::consts::{FRAC_PI_2, PI};

use super::contact_law::{ContactLaw, far_side_m};
use super::contact_state::ContactState;
use super::error::{SimulateError, within};
use super::material::{Sphere, Waveguide};

/// The contact at one load.
///
/// ```
/// use std::f64::consts::PI;
/// use tactile_simulate::{Load, PressOptions, PressScene};
/// let scene = PressScene::new(PressOptions { loads: vec![Load::normal(0.01)], ..PressOptions::default() })?;
/// let contact = scene.truth(0).contact;
/// let (a, r, e) = (contact.contact_radius_m, contact.sphere_radius_m, contact.effective_modulus_pa);
/// let near = |found: f64, expected: f64| (found / expected - 1.0).abs() < 1e-12;
/// assert!(near(a.powi(3), 0.75 * 0.01 * r / e) && a / r < 0.3, "a³ = 3FR/(4E*)");
/// assert!(near(contact.pressure_pa(0.0), 1.5 * 0.01 / (PI * a * a)) && contact.pressure_pa(a) == 0.0);
/// assert!(near(contact.apparent_height_m(0.6 * a), 0.8 * a), "a hemisphere");
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Contact {
    /// Normal force in newton.
    pub force_n: f64,
    /// Radius of the undeformed sphere in metres.
    pub sphere_radius_m: f64,
    /// Radius a of the contact in metres; 0 without load.
    pub contact_radius_m: f64,
    /// Approach δ of the two bodies in metres.
    pub indentation_m: f64,
    /// Pressure p₀ = 3F/(2πa²) at the centre, in pascal.
    pub peak_pressure_pa: f64,
    /// E* of 1/E* = (1 − ν₁²)/E₁ + (1 − ν₂²)/E₂, in pascal.
    pub effective_modulus_pa: f64,
    /// The waveguide's share E*·(1 − ν₂²)/E₂ of the indentation, 0 to 1.
    pub waveguide_share: f64,
    /// The state at this force where the contact was computed elsewhere.
    #[cfg_attr(feature = "serde", serde(skip))]
    given: Option<ContactState>,
}

impl Contact {
    /// The contact of `sphere` on `waveguide` at `force_n` ≥ 0.
    ///
    /// # Errors
    /// [`SimulateError::OutOfRange`] for a force beyond the last state of a tabulated contact.
    pub(super) fn new(
        sphere: &Sphere,
        waveguide: &Waveguide,
        law: &ContactLaw,
        force_n: f64,
    ) -> Result<Self, SimulateError> {
        let largest = law.largest_force_n(sphere, waveguide)?;
        within("force_n", force_n, 0.0, largest)?;
        let hertz = Self::hertz(sphere, waveguide, force_n);
        if let Some(states) = law.states(sphere, waveguide)? {
            let state = (force_n > 0.0).then(|| ContactState::at_force(&states, force_n));
            return Ok(match state.flatten() {
                Some(state) => hertz.with_state(state),
                None => hertz,
            });
        }
        Ok(match law {
            ContactLaw::Tatara => Self {
                indentation_m: hertz.indentation_m
                    - far_side_m(sphere, force_n, hertz.contact_radius_m),
                ..hertz
            },
            _ => hertz,
        })
    }

    fn hertz(sphere: &Sphere, waveguide: &Waveguide, force_n: f64) -> Self {
        let body = waveguide.series();
        let sphere_compliance = sphere.material.plane_strain_compliance();
        let waveguide_compliance = body.plane_strain_compliance();
        let effective_modulus_pa = 1.0 / (sphere_compliance + waveguide_compliance);
        let radius = sphere.radius_m;
        let a = (0.75 * force_n * radius / effective_modulus_pa).cbrt();
        let peak_pressure_pa = if a > 0.0 {
            1.5 * force_n / (PI * a * a)
        } else {
            0.0
        };
        Self {
            force_n,
            sphere_radius_m: radius,
            contact_radius_m: a,
            indentation_m: a * a / radius,
            peak_pressure_pa,
            effective_modulus_pa,
            waveguide_share: waveguide_compliance * effective_modulus_pa,
            given: None,
        }
    }

    fn with_state(self, state: ContactState) -> Self {
        Self {
            contact_radius_m: state.contact_radius_m,
            indentation_m: state.indentation_m,
            peak_pressure_pa: state.peak_pressure_pa(),
            given: Some(state),
            ..self
        }
    }

    /// Whether the pressure is Hertz's, p₀ √(1 − r²/a²).
    pub(super) fn is_hertzian(&self) -> bool {
        self.given.is_none()
    }

    /// Pressure at distance `r_m` from the centre, in pascal: p₀ √(1 − r²/a²) for a closed form, else that of the given state.
    pub fn pressure_pa(&self, r_m: f64) -> f64 {
        let a = self.contact_radius_m;
        if r_m >= a {
            return 0.0;
        }
        match &self.given {
            Some(state) => state.pressure_at_pa(r_m),
            None => self.peak_pressure_pa * ((a - r_m) * (a + r_m)).sqrt() / a,
        }
    }

    /// a/R: Hertz's law holds while this is small (warn beyond 0.3).
    pub fn contact_ratio(&self) -> f64 {
        self.contact_radius_m / self.sphere_radius_m
    }

    /// Height of the *apparent* surface: the pressure read as the shading of a frontally lit Lambertian surface,
    /// z(r) = ∫ᵣᵃ √((p₀/p)² − 1) dr with p₀ the largest pressure. Hertz's pressure gives exactly a hemisphere of radius a, z = √(a² − r²), whatever
    /// the sphere's radius and modulus. Zero outside.
    pub fn apparent_height_m(&self, r_m: f64) -> f64 {
        let a = self.contact_radius_m;
        if r_m >= a {
            return 0.0;
        }
        let Some(state) = &self.given else {
            return ((a - r_m) * (a + r_m)).sqrt();
        };
        // With r = a sin φ the integrand stays finite at the rim, where p falls as √(a − r); midpoint rule.
        const STEPS: usize = 64;
        let first = (r_m / a).asin();
        let step = (FRAC_PI_2 - first) / STEPS as f64;
        let slope_at = |phi: f64| {
            let ratio = self.peak_pressure_pa / state.pressure_at_pa(a * phi.sin());
            (ratio * ratio - 1.0).max(0.0).sqrt() * a * phi.cos()
        };
        let angles = (0..STEPS).map(|k| first + (k as f64 + 0.5) * step);
        angles.map(slope_at).sum::<f64>() * step
    }

    /// Vertical displacement in metres of the waveguide's surface at distance `r_m` from the centre, negative under the object:
    /// of a closed form the waveguide's share of the joint displacement under Hertz's pressure, else that of the given state.
    pub(super) fn waveguide_height_m(&self, r_m: f64) -> f64 {
        match &self.given {
            Some(state) => state.height_at_m(r_m),
            None if self.contact_radius_m == 0.0 => 0.0,
            None => -self.waveguide_share * self.joint_displacement_m(r_m),
        }
    }

    /// Sum of both surfaces' normal displacements at distance r (Johnson, eqs. 3.41a and 3.42a).
    fn joint_displacement_m(&self, r: f64) -> f64 {
        let (a, p0, e) = (
            self.contact_radius_m,
            self.peak_pressure_pa,
            self.effective_modulus_pa,
        );
        if r <= a {
            return PI * p0 * (2.0 * a * a - r * r) / (4.0 * a * e);
        }
        let q = a / r;
        if q < 0.02 {
            // (2q² − 1) asin q + q√(1 − q²) = (4/3) q³ (1 + q²/10 + 9q⁴/280 + …), far field of a point force.
            return 2.0 * p0 * a * q / (3.0 * e) * (1.0 + q * q * (0.1 + q * q * (9.0 / 280.0)));
        }
        p0 * a / (2.0 * e) * ((2.0 - 1.0 / (q * q)) * q.asin() + ((1.0 - q) * (1.0 + q)).sqrt() / q)
    }
}

#[cfg(test)]
mod tests {
    use super::super::material::Elastic;
    use super::*;

    fn contact(law: ContactLaw, force_n: f64) -> Contact {
        let sphere = Sphere {
            radius_m: 3e-3,
            material: Elastic::CL2000X,
        };
        Contact::new(&sphere, &Waveguide::default(), &law, force_n).unwrap()
    }

    #[test]
    fn hertz_relations_hold_among_themselves() {
        let c = contact(ContactLaw::Hertz, 0.7);
        let close = |x: f64, y: f64| assert!((x / y - 1.0).abs() < 1e-14, "{x} {y}");
        let (a, e) = (c.contact_radius_m, c.effective_modulus_pa);
        close(
            1.0 / e,
            0.75 / 103e3 + 0.75 * (2e-3 / 1.36e5 + 3e-3 / 8e4 + 5e-3 / 3.4e4) / 10e-3,
        );
        close(a.powi(3), 0.75 * 0.7 * 3e-3 / e);
        close(c.indentation_m, a * a / 3e-3);
        close(
            c.force_n,
            4.0 / 3.0 * e * 3e-3_f64.sqrt() * c.indentation_m.powf(1.5),
        );
        close(c.peak_pressure_pa, 2.0 * a * e / (PI * 3e-3));
        // Both surfaces' displacement at the centre is the approach.
        close(
            -c.waveguide_height_m(0.0),
            c.waveguide_share * c.indentation_m,
        );
    }

    #[test]
    fn displacement_is_continuous_at_the_rim_and_where_the_series_takes_over() {
        let c = contact(ContactLaw::Hertz, 0.7);
        for (r, step) in [
            (c.contact_radius_m, 1e-9),
            (50.0 * c.contact_radius_m, 1e-9),
        ] {
            let at = |q: f64| c.waveguide_height_m(q);
            // One-sided values differ by slope × step plus the closed form's cancellation, (r/a)³ ulps.
            assert!((at(r * (1.0 - step)) / at(r * (1.0 + step)) - 1.0).abs() < 1e-8);
        }
        // Far away: a point force on a half space, F/(π E* r) for both bodies.
        let r = 1e3 * c.contact_radius_m;
        let point = c.waveguide_share * c.force_n / (PI * c.effective_modulus_pa * r);
        assert!((-c.waveguide_height_m(r) / point - 1.0).abs() < 1e-6);
    }

    #[test]
    fn tatara_keeps_the_radius_and_lessens_the_approach() {
        let (h, t) = (
            contact(ContactLaw::Hertz, 0.7),
            contact(ContactLaw::Tatara, 0.7),
        );
        assert_eq!(h.contact_radius_m, t.contact_radius_m);
        assert!(t.indentation_m < h.indentation_m && t.indentation_m > 0.0);
        // At small load the correction vanishes relative to Hertz's approach, as F against F^(2/3).
        let ratio = |f| {
            contact(ContactLaw::Tatara, f).indentation_m
                / contact(ContactLaw::Hertz, f).indentation_m
        };
        let fall = (1.0 - ratio(1e-6)) / (1.0 - ratio(1e-9));
        assert!((fall - 10.0).abs() < 0.01, "{fall}");
    }
}
