//! A number whose error is split by source.

use crate::Estimate;
use crate::statistics::effective_degrees_of_freedom;
use std::fmt::{self, Display};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Source of the error of a measured number.
///
/// Errors from one source are fully correlated: a pixel size that is wrong by 0.3 % affects every
/// length in the same way. Only [`Noise`](Self::Noise) is independent in every number.
///
/// ```
/// use tactile_core::Source;
/// assert_eq!(Source::PixelSize.to_string(), "the size of a pixel");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "snake_case")
)]
#[non_exhaustive]
pub enum Source {
    /// Noise of a frame or of a force gauge.
    Noise,
    /// The calibration of light to force.
    Calibration,
    /// Difference in optical coupling between the object and the calibration object.
    Coupling,
    /// The scale of the forces: of the gauge, and of light that is uneven or has changed since
    /// calibration.
    Gain,
    /// Size of a pixel on the sensing surface.
    PixelSize,
    /// The assumed profile of the contact, and contacts that deviate from it.
    Profile,
    /// Size of the object.
    ObjectSize,
    /// Poisson's ratio of the object.
    PoissonRatio,
    /// Moduli, thicknesses and Poisson's ratios of the layers of the guide.
    Guide,
    /// Adhesion of a ball.
    Adhesion,
    /// The contact law.
    Law,
    /// A source defined by the caller, numbered from 0 to 4. Higher numbers count as 4.
    Own(u8),
}

/// Number of sources defined by the caller.
const OWN: usize = 5;
const COUNT: usize = 11 + OWN;

impl Source {
    /// All sources, in the order of their indices.
    pub const ALL: [Self; COUNT] = [
        Self::Noise,
        Self::Calibration,
        Self::Coupling,
        Self::Gain,
        Self::PixelSize,
        Self::Profile,
        Self::ObjectSize,
        Self::PoissonRatio,
        Self::Guide,
        Self::Adhesion,
        Self::Law,
        Self::Own(0),
        Self::Own(1),
        Self::Own(2),
        Self::Own(3),
        Self::Own(4),
    ];

    fn place(self) -> usize {
        match self {
            Self::Noise => 0,
            Self::Calibration => 1,
            Self::Coupling => 2,
            Self::Gain => 3,
            Self::PixelSize => 4,
            Self::Profile => 5,
            Self::ObjectSize => 6,
            Self::PoissonRatio => 7,
            Self::Guide => 8,
            Self::Adhesion => 9,
            Self::Law => 10,
            Self::Own(number) => COUNT - OWN + usize::from(number).min(OWN - 1),
        }
    }
}

impl Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Noise => "noise of the frames",
            Self::Calibration => "the calibration of the force",
            Self::Coupling => "the optical coupling of the object",
            Self::Gain => "the scale of the force",
            Self::PixelSize => "the size of a pixel",
            Self::Profile => "the profile of the contact",
            Self::ObjectSize => "the object's size",
            Self::PoissonRatio => "the object's Poisson ratio",
            Self::Guide => "the guide's layers",
            Self::Adhesion => "adhesion",
            Self::Law => "the contact law",
            Self::Own(number) => return write!(f, "source {number}"),
        })
    }
}

/// A value with the signed standard deviation from each [`Source`], propagated to first order. For
/// y = f(x₁, x₂, …) the part of a source is Σ ∂f/∂xᵢ pᵢ, with the signed parts pᵢ of that source.
/// The part of noise is √(Σ (∂f/∂xᵢ pᵢ)²). No allocation.
///
/// Noise is assumed to be independent in the two operands: for the square of a number use
/// [`powf`](Self::powf), not its product with itself.
///
/// ```
/// use tactile_core::{Source, Uncertain};
/// // Two radii measured with the same pixels, whose size is known to 0.3 %.
/// let pixel_m = Uncertain::exact(20e-6).by_relative(Source::PixelSize, 3e-3);
/// let [first, second] = [100.0, 120.0].map(|px| pixel_m * Uncertain::exact(px).by(Source::Noise, 0.1));
/// // Their ratio does not depend on the size: only noise of 0.1 % and 0.083 % remains.
/// let ratio = second / first;
/// assert!((ratio.total().relative_error() - 1.3e-3).abs() < 2e-6);
/// assert!(ratio.part(Source::PixelSize).abs() < 1e-15);
/// // The relative error of the area of a disc is twice that of the radius.
/// let area = first.powf(2.0) * std::f64::consts::PI;
/// assert!((area.part(Source::PixelSize) / area.value - 6e-3).abs() < 1e-12);
/// assert!(area.share(Source::PixelSize) > 0.89, "of its variance");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Uncertain {
    /// The value.
    pub value: f64,
    parts: [f64; COUNT],
    /// Degrees of freedom of each part: infinite if the part is known.
    degrees: [f64; COUNT],
}

