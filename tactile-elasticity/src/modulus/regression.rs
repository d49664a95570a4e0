//! Young's modulus as the slope of stress over strain.

use super::estimate::{
    EstimatorKind, FitStatistics, LoadDiagnostics, ModulusEstimate, ModulusEstimator, Warning,
};
use super::load::{LoadSeries, LoadState, derived, validated};
use super::ratio::{LINEAR_STRAIN, strain_warnings, stress};
use super::statistics::{chi_squared_tail, fewest, t_tail};
use crate::error::{ElasticityError, Quantity};
use crate::strain::StrainMeasure;
use nalgebra::Matrix3;
use tactile_core::statistics::{effective_degrees_of_freedom, quantile_95};
use tactile_core::{Estimate, Interval};

/// S_i = S₀ + E e_i over many loads, with errors in both.
///
/// Each load weighs 1/(σ_S² + E²σ_e²) (York's effective variance without correlation). Without any
/// standard errors all weigh the same and the error is estimated from the scatter. At least two
/// loads, three where neither errors nor a zero intercept are given.
///
/// ```
/// use tactile_elasticity::modulus::{
///     Estimate, LoadSeries, LoadState, ModulusEstimator, StressStrainRegression,
/// };
/// let load = |stress: f64, strain: f64| {
///     LoadState {
///         contact_area_m2: Some(Estimate::exact(1e-6)), // one square millimetre
///         mean_strain: Some(Estimate::new(strain, 1e-4)),
///         ..LoadState::new(Estimate::new(stress * 1e-6, 1e-5))
///     }
/// };
/// let loads = LoadSeries::new([load(600.0, 0.01), load(1200.0, 0.02), load(2400.0, 0.04)]);
/// let modulus = StressStrainRegression::default().estimate(&loads)?;
/// assert!((modulus.youngs_modulus_pa - 60e3).abs() < 1e-6);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StressStrainRegression {
    zero_at_origin: bool,
}

impl StressStrainRegression {
    /// The line goes through the origin. By default it has an intercept, which is tested: a
    /// significant one is warned of.
    ///
    /// ```
    /// use tactile_elasticity::modulus::{
    ///     Estimate, LoadSeries, LoadState, ModulusEstimator, StressStrainRegression, Warning,
    /// };
    ///
    /// // Stress that starts at 300 Pa: a gauge that was not tared.
    /// let loads = [0.01, 0.02, 0.03, 0.04].map(|strain: f64| LoadState {
    ///     contact_area_m2: Some(Estimate::exact(1e-4)),
    ///     mean_strain: Some(Estimate::exact(strain)),
    ///     ..LoadState::new(Estimate::new((300.0 + 60e3 * strain) * 1e-4, 1e-4))
    /// });
    /// let (loads, line) = (LoadSeries::new(loads), StressStrainRegression::default());
    /// let tested = line.estimate(&loads)?;
    /// assert!(
    ///     tested
    ///         .warnings
    ///         .iter()
    ///         .any(|w| matches!(w, Warning::Intercept { .. }))
    /// );
    /// let forced = line.with_zero_at_origin().estimate(&loads)?;
    /// assert!(forced.youngs_modulus_pa > tested.youngs_modulus_pa);
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn with_zero_at_origin(mut self) -> Self {
        self.zero_at_origin = true;
        self
    }

    fn points(loads: &[LoadState]) -> Result<Vec<Point>, ElasticityError> {
        let mut points = Vec::new();
        for (load, state) in loads.iter().enumerate() {
            if let Some(strain) = state.mean_strain {
                points.push(Point {
                    load,
                    strain: validated(strain, Quantity::Strain)?,
                    stress: stress(load, state)?,
                });
            }
        }
        Ok(points)
    }

    /// The line with a slope above zero.
    fn line(&self, points: &[Point]) -> Result<Line, ElasticityError> {
        let known = Self::known(points);
        self.check(points, known)?;
        let line = Line::fit(points, !self.zero_at_origin, known);
        if line.slope <= 0.0 || !line.slope.is_finite() {
            let p = points
                .last()
                .map_or((0.0, 0.0), |p| (p.stress.value, p.strain.value));
            return Err(ElasticityError::OppositeSigns {
                stress_pa: p.0,
                strain: p.1,
            });
        }
        Ok(line)
    }

