//! Calibration of a gel that darkens, from presses of balls of known radius.
//!
//! Darkness is averaged over rings around the centre of each contact, which hardly leaves noise.
//! There the depth of the ball is z = δ + √(R² − r²) − R, and the table is c₁ d + c₂ d². The depths
//! δ of the presses drop out of equations about the mean of each press, so that c₁ and c₂ remain.

use nalgebra::{Matrix2, Vector2};
use ndarray::ArrayView2;
use tactile_core::Requirement;
use tactile_core::statistics::quantile;

use crate::ball::BallFace;
use crate::calibration::{doubts, enough, lengths, reject_others, scatter};
use crate::darkness::{DarkSensor, Darkness};
use crate::error::same_shape;
use crate::frame_check::FrameDoubt;
use crate::model::DarkModel;
use crate::{BallPress, CalibrationDoubt, CalibrationReport, CircleFinding, GelError, GelImage};

/// Pixels of at least this fraction of the largest darkness touch the ball: the rim of a contact is
/// half as deep as its centre on a thick gel (Hertz), and less on a thin one.
const INSIDE: f64 = 0.6;
/// Number of rings of equal area.
const RINGS: usize = 24;
/// Margin in pixels inside a drawn circle, where the table is not fitted.
const RIM_PX: f64 = 1.5;
/// Contacts with fewer pixels that touch the ball do not count.
const LEAST_PIXELS: usize = 60;
/// A drawn circle is wrong if its centre is off by more than this fraction of the ball's radius.
const WRONG: f64 = 0.1;
/// Number of entries of the table after the first.
const ENTRIES: usize = 64;

/// A ring: number of pixels, mean darkness, height of the ball below its equator's pole in metres,
/// and distance from the centre in metres.
#[derive(Clone, Copy, Default)]
struct Ring {
    pixels: f64,
    darkness: f64,
    height: f64,
    distance: f64,
}

/// The inside of the contact of one press.
struct Press {
    rings: Vec<Ring>,
    /// Darkness and height of each pixel.
    pixels: Vec<[f64; 2]>,
    circle: CircleFinding,
}

/// Sums of the equations for c₁ and c₂.
#[derive(Clone, Copy, Default)]
struct Sums {
    square: Matrix2<f64>,
    right: Vector2<f64>,
}

impl Sums {
    fn of(rings: &[Ring], unit: f64) -> Self {
        let total: f64 = rings.iter().map(|ring| ring.pixels).sum();
        let terms = |ring: &Ring| {
            let d = ring.darkness / unit;
            Vector2::new(d, d * d)
        };
        let weigh = |ring: &Ring| ring.pixels / total.max(1.0);
        let mean: Vector2<f64> = rings.iter().map(|ring| terms(ring) * weigh(ring)).sum();
        let height: f64 = rings.iter().map(|ring| ring.height * weigh(ring)).sum();
        let mut sums = Self::default();
        for ring in rings {
            let term = terms(ring) - mean;
            sums.square += term * term.transpose() * ring.pixels;
            sums.right += term * (ring.height - height) * ring.pixels;
        }
        sums
    }

    fn add(&mut self, other: &Self, sign: f64) {
        self.square += other.square * sign;
        self.right += other.right * sign;
    }

    fn solve(&self, unit: f64) -> Result<Curve, GelError> {
        let factor = self.square.cholesky().ok_or(GelError::NoSolution)?;
        let curve = Curve {
            coefficients: factor.solve(&self.right).into(),
            unit,
        };
        // Depth increases with darkness up to the darkest pixel.
        let increases = curve.slope(0.0) >= 0.0 && curve.slope(unit) >= 0.0;
        match increases && curve.depth(unit) > 0.0 {
            true => Ok(curve),
            false => Err(GelError::NoSolution),
        }
    }
}

/// Depth in metres as a parabola of the darkness in units of `unit` grey levels.
struct Curve {
    coefficients: [f64; 2],
    unit: f64,
}

impl Curve {
    fn depth(&self, darkness: f64) -> f64 {
        let d = darkness / self.unit;
        self.coefficients[0] * d + self.coefficients[1] * d * d
    }

    /// Derivative of the depth by the darkness in units of `unit`.
    fn slope(&self, darkness: f64) -> f64 {
        self.coefficients[0] + 2.0 * self.coefficients[1] * darkness / self.unit
    }
}