impl Default for Uncertain {
    fn default() -> Self {
        Self::exact(0.0)
    }
}

impl Uncertain {
    /// Creates a value without error.
    #[must_use]
    pub const fn exact(value: f64) -> Self {
        Self {
            value,
            parts: [0.0; COUNT],
            degrees: [f64::INFINITY; COUNT],
        }
    }

    /// Creates a number from an estimate whose error comes from one source. A negative error is
    /// invalid and becomes NaN.
    ///
    /// ```
    /// use tactile_core::{Estimate, Source, Uncertain};
    /// let gain = Estimate::new(0.9, 0.01).with_degrees_of_freedom(3.0);
    /// assert_eq!(Uncertain::of(gain, Source::Coupling).total(), gain);
    /// ```
    #[must_use]
    pub fn of(estimate: Estimate, source: Source) -> Self {
        let error = estimate.standard_error;
        let error = if error < 0.0 { f64::NAN } else { error };
        let degrees = estimate.degrees_of_freedom;
        Self::exact(estimate.value).by_estimated(source, error, degrees)
    }

    /// Adds a standard deviation from a source. It is positive if a positive error of the source
    /// increases the value. If there is already a part of the same source, the two are independent:
    /// their squares add up.
    #[must_use]
    pub fn by(self, source: Source, standard_deviation: f64) -> Self {
        self.by_estimated(source, standard_deviation, None)
    }

    /// Like [`by`](Self::by), relative to the value.
    #[must_use]
    pub fn by_relative(self, source: Source, standard_deviation: f64) -> Self {
        self.by(source, standard_deviation * self.value)
    }

    /// Like [`by`](Self::by), but for a standard deviation that was estimated with these degrees of
    /// freedom.
    #[must_use]
    pub fn by_estimated(mut self, source: Source, sd: f64, degrees: Option<f64>) -> Self {
        let place = source.place();
        let one = (self.parts[place], self.degrees[place]);
        let (size, degrees) = beside(one, (sd, degrees.unwrap_or(f64::INFINITY)));
        let sign = if one.0 == 0.0 { sd } else { one.0 };
        (self.parts[place], self.degrees[place]) = (size.copysign(sign), degrees);
        self
    }

    /// The signed standard deviation from a source.
    #[must_use]
    pub fn part(&self, source: Source) -> f64 {
        self.parts[source.place()]
    }

    /// The degrees of freedom of the part from a source. `None` if the part is known.
    #[must_use]
    pub fn degrees_of_freedom(&self, source: Source) -> Option<f64> {
        Some(self.degrees[source.place()]).filter(|n| *n != f64::INFINITY)
    }

    /// The sources with an error and their signed standard deviations: the uncertainty budget of
    /// the number.
    ///
    /// ```
    /// use tactile_core::{Source, Uncertain};
    /// let force_n = Uncertain::exact(1.0).by(Source::Noise, 3e-3).by(Source::Gain, 4e-3);
    /// let budget: Vec<_> = force_n.parts().collect();
    /// assert_eq!(budget, [(Source::Noise, 3e-3), (Source::Gain, 4e-3)]);
    /// ```
    pub fn parts(&self) -> impl Iterator<Item = (Source, f64)> + use<> {
        let all = Source::ALL.into_iter().zip(self.parts);
        all.filter(|(_, part)| *part != 0.0)
    }

    /// Limits the standard deviation from a source to `limit`; the excess counts as noise. This
    /// separates the part of an error that the number has in common with others.
    ///
    /// ```
    /// use tactile_core::{Source, Uncertain};
    /// let force_n = Uncertain::exact(1.0).by(Source::Calibration, 5e-3);
    /// let apart = force_n.with_excess_as_noise(Source::Calibration, 3e-3);
    /// assert_eq!(apart.part(Source::Calibration), 3e-3);
    /// assert!((apart.part(Source::Noise) - 4e-3).abs() < 1e-15);
    /// ```
    #[must_use]
    pub fn with_excess_as_noise(mut self, source: Source, limit: f64) -> Self {
        let place = source.place();
        let (part, degrees) = (self.parts[place], self.degrees_of_freedom(source));
        let excess = (part * part - limit * limit).max(0.0).sqrt();
        self.parts[place] = part.signum() * part.abs().min(limit);
        self.by_estimated(Source::Noise, excess, degrees)
    }

    /// The number without the error from a source.
    ///
    /// ```
    /// use tactile_core::{Source, Uncertain};
    /// let force_n = Uncertain::exact(1.0).by(Source::Noise, 3e-3).by(Source::Gain, 4e-3);
    /// assert_eq!(force_n.without(Source::Noise).standard_error(), 4e-3);
    /// ```
    #[must_use]
    pub fn without(mut self, source: Source) -> Self {
        let place = source.place();
        (self.parts[place], self.degrees[place]) = (0.0, f64::INFINITY);
        self
    }

