//! Contact laws F = E* f(x), with x the contact radius or the indentation. There is one file per
//! law.
//!
//! | law | contact |
//! |---|---|
//! | [`HertzLaw`] | ball on a half-space, small contact |
//! | [`PunchLaw`] | flat punch on a half-space |
//! | [`ConeLaw`] | cone on a half-space |
//! | [`LayerLaw`] | ball on one layer, which is the sample |
//! | [`WaveguideLaw`] | soft ball, the sample, on the layers of a guide at finite strain |
//! | [`RigidBallLaw`] | rigid balls on the layers of a guide, which they calibrate |
//!
//! [`ContactEstimator`](crate::modulus::ContactEstimator) turns a law into a modulus with its error.

mod cone;
mod finite_strain;
mod hertz;
mod layer;
mod punch;
mod rigid_ball;
mod waveguide;

pub use cone::ConeLaw;
pub use hertz::HertzLaw;
pub use layer::LayerLaw;
pub use punch::PunchLaw;
pub use rigid_ball::RigidBallLaw;
pub use waveguide::WaveguideLaw;

use std::ops::Deref;

/// The measured length of a contact, in metres.
///
/// ```
/// use tactile_elasticity::laws::ContactLength;
///
/// assert_eq!(ContactLength::Radius(1e-3).metres(), ContactLength::Indentation(1e-3).metres());
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum ContactLength {
    /// The contact radius a.
    Radius(f64),
    /// The indentation δ, the approach of the two bodies.
    Indentation(f64),
}

impl ContactLength {
    /// The length in metres, of either kind.
    pub const fn metres(self) -> f64 {
        match self {
            Self::Radius(x) | Self::Indentation(x) => x,
        }
    }

    /// Multiplies the length by a factor.
    fn times(self, factor: f64) -> Self {
        match self {
            Self::Radius(x) => Self::Radius(x * factor),
            Self::Indentation(x) => Self::Indentation(x * factor),
        }
    }
}

/// ln f = ln(F/E*) of a contact, with further properties that a law may state.
///
/// ```
/// use tactile_elasticity::laws::LogForce;
///
/// // ln f alone: slopes are computed by differences.
/// let hertz = |a: f64| LogForce::new((4.0 / 3.0 * a.powi(3) / 5e-3).ln());
/// // With its slopes in ln a and in ln R, and an accuracy of 1 %.
/// let stated = hertz(1e-3).with_slopes(3.0, -1.0).with_error(0.01);
/// assert_ne!(hertz(1e-3), stated);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LogForce {
    value: f64,
    /// Slopes in ln x and in ln R.
    slopes: Option<[f64; 2]>,
    sample_part: Option<f64>,
    error: f64,
}

impl LogForce {
    /// Creates the value from ln f. Its slope in ln x is computed by evaluating the law next to the
    /// length. Its slope in ln R, with R the size of the indenter, is 2 minus that slope, because f
    /// has the dimension of an area. A law with more lengths than x and R must state its slopes.
    pub const fn new(value: f64) -> Self {
        Self {
            value,
            slopes: None,
            sample_part: None,
            error: 0.0,
        }
    }

    /// States d ln f/d ln x and d ln f/d ln R, with R the size of the indenter.
    #[must_use]
    pub const fn with_slopes(mut self, slope: f64, size_slope: f64) -> Self {
        self.slopes = Some([slope, size_slope]);
        self
    }

    /// States the sample's part of the contact's compliance, if it is not 1 − share: on a layer
    /// that is not deep.
    #[must_use]
    pub const fn with_sample_part(mut self, sample_part: f64) -> Self {
        self.sample_part = Some(sample_part);
        self
    }

    /// States the standard error of ln F due to the law itself, common to all loads of one size.
    #[must_use]
    pub const fn with_error(mut self, error: f64) -> Self {
        self.error = error;
        self
    }

    /// ln f.
    pub const fn value(&self) -> f64 {
        self.value
    }

    /// Slopes in ln x and ln R. `None` if the law does not state them.
    pub const fn slopes(&self) -> Option<[f64; 2]> {
        self.slopes
    }

    /// The sample's part of the compliance. `None` if the law does not state it.
    pub const fn sample_part(&self) -> Option<f64> {
        self.sample_part
    }

    /// Standard error of ln F due to the law itself.
    pub const fn error(&self) -> f64 {
        self.error
    }

    /// Adds a correction to the value and the slopes.
    fn corrected(self, value: f64, slope: f64, size_slope: f64) -> Self {
        Self {
            value: self.value + value,
            slopes: self.slopes.map(|[x, size]| [x + slope, size + size_slope]),
            ..self
        }
    }
}

/// Result of a law for a length.
///
/// ```
/// use tactile_elasticity::laws::{ContactLaw, ContactLength, HertzLaw, PunchLaw, Reach};
///
/// let radius = ContactLength::Radius(1e-3);
/// assert!(matches!(HertzLaw::new(5e-3)?.log_force(radius, 0.0), Reach::At(_)));
/// // The radius of a punch does not depend on the force.
/// assert_eq!(PunchLaw::new(5e-3)?.log_force(radius, 0.0), Reach::NotMine);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Reach {
    /// ln f at this length.
    At(LogForce),
    /// The length is outside the range of the law.
    Beyond,
    /// The force does not depend on this kind of length, or the law has no formula for it.
    NotMine,
}

