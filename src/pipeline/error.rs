//! Errors of a measurement.
use crate::core::InvalidOption;
use crate::elasticity::ElasticityError;
use crate::force::{ForceError, ShapeProblem};
use crate::matching::MatchError;
use crate::sfs::SfsError;
use crate::tps::TpsError;

/// Why a measurement failed. Frames are counted from 0, as in the calls.
///
/// ```
/// use tactile_imaging::pipeline::{Object, Pipeline, PipelineError};
/// use tactile_imaging::force::CalibrationPair;
/// let pairs = [0.0, 1.0, 2.0].map(|n| CalibrationPair::loading(1e5 * n, n));
/// let pipeline = Pipeline::from_pairs(&pairs, [50e-6; 2], Object::sphere(3e-3))?;
/// let empty = ndarray::Array2::from_elem((64, 64), 10_u8);
/// let mut press = pipeline.press(empty.view())?;
/// press.add_frame(empty.view());
/// let error = press.surface(0).unwrap_err();
/// assert_eq!(error, PipelineError::NoContact { frame: 0 });
/// assert!(error.to_string().starts_with("frame 0 shows no contact"));
/// let error = press.contact(7).unwrap_err();
/// assert_eq!(error.to_string(), "there is no frame 7: the press has 1");
/// # Ok::<(), tactile_imaging::pipeline::PipelineError>(())
/// ```
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PipelineError {
    /// The reference or the options of the pipeline are invalid.
    #[error("the sensor's description is not usable: {0}")]
    Sensor(#[source] ForceError),
    /// The calibration cannot be fitted.
    #[error("the force calibration cannot be fitted: {0}")]
    Calibration(#[source] ForceError),
    /// The options of the reconstruction or the sampler are invalid.
    #[error("the options of the surface stages are not usable: {0}")]
    SurfaceOptions(#[source] SfsError),
    /// The options of the warp are invalid.
    #[error("the options of the warp are not usable: {0}")]
    WarpOptions(#[source] TpsError),
    /// The depth table is invalid.
    #[error("the depth table is not usable: {0}")]
    DepthTable(#[source] SfsError),
    /// The waveguide or the object is unphysical.
    #[error("the waveguide or the object is not physical: {0}")]
    Material(#[source] ElasticityError),
    /// A press of known force cannot be used.
    #[error("press {press} of known force is not usable: {reason}")]
    Check {
        /// Index of the press, counted from 0.
        press: usize,
        /// The reason.
        reason: &'static str,
    },
    /// A setting of the pipeline is outside its range.
    #[error(transparent)]
    Setting(#[from] InvalidOption),
    /// There is no frame with this index.
    #[error("there is no frame {frame}: the press has {frames}")]
    NoSuchFrame {
        /// The requested frame.
        frame: usize,
        /// Number of frames in the press.
        frames: usize,
    },
    /// A frame that is read on demand could not be read.
    #[error("frame {frame}: {reason}")]
    Unreadable {
        /// The frame.
        frame: usize,
        /// Message of the reader.
        reason: String,
    },
    /// The surface of this frame was not reconstructed, because the measurement has many frames.
    #[error(
        "frame {frame}: no surface was reconstructed; of {frames} frames only those with a \
         strain have one (`Press::surface` computes any)"
    )]
    NotReconstructed {
        /// The frame.
        frame: usize,
        /// Number of frames.
        frames: usize,
    },
    /// No contact could be measured in a frame.
    #[error("frame {frame}: {source}")]
    Contact {
        /// The frame.
        frame: usize,
        /// The reason.
        source: ForceError,
    },
    /// The result of a contact stage does not fit the frame.
    #[error(
        "frame {frame}: the contact stage gave a mask of {} × {} pixels for a box of {} × {} \
         pixels in a frame of {} × {}",
        mask.0, mask.1, region.0, region.1, image.0, image.1
    )]
    ContactMask {
        /// The frame.
        frame: usize,
        /// Rows and columns of the mask.
        mask: (usize, usize),
        /// Rows and columns of the region.
        region: (usize, usize),
        /// Rows and columns of the frame, in which the region must lie.
        image: (usize, usize),
    },
    /// A frame shows no contact, but a contact is needed.
    #[error(
        "frame {frame} shows no contact: it does not differ from the reference by more than its \
         noise"
    )]
    NoContact {
        /// The frame.
        frame: usize,
    },
    /// A frame shows no contact, but its signal has the wrong sign for one.
    #[error(
        "frame {frame} shows no contact, though it is up to {:.0} grey levels {} than the \
         reference: were the two swapped, or has the light changed?",
        .grey.abs(),
        if *.grey < 0.0 { "darker" } else { "brighter" }
    )]
    OppositeSignal {
        /// The frame.
        frame: usize,
        /// Largest difference of frame minus reference, in grey levels.
        grey: f64,
    },
    /// The force of a frame is unknown: there is neither a calibration nor a gauge reading.
    #[error(
        "the force of frame {frame} is unknown: without a calibration a gauge reading is needed \
         (`force_N`)"
    )]
    NoForce {
        /// The frame.
        frame: usize,
    },
    /// The edge of the frame cuts every contact, so force and radius are incomplete.
    #[error(
        "the frame's edge cuts every contact, and a partial contact gives no modulus: move the \
         object to the middle of the frame"
    )]
    NoWholeContact,
    /// The time of a frame is negative or not finite.
    #[error(
        "the time of frame {frame} must be zero or a positive number of seconds, found {found_s}"
    )]
    Time {
        /// The frame.
        frame: usize,
        /// The time given.
        found_s: f64,
    },
    /// Frames are not in the order of time.
    #[error("frame {frame} was taken at {found_s} s, before the preceding frame ({before_s} s)")]
    TimeDecreases {
        /// The frame.
        frame: usize,
        /// Time of the last preceding frame that has one.
        before_s: f64,
        /// Time of this frame.
        found_s: f64,
    },
    /// Matches and strains need two frames.
    #[error("a strain needs two frames, found {found}")]
    TooFewFrames {
        /// Number of frames.
        found: usize,
    },
    /// No surface could be reconstructed.
    #[error("frame {frame}: no surface: {source}")]
    Surface {
        /// The frame.
        frame: usize,
        /// The reason.
        source: SfsError,
    },
    /// The control points could not be matched.
    #[error("frames {from} and {to} cannot be matched: {source}")]
    Match {
        /// The first frame.
        from: usize,
        /// The second frame.
        to: usize,
        /// The reason.
        source: MatchError,
    },
    /// Too few control points have partners.
    #[error(
        "frames {from} and {to}: only {found} control points have a partner, {expected} are needed"
    )]
    TooFewMatches {
        /// The first frame.
        from: usize,
        /// The second frame.
        to: usize,
        /// Minimum number of partners.
        expected: usize,
        /// Number found.
        found: usize,
    },
    /// The displacement between two frames has no warp.
    #[error("frames {from} and {to}: no warp fits the matches: {source}")]
    Warp {
        /// The first frame.
        from: usize,
        /// The second frame.
        to: usize,
        /// The reason.
        source: TpsError,
    },
    /// The strain between two frames could not be computed.
    #[error("frames {from} and {to}: no strain: {source}")]
    Strain {
        /// The first frame.
        from: usize,
        /// The second frame.
        to: usize,
        /// The reason.
        source: ElasticityError,
    },
    /// The contact is not a single flat face under uniaxial load, so no modulus can be derived from
    /// it.
    #[error("frame {frame}: {problem}")]
    NotUniaxial {
        /// The frame.
        frame: usize,
        /// The reason.
        problem: ShapeProblem,
    },
    /// The points of a flat face cannot be matched.
    #[error(
        "frames {from} and {to}: the points of a flat face cannot be matched; its strain follows \
         from its outline"
    )]
    FlatFace {
        /// The first frame.
        from: usize,
        /// The second frame.
        to: usize,
    },
    /// The chosen estimator is for another object.
    #[error("the estimator \"{estimator}\" needs {needs}")]
    WrongEstimator {
        /// Name of the estimator.
        estimator: &'static str,
        /// What the estimator needs.
        needs: &'static str,
    },
    /// The loads do not determine a modulus.
    #[error("the loads do not determine the modulus: {0}")]
    Modulus(#[source] ElasticityError),
}

