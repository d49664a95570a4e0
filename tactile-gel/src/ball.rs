//! Estimates the size of the pressed ball from the light, and whether the face is a sphere or a
//! paraboloid.
//!
//! For a matt face far from shadows, the level of a channel is linear in the unit normal. The third
//! component of the normal follows from the other two. For a sphere
//! 1 − n_z is (s r)²/2 + (s r)⁴/8 + …, where s is the factor by which the ball is smaller than
//! stated. The ratio of both terms gives s. A frame simulated from Hertz's law shows a paraboloid.
//! Real gels are not perfectly matt, so the evidence counts only if the linear law leaves small
//! residuals.

use nalgebra::{DMatrix, DVector};

use crate::gradients::Blurred;

/// Shape of the face over a ball.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub enum BallFace {
    /// The ball itself: slopes r/√(R² − r²).
    Sphere,
    /// Hertz's law: slopes r/R.
    Paraboloid,
}

impl BallFace {
    /// Components n_x and n_y of the unit normal at a position in radii of the ball.
    pub fn normal(self, [x, y]: [f64; 2]) -> [f64; 2] {
        match self {
            Self::Sphere => [x, y],
            Self::Paraboloid => [x, y].map(|v| v / (1.0 + x * x + y * y).sqrt()),
        }
    }

    /// Depth below a rim of radius `rim` at a distance from the centre, in radii of the ball.
    pub fn depth(self, distance: f64, rim: f64) -> f64 {
        let up = |r: f64| match self {
            Self::Sphere => (1.0 - r * r).max(0.0).sqrt(),
            Self::Paraboloid => 1.0 - 0.5 * r * r,
        };
        up(distance) - up(rim)
    }
}

/// Tested factors by which the ball may be smaller than stated.
const FACTORS: [f64; 11] = [0.4, 0.5, 0.63, 0.8, 0.9, 1.0, 1.1, 1.25, 1.6, 2.0, 2.5];
/// Number of terms: the three components of the normal minus those of the flat face, times 1, x and
/// y.
const TERMS: usize = 9;
/// The linear law is accepted if its residuals are below this multiple of the noise variance.
const LINEAR: f64 = 2.0;
/// Another shape or size is accepted if its residuals are smaller than the stated one's by this
/// factor.
const EVIDENCE: f64 = 1.15;
/// Factors in this range around 1 raise no doubt, because light is not exactly linear.
const SURE: [f64; 2] = [0.75, 1.3];

/// Sums for one shape and factor.
struct Fit {
    face: BallFace,
    factor: f64,
    square: DMatrix<f64>,
    right: [DVector<f64>; 3],
}

/// Evidence over the presses of a calibration.
pub(crate) struct Evidence {
    fits: Vec<Fit>,
    levels: f64,
    count: f64,
    /// Squares of second differences of levels, for the noise.
    rough: Vec<f32>,
}

/// Shape of the face over the balls, and the factor by which they are smaller than stated if their
/// size is doubtful.
pub(crate) struct Verdict {
    pub face: BallFace,
    pub factor: Option<f64>,
}

impl Evidence {
    pub(crate) fn new() -> Self {
        let faces = [BallFace::Sphere, BallFace::Paraboloid];
        let each = faces
            .iter()
            .flat_map(|face| FACTORS.map(|factor| (*face, factor)));
        let fit = |(face, factor)| Fit {
            face,
            factor,
            square: DMatrix::zeros(TERMS, TERMS),
            right: core::array::from_fn(|_| DVector::zeros(TERMS)),
        };
        Self {
            fits: each.map(fit).collect(),
            levels: 0.0,
            count: 0.0,
            rough: Vec::new(),
        }
    }

