//! Residuals below the resolution of the annealing: decides whether they are noise, and places the
//! points accordingly.

use super::run::Run;
use super::{difference, in_space, squared, squared_distance};
use crate::hard::nearest;
use crate::judgement::median_of_chi_squared;
use crate::kernels::cholesky;
use nalgebra::{Matrix4, Matrix4x3, RowVector4, SVector};
use tactile_core::{statistics::median, vectorised};

// An annealing run ends at a thousandth of the radius, because the factor of its prior has a
// truncation error of this size. The pairs are decided there, and the remaining residuals are
// either the rounding of clean data or noise. With hard pairs `zᵢ` the model is a full Gaussian
// process with a free affine part, `cov z = τ²(K + λ 1)`. Its restricted likelihood (Patterson &
// Thompson, Biometrika 58, 1971), with τ profiled out, depends only on λ and the shape of K:
//
// `−ln p = ½ [M ln S + D (ln det C + ln det PᵀC⁻¹P)]`, `C = K + λ 1`, `S = zᵀ B z`,
// `B = C⁻¹ − C⁻¹P (PᵀC⁻¹P)⁻¹ PᵀC⁻¹`, `M = D (n − D − 1)`.
//
// For clean data of a bending field the smallest λ is the likeliest, if necessary with a rough
// covariance.

/// Shapes of the covariance in the order of trial: Gaussians of a length in radii, and a Matérn
/// covariance whose fields have one derivative, for clean fields that no Gaussian resolves.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Shape {
    Gaussian(f64),
    Matern(f64),
}

const SHAPES: [Shape; 6] = [
    Shape::Gaussian(1.2),
    Shape::Gaussian(1.7),
    Shape::Gaussian(2.4),
    Shape::Gaussian(3.4),
    Shape::Gaussian(0.6),
    Shape::Matern(2.0),
];

/// Number of pairs whose likelihood decides about the noise: the 60 nearest to the centre. They
/// determine the noise to 7 %; twice as many take eight times as long.
pub(super) const PATCH: usize = 60;

/// Sets up to this size are fitted as a whole: their dense system takes a tenth of a second.
pub(super) const MAX_WHOLE: usize = 600;

/// λ = 4ᵏ, from the rounding of the covariances to a field that is affine compared with its noise.
const POWERS: std::ops::RangeInclusive<i32> = -20..=6;

impl Shape {
    fn covariance(self, square: f64) -> f64 {
        match self {
            Self::Gaussian(length) => (-0.5 * square / (length * length)).exp(),
            Self::Matern(length) => {
                let a = (3.0 * square).sqrt() / length;
                (1.0 + a) * (-a).exp()
            }
        }
    }
}

/// Working memory of the fit, and its result.
#[derive(Clone, Debug, Default)]
pub(super) struct FineFit<const D: usize> {
    /// Whether there is noise, also in sets that are too large to be fitted as a whole.
    pub(super) found: bool,
    /// Standard deviation of the noise along an axis. `None` before the search for noise.
    pub(super) sigma: Option<f64>,
    /// Variance of the positions along an axis. Empty if the positions do not come from the fit.
    pub(super) variance: Vec<f64>,
    pub(super) pairs: Vec<(usize, usize)>,
    sample: Vec<(usize, usize)>,
    distances: Vec<f64>,
    system: System<D>,
}

/// Model, its positions under a start, and targets.
type Sets<'a, const D: usize> = (&'a [[f64; D]], &'a [[f64; D]], &'a [[f64; D]]);

impl<const D: usize> FineFit<D> {
    pub(super) fn forget(&mut self) {
        (self.found, self.sigma) = (false, None);
        self.variance.clear();
    }

    /// Mutual nearest neighbours of warped points and targets, of all points or of those next to
    /// the centre. A pair must be nearer than `reach` or six times the median.
    pub(super) fn pair(
        &mut self,
        model: &[[f64; D]],
        warped: &[[f64; D]],
        target: &[[f64; D]],
        reach: f64,
    ) {
        self.pairs.clear();
        self.pairs.extend((0..model.len()).map(|i| (i, 0)));
        if model.len() > MAX_WHOLE {
            centre_first(model, &mut self.pairs, PATCH);
        }
        self.pairs.retain_mut(|pair| {
            let nearest = |place: &[f64; D], points: &[[f64; D]]| {
                nearest(points.iter().map(|p| squared_distance(place, p))).0
            };
            pair.1 = nearest(&warped[pair.0], target);
            nearest(&target[pair.1], warped) == pair.0
        });
        let apart = |&(i, j): &(usize, usize)| squared_distance(&warped[i], &target[j]);
        self.distances.clear();
        self.distances.extend(self.pairs.iter().map(apart));
        let limit = (36.0 * median(&mut self.distances)).max(reach * reach);
        self.pairs.retain(|pair| apart(pair) <= limit);
    }