/// What a caller can do about a [`PipelineError`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PipelineErrorKind {
    /// Settings, calibration, description of the sensor or object are invalid: change them.
    Options,
    /// A frame, time or reading is invalid: supply another one.
    Input,
    /// A frame of the press could not be read from its source.
    NotRead,
    /// A frame shows no contact.
    NoContact,
    /// The frames do not determine the result: more or other frames may.
    NotDetermined,
    /// A user-defined stage failed.
    OwnStage,
}

impl PipelineError {
    /// What a caller can do about this error.
    ///
    /// ```
    /// use tactile_imaging::pipeline::{PipelineError, PipelineErrorKind};
    /// assert_eq!(PipelineError::NoContact { frame: 2 }.kind(), PipelineErrorKind::NoContact);
    /// ```
    #[must_use]
    pub fn kind(&self) -> PipelineErrorKind {
        use PipelineErrorKind as Kind;
        match self {
            Self::Contact {
                source: ForceError::Custom(_),
                ..
            }
            | Self::ContactMask { .. }
            | Self::Surface {
                source: SfsError::Custom(_),
                ..
            }
            | Self::Match {
                source: MatchError::Custom(_),
                ..
            }
            | Self::Warp {
                source: TpsError::Custom(_),
                ..
            }
            | Self::Strain {
                source: ElasticityError::Custom(_),
                ..
            }
            | Self::Modulus(ElasticityError::Custom(_)) => Kind::OwnStage,
            Self::Sensor(_)
            | Self::Calibration(_)
            | Self::SurfaceOptions(_)
            | Self::WarpOptions(_)
            | Self::DepthTable(_)
            | Self::Material(_)
            | Self::Setting(_)
            | Self::WrongEstimator { .. } => Kind::Options,
            Self::Contact {
                source: ForceError::SaturatedContact { .. },
                ..
            } => Kind::NotDetermined,
            Self::Check { .. }
            | Self::NoSuchFrame { .. }
            | Self::Contact { .. }
            | Self::Time { .. }
            | Self::TimeDecreases { .. } => Kind::Input,
            Self::Unreadable { .. } => Kind::NotRead,
            Self::NoContact { .. } | Self::OppositeSignal { .. } => Kind::NoContact,
            Self::NotReconstructed { .. }
            | Self::NoForce { .. }
            | Self::NoWholeContact
            | Self::TooFewFrames { .. }
            | Self::Surface { .. }
            | Self::Match { .. }
            | Self::TooFewMatches { .. }
            | Self::Warp { .. }
            | Self::Strain { .. }
            | Self::NotUniaxial { .. }
            | Self::FlatFace { .. }
            | Self::Modulus(_) => Kind::NotDetermined,
        }
    }

