//! Ray tracing through the slab: the budget of an LED's light.
//!
//! Light enters through the edge x = 0 and travels along x between the top (deformed, possibly touched by an object) and
//! the bottom, beyond which the camera looks up. At every interface its power is split by Fresnel's coefficients for
//! unpolarised light and both parts are followed; what leaves the slab is counted. In the undeformed slab light within
//! the acceptance angle is totally reflected for good. A press breaks this twice: the top's slope turns rays towards the
//! normal, by twice the slope at each reflection, until they leave; and a touching object lets light out of the top
//! whatever its angle and scatters it back in all directions, some of them towards the camera.
//!
//! Ray optics only: no interference, no polarisation kept from one interface to the next, no absorption in the layers.
//!
//! Rays start on evenly spread points, so the budget converges much faster than with random ones (nearly as the inverse
//! of the number of rays for a flat slab). Cost: O(rays × events), events being reflections until the light has left or
//! falls below the cut-off.

mod budget;
mod follow;
mod options;
mod path;
mod ray;
pub(crate) mod sampling;

pub use budget::LightBudget;
pub use options::TraceOptions;
pub use path::path;

use crate::error::OpticsError;
use crate::fresnel::from_sine_and_cosine;
use crate::led::{Geometry, Led};
use crate::real::{as_f64, within};
use crate::surface::{TopSurface, contact_gap};
use budget::{RayOutcome, Tally};
use follow::Tracer;
use num_traits::{Float, FloatConst};
use ray::Ray;
use sampling::Points;

/// One layer of the slab.
///
/// ```
/// use tactile_optics::Dispersion;
/// use tactile_optics::trace::SlabLayer;
///
/// let epidermis = SlabLayer { index: Dispersion::PDMS_5_1.index(525e-9)?, thickness_m: 2e-3 };
/// assert!((epidermis.index - 1.405_f64).abs() < 1e-3);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlabLayer<T> {
    /// Refractive index.
    pub index: T,
    /// Thickness in metres.
    pub thickness_m: T,
}

/// A slab of layers, listed from the top (the object's side) down to the glass.
///
/// ```
/// use tactile_optics::trace::{Slab, SlabLayer};
///
/// // Epidermis, dermis and subcutanea on a plate of glass: the paper's indices (§3.3) and thicknesses.
/// let layers = [(1.38, 2e-3), (1.39, 3e-3), (1.40, 5e-3), (1.41, 3e-3)].map(|(index, thickness_m)| SlabLayer { index, thickness_m });
/// assert!(Slab::new(&layers, 1.0_f64, 30e-3).is_ok());
/// assert!(Slab::new(&layers, 1.0_f64, 0.0).is_err());
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slab<'a, T> {
    layers: &'a [SlabLayer<T>],
    ambient: T,
    length: T,
}

impl<'a, T: Float + FloatConst> Slab<'a, T> {
    /// `layers` from the top down, in an `ambient` index, `length_m` from the lit edge to the far one.
    ///
    /// # Errors
    /// [`OpticsError::Empty`] without layers; [`OpticsError::OutOfRange`] for an index, thickness or length that is not
    /// positive and finite.
    pub fn new(layers: &'a [SlabLayer<T>], ambient: T, length_m: T) -> Result<Self, OpticsError> {
        if layers.is_empty() {
            return Err(OpticsError::Empty { quantity: "slab" });
        }
        for layer in layers {
            within("refractive index", layer.index, 1e-6, 1e6)?;
            within("thickness of a layer", layer.thickness_m, 1e-9, 1e6)?;
        }
        within("refractive index of the ambient", ambient, 1e-6, 1e6)?;
        within("length of the slab", length_m, 1e-9, 1e6)?;
        Ok(Self {
            layers,
            ambient,
            length: length_m,
        })
    }

    /// Thickness of the whole slab in metres.
    pub(crate) fn thickness_m(&self) -> T {
        self.layers
            .iter()
            .fold(T::zero(), |sum, l| sum + l.thickness_m)
    }

    /// z of the upper face of layer `k` (of the bottom for `k` = number of layers).
    fn face(&self, k: usize) -> T {
        self.layers[..k]
            .iter()
            .fold(T::zero(), |z, l| z - l.thickness_m)
    }
}

