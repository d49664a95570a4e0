//! Least squares on the rings: the Gauss–Newton iteration for the profile's parameters.

use super::edge::BlurredEdge;
use super::equations::{BEND, Equations, Normal, Step};
use super::misfit::Misfit;
use super::profile::{Shape, level};
use super::rings::Rings;
use super::variance::PixelVariance;
use super::{HertzFit, HertzFitOptions};
use crate::contact::Region;
use tactile_core::Estimate;
use tactile_core::StopReason;

/// Variance along one axis of a position spread evenly over a pixel.
const PIXEL: f64 = 1.0 / 12.0;
/// Greatest bend that is fitted. Balls on soft layers reach −0.3, balls flattened on glass +0.15; beyond ±0.6 the profile is no ball's.
const LARGEST_BEND: f64 = 0.6;
/// Share of the misfit that a bend must take away to be believed. Contacts by finite elements lose nine tenths and more; where the light is not
/// quite proportional, saturates, or is rough, a bend takes away a tenth and makes the radius worse (`cargo test -p tactile-force --test suite
/// sensor`).
const EXPLAINED: f64 = 0.5;
/// Least fall of χ² in a step, as a share, of a profile that is no ball's: there blur and radius wander along a valley without end, and what they
/// are says nothing.
const FALLING: f64 = 1e-2;
/// Steps in which a ball's profile has long settled, however far from it the fit starts.
const AMPLE: usize = 12;

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

/// What is fitted, and how pixels count.
#[derive(Clone, Copy)]
struct Data<'a> {
    region: &'a Region,
    variance: PixelVariance<'a>,
    /// Height of a pixel over its width.
    aspect: f64,
    /// About the contact's, in pixels.
    radius: f64,
}

#[derive(Clone, Copy)]
struct State {
    shape: Shape,
    centre: [f64; 2],
    /// Whether the bend is fitted.
    bent: bool,
    iterations: usize,
    stop: StopReason,
}

impl HertzFitter {
    pub(crate) fn new(options: HertzFitOptions) -> Self {
        Self {
            options,
            edge: BlurredEdge::new(),
        }
    }

