//! From pressure to light: the leaked light of a contact, averaged over pixels.

use crate::contact::SimulatedContact;
use crate::error::{SimulateError, finite, not_negative, within};
use crate::pixel_average::{Disc, PixelPatch, PixelPlane, Profile, Window};

/// Light that leaks under pressure p, relative to the gain g in grey levels per pascal. All
/// responses are monotone up to the largest peak pressure p_max of the scene. For the first two,
/// Hertz's pressure is averaged over pixels exactly, and all other cases by quadrature (1e-4 of the
/// light).
///
/// ```
/// use tactile_simulate::{Camera, PressOptions, PressScene, Response};
/// let camera = Camera::default().coarser(16);
/// // The light at 1.2 N over that at 0.7 N.
/// let ratio = |response| {
///     let scene = PressScene::new(PressOptions { camera, response, ..PressOptions::default() })?;
///     Ok::<_, tactile_simulate::SimulateError>(
///         scene.truth(1).integrated_pixel_value / scene.truth(0).integrated_pixel_value,
///     )
/// };
/// assert!((ratio(Response::Linear)? - 1.2 / 0.7).abs() < 1e-9);
/// assert!(ratio(Response::Quadratic { droop: 0.3 })? < 1.2 / 0.7);
/// // By Hertz, a² is proportional to F^⅔ and pⁿ to F^(n/3).
/// let power = (1.2_f64 / 0.7).powf((2.0 + 0.9) / 3.0);
/// assert!((ratio(Response::Power { exponent: 0.9 })? / power - 1.0).abs() < 1e-3);
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Response {
    /// g·p: the sum of the frame is proportional to the force.
    #[default]
    Linear,
    /// g·p·(1 − κ p/p_max): saturates because fewer trapped rays are left to leak. κ in 0 to 0.5.
    Quadratic {
        /// κ, the fraction of light lost at p_max.
        droop: f64,
    },
    /// g·p_max·(p/p_max)ⁿ, n in 0.25 to 4: the light is not proportional to the pressure, so the
    /// sum of the frame depends on the distribution of the force.
    Power {
        /// n, 1 for [`Linear`](Self::Linear).
        exponent: f64,
    },
}

impl Response {
    /// κ of g·p·(1 − κ p/p_max).
    fn droop(&self) -> f64 {
        match *self {
            Self::Linear | Self::Power { .. } => 0.0,
            Self::Quadratic { droop } => droop,
        }
    }

    /// Light over g·p_max at the pressure `share`·p_max.
    pub(crate) fn light(&self, share: f64) -> f64 {
        match *self {
            Self::Linear => share,
            Self::Quadratic { droop } => share * (1.0 - droop * share),
            Self::Power { exponent } => share.powf(exponent),
        }
    }

    pub(crate) fn validate(&self) -> Result<(), SimulateError> {
        if let Self::Power { exponent } = *self {
            return within("exponent", exponent, 0.25, 4.0);
        }
        within("droop", self.droop(), 0.0, 0.5)
    }
}

/// Illumination of one frame relative to the reference frame. It scales background and leaked light
/// equally.
///
/// ```
/// use tactile_simulate::{Camera, Illumination, PressLoad, PressOptions, PressScene};
/// let camera = Camera::default().coarser(16).ideal();
/// let illumination = Illumination {
///     level: 1.2,
///     tilt: [0.1, 0.0],
/// };
/// let loads = vec![PressLoad {
///     illumination,
///     ..PressLoad::normal(0.0)
/// }];
/// let light = PressScene::new(PressOptions {
///     camera,
///     loads,
///     ..PressOptions::default()
/// })?
/// .expected_frame(0);
/// for (column, share) in [(0, 1.15), (43, 1.2), (86, 1.25)] {
///     assert!((light[[0, column]] - share * camera.background_grey).abs() < 1e-9);
/// }
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Illumination {
    /// Brightness, 1 for unchanged.
    pub level: f64,
    /// Relative change of brightness from the first to the last column (x) and row (y) of the
    /// frame. 0 for unchanged.
    pub tilt: [f64; 2],
}

impl Default for Illumination {
    fn default() -> Self {
        Self {
            level: 1.0,
            tilt: [0.0; 2],
        }
    }
}

impl Illumination {
    pub(crate) fn validate(&self) -> Result<(), SimulateError> {
        not_negative("level", self.level)?;
        finite("tilt", self.tilt[0])?;
        finite("tilt", self.tilt[1])
    }
}

/// The relation of light to pressure in one scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LightLaw {
    pub response: Response,
    /// Grey levels per pascal, g.
    pub grey_per_pascal: f64,
    /// The largest pressure p_max of the scene, to which the response refers.
    pub largest_pressure_pa: f64,
}

impl LightLaw {
    /// Light at a pressure, in grey levels above the background.
    pub(crate) fn grey_at(&self, pressure_pa: f64) -> f64 {
        // A scene without load has no peak pressure.
        if self.largest_pressure_pa == 0.0 {
            return 0.0;
        }
        let share = pressure_pa / self.largest_pressure_pa;
        self.grey_per_pascal * self.largest_pressure_pa * self.response.light(share)
    }

    /// Unblurred light of a contact through a distorting lens.
    pub(crate) fn bent_patch(
        &self,
        contact: &SimulatedContact,
        disc: &Disc,
        plane: PixelPlane,
        window: Window,
    ) -> PixelPatch {
        disc.average_bent(plane, window, |r_m| self.grey_at(contact.pressure_pa(r_m)))
    }

    /// Unblurred light of a contact over `window`, in grey levels above the background.
    pub(crate) fn patch(
        &self,
        contact: &SimulatedContact,
        disc: &Disc,
        window: Window,
    ) -> PixelPatch {
        if self.largest_pressure_pa == 0.0 {
            return PixelPatch::zeros(window);
        }
        let exact = contact.is_hertzian() && !matches!(self.response, Response::Power { .. });
        if !exact {
            return disc.average_radial(window, |r_m| self.grey_at(contact.pressure_pa(r_m)));
        }
        let peak = contact.peak_pressure_pa;
        let mut patch = disc.average(Profile::Hemisphere, window);
        patch
            .values
            .map_inplace(|v| *v *= self.grey_per_pascal * peak);
        let droop = self.response.droop() / self.largest_pressure_pa;
        if droop > 0.0 {
            // The square of Hertz's pressure is p₀² (1 − ρ²), a paraboloid, which is averaged
            // exactly.
            let square = disc.average(Profile::Paraboloid, window);
            patch
                .values
                .scaled_add(-self.grey_per_pascal * droop * peak * peak, &square.values);
        }
        patch
    }
}

/// Pressure of a contact over `window` in pascals.
pub(crate) fn pressure_patch(
    contact: &SimulatedContact,
    disc: &Disc,
    window: Window,
) -> PixelPatch {
    if !contact.is_hertzian() {
        return disc.average_radial(window, |r_m| contact.pressure_pa(r_m));
    }
    let mut patch = disc.average(Profile::Hemisphere, window);
    patch.values.map_inplace(|v| *v *= contact.peak_pressure_pa);
    patch
}
