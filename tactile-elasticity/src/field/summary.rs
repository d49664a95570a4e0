//! Mean, spread and standard error of a strain field.

use super::robust::{Averaging, centre_and_spread};
use crate::error::{ElasticityError, Quantity};
use crate::strain::{Deformation, StrainMeasure};
use nalgebra::Matrix3;

/// Averages of a strain field, component by component.
///
/// ```
/// use nalgebra::Matrix3;
/// use tactile_elasticity::field::StrainField;
/// use tactile_elasticity::strain::Infinitesimal;
///
/// let gradients = [0.01_f64, 0.03].map(Matrix3::from_diagonal_element);
/// let summary = StrainField::from_gradients(&gradients, None, &Infinitesimal)?.summary();
/// assert!((summary.mean[(0, 0)] - 0.02).abs() < 1e-15);
/// assert!((summary.standard_error[(0, 0)] - summary.spread[(0, 0)] / 2.0_f64.sqrt()).abs() < 1e-15);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct StrainSummary {
    /// Weighted mean.
    pub mean: Matrix3<f64>,
    /// Weighted standard deviation over the field.
    pub spread: Matrix3<f64>,
    /// Standard error of the mean, as if the points were independent: spread/√n_eff, n_eff = (Σw)²/Σw².
    pub standard_error: Matrix3<f64>,
    /// Points that count.
    pub used: usize,
    /// Indices of the points where det F ≤ 0, left out of the averages.
    pub folded: Vec<usize>,
}

/// Strain at points, with the weight (area, volume) of each.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct StrainField {
    /// The strain at every point; zero where the deformation folds.
    pub strains: Vec<Matrix3<f64>>,
    /// The weight of every point; zero where the deformation folds.
    pub weights: Vec<f64>,
    /// The points at which the deformation folds, det F ≤ 0.
    pub folded: Vec<usize>,
}

impl StrainField {
    /// Strain of every displacement gradient, equal weights.
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

    /// As [`from_gradients`](Self::from_gradients), in the memory of this field: for as many points nothing is allocated.
    ///
    /// ```
    /// use nalgebra::Matrix3;
    /// use tactile_elasticity::field::StrainField;
    /// use tactile_elasticity::strain::Infinitesimal;
    /// let mut field = StrainField::from_gradients(&[Matrix3::identity(); 2], None, &Infinitesimal)?;
    /// field.set_gradients(&[Matrix3::from_diagonal_element(0.01)], Some(&[2.0]), &Infinitesimal)?;
    /// assert_eq!((field.strains.len(), field.summary().mean[(2, 2)]), (1, 0.01));
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    ///
    /// # Errors
    /// As [`from_gradients`](Self::from_gradients); the field is then empty.
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
                check_weights(gradients.len(), weights)?;
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

    /// Mean, spread and standard error, robust if asked for.
    ///
    /// The robust standard error is that of the mean over the estimator's efficiency on normal data: √(π/2) for the median,
    /// 1/√0.95 for Huber's mean.
    ///
    /// ```
    /// use nalgebra::Matrix3;
    /// use tactile_elasticity::field::{Averaging, StrainField};
    /// use tactile_elasticity::strain::Infinitesimal;
    ///
    /// let gradients = [0.01_f64, 0.02, 0.9].map(Matrix3::from_diagonal_element);
    /// let field = StrainField::from_gradients(&gradients, None, &Infinitesimal)?;
    /// assert_eq!(field.summary_with(Averaging::Median).mean[(0, 0)], 0.02);
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn summary_with(&self, averaging: Averaging) -> StrainSummary {
        let mut summary = self.summary();
        let loss: f64 = match averaging {
            Averaging::Mean => return summary,
            Averaging::Huber => 1.0 / 0.95f64.sqrt(),
            Averaging::Median => std::f64::consts::FRAC_PI_2.sqrt(),
        };
        let total = self.weights.iter().fold(0.0, |s, &w| s + w);
        let squares = self.weights.iter().fold(0.0, |s, &w| s + w * w);
        if squares == 0.0 {
            return summary;
        }
        let root = total / squares.sqrt();
        for i in 0..3 {
            for j in 0..3 {
                let values: Vec<f64> = self.strains.iter().map(|e| e[(i, j)]).collect();
                let (centre, spread) = centre_and_spread(&values, &self.weights, averaging);
                summary.mean[(i, j)] = centre;
                summary.spread[(i, j)] = spread;
                summary.standard_error[(i, j)] = spread / root * loss;
            }
        }
        summary
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

fn check_weights(n: usize, weights: &[f64]) -> Result<(), ElasticityError> {
    if weights.len() != n {
        return Err(ElasticityError::LengthMismatch {
            quantity: Quantity::Weight,
            expected: n,
            found: weights.len(),
        });
    }
    for &w in weights {
        crate::error::not_negative(w, Quantity::Weight)?;
    }
    Ok(())
}
