//! The path of a single ray, for drawings.

use super::follow::Tracer;
use super::ray::{Branches, Ray};
use super::{Slab, TraceOptions, launch, new_tracer};
use crate::error::OpticsError;
use crate::real::{real, within};
use crate::surface::TopSurface;
use num_traits::{Float, FloatConst};

/// Follows the stronger part of one ray and writes its vertices (x, y, z in metres, z from the undeformed top) to
/// `vertices`; returns how many were written. The ray enters the edge x = 0 in the plane y = 0 at `depth_share` of the
/// slab's thickness, `angle` radians upwards from the LED's axis. It ends at an edge, where most of its light leaves
/// through top or bottom, or where `vertices` is full.
///
/// # Errors
/// [`OpticsError::OutOfRange`] for a share outside 0 to 1, an angle beyond a right one, or a surface deeper than the top layer.
///
/// ```
/// use tactile_optics::surface::Flat;
/// use tactile_optics::trace::{Slab, SlabLayer, path};
///
/// let slab = Slab::new(&[SlabLayer { index: 1.40_f64, thickness_m: 10e-3 }], 1.0, 30e-3)?;
/// let mut vertices = [[0.0; 3]; 8];
/// let count = path(&slab, &Flat, 0.5, 45.0_f64.to_radians(), &mut vertices)?;
/// // In at the middle of the edge, reflected from side to side, out of the far edge.
/// assert_eq!(vertices[0], [0.0, 0.0, -5e-3]);
/// assert!((vertices[count - 1][0] - 30e-3).abs() < 1e-12);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
pub fn path<T: Float + FloatConst, S: TopSurface<T> + ?Sized>(
    slab: &Slab<'_, T>,
    surface: &S,
    depth_share: T,
    angle: T,
    vertices: &mut [[T; 3]],
) -> Result<usize, OpticsError> {
    within("share of the slab's depth", depth_share, 0.0, 1.0)?;
    let right = core::f64::consts::FRAC_PI_2;
    within("angle of the ray", angle, -right, right)?;
    let options = TraceOptions::default();
    let mut tracer: Tracer<'_, '_, T, S> = new_tracer(slab, surface, &options, &mut [])?;
    let outside = [angle.cos(), T::zero(), angle.sin()];
    let (ray, _) = launch(slab, depth_share, T::zero(), outside);
    let mut current = Some(Ray {
        power: T::one(),
        ..ray
    });
    let mut written = 0;
    while let (Some(ray), true) = (current, written < vertices.len()) {
        vertices[written] = ray.position;
        written += 1;
        current = stronger_part(&mut tracer, ray);
        if current.is_none() && written < vertices.len() {
            let (distance, _) = tracer.next(&ray);
            vertices[written] = ray.at(distance);
            written += 1;
        }
    }
    Ok(written)
}

/// The strongest of the parts into which the next obstacle splits a ray; `None` if more than half of its light leaves there.
fn stronger_part<T: Float + FloatConst, S: TopSurface<T> + ?Sized>(
    tracer: &mut Tracer<'_, '_, T, S>,
    ray: Ray<T>,
) -> Option<Ray<T>> {
    let mut waiting = Branches::new();
    let mut best = tracer.advance(ray, &mut waiting);
    while let Some(branch) = waiting.pop() {
        if best.is_none_or(|b| b.power < branch.power) {
            best = Some(branch);
        }
    }
    best.filter(|b| b.power >= ray.power * real(0.5))
}
