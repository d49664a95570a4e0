//! From pixel values to force and stress: P = f(I), F_z = ∫P dS, equations (5) and (6).
//!
//! A line ([`LinearCalibration`]) is fitted to pairs of integrated pixel value V = Σ (I − I_ref)
//! over the contact and known force F, taken while loading and unloading. It gives F(V) with its
//! standard error. Distributed over the pixels in proportion to their grey level, it also gives the
//! stress
//!
//! ```text
//! P_ij = (I_ij − I_ref,ij) F(V) / (V A),   A = area of a pixel,   so that  Σ P_ij A = F(V).
//! ```
//!
//! The line is valid for contacts shaped like those of the calibration. A local curve
//! ([`PressureCurve`]) from grey level to pressure is valid for any contact.

mod curve;
mod doubts;
mod line;

pub use curve::{
    CalibrationFrame, CurveHysteresis, PressureCurve, PressureCurveOptions, PressureCurveReport,
};
pub use doubts::LineDoubt;
pub use line::{Hysteresis, LineReport, LinearCalibration};

use ndarray::Array2;
use std::ops::Deref;
use tactile_core::{Estimate, Source, Uncertain};

use crate::error::ForceError;
use crate::noise::DifferenceNoise;

/// Relative standard error of a force on the way back from a larger one, if the calibration has
/// rising forces alone: evenly distributed within ± 5 %. Silicone rubbers lose up to a tenth of the
/// stored energy in a slow cycle.
const HYSTERESIS: f64 = 0.029;

/// A force read with a calibration.
///
/// ```
/// use tactile_force::{
///     CalibrationPair, Estimate, LinearCalibration, Source, StressCalibration,
/// };
///
/// let pairs = [(0.0, 0.01), (1e5, 0.49), (2e5, 1.01), (3e5, 1.49)];
/// let pairs = pairs.map(|(v, f)| CalibrationPair::loading(v, f));
/// let line = LinearCalibration::fit(&pairs)?;
/// let reading = line.read(Estimate::new(2.5e5, 400.0))?;
/// let part = |source| reading.force_n.part(source).abs();
/// assert!(part(Source::Noise) < part(Source::Calibration) && !reading.out_of_range);
/// // Four pairs minus two parameters, slightly increased because the noise is known.
/// assert!((2.0..3.0).contains(&reading.force_n.total().degrees_of_freedom.unwrap()));
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct ForceReading {
    /// Force in newtons with the errors of the frame's noise and of the calibration. The latter was
    /// estimated from a few pairs and is common to all frames that use the calibration.
    pub force_n: Uncertain,
    /// Whether the pixel value is outside the range of the calibration.
    pub out_of_range: bool,
}

impl ForceReading {
    /// Creates a force with the standard errors of the frame's noise and of the calibration. The
    /// latter has these degrees of freedom.
    ///
    /// ```
    /// use tactile_force::ForceReading;
    /// let reading = ForceReading::new(1.2, 3e-3, 4e-3, Some(4.0));
    /// assert!((reading.force_n.standard_error() - 5e-3).abs() < 1e-15 && !reading.out_of_range);
    /// let total = reading.force_n.total();
    /// assert!(total.degrees_of_freedom > Some(4.0), "the noise is known");
    /// ```
    #[must_use]
    pub fn new(force_n: f64, noise_n: f64, calibration_n: f64, degrees: Option<f64>) -> Self {
        let exact = Uncertain::exact(force_n);
        Self {
            force_n: exact.by(Source::Noise, noise_n).by_estimated(
                Source::Calibration,
                calibration_n,
                degrees,
            ),
            out_of_range: false,
        }
    }
}