    /// The standard error from all sources.
    #[must_use]
    pub fn standard_error(&self) -> f64 {
        // Most sources contribute nothing, and `hypot` is slower than the test.
        let parts = self.parts.iter().filter(|part| **part != 0.0);
        parts.fold(0.0, |sum: f64, part| sum.hypot(*part))
    }

    /// The standard error divided by the magnitude of the value.
    #[must_use]
    pub fn relative_error(&self) -> f64 {
        self.standard_error() / self.value.abs()
    }

    /// Value and standard error, with the degrees of freedom that follow from those of the sources
    /// ([`effective_degrees_of_freedom`]).
    #[must_use]
    pub fn total(&self) -> Estimate {
        let parts = Source::ALL.map(|source| {
            let degrees = self.degrees_of_freedom(source);
            (self.part(source).powi(2), degrees)
        });
        let mut total = Estimate::new(self.value, self.standard_error());
        total.degrees_of_freedom = effective_degrees_of_freedom(&parts);
        total
    }

    /// Fraction of the variance from a source, from 0 to 1. It is zero for an exact number.
    #[must_use]
    pub fn share(&self, source: Source) -> f64 {
        let total = self.standard_error();
        if total > 0.0 {
            (self.part(source) / total).powi(2)
        } else {
            0.0
        }
    }

    /// The covariance with another number. All sources but noise contribute.
    ///
    /// ```
    /// use tactile_core::{Source, Uncertain};
    /// let force_n = Uncertain::exact(1.0).by(Source::Noise, 1e-3).by(Source::Gain, 2e-3);
    /// assert_eq!(force_n.covariance(&force_n), 4e-6);
    /// assert_eq!(force_n.covariance(&-force_n), -4e-6);
    /// ```
    #[must_use]
    pub fn covariance(&self, other: &Self) -> f64 {
        let noise = Source::Noise.place();
        let parts = self.parts.iter().zip(&other.parts).enumerate();
        parts
            .filter(|(place, _)| *place != noise)
            .map(|(_, (one, other))| one * other)
            .sum()
    }

    /// f of the number, from its value and its slope at the number.
    ///
    /// ```
    /// use tactile_core::{Source, Uncertain};
    /// let force_n = Uncertain::exact(2.0).by_relative(Source::Gain, 0.01);
    /// let logarithm = force_n.map(f64::ln, |n| 1.0 / n);
    /// assert!((logarithm.part(Source::Gain) - 0.01).abs() < 1e-15);
    /// ```
    #[must_use]
    pub fn map(self, f: impl FnOnce(f64) -> f64, slope: impl FnOnce(f64) -> f64) -> Self {
        let (value, slope) = (f(self.value), slope(self.value));
        Self {
            value,
            ..self * slope
        }
    }

    /// The number raised to a power.
    #[must_use]
    pub fn powf(self, power: f64) -> Self {
        self.map(|x| x.powf(power), |x| power * x.powf(power - 1.0))
    }

    /// The mean of several numbers: 0/0 if there are none. Only noise is reduced by averaging.
    ///
    /// ```
    /// use tactile_core::{Source, Uncertain};
    /// let frame = Uncertain::exact(1.0).by(Source::Noise, 0.02).by(Source::Calibration, 0.01);
    /// let mean = Uncertain::mean(&[frame; 4]);
    /// assert_eq!((mean.part(Source::Noise), mean.part(Source::Calibration)), (0.01, 0.01));
    /// ```
    #[must_use]
    pub fn mean(numbers: &[Self]) -> Self {
        let sum = numbers.iter().fold(Self::exact(0.0), |sum, x| sum + *x);
        sum * (numbers.len() as f64).recip()
    }

    /// a x + b y with a given `value`: the form of every operation on two numbers.
    fn combined(self, a: f64, other: Self, b: f64, value: f64) -> Self {
        // A correlated error has the degrees of freedom of its least certain part.
        let mut sum = Self {
            value,
            parts: std::array::from_fn(|k| a * self.parts[k] + b * other.parts[k]),
            degrees: std::array::from_fn(|k| self.degrees[k].min(other.degrees[k])),
        };
        let noise = Source::Noise.place();
        let one = (a * self.parts[noise], self.degrees[noise]);
        let other = (b * other.parts[noise], other.degrees[noise]);
        (sum.parts[noise], sum.degrees[noise]) = beside(one, other);
        sum
    }
}