    /// Whether any point has an error.
    fn known(points: &[Point]) -> bool {
        points
            .iter()
            .any(|p| p.stress.standard_error > 0.0 || p.strain.standard_error > 0.0)
    }

    fn check(&self, points: &[Point], known: bool) -> Result<(), ElasticityError> {
        let through_origin = self.zero_at_origin;
        let expected = match (through_origin, known) {
            (true, true) => 1,
            (false, false) => 3,
            _ => 2,
        };
        if points.len() < expected {
            return Err(ElasticityError::TooFewLoads {
                expected,
                found: points.len(),
            });
        }
        let same = |f: fn(&Point) -> f64| points.windows(2).all(|w| f(&w[0]) == f(&w[1]));
        if through_origin && points.iter().all(|p| p.strain.value == 0.0) {
            return Err(ElasticityError::ZeroStrain);
        }
        if !through_origin && same(|p| p.stress.value) {
            return Err(ElasticityError::EqualLoads);
        }
        if !through_origin && same(|p| p.strain.value) {
            return Err(ElasticityError::ZeroStrain);
        }
        Ok(())
    }

    /// Degrees of freedom of the slope's error: those of the scatter, or of the sources, the
    /// stresses counted as one. `scales` are the variances that all stresses share, with their
    /// degrees of freedom.
    fn degrees(points: &[Point], line: &Line, scales: [(f64, Option<f64>); 2]) -> Option<f64> {
        if line.learnt {
            return Some(line.degrees as f64);
        }
        let stress = points
            .iter()
            .map(|p| p.stress.standard_error.powi(2))
            .sum::<f64>();
        let strain = points
            .iter()
            .map(|p| (line.slope * p.strain.standard_error).powi(2))
            .sum::<f64>();
        // What the slope's error has of either, in proportion.
        let unit = line.slope_error.powi(2) / (stress + strain);
        effective_degrees_of_freedom(&[
            (
                unit * stress,
                fewest(points.iter().map(|p| p.stress.degrees_of_freedom)),
            ),
            (
                unit * strain,
                fewest(points.iter().map(|p| p.strain.degrees_of_freedom)),
            ),
            scales[0],
            scales[1],
        ])
    }

    fn warnings(&self, loads: &[LoadState], line: &Line) -> Vec<Warning> {
        let mut warnings = strain_warnings(loads);
        warnings.extend(line.excess.map(|x| Warning::ExcessScatter {
            reduced_chi_squared: x,
        }));
        if line.intercept_error > 0.0 {
            let t = line.intercept / line.intercept_error;
            let p_value = t_tail(
                t,
                if line.learnt {
                    line.degrees
                } else {
                    usize::MAX >> 12
                },
            );
            if p_value < 0.05 {
                warnings.push(Warning::Intercept {
                    intercept_pa: line.intercept,
                    p_value,
                });
            }
        }
        warnings
    }
}

/// Residuals over their standard errors. Over the scatter where no errors are known.
fn diagnostics(points: &[Point], line: &Line, known: bool, loads: usize) -> Vec<LoadDiagnostics> {
    let mut diagnostics = vec![LoadDiagnostics::default(); loads];
    for p in points {
        let residual = p.stress.value - line.intercept - line.slope * p.strain.value;
        let spread = if known {
            p.stress
                .standard_error
                .hypot(line.slope * p.strain.standard_error)
        } else {
            (line.chi_squared / line.degrees.max(1) as f64).sqrt()
        };
        diagnostics[p.load].used = true;
        diagnostics[p.load].standardized_residual = (spread > 0.0).then(|| residual / spread);
    }
    diagnostics
}

