//! Normal equations of the profile's parameters over rings of pixels.

use nalgebra::{SMatrix, SVector};

use super::profile::Level;
use super::ring::RingSums;

/// Peak, background, radius, blur variance, centre's x and y, bend.
pub(super) type Normal = SMatrix<f64, 7, 7>;
pub(super) type Step = SVector<f64, 7>;

/// Place of the bend among the parameters.
pub(super) const BEND: usize = 6;
/// Root mean square residual, as a share of the peak, beyond which a profile is no ball's: contacts by finite elements have 2 %, flat faces 10 % and
/// more.
const NO_BALL: f64 = 0.05;
/// Squared residuals over the noise's from which on they are the profile's, not the noise's.
const CLEARLY: f64 = 2.0;

pub(super) struct Equations {
    pub(super) normal: Normal,
    pub(super) gradient: Step,
    pub(super) chi2: f64,
    pub(super) pixels: f64,
    /// Sum of the pixels' weights.
    weights: f64,
}

impl Equations {
    pub(super) fn zeros() -> Self {
        Self {
            normal: Normal::zeros(),
            gradient: Step::zeros(),
            chi2: 0.0,
            pixels: 0.0,
            weights: 0.0,
        }
    }

    /// Adds one ring's pixels; only the lower triangle of the normal matrix is filled.
    ///
    /// Along a ring the model is its level, to first order in r² − mean r²; a shift of the centre changes it by
    /// −2 (dI/dr²) times the place.
    pub(super) fn add(&mut self, ring: &RingSums, l: &Level, weight: f64, r2: f64, spread: f64) {
        let radial = [
            (0, l.by_peak),
            (1, 1.0),
            (2, l.by_radius),
            (3, l.by_blur),
            (BEND, l.by_bend),
        ];
        let along = |place: f64, by_r2: f64| l.value * place + l.by_r2 * (by_r2 - r2 * place);
        let slope = -2.0 * weight * l.by_r2;
        for (k, &(i, by)) in radial.iter().enumerate() {
            let a = weight * ring.n * by;
            for &(j, b) in &radial[..=k] {
                self.normal[(i, j)] += a * b;
            }
            let (x, y) = if i == BEND {
                ((BEND, 4), (BEND, 5))
            } else {
                ((4, i), (5, i))
            };
            self.normal[x] += slope * by * ring.u;
            self.normal[y] += slope * by * ring.v;
            self.gradient[i] += weight * by * (ring.d - ring.n * l.value);
        }
        let square = -2.0 * slope * l.by_r2;
        self.normal[(4, 4)] += square * ring.uu;
        self.normal[(5, 4)] += square * ring.uv;
        self.normal[(5, 5)] += square * (ring.r2 - ring.uu);
        self.gradient[4] += slope * (ring.du - along(ring.u, ring.r2u));
        self.gradient[5] += slope * (ring.dv - along(ring.v, ring.r2v));
        // Along a ring the model itself varies; that is no misfit.
        let within = ring.n * l.by_r2 * l.by_r2 * spread;
        self.chi2 +=
            weight * (ring.dd - 2.0 * l.value * ring.d + ring.n * l.value * l.value - within);
        self.pixels += ring.n;
        self.weights += weight * ring.n;
    }

    /// Whether the residuals of a profile of that peak are neither noise nor what finite strain leaves.
    pub(super) fn is_no_ball(&self, peak: f64) -> bool {
        let limit = NO_BALL * peak;
        self.chi2 > CLEARLY * self.pixels && self.chi2 > limit * limit * self.weights
    }
}
