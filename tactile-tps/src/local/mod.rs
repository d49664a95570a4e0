//! Displacement field and gradient from any number of pairs.

use crate::error::{same_length, validate_pairs};
use crate::{TpsError, Warp};
use core::ops::ControlFlow;
use nalgebra::{Matrix4, Matrix4x3, Point, RowVector4, SMatrix, SVector};
use tactile_core::Progress;
use tree::Tree;

mod grain;
mod judge;
mod patch;
mod process;
mod tree;

use judge::contradicted;
use patch::{PairPatch, Pairs};

/// Up to this number, all pairs form one patch. More pairs are divided, because the time grows with
/// the third power.
const WHOLE: usize = 300;

/// Number of pairs in the smallest patch. Twice as many halve the errors of smooth fields, and take
/// four times as long.
const fn smallest_patch(dimensions: usize) -> usize {
    if dimensions == 2 { 70 } else { 110 }
}

/// Number of points in a block of neighbours that are evaluated together.
const BLOCK: usize = 24;

/// Maximum ratio of the points of a block to the pairs of its patch: only points in the middle are
/// evaluated.
const MIDDLE: usize = 3;

/// Maximum distance of the block's points from its middle, relative to the farthest pair of its
/// patch.
const INSIDE: f64 = 0.8;

/// Rounds of rejecting wrong pairs. Each round excludes those rejected in the last.
const ROUNDS: usize = 4;

/// Noise above this multiple of the typical noise may be deformation that the pairs do not resolve,
/// if it is at least the fraction [`NOTICEABLE`] of the spacing.
const FAR_ABOVE: f64 = 3.0;

/// Fraction of the spacing above which unresolved deformation is noticeable.
const NOTICEABLE: f64 = 0.02;

/// A displacement field through pairs, with its gradient and their errors.
///
/// The displacement is an affine field plus a Gaussian process (kriging),
/// `cov zᵢ zⱼ = τ²(k(|xᵢ − xⱼ|) + λ δᵢⱼ)`. Shapes and lengths of k and noise ratios λ are weighted
/// by their restricted likelihood (Patterson & Thompson, Biometrika 58, 1971), and the field is the
/// average of the likely ones. Its errors include noise, unresolved detail, and the differences
/// between the likely processes. They are increased if leave-one-out residuals are larger than the
/// likelihood predicts.
///
/// Up to 300 pairs form one patch. More pairs are divided into patches of neighbours, down to 70
/// pairs in the plane and 110 in space, so that time and memory are proportional to the number of
/// pairs. Fewer than 16 pairs determine only an affine field. The gradient is undetermined along
/// directions that the points do not span: its variance is infinite there.
///
/// A pair is rejected if its distance from the prediction by its neighbours exceeds six standard
/// deviations and a seventh of the spacing, unless three of them share its motion.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_tps::LocalField;
/// # fn main() -> Result<(), tactile_tps::TpsError> {
/// let sources: Vec<_> = (0..2000)
///     .map(|i| {
///         Point2::new(
///             f64::from(i % 50) + 0.3 * (7.1 * f64::from(i)).sin(),
///             f64::from(i / 50),
///         )
///     })
///     .collect();
/// let bend = |p: &Point2<f64>| Point2::new(p.x + (0.1 * p.y).sin(), p.y);
/// let mut targets: Vec<_> = sources.iter().map(bend).collect();
/// targets[777].y += 3.0; // a wrong match
/// let field = LocalField::fit(&sources, &targets)?;
/// assert!((0..2000).all(|i| field.kept[i] == (i != 777)));
/// let found = &field.at(&[Point2::new(20.0, 10.0)])[0];
/// // ∂u_x/∂y = 0.1 cos(0.1 y).
/// assert!((found.gradient[(0, 1)] - 0.1 * 1_f64.cos()).abs() < 1e-5);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct LocalField<const D: usize> {
    /// Whether each pair agrees with its neighbours.
    pub kept: Vec<bool>,
    /// The field at each source.
    pub values: Vec<LocalValue<D>>,
    /// Distance of each pair from the prediction by the others.
    pub misses: Vec<f64>,
    /// Covariance of a row of the mean gradient over the sources.
    pub mean_gradient_covariance: SMatrix<f64, D, D>,
    /// Degrees of freedom of the noise and of the covariance of the mean.
    pub degrees_of_freedom: usize,
    sources: Vec<Point<f64, D>>,
    displacements: Vec<SVector<f64, D>>,
    floor: f64,
    grain: f64,
    tree: Tree<D>,
    /// Median noise of the values.
    usual: f64,
}

