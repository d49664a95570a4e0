//! The surface of layers under a ball's contact.
use super::hertz::HertzContact;
use super::layers::{Bond, LayerKernel};
use super::waveguide::Waveguide;
use crate::error::{ElasticityError, Quantity};

impl Waveguide {
    /// Depth in metres by which a ball's contact indents the surface of layers, at each distance
    /// from its centre.
    ///
    /// ```math
    /// u(r) = \frac{2}{E^*} \int_0^\infty L(kh)\, P(k)\, J_0(kr)\, dk, \qquad
    /// P(k) = p_0 \frac{\sin ka - ka \cos ka}{a k^3}, \qquad p_0 = \frac{3F}{2\pi a^2}
    /// ```
    ///
    /// with E* = E/(1 − ν²) of the touched layer and L the compliance of the layers relative to
    /// that of a half-space (Johnson, *Contact Mechanics*, 1985, 5.8). The part of the half-space
    /// is Hertz's closed form, so only the difference is integrated. Strains are assumed small and
    /// the pressure Hertzian; on layers that are thin compared with the contact, the pressure is
    /// flatter. It costs several hundred solutions of the layers, and as many Bessel functions per
    /// distance.
    ///
    /// ```
    /// use tactile_elasticity::contact::{Bond, Layer, Waveguide};
    /// let gel = Layer { thickness_m: 10e-3, youngs_modulus_pa: 75e3, poisson_ratio: 0.5 };
    /// let guide = Waveguide::new(vec![gel])?;
    /// // A force of 0.1 N on a disc of 1 mm indents a half-space of E* = 100 kPa by 3F/(4aE*).
    /// let depth = guide.depression_m(Bond::Bonded, 0.1, 1e-3, &[0.0, 40e-3])?;
    /// assert!(depth[0] < 0.75e-3 && depth[0] > 0.6e-3, "less, for the rigid base");
    /// assert!(depth[1].abs() < 1e-6, "no displacement far away");
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`] for a force, a radius or a guide without layers,
    /// [`ElasticityError::NotFinite`] for a distance.
    pub fn depression_m(
        &self,
        bond: Bond,
        force_n: f64,
        contact_radius_m: f64,
        distances_m: &[f64],
    ) -> Result<Vec<f64>, ElasticityError> {
        let force = Quantity::Force.positive(force_n)?;
        let a = Quantity::ContactRadius.positive(contact_radius_m)?;
        let kernel = LayerKernel::of_layers(self, bond)?;
        for &distance in distances_m {
            Quantity::Distance.finite(distance)?;
        }
        let h = self.thickness_m();
        let plane_strain = 1.0 / self.touched().compliance_per_pa();
        let peak = 1.5 * force / (core::f64::consts::PI * a * a);
        let farthest = distances_m.iter().fold(0.0, |far: f64, r| far.max(r.abs()));
        let stiffened: Vec<(f64, f64)> = kernel
            .wavenumbers((a + farthest) / h)
            .into_iter()
            .map(|(s, weight)| {
                let deficit = weight * kernel.deficit(s) / h;
                (s / h, deficit * peak * a * a * hertz_transform(s / h * a))
            })
            .collect();
        let depth = |&r: &f64| {
            let half_space = HertzContact::surface_displacement_m(r, a, peak, plane_strain);
            let less: f64 = stiffened.iter().map(|(k, w)| w * libm::j0(k * r)).sum();
            half_space - 2.0 / plane_strain * less
        };
        Ok(distances_m.iter().map(depth).collect())
    }
}

/// (sin x − x cos x)/x³, replaced by ⅓ − x²/30 for small x, where the terms cancel.
fn hertz_transform(x: f64) -> f64 {
    if x > 0.1 {
        return (x.sin() - x * x.cos()) / x.powi(3);
    }
    let square = x * x;
    // At x = 0.1 the first neglected term is 10⁻¹³.
    1.0 / 3.0 - square / 30.0 * (1.0 - square / 28.0 * (1.0 - square / 54.0))
}
