//! Tsai & Shah 1994: Newton's method on the reflectance, pixel by pixel.
//!
//! With p = (z − z_left)/h_x and q = (z − z_above)/h_y the residual f(z) = R − (s_z − s_x p − s_y
//! q)/√(1 + p² + q²) is linearised in the height of the pixel. The published method fails if f′
//! vanishes (immediately under frontal light, where the start z = 0 is stationary), and if slopes
//! diverge. It also fails along one diagonal, because only the left and the upper neighbours are
//! used. The modifications here are:
//!
//! - The step is K = f′ S/(W + f′² S) · f. S is the variance of the pixel, which is reduced to (1 −
//!   K f′) S. This is a Kalman gain instead of 1/f′ (the remedy of the authors), with W as the
//!   noise of the image.
//! - Slopes in f and f′ are limited to 5.
//! - The start is a slightly convex paraboloid with the centre and the axes of the mask instead of
//!   the stationary plane.
//! - The four corners are used in turn (left/right, above/below), so that no diagonal is preferred.
//!
//! The method is local: a few iterations add the fine relief to the start, and the large-scale
//! shape remains that of the start. The eikonal method is better whenever a height is known.

use super::FieldBuffers;
use crate::integrate::write_levelled;
use crate::{
    Domain, Image, Lighting, PixelScalar, SfsError, StopReason, Surface, SurfaceReconstruction,
    SurfaceWorkspace,
};
use tactile_core::Requirement;

/// Variance W of the reflectance.
const NOISE: f64 = 1e-2;

/// Limit of the slopes.
const MAX_SLOPE: f64 = 5.0;

/// Slope of the start at the nearest point of its boundary.
const START_SLOPE: f64 = 0.5;

/// Shape from shading by Newton's method on each pixel.
///
/// Heights agree with known ones on average, or have mean 0. Cost: O(pixels) per iteration.
/// `report.residual` is the root mean square residual of the reflectance.
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{Domain, Image, Lighting, SurfaceReconstruction, TsaiShah};
/// let image = Array2::from_shape_fn((32, 32), |(_, c)| if c < 16 { 0.6 } else { 0.8 });
/// let method = TsaiShah::new(Lighting::new([1.0, 0.0, 1.0])?).with_iterations(5)?;
/// assert_eq!(method.reconstruct(
///     Image::new(image.view(), Domain::default())
/// )?.report.iterations, 5);
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TsaiShah<T> {
    lighting: Lighting<T>,
    iterations: usize,
}

impl<T: PixelScalar> TsaiShah<T> {
    /// Creates the method with 12 iterations, noise variance 10⁻², slopes up to 5, and a start that
    /// falls with slope 0.5 at the nearest point of its boundary.
    pub fn new(lighting: Lighting<T>) -> Self {
        Self {
            lighting,
            iterations: 12,
        }
    }

    /// Sets the number of iterations. A larger number does not make the method converge to the
    /// surface.
    ///
    /// # Errors
    /// [`SfsError::InvalidOption`] for 0.
    pub fn with_iterations(self, iterations: usize) -> Result<Self, SfsError> {
        Requirement::Positive.check("iterations", iterations as f64)?;
        Ok(Self { iterations, ..self })
    }

    /// z = −½ s a xᵀ(4C)⁻¹x: the paraboloid whose contours are ellipses with the centre and the
    /// covariance C of the pixels with data (a uniform ellipse ends at xᵀC⁻¹x = 4). Here s is its
    /// slope at the ends of the minor half axis a = 2 √λ_min(C).
    fn start(field: &mut FieldBuffers<T>, grid: &Grid<T>) {
        let aspect = grid.step[1].as_f64();
        let at = |i: usize| {
            (
                (i % grid.columns) as f64,
                (i / grid.columns) as f64 * aspect,
            )
        };
        let inside = || {
            field
                .reflectance
                .iter()
                .enumerate()
                .filter(|(_, r)| !r.is_nan())
                .map(|(i, _)| at(i))
        };
        let (mut sum, mut count) = ([0.0; 2], 0.0);
        for (x, y) in inside() {
            sum = [sum[0] + x, sum[1] + y];
            count += 1.0;
        }
        let [cx, cy] = sum.map(|sum| sum / count);
        // The variance within a single pixel avoids a singular matrix for masks of one row or
        // column.
        let (mut xx, mut xy, mut yy) = (1.0 / 12.0, 0.0, aspect * aspect / 12.0);
        for (x, y) in inside() {
            xx += (x - cx) * (x - cx) / count;
            xy += (x - cx) * (y - cy) / count;
            yy += (y - cy) * (y - cy) / count;
        }
        let determinant = xx * yy - xy * xy;
        let largest = 0.5 * (xx + yy) + (0.5 * (xx - yy)).hypot(xy);
        let minor = 2.0 * (determinant / largest).sqrt();
        let curvature = -0.5 * START_SLOPE * minor / (4.0 * determinant);
        // The quadratic form of C⁻¹, whose determinant is included in the factor.
        for (i, z) in field.heights.iter_mut().enumerate() {
            let (x, y) = (at(i).0 - cx, at(i).1 - cy);
            *z = T::of(curvature * (yy * x * x - 2.0 * xy * x * y + xx * y * y));
        }
    }
}