/// The field at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct LocalValue<const D: usize> {
    /// Displacement.
    pub displacement: SVector<f64, D>,
    /// Variance of a coordinate of the displacement.
    pub displacement_variance: f64,
    /// Gradient of the displacement: row i is ∇uᵢ.
    pub gradient: SMatrix<f64, D, D>,
    /// Covariance of a row of the gradient. Rows are independent of each other. Infinite along axes
    /// with a component normal to the span of the points.
    pub gradient_covariance: SMatrix<f64, D, D>,
    /// Number of directions that the nearby points span, such as 1 for points on a line.
    pub rank: usize,
    /// Standard deviation of the local noise of a coordinate.
    pub sigma: f64,
    /// Ratio of the nearby leave-one-out residuals to the prediction of the likelihood, in terms of
    /// variance and at least 1. The covariances include it.
    pub excess: f64,
    /// Local distance between neighbours.
    pub spacing: f64,
    /// Whether the noise is far above that elsewhere: deformation that the pairs do not resolve,
    /// such as short waves and jumps. The errors include it.
    pub unresolved: bool,
}

/// A value, and the leave-one-out misfit of the pair there, if there is one.
#[derive(Clone, Copy)]
struct Found<const D: usize> {
    value: LocalValue<D>,
    /// Squared distance from the prediction over its variance, and the distance.
    misfit: f64,
    distance: f64,
    /// Gradient of the affine field of the patch.
    trend: SMatrix<f64, D, D>,
}

impl<const D: usize> LocalField<D> {
    /// Number of pairs in a patch of a large set.
    pub const PATCH: usize = smallest_patch(D);

    /// Fits `sources` to `targets`. O(n³) time up to 300 pairs, and O(n) beyond, after O(n log n)
    /// for the search of neighbours.
    ///
    /// # Errors
    /// [`TpsError`] for no points, lengths that differ and non-finite numbers.
    pub fn fit(sources: &[Point<f64, D>], targets: &[Point<f64, D>]) -> Result<Self, TpsError> {
        Self::fit_watched(sources, targets, |_| ControlFlow::Continue(()))
    }

    /// Like [`fit`](Self::fit). `watch` is called with the number of completed points, and may stop
    /// the fit.
    ///
    /// # Errors
    /// Those of [`fit`](Self::fit), and [`TpsError::Stopped`].
    pub fn fit_watched(
        sources: &[Point<f64, D>],
        targets: &[Point<f64, D>],
        mut watch: impl FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Self, TpsError> {
        let mut field = Self::of(sources, targets)?;
        let mut done = 0;
        let mut found = Vec::new();
        let mut patch = PairPatch::default();
        for round in 1..=ROUNDS {
            field.plant();
            found.clear();
            field.walk(&mut patch, sources, true, &mut found, |points| {
                // Most fields need one round, others two.
                let total = sources.len() * round;
                watch(&Progress::new(done + points, total))
            })?;
            done += sources.len();
            if round == ROUNDS {
                break;
            }
            let wrong = contradicted(&found, &field.sources, &field.displacements);
            // `kept` is the opposite of `wrong`: nothing has changed if they differ everywhere.
            if field
                .kept
                .iter()
                .zip(&wrong)
                .all(|(kept, wrong)| kept != wrong)
            {
                break;
            }
            field.kept = wrong.into_iter().map(|wrong| !wrong).collect();
        }
        field.misses = found.iter().map(|found| found.distance).collect();
        field.values = found.into_iter().map(|found| found.value).collect();
        field.mark();
        field.take_mean(&mut patch);
        Ok(field)
    }

    /// The field before the fit.
    fn of(sources: &[Point<f64, D>], targets: &[Point<f64, D>]) -> Result<Self, TpsError> {
        validate_pairs(sources, targets, None)?;
        let grain = grain::of_pairs(sources, targets);
        Ok(Self {
            kept: vec![true; sources.len()],
            values: Vec::new(),
            misses: Vec::new(),
            mean_gradient_covariance: SMatrix::zeros(),
            degrees_of_freedom: 0,
            sources: sources.to_vec(),
            displacements: targets.iter().zip(sources).map(|(t, s)| t - s).collect(),
            floor: grain::least_noise(sources, targets, grain),
            grain,
            tree: Tree::default(),
            usual: f64::INFINITY,
        })
    }

    /// Computes the covariance of the mean gradient.
    fn take_mean(&mut self, patch: &mut PairPatch<D>) {
        let (size, kept) = (self.sizes().0, self.tree.len());
        if kept == size {
            self.mean_gradient_covariance = patch.of_mean();
            self.degrees_of_freedom = patch.degrees();
            return;
        }
        // Points of one patch share their errors. Those of neighbouring patches partly cancel, so
        // this is an upper bound of the error of the mean.
        let patches = kept / size;
        let all = self.values.iter().map(|value| value.gradient_covariance);
        let mean = all.sum::<SMatrix<f64, D, D>>() / self.values.len() as f64;
        self.mean_gradient_covariance = mean / patches as f64;
        self.degrees_of_freedom = patches.max(2) - 1;
    }

    fn pairs(&self) -> Pairs<'_, D> {
        Pairs {
            sources: &self.sources,
            displacements: &self.displacements,
            floor: self.floor,
            grain: self.grain,
        }
    }

