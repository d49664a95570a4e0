//! Calibration of a gel sensor from presses of balls of known radius, with or without drawn
//! circles.

use nalgebra::DMatrix;
use ndarray::{Array2, ArrayView3};
use tactile_core::statistics::quantile;
use tactile_core::{InvalidOption, Requirement};

use crate::ball::{BallFace, Evidence};
use crate::colour::{ColourSensor, colour_image};
use crate::dots;
use crate::error::same_shape;
use crate::face::gradient_errors;
use crate::frame_check::FrameDoubt;
use crate::gradients::{Blurred, TERMS, samples};
use crate::model::ColourModel;
use crate::{GelError, GelImage};

/// Margin in pixels inside the edge of the contact, where the polynomial is not fitted: the blur of
/// the frames mixes contact and free gel there.
const RIM_PX: f64 = 1.5;
/// Relative error of slopes that is common to all presses of a calibration and therefore not
/// visible in their scatter. It was measured on gels with known faces.
const COMMON_ERROR: f64 = 0.012;
/// With fewer used presses, much of the frame and of the slopes is not covered.
const ENOUGH_PRESSES: usize = 5;
/// Median angle in degrees above which lamps, pixel size or circles are doubtful.
const LARGE_ANGLE_DEG: f64 = 10.0;
/// If the contacts reach only to a smaller fraction of the ball's radius, the ball is hardly
/// pressed or its unit is wrong.
const SMALL_SHARE: f64 = 0.02;
/// Sizes in metres above which the unit of a pixel or a ball is probably wrong.
const LARGE_PIXEL_M: f64 = 1e-3;
const LARGE_BALL_M: f64 = 0.2;

/// A frame of a ball pressed into the gel.
#[derive(Clone, Copy, Debug)]
pub struct BallPress<'a> {
    /// The frame, of the kind of the reference.
    pub frame: GelImage<'a>,
    /// Radius of the ball in metres.
    pub ball_radius_m: f64,
    /// Contact circle drawn by a user: x and y of the centre and radius, in pixels.
    pub circle_px: Option<[f64; 3]>,
}

impl<'a> BallPress<'a> {
    /// A press of a ball without a drawn circle.
    pub fn new(frame: impl Into<GelImage<'a>>, ball_radius_m: f64) -> Self {
        Self {
            frame: frame.into(),
            ball_radius_m,
            circle_px: None,
        }
    }

    pub(crate) fn check(&self) -> Result<(), InvalidOption> {
        Requirement::Positive.check("ball radius", self.ball_radius_m)?;
        let Some([x, y, radius]) = self.circle_px else {
            return Ok(());
        };
        Requirement::Finite.check("circle's x", x)?;
        Requirement::Finite.check("circle's y", y)?;
        Requirement::Positive.check("circle's radius", radius)?;
        Ok(())
    }
}

/// The contact circle of one press. Circles are x and y of the centre and radius, in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct CircleFinding {
    /// The drawn circle. `None` if the user drew none.
    pub drawn_px: Option<[f64; 3]>,
    /// The circle found in the frame. `None` if no contact was found.
    pub found_px: Option<[f64; 3]>,
    /// The circle used for the fit. `None` if the press was left out.
    pub used_px: Option<[f64; 3]>,
    /// Distance in pixels between the drawn and the found circle, in centre or radius, after
    /// subtracting the offset common to all drawn circles.
    pub misfit_px: Option<f64>,
    /// Whether the drawn circle is wrong.
    pub wrong: bool,
}

/// Report of a calibration.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct CalibrationReport {
    /// Circles of the presses, in order.
    pub circles: Vec<CircleFinding>,
    /// Median offset of the drawn circles from the found ones: x, y, radius, in pixels.
    pub offset_px: [f64; 3],
    /// Median leave-one-out angle in degrees between the normals of a press and the predicted ones.
    pub median_angle_deg: f64,
    /// Shape of the pressed faces according to the light.
    pub face: BallFace,
    /// Why the calibrated sensor may be wrong.
    pub doubts: Vec<CalibrationDoubt>,
}

