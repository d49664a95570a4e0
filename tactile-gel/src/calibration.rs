//! A photometric sensor from presses of balls of known radius, with or without drawn circles.

use nalgebra::DMatrix;
use ndarray::{Array2, ArrayView3};
use tactile_core::Requirement;

use crate::GelError;
use crate::contacts::contact;
use crate::contacts::parts;
use crate::error::same_shape;
use crate::gradients::{Blurred, TERMS, normals, samples};
use crate::sensor::{GelModel, GelSensor, colour_image};

/// A frame of a ball pressed into the gel.
#[derive(Clone, Copy, Debug)]
pub struct BallPress<'a> {
    /// The frame, `[row, column, channel]`.
    pub frame: ArrayView3<'a, u8>,
    /// Radius of the ball in metres.
    pub ball_radius_m: f64,
    /// Contact circle as a user drew it: x and y of the centre and radius, in pixels.
    pub circle_px: Option<[f64; 3]>,
}

/// The contact circle of one press. Circles are x and y of the centre and radius, in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct CircleFinding {
    /// The circle as drawn.
    pub drawn_px: Option<[f64; 3]>,
    /// The circle found in the frame. `None` where no contact was found.
    pub found_px: Option<[f64; 3]>,
    /// The circle that the model was fitted with. `None` for a press that was left out.
    pub used_px: Option<[f64; 3]>,
    /// Distance in pixels by which the drawn circle misses the found one, in centre or radius, less
    /// the offset that all drawn circles share.
    pub misfit_px: Option<f64>,
    /// Whether the drawn circle is wrong.
    pub wrong: bool,
}

/// How the presses of a calibration were read.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct CalibrationReport {
    /// Circles of the presses, in their order.
    pub circles: Vec<CircleFinding>,
    /// Median offset of the drawn circles from the found ones: x, y, radius, in pixels.
    pub offset_px: [f64; 3],
    /// Median angle in degrees between the normals of a press and those found without it.
    pub median_angle_deg: f64,
}

