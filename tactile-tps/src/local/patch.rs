//! The field over one patch of pairs: an average over the processes that are likely there.

use super::process::{Data, Factor, Process, Shape};
use super::{LocalValue, Matrix4x3, Point, RowVector4, SMatrix, SVector};

/// Covariances that are tried, each family from long to short, lengths in radii of the patch.
const SHAPES: [Shape; 11] = [
    Shape::Affine,
    Shape::Gaussian(4.0),
    Shape::Gaussian(2.0),
    Shape::Gaussian(1.0),
    Shape::Gaussian(0.5),
    Shape::Gaussian(0.25),
    Shape::Matern5(2.0),
    Shape::Matern5(1.0),
    Shape::Matern5(0.5),
    Shape::Matern3(4.0),
    Shape::Matern3(1.0),
];

/// A shape that is so much less likely than the best ends its family, if it is no better than the
/// one before: in natural logarithms.
const HOPELESS: f64 = 12.0;

/// Shorter lengths, in spacings, resolve nothing that the pairs show.
const SHORTEST: f64 = 1.2;

/// λ = 4ᵏ, from the rounding of the covariances to fields that hardly differ from affine ones.
const POWERS: std::ops::RangeInclusive<i32> = -19..=2;

/// Fewer pairs show an affine field and its error.
const FEWEST: usize = 16;

/// Processes whose likelihood is a smaller share of the largest take no part.
const LEAST_SHARE: f64 = 0.02;

/// Processes that take part, at most.
const MOST: usize = 6;

/// Processes whose errors are averaged, at most.
const HEARD: usize = 3;

/// Smaller shares are not, but for that of the likeliest.
const LEAST_HEARD: f64 = 0.1;

/// Every so many patches all shapes are tried, in the others those that took part in the last.
const ROUND: usize = 4;

/// Pairs about a place whose residuals calibrate the errors there.
const NEARBY: f64 = 12.0;

/// Places that are evaluated together.
const TOGETHER: usize = 24;

/// Extents across which points are taken to lie in a line or a plane: the rounding of coordinates,
/// in the largest extent.
const FLAT: f64 = 1e-6;

/// Pairs of a field.
#[derive(Clone, Copy)]
pub(super) struct Pairs<'a, const D: usize> {
    pub(super) sources: &'a [Point<f64, D>],
    pub(super) displacements: &'a [SVector<f64, D>],
    /// The least standard deviation of a coordinate, and the grain of the numbers.
    pub(super) floor: f64,
    pub(super) grain: f64,
}

#[derive(Clone, Debug)]
pub(super) struct PairPatch<const D: usize> {
    pub(super) rows: Vec<usize>,
    centre: SVector<f64, D>,
    radius: f64,
    spacing: f64,
    grain: f64,
    /// Orthonormal directions, those that the points span first.
    frame: SMatrix<f64, D, D>,
    data: Data<D>,
    /// The affine field of least squares, in the frame.
    trend: Matrix4x3<f64>,
    factor: Factor,
    processes: Vec<Process<D>>,
    seen: usize,
    /// Those that take part, with their shares, the likeliest first.
    mixture: Vec<(usize, f64)>,
    /// The process whose factor was made last.
    factored: usize,
    taken: usize,
    /// The λ and the share of every shape in the last patch.
    last: [i32; SHAPES.len()],
    share: [f64; SHAPES.len()],
    /// Bᵢᵢ, and squared left-out residuals over their variances along each axis.
    precisions: Vec<f64>,
    misfits: Vec<SVector<f64, D>>,
    columns: Vec<f64>,
    kernels: Vec<(f64, f64)>,
}

impl<const D: usize> Default for PairPatch<D> {
    fn default() -> Self {
        Self {
            rows: Vec::new(),
            centre: SVector::zeros(),
            radius: 1.0,
            spacing: 1.0,
            grain: 0.0,
            frame: SMatrix::identity(),
            data: Data {
                points: Vec::new(),
                bases: Vec::new(),
                displacements: Vec::new(),
                rank: D,
                floor: 0.0,
            },
            trend: Matrix4x3::zeros(),
            factor: Factor::default(),
            processes: Vec::new(),
            seen: 0,
            mixture: Vec::new(),
            factored: usize::MAX,
            taken: 0,
            last: [-7; SHAPES.len()],
            share: [1.0; SHAPES.len()],
            precisions: Vec::new(),
            misfits: Vec::new(),
            columns: Vec::new(),
            kernels: Vec::new(),
        }
    }
}

