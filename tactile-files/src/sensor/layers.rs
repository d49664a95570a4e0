//! Fits the layers of the guide to contact radii of rigid balls.
//!
//! ln F = ln(4/3 a³/R) + ln E_g(a, layers), with E_g from the layer equation. The parameters are ln
//! E, ln h and ν of all layers, ln R of every ball, and one factor on all forces, because the
//! parabola of the theory is not a ball. All start from their stated values, with the stated errors
//! as a prior. Parameters that the presses do not determine keep their stated values.
use super::findings::{LayerFinding, PressFinding, SensorError};
use super::input::{Indenter, LayerInput};
use crate::scene::{SceneLayer, elastic_layers};
use nalgebra::{DMatrix, DVector};
use tactile_imaging::elasticity::contact::Layer;
use tactile_imaging::force::Estimate;

/// A contact of a rigid ball.
#[derive(Clone, Copy, Debug)]
struct BallContact {
    /// Index of the ball.
    ball: usize,
    force_n: f64,
    /// Relative standard error of the force.
    force_error: f64,
    radius_m: f64,
    /// Relative standard error of the contact radius.
    radius_error: f64,
}

/// A ball with its stated values.
#[derive(Clone, Copy, Debug)]
struct Ball {
    radius_m: f64,
    /// Relative standard error of the radius.
    radius_error: f64,
}

/// The layers with their errors.
#[derive(Clone, Debug)]
pub(super) struct LayerFit {
    /// The fitted layers, or the stated ones if no press could be used.
    pub layers: Vec<SceneLayer>,
    /// Covariance of ln E, ln h and ν of all layers.
    covariance: DMatrix<f64>,
}

impl LayerFit {
    /// The covariance as rows for the sensor file.
    pub(super) fn covariance_rows(&self) -> Vec<Vec<f64>> {
        let rows = self.covariance.row_iter();
        rows.map(|row| row.iter().copied().collect()).collect()
    }
}

/// Number of nodes in ln a for the polynomial of ln E_g. Five leave an error of 10⁻⁵ over a decade,
/// and each costs a solution of the layer equation.
const NODES: usize = 5;
/// Largest deviation of a stated value, or of the whole fit, in standard errors.
const LARGEST_DEVIATION: f64 = 4.0;
/// Standard error of a parameter that is stated as exact, far below what presses can determine.
const EXACT: f64 = 1e-6;
/// Relative error of a contact radius beyond the noise of the frame, because the pressure profile
/// on a guide of finite thickness differs from Hertz's.
const PROFILE_ERROR: f64 = 5e-4;

