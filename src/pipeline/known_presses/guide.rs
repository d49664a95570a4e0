//! The current layers of the guide, from contact radii of balls of known modulus.
//!
//! A contact of radius a carries ln F = ln E* + ln f(a, layers). Let x be the deviations of ln E,
//! ln h and ν of all layers from their stated values, C their covariance, V the covariance of all
//! other contributions to ln F, and H the derivatives of ln F by x. The deviations after the
//! presses are x = C Hᵀ (H C Hᵀ + V)⁻¹ (ln F − ln F(x) + H x), the iterated Kalman update.
//! Parameters that the presses do not determine keep their stated values.
//!
//! The error of the pixel size enters V and also affects the contacts of the sample. The pixel size
//! is not updated, but its covariance with x is kept. It is -K s σ², with the Kalman gain K, the
//! derivatives s of ln F by ln a and the variance σ² of the size (Schmidt's filter: 1966, Adv.
//! Control Syst. 3, 293).
use super::{KnownBall, is_known, is_positive};
use crate::core::{Estimate, Source};
use crate::elasticity::contact::{Bond, Layer, Waveguide};
use crate::elasticity::laws::{ContactLaw, ContactLength, LogForce, RigidBallLaw, WaveguideLaw};
use crate::elasticity::modulus::Bodies;
use crate::pipeline::assumptions::CheckedGuide;
use crate::pipeline::contact::ContactReading;
use crate::pipeline::settings::Settings;
use nalgebra::{DMatrix, DVector};

/// The layers after the presses.
pub(super) struct UpdatedGuide {
    pub checked: CheckedGuide,
    pub layers: Waveguide,
    pub covariance: DMatrix<f64>,
    /// Covariances of the parameters with the logarithm of measured lengths.
    pub with_length: DVector<f64>,
}

/// A contact radius of a known ball under a known force.
#[derive(Clone, Copy, Debug)]
pub(super) struct GuideCheck {
    ball: KnownBall,
    known_n: Estimate,
    /// Contact radius. Its error is the part specific to this contact.
    radius_m: Estimate,
}

/// A press is rejected if it contradicts the stated values by more than this number of standard
/// errors.
const LARGEST_DEVIATION: f64 = 4.0;

/// The update has converged if x changes by less than this: a hundredth of any error of the layers.
const SETTLED: f64 = 1e-5;

/// Maximum number of iterations. The update is nearly linear in x and converges in three or four.
const MOST_ROUNDS: usize = 10;

/// Step of the finite differences. It is negative because ν is at most ½.
const STEP: f64 = -1e-3;

impl GuideCheck {
    pub(super) fn new(
        contact: &ContactReading,
        known_n: Estimate,
        ball: KnownBall,
    ) -> Result<Self, &'static str> {
        if !is_positive(ball.radius_m) || !ball.youngs_modulus_pa.is_none_or(is_positive) {
            return Err("the ball's radius and modulus must be positive numbers");
        }
        let poisson = ball.poisson_ratio;
        if !(is_known(poisson) && poisson.value > -1.0 && poisson.value <= 0.5) {
            return Err("the ball's Poisson's ratio must be above -1 and at most 0.5");
        }
        Ok(Self {
            ball,
            known_n,
            radius_m: contact.contact_radius_m.total(),
        })
    }

    /// ln F at the measured radius for these layers.
    fn log_force(&self, layers: &[Layer]) -> Option<PressForce> {
        self.ball.log_force(layers, self.radius_m.value)
    }

    /// Errors of ln F that presses of this ball share.
    fn ball_errors(&self, layers: &[Layer], here: &PressForce) -> Option<[f64; 3]> {
        let beside = |ball: KnownBall| {
            let there = ball.log_force(layers, self.radius_m.value)?;
            Some((there.value - here.value) / STEP)
        };
        let radius = here.size_slope * self.ball.radius_m.relative_error();
        let Some(modulus) = self.ball.youngs_modulus_pa else {
            return Some([radius, 0.0, 0.0]);
        };
        let softer = Estimate::new(modulus.value * STEP.exp(), modulus.standard_error);
        let by_modulus = beside(KnownBall {
            youngs_modulus_pa: Some(softer),
            ..self.ball
        })?;
        let poisson = self.ball.poisson_ratio;
        let lower = Estimate::new(poisson.value + STEP, poisson.standard_error);
        let by_poisson = beside(KnownBall {
            poisson_ratio: lower,
            ..self.ball
        })?;
        Some([
            radius,
            by_modulus * modulus.relative_error(),
            by_poisson * poisson.standard_error,
        ])
    }
}

impl KnownBall {
    /// The contact law of an elastic ball on layers.
    fn law(&self, layers: &[Layer]) -> Option<WaveguideLaw> {
        let guide = Waveguide::new(layers.to_vec()).ok()?;
        let (radius, poisson) = (self.radius_m.value, self.poisson_ratio.value);
        WaveguideLaw::new(radius, poisson, &guide, Bond::Bonded).ok()
    }