/// The box of one call.
struct Grid<T> {
    rows: usize,
    columns: usize,
    step: [T; 2],
}

impl<T: PixelScalar> SurfaceReconstruction<T> for TsaiShah<T> {
    fn reconstruct(&self, image: Image<'_, '_, T>) -> Result<Surface<T>, SfsError> {
        Surface::made_by(|workspace, surface| self.reconstruct_with(workspace, image, surface))
    }

    fn reconstruct_with(
        &self,
        workspace: &mut SurfaceWorkspace<T>,
        image: Image<'_, '_, T>,
        surface: &mut Surface<T>,
    ) -> Result<(), SfsError> {
        let Image { values, domain } = image;
        surface.enter(values.dim(), &domain)?;
        let mut field = core::mem::take(&mut workspace.field);
        let loaded = field.load(&values, &domain, &self.lighting, surface);
        if loaded.is_ok() {
            self.solve(&mut field, workspace, &domain, surface);
            field.written.clear();
            let hx = domain.pixel_size_m[0];
            let heights = field.heights.iter().map(|&z| (z * hx).as_f64());
            field.written.extend(heights);
            write_levelled(&field.written, &domain, surface);
            surface.finish(&domain);
        }
        workspace.field = field;
        loaded
    }
}

impl<T: PixelScalar> TsaiShah<T> {
    /// Start and iterations, in widths of a pixel.
    fn solve(
        &self,
        field: &mut FieldBuffers<T>,
        workspace: &mut SurfaceWorkspace<T>,
        domain: &Domain<'_, T>,
        surface: &mut Surface<T>,
    ) {
        let area = surface.bounding_box;
        let [hx, hy] = domain.pixel_size_m;
        let grid = Grid {
            rows: area.rows(),
            columns: area.columns(),
            step: [T::one(), hy / hx],
        };
        for (vector, value) in [
            (&mut field.heights, T::zero()),
            (&mut field.variance, T::one()),
            (&mut field.next_heights, T::zero()),
        ] {
            vector.clear();
            vector.resize(area.area(), value);
        }
        Self::start(field, &grid);
        surface.report.stop = StopReason::IterationLimit;
        for iteration in 0..self.iterations {
            let misfit = self.iterate(field, &grid, iteration);
            core::mem::swap(&mut field.heights, &mut field.next_heights);
            surface.report.iterations = iteration + 1;
            surface.report.residual = misfit;
            if let Some(stop) = workspace.report(iteration + 1, self.iterations, misfit) {
                surface.report.stop = stop;
                break;
            }
        }
    }

    /// One step at every pixel. Returns the root mean square residual before the step.
    fn iterate(&self, field: &mut FieldBuffers<T>, grid: &Grid<T>, iteration: usize) -> T {
        let sign = |back: bool| if back { T::one() } else { -T::one() };
        // Four iterations use all four corners.
        let back = [iteration & 1 == 0, iteration & 2 == 0];
        let per = [sign(back[0]) / grid.step[0], sign(back[1]) / grid.step[1]];
        let max_slope = T::of(MAX_SLOPE);
        let cut = |slope: T| slope.max(-max_slope).min(max_slope);
        let (mut sum, mut count) = (T::zero(), 0usize);
        for i in 0..grid.rows * grid.columns {
            let (r, c) = (i / grid.columns, i % grid.columns);
            let (z, reflectance) = (field.heights[i], field.reflectance[i]);
            field.next_heights[i] = z;
            if reflectance.is_nan() {
                continue;
            }
            let beside = neighbour(&field.heights, i, c, grid.columns, 1, back[0]);
            let above = neighbour(&field.heights, i, r, grid.rows, grid.columns, back[1]);
            let slopes = [cut(per[0] * (z - beside)), cut(per[1] * (z - above))];
            let (f, slope) = self.residual(reflectance, slopes, per);
            let variance = field.variance[i];
            let gain = variance * slope / (T::of(NOISE) + slope * slope * variance);
            // The variance only decreases, so that changes become smaller with every iteration.
            field.variance[i] = (T::one() - gain * slope) * variance;
            field.next_heights[i] = z - gain * f;
            sum += f * f;
            count += 1;
        }
        (sum / T::of(count.max(1) as f64)).sqrt()
    }

    /// f = R − n·s, and its derivative with respect to the height of the pixel. The slopes change
    /// by `per` per unit of height.
    #[inline(always)]
    fn residual(&self, reflectance: T, [p, q]: [T; 2], [ax, ay]: [T; 2]) -> (T, T) {
        let [sx, sy, sz] = self.lighting.direction();
        let w2 = T::one() + p * p + q * q;
        let w = w2.sqrt();
        let cosine = (sz - sx * p - sy * q) / w;
        let slope = (sx * ax + sy * ay) / w + cosine * (p * ax + q * ay) / w2;
        // The derivative is not clamped in attached shadow: it moves the pixel back into the light.
        (reflectance - cosine.max(T::zero()), slope)
    }
}

/// Height of the neighbour before or after along one axis, or of the pixel itself at the border.
fn neighbour<T: PixelScalar>(
    z: &[T],
    i: usize,
    at: usize,
    length: usize,
    stride: usize,
    back: bool,
) -> T {
    match back {
        true if at > 0 => z[i - stride],
        false if at + 1 < length => z[i + stride],
        _ => z[i],
    }
}