impl DarkSensor {
    /// Calibrates the sensor: see [`GelSensor::calibrate`](crate::GelSensor::calibrate).
    pub(crate) fn calibrate(
        reference: ArrayView2<'_, u8>,
        pixel_size_m: f64,
        presses: &[BallPress<'_>],
    ) -> Result<(Self, CalibrationReport), GelError> {
        Requirement::Positive.check("pixel size", pixel_size_m)?;
        let blank = DarkModel::new(pixel_size_m, vec![[0.0, 0.0], [255.0, 1.0]]);
        let blank = Self::new(blank, reference)?;
        let mut found = Vec::new();
        let mut read = Vec::new();
        for (k, press) in presses.iter().enumerate() {
            let (press, doubts) = Press::of(press, &blank)?;
            read.push(press);
            let other = |doubt| CalibrationDoubt::OtherFrame { press: k, doubt };
            found.extend(doubts.into_iter().map(other));
        }
        reject_others(&found, presses.len())?;
        found.extend(lengths(pixel_size_m, presses));
        let used: Vec<&Press> = read.iter().filter(|press| press.is_used()).collect();
        enough(used.len())?;
        let levels = used.iter().flat_map(|press| &press.pixels);
        let unit = levels.map(|[darkness, _]| *darkness).fold(1.0, f64::max);
        let each: Vec<Sums> = used
            .iter()
            .map(|press| Sums::of(&press.rings, unit))
            .collect();
        let mut total = Sums::default();
        each.iter().for_each(|sums| total.add(sums, 1.0));
        let curve = total.solve(unit)?;
        let mut misses = Misses::default();
        for (press, sums) in used.iter().zip(&each) {
            let mut others = total;
            others.add(sums, -1.0);
            misses.add(press, &others.solve(unit)?);
        }
        let entry = |k: usize| {
            let darkness = unit * k as f64 / ENTRIES as f64;
            [darkness, curve.depth(darkness)]
        };
        let model = DarkModel {
            depth_standard_error_m: quantile(&mut misses.depths, 0.683),
            slope_standard_error: scatter(&misses.scales),
            ..DarkModel::new(pixel_size_m, (0..=ENTRIES).map(entry).collect())
        };
        let median_angle_deg = quantile(&mut misses.angles, 0.5);
        let circles: Vec<CircleFinding> = read.into_iter().map(|press| press.circle).collect();
        let balls = presses
            .iter()
            .map(|press| press.ball_radius_m / pixel_size_m);
        found.extend(doubts(balls, &circles, median_angle_deg));
        let report = CalibrationReport {
            circles,
            offset_px: [0.0; 3],
            median_angle_deg,
            face: BallFace::Sphere,
            doubts: found,
        };
        Ok((Self::new(model, reference)?, report))
    }
}

impl Press {
    fn of(press: &BallPress<'_>, blank: &DarkSensor) -> Result<(Self, Vec<FrameDoubt>), GelError> {
        press.check()?;
        let GelImage::Grey(frame) = press.frame else {
            return Err(GelError::WrongImage { colours: false });
        };
        same_shape("frame of a press", blank.reference().dim(), frame.dim())?;
        let darkness = blank.darkness(frame);
        let doubts = blank.doubts(frame, darkness.step);
        let ball_px = press.ball_radius_m / blank.model.pixel_size_m;
        let own = !doubts.iter().any(FrameDoubt::refuses);
        let found = own.then(|| inside(blank, &darkness, press.circle_px, ball_px));
        let (centre, touched) = found.flatten().unwrap_or_default();
        let size = blank.model.pixel_size_m;
        let ball = press.ball_radius_m;
        // Height of a place on the ball relative to its lowest point, negative.
        let height = |r: f64| (ball * ball - r * r).max(0.0).sqrt() - ball;
        let distance =
            |at: &[usize; 2]| size * (at[1] as f64 - centre[0]).hypot(at[0] as f64 - centre[1]);
        let reach = touched
            .iter()
            .map(distance)
            .fold(f64::MIN_POSITIVE, f64::max);
        let mut rings = vec![Ring::default(); RINGS];
        for at in &touched {
            let r = distance(at);
            let ring = (RINGS as f64 * (r / reach).powi(2)) as usize;
            let ring = &mut rings[ring.min(RINGS - 1)];
            ring.pixels += 1.0;
            ring.darkness += darkness.levels[*at];
            ring.height += height(r);
            ring.distance += r;
        }
        rings.retain(|ring| ring.pixels > 0.0);
        for ring in &mut rings {
            for sum in [&mut ring.darkness, &mut ring.height, &mut ring.distance] {
                *sum /= ring.pixels;
            }
        }
        let circle = (!touched.is_empty()).then(|| [centre[0], centre[1], reach / size]);
        let misfit_px = press.circle_px.zip(circle);
        let misfit_px =
            misfit_px.map(|(drawn, found)| (drawn[0] - found[0]).hypot(drawn[1] - found[1]));
        let pixel = |at: &[usize; 2]| [darkness.levels[*at], height(distance(at))];
        let press = Self {
            pixels: touched.iter().map(pixel).collect(),
            rings,
            circle: CircleFinding {
                drawn_px: press.circle_px,
                found_px: circle,
                used_px: circle,
                misfit_px,
                wrong: misfit_px.is_some_and(|misfit| misfit > WRONG * ball_px),
            },
        };
        Ok((press, doubts))
    }

