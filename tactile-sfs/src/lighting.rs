//! Light, albedo and ambient light: the model from slopes to grey levels.

use crate::{PixelScalar, SfsError};
use tactile_core::Requirement;

/// Distant light on a Lambertian surface: I = ambient + I₀ · max(0, n·s), with I₀ the intensity of
/// the light times the albedo.
///
/// [`Default`] is light from the viewer, with ambient 0 and intensity 1 at normal incidence.
///
/// # Convention
///
/// The axis x runs along columns, y along rows (so y points *down* the image), and z points from
/// the surface to the viewer. A surface z(x, y) with slopes p = ∂z/∂x and q = ∂z/∂y has the normal
/// n = (−p, −q, 1)/√(1 + p² + q²). `direction` points *from the surface to the light*: (1, 0, 1) is
/// a light to the right of the image, 45° above the surface. It brightens slopes that fall to the
/// right. For formulas whose y axis points up, change the sign of y.
///
/// ```
/// use tactile_sfs::Lighting;
/// let light = Lighting::new([1.0, 0.0, 1.0])?.with_normal_intensity(255.0)?;
/// assert!(light.shade(-0.5, 0.0) > light.shade(0.5, 0.0)); // a fall to the right is brighter
/// assert_eq!(Lighting::<f64>::default().shade(0.0, 0.0), 1.0);
/// assert!(Lighting::new([1.0, 0.0, -1.0]).is_err());       // light from below
/// # Ok::<(), tactile_sfs::SfsError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lighting<T> {
    direction: [T; 3],
    ambient: T,
    normal_intensity: T,
}

impl<T: PixelScalar> Default for Lighting<T> {
    fn default() -> Self {
        let (zero, one) = (T::zero(), T::one());
        Self {
            direction: [zero, zero, one],
            ambient: zero,
            normal_intensity: one,
        }
    }
}

impl<T: PixelScalar> Lighting<T> {
    /// Light from `direction` (of any length), with ambient 0 and intensity 1 at normal incidence.
    ///
    /// # Errors
    /// [`SfsError::InvalidOption`] for a direction that is zero or not finite,
    /// [`SfsError::LightFromBelow`] for z ≤ 0.
    pub fn new(direction: [T; 3]) -> Result<Self, SfsError> {
        let [x, y, z] = direction.map(T::as_f64);
        // Normalised in double precision, so that a direction in `f32` is rounded only once.
        let length = (x * x + y * y + z * z).sqrt();
        Requirement::Positive.check("length of the light direction", length)?;
        if z <= 0.0 {
            return Err(SfsError::LightFromBelow { x, y, z });
        }
        let unit = |v: f64| T::of(v / length);
        Ok(Self {
            direction: [unit(x), unit(y), unit(z)],
            ..Self::default()
        })
    }

    /// Intensity of every pixel without the light.
    ///
    /// # Errors
    /// [`SfsError::InvalidOption`] for a value that is negative or not finite.
    pub fn with_ambient(self, ambient: T) -> Result<Self, SfsError> {
        Requirement::NonNegative.check("ambient", ambient.as_f64())?;
        Ok(Self { ambient, ..self })
    }

    /// I₀, the intensity above the ambient of a surface that faces the light: 255 for a full-range
    /// 8-bit frame. If some part of the surface faces the light, use a high quantile of the image
    /// minus the ambient. The quantile 0.995 excludes single bright pixels.
    ///
    /// # Errors
    /// [`SfsError::InvalidOption`] for a value that is not positive and finite.
    pub fn with_normal_intensity(self, normal_intensity: T) -> Result<Self, SfsError> {
        Requirement::Positive.check("intensity at normal incidence", normal_intensity.as_f64())?;
        Ok(Self {
            normal_intensity,
            ..self
        })
    }

    /// Unit vector from the surface to the light.
    pub fn direction(&self) -> [T; 3] {
        self.direction
    }

    /// I₀, the intensity above the ambient of a surface that faces the light.
    pub fn normal_intensity(&self) -> T {
        self.normal_intensity
    }

    /// Whether the light comes exactly from the viewer.
    pub(crate) fn is_frontal(&self) -> bool {
        self.direction[0] == T::zero() && self.direction[1] == T::zero()
    }

    /// Reflectance n·s of an intensity, (I − ambient)/I₀. It lies in [0, 1] if the pixel agrees
    /// with the model.
    pub(crate) fn reflectance(&self, intensity: T) -> T {
        (intensity - self.ambient) / self.normal_intensity
    }

    /// Intensity of a reflectance.
    pub(crate) fn intensity(&self, reflectance: T) -> T {
        self.ambient + self.normal_intensity * reflectance
    }

    /// Intensity of a surface element with slopes p = ∂z/∂x and q = ∂z/∂y. It is the ambient in
    /// attached shadows.
    ///
    /// ```
    /// use tactile_sfs::Lighting;
    /// let light = Lighting::new([0.0, 0.0, 5.0])?
    ///     .with_normal_intensity(204.0)?
    ///     .with_ambient(10.0)?;
    /// assert_eq!(
    ///     (light.direction(), light.normal_intensity()),
    ///     ([0.0, 0.0, 1.0], 204.0)
    /// );
    /// let grey = light.shade(1.0, 0.0); // 45° from the light
    /// assert!((grey - (10.0 + 204.0 * 0.5_f64.sqrt())).abs() < 1e-12);
    /// # Ok::<(), tactile_sfs::SfsError>(())
    /// ```
    pub fn shade(&self, p: T, q: T) -> T {
        let [x, y, z] = self.direction;
        // n·s with the normal (−p, −q, 1) divided by its length.
        let cosine = (z - p * x - q * y) / (T::one() + p * p + q * q).sqrt();
        self.intensity(cosine.max(T::zero()))
    }
}
