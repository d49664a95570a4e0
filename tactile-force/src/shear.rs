//! Shear from the displacement of the centroid: F_x = K_x u_x, F_y = K_y u_y (equations (9)–(12)).

use crate::error::{ForceError, check_observations};
use tactile_core::Estimate;

/// One observation for the shear calibration: the displacement of the centroid under a known shear
/// force.
///
/// ```
/// use tactile_force::ShearPair;
///
/// let pulled_right = ShearPair { centroid_step_m: [50e-6, 0.0], force_n: [0.1, 0.0] };
/// assert_eq!(pulled_right.force_n[0] / pulled_right.centroid_step_m[0], 2000.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ShearPair {
    /// Displacement [x, y] of the centroid, in metres.
    pub centroid_step_m: [f64; 2],
    /// Shear force [x, y], in newtons.
    pub force_n: [f64; 2],
}

/// The stiffnesses K_x and K_y, in newtons per metre.
///
/// ```
/// use tactile_force::{Estimate, ShearCalibration, ShearPair};
///
/// // 2 N/mm along x, 3 N/mm along y.
/// let pairs: Vec<_> = [1e-5, 2e-5, 5e-5]
///     .map(|u| ShearPair { centroid_step_m: [u, -u], force_n: [2e3 * u, -3e3 * u] })
///     .to_vec();
/// let calibration = ShearCalibration::fit(&pairs)?;
/// assert!((calibration.stiffness_n_per_m[1].value - 3e3).abs() < 1e-9);
/// let step = Estimate::new(1e-5_f64, 1e-7);
/// let [x, _] = calibration.force_n([step, step]);
/// assert!((x.value - 0.02).abs() < 1e-12 && (x.standard_error - 2e-4).abs() < 1e-9);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct ShearCalibration {
    /// [K_x, K_y] in newtons per metre.
    pub stiffness_n_per_m: [Estimate; 2],
    /// Standard deviation of the residuals along each axis, in newtons.
    pub residual_sd_n: [f64; 2],
}

impl ShearCalibration {
    /// Stiffnesses [K_x, K_y] that are known from elsewhere, in newtons per metre.
    ///
    /// ```
    /// use tactile_force::{Estimate, ShearCalibration};
    ///
    /// let calibration = ShearCalibration::new([Estimate::new(2e3, 10.0), Estimate::new(3e3, 10.0)]);
    /// let [x, _] = calibration.force_n([Estimate::exact(1e-5); 2]);
    /// assert!((x.value - 0.02).abs() < 1e-12);
    /// ```
    #[must_use]
    pub const fn new(stiffness_n_per_m: [Estimate; 2]) -> Self {
        Self {
            stiffness_n_per_m,
            residual_sd_n: [0.0; 2],
        }
    }

    /// Least-squares fit through the origin, separately for each axis: K = Σ u F / Σ u².
    ///
    /// # Errors
    /// An error for fewer than two pairs, a pair that is not finite, or an axis without
    /// displacement.
    pub fn fit(pairs: &[ShearPair]) -> Result<Self, ForceError> {
        check_observations(pairs, 2, |p| {
            let ([u_x, u_y], [f_x, f_y]) = (p.centroid_step_m, p.force_n);
            [u_x, u_y, f_x, f_y]
        })?;
        let [(k_x, sd_x), (k_y, sd_y)] = [stiffness(pairs, 0)?, stiffness(pairs, 1)?];
        Ok(Self {
            residual_sd_n: [sd_x, sd_y],
            ..Self::new([k_x, k_y])
        })
    }

    /// Shear force [x, y] for a displacement of the centroid, in newtons.
    pub fn force_n(&self, centroid_step_m: [Estimate; 2]) -> [Estimate; 2] {
        std::array::from_fn(|k| {
            let (stiffness, step) = (self.stiffness_n_per_m[k], centroid_step_m[k]);
            Estimate::new(
                stiffness.value * step.value,
                (stiffness.value * step.standard_error)
                    .hypot(stiffness.standard_error * step.value),
            )
        })
    }
}