/// Standard deviation and degrees of freedom of the sum of two independent errors.
fn beside(one: (f64, f64), other: (f64, f64)) -> (f64, f64) {
    if other.0 == 0.0 {
        return one;
    }
    if one.0 == 0.0 {
        return other;
    }
    let part = |(sd, degrees): (f64, f64)| (sd * sd, Some(degrees).filter(|n| n.is_finite()));
    let degrees = effective_degrees_of_freedom(&[part(one), part(other)]);
    (one.0.hypot(other.0), degrees.unwrap_or(f64::INFINITY))
}

/// An estimate without a source: all of its error counts as noise.
impl From<Estimate> for Uncertain {
    fn from(estimate: Estimate) -> Self {
        Self::of(estimate, Source::Noise)
    }
}

impl Neg for Uncertain {
    type Output = Self;

    fn neg(self) -> Self {
        self * -1.0
    }
}

impl Mul<f64> for Uncertain {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        Self {
            value: self.value * factor,
            parts: self.parts.map(|part| part * factor),
            ..self
        }
    }
}

impl Add for Uncertain {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        self.combined(1.0, other, 1.0, self.value + other.value)
    }
}

impl Sub for Uncertain {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self.combined(1.0, other, -1.0, self.value - other.value)
    }
}

impl Mul for Uncertain {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        self.combined(other.value, other, self.value, self.value * other.value)
    }
}

impl Div for Uncertain {
    type Output = Self;

    fn div(self, other: Self) -> Self {
        let ratio = self.value / other.value;
        self.combined(other.value.recip(), other, -ratio / other.value, ratio)
    }
}

/// Like the total [`Estimate`]: `1.2 ± 0.003`.
impl Display for Uncertain {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.total().fmt(f)
    }
}

#[cfg(feature = "serde")]
mod with_serde {
    use super::{Source, Uncertain};
    use crate::Estimate;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    /// The part of one source.
    #[derive(Clone, Copy, Serialize, Deserialize)]
    struct Part {
        source: Source,
        standard_error: f64,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        degrees_of_freedom: Option<f64>,
    }

    /// The total and its parts.
    #[derive(Serialize)]
    struct Written {
        #[serde(flatten)]
        total: Estimate,
        by_source: Vec<Part>,
    }

    impl Serialize for Uncertain {
        fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
            let part = |(source, standard_error)| Part {
                source,
                standard_error,
                degrees_of_freedom: self.degrees_of_freedom(source),
            };
            Written {
                total: self.total(),
                by_source: self.parts().map(part).collect(),
            }
            .serialize(serializer)
        }
    }

    impl<'de> Deserialize<'de> for Uncertain {
        /// From the value and the parts, or from an [`Estimate`].
        fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
            #[derive(Deserialize)]
            struct Read {
                #[serde(flatten)]
                total: Estimate,
                by_source: Option<Vec<Part>>,
            }
            let Read { total, by_source } = Read::deserialize(deserializer)?;
            Ok(match by_source {
                None => total.into(),
                Some(parts) => parts.iter().fold(Self::exact(total.value), |number, part| {
                    number.by_estimated(part.source, part.standard_error, part.degrees_of_freedom)
                }),
            })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_source_has_a_place_of_its_own() {
        for (place, source) in Source::ALL.into_iter().enumerate() {
            assert_eq!(source.place(), place);
        }
        assert_eq!(Source::Own(u8::MAX).place(), Source::Own(4).place());
    }

    #[test]
    fn what_one_error_moves_both_ways_cancels() {
        let scale = Uncertain::exact(3.0).by(Source::PixelSize, 0.1);
        let number = scale * Uncertain::exact(2.0).by(Source::Own(0), 0.01);
        assert_eq!((number / scale).part(Source::PixelSize), 0.0);
        assert!((number - scale * 2.0).part(Source::PixelSize).abs() < 1e-16);
        // Noise does not cancel.
        let noisy = Uncertain::exact(3.0).by(Source::Noise, 0.3);
        assert!(((noisy - noisy).standard_error() - 0.18_f64.sqrt()).abs() < 1e-15);
        assert_eq!(noisy.covariance(&noisy), 0.0);
    }

    #[test]
    fn degrees_of_freedom_follow_the_sources() {
        let one = Uncertain::exact(1.0).by(Source::Noise, 3e-3).by_estimated(
            Source::Calibration,
            4e-3,
            Some(4.0),
        );
        let parts = [(9e-6, None), (16e-6, Some(4.0))];
        assert_eq!(
            one.total().degrees_of_freedom,
            effective_degrees_of_freedom(&parts)
        );
        let other = Uncertain::exact(1.0).by_estimated(Source::Calibration, 1e-3, Some(2.0));
        let sum = one.without(Source::Noise) + other;
        assert_eq!(sum.total().degrees_of_freedom, Some(2.0), "the least known");
        let known = Uncertain::exact(5.0).by(Source::Gain, 0.1);
        assert_eq!((known * 2.0).total().degrees_of_freedom, None);
    }
}