    /// Whether the residuals of the pairs are noise. Pairs that contradict the others are dropped.
    /// The fit of all pairs stays in `system`.
    pub(super) fn are_noisy(&mut self, sets: Sets<'_, D>) -> bool {
        for _ in 0..3 {
            self.found = false;
            // Fewer pairs cannot separate noise from bending.
            if self.pairs.len() < 8 * (D + 1) {
                return false;
            }
            self.sample.clone_from(&self.pairs);
            centre_first(sets.0, &mut self.sample, PATCH);
            let Some(of_patch) = self.likeliest(sets) else {
                return false;
            };
            self.found = true;
            if sets.0.len() > MAX_WHOLE {
                return true;
            }
            let step = self.pairs.len().div_ceil(2 * PATCH);
            self.sample.clear();
            self.sample.extend(self.pairs.iter().step_by(step));
            let (shape, mut lambda) = self.likeliest(sets).unwrap_or(of_patch);
            self.system.take(sets, &self.pairs, shape);
            let energies = [0.5, 1.0, 2.0].map(|f| self.system.energy(f * lambda));
            if energies[0] < energies[1] {
                lambda *= 0.5;
            } else if energies[2] < energies[1] {
                lambda *= 2.0;
            }
            self.system.solve(lambda);
            self.sigma = Some(self.system.noise());
            if !self.drop_contradicted() {
                return true;
            }
        }
        true
    }

    /// Drops pairs whose residual exceeds the noise of the others. Returns whether any was dropped.
    fn drop_contradicted(&mut self) -> bool {
        let Self {
            system,
            pairs,
            distances,
            ..
        } = self;
        // λα has the variance σ²λB if the noise is σ².
        let misfit = |row: usize| squared(&system.weights[row]) / system.precision[row];
        distances.clear();
        distances.extend((0..pairs.len()).map(misfit));
        // By the median, one correct residual in a million is beyond five standard deviations.
        let limit = 25.0 / median_of_chi_squared(D) * D as f64 / 2.0 * median(distances);
        let (before, mut row) = (pairs.len(), 0);
        pairs.retain(|_| {
            row += 1;
            misfit(row - 1) <= limit
        });
        pairs.len() < before
    }

    /// Shape and λ of the largest likelihood over the sample. `None` if the data are clean.
    fn likeliest(&mut self, sets: Sets<'_, D>) -> Option<(Shape, f64)> {
        let (least, most) = (*POWERS.start(), *POWERS.end());
        let lambda = |k: i32| 4_f64.powi(k);
        let (mut best, mut clean) = ((f64::INFINITY, SHAPES[0], least), f64::INFINITY);
        for shape in SHAPES {
            self.system.take(sets, &self.sample, shape);
            // If the data are clean under the first shape, a few values of λ settle it.
            if shape == SHAPES[0] {
                let rough = [least, -17, -11, -2].map(|k| self.system.energy(lambda(k)));
                if !rough[0].is_finite() {
                    return None; // all on a line or a plane
                }
                if rough.is_sorted() {
                    self.sigma = Some(self.system.scale(lambda(least)));
                    return None;
                }
            }
            let mut of_shape = (self.system.energy(lambda(least)), least);
            clean = clean.min(of_shape.0);
            let mut consider = |k: i32| {
                let energy = self.system.energy(lambda(k.clamp(least, most)));
                if energy < of_shape.0 {
                    of_shape = (energy, k.clamp(least, most));
                }
                of_shape.1
            };
            let coarse = (least..=most).step_by(3).map(&mut consider).last();
            let centre = coarse.unwrap_or(least);
            consider(centre - 1);
            consider(centre + 1);
            if of_shape.0 < best.0 {
                best = (of_shape.0, shape, of_shape.1);
            }
        }
        let (energy, shape, k) = best;
        self.system.take(sets, &self.sample, shape);
        self.system.solve(lambda(k));
        let sigma = self.system.noise();
        self.sigma = Some(sigma);
        // Coordinates written with six digits have larger rounding errors. A likelihood ratio to
        // clean data below e⁵ is not significant.
        let noisy = k > least + 1 && sigma > 1e-6 && energy < clean - 5.0;
        noisy.then_some((shape, lambda(k)))
    }

