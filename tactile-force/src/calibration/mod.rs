//! From pixel values to force and stress: P = f(I), F_z = ∫P dS (equations (5) and (6)).
//!
//! A calibration is fitted from pairs of integrated pixel value V = Σ (I − I_ref) over the contact and known force F,
//! taken while loading and unloading. It gives F(V), its standard error and, shared out over the pixels in proportion
//! to their grey level, the stress
//!
//! ```text
//! P_ij = (I_ij − I_ref,ij) F(V) / (V A),   A = area of a pixel,   so that  Σ P_ij A = F(V)  exactly.
//! ```

mod histogram;
mod least_squares;
mod linear;
mod local;
mod options;
mod pair;
mod report;

pub use histogram::GreyHistogram;
pub use linear::LinearCalibration;
pub use local::LocalCalibration;
pub use options::{CalibrationOptions, Robustness};
pub use pair::{Branch, CalibrationPair};
pub use report::{CalibrationReport, Hysteresis};

use ndarray::Array2;

use tactile_core::Estimate;

/// A force read from a calibration.
///
/// ```
/// use tactile_force::{CalibrationPair, Estimate, LinearCalibration, StressCalibration};
///
/// let pairs = [(0.0, 0.01), (1e5, 0.49), (2e5, 1.01), (3e5, 1.49)].map(|(v, f)| CalibrationPair::loading(v, f));
/// let line = LinearCalibration::fit(&pairs, &Default::default())?;
/// let reading = line.read(Estimate::new(2.5e5, 400.0));
/// assert!(reading.noise_n < reading.calibration_n && !reading.out_of_range);
/// let both = reading.noise_n.hypot(reading.calibration_n);
/// assert!((reading.force_n.standard_error - both).abs() < 1e-15);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ForceReading {
    /// Force and its standard error from all sources, in newtons.
    pub force_n: Estimate,
    /// The part of the standard error that comes from noise in the frames, in newtons.
    pub noise_n: f64,
    /// The part of the standard error that comes from the calibration's parameters, in newtons: it is the same for
    /// every frame read with one calibration.
    pub calibration_n: f64,
    /// Degrees of freedom of the standard error, for Student's t: the calibration's share was estimated from the scatter of a
    /// few pairs, the frame's is known (Welch–Satterthwaite); `None` where the calibration adds no error.
    pub degrees_of_freedom: Option<f64>,
    /// The pixel value lies outside the range the calibration was fitted on.
    pub out_of_range: bool,
}

/// Pixel value to force and stress, equations (5) and (6).
///
/// V is the integrated pixel value: the sum of the grey-level differences over the contact.
///
/// ```
/// use tactile_force::{CalibrationPair, Estimate, LinearCalibration, StressCalibration};
///
/// let pairs = [0.0, 1e5, 2e5, 3e5].map(|v| CalibrationPair::loading(v, 5e-6 * v));
/// let line = LinearCalibration::fit(&pairs, &Default::default())?;
/// assert!((line.force_n(1e5) - 0.5).abs() < 1e-12 && (line.sensitivity_n(1e5) - 5e-6_f64).abs() < 1e-15);
/// assert_eq!(line.range(), [0.0, 3e5]);
/// // Exact pairs leave the parameters no error, at one value or between two.
/// assert!(line.standard_error_n(1e5) < 1e-12 && line.error_covariance_n2(1e5, 2e5).abs() < 1e-24);
/// assert!((line.integrated_pixel_value(0.5).unwrap() - 1e5).abs() < 1e-6);
/// assert!(line.report().r_squared > 0.999_999);
/// // A line of frame sums holds for contacts of one shape; it has no curve that holds pixel by pixel.
/// assert!(line.local().is_none());
/// // Stress of one grey level on pixels of (20 µm)².
/// let step = line.stress_per_grey_level_pa(1e5, 4e-10);
/// assert!((step - 12_500.0).abs() < 1e-6);
/// // Beyond the range: read, and flagged.
/// assert!(line.read(Estimate::new(4e5, 0.0)).out_of_range);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
pub trait StressCalibration: Send + Sync {
    /// Force at an integrated pixel value, in newtons.
    fn force_n(&self, integrated_pixel_value: f64) -> f64;

