//! Weighted least squares on a mask of any shape: conjugate gradients, preconditioned by multigrid.
//!
//! Minimises Σ w_ij (z_j − z_i − h s̄_ij)² over the edges between neighbouring pixels of the mask, s̄ the mean slope along
//! the edge, of the cubic (at the border: parabola or line) through the slopes of the pixels in line with it, w_ij the
//! harmonic mean of the two pixels' weights. Error O(h⁴) inside. On a full rectangle with equal weights that is what
//! [`CosinePoisson`] solves directly, and it is asked to. The border of the mask is free (natural). Connected
//! parts have nothing to do with each other: each gets mean 0, or is fixed by its own known heights.

mod components;
mod level;
mod multigrid;
mod solve;
mod system;

use ndarray::ArrayView2;

use super::{CosinePoisson, SlopeIntegrator};
use crate::domain::same_shape;
use crate::error::positive;
use crate::{BoundingBox, Component, Domain, Scalar, SfsError, Surface, Workspace};
use components::Components;
use multigrid::Hierarchy;
use solve::Limits;
use system::System;

/// Weighted least squares integration on a mask.
///
/// Slopes that are NaN or infinite are left out: the edge takes the other pixel's slope alone, or, if both are missing,
/// a weak zero slope; the pixel is flagged `NON_FINITE`. Known heights inside the mask are met exactly, and each
/// connected part without one has mean 0 (`report.components`). `report.residual` is the residual of the normal
/// equations relative to the right-hand side. O(pixels) a step, a dozen or two of steps whatever the size; on a full rectangle
/// with equal weights and no known height it is solved directly (`StopReason::Direct`), ten times faster.
///
/// ```
/// use ndarray::{Array2, array};
/// use tactile_sfs::{Domain, MaskedLeastSquares, SlopeIntegrator};
/// let mask = array![[true, true, false, true], [false, true, false, true]];
/// let (p, q) = (Array2::from_elem((2, 4), 1.0), Array2::from_elem((2, 4), 2.0));
/// let domain = Domain::default().with_mask(mask.view());
/// let surface = MaskedLeastSquares::default().integrate(p.view(), q.view(), &domain)?;
/// assert_eq!(surface.report.components.len(), 2);
/// assert!((surface.heights[[1, 3]] - surface.heights[[0, 3]] - 2.0_f64).abs() < 1e-9);
/// assert!(surface.heights[[0, 2]].is_nan());
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaskedLeastSquares<'a, T> {
    tolerance: T,
    max_iterations: usize,
    weights: Option<ArrayView2<'a, T>>,
}

/// Equal weights, a relative residual of 10⁻⁹ (10⁻⁶ in `f32`), at most 500 steps.
impl<T: Scalar> Default for MaskedLeastSquares<'_, T> {
    fn default() -> Self {
        let tolerance = T::of(1e-9).max(T::epsilon() * T::of(10.0));
        Self {
            tolerance,
            max_iterations: 500,
            weights: None,
        }
    }
}

impl<'a, T: Scalar> MaskedLeastSquares<'a, T> {
    /// Relative residual at which the solve ends.
    ///
    /// # Errors
    /// [`SfsError::NotPositive`] unless positive and finite.
    pub fn with_tolerance(self, tolerance: T) -> Result<Self, SfsError> {
        positive("tolerance", tolerance.as_f64())?;
        Ok(Self { tolerance, ..self })
    }

    fn limits(&self) -> Limits {
        Limits {
            tolerance: self.tolerance.as_f64(),
            iterations: self.max_iterations,
        }
    }

    /// Whether the fit is Poisson's equation on a rectangle: equal weights, no height known, no hole in the mask.
    fn is_plain(&self, domain: &Domain<'_, T>, area: BoundingBox) -> bool {
        let full = |mask: ArrayView2<'_, bool>| area.view(mask.view()).iter().all(|&inside| inside);
        self.weights.is_none() && domain.known_heights.is_none() && domain.mask.is_none_or(full)
    }

    /// Weight of each pixel's slopes, such as the inverse of their variance; 0, NaN or less leave the slopes out.
    ///
    /// ```
    /// use ndarray::Array2;
    /// use tactile_sfs::{Domain, MaskedLeastSquares, SlopeIntegrator};
    /// let (mut p, mut weights) = (Array2::from_elem((6, 6), 0.5), Array2::from_elem((6, 6), 1.0));
    /// (p[[2, 3]], weights[[2, 3]]) = (40.0, 0.0); // a false slope, known to be one
    /// let method = MaskedLeastSquares::default().with_weights(weights.view()).with_tolerance(1e-10)?;
    /// let surface = method.integrate(p.view(), Array2::zeros((6, 6)).view(), &Domain::default())?;
    /// let z = &surface.heights;
    /// assert!((z[[2, 5]] - z[[2, 0]] - 2.5_f64).abs() < 0.1);
    /// # Ok::<(), tactile_sfs::SfsError>(())
    /// ```
    pub fn with_weights(self, weights: ArrayView2<'a, T>) -> Self {
        Self {
            weights: Some(weights),
            ..self
        }
    }
}

