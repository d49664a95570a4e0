//! The top of the slab: its shape under load and the touching object.

use core::f64::consts::FRAC_PI_2;

#[cfg(not(feature = "std"))]
use num_traits::Float;

use crate::error::{OpticsError, within};

/// An object in optical contact with the slab: light that enters it is scattered back uniformly or
/// absorbed.
///
/// ```
/// use tactile_optics::surface::{Flat, TopSurface, Touched, TouchingObject};
///
/// let skin = TouchingObject { index: 1.44_f64, albedo: 0.5 };
/// let touched = Touched::new(Flat, skin, [15e-3, 0.0], 2e-3)?;
/// assert_eq!(touched.touching(16e-3, 1e-3), Some(skin));
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TouchingObject {
    /// Refractive index of the object.
    pub index: f64,
    /// Fraction of the light in the object that is scattered back, as by a Lambertian emitter in
    /// the top layer of the slab.
    pub albedo: f64,
}

/// Shape of the top of the slab. Coordinates are in metres: x along the LED axis from the lit edge,
/// y across it, z up from the undeformed top.
///
/// ```
/// use tactile_optics::surface::{TopSurface, TouchingObject};
///
/// /// A wedge that is pressed in from x = 10 mm to 20 mm.
/// struct Wedge;
///
/// impl TopSurface for Wedge {
///     fn height(&self, x: f64, _y: f64) -> f64 {
///         0.1 * ((x - 15e-3).abs() - 5e-3).min(0.0)
///     }
///     fn gradient(&self, x: f64, _y: f64) -> [f64; 2] {
///         if (x - 15e-3).abs() < 5e-3 { [0.1 * (x - 15e-3).signum(), 0.0] } else { [0.0; 2] }
///     }
///     fn steepest(&self) -> f64 {
///         0.1
///     }
///     fn deepest(&self) -> f64 {
///         0.5e-3
///     }
///     fn support(&self) -> [f64; 2] {
///         [10e-3, 20e-3]
///     }
///     fn touching(&self, _x: f64, _y: f64) -> Option<TouchingObject> {
///         None
///     }
/// }
///
/// use tactile_optics::{Led, trace::{Slab, SlabLayer, TraceOptions, trace}};
/// let slab = Slab::new(&[SlabLayer { index: 1.40, thickness_m: 10e-3 }], 1.0, 30e-3)?;
/// let budget = trace(&slab, &Led::default(), &Wedge, &TraceOptions::default(), &mut [])?;
/// assert!(budget.above + budget.below + budget.camera > 0.01);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
pub trait TopSurface {
    /// Height above the undeformed top, in metres. Negative under load.
    fn height(&self, x: f64, y: f64) -> f64;
    /// Slopes of the surface along x and y.
    fn gradient(&self, x: f64, y: f64) -> [f64; 2];
    /// Upper bound of the slope of the whole surface. It limits the steps of rays towards the
    /// surface, so that no intersection is missed.
    fn steepest(&self) -> f64;
    /// The deepest point below the undeformed top, in metres, as a positive number.
    fn deepest(&self) -> f64;
    /// The range of x outside which the top is flat and without contact.
    fn support(&self) -> [f64; 2];
    /// The object in contact with the slab at a point. `None` if the ambient is there.
    fn touching(&self, _x: f64, _y: f64) -> Option<TouchingObject> {
        None
    }
}

/// The undeformed top.
///
/// ```
/// use tactile_optics::surface::{Flat, TopSurface};
///
/// assert_eq!(TopSurface::deepest(&Flat), 0.0);
/// assert_eq!(Flat.gradient(1e-3_f64, 0.0), [0.0, 0.0]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Flat;

impl TopSurface for Flat {
    fn height(&self, _x: f64, _y: f64) -> f64 {
        0.0
    }
    fn gradient(&self, _x: f64, _y: f64) -> [f64; 2] {
        [0.0; 2]
    }
    fn steepest(&self) -> f64 {
        0.0
    }
    fn deepest(&self) -> f64 {
        0.0
    }
    fn support(&self) -> [f64; 2] {
        [0.0; 2]
    }
}

/// A round dimple z = −d cos²(πr/2w) for r < w, flat outside. Its steepest slope is πd/2w, at half
/// depth.
///
/// ```
/// use tactile_optics::surface::{Dimple, TopSurface};
///
/// let dimple = Dimple::new([15e-3_f64, 0.0], 4e-3, 1.5e-3)?;
/// assert_eq!(dimple.height(15e-3, 0.0), -1.5e-3);
/// assert_eq!(dimple.height(19.1e-3, 0.0), 0.0);
/// // Defined by its steepest slope s instead of its depth: d = 2ws/π.
/// let depth_m = 0.3 * 4e-3 * std::f64::consts::FRAC_2_PI;
/// assert!((Dimple::new([15e-3_f64, 0.0], 4e-3, depth_m)?.steepest() - 0.3).abs() < 1e-15);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dimple {
    centre: [f64; 2],
    half_width: f64,
    depth: f64,
}

