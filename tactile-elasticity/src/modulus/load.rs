//! What was measured at one load.

use crate::error::{ElasticityError, Quantity, not_negative};
use crate::scalar::widen;
use nalgebra::RealField;

/// A number and the standard error of it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Estimate<T> {
    /// The best value.
    pub value: T,
    /// Its standard deviation over repetitions; zero where unknown.
    pub standard_error: T,
    /// Degrees of freedom of the standard error where it was itself estimated (pairs less parameters of a calibration, parts of a
    /// jackknife less one); None where it is known. Fewer degrees make wider intervals.
    pub degrees_of_freedom: Option<T>,
}

impl<T: RealField + Copy> Estimate<T> {
    /// A value with its standard error.
    pub fn new(value: T, standard_error: T) -> Self {
        Self {
            value,
            standard_error,
            degrees_of_freedom: None,
        }
    }

    /// With the degrees of freedom of a standard error that was estimated from few repetitions.
    ///
    /// ```
    /// use tactile_elasticity::modulus::{Estimate, LoadSeries, LoadState, ModulusEstimator, PaperRatio};
    /// let load = |force| {
    ///     LoadState {
    ///         contact_area_m2: Some(Estimate::exact(1e-4)),
    ///         mean_strain: Some(Estimate::exact(0.02)),
    ///         ..LoadState::new(force)
    ///     }
    /// };
    /// let force = Estimate::new(0.12, 0.001);
    /// let known = PaperRatio::default().estimate(&LoadSeries::new([load(force)]))?;
    /// let estimated = PaperRatio::default().estimate(&LoadSeries::new([load(force.with_degrees_of_freedom(5.0))]))?;
    /// assert_eq!(known.standard_error_pa, estimated.standard_error_pa);
    /// assert!(estimated.interval_95.lower < known.interval_95.lower); // Student's t instead of the normal distribution
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn with_degrees_of_freedom(mut self, degrees: T) -> Self {
        self.degrees_of_freedom = Some(degrees);
        self
    }

    /// A value whose error is unknown or negligible.
    pub fn exact(value: T) -> Self {
        Self::new(value, T::zero())
    }

    pub(crate) fn widen(self) -> Estimate<f64> {
        Estimate {
            value: widen(self.value),
            standard_error: widen(self.standard_error),
            degrees_of_freedom: self.degrees_of_freedom.map(widen),
        }
    }
}

impl Estimate<f64> {
    /// The error as a share of the value.
    pub(crate) fn relative_error(self) -> f64 {
        self.standard_error / self.value.abs()
    }

    pub(crate) fn validated(self, quantity: Quantity) -> Result<Self, ElasticityError> {
        crate::error::finite(self.value, quantity)?;
        not_negative(self.standard_error, Quantity::StandardError)?;
        if let Some(degrees) = self.degrees_of_freedom {
            crate::error::positive(degrees, Quantity::DegreesOfFreedom)?;
        }
        Ok(self)
    }
}

/// One load: the force and what was measured of the contact.
///
/// Pressing forces are positive. Strain is that between the unloaded state (or the first load, see the estimators) and this
/// load, positive where the object is squeezed.
///
/// ```
/// use tactile_elasticity::modulus::{Estimate, LoadSeries, LoadState};
/// let load = LoadState {
///     contact_radius_m: Some(Estimate::new(1.2e-3, 4e-6)),
///     mean_strain: Some(Estimate::exact(0.021)),
///     ..LoadState::new(Estimate::new(0.7, 0.002))
/// };
/// assert!((load.stress_pa().unwrap() - 0.7f64 / (std::f64::consts::PI * 1.44e-6)).abs() < 1e-6);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LoadState<T> {
    /// F.
    pub force_n: Estimate<T>,
    /// a, of a round contact.
    pub contact_radius_m: Option<Estimate<T>>,
    /// The contact's area, where it is not πa².
    pub contact_area_m2: Option<Estimate<T>>,
    /// δ, the approach of the two bodies.
    pub indentation_m: Option<Estimate<T>>,
    /// Mean e_zz, positive where the object is squeezed.
    pub mean_strain: Option<Estimate<T>>,
}

impl<T: RealField + Copy> LoadState<T> {
    /// A load of which only the force is known yet.
    pub fn new(force_n: Estimate<T>) -> Self {
        Self {
            force_n,
            contact_radius_m: None,
            contact_area_m2: None,
            indentation_m: None,
            mean_strain: None,
        }
    }

    /// F over the area given, or over πa²; None where neither is known or the area is zero.
    pub fn stress_pa(&self) -> Option<T> {
        let area = match (self.contact_area_m2, self.contact_radius_m) {
            (Some(area), _) => area.value,
            (None, Some(a)) => T::pi() * a.value * a.value,
            (None, None) => return None,
        };
        (area > T::zero()).then(|| self.force_n.value / area)
    }
}

impl LoadState<f64> {
    /// The area given, or πa².
    pub(crate) fn area(&self) -> Option<Estimate<f64>> {
        let disc = |a: Estimate<f64>| Estimate {
            value: std::f64::consts::PI * a.value * a.value,
            standard_error: 2.0 * std::f64::consts::PI * a.value.abs() * a.standard_error,
            ..a
        };
        self.contact_area_m2
            .or_else(|| self.contact_radius_m.map(disc))
    }
}

impl<T: RealField + Copy> LoadState<T> {
    pub(crate) fn widened(&self) -> LoadState<f64> {
        LoadState {
            force_n: self.force_n.widen(),
            contact_radius_m: self.contact_radius_m.map(Estimate::widen),
            contact_area_m2: self.contact_area_m2.map(Estimate::widen),
            indentation_m: self.indentation_m.map(Estimate::widen),
            mean_strain: self.mean_strain.map(Estimate::widen),
        }
    }
}