/// From pixel value to force and stress, equations (5) and (6).
///
/// V is the integrated pixel value: the sum of the grey-level differences over the contact. A
/// user-defined calibration must give F(V). The other methods have defaults that suit a curve of
/// negligible error.
///
/// ```
/// use tactile_force::{Estimate, Source, StressCalibration};
///
/// /// Light that grows with the square of the force.
/// struct Root;
///
/// impl StressCalibration for Root {
///     fn force_n(&self, integrated_pixel_value: f64) -> f64 {
///         1e-3 * integrated_pixel_value.max(0.0).sqrt()
///     }
/// }
///
/// let reading = Root.read(Estimate::new(1e6, 2e3))?;
/// let force_n = reading.force_n;
/// assert_eq!((force_n.value, force_n.part(Source::Calibration)), (1.0, 0.0));
/// // dF/dV = ½ F/V.
/// assert!((force_n.part(Source::Noise) - 1e-3).abs() < 1e-9);
/// // Stress per grey level on pixels of (20 µm)².
/// assert!((Root.stress_per_grey_level_pa(1e6, 4e-10) - 2500.0).abs() < 1e-9);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
pub trait StressCalibration: Send + Sync {
    /// Force at an integrated pixel value, in newtons.
    fn force_n(&self, integrated_pixel_value: f64) -> f64;

    /// dF/dV, in newtons per grey level. The default is a central difference.
    fn sensitivity_n(&self, integrated_pixel_value: f64) -> f64 {
        let v = integrated_pixel_value;
        // The cube root of the rounding error balances rounding against the third derivative.
        let step = 1e-5 * v.abs().max(1.0);
        (self.force_n(v + step) - self.force_n(v - step)) / (2.0 * step)
    }

    /// Standard error of the force due to the calibration itself, in newtons: the uncertainty of
    /// its parameters, and the difference of its branches ([`Hysteresis::width_n`]). The default is
    /// zero.
    fn standard_error_n(&self, _integrated_pixel_value: f64) -> f64 {
        0.0
    }

    /// Degrees of freedom of this standard error: number of pairs minus number of parameters. The
    /// default is `None`, for a known error.
    fn degrees_of_freedom(&self) -> Option<f64> {
        None
    }

    /// Relative standard error of a force on the way back from a larger one, if the calibration has
    /// rising forces alone and does not show its hysteresis. Otherwise zero, the default.
    fn unknown_hysteresis(&self) -> f64 {
        0.0
    }

    /// Covariance of the calibration's errors at two integrated pixel values, in N². By default the
    /// errors at all pixel values are fully correlated.
    fn error_covariance_n2(&self, a: f64, b: f64) -> f64 {
        self.standard_error_n(a) * self.standard_error_n(b)
    }

    /// Covariance matrix of forces read with this calibration, in N²: C_ij = cov_cal(V_i, V_j) +
    /// δ_ij (dF/dV)² σ_V².
    ///
    /// The noise of the frames is independent; the error of the calibration is common. O(n²).
    ///
    /// ```
    /// use tactile_force::{CalibrationPair, Estimate, LinearCalibration, StressCalibration};
    /// let pairs = [(0.0, 0.01), (1e5, 0.48), (2e5, 1.03), (3e5, 1.5), (4e5, 1.98)];
    /// let pairs = pairs.map(|(v, f)| CalibrationPair::loading(v, f));
    /// let line = LinearCalibration::fit(&pairs)?;
    /// let values = [1e5, 3e5].map(|value| Estimate::new(value, 300.0));
    /// let covariance = line.force_covariance_n2(&values);
    /// let alone = line.read(values[1])?.force_n.standard_error();
    /// assert!((covariance[[1, 1]].sqrt() - alone).abs() < 1e-12);
    /// assert_eq!(covariance[[0, 1]], covariance[[1, 0]]);
    /// # Ok::<(), tactile_force::ForceError>(())
    /// ```
    fn force_covariance_n2(&self, integrated_pixel_values: &[Estimate]) -> Array2<f64> {
        let n = integrated_pixel_values.len();
        Array2::from_shape_fn((n, n), |(i, j)| {
            let a = integrated_pixel_values[i.min(j)];
            let b = integrated_pixel_values[i.max(j)];
            let shared = self.error_covariance_n2(a.value, b.value);
            let own = self.sensitivity_n(a.value) * a.standard_error;
            if i == j { shared + own * own } else { shared }
        })
    }

