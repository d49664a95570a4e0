//! Brooks & Horn 1985 with the integrability of Frankot & Chellappa 1988.
//!
//! Minimises ∫ (R − n·s)² + λ |∇n|² over unit normals by the iteration n ← normalise(n̄ + (R −
//! n̄·s) s/(1 + 4 λ)), n̄ the mean of the neighbours. That is the pixel's own equation solved
//! exactly. The printed explicit form diverges for small λ. Every few steps the slopes are
//! projected on the integrable ones (in the Fourier domain, or by another integrator), and the
//! heights are those of the last projection. Normals have no infinite slopes, so the occluding
//! boundary is an ordinary boundary condition: there n lies in the image plane and points outwards.

use std::sync::Arc;

use ndarray::Array2;
use tactile_core::{Requirement, StopReason};

use super::FieldBuffers;
use crate::integrate::write_levelled;
use crate::{
    BoundingBox, Domain, Frame, Lighting, PixelScalar, SfsError, SlopeIntegrator, Surface,
    SurfaceReconstruction, SurfaceWorkspace,
};

/// Variational shape from shading with integrability.
///
/// Heights are level with known ones on average, or have mean 0. O(pixels) a step plus O(N M log(N
/// M)) a projection. `report.residual` is the root mean square misfit of the reflectance.
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{BrooksHorn, Domain, Lighting, SurfaceReconstruction};
/// let image = Array2::from_elem((16, 16), 1.0);
/// let method = BrooksHorn::new(Lighting::default());
/// let surface = method.reconstruct(image.view().into(), &Domain::default())?;
/// // Facing the light everywhere: flat.
/// assert!(surface.heights.iter().all(|z: &f64| z.abs() < 1e-9));
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BrooksHorn<T> {
    lighting: Lighting<T>,
    smoothness: T,
    iterations: usize,
    project_every: usize,
    occluding_boundary: bool,
    max_slope: T,
}

impl<T: PixelScalar> BrooksHorn<T> {
    /// λ = 0.02, 300 steps, a projection every 20, no occluding boundary, slopes up to 10.
    pub fn new(lighting: Lighting<T>) -> Self {
        let (smoothness, max_slope) = (T::of(0.02), T::of(10.0));
        Self {
            lighting,
            smoothness,
            iterations: 300,
            project_every: 20,
            occluding_boundary: false,
            max_slope,
        }
    }

    /// λ, the weight of smoothness against the image.
    ///
    /// # Errors
    /// [`SfsError::InvalidOption`] unless positive and finite.
    pub fn with_smoothness(self, smoothness: T) -> Result<Self, SfsError> {
        Requirement::Positive.check("smoothness", smoothness.as_f64())?;
        Ok(Self { smoothness, ..self })
    }

    /// Number of steps and of steps between projections.
    ///
    /// # Errors
    /// [`SfsError::InvalidOption`] if either is 0.
    pub fn with_iterations(
        self,
        iterations: usize,
        project_every: usize,
    ) -> Result<Self, SfsError> {
        Requirement::Positive.check("iterations", iterations as f64)?;
        Requirement::Positive.check("steps between projections", project_every as f64)?;
        Ok(Self {
            iterations,
            project_every,
            ..self
        })
    }

    /// Whether the mask's border (not the frame's) is an occluding contour of a convex object.
    ///
    /// ```
    /// use ndarray::Array2;
    /// use tactile_sfs::{BrooksHorn, Domain, Lighting, SurfaceReconstruction};
    /// // A hemisphere of radius 10 px, vertical at its boundary.
    /// let z = Array2::from_shape_fn((25, 25), |(r, c)| {
    ///     (100.0 - (r as f64 - 12.0).powi(2) - (c as f64 - 12.0).powi(2)).max(0.0).sqrt()
    /// });
    /// let (image, mask) = (z.mapv(|z| z / 10.0), z.mapv(|z| z > 0.0));
    /// let method = BrooksHorn::new(Lighting::default())
    ///     .with_occluding_boundary(true)
    ///     .with_smoothness(0.05)?
    ///     .with_iterations(100, 20)?;
    /// let domain = Domain::default().with_mask(mask.view());
    /// let heights = method.reconstruct(image.view().into(), &domain)?.heights;
    /// // A bump by the boundary alone: the light would allow a hollow.
    /// assert!(heights[[12, 12]] - heights[[12, 4]] > 2.0);
    /// # Ok::<(), tactile_sfs::SfsError>(())
    /// ```
    pub fn with_occluding_boundary(self, occluding_boundary: bool) -> Self {
        Self {
            occluding_boundary,
            ..self
        }
    }
}

