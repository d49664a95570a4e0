//! The misfit of a profile beyond the noise.

use super::edge::BlurredEdge;
use super::outcome::ProfileShape;
use super::profile::{Shape, level};
use super::rings::Rings;
use super::variance::PixelVariance;

/// Radial misfit, as a share of the peak, beyond which a profile is not Hertz's. Blur, whole grey levels and the depth of a guide
/// ten times the contact leave 0.2 % or less; light ∝ p^1.2 taken for pressure 0.8 %, a flat punch 10 %.
const RADIAL_LIMIT: f64 = 0.01;
/// The same around the centre, where the noise model's own error counts: an ellipse of 1.2 to 1 has 4 %.
const AZIMUTHAL_LIMIT: f64 = 0.03;
/// Standard deviations by which a sum of squares must exceed that of the noise.
const SIGNIFICANT: f64 = 5.0;

/// Misfit of a fitted profile as shares of its peak.
#[derive(Clone, Copy, Debug)]
pub(super) struct Misfit {
    pub(super) radial: f64,
    pub(super) azimuthal: f64,
    pub(super) shape: ProfileShape,
    /// Whether the misfit along the radius stands out of the noise, however small it is.
    pub(super) stands_out: bool,
}

impl Misfit {
    /// Splits χ² of all pixels into that of the rings' means and the rest. With weights w = 1/σ² the noise adds one a ring and
    /// one a pixel, so that (χ² − number)/Σw is the mean square of the misfit.
    pub(super) fn of(
        rings: &Rings,
        edge: &BlurredEdge,
        shape: &Shape,
        variance: PixelVariance<'_>,
        chi2: f64,
    ) -> Self {
        let (mut weights, mut radial_chi2, mut count, mut pixels) = (0.0, 0.0, 0.0, 0.0);
        for ring in rings.filled() {
            let r2 = ring.r2 / ring.n;
            let spread = (ring.r4 / ring.n - r2 * r2).max(0.0);
            let level = level(edge, shape, r2, spread).value;
            let weight = 1.0 / variance.at(level);
            let residual = ring.d / ring.n - level;
            radial_chi2 += weight * ring.n * residual * residual;
            weights += weight * ring.n;
            pixels += ring.n;
            count += 1.0;
        }
        let share = |excess: f64| (excess.max(0.0) / weights).sqrt() / shape.peak;
        let around_chi2 = chi2 - radial_chi2;
        let radial = share(radial_chi2 - count);
        let azimuthal = share(around_chi2 - (pixels - count));
        let stands_out =
            |chi2: f64, number: f64| chi2 > number + SIGNIFICANT * (2.0 * number).sqrt();
        let radial_stands_out = stands_out(radial_chi2, count);
        let not_radial = radial > RADIAL_LIMIT && radial_stands_out;
        let not_round = azimuthal > AZIMUTHAL_LIMIT && stands_out(around_chi2, pixels - count);
        Self {
            radial,
            azimuthal,
            shape: if not_radial || not_round {
                ProfileShape::NotHertz
            } else {
                ProfileShape::Hertz
            },
            stands_out: radial_stands_out,
        }
    }
}
