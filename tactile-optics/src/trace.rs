//! Ray tracing through the slab: the budget of the LED light.
//!
//! Light enters through the edge x = 0 and travels along x between the top (deformed, possibly in
//! contact with an object) and the bottom, below which the camera is. At every interface its power
//! is split by Fresnel's coefficients for unpolarised light, and both parts are followed. Light
//! that leaves the slab is counted. In the undeformed slab, light within the acceptance angle is
//! always totally reflected. A press changes this in two ways. The slope of the top rotates rays
//! towards the normal, by twice the slope at each reflection, until they leave. A touching object
//! lets light of any angle out of the top and scatters it back in all directions, partly towards
//! the camera.
//!
//! Only ray optics: no interference, no polarisation from one interface to the next, no absorption
//! in the layers.
//!
//! Rays start at evenly distributed points, so that the budget converges much faster than with
//! random points (for a flat slab nearly as the inverse of the number of rays). Cost: O(rays ×
//! events). Events are the reflections until the light has left or falls below the cut-off.

use core::f64::consts::{FRAC_PI_2, FRAC_PI_6, PI};

#[cfg(not(feature = "std"))]
use num_traits::Float;

use crate::error::{OpticsError, within};
use crate::fresnel::crossing;
use crate::led::{Geometry, Led};
use crate::spread_points::{Points, hash, unit};
use crate::surface::{Meeting, TopSurface, contact_gap, march};

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
pub struct SlabLayer {
    /// Refractive index.
    pub index: f64,
    /// Thickness in metres.
    pub thickness_m: f64,
}

/// A slab of layers, listed from the top (the object's side) down to the glass.
///
/// ```
/// use tactile_optics::trace::{Slab, SlabLayer};
///
/// // Epidermis, dermis and subcutanea on a plate of glass, with the indices (§3.3) and
/// // thicknesses of the paper.
/// let layers = [(1.38, 2e-3), (1.39, 3e-3), (1.40, 5e-3), (1.41, 3e-3)]
///     .map(|(index, thickness_m)| SlabLayer { index, thickness_m });
/// assert!(Slab::new(&layers, 1.0_f64, 30e-3).is_ok());
/// assert!(Slab::new(&layers, 1.0_f64, 0.0).is_err());
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slab<'a> {
    layers: &'a [SlabLayer],
    ambient: f64,
    length: f64,
}