impl ModulusEstimator for StressStrainRegression {
    fn estimate(&self, series: &LoadSeries) -> Result<ModulusEstimate, ElasticityError> {
        let loads = series.loads();
        let points = Self::points(loads)?;
        let known = Self::known(&points);
        let line = self.line(&points)?;
        // The scale of the forces comes from the calibration that their own errors come from.
        let forces = fewest(loads.iter().map(|load| load.force_n.degrees_of_freedom));
        let scales = [
            (series.shared_errors().force_scale, forces),
            (series.size_scale_error(), None),
        ]
        .map(|(relative, degrees)| ((line.slope * relative).powi(2), degrees));
        let error = (line.slope_error.powi(2) + scales[0].0 + scales[1].0).sqrt();
        let reach = error * quantile_95(Self::degrees(&points, &line, scales));
        Ok(ModulusEstimate {
            youngs_modulus_pa: line.slope,
            standard_error_pa: error,
            interval_95: Interval::new((line.slope - reach).max(0.0), Some(line.slope + reach)),
            estimator: EstimatorKind::StressStrainRegression,
            loads: diagnostics(&points, &line, known, loads.len()),
            fit: FitStatistics::new(points.len(), points.len() - line.degrees, line.chi_squared),
            warnings: self.warnings(loads, &line),
        })
    }

    fn kind(&self) -> EstimatorKind {
        EstimatorKind::StressStrainRegression
    }
}

/// A straight line with its errors.
#[derive(Debug, Clone, Copy)]
struct Line {
    slope: f64,
    intercept: f64,
    slope_error: f64,
    intercept_error: f64,
    chi_squared: f64,
    degrees: usize,
    learnt: bool,
    excess: Option<f64>,
}

struct Point {
    load: usize,
    strain: Estimate,
    stress: Estimate,
}

impl Line {
    /// The line through the points, or through them and the origin. Weighted by their errors where
    /// these are known. The weights depend on the slope, so that the fit is iterated.
    fn fit(points: &[Point], free: bool, known: bool) -> Self {
        let mut line = Self::weighted(points, |_| 1.0, free, false);
        if !known {
            return line;
        }
        for _ in 0..50 {
            let slope = line.slope;
            let variance = |p: &Point| {
                p.stress.standard_error.powi(2) + (slope * p.strain.standard_error).powi(2)
            };
            let floor = points.iter().map(variance).fold(0.0, f64::max) * 1e-12;
            line = Self::weighted(points, |p| 1.0 / variance(p).max(floor), free, true);
            if (line.slope - slope).abs() <= 1e-12 * slope.abs() {
                break;
            }
        }
        line
    }

    /// Weighted least squares about the weighted centre, which keeps the two parameters apart.
    fn weighted(points: &[Point], weight: impl Fn(&Point) -> f64, free: bool, known: bool) -> Self {
        let sum = |f: &dyn Fn(&Point) -> f64| points.iter().map(|p| weight(p) * f(p)).sum::<f64>();
        let total = sum(&|_| 1.0);
        let (cx, cy) = if free {
            (
                sum(&|p| p.strain.value) / total,
                sum(&|p| p.stress.value) / total,
            )
        } else {
            (0.0, 0.0)
        };
        let sxx = sum(&|p| (p.strain.value - cx).powi(2));
        let slope = sum(&|p| (p.strain.value - cx) * (p.stress.value - cy)) / sxx;
        let intercept = cy - slope * cx;
        let chi_squared = sum(&|p| (p.stress.value - intercept - slope * p.strain.value).powi(2));
        let degrees = points.len() - if free { 2 } else { 1 };
        let reduced = chi_squared / degrees.max(1) as f64;
        let excess = (known && degrees > 0 && chi_squared_tail(chi_squared, degrees) < 1e-3)
            .then_some(reduced);
        let learnt = !known || excess.is_some();
        let unit = if learnt { reduced } else { 1.0 };
        let intercept_variance = if free {
            unit * (1.0 / total + cx * cx / sxx)
        } else {
            0.0
        };
        Self {
            slope,
            intercept,
            slope_error: (unit / sxx).sqrt(),
            intercept_error: intercept_variance.sqrt(),
            chi_squared,
            degrees,
            learnt,
            excess,
        }
    }
}