/// The system on all grids, the vectors of conjugate gradients and the labels of the parts.
#[derive(Debug, Default)]
pub(crate) struct MaskedBuffers<T> {
    system: System<T>,
    hierarchy: Hierarchy,
    components: Components,
    /// Heights, residual, direction, and A · direction: in f64 for both float types, for A's smallest eigenvalues are
    /// far below single precision.
    z: Vec<f64>,
    residual: Vec<f64>,
    direction: Vec<f64>,
    image: Vec<f64>,
    parts: Vec<Part>,
}

/// Sum of the heights of a connected part, and whether one of them is known.
#[derive(Clone, Copy, Debug, Default)]
struct Part {
    sum: f64,
    pixels: usize,
    anchored: bool,
}

impl Part {
    fn mean(&self) -> f64 {
        self.sum / self.pixels as f64
    }
}

impl<T: Scalar> SlopeIntegrator<T> for MaskedLeastSquares<'_, T> {
    fn integrate_with(
        &self,
        workspace: &mut Workspace<T>,
        p: ArrayView2<'_, T>,
        q: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
        surface: &mut Surface<T>,
    ) -> Result<(), SfsError> {
        let (rows, columns) = p.dim();
        let area = domain.validate(rows, columns)?;
        if let Some(weights) = self.weights {
            same_shape("weights", [rows, columns], weights.dim())?;
        }
        if self.is_plain(domain, area) && solve_directly(workspace, [p, q], domain, surface)? {
            return Ok(());
        }
        surface.enter_slopes(p, q, domain)?;
        let slopes = system::Slopes {
            p,
            q,
            weights: self.weights,
        };
        let mut buffers = core::mem::take(&mut workspace.masked);
        system::assemble(&mut buffers, &slopes, domain, surface);
        solve::conjugate_gradients(&mut buffers, workspace, &self.limits(), &mut surface.report);
        buffers.level(surface);
        buffers.write(domain, surface);
        workspace.masked = buffers;
        surface.finish(domain);
        Ok(())
    }
}

/// The fit on a full rectangle with equal weights; false if there are slopes to be left out.
fn solve_directly<T: Scalar>(
    workspace: &mut Workspace<T>,
    [p, q]: [ArrayView2<'_, T>; 2],
    domain: &Domain<'_, T>,
    surface: &mut Surface<T>,
) -> Result<bool, SfsError> {
    match CosinePoisson.integrate_with(workspace, p, q, domain, surface) {
        Ok(()) => {
            let BoundingBox { top, left, .. } = surface.bounding_box;
            let pixels = surface.bounding_box.area();
            surface.report.components.push(Component {
                pixels,
                first: [top, left],
                mean_height: T::zero(),
            });
            Ok(true)
        }
        Err(SfsError::NonFiniteSlope { .. }) => Ok(false),
        Err(error) => Err(error),
    }
}

impl<T: Scalar> MaskedBuffers<T> {
    /// Gives parts without a known height mean 0 and reports all parts.
    fn level(&mut self, surface: &mut Surface<T>) {
        self.components.label(&self.system);
        self.sum_up(surface);
        for (part, component) in self.parts.iter().zip(&mut surface.report.components) {
            component.pixels = part.pixels;
            component.mean_height = if part.anchored {
                T::of(part.mean())
            } else {
                T::zero()
            };
        }
        for i in 0..self.z.len() {
            if let Some(label) = self
                .components
                .of(i)
                .filter(|&label| !self.parts[label].anchored)
            {
                self.z[i] -= self.parts[label].mean();
            }
        }
    }

    /// Sums the heights of the parts, whose first pixels go to the report.
    fn sum_up(&mut self, surface: &mut Surface<T>) {
        let (area, system) = (surface.bounding_box, &self.system);
        self.parts.clear();
        self.parts.resize(self.components.count(), Part::default());
        surface.report.components.clear();
        for (i, z) in self.z.iter().enumerate() {
            let Some(label) = self.components.of(i) else {
                continue;
            };
            let part = &mut self.parts[label];
            if part.pixels == 0 {
                let first = [
                    area.top + i / system.width - 1,
                    area.left + i % system.width - 1,
                ];
                surface.report.components.push(Component {
                    pixels: 0,
                    first,
                    mean_height: T::zero(),
                });
            }
            part.sum += z;
            part.pixels += 1;
            part.anchored |= system.anchor[i] > T::zero() || system.fixed[i];
        }
    }

    fn write(&self, domain: &Domain<'_, T>, surface: &mut Surface<T>) {
        let area = surface.bounding_box;
        for (row, column) in area.pixels() {
            let i = (row - area.top + 1) * self.system.width + column - area.left + 1;
            if self.system.inside[i] {
                surface.set(
                    row,
                    column,
                    domain.known(row, column).unwrap_or(T::of(self.z[i])),
                );
            }
        }
    }
}
