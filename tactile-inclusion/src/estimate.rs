//! What a search found.

use std::fmt;
use tactile_fem::Interface;

/// Relative standard error above which a parameter is not identified, on the side where its
/// interval reaches further: a modulus that may be far higher is not identified by being bounded
/// from below. On 162 scenes of `evidence/inclusion_scenes.py`, none of 60 parameters that a
/// sensor cannot know within 30 % was told (`inclusion_study`); the price is that some it could
/// know within 20 to 30 % are left open.
const OPEN: f64 = 0.25;

/// 1 % of asymmetry is harmless, 6 % is not.
const LARGEST_ASYMMETRY: f64 = 0.03;

/// Smooth errors of a sensor (0.3 % over 3 mm) reach 0.4 % in one picture of 100. An ellipsoid of
/// 14 × 10 × 8 mm has 1.9 %.
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
    /// Its standard error.
    pub standard_error: f64,
    /// The 95 % interval.
    #[cfg_attr(feature = "serde", serde(rename = "interval_95"))]
    pub interval: [f64; 2],
}

impl Estimated {
    /// From a logarithm and the ends of its 95 % interval. The standard error is that of a Gaussian
    /// with an interval as wide.
    pub(crate) fn within(logarithm: f64, [low, high]: [f64; 2]) -> Self {
        let value = logarithm.exp();
        Self {
            value,
            standard_error: value * 0.5 * (high - low) / TWO_SIDED_95,
            interval: [low.exp(), high.exp()],
        }
    }

    /// From the ends of its 95 % interval.
    pub(crate) fn new(value: f64, [low, high]: [f64; 2]) -> Self {
        Self {
            value,
            standard_error: 0.5 * (high - low) / TWO_SIDED_95,
            interval: [low, high],
        }
    }

    /// With another standard error in quadrature.
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

/// Standard deviations that 95 % of a Gaussian lie within.
pub(crate) const TWO_SIDED_95: f64 = 1.959_963_984_540_054;

/// A parameter of an inclusion: identified, or left open.
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
    /// Known within 25 % (one standard error) both ways.
    Yes(Estimated),
    /// The data leave it open: what prior and data allow together.
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

    /// The value, where it is identified.
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

/// The estimate, and `told`: whether it is identified.
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
    /// Its middle (x, y) from the face's axis, in metres. `None` from ring means: under the axis.
    pub position_m: Option<[Estimated; 2]>,
    /// Diameter D of the ball of equal volume, in metres: the posterior's median.
    pub diameter_m: Identifiable,
    /// Depth of its top d, in metres: the posterior's median.
    pub depth_m: Identifiable,
    /// Young's modulus E₁, in pascals: of the best fit, for how stiff it may be at most is often
    /// known from the prior alone.
    pub youngs_modulus_pa: Identifiable,
    /// Height along the axis over the width across it: the posterior's median. `None` where it was
    /// said to be a ball.
    pub height_over_width: Option<Estimated>,
    /// Probability that it is a ball, where it is as likely as not beforehand.
    pub ball_probability: f64,
    /// Correlations of ln D, ln d and ln E₁.
    pub correlation: [[f64; 3]; 3],
}

/// What weakens an estimate.
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
    /// The best fit leaves more than the errors explain (below 1 chance in 1000): several
    /// inclusions, one off the axis, a stiffer skin, or errors larger than stated. Errors are
    /// widened by the root of the excess, and no parameter counts as identified.
    PoorFit {
        /// χ² over its degrees of freedom.
        excess: f64,
    },
    /// One frame: size and stiffness are told apart by how the pressure grows with the approach.
    OneFrame,
    /// The fit ended before it settled.
    NotConverged,
    /// Bonded and frictionless faces explain the frames about equally well: the better one's values
    /// are given, with intervals that hold those of both. Or one of them could not be solved, and
    /// no parameter counts as identified.
    UncertainInterface,
    /// The inclusion lies nearer to the surface or to the stage than half an element: the model
    /// does not reach that far.
    AtBoundary,
    /// A sixth of the inclusion or more lies under the rim of the face: the model places it, and
    /// does not reach its size.
    AtRim,
    /// The pressure is larger on one side of the axis by more than 3 %: an inclusion off the axis,
    /// several, or a tilted block. The model is symmetric.
    Asymmetric {
        /// First harmonic of the pressure around the axis over its mean.
        asymmetry: f64,
    },
    /// The inclusion is no ball: seen from above its axes differ. The model is a ball, and neither
    /// size nor depth nor modulus can be told.
    NotABall {
        /// Ratio of the axes.
        axes: f64,
    },
    /// The pressure around the axis has second to fourth harmonics above 0.6 %: a lump that is not
    /// round, several, or one off the axis. The model is symmetric.
    NotRound {
        /// Root mean square of these harmonics over the pressure.
        harmonics: f64,
    },
}