impl Reach {
    /// ln f at this length. `None` if the law gives none.
    pub fn at(self) -> Option<LogForce> {
        match self {
            Self::At(log_force) => Some(log_force),
            Self::Beyond | Self::NotMine => None,
        }
    }
}

impl From<Option<LogForce>> for Reach {
    /// Treats `None` as outside the range of the law.
    fn from(found: Option<LogForce>) -> Self {
        found.map_or(Self::Beyond, Self::At)
    }
}

/// Range of contacts for which a law is valid. Outside it, an estimate carries a warning.
///
/// ```
/// use tactile_elasticity::laws::Limits;
///
/// let limits = Limits::of_ball(5e-3, 0.3);
/// assert_eq!((limits.radius_m, limits.contact_ratio), (Some(5e-3), 0.3));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Limits {
    /// R for laws with a radius. The diagnostics of every load then contain a/R.
    pub radius_m: Option<f64>,
    /// The largest valid a/R.
    pub contact_ratio: f64,
    /// For laws of the guide's layers, whose E* is that of the sample and the touched layer: their
    /// thickness h (m) and the largest valid a/h.
    pub layers: Option<[f64; 2]>,
}

impl Default for Limits {
    /// No radius and no limit.
    fn default() -> Self {
        Self {
            radius_m: None,
            contact_ratio: f64::INFINITY,
            layers: None,
        }
    }
}

impl Limits {
    /// Limits of a ball with radius R (m), up to this a/R.
    pub fn of_ball(radius_m: f64, contact_ratio: f64) -> Self {
        Self {
            radius_m: Some(radius_m),
            contact_ratio,
            layers: None,
        }
    }

    /// Limits of a law of layers with thickness h (m), up to this a/h.
    ///
    /// ```
    /// use tactile_elasticity::laws::Limits;
    /// let limits = Limits::of_ball(5e-3, 0.3).with_layers(10e-3, 1.6);
    /// assert_eq!(limits.layers, Some([10e-3, 1.6]));
    /// ```
    #[must_use]
    pub fn with_layers(mut self, thickness_m: f64, contact_ratio: f64) -> Self {
        self.layers = Some([thickness_m, contact_ratio]);
        self
    }

    /// a/R. If only the indentation is known, it follows from Hertz's a² = Rδ.
    pub(crate) fn ratio(
        &self,
        contact_radius_m: Option<f64>,
        indentation_m: Option<f64>,
    ) -> Option<f64> {
        let radius = self.radius_m?;
        contact_radius_m
            .or_else(|| indentation_m.map(|d| (radius * d).sqrt()))
            .map(|a| a / radius)
    }
}

/// A law F = E* f(x) of a contact, with x the contact radius or the indentation. A user-defined law
/// implements [`log_force`](Self::log_force) and is passed to
/// [`ContactEstimator::from_law`](crate::modulus::ContactEstimator::from_law).
///
/// `share` is the other body's part of 1/E*, in [0, 1], and 0 if it is rigid. Most laws do not
/// depend on it. A boxed or shared law also implements the trait.
pub trait ContactLaw: Send + Sync {
    /// ln f for a positive length.
    fn log_force(&self, length: ContactLength, share: f64) -> Reach;

    /// The range of valid contacts. By default there is no limit and no radius.
    fn limits(&self) -> Limits {
        Limits::default()
    }
}

/// Implements the trait for boxed, shared and borrowed laws.
impl<P: Deref<Target: ContactLaw> + Send + Sync> ContactLaw for P {
    fn log_force(&self, length: ContactLength, share: f64) -> Reach {
        (**self).log_force(length, share)
    }

    fn limits(&self) -> Limits {
        (**self).limits()
    }
}

// Half the step in ln x of the numerical slope. The third derivative leaves a relative error of
// 10⁻⁸, rounding one of 10⁻¹¹.
const HALF_STEP: f64 = 1e-4;

/// Slopes of ln f in ln x and ln R: the stated ones, or differences. `None` if the law is not
/// defined on both sides.
pub(crate) fn slopes<L: ContactLaw + ?Sized>(
    law: &L,
    length: ContactLength,
    share: f64,
    at: &LogForce,
) -> Option<[f64; 2]> {
    if at.slopes.is_some() {
        return at.slopes;
    }
    let beside = |step: f64| {
        let found = law.log_force(length.times(step.exp()), share).at()?;
        Some(found.value)
    };
    let slope = match [-HALF_STEP, HALF_STEP].map(beside) {
        [Some(below), Some(above)] => (above - below) / (2.0 * HALF_STEP),
        [Some(below), None] => (at.value - below) / HALF_STEP,
        [None, Some(above)] => (above - at.value) / HALF_STEP,
        [None, None] => return None,
    };
    Some([slope, 2.0 - slope])
}