impl<'a> Slab<'a> {
    /// Creates a slab of `layers` from the top down in an ambient of index `ambient`, with
    /// `length_m` from the lit edge to the far edge.
    ///
    /// # Errors
    /// [`OpticsError::Empty`] without layers; [`OpticsError::OutOfRange`] for an index, thickness
    /// or length that is not positive and finite.
    pub fn new(layers: &'a [SlabLayer], ambient: f64, length_m: f64) -> Result<Self, OpticsError> {
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
    fn thickness_m(&self) -> f64 {
        self.layers.iter().fold(0.0, |sum, l| sum + l.thickness_m)
    }

    /// z of the upper face of layer `k` (of the bottom if `k` is the number of layers).
    fn face(&self, k: usize) -> f64 {
        self.layers[..k].iter().fold(0.0, |z, l| z - l.thickness_m)
    }
}

/// Traces the rays of the LED through the slab under `surface` and returns the light budget.
///
/// `camera_profile`, if not empty, receives the light that reaches the camera, by the position at
/// which it left the slab, in equal bins from x = 0 to the length. It is overwritten, and its sum
/// is [`LightBudget::camera`].
///
/// # Errors
/// [`OpticsError::OutOfRange`] for a surface that is deeper than the top layer.
///
/// ```
/// use tactile_optics::Led;
/// use tactile_optics::surface::{Dimple, Flat};
/// use tactile_optics::trace::{Slab, SlabLayer, TraceOptions, trace};
///
/// let layers = [
///     SlabLayer {
///         index: 1.40_f64,
///         thickness_m: 10e-3,
///     },
///     SlabLayer {
///         index: 1.41,
///         thickness_m: 3e-3,
///     },
/// ];
/// let slab = Slab::new(&layers, 1.0, 30e-3)?;
/// let (led, options) = (Led::default(), TraceOptions::default());
/// let at_rest = trace(&slab, &led, &Flat, &options, &mut [])?;
/// let dimple = Dimple::new([15e-3, 0.0], 4e-3, 1.5e-3)?;
/// let pressed = trace(&slab, &led, &dimple, &options, &mut [])?;
/// assert!(pressed.camera > at_rest.camera);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
pub fn trace<S: TopSurface + ?Sized>(
    slab: &Slab<'_>,
    led: &Led,
    surface: &S,
    options: &TraceOptions,
    camera_profile: &mut [f64],
) -> Result<LightBudget, OpticsError> {
    camera_profile.fill(0.0);
    let mut tracer = new_tracer(slab, surface, options, camera_profile)?;
    let points = Points::new(options.geometry == Geometry::Volume, options.seed);
    let mut total = Tally::default();
    for i in 0..u64::from(options.rays) {
        let [z, u, v, y] = points.point(i);
        let (outside, weight) = led.direction(u, v, options.geometry);
        // The sum of the weights is not known in advance. It divides every fraction at the end.
        total.add(RayOutcome::Entry, weight);
        let across = match options.geometry {
            Geometry::Section => 0.0,
            Geometry::Volume => (y + y - 1.0) * options.emitter_half_width_m,
        };
        let entry = launch(slab, z, across, outside);
        let transmitted = weight * entry.1;
        tracer.tally.add(RayOutcome::Entry, weight - transmitted);
        // Every ray has its own random numbers: light scattered from one ray does not affect the
        // next ray.
        tracer.stream = hash(options.seed ^ hash(i));
        tracer.follow(Ray {
            power: transmitted,
            ..entry.0
        });
    }
    let total = total.budget(1.0).entry;
    tracer.camera_profile.iter_mut().for_each(|v| *v /= total);
    Ok(tracer.tally.budget(total))
}

/// A tracer with an empty budget. It is an error if the surface extends below the top layer.
fn new_tracer<'a, 's, S: TopSurface + ?Sized>(
    slab: &'a Slab<'s>,
    surface: &'a S,
    options: &'a TraceOptions,
    camera_profile: &'a mut [f64],
) -> Result<Tracer<'a, 's, S>, OpticsError> {
    let top = slab.layers[0].thickness_m;
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
        tally: Tally::default(),
        camera_profile,
        stream: 0,
    })
}

/// The ray inside the slab, at the fraction `z` of its thickness from the top, and the
/// transmittance of the edge.
fn launch(slab: &Slab<'_>, z: f64, y: f64, outside: [f64; 3]) -> (Ray, f64) {
    let mut depth = z * slab.thickness_m();
    let mut layer = 0;
    while layer + 1 < slab.layers.len() && depth > slab.layers[layer].thickness_m {
        depth -= slab.layers[layer].thickness_m;
        layer += 1;
    }
    let n = slab.layers[layer].index;
    let across = outside[1].hypot(outside[2]);
    let edge = crossing(slab.ambient, n, across, outside[0].max(0.0));
    // n sin θ is conserved. A denser ambient can reflect all light at the edge: the power is then
    // 0.
    let ratio = slab.ambient / n;
    let (uy, uz) = (outside[1] * ratio, outside[2] * ratio);
    let along = (1.0 - uy * uy - uz * uz).max(0.0).sqrt();
    let position = [0.0, y, slab.face(layer) - depth];
    let ray = Ray {
        position,
        direction: [along, uy, uz],
        layer,
        power: 0.0,
        events: 0,
    };
    (ray, edge.map_or(0.0, |(share, _)| share))
}

