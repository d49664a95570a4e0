//! Strain at many points: mean, spread and error.

use crate::error::{ElasticityError, Quantity};
use crate::strain::{Deformation, StrainMeasure};
use nalgebra::{Matrix3, Point3, Vector3};

/// Averages of a strain field, by component.
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::field::StrainField;
/// use tactile_elasticity::strain::Infinitesimal;
///
/// let gradients = [0.01_f64, 0.03].map(Matrix3::from_diagonal_element);
/// let summary = StrainField::from_gradients(&gradients, None, &Infinitesimal)?.summary();
/// assert!((summary.mean[(0, 0)] - 0.02).abs() < 1e-15);
/// assert!(
///     (summary.standard_error[(0, 0)] - summary.spread[(0, 0)] / 2.0_f64.sqrt()).abs() < 1e-15
/// );
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct StrainSummary {
    /// Weighted mean.
    pub mean: Matrix3<f64>,
    /// Weighted standard deviation over the field.
    pub spread: Matrix3<f64>,
    /// Standard error of the mean for independent points: spread/√n_eff, with n_eff = (Σw)²/Σw².
    pub standard_error: Matrix3<f64>,
    /// Number of points used.
    pub used: usize,
    /// Indices of the points with det F ≤ 0, which are excluded from the averages.
    pub folded: Vec<usize>,
}

/// Strain at points, each with its weight (area, volume).
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct StrainField {
    /// Strain at each point. Zero if the deformation folds there.
    pub strains: Vec<Matrix3<f64>>,
    /// Weight of each point. Zero if the deformation folds there.
    pub weights: Vec<f64>,
    /// Points at which the deformation folds, det F ≤ 0.
    pub folded: Vec<usize>,
}

impl StrainField {
    /// Computes the strain of each displacement gradient, with equal weights.
    ///
    /// # Errors
    /// [`ElasticityError::NotFinite`].
    ///
    /// ```
    /// use nalgebra::Matrix3;
    /// use tactile_elasticity::field::StrainField;
    /// use tactile_elasticity::strain::GreenLagrange;
    /// let mut gradients = vec![Matrix3::from_diagonal_element(0.01); 4];
    /// gradients[2][(0, 0)] = -1.5; // turned inside out
    /// let summary = StrainField::from_gradients(&gradients, None, &GreenLagrange)?.summary();
    /// assert_eq!(summary.folded, [2]);
    /// assert!((summary.mean[(0, 0)] - 0.01005f64).abs() < 1e-15);
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn from_gradients(
        gradients: &[Matrix3<f64>],
        weights: Option<&[f64]>,
        measure: &dyn StrainMeasure,
    ) -> Result<Self, ElasticityError> {
        let mut field = Self {
            strains: Vec::new(),
            weights: Vec::new(),
            folded: Vec::new(),
        };
        field.set_gradients(gradients, weights, measure)?;
        Ok(field)
    }