    /// Moves the points to the positions of the fit.
    pub(super) fn place(&mut self, model: &[[f64; D]], run: &mut Run<D>) {
        let sigma = self.system.noise();
        self.sigma = Some(sigma);
        (run.sigma, run.noisy) = (sigma, true);
        self.variance.clear();
        for (i, point) in model.iter().enumerate() {
            let (displacement, variance) = self.system.predict(point);
            run.warped[i] = std::array::from_fn(|d| run.base[i][d] + displacement[d]);
            self.variance.push(sigma * sigma * variance);
        }
    }
}

/// Keeps the `count` pairs whose model points are nearest to the centre.
fn centre_first<const D: usize>(model: &[[f64; D]], pairs: &mut Vec<(usize, usize)>, count: usize) {
    if pairs.len() > count {
        pairs.select_nth_unstable_by(count, |&(a, _), &(b, _)| {
            squared(&model[a]).total_cmp(&squared(&model[b]))
        });
        pairs.truncate(count);
    }
}

/// The dense system of the fitted pairs.
#[derive(Clone, Debug, Default)]
struct System<const D: usize> {
    shape: Option<Shape>,
    lambda: f64,
    points: Vec<[f64; D]>,
    displacements: Vec<[f64; D]>,
    /// K, and the factor of C, row by row.
    kernel: Vec<f64>,
    factor: Vec<f64>,
    /// L⁻¹[P z].
    whitened: Vec<(RowVector4<f64>, SVector<f64, D>)>,
    inverse: Vec<f64>,
    normal: Matrix4<f64>,
    affine: Matrix4x3<f64>,
    /// α = B z, and the diagonal of B.
    weights: Vec<[f64; D]>,
    precision: Vec<f64>,
}

impl<const D: usize> System<D> {
    fn take(&mut self, (model, base, target): Sets<'_, D>, pairs: &[(usize, usize)], shape: Shape) {
        self.shape = Some(shape);
        self.points.clear();
        self.points.extend(pairs.iter().map(|&(i, _)| model[i]));
        self.displacements.clear();
        let displacement = |&(i, j): &(usize, usize)| difference(&target[j], &base[i]);
        self.displacements.extend(pairs.iter().map(displacement));
        let n = pairs.len();
        self.kernel.clear();
        self.kernel.resize(n * n, 0.0);
        for i in 0..n {
            for j in 0..=i {
                let square = squared_distance(&self.points[i], &self.points[j]);
                self.kernel[i * n + j] = shape.covariance(square);
            }
        }
    }

    /// The basis of the affine fields at a point, with unit vectors for the missing dimensions.
    fn basis(point: &[f64; D]) -> RowVector4<f64> {
        RowVector4::from_fn(|_, c| match c {
            0 => 1.0,
            _ => point.get(c - 1).copied().unwrap_or(0.0),
        })
    }

    /// Factors C and whitens. Returns the quadratic form S and the logarithm of both determinants.
    fn whiten(&mut self, lambda: f64) -> (f64, f64) {
        let n = self.points.len();
        self.lambda = lambda;
        self.factor.clone_from(&self.kernel);
        (0..n).for_each(|i| self.factor[i * n + i] += lambda);
        let factor = &mut self.factor;
        vectorised(
            #[inline(always)]
            || cholesky(factor, n),
        );
        self.whitened.clear();
        let mut normal = Matrix4::zeros();
        let (mut moments, mut squares, mut log_det) = (Matrix4x3::zeros(), 0.0, 0.0);
        for i in 0..n {
            let row = &self.factor[i * n..=i * n + i];
            let mut p = Self::basis(&self.points[i]);
            let mut z = SVector::from(self.displacements[i]);
            for (l, (pw, zw)) in row.iter().zip(&self.whitened) {
                p -= pw * *l;
                z -= zw * *l;
            }
            (p, z) = (p / row[i], z / row[i]);
            log_det += 2.0 * row[i].ln();
            normal += p.transpose() * p;
            squares += z.norm_squared();
            moments += p.transpose() * in_space(&z).transpose();
            self.whitened.push((p, z));
        }
        (D + 1..4).for_each(|c| normal[(c, c)] = 1.0);
        let Some(inverse) = normal.try_inverse() else {
            return (f64::INFINITY, 0.0); // all on a line or plane: no affine part
        };
        (self.normal, self.affine) = (inverse, inverse * moments);
        // A smaller value is rounding.
        let left = (squares - moments.dot(&self.affine)).max(1e-26);
        (left, log_det + normal.determinant().ln())
    }