    /// Fits the aperture's pixels. `None` if they do not determine the parameters.
    pub(crate) fn fit_with(
        &self,
        rings: &mut Rings,
        region: &Region,
        start: Start,
        variance: PixelVariance<'_>,
        pixel_size_m: [f64; 2],
    ) -> Option<HertzFit> {
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
                bend: 0.0,
            },
            centre: start.centre,
            bent: false,
            iterations: 0,
            stop: StopReason::IterationLimit,
        };
        let data = Data {
            region,
            variance,
            aspect,
            radius: start.radius,
        };
        self.refine(rings, &data, &mut state)?;
        let mut equations = self.assemble(rings, &state, variance);
        let mut misfit = Misfit::of(rings, &self.edge, &state.shape, variance, equations.chi2);
        if misfit.stands_out
            && let Some(bent) = self.bend(rings, &data, &state, &misfit)
        {
            (state, equations, misfit) = bent;
        }
        let origin = [place.column_start as f64, place.row_start as f64];
        self.report(&state, &equations, misfit, origin, pixel_size_m)
    }

    /// The profile with a bend, if that explains the misfit of Hertz's.
    fn bend(
        &self,
        rings: &mut Rings,
        data: &Data<'_>,
        hertz: &State,
        misfit: &Misfit,
    ) -> Option<(State, Equations, Misfit)> {
        let mut state = State {
            bent: true,
            iterations: 0,
            ..*hertz
        };
        self.refine(rings, data, &mut state)?;
        let equations = self.assemble(rings, &state, data.variance);
        let chi2 = equations.chi2;
        let left = Misfit::of(rings, &self.edge, &state.shape, data.variance, chi2);
        let explained = left.radial < EXPLAINED * misfit.radial;
        state.iterations += hertz.iterations;
        (explained && state.shape.bend.abs() < LARGEST_BEND).then_some((state, equations, left))
    }

    /// Fits and gathers the rings anew until the centre stays. `None` too where it leaves the region by more than the region's size: rings about
    /// such a centre, of which the pixels say nothing, would be without number.
    fn refine(&self, rings: &mut Rings, data: &Data<'_>, state: &mut State) -> Option<()> {
        let place = data.region.place?;
        let farthest = 2.0 * (place.rows() + place.columns()) as f64;
        let is_near = |[x, y]: [f64; 2]| x.hypot(y) <= farthest;
        for _ in 0..5 {
            if !is_near(state.centre) {
                return None;
            }
            rings.gather(data.region, state.centre, data.aspect, data.radius);
            let moved = self.descend(rings, state, data.variance, data.aspect)?;
            if moved < 0.02 {
                break;
            }
        }
        is_near(state.centre).then_some(())
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
        let mut here = self.assemble(rings, state, variance);
        state.stop = StopReason::IterationLimit;
        let mut shift = [0.0; 2];
        while state.iterations < self.options.max_iterations {
            state.iterations += 1;
            let step = here.normal.cholesky()?.solve(&here.gradient);
            // The centre enters linearly on fixed rings: its best shift belongs to the final shape.
            shift = [step[4], step[5]];
            let mut trial = self.stepped(state, &step);
            let mut there = self.assemble(rings, &trial, variance);
            for halving in 1..10 {
                if there.chi2 <= here.chi2 * 1.01 {
                    break;
                }
                trial = self.stepped(state, &(step * 0.5_f64.powi(halving)));
                there = self.assemble(rings, &trial, variance);
            }
            let no_ball = state.iterations >= AMPLE && there.is_no_ball(trial.shape.peak);
            if no_ball && there.chi2 > (1.0 - FALLING) * here.chi2 {
                // The better of the two, about the centre as it is.
                if there.chi2 < here.chi2 {
                    state.shape = trial.shape;
                }
                state.stop = StopReason::Converged;
                return Some(0.0);
            }
            let before = std::mem::replace(&mut state.shape, trial.shape);
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

    fn stepped(&self, state: &State, step: &Step) -> State {
        let shape = &state.shape;
        let stepped = Shape {
            peak: shape.peak + step[0],
            background: shape.background + step[1],
            radius: (shape.radius + step[2]).clamp(0.5 * shape.radius, 2.0 * shape.radius),
            blur: if self.options.blur_px.is_some() {
                shape.blur
            } else {
                (shape.blur + step[3]).clamp(PIXEL, 4.0 * shape.blur)
            },
            bend: (shape.bend + step[BEND]).clamp(-LARGEST_BEND, LARGEST_BEND),
        };
        State {
            shape: stepped,
            ..*state
        }
    }

    /// Normal equations over all pixels of the rings; rows of parameters that are not fitted are those of the identity.
    fn assemble(&self, rings: &Rings, state: &State, variance: PixelVariance<'_>) -> Equations {
        let shape = &state.shape;
        let mut e = Equations::zeros();
        for ring in rings.filled() {
            let r2 = ring.r2 / ring.n;
            let spread = (ring.r4 / ring.n - r2 * r2).max(0.0);
            let level = level(&self.edge, shape, r2, spread);
            let weight = 1.0 / variance.at(level.value);
            e.add(&ring, &level, weight, r2, spread);
        }
        e.normal.fill_upper_triangle_with_lower_triangle();
        for k in self.fixed(state) {
            e.normal.fill_row(k, 0.0);
            e.normal.fill_column(k, 0.0);
            e.normal[(k, k)] = 1.0;
            e.gradient[k] = 0.0;
        }
        e
    }

    /// The parameters that are not fitted.
    fn fixed(&self, state: &State) -> impl Iterator<Item = usize> + Clone {
        [
            (1, !self.options.fit_background),
            (3, self.options.blur_px.is_some()),
            (BEND, !state.bent),
        ]
        .into_iter()
        .filter_map(|(parameter, fixed)| fixed.then_some(parameter))
    }

    /// The parameters' covariance, scaled by the residuals and in pixels along both axes, and the reduced χ².
    fn covariance(
        &self,
        state: &State,
        equations: &Equations,
        aspect: f64,
    ) -> Option<(Normal, f64)> {
        let mut covariance = equations.normal.cholesky()?.inverse();
        let fixed = self.fixed(state);
        for k in fixed.clone() {
            covariance[(k, k)] = 0.0;
        }
        let fitted = 7 - fixed.count();
        let reduced = equations.chi2 / (equations.pixels - fitted as f64).max(1.0);
        covariance *= reduced;
        covariance.row_mut(5).unscale_mut(aspect);
        covariance.column_mut(5).unscale_mut(aspect);
        Some((covariance, reduced))
    }

    fn report(
        &self,
        state: &State,
        equations: &Equations,
        misfit: Misfit,
        origin: [f64; 2],
        pixel_size_m: [f64; 2],
    ) -> Option<HertzFit> {
        let aspect = pixel_size_m[1] / pixel_size_m[0];
        let (covariance, reduced) = self.covariance(state, equations, aspect)?;
        let s = &state.shape;
        let radius_px = Estimate::from_variance(s.radius, covariance[(2, 2)]);
        let centre = |k: usize| {
            Estimate::from_variance(origin[k] + state.centre[k], covariance[(4 + k, 4 + k)])
        };
        Some(HertzFit {
            centre_px: [centre(0), centre(1)],
            radius_px,
            radius_m: radius_px * pixel_size_m[0],
            peak: Estimate::from_variance(s.peak, covariance[(0, 0)]),
            background: Estimate::from_variance(s.background, covariance[(1, 1)]),
            blur_px: (s.blur - PIXEL).max(0.0).sqrt(),
            bend: Estimate::from_variance(s.bend, covariance[(BEND, BEND)]),
            integrated_pixel_value: integral(s, &covariance, aspect),
            covariance: std::array::from_fn(|i| std::array::from_fn(|j| covariance[(i, j)])),
            reduced_chi_squared: reduced,
            radial_misfit: misfit.radial,
            azimuthal_misfit: misfit.azimuthal,
            shape: misfit.shape,
            iterations: state.iterations,
            stop: state.stop,
        })
    }
}

/// Integral of the profile, 2π/3 A a² (1 − 2c/5) over a pixel's area, and its error.
fn integral(s: &Shape, covariance: &Normal, aspect: f64) -> Estimate {
    let hertz = 2.0 / 3.0 * std::f64::consts::PI / aspect * s.radius;
    let volume = hertz * (1.0 - 0.4 * s.bend);
    let (by_peak, by_radius) = (volume * s.radius, 2.0 * volume * s.peak);
    let by_bend = -0.4 * hertz * s.radius * s.peak;
    let mut variance = by_peak * by_peak * covariance[(0, 0)]
        + 2.0 * by_peak * by_radius * covariance[(0, 2)]
        + by_radius * by_radius * covariance[(2, 2)];
    variance += by_bend * by_bend * covariance[(BEND, BEND)]
        + 2.0 * by_bend * (by_peak * covariance[(0, BEND)] + by_radius * covariance[(2, BEND)]);
    Estimate::from_variance(volume * s.radius * s.peak, variance)
}

/// Nothing moves by more than a millionth.
fn settled(before: &Shape, after: &Shape) -> bool {
    let close = |a: f64, b: f64, scale: f64| (a - b).abs() <= 1e-6 * scale.abs();
    close(before.radius, after.radius, after.radius)
        && close(before.peak, after.peak, after.peak)
        && close(before.background, after.background, after.peak)
        && close(before.blur, after.blur, after.blur + after.radius)
        && close(before.bend, after.bend, 1.0)
}