/// The number of rays, their starting points, and which of them reach the camera.
///
/// ```
/// use tactile_optics::{Geometry, OpticsError, trace::TraceOptions};
///
/// let quick = TraceOptions::default()
///     .with_geometry(Geometry::Section)
///     .with_rays(256)?
///     .with_seed(7)
///     .with_cutoff(1e-4)?
///     .with_camera_half_angle(0.3)?
///     .with_emitter_half_width_m(2.5e-3)?;
/// assert_ne!(quick, TraceOptions::default());
/// assert!(matches!(
///     quick.with_cutoff(f64::NAN),
///     Err(OpticsError::OutOfRange {
///         quantity: "cut-off",
///         ..
///     })
/// ));
/// # Ok::<(), OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TraceOptions {
    geometry: Geometry,
    rays: u32,
    seed: u64,
    cutoff: f64,
    camera_half_angle: f64,
    emitter_half_width_m: f64,
}

impl Default for TraceOptions {
    /// 4096 rays in space, a cut-off of 10⁻⁶, a camera that sees 30° around its axis, and a point
    /// LED.
    fn default() -> Self {
        Self {
            geometry: Geometry::Volume,
            // The guided fraction is accurate to 2×10⁻⁴ in 20 ms. For the error with more rays run
            // `cargo bench -p tactile-benches --bench work_precision -- optics`.
            rays: 4096,
            seed: 1,
            cutoff: 1e-6,
            camera_half_angle: FRAC_PI_6,
            emitter_half_width_m: 0.0,
        }
    }
}

impl TraceOptions {
    /// Sets whether a section or all of space is traced.
    pub fn with_geometry(mut self, geometry: Geometry) -> Self {
        self.geometry = geometry;
        self
    }

    /// Sets the number of rays from the LED.
    ///
    /// # Errors
    /// [`OpticsError::OutOfRange`] for zero rays.
    pub fn with_rays(mut self, rays: u32) -> Result<Self, OpticsError> {
        within("number of rays", f64::from(rays), 1.0, 4.3e9)?;
        self.rays = rays;
        Ok(self)
    }

    /// Sets the seed, which shifts the starting points and changes the directions of scattered
    /// light.
    pub fn with_seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self
    }

    /// Sets the cut-off: a branch with less than this fraction of the power of its ray is not
    /// followed.
    ///
    /// # Errors
    /// [`OpticsError::OutOfRange`] for a fraction outside 0 to 1.
    pub fn with_cutoff(mut self, share: f64) -> Result<Self, OpticsError> {
        self.cutoff = within("cut-off", share, 0.0, 1.0)?;
        Ok(self)
    }

    /// Sets the half angle of the camera (radians): rays that leave the bottom within this angle of
    /// its normal reach the camera.
    ///
    /// # Errors
    /// [`OpticsError::OutOfRange`] for an angle outside 0 to π/2.
    pub fn with_camera_half_angle(mut self, angle: f64) -> Result<Self, OpticsError> {
        // π/2 converted from degrees may exceed a right angle by rounding.
        let right = FRAC_PI_2 * (1.0 + 1e-7);
        self.camera_half_angle = within("half angle of the camera", angle, 0.0, right)?;
        Ok(self)
    }

    /// Sets the half width of the LED across the slab, in metres. It has no effect in a section.
    ///
    /// # Errors
    /// [`OpticsError::OutOfRange`] for a width that is negative or not finite.
    pub fn with_emitter_half_width_m(mut self, half_width_m: f64) -> Result<Self, OpticsError> {
        self.emitter_half_width_m = within("half width of the emitter", half_width_m, 0.0, 1e6)?;
        Ok(self)
    }
}

