//! A Gaussian process over one patch of pairs.

use super::{LocalValue, Matrix4, Matrix4x3, Point, RowVector4, SMatrix, SVector};
use crate::lanes::{Job, Lane, dispatch};

// With `C = K + λ 1`, the affine functions P and the displacements Z the restricted likelihood, τ
// profiled out, is
//
// `−ln p = ½ [M ln S + D (ln det C + ln det PᵀC⁻¹P)]`, `S = tr ZᵀBZ`, `M = D (n − D − 1)`,
// `B = C⁻¹ − C⁻¹P (PᵀC⁻¹P)⁻¹ PᵀC⁻¹`.
//
// What the others predict for pair i is off by `(BZ)ᵢ/Bᵢᵢ`, whose variance is `τ²/Bᵢᵢ`.

/// Covariances by distance, in radii of the patch: Gaussian ones for fields that are smooth over
/// some spacings, and Matérn's of two derivatives for those that are not.
#[derive(Clone, Copy, Debug)]
enum Shape {
    Gaussian(f64),
    Matern(f64),
}

const SHAPES: [Shape; 4] = [
    Shape::Gaussian(0.5),
    Shape::Gaussian(1.0),
    Shape::Gaussian(2.0),
    Shape::Matern(2.0),
];

/// λ = 4ᵏ, from the rounding of the covariances to fields that are affine beside their noise.
const POWERS: std::ops::RangeInclusive<i32> = -19..=5;

/// Pairs in the middle of a patch whose residuals calibrate its errors, as many as a block has.
const MIDDLE: usize = 24;

impl Shape {
    /// k(r) and k'(r)/r, which at r = 0 is k''(0).
    fn of(self, square: f64) -> (f64, f64) {
        match self {
            Self::Gaussian(length) => {
                let s = 1.0 / (length * length);
                let value = (-0.5 * square * s).exp();
                (value, -value * s)
            }
            Self::Matern(length) => {
                let s = 5.0 / (length * length);
                let a = (square * s).sqrt();
                let decay = (-a).exp();
                (
                    (1.0 + a + a * a / 3.0) * decay,
                    -s / 3.0 * (1.0 + a) * decay,
                )
            }
        }
    }
}

#[derive(Clone, Debug)]
pub(super) struct Patch<const D: usize> {
    rows: Vec<usize>,
    centre: SVector<f64, D>,
    radius: f64,
    points: Vec<SVector<f64, D>>,
    displacements: Vec<SVector<f64, D>>,
    squares: Vec<f64>,
    kernel: Vec<f64>,
    /// Rows of the upper triangle.
    factor: Vec<f64>,
    shape: Shape,
    taken: usize,
    best: usize,
    /// The λ of every shape in the last patch.
    last: [i32; SHAPES.len()],
    /// U⁻ᵀ[P Z] and BZ.
    white: Vec<(RowVector4<f64>, SVector<f64, D>)>,
    weights: Vec<SVector<f64, D>>,
    normal: Matrix4<f64>,
    affine: Matrix4x3<f64>,
    /// τ².
    scale: f64,
    sigma: f64,
    column: Vec<f64>,
}

impl<const D: usize> Default for Patch<D> {
    fn default() -> Self {
        Self {
            rows: Vec::new(),
            centre: SVector::zeros(),
            radius: 1.0,
            points: Vec::new(),
            displacements: Vec::new(),
            squares: Vec::new(),
            kernel: Vec::new(),
            factor: Vec::new(),
            shape: SHAPES[0],
            taken: 0,
            best: 0,
            last: [-7; SHAPES.len()],
            white: Vec::new(),
            weights: Vec::new(),
            normal: Matrix4::identity(),
            affine: Matrix4x3::zeros(),
            scale: 0.0,
            sigma: 0.0,
            column: Vec::new(),
        }
    }
}

/// What a whitened linear functional of the process has: its values for affine functions that the
/// pairs do not explain, and itself.
struct White {
    basis: RowVector4<f64>,
    column: Vec<f64>,
}

