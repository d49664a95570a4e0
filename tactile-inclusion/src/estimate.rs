//! Results of a search.

use std::fmt;
use tactile_fem::Interface;

/// Relative standard error above which a parameter is not identified. The longer side of its
/// interval counts: a modulus that may be far higher is not identified by a lower bound. In 162
/// scenes of `evidence/inclusion_scenes.py`, 60 parameters cannot be determined by a sensor within
/// 30 %, and all 60 were correctly reported as not identified (`inclusion_study`). In exchange,
/// some that it could determine within 20 to 30 % stay open.
const OPEN: f64 = 0.25;

/// An asymmetry of 1 % is harmless, 6 % is not.
const LARGEST_ASYMMETRY: f64 = 0.03;

/// Smooth errors of a sensor (0.3 % over 3 mm) reach 0.4 % in one picture of 100. An ellipsoid of
/// 14 × 10 × 8 mm gives 1.9 %.
const LARGEST_HARMONICS: f64 = 0.006;

/// A value with its standard error and its 95 % interval.
///
/// ```
/// use tactile_inclusion::Estimated;
///
/// let diameter = Estimated { value: 10e-3, standard_error: 0.5e-3, interval: [9e-3, 11e-3] };
/// assert!(diameter.interval[0] < diameter.value);
/// assert_eq!(diameter.relative_error(), 0.05);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Estimated {
    /// The value.
    pub value: f64,
    /// Standard error of the value.
    pub standard_error: f64,
    /// 95 % interval of the value.
    #[cfg_attr(feature = "serde", serde(rename = "interval_95"))]
    pub interval: [f64; 2],
}

impl Estimated {
    /// Creates the estimate from a logarithm and the ends of its 95 % interval. The standard error
    /// belongs to a Gaussian with an interval of equal width.
    pub(crate) fn within(logarithm: f64, [low, high]: [f64; 2]) -> Self {
        let value = logarithm.exp();
        Self {
            value,
            standard_error: value * 0.5 * (high - low) / TWO_SIDED_95,
            interval: [low.exp(), high.exp()],
        }
    }

    /// Creates the estimate from the ends of its 95 % interval.
    pub(crate) fn new(value: f64, [low, high]: [f64; 2]) -> Self {
        Self {
            value,
            standard_error: 0.5 * (high - low) / TWO_SIDED_95,
            interval: [low, high],
        }
    }

    /// Adds another standard error in quadrature.
    pub(crate) fn widened(&self, error: f64) -> Self {
        let reach = |end: f64| (end - self.value).hypot(TWO_SIDED_95 * error);
        let [low, high] = self.interval.map(reach);
        Self::new(self.value, [self.value - low, self.value + high])
    }

    /// Standard error over value.
    pub fn relative_error(&self) -> f64 {
        self.standard_error / self.value
    }
}

/// Half width of the 95 % interval of a Gaussian, in standard deviations.
pub(crate) const TWO_SIDED_95: f64 = 1.959_963_984_540_054;

/// A parameter of an inclusion, identified or open.
///
/// ```
/// use tactile_inclusion::{Estimated, Identifiable};
///
/// let range = Estimated { value: 50e3, standard_error: 60e3, interval: [15e3, 200e3] };
/// assert_eq!(Identifiable::No(range).value(), None);
/// assert_eq!(Identifiable::Yes(range).value(), Some(50e3));
/// assert_eq!(Identifiable::No(range).estimate().interval, [15e3, 200e3]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Identifiable {
    /// The parameter is known within 25 % (one standard error) on both sides.
    Yes(Estimated),
    /// The data leave the parameter open. The estimate combines prior and data.
    No(Estimated),
}

impl Identifiable {
    pub(crate) fn new(estimated: Estimated, is_reliable: bool) -> Self {
        let [low, high] = estimated.interval;
        let reach = (estimated.value / low).max(high / estimated.value).ln();
        if is_reliable && reach < TWO_SIDED_95 * OPEN {
            Self::Yes(estimated)
        } else {
            Self::No(estimated)
        }
    }

    /// The value. `None` if the parameter is not identified.
    pub fn value(&self) -> Option<f64> {
        match self {
            Self::Yes(estimated) => Some(estimated.value),
            Self::No(_) => None,
        }
    }

    /// The estimate, identified or not.
    pub fn estimate(&self) -> &Estimated {
        match self {
            Self::Yes(estimated) | Self::No(estimated) => estimated,
        }
    }
}