/// Sums of the normal equations: terms by terms and terms by (n_x, n_y).
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

    /// Sums over rows of terms, then n_x and n_y.
    fn of(rows: &[f64]) -> Self {
        let all = DMatrix::from_row_slice(rows.len() / (TERMS + 2), TERMS + 2, rows);
        // One product of matrices gives both sides of the normal equations.
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

    /// Ridge regression. The penalty of a ten-thousandth of the number of samples binds terms that
    /// the presses do not determine and moves the others by less than their errors.
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

impl GelSensor {
    /// Calibrates a sensor from its frame without contact and at least three presses of balls.
    ///
    /// Circles and polynomial are found in turn: the polynomial from the circles by ridge
    /// regression, the circles from the contacts that its normals show, until no circle moves by a
    /// tenth of a pixel. Without drawn circles the start is the patch of large colour differences.
    ///
    /// A circle drawn by hand may be off by some pixels. The median offset between drawn and found
    /// circles is the user's convention of where a contact ends, and it is kept. Beyond it the
    /// found circles are used. A drawn circle is wrong if it misses by more than three times
    /// the median misfit and more than a tenth of the ball's radius.
    ///
    /// Errors are those of presses left out in turn: the quantile of 68.3 % of the differences to
    /// the sphere through the circle, drawn where it is not wrong. They include the errors of the
    /// circles.
    ///
    /// # Errors
    /// [`GelError::TooFewPresses`], [`GelError::ShapeMismatch`], [`GelError::InvalidOption`] for
    /// lengths that are not positive.
    pub fn calibrate(
        reference: ArrayView3<'_, u8>,
        pixel_size_m: f64,
        presses: &[BallPress<'_>],
    ) -> Result<(Self, CalibrationReport), GelError> {
        Requirement::Positive.check("pixel size", pixel_size_m)?;
        let reference = Blurred::of(colour_image(reference)?);
        let presses = presses.iter().map(|press| {
            Requirement::Positive.check("ball radius", press.ball_radius_m)?;
            let (rows, columns, _) = colour_image(press.frame)?.dim();
            same_shape("frame of a press", reference.dim(), (rows, columns))?;
            if let Some([x, y, radius]) = press.circle_px {
                Requirement::Finite.check("circle's x", x)?;
                Requirement::Finite.check("circle's y", y)?;
                Requirement::Positive.check("circle's radius", radius)?;
            }
            Ok(Press {
                frame: Blurred::of(press.frame),
                ball_px: press.ball_radius_m / pixel_size_m,
                drawn: press.circle_px,
            })
        });
        let presses = presses.collect::<Result<Vec<_>, GelError>>()?;
        let found = find_circles(&presses, &reference)?;
        let (circles, offset_px) = judged(&presses, &found);
        let used = circles
            .iter()
            .filter(|circle| circle.used_px.is_some())
            .count();
        enough(used)?;
        let sums: Vec<Sums> = presses
            .iter()
            .zip(&circles)
            .map(|(press, circle)| press.sums(&reference, circle.used_px))
            .collect();
        let mut total = flat(&reference);
        sums.iter().for_each(|sums| total.add(sums, 1.0));
        let model = GelModel::new(pixel_size_m, total.solve()?);
        let mut sensor = Self { model, reference };
        let mut misses = Misses::default();
        for ((press, circle), sums) in presses.iter().zip(&circles).zip(&sums) {
            let kept = circle.drawn_px.filter(|_| !circle.wrong).or(circle.used_px);
            if let Some(circle) = kept {
                let mut others = total.clone();
                // Sums of the normal equations add over presses. Leaving one out is a subtraction.
                others.add(sums, -1.0);
                let model = GelModel {
                    // With an error of 1 the reading's errors are the factors from normals to
                    // gradients.
                    normal_standard_error: 1.0,
                    ..GelModel::new(pixel_size_m, others.solve()?)
                };
                let without = Self {
                    model,
                    reference: sensor.reference.clone(),
                };
                misses.add(&without, press, press.within(circle))?;
            }
        }
        sensor.model.normal_standard_error = quantile(&mut misses.gradients, 0.683);
        sensor.model.depth_standard_error_m = quantile(&mut misses.depths, 0.683);
        let report = CalibrationReport {
            circles,
            offset_px,
            median_angle_deg: quantile(&mut misses.angles, 0.5),
        };
        Ok((sensor, report))
    }
}

fn enough(available: usize) -> Result<(), GelError> {
    let needed = 3;
    if available < needed {
        return Err(GelError::TooFewPresses { needed, available });
    }
    Ok(())
}

/// A press as it is computed with, lengths in pixels.
struct Press {
    frame: Blurred,
    ball_px: f64,
    drawn: Option<[f64; 3]>,
}

impl Press {
    /// A circle that a ball can make. Beyond 76° from the axis light shows no slope.
    fn within(&self, [x, y, radius]: [f64; 3]) -> [f64; 3] {
        [x, y, radius.min(0.97 * self.ball_px)]
    }

    /// Every third pixel of the contact, and one in 31 of those far from it, which are flat.
    fn sums(&self, reference: &Blurred, circle: Option<[f64; 3]>) -> Sums {
        let Some([x0, y0, radius]) = circle else {
            return Sums::new();
        };
        let mut rows = Vec::new();
        samples(&self.frame, reference, |row, column, terms| {
            let [x, y] = [column as f64 - x0, row as f64 - y0];
            let square = x * x + y * y;
            // Neighbours share most of their noise after the blur, so that fewer pixels lose
            // little.
            if square < radius * radius && (column + 7 * row).is_multiple_of(3) {
                rows.extend(terms());
                rows.extend([x / self.ball_px, y / self.ball_px]);
            // Nearer to the contact the free gel is not flat: it hangs from the rim.
            } else if square > 9.0 * radius * radius && (5 * column + 7 * row).is_multiple_of(31) {
                rows.extend(terms());
                rows.extend([0.0; 2]);
            }
        });
        Sums::of(&rows)
    }

    /// The patch of large colour differences, where nothing better is known.
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

    /// Centroid and radius of equal area of the largest patch of contact.
    fn found(&self, reference: &Blurred, coefficients: &[Vec<f64>; 2]) -> Option<[f64; 3]> {
        let touched = contact(&normals(&self.frame, reference, coefficients));
        let patch = parts(touched.view(), true)
            .into_iter()
            .max_by_key(Vec::len)?;
        let n = patch.len() as f64;
        let mean = |axis: usize| patch.iter().map(|at| at[axis] as f64).sum::<f64>() / n;
        Some(self.within([mean(1), mean(0), (n / core::f64::consts::PI).sqrt()]))
    }
}

/// The frame without contact is flat.
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

/// Circles and polynomial in turn. `None` for presses in which no contact is found.
fn find_circles(presses: &[Press], reference: &Blurred) -> Result<Vec<Option<[f64; 3]>>, GelError> {
    enough(presses.len())?;
    let flat = flat(reference);
    let starts = presses.iter().map(|press| {
        let circle = press.drawn.unwrap_or_else(|| press.start(reference));
        Some(press.within(circle)).filter(|circle| circle.iter().all(|v| v.is_finite()))
    });
    let mut circles: Vec<_> = starts.collect();
    for _ in 0..12 {
        let mut total = flat.clone();
        for (press, circle) in presses.iter().zip(&circles) {
            total.add(&press.sums(reference, *circle), 1.0);
        }
        let coefficients = total.solve()?;
        let found = presses
            .iter()
            .map(|press| press.found(reference, &coefficients));
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

/// Drawn circles against found ones, and the offset that the drawn ones share.
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
        // Where all circles are drawn well the median misfit is small. The second limit keeps them
        // right.
        let limit = (3.0 * usual).max(0.1 * press.ball_px);
        let shifted = found.map(|found| [0, 1, 2].map(|k| found[k] + offset[k]));
        CircleFinding {
            drawn_px: press.drawn,
            found_px: *found,
            // A press without a contact found still counts with the circle that the user drew.
            used_px: shifted.or(press.drawn).map(|circle| press.within(circle)),
            misfit_px,
            wrong: misfit_px.is_some_and(|misfit| misfit > limit),
        }
    };
    (pairs.map(judge).collect(), offset)
}

/// Differences between spheres and what is found without their press.
#[derive(Default)]
struct Misses {
    /// Of gradients, in units of their errors for a normal's error of 1.
    gradients: Vec<f64>,
    depths: Vec<f64>,
    angles: Vec<f64>,
}

impl Misses {
    fn add(
        &mut self,
        without: &GelSensor,
        press: &Press,
        [x0, y0, radius]: [f64; 3],
    ) -> Result<(), GelError> {
        let reading = without.read_blurred(&press.frame)?;
        // Depth counts from the contact circle: the cap's height less that of its rim.
        let rim = (press.ball_px.powi(2) - radius * radius).sqrt();
        for ((row, column), depth) in reading.depth_m.indexed_iter() {
            let [x, y] = [column as f64 - x0, row as f64 - y0];
            if x * x + y * y >= radius * radius {
                continue;
            }
            let up = (press.ball_px.powi(2) - x * x - y * y).sqrt();
            let truth = [-x / up, -y / up];
            let found = [0, 1].map(|k: usize| f64::from(reading.gradient[k][[row, column]]));
            let parts = reading.gradient_error.iter().zip(found.iter().zip(truth));
            for (error, (found, truth)) in parts {
                let unit = f64::from(error[[row, column]]);
                self.gradients.push((found - truth).abs() / unit);
            }
            self.depths
                .push((depth - without.model.pixel_size_m * (up - rim)).abs());
            let length = |[p, q]: [f64; 2]| (1.0 + p * p + q * q).sqrt();
            let cosine =
                (1.0 + found[0] * truth[0] + found[1] * truth[1]) / (length(found) * length(truth));
            // Rounding can take the cosine of equal normals above 1.
            self.angles.push(cosine.min(1.0).acos().to_degrees());
        }
        Ok(())
    }
}

/// A quantile of values, 0 without any.
fn quantile(values: &mut [f64], share: f64) -> f64 {
    let at = (share * values.len() as f64) as usize;
    if values.is_empty() {
        return 0.0;
    }
    *values
        .select_nth_unstable_by(at.min(values.len() - 1), f64::total_cmp)
        .1
}