impl<const D: usize> PairPatch<D> {
    /// Takes pairs, and finds the processes that are likely.
    pub(super) fn take(&mut self, pairs: &Pairs<'_, D>, rows: impl Iterator<Item = usize>) {
        self.rows.clear();
        self.rows.extend(rows);
        self.gather(pairs);
        self.detrend();
        self.search();
        self.calibrate();
    }

    /// Points about their mean, in radii, and the directions that they span.
    fn gather(&mut self, pairs: &Pairs<'_, D>) {
        let n = self.rows.len();
        let place = |&i: &usize| pairs.sources[i].coords;
        let origin = self.rows.first().map_or(SVector::zeros(), place);
        let offsets = self.rows.iter().map(|i| place(i) - origin);
        self.centre = origin + offsets.sum::<SVector<f64, D>>() / n.max(1) as f64;
        let centre = self.centre;
        let farthest = self.rows.iter().map(|i| (place(i) - centre).norm());
        let farthest = farthest.fold(0.0, f64::max);
        self.radius = if farthest > 0.0 { farthest } else { 1.0 };
        let radius = self.radius;
        let data = &mut self.data;
        data.points.clear();
        data.points
            .extend(self.rows.iter().map(|i| (place(i) - centre) / radius));
        data.displacements.clear();
        data.displacements
            .extend(self.rows.iter().map(|&i| pairs.displacements[i]));
        data.floor = pairs.floor * pairs.floor;
        self.grain = pairs.grain;
        let scatter: SMatrix<f64, 3, 3> = data.points.iter().fold(SMatrix::zeros(), |sum, p| {
            let p: SVector<f64, 3> = p.fixed_resize(0.0);
            sum + p * p.transpose()
        });
        let eigen = scatter.symmetric_eigen();
        let mut order: [usize; 3] = [0, 1, 2];
        // In the plane the third axis has no extent: its vector comes last.
        order.sort_unstable_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let largest = eigen.eigenvalues[order[0]];
        data.rank = 0;
        for (k, &axis) in order[..D].iter().enumerate() {
            let direction = eigen.eigenvectors.column(axis);
            self.frame
                .set_column(k, &direction.fixed_resize::<D, 1>(0.0));
            let extent = eigen.eigenvalues[axis];
            if extent > FLAT * FLAT * largest {
                data.rank += 1;
            }
        }
        if n < 2 {
            data.rank = 0;
        }
        let rank = data.rank as i32;
        // As many points in a ball of that many dimensions.
        let ball = [
            1.0,
            2.0,
            std::f64::consts::PI,
            4.0 / 3.0 * std::f64::consts::PI,
        ][data.rank];
        self.spacing = radius * (ball / n.max(1) as f64).powf(1.0 / f64::from(rank.max(1)));
        data.bases.clear();
        for k in 0..n {
            let basis = self.basis(&self.data.points[k]);
            self.data.bases.push(basis);
        }
    }

    /// Affine functions at a place, of the directions that the points span.
    fn basis(&self, place: &SVector<f64, D>) -> RowVector4<f64> {
        RowVector4::from_fn(|_, c| match c {
            0 => 1.0,
            _ if c <= self.data.rank => self.frame.column(c - 1).dot(place),
            _ => 0.0,
        })
    }

    /// Derivatives of the affine functions along an axis.
    fn slope(&self, axis: usize) -> RowVector4<f64> {
        RowVector4::from_fn(|_, c| match c {
            1.. if c <= self.data.rank => self.frame[(axis, c - 1)],
            _ => 0.0,
        })
    }

    /// Takes the affine field of least squares away, which likelihoods do not depend on: residuals
    /// of exact fields are rounded to their own size.
    fn detrend(&mut self) {
        let data = &mut self.data;
        self.trend = Matrix4x3::zeros();
        let mut normal = nalgebra::Matrix4::identity();
        let terms = data.rank + 1;
        normal.view_mut((0, 0), (terms, terms)).fill(0.0);
        for basis in &data.bases {
            normal += basis.transpose() * basis;
        }
        let Some(root) = normal.cholesky() else {
            return;
        };
        // The second pass takes what rounding left of the first.
        for _ in 0..2 {
            let mut moments = Matrix4x3::zeros();
            for (basis, z) in data.bases.iter().zip(&data.displacements) {
                (0..D).for_each(|d| moments.column_mut(d).axpy(z[d], &basis.transpose(), 1.0));
            }
            let trend = root.solve(&moments);
            self.trend += trend;
            for (basis, z) in data.bases.iter().zip(&mut data.displacements) {
                let own = basis * trend;
                (0..D).for_each(|d| z[d] -= own[d]);
            }
        }
    }