/// Fractions of the LED light by where the light ended. They add up to 1 within rounding.
///
/// ```
/// use tactile_optics::Led;
/// use tactile_optics::surface::Flat;
/// use tactile_optics::trace::{Slab, SlabLayer, TraceOptions, trace};
///
/// let slab = Slab::new(&[SlabLayer { index: 1.40_f64, thickness_m: 10e-3 }], 1.0, 30e-3)?;
/// let budget = trace(&slab, &Led::default(), &Flat, &TraceOptions::default(), &mut [])?;
/// let leaked = budget.above + budget.below + budget.camera;
/// let rest = budget.entry + budget.returned + budget.absorbed + budget.unresolved;
/// assert!((budget.guided + leaked + rest - 1.0).abs() < 1e-12);
/// // A flat layer guides nearly all light that enters it.
/// assert!(budget.guided / (1.0 - budget.entry) > 0.98 && leaked < 0.02);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct LightBudget {
    /// Reflected at the lit edge without entering.
    pub entry: f64,
    /// Guided to the far edge by total reflection.
    pub guided: f64,
    /// Returned to the lit edge.
    pub returned: f64,
    /// Left through the top into the ambient.
    pub above: f64,
    /// Left through the bottom at an angle outside the view of the camera.
    pub below: f64,
    /// Left through the bottom towards the camera.
    pub camera: f64,
    /// Lost in the touching object.
    pub absorbed: f64,
    /// Not followed to the end: branches below the cut-off and rays with too many events.
    pub unresolved: f64,
}

/// Outcome of a ray, in the order of the fields of [`LightBudget`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(usize)]
enum RayOutcome {
    Entry,
    Guided,
    Returned,
    Above,
    Below,
    Camera,
    Absorbed,
    Unresolved,
}

/// Compensated sums (Neumaier), one per outcome: a million rays are summed without loss.
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    sums: [f64; 8],
    errors: [f64; 8],
}

impl Tally {
    fn add(&mut self, outcome: RayOutcome, power: f64) {
        let k = outcome as usize;
        let (old, new) = (self.sums[k], self.sums[k] + power);
        let lost = if old.abs() >= power.abs() {
            (old - new) + power
        } else {
            (power - new) + old
        };
        self.sums[k] = new;
        self.errors[k] += lost;
    }

    /// Fractions of `total`.
    fn budget(&self, total: f64) -> LightBudget {
        let share = |outcome: RayOutcome| {
            (self.sums[outcome as usize] + self.errors[outcome as usize]) / total
        };
        LightBudget {
            entry: share(RayOutcome::Entry),
            guided: share(RayOutcome::Guided),
            returned: share(RayOutcome::Returned),
            above: share(RayOutcome::Above),
            below: share(RayOutcome::Below),
            camera: share(RayOutcome::Camera),
            absorbed: share(RayOutcome::Absorbed),
            unresolved: share(RayOutcome::Unresolved),
        }
    }
}

