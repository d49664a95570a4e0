//! Fits the layers of the guide to contact radii of rigid balls.
//!
//! ln F(a, R, layers) is that of [`RigidBallLaw`], the law by which a scene's frames are measured.
//! The parameters are ln E, ln h and ν of all layers, ln R of every ball, and the error of the law,
//! which all presses share. All start from their stated values, with the stated errors as a prior.
//! Parameters that the presses do not determine keep their stated values.
use super::findings::{LayerFinding, PressFinding, SensorError};
use super::input::{Indenter, LayerInput};
use crate::scene::{SceneLayer, elastic_layers};
use nalgebra::{DMatrix, DVector};
use tactile_imaging::elasticity::contact::{Layer, Waveguide};
use tactile_imaging::elasticity::laws::RigidBallLaw;
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

/// Part of the law's error that contacts of other a/R do not share: it bends over a/R.
const OWN_PART_OF_LAW: f64 = 0.5;
/// Largest a/R of a press that is used: up to here the law was compared with finite elements.
const LARGEST_CONTACT_RATIO: f64 = 0.85;
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
        if radius.value > LARGEST_CONTACT_RATIO * radius_m || press.force_n <= 0.0 {
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
            // The curve that converts light to pressure, and with it the profile, is as uncertain
            // at the grey levels of this press as its force.
            radius_error: (radius.standard_error / radius.value)
                .hypot(gauge_noise_n / press.force_n)
                .hypot(PROFILE_ERROR),
        });
        places.push(place);
    }
    // A rigid guide, or a calibration by punches alone, has nothing to fit.
    if n == 0 || contacts.is_empty() {
        return Ok(as_stated);
    }
    let layers = elastic_layers(&as_stated.layers);
    let problem = Problem::new(&errors, &balls, &contacts, &layers);
    let Some((problem, solution)) = problem.and_then(|p| p.solve(&layers).map(|s| (p, s))) else {
        return Ok(as_stated);
    };
    problem.plausible(&solution)?;
    let count = Layer::PARAMETERS * n;
    let parameters = solution.parameters.rows(0, count).into_owned();
    let fitted = Layer::stepped(&layers, &parameters);
    for (place, log_force) in places.into_iter().zip(&solution.log_forces) {
        presses[place].layers_force_n = Some(log_force.exp());
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

/// The law for all contacts. `None` if the layer equation cannot be solved.
fn law(layers: &[Layer], contacts: &[BallContact]) -> Option<RigidBallLaw> {
    let radii = || contacts.iter().map(|c| c.radius_m);
    let range = [
        radii().fold(f64::INFINITY, f64::min),
        radii().fold(0.0, f64::max),
    ];
    RigidBallLaw::new(&Waveguide::new(layers.to_vec()).ok()?, range).ok()
}

struct Problem<'a> {
    balls: &'a [Ball],
    contacts: &'a [BallContact],
    /// Prior standard errors of the layer parameters, of ln R of every ball and of the common
    /// factor.
    prior: DVector<f64>,
    layer_parameters: usize,
    /// Standard error of every contact because of the law.
    law: Vec<f64>,
}

struct Solution {
    parameters: DVector<f64>,
    covariance: DMatrix<f64>,
    /// ln F of every contact by the fitted parameters.
    log_forces: Vec<f64>,
    /// Sum of squared residuals over the standard errors of the presses alone.
    chi_squared: f64,
}

impl<'a> Problem<'a> {
    /// `None` if the contacts on the stated layers cannot be solved.
    fn new(
        errors: &[[f64; 3]],
        balls: &'a [Ball],
        contacts: &'a [BallContact],
        layers: &[Layer],
    ) -> Option<Self> {
        let n = errors.len();
        let layer_parameters = Layer::PARAMETERS * n;
        let prior = DVector::from_fn(layer_parameters + balls.len() + 1, |k, _| {
            let error = if k < layer_parameters {
                errors[k % n][k / n]
            } else {
                // The last parameter counts standard errors of the law.
                balls
                    .get(k - layer_parameters)
                    .map_or(1.0, |b| b.radius_error)
            };
            error.max(EXACT)
        });
        let law = law(layers, contacts)?;
        let error = |c: &BallContact| law.log_force(balls[c.ball].radius_m, c.radius_m).error();
        Some(Self {
            balls,
            contacts,
            prior,
            layer_parameters,
            law: contacts.iter().map(error).collect(),
        })
    }

    /// ln F of every contact, as predicted by the law.
    fn predicted(&self, layers: &[Layer], parameters: &DVector<f64>) -> Option<Vec<f64>> {
        let n = self.layer_parameters;
        let step = parameters.rows(0, n).into_owned();
        let law = law(&Layer::stepped(layers, &step), self.contacts)?;
        let common = parameters[n + self.balls.len()];
        let log_force = |(c, error): (&BallContact, &f64)| {
            let ball_radius_m = self.balls[c.ball].radius_m * parameters[n + c.ball].exp();
            law.log_force(ball_radius_m, c.radius_m).value() + error * common
        };
        Some(self.contacts.iter().zip(&self.law).map(log_force).collect())
    }

    /// Of ln F of a contact, beside what all contacts share.
    fn variance(&self, contact: usize) -> f64 {
        let c = &self.contacts[contact];
        // F grows as the third power of the radius, and a little faster on layers of finite
        // thickness.
        let measured = c.force_error.hypot(3.2 * c.radius_error);
        measured.hypot(OWN_PART_OF_LAW * self.law[contact]).powi(2)
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
                let weight = self.variance(i).recip();
                let row = slopes.row(i).transpose();
                right += &row * (weight * (contact.force_n.ln() - here[i]));
                normal += &row * row.transpose() * weight;
            }
            covariance = normal.cholesky()?.inverse();
            parameters += &covariance * right;
        }
        let here = self.predicted(layers, &parameters)?;
        let chi = |(i, log_force): (usize, &f64)| {
            (self.contacts[i].force_n.ln() - log_force).powi(2) / self.variance(i)
        };
        Some(Solution {
            chi_squared: here.iter().enumerate().map(chi).sum(),
            log_forces: here,
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
