//! The field over one patch of pairs: an average over the processes that are likely there.

use super::process::{Data, Factor, Process, Shape};
use super::{Matrix4x3, Point, RowVector4, SMatrix, SVector};

mod evaluate;

/// Covariances that are tried, from long to short in each family, with lengths in radii of the
/// patch.
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

/// A shape whose log-likelihood is this far below the best ends its family, if it is no better than
/// the previous one.
const HOPELESS: f64 = 12.0;

/// Shorter lengths, in spacings, resolve nothing that the pairs contain.
const SHORTEST: f64 = 1.2;

/// λ = 4ᵏ, from the rounding of the covariances to fields that are almost affine.
const POWERS: std::ops::RangeInclusive<i32> = -19..=2;

/// Minimum number of pairs for a process. Fewer determine only an affine field with its error.
const FEWEST: usize = 16;

/// Processes with a likelihood below this fraction of the largest are excluded.
const LEAST_SHARE: f64 = 0.02;

/// Maximum number of processes in the average.
const MOST: usize = 6;

/// From this number of pairs on, shapes and noises are first determined with every other pair.
const MANY: usize = 100;

/// All shapes are tried in one of this number of patches; in the others, only those used in the
/// last.
const ROUND: usize = 4;

/// Relative extent, from rounding of coordinates, below which points count as lying on a line or a
/// plane.
const FLAT: f64 = 1e-6;

/// Pairs of a field.
#[derive(Clone, Copy)]
pub(super) struct Pairs<'a, const D: usize> {
    pub(super) sources: &'a [Point<f64, D>],
    pub(super) displacements: &'a [SVector<f64, D>],
    /// The minimum standard deviation of a coordinate, and the grain of the numbers.
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
    /// Orthonormal directions, with those that the points span first.
    frame: SMatrix<f64, D, D>,
    data: Data<D>,
    /// The least-squares affine field, in the frame.
    trend: Matrix4x3<f64>,
    factor: Factor,
    processes: Vec<Process<D>>,
    seen: usize,
    /// The processes in the average with their weights, the likeliest first.
    mixture: Vec<(usize, f64)>,
    /// The process whose factor was computed last.
    factored: usize,
    taken: usize,
    /// The λ and the weight of each shape in the last patch.
    last: [i32; SHAPES.len()],
    share: [f64; SHAPES.len()],
    /// Bᵢᵢ, and squared leave-one-out residuals over their variances along each axis.
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
    /// Stores pairs, and finds the likely processes.
    pub(super) fn take(&mut self, pairs: &Pairs<'_, D>, rows: impl Iterator<Item = usize>) {
        self.rows.clear();
        self.rows.extend(rows);
        if self.taken == 0 && self.rows.len() >= MANY {
            let all = self.rows.clone();
            self.rows.clear();
            self.rows.extend(all.iter().step_by(2));
            self.settle(pairs);
            self.rows = all;
        }
        self.settle(pairs);
        self.calibrate();
    }

    fn settle(&mut self, pairs: &Pairs<'_, D>) {
        self.gather(pairs);
        self.detrend();
        self.search();
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
        // In the plane the third axis has no extent, so its vector comes last.
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
        // Spacing of this number of points in a ball with this number of dimensions.
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

    /// Affine functions at a position, for the directions that the points span.
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

    /// Subtracts the least-squares affine field, on which likelihoods do not depend, so that the
    /// residuals of exact fields are rounded at their own size.
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
        // The second pass removes the rounding errors of the first.
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

    /// Finds the processes of the average. Leaves the factor of the likeliest.
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
        // Another process may have been evaluated last.
        self.factored = usize::MAX;
        if let Some(&(best, _)) = self.mixture.first() {
            self.refactor(best);
        }
    }

    /// The lowest energy of a shape, starting from the λ of the last patch or of the previous shape
    /// in its family. Keeps the processes on the way that are nearly as likely as the likeliest.
    fn climb(&mut self, s: usize, first: bool, least: &mut f64) -> f64 {
        self.factor.cover(&self.data.points, SHAPES[s]);
        if SHAPES[s] == Shape::Affine {
            return self.look(s, 0, least);
        }
        let new = self.taken == 0;
        let mut at = self.last[if new && !first { s - 1 } else { s }];
        let mut energy = self.look(s, at, least);
        // The first shape of the first patch uses large steps. Others start close to their λ.
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
            // The energy rises back towards the start.
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

    /// Compares each pair with the prediction by the others.
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

    /// Resets the search, so that the next patch is treated like the first.
    pub(super) fn forget_last(&mut self) {
        self.taken = 0;
        self.last = [-7; SHAPES.len()];
    }

    /// Gradient of the least-squares affine field.
    pub(super) fn trend(&self) -> SMatrix<f64, D, D> {
        SMatrix::from_fn(|d, a| (self.slope(a) * self.trend.column(d))[0] / self.radius)
    }

    /// Row of a source in the patch.
    pub(super) fn row_of(&self, source: usize) -> Option<usize> {
        self.rows.iter().position(|&row| row == source)
    }

    /// Squared distance of a pair from the prediction by the others over its variance, and the
    /// distance.
    pub(super) fn left_out(&self, row: usize) -> (f64, f64) {
        let squares = self.misfits[row];
        let Some(&(best, _)) = self.mixture.first() else {
            return (0.0, 0.0);
        };
        let distance = self.processes[best].weights[row].norm() / self.precisions[row];
        (squares.sum(), distance)
    }
}