/// Follows the stronger part of one ray and writes its vertices (x, y, z in metres, z from the
/// undeformed top) to `vertices`. Returns the number of vertices. The ray enters the edge x = 0 in
/// the plane y = 0, at the fraction `depth_share` of the slab's thickness. Its direction is `angle`
/// radians upwards from the axis of the LED. It ends at an edge, at the point at which most of its
/// light leaves through top or bottom, or when `vertices` is full. `vertices` is full.
///
/// # Errors
/// [`OpticsError::OutOfRange`] for a fraction outside 0 to 1, an angle beyond a right angle, or a
/// surface that is deeper than the top layer.
///
/// ```
/// use tactile_optics::surface::Flat;
/// use tactile_optics::trace::{Slab, SlabLayer, path};
///
/// let slab = Slab::new(&[SlabLayer { index: 1.40_f64, thickness_m: 10e-3 }], 1.0, 30e-3)?;
/// let mut vertices = [[0.0; 3]; 8];
/// let count = path(&slab, &Flat, 0.5, 45.0_f64.to_radians(), &mut vertices)?;
/// // Enters at the middle of the edge, is reflected from side to side, and leaves at the far edge.
/// assert_eq!(vertices[0], [0.0, 0.0, -5e-3]);
/// assert!((vertices[count - 1][0] - 30e-3).abs() < 1e-12);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
pub fn path<S: TopSurface + ?Sized>(
    slab: &Slab<'_>,
    surface: &S,
    depth_share: f64,
    angle: f64,
    vertices: &mut [[f64; 3]],
) -> Result<usize, OpticsError> {
    within("fraction of the slab's depth", depth_share, 0.0, 1.0)?;
    // A ray at a larger angle would start backwards, out of the lit edge.
    let right = FRAC_PI_2;
    within("angle of the ray", angle, -right, right)?;
    let options = TraceOptions::default();
    let mut tracer: Tracer<'_, '_, S> = new_tracer(slab, surface, &options, &mut [])?;
    let outside = [angle.cos(), 0.0, angle.sin()];
    let (ray, _) = launch(slab, depth_share, 0.0, outside);
    let mut current = Some(Ray { power: 1.0, ..ray });
    let mut written = 0;
    while let (Some(ray), true) = (current, written < vertices.len()) {
        vertices[written] = ray.position;
        written += 1;
        current = stronger_part(&mut tracer, ray);
        // The path also contains the point at which its light leaves.
        if current.is_none() && written < vertices.len() {
            let (distance, _) = tracer.next(&ray);
            vertices[written] = ray.at(distance);
            written += 1;
        }
    }
    Ok(written)
}

/// The strongest part into which the next obstacle splits a ray. `None` if more than half of its
/// light leaves there.
fn stronger_part<S: TopSurface + ?Sized>(tracer: &mut Tracer<'_, '_, S>, ray: Ray) -> Option<Ray> {
    let mut waiting = Branches::default();
    let mut best = tracer.advance(ray, &mut waiting);
    while let Some(branch) = waiting.pop() {
        if best.is_none_or(|b| b.power < branch.power) {
            best = Some(branch);
        }
    }
    best.filter(|b| b.power >= ray.power * 0.5)
}

/// Number of reflections after which a ray is given up: a guided ray in a long slab needs a few
/// thousand.
const MAX_EVENTS: u32 = 20_000;

/// The state of a trace: the scene, the sums and the random numbers.
struct Tracer<'a, 's, S: ?Sized> {
    slab: &'a Slab<'s>,
    surface: &'a S,
    options: &'a TraceOptions,
    /// Gap that counts as contact with the surface.
    tolerance: f64,
    camera_sine: f64,
    tally: Tally,
    camera_profile: &'a mut [f64],
    /// State of the random numbers of the current ray.
    stream: u64,
}

/// The next obstacle on a ray's path.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Next {
    /// The top of the slab.
    Top,
    /// The upper face of the layer, an interface inside the slab.
    Up,
    /// The lower face of the layer.
    Down,
    /// The edge ahead of the ray.
    Edge,
    /// No obstacle was found: the ray runs along the surface.
    Nothing,
}

impl<S: TopSurface + ?Sized> Tracer<'_, '_, S> {
    /// Follows a ray and all its branches.
    fn follow(&mut self, first: Ray) {
        // The cut-off is relative to each ray, so that weak rays are followed as far as strong
        // ones.
        let smallest = first.power * self.options.cutoff;
        let mut branches = Branches::default();
        let mut current = Some(first);
        while let Some(ray) = current {
            current = if ray.power <= smallest || ray.events >= MAX_EVENTS {
                self.tally.add(RayOutcome::Unresolved, ray.power);
                None
            } else {
                self.advance(ray, &mut branches)
            }
            .or_else(|| branches.pop());
        }
    }