/// Fits the layers to the contacts of balls, and stores the force that they predict for each press.
///
/// # Errors
/// [`SensorError::Radius`] if the contacts contradict the stated values.
pub(super) fn fit(
    stated: &[LayerInput],
    gauge_noise_n: f64,
    presses: &mut [PressFinding],
) -> Result<LayerFit, SensorError> {
    let n = stated.len();
    let errors: Vec<[f64; 3]> = stated.iter().map(parameter_errors).collect();
    let variances = DVector::from_fn(3 * n, |k, _| errors[k % n][k / n].powi(2));
    let as_stated = LayerFit {
        layers: stated.iter().map(|input| input.layer).collect(),
        covariance: DMatrix::from_diagonal(&variances),
    };
    let (mut balls, mut contacts, mut places) = (Vec::<Ball>::new(), Vec::new(), Vec::new());
    for (place, press) in presses.iter().enumerate() {
        let (
            Indenter::Ball {
                radius_m,
                radius_error_m,
            },
            Some(radius),
        ) = (press.indenter, press.contact_radius_m)
        else {
            continue;
        };
        // Beyond half its radius a ball differs too much from a parabola.
        if radius.value > 0.5 * radius_m || press.force_n <= 0.0 {
            continue;
        }
        // Presses of equal radius use the same ball and share its error.
        let known = balls.iter().position(|b| b.radius_m == radius_m);
        let ball = known.unwrap_or_else(|| {
            balls.push(Ball {
                radius_m,
                radius_error: radius_error_m / radius_m,
            });
            balls.len() - 1
        });
        contacts.push(BallContact {
            ball,
            force_n: press.force_n,
            force_error: (gauge_noise_n / press.force_n).max(1e-4),
            radius_m: radius.value,
            radius_error: (radius.standard_error / radius.value).hypot(PROFILE_ERROR),
        });
        places.push(place);
    }
    // A rigid guide, or a calibration by punches alone, has nothing to fit.
    if n == 0 || contacts.is_empty() {
        return Ok(as_stated);
    }
    let layers = elastic_layers(&as_stated.layers);
    let problem = Problem::new(&errors, &balls, &contacts);
    let Some(solution) = problem.solve(&layers) else {
        return Ok(as_stated);
    };
    problem.plausible(&solution)?;
    let count = Layer::PARAMETERS * n;
    let parameters = solution.parameters.rows(0, count).into_owned();
    let fitted = Layer::stepped(&layers, &parameters);
    let Some(stiffness) = Stiffness::new(&fitted, &contacts) else {
        return Ok(as_stated);
    };
    for (place, c) in places.into_iter().zip(&contacts) {
        let ball_radius = balls[c.ball].radius_m * solution.parameters[count + c.ball].exp();
        let force_n = 4.0 / 3.0 * c.radius_m.powi(3) / ball_radius * stiffness.at(c.radius_m).exp();
        presses[place].layers_force_n = Some(force_n);
    }
    let covariance = solution.covariance.view((0, 0), (count, count));
    let layer = |(layer, input): (&Layer, &LayerInput)| SceneLayer {
        thickness_m: layer.thickness_m,
        youngs_modulus_pa: layer.youngs_modulus_pa,
        poisson_ratio: layer.poisson_ratio,
        ..input.layer
    };
    Ok(LayerFit {
        layers: fitted.iter().zip(stated).map(layer).collect(),
        covariance: covariance.into_owned(),
    })
}

/// All parameters of the layers before and after the fit.
pub(super) fn findings(stated: &[LayerInput], fit: &LayerFit) -> Vec<LayerFinding> {
    let n = stated.len();
    let mut findings = Vec::with_capacity(3 * n);
    let values = |layer: &SceneLayer| {
        [
            layer.youngs_modulus_pa,
            layer.thickness_m,
            layer.poisson_ratio,
        ]
    };
    for (layer, input) in stated.iter().enumerate() {
        let (before, after) = (values(&input.layer), values(&fit.layers[layer]));
        let names = ["youngs_modulus_pa", "thickness_m", "poisson_ratio"];
        for (k, parameter) in names.into_iter().enumerate() {
            // The errors of moduli and thicknesses are relative.
            let unit = |value: f64| if k < 2 { value } else { 1.0 };
            let place = k * n + layer;
            let error = fit.covariance[(place, place)].sqrt();
            let stated = Estimate::new(before[k], parameter_errors(input)[k] * unit(before[k]));
            let fitted = Estimate::new(after[k], error * unit(after[k]));
            findings.push(LayerFinding {
                layer,
                parameter,
                stated,
                fitted,
                identified: fitted.standard_error < 0.7 * stated.standard_error,
            });
        }
    }
    findings
}

/// Standard errors of ln E, ln h and ν.
fn parameter_errors(input: &LayerInput) -> [f64; 3] {
    [
        input.youngs_modulus_error_pa / input.layer.youngs_modulus_pa,
        input.thickness_error_m / input.layer.thickness_m,
        input.poisson_ratio_error,
    ]
}

/// ln E_g as a function of ln a: a polynomial through Chebyshev nodes.
struct Stiffness {
    nodes: [f64; NODES],
    values: [f64; NODES],
}

