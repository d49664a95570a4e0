//! Motions of the parts of a set before any match: peaks of the differences between blocks and
//! targets.

use super::cells::Cells;
use super::{difference, squared_distance};
use crate::Watch;
use nalgebra::{SMatrix, SVector};
use std::f64::consts::PI;
use std::ops::ControlFlow;
use tactile_core::statistics::quantile;

// Among all differences `tⱼ − xᵢ` between a block of neighbours and the targets, those of correct
// pairs cluster at one vector, the motion of the block. All others are distributed as evenly as the
// targets. The first blocks search far; each later block searches near the prediction from its
// neighbours. Motions of many spacings are thus followed from block to block
// [as in image velocimetry: Scarano, *Iterative image deformation methods in PIV*, Meas. Sci.
// Technol. 13 (2002)]. Among equal peaks, such as those of a lattice, the one of least motion is
// taken.

/// Points per block, for sets of six blocks and more. A true peak then exceeds the differences to
/// other points by ten of their standard deviations, and a strain of a tenth does not blur it.
const BLOCK: usize = 320;
const BLOCKS: usize = 6;
/// Number of blocks that contain each point: their motions support a field that bends within a
/// block.
const OVERLAP: usize = 4;
/// Minimum number of points whose common motion is searched.
const FEWEST: usize = 12;
/// Sets up to this size are one block.
const ONE_BLOCK: usize = 500;
/// Number of blocks that search far: it is unlikely that all of them lie where a field bends most.
const PROBES: usize = 12;
/// Their search distance, in radii of the model and, to limit the time, in spacings for the plane
/// and for space.
const FAR: f64 = 0.35;
const FAR_SPACINGS: [f64; 2] = [150.0, 20.0];
/// Search distance of a block from the prediction of its neighbours, in spacings.
const NEAR: f64 = 3.0;
/// Histogram cells per spacing. Three cells, one spacing, are summed.
const CELLS: f64 = 3.0;
/// Minimum height of a peak above the next one, in standard deviations of its count: by chance one
/// place in three thousand exceeds 2.0, and one in a hundred 1.2. The differences of surfaces
/// cluster along a sheet, so their peaks are no higher than the neighbouring ones.
const FAR_HEIGHT: f64 = 2.0;
const NEAR_HEIGHT: f64 = 1.2;
/// Cells within which peaks count as one: the range of the sum.
const APART: usize = 3;
/// Fraction of the smaller set that a common motion of all points must pair.
const COMMON: f64 = 0.6;
/// Peaks of at least this fraction of the highest count as equal. For a lattice of 400 points the
/// second peak has 95 % of the height of the first.
const EQUAL: f64 = 0.97;
/// Rounds in which the motion of a block is refined with its pairs. Wrong targets among them slow
/// the convergence: each round halves the error.
const ROUNDS: usize = 4;
/// Weight of the prior of zero gradient, as a fraction of the spread of the block's points.
const RIDGE: f64 = 0.02;
/// Fraction of the blocks that must agree on a field.
const AGREEING: f64 = 0.6;
/// Number of retries for a block without a peak, with more neighbours each time.
const TRIES: u8 = 3;

/// Two sets coincide if four in five points have a target within this distance, in spacings. By
/// chance one in eight has.
const LIES: f64 = 0.2;
/// Number of points whose nearest-target distances measure how well motions place the sets.
const SAMPLE: usize = 2000;
/// Minimum fraction of the points that have a target.
const PRESENT: f64 = 0.8;

/// The centre of a block, with its motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seed<const D: usize> {
    /// The model row at the centre.
    pub(super) row: usize,
    /// The displacement field about the centre.
    motion: Option<Local<D>>,
    /// Squared distance from the nearest block with a known motion.
    distance: f64,
    tries: u8,
}

impl<const D: usize> Seed<D> {
    /// Motion of the centre.
    pub(super) fn value(&self) -> Option<SVector<f64, D>> {
        self.motion.map(|motion| motion.value)
    }
}

/// Working memory of the motions.
#[derive(Clone, Debug, Default)]
pub(super) struct Motions<const D: usize> {
    /// Blocks with their motions.
    pub(super) seeds: Vec<Seed<D>>,
    model: Cells<D>,
    targets: Cells<D>,
    /// Rows of the current block.
    block: Vec<usize>,
    counts: Vec<u32>,
    sums: Vec<u32>,
    misses: Vec<f64>,
    /// Number of points per block, and the radius of the last block.
    wanted: usize,
    radius: f64,
}