    /// Standard deviation of the noise from the likelihood: τ√λ.
    fn scale(&mut self, lambda: f64) -> f64 {
        let degrees = ((self.points.len() - D - 1) * D) as f64;
        (self.whiten(lambda).0 * lambda / degrees).sqrt()
    }

    /// Negative logarithm of the restricted likelihood.
    fn energy(&mut self, lambda: f64) -> f64 {
        let degrees = (self.points.len() - D - 1) as f64;
        let (left, log_det) = self.whiten(lambda);
        0.5 * D as f64 * (degrees * left.ln() + log_det)
    }

    /// Computes α and the diagonal of B: `O(n³)`.
    fn solve(&mut self, lambda: f64) {
        let n = self.points.len();
        self.whiten(lambda);
        // Rows of L⁻ᵀ, one by one: C⁻¹ = L⁻ᵀ L⁻¹.
        self.precision.clear();
        self.weights.clear();
        let Self {
            factor,
            inverse,
            whitened,
            ..
        } = self;
        for k in 0..n {
            inverse.clear();
            inverse.resize(n, 0.0);
            let mut p = RowVector4::zeros();
            let mut z = SVector::<f64, D>::zeros();
            let mut square = 0.0;
            for i in k..n {
                let row = &factor[i * n..=i * n + i];
                let sum: f64 = row[k..i]
                    .iter()
                    .zip(&inverse[k..i])
                    .map(|(l, x)| l * x)
                    .sum();
                let value = (f64::from(u8::from(i == k)) - sum) / row[i];
                inverse[i] = value;
                square += value * value;
                p += whitened[i].0 * value;
                z += whitened[i].1 * value;
            }
            let affine = p * self.affine;
            self.weights.push(std::array::from_fn(|d| z[d] - affine[d]));
            let explained = (p * self.normal * p.transpose())[0];
            self.precision
                .push((square - explained).max(f64::MIN_POSITIVE));
        }
    }

    /// Standard deviation of the noise: residuals over the degrees of freedom of the fit.
    fn noise(&self) -> f64 {
        let squares: f64 = self.weights.iter().map(squared).sum();
        let free: f64 = self.precision.iter().sum();
        (self.lambda * squares / (D as f64 * free)).sqrt()
    }

    /// Displacement at a point, and its variance relative to the noise: `O(n²)`.
    fn predict(&mut self, point: &[f64; D]) -> ([f64; D], f64) {
        let n = self.points.len();
        let shape = self.shape.unwrap_or(SHAPES[0]);
        let Self {
            factor,
            inverse,
            whitened,
            points,
            ..
        } = self;
        inverse.clear();
        let mut basis = Self::basis(point);
        let own = basis * self.affine;
        let mut displacement: [f64; D] = std::array::from_fn(|d| own[d]);
        let mut variance = 1.0;
        for i in 0..n {
            let covariance = shape.covariance(squared_distance(point, &points[i]));
            for d in 0..D {
                displacement[d] += covariance * self.weights[i][d];
            }
            let row = &factor[i * n..=i * n + i];
            let sum: f64 = row[..i].iter().zip(&*inverse).map(|(l, x)| l * x).sum();
            let value = (covariance - sum) / row[i];
            inverse.push(value);
            variance -= value * value;
            basis -= whitened[i].0 * value;
        }
        let affine = (basis * self.normal * basis.transpose())[0];
        (displacement, (variance.max(0.0) + affine) / self.lambda)
    }
}
