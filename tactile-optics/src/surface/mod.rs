//! The top of the slab: its shape under load and the object that touches it.

mod dimple;
mod march;
mod touched;

pub use dimple::Dimple;
pub use touched::Touched;

pub(crate) use march::{Meeting, contact_gap, march};

use num_traits::{Float, FloatConst};

/// An object in optical contact with the slab: light that enters it is scattered back evenly or lost.
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
pub struct TouchingObject<T> {
    /// Refractive index of the object.
    pub index: T,
    /// Share of the light entering the object that it scatters back, as a Lambertian emitter in the slab's top layer.
    pub albedo: T,
}

/// The shape of the slab's top. Coordinates in metres: x along the LED's axis from the lit edge, y across, z up from
/// the undeformed top.
///
/// ```
/// use tactile_optics::surface::{TopSurface, TouchingObject};
///
/// /// A wedge pressed in from x = 10 mm to 20 mm.
/// struct Wedge;
///
/// impl TopSurface<f64> for Wedge {
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
///     fn touching(&self, _x: f64, _y: f64) -> Option<TouchingObject<f64>> {
///         None
///     }
/// }
///
/// # use tactile_optics::{Led, trace::{Slab, SlabLayer, TraceOptions, trace}};
/// let slab = Slab::new(&[SlabLayer { index: 1.40, thickness_m: 10e-3 }], 1.0, 30e-3)?;
/// let budget = trace(&slab, &Led::default(), &Wedge, &TraceOptions::default(), &mut [])?;
/// assert!(budget.above + budget.below + budget.camera > 0.01);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
pub trait TopSurface<T> {
    /// Height above the undeformed top, in metres; negative under load.
    fn height(&self, x: T, y: T) -> T;
    /// Its slopes along x and y.
    fn gradient(&self, x: T, y: T) -> [T; 2];
    /// A bound on the slope's size anywhere: rays step towards the surface no faster than it allows, so that no intersection is
    /// missed.
    fn steepest(&self) -> T;
    /// The deepest point below the undeformed top, in metres, as a positive number.
    fn deepest(&self) -> T;
    /// The range of x outside which the top is flat and untouched.
    fn support(&self) -> [T; 2];
    /// The object that touches the slab at a point; `None` where the ambient does.
    fn touching(&self, _x: T, _y: T) -> Option<TouchingObject<T>> {
        None
    }
}

/// The undeformed top.
///
/// ```
/// use tactile_optics::surface::{Flat, TopSurface};
///
/// assert_eq!(TopSurface::<f64>::deepest(&Flat), 0.0);
/// assert_eq!(Flat.gradient(1e-3_f64, 0.0), [0.0, 0.0]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Flat;

impl<T: Float + FloatConst> TopSurface<T> for Flat {
    fn height(&self, _x: T, _y: T) -> T {
        T::zero()
    }
    fn gradient(&self, _x: T, _y: T) -> [T; 2] {
        [T::zero(); 2]
    }
    fn steepest(&self) -> T {
        T::zero()
    }
    fn deepest(&self) -> T {
        T::zero()
    }
    fn support(&self) -> [T; 2] {
        [T::zero(); 2]
    }
}
