//! Presses of known force besides the frames: they check the current state of the sensor and its
//! guide.
mod gain;
mod guide;

use super::contact::ContactReading;
use super::error::PipelineError;
use super::pipeline::Pipeline;
use super::specimen::Object;
use crate::core::{Estimate, Source};
use gain::GainCheck;
use guide::GuideCheck;
use ndarray::ArrayView2;

/// A ball of known radius and modulus.
///
/// ```
/// use tactile_imaging::{force::Estimate, pipeline::KnownBall};
/// let steel = KnownBall::rigid(Estimate::new(10e-3, 5e-6));
/// assert!(steel.youngs_modulus_pa.is_none());
/// let silicone = KnownBall::elastic(Estimate::new(3e-3, 5e-6), Estimate::new(62e3, 1e3));
/// assert_eq!(silicone.poisson_ratio.value, 0.5);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct KnownBall {
    /// Radius in metres.
    pub radius_m: Estimate,
    /// Young's modulus in pascals. `None` for a rigid ball.
    pub youngs_modulus_pa: Option<Estimate>,
    /// Poisson ratio, used for an elastic ball.
    pub poisson_ratio: Estimate,
}

impl KnownBall {
    /// A ball much stiffer than the guide.
    #[must_use]
    pub const fn rigid(radius_m: Estimate) -> Self {
        Self {
            radius_m,
            youngs_modulus_pa: None,
            poisson_ratio: Estimate::exact(0.5),
        }
    }

    /// An incompressible ball whose Poisson ratio is known to 0.01.
    #[must_use]
    pub const fn elastic(radius_m: Estimate, youngs_modulus_pa: Estimate) -> Self {
        Self {
            radius_m,
            youngs_modulus_pa: Some(youngs_modulus_pa),
            poisson_ratio: Estimate::new(0.5, 0.01),
        }
    }

    /// A radius in metres. The default error is 0.5 %.
    #[must_use]
    pub fn radius(radius_m: f64, error_m: Option<f64>) -> Estimate {
        Estimate::new(radius_m, error_m.unwrap_or(0.5e-2 * radius_m))
    }

    /// A modulus in pascals. The default error is 2 %.
    #[must_use]
    pub fn modulus(modulus_pa: f64, error_pa: Option<f64>) -> Estimate {
        Estimate::new(modulus_pa, error_pa.unwrap_or(2e-2 * modulus_pa))
    }
}

/// The object of a press of known force.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum CheckedObject {
    /// The measured object: its light coupling is checked too.
    Sample,
    /// The object used for the calibration: the gain is checked, but not the coupling of the
    /// sample.
    Calibrator,
    /// A ball of known modulus: its contact radius checks the layers of the guide. Its light is not
    /// used.
    Ball(KnownBall),
}

/// A press of known force, before or after the frames, for
/// [`Pipeline::with_checks`].
#[derive(Clone, Copy, Debug)]
pub struct CheckPress<'a> {
    /// The image.
    pub frame: ArrayView2<'a, u8>,
    /// The force of the weight or gauge.
    pub known_n: Estimate,
    /// The pressed object.
    pub object: CheckedObject,
}

impl<'a> CheckPress<'a> {
    /// A press of an object with a known force.
    ///
    /// ```
    /// use tactile_imaging::{force::Estimate, pipeline::{CheckPress, CheckedObject}};
    /// let frame = ndarray::Array2::zeros((480, 640));
    /// let weight_n = Estimate::new(0.981, 1e-3);
    /// let check = CheckPress::new(frame.view(), weight_n, CheckedObject::Sample);
    /// assert_eq!(check.object, CheckedObject::Sample);
    /// ```
    #[must_use]
    pub const fn new(frame: ArrayView2<'a, u8>, known_n: Estimate, object: CheckedObject) -> Self {
        Self {
            frame,
            known_n,
            object,
        }
    }

    /// A force in newtons. The default error is 0.2 %.
    #[must_use]
    pub fn force(force_n: f64, error_n: Option<f64>) -> Estimate {
        Estimate::new(force_n, error_n.unwrap_or(0.2e-2 * force_n))
    }
}

