//! Least squares on the rings: the Gauss–Newton iteration for the profile's parameters.

use nalgebra::{SMatrix, SVector};

use super::edge::BlurredEdge;
use super::misfit::Misfit;
use super::profile::{Level, Shape, level};
use super::rings::{RingSums, Rings};
use super::variance::PixelVariance;
use super::{HertzFit, HertzFitOptions};
use crate::calibration::StopReason;
use crate::contact::Region;
use crate::estimate::{Estimate, Real};

type Normal = SMatrix<f64, 6, 6>;
type Step = SVector<f64, 6>;

/// Variance along one axis of a position spread evenly over a pixel.
const PIXEL: f64 = 1.0 / 12.0;

/// Fits Hertz profiles; holds the table of the blurred edge.
#[derive(Clone, Debug)]
pub(crate) struct HertzFitter {
    options: HertzFitOptions,
    edge: BlurredEdge,
}

/// Where a fit starts: the contact's centroid, equivalent radius and integral, in pixels of its region.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Start {
    pub(crate) centre: [f64; 2],
    pub(crate) radius: f64,
    pub(crate) integral: f64,
}

struct State {
    shape: Shape,
    centre: [f64; 2],
    iterations: usize,
    stop: StopReason,
}

struct Equations {
    normal: Normal,
    gradient: Step,
    chi2: f64,
    pixels: f64,
}

impl HertzFitter {
    pub(crate) fn new(options: HertzFitOptions) -> Self {
        Self {
            options,
            edge: BlurredEdge::new(),
        }
    }

    /// Fits the aperture's pixels. `None` if they do not determine the parameters.
    pub(crate) fn fit_with<T: Real>(
        &self,
        rings: &mut Rings,
        region: &Region,
        start: Start,
        variance: PixelVariance<'_>,
        pixel_size_m: [f64; 2],
    ) -> Option<HertzFit<T>> {
        let place = region.place?;
        let aspect = pixel_size_m[1] / pixel_size_m[0];
        let blur = self.options.blur_px.map_or(0.5, |b| b * b) + PIXEL;
        let peak =
            1.5 * start.integral * aspect / (std::f64::consts::PI * start.radius * start.radius);
        let mut state = State {
            shape: Shape {
                peak,
                background: 0.0,
                radius: start.radius,
                blur,
            },
            centre: start.centre,
            iterations: 0,
            stop: StopReason::IterationLimit,
        };
        for _ in 0..5 {
            rings.gather(region, state.centre, aspect, start.radius);
            let moved = self.descend(rings, &mut state, variance, aspect)?;
            if moved < 0.02 {
                break;
            }
        }
        let equations = self.assemble(rings, &state.shape, variance);
        let origin = [place.column_start as f64, place.row_start as f64];
        let misfit = Misfit::of(rings, &self.edge, &state.shape, variance, equations.chi2);
        self.report(&state, &equations, misfit, origin, pixel_size_m)
    }

    /// Gauss–Newton steps on fixed rings until nothing moves; returns how far the centre went, in pixels.
    ///
    /// Weights follow the shape, so χ² may rise by a hair near the end: only a step that makes it clearly worse is halved.
    fn descend(
        &self,
        rings: &Rings,
        state: &mut State,
        variance: PixelVariance<'_>,
        aspect: f64,
    ) -> Option<f64> {
        let mut here = self.assemble(rings, &state.shape, variance);
        state.stop = StopReason::IterationLimit;
        let mut shift = [0.0; 2];
        while state.iterations < self.options.max_iterations {
            state.iterations += 1;
            let step = here.normal.cholesky()?.solve(&here.gradient);
            // The centre enters linearly on fixed rings: its best shift belongs to the final shape.
            shift = [step[4], step[5]];
            let mut trial = self.stepped(&state.shape, &step);
            let mut there = self.assemble(rings, &trial, variance);
            for halving in 1..10 {
                if there.chi2 <= here.chi2 * 1.01 {
                    break;
                }
                trial = self.stepped(&state.shape, &(step * 0.5_f64.powi(halving)));
                there = self.assemble(rings, &trial, variance);
            }
            let before = std::mem::replace(&mut state.shape, trial);
            here = there;
            if settled(&before, &state.shape) {
                state.stop = StopReason::Converged;
                break;
            }
        }
        state.centre[0] += shift[0];
        state.centre[1] += shift[1] / aspect;
        Some(shift[0].hypot(shift[1]))
    }

    fn stepped(&self, shape: &Shape, step: &Step) -> Shape {
        Shape {
            peak: shape.peak + step[0],
            background: shape.background + step[1],
            radius: (shape.radius + step[2]).clamp(0.5 * shape.radius, 2.0 * shape.radius),
            blur: if self.options.blur_px.is_some() {
                shape.blur
            } else {
                (shape.blur + step[3]).clamp(PIXEL, 4.0 * shape.blur)
            },
        }
    }

