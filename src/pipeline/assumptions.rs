//! What is assumed where nothing is stated, and what presses of known force show of the sensor.
use super::text::with_error;
use crate::core::{Estimate, Source};
use std::fmt::{self, Display, Formatter};

/// An input whose error is assumed where none is stated.
///
/// ```
/// use tactile_imaging::force::Source;
/// use tactile_imaging::pipeline::Assumption;
/// let light = Assumption::of(Source::Coupling).expect("it has a default");
/// assert_eq!((light.setting, light.default), ("coupling_error", 0.12));
/// assert!(Assumption::of(Source::Noise).is_none(), "measured in the frames");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Assumption {
    /// The source that its error is.
    pub source: Source,
    /// The field of [`Settings`](crate::pipeline::Settings) that states it.
    pub setting: &'static str,
    /// The key of a scene file that states it.
    pub scene_key: &'static str,
    /// The standard error that is assumed.
    pub default: f64,
    /// The unit of the default.
    pub unit: &'static str,
    /// What makes it smaller.
    pub remedy: &'static str,
}

impl Assumption {
    /// Every input with a default. This is the place to change one.
    pub const ALL: [Self; 7] = [
        Self {
            source: Source::Gain,
            setting: "force_scale_error",
            scene_key: "gauge_error",
            // A gauge to 0.2 %, and light that is uneven by 0.1 %: √(0.2² + 0.1²) %.
            default: 2.236_067_977_499_79e-3,
            unit: "of the force",
            remedy: "a better gauge, or a flat field",
        },
        Self {
            source: Source::Coupling,
            setting: "coupling_error",
            scene_key: "coupling_error",
            // An object that reflects a fifth less than the calibrator is held.
            default: 0.12,
            unit: "of the force",
            remedy: "a press of this object under a known weight ([[check]])",
        },
        Self {
            source: Source::PixelSize,
            setting: "length_scale_error",
            scene_key: "pixel_size_error",
            default: 0.3e-2,
            unit: "of a length",
            remedy: "a frame of a target of known pitch",
        },
        Self {
            source: Source::ObjectSize,
            setting: "object_radius_error_m",
            scene_key: "radius_error_m",
            default: 0.5e-2,
            unit: "of the radius",
            remedy: "a calliper on the object (radius_error_m)",
        },
        Self {
            source: Source::PoissonRatio,
            setting: "poisson_ratio_error",
            scene_key: "poisson_ratio_error",
            default: 0.01,
            unit: "",
            remedy: "a statement of its error (poisson_ratio_error)",
        },
        Self {
            source: Source::Adhesion,
            setting: "adhesion_error_j_per_m2",
            scene_key: "adhesion_error_j_per_m2",
            // A dusted ball. Clean dry silicone has some tens of mJ/m².
            default: 1e-3,
            unit: "J/m²",
            remedy: "larger forces, or talc and a statement of adhesion_error_j_per_m2",
        },
        Self {
            source: Source::Guide,
            setting: "layer_covariance",
            scene_key: "layer_error",
            default: 0.05,
            unit: "of the moduli of all layers, by one factor",
            remedy: "a press of a ball of known radius and modulus ([[check]])",
        },
    ];

    /// That of a source. `None` if its error is measured.
    #[must_use]
    pub fn of(source: Source) -> Option<&'static Self> {
        const ALL: &[Assumption] = &Assumption::ALL;
        ALL.iter().find(|assumption| assumption.source == source)
    }

    /// The error that is assumed of a source, zero of one that is measured.
    pub(super) fn default_of(source: Source) -> f64 {
        Self::of(source).map_or(0.0, |assumption| assumption.default)
    }
}

/// The gain that presses of known force show. Forces that are read from light are divided by it,
/// and its error stands in place of
/// [`Settings::coupling_error`](crate::pipeline::Settings::coupling_error).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct CheckedGain {
    /// Force that is read over force that is known.
    pub gain: Estimate,
    /// Standard deviation of the gain between presses beyond their own errors, relative. The error
    /// of the gain allows for it, and for 0.5 % where it is less.
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

/// What presses of balls of known modulus show of the guide's layers. The layers of the pipeline
/// and their covariance are those after the presses.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct CheckedGuide {
    /// Stiffness of the guide under contacts of the presses' mean radius, over that as stated.
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