impl Dimple {
    /// Creates a dimple around `centre_m` (x, y) with half width w and depth d in metres.
    ///
    /// # Errors
    /// [`OpticsError::OutOfRange`] for a centre that is not finite, a half width that is not
    /// positive or a depth that is negative.
    pub fn new(centre_m: [f64; 2], half_width_m: f64, depth_m: f64) -> Result<Self, OpticsError> {
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
    fn phase(&self, x: f64, y: f64) -> Option<(f64, f64)> {
        let r = (x - self.centre[0]).hypot(y - self.centre[1]);
        (r < self.half_width).then(|| (FRAC_PI_2 * r / self.half_width, r))
    }
}

impl TopSurface for Dimple {
    fn height(&self, x: f64, y: f64) -> f64 {
        self.phase(x, y)
            .map_or(0.0, |(phase, _)| -self.depth * phase.cos().powi(2))
    }

    fn gradient(&self, x: f64, y: f64) -> [f64; 2] {
        let Some((phase, r)) = self.phase(x, y) else {
            return [0.0; 2];
        };
        // The direction of the slope is undefined at the centre, where the slope is 0.
        if r == 0.0 {
            return [0.0; 2];
        }
        let radial = self.depth * FRAC_PI_2 / self.half_width * (phase + phase).sin() / r;
        [radial * (x - self.centre[0]), radial * (y - self.centre[1])]
    }

    fn steepest(&self) -> f64 {
        self.depth * FRAC_PI_2 / self.half_width
    }

    fn deepest(&self) -> f64 {
        self.depth
    }

    fn support(&self) -> [f64; 2] {
        [
            self.centre[0] - self.half_width,
            self.centre[0] + self.half_width,
        ]
    }
}

/// A surface with an object in optical contact inside a circle.
///
/// ```
/// use tactile_optics::Led;
/// use tactile_optics::surface::{Dimple, Touched, TouchingObject};
/// use tactile_optics::trace::{Slab, SlabLayer, TraceOptions, trace};
///
/// let slab = Slab::new(&[SlabLayer { index: 1.40_f64, thickness_m: 10e-3 }], 1.0, 30e-3)?;
/// let dimple = Dimple::new([15e-3, 0.0], 4e-3, 0.2e-3)?;
/// let finger = Touched::new(
///     dimple,
///     TouchingObject {
///         index: 1.44,
///         albedo: 0.6,
///     },
///     [15e-3, 0.0],
///     2e-3,
/// )?;
/// let (led, options) = (Led::default(), TraceOptions::default());
/// let pressed_by_air = trace(&slab, &led, &dimple, &options, &mut [])?;
/// let pressed_by_finger = trace(&slab, &led, &finger, &options, &mut [])?;
/// // The touching object scatters light down to the camera.
/// assert!(pressed_by_finger.camera > 2.0 * pressed_by_air.camera);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touched<S> {
    surface: S,
    object: TouchingObject,
    centre: [f64; 2],
    radius: f64,
}

