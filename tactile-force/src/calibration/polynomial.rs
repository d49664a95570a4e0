//! The polynomial F = Σ c_k T_k(t(V)) in Chebyshev form.

use nalgebra::DMatrix;

use super::curve::{Basis, extremes, invert};
use super::options::CalibrationOptions;
use super::pair::{CalibrationPair, check_pairs};
use super::report::{self, CalibrationReport, Parameters, Shape};
use super::{StressCalibration, least_squares};
use crate::error::{ForceError, Requirement};
use crate::estimate::Real;

/// A polynomial from integrated pixel value to force, fitted in Chebyshev polynomials over the calibrated range so that high
/// degrees stay well conditioned.
///
/// ```
/// use tactile_force::{CalibrationPair, PolynomialCalibration, StressCalibration};
/// let force = |v: f64| 1e-6 * v + 2e-13 * v * v;
/// let pairs: Vec<_> = (0..12).map(|k| 1e5 * k as f64).map(|v| CalibrationPair::loading(v, force(v))).collect();
/// let curve = PolynomialCalibration::fit(&pairs, 2, &Default::default())?;
/// assert!((curve.force_n(3.3e5) - force(3.3e5)).abs() < 1e-12);
/// assert!(curve.report().monotone);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PolynomialCalibration<T> {
    middle: T,
    half: T,
    scale: Option<T>,
    coefficients: Vec<T>,
    /// Row-major covariance of the coefficients.
    covariance: Vec<T>,
    range: [T; 2],
    report: CalibrationReport<T>,
}

impl<T: Real> PolynomialCalibration<T> {
    /// Fits a polynomial of the given degree, at least 1; through the origin it has no constant term.
    ///
    /// A curve that falls somewhere in the range is accepted; the report says so, and it does not invert.
    ///
    /// # Errors
    /// Degree zero, fewer pairs than parameters + 1, a pair that is not finite, or too few different pixel values.
    pub fn fit(
        pairs: &[CalibrationPair<T>],
        degree: usize,
        options: &CalibrationOptions,
    ) -> Result<Self, ForceError> {
        Requirement::AtLeastOne.check("degree", degree as f64)?;
        let terms = if options.through_origin {
            degree
        } else {
            degree + 1
        };
        check_pairs(pairs, terms)?;
        let values: Vec<f64> = pairs
            .iter()
            .map(|p| p.integrated_pixel_value.as_f64())
            .collect();
        let forces: Vec<f64> = pairs.iter().map(|p| p.force_n.as_f64()).collect();
        let basis = spanned(&values, options.through_origin)?;
        let design = design(&basis, &values, terms);
        let fit = least_squares::solve(&design, &forces, options.robustness)?;
        let [low, high] = extremes(&values);
        let shape = shape(&basis, &fit.coefficients, low, high, &values, &forces)?;
        let parameters = Parameters::of(&fit);
        let cast = |values: &[f64]| values.iter().map(|&v| T::nearest(v)).collect::<Vec<T>>();
        Ok(Self {
            middle: T::nearest(basis.middle),
            half: T::nearest(basis.half),
            scale: basis.through_origin.map(T::nearest),
            coefficients: cast(&fit.coefficients),
            covariance: cast(fit.covariance.as_slice()),
            range: [T::nearest(low), T::nearest(high)],
            report: report::build(pairs, &fit, parameters, shape),
        })
    }

    /// Runs over the basis at V: (k, φ_k, φ_k′), in T so that nothing is allocated.
    fn each(&self, v: T, each: impl FnMut(usize, f64, f64)) {
        let basis = Basis {
            middle: self.middle.as_f64(),
            half: self.half.as_f64(),
            through_origin: self.scale.map(T::as_f64),
        };
        basis.each(v.as_f64(), self.coefficients.len(), each);
    }
}

/// The basis over values that differ.
fn spanned(values: &[f64], through_origin: bool) -> Result<Basis, ForceError> {
    let basis = Basis::over(values, through_origin);
    if basis.half <= 4.0 * f64::EPSILON * basis.middle.abs() {
        return Err(ForceError::DegeneratePairs {
            span: 2.0 * basis.half,
        });
    }
    Ok(basis)
}

/// One row a value, one column a polynomial.
fn design(basis: &Basis, values: &[f64], terms: usize) -> DMatrix<f64> {
    let mut design = DMatrix::zeros(values.len(), terms);
    for (i, &v) in values.iter().enumerate() {
        basis.each(v, terms, |k, value, _| design[(i, k)] = value);
    }
    design
}

/// Sensitivity, departure from the straight line and whether the curve rises, from its slope on a fine grid.
fn shape(
    basis: &Basis,
    coefficients: &[f64],
    low: f64,
    high: f64,
    values: &[f64],
    forces: &[f64],
) -> Result<Shape, ForceError> {
    let steps = 64 * coefficients.len();
    let grid: Vec<f64> = (0..=steps)
        .map(|k| low + (high - low) * k as f64 / steps as f64)
        .collect();
    let curve = |v: f64| basis.value(coefficients, v);
    Ok(Shape {
        linearity_error: report::linearity_error(values, forces, &grid, curve)?,
        sensitivity: (curve(high) - curve(low)) / (high - low),
        monotone: grid.iter().all(|&v| basis.slope(coefficients, v) >= 0.0),
    })
}

impl<T: Real> StressCalibration<T> for PolynomialCalibration<T> {
    fn force_n(&self, integrated_pixel_value: T) -> T {
        let mut sum = 0.0;
        self.each(integrated_pixel_value, |k, value, _| {
            sum += self.coefficients[k].as_f64() * value
        });
        T::nearest(sum)
    }

    fn sensitivity_n(&self, integrated_pixel_value: T) -> T {
        let mut sum = 0.0;
        self.each(integrated_pixel_value, |k, _, slope| {
            sum += self.coefficients[k].as_f64() * slope
        });
        T::nearest(sum)
    }

    fn standard_error_n(&self, integrated_pixel_value: T) -> T {
        self.error_covariance_n2(integrated_pixel_value, integrated_pixel_value)
            .max(T::zero())
            .sqrt()
    }

    fn error_covariance_n2(&self, a: T, b: T) -> T {
        let terms = self.coefficients.len();
        let mut covariance = 0.0;
        self.each(a, |i, a, _| {
            self.each(b, |j, b, _| {
                covariance += a * b * self.covariance[i * terms + j].as_f64()
            });
        });
        let branch = self.report.branch_error_n();
        T::nearest(covariance) + branch * branch
    }

    fn integrated_pixel_value(&self, force_n: T) -> Option<T> {
        let [low, high] = self.range.map(T::as_f64);
        let curve = |v: f64| self.force_n(T::nearest(v)).as_f64();
        let v = self
            .report
            .monotone
            .then(|| invert(low, high, force_n.as_f64(), curve))??;
        Some(T::nearest(v))
    }

    fn range(&self) -> [T; 2] {
        self.range
    }

    fn report(&self) -> &CalibrationReport<T> {
        &self.report
    }
}