/// Why a calibrated sensor may be wrong.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub enum CalibrationDoubt {
    /// Few of the given presses were used.
    FewPresses {
        /// Presses used.
        used: usize,
        /// Presses given.
        given: usize,
    },
    /// The leave-one-out normals are far off: the median angle in degrees.
    LargeAngle(f64),
    /// The light corresponds to a ball that is smaller than stated by this factor.
    BallSize(f64),
    /// The contacts reach only to this fraction of the ball's radius.
    FlatBall(f64),
    /// A length in metres is unusually large, probably because of a wrong unit.
    LargeLength(f64),
    /// A press, counted from 0, does not come from the sensor of the reference.
    OtherFrame {
        /// The press.
        press: usize,
        /// The difference.
        doubt: FrameDoubt,
    },
}

impl CalibrationDoubt {
    /// A keyword for programs.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::FewPresses { .. } => "few_presses",
            Self::LargeAngle(_) => "large_angle",
            Self::BallSize(_) => "doubtful_ball",
            Self::FlatBall(_) => "flat_ball",
            Self::LargeLength(_) => "doubtful_unit",
            Self::OtherFrame { doubt, .. } => doubt.kind(),
        }
    }
}

impl core::fmt::Display for CalibrationDoubt {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::FewPresses { used, given } => write!(
                f,
                "{used} of {given} presses were used: five to twenty at different positions are needed"
            ),
            Self::LargeAngle(angle) => write!(
                f,
                "the normals of left-out presses are wrong by {angle:.1}° in the median: check for a \
                 changed lamp, a wrong reference or wrong circles"
            ),
            Self::BallSize(factor) => write!(
                f,
                "the light fits a ball of {:.2} times the stated radius: was the diameter given \
                 instead of the radius, or is the pixel size wrong?",
                factor.recip()
            ),
            Self::FlatBall(share) => write!(
                f,
                "contacts reach to {share:.1e} of the ball's radius: is it in metres?"
            ),
            Self::LargeLength(length) => {
                write!(
                    f,
                    "a length of {length} m is large for a gel: is it in metres?"
                )
            }
            Self::OtherFrame { press, doubt } => write!(f, "press {}: {doubt}", press + 1),
        }
    }
}

/// Sums of the normal equations: terms by terms, and terms by (n_x, n_y).
#[derive(Clone)]
struct Sums {
    square: DMatrix<f64>,
    right: DMatrix<f64>,
    count: f64,
}

impl Sums {
    fn new() -> Self {
        Self {
            square: DMatrix::zeros(TERMS, TERMS),
            right: DMatrix::zeros(TERMS, 2),
            count: 0.0,
        }
    }

    /// Computes the sums over rows that hold the terms, then n_x and n_y.
    fn of(rows: &[f64]) -> Self {
        let all = DMatrix::from_row_slice(rows.len() / (TERMS + 2), TERMS + 2, rows);
        // One matrix product gives both sides of the normal equations.
        let products = all.tr_mul(&all);
        Self {
            square: products.view((0, 0), (TERMS, TERMS)).into_owned(),
            right: products.view((0, TERMS), (TERMS, 2)).into_owned(),
            count: all.nrows() as f64,
        }
    }

    fn add(&mut self, other: &Self, sign: f64) {
        self.square += sign * &other.square;
        self.right += sign * &other.right;
        self.count += sign * other.count;
    }

    /// Ridge regression. The penalty is a ten-thousandth of the number of samples. It keeps terms
    /// bounded that the presses do not determine, and changes the others by less than their errors.
    fn solve(&self) -> Result<[Vec<f64>; 2], GelError> {
        let mut square = self.square.clone();
        for k in 0..TERMS {
            square[(k, k)] += 1e-4 * self.count;
        }
        let factor = square.cholesky().ok_or(GelError::NoSolution)?;
        let solved = factor.solve(&self.right);
        let column = |k: usize| solved.column(k).iter().copied().collect();
        Ok([column(0), column(1)])
    }
}

