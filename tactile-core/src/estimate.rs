//! A number with its standard error, and the interval that follows from them.

#[cfg(feature = "intervals")]
use crate::statistics::quantile_95;
use crate::{InvalidOption, Requirement};
use std::fmt::{self, Display};
use std::ops::Mul;

/// A value, its standard error and the degrees of freedom of that error.
///
/// All three are in double precision, whatever the precision of the data they come from.
///
/// ```
/// use tactile_core::Estimate;
/// let force_n = Estimate::new(1.2, 0.003);
/// assert_eq!(format!("{force_n} N"), "1.2 ± 0.003 N");
/// // Converted to millinewtons.
/// assert_eq!((force_n * 1e3).standard_error, 3.0);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Deserialize),
    serde(try_from = "StoredEstimate")
)]
#[non_exhaustive]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Standard deviation of the value over repetitions: zero if it is unknown or negligible.
    pub standard_error: f64,
    /// Degrees of freedom of an estimated standard error: pairs minus parameters of a calibration,
    /// or parts of a jackknife minus one. `None` if the standard error is known.
    pub degrees_of_freedom: Option<f64>,
}

/// An estimate as stored in a file, before validation.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
struct StoredEstimate {
    value: f64,
    standard_error: f64,
    #[serde(default)]
    degrees_of_freedom: Option<f64>,
}

#[cfg(feature = "serde")]
impl TryFrom<StoredEstimate> for Estimate {
    type Error = InvalidOption;

    fn try_from(stored: StoredEstimate) -> Result<Self, InvalidOption> {
        let estimate = Self {
            value: stored.value,
            standard_error: stored.standard_error,
            degrees_of_freedom: stored.degrees_of_freedom,
        };
        estimate.validated()
    }
}

impl Estimate {
    /// Creates an estimate from a value and its standard error.
    #[must_use]
    pub const fn new(value: f64, standard_error: f64) -> Self {
        Self {
            value,
            standard_error,
            degrees_of_freedom: None,
        }
    }

    /// Creates an estimate with a negligible error.
    ///
    /// ```
    /// use tactile_core::Estimate;
    /// assert_eq!(Estimate::exact(3e-3), Estimate::new(3e-3, 0.0));
    /// ```
    #[must_use]
    pub const fn exact(value: f64) -> Self {
        Self::new(value, 0.0)
    }

    /// Creates an estimate from a value and its variance. A variance below zero, which rounding may
    /// cause, counts as zero.
    ///
    /// ```
    /// use tactile_core::Estimate;
    /// assert_eq!(Estimate::from_variance(2.0, 0.25), Estimate::new(2.0, 0.5));
    /// ```
    #[must_use]
    pub fn from_variance(value: f64, variance: f64) -> Self {
        Self::new(value, variance.max(0.0).sqrt())
    }

    /// Sets the degrees of freedom of a standard error that was estimated from few repetitions.
    /// Fewer degrees of freedom give a wider interval.
    ///
    /// ```
    /// use tactile_core::Estimate;
    /// let known = Estimate::new(0.12, 0.001);
    /// let estimated = known.with_degrees_of_freedom(5.0);
    /// assert!(estimated.interval_95().lower < known.interval_95().lower);
    /// ```
    #[must_use]
    pub const fn with_degrees_of_freedom(mut self, degrees: f64) -> Self {
        self.degrees_of_freedom = Some(degrees);
        self
    }

    /// The standard error divided by the magnitude of the value.
    ///
    /// ```
    /// use tactile_core::Estimate;
    /// assert_eq!(Estimate::new(-4.0, 1.0).relative_error(), 0.25);
    /// ```
    #[must_use]
    pub fn relative_error(self) -> f64 {
        self.standard_error / self.value.abs()
    }

