//! A sphere pressed on the waveguide: pressure, contact radius, indentation and surface displacement.

use std::f64::consts::PI;

use super::material::{Sphere, Waveguide};

/// How force, contact radius and indentation hang together.
///
/// ```
/// use tactile_imaging::simulate::{ContactLaw, PressOptions, PressScene};
/// let contact = |law| {
///     let scene = PressScene::new(PressOptions { law, ..PressOptions::default() })?;
///     Ok::<_, tactile_imaging::simulate::SimulateError>(scene.truth(0).contact)
/// };
/// let (hertz, tatara) = (contact(ContactLaw::Hertz)?, contact(ContactLaw::Tatara)?);
/// assert_eq!(hertz.indentation_m, hertz.contact_radius_m.powi(2) / hertz.sphere_radius_m);
/// assert_eq!(tatara.contact_radius_m, hertz.contact_radius_m);
/// assert!(tatara.indentation_m < hertz.indentation_m);
/// # Ok::<(), tactile_imaging::simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum ContactLaw {
    /// Hertz (1882): a³ = 3FR/(4E*), δ = a²/R. Small contact, a ≪ R; the simulator obeys it at any load.
    #[default]
    Hertz,
    /// Tatara (1991), first extension of Hertz to a sphere squeezed between two surfaces: Hertz's radius and
    /// pressure, but the approach is lessened by the displacement that the opposite contact's force causes,
    /// δ = a²/R − F/(πE₁)·[(1 − ν₁²)/√(a² + 4R²) + 2(1 + ν₁)R²/(a² + 4R²)^{3/2}].
    /// Only the sphere's own material (E₁, ν₁) enters the correction: the waveguide is loaded on one side.
    /// His stiffening of rubber and the lateral spread of the contact are not included.
    ///
    /// Y. Tatara, J. Eng. Mater. Technol. 113 (1991) 285–291.
    Tatara,
}

/// The contact at one load.
///
/// ```
/// use std::f64::consts::PI;
/// use tactile_imaging::simulate::{Load, PressOptions, PressScene};
/// let scene = PressScene::new(PressOptions { loads: vec![Load::normal(0.01)], ..PressOptions::default() })?;
/// let contact = scene.truth(0).contact;
/// let (a, r, e) = (contact.contact_radius_m, contact.sphere_radius_m, contact.effective_modulus_pa);
/// let near = |found: f64, expected: f64| (found / expected - 1.0).abs() < 1e-12;
/// assert!(near(a.powi(3), 0.75 * 0.01 * r / e) && contact.contact_ratio() < 0.3, "a³ = 3FR/(4E*)");
/// assert!(near(contact.mean_pressure_pa() * PI * a * a, 0.01));
/// assert!(near(contact.pressure_pa(0.0), 1.5 * contact.mean_pressure_pa()) && contact.pressure_pa(a) == 0.0);
/// assert!(near(contact.apparent_height_m(0.6 * a), 0.8 * a), "a hemisphere");
/// let [_, _, sink] = contact.waveguide_displacement_m(0.0, 0.0);
/// assert!(near(-sink, contact.waveguide_share * contact.indentation_m));
/// # Ok::<(), tactile_imaging::simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
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
    /// Radial displacement of the waveguide's surface at the rim, per p₀·a, in 1/Pa (0 when incompressible).
    radial_compliance: f64,
}

impl Contact {
    /// The contact of `sphere` on `waveguide` at `force_n` ≥ 0.
    pub(super) fn new(
        sphere: &Sphere,
        waveguide: &Waveguide,
        law: ContactLaw,
        force_n: f64,
    ) -> Self {
        let body = waveguide.series();
        let (c1, c2) = (
            sphere.material.plane_strain_compliance(),
            body.plane_strain_compliance(),
        );
        let effective_modulus_pa = 1.0 / (c1 + c2);
        let radius = sphere.radius_m;
        let a = (0.75 * force_n * radius / effective_modulus_pa).cbrt();
        let peak_pressure_pa = if a > 0.0 {
            1.5 * force_n / (PI * a * a)
        } else {
            0.0
        };
        let nu = body.poisson_ratio;
        Self {
            force_n,
            sphere_radius_m: radius,
            contact_radius_m: a,
            indentation_m: a * a / radius - far_side(sphere, law, force_n, a),
            peak_pressure_pa,
            effective_modulus_pa,
            waveguide_share: c2 * effective_modulus_pa,
            radial_compliance: (1.0 - 2.0 * nu) * (1.0 + nu) / (3.0 * body.youngs_modulus_pa),
        }
    }

