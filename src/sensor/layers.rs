//! The fit of the guide's layers to contact radii of rigid balls.
//!
//! ln F = ln(4/3 a³/R) + ln E_g(a; layers), E_g from the layer equation. The parameters are ln E, ln h and ν of all layers, ln R of
//! every ball, and one factor on all forces for what the parabola of the theory is not a ball. All start from what is stated, with its
//! error as a prior, so that what the presses do not determine stays as it was stated.
use super::error::SensorError;
use super::input::LayerInput;
use crate::elasticity::contact::{
    Layer, PARAMETERS_PER_LAYER, guide_log_stiffness, stepped_layers,
};
use nalgebra::{DMatrix, DVector};

/// A contact of a rigid ball.
#[derive(Clone, Copy, Debug)]
pub struct BallContact {
    /// Which ball.
    pub ball: usize,
    pub force_n: f64,
    /// Relative standard error of the force.
    pub force_error: f64,
    pub radius_m: f64,
    /// Relative standard error of the contact radius.
    pub radius_error: f64,
}

/// A ball as stated.
#[derive(Clone, Copy, Debug)]
pub struct Ball {
    pub radius_m: f64,
    /// Relative.
    pub radius_error: f64,
}

#[derive(Clone, Debug)]
pub struct LayerFit {
    pub layers: Vec<Layer>,
    /// Of ln E, ln h and ν of all layers.
    pub covariance: DMatrix<f64>,
    /// Force of the fitted law at every contact's radius.
    pub forces_n: Vec<f64>,
}

/// Nodes in ln a between which ln E_g is a polynomial: it bends so little that five leave 10⁻⁵ over a decade.
const NODES: usize = 5;
/// Newton's steps: the law is nearly linear in the logarithms, a step of a tenth leaves some 10⁻³ of itself.
const STEPS: usize = 4;
/// Largest a/R that the layers are fitted to: beyond, a ball is no parabola.
pub(super) const LARGEST_CONTACT_RATIO: f64 = 0.5;
/// Relative error of F at a/R = 1 from taking the ball for a parabola and strains as small. It goes as (a/R)².
const MODEL_ERROR: f64 = 0.1;
/// Standard errors by which a stated value, or the whole fit, may be off before it counts as a mistake.
const LARGEST_DEVIATION: f64 = 4.0;
/// Standard error that a parameter stated as exact is given: far below what can be told.
const EXACT: f64 = 1e-6;

pub fn fit(
    stated: &[LayerInput],
    balls: &[Ball],
    contacts: &[BallContact],
) -> Result<Option<LayerFit>, SensorError> {
    let layers: Vec<Layer> = stated.iter().map(elastic).collect();
    let near: Vec<BallContact> = contacts
        .iter()
        .filter(|c| c.radius_m <= LARGEST_CONTACT_RATIO * balls[c.ball].radius_m)
        .copied()
        .collect();
    if layers.is_empty() || near.is_empty() {
        return Ok(None);
    }
    let problem = Problem::new(stated, balls, &near);
    let Some(solution) = problem.solve(&layers) else {
        return Ok(None);
    };
    problem.plausible(&solution)?;
    let count = PARAMETERS_PER_LAYER * layers.len();
    let parameters = solution.parameters.rows(0, count).into_owned();
    let fitted = stepped_layers(&layers, &parameters);
    let Some(stiffness) = Stiffness::new(&fitted, contacts) else {
        return Ok(None);
    };
    let ball_radius = |ball: usize| balls[ball].radius_m * solution.parameters[count + ball].exp();
    let forces_n = contacts
        .iter()
        .map(|c| {
            4.0 / 3.0 * c.radius_m.powi(3) / ball_radius(c.ball) * stiffness.at(c.radius_m).exp()
        })
        .collect();
    Ok(Some(LayerFit {
        layers: fitted,
        covariance: solution
            .covariance
            .view((0, 0), (count, count))
            .into_owned(),
        forces_n,
    }))
}

pub fn elastic(input: &LayerInput) -> Layer {
    Layer {
        thickness_m: input.layer.thickness_m,
        youngs_modulus_pa: input.layer.youngs_modulus_pa,
        poisson_ratio: input.layer.poisson_ratio,
    }
}

/// ln E_g over ln a: the polynomial through Chebyshev's nodes.
struct Stiffness {
    nodes: [f64; NODES],
    values: [f64; NODES],
}

impl Stiffness {
    fn new(layers: &[Layer], contacts: &[BallContact]) -> Option<Self> {
        let logs = || contacts.iter().map(|c| c.radius_m.ln());
        let (low, high) = (
            logs().fold(f64::INFINITY, f64::min),
            logs().fold(f64::NEG_INFINITY, f64::max),
        );
        // A single radius has a span of its own, so that no nodes coincide.
        let half = (0.5 * (high - low)).max(0.05);
        let nodes = std::array::from_fn(|k| {
            let angle = std::f64::consts::PI * (k as f64 + 0.5) / NODES as f64;
            0.5 * (low + high) - half * angle.cos()
        });
        let mut values = [0.0; NODES];
        for (value, node) in values.iter_mut().zip(nodes) {
            *value = guide_log_stiffness(layers, f64::exp(node))?;
        }
        Some(Self { nodes, values })
    }

    /// Lagrange's interpolation.
    fn at(&self, radius_m: f64) -> f64 {
        let x = radius_m.ln();
        let weight = |k: usize| {
            let others = (0..NODES).filter(|j| *j != k);
            others
                .map(|j| (x - self.nodes[j]) / (self.nodes[k] - self.nodes[j]))
                .product::<f64>()
        };
        (0..NODES).map(|k| self.values[k] * weight(k)).sum()
    }
}