/// A linear field about a point: its value there and its gradient.
#[derive(Clone, Copy, Debug)]
struct Local<const D: usize> {
    at: SVector<f64, D>,
    value: SVector<f64, D>,
    gradient: SMatrix<f64, D, D>,
}

impl<const D: usize> Local<D> {
    fn still(at: &[f64; D]) -> Self {
        Self {
            at: SVector::from(*at),
            value: SVector::zeros(),
            gradient: SMatrix::zeros(),
        }
    }

    fn value_at(&self, p: &SVector<f64, D>) -> SVector<f64, D> {
        self.value + self.gradient * (p - self.at)
    }

    fn move_point(&self, p: &[f64; D]) -> [f64; D] {
        let p = SVector::from(*p);
        (p + self.value_at(&p)).into()
    }
}

impl<const D: usize> Motions<D> {
    /// Finds the motions of blocks of `still`, the unmoved model, whose rows `order` sorts so that
    /// any stride of them is well spread. `spacing` is the mean distance of neighbours, and
    /// `farthest` bounds the motions. Returns `false` if the blocks do not agree on a field.
    pub(super) fn find(
        &mut self,
        (still, target): (&[[f64; D]], &[[f64; D]]),
        order: &[usize],
        spacing: f64,
        farthest: f64,
        watch: Watch<'_>,
    ) -> ControlFlow<(), bool> {
        const NONE: ControlFlow<(), bool> = ControlFlow::Continue(false);
        self.seeds.clear();
        let smaller = still.len().min(target.len());
        if smaller < FEWEST || !(spacing > 0.0 && spacing.is_finite()) {
            return NONE;
        }
        let most = FAR_SPACINGS[usize::from(D > 2)] * spacing;
        let far = FAR.min(most).min(farthest).max(1.5 * spacing);
        self.targets.build(target, 1.5 * spacing);
        let seed = |row| Seed {
            row,
            motion: None,
            distance: f64::INFINITY,
            tries: 0,
        };
        if smaller < ONE_BLOCK {
            self.block.clear();
            self.block.extend(0..still.len());
            let here = Local::still(&still[0]);
            let peak = self.peak(still, target, &here, far, spacing);
            let Some((motion, _)) = peak.filter(|(_, peak)| peak.pairs >= COMMON * smaller as f64)
            else {
                return NONE;
            };
            self.seeds.push(seed(0));
            self.seeds[0].motion = Some(motion);
            return ControlFlow::Continue(true);
        }
        self.wanted = BLOCK.min(still.len() / BLOCKS);
        self.radius = spacing * (self.wanted as f64 / PI).powf(1.0 / D as f64);
        let rows = order.iter().step_by(self.wanted / OVERLAP);
        self.seeds.extend(rows.map(|&row| seed(row)));
        if self.miss(still, target, spacing) <= LIES * spacing {
            // In a lattice no peak would stand out.
            for seed in &mut self.seeds {
                seed.motion = Some(Local::still(&still[seed.row]));
            }
            return ControlFlow::Continue(true);
        }
        self.model.build(still, 1.5 * spacing);
        let step = (self.seeds.len() / PROBES).max(1);
        let mut best = (FAR_HEIGHT, None);
        for k in (0..self.seeds.len()).step_by(step) {
            watch()?;
            let row = self.seeds[k].row;
            self.gather(still, row);
            let here = Local::still(&still[row]);
            let found = self.peak(still, target, &here, far, spacing);
            if let Some((motion, peak)) = found.filter(|(_, peak)| peak.height > best.0) {
                best = (peak.height, Some((k, motion)));
            }
        }
        let Some((k, motion)) = best.1 else {
            return NONE;
        };
        self.settle(still, k, motion);
        while let Some(k) = self.next() {
            watch()?;
            let row = self.seeds[k].row;
            self.gather(still, row);
            let here = self.predict(still, row);
            let found = self.peak(still, target, &here, NEAR * spacing, spacing);
            match found.filter(|(_, peak)| peak.height > NEAR_HEIGHT) {
                Some((motion, _)) => self.settle(still, k, motion),
                None => self.seeds[k].tries += 1,
            }
        }
        let total = self.seeds.len();
        self.seeds.retain(|seed| seed.motion.is_some());
        ControlFlow::Continue(self.seeds.len() as f64 >= AGREEING * total as f64)
    }

