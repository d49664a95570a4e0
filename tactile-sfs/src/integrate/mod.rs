//! Slopes to heights: the trait and its implementations.

mod cosine_poisson;
mod cosine_transform;
mod divergence;
mod frankot_chellappa;
mod masked;
pub(crate) mod shift;
mod tridiagonal;

use std::sync::Arc;

use ndarray::ArrayView2;

pub use cosine_poisson::CosinePoisson;
pub(crate) use cosine_poisson::PoissonBuffers;
pub(crate) use frankot_chellappa::FourierBuffers;
pub use frankot_chellappa::FrankotChellappa;
pub(crate) use masked::MaskedBuffers;
pub use masked::MaskedLeastSquares;

use crate::{Domain, Scalar, SfsError, Surface, Workspace};

/// A way from slopes p = ∂z/∂x and q = ∂z/∂y to heights.
///
/// Slopes are dimensionless (metres per metre); heights come out in the unit of the pixel size. A height is known up
/// to a constant: the mean is 0, unless the domain's known heights fix it. Object safe.
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{CosinePoisson, Domain, SlopeIntegrator};
/// // The plane z = 0.3 x − 0.2 y comes back exactly.
/// let (p, q) = (Array2::from_elem((5, 7), 0.3), Array2::from_elem((5, 7), -0.2));
/// let surface = CosinePoisson.integrate(p.view(), q.view(), &Domain::default())?;
/// let z = &surface.heights;
/// assert!((z[[0, 1]] - z[[0, 0]] - 0.3_f64).abs() < 1e-12);
/// assert!((z[[1, 0]] - z[[0, 0]] + 0.2).abs() < 1e-12);
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
pub trait SlopeIntegrator<T: Scalar> {
    /// Integrates into `surface`, reusing its arrays and the buffers of `workspace`.
    ///
    /// ```
    /// use ndarray::Array2;
    /// use tactile_sfs::{Domain, FrankotChellappa, CosinePoisson, SlopeIntegrator, Surface, Workspace};
    /// let (mut workspace, mut surface) = (Workspace::default(), Surface::default());
    /// let methods: [&dyn SlopeIntegrator<f64>; 2] = [&CosinePoisson, &FrankotChellappa];
    /// let flat = Array2::zeros((16, 16));
    /// for method in methods {
    ///     method.integrate_with(&mut workspace, flat.view(), flat.view(), &Domain::default(), &mut surface)?;
    ///     assert!(surface.heights.iter().all(|z| z.abs() < 1e-12));
    /// }
    /// # Ok::<(), tactile_sfs::SfsError>(())
    /// ```
    ///
    /// # Errors
    /// What the method documents: shapes that differ, an empty mask, slopes it cannot skip.
    fn integrate_with(
        &self,
        workspace: &mut Workspace<T>,
        p: ArrayView2<'_, T>,
        q: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
        surface: &mut Surface<T>,
    ) -> Result<(), SfsError>;

    /// Integrates slopes p along x and q along y.
    ///
    /// # Errors
    /// As [`integrate_with`](Self::integrate_with).
    fn integrate(
        &self,
        p: ArrayView2<'_, T>,
        q: ArrayView2<'_, T>,
        domain: &Domain<'_, T>,
    ) -> Result<Surface<T>, SfsError> {
        let mut surface = Surface::default();
        self.integrate_with(&mut Workspace::default(), p, q, domain, &mut surface)?;
        Ok(surface)
    }
}

/// What is implemented for a value is implemented for a pointer to it.
macro_rules! forward {
    ($pointer:ident) => {
        impl<T: Scalar, M: SlopeIntegrator<T> + ?Sized> SlopeIntegrator<T> for $pointer<M> {
            fn integrate_with(
                &self,
                workspace: &mut Workspace<T>,
                p: ArrayView2<'_, T>,
                q: ArrayView2<'_, T>,
                domain: &Domain<'_, T>,
                surface: &mut Surface<T>,
            ) -> Result<(), SfsError> {
                (**self).integrate_with(workspace, p, q, domain, surface)
            }
        }
    };
}
forward!(Box);
forward!(Arc);
