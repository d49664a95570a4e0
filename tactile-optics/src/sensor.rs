//! The sensor's specification (Table 1) from its inputs.

use crate::error::OpticsError;
use crate::real::{Real, within};

/// Inputs of the specification.
///
/// ```
/// use tactile_optics::SensorSpecification;
///
/// let sensor = SensorSpecification {
///     side_m: 30e-3_f64,
///     pixel_m: 4.65e-6,
///     frame_rate_hz: 80.0,
///     largest_force_n: 2.0,
///     newton_per_grey: 1e-6,
///     pixel_noise_grey: 1.0,
///     summed_pixels: 10_000.0,
/// }
/// .validated()?;
/// assert_eq!(sensor.grid_elements().round(), 6452.0);
/// assert_eq!(sensor.temporal_resolution_s(), 12.5e-3);
/// // Three σ of the difference of two frames' sums over 100 × 100 pixels: 3 √2 · 100 grey levels of 1 µN.
/// assert!((sensor.force_resolution_n(3.0) - 4.243e-4).abs() < 1e-7);
/// assert_eq!(sensor.force_levels(3.0).floor(), 4714.0);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorSpecification<T> {
    /// Side of the sensing area in metres.
    pub side_m: T,
    /// Size of a pixel in metres.
    pub pixel_m: T,
    /// Frames per second.
    pub frame_rate_hz: T,
    /// Largest force in newton.
    pub largest_force_n: T,
    /// Force over integrated pixel value, in newton per grey level.
    pub newton_per_grey: T,
    /// Standard deviation of a pixel's noise in grey levels.
    pub pixel_noise_grey: T,
    /// Pixels that are summed for a force.
    pub summed_pixels: T,
}

impl<T: Real> SensorSpecification<T> {
    /// Checks the inputs.
    ///
    /// # Errors
    /// [`OpticsError::OutOfRange`] for a value that is not positive and finite (the noise may be zero).
    pub fn validated(self) -> Result<Self, OpticsError> {
        for (name, value) in [
            ("side of the sensing area", self.side_m),
            ("size of a pixel", self.pixel_m),
            ("frame rate", self.frame_rate_hz),
            ("largest force", self.largest_force_n),
            ("newton per grey level", self.newton_per_grey),
            ("number of summed pixels", self.summed_pixels),
        ] {
            within(name, value, f64::MIN_POSITIVE, f64::MAX)?;
        }
        within("noise of a pixel", self.pixel_noise_grey, 0.0, f64::MAX)?;
        Ok(self)
    }

    /// Pixels along a side: 6452 (6451.6) for the paper's 30 mm of 4.65 µm, where §3.4 prints 6415.
    pub fn grid_elements(&self) -> T {
        self.side_m / self.pixel_m
    }

    /// Seconds between frames: 12.5 ms at the paper's 80 frames per second.
    pub fn temporal_resolution_s(&self) -> T {
        self.frame_rate_hz.recip()
    }

    /// The smallest force told from none at `sigmas` standard deviations: σ_pixel √pixels × √2 × newton per grey level. The
    /// √2 is the reference frame's noise, which is as large as the frame's.
    pub fn force_resolution_n(&self, sigmas: T) -> T {
        let two = T::one() + T::one();
        sigmas * self.pixel_noise_grey * (two * self.summed_pixels).sqrt() * self.newton_per_grey
    }

    /// Forces told apart between none and the largest.
    pub fn force_levels(&self, sigmas: T) -> T {
        self.largest_force_n / self.force_resolution_n(sigmas)
    }
}

/// The force sensitivity of the sensor in newton as the paper's text has it. Table 1 swaps it with
/// [`FINGERTIP_FORCE_SENSITIVITY_N`].
///
/// ```
/// use tactile_optics::sensor::{FINGERTIP_FORCE_SENSITIVITY_N, PAPER_FORCE_SENSITIVITY_N};
///
/// // The sensor tells forces an eighth of what a fingertip does.
/// assert!((FINGERTIP_FORCE_SENSITIVITY_N / PAPER_FORCE_SENSITIVITY_N - 8.0).abs() < 1e-12);
/// ```
pub const PAPER_FORCE_SENSITIVITY_N: f64 = 2.5e-3;

/// The force sensitivity of a human fingertip in newton, as the paper's text has it.
///
/// ```
/// use tactile_optics::sensor::FINGERTIP_FORCE_SENSITIVITY_N;
///
/// // About the weight of two grams.
/// assert!((FINGERTIP_FORCE_SENSITIVITY_N / 9.81 - 2e-3).abs() < 1e-4);
/// ```
pub const FINGERTIP_FORCE_SENSITIVITY_N: f64 = 2.0e-2;