impl<const D: usize> Patch<D> {
    /// Takes pairs, and chooses shape and λ.
    pub(super) fn take(
        &mut self,
        sources: &[Point<f64, D>],
        displacements: &[SVector<f64, D>],
        centre: &SVector<f64, D>,
        near: &[(f64, usize)],
    ) {
        let n = near.len();
        let farthest = near.last().map_or(0.0, |last| last.0.sqrt());
        self.centre = *centre;
        self.radius = if farthest > 0.0 { farthest } else { 1.0 };
        self.rows = near.iter().map(|near| near.1).collect();
        let inside = |&i: &usize| (sources[i].coords - centre) / self.radius;
        self.points = self.rows.iter().map(inside).collect();
        self.displacements = self.rows.iter().map(|&i| displacements[i]).collect();
        self.squares.clear();
        self.squares.resize(n * n, 0.0);
        for i in 0..n {
            for j in i..n {
                // The upper triangle alone. Distances serve all shapes and λ.
                self.squares[i * n + j] = (self.points[i] - self.points[j]).norm_squared();
            }
        }
        // Neighbouring patches mostly have the same shape: all are tried in every fourth.
        let all = self.taken.is_multiple_of(4);
        let (last, mut best) = (self.best, (f64::INFINITY, self.best));
        for s in (0..SHAPES.len()).filter(|&s| all || s == last) {
            let energy = self.climb(s);
            if energy < best.0 {
                best = (energy, s);
            }
        }
        self.best = best.1;
        self.taken += 1;
        self.choose(SHAPES[self.best]);
        // Other shapes may have been tried last: factor and columns are made again.
        self.energy(4_f64.powi(self.last[self.best]));
        self.solve();
    }

    /// The least energy of a shape, from the λ of the last patch.
    fn climb(&mut self, s: usize) -> f64 {
        self.choose(SHAPES[s]);
        let (least, most) = (*POWERS.start(), *POWERS.end());
        let mut at = self.last[s];
        let mut energy = self.energy(4_f64.powi(at));
        // Large steps for the first patch. Later ones start at their neighbour's λ, which is close.
        let steps = if self.taken == 0 {
            &[-4, 4, -1, 1][..]
        } else {
            &[-1, 1]
        };
        for step in steps {
            loop {
                let next = (at + step).clamp(least, most);
                if next == at {
                    break;
                }
                let other = self.energy(4_f64.powi(next));
                if other >= energy {
                    break;
                }
                (at, energy) = (next, other);
            }
        }
        self.last[s] = at;
        energy
    }

    /// Fills the covariances of a shape.
    fn choose(&mut self, shape: Shape) {
        let n = self.points.len();
        self.shape = shape;
        self.kernel.resize(n * n, 0.0);
        for i in 0..n {
            let upper = i * n + i..(i + 1) * n;
            let squares = &self.squares[upper.clone()];
            for (k, &square) in self.kernel[upper].iter_mut().zip(squares) {
                *k = shape.of(square).0;
            }
        }
    }

    /// Row of a source in the patch.
    pub(super) fn row_of(&self, source: usize) -> Option<usize> {
        self.rows.iter().position(|&row| row == source)
    }

    /// Affine functions at a place. The dimensions that it lacks have none.
    fn basis(place: &SVector<f64, D>) -> RowVector4<f64> {
        RowVector4::from_fn(|_, c| match c {
            0 => 1.0,
            _ => place.as_slice().get(c - 1).copied().unwrap_or(0.0),
        })
    }

    /// Minus the logarithm of the restricted likelihood. Leaves factor and whitened columns.
    fn energy(&mut self, lambda: f64) -> f64 {
        let n = self.points.len();
        self.factor.clone_from(&self.kernel);
        (0..n).for_each(|i| self.factor[i * n + i] += lambda);
        let log_det = dispatch(Factorise {
            matrix: &mut self.factor,
            n,
        });
        self.white.clear();
        let rows = self.points.iter().zip(&self.displacements);
        self.white.extend(rows.map(|(p, z)| (Self::basis(p), *z)));
        let (mut normal, mut moments, mut squares) = (Matrix4::zeros(), Matrix4x3::zeros(), 0.0);
        for k in 0..n {
            let row = &self.factor[k * n..(k + 1) * n];
            let (p, z) = (self.white[k].0 / row[k], self.white[k].1 / row[k]);
            self.white[k] = (p, z);
            for (u, white) in row[k + 1..].iter().zip(&mut self.white[k + 1..]) {
                white.0 -= p * *u;
                white.1 -= z * *u;
            }
            normal += p.transpose() * p;
            for d in 0..D {
                moments.column_mut(d).axpy(z[d], &p.transpose(), 1.0);
            }
            squares += z.norm_squared();
        }
        // Directions that the points do not span take no part.
        let tiny = 1e-12 * normal[(0, 0)].max(f64::MIN_POSITIVE);
        for c in 0..4 {
            if c > D || normal[(c, c)] <= tiny {
                normal.row_mut(c).fill(0.0);
                normal.column_mut(c).fill(0.0);
                moments.row_mut(c).fill(0.0);
                normal[(c, c)] = 1.0;
            }
        }
        let Some(inverse) = normal.try_inverse() else {
            return f64::INFINITY;
        };
        (self.normal, self.affine) = (inverse, inverse * moments);
        let degrees = (D * n.saturating_sub(D + 1)).max(1) as f64;
        // Less than this is the rounding of displacements.
        let largest = self
            .displacements
            .iter()
            .map(|z| z.amax())
            .fold(0.0, f64::max);
        let rounding = (1e-13 * largest).powi(2).max(f64::MIN_POSITIVE);
        let left = (squares - moments.dot(&self.affine)).max(rounding);
        self.scale = left / degrees;
        self.sigma = (self.scale * lambda).sqrt();
        0.5 * (degrees * left.ln() + D as f64 * (log_det + normal.determinant().ln()))
    }

