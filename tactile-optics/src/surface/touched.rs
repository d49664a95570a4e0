//! A surface in optical contact with an object.

use super::{TopSurface, TouchingObject};
use crate::error::OpticsError;
use crate::real::within;
use num_traits::{Float, FloatConst};

/// A surface with an object in optical contact inside a circle.
///
/// ```
/// use tactile_optics::Led;
/// use tactile_optics::surface::{Dimple, Touched, TouchingObject};
/// use tactile_optics::trace::{Slab, SlabLayer, TraceOptions, trace};
///
/// let slab = Slab::new(&[SlabLayer { index: 1.40_f64, thickness_m: 10e-3 }], 1.0, 30e-3)?;
/// let dimple = Dimple::new([15e-3, 0.0], 4e-3, 0.2e-3)?;
/// let finger = Touched::new(dimple, TouchingObject { index: 1.44, albedo: 0.6 }, [15e-3, 0.0], 2e-3)?;
/// let (led, options) = (Led::default(), TraceOptions::default());
/// let pressed_by_air = trace(&slab, &led, &dimple, &options, &mut [])?;
/// let pressed_by_finger = trace(&slab, &led, &finger, &options, &mut [])?;
/// // The touching object scatters light down to the camera.
/// assert!(pressed_by_finger.camera > 2.0 * pressed_by_air.camera);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touched<S, T> {
    surface: S,
    object: TouchingObject<T>,
    centre: [T; 2],
    radius: T,
}

impl<T: Float + FloatConst, S: TopSurface<T>> Touched<S, T> {
    /// `surface` with `object` touching it within `radius_m` of `centre_m`.
    ///
    /// # Errors
    /// [`OpticsError::OutOfRange`] for an index that is not positive, an albedo outside 0 to 1, or a circle without meaning.
    pub fn new(
        surface: S,
        object: TouchingObject<T>,
        centre_m: [T; 2],
        radius_m: T,
    ) -> Result<Self, OpticsError> {
        within(
            "refractive index of the object",
            object.index,
            f64::MIN_POSITIVE,
            1e6,
        )?;
        within("albedo of the object", object.albedo, 0.0, 1.0)?;
        for c in centre_m {
            within("centre of the contact", c, -1e6, 1e6)?;
        }
        within("radius of the contact", radius_m, 0.0, 1e6)?;
        Ok(Self {
            surface,
            object,
            centre: centre_m,
            radius: radius_m,
        })
    }
}

impl<T: Float + FloatConst, S: TopSurface<T>> TopSurface<T> for Touched<S, T> {
    fn height(&self, x: T, y: T) -> T {
        self.surface.height(x, y)
    }
    fn gradient(&self, x: T, y: T) -> [T; 2] {
        self.surface.gradient(x, y)
    }
    fn steepest(&self) -> T {
        self.surface.steepest()
    }
    fn deepest(&self) -> T {
        self.surface.deepest()
    }
    fn support(&self) -> [T; 2] {
        let [a, b] = self.surface.support();
        let (left, right) = (self.centre[0] - self.radius, self.centre[0] + self.radius);
        // An empty support (a flat top) must not stretch to the contact.
        if a < b {
            [a.min(left), b.max(right)]
        } else {
            [left, right]
        }
    }
    fn touching(&self, x: T, y: T) -> Option<TouchingObject<T>> {
        let inside = (x - self.centre[0]).hypot(y - self.centre[1]) < self.radius;
        if inside {
            Some(self.object)
        } else {
            self.surface.touching(x, y)
        }
    }
}
