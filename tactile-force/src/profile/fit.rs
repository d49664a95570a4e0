//! Least squares on the rings: Gauss–Newton iteration for the parameters of the profile, and the
//! misfit beyond the noise.

use nalgebra::{SMatrix, SVector};
use tactile_core::{Estimate, Source, StopReason, Uncertain};

use super::model::{BlurredEdge, Level, Shape, level};
use super::rings::{Ring, Rings};
use crate::noise::DifferenceNoise;
use crate::region::Region;

/// Whether a fitted contact is that of a ball.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::*;
///
/// let pairs = [0.0, 1e5, 2e5].map(|v| CalibrationPair::loading(v, 1e-5 * v));
/// let calibration = LinearCalibration::fit(&pairs)?;
/// let at_rest = Array2::from_elem((120, 120), 12_u8);
/// let shape = |level: &dyn Fn(f64) -> f64| -> Result<Option<ProfileShape>, ForceError> {
///     let frame = Array2::from_shape_fn((120, 120), |(y, x)| {
///         12 + level((x as f64 - 60.2).hypot(y as f64 - 59.7) / 30.0).round() as u8
///     });
///     let m: ForceMeasurement = measure_force(
///         frame.view(),
///         at_rest.view(),
///         [20e-6; 2],
///         &calibration,
///         &Default::default(),
///     )?;
///     Ok(m.profile.map(|p| p.shape))
/// };
/// assert_eq!(shape(&|r| 150.0 * (1.0 - r * r).max(0.0).sqrt())?, Some(ProfileShape::Hertz));
/// // Uniform pressure, as under a soft pad.
/// assert_eq!(shape(&|r| if r < 1.0 { 150.0 } else { 0.0 })?, Some(ProfileShape::NotHertz));
/// # Ok::<(), ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum ProfileShape {
    /// The pressure is Hertzian, or that of a ball at finite strain if there is a
    /// [`bend`](HertzFit::bend), within the misfit explained by noise and a smooth guide.
    Hertz,
    /// The profile is not that of a ball: the misfit exceeds the noise, and 1 % of the peak along
    /// the radius or 3 % around it. The contact radius is that of the profile with its `bend`:
    /// accurate to 0.03 % for a ball at finite strain, and only a measure of size for other
    /// objects.
    NotHertz,
}

/// A fitted Hertz profile.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::*;
///
/// let pairs = [0.0, 1e5, 2e5].map(|v| CalibrationPair::loading(v, 1e-5 * v));
/// let calibration = LinearCalibration::fit(&pairs)?;
/// let frame = Array2::from_shape_fn((120, 120), |(y, x)| {
///     let r = (x as f64 - 60.3).hypot(y as f64 - 57.8) / 30.0;
///     12 + (150.0 * (1.0 - r * r).max(0.0).sqrt()).round() as u8
/// });
/// let at_rest = Array2::from_elem((120, 120), 12);
/// let measured = measure_force(
///     frame.view(),
///     at_rest.view(),
///     [20e-6; 2],
///     &calibration,
///     &Default::default(),
/// )?;
/// let fit: HertzFit = measured.profile.expect("a profile");
/// assert!((fit.radius_px.value - 30.0).abs() < 0.02);
/// assert!((fit.centre_px[0].value - 60.3).abs() < 0.01 && (fit.peak.value - 150.0).abs() < 0.3);
/// assert_eq!(fit.stop, tactile_core::StopReason::Converged);
/// # Ok::<(), ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct HertzFit {
    /// Centre [x, y] in pixels.
    pub centre_px: [Estimate; 2],
    /// Contact radius in units of the pixel width, with the errors of noise and of the law of the
    /// profile. The latter are a hundredth of a pixel and 0.03 % of the radius, common to repeated
    /// frames.
    pub radius_px: Uncertain,
    /// Contact radius in metres.
    pub radius_m: Uncertain,
    /// Grey-level difference at the centre.
    pub peak: Estimate,
    /// Standard deviation of the blur, in pixels.
    pub blur_px: f64,
    /// c of p₀ √(1 − r²/a²) (1 − c r²/a²). Zero if the Hertz profile fits within the noise. Balls
    /// at finite strain on soft layers press harder at the rim (c < 0, to −0.3), balls flattened on
    /// a stiff base less (c > 0, to 0.15).
    pub bend: Estimate,
    /// Integral of the profile, 2π/3 A a² (1 − 2c/5) in grey levels × pixels.
    pub integrated_pixel_value: Estimate,
    /// Covariance of [peak, radius, blur variance, x, y], in grey levels and pixels.
    pub covariance: [[f64; 5]; 5],
    /// Residual variance relative to the noise model. It is close to 1 for the contact of a ball.
    pub reduced_chi_squared: f64,
    /// Root mean square misfit of the mean level at each radius, relative to the peak and corrected
    /// for the noise.
    pub radial_misfit: f64,
    /// Root mean square misfit around the centre, relative to the peak and corrected for the noise
    /// and the radial misfit.
    pub azimuthal_misfit: f64,
    /// Whether the misfits are compatible with a ball.
    pub shape: ProfileShape,
    /// Number of steps.
    pub iterations: usize,
    /// Why the fit stopped.
    pub stop: StopReason,
}