    /// BZ from the whitened columns.
    fn solve(&mut self) {
        let n = self.points.len();
        self.weights.clear();
        self.weights.resize(n, SVector::zeros());
        for k in (0..n).rev() {
            let row = &self.factor[k * n..(k + 1) * n];
            let (p, z) = &self.white[k];
            let explained = p * self.affine;
            let mut value = SVector::<f64, D>::from_fn(|d, _| z[d] - explained[d]);
            for (u, weight) in row[k + 1..].iter().zip(&self.weights[k + 1..]) {
                value -= weight * *u;
            }
            self.weights[k] = value / row[k];
        }
    }

    /// U⁻ᵀ of columns, and of each basis what the pairs do not explain.
    fn whitened<const C: usize>(
        &self,
        mut columns: [Vec<f64>; C],
        bases: [RowVector4<f64>; C],
    ) -> [White; C] {
        dispatch(Forward {
            factor: &self.factor,
            columns: columns.each_mut().map(|column| &mut column[..]),
        });
        let mut bases = bases.into_iter();
        columns.map(|column| {
            let mut basis = bases.next().unwrap_or_default();
            for (white, value) in self.white.iter().zip(&column) {
                basis -= white.0 * *value;
            }
            White { basis, column }
        })
    }

    fn product(&self, a: &White, b: &White) -> f64 {
        let dot: f64 = a.column.iter().zip(&b.column).map(|(a, b)| a * b).sum();
        // Variance of the affine part that the pairs leave open, less what they explain of the
        // process.
        (a.basis * self.normal * b.basis.transpose())[0] - dot
    }

    /// The field at a place: O(n²).
    pub(super) fn value(&self, place: &Point<f64, D>) -> LocalValue<D> {
        let x = (place.coords - self.centre) / self.radius;
        let offsets: Vec<SVector<f64, D>> = self.points.iter().map(|p| x - p).collect();
        let kernels: Vec<(f64, f64)> = offsets
            .iter()
            .map(|o| self.shape.of(o.norm_squared()))
            .collect();
        let basis = Self::basis(&x);
        let own = basis * self.affine;
        let mut displacement = SVector::<f64, D>::from_fn(|d, _| own[d]);
        let mut gradient = SMatrix::<f64, D, D>::from_fn(|d, a| self.affine[(a + 1, d)]);
        for ((offset, kernel), weight) in offsets.iter().zip(&kernels).zip(&self.weights) {
            displacement += weight * kernel.0;
            gradient += weight * offset.transpose() * kernel.1;
        }
        let [whole] = self.whitened([kernels.iter().map(|k| k.0).collect()], [basis]);
        let along = |a: usize| {
            let slopes = offsets.iter().zip(&kernels).map(|(o, k)| o[a] * k.1);
            slopes.collect::<Vec<_>>()
        };
        let axis = |a: usize| RowVector4::from_fn(|_, c| f64::from(u8::from(c == a + 1)));
        let slopes: [White; D] =
            self.whitened(std::array::from_fn(along), std::array::from_fn(axis));
        let (at_zero, curvature) = self.shape.of(0.0);
        let covariance = SMatrix::<f64, D, D>::from_fn(|a, b| {
            let prior = if a == b { -curvature } else { 0.0 };
            prior + self.product(&slopes[a], &slopes[b])
        });
        let n = self.points.len() as f64;
        // Volume of the unit ball over that of a cube.
        let ball = std::f64::consts::PI * if D == 2 { 1.0 } else { 4.0 / 3.0 };
        LocalValue {
            displacement,
            displacement_variance: self.scale * (at_zero + self.product(&whole, &whole)).max(0.0),
            gradient: gradient / self.radius,
            // Lengths are in radii of the patch, so that a derivative has one over the radius.
            gradient_covariance: covariance * (self.scale / (self.radius * self.radius)),
            sigma: self.sigma,
            spacing: self.radius * (ball / n).powf(1.0 / D as f64),
        }
    }

    /// Squared distance of a pair of the patch from what the others predict over its variance, and
    /// the distance.
    pub(super) fn left_out(&mut self, row: usize) -> (f64, f64) {
        let (precision, scale) = (self.precision(row), self.scale.max(f64::MIN_POSITIVE));
        let weight = self.weights[row].norm();
        (weight * weight / (precision * scale), weight / precision)
    }