    /// Like [`from_gradients`](Self::from_gradients), reusing the memory of this field. Nothing is
    /// allocated for the same number of points.
    ///
    /// ```
    /// use nalgebra::Matrix3;
    /// use tactile_elasticity::field::StrainField;
    /// use tactile_elasticity::strain::Infinitesimal;
    /// let mut field =
    ///     StrainField::from_gradients(&[Matrix3::identity(); 2], None, &Infinitesimal)?;
    /// field.set_gradients(
    ///     &[Matrix3::from_diagonal_element(0.01)],
    ///     Some(&[2.0]),
    ///     &Infinitesimal,
    /// )?;
    /// assert_eq!(
    ///     (field.strains.len(), field.summary().mean[(2, 2)]),
    ///     (1, 0.01)
    /// );
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`from_gradients`](Self::from_gradients). The field is then empty.
    pub fn set_gradients(
        &mut self,
        gradients: &[Matrix3<f64>],
        weights: Option<&[f64]>,
        measure: &dyn StrainMeasure,
    ) -> Result<(), ElasticityError> {
        self.clear();
        let taken = self.take(gradients, weights, measure);
        if taken.is_err() {
            self.clear();
        }
        taken
    }

    fn clear(&mut self) {
        self.strains.clear();
        self.weights.clear();
        self.folded.clear();
    }

    fn take(
        &mut self,
        gradients: &[Matrix3<f64>],
        weights: Option<&[f64]>,
        measure: &dyn StrainMeasure,
    ) -> Result<(), ElasticityError> {
        match weights {
            None => self.weights.resize(gradients.len(), 1.0),
            Some(weights) => {
                Quantity::Weight.entries(weights.len(), gradients.len())?;
                for &weight in weights {
                    Quantity::Weight.not_negative(weight)?;
                }
                self.weights.extend_from_slice(weights);
            }
        }
        for (i, h) in gradients.iter().enumerate() {
            let deformation = Deformation::from_displacement_gradient(*h);
            if deformation.is_finite() && deformation.jacobian() <= 0.0 {
                self.folded.push(i);
                self.strains.push(Matrix3::zeros());
                self.weights[i] = 0.0;
            } else {
                self.strains.push(measure.of(&deformation)?);
            }
        }
        Ok(())
    }

    /// Weighted mean, spread and standard error.
    pub fn summary(&self) -> StrainSummary {
        let mut total = 0.0;
        let (mut squares, mut mean) = (0.0, Matrix3::zeros());
        for (e, &w) in self.strains.iter().zip(&self.weights) {
            total += w;
            squares += w * w;
            if total > 0.0 {
                mean += (e - mean) * (w / total);
            }
        }
        let mut variance = Matrix3::zeros();
        for (e, &w) in self.strains.iter().zip(&self.weights) {
            let d = e - mean;
            variance += d.component_mul(&d) * w;
        }
        let effective = if squares > 0.0 {
            total * total / squares
        } else {
            0.0
        };
        let (spread, standard_error) = if effective > 1.0 {
            let unbiased = effective / (effective - 1.0);
            let variance = variance * (unbiased / total);
            (
                variance.map(|v| v.sqrt()),
                variance.map(|v| (v / effective).sqrt()),
            )
        } else {
            (Matrix3::zeros(), Matrix3::zeros())
        };
        let used = self.weights.iter().filter(|&&w| w > 0.0).count();
        StrainSummary {
            mean,
            spread,
            standard_error,
            used,
            folded: self.folded.clone(),
        }
    }
}

// Three errors are not contained in the spread of the strain over the points. First, neighbours
// share the errors of a reconstructed surface, so n points carry less information than n
// independent ones: residuals of the affine fit are summed over runs of neighbours, and the sums
// are treated as independent (cluster-robust errors: Liang & Zeger, Biometrika 73, 1986). Second,
// the edge of the contact, to which the points are tied, is known to a fraction of a pixel: the
// smaller contact has the larger relative error. Third, errors of the first surface's points make
// any fit to them too flat (regression dilution: Fuller, Measurement Error Models, 1987, §1.1).

// Distance, in pixels of the surfaces, between the edge of a mask and that of the contact.
const EDGE_PX: f64 = 0.5;