    /// Distance to their nearest targets that four in five of the moved points do not exceed, up to
    /// half a spacing. A fifth of the points may be missing.
    pub(super) fn miss(&mut self, moved: &[[f64; D]], target: &[[f64; D]], spacing: f64) -> f64 {
        let Self {
            misses, targets, ..
        } = self;
        let step = moved.len().div_ceil(SAMPLE).max(1);
        misses.clear();
        misses.extend(moved.iter().step_by(step).map(|p| {
            let mut least = 0.25 * spacing * spacing;
            targets.within(p, 0.5 * spacing, |j, _| {
                least = squared_distance(&target[j], p).min(least);
            });
            least.sqrt()
        }));
        quantile(misses, PRESENT)
    }

    /// Mean of the motions of the blocks.
    pub(super) fn mean(&self) -> [f64; D] {
        let sum: SVector<f64, D> = self.seeds.iter().filter_map(Seed::value).sum();
        (sum / self.seeds.len().max(1) as f64).into()
    }

    /// The block without a motion that is nearest to a block with one.
    fn next(&self) -> Option<usize> {
        let open = self.seeds.iter().enumerate();
        let open = open.filter(|(_, seed)| seed.motion.is_none() && seed.tries < TRIES);
        // A block that failed waits until the other open blocks are equally near to known motions.
        let place = |seed: &Seed<D>| seed.distance * f64::from(1 + 8 * u32::from(seed.tries));
        open.min_by(|a, b| place(a.1).total_cmp(&place(b.1)))
            .map(|(k, _)| k)
    }

    fn settle(&mut self, still: &[[f64; D]], k: usize, motion: Local<D>) {
        self.seeds[k].motion = Some(motion);
        let place = still[self.seeds[k].row];
        for seed in &mut self.seeds {
            let distance = squared_distance(&still[seed.row], &place);
            seed.distance = seed.distance.min(distance);
        }
    }

    /// Collects the rows of the block about a model point.
    fn gather(&mut self, still: &[[f64; D]], row: usize) {
        // Adapts the radius to the density, round by round.
        for _ in 0..6 {
            self.block.clear();
            let block = &mut self.block;
            self.model
                .within(&still[row], self.radius, |i, _| block.push(i));
            self.block.sort_unstable();
            self.block.dedup();
            let wanted = self.wanted as f64 / self.block.len().max(1) as f64;
            if (0.7..1.4).contains(&wanted) || self.block.len() == still.len() {
                return;
            }
            self.radius *= wanted.powf(1.0 / D as f64).clamp(0.5, 2.0);
        }
    }

    /// Prediction of the nearest blocks at a model point: the mean of their fields.
    fn predict(&self, still: &[[f64; D]], row: usize) -> Local<D> {
        let at = SVector::from(still[row]);
        // Enough blocks to surround the point.
        let mut near = [(f64::INFINITY, None); 4];
        for seed in &self.seeds {
            let square = squared_distance(&still[seed.row], &still[row]);
            if seed.motion.is_some() && square < near[3].0 {
                let place = near.partition_point(|&(other, _)| other <= square);
                near[place..].rotate_right(1);
                near[place] = (square, seed.motion);
            }
        }
        let motions = near.iter().filter_map(|(_, motion)| *motion);
        let count = motions.clone().count().max(1) as f64;
        Local {
            at,
            value: motions
                .clone()
                .map(|m| m.value_at(&at))
                .sum::<SVector<f64, D>>()
                / count,
            gradient: motions.map(|m| m.gradient).sum::<SMatrix<f64, D, D>>() / count,
        }
    }

