//! From slopes to heights: the trait, its implementations, and the constant of integration.
//!
//! Heights are computed in double precision, whatever the type of the slopes. In images of usual
//! size, the smallest eigenvalues of the equations are below the rounding errors of single
//! precision.

mod masked;
mod poisson;

use std::ops::Deref;

use ndarray::ArrayView2;

pub(crate) use masked::MaskedBuffers;
pub use masked::MaskedLeastSquares;
pub use poisson::CosinePoisson;
pub(crate) use poisson::PoissonBuffers;

use crate::{BoundingBox, Domain, PixelScalar, SfsError, Surface, SurfaceWorkspace};

/// A method of computing heights from slopes p = ∂z/∂x and q = ∂z/∂y.
///
/// Slopes are dimensionless (metres per metre), and heights have the unit of the pixel size.
/// Heights are determined up to a constant: the mean is 0 unless the domain has known heights. The
/// trait is object-safe. Only [`integrate`](Self::integrate) has to be implemented.
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{CosinePoisson, Domain, SlopeIntegrator};
/// // The plane z = 0.3 x − 0.2 y is recovered exactly.
/// let (p, q) = (Array2::from_elem((5, 7), 0.3), Array2::from_elem((5, 7), -0.2));
/// let surface = CosinePoisson.integrate(p.view(), q.view(), &Domain::default())?;
/// let z = &surface.heights;
/// assert!((z[[0, 1]] - z[[0, 0]] - 0.3_f64).abs() < 1e-12);
/// assert!((z[[1, 0]] - z[[0, 0]] + 0.2).abs() < 1e-12);
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
pub trait SlopeIntegrator<T: PixelScalar>: Send + Sync {
    /// Integrates slopes p along x and q along y.
    ///
    /// # Errors
    /// Those of the method: different shapes, an empty mask, or slopes that it cannot leave out.
    fn integrate(
        &self,
        p: ArrayView2<'_, T>,
        q: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
    ) -> Result<Surface<T>, SfsError>;

    /// Like [`integrate`](Self::integrate), but into `surface`: its arrays and the buffers of
    /// `workspace` are reused.
    ///
    /// ```
    /// use ndarray::Array2;
    /// use tactile_sfs::{
    ///     CosinePoisson, Domain, MaskedLeastSquares, SlopeIntegrator, Surface, SurfaceWorkspace,
    /// };
    /// let (mut workspace, mut surface) = (SurfaceWorkspace::default(), Surface::default());
    /// let masked = MaskedLeastSquares::default();
    /// let methods: [&dyn SlopeIntegrator<f64>; 2] = [&CosinePoisson, &masked];
    /// let flat = Array2::zeros((16, 16));
    /// for method in methods {
    ///     method.integrate_with(
    ///         &mut workspace,
    ///         flat.view(),
    ///         flat.view(),
    ///         &Domain::default(),
    ///         &mut surface,
    ///     )?;
    ///     assert!(surface.heights.iter().all(|z| z.abs() < 1e-12));
    /// }
    /// # Ok::<(), tactile_sfs::SfsError>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`integrate`](Self::integrate).
    fn integrate_with(
        &self,
        workspace: &mut SurfaceWorkspace<T>,
        p: ArrayView2<'_, T>,
        q: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
        surface: &mut Surface<T>,
    ) -> Result<(), SfsError> {
        let _ = workspace;
        *surface = self.integrate(p, q, domain)?;
        Ok(())
    }
}

/// Implements the trait for boxed, shared and borrowed integrators.
impl<T: PixelScalar, P: Deref<Target: SlopeIntegrator<T>> + Send + Sync> SlopeIntegrator<T> for P {
    fn integrate(
        &self,
        p: ArrayView2<'_, T>,
        q: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
    ) -> Result<Surface<T>, SfsError> {
        (**self).integrate(p, q, domain)
    }

    fn integrate_with(
        &self,
        workspace: &mut SurfaceWorkspace<T>,
        p: ArrayView2<'_, T>,
        q: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
        surface: &mut Surface<T>,
    ) -> Result<(), SfsError> {
        (**self).integrate_with(workspace, p, q, domain, surface)
    }
}

/// Copies a row of a box of slopes, with 0 outside the mask.
///
/// # Errors
/// [`SfsError::NonFiniteSlope`] for a slope inside the mask.
fn load_row<T: PixelScalar>(
    slopes: ArrayView2<'_, T>,
    domain: &Domain<'_, T>,
    area: BoundingBox,
    row: usize,
    line: &mut [f64],
) -> Result<(), SfsError> {
    let from = slopes.row(area.row_start + row);
    let columns = area.column_start..area.column_end;
    match from.to_slice() {
        Some(from) => {
            let from = from[columns].iter();
            from.zip(&mut *line).for_each(|(x, to)| *to = x.as_f64());
        }
        None => {
            for (column, to) in columns.zip(&mut *line) {
                *to = from[column].as_f64();
            }
        }
    }
    if let Some(mask) = domain.mask {
        let inside = area.of(mask).index_axis_move(ndarray::Axis(0), row);
        for (x, inside) in line.iter_mut().zip(inside) {
            *x = if *inside { *x } else { 0.0 };
        }
    }
    // x · 0 is 0 only for finite x, and a sum is computed with SIMD instructions.
    let poison: f64 = line.iter().map(|x| x * 0.0).sum();
    if poison == 0.0 {
        return Ok(());
    }
    let column = line.iter().position(|x| !x.is_finite()).unwrap_or(0);
    Err(SfsError::NonFiniteSlope {
        row: area.row_start + row,
        column: area.column_start + column,
    })
}

/// Writes heights over the surface's box, row by row, all shifted by one constant. The shift meets
/// known heights on average, or makes the mean inside the mask 0. NaN stands for a missing height.
pub(crate) fn write_levelled<T: PixelScalar>(
    heights: &[f64],
    domain: &Domain<'_, T>,
    surface: &mut Surface<T>,
) {
    let area = surface.bounding_box;
    let places = || area.pixels().zip(heights);
    let solved = || places().filter(|((r, c), z)| domain.contains(*r, *c) && !z.is_nan());
    let (mut excess, mut known) = (0.0, 0usize);
    if domain.known_heights.is_some() {
        for ((row, column), z) in solved() {
            if let Some(height) = domain.known(row, column) {
                excess += height.as_f64() - z;
                known += 1;
            }
        }
    }
    let shift = if known > 0 {
        excess / known as f64
    } else if domain.mask.is_none() && heights.iter().all(|z| !z.is_nan()) {
        -heights.iter().sum::<f64>() / heights.len() as f64
    } else {
        let (sum, count) = solved().fold((0.0, 0usize), |(sum, n), (_, z)| (sum + z, n + 1));
        -sum / count.max(1) as f64
    };
    let mut rows = area.of_mut(surface.heights.view_mut());
    let mut solved = area.of_mut(surface.mask.view_mut());
    for (r, line) in heights.chunks(area.columns()).enumerate() {
        let (mut to, mut solved) = (rows.row_mut(r), solved.row_mut(r));
        let places = to.iter_mut().zip(line).zip(solved.iter_mut());
        match domain.mask {
            None => places.for_each(|((to, z), solved)| {
                *to = T::of(z + shift);
                *solved = !z.is_nan();
            }),
            Some(mask) => {
                let mask = area.of(mask);
                for (((to, z), solved), inside) in places.zip(mask.row(r)) {
                    if *inside && !z.is_nan() {
                        (*to, *solved) = (T::of(z + shift), true);
                    }
                }
            }
        }
    }
}