/// Serialises the estimate, with `told` for whether it is identified.
#[cfg(feature = "serde")]
impl serde::Serialize for Identifiable {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(serde::Serialize)]
        struct Flat<'a> {
            told: bool,
            #[serde(flatten)]
            estimated: &'a Estimated,
        }
        let (told, estimated) = (matches!(self, Self::Yes(_)), self.estimate());
        Flat { told, estimated }.serialize(serializer)
    }
}

/// An inclusion's parameters.
///
/// ```no_run
/// # use tactile_inclusion::InclusionEstimate;
/// # fn print(estimate: &InclusionEstimate) {
/// if let Some(inclusion) = &estimate.inclusion {
///     println!("diameter {:.1} mm", 1e3 * inclusion.diameter_m.estimate().value);
/// }
/// # }
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Inclusion {
    /// Position (x, y) of its centre relative to the axis of the face, in metres. `None` for ring
    /// means, which assume an inclusion on the axis.
    pub position_m: Option<[Estimated; 2]>,
    /// Diameter D of the ball of equal volume, in metres: median of the posterior.
    pub diameter_m: Identifiable,
    /// Depth d of its top, in metres: median of the posterior.
    pub depth_m: Identifiable,
    /// Young's modulus E₁ of the best fit, in pascals. It is not the median, because the upper
    /// limit of the stiffness often comes from the prior alone.
    pub youngs_modulus_pa: Identifiable,
    /// Height along the axis over width across it: median of the posterior. `None` if the inclusion
    /// is assumed to be a ball.
    pub height_over_width: Option<Estimated>,
    /// Probability that the inclusion is a ball, with a prior probability of one half.
    pub ball_probability: f64,
    /// Correlations of ln D, ln d and ln E₁.
    pub correlation: [[f64; 3]; 3],
}

/// A reservation about an estimate.
///
/// ```
/// use tactile_inclusion::InclusionWarning;
///
/// let sentence = InclusionWarning::OneFrame.to_string();
/// assert!(sentence.ends_with("add approaches"));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize),
    serde(tag = "kind", rename_all = "snake_case")
)]
#[non_exhaustive]
pub enum InclusionWarning {
    /// The best fit leaves residuals above the errors (probability below 0.001). Possible reasons
    /// are several inclusions, an off-axis inclusion, a stiffer skin, or understated errors. Errors
    /// are widened by the root of the excess, and no parameter is identified.
    PoorFit {
        /// χ² over its degrees of freedom.
        excess: f64,
    },
    /// There is only one frame, whereas size and stiffness are separated by the growth of the
    /// pressure with the approach.
    OneFrame,
    /// The fit stopped before it converged.
    NotConverged,
    /// Bonded and frictionless faces fit the frames about equally well: the better one gives the
    /// values, and the intervals cover both. If one of them could not be solved, no parameter is
    /// identified.
    UncertainInterface,
    /// The specimen states one contact condition, and the other explains the frames clearly better.
    /// The better one gives the values, and the intervals cover both.
    ContradictedInterface,
    /// The inclusion is closer to the surface or to the stage than half an element, where the model
    /// does not apply.
    AtBoundary,
    /// A sixth of the inclusion or more lies under the rim of the face: its position is determined,
    /// but not its size.
    AtRim,
    /// The pressure is more than 3 % larger on one side of the axis: an off-axis inclusion, several
    /// inclusions, or a tilted block. The model is symmetric.
    Asymmetric {
        /// First harmonic of the pressure around the axis, relative to its mean.
        asymmetry: f64,
    },
    /// The inclusion is not a ball: its axes differ as seen from above. The model assumes a ball,
    /// so size, depth and modulus are undetermined.
    NotABall {
        /// Ratio of the axes.
        axes: f64,
    },
    /// The pressure around the axis has second to fourth harmonics above 0.6 %: a lump that is not
    /// round, several lumps, or one off the axis. The model is symmetric.
    NotRound {
        /// Root mean square of these harmonics, relative to the pressure.
        harmonics: f64,
    },
}

impl fmt::Display for InclusionWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PoorFit { excess } => write!(
                f,
                "the misfit is {excess:.1} times as large as the errors explain: several lumps, \
                 one \
                 off the axis, a stiffer skin, or wrong sizes or forces; errors are widened"
            ),
            Self::OneFrame => {
                f.write_str("one frame hardly separates size from stiffness: add approaches")
            }
            Self::NotConverged => f.write_str("the fit did not converge; it gives no parameters"),
            Self::UncertainInterface => {
                f.write_str("bonded and frictionless faces explain the frames about equally well")
            }
            Self::ContradictedInterface => f.write_str(
                "the frames contradict the stated interface: with the other they are explained \
                 better; intervals cover both",
            ),
            Self::AtBoundary => {
                f.write_str("the lump touches the surface or the base: the model does not apply")
            }
            Self::AtRim => f.write_str(
                "part of the lump lies under the rim of the face: press nearer to it for its size",
            ),
            Self::Asymmetric { asymmetry } => write!(
                f,
                "the pressure is {:.1} % larger on one side: a lump off the axis, several, or a \
                 tilted block; the model is symmetric, so no size is given",
                100.0 * asymmetry
            ),
            Self::NotABall { axes } => write!(
                f,
                "seen from above the lump's axes are {axes:.2} : 1; the model assumes a ball, so no \
                 size is given"
            ),
            Self::NotRound { harmonics } => write!(
                f,
                "around the axis the pressure varies by {:.1} %: a lump that is not round, \
                 several, or one off the axis; the model is symmetric, so no size is given",
                100.0 * harmonics
            ),
        }
    }
}