    /// Pressure p₀ √(1 − r²/a²) at distance `r_m` from the centre, in pascal.
    pub fn pressure_pa(&self, r_m: f64) -> f64 {
        let a = self.contact_radius_m;
        if r_m >= a {
            return 0.0;
        }
        self.peak_pressure_pa * ((a - r_m) * (a + r_m)).sqrt() / a
    }

    /// Mean pressure F/(πa²) in pascal; 0 without contact.
    pub fn mean_pressure_pa(&self) -> f64 {
        self.peak_pressure_pa / 1.5
    }

    /// a/R: Hertz's law holds while this is small (warn beyond 0.3).
    pub fn contact_ratio(&self) -> f64 {
        self.contact_radius_m / self.sphere_radius_m
    }

    /// Height of the *apparent* surface: the pressure read as the shading of a frontally lit Lambertian surface is
    /// exactly a hemisphere of radius a, z = √(a² − r²), whatever the sphere's radius and modulus. Zero outside.
    pub fn apparent_height_m(&self, r_m: f64) -> f64 {
        let a = self.contact_radius_m;
        if r_m >= a {
            0.0
        } else {
            ((a - r_m) * (a + r_m)).sqrt()
        }
    }

    /// Displacement (x, y, z) of the waveguide's material point that lay at (`x_m`, `y_m`) from the contact's
    /// centre on the flat surface, in metres: down is negative z.
    ///
    /// With u the joint displacement of both surfaces under Hertz's pressure, the waveguide's share of it is normal;
    /// the tangential part, towards the centre, vanishes at ν₂ = ½ (K. L. Johnson, *Contact Mechanics*, eq. 3.41).
    pub fn waveguide_displacement_m(&self, x_m: f64, y_m: f64) -> [f64; 3] {
        let a = self.contact_radius_m;
        if a == 0.0 {
            return [0.0; 3];
        }
        let r = x_m.hypot(y_m);
        let normal = -self.waveguide_share * self.joint_displacement_m(r);
        // 1 − (1 − t)^{3/2} over t, with t = r²/a², kept accurate for small t.
        let t = (r / a).powi(2);
        let shape = if t >= 1.0 {
            1.0 / t
        } else {
            let s = (1.0 - t).sqrt();
            (1.0 + s + s * s) / (1.0 + s)
        };
        let radial = -self.radial_compliance * self.peak_pressure_pa * shape;
        [radial * x_m, radial * y_m, normal]
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

/// What the opposite contact takes off the approach.
fn far_side(sphere: &Sphere, law: ContactLaw, force_n: f64, a: f64) -> f64 {
    if law == ContactLaw::Hertz {
        return 0.0;
    }
    let (nu, r) = (sphere.material.poisson_ratio, sphere.radius_m);
    let d = (a * a + 4.0 * r * r).sqrt();
    force_n / (PI * sphere.material.youngs_modulus_pa)
        * ((1.0 - nu) * (1.0 + nu) / d + 2.0 * (1.0 + nu) * r * r / (d * d * d))
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
        Contact::new(&sphere, &Waveguide::default(), law, force_n)
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
            -c.waveguide_displacement_m(0.0, 0.0)[2],
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
            let at = |q: f64| c.waveguide_displacement_m(q, 0.0)[2];
            // One-sided values differ by slope × step plus the closed form's cancellation, (r/a)³ ulps.
            assert!((at(r * (1.0 - step)) / at(r * (1.0 + step)) - 1.0).abs() < 1e-8);
        }
        // Far away: a point force on a half space, F/(π E* r) for both bodies.
        let r = 1e3 * c.contact_radius_m;
        let point = c.waveguide_share * c.force_n / (PI * c.effective_modulus_pa * r);
        assert!((-c.waveguide_displacement_m(r, 0.0)[2] / point - 1.0).abs() < 1e-6);
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
