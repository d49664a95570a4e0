//! Rotation, principal strains, volume change and equivalent strain between two point sets.

use crate::elasticity::kinematics::StrainQuantities;
use crate::elasticity::strain::StrainMeasure;
use crate::strain_between::{StrainAt, StrainBetween};
use crate::tps::LocalValue;

impl<const D: usize> StrainAt<D> {
    /// Quantities derived from the deformation gradient, each with its standard error. All are NaN if
    /// the deformation folds.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_imaging::{StrainBetween, StrainBetweenOptions, elasticity::strain::Biot};
    /// // A sheet rotates by 0.3 rad and grows by 10 % along its own x axis.
    /// let before: Vec<_> = (0..64)
    ///     .map(|k| Point2::new(f64::from(k % 8), f64::from(k / 8)))
    ///     .collect();
    /// let turn = nalgebra::Rotation2::new(0.3);
    /// let after: Vec<_> = before
    ///     .iter()
    ///     .map(|p| turn * Point2::new(1.1 * p.x, p.y))
    ///     .collect();
    /// let options = StrainBetweenOptions::default();
    /// let found = StrainBetween::of_known_pairs(&before, &after, &options)?;
    /// let at = found.at(&[Point2::new(3.5, 3.5)], &Biot)?[0].kinematics(&Biot);
    /// assert!((at.rotation_rad - 0.3).abs() < 1e-6 && (at.size_ratio - 1.1).abs() < 1e-6);
    /// assert!((at.principal[0] - 0.1).abs() < 1e-6);
    /// # Ok::<(), tactile_imaging::StrainBetweenError>(())
    /// ```
    #[must_use]
    pub fn kinematics(&self, measure: &dyn StrainMeasure) -> StrainQuantities {
        read(&self.value, measure)
    }
}

impl<const D: usize> StrainBetween<D> {
    /// The [kinematics](StrainAt::kinematics) at each matched point of the first set.
    #[must_use]
    pub fn kinematics(&self, measure: &dyn StrainMeasure) -> Vec<StrainQuantities> {
        self.values
            .iter()
            .map(|value| read(value, measure))
            .collect()
    }
}

fn read<const D: usize>(value: &LocalValue<D>, measure: &dyn StrainMeasure) -> StrainQuantities {
    let gradient = value.gradient.fixed_resize(0.0);
    let covariance = value.gradient_covariance.fixed_resize(0.0);
    let found = StrainQuantities::of(&gradient, &covariance, D, measure);
    found.unwrap_or_else(|_| StrainQuantities::undefined())
}
