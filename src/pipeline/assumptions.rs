//! Default errors of inputs, and what presses of known force reveal about the sensor.
use super::text::with_error;
use crate::core::{Estimate, InvalidOption, Requirement, Source};
use std::fmt::{self, Display, Formatter};

/// An input whose error has a default.
///
/// ```
/// use tactile_imaging::force::Source;
/// use tactile_imaging::pipeline::Assumption;
/// let light = Assumption::of(Source::Coupling).expect("it has a default");
/// assert_eq!((light.key, light.default), ("coupling_error", 0.12));
/// assert!(Assumption::of(Source::Noise).is_none(), "measured in the frames");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Assumption {
    /// Error source of the input.
    pub source: Source,
    /// The key of the input's error in a scene file. It is also the keyword in Python, apart from
    /// units.
    pub key: &'static str,
    /// The default standard error.
    pub default: f64,
    /// The unit of the default, and of [`Assumptions::state`].
    pub unit: &'static str,
    /// What reduces the error.
    pub remedy: &'static str,
}

impl Assumption {
    /// Every input with a default. To change a default, change it here.
    ///
    /// [`Source::Gain`]: the scale of the gauge, and uneven light over the frame, because of which
    /// contacts of another size than the calibration's have another gain. [`Source::Coupling`]: a
    /// bare guide scatters light according to the touching material, and the object may reflect
    /// differently from the calibrator. It is zero under a fixed diffusing skin, and for the
    /// calibrator itself. [`Source::ObjectSize`] is the error of the radius of a ball, a punch or
    /// an indenter. [`Source::Guide`] is not used if there is a covariance of the layers
    /// ([`Settings::layer_covariance`](field@crate::pipeline::Settings::layer_covariance)).
    pub const ALL: [Self; 7] = [
        Self {
            source: Source::Gain,
            key: "gauge_error",
            // A gauge accurate to 0.2 % and light uneven by 0.1 %: √(0.2² + 0.1²) %.
            default: 2.236_067_977_499_79e-3,
            unit: "of the force",
            remedy: "a better gauge, or a flat field",
        },
        Self {
            source: Source::Coupling,
            key: "coupling_error",
            // The allowance includes an object that reflects a fifth less than the calibrator.
            default: 0.12,
            unit: "of the force",
            remedy: "a press of this object under a known weight ([[check]])",
        },
        Self {
            source: Source::PixelSize,
            key: "pixel_size_error",
            default: 0.3e-2,
            unit: "of a length",
            remedy: "a frame of a target of known pitch",
        },
        Self {
            source: Source::ObjectSize,
            key: "radius_error_m",
            default: 0.5e-2,
            unit: "of the radius",
            remedy: "a calliper on the object (radius_error_m)",
        },
        Self {
            source: Source::PoissonRatio,
            key: "poisson_ratio_error",
            default: 0.01,
            unit: "",
            remedy: "its stated error (poisson_ratio_error)",
        },
        Self {
            source: Source::Adhesion,
            key: "adhesion_error_j_per_m2",
            // The value for a dusted ball. Clean dry silicone has several tens of mJ/m².
            default: 1e-3,
            unit: "J/m²",
            remedy: "larger forces, or talc and a stated adhesion_error_j_per_m2",
        },
        Self {
            source: Source::Guide,
            key: "layer_error",
            default: 0.05,
            unit: "of the moduli of all layers, by one factor",
            remedy: "a press of a ball of known radius and modulus ([[check]])",
        },
    ];

    /// The assumption for a source. `None` if the error of the source is measured.
    #[must_use]
    pub fn of(source: Source) -> Option<&'static Self> {
        const ALL: &[Assumption] = &Assumption::ALL;
        ALL.iter().find(|assumption| assumption.source == source)
    }
}