    /// Finds the processes that take part. Leaves the factor of the likeliest.
    fn search(&mut self) {
        self.seen = 0;
        self.mixture.clear();
        let n = self.rows.len();
        let shortest = SHORTEST * self.spacing / self.radius;
        let all = self.taken.is_multiple_of(ROUND);
        let mut least = f64::INFINITY;
        let mut before = None;
        for (s, &shape) in SHAPES.iter().enumerate() {
            let serves = match shape {
                Shape::Affine => true,
                Shape::Gaussian(length) | Shape::Matern5(length) | Shape::Matern3(length) => {
                    n >= FEWEST && length >= shortest
                }
            };
            if !serves || !all && self.share[s] <= LEAST_SHARE {
                continue;
            }
            let family = std::mem::discriminant(&shape);
            match before {
                Some((other, energy, last)) if other == family => {
                    if energy > least + HOPELESS && energy > last {
                        continue;
                    }
                }
                _ => before = None,
            }
            let energy = self.climb(s, before.is_none(), &mut least);
            let last = before.map_or(f64::INFINITY, |(_, last, _)| last);
            before = Some((family, energy, last));
        }
        self.taken += 1;
        let share = |process: &Process<D>| (least - process.energy).exp();
        let likely = self.processes[..self.seen].iter().map(share).enumerate();
        self.mixture
            .extend(likely.filter(|(_, share)| *share >= LEAST_SHARE));
        self.mixture
            .sort_unstable_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        self.mixture.truncate(MOST);
        let total: f64 = self.mixture.iter().map(|(_, share)| share).sum();
        self.mixture
            .iter_mut()
            .for_each(|(_, share)| *share /= total);
        if all {
            self.share = [0.0; SHAPES.len()];
        }
        for &(k, share) in &self.mixture {
            let shape = self.processes[k].shape;
            if let Some(s) = SHAPES.iter().position(|own| *own == shape) {
                self.share[s] = if all { self.share[s] + share } else { 1.0 };
            }
        }
        // Others may have been weighed last.
        self.factored = usize::MAX;
        if let Some(&(best, _)) = self.mixture.first() {
            self.refactor(best);
        }
    }

    /// The least energy of a shape, from the λ of the last patch, or of the last shape of its
    /// family. Keeps the processes on the way that are about as likely as the likeliest.
    fn climb(&mut self, s: usize, first: bool, least: &mut f64) -> f64 {
        self.factor.cover(&self.data.points, SHAPES[s]);
        if SHAPES[s] == Shape::Affine {
            return self.look(s, 0, least);
        }
        let new = self.taken == 0;
        let mut at = self.last[if new && !first { s - 1 } else { s }];
        let mut energy = self.look(s, at, least);
        // Large steps for the first shape of the first patch. Others start close to their λ.
        let steps = if new && first {
            &[-4, 4, -1, 1][..]
        } else {
            &[-1, 1]
        };
        for step in steps {
            let start = at;
            loop {
                let next = (at + step).clamp(*POWERS.start(), *POWERS.end());
                if next == at {
                    break;
                }
                let other = self.look(s, next, least);
                if other >= energy || other.is_nan() {
                    break;
                }
                (at, energy) = (next, other);
            }
            // It gets worse towards where it came from.
            if at != start && *step == -1 {
                break;
            }
        }
        self.last[s] = at;
        energy
    }

    /// Energy of a shape with λ = 4ᵏ.
    fn look(&mut self, s: usize, power: i32, least: &mut f64) -> f64 {
        if self.seen == self.processes.len() {
            self.processes.push(Process::default());
        }
        let process = &mut self.processes[self.seen];
        (process.shape, process.lambda) = (SHAPES[s], 4_f64.powi(power));
        self.factor.weigh(&self.data, process);
        let energy = process.energy;
        if energy <= *least - LEAST_SHARE.ln() {
            self.factor.solve(&self.data, process);
            self.seen += 1;
            *least = least.min(energy);
        }
        energy
    }

    /// Compares every pair with what the others predict.
    fn calibrate(&mut self) {
        self.misfits.clear();
        let Some(&(best, _)) = self.mixture.first() else {
            self.misfits.resize(self.rows.len(), SVector::zeros());
            self.precisions.clear();
            self.precisions.resize(self.rows.len(), 1.0);
            return;
        };
        self.factor.precisions(self.data.rank, &mut self.precisions);
        let process = &self.processes[best];
        let scale = process.scale.max(f64::MIN_POSITIVE);
        for (weight, precision) in process.weights.iter().zip(&mut self.precisions) {
            *precision = precision.max(f64::MIN_POSITIVE);
            let square = weight.component_mul(weight) / (*precision * scale);
            self.misfits.push(square);
        }
    }