impl<T: PixelScalar> SurfaceReconstruction<T> for BrooksHorn<T> {
    fn reconstruct(
        &self,
        frame: Frame<'_, T>,
        domain: &Domain<'_, T>,
    ) -> Result<Surface<T>, SfsError> {
        Surface::made_by(|workspace, surface| {
            self.reconstruct_with(workspace, frame, domain, surface)
        })
    }

    fn reconstruct_with(
        &self,
        workspace: &mut SurfaceWorkspace<T>,
        frame: Frame<'_, T>,
        domain: &Domain<'_, T>,
        surface: &mut Surface<T>,
    ) -> Result<(), SfsError> {
        self.run(None, workspace, frame, domain, surface)
    }

    fn with_slope_integrator(
        &self,
        integrator: Arc<dyn SlopeIntegrator<T> + Send + Sync>,
    ) -> Option<Arc<dyn SurfaceReconstruction<T> + Send + Sync>> {
        Some(Arc::new(Integrated {
            method: *self,
            integrator,
        }))
    }
}

impl<T: PixelScalar> BrooksHorn<T> {
    /// Steps and projections: by `integrator`, or in the Fourier domain.
    fn run(
        &self,
        integrator: Option<&dyn SlopeIntegrator<T>>,
        workspace: &mut SurfaceWorkspace<T>,
        frame: Frame<'_, T>,
        domain: &Domain<'_, T>,
        surface: &mut Surface<T>,
    ) -> Result<(), SfsError> {
        let area = surface.enter(frame.dim(), domain)?;
        workspace
            .field
            .load(&frame, domain, &self.lighting, surface)?;
        let start = [T::zero(), T::zero(), T::one()];
        for normals in [&mut workspace.field.normals, &mut workspace.field.next] {
            normals.clear();
            normals.resize(area.area(), start);
        }
        self.solve(integrator, workspace, frame.dim(), domain, surface)?;
        write_levelled(&workspace.slopes.heights, domain, surface);
        surface.finish(domain);
        Ok(())
    }

    /// Steps and projections. The heights of the last one are left in the buffers of the slopes.
    fn solve(
        &self,
        integrator: Option<&dyn SlopeIntegrator<T>>,
        workspace: &mut SurfaceWorkspace<T>,
        frame: (usize, usize),
        domain: &Domain<'_, T>,
        surface: &mut Surface<T>,
    ) -> Result<(), SfsError> {
        let area = surface.bounding_box;
        let report = &mut surface.report;
        report.stop = StopReason::IterationLimit;
        for step in 1..=self.iterations {
            report.iterations = step;
            // Between projections the normals move freely and need not belong to any surface.
            report.residual = self.relax(&mut workspace.field, area, frame);
            if step % self.project_every == 0 || step == self.iterations {
                match integrator {
                    None => self.project(workspace, domain, area),
                    Some(integrator) => {
                        self.integrate(integrator, workspace, frame, domain, area)?;
                    }
                }
                if let Some(stop) = workspace.report(step, self.iterations, report.residual) {
                    report.stop = stop;
                    break;
                }
                // After the last step the heights are the answer, and the normals are not used
                // again.
                if step < self.iterations {
                    follow(workspace, domain.pixel_size_m, area);
                }
            }
        }
        Ok(())
    }

    /// One Jacobi step on the normals. Returns the misfit before it.
    fn relax(&self, field: &mut FieldBuffers<T>, area: BoundingBox, frame: (usize, usize)) -> T {
        let light = self.lighting.direction();
        let weight = T::one() / (T::one() + T::of(4.0) * self.smoothness);
        let (mut sum, mut count) = (T::zero(), 0usize);
        for (i, at) in area.pixels().enumerate() {
            let reflectance = field.reflectance[i];
            if reflectance.is_nan() {
                continue;
            }
            let mean = self.mean(field, area, at, frame);
            let misfit = reflectance - dot(field.normals[i], light);
            sum += misfit * misfit;
            count += 1;
            let pull = weight * (reflectance - dot(mean, light));
            field.next[i] = unit([
                mean[0] + pull * light[0],
                mean[1] + pull * light[1],
                mean[2] + pull * light[2],
            ]);
        }
        // Jacobi, not Gauss–Seidel: the answer does not depend on the order of the pixels.
        core::mem::swap(&mut field.normals, &mut field.next);
        (sum / T::of(count.max(1) as f64)).sqrt()
    }