    /// Range of integrated pixel values for which the calibration is valid. The default is
    /// unlimited.
    fn range(&self) -> [f64; 2] {
        [f64::NEG_INFINITY, f64::INFINITY]
    }

    /// The curve that is valid pixel by pixel. The default is `None`.
    fn local(&self) -> Option<&dyn LocalCalibration> {
        None
    }

    /// Force with its standard error √((dF/dV)² σ_V² + σ_cal²).
    ///
    /// # Errors
    /// None by default. A user-defined calibration may return [`ForceError::custom`].
    fn read(&self, integrated_pixel_value: Estimate) -> Result<ForceReading, ForceError> {
        let v = integrated_pixel_value.value;
        let [low, high] = self.range();
        let noise_n = (self.sensitivity_n(v) * integrated_pixel_value.standard_error).abs();
        let (error, degrees) = (self.standard_error_n(v), self.degrees_of_freedom());
        Ok(ForceReading {
            out_of_range: !(v >= low && v <= high),
            ..ForceReading::new(self.force_n(v), noise_n, error, degrees)
        })
    }

    /// Stress per grey level of difference, in pascals, in a contact with the given integrated
    /// pixel value: F(V)/(V A). If V is zero, it is the limit along the curve, (dF/dV)/A.
    fn stress_per_grey_level_pa(&self, integrated_pixel_value: f64, pixel_area_m2: f64) -> f64 {
        let v = integrated_pixel_value;
        let secant = if v == 0.0 {
            self.sensitivity_n(v)
        } else {
            self.force_n(v) / v
        };
        secant / pixel_area_m2
    }
}

/// Implements the trait for boxed, shared and borrowed calibrations.
impl<P: Deref<Target: StressCalibration> + Send + Sync> StressCalibration for P {
    fn force_n(&self, integrated_pixel_value: f64) -> f64 {
        (**self).force_n(integrated_pixel_value)
    }

    fn sensitivity_n(&self, integrated_pixel_value: f64) -> f64 {
        (**self).sensitivity_n(integrated_pixel_value)
    }

    fn standard_error_n(&self, integrated_pixel_value: f64) -> f64 {
        (**self).standard_error_n(integrated_pixel_value)
    }

    fn unknown_hysteresis(&self) -> f64 {
        (**self).unknown_hysteresis()
    }

    fn degrees_of_freedom(&self) -> Option<f64> {
        (**self).degrees_of_freedom()
    }

    fn error_covariance_n2(&self, a: f64, b: f64) -> f64 {
        (**self).error_covariance_n2(a, b)
    }

    fn force_covariance_n2(&self, integrated_pixel_values: &[Estimate]) -> Array2<f64> {
        (**self).force_covariance_n2(integrated_pixel_values)
    }

    fn range(&self) -> [f64; 2] {
        (**self).range()
    }

    fn local(&self) -> Option<&dyn LocalCalibration> {
        (**self).local()
    }

    fn read(&self, integrated_pixel_value: Estimate) -> Result<ForceReading, ForceError> {
        (**self).read(integrated_pixel_value)
    }

    fn stress_per_grey_level_pa(&self, integrated_pixel_value: f64, pixel_area_m2: f64) -> f64 {
        (**self).stress_per_grey_level_pa(integrated_pixel_value, pixel_area_m2)
    }
}

/// From grey level to pressure, pixel by pixel: f of (5) itself, rather than its integral over a
/// contact.
///
/// A [`StressCalibration`] returns one from [`local`](StressCalibration::local). A
/// [`ForceMeter`](crate::ForceMeter) then fits the contact radius to the pressure instead of the
/// light. A user-defined curve must give the pressure of a grey level.
///
/// ```
/// use tactile_force::{DifferenceNoise, Estimate, GreyHistogram, LocalCalibration};
///
/// /// Light exactly proportional to the pressure.
/// struct Proportional {
///     pa_per_grey: f64,
/// }
///
/// impl LocalCalibration for Proportional {
///     fn pressure_pa(&self, grey: f64) -> Estimate {
///         Estimate::exact(self.pa_per_grey * grey)
///     }
/// }
///
/// let histogram = GreyHistogram::from_differences([50.0; 200].into_iter(), 4e-10);
/// let reading =
///     Proportional { pa_per_grey: 100.0 }.read(&histogram, &DifferenceNoise::white(2.0))?;
/// assert!((reading.force_n.value - 4e-4).abs() < 1e-15);
/// // 200 pixels with √2 grey levels of noise each.
/// assert!((reading.force_n.standard_error() - 100.0 * 4e-10 * 400_f64.sqrt()).abs() < 1e-15);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
pub trait LocalCalibration: Send + Sync {
    /// Pressure in pascals of a grey-level difference, with its standard error. It increases with
    /// the grey level and is zero at zero.
    fn pressure_pa(&self, grey: f64) -> Estimate;