    /// Builds the tree of the kept pairs.
    fn plant(&mut self) {
        let rows = (0..self.sources.len()).filter(|&i| self.kept[i]);
        self.tree = Tree::new(&self.sources, rows.collect(), BLOCK);
    }

    /// Marks values whose noise is far above the typical one.
    fn mark(&mut self) {
        let mut noises: Vec<f64> = self.values.iter().map(LocalValue::noise).collect();
        let middle = noises.len() / 2;
        if middle < noises.len() {
            self.usual = *noises.select_nth_unstable_by(middle, f64::total_cmp).1;
        }
        let usual = self.usual;
        self.values.iter_mut().for_each(|value| value.mark(usual));
    }

    /// The field at any points: O(1) time for each point with nearby pairs.
    #[must_use]
    pub fn at(&self, points: &[Point<f64, D>]) -> Vec<LocalValue<D>> {
        // Nothing stops this evaluation.
        let values = self.at_watched(points, || ControlFlow::Continue(()));
        values.unwrap_or_default()
    }

    /// Like [`at`](Self::at). `watch` is called many times a second and may stop it.
    ///
    /// # Errors
    /// [`TpsError::Stopped`].
    pub fn at_watched(
        &self,
        points: &[Point<f64, D>],
        mut watch: impl FnMut() -> ControlFlow<()>,
    ) -> Result<Vec<LocalValue<D>>, TpsError> {
        let mut found = Vec::with_capacity(points.len());
        let mut patch = PairPatch::default();
        self.walk(&mut patch, points, false, &mut found, |_| watch())?;
        let value = |found: Found<D>| {
            let mut value = found.value;
            value.mark(self.usual);
            value
        };
        Ok(found.into_iter().map(value).collect())
    }

    /// Number of pairs in a patch, and number of points that it serves.
    fn sizes(&self) -> (usize, usize) {
        let kept = self.tree.len();
        if kept <= WHOLE {
            return (kept, usize::MAX);
        }
        // The time per pair is kept constant until the smallest patch size is reached.
        let size = WHOLE as f64 * (WHOLE as f64 / kept as f64).sqrt();
        let size = (size as usize).max(Self::PATCH);
        (size, size.div_euclid(MIDDLE))
    }

    /// The field at `points`, which must be the sources if pairs are judged.
    fn walk(
        &self,
        patch: &mut PairPatch<D>,
        points: &[Point<f64, D>],
        judge: bool,
        found: &mut Vec<Found<D>>,
        mut watch: impl FnMut(usize) -> ControlFlow<()>,
    ) -> Result<(), TpsError> {
        let (count, leaf) = self.sizes();
        let pairs = self.pairs();
        // One patch serves all points of a block, because they are neighbours.
        let blocks = Tree::new(points, (0..points.len()).collect(), leaf);
        patch.forget_last();
        let (mut order, mut own, mut values) = (Vec::new(), Vec::new(), Vec::new());
        let mut read = |patch: &mut PairPatch<D>, rows: &[usize]| {
            own.clear();
            own.extend(rows.iter().map(|&i| points[i]));
            values.clear();
            patch.values(&own, &mut values);
            for (&i, value) in rows.iter().zip(&values) {
                let (misfit, distance) = match judge.then(|| patch.row_of(i)) {
                    None => (0.0, 0.0),
                    Some(Some(row)) => patch.left_out(row),
                    Some(None) => value.beside(&self.displacements[i]),
                };
                let found = Found {
                    value: *value,
                    misfit,
                    distance,
                    trend: patch.trend(),
                };
                order.push((i, found));
            }
        };
        if leaf == usize::MAX {
            patch.take(&pairs, self.tree.rows().iter().copied());
        }
        let mut done = 0;
        let mut waiting: Vec<Vec<usize>> = Vec::new();
        for block in blocks.leaves() {
            if leaf == usize::MAX {
                read(patch, block);
            } else if !block.is_empty() {
                waiting.push(block.to_vec());
            }
            while let Some(mut block) = waiting.pop() {
                let offset = |i: usize, from: &SVector<f64, D>| points[i].coords - from;
                let first = points[block[0]].coords;
                let sum: SVector<f64, D> = block.iter().map(|&i| offset(i, &first)).sum();
                let centre = first + sum / block.len() as f64;
                let near = self.tree.nearest(&self.sources, &centre.into(), count);
                let reach = near.last().map_or(0.0, |last| last.0.sqrt());
                let extents = block.iter().map(|&i| offset(i, &centre).abs());
                let extents = extents.fold(SVector::<f64, D>::zeros(), |e, o| e.sup(&o));
                let extent = block.iter().map(|&i| offset(i, &centre).norm());
                if block.len() == 1 || extent.fold(0.0, f64::max) <= INSIDE * reach {
                    patch.take(&pairs, near.into_iter().map(|near| near.1));
                    read(patch, &block);
                } else {
                    // For sparse points next to dense pairs, smaller blocks get their own patches.
                    let axis = extents.imax();
                    let along = |&i: &usize| points[i][axis];
                    block.sort_unstable_by(|i, j| along(i).total_cmp(&along(j)).then(i.cmp(j)));
                    let rest = block.split_off(block.len() / 2);
                    waiting.extend([rest, block]);
                }
            }
            done += block.len();
            if watch(done).is_break() {
                return Err(TpsError::Stopped);
            }
        }
        order.sort_unstable_by_key(|found| found.0);
        found.extend(order.into_iter().map(|found| found.1));
        Ok(())
    }
}