impl ColourSensor {
    /// Calibrates the sensor: see [`GelSensor::calibrate`](crate::GelSensor::calibrate).
    pub(crate) fn calibrate(
        reference: ArrayView3<'_, u8>,
        pixel_size_m: f64,
        presses: &[BallPress<'_>],
    ) -> Result<(Self, CalibrationReport), GelError> {
        Requirement::Positive.check("pixel size", pixel_size_m)?;
        let model = ColourModel::new(pixel_size_m, [vec![0.0; TERMS], vec![0.0; TERMS]]);
        let blank = Self::of_checked(model, colour_image(reference)?);
        let mut doubts = Vec::new();
        let mut read = Vec::new();
        for (k, press) in presses.iter().enumerate() {
            let (press, found) = Press::of(press, &blank)?;
            let other = found
                .into_iter()
                .map(|doubt| CalibrationDoubt::OtherFrame { press: k, doubt });
            doubts.extend(other);
            read.push(press);
        }
        reject_others(&doubts, presses.len())?;
        doubts.extend(lengths(pixel_size_m, presses));
        let presses = read;
        let mut fit = Fitted::of(&blank, &presses, BallFace::Sphere)?;
        let mut evidence = Evidence::new();
        for (press, circle) in presses.iter().zip(&fit.circles) {
            if let Some(circle) = circle.used_px {
                evidence.add(&press.frame, &blank.reference, circle, press.ball_px);
            }
        }
        let verdict = evidence.verdict();
        if verdict.face != fit.face {
            fit = Fitted::of(&blank, &presses, verdict.face)?;
        }
        let (mut model, median_angle_deg) = fit.judged(&blank, &presses)?;
        if blank.has_dots {
            model.slope_standard_error = model.slope_standard_error.hypot(dots::SLOPE_ERROR);
        }
        let sensor = blank.with_model(model);
        doubts.extend(verdict.factor.map(CalibrationDoubt::BallSize));
        let balls = presses.iter().map(|press| press.ball_px);
        doubts.extend(self::doubts(balls, &fit.circles, median_angle_deg));
        let report = CalibrationReport {
            circles: fit.circles,
            offset_px: fit.offset_px,
            median_angle_deg,
            face: fit.face,
            doubts,
        };
        Ok((sensor, report))
    }
}

/// Rejects presses of which most do not come from the sensor of the reference.
pub(crate) fn reject_others(doubts: &[CalibrationDoubt], given: usize) -> Result<(), GelError> {
    let refused = doubts.iter().filter_map(|doubt| match doubt {
        CalibrationDoubt::OtherFrame { doubt, .. } if doubt.refuses() => Some(*doubt),
        _ => None,
    });
    let refused: Vec<FrameDoubt> = refused.collect();
    match refused.first() {
        Some(doubt) if 2 * refused.len() > given => Err(GelError::OtherFrames {
            presses: refused.len(),
            given,
            doubt: *doubt,
        }),
        _ => Ok(()),
    }
}

pub(crate) fn lengths(pixel_size_m: f64, presses: &[BallPress<'_>]) -> Vec<CalibrationDoubt> {
    let ball = presses.iter().map(|press| press.ball_radius_m);
    let ball = ball.fold(0.0, f64::max);
    let large = [(pixel_size_m, LARGE_PIXEL_M), (ball, LARGE_BALL_M)];
    let large = large.iter().filter(|(length, limit)| length > limit);
    large
        .map(|(length, _)| CalibrationDoubt::LargeLength(*length))
        .collect()
}

pub(crate) fn enough(available: usize) -> Result<(), GelError> {
    let needed = 3;
    if available < needed {
        return Err(GelError::TooFewPresses { needed, available });
    }
    Ok(())
}

/// Circles, with the sums of the polynomial inside them.
struct Fitted {
    face: BallFace,
    circles: Vec<CircleFinding>,
    offset_px: [f64; 3],
    sums: Vec<Sums>,
    total: Sums,
}

impl Fitted {
    fn of(blank: &ColourSensor, presses: &[Press], face: BallFace) -> Result<Self, GelError> {
        let found = find_circles(blank, presses, face)?;
        let (circles, offset_px) = judged(presses, &found);
        let used = circles.iter().filter(|circle| circle.used_px.is_some());
        enough(used.count())?;
        let sums: Vec<Sums> = presses
            .iter()
            .zip(&circles)
            .map(|(press, circle)| press.sums(&blank.reference, circle.used_px, face))
            .collect();
        let mut total = flat(&blank.reference);
        sums.iter().for_each(|sums| total.add(sums, 1.0));
        Ok(Self {
            face,
            circles,
            offset_px,
            sums,
            total,
        })
    }

    /// The model with its errors and the median angle in degrees, from leaving out one press at a
    /// time.
    fn judged(
        &self,
        blank: &ColourSensor,
        presses: &[Press],
    ) -> Result<(ColourModel, f64), GelError> {
        let pixel_size_m = blank.model.pixel_size_m;
        let mut misses = Misses::default();
        for ((press, circle), sums) in presses.iter().zip(&self.circles).zip(&self.sums) {
            let kept = circle.drawn_px.filter(|_| !circle.wrong).or(circle.used_px);
            if let Some(circle) = kept {
                let mut others = self.total.clone();
                // The sums of the normal equations are additive over presses, so a press is left
                // out by subtraction.
                others.add(sums, -1.0);
                let model = ColourModel::new(pixel_size_m, others.solve()?);
                let without = blank.with_model(model);
                misses.add(&without, press, press.within(circle), self.face)?;
            }
        }
        let angle = quantile(&mut misses.angles, 0.5);
        let model = ColourModel {
            normal_standard_error: quantile(&mut misses.gradients, 0.683),
            depth_standard_error_m: quantile(&mut misses.depths, 0.683),
            slope_standard_error: scatter(&misses.scales),
            ..ColourModel::new(pixel_size_m, self.total.solve()?)
        };
        Ok((model, angle))
    }
}

/// Doubts about the presses of a calibration: the radius of the ball of each in pixels, and its
/// circle.
pub(crate) fn doubts(
    balls_px: impl ExactSizeIterator<Item = f64>,
    circles: &[CircleFinding],
    angle_deg: f64,
) -> Vec<CalibrationDoubt> {
    let mut doubts = Vec::new();
    let given = balls_px.len();
    let used = circles.iter().filter(|c| c.used_px.is_some()).count();
    if used < ENOUGH_PRESSES || 10 * used < 7 * given {
        doubts.push(CalibrationDoubt::FewPresses { used, given });
    }
    if angle_deg > LARGE_ANGLE_DEG {
        doubts.push(CalibrationDoubt::LargeAngle(angle_deg));
    }
    let share = balls_px.zip(circles);
    let share = share.filter_map(|(ball, circle)| Some(circle.used_px?[2] / ball));
    let share = share.fold(0.0, f64::max);
    if share < SMALL_SHARE {
        doubts.push(CalibrationDoubt::FlatBall(share));
    }
    doubts
}

/// Standard error of a scale of 1 from its values in the presses: their root mean square deviation
/// from 1, widened for few presses by Student's distribution.
pub(crate) fn scatter(scales: &[f64]) -> f64 {
    let n = scales.len() as f64;
    if n < 2.0 {
        return 1.0;
    }
    let square = scales.iter().map(|s| (s - 1.0).powi(2)).sum::<f64>() / n;
    // Accurate within 4 % for the ratio of the 97.5 % quantiles of Student's and the normal
    // distribution, from two degrees of freedom on.
    let student = 1.0 + 1.35 / (n - 1.0) + 2.2 / (n - 1.0).powi(2);
    (square.sqrt() * (1.0 + 1.0 / n).sqrt() * student).hypot(COMMON_ERROR)
}

/// A press prepared for the computation. Lengths are in pixels.
struct Press {
    frame: Blurred,
    ball_px: f64,
    drawn: Option<[f64; 3]>,
    /// Whether the frame comes from the sensor of the reference.
    own: bool,
}

impl Press {
    fn of(
        press: &BallPress<'_>,
        blank: &ColourSensor,
    ) -> Result<(Self, Vec<FrameDoubt>), GelError> {
        press.check()?;
        let GelImage::Colour(frame) = press.frame else {
            return Err(GelError::WrongImage { colours: true });
        };
        let (rows, columns, _) = colour_image(frame)?.dim();
        same_shape("frame of a press", blank.shape(), (rows, columns))?;
        let (frame, doubts) = blank.checked(frame);
        let press = Self {
            frame,
            ball_px: press.ball_radius_m / blank.model.pixel_size_m,
            drawn: press.circle_px,
            own: !doubts.iter().any(FrameDoubt::refuses),
        };
        Ok((press, doubts))
    }

    /// Limits the circle to one that a ball can make. Beyond 76° from the axis, light does not
    /// depend on the slope.
    fn within(&self, [x, y, radius]: [f64; 3]) -> [f64; 3] {
        [x, y, radius.min(0.97 * self.ball_px)]
    }

    /// Sums over every third pixel of the inner contact.
    fn sums(&self, reference: &Blurred, circle: Option<[f64; 3]>, face: BallFace) -> Sums {
        let Some([x0, y0, radius]) = circle.filter(|_| self.own) else {
            return Sums::new();
        };
        let mut rows = Vec::new();
        samples(&self.frame, reference, |row, column, terms| {
            let [x, y] = [column as f64 - x0, row as f64 - y0];
            // Neighbours share most of their noise after the blur, so using fewer pixels loses
            // little.
            if x.hypot(y) < radius - RIM_PX && (column + 7 * row).is_multiple_of(3) {
                rows.extend(terms());
                rows.extend(face.normal([x / self.ball_px, y / self.ball_px]));
            }
        });
        Sums::of(&rows)
    }

    /// The region of large colour differences, as a first guess.
    fn start(&self, reference: &Blurred) -> [f64; 3] {
        let mut energy = Array2::zeros(reference.dim());
        samples(&self.frame, reference, |row, column, terms| {
            // The terms after the constant are the differences.
            energy[[row, column]] = terms()[1..4].iter().map(|d| d * d).sum();
        });
        let largest = energy.iter().copied().fold(0.0, f64::max);
        let mut sums = [0.0; 4];
        for ((row, column), energy) in energy.indexed_iter() {
            if *energy > 0.3 * largest {
                let more = [*energy, energy * column as f64, energy * row as f64, 1.0];
                sums.iter_mut()
                    .zip(more)
                    .for_each(|(sum, more)| *sum += more);
            }
        }
        let [weight, x, y, pixels] = sums;
        let radius = (pixels / core::f64::consts::PI).sqrt();
        [x / weight, y / weight, radius.min(0.8 * self.ball_px)]
    }

    /// Centroid of the largest contact, and the radius of a circle of equal area.
    fn found(&self, sensor: &ColourSensor) -> Option<[f64; 3]> {
        let patches = sensor.patches(&self.frame);
        let largest = patches.iter().max_by(|a, b| a.area.total_cmp(&b.area))?;
        let n = largest.pixels.len() as f64;
        let mean = |axis: usize| largest.pixels.iter().map(|at| at[axis] as f64).sum::<f64>() / n;
        Some(self.within([mean(1), mean(0), largest.radius]))
    }
}

/// Sums of the frame without contact, which is flat.
fn flat(reference: &Blurred) -> Sums {
    let mut rows = Vec::new();
    samples(reference, reference, |row, column, terms| {
        if (5 * column + 7 * row).is_multiple_of(31) {
            rows.extend(terms());
            rows.extend([0.0; 2]);
        }
    });
    Sums::of(&rows)
}

/// Alternates circles and polynomial. `None` for presses in which no contact is found.
fn find_circles(
    blank: &ColourSensor,
    presses: &[Press],
    face: BallFace,
) -> Result<Vec<Option<[f64; 3]>>, GelError> {
    let own = presses.iter().filter(|press| press.own).count();
    enough(own)?;
    let flat = flat(&blank.reference);
    let starts = presses.iter().map(|press| {
        let circle = press.drawn.unwrap_or_else(|| press.start(&blank.reference));
        let finite = |circle: &[f64; 3]| circle.iter().all(|v| v.is_finite());
        Some(press.within(circle)).filter(|circle| press.own && finite(circle))
    });
    let mut circles: Vec<_> = starts.collect();
    for _ in 0..10 {
        let mut total = flat.clone();
        for (press, circle) in presses.iter().zip(&circles) {
            total.add(&press.sums(&blank.reference, *circle, face), 1.0);
        }
        let model = ColourModel::new(blank.model.pixel_size_m, total.solve()?);
        let sensor = blank.with_model(model);
        let found = presses
            .iter()
            .map(|press| press.found(&sensor).filter(|_| press.own));
        let found: Vec<_> = found.collect();
        let moved = circles.iter().zip(&found).map(|pair| match pair {
            (Some(old), Some(new)) => (0..3).map(|k| (old[k] - new[k]).abs()).fold(0.0, f64::max),
            (None, None) => 0.0,
            _ => f64::INFINITY,
        });
        let largest = moved.fold(0.0, f64::max);
        circles = found;
        if largest < 0.1 {
            break;
        }
    }
    Ok(circles)
}

/// Compares drawn with found circles. Also returns the offset common to the drawn circles.
fn judged(presses: &[Press], found: &[Option<[f64; 3]>]) -> (Vec<CircleFinding>, [f64; 3]) {
    let pairs = presses.iter().zip(found);
    let both = pairs
        .clone()
        .filter_map(|(press, found)| Some((press.drawn?, (*found)?)));
    let both: Vec<_> = both.collect();
    let offset = [0, 1, 2].map(|k: usize| {
        let mut steps: Vec<f64> = both
            .iter()
            .map(|(drawn, found)| drawn[k] - found[k])
            .collect();
        quantile(&mut steps, 0.5)
    });
    let misfit = |(drawn, found): ([f64; 3], [f64; 3])| {
        let [x, y, radius] = [0, 1, 2].map(|k| drawn[k] - found[k] - offset[k]);
        x.hypot(y).max(radius.abs())
    };
    let mut misfits: Vec<f64> = both.iter().copied().map(misfit).collect();
    let usual = quantile(&mut misfits, 0.5);
    let judge = |(press, found): (&Press, &Option<[f64; 3]>)| {
        let misfit_px = press.drawn.zip(*found).map(misfit);
        // If all circles are drawn well, the median misfit is small. The second limit then prevents
        // false alarms.
        let limit = (3.0 * usual).max(0.1 * press.ball_px);
        let shifted = found.map(|found| [0, 1, 2].map(|k| found[k] + offset[k]));
        CircleFinding {
            drawn_px: press.drawn,
            found_px: *found,
            // A press without a found contact still counts, with the circle drawn by the user.
            used_px: shifted
                .or(press.drawn)
                .filter(|_| press.own)
                .map(|circle| press.within(circle)),
            misfit_px,
            wrong: misfit_px.is_some_and(|misfit| misfit > limit),
        }
    };
    (pairs.map(judge).collect(), offset)
}

/// Differences between the balls and the leave-one-out predictions.
#[derive(Default)]
struct Misses {
    /// Differences of gradients, in units of their error for a unit error of the normal.
    gradients: Vec<f64>,
    depths: Vec<f64>,
    angles: Vec<f64>,
    /// Slopes relative to those of the ball, one number per press.
    scales: Vec<f64>,
}

impl Misses {
    fn add(
        &mut self,
        without: &ColourSensor,
        press: &Press,
        [x0, y0, radius]: [f64; 3],
        face: BallFace,
    ) -> Result<(), GelError> {
        let reading = without.read_blurred(&press.frame, Vec::new())?;
        let ball = press.ball_px;
        // Depth is measured from the contact circle.
        let (mut rim, mut ring) = (0.0, 0.0);
        for ((row, column), depth) in reading.depth_m.indexed_iter() {
            let distance = (column as f64 - x0).hypot(row as f64 - y0);
            if (distance - radius).abs() < 0.7 {
                (rim, ring) = (rim + depth, ring + 1.0);
            }
        }
        let rim = rim / f64::max(ring, 1.0);
        let (mut product, mut square) = (0.0, 0.0);
        for ((row, column), depth) in reading.depth_m.indexed_iter() {
            let [x, y] = [column as f64 - x0, row as f64 - y0];
            let distance = x.hypot(y);
            if distance >= radius {
                continue;
            }
            let normal = face.normal([x / ball, y / ball]);
            let up = (1.0 - normal[0].powi(2) - normal[1].powi(2))
                .max(1e-3)
                .sqrt();
            let truth = normal.map(|n| -n / up);
            let found = [0, 1].map(|k: usize| f64::from(reading.gradient[k][[row, column]]));
            let units = gradient_errors(found.map(|slope| slope as f32));
            for ((found, truth), unit) in found.iter().zip(truth).zip(units) {
                self.gradients.push((found - truth).abs() / f64::from(unit));
            }
            let cap = face.depth(distance / ball, radius / ball) * ball;
            self.depths
                .push((depth - rim - without.model.pixel_size_m * cap).abs());
            if distance < radius - RIM_PX {
                product += found[0] * truth[0] + found[1] * truth[1];
                square += truth[0].powi(2) + truth[1].powi(2);
            }
            let length = |[p, q]: [f64; 2]| (1.0 + p * p + q * q).sqrt();
            let cosine =
                (1.0 + found[0] * truth[0] + found[1] * truth[1]) / (length(found) * length(truth));
            // Rounding can raise the cosine of equal normals above 1.
            self.angles.push(cosine.min(1.0).acos().to_degrees());
        }
        if square > 0.0 {
            self.scales.push(product / square);
        }
        Ok(())
    }
}