/// Least squares along one axis: the stiffness, and the standard deviation of the residuals.
fn stiffness(pairs: &[ShearPair], axis: usize) -> Result<(Estimate, f64), ForceError> {
    let both = || {
        pairs
            .iter()
            .map(|p| (p.centroid_step_m[axis], p.force_n[axis]))
    };
    let uu: f64 = both().map(|(u, _)| u * u).sum();
    let uf: f64 = both().map(|(u, f)| u * f).sum();
    if uu == 0.0 {
        return Err(ForceError::DegeneratePairs { span: 0.0 });
    }
    let stiffness = uf / uu;
    let squares: f64 = both().map(|(u, f)| (f - stiffness * u).powi(2)).sum();
    // One parameter was fitted.
    let variance = squares / (pairs.len() - 1) as f64;
    let estimate = Estimate::from_variance(stiffness, variance / uu);
    Ok((estimate, variance.sqrt()))
}

/// Shear force and centroid displacement of one frame.
///
/// See [`ShearTracker`] for an example.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct ShearMeasurement {
    /// Current centroid minus centroid at the start of the contact, [x, y] in metres.
    pub displacement_m: [Estimate; 2],
    /// Current centroid minus that of the preceding frame, [x, y] in metres: u of equations (9) and
    /// (10).
    pub step_m: [Estimate; 2],
    /// Shear force since contact began, [x, y] in newtons, equations (11) and (12).
    pub force_n: [Estimate; 2],
}

/// Follows the centroid from frame to frame.
///
/// The shear force is computed from the displacement since the start of the contact. Adding up the
/// displacements from frame to frame would add up the noise of all frames; here it is that of two
/// frames.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::*;
///
/// let press = |x0: f64| {
///     Array2::from_shape_fn((120, 120), |(y, x)| {
///         let r2 = (x as f64 - x0).powi(2) + (y as f64 - 60.0).powi(2);
///         12 + (150.0 * (1.0 - r2 / 400.0).max(0.0).sqrt()).round() as u8
///     })
/// };
/// let pairs = [0.0, 1e5, 2e5].map(|v| CalibrationPair::loading(v, 1e-5 * v));
/// let force = LinearCalibration::fit(&pairs)?;
/// let shear = ShearCalibration::fit(&[1e-5, 2e-5].map(|u| ShearPair {
///     centroid_step_m: [u, u],
///     force_n: [2e3 * u; 2],
/// }))?;
/// let at_rest = Array2::from_elem((120, 120), 12_u8);
/// let measure = |frame: &Array2<u8>| {
///     measure_force(
///         frame.view(),
///         at_rest.view(),
///         [20e-6; 2],
///         &force,
///         &Default::default(),
///     )
/// };
///
/// let mut tracker = ShearTracker::new(shear);
/// assert!(tracker.update(measure(&at_rest)?.centroid_m).is_none());
/// assert_eq!(
///     tracker
///         .update(measure(&press(60.0))?.centroid_m)
///         .map(|s| s.force_n[0].value),
///     Some(0.0)
/// );
/// // Two pixels to the right are 40 µm and 80 mN.
/// let pulled = tracker.update(measure(&press(62.0))?.centroid_m).expect("contact");
/// assert!((pulled.force_n[0].value - 0.08_f64).abs() < 1e-3);
/// # Ok::<(), ForceError>(())
/// ```
#[derive(Clone, Debug)]
pub struct ShearTracker {
    calibration: ShearCalibration,
    first: Option<[Estimate; 2]>,
    last: Option<[Estimate; 2]>,
}

impl ShearTracker {
    /// Creates a tracker that waits for contact.
    pub fn new(calibration: ShearCalibration) -> Self {
        Self {
            calibration,
            first: None,
            last: None,
        }
    }

    /// Adds the centroid [x, y] of the next frame in metres, measured by any method, or `None`
    /// without contact. The first frame of a contact has zero shear by definition. After a frame
    /// without contact, the next contact starts anew.
    pub fn update(&mut self, centroid_m: Option<[Estimate; 2]>) -> Option<ShearMeasurement> {
        let Some(now) = centroid_m else {
            (self.first, self.last) = (None, None);
            return None;
        };
        let zero = [Estimate::default(); 2];
        let displacement_m = self.first.map_or(zero, |from| difference(now, from));
        let step_m = self.last.map_or(zero, |from| difference(now, from));
        // Kept for the whole contact, so that the errors of intermediate frames do not add up.
        self.first.get_or_insert(now);
        self.last = Some(now);
        Some(ShearMeasurement {
            displacement_m,
            step_m,
            force_n: self.calibration.force_n(displacement_m),
        })
    }
}

fn difference(to: [Estimate; 2], from: [Estimate; 2]) -> [Estimate; 2] {
    std::array::from_fn(|k| {
        Estimate::new(
            to[k].value - from[k].value,
            to[k].standard_error.hypot(from[k].standard_error),
        )
    })
}
