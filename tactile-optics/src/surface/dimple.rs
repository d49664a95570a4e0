//! A smooth round indentation.

use super::TopSurface;
use crate::error::OpticsError;
use crate::real::within;
use num_traits::{Float, FloatConst};

/// A round dimple z = −d cos²(πr/2w) for r < w, flat beyond; its steepest slope is πd/2w, halfway down.
///
/// ```
/// use tactile_optics::surface::{Dimple, TopSurface};
///
/// let dimple = Dimple::new([15e-3_f64, 0.0], 4e-3, 1.5e-3)?;
/// assert_eq!(dimple.height(15e-3, 0.0), -1.5e-3);
/// assert_eq!(dimple.height(19.1e-3, 0.0), 0.0);
/// // By its steepest slope s instead of its depth: d = 2ws/π.
/// let depth_m = 0.3 * 4e-3 * std::f64::consts::FRAC_2_PI;
/// assert!((Dimple::new([15e-3_f64, 0.0], 4e-3, depth_m)?.steepest() - 0.3).abs() < 1e-15);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dimple<T> {
    centre: [T; 2],
    half_width: T,
    depth: T,
}

impl<T: Float + FloatConst> Dimple<T> {
    /// A dimple around `centre_m` (x, y) of half width w and depth d in metres.
    ///
    /// # Errors
    /// [`OpticsError::OutOfRange`] for a centre that is not finite, a half width that is not positive or a depth that is
    /// negative.
    pub fn new(centre_m: [T; 2], half_width_m: T, depth_m: T) -> Result<Self, OpticsError> {
        for c in centre_m {
            within("centre of the dimple", c, -1e6, 1e6)?;
        }
        within("half width of the dimple", half_width_m, 1e-9, 1e6)?;
        within("depth of the dimple", depth_m, 0.0, 1e6)?;
        Ok(Self {
            centre: centre_m,
            half_width: half_width_m,
            depth: depth_m,
        })
    }

    /// πr/2w, and r.
    fn phase(&self, x: T, y: T) -> Option<(T, T)> {
        let r = (x - self.centre[0]).hypot(y - self.centre[1]);
        (r < self.half_width).then(|| (T::FRAC_PI_2() * r / self.half_width, r))
    }
}

impl<T: Float + FloatConst> TopSurface<T> for Dimple<T> {
    fn height(&self, x: T, y: T) -> T {
        self.phase(x, y)
            .map_or(T::zero(), |(phase, _)| -self.depth * phase.cos().powi(2))
    }

    fn gradient(&self, x: T, y: T) -> [T; 2] {
        let Some((phase, r)) = self.phase(x, y) else {
            return [T::zero(); 2];
        };
        if r == T::zero() {
            return [T::zero(); 2];
        }
        let radial = self.depth * T::FRAC_PI_2() / self.half_width * (phase + phase).sin() / r;
        [radial * (x - self.centre[0]), radial * (y - self.centre[1])]
    }

    fn steepest(&self) -> T {
        self.depth * T::FRAC_PI_2() / self.half_width
    }

    fn deepest(&self) -> T {
        self.depth
    }

    fn support(&self) -> [T; 2] {
        [
            self.centre[0] - self.half_width,
            self.centre[0] + self.half_width,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gradients_are_the_heights_differences_and_the_steepest_slope_bounds_them() {
        let dimple = Dimple::new([0.5, 0.1], 0.4, 0.2).unwrap();
        let h = 1e-6;
        for i in 0..50 {
            for j in 0..50 {
                let (x, y) = (0.02 * f64::from(i), 0.02 * f64::from(j) - 0.4);
                let [gx, gy] = dimple.gradient(x, y);
                let dx = (dimple.height(x + h, y) - dimple.height(x - h, y)) / (2.0 * h);
                let dy = (dimple.height(x, y + h) - dimple.height(x, y - h)) / (2.0 * h);
                // Second differences of a curvature that jumps by 12 at the edge: h times that.
                assert!((gx - dx).abs() < 2e-5 && (gy - dy).abs() < 2e-5);
                assert!(gx.hypot(gy) <= dimple.steepest() * (1.0 + 1e-15));
            }
        }
    }
}