    /// Mean normal around a pixel of the frame, that of the occluding boundary among them.
    fn mean(
        &self,
        field: &FieldBuffers<T>,
        area: BoundingBox,
        (row, column): (usize, usize),
        (rows, columns): (usize, usize),
    ) -> [T; 3] {
        let at = [row - area.row_start, column - area.column_start];
        let (mut mean, mut outward) = neighbours(&field.normals, &field.reflectance, area, at);
        // Where the frame cuts the surface off there is no boundary.
        let cut = [
            column == 0 || column + 1 == columns,
            row == 0 || row + 1 == rows,
        ];
        (0..2)
            .filter(|&axis| cut[axis])
            .for_each(|axis| outward[axis] = 0);
        if self.occluding_boundary && outward != [0, 0] {
            let length = T::of(f64::from(outward[0]).hypot(f64::from(outward[1])));
            let out = outward.map(|d| T::of(f64::from(d)) / length);
            mean = [mean[0] + out[0], mean[1] + out[1], mean[2]];
        }
        unit(mean)
    }
}

/// Sum of the normals of the neighbours in the mask, and the direction out of the mask.
fn neighbours<T: PixelScalar>(
    normals: &[[T; 3]],
    reflectance: &[T],
    area: BoundingBox,
    [r, c]: [usize; 2],
) -> ([T; 3], [i32; 2]) {
    let (mut sum, mut outward) = ([T::zero(); 3], [0, 0]);
    for (dr, dc) in [(0, -1), (0, 1), (-1, 0), (1, 0)] {
        // Beyond the box on its near sides these are numbers that no box reaches.
        let (row, column) = (r.wrapping_add_signed(dr), c.wrapping_add_signed(dc));
        let in_box = row < area.rows() && column < area.columns();
        let j = row.wrapping_mul(area.columns()).wrapping_add(column);
        if in_box && !reflectance[j].is_nan() {
            for (sum, &n) in sum.iter_mut().zip(&normals[j]) {
                *sum += n;
            }
        } else {
            outward = [outward[0] + dc as i32, outward[1] + dr as i32];
        }
    }
    (sum, outward)
}

