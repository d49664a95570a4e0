//! The field and its errors at points of a patch.

use super::super::process::Shape;
use super::super::{LocalValue, Point, RowVector4, SMatrix, SVector};
use super::{FLAT, PairPatch};

/// Maximum number of processes whose errors are averaged.
const HEARD: usize = 3;

/// Minimum weight of such a process, except for the likeliest.
const LEAST_HEARD: f64 = 0.1;

/// Effective number of nearby pairs whose residuals calibrate the local errors.
const NEARBY: f64 = 12.0;

/// Number of points evaluated together.
const TOGETHER: usize = 24;

impl<const D: usize> PairPatch<D> {
    /// Factor by which the variances are increased at a point: squared leave-one-out residuals of
    /// the nearby pairs over their variances, along the axis with the largest ratio.
    ///
    /// The τ² of the likelihood is the mean over the patch under its covariance. If a field is
    /// steeper in a part of the patch, or has another shape, its pairs there deviate more than the
    /// covariance predicts (Bachoc, Comput. Stat. Data Anal. 66, 2013).
    fn raised(&self, place: &SVector<f64, D>) -> f64 {
        let n = self.rows.len() as f64;
        // Radius of weights whose effective number equals that of the nearby pairs.
        let reach = match D {
            2 => NEARBY / (4.0 * n),
            _ => (NEARBY / (10.6 * n)).powf(2.0 / 3.0),
        };
        let square = |p: &SVector<f64, D>| (p - place).norm_squared();
        let nearest = self
            .data
            .points
            .iter()
            .map(square)
            .fold(f64::INFINITY, f64::min);
        let (mut sum, mut total) = (SVector::<f64, D>::zeros(), 0.0);
        for (p, misfit) in self.data.points.iter().zip(&self.misfits) {
            let weight = (-0.5 * (square(p) - nearest) / reach).exp();
            sum += misfit * weight;
            total += weight;
        }
        // Only increased: a few residuals that are small by chance do not prove small errors.
        let found: f64 = (sum / total).max();
        if found.is_finite() {
            found.max(1.0)
        } else {
            1.0
        }
    }

    /// Displacement and gradient of a process at a point, and those of the trend.
    fn mean(&self, process: usize, x: &SVector<f64, D>) -> (SVector<f64, D>, SMatrix<f64, D, D>) {
        let process = &self.processes[process];
        let affine = self.trend + process.affine;
        let own = self.basis(x) * affine;
        let mut displacement = SVector::<f64, D>::from_fn(|d, _| own[d]);
        let mut gradient = SMatrix::<f64, D, D>::zeros();
        for a in 0..D {
            let slope = self.slope(a) * affine;
            (0..D).for_each(|d| gradient[(d, a)] = slope[d]);
        }
        if process.shape != Shape::Affine {
            for (p, weight) in self.data.points.iter().zip(&process.weights) {
                let offset = x - p;
                let (value, slope) = process.shape.of(offset.norm_squared());
                displacement += weight * value;
                gradient += weight * (offset * slope).transpose();
            }
        }
        (displacement, gradient / self.radius)
    }

    /// The field at several points: O(n²) for each.
    pub(in super::super) fn values(
        &mut self,
        places: &[Point<f64, D>],
        found: &mut Vec<LocalValue<D>>,
    ) {
        let Some(&(best, _)) = self.mixture.first() else {
            return found.extend(places.iter().map(|_| self.unknown()));
        };
        let first = found.len();
        let noise = self.processes[best].lambda * self.processes[best].scale;
        let mut means = Vec::with_capacity(self.mixture.len());
        for place in places {
            let x = self.inside(place);
            means.clear();
            let parts = self.mixture.iter();
            means.extend(parts.map(|&(k, share)| (share, self.mean(k, &x))));
            let (displacement, gradient) = average(means.iter().copied());
            let mut value = LocalValue {
                displacement,
                displacement_variance: 0.0,
                gradient,
                gradient_covariance: SMatrix::zeros(),
                rank: self.data.rank,
                sigma: noise.sqrt(),
                excess: self.raised(&x),
                spacing: self.spacing,
                unresolved: false,
            };
            // Variance between the likely processes.
            for &(share, (u, h)) in &means {
                let off = h - gradient;
                value.displacement_variance += share * (u - displacement).norm_squared() / D as f64;
                value.gradient_covariance += off.transpose() * off * (share / D as f64);
            }
            found.push(value);
        }
        let found = &mut found[first..];
        let count = self.mixture.iter().take(HEARD);
        let count = count.take_while(|(_, share)| *share >= LEAST_HEARD).count();
        let heard: f64 = self.mixture[..count].iter().map(|(_, share)| share).sum();
        for at in 0..count {
            let (k, share) = self.mixture[at];
            self.refactor(k);
            for (places, values) in places.chunks(TOGETHER).zip(found.chunks_mut(TOGETHER)) {
                self.add_errors(k, share / heard, places, values);
            }
        }
        // Rounded numbers are constant over many spacings and then jump, so their errors do not
        // average out within a patch.
        let steps = (0.5 * self.grain / self.radius).powi(2);
        for (place, value) in places.iter().zip(found) {
            let x = self.inside(place);
            let covariance = &mut value.gradient_covariance;
            (0..D).for_each(|a| covariance[(a, a)] = covariance[(a, a)].max(0.0) + steps);
            self.forget(&x, &mut value.displacement_variance, covariance);
        }
    }