impl<S: TopSurface> Touched<S> {
    /// Creates `surface` with `object` in contact within `radius_m` of `centre_m`.
    ///
    /// # Errors
    /// [`OpticsError::OutOfRange`] for an index that is not positive, an albedo outside 0 to 1, or
    /// an invalid circle.
    pub fn new(
        surface: S,
        object: TouchingObject,
        centre_m: [f64; 2],
        radius_m: f64,
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

impl<S: TopSurface> TopSurface for Touched<S> {
    fn height(&self, x: f64, y: f64) -> f64 {
        self.surface.height(x, y)
    }
    fn gradient(&self, x: f64, y: f64) -> [f64; 2] {
        self.surface.gradient(x, y)
    }
    fn steepest(&self) -> f64 {
        self.surface.steepest()
    }
    fn deepest(&self) -> f64 {
        self.surface.deepest()
    }
    fn support(&self) -> [f64; 2] {
        let [a, b] = self.surface.support();
        let (left, right) = (self.centre[0] - self.radius, self.centre[0] + self.radius);
        // An empty support (a flat top) must not be extended to the contact.
        if a < b {
            [a.min(left), b.max(right)]
        } else {
            [left, right]
        }
    }
    fn touching(&self, x: f64, y: f64) -> Option<TouchingObject> {
        let inside = (x - self.centre[0]).hypot(y - self.centre[1]) < self.radius;
        if inside {
            Some(self.object)
        } else {
            self.surface.touching(x, y)
        }
    }
}

/// The first intersection of a ray with the surface inside its support, at a distance along the ray
/// between `from` and `to`.
///
/// g = height − z is the gap above the ray. It closes at a rate of at most u_z + L·√(u_x² + u_y²)
/// with the steepest slope L. A step of the gap divided by that rate therefore cannot miss a
/// crossing. Steps continue until the gap is below `tolerance`.
pub(crate) fn march<S: TopSurface + ?Sized>(
    surface: &S,
    position: &[f64; 3],
    direction: &[f64; 3],
    [from, to]: [f64; 2],
    tolerance: f64,
) -> Meeting {
    let at = |t: f64| -> [f64; 3] { core::array::from_fn(|k| position[k] + t * direction[k]) };
    let gap = |t: f64| {
        let [x, y, z] = at(t);
        surface.height(x, y) - z
    };
    // A ray that descends more steeply than every slope of the surface never intersects it.
    let closing = direction[2] + surface.steepest() * direction[0].hypot(direction[1]);
    if closing <= 0.0 {
        return Meeting::Missed;
    }
    let (mut t, mut g) = (from, gap(from));
    if g <= tolerance {
        // On the surface: the ray has just left it, or intersects it here unless the gap increases.
        let [x, y, _] = at(t);
        let [gx, gy] = surface.gradient(x, y);
        let opening = gx * direction[0] + gy * direction[1] - direction[2];
        if opening <= 0.0 {
            return Meeting::At(t);
        }
        // Twice the tolerance, so that the ray does not find its starting point again.
        t += (tolerance + tolerance) / opening;
        g = gap(t);
    }
    for _ in 0..MAX_STEPS {
        if t > to {
            return Meeting::Missed;
        }
        if g <= tolerance {
            return Meeting::At(t);
        }
        t += g / closing;
        g = gap(t);
    }
    Meeting::Undecided
}

/// Number of steps after which a ray along the surface is given up.
const MAX_STEPS: usize = 20_000;

/// Outcome of [`march`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Meeting {
    /// The ray intersects the surface at this distance.
    At(f64),
    /// The ray does not intersect the surface.
    Missed,
    /// The number of steps was exceeded by a ray along the surface.
    Undecided,
}

/// Gap that counts as contact: far below any relevant length, far above rounding.
pub(crate) fn contact_gap(thickness: f64) -> f64 {
    thickness * f64::EPSILON.powf(0.6)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Step of the finite differences.
    const H: f64 = 1e-6;

    /// Number of steps of a scan.
    const STEPS: i32 = 20_000;

    /// Tolerance of the position of a crossing.
    const TOLERANCE: f64 = 1e-9;

    #[test]
    fn gradients_are_the_heights_differences_and_the_steepest_slope_bounds_them() {
        let dimple = Dimple::new([0.5, 0.1], 0.4, 0.2).unwrap();
        for i in 0..50 {
            for j in 0..50 {
                let (x, y) = (0.02 * f64::from(i), 0.02 * f64::from(j) - 0.4);
                let [gx, gy] = dimple.gradient(x, y);
                let dx = (dimple.height(x + H, y) - dimple.height(x - H, y)) / (2.0 * H);
                let dy = (dimple.height(x, y + H) - dimple.height(x, y - H)) / (2.0 * H);
                // Second differences of a curvature with a jump of 12 at the edge: H times 12.
                assert!((gx - dx).abs() < 2e-5 && (gy - dy).abs() < 2e-5);
                assert!(gx.hypot(gy) <= dimple.steepest() * (1.0 + 1e-15));
            }
        }
    }

    /// The first crossing, found by small steps and bisection.
    fn scanned(surface: &Dimple, p: &[f64; 3], u: &[f64; 3], to: f64) -> Option<f64> {
        let gap = |t: f64| surface.height(p[0] + t * u[0], p[1] + t * u[1]) - (p[2] + t * u[2]);
        let first = (1..=STEPS).find(|&k| gap(to * f64::from(k) / f64::from(STEPS)) <= 0.0)?;
        let (mut a, mut b) = (
            to * f64::from(first - 1) / f64::from(STEPS),
            to * f64::from(first) / f64::from(STEPS),
        );
        for _ in 0..60 {
            let middle = 0.5 * (a + b);
            if gap(middle) > 0.0 {
                a = middle
            } else {
                b = middle
            }
        }
        Some(b)
    }

    #[test]
    fn marching_finds_the_first_crossing_and_no_other() {
        let dimple = Dimple::new([0.5, 0.1], 0.4, 0.2).unwrap();
        let (mut met, mut missed) = (0, 0);
        for i in 0..40 {
            for j in 0..10 {
                let angle = -0.3 + 0.02 * f64::from(i);
                let turn = 0.03 * f64::from(j);
                let u = [
                    angle.cos() * turn.cos(),
                    angle.cos() * turn.sin(),
                    angle.sin(),
                ];
                let p = [0.0, -0.05, -0.05 - 0.02 * f64::from(j)];
                let found = march(&dimple, &p, &u, [0.0, 1.2], TOLERANCE);
                match (found, scanned(&dimple, &p, &u, 1.2)) {
                    (Meeting::At(t), Some(expected)) => {
                        // Stopping at a gap of the tolerance is early by the tolerance divided by
                        // the closing speed, which is small for grazing rays.
                        assert!((t - expected).abs() < 1e-5, "{i} {j}: {t} {expected}");
                        met += 1;
                    }
                    (Meeting::Missed, None) => missed += 1,
                    other => panic!("{i} {j}: {other:?}"),
                }
            }
        }
        assert!(met > 50 && missed > 50, "{met} {missed}");
    }
}