    /// Returns the estimate if it is valid.
    ///
    /// # Errors
    /// [`InvalidOption`] for a value or a standard error that is not finite, a standard error below
    /// zero, and degrees of freedom that are not above zero.
    ///
    /// ```
    /// use tactile_core::Estimate;
    /// assert!(Estimate::new(1.2, 0.003).validated().is_ok());
    /// assert!(Estimate::new(1.2, -0.003).validated().is_err());
    /// assert!(Estimate::new(1.2, 0.003).with_degrees_of_freedom(0.0).validated().is_err());
    /// ```
    pub fn validated(self) -> Result<Self, InvalidOption> {
        Requirement::Finite.check("value", self.value)?;
        Requirement::NonNegative.check("standard_error", self.standard_error)?;
        let degrees = self.degrees_of_freedom.filter(|n| *n != f64::INFINITY);
        if let Some(degrees) = degrees {
            Requirement::Positive.check("degrees_of_freedom", degrees)?;
        }
        Ok(self)
    }

    /// The symmetric 95 % interval, value ± t·standard error. The factor t is the quantile of
    /// Student's distribution if the degrees of freedom are known, and of the normal distribution
    /// otherwise. The interval is unbounded if the standard error is invalid (below zero or NaN) or
    /// has no degrees of freedom.
    ///
    /// ```
    /// use tactile_core::Estimate;
    /// let interval = Estimate::new(10.0, 1.0).interval_95();
    /// assert!(interval.contains(11.9) && !interval.contains(12.0));
    /// // A line through two pairs has no degree of freedom, and its error is unknown.
    /// let line = Estimate::new(10.0, 1.0).with_degrees_of_freedom(0.0);
    /// assert_eq!(line.interval_95().upper, None);
    /// ```
    #[must_use]
    #[cfg(feature = "intervals")]
    pub fn interval_95(self) -> Interval {
        let half = quantile_95(self.degrees_of_freedom) * self.standard_error;
        if (0.0..f64::INFINITY).contains(&half) {
            Interval::new(self.value - half, Some(self.value + half))
        } else {
            Interval::new(f64::NEG_INFINITY, None)
        }
    }
}

/// Value, standard error, both ends of the 95 % interval and, if known, the degrees of freedom.
#[cfg(feature = "serde")]
impl serde::Serialize for Estimate {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        use serde::ser::SerializeStruct;
        let Interval { lower, upper } = self.interval_95();
        let degrees = self.degrees_of_freedom;
        let fields = 3 + usize::from(degrees.is_some());
        let mut out = serializer.serialize_struct("Estimate", fields)?;
        out.serialize_field("value", &self.value)?;
        out.serialize_field("standard_error", &self.standard_error)?;
        out.serialize_field("interval_95", &[lower, upper.unwrap_or(f64::INFINITY)])?;
        if degrees.is_some() {
            out.serialize_field("degrees_of_freedom", &degrees)?;
        }
        out.end()
    }
}

impl Mul<f64> for Estimate {
    type Output = Self;

    /// The estimate in another unit.
    fn mul(self, factor: f64) -> Self {
        Self {
            value: self.value * factor,
            // A change of sign affects the value, but not its spread.
            standard_error: self.standard_error * factor.abs(),
            ..self
        }
    }
}

impl Display for Estimate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Display::fmt(&self.value, f)?;
        f.write_str(" ± ")?;
        Display::fmt(&self.standard_error, f)
    }
}

/// A range that contains the true value with a stated probability.
///
/// ```
/// use tactile_core::Interval;
/// let at_least = Interval::new(20e3, None);
/// assert!(at_least.contains(1e9) && !at_least.contains(19e3));
/// // The ends are sorted.
/// assert_eq!(Interval::new(3.0, Some(1.0)), Interval::new(1.0, Some(3.0)));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct Interval {
    /// Lower limit.
    pub lower: f64,
    /// Upper limit. `None` if the data determine no upper limit.
    pub upper: Option<f64>,
}

impl Interval {
    /// The interval between two ends, of which the smaller becomes the lower limit.
    #[must_use]
    pub fn new(lower: f64, upper: Option<f64>) -> Self {
        match upper {
            Some(upper) if upper < lower => Self {
                lower: upper,
                upper: Some(lower),
            },
            _ => Self { lower, upper },
        }
    }

    /// Whether `x` lies in the interval, ends included.
    #[must_use]
    pub fn contains(&self, x: f64) -> bool {
        x >= self.lower && self.upper.is_none_or(|upper| x <= upper)
    }
}
