//! The kinds of drift that can be corrected, and whether it was.

/// The change of illumination or stray light that is corrected; none by default.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::{ContactDetector, ContactOptions, Detection, DriftCorrection, ReferenceFrame};
///
/// // Three grey levels of stray light everywhere are no contact.
/// let reference = ReferenceFrame::new(Array2::from_elem((160, 160), 20_u8).view())?;
/// let brighter = Array2::from_elem((160, 160), 23_u8);
/// let options = ContactOptions::default().with_drift(DriftCorrection::Offset);
/// let found: Detection<f64> =
///     ContactDetector::new(options).detect_with(&mut Default::default(), brighter.view(), &reference)?;
/// assert!(found.contact.is_none());
/// assert!((found.drift.coefficients[0] - 3.0).abs() < 1e-9);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum DriftCorrection {
    /// Frames are taken as they are.
    #[default]
    None,
    /// Stray light added everywhere alike: d = f − r − b.
    Offset,
    /// Stray light with a gradient: d = f − r − (b + bₓ x + b_y y).
    Plane,
    /// Illumination brighter or darker, background and signal alike: d = f/g − r.
    Illumination,
    /// Illumination that also changed its distribution, as when an LED moves: d = f/(g + gₓ x + g_y y) − r.
    TiltedIllumination,
    /// [`Illumination`](Self::Illumination) where the frame shows it, nothing where it does not: [`DriftOutcome`] says which.
    Automatic,
}

/// Whether the drift of a frame is known.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::{
///     ContactDetector, ContactOptions, Detection, DriftCorrection, DriftOutcome, ForceError, ReferenceFrame,
/// };
///
/// let options = ContactOptions::default().with_drift(DriftCorrection::Automatic);
/// let outcome = |at_rest: u8, now: u8| -> Result<DriftOutcome, ForceError> {
///     let reference = ReferenceFrame::new(Array2::from_elem((160, 160), at_rest).view())?;
///     let frame = Array2::from_elem((160, 160), now);
///     let found: Detection<f64> =
///         ContactDetector::new(options).detect_with(&mut Default::default(), frame.view(), &reference)?;
///     Ok(found.drift.outcome)
/// };
/// assert_eq!(outcome(100, 103)?, DriftOutcome::Corrected);
/// // A black background shows nothing of the illumination.
/// assert!(matches!(outcome(0, 0)?, DriftOutcome::TooDark { .. }));
/// # Ok::<(), ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum DriftOutcome {
    /// No correction was asked for.
    #[default]
    NotRequested,
    /// The drift was estimated and corrected.
    Corrected,
    /// The background is too dark beside its noise: the illumination would be known to no better than this standard error, where
    /// 0.5 % is required. Nothing was corrected.
    TooDark {
        /// Standard error of the relative illumination.
        standard_error: f64,
    },
    /// Less than half of the frame agrees on one illumination, as under a contact that covers most of it. Nothing was corrected.
    TooLittleBackground {
        /// Share of the tiles that agree.
        share: f64,
    },
}

impl DriftCorrection {
    pub(super) fn is_multiplicative(self) -> bool {
        matches!(
            self,
            Self::Illumination | Self::TiltedIllumination | Self::Automatic
        )
    }

    pub(super) fn terms(self) -> usize {
        match self {
            Self::None => 0,
            Self::Offset | Self::Illumination | Self::Automatic => 1,
            Self::Plane | Self::TiltedIllumination => 3,
        }
    }
}