    /// Adds the press in a circle. Lengths are in pixels.
    pub(crate) fn add(
        &mut self,
        frame: &Blurred,
        reference: &Blurred,
        circle: [f64; 3],
        ball_px: f64,
    ) {
        let [x0, y0, radius] = circle;
        let reach = 0.85 * radius.min(0.97 * ball_px);
        let (rows, columns) = frame.dim();
        let difference = |row: usize, column: usize| {
            [0, 1, 2].map(|k| {
                let [a, b] = [frame, reference].map(|image| image.line(k, row)[column]);
                (f64::from(a) - f64::from(b)) / 256.0
            })
        };
        let within = |v: f64, n: usize| (v.max(0.0) as usize).min(n);
        let down = within(y0 - reach, rows)..within(y0 + reach + 1.0, rows);
        for row in down {
            let across = within(x0 - reach, columns)..within(x0 + reach + 1.0, columns);
            for column in across {
                let [x, y] = [column as f64 - x0, row as f64 - y0];
                if x * x + y * y >= reach * reach || !(column + 2 * row).is_multiple_of(5) {
                    continue;
                }
                let level = difference(row, column);
                // Pixels at this distance share no noise.
                if column >= 5 && column + 5 < columns {
                    let beside = [difference(row, column - 5), difference(row, column + 5)];
                    let bend = |k: usize| beside[0][k] + beside[1][k] - 2.0 * level[k];
                    self.rough.extend([0, 1, 2].map(|k| bend(k).abs() as f32));
                }
                self.levels += level.iter().map(|v| v * v).sum::<f64>();
                self.count += 3.0;
                let place = [
                    1.0,
                    2.0 * column as f64 / columns as f64 - 1.0,
                    2.0 * row as f64 / rows as f64 - 1.0,
                ];
                for fit in &mut self.fits {
                    fit.add([x / ball_px, y / ball_px], place, level);
                }
            }
        }
    }

    pub(crate) fn verdict(mut self) -> Verdict {
        let stated = Verdict {
            face: BallFace::Sphere,
            factor: None,
        };
        // Second differences of noise have six times its variance, and the face is nearly straight
        // over three pixels.
        let noise = f64::from(crate::contacts::quantile(&mut self.rough, 0.5)) * 1.4826;
        let noise = (noise * noise / 6.0).max(0.01);
        let left = |fit: &Fit| fit.left(self.levels).map(|left| left / self.count);
        let all: Vec<(BallFace, f64, f64)> = self
            .fits
            .iter()
            .filter_map(|fit| Some((fit.face, fit.factor, left(fit)?)))
            .collect();
        let least = |wanted: &dyn Fn(&(BallFace, f64, f64)) -> bool| {
            let all = all.iter().copied().filter(|fit| wanted(fit));
            all.min_by(|a, b| a.2.total_cmp(&b.2))
        };
        let (Some(best), Some(sphere)) = (
            least(&|_| true),
            least(&|fit| fit.0 == BallFace::Sphere && fit.1 == 1.0),
        ) else {
            return stated;
        };
        if best.2 > LINEAR * noise {
            return stated;
        }
        let as_stated = least(&|fit| fit.1 == 1.0).unwrap_or(sphere);
        let beyond = best.1 < SURE[0] || best.1 > SURE[1];
        Verdict {
            face: match sphere.2 > EVIDENCE * as_stated.2 {
                true => as_stated.0,
                false => BallFace::Sphere,
            },
            factor: (beyond && as_stated.2 > EVIDENCE * best.2).then_some(best.1),
        }
    }
}

impl Fit {
    fn add(&mut self, [x, y]: [f64; 2], place: [f64; 3], level: [f64; 3]) {
        let at = [self.factor * x, self.factor * y];
        let [nx, ny] = self.face.normal(at);
        let up = 1.0 - nx * nx - ny * ny;
        // A ball of this size does not extend this far, which makes the fit worse.
        let components = [nx, ny, up.max(0.0).sqrt() - 1.0];
        let terms: [f64; TERMS] = core::array::from_fn(|k| components[k % 3] * place[k / 3]);
        for (i, a) in terms.iter().enumerate() {
            for (j, b) in terms.iter().enumerate() {
                self.square[(i, j)] += a * b;
            }
            for (right, level) in self.right.iter_mut().zip(level) {
                right[i] += a * level;
            }
        }
    }

    /// Residual sum of squares of the levels under the linear law.
    fn left(&self, levels: f64) -> Option<f64> {
        let factor = self.square.clone().cholesky()?;
        let explained: f64 = self.right.iter().map(|r| r.dot(&factor.solve(r))).sum();
        Some((levels - explained).max(0.0))
    }
}