impl fmt::Display for InclusionWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PoorFit { excess } => write!(
                f,
                "the best fit leaves {excess:.1} times what the errors explain: several lumps, one \
                 off the axis, a stiffer skin, or wrong sizes or forces; errors are widened"
            ),
            Self::OneFrame => {
                f.write_str("one frame tells size and stiffness hardly apart: add approaches")
            }
            Self::NotConverged => f.write_str("the fit had not settled; nothing of it is told"),
            Self::UncertainInterface => {
                f.write_str("bonded and frictionless faces explain the frames about equally well")
            }
            Self::AtBoundary => {
                f.write_str("the lump touches the surface or the base: beyond the model")
            }
            Self::AtRim => f.write_str(
                "part of the lump lies under the rim of the face: press nearer to it for its size",
            ),
            Self::Asymmetric { asymmetry } => write!(
                f,
                "the pressure is {:.1} % larger on one side: a lump off the axis, several, or a \
                 tilted block; the model is symmetric, and no size is given",
                100.0 * asymmetry
            ),
            Self::NotABall { axes } => write!(
                f,
                "seen from above the lump's axes are {axes:.2} : 1; the model is a ball, and no \
                 size is given"
            ),
            Self::NotRound { harmonics } => write!(
                f,
                "around the axis the pressure varies by {:.1} %: a lump that is not round, \
                 several, or one off the axis; the model is symmetric, and no size is given",
                100.0 * harmonics
            ),
        }
    }
}

/// What a symmetric model does not explain of a picture: its first harmonic around the axis above
/// 3 % and the root mean square of the second to fourth above 0.6 %, both over the pressure.
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
    /// One was found.
    Found,
    /// The frames show none.
    Absent,
    /// None was found, but one is more probable than not, or the model does not explain the frames.
    Uncertain,
}

/// What a search found.
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
    /// Probability that there is an inclusion, one and none being equally likely beforehand.
    pub probability: f64,
    /// Whether one was found: the probability is above 0.99, χ² falls by more than 36, and its
    /// modulus is a fifth or more from the tissue's. The block holds it, and χ² over its degrees of
    /// freedom is below 50.
    pub found: bool,
    /// Young's modulus of the tissue, in pascals.
    pub block_modulus_pa: Estimated,
    /// The inclusion that explains the frames best. `None` where none was found, and where the
    /// picture is not that of a ball: there is a warning.
    pub inclusion: Option<Inclusion>,
    /// A second one, where two explain the picture and one does not.
    pub second: Option<Inclusion>,
    /// How the face touches the block.
    pub interface: Interface,
    /// χ² of the fit over its degrees of freedom.
    pub misfit: f64,
    /// What weakens the estimate.
    pub warnings: Vec<InclusionWarning>,
    /// Radii of the rings used, in metres.
    pub radii_m: Vec<f64>,
    /// Fitted pressure of each frame at those radii, in pascals.
    pub fitted_pa: Vec<Vec<f64>>,
    /// Pressure of the homogeneous block that fits best, in pascals.
    pub homogeneous_pa: Vec<Vec<f64>>,
}

impl InclusionEstimate {
    /// All inclusions of which parameters are given.
    pub fn inclusions(&self) -> Vec<Inclusion> {
        self.inclusion.into_iter().chain(self.second).collect()
    }

    /// Whether there is an inclusion. That there is none is certain only where the model explains
    /// the frames: beside a poor fit or one that did not settle it is not.
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