    /// ln F of a contact of radius a (m), with its derivatives in ln a and ln R.
    fn log_force(&self, layers: &[Layer], a: f64) -> Option<PressForce> {
        let Some(modulus) = self.youngs_modulus_pa else {
            let guide = Waveguide::new(layers.to_vec()).ok()?;
            let law = RigidBallLaw::new(&guide, [a; 2]).ok()?;
            let (radius_m, step) = (self.radius_m.value, STEP.exp());
            let here = law.log_force(radius_m, a);
            let slope = |there: LogForce| (there.value() - here.value()) / STEP;
            return Some(PressForce {
                value: here.value(),
                slope: slope(law.log_force(radius_m, a * step)),
                size_slope: slope(law.log_force(radius_m * step, a)),
                law_error: here.error(),
            });
        };
        let compliance = |modulus: f64, poisson: f64| (1.0 - poisson * poisson) / modulus;
        let own = compliance(modulus.value, self.poisson_ratio.value);
        let top = layers.first()?;
        let touched = compliance(top.youngs_modulus_pa, top.poisson_ratio);
        let share = touched / (touched + own);
        let law = self.law(layers)?;
        let force = law.log_force(ContactLength::Radius(a), share).at()?;
        let [slope, size_slope] = force.slopes()?;
        Some(PressForce {
            value: force.value() - (touched + own).ln(),
            slope,
            size_slope,
            law_error: force.error(),
        })
    }
}

/// ln F of a press according to a law.
#[derive(Debug)]
struct PressForce {
    value: f64,
    /// Derivative in ln a.
    slope: f64,
    /// Derivative in ln R.
    size_slope: f64,
    /// Standard error of ln F because of the law itself.
    law_error: f64,
}

/// ln F of all presses on these layers.
fn log_forces(checks: &[GuideCheck], layers: &[Layer]) -> Option<Vec<PressForce>> {
    let forces = checks.iter().map(|check| check.log_force(layers));
    forces.collect()
}

/// Covariance of ln F of all presses from all sources except the layers, at the stated layers.
fn noise(
    checks: &[GuideCheck],
    layers: &[Layer],
    forces: &[PressForce],
    length_scale: f64,
) -> Option<DMatrix<f64>> {
    let mut noise = DMatrix::zeros(checks.len(), checks.len());
    let balls = checks.iter().zip(forces);
    let balls = balls.map(|(check, force)| check.ball_errors(layers, force));
    let balls: Vec<[f64; 3]> = balls.collect::<Option<_>>()?;
    for (i, first) in checks.iter().enumerate() {
        let force = first.known_n.relative_error();
        for (j, second) in checks.iter().enumerate() {
            // Shared errors: pixel size, law and weights.
            noise[(i, j)] = forces[i].slope * forces[j].slope * length_scale * length_scale
                + forces[i].law_error * forces[j].law_error
                + force * second.known_n.relative_error();
            if first.ball == second.ball {
                let products = balls[i].iter().zip(&balls[j]).map(|(a, b)| a * b);
                noise[(i, j)] += products.sum::<f64>();
            }
        }
        // Whether the weights share an error is unknown, so it is also counted as independent.
        let own = forces[i].slope * first.radius_m.relative_error();
        noise[(i, i)] += own * own + force * force;
    }
    Some(noise)
}