impl StrainField {
    /// Standard errors of the mean Green–Lagrange strain between matched points of two
    /// reconstructed surfaces.
    ///
    /// `grid_m` is the pixel size of the surfaces in metres. `run_length` is the number of
    /// consecutive neighbours that share the errors of a surface. O(n).
    ///
    /// ```
    /// use nalgebra::Point3;
    /// use tactile_elasticity::field::StrainField;
    ///
    /// // A dome that grows by a fifth. The edges of both contacts are known to half a pixel.
    /// let dome: Vec<_> = (0..100)
    ///     .map(|i| {
    ///         let (z, angle) = (1.0 - f64::from(i) / 100.0, 2.4 * f64::from(i));
    ///         let r = (1.0 - z * z).sqrt();
    ///         Point3::new(r * angle.cos(), r * angle.sin(), z)
    ///     })
    ///     .collect();
    /// let grown: Vec<_> = dome.iter().map(|p| p * 1.2).collect();
    /// assert!(StrainField::mean_error(&dome, &grown, 0.0, 10).amax() < 1e-10);
    /// assert!(StrainField::mean_error(&dome, &grown, 0.1, 10)[(2, 2)] > 0.005);
    /// ```
    pub fn mean_error(
        sources: &[Point3<f64>],
        targets: &[Point3<f64>],
        grid_m: f64,
        run_length: usize,
    ) -> Matrix3<f64> {
        let [from, to] = [sources, targets].map(Disc::of);
        let offsets = || pairs_of(sources, targets, [&from, &to]);
        let spread: Matrix3<f64> = offsets().map(|(d, _)| d * d.transpose()).sum();
        // Directions that the points do not span are undetermined. A small multiple of the identity
        // keeps the inverse finite.
        let inverse = (spread + Matrix3::identity() * (1e-12 * spread.trace())).try_inverse();
        let Some(inverse) = inverse else {
            return Matrix3::zeros();
        };
        let slope = offsets()
            .map(|(d, t)| t * d.transpose())
            .sum::<Matrix3<f64>>()
            * inverse;
        let gradient = clustered(offsets(), run_length, &slope, &inverse);
        let along = |k: usize| slope.column(k).norm();
        let edge = EDGE_PX * grid_m * (from.radius.recip() - to.radius.recip()).abs();
        let residual: Vector3<f64> = offsets()
            .map(|(d, t)| t - slope * d)
            .map(|r| r.component_mul(&r))
            .sum();
        // Both surfaces have the same errors, in the units of the first.
        let dilution = |k: usize| residual[k] * inverse[(k, k)] / (1.0 + along(k).powi(2));
        Matrix3::from_fn(|j, k| {
            if j == k {
                let square = along(j).powi(2);
                (along(j) * gradient[(j, j)])
                    .hypot(square * edge)
                    .hypot(square * dilution(j))
            } else {
                0.5 * (along(j) * gradient[(j, k)]).hypot(along(k) * gradient[(k, j)])
            }
        })
    }
}

/// The disc in the image plane with the centroid and spread of the points.
struct Disc {
    centroid: Vector3<f64>,
    radius: f64,
}

impl Disc {
    fn of(points: &[Point3<f64>]) -> Self {
        let n = points.len() as f64;
        let centroid = points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / n;
        let offsets = points.iter().map(|p| p.coords - centroid);
        let square = offsets.map(|d| d.xy().norm_squared()).sum::<f64>() / n;
        let radius = (2.0 * square).sqrt().max(f64::MIN_POSITIVE);
        Self { centroid, radius }
    }
}

/// Offsets of the pairs from their centroids.
fn pairs_of<'a>(
    sources: &'a [Point3<f64>],
    targets: &'a [Point3<f64>],
    [from, to]: [&'a Disc; 2],
) -> impl ExactSizeIterator<Item = (Vector3<f64>, Vector3<f64>)> + 'a {
    let pairs = sources.iter().zip(targets);
    pairs.map(|(s, t)| (s.coords - from.centroid, t.coords - to.centroid))
}

/// Standard errors of the entries of the affine gradient, with independent runs of neighbours.
fn clustered(
    mut offsets: impl ExactSizeIterator<Item = (Vector3<f64>, Vector3<f64>)>,
    run_length: usize,
    slope: &Matrix3<f64>,
    inverse: &Matrix3<f64>,
) -> Matrix3<f64> {
    let runs = offsets.len().div_ceil(run_length);
    let mut variance = Matrix3::zeros();
    for _ in 0..runs {
        let run = offsets.by_ref().take(run_length);
        let sum: Matrix3<f64> = run.map(|(d, t)| (t - slope * d) * d.transpose()).sum();
        let share = sum * inverse;
        variance += share.component_mul(&share);
    }
    // The fit uses four degrees of freedom of the runs.
    let runs = runs as f64;
    variance.map(|v| (v * runs / (runs - 4.0).max(1.0)).sqrt())
}

#[cfg(test)]
#[path = "field_tests.rs"]
mod tests;