    /// Moves the ray to its next obstacle. Returns the part that continues, or `None`.
    fn advance(&mut self, ray: Ray, branches: &mut Branches) -> Option<Ray> {
        let (distance, next) = self.next(&ray);
        let mut ray = Ray {
            position: ray.at(distance),
            events: ray.events + 1,
            ..ray
        };
        match next {
            Next::Nothing => self.tally.add(RayOutcome::Unresolved, ray.power),
            Next::Edge => {
                let outcome = if ray.direction[0] > 0.0 {
                    RayOutcome::Guided
                } else {
                    RayOutcome::Returned
                };
                self.tally.add(outcome, ray.power);
            }
            Next::Top => return self.top(ray, branches),
            Next::Up => {
                // Placed exactly on the face. Rounding could leave the ray outside the layer that
                // it enters.
                ray.position[2] = self.slab.face(ray.layer);
                return self.inside(ray, ray.layer - 1, branches);
            }
            Next::Down => {
                ray.position[2] = self.slab.face(ray.layer + 1);
                let below = ray.layer + 1;
                if below < self.slab.layers.len() {
                    return self.inside(ray, below, branches);
                }
                return Some(self.bottom(ray));
            }
        }
        None
    }

    /// Distance and kind of the nearest obstacle: edge, face of the layer, or top.
    fn next(&self, ray: &Ray) -> (f64, Next) {
        let [ux, _, uz] = ray.direction;
        // The slab has no sides: a ray across its width meets no obstacle.
        let edge = match ux {
            u if u > 0.0 => (self.slab.length - ray.position[0]) / u,
            u if u < 0.0 => ray.position[0] / -u,
            _ => f64::INFINITY,
        };
        let mut nearest = (edge.max(0.0), Next::Edge);
        let mut offer = |distance: f64, next: Next| {
            if distance < nearest.0 {
                nearest = (distance.max(0.0), next);
            }
        };
        if uz < 0.0 {
            offer(
                (self.slab.face(ray.layer + 1) - ray.position[2]) / uz,
                Next::Down,
            );
        } else if uz > 0.0 && ray.layer > 0 {
            offer((self.slab.face(ray.layer) - ray.position[2]) / uz, Next::Up);
        }
        // Only the top layer is bounded by the deformed surface, which `new_tracer` keeps above the
        // lower face of that layer.
        if ray.layer > 0 {
            return nearest;
        }
        match self.meet_top(ray, nearest.0) {
            Meeting::At(distance) => (distance, Next::Top),
            Meeting::Missed => nearest,
            Meeting::Undecided => (0.0, Next::Nothing),
        }
    }

    /// Intersection of the ray with the top before the distance `limit`: with the plane z = 0
    /// outside the support of the surface, and with the surface itself inside.
    fn meet_top(&self, ray: &Ray, limit: f64) -> Meeting {
        let ([x, _, z], [ux, _, uz]) = (ray.position, ray.direction);
        let [left, right] = self.surface.support();
        let plane = if uz > 0.0 {
            ((-z) / uz).max(0.0)
        } else {
            f64::INFINITY
        };
        // The part of the path inside the support.
        let (enter, leave) = if ux == 0.0 {
            if x >= left && x <= right {
                (0.0, limit)
            } else {
                (f64::INFINITY, f64::INFINITY)
            }
        } else {
            let (a, b) = ((left - x) / ux, (right - x) / ux);
            (a.min(b).max(0.0), a.max(b))
        };
        let meets_plane = |distance: f64| {
            if distance <= limit {
                Meeting::At(distance)
            } else {
                Meeting::Missed
            }
        };
        // The flat top applies if the support is empty, lies behind the ray, or begins beyond the
        // crossing of z = 0.
        if left >= right || leave <= 0.0 || plane < enter {
            return meets_plane(plane);
        }
        if enter > limit {
            return Meeting::Missed;
        }
        match march(
            self.surface,
            &ray.position,
            &ray.direction,
            [enter, leave.min(limit)],
            self.tolerance,
        ) {
            // Beyond the support the top is the plane z = 0 again, which applies only from there
            // on.
            Meeting::Missed => meets_plane(plane.max(leave)),
            met => met,
        }
    }