    /// The motion of the current block at `here`, within `reach` of the prediction, and how much
    /// its peak stands out. The gradient is included unless the sets form one block.
    fn peak(
        &mut self,
        still: &[[f64; D]],
        target: &[[f64; D]],
        here: &Local<D>,
        reach: f64,
        spacing: f64,
    ) -> Option<(Local<D>, Peak)> {
        let per_cell = CELLS / spacing;
        let half = (reach * per_cell).ceil() as usize + 1;
        let side = 2 * half + 1;
        let counts = &mut self.counts;
        counts.clear();
        counts.resize(side.pow(D as u32), 0);
        let centre = half as f64 + 0.5;
        for &i in &self.block {
            let place = here.move_point(&still[i]);
            self.targets.within(&place, reach, |j, _| {
                let step = difference(&target[j], &place);
                let mut index = 0;
                for k in (0..D).rev() {
                    index = index * side + (step[k] * per_cell + centre) as usize;
                }
                counts[index] += 1;
            });
        }
        self.sum_neighbours(side);
        let rows = self.sums.iter().enumerate();
        let (top, &highest) = rows.clone().max_by_key(|&(_, sum)| sum)?;
        let cell = |index: usize, k: usize| index / side.pow(k as u32) % side;
        let apart = |index: usize| (0..D).any(|k| cell(index, k).abs_diff(cell(top, k)) > APART);
        let others = rows.filter(|&(index, &sum)| sum > 0 && apart(index));
        let next = f64::from(others.map(|(_, &sum)| sum).max().unwrap_or(0));
        let place = |index: usize| -> [f64; D] {
            std::array::from_fn(|k| (cell(index, k) as f64 - half as f64) / per_cell)
        };
        let high = self.sums.iter().enumerate();
        let high = high.filter(|&(_, &sum)| f64::from(sum) >= EQUAL * f64::from(highest));
        let motion = |index: usize| {
            let moved = SVector::from(place(index)) + here.value;
            moved.norm_squared()
        };
        let (least, _) = high
            .map(|(index, _)| (index, motion(index)))
            .min_by(|a, b| a.1.total_cmp(&b.1))?;
        let mut motion = *here;
        motion.value += SVector::from(place(least));
        let bends = still.len() >= ONE_BLOCK;
        let pairs = self.refine(still, target, &mut motion, bends, spacing);
        let height = (f64::from(highest) - next) / (next + 1.0).sqrt();
        Some((motion, Peak { height, pairs }))
    }

    /// Refines a motion with the targets within half a spacing of the predicted points of the
    /// block. Returns the number of these targets.
    fn refine(
        &self,
        still: &[[f64; D]],
        target: &[[f64; D]],
        motion: &mut Local<D>,
        bends: bool,
        spacing: f64,
    ) -> f64 {
        let mut count = 0.0;
        for _ in 0..ROUNDS {
            let (mut arm, mut miss) = (SVector::zeros(), SVector::zeros());
            let (mut gram, mut outer) = (SMatrix::zeros(), SMatrix::<f64, D, D>::zeros());
            count = 0.0;
            for &i in &self.block {
                let place = motion.move_point(&still[i]);
                let r = SVector::from(still[i]) - motion.at;
                self.targets.within(&place, 0.5 * spacing, |j, _| {
                    let e = SVector::from(difference(&target[j], &place));
                    (arm, miss, count) = (arm + r, miss + e, count + 1.0);
                    gram += r * r.transpose();
                    outer += e * r.transpose();
                });
            }
            if count == 0.0 {
                break;
            }
            (arm, miss) = (arm / count, miss / count);
            if bends {
                gram = gram / count - arm * arm.transpose();
                outer = outer / count - miss * arm.transpose();
                gram += SMatrix::identity() * (RIDGE * gram.trace());
                let change = outer * gram.try_inverse().unwrap_or_else(SMatrix::zeros);
                motion.gradient += change;
                miss -= change * arm;
            }
            motion.value += miss;
        }
        count
    }

    /// Writes sums over three cells per axis into `sums`.
    fn sum_neighbours(&mut self, side: usize) {
        let Self { counts, sums, .. } = self;
        for k in 0..D {
            let stride = side.pow(k as u32);
            sums.clone_from(counts);
            for (i, &count) in counts.iter().enumerate().filter(|(_, count)| **count > 0) {
                // The outermost cells are empty.
                sums[i - stride] += count;
                sums[i + stride] += count;
            }
            std::mem::swap(counts, sums);
        }
        std::mem::swap(counts, sums);
    }
}

/// How much a peak stands out.
#[derive(Clone, Copy, Debug)]
struct Peak {
    /// Height above the next peak, in standard deviations.
    height: f64,
    /// Number of differences within half a spacing of the peak.
    pairs: f64,
}