    fn inside(&self, place: &Point<f64, D>) -> SVector<f64, D> {
        (place.coords - self.centre) / self.radius
    }

    /// Computes the factor of a process.
    pub(super) fn refactor(&mut self, k: usize) {
        if self.factored != k {
            let process = &mut self.processes[k];
            self.factor.cover(&self.data.points, process.shape);
            self.factor.weigh(&self.data, process);
            self.factored = k;
        }
    }

    /// Adds the errors of a process with the weight `share`.
    fn add_errors(
        &mut self,
        k: usize,
        share: f64,
        places: &[Point<f64, D>],
        values: &mut [LocalValue<D>],
    ) {
        let n = self.rows.len();
        let (shape, scale) = (self.processes[k].shape, self.processes[k].scale);
        let mut columns = std::mem::take(&mut self.columns);
        columns.clear();
        for place in places {
            let x = self.inside(place);
            self.kernels.clear();
            self.kernels.extend(
                self.data
                    .points
                    .iter()
                    .map(|p| shape.of((x - p).norm_squared())),
            );
            columns.extend(self.kernels.iter().map(|k| k.0));
            for a in 0..D {
                let rows = self.data.points.iter().zip(&self.kernels);
                columns.extend(rows.map(|(p, k)| (x[a] - p[a]) * k.1));
            }
        }
        if shape != Shape::Affine {
            self.factor.whiten(&mut columns);
        }
        let (at_zero, curvature) = shape.of(0.0);
        let rank = self.data.rank;
        let factor = share * scale * student(self.data.degrees());
        let columns_of = columns.chunks_exact((n * (D + 1)).max(1));
        for ((place, value), columns) in places.iter().zip(values).zip(columns_of) {
            let x = self.inside(place);
            let column = |c: usize| &columns[c * n..(c + 1) * n];
            let dot = |a: usize, b: usize| -> f64 {
                column(a).iter().zip(column(b)).map(|(a, b)| a * b).sum()
            };
            let rest = |c: usize| {
                let basis = if c == 0 {
                    self.basis(&x)
                } else {
                    self.slope(c - 1)
                };
                self.factor.unexplained(basis, column(c), rank)
            };
            let rests: [RowVector4<f64>; 4] =
                std::array::from_fn(|c| if c <= D { rest(c) } else { RowVector4::zeros() });
            let whole = at_zero - dot(0, 0) + self.factor.of_affine(&rests[0], &rests[0]);
            let covariance = SMatrix::<f64, D, D>::from_fn(|a, b| {
                let prior = if a == b { -curvature } else { 0.0 };
                let affine = self.factor.of_affine(&rests[a + 1], &rests[b + 1]);
                prior - dot(a + 1, b + 1) + affine
            });
            let factor = factor * value.excess;
            value.gradient_covariance += covariance * (factor / (self.radius * self.radius));
            value.displacement_variance += factor * whole.max(0.0);
        }
        self.columns = columns;
    }

