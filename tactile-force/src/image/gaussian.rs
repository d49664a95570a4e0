//! The Gaussian profile.

use ndarray::Array2;

use super::quadrature::Gauss;
use super::{PixelGrid, ProfileMoments};
use crate::error::{ForceError, Requirement};
use crate::estimate::Real;

/// A exp(−|x − c|²/(2σ²)), lengths in any unit.
///
/// ```
/// use tactile_force::{GaussianProfile, PixelGrid};
/// let blob = GaussianProfile::new([7.2_f64, 8.1], 1.5, 100.0)?;
/// let image = blob.image(&PixelGrid { rows: 16, columns: 16, size: [1.0; 2], first: [0.0; 2] });
/// assert!((image.sum() / blob.whole().integral - 1.0).abs() < 1e-5);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct GaussianProfile<T> {
    centre: [T; 2],
    sd: T,
    peak: T,
}

/// Beyond so many standard deviations exp(−z²/2) is zero in double precision.
const REACH: f64 = 39.0;

impl<T: Real> GaussianProfile<T> {
    /// A blob with centre [x, y], standard deviation and height.
    ///
    /// # Errors
    /// A centre or height that is not finite, a standard deviation that is not positive.
    pub fn new(centre: [T; 2], sd: T, peak: T) -> Result<Self, ForceError> {
        for c in centre {
            Requirement::Finite.check("centre", c.as_f64())?;
        }
        Requirement::Positive.check("sd", sd.as_f64())?;
        Requirement::Finite.check("peak", peak.as_f64())?;
        Ok(Self { centre, sd, peak })
    }

    /// Moments over the whole plane: 2πσ²A, the centre, √2 σ.
    pub fn whole(&self) -> ProfileMoments<T> {
        let sd = self.sd.as_f64();
        ProfileMoments {
            integral: T::nearest(2.0 * std::f64::consts::PI * sd * sd * self.peak.as_f64()),
            centroid: self.centre,
            radius_of_gyration: T::nearest(std::f64::consts::SQRT_2 * sd),
        }
    }

    /// Moments over the rectangle of these ranges [from, to] along x and along y; `None` where the profile is zero in double precision.
    ///
    /// ```
    /// use tactile_force::GaussianProfile;
    ///
    /// // Far out on the tail the digits are still there.
    /// let blob = GaussianProfile::new([0.0_f64, 0.0], 1.0, 1.0)?;
    /// let tail = blob.within([[20.0, 21.0], [-40.0, 40.0]]).expect("not dark");
    /// assert!(tail.integral > 0.0 && tail.integral < 1e-87);
    /// # Ok::<(), tactile_force::ForceError>(())
    /// ```
    pub fn within(&self, [x_range, y_range]: [[T; 2]; 2]) -> Option<ProfileMoments<T>> {
        let gauss = Gauss::new();
        let x = self.along(&gauss, 0, x_range.map(T::as_f64), 0.0);
        let y = self.along(&gauss, 1, y_range.map(T::as_f64), 0.0);
        let integral = self.peak.as_f64() * x[0] * y[0];
        if integral == 0.0 {
            return None;
        }
        let centroid = [x[1] / x[0], y[1] / y[0]];
        // A second time about the centroid, where no second moment cancels.
        let x = self.along(&gauss, 0, x_range.map(T::as_f64), centroid[0]);
        let y = self.along(&gauss, 1, y_range.map(T::as_f64), centroid[1]);
        Some(ProfileMoments {
            integral: T::nearest(integral),
            centroid: centroid.map(T::nearest),
            radius_of_gyration: T::nearest((x[2] / x[0] + y[2] / y[0]).sqrt()),
        })
    }

    /// Averages over the pixels of a grid, [row, column].
    pub fn image(&self, grid: &PixelGrid<T>) -> Array2<T> {
        let gauss = Gauss::new();
        let mean = |axis: usize, k: usize| {
            let ends = [grid.edge(axis, k), grid.edge(axis, k + 1)];
            self.along(&gauss, axis, ends, 0.0)[0] / (ends[1] - ends[0])
        };
        let xs: Vec<f64> = (0..grid.columns).map(|k| mean(0, k)).collect();
        let ys: Vec<f64> = (0..grid.rows).map(|k| mean(1, k)).collect();
        let peak = self.peak.as_f64();
        Array2::from_shape_fn((grid.rows, grid.columns), |(row, column)| {
            T::nearest(peak * ys[row] * xs[column])
        })
    }

    /// ∫ g, ∫ x g and ∫ (x − about)² g along one axis, with g = exp(−(x − c)²/(2σ²)): all terms are positive, so the far tail keeps its
    /// digits where differences of error functions have none.
    fn along(&self, gauss: &Gauss<16>, axis: usize, [from, to]: [f64; 2], about: f64) -> [f64; 3] {
        let (c, sd) = (self.centre[axis].as_f64(), self.sd.as_f64());
        let (from, to) = (from.max(c - REACH * sd), to.min(c + REACH * sd));
        let mut total = [0.0; 3];
        if from >= to {
            return total;
        }
        let exponent = |x: f64| 0.5 * ((x - c) / sd).powi(2);
        let change = (exponent(to) - exponent(from)).abs();
        let panels = (2.0 * (to - from) / sd + change / 4.0).ceil().max(1.0);
        for k in 0..panels as usize {
            let at = |k: f64| from + (to - from) * k / panels;
            let part = gauss.integrate(at(k as f64), at(k as f64 + 1.0), |x| {
                let g = (-exponent(x)).exp();
                [g, x * g, (x - about).powi(2) * g]
            });
            total.iter_mut().zip(part).for_each(|(t, p)| *t += p);
        }
        total
    }
}