impl Pipeline {
    /// Applies presses of known force. Presses of the sample or the calibrator correct the gain of
    /// the light ([`CheckedGain`](super::CheckedGain)); presses of balls of known modulus correct
    /// the layers of the guide ([`CheckedGuide`](super::CheckedGuide)). All use the same reference.
    /// Within one call, the errors common to the presses (pixel size, contact law, ball) are
    /// treated as shared. Presses of a later call are treated as independent of earlier ones,
    /// except for the pixel size. A ball costs several dozen solutions of its contact.
    ///
    /// ```
    /// use tactile_imaging::force::{CalibrationPair, Estimate};
    /// use tactile_imaging::pipeline::{CheckPress, CheckedObject, Object, Pipeline};
    /// let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
    /// let hertz = |peak: f64| ndarray::Array2::from_shape_fn((64, 64), |(r, c)| {
    ///     let d = ((r as f64 - 32.0).hypot(c as f64 - 32.0) / 20.0).min(1.0);
    ///     10 + (peak * (1.0 - d * d).sqrt()).round() as u8
    /// });
    /// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
    /// let (reference, frame) = (hertz(0.0), hertz(120.0));
    /// // A weight of 1.117 N gives the light of 1.005 N: the lamps are a tenth darker.
    /// let weight_n = Estimate::new(1.117, 1e-3);
    /// let check = CheckPress::new(frame.view(), weight_n, CheckedObject::Sample);
    /// let pipeline = pipeline.with_checks(reference.view(), &[check])?;
    /// let gain = pipeline.settings().checked_gain.expect("a gain").gain;
    /// assert!((gain.value / 0.9 - 1.0).abs() < 0.01);
    /// let mut press = pipeline.press(reference.view())?;
    /// press.add_frame(frame.view());
    /// let force = press.contact(0)?.and_then(|contact| contact.force_n).expect("a force");
    /// assert!((force.value / 1.117 - 1.0).abs() < 1e-6 && force.relative_error() < 0.01);
    /// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
    /// ```
    ///
    /// # Errors
    /// [`PipelineError::Check`] for a press that shows no contact, is unreliable, has unphysical
    /// known values, contradicts the sensor or the stated layers, or is of a ball although the
    /// guide has no layers. Also the errors of a [`Press`](super::Press)'s contact.
    pub fn with_checks(
        self,
        reference: ArrayView2<'_, u8>,
        checks: &[CheckPress<'_>],
    ) -> Result<Self, PipelineError> {
        let (mut gains, mut guides, mut balls) = (Vec::new(), Vec::new(), Vec::new());
        for (press, check) in checks.iter().enumerate() {
            let refused = |reason| PipelineError::Check { press, reason };
            if !is_positive(check.known_n) {
                return Err(refused("its force must be a positive number"));
            }
            let contact = self.checked_contact(reference, check)?;
            let contact = contact.ok_or(refused("it shows no contact"))?;
            trusted(&contact).map_err(refused)?;
            match check.object {
                CheckedObject::Ball(ball) => {
                    guides.push(GuideCheck::new(&contact, check.known_n, ball).map_err(refused)?);
                    balls.push(press);
                }
                object => {
                    gains.push(GainCheck::new(&contact, check.known_n, object).map_err(refused)?)
                }
            }
        }
        let mut pipeline = self;
        if !gains.is_empty() {
            let coupling = pipeline.settings().assumptions.error(Source::Coupling);
            let checked = gain::checked(&gains, coupling);
            pipeline = pipeline.with_settings(|settings| settings.checked_gain = Some(checked))?;
        }
        if !guides.is_empty() {
            let checked = guide::update(&guides, pipeline.settings());
            let updated = checked.map_err(|(ball, reason)| {
                let press = balls[ball];
                PipelineError::Check { press, reason }
            })?;
            pipeline = pipeline.with_settings(|settings| {
                settings.waveguide = Some(updated.layers);
                settings.layer_covariance = Some(updated.covariance);
                settings.layers_with_length = Some(updated.with_length);
                settings.checked_guide = Some(updated.checked);
            })?;
        }
        Ok(pipeline)
    }

    /// The contact of a check, with only its own errors.
    fn checked_contact(
        &self,
        reference: ArrayView2<'_, u8>,
        check: &CheckPress<'_>,
    ) -> Result<Option<ContactReading>, PipelineError> {
        let pipeline = self.clone().with_settings(|settings| {
            settings.checked_gain = None;
            // Errors common to all presses are counted once, with the checked parameter.
            settings.assumptions.state(Source::Coupling, 0.0);
            settings.assumptions.state(Source::Gain, 0.0);
            if let CheckedObject::Ball(ball) = check.object {
                settings.assumptions.state(Source::PixelSize, 0.0);
                settings.object = Object::Sphere {
                    radius_m: ball.radius_m.value,
                    poisson_ratio: ball.poisson_ratio.value,
                };
            }
        })?;
        let mut press = pipeline.press(reference)?;
        press.add_frame(check.frame);
        Ok(press.contact(0)?.copied())
    }
}

/// Whether a value and its error are numbers and the value is positive.
fn is_positive(estimate: Estimate) -> bool {
    estimate.value > 0.0 && is_known(estimate)
}

/// Whether a value and its error are numbers.
fn is_known(estimate: Estimate) -> bool {
    let error = estimate.standard_error;
    estimate.value.is_finite() && error >= 0.0 && error.is_finite()
}

/// Rejects a contact whose force and radius do not cover the whole object.
fn trusted(contact: &ContactReading) -> Result<(), &'static str> {
    let doubts = [
        (
            contact.touches_edge,
            "its contact is cut by the frame's edge",
        ),
        (contact.other_contacts > 0, "it shows several contacts"),
    ];
    match doubts.iter().find(|(doubted, _)| *doubted) {
        Some(&(_, reason)) => Err(reason),
        None => Ok(()),
    }
}