    /// The value of [`pressure_pa`](Self::pressure_pa) without its error, for tables.
    fn value_pa(&self, grey: f64) -> f64 {
        self.pressure_pa(grey).value
    }

    /// Force of a contact from its histogram, Σ A(g) f(g), with its errors. By default those of all
    /// grey levels are fully correlated.
    ///
    /// # Errors
    /// None by default. A user-defined curve may return [`ForceError::custom`].
    fn read(
        &self,
        histogram: &GreyHistogram,
        noise: &DifferenceNoise,
    ) -> Result<ForceReading, ForceError> {
        let slope = |grey: f64| self.value_pa(grey + 0.5) - self.value_pa(grey - 0.5);
        let noise_n = histogram.noise(noise, slope);
        let error = histogram.integral(|grey| self.pressure_pa(grey).standard_error);
        let force_n = histogram.integral(|grey| self.value_pa(grey));
        let degrees = self.pressure_pa(histogram.greatest()).degrees_of_freedom;
        Ok(ForceReading::new(force_n, noise_n, error, degrees))
    }
}

/// Implements the trait for boxed, shared and borrowed calibrations.
impl<P: Deref<Target: LocalCalibration> + Send + Sync> LocalCalibration for P {
    fn pressure_pa(&self, grey: f64) -> Estimate {
        (**self).pressure_pa(grey)
    }

    fn value_pa(&self, grey: f64) -> f64 {
        (**self).value_pa(grey)
    }

    fn read(
        &self,
        histogram: &GreyHistogram,
        noise: &DifferenceNoise,
    ) -> Result<ForceReading, ForceError> {
        (**self).read(histogram, noise)
    }
}

/// The area of a contact by grey-level difference from the reference, with one bin per grey level.
///
/// A difference between two integer grey levels is distributed between both bins, so that area and
/// integral of the differences are exact. The integral of a curve f over the contact is Σ A(g)
/// f(g).
///
/// ```
/// use ndarray::array;
/// use tactile_force::GreyHistogram;
///
/// let differences = array![10.0, 10.0, 20.25];
/// let histogram = GreyHistogram::from_differences(differences.iter().copied(), 1e-10);
/// assert!((histogram.area_m2() - 3e-10).abs() < 1e-22);
/// assert!((histogram.integral(|grey| grey) - 40.25e-10).abs() < 1e-20);
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct GreyHistogram {
    /// Bins from −256 to 256 grey levels.
    area_m2: Vec<f64>,
    pixel_area_m2: f64,
}

impl Default for GreyHistogram {
    fn default() -> Self {
        Self {
            area_m2: vec![0.0; 513],
            pixel_area_m2: 0.0,
        }
    }
}

impl GreyHistogram {
    /// Sorts the differences of a contact's pixels, in grey levels, each covering `pixel_area_m2`.
    /// Differences beyond ±255 count as ±255, and NaN is skipped.
    pub fn from_differences(differences: impl Iterator<Item = f32>, pixel_area_m2: f64) -> Self {
        let mut histogram = Self::default();
        histogram.clear(pixel_area_m2);
        differences
            .filter(|d| !d.is_nan())
            .for_each(|d| histogram.add_many(d, 1.0));
        histogram
    }

    /// Area of the contact in square metres.
    pub fn area_m2(&self) -> f64 {
        self.area_m2.iter().sum()
    }