/// Moves points by the displacement of the field, which smooths the noise of the pairs. Many points
/// take far less time together than one by one.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_tps::{LocalField, Warp};
/// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
/// let targets = sources.map(|p| Point2::new(1.1 * p.x, p.y));
/// let field = LocalField::fit(&sources, &targets)?;
/// let mut images = sources;
/// field.apply_into(&sources, &mut images)?;
/// assert!((images[3] - targets[3]).norm() < 1e-12);
/// assert!((field.jacobian(&sources[4])[(0, 0)] - 1.1).abs() < 1e-12);
/// # Ok::<(), tactile_tps::TpsError>(())
/// ```
impl<const D: usize> Warp<D> for LocalField<D> {
    fn apply(&self, point: &Point<f64, D>) -> Point<f64, D> {
        point + self.at(&[*point])[0].displacement
    }

    fn jacobian(&self, point: &Point<f64, D>) -> SMatrix<f64, D, D> {
        SMatrix::identity() + self.at(&[*point])[0].gradient
    }

    fn rank(&self) -> usize {
        1 + self.values.iter().map(|at| at.rank).max().unwrap_or(0)
    }

    fn apply_into(
        &self,
        points: &[Point<f64, D>],
        images: &mut [Point<f64, D>],
    ) -> Result<(), TpsError> {
        same_length(points.len(), images.len())?;
        for ((image, point), at) in images.iter_mut().zip(points).zip(self.at(points)) {
            *image = point + at.displacement;
        }
        Ok(())
    }

    fn jacobian_into(
        &self,
        points: &[Point<f64, D>],
        jacobians: &mut [SMatrix<f64, D, D>],
    ) -> Result<(), TpsError> {
        same_length(points.len(), jacobians.len())?;
        for (jacobian, at) in jacobians.iter_mut().zip(self.at(points)) {
            *jacobian = SMatrix::identity() + at.gradient;
        }
        Ok(())
    }
}

impl<const D: usize> LocalValue<D> {
    /// Local noise of the pairs, increased by the excess over the likelihood.
    fn noise(&self) -> f64 {
        self.sigma * self.excess.sqrt()
    }

    /// Noise far above the typical one may be deformation between the pairs: its gradient is of the
    /// order of the noise over half of the spacing.
    fn mark(&mut self, usual: f64) {
        let noise = self.noise();
        self.unresolved = noise > FAR_ABOVE * usual && noise > NOTICEABLE * self.spacing;
        if self.unresolved {
            let hidden = (2.0 * noise / self.spacing).powi(2);
            (0..D).for_each(|a| self.gradient_covariance[(a, a)] += hidden);
        }
    }
}

/// Rows of the `count` points nearest to each position, nearest first. O(log n) per position.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_tps::nearest_rows;
/// let points: Vec<_> = (0..100).map(|i| Point2::new(f64::from(i), 0.0)).collect();
/// let found = nearest_rows(&points, &[Point2::new(41.9, 3.0)], 2);
/// assert_eq!(found, [[42, 41]]);
/// ```
pub fn nearest_rows<const D: usize>(
    points: &[Point<f64, D>],
    places: &[Point<f64, D>],
    count: usize,
) -> Vec<Vec<usize>> {
    let tree = Tree::new(points, (0..points.len()).collect(), BLOCK);
    let near = |place| tree.nearest(points, place, count);
    let rows = |place| near(place).into_iter().map(|(_, row)| row).collect();
    places.iter().map(rows).collect()
}