impl HertzFit {
    /// Converts the fit to other units of its level, such as pressures instead of grey levels.
    pub(crate) fn with_levels_scaled(mut self, factor: f64) -> Self {
        self.peak = self.peak * factor;
        self.integrated_pixel_value = self.integrated_pixel_value * factor;
        self.covariance[0].iter_mut().for_each(|c| *c *= factor);
        self.covariance.iter_mut().for_each(|row| row[0] *= factor);
        self
    }
}

/// Variance along one axis of a position distributed uniformly over a pixel.
const PIXEL: f64 = 1.0 / 12.0;
/// Largest bend that is fitted. Balls on soft layers reach −0.3, balls flattened on glass +0.15.
/// Beyond ±0.6 the profile is not that of a ball.
const LARGEST_BEND: f64 = 0.6;
/// Maximum number of steps of a fit. A clean contact takes 5 to 8.
const MAX_ITERATIONS: usize = 50;

/// Fits Hertz profiles. Holds the table of the blurred edge.
#[derive(Clone, Debug)]
pub(crate) struct HertzFitter {
    edge: BlurredEdge,
}

/// Start values of a fit: centroid, equivalent radius and integral of the contact, in pixels of its
/// region.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Start {
    pub centre: [f64; 2],
    pub radius: f64,
    pub integral: f64,
}