    /// Covariance of a row of the mean gradient over the points. The errors within a patch are
    /// correlated.
    pub(in super::super) fn of_mean(&mut self) -> SMatrix<f64, D, D> {
        let n = self.rows.len();
        let Some(&(best, _)) = self.mixture.first() else {
            return SMatrix::from_element(f64::INFINITY);
        };
        self.refactor(best);
        let (shape, scale) = (self.processes[best].shape, self.processes[best].scale);
        let mut covariance = SMatrix::<f64, D, D>::zeros();
        self.columns.clear();
        self.columns.resize(n * D, 0.0);
        let share = 1.0 / n as f64;
        for i in 0..n {
            for j in 0..n {
                let d = self.data.points[j] - self.data.points[i];
                let square = d.norm_squared();
                let slope = shape.of(square).1;
                covariance -= d * d.transpose() * (share * share * shape.bend(square));
                for a in 0..D {
                    covariance[(a, a)] -= share * share * slope;
                    self.columns[a * n + i] += share * d[a] * slope;
                }
            }
        }
        self.factor.whiten(&mut self.columns);
        let column = |a: usize| &self.columns[a * n..(a + 1) * n];
        let rank = self.data.rank;
        let rest = |a: usize| self.factor.unexplained(self.slope(a), column(a), rank);
        for a in 0..D {
            for b in 0..D {
                let dot: f64 = column(a).iter().zip(column(b)).map(|(a, b)| a * b).sum();
                covariance[(a, b)] += self.factor.of_affine(&rest(a), &rest(b)) - dot;
            }
        }
        let raised = self.misfits.iter().sum::<SVector<f64, D>>().max() * share;
        let factor = scale * student(self.data.degrees()) * raised.max(1.0);
        covariance *= factor / (self.radius * self.radius);
        let steps = (0.5 * self.grain / self.radius).powi(2);
        (0..D).for_each(|a| covariance[(a, a)] = covariance[(a, a)].max(0.0) + steps);
        self.forget(&SVector::zeros(), &mut 0.0, &mut covariance);
        covariance
    }

    /// Sets infinite variances along directions that the points do not span.
    fn forget(&self, x: &SVector<f64, D>, variance: &mut f64, covariance: &mut SMatrix<f64, D, D>) {
        let rank = self.data.rank;
        if self.data.degrees() == 0 {
            *variance = f64::INFINITY;
            covariance.fill(f64::INFINITY);
        }
        for direction in self.frame.column_iter().skip(rank) {
            if direction.dot(x).abs() > FLAT {
                *variance = f64::INFINITY;
            }
            for a in 0..D {
                for b in 0..D {
                    if (direction[a] * direction[b]).abs() > FLAT * FLAT {
                        covariance[(a, b)] = f64::INFINITY;
                    }
                }
            }
        }
    }

    /// The field without pairs.
    fn unknown(&self) -> LocalValue<D> {
        LocalValue {
            displacement: SVector::zeros(),
            displacement_variance: f64::INFINITY,
            gradient: SMatrix::zeros(),
            gradient_covariance: SMatrix::from_element(f64::INFINITY),
            rank: 0,
            sigma: 0.0,
            excess: 1.0,
            spacing: 0.0,
            unresolved: false,
        }
    }
}

/// Displacement and gradient.
type Mean<const D: usize> = (SVector<f64, D>, SMatrix<f64, D, D>);

fn average<const D: usize>(means: impl Iterator<Item = (f64, Mean<D>)>) -> Mean<D> {
    means.fold(
        (SVector::zeros(), SMatrix::zeros()),
        |sum, (share, mean)| (sum.0 + mean.0 * share, sum.1 + mean.1 * share),
    )
}

/// Variance ratio of a Gaussian whose 95 % interval is as wide as that of Student's distribution,
/// by the Cornish–Fisher expansion. It is 4 % too small at two degrees of freedom, and accurate
/// from ten on.
fn student(degrees: usize) -> f64 {
    let v = (degrees.max(1)) as f64;
    let quantile = 1.96 + 2.372 / v + 2.823 / (v * v) + 2.556 / (v * v * v);
    (quantile / 1.96).powi(2)
}

impl<const D: usize> LocalValue<D> {
    /// Like [`PairPatch::left_out`], for a pair outside the patch.
    pub(in super::super) fn beside(&self, displacement: &SVector<f64, D>) -> (f64, f64) {
        let distance = (displacement - self.displacement).norm();
        let variance = self.displacement_variance + self.sigma * self.sigma;
        (
            distance * distance / variance.max(f64::MIN_POSITIVE),
            distance,
        )
    }
}
