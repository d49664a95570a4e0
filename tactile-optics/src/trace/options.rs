//! The options of a trace.

use crate::error::OpticsError;
use crate::led::Geometry;
use crate::real::{real, within};
use num_traits::{Float, FloatConst};

/// The number of rays, their starting points, and which of them reach the camera.
///
/// ```
/// use tactile_optics::{Geometry, OpticsError, trace::TraceOptions};
///
/// let quick = TraceOptions::<f64>::default()
///     .with_geometry(Geometry::Section)
///     .with_rays(256)?
///     .with_seed(7)
///     .with_cutoff(1e-4)?
///     .with_camera_half_angle(0.3)?
///     .with_emitter_half_width_m(2.5e-3)?;
/// assert_ne!(quick, TraceOptions::default());
/// assert!(matches!(quick.with_cutoff(f64::NAN), Err(OpticsError::OutOfRange { quantity: "cut-off", .. })));
/// # Ok::<(), OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TraceOptions<T> {
    pub(super) geometry: Geometry,
    pub(super) rays: u32,
    pub(super) seed: u64,
    pub(super) cutoff: T,
    pub(super) camera_half_angle: T,
    pub(super) emitter_half_width_m: T,
}

impl<T: Float + FloatConst> Default for TraceOptions<T> {
    /// 4096 rays in space, cut off at 10⁻⁶, a camera that sees 30° around its axis, an LED that is a point.
    fn default() -> Self {
        Self {
            geometry: Geometry::Volume,
            // The guided share to 2×10⁻⁴ in 20 ms: `cargo bench -p tactile-benches --bench work_precision -- optics` shows what more rays buy.
            rays: 4096,
            seed: 1,
            cutoff: real(1e-6),
            camera_half_angle: T::FRAC_PI_6(),
            emitter_half_width_m: T::zero(),
        }
    }
}

impl<T: Float + FloatConst> TraceOptions<T> {
    /// Traces a section or all of space.
    pub fn with_geometry(mut self, geometry: Geometry) -> Self {
        self.geometry = geometry;
        self
    }

    /// Shoots this number of rays from the LED.
    ///
    /// # Errors
    /// [`OpticsError::OutOfRange`] for no rays.
    pub fn with_rays(mut self, rays: u32) -> Result<Self, OpticsError> {
        within("number of rays", real::<T>(f64::from(rays)), 1.0, 4.3e9)?;
        self.rays = rays;
        Ok(self)
    }

    /// Shifts the starting points and draws other directions of scattered light.
    pub fn with_seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self
    }

    /// Gives up a branch that carries less than this share of its ray.
    ///
    /// # Errors
    /// [`OpticsError::OutOfRange`] outside 0 to 1.
    pub fn with_cutoff(mut self, share: T) -> Result<Self, OpticsError> {
        self.cutoff = within("cut-off", share, 0.0, 1.0)?;
        Ok(self)
    }

    /// Counts rays that leave the bottom within this angle of its normal (radians) as seen by the camera.
    ///
    /// # Errors
    /// [`OpticsError::OutOfRange`] outside 0 to π/2.
    pub fn with_camera_half_angle(mut self, angle: T) -> Result<Self, OpticsError> {
        // A scalar's π/2 may lie above the true one by rounding.
        let right = core::f64::consts::FRAC_PI_2 * (1.0 + 1e-7);
        self.camera_half_angle = within("half angle of the camera", angle, 0.0, right)?;
        Ok(self)
    }

    /// Spreads the LED over this half width across the slab, in metres. No effect in a section.
    ///
    /// # Errors
    /// [`OpticsError::OutOfRange`] for a width that is negative or not finite.
    pub fn with_emitter_half_width_m(mut self, half_width_m: T) -> Result<Self, OpticsError> {
        self.emitter_half_width_m = within("half width of the emitter", half_width_m, 0.0, 1e6)?;
        Ok(self)
    }
}