    pub(super) fn degrees(&self) -> usize {
        self.data.degrees()
    }

    /// Lets the next patch be found as the first.
    pub(super) fn forget_last(&mut self) {
        self.taken = 0;
        self.last = [-7; SHAPES.len()];
    }

    /// Gradient of the affine field of least squares.
    pub(super) fn trend(&self) -> SMatrix<f64, D, D> {
        SMatrix::from_fn(|d, a| (self.slope(a) * self.trend.column(d))[0] / self.radius)
    }

    /// Row of a source in the patch.
    pub(super) fn row_of(&self, source: usize) -> Option<usize> {
        self.rows.iter().position(|&row| row == source)
    }

    /// Squared distance of a pair from what the others predict over its variance, and the distance.
    pub(super) fn left_out(&self, row: usize) -> (f64, f64) {
        let squares = self.misfits[row];
        let Some(&(best, _)) = self.mixture.first() else {
            return (0.0, 0.0);
        };
        let distance = self.processes[best].weights[row].norm() / self.precisions[row];
        (squares.sum(), distance)
    }

    /// By how much the variances are raised at a place: squared residuals of the pairs thereabouts,
    /// each left out in turn, over their variances, along the axis that has most.
    ///
    /// The likelihood's τ² is the mean of the patch under its covariance. A field that is steeper
    /// in a part of it, or of another shape, is further from its pairs there than the covariance
    /// allows (Bachoc, Comput. Stat. Data Anal. 66, 2013).
    fn raised(&self, place: &SVector<f64, D>) -> f64 {
        let n = self.rows.len() as f64;
        // Radius of weights whose effective number is that of the nearby pairs.
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
        // Only raised: few residuals that happen to be small do not prove small errors.
        let found: f64 = (sum / total).max();
        if found.is_finite() {
            found.max(1.0)
        } else {
            1.0
        }
    }

    /// Displacement and gradient at a place.
    fn mean_at(&self, place: &Point<f64, D>) -> (SVector<f64, D>, SMatrix<f64, D, D>) {
        let x = self.inside(place);
        average(
            self.mixture
                .iter()
                .map(|&(k, share)| (share, self.mean(k, &x))),
        )
    }

    /// Displacement and gradient of a process at a place, and those of the trend.
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

    /// The field at some places: O(n²) for each.
    pub(super) fn values(&mut self, places: &[Point<f64, D>], found: &mut Vec<LocalValue<D>>) {
        let Some(&(best, _)) = self.mixture.first() else {
            return found.extend(places.iter().map(|_| self.unknown()));
        };
        let first = found.len();
        let noise = self.processes[best].lambda * self.processes[best].scale;
        for place in places {
            let x = self.inside(place);
            let (displacement, gradient) = self.mean_at(place);
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
            // What the likely processes do not agree on.
            for &(k, share) in &self.mixture {
                let (u, h) = self.mean(k, &x);
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
        // Rounded numbers stand still over many spacings and then jump: their errors do not average
        // out within a patch.
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

    /// Makes the factor that of a process.
    fn refactor(&mut self, k: usize) {
        if self.factored != k {
            let process = &mut self.processes[k];
            self.factor.cover(&self.data.points, process.shape);
            self.factor.weigh(&self.data, process);
            self.factored = k;
        }
    }

    /// Adds the errors of a process, of which `share` is the share.
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

    /// Covariance of a row of the mean gradient over the points. The errors of one patch hang
    /// together.
    pub(super) fn of_mean(&mut self) -> SMatrix<f64, D, D> {
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

    /// Nothing is known along directions that the points do not span.
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

    /// The field of no pairs.
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

/// Variance over that of a Gaussian whose 95 % interval is as wide as that of Student's law, by the
/// expansion of Cornish and Fisher: 4 % less at two degrees, nothing from ten on.
fn student(degrees: usize) -> f64 {
    let v = (degrees.max(1)) as f64;
    let quantile = 1.96 + 2.372 / v + 2.823 / (v * v) + 2.556 / (v * v * v);
    (quantile / 1.96).powi(2)
}

impl<const D: usize> LocalValue<D> {
    /// As [`PairPatch::left_out`], of a pair that is not in the patch.
    pub(super) fn beside(&self, displacement: &SVector<f64, D>) -> (f64, f64) {
        let distance = (displacement - self.displacement).norm();
        let variance = self.displacement_variance + self.sigma * self.sigma;
        (
            distance * distance / variance.max(f64::MIN_POSITIVE),
            distance,
        )
    }
}