    /// Bᵢᵢ.
    fn precision(&mut self, row: usize) -> f64 {
        let mut column = std::mem::take(&mut self.column);
        column.clear();
        column.resize(self.points.len(), 0.0);
        column[row] = 1.0;
        let [white] = self.whitened([column], [RowVector4::zeros()]);
        let square: f64 = white.column.iter().map(|c| c * c).sum();
        let explained = (white.basis * self.normal * white.basis.transpose())[0];
        self.column = white.column;
        // From the whitened unit vector of the pair.
        (square - explained).max(f64::MIN_POSITIVE)
    }

    /// Raises τ² to what the pairs in the middle have, each left out in turn, along the axis that
    /// has most: a dimple moves points along one.
    ///
    /// The likelihood's τ² is the mean of the patch under its covariance. A field that is steeper
    /// in the middle, or of another shape, is further from its pairs there than the covariance
    /// allows (Bachoc, Comput. Stat. Data Anal. 66, 2013).
    pub(super) fn calibrate(&mut self) {
        // Nearest first.
        let middle = MIDDLE.min(self.points.len());
        let mut misfits = SVector::<f64, D>::zeros();
        for row in 0..middle {
            let precision = self.precision(row);
            misfits += self.weights[row].component_mul(&self.weights[row]) / precision;
        }
        let ratio = misfits.max() / (middle as f64 * self.scale.max(f64::MIN_POSITIVE));
        if ratio.is_finite() {
            // Only raised: few residuals that happen to be small do not prove small errors.
            self.scale *= ratio.max(1.0);
        }
    }
}

impl<const D: usize> LocalValue<D> {
    /// As [`Patch::left_out`], of a pair that is not in the patch.
    pub(super) fn beside(&self, displacement: &SVector<f64, D>) -> (f64, f64) {
        let distance = (displacement - self.displacement).norm();
        let variance = self.displacement_variance + self.sigma * self.sigma;
        let misfit = distance * distance / variance.max(f64::MIN_POSITIVE);
        (misfit, distance)
    }
}

/// The upper triangle U of `A = UᵀU` in place, row by row, and the logarithm of the determinant.
/// Rounding is caught by a floor.
struct Factorise<'a> {
    matrix: &'a mut [f64],
    n: usize,
}

/// Rows that are eliminated together: each pass over the rest then does four times the work.
const TOGETHER: usize = 4;

impl Job for Factorise<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<L: Lane>(self) -> f64 {
        let Self { matrix, n } = self;
        let mut log_det = 0.0;
        for first in (0..n).step_by(TOGETHER) {
            let end = n.min(first + TOGETHER);
            let (done, rest) = matrix.split_at_mut(end * n);
            let rows = &mut done[first * n..];
            for k in first..end {
                let (row, below) = rows[(k - first) * n..].split_at_mut(n);
                // The diagonal of the covariances is at least 1. A pivot at the floor is rounding
                // alone.
                let root = row[k].max(1e-15).sqrt();
                log_det += 2.0 * root.ln();
                row[k] = root;
                row[k + 1..].iter_mut().for_each(|u| *u /= root);
                for (i, next) in (k + 1..end).zip(below.chunks_exact_mut(n)) {
                    subtract(&mut next[i..], row[i], &row[i..]);
                }
            }
            for (i, below) in (end..n).zip(rest.chunks_exact_mut(n)) {
                let [a, b, c, d] = std::array::from_fn(|k| &rows[k * n + i..(k + 1) * n]);
                let (fa, fb, fc, fd) = (a[0], b[0], c[0], d[0]);
                let pairs = a.iter().zip(b).zip(c.iter().zip(d));
                for (x, ((a, b), (c, d))) in below[i..].iter_mut().zip(pairs) {
                    *x -= (fa * a + fb * b) + (fc * c + fd * d);
                }
            }
        }
        log_det
    }
}

/// `x − f a`.
#[inline(always)]
fn subtract(x: &mut [f64], f: f64, a: &[f64]) {
    for (x, a) in x.iter_mut().zip(a) {
        *x -= f * a;
    }
}

/// U⁻ᵀ of some columns.
struct Forward<'a, const C: usize> {
    factor: &'a [f64],
    columns: [&'a mut [f64]; C],
}

impl<const C: usize> Job for Forward<'_, C> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lane>(mut self) {
        let n = self.columns.first().map_or(0, |column| column.len());
        for (k, row) in self.factor.chunks_exact(n.max(1)).enumerate() {
            for column in &mut self.columns {
                let value = column[k] / row[k];
                column[k] = value;
                if value == 0.0 {
                    continue; // unit vectors begin with zeros
                }
                subtract(&mut column[k + 1..], value, &row[k + 1..]);
            }
        }
    }
}