/// Warnings about the asymmetric part of a picture, relative to the pressure. They are given if the
/// first harmonic around the axis exceeds 3 %, or the root mean square of the second to fourth
/// exceeds 0.6 %.
///
/// ```
/// use tactile_inclusion::asymmetry_warnings;
///
/// assert!(asymmetry_warnings(0.01, 0.002).is_empty());
/// assert_eq!(asymmetry_warnings(0.06, 0.02).len(), 2);
/// ```
pub fn asymmetry_warnings(asymmetry: f64, harmonics: f64) -> Vec<InclusionWarning> {
    let first = InclusionWarning::Asymmetric { asymmetry };
    let higher = InclusionWarning::NotRound { harmonics };
    let both = [
        (asymmetry > LARGEST_ASYMMETRY, first),
        (harmonics > LARGEST_HARMONICS, higher),
    ];
    both.into_iter()
        .filter_map(|(is, warning)| is.then_some(warning))
        .collect()
}

/// Whether there is an inclusion.
///
/// ```
/// use tactile_inclusion::SearchVerdict;
/// assert_ne!(SearchVerdict::Absent, SearchVerdict::Uncertain);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize),
    serde(rename_all = "snake_case")
)]
pub enum SearchVerdict {
    /// An inclusion was found.
    Found,
    /// The frames show none.
    Absent,
    /// No inclusion was found, but one is more probable than not, or the model does not fit the
    /// frames.
    Uncertain,
}

/// Result of a search.
///
/// ```no_run
/// # use tactile_inclusion::InclusionEstimate;
/// # fn print(estimate: &InclusionEstimate) {
/// println!("an inclusion with probability {:.3}", estimate.probability);
/// # }
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct InclusionEstimate {
    /// Probability that there is an inclusion, with a prior probability of one half.
    pub probability: f64,
    /// Whether an inclusion was found. Its probability is above 0.99, it reduces χ² by more than
    /// 36, and its modulus differs from that of the tissue by at least a fifth. It lies within the
    /// block, and χ² over its degrees of freedom is below 50.
    pub found: bool,
    /// Young's modulus of the tissue, in pascals.
    pub block_modulus_pa: Estimated,
    /// The inclusion that fits the frames best. `None` if none was found, or if the picture is not
    /// that of a ball, which raises a warning.
    pub inclusion: Option<Inclusion>,
    /// A second inclusion. `None` unless two inclusions fit the picture and one does not.
    pub second: Option<Inclusion>,
    /// Contact condition between face and block.
    pub interface: Interface,
    /// χ² of the fit over its degrees of freedom.
    pub misfit: f64,
    /// Reservations about the estimate.
    pub warnings: Vec<InclusionWarning>,
    /// Radii of the rings used, in metres.
    pub radii_m: Vec<f64>,
    /// Fitted pressure of each frame at those radii, in pascals.
    pub fitted_pa: Vec<Vec<f64>>,
    /// Pressure of the homogeneous block that fits best, in pascals.
    pub homogeneous_pa: Vec<Vec<f64>>,
}

impl InclusionEstimate {
    /// All inclusions whose parameters are reported.
    pub fn inclusions(&self) -> Vec<Inclusion> {
        self.inclusion.into_iter().chain(self.second).collect()
    }

    /// Whether there is an inclusion. Its absence is certain only if the model fits the frames;
    /// after a poor fit, or one that did not converge, it is not.
    pub fn verdict(&self) -> SearchVerdict {
        let is_model_in_doubt = self.warnings.iter().any(|warning| {
            matches!(
                warning,
                InclusionWarning::PoorFit { .. } | InclusionWarning::NotConverged
            )
        });
        if self.found {
            SearchVerdict::Found
        } else if is_model_in_doubt || self.probability > 0.5 {
            SearchVerdict::Uncertain
        } else {
            SearchVerdict::Absent
        }
    }
}
