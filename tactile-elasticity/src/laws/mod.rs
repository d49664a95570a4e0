//! Contact laws F = E* f(x), x the contact radius or the indentation: one file a law.
//!
//! | law | contact |
//! |---|---|
//! | [`HertzLaw`] | ball on a half-space, small contact |
//! | [`PunchLaw`] | flat punch on a half-space |
//! | [`ConeLaw`] | cone on a half-space |
//! | [`LayerLaw`] | ball on one layer, which is the sample |
//! | [`WaveguideLaw`] | soft ball, the sample, on the layers of a guide at finite strain |
//!
//! [`ContactEstimator`](crate::modulus::ContactEstimator) turns a law into a modulus with its error.

mod cone;
mod finite_strain;
mod hertz;
mod layer;
mod punch;
mod waveguide;

pub use cone::ConeLaw;
pub use hertz::HertzLaw;
pub use layer::LayerLaw;
pub use punch::PunchLaw;
pub use waveguide::WaveguideLaw;

use std::ops::Deref;

/// What was measured of a contact, in metres.
///
/// ```
/// use tactile_elasticity::laws::ContactLength;
///
/// assert_eq!(ContactLength::Radius(1e-3).metres(), ContactLength::Indentation(1e-3).metres());
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ContactLength {
    /// The contact radius a.
    Radius(f64),
    /// The indentation δ, the approach of the two bodies.
    Indentation(f64),
}

impl ContactLength {
    /// The length, whichever it is.
    pub const fn metres(self) -> f64 {
        match self {
            Self::Radius(x) | Self::Indentation(x) => x,
        }
    }

    /// The same length times a factor.
    fn times(self, factor: f64) -> Self {
        match self {
            Self::Radius(x) => Self::Radius(x * factor),
            Self::Indentation(x) => Self::Indentation(x * factor),
        }
    }
}

/// ln f = ln(F/E*) of a contact, with what the law adds to it.
///
/// ```
/// use tactile_elasticity::laws::LogForce;
///
/// // ln f alone: slopes are found by differences.
/// let hertz = |a: f64| LogForce::new((4.0 / 3.0 * a.powi(3) / 5e-3).ln());
/// // With its slopes in ln a and in ln R, and good to 1 %.
/// let stated = hertz(1e-3).with_slopes(3.0, -1.0).with_error(0.01);
/// assert_ne!(hertz(1e-3), stated);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LogForce {
    value: f64,
    /// In ln x and in ln R.
    slopes: Option<[f64; 2]>,
    sample_part: Option<f64>,
    error: f64,
}

impl LogForce {
    /// ln f. Its slopes are found by differences: in ln x by evaluating the law beside the length,
    /// in the logarithm of the indenter's size R as 2 less that, for f has the dimension of an
    /// area. A law with more lengths than x and R states them.
    pub const fn new(value: f64) -> Self {
        Self {
            value,
            slopes: None,
            sample_part: None,
            error: 0.0,
        }
    }

    /// With d ln f/d ln x and d ln f/d ln R, R the size of the indenter.
    #[must_use]
    pub const fn with_slopes(mut self, slope: f64, size_slope: f64) -> Self {
        self.slopes = Some([slope, size_slope]);
        self
    }

    /// With the sample's part of the contact's compliance, where it is not 1 − share: on a layer
    /// that is not deep.
    #[must_use]
    pub const fn with_sample_part(mut self, sample_part: f64) -> Self {
        self.sample_part = Some(sample_part);
        self
    }

    /// With the standard error of ln F that is the law's own, the same at every load of one size.
    #[must_use]
    pub const fn with_error(mut self, error: f64) -> Self {
        self.error = error;
        self
    }

    /// ln f.
    pub const fn value(&self) -> f64 {
        self.value
    }

    /// Slopes in ln x and ln R, where they are stated.
    pub const fn slopes(&self) -> Option<[f64; 2]> {
        self.slopes
    }

    /// The sample's part of the compliance, where it is stated.
    pub const fn sample_part(&self) -> Option<f64> {
        self.sample_part
    }

    /// Standard error of ln F that is the law's own.
    pub const fn error(&self) -> f64 {
        self.error
    }

    /// With a correction, and what it adds to the slopes.
    fn corrected(self, value: f64, slope: f64, size_slope: f64) -> Self {
        Self {
            value: self.value + value,
            slopes: self.slopes.map(|[x, size]| [x + slope, size + size_slope]),
            ..self
        }
    }
}

/// What a law has to say of a length.
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
pub enum Reach {
    /// ln f there.
    At(LogForce),
    /// The law does not reach so far.
    Beyond,
    /// The force does not depend on this length, or the law has no formula for it.
    NotMine,
}

impl Reach {
    /// ln f there.
    pub fn at(self) -> Option<LogForce> {
        match self {
            Self::At(log_force) => Some(log_force),
            Self::Beyond | Self::NotMine => None,
        }
    }
}

impl From<Option<LogForce>> for Reach {
    /// `None` is beyond the law.
    fn from(found: Option<LogForce>) -> Self {
        found.map_or(Self::Beyond, Self::At)
    }
}

/// For which contacts a law is meant: beyond, an estimate carries a warning.
///
/// ```
/// use tactile_elasticity::laws::Limits;
///
/// let limits = Limits::of_ball(5e-3, 0.3);
/// assert_eq!((limits.radius_m, limits.contact_ratio), (Some(5e-3), 0.3));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// R, of a law with a radius: a/R stands in the diagnostics of every load.
    pub radius_m: Option<f64>,
    /// The largest a/R.
    pub contact_ratio: f64,
    /// Of a law of the guide's layers, whose E* is that of the sample and of the touched layer:
    /// their thickness h (m) and the largest a/h.
    pub layers: Option<[f64; 2]>,
}

impl Default for Limits {
    /// No radius, no limit.
    fn default() -> Self {
        Self {
            radius_m: None,
            contact_ratio: f64::INFINITY,
            layers: None,
        }
    }
}

impl Limits {
    /// Of a ball of radius R (m), up to this a/R.
    pub fn of_ball(radius_m: f64, contact_ratio: f64) -> Self {
        Self {
            radius_m: Some(radius_m),
            contact_ratio,
            layers: None,
        }
    }

    /// a/R. By Hertz's a² = Rδ where the indentation alone is known.
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

/// A law F = E* f(x) of a contact, x the contact radius or the indentation. A law of one's own
/// implements [`log_force`](Self::log_force) and goes into
/// [`ContactEstimator::from_law`](crate::modulus::ContactEstimator::from_law).
///
/// `share` is the other body's part of 1/E*, in [0, 1]: 0 where it is rigid. Most laws do not
/// depend on it. A boxed or shared law is a law as well.
pub trait ContactLaw: Send + Sync {
    /// ln f of a length that is above zero.
    fn log_force(&self, length: ContactLength, share: f64) -> Reach;

    /// For which contacts the law is meant. By default all, without a radius.
    fn limits(&self) -> Limits {
        Limits::default()
    }
}

/// Boxed, shared and borrowed laws.
impl<P: Deref<Target: ContactLaw> + Send + Sync> ContactLaw for P {
    fn log_force(&self, length: ContactLength, share: f64) -> Reach {
        (**self).log_force(length, share)
    }

    fn limits(&self) -> Limits {
        (**self).limits()
    }
}

// Half the step in ln x of the numerical slope: the third derivative leaves 10⁻⁸ of it, rounding
// 10⁻¹¹.
const HALF_STEP: f64 = 1e-4;

/// Slopes of ln f in ln x and ln R: those stated, or by differences. `None` where the law does not
/// reach on either side.
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