/// Traces the LED's rays through the slab under `surface` and returns the light budget.
///
/// `camera_profile`, if not empty, receives the light reaching the camera by where along the slab it left, in equal bins
/// from x = 0 to the length; it is overwritten, and its sum is [`LightBudget::camera`].
///
/// # Errors
/// [`OpticsError::OutOfRange`] for a surface deeper than the top layer.
///
/// ```
/// use tactile_optics::led::Led;
/// use tactile_optics::surface::{Dimple, Flat};
/// use tactile_optics::trace::{Slab, SlabLayer, TraceOptions, trace};
///
/// let layers = [SlabLayer { index: 1.40_f64, thickness_m: 10e-3 }, SlabLayer { index: 1.41, thickness_m: 3e-3 }];
/// let slab = Slab::new(&layers, 1.0, 30e-3)?;
/// let (led, options) = (Led::default(), TraceOptions::default());
/// let at_rest = trace(&slab, &led, &Flat, &options, &mut [])?;
/// let dimple = Dimple::new([15e-3, 0.0], 4e-3, 1.5e-3)?;
/// let pressed = trace(&slab, &led, &dimple, &options, &mut [])?;
/// assert!(pressed.camera > at_rest.camera);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
pub fn trace<T: Float + FloatConst, S: TopSurface<T> + ?Sized>(
    slab: &Slab<'_, T>,
    led: &Led<T>,
    surface: &S,
    options: &TraceOptions<T>,
    camera_profile: &mut [T],
) -> Result<LightBudget<T>, OpticsError> {
    camera_profile.fill(T::zero());
    let mut tracer = new_tracer(slab, surface, options, camera_profile)?;
    let points = Points::new(options.geometry == Geometry::Volume, options.seed);
    let mut total = Tally::new();
    for i in 0..u64::from(options.rays) {
        let [z, u, v, y] = points.point::<T>(i);
        let (outside, weight) = led.direction(u, v, options.geometry);
        total.add(RayOutcome::Entry, weight);
        let across = match options.geometry {
            Geometry::Section => T::zero(),
            Geometry::Volume => (y + y - T::one()) * options.emitter_half_width_m,
        };
        let entry = launch(slab, z, across, outside);
        let transmitted = weight * entry.1;
        tracer.tally.add(RayOutcome::Entry, weight - transmitted);
        tracer.stream = sampling::hash(options.seed ^ sampling::hash(i));
        tracer.follow(Ray {
            power: transmitted,
            ..entry.0
        });
    }
    let total = total.budget(T::one()).entry;
    tracer
        .camera_profile
        .iter_mut()
        .for_each(|v| *v = *v / total);
    Ok(tracer.tally.budget(total))
}

/// A tracer of an empty budget; refuses a surface that reaches below the top layer.
fn new_tracer<'a, 's, T: Float + FloatConst, S: TopSurface<T> + ?Sized>(
    slab: &'a Slab<'s, T>,
    surface: &'a S,
    options: &'a TraceOptions<T>,
    camera_profile: &'a mut [T],
) -> Result<Tracer<'a, 's, T, S>, OpticsError> {
    let top = as_f64(slab.layers[0].thickness_m);
    within(
        "depth of the surface",
        surface.deepest(),
        0.0,
        top * (1.0 - 1e-6),
    )?;
    Ok(Tracer {
        slab,
        surface,
        options,
        tolerance: contact_gap(slab.thickness_m()),
        camera_sine: options.camera_half_angle.sin(),
        tally: Tally::new(),
        camera_profile,
        stream: 0,
    })
}

/// The ray inside the slab, at the share `z` of its thickness from the top, and the edge's transmittance.
fn launch<T: Float + FloatConst>(slab: &Slab<'_, T>, z: T, y: T, outside: [T; 3]) -> (Ray<T>, T) {
    let mut depth = z * slab.thickness_m();
    let mut layer = 0;
    while layer + 1 < slab.layers.len() && depth > slab.layers[layer].thickness_m {
        depth = depth - slab.layers[layer].thickness_m;
        layer += 1;
    }
    let n = slab.layers[layer].index;
    let across = outside[1].hypot(outside[2]);
    let edge = from_sine_and_cosine(slab.ambient, n, across, outside[0].max(T::zero()));
    // n sin θ is kept; a denser ambient can turn light back at the edge altogether.
    let ratio = slab.ambient / n;
    let (uy, uz) = (outside[1] * ratio, outside[2] * ratio);
    let along = (T::one() - uy * uy - uz * uz).max(T::zero()).sqrt();
    let position = [T::zero(), y, slab.face(layer) - depth];
    let ray = Ray {
        position,
        direction: [along, uy, uz],
        layer,
        power: T::zero(),
        events: 0,
    };
    (ray, edge.transmittance)
}
