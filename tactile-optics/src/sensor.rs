//! The specification of the sensor (§3.4 and Table 1) from its parameters.

#[cfg(not(feature = "std"))]
use num_traits::Float;

use crate::error::{OpticsError, within};

/// Parameters of a [`SensorSpecification`].
///
/// ```
/// use tactile_optics::{SensorParameters, SensorSpecification};
///
/// let camera = SensorParameters {
///     side_m: 30e-3_f64,
///     pixel_m: 4.65e-6,
///     frame_rate_hz: 80.0,
///     largest_force_n: 2.0,
///     newton_per_grey: 1e-6,
///     pixel_noise_grey: 1.0,
///     summed_pixels: 10_000.0,
/// };
/// // Twice the frame rate halves the temporal resolution.
/// let fast = SensorSpecification::new(&SensorParameters { frame_rate_hz: 160.0, ..camera }, 3.0)?;
/// assert_eq!(fast.temporal_resolution_s, 6.25e-3);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorParameters {
    /// Side of the sensing area in metres.
    pub side_m: f64,
    /// Size of a pixel in metres.
    pub pixel_m: f64,
    /// Frames per second.
    pub frame_rate_hz: f64,
    /// Largest force in newtons.
    pub largest_force_n: f64,
    /// Force per integrated pixel value, in newtons per grey level.
    pub newton_per_grey: f64,
    /// Standard deviation of the pixel noise in grey levels.
    pub pixel_noise_grey: f64,
    /// Number of pixels that are summed for a force.
    pub summed_pixels: f64,
}

/// Spatial, temporal and force resolution of a sensor.
///
/// ```
/// use tactile_optics::{SensorParameters, SensorSpecification};
///
/// let sensor = SensorSpecification::new(
///     &SensorParameters {
///         side_m: 30e-3_f64,
///         pixel_m: 4.65e-6,
///         frame_rate_hz: 80.0,
///         largest_force_n: 2.0,
///         newton_per_grey: 1e-6,
///         pixel_noise_grey: 1.0,
///         summed_pixels: 10_000.0,
///     },
///     3.0,
/// )?;
/// assert_eq!(sensor.grid_elements.round(), 6452.0);
/// assert_eq!(sensor.temporal_resolution_s, 12.5e-3);
/// // Three σ of the difference between the sums of two frames over 100 × 100 pixels: 3 √2 · 100
/// // grey levels of 1 µN.
/// assert!((sensor.force_resolution_n - 4.243e-4).abs() < 1e-7);
/// assert_eq!(sensor.force_levels.floor(), 4714.0);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorSpecification {
    /// Pixels along a side: 6452 (6451.6) for the paper's 30 mm of 4.65 µm, for which §3.4 prints
    /// 6415.
    pub grid_elements: f64,
    /// Seconds between frames: 12.5 ms at the paper's 80 frames per second.
    pub temporal_resolution_s: f64,
    /// The smallest force that differs from zero, in newtons: k σ_pixel √pixels × √2 × newtons per
    /// grey level, with k the required number of standard deviations. The factor √2 accounts for
    /// the noise of the reference frame, which equals that of the frame.
    pub force_resolution_n: f64,
    /// Number of distinguishable forces between zero and the largest.
    pub force_levels: f64,
}

impl SensorSpecification {
    /// The specification of a sensor whose smallest force exceeds the noise by `sigmas` standard
    /// deviations.
    ///
    /// # Errors
    /// [`OpticsError::OutOfRange`] for a parameter that is not positive and finite. The noise may
    /// be zero.
    pub fn new(parameters: &SensorParameters, sigmas: f64) -> Result<Self, OpticsError> {
        let p = parameters;
        for (name, value) in [
            ("side of the sensing area", p.side_m),
            ("size of a pixel", p.pixel_m),
            ("frame rate", p.frame_rate_hz),
            ("largest force", p.largest_force_n),
            ("newton per grey level", p.newton_per_grey),
            ("number of summed pixels", p.summed_pixels),
            ("number of standard deviations", sigmas),
        ] {
            within(name, value, f64::MIN_POSITIVE, f64::MAX)?;
        }
        within("noise of a pixel", p.pixel_noise_grey, 0.0, f64::MAX)?;
        // The variances of the frame and of the reference add up. Each is that of the summed
        // pixels.
        let force_resolution_n =
            sigmas * p.pixel_noise_grey * (2.0 * p.summed_pixels).sqrt() * p.newton_per_grey;
        Ok(Self {
            grid_elements: p.side_m / p.pixel_m,
            temporal_resolution_s: p.frame_rate_hz.recip(),
            force_resolution_n,
            force_levels: p.largest_force_n / force_resolution_n,
        })
    }
}
