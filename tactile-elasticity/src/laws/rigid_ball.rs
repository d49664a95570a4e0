//! A rigid ball on the layers of a guide.

use super::LogForce;
use super::finite_strain::{FiniteStrain, LinearContact};
use crate::contact::{Bond, LayerEquation, Waveguide};
use crate::error::{ElasticityError, Quantity};
use std::f64::consts::PI;

/// Nodes in ln a between which the linear contact is a polynomial. Five leave an error of 10⁻⁵ over
/// a decade, and each costs a solution of the layer equation.
const NODES: usize = 5;

/// Standard error of ln F if the layers differ, beside that of the law: the law's correction was
/// fitted to more single layers than stacks.
const STACK_ERROR: f64 = 0.004;

/// Smallest half width of the nodes in ln a: those of a single radius must not coincide.
const LEAST_HALF_WIDTH: f64 = 0.05;

/// F(a, R) of rigid balls on a guide: [`WaveguideLaw`](super::WaveguideLaw) without compliance of
/// the ball, for the balls that calibrate or check a guide. E is that of the guide, so the force is
/// in newtons.
///
/// ```
/// use tactile_elasticity::contact::{Layer, Waveguide};
/// use tactile_elasticity::laws::RigidBallLaw;
/// let gel = Layer { thickness_m: 10e-3, youngs_modulus_pa: 75e3, poisson_ratio: 0.5 };
/// let law = RigidBallLaw::new(&Waveguide::new(vec![gel])?, [0.2e-3, 8e-3])?;
/// // A small contact is Hertz's on a half-space with E/(1 − ν²) = 100 kPa, one as wide as the layer is not.
/// let over_hertz = |radius_m: f64, a: f64| {
///     law.log_force(radius_m, a).value().exp() / (4.0 / 3.0 * 100e3 * a.powi(3) / radius_m)
/// };
/// assert!((over_hertz(20e-3, 0.2e-3) - 1.0).abs() < 0.03);
/// assert!(over_hertz(20e-3, 8e-3) > 1.2);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone)]
pub struct RigidBallLaw {
    thickness_m: f64,
    /// ln(4/3 E/(1 − ν²)) of the touched layer.
    log_modulus: f64,
    finite_strain: FiniteStrain,
    stack_error: f64,
    nodes: [f64; NODES],
    /// ln(F/F_Hertz) and ln(δ/δ_Hertz) of the linear contact at the nodes.
    values: [[f64; 2]; NODES],
}

impl RigidBallLaw {
    /// Solves the linear contact for radii (m) from the first to the second.
    ///
    /// # Errors
    /// Those of the layers' contact: [`ElasticityError`].
    pub fn new(guide: &Waveguide, radii_m: [f64; 2]) -> Result<Self, ElasticityError> {
        let [low, high] = radii_m.map(|a| Quantity::ContactRadius.positive(a));
        let [low, high] = [low?.ln(), high?.ln()];
        let half = (0.5 * (high - low)).max(LEAST_HALF_WIDTH);
        let equation = LayerEquation::of_layers(guide, Bond::Bonded)?;
        // Chebyshev's nodes keep the interpolation from swinging at the ends.
        let nodes = std::array::from_fn(|k| {
            let angle = PI * (k as f64 + 0.5) / NODES as f64;
            0.5 * (low + high) - half * angle.cos()
        });
        let mut values = [[0.0; 2]; NODES];
        for (value, node) in values.iter_mut().zip(nodes) {
            let contact = equation.solve(f64::exp(node) / guide.thickness_m())?;
            *value = [contact.force_ratio_same_radius, contact.indentation_ratio].map(f64::ln);
        }
        let touched = guide.layers().iter().find(|layer| layer.thickness_m > 0.0);
        Ok(Self {
            thickness_m: guide.thickness_m(),
            log_modulus: (4.0 / 3.0 / guide.touched().compliance_per_pa()).ln(),
            finite_strain: FiniteStrain::new(touched.map_or(0.5, |layer| layer.poisson_ratio)),
            stack_error: if guide.layers().len() > 1 {
                STACK_ERROR
            } else {
                0.0
            },
            nodes,
            values,
        })
    }

    /// ln F in newtons of a contact of radius a under a ball, both in metres, with the standard
    /// error of the law.
    #[must_use]
    pub fn log_force(&self, ball_radius_m: f64, a: f64) -> LogForce {
        let [force, indentation] = self.linear(a.ln());
        let contact = LinearContact {
            ratio: a / ball_radius_m,
            ball: 0.0,
            layer_ratio: a / self.thickness_m,
            log_force: [force, 0.0],
            log_indentation: [indentation, 0.0],
        };
        let hertz = self.log_modulus + 3.0 * a.ln() - ball_radius_m.ln();
        let law = &self.finite_strain;
        let error = law.error(contact.ratio, Some(contact.layer_ratio), false);
        LogForce::new(hertz + force + law.force(&contact).value)
            .with_error(error.hypot(self.stack_error))
    }

    /// Lagrange's interpolation at ln a.
    fn linear(&self, log_a: f64) -> [f64; 2] {
        let mut sum = [0.0; 2];
        for (k, (value, node)) in self.values.iter().zip(self.nodes).enumerate() {
            let others = self.nodes.iter().enumerate().filter(|(j, _)| *j != k);
            let weight: f64 = others
                .map(|(_, other)| (log_a - other) / (node - other))
                .product();
            sum = [0, 1].map(|i| sum[i] + weight * value[i]);
        }
        sum
    }
}