    /// ∫ f dS over the contact, Σ A(g) f(g), for a function of the grey-level difference.
    pub fn integral(&self, mut f: impl FnMut(f64) -> f64) -> f64 {
        self.bins().map(|(grey, area)| area * f(grey)).sum()
    }

    /// Empties the bins for a contact whose pixels each cover this area.
    pub(crate) fn clear(&mut self, pixel_area_m2: f64) {
        self.area_m2.fill(0.0);
        self.pixel_area_m2 = pixel_area_m2;
    }

    /// Adds a number of pixels with the same difference.
    pub(crate) fn add_many(&mut self, difference: f32, pixels: f64) {
        let place = f64::from(difference.clamp(-255.0, 255.0)) + 256.0;
        let below = place as usize;
        let (share, area) = (place - below as f64, pixels * self.pixel_area_m2);
        // Distributed in proportion, the first moment of the bins is that of the difference.
        self.area_m2[below] += (1.0 - share) * area;
        self.area_m2[below + 1] += share * area;
    }

    /// Grey level and area of the bins that are not empty.
    fn bins(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let bins = self.area_m2.iter().enumerate();
        bins.filter(|(_, area)| **area != 0.0)
            .map(|(bin, area)| (bin as f64 - 256.0, *area))
    }

    /// The largest grey level of the contact.
    fn greatest(&self) -> f64 {
        self.bins().map(|(grey, _)| grey).fold(0.0, f64::max)
    }

    /// Standard error of ∫ f dS because of the noise of the pixels, for a curve f with this slope:
    /// white noise of each pixel, and errors common to all pixels.
    fn noise(&self, noise: &DifferenceNoise, slope: impl Fn(f64) -> f64) -> f64 {
        let (mut white, mut common, mut scale) = (0.0, 0.0, 0.0);
        for (grey, area) in self.bins() {
            let slope = slope(grey);
            white += area * slope * slope * (noise.background + noise.gain * grey.max(0.0));
            common += area * slope;
            scale += area * slope * grey;
        }
        // Both come from one estimate of the drift, so they are added before squaring.
        let shared = common * noise.common.sqrt() + scale * noise.scale.sqrt();
        (white * self.pixel_area_m2 + shared * shared + noise.flat_field * scale * scale).sqrt()
    }
}

/// Whether the force was rising or falling when a pair was taken.
///
/// ```
/// use tactile_force::{Branch, CalibrationPair};
///
/// assert_eq!(CalibrationPair::loading(1e5, 0.5).branch, Branch::Loading);
/// assert_eq!(CalibrationPair::unloading(1e5, 0.5).branch, Branch::Unloading);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Branch {
    /// The force was rising.
    #[default]
    Loading,
    /// The force was falling.
    Unloading,
}

/// One calibration measurement.
///
/// ```
/// use tactile_force::CalibrationPair;
///
/// // A gauge's readings up and down again.
/// let mut pairs = [(0.0, 0.0), (1.02e5, 0.5), (2.01e5, 1.0)]
///     .map(|(v, f)| CalibrationPair::loading(v, f))
///     .to_vec();
/// pairs.push(CalibrationPair::unloading(0.99e5, 0.5));
/// assert_eq!(pairs[3].force_n, 0.5);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CalibrationPair {
    /// Sum of the grey-level differences over the contact.
    pub integrated_pixel_value: f64,
    /// Force from a reference instrument, in newtons.
    pub force_n: f64,
    /// Whether the force was rising or falling.
    pub branch: Branch,
}

impl CalibrationPair {
    /// A pair taken while the force was rising.
    pub fn loading(integrated_pixel_value: f64, force_n: f64) -> Self {
        Self {
            integrated_pixel_value,
            force_n,
            branch: Branch::Loading,
        }
    }

    /// A pair taken while the force was falling.
    pub fn unloading(integrated_pixel_value: f64, force_n: f64) -> Self {
        Self {
            branch: Branch::Unloading,
            ..Self::loading(integrated_pixel_value, force_n)
        }
    }
}