    fn is_used(&self) -> bool {
        self.circle.used_px.is_some()
    }
}

/// Centre (x, y) of the widest contact, and its pixels that touch the ball. `None` if they are too
/// few.
fn inside(
    blank: &DarkSensor,
    darkness: &Darkness,
    drawn: Option<[f64; 3]>,
    ball_px: f64,
) -> Option<([f64; 2], Vec<[usize; 2]>)> {
    let patches = blank.patches(darkness);
    let (patch, darkness) = (patches.first()?, &darkness.levels);
    // A quantile, because a single pixel has the noise of the camera.
    let mut levels: Vec<f64> = patch.pixels.iter().map(|at| darkness[*at]).collect();
    let limit = INSIDE * quantile(&mut levels, 0.98);
    let deep = patch.pixels.iter().filter(|at| darkness[**at] > limit);
    let deep: Vec<[usize; 2]> = deep.copied().collect();
    let mean = |axis: usize| deep.iter().map(|at| at[axis] as f64).sum::<f64>() / deep.len() as f64;
    let centre = [mean(1), mean(0)];
    let far = |at: &[usize; 2], [x, y]: [f64; 2]| (at[1] as f64 - x).hypot(at[0] as f64 - y);
    // The whole inner circle is used where most of its pixels are dark enough: choosing pixels by
    // their own darkness would favour dark noise.
    let radius = (deep.len() as f64 / core::f64::consts::PI)
        .sqrt()
        .min(0.97 * ball_px);
    let within = |at: &[usize; 2]| {
        let drawn = drawn.is_none_or(|[x, y, radius]| far(at, [x, y]) < radius - RIM_PX);
        far(at, centre) < radius - RIM_PX && drawn
    };
    let touched: Vec<[usize; 2]> = patch
        .pixels
        .iter()
        .filter(|at| within(at))
        .copied()
        .collect();
    (touched.len() >= LEAST_PIXELS).then_some((centre, touched))
}

/// Differences between the balls and the leave-one-out predictions.
#[derive(Default)]
struct Misses {
    depths: Vec<f64>,
    angles: Vec<f64>,
    /// Depths relative to those of the ball, one number per press.
    scales: Vec<f64>,
}

impl Misses {
    fn add(&mut self, press: &Press, curve: &Curve) {
        let n = press.pixels.len() as f64;
        let depths = press
            .pixels
            .iter()
            .map(|[d, height]| curve.depth(*d) - height);
        let offset = depths.clone().sum::<f64>() / n;
        self.depths
            .extend(depths.map(|depth| (depth - offset).abs()));
        let total: f64 = press.rings.iter().map(|ring| ring.pixels).sum();
        let mean = |value: &dyn Fn(&Ring) -> f64| {
            press
                .rings
                .iter()
                .map(|ring| ring.pixels * value(ring))
                .sum::<f64>()
                / total
        };
        let depth = |ring: &Ring| curve.depth(ring.darkness);
        let [own, ball] = [mean(&depth), mean(&|ring| ring.height)];
        let product = mean(&|ring| (depth(ring) - own) * (ring.height - ball));
        let square = mean(&|ring| (ring.height - ball).powi(2));
        if square > 0.0 {
            self.scales.push(product / square);
        }
        for pair in press.rings.windows(2) {
            let apart = pair[1].distance - pair[0].distance;
            let rise = [
                depth(&pair[1]) - depth(&pair[0]),
                pair[1].height - pair[0].height,
            ];
            let [found, truth] = rise.map(|rise| (rise / apart).atan().to_degrees());
            if apart > 0.0 {
                self.angles.push((found - truth).abs());
            }
        }
    }
}
