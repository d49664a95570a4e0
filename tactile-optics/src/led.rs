//! The LED at the edge of the slab: its radiation pattern, and the fraction of its light that a
//! layer traps.

use core::f64::consts::{FRAC_2_PI, FRAC_PI_2, PI};

#[cfg(not(feature = "std"))]
use num_traits::Float;

use crate::angle::Angle;
use crate::error::{OpticsError, within};

/// The directions of light: in one plane or in space.
///
/// ```
/// use tactile_optics::{Geometry, Led, acceptance_angle};
///
/// // In space more of the light is inclined within the plane of the layer. Less of it is lost than
/// // in a section.
/// let acceptance = acceptance_angle(1.38_f64, 1.0)?;
/// let share = |geometry| Led::default().trapped_share(acceptance, geometry);
/// let [section, volume] = [Geometry::Section, Geometry::Volume].map(share);
/// assert!(section > 0.95 && volume > section && volume < 1.0);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Geometry {
    /// A section: rays in the plane of the LED axis and the normal of the slab.
    Section,
    /// All directions in space.
    #[default]
    Volume,
}

/// An LED that faces the edge of the slab: intensity ∝ cosᵐ θ up to a half angle, with θ measured
/// from its axis.
///
/// ```
/// use tactile_optics::{Geometry, Led, acceptance_angle};
///
/// // More light of a narrow LED is trapped than of a Lambertian LED.
/// let acceptance = acceptance_angle(1.38, 1.0)?;
/// let leds = [Led::default(), Led::new(4.0, 60.0_f64.to_radians())?];
/// let [wide, narrow] = leds.map(|led| led.trapped_share(acceptance, Geometry::Volume));
/// assert!(narrow > wide);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Led {
    exponent: f64,
    half_angle: f64,
}

impl Default for Led {
    /// A Lambertian LED: m = 1 up to a right angle.
    fn default() -> Self {
        Self {
            exponent: 1.0,
            half_angle: FRAC_PI_2,
        }
    }
}

impl Led {
    /// Creates an LED with intensity ∝ cosᵐ θ for θ below `half_angle`. An exponent of 1 is
    /// Lambertian (the default), and 0 is uniform. Data sheets give the angle α of half the
    /// intensity: m = ln ½ / ln cos α.
    ///
    /// # Errors
    /// [`OpticsError::OutOfRange`] for an exponent outside 0 to 1000 or a half angle outside (0,
    /// π/2].
    pub fn new(exponent: f64, half_angle: f64) -> Result<Self, OpticsError> {
        within("exponent of the radiation pattern", exponent, 0.0, 1000.0)?;
        within(
            "half angle of the LED",
            half_angle,
            1e-6,
            FRAC_PI_2 * (1.0 + 1e-7),
        )?;
        Ok(Self {
            exponent,
            half_angle: half_angle.min(FRAC_PI_2),
        })
    }

    /// The fraction of the LED light that is trapped by a layer with this acceptance angle, before
    /// losses at the entry.
    ///
    /// In a section the fraction is ∫₀^θᵢ cosᵐ / ∫₀^h cosᵐ. In space a ray is trapped if its slope
    /// relative to the plane of the layer is below S = sin θᵢ. This is the fraction (2/π)
    /// asin(min(1, S/sin θ)) of the directions at θ from the axis. The Gauss–Legendre quadrature is
    /// accurate to about 10⁻¹² in `f64`.
    ///
    /// ```
    /// use tactile_optics::{Geometry, Led, acceptance_angle};
    /// let acceptance = acceptance_angle(1.38_f64, 1.0)?;
    /// let share = Led::default().trapped_share(acceptance, Geometry::Section);
    /// assert!((share - (1.38_f64 * 1.38 - 1.0).sqrt()).abs() < 1e-12);
    /// # Ok::<(), tactile_optics::OpticsError>(())
    /// ```
    pub fn trapped_share(&self, acceptance: Angle, geometry: Geometry) -> f64 {
        // An LED narrower than the acceptance angle emits no light beyond its half angle.
        let limit = acceptance.radians.min(self.half_angle);
        if geometry == Geometry::Section {
            let intensity = |t: f64| t.cos().max(0.0).powf(self.exponent);
            return integral(0.0, limit, intensity) / integral(0.0, self.half_angle, intensity);
        }
        // sin θ is the solid angle of a ring of directions about the axis. The factor 2π cancels in
        // the ratio.
        let flux = |t: f64| t.cos().max(0.0).powf(self.exponent) * t.sin();
        let slope = acceptance.radians.sin();
        // Beyond θᵢ the trapped fraction decreases with an infinite slope at first. The
        // substitution θ = θᵢ + t² removes it.
        let outer = |t: f64| {
            let theta = limit + t * t;
            let part = (slope / theta.sin()).min(1.0).asin() * FRAC_2_PI;
            flux(theta) * part * (t + t)
        };
        let trapped = integral(0.0, limit, flux)
            + integral(0.0, (self.half_angle - limit).max(0.0).sqrt(), outer);
        trapped / integral(0.0, self.half_angle, flux)
    }

    /// Converts two numbers in [0, 1) to a direction: components along the axis, across it in the
    /// plane of the slab, and along the normal of the slab. The weight of the direction is also
    /// returned: its fraction of the light up to a common factor.
    pub(crate) fn direction(&self, u: f64, v: f64, geometry: Geometry) -> ([f64; 3], f64) {
        if geometry == Geometry::Section {
            // For a general m the integral of cosᵐ has no inverse in closed form. Angles are
            // therefore uniform and have the intensity as weight.
            let theta = (u + u - 1.0) * self.half_angle;
            return (
                [theta.cos(), 0.0, theta.sin()],
                theta.cos().max(0.0).powf(self.exponent),
            );
        }
        // On the sphere the integral of cosᵐ θ sin θ has an inverse in closed form. All directions
        // then have the same weight.
        let power = self.exponent + 1.0;
        let edge = self.half_angle.cos().max(0.0).powf(power);
        let cosine = (1.0 - u * (1.0 - edge)).powf(power.recip());
        // Written as a product, because 1 − cos² loses half of the digits near the axis.
        let sine = ((1.0 - cosine) * (1.0 + cosine)).max(0.0).sqrt();
        let (across, up) = ((v + v) * PI).sin_cos();
        ([cosine, sine * across, sine * up], 1.0)
    }
}

/// ∫ f from `a` to `b` by the five-point Gauss–Legendre rule on 32 panels.
fn integral(a: f64, b: f64, f: impl Fn(f64) -> f64) -> f64 {
    const NODES: [(f64, f64); 3] = [
        (0.0, 0.568_888_888_888_888_9),
        (0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
        (0.906_179_845_938_664, 0.236_926_885_056_189_1),
    ];
    const PANELS: usize = 32;
    let half = (b - a) / (2.0 * PANELS as f64);
    let mut sum = 0.0;
    for panel in 0..PANELS {
        let middle = a + half * ((2 * panel + 1) as f64);
        for (k, (node, weight)) in NODES.iter().enumerate() {
            let (offset, weight) = (half * *node, *weight);
            sum += weight * f(middle + offset);
            if k > 0 {
                sum += weight * f(middle - offset);
            }
        }
    }
    sum * half
}