struct Problem<'a> {
    balls: &'a [Ball],
    contacts: &'a [BallContact],
    /// Prior standard errors: of the layers' parameters, of ln R of every ball, of the common factor.
    prior: DVector<f64>,
    layer_parameters: usize,
    /// How much of the common factor every contact has.
    model: Vec<f64>,
}

struct Solution {
    parameters: DVector<f64>,
    covariance: DMatrix<f64>,
    /// Residuals over the standard errors of the presses alone.
    chi_squared: f64,
}

impl<'a> Problem<'a> {
    fn new(stated: &[LayerInput], balls: &'a [Ball], contacts: &'a [BallContact]) -> Self {
        let errors = stated.iter().map(LayerInput::parameter_errors);
        let errors: Vec<[f64; 3]> = errors.collect();
        let n = stated.len();
        let layer_parameters = PARAMETERS_PER_LAYER * n;
        let prior = DVector::from_fn(layer_parameters + balls.len() + 1, |k, _| {
            let error = if k < layer_parameters {
                errors[k % n][k / n]
            } else {
                balls
                    .get(k - layer_parameters)
                    .map_or(MODEL_ERROR, |b| b.radius_error)
            };
            error.max(EXACT)
        });
        let ratio = |c: &BallContact| c.radius_m / balls[c.ball].radius_m;
        Self {
            balls,
            contacts,
            prior,
            layer_parameters,
            model: contacts.iter().map(|c| ratio(c).powi(2)).collect(),
        }
    }

    /// ln F of every contact by the law.
    fn predicted(&self, layers: &[Layer], parameters: &DVector<f64>) -> Option<Vec<f64>> {
        let n = self.layer_parameters;
        let step = parameters.rows(0, n).into_owned();
        let stiffness = Stiffness::new(&stepped_layers(layers, &step), self.contacts)?;
        let common = parameters[n + self.balls.len()];
        let log_force = |(c, model): (&BallContact, &f64)| {
            let ball_radius = self.balls[c.ball].radius_m.ln() + parameters[n + c.ball];
            (4.0_f64 / 3.0).ln() + 3.0 * c.radius_m.ln() - ball_radius
                + stiffness.at(c.radius_m)
                + model * common
        };
        Some(
            self.contacts
                .iter()
                .zip(&self.model)
                .map(log_force)
                .collect(),
        )
    }

    fn variance(&self, contact: &BallContact) -> f64 {
        // F goes as the third power of the radius, and a little faster on layers that end.
        contact.force_error.powi(2) + (3.2 * contact.radius_error).powi(2)
    }

    /// Gauss and Newton's steps on residuals and priors.
    fn solve(&self, layers: &[Layer]) -> Option<Solution> {
        let count = self.prior.len();
        let mut parameters = DVector::zeros(count);
        let mut covariance = DMatrix::zeros(count, count);
        for _ in 0..STEPS {
            let here = self.predicted(layers, &parameters)?;
            let slopes = self.slopes(layers, &parameters, &here)?;
            let mut normal = DMatrix::from_diagonal(&self.prior.map(|sd| (sd * sd).recip()));
            let mut right = -(&normal * &parameters);
            for (i, contact) in self.contacts.iter().enumerate() {
                let weight = self.variance(contact).recip();
                let row = slopes.row(i).transpose();
                right += &row * (weight * (contact.force_n.ln() - here[i]));
                normal += &row * row.transpose() * weight;
            }
            covariance = normal.cholesky()?.inverse();
            parameters += &covariance * right;
        }
        let here = self.predicted(layers, &parameters)?;
        let chi = |(c, log_force): (&BallContact, &f64)| {
            (c.force_n.ln() - log_force).powi(2) / self.variance(c)
        };
        Some(Solution {
            chi_squared: self.contacts.iter().zip(&here).map(chi).sum(),
            parameters,
            covariance,
        })
    }

    fn slopes(
        &self,
        layers: &[Layer],
        parameters: &DVector<f64>,
        here: &[f64],
    ) -> Option<DMatrix<f64>> {
        // Downwards, because ν is at most ½.
        const STEP: f64 = -1e-3;
        let mut slopes = DMatrix::zeros(here.len(), self.prior.len());
        for k in 0..self.prior.len() {
            // What is stated as exact does not move.
            if self.prior[k] <= EXACT {
                continue;
            }
            let mut beside = parameters.clone();
            beside[k] += STEP;
            let there = self.predicted(layers, &beside)?;
            for (i, (there, here)) in there.iter().zip(here).enumerate() {
                slopes[(i, k)] = (there - here) / STEP;
            }
        }
        Some(slopes)
    }

    /// Refuses a fit that needs a stated value far from what was stated, or that does not fit.
    fn plausible(&self, solution: &Solution) -> Result<(), SensorError> {
        let moved = solution.parameters.component_div(&self.prior);
        let freedom = self.contacts.len() as f64;
        let excess = (solution.chi_squared - freedom) / (2.0 * freedom).sqrt();
        let prior_excess = moved.norm_squared().sqrt();
        let deviation = prior_excess.max(moved.amax());
        // The stated errors of the presses are those of noise alone: ten times their χ² is a wrong law, not a wrong error.
        let misfit = solution.chi_squared > 10.0 * freedom && excess > LARGEST_DEVIATION;
        if deviation <= LARGEST_DEVIATION && !misfit {
            return Ok(());
        }
        let n = self.layer_parameters;
        let worst = (0..self.balls.len())
            .max_by(|i, j| moved[n + i].abs().total_cmp(&moved[n + j].abs()))
            .unwrap_or(0);
        Err(SensorError::Radius {
            radius_m: self.balls[worst].radius_m,
            deviation: deviation.max(excess),
        })
    }
}