// Specimens with a flat face, pressed without friction: strain and conjugate stress from the face's
// area.
//
// Under uniaxial load a block or a cylinder of any outline deforms homogeneously: the face
// stretches by λ_t in its plane and by λ_z across it, and its area is A = A₀ λ_t². With a measure
// of strain f (Green–Lagrange: f(λ) = ½(λ² − 1)) and Poisson's ratio defined by the same measure,
// f(λ_t) = −ν f(λ_z), which for Hencky's measure and ν = ½ is incompressibility, λ_z λ_t² = 1. The
// stress conjugate to the measure does the work of the force: S df = (F/A₀) dλ_z, hence
//
// S = F / (A₀ f′(λ_z)),
//
// the second Piola–Kirchhoff stress for Green–Lagrange, F/A₀ (engineering stress) for Biot's
// measure and J times the true stress F/A for Hencky's. Material law: S = E f(λ_z), equation (31).
//
// Frames show pressed faces only, so that A₀ is not measured. It is the area for which the line S
// over e passes through the origin: n loads determine the two unknowns E and A₀ from n ≥ 2. To
// first order E = 2ν ΔF/ΔA, which does not hold A₀ at all. The error of A₀ is of the order of that
// of E times the strain and is neglected.
//
// Range: no friction. A face that sticks to the plate stretches less than the material above it,
// and E comes out too large.

// Steps to the unloaded area: the error falls by about the strain each time, to rounding for
// strains up to a third.
const AREA_STEPS: usize = 60;
// Axial stretches that are considered: beyond them no law with one modulus holds.
const STRETCHES: [f64; 2] = [0.05, 4.0];

/// The loads of a specimen with a flat face, its areas turned into strains and conjugate stresses.
///
/// ```
/// use tactile_elasticity::modulus::{
///     Estimate, LoadSeries, LoadState, ModulusEstimator, StressStrainRegression, UniaxialLoads,
/// };
/// use tactile_elasticity::strain::GreenLagrange;
///
/// // A face of 1 cm² of 100 kPa and ν = ½, squeezed by e = 2 % and 5 %: λ_z = √(1 − 2e), A = A₀(1
/// // + e), F = E e λ_z A₀.
/// let load = |e: f64| LoadState {
///     contact_area_m2: Some(Estimate::new(1e-4 * (1.0 + e), 1e-9)),
///     ..LoadState::new(Estimate::new(
///         100e3 * e * (1.0 - 2.0 * e).sqrt() * 1e-4,
///         1e-4,
///     ))
/// };
/// let uniaxial = UniaxialLoads::new(
///     &LoadSeries::new([load(0.02), load(0.05)]),
///     0.5,
///     &GreenLagrange,
/// )?;
/// assert!((uniaxial.unloaded_area_m2 / 1e-4 - 1.0).abs() < 1e-9);
/// let [_lateral, axial] = uniaxial.stretches[1];
/// assert!((axial - 0.9f64.sqrt()).abs() < 1e-9);
/// let modulus = StressStrainRegression::default().estimate(&uniaxial.series)?;
/// assert!((modulus.youngs_modulus_pa / 100e3 - 1.0).abs() < 1e-9);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct UniaxialLoads {
    /// The loads with their strains, for a [`StressStrainRegression`].
    pub series: LoadSeries,
    /// Stretches of the face in its plane and across it, λ_t and λ_z, of every load.
    pub stretches: Vec<[f64; 2]>,
    /// Area of the unloaded face in m².
    pub unloaded_area_m2: f64,
}