/// The standard errors of a pipeline's inputs: the stated ones, and the defaults of
/// [`Assumption::ALL`] for all others. Each is in the unit of its [`Assumption`].
///
/// ```
/// use tactile_imaging::force::Source;
/// use tactile_imaging::pipeline::Assumptions;
/// let mut errors = Assumptions::default();
/// // A ball of 3 mm, measured to 5 µm with a calliper.
/// errors.state(Source::ObjectSize, 5e-6 / 3e-3);
/// assert_eq!(errors.stated(Source::ObjectSize), Some(5e-6 / 3e-3));
/// assert_eq!((errors.stated(Source::Coupling), errors.error(Source::Coupling)), (None, 0.12));
/// assert_eq!(errors.error(Source::Noise), 0.0, "measured in the frames");
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Assumptions(Vec<(Source, f64)>);

impl Assumptions {
    /// States the standard error of a source.
    /// [`Pipeline::with_settings`](crate::pipeline::Pipeline::with_settings) rejects an error that
    /// is negative or not finite, and one of a source that is measured.
    pub fn state(&mut self, source: Source, error: f64) {
        self.forget(source);
        self.0.push((source, error));
    }

    /// Returns a source to its default error.
    pub fn forget(&mut self, source: Source) {
        self.0.retain(|(stated, _)| *stated != source);
    }

    /// Adopts all errors stated in `others`.
    pub(super) fn state_all(&mut self, others: &Self) {
        others
            .0
            .iter()
            .for_each(|&(source, error)| self.state(source, error));
    }

    /// The stated error of a source. `None` if the default applies.
    #[must_use]
    pub fn stated(&self, source: Source) -> Option<f64> {
        let found = self.0.iter().find(|(stated, _)| *stated == source);
        found.map(|&(_, error)| error)
    }

    /// The stated or default error of a source. Zero for a measured source.
    #[must_use]
    pub fn error(&self, source: Source) -> f64 {
        let assumed = || Assumption::of(source).map_or(0.0, |assumption| assumption.default);
        self.stated(source).unwrap_or_else(assumed)
    }

    pub(super) fn check(&self) -> Result<(), InvalidOption> {
        for &(source, error) in &self.0 {
            let Some(assumption) = Assumption::of(source) else {
                let expected = "sources whose errors are not measured in the frames";
                return Err(InvalidOption::new("assumptions", error, expected));
            };
            Requirement::NonNegative.check(assumption.key, error)?;
        }
        Ok(())
    }
}

/// The gain of the sensor according to presses of known force. Forces read from light are divided
/// by it, and its error replaces that of [`Source::Coupling`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct CheckedGain {
    /// Measured force over known force.
    pub gain: Estimate,
    /// Relative standard deviation of the gain between presses beyond their own errors. The error
    /// of the gain includes it, or 0.5 % if it is smaller.
    pub drift: f64,
    /// The number of presses.
    pub presses: usize,
}

impl Display for CheckedGain {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let gain = with_error(self.gain.value, self.gain.standard_error, 1.0);
        let s = if self.presses == 1 { "" } else { "es" };
        write!(
            f,
            "forces read from light are divided by {gain} ({} press{s} of known force)",
            self.presses
        )?;
        match self.drift {
            0.0 => Ok(()),
            drift => write!(f, ", which drifts by {:.1} %", 100.0 * drift),
        }
    }
}

/// The stiffness of the guide according to presses of balls of known modulus. The pipeline then
/// uses the updated layers and their covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct CheckedGuide {
    /// Stiffness of the guide for contacts of the presses' mean radius, relative to the stated
    /// value.
    pub stiffness: Estimate,
    /// The number of presses.
    pub presses: usize,
}

impl Display for CheckedGuide {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let stiffness = self.stiffness;
        let ratio = with_error(stiffness.value, stiffness.standard_error, 1.0);
        let s = if self.presses == 1 { "" } else { "es" };
        write!(
            f,
            "the guide is {ratio} times as stiff as stated ({} press{s} of known balls)",
            self.presses
        )
    }
}