    /// The frame that caused the error, counted from 0. `None` if there is no single one.
    ///
    /// ```
    /// use tactile_imaging::pipeline::PipelineError;
    /// assert_eq!(PipelineError::NoContact { frame: 2 }.frame(), Some(2));
    /// ```
    #[must_use]
    pub fn frame(&self) -> Option<usize> {
        self.clone().frames().pop().copied()
    }

    /// This error with its frames and loads counted from `first` instead of 0, for messages.
    ///
    /// ```
    /// use tactile_imaging::pipeline::PipelineError;
    /// let error = PipelineError::NoContact { frame: 2 };
    /// assert!(error.to_string().starts_with("frame 2 shows no contact"));
    /// assert!(error.numbered_from(1).to_string().starts_with("frame 3 shows no contact"));
    /// ```
    #[must_use]
    pub fn numbered_from(mut self, first: usize) -> Self {
        for frame in self.frames() {
            *frame += first;
        }
        match self {
            Self::Check { press, reason } => Self::Check {
                press: press + first,
                reason,
            },
            Self::Modulus(source) => Self::Modulus(source.numbered_from(first)),
            error => error,
        }
    }

    /// The frames in the message.
    fn frames(&mut self) -> Vec<&mut usize> {
        match self {
            Self::NoSuchFrame { frame, .. }
            | Self::Unreadable { frame, .. }
            | Self::NotReconstructed { frame, .. }
            | Self::Contact { frame, .. }
            | Self::ContactMask { frame, .. }
            | Self::NoContact { frame }
            | Self::OppositeSignal { frame, .. }
            | Self::NoForce { frame }
            | Self::Time { frame, .. }
            | Self::TimeDecreases { frame, .. }
            | Self::NotUniaxial { frame, .. }
            | Self::Surface { frame, .. } => vec![frame],
            Self::Match { from, to, .. }
            | Self::FlatFace { from, to }
            | Self::TooFewMatches { from, to, .. }
            | Self::Warp { from, to, .. }
            | Self::Strain { from, to, .. } => vec![from, to],
            _ => Vec::new(),
        }
    }
}