impl UniaxialLoads {
    /// Finds A₀ and the state of every load that has a contact area. The others have a force alone.
    /// O(loads).
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`] for a Poisson ratio, from which there is no way back to the
    /// axial strain, or an area. [`ElasticityError::TooFewLoads`] for fewer than two areas,
    /// [`ElasticityError::EqualLoads`] and [`ElasticityError::ZeroStrain`] where they are all one,
    /// [`ElasticityError::OppositeSigns`] where the face does not grow with the force.
    pub fn new(
        series: &LoadSeries,
        poisson_ratio: f64,
        measure: &dyn StrainMeasure,
    ) -> Result<Self, ElasticityError> {
        let law = LateralLaw {
            poisson_ratio: Quantity::PoissonRatio.positive(poisson_ratio)?,
            measure,
        };
        let faces = series.loads().iter().filter_map(|l| l.contact_area_m2);
        let mut unloaded = f64::INFINITY;
        for face in faces {
            let area =
                Quantity::ContactArea.positive(validated(face, Quantity::ContactArea)?.value)?;
            unloaded = unloaded.min(area);
        }
        let regression = StressStrainRegression::default();
        for _ in 0..AREA_STEPS {
            let line = regression.line(&StressStrainRegression::points(
                &law.strained(series, unloaded)?.0,
            )?)?;
            // The strain at which the line has no stress is that of the unloaded face.
            let strain = -line.intercept / line.slope;
            let ratio = (1.0
                - 2.0 * law.poisson_ratio * strain.clamp(-LINEAR_STRAIN, LINEAR_STRAIN))
            .recip();
            unloaded *= ratio;
            if (ratio - 1.0).abs() < 1e-14 {
                break;
            }
        }
        let (loads, stretches) = law.strained(series, unloaded)?;
        Ok(Self {
            series: series.uniaxial(loads, poisson_ratio),
            stretches,
            unloaded_area_m2: unloaded,
        })
    }
}

/// f(λ_t) = −ν f(λ_z).
struct LateralLaw<'a> {
    poisson_ratio: f64,
    measure: &'a dyn StrainMeasure,
}

impl LateralLaw<'_> {
    /// f of a stretch.
    fn strain(&self, stretch: f64) -> Result<f64, ElasticityError> {
        let gradient = Matrix3::from_diagonal(&[0.0, 0.0, stretch - 1.0].into());
        Ok(self.measure.strain(&gradient)?[(2, 2)])
    }

    /// f′ of a stretch, by a central difference: exact to 1e-11, its third derivative times the
    /// step squared.
    fn slope(&self, stretch: f64) -> Result<f64, ElasticityError> {
        const STEP: f64 = 1e-5;
        Ok((self.strain(stretch + STEP)? - self.strain(stretch - STEP)?) / (2.0 * STEP))
    }

    /// λ_z of a face that has stretched by λ_t, by bisection: f rises with the stretch, whatever
    /// the measure.
    fn axial(&self, lateral: f64) -> Result<f64, ElasticityError> {
        let wanted = -self.strain(lateral)? / self.poisson_ratio;
        let [mut low, mut high] = STRETCHES;
        if !(self.strain(low)? < wanted && wanted < self.strain(high)?) {
            return Err(ElasticityError::SingularDeformation);
        }
        while high - low > 4.0 * f64::EPSILON {
            let middle = 0.5 * (low + high);
            if self.strain(middle)? < wanted {
                low = middle;
            } else {
                high = middle;
            }
            if middle == 0.5 * (low + high) {
                break;
            }
        }
        Ok(0.5 * (low + high))
    }

    /// The loads with their strains, and the stretches of each.
    fn strained(
        &self,
        series: &LoadSeries,
        unloaded_m2: f64,
    ) -> Result<(Vec<LoadState>, Vec<[f64; 2]>), ElasticityError> {
        let mut loads = Vec::with_capacity(series.loads().len());
        let mut stretches = Vec::with_capacity(series.loads().len());
        for state in series.loads() {
            let Some(face) = state.contact_area_m2 else {
                loads.push(LoadState {
                    mean_strain: None,
                    contact_radius_m: None,
                    ..*state
                });
                stretches.push([1.0; 2]);
                continue;
            };
            let lateral = (face.value / unloaded_m2).sqrt();
            let axial = self.axial(lateral)?;
            let axial_slope = self.slope(axial)?;
            // de_zz/d ln A = −f′(λ_t) λ_t / 2ν.
            let per_relative_area = self.slope(lateral)? * lateral / (2.0 * self.poisson_ratio);
            loads.push(LoadState {
                contact_area_m2: Some(Estimate::exact(unloaded_m2 * axial_slope)),
                contact_radius_m: None,
                mean_strain: Some(derived(
                    face,
                    -self.strain(axial)?,
                    per_relative_area * face.relative_error(),
                )),
                ..*state
            });
            stretches.push([lateral, axial]);
        }
        Ok((loads, stretches))
    }
}