impl Stiffness {
    fn new(layers: &[Layer], contacts: &[BallContact]) -> Option<Self> {
        let logs: DVector<f64> =
            DVector::from_iterator(contacts.len(), contacts.iter().map(|c| c.radius_m.ln()));
        let (low, high) = (logs.min(), logs.max());
        // A single radius gets a minimum span, so that no nodes coincide.
        let half = (0.5 * (high - low)).max(0.05);
        // Chebyshev nodes keep the interpolation from oscillating at the ends.
        let nodes = std::array::from_fn(|k| {
            let angle = std::f64::consts::PI * (k as f64 + 0.5) / NODES as f64;
            0.5 * (low + high) - half * angle.cos()
        });
        let mut values = [0.0; NODES];
        for (value, node) in values.iter_mut().zip(nodes) {
            *value = Layer::log_stiffness(layers, f64::exp(node))?;
        }
        Some(Self { nodes, values })
    }

    /// Lagrange interpolation at a radius.
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
    /// Prior standard errors of the layer parameters, of ln R of every ball and of the common
    /// factor.
    prior: DVector<f64>,
    layer_parameters: usize,
    /// Weight of the common factor in every contact.
    model: Vec<f64>,
}

struct Solution {
    parameters: DVector<f64>,
    covariance: DMatrix<f64>,
    /// Sum of squared residuals over the standard errors of the presses alone.
    chi_squared: f64,
}

impl<'a> Problem<'a> {
    fn new(errors: &[[f64; 3]], balls: &'a [Ball], contacts: &'a [BallContact]) -> Self {
        let n = errors.len();
        let layer_parameters = Layer::PARAMETERS * n;
        let prior = DVector::from_fn(layer_parameters + balls.len() + 1, |k, _| {
            let error = if k < layer_parameters {
                errors[k % n][k / n]
            } else {
                balls
                    .get(k - layer_parameters)
                    .map_or(Layer::PARABOLA_ERROR, |b| b.radius_error)
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

    /// ln F of every contact, as predicted by the law.
    fn predicted(&self, layers: &[Layer], parameters: &DVector<f64>) -> Option<Vec<f64>> {
        let n = self.layer_parameters;
        let step = parameters.rows(0, n).into_owned();
        let stiffness = Stiffness::new(&Layer::stepped(layers, &step), self.contacts)?;
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
        // F grows as the third power of the radius, and a little faster on layers of finite
        // thickness.
        contact.force_error.powi(2) + (3.2 * contact.radius_error).powi(2)
    }

    /// Gauss–Newton steps on residuals and priors.
    fn solve(&self, layers: &[Layer]) -> Option<Solution> {
        let count = self.prior.len();
        let mut parameters = DVector::zeros(count);
        let mut covariance = DMatrix::zeros(count, count);
        // The law is nearly linear in the logarithms. A step of 0.1 leaves an error of some 10⁻³ of
        // the step.
        for _ in 0..4 {
            let here = self.predicted(layers, &parameters)?;
            // Parameters stated as exact are held fixed.
            let moves = |k: usize| self.prior[k] > EXACT;
            let slopes = Layer::slopes(&here, &parameters, moves, |x| self.predicted(layers, x))?;
            // The priors keep the normal equations regular even if the presses determine nothing.
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

    /// Refuses a fit that moves a stated value too far or leaves too large residuals.
    fn plausible(&self, solution: &Solution) -> Result<(), SensorError> {
        let moved = solution.parameters.component_div(&self.prior);
        let freedom = self.contacts.len() as f64;
        let excess = (solution.chi_squared - freedom) / (2.0 * freedom).sqrt();
        let deviation = moved.norm();
        // The errors of the presses are those of noise alone. Ten times their χ² shows a wrong law,
        // not a wrong error.
        let misfit = solution.chi_squared > 10.0 * freedom && excess > LARGEST_DEVIATION;
        if deviation <= LARGEST_DEVIATION && !misfit {
            return Ok(());
        }
        let n = self.layer_parameters;
        // The message names the ball that moved the most.
        let worst = (0..self.balls.len())
            .max_by(|i, j| moved[n + i].abs().total_cmp(&moved[n + j].abs()))
            .unwrap_or(0);
        Err(SensorError::Radius {
            radius_m: self.balls[worst].radius_m,
            deviation: deviation.max(excess),
        })
    }
}