/// The layers and their covariance after the presses, or the index of an unusable press and the
/// reason.
pub(super) fn update(
    checks: &[GuideCheck],
    settings: &Settings,
) -> Result<UpdatedGuide, (usize, &'static str)> {
    let guide = settings.waveguide.as_ref();
    let stated = guide.map_or(&[][..], Waveguide::layers);
    if stated.is_empty() {
        let rigid = "the guide is rigid compared with the ball: it has no layers to check";
        return Err((0, rigid));
    }
    let unsolved = (
        0,
        "the contact of the ball with the stated layers cannot be solved",
    );
    let prior = settings.layer_covariance();
    let forces = log_forces(checks, stated).ok_or(unsolved)?;
    let noise = noise(
        checks,
        stated,
        &forces,
        settings.assumptions.error(Source::PixelSize),
    )
    .ok_or(unsolved)?;
    let known = checks.iter().map(|check| check.known_n.value.ln());
    let log_known = DVector::from_iterator(checks.len(), known);
    let mut x = DVector::zeros(prior.nrows());
    let mut covariance = prior.clone();
    // Covariance from earlier presses.
    let earlier = settings.layers_with_length.clone();
    let earlier = earlier.unwrap_or_else(|| DVector::zeros(prior.nrows()));
    let mut with_length = earlier.clone();
    let by_length = forces.iter().map(|force| force.slope);
    let by_length = DVector::from_iterator(checks.len(), by_length);
    let predicted = |x: &DVector<f64>| -> Option<Vec<f64>> {
        let forces = log_forces(checks, &Layer::stepped(stated, x))?;
        Some(forces.iter().map(|force| force.value).collect())
    };
    for round in 0..MOST_ROUNDS {
        let here = predicted(&x).ok_or(unsolved)?;
        let moves = |k: usize| prior[(k, k)] > 0.0;
        let slopes = Layer::slopes(&here, &x, moves, predicted).ok_or(unsolved)?;
        let gap = &log_known - DVector::from_vec(here);
        let whole = &slopes * &prior * slopes.transpose() + &noise;
        if round == 0 {
            let deviations = gap.component_div(&whole.diagonal().map(f64::sqrt)).abs();
            if deviations.max() > LARGEST_DEVIATION {
                return Err((
                    deviations.imax(),
                    "its contact radius contradicts the stated layers and ball by more than four \
                     standard errors",
                ));
            }
        }
        let inverse = whole.cholesky().ok_or(unsolved)?.inverse();
        let gain = &prior * slopes.transpose() * inverse;
        let next = &gain * (gap + &slopes * &x);
        // Joseph's form stays positive definite if a parameter is exact.
        let left = DMatrix::identity(x.len(), x.len()) - &gain * &slopes;
        covariance = &left * &prior * left.transpose() + &gain * &noise * gain.transpose();
        let (kept, moved_by_length) = (&left * &earlier, &gain * &by_length);
        let crossed = &kept * moved_by_length.transpose();
        covariance -= &crossed + crossed.transpose();
        with_length =
            kept - moved_by_length * settings.assumptions.error(Source::PixelSize).powi(2);
        let moved = (&next - &x).amax();
        x = next;
        if moved < SETTLED {
            break;
        }
    }
    let layers = Layer::stepped(stated, &x);
    let sum: f64 = checks.iter().map(|check| check.radius_m.value).sum();
    let mean_m = sum / checks.len() as f64;
    let stiffness = |layers: &[Layer]| Layer::log_stiffness(layers, mean_m).ok_or(unsolved);
    let ratio = (stiffness(&layers)? - stiffness(stated)?).exp();
    let layers = Waveguide::new(layers).map_err(|_| unsolved)?;
    let bodies = Bodies::new(settings.object, Some(layers.clone()))
        .with_layer_errors(covariance.clone(), None)
        .map_err(|_| unsolved)?;
    let factor = bodies.guide_compliance(mean_m);
    // Earlier presses moved the layers from their stated values.
    let earlier = settings.checked_guide;
    let ratio = ratio * earlier.map_or(1.0, |earlier| earlier.stiffness.value);
    let checked = CheckedGuide {
        stiffness: Estimate::new(ratio, ratio * factor.standard_error()),
        presses: checks.len() + earlier.map_or(0, |earlier| earlier.presses),
    };
    Ok(UpdatedGuide {
        checked,
        layers,
        covariance,
        with_length,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hard_ball_with_a_small_contact_is_a_rigid_one() {
        let gel = Layer {
            thickness_m: 10e-3,
            youngs_modulus_pa: 75e3,
            poisson_ratio: 0.5,
        };
        let radius_m = Estimate::exact(10e-3);
        let rigid = KnownBall::rigid(radius_m);
        let hard = KnownBall::elastic(radius_m, Estimate::exact(200e9));
        let [rigid, hard] = [rigid, hard].map(|ball| ball.log_force(&[gel], 0.3e-3).unwrap());
        // The effect of finite strain is proportional to a/R: a few thousandths here.
        assert!(
            (rigid.value - hard.value).abs() < 5e-3,
            "{rigid:?} {hard:?}"
        );
        assert!(
            (rigid.slope - hard.slope).abs() < 1e-2,
            "{rigid:?} {hard:?}"
        );
    }

    /// Layers and pixel size are both misstated: the remaining error of the layers has the stated
    /// correlation with that of the pixel size.
    #[test]
    fn layers_err_with_the_pixels_that_checked_them() {
        use crate::pipeline::Object;
        use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
        use rand_distr::StandardNormal;
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut normal = || -> f64 { rng.sample(StandardNormal) };
        let gel = |youngs_modulus_pa| Layer {
            thickness_m: 10e-3,
            youngs_modulus_pa,
            poisson_ratio: 0.5,
        };
        let (truth_pa, a) = (75e3, 2e-3);
        let ball = KnownBall::rigid(Estimate::exact(20e-3));
        let known_n = ball.log_force(&[gel(truth_pa)], a).unwrap().value.exp();
        let (draws, mut sum, mut stated) = (400, 0.0, 0.0);
        for _ in 0..draws {
            let length_error = 3e-3 * normal();
            let mut settings = Settings::new(Object::sphere(3e-3));
            let wrong = gel(truth_pa * (0.05 * normal()).exp());
            settings.waveguide = Some(Waveguide::new(vec![wrong]).unwrap());
            let check = GuideCheck {
                ball,
                known_n: Estimate::new(known_n, 1e-3 * known_n),
                radius_m: Estimate::exact(a * (1.0 + length_error)),
            };
            let updated = update(&[check], &settings).unwrap();
            let left = updated.layers.layers()[0].youngs_modulus_pa / truth_pa;
            sum += left.ln() * length_error;
            stated += updated.with_length[0];
        }
        // A covariance from this number of draws is known to 7 %, because both errors are nearly
        // proportional.
        assert!((sum / stated - 1.0).abs() < 0.2, "{sum} {stated}");
    }
}