fn dot<T: PixelScalar>(a: [T; 3], b: [T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn unit<T: PixelScalar>(v: [T; 3]) -> [T; 3] {
    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    if length > T::zero() {
        v.map(|x| x / length)
    } else {
        [T::zero(), T::zero(), T::one()]
    }
}

/// The method with its slopes projected by an integrator of the caller's choice.
struct Integrated<T> {
    method: BrooksHorn<T>,
    integrator: Arc<dyn SlopeIntegrator<T> + Send + Sync>,
}

impl<T: PixelScalar> SurfaceReconstruction<T> for Integrated<T> {
    fn reconstruct(
        &self,
        frame: Frame<'_, T>,
        domain: &Domain<'_, T>,
    ) -> Result<Surface<T>, SfsError> {
        Surface::made_by(|workspace, surface| {
            self.reconstruct_with(workspace, frame, domain, surface)
        })
    }

    fn reconstruct_with(
        &self,
        workspace: &mut SurfaceWorkspace<T>,
        frame: Frame<'_, T>,
        domain: &Domain<'_, T>,
        surface: &mut Surface<T>,
    ) -> Result<(), SfsError> {
        let integrator = Some(self.integrator.as_ref() as &dyn SlopeIntegrator<T>);
        self.method
            .run(integrator, workspace, frame, domain, surface)
    }

    fn with_slope_integrator(
        &self,
        integrator: Arc<dyn SlopeIntegrator<T> + Send + Sync>,
    ) -> Option<Arc<dyn SurfaceReconstruction<T> + Send + Sync>> {
        self.method.with_slope_integrator(integrator)
    }
}

/// Slopes over the frame and what an integrator makes of them, kept between calls.
#[derive(Debug, Default)]
pub(crate) struct SlopeBuffers<T> {
    p: Array2<T>,
    q: Array2<T>,
    integrated: Surface<T>,
    /// The heights of the last projection over the box.
    heights: Vec<f64>,
}

impl<T: PixelScalar> BrooksHorn<T> {
    /// The slopes of a normal, zero where the image has no value.
    fn slopes(&self, normal: &[T; 3], reflectance: T) -> [T; 2] {
        if reflectance.is_nan() {
            return [T::zero(); 2];
        }
        let least = T::one() / (T::one() + self.max_slope * self.max_slope).sqrt();
        // Normals near the image plane have slopes without bound, which would dominate the
        // projection.
        let z = normal[2].max(least);
        [normal[0], normal[1]].map(|n| (-n / z).max(-self.max_slope).min(self.max_slope))
    }

    /// Projects the slopes on the integrable ones in the Fourier domain.
    fn project(
        &self,
        workspace: &mut SurfaceWorkspace<T>,
        domain: &Domain<'_, T>,
        area: BoundingBox,
    ) {
        let field = &workspace.field;
        let slopes = field.normals.iter().zip(&field.reflectance);
        let slopes =
            slopes.map(|(normal, &reflectance)| self.slopes(normal, reflectance).map(T::as_f64));
        let shape = (area.rows(), area.columns());
        let size = domain.pixel_size_m.map(T::as_f64);
        let heights = workspace.fourier.integrate_slopes(shape, size, slopes);
        workspace.slopes.heights.clear();
        workspace.slopes.heights.extend(heights);
    }

    /// Projects the slopes on those of the heights that `integrator` finds. Where it finds none the
    /// heights are NaN.
    fn integrate(
        &self,
        integrator: &dyn SlopeIntegrator<T>,
        workspace: &mut SurfaceWorkspace<T>,
        frame: (usize, usize),
        domain: &Domain<'_, T>,
        area: BoundingBox,
    ) -> Result<(), SfsError> {
        // The integrator takes the whole workspace: these buffers leave it meanwhile.
        let mut buffers = core::mem::take(&mut workspace.slopes);
        for slopes in [&mut buffers.p, &mut buffers.q] {
            if slopes.dim() != frame {
                *slopes = Array2::zeros(frame);
            }
        }
        for (i, at) in area.pixels().enumerate() {
            let [p, q] = self.slopes(&workspace.field.normals[i], workspace.field.reflectance[i]);
            (buffers.p[at], buffers.q[at]) = (p, q);
        }
        let integrated = integrator.integrate_with(
            workspace,
            buffers.p.view(),
            buffers.q.view(),
            domain,
            &mut buffers.integrated,
        );
        let heights = area
            .pixels()
            .map(|at| buffers.integrated.heights[at].as_f64());
        if integrated.is_ok() {
            buffers.heights.clear();
            buffers.heights.extend(heights);
        }
        workspace.slopes = buffers;
        integrated
    }
}

/// Takes the normals of the heights of the last projection.
fn follow<T: PixelScalar>(
    workspace: &mut SurfaceWorkspace<T>,
    pixel_size: [T; 2],
    area: BoundingBox,
) {
    let (field, z) = (&mut workspace.field, &workspace.slopes.heights);
    let [hx, hy] = pixel_size.map(T::as_f64);
    let (rows, columns) = (area.rows(), area.columns());
    for r in 0..rows {
        for c in 0..columns {
            let i = r * columns + c;
            if field.reflectance[i].is_nan() {
                continue;
            }
            let (left, right) = (i - usize::from(c > 0), i + usize::from(c + 1 < columns));
            let up = if r > 0 { i - columns } else { i };
            let down = if r + 1 < rows { i + columns } else { i };
            let p = difference(z[left], z[i], z[right], hx);
            let q = difference(z[up], z[i], z[down], hy);
            field.normals[i] = unit([T::of(-p), T::of(-q), T::one()]);
        }
    }
}

/// The central difference. One-sided where a neighbour has no height, zero where neither has.
fn difference(before: f64, here: f64, after: f64, step: f64) -> f64 {
    match (before.is_nan(), after.is_nan()) {
        (false, false) => (after - before) / (2.0 * step),
        (true, false) => (after - here) / step,
        (false, true) => (here - before) / step,
        (true, true) => 0.0,
    }
}