/// The data of a fit and the weights of the pixels.
#[derive(Clone, Copy)]
struct Data<'a> {
    region: &'a Region,
    variance: PixelVariance<'a>,
    /// Height of a pixel over its width.
    aspect: f64,
    /// Approximate contact radius, in pixels.
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
    pub(crate) fn new() -> Self {
        Self {
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
        // Peak of Hertz's profile with this integral, 2π/3 A a² over pixels `aspect` times as high
        // as wide.
        let peak =
            1.5 * start.integral * aspect / (std::f64::consts::PI * start.radius * start.radius);
        let mut state = State {
            shape: Shape {
                peak,
                radius: start.radius,
                blur: 0.5 + PIXEL,
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

    /// The profile with a bend, if it explains the misfit of Hertz's profile.
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
        // Fraction of the misfit that a bend must explain to be accepted. For contacts by finite
        // elements it explains nine tenths and more. If the light is slightly non-linear, saturated
        // or rough, a bend explains a tenth and makes the radius worse
        // (`cargo test -p tactile-force --test suite sensor`).
        let explained = left.radial < 0.5 * misfit.radial;
        state.iterations += hertz.iterations;
        (explained && state.shape.bend.abs() < LARGEST_BEND).then_some((state, equations, left))
    }

    /// Alternates the fit and the gathering of rings until the centre converges. `None` if it
    /// leaves the region by more than the region's size: such a centre is not determined by the
    /// pixels, and would need an unlimited number of rings.
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

    /// Gauss–Newton steps on fixed rings until they converge. Returns the displacement of the
    /// centre, in pixels.
    ///
    /// The weights depend on the shape, so χ² may rise slightly near the end: only a step that
    /// makes it clearly worse is halved.
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
        while state.iterations < MAX_ITERATIONS {
            state.iterations += 1;
            let step = here.normal.cholesky()?.solve(&here.gradient);
            // The centre enters linearly on fixed rings, so its best shift belongs to the final
            // shape.
            shift = [step[X], step[Y]];
            let mut trial = self.stepped(state, &step);
            let mut there = self.assemble(rings, &trial, variance);
            for halving in 1..10 {
                if there.chi2 <= here.chi2 * 1.01 {
                    break;
                }
                trial = self.stepped(state, &(step * 0.5_f64.powi(halving)));
                there = self.assemble(rings, &trial, variance);
            }
            // Number of steps after which a ball's profile has converged from any start.
            let no_ball = state.iterations >= 12 && there.is_no_ball(trial.shape.peak);
            // Minimum relative decrease of χ² per step for a profile that is not a ball's: its blur
            // and radius drift along a valley indefinitely, and their values are meaningless.
            if no_ball && there.chi2 > 0.99 * here.chi2 {
                // The better of the two, with the current centre.
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
            // A full step from a poor start can leave the range of the linear model.
            radius: (shape.radius + step[RADIUS]).clamp(0.5 * shape.radius, 2.0 * shape.radius),
            // The width of a pixel is the minimum blur.
            blur: (shape.blur + step[BLUR]).clamp(PIXEL, 4.0 * shape.blur),
            bend: (shape.bend + step[BEND]).clamp(-LARGEST_BEND, LARGEST_BEND),
        };
        State {
            shape: stepped,
            ..*state
        }
    }

    /// Normal equations over all pixels of the rings. If the bend is not fitted, its row is taken
    /// from the identity.
    fn assemble(&self, rings: &Rings, state: &State, variance: PixelVariance<'_>) -> Equations {
        let shape = &state.shape;
        let mut e = Equations::zeros();
        for ring in rings.filled() {
            let n = ring.place[0];
            let r2 = ring.place[3] / n;
            let spread = (ring.r4 / n - r2 * r2).max(0.0);
            let level = level(&self.edge, shape, r2, spread);
            // The variance is that at the fitted level. With the variance at the measured level,
            // pixels that noise makes darker would get a higher weight.
            let weight = 1.0 / variance.at(level.value);
            e.add(ring, &level, weight, r2, spread);
        }
        e.normal.fill_upper_triangle_with_lower_triangle();
        if !state.bent {
            e.normal.fill_row(BEND, 0.0);
            e.normal.fill_column(BEND, 0.0);
            // The factorisation then exists, and the step of the bend is zero.
            e.normal[(BEND, BEND)] = 1.0;
            e.gradient[BEND] = 0.0;
        }
        e
    }

    /// The parameter covariance, scaled by the residuals and in pixels along both axes, and the
    /// reduced χ².
    fn covariance(
        &self,
        state: &State,
        equations: &Equations,
        aspect: f64,
    ) -> Option<(Normal, f64)> {
        let mut covariance = equations.normal.cholesky()?.inverse();
        if !state.bent {
            covariance[(BEND, BEND)] = 0.0;
        }
        let fitted = if state.bent { PARAMETERS } else { BEND };
        let reduced = equations.chi2 / (equations.pixels - fitted as f64).max(1.0);
        // Scaled by the residuals: an error of the noise model and a misfit widen all errors
        // equally.
        covariance *= reduced;
        // The fit measures rows in pixel widths, the report in rows.
        covariance.row_mut(Y).unscale_mut(aspect);
        covariance.column_mut(Y).unscale_mut(aspect);
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
        // For balls by finite elements, the radius is 0.00 to 0.05 % too small with cameras of 350
        // to 1,400 pixels. Discretisation of the rim and blur add several hundredths of a pixel.
        let radius_law_px = 0.01_f64.hypot(3e-4 * s.radius);
        let radius_px = Uncertain::from(Estimate::from_variance(
            s.radius,
            covariance[(RADIUS, RADIUS)],
        ))
        .by(Source::Profile, radius_law_px);
        let centre = |k: usize| {
            Estimate::from_variance(origin[k] + state.centre[k], covariance[(X + k, X + k)])
        };
        Some(HertzFit {
            centre_px: [centre(0), centre(1)],
            radius_px,
            radius_m: radius_px * pixel_size_m[0],
            peak: Estimate::from_variance(s.peak, covariance[(0, 0)]),
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

/// Integral of the profile, 2π/3 A a² (1 − 2c/5) over the area of a pixel, and its error.
fn integral(s: &Shape, covariance: &Normal, aspect: f64) -> Estimate {
    let hertz = 2.0 / 3.0 * std::f64::consts::PI / aspect * s.radius;
    let volume = hertz * (1.0 - 0.4 * s.bend);
    let (by_peak, by_radius) = (volume * s.radius, 2.0 * volume * s.peak);
    let by_bend = -0.4 * hertz * s.radius * s.peak;
    let mut variance = by_peak * by_peak * covariance[(0, 0)]
        + 2.0 * by_peak * by_radius * covariance[(0, RADIUS)]
        + by_radius * by_radius * covariance[(RADIUS, RADIUS)];
    variance += by_bend * by_bend * covariance[(BEND, BEND)]
        + 2.0
            * by_bend
            * (by_peak * covariance[(0, BEND)] + by_radius * covariance[(RADIUS, BEND)]);
    Estimate::from_variance(volume * s.radius * s.peak, variance)
}

/// Whether no parameter changed by more than a millionth.
fn settled(before: &Shape, after: &Shape) -> bool {
    let close = |a: f64, b: f64, scale: f64| (a - b).abs() <= 1e-6 * scale.abs();
    close(before.radius, after.radius, after.radius)
        && close(before.peak, after.peak, after.peak)
        && close(before.blur, after.blur, after.blur + after.radius)
        && close(before.bend, after.bend, 1.0)
}

/// Peak, radius, blur variance, x and y of the centre, bend.
const PARAMETERS: usize = 6;
type Normal = SMatrix<f64, PARAMETERS, PARAMETERS>;
type Step = SVector<f64, PARAMETERS>;

/// Indices of the parameters.
const RADIUS: usize = 1;
const BLUR: usize = 2;
const X: usize = 3;
const Y: usize = 4;
const BEND: usize = 5;

struct Equations {
    normal: Normal,
    gradient: Step,
    chi2: f64,
    pixels: f64,
    /// Sum of the pixels' weights.
    weights: f64,
}

impl Equations {
    fn zeros() -> Self {
        Self {
            normal: Normal::zeros(),
            gradient: Step::zeros(),
            chi2: 0.0,
            pixels: 0.0,
            weights: 0.0,
        }
    }

    /// Adds the pixels of one ring. Only the lower triangle of the normal matrix is filled.
    ///
    /// Along a ring the model is its level, to first order in r² − mean r². A shift of the centre
    /// changes it by −2 (dI/dr²) times the position.
    fn add(&mut self, ring: &Ring, l: &Level, weight: f64, r2: f64, spread: f64) {
        let [n, u, v, sum_r2] = ring.place;
        let [uu, uv, r2u, r2v] = ring.product;
        let [d, du, dv, dd] = ring.difference;
        let radial = [
            (0, l.by_peak),
            (RADIUS, l.by_radius),
            (BLUR, l.by_blur),
            (BEND, l.by_bend),
        ];
        let along = |place: f64, by_r2: f64| l.value * place + l.by_r2 * (by_r2 - r2 * place);
        let slope = -2.0 * weight * l.by_r2;
        for (k, &(i, by)) in radial.iter().enumerate() {
            let a = weight * n * by;
            for &(j, b) in &radial[..=k] {
                self.normal[(i, j)] += a * b;
            }
            let (x, y) = if i == BEND {
                ((BEND, X), (BEND, Y))
            } else {
                ((X, i), (Y, i))
            };
            self.normal[x] += slope * by * u;
            self.normal[y] += slope * by * v;
            self.gradient[i] += weight * by * (d - n * l.value);
        }
        let square = -2.0 * slope * l.by_r2;
        self.normal[(X, X)] += square * uu;
        self.normal[(Y, X)] += square * uv;
        self.normal[(Y, Y)] += square * (sum_r2 - uu);
        self.gradient[X] += slope * (du - along(u, r2u));
        self.gradient[Y] += slope * (dv - along(v, r2v));
        // The variation of the model itself along a ring is not a misfit.
        let within = n * l.by_r2 * l.by_r2 * spread;
        self.chi2 += weight * (dd - 2.0 * l.value * d + n * l.value * l.value - within);
        self.pixels += n;
        self.weights += weight * n;
    }

    /// Whether the residuals of a profile with this peak are neither noise nor an effect of finite
    /// strain.
    fn is_no_ball(&self, peak: f64) -> bool {
        // Root mean square residual, relative to the peak, above which a profile is not that of a
        // ball: contacts by finite elements have 2 %, flat faces 10 % and more.
        let limit = 0.05 * peak;
        // Ratio of squared residuals to the noise above which they come from the profile.
        self.chi2 > 2.0 * self.pixels && self.chi2 > limit * limit * self.weights
    }
}

/// Misfit of a fitted profile, relative to its peak.
#[derive(Clone, Copy, Debug)]
struct Misfit {
    radial: f64,
    azimuthal: f64,
    shape: ProfileShape,
    /// Whether the radial misfit is significant, even if it is small.
    stands_out: bool,
}

impl Misfit {
    /// Splits χ² of all pixels into that of the rings' means and the rest. With weights w = 1/σ²
    /// the noise adds one per ring and one per pixel, so (χ² − number)/Σw is the mean square of the
    /// misfit.
    fn of(
        rings: &Rings,
        edge: &BlurredEdge,
        shape: &Shape,
        variance: PixelVariance<'_>,
        chi2: f64,
    ) -> Self {
        let (mut weights, mut radial_chi2, mut count, mut pixels) = (0.0, 0.0, 0.0, 0.0);
        for ring in rings.filled() {
            let n = ring.place[0];
            let r2 = ring.place[3] / n;
            let spread = (ring.r4 / n - r2 * r2).max(0.0);
            let level = level(edge, shape, r2, spread).value;
            let weight = 1.0 / variance.at(level);
            let residual = ring.difference[0] / n - level;
            radial_chi2 += weight * n * residual * residual;
            weights += weight * n;
            pixels += n;
            count += 1.0;
        }
        let share = |excess: f64| (excess.max(0.0) / weights).sqrt() / shape.peak;
        // χ² of all pixels is the sum of that of the means and that about the means.
        let around_chi2 = chi2 - radial_chi2;
        let radial = share(radial_chi2 - count);
        let azimuthal = share(around_chi2 - (pixels - count));
        let stands_out =
            // Number of standard deviations by which a sum of squares must exceed that of the
            // noise.
            |chi2: f64, number: f64| chi2 > number + 5.0 * (2.0 * number).sqrt();
        let radial_stands_out = stands_out(radial_chi2, count);
        // Radial misfit, relative to the peak, above which a profile is not Hertzian. Blur,
        // rounding to grey levels and the depth of a guide ten times the contact give 0.2 % or
        // less. Light ∝ p^1.2 interpreted as pressure gives 0.8 %, a flat punch 10 %.
        let not_radial = radial > 0.01 && radial_stands_out;
        // Corresponding misfit around the centre, which includes the error of the noise model: an
        // ellipse of 1.2 to 1 has 4 %.
        let not_round = azimuthal > 0.03 && stands_out(around_chi2, pixels - count);
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

/// Number of levels of a tabulated variance.
pub(crate) const VARIANCE_LEVELS: usize = 65;

/// Variance of one pixel at a level of the profile.
#[derive(Clone, Copy, Debug)]
pub(crate) enum PixelVariance<'a> {
    /// Grey levels: background + gain × level.
    Grey(&'a DifferenceNoise),
    /// Pressures: values at `VARIANCE_LEVELS` even steps from zero.
    Pressure {
        values: &'a [f64; VARIANCE_LEVELS],
        step: f64,
    },
}

impl PixelVariance<'_> {
    #[inline]
    fn at(&self, level: f64) -> f64 {
        match self {
            Self::Grey(noise) => noise.background + noise.gain * level.max(0.0),
            Self::Pressure { values, step } => {
                let place = (level / step).clamp(0.0, (VARIANCE_LEVELS - 1) as f64);
                let below = (place as usize).min(VARIANCE_LEVELS - 2);
                let share = place - below as f64;
                values[below] + share * (values[below + 1] - values[below])
            }
        }
    }
}

#[cfg(test)]
#[path = "fit_tests.rs"]
mod tests;
