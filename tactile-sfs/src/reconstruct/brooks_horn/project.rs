//! The integrability of Brooks and Horn's method: slopes of the normals to heights and back.

use std::sync::Arc;

use ndarray::Array2;
use rustfft::num_complex::Complex;

use super::{BrooksHorn, unit};
use crate::{
    BoundingBox, Domain, Frame, Scalar, SfsError, SlopeIntegrator, Surface, SurfaceReconstruction,
    Workspace,
};

/// The method with its slopes projected by an integrator of the caller's choice.
pub(super) struct Integrated<T> {
    pub(super) method: BrooksHorn<T>,
    pub(super) integrator: Arc<dyn SlopeIntegrator<T> + Send + Sync>,
}

impl<T: Scalar> SurfaceReconstruction<T> for Integrated<T> {
    fn reconstruct_with(
        &self,
        workspace: &mut Workspace<T>,
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
    pub(super) heights: Vec<T>,
}

impl<T: Scalar> BrooksHorn<T> {
    /// The slopes of a normal, zero where the image says nothing.
    fn slopes(&self, normal: &[T; 3], reflectance: T) -> [T; 2] {
        if reflectance.is_nan() {
            return [T::zero(); 2];
        }
        let least = T::one() / (T::one() + self.max_slope * self.max_slope).sqrt();
        let z = normal[2].max(least);
        [normal[0], normal[1]].map(|n| (-n / z).max(-self.max_slope).min(self.max_slope))
    }

    /// Projects the slopes on the integrable ones in the Fourier domain.
    pub(super) fn project(
        &self,
        workspace: &mut Workspace<T>,
        domain: &Domain<'_, T>,
        area: BoundingBox,
    ) {
        let (field, fourier) = (&workspace.field, &mut workspace.fourier);
        let slopes = field.normals.iter().zip(&field.reflectance);
        let slopes = slopes.map(|(normal, &reflectance)| {
            let [p, q] = self.slopes(normal, reflectance);
            Complex::new(p, q)
        });
        fourier.fill(area.rows, area.columns, slopes);
        fourier.integrate(domain.pixel_size_m);
        workspace.slopes.heights.clear();
        workspace.slopes.heights.extend(fourier.heights());
    }

    /// Projects the slopes on those of the heights that `integrator` finds; where it finds none the heights are NaN.
    pub(super) fn integrate(
        &self,
        integrator: &dyn SlopeIntegrator<T>,
        workspace: &mut Workspace<T>,
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
        let heights = area.pixels().map(|at| buffers.integrated.heights[at]);
        if integrated.is_ok() {
            buffers.heights.clear();
            buffers.heights.extend(heights);
        }
        workspace.slopes = buffers;
        integrated
    }
}

/// Takes the normals of the heights of the last projection.
pub(super) fn follow<T: Scalar>(workspace: &mut Workspace<T>, [hx, hy]: [T; 2], area: BoundingBox) {
    let (field, z) = (&mut workspace.field, &workspace.slopes.heights);
    for r in 0..area.rows {
        for c in 0..area.columns {
            let i = r * area.columns + c;
            if field.reflectance[i].is_nan() {
                continue;
            }
            let (left, right) = (
                i - usize::from(c > 0),
                i + usize::from(c + 1 < area.columns),
            );
            let up = if r > 0 { i - area.columns } else { i };
            let down = if r + 1 < area.rows {
                i + area.columns
            } else {
                i
            };
            let p = difference(z[left], z[i], z[right], hx);
            let q = difference(z[up], z[i], z[down], hy);
            field.normals[i] = unit([-p, -q, T::one()]);
        }
    }
}

/// The central difference; one-sided where a neighbour has no height, zero where neither has.
fn difference<T: Scalar>(before: T, here: T, after: T, step: T) -> T {
    match (before.is_nan(), after.is_nan()) {
        (false, false) => (after - before) / (T::of(2.0) * step),
        (true, false) => (after - here) / step,
        (false, true) => (here - before) / step,
        (true, true) => T::zero(),
    }
}