    /// Splits a ray at the top: the transmitted part leaves, or enters the touching object and is
    /// scattered back or absorbed.
    fn top(&mut self, mut ray: Ray, branches: &mut Branches) -> Option<Ray> {
        let [x, y, _] = ray.position;
        let [left, right] = self.surface.support();
        let deformed = x > left && x < right;
        // Slopes and object apply only inside the support, as in `meet_top`.
        let [gx, gy] = if deformed {
            self.surface.gradient(x, y)
        } else {
            [0.0; 2]
        };
        ray.position[2] = if deformed {
            self.surface.height(x, y)
        } else {
            0.0
        };
        let normal = normalised([-gx, -gy, 1.0]);
        let object = if deformed {
            self.surface.touching(x, y)
        } else {
            None
        };
        let outside = object.map_or(self.slab.ambient, |o| o.index);
        // At a touching object its index applies, so that reflection need not be total.
        let transmitted = ray.power * self.transmittance(&ray, &normal, outside);
        match object {
            None => self.tally.add(RayOutcome::Above, transmitted),
            Some(object) => {
                let scattered = transmitted * object.albedo;
                self.tally
                    .add(RayOutcome::Absorbed, transmitted - scattered);
                let direction = self.scatter(&normal);
                self.keep(
                    Ray {
                        direction,
                        power: scattered,
                        ..ray
                    },
                    branches,
                );
            }
        }
        Some(ray.mirrored(&normal, ray.power - transmitted))
    }

    /// Splits a ray at the bottom: the transmitted part leaves, towards the camera or not.
    fn bottom(&mut self, ray: Ray) -> Ray {
        let normal = [0.0, 0.0, 1.0];
        let transmitted = ray.power * self.transmittance(&ray, &normal, self.slab.ambient);
        let sine = ray.direction[0].hypot(ray.direction[1]);
        // The camera's angle is defined outside the slab. Snell's law converts it to the layer of
        // the ray.
        let seen = self.slab.layers[ray.layer].index * sine <= self.slab.ambient * self.camera_sine;
        self.tally.add(
            if seen {
                RayOutcome::Camera
            } else {
                RayOutcome::Below
            },
            transmitted,
        );
        if seen && !self.camera_profile.is_empty() {
            let bins = self.camera_profile.len();
            let share = ray.position[0] / self.slab.length * (bins as f64);
            let bin = (share as usize).min(bins - 1);
            self.camera_profile[bin] += transmitted;
        }
        ray.mirrored(&normal, ray.power - transmitted)
    }

    /// Splits a ray at an interface inside the slab: the refracted part continues, and the
    /// reflected part is stored as a branch.
    fn inside(&mut self, ray: Ray, beyond: usize, branches: &mut Branches) -> Option<Ray> {
        let normal = [0.0, 0.0, 1.0];
        let (n1, n2) = (
            self.slab.layers[ray.layer].index,
            self.slab.layers[beyond].index,
        );
        let [ux, uy, uz] = ray.direction;
        let (sine, cosine) = (ux.hypot(uy), uz.abs());
        // Total reflection needs no branch, because no light is transmitted.
        let Some((share, along)) = crossing(n1, n2, sine, cosine) else {
            return Some(ray.mirrored(&normal, ray.power));
        };
        let transmitted = ray.power * share;
        self.keep(ray.mirrored(&normal, ray.power - transmitted), branches);
        let ratio = n1 / n2;
        // By Snell's law n times the tangential part is conserved. The normal part comes from
        // `crossing`, without cancellation at grazing incidence.
        let direction = normalised([ux * ratio, uy * ratio, (along / n2).copysign(uz)]);
        Some(Ray {
            direction,
            layer: beyond,
            power: transmitted,
            ..ray
        })
    }

    fn transmittance(&self, ray: &Ray, normal: &[f64; 3], outside: f64) -> f64 {
        let inside = self.slab.layers[ray.layer].index;
        let cosine = dot(&ray.direction, normal).abs().min(1.0);
        let sine = sine_between(&ray.direction, normal);
        crossing(inside, outside, sine, cosine).map_or(0.0, |(share, _)| share)
    }