    /// dF/dV, in newtons per grey level.
    fn sensitivity_n(&self, integrated_pixel_value: f64) -> f64;

    /// Standard error of the force due to the uncertainty of the calibration's own parameters and to the difference of its branches
    /// ([`Hysteresis::width_n`]), in newtons.
    fn standard_error_n(&self, integrated_pixel_value: f64) -> f64;

    /// Covariance of the calibration's errors at two integrated pixel values, in N²; at one and the same it is the square of
    /// [`standard_error_n`](Self::standard_error_n). By default errors at all pixel values are fully correlated.
    fn error_covariance_n2(&self, a: f64, b: f64) -> f64 {
        self.standard_error_n(a) * self.standard_error_n(b)
    }

    /// Covariance matrix of forces read with this one calibration, in N²:
    /// C_ij = cov_cal(V_i, V_j) + δ_ij (dF/dV)² σ_V². The noise of the frames is each force's own, the calibration's error is
    /// shared. O(n²).
    ///
    /// ```
    /// use tactile_force::{CalibrationPair, Estimate, LinearCalibration, StressCalibration};
    /// let pairs: Vec<_> = [0.01, 0.48, 1.03, 1.5, 1.98]
    ///     .iter()
    ///     .zip(0..)
    ///     .map(|(f, k)| CalibrationPair::loading(1e5 * f64::from(k), *f))
    ///     .collect();
    /// let line = LinearCalibration::fit(&pairs, &Default::default())?;
    /// let values = [1e5, 3e5].map(|value| Estimate::new(value, 300.0));
    /// let covariance = line.force_covariance_n2(&values);
    /// let alone = line.read(values[1]).force_n.standard_error;
    /// assert!((covariance[[1, 1]].sqrt() - alone).abs() < 1e-12);
    /// assert_eq!(covariance[[0, 1]], covariance[[1, 0]]);
    /// # Ok::<(), tactile_force::ForceError>(())
    /// ```
    fn force_covariance_n2(&self, integrated_pixel_values: &[Estimate]) -> Array2<f64> {
        let n = integrated_pixel_values.len();
        Array2::from_shape_fn((n, n), |(i, j)| {
            let (a, b) = (
                integrated_pixel_values[i.min(j)],
                integrated_pixel_values[i.max(j)],
            );
            let shared = self.error_covariance_n2(a.value, b.value);
            let own = self.sensitivity_n(a.value) * a.standard_error;
            if i == j { shared + own * own } else { shared }
        })
    }

    /// The integrated pixel value of a force, or `None` where the curve does not take it exactly once.
    fn integrated_pixel_value(&self, force_n: f64) -> Option<f64>;

    /// The least and the greatest integrated pixel value of the fit.
    fn range(&self) -> [f64; 2];

    /// How well the calibration fits its pairs.
    fn report(&self) -> &CalibrationReport;

    /// The curve that holds pixel by pixel, if the calibration has one; by default it has none.
    fn local(&self) -> Option<&dyn LocalCalibration> {
        None
    }

    /// Force with its standard error: √((dF/dV)² σ_V² + σ_cal²).
    fn read(&self, integrated_pixel_value: Estimate) -> ForceReading {
        let v = integrated_pixel_value.value;
        let noise_n = (self.sensitivity_n(v) * integrated_pixel_value.standard_error).abs();
        let calibration_n = self.standard_error_n(v);
        let [low, high] = self.range();
        let standard_error = noise_n.hypot(calibration_n);
        let share = (calibration_n / standard_error).powi(4);
        let degrees = self.report().degrees_of_freedom as f64;
        ForceReading {
            force_n: Estimate::new(self.force_n(v), standard_error),
            noise_n,
            calibration_n,
            degrees_of_freedom: (share > 0.0).then(|| degrees / share),
            out_of_range: !(v >= low && v <= high),
        }
    }

    /// Stress per grey level of difference, in pascals, in a contact of the given integrated pixel value:
    /// F(V)/(V A). Where V is zero, its limit along the curve, (dF/dV)/A.
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
