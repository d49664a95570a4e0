//! Pentland 1990: the reflectance made linear in the slopes, inverted by Fourier transform.
//!
//! For small slopes R ≈ s_z − s_x p − s_y q, hence R̂ = −i (s_x u + s_y v) ẑ. Waves that run across the light (s_x u + s_y v = 0)
//! do not shade and cannot be recovered: the division is regularised, D̄/(|D|² + ε²), and they come out as 0.

use rustfft::num_complex::Complex;

use crate::error::positive;
use crate::integrate::shift::write_levelled;
use crate::{Domain, Frame, Lighting, Scalar, SfsError, Surface, SurfaceReconstruction, Workspace};

/// Linear shape from shading under oblique light.
///
/// Fast and direct, right for slopes that are small against the light's; outside the mask the surface is taken as flat.
/// O(N M log(N M)). Under frontal light shading is quadratic in the slopes and the method is undefined.
///
/// ```
/// use ndarray::Array2;
/// use tactile_sfs::{Domain, Lighting, Pentland, SurfaceReconstruction};
/// let light = Lighting::new([1.0, 0.0, 1.0])?;
/// let wave = core::f64::consts::TAU / 32.0;
/// let image = Array2::from_shape_fn((8, 32), |(_, c)| light.shade(1e-3 * wave * (wave * c as f64).cos(), 0.0));
/// let z = Pentland::new(light).reconstruct(image.view().into(), &Domain::default())?.heights;
/// assert!((z[[0, 8]] - z[[0, 24]] - 2e-3).abs() < 1e-5);
/// assert!(Pentland::new(Lighting::default()).reconstruct(image.view().into(), &Domain::default()).is_err());
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pentland<T> {
    lighting: Lighting<T>,
    regularisation: T,
}

impl<T: Scalar> Pentland<T> {
    /// The method with regularisation 10⁻³.
    pub fn new(lighting: Lighting<T>) -> Self {
        Self {
            lighting,
            regularisation: T::of(1e-3),
        }
    }

    /// ε in radians per pixel, below which a wave across the light is damped.
    ///
    /// ```
    /// use ndarray::Array2;
    /// use tactile_sfs::{Domain, Lighting, Pentland, SurfaceReconstruction};
    /// let light = Lighting::new([1.0, 0.0, 1.0])?;
    /// let wave = core::f64::consts::TAU / 32.0;
    /// let image = Array2::from_shape_fn((8, 32), |(_, c)| light.shade(1e-3 * wave * (wave * c as f64).cos(), 0.0));
    /// let height = |epsilon| {
    ///     let z = Pentland::new(light).with_regularisation(epsilon)?.reconstruct(image.view().into(), &Domain::default())?.heights;
    ///     Ok::<f64, tactile_sfs::SfsError>(z[[0, 8]] - z[[0, 24]])
    /// };
    /// assert!((height(1e-3)? - 2e-3).abs() < 1e-5);
    /// assert!(height(0.5)? < 0.5e-3); // damps this wave of 0.2 rad/px, too
    /// # Ok::<(), tactile_sfs::SfsError>(())
    /// ```
    ///
    /// # Errors
    /// [`SfsError::NotPositive`] unless positive and finite.
    pub fn with_regularisation(self, regularisation: T) -> Result<Self, SfsError> {
        positive("regularisation", regularisation.as_f64())?;
        Ok(Self {
            regularisation,
            ..self
        })
    }
}

impl<T: Scalar> SurfaceReconstruction<T> for Pentland<T> {
    fn reconstruct_with(
        &self,
        workspace: &mut Workspace<T>,
        frame: Frame<'_, T>,
        domain: &Domain<'_, T>,
        surface: &mut Surface<T>,
    ) -> Result<(), SfsError> {
        if self.lighting.is_frontal() {
            return Err(SfsError::FrontalLight {
                method: "Pentland's method",
            });
        }
        let area = surface.enter(frame.dim(), domain)?;
        workspace
            .field
            .load(&frame, domain, &self.lighting, surface)?;
        let [sx, sy, sz] = self.lighting.direction();
        let [hx, hy] = domain.pixel_size_m;
        let flat = |&reflectance: &T| {
            if reflectance.is_nan() {
                T::zero()
            } else {
                reflectance - sz
            }
        };
        let flat = |reflectance| Complex::new(flat(reflectance), T::zero());
        let fourier = &mut workspace.fourier;
        fourier.fill(
            area.rows,
            area.columns,
            workspace.field.reflectance.iter().map(flat),
        );
        let epsilon = self.regularisation / hx;
        fourier.filter([hx, hy], |u, v| {
            // D = −i d, hence D̄/(|D|² + ε²) = i d/(d² + ε²).
            let d = sx * u + sy * v;
            Complex::new(T::zero(), d / (d * d + epsilon * epsilon))
        });
        write_levelled(fourier.heights(), domain, surface);
        surface.finish(domain);
        Ok(())
    }
}