    /// Stores a branch for later, or counts it as unresolved if the stack is full.
    fn keep(&mut self, ray: Ray, branches: &mut Branches) {
        if ray.power > 0.0 && !branches.push(ray) {
            self.tally.add(RayOutcome::Unresolved, ray.power);
        }
    }

    /// A direction into the slab by Lambert's law about the inward normal of the surface.
    fn scatter(&mut self, normal: &[f64; 3]) -> [f64; 3] {
        self.stream = hash(self.stream);
        let u = unit(self.stream);
        if self.options.geometry == Geometry::Section {
            // In a plane, Lambert's law is a uniform distribution of the sine of the angle over −1
            // to 1.
            let across = u + u - 1.0;
            let inward = ((1.0 - across) * (1.0 + across)).sqrt();
            return normalised([
                -inward * normal[0] + across * normal[2],
                0.0,
                -inward * normal[2] - across * normal[0],
            ]);
        }
        self.stream = hash(self.stream);
        let (sin, cos) = (unit(self.stream) * (PI + PI)).sin_cos();
        // Uniform points of a disc, projected to the hemisphere, follow Lambert's law in space
        // (Malley's method).
        let (radius, inward) = (u.sqrt(), (1.0 - u).sqrt());
        // Two directions in the tangent plane. The z component of the normal is positive, so that
        // the normal is never along y and `first` is not zero.
        let first = normalised([normal[2], 0.0, -normal[0]]);
        let second = [
            normal[1] * first[2] - normal[2] * first[1],
            normal[2] * first[0] - normal[0] * first[2],
            normal[0] * first[1] - normal[1] * first[0],
        ];
        normalised(core::array::from_fn(|k| {
            radius * (cos * first[k] + sin * second[k]) - inward * normal[k]
        }))
    }
}

/// A ray in a layer.
#[derive(Debug, Clone, Copy)]
struct Ray {
    position: [f64; 3],
    direction: [f64; 3],
    layer: usize,
    power: f64,
    events: u32,
}

impl Ray {
    /// The point at the distance `t` along the ray.
    fn at(&self, t: f64) -> [f64; 3] {
        core::array::from_fn(|k| self.position[k] + t * self.direction[k])
    }

    /// The ray mirrored at a plane with the unit normal `n`, with the remaining `power`.
    fn mirrored(&self, n: &[f64; 3], power: f64) -> Self {
        let along = dot(&self.direction, n);
        let direction = core::array::from_fn(|k| self.direction[k] - (along + along) * n[k]);
        Self {
            // Without this, rounding errors would grow over thousands of reflections.
            direction: normalised(direction),
            power,
            ..*self
        }
    }
}

fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn normalised(v: [f64; 3]) -> [f64; 3] {
    let length = dot(&v, &v).sqrt();
    v.map(|c| c / length)
}

/// Sine of the angle between unit vectors, accurate for small angles.
fn sine_between(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    let x = a[1] * b[2] - a[2] * b[1];
    let y = a[2] * b[0] - a[0] * b[2];
    let z = a[0] * b[1] - a[1] * b[0];
    (x * x + y * y + z * z).sqrt().min(1.0)
}

/// Branches that are still to be followed. The size is fixed, so that tracing never allocates.
#[derive(Debug, Default)]
struct Branches {
    rays: [Option<Ray>; 32],
    count: usize,
}

impl Branches {
    /// Stores a ray. Returns false if the stack is full.
    fn push(&mut self, ray: Ray) -> bool {
        let Some(slot) = self.rays.get_mut(self.count) else {
            return false;
        };
        *slot = Some(ray);
        self.count += 1;
        true
    }

    fn pop(&mut self) -> Option<Ray> {
        self.count = self.count.checked_sub(1)?;
        self.rays[self.count].take()
    }
}