    /// Normal equations over all pixels of the rings; rows of parameters that are not fitted are those of the identity.
    fn assemble(&self, rings: &Rings, shape: &Shape, variance: PixelVariance<'_>) -> Equations {
        let mut e = Equations {
            normal: Normal::zeros(),
            gradient: Step::zeros(),
            chi2: 0.0,
            pixels: 0.0,
        };
        for ring in rings.filled() {
            let r2 = ring.r2 / ring.n;
            let spread = (ring.r4 / ring.n - r2 * r2).max(0.0);
            let level = level(&self.edge, shape, r2, spread);
            let weight = 1.0 / variance.at(level.value);
            e.add(&ring, &level, weight, r2, spread);
        }
        e.normal.fill_upper_triangle_with_lower_triangle();
        for (k, _) in self.fixed().into_iter().filter(|(_, fixed)| *fixed) {
            e.normal.fill_row(k, 0.0);
            e.normal.fill_column(k, 0.0);
            e.normal[(k, k)] = 1.0;
            e.gradient[k] = 0.0;
        }
        e
    }

    /// The parameters that need not be fitted, and whether they are not.
    fn fixed(&self) -> [(usize, bool); 2] {
        [
            (1, !self.options.fit_background),
            (3, self.options.blur_px.is_some()),
        ]
    }

    /// The parameters' covariance, scaled by the residuals and in pixels along both axes, and the reduced χ².
    fn covariance(&self, equations: &Equations, aspect: f64) -> Option<(Normal, f64)> {
        let mut covariance = equations.normal.cholesky()?.inverse();
        let fixed = self.fixed();
        for (k, _) in fixed.into_iter().filter(|(_, fixed)| *fixed) {
            covariance[(k, k)] = 0.0;
        }
        let fitted = 6 - fixed.iter().filter(|(_, fixed)| *fixed).count();
        let reduced = equations.chi2 / (equations.pixels - fitted as f64).max(1.0);
        covariance *= reduced;
        covariance.row_mut(5).unscale_mut(aspect);
        covariance.column_mut(5).unscale_mut(aspect);
        Some((covariance, reduced))
    }

    fn report<T: Real>(
        &self,
        state: &State,
        equations: &Equations,
        misfit: Misfit,
        origin: [f64; 2],
        pixel_size_m: [f64; 2],
    ) -> Option<HertzFit<T>> {
        let aspect = pixel_size_m[1] / pixel_size_m[0];
        let (covariance, reduced) = self.covariance(equations, aspect)?;
        let s = &state.shape;
        let radius_px = Estimate::<T>::nearest(s.radius, covariance[(2, 2)]);
        let centre =
            |k: usize| Estimate::nearest(origin[k] + state.centre[k], covariance[(4 + k, 4 + k)]);
        Some(HertzFit {
            centre_px: [centre(0), centre(1)],
            radius_px,
            radius_m: radius_px.scaled(T::nearest(pixel_size_m[0])),
            peak: Estimate::nearest(s.peak, covariance[(0, 0)]),
            background: Estimate::nearest(s.background, covariance[(1, 1)]),
            blur_px: T::nearest((s.blur - PIXEL).max(0.0).sqrt()),
            integrated_pixel_value: integral(s, &covariance, aspect),
            covariance: std::array::from_fn(|i| {
                std::array::from_fn(|j| T::nearest(covariance[(i, j)]))
            }),
            reduced_chi_squared: T::nearest(reduced),
            radial_misfit: T::nearest(misfit.radial),
            azimuthal_misfit: T::nearest(misfit.azimuthal),
            shape: misfit.shape,
            iterations: state.iterations,
            stop: state.stop,
        })
    }
}

impl Equations {
    /// Adds one ring's pixels; only the lower triangle of the normal matrix is filled.
    ///
    /// Along a ring the model is its level, to first order in r² − mean r²; a shift of the centre changes it by
    /// −2 (dI/dr²) times the place.
    fn add(&mut self, ring: &RingSums, l: &Level, weight: f64, r2: f64, spread: f64) {
        let radial = [l.by_peak, 1.0, l.by_radius, l.by_blur];
        let along = |place: f64, by_r2: f64| l.value * place + l.by_r2 * (by_r2 - r2 * place);
        let slope = -2.0 * weight * l.by_r2;
        for i in 0..4 {
            let a = weight * ring.n * radial[i];
            for (j, b) in radial[..=i].iter().enumerate() {
                self.normal[(i, j)] += a * b;
            }
            self.normal[(4, i)] += slope * radial[i] * ring.u;
            self.normal[(5, i)] += slope * radial[i] * ring.v;
            self.gradient[i] += weight * radial[i] * (ring.d - ring.n * l.value);
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
    }
}

/// Integral of the profile, 2π/3 A a² over a pixel's area, and its error.
fn integral<T: Real>(s: &Shape, covariance: &Normal, aspect: f64) -> Estimate<T> {
    let volume = 2.0 / 3.0 * std::f64::consts::PI / aspect * s.radius;
    let (by_peak, by_radius) = (volume * s.radius, 2.0 * volume * s.peak);
    let variance = by_peak * by_peak * covariance[(0, 0)]
        + 2.0 * by_peak * by_radius * covariance[(0, 2)]
        + by_radius * by_radius * covariance[(2, 2)];
    Estimate::nearest(volume * s.radius * s.peak, variance)
}

/// Nothing moves by more than a millionth.
fn settled(before: &Shape, after: &Shape) -> bool {
    let close = |a: f64, b: f64, scale: f64| (a - b).abs() <= 1e-6 * scale.abs();
    close(before.radius, after.radius, after.radius)
        && close(before.peak, after.peak, after.peak)
        && close(before.background, after.background, after.peak)
        && close(before.blur, after.blur, after.blur + after.radius)
}
