//! Displacement and gradient from any number of pairs, patch by patch.

use crate::TpsError;
use crate::error::validate_pairs;
use nalgebra::{Matrix4, Matrix4x3, Point, RowVector4, SMatrix, SVector};
use tree::Tree;

mod patch;
mod tree;

use patch::Patch;

/// A displacement field through many pairs, with its gradient and their errors, in time and memory
/// that grow as the number of pairs.
///
/// The sources are cut into blocks of two dozen neighbours. Each block has a patch: the 70 pairs in
/// the plane, 110 in space, that lie next to it. There the displacement is an affine field plus a
/// Gaussian process (kriging), `cov zᵢ zⱼ = τ²(k(|xᵢ − xⱼ|) + λ δᵢⱼ)`. Shape and length of k and
/// the noise λ are those of the largest restricted likelihood (Patterson & Thompson, Biometrika 58,
/// 1971) in this patch, so that a steep zone has its own. The posterior gives displacement,
/// gradient and covariances, which hold noise and what the pairs do not resolve.
///
/// A pair is left out where it contradicts its neighbours: the distance from the prediction by the
/// others exceeds six standard deviations of the patch and a seventh of the spacing. The standard
/// deviation is robust and the patch's own.
///
/// Against polynomials fitted by moving least squares the gradients of noisy fields err by half as
/// much, and their errors hold the truth 93 to 99 times in 100 instead of 40 to 90.
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
/// let field = LocalField::fit(&sources, &targets, |_| {})?;
/// assert!((0..2000).all(|i| field.kept[i] == (i != 777)));
/// let found = &field.at(&[Point2::new(20.0, 10.0)], |_| {})[0];
/// // ∂u_x/∂y = 0.1 cos(0.1 y).
/// assert!((found.gradient[(0, 1)] - 0.1 * 1_f64.cos()).abs() < 1e-5);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct LocalField<const D: usize> {
    /// Whether a pair agrees with its neighbours.
    pub kept: Vec<bool>,
    /// The field at every source.
    pub values: Vec<LocalValue<D>>,
    sources: Vec<Point<f64, D>>,
    displacements: Vec<SVector<f64, D>>,
    tree: Tree<D>,
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
    /// Covariance of a row of the gradient. Rows are independent of each other.
    pub gradient_covariance: SMatrix<f64, D, D>,
    /// Standard deviation of a coordinate's noise hereabouts.
    pub sigma: f64,
    /// Distance between neighbours hereabouts.
    pub spacing: f64,
}

/// Why the field is looked up.
#[derive(Clone, Copy, PartialEq)]
enum Walk {
    /// To judge the pairs. Smaller patches are enough, and take a sixth of the time.
    Judge,
    /// To read values and errors.
    Read,
}

/// A value and how far the pair there, if there is one, is from what the others predict.
struct Found<const D: usize> {
    value: LocalValue<D>,
    /// Squared distance from the prediction over its variance, and the distance.
    misfit: f64,
    distance: f64,
}

impl<const D: usize> LocalField<D> {
    /// Pairs of a patch. Twice as many halve the errors of smooth fields, and take eight times as
    /// long.
    pub const PATCH: usize = if D == 2 { 70 } else { 110 };

    /// Fits `sources` to `targets`. `progress` gets the share that is done. O(n) time after
    /// O(n log n) for the neighbours.
    ///
    /// # Errors
    /// [`TpsError`] for no points, lengths that differ and numbers that are not finite.
    pub fn fit(
        sources: &[Point<f64, D>],
        targets: &[Point<f64, D>],
        mut progress: impl FnMut(f64),
    ) -> Result<Self, TpsError> {
        validate_pairs(sources, targets, None)?;
        let mut field = Self {
            kept: vec![true; sources.len()],
            values: Vec::new(),
            sources: sources.to_vec(),
            displacements: targets.iter().zip(sources).map(|(t, s)| t - s).collect(),
            tree: Tree::default(),
        };
        // The first round judges with the wrong pairs among the others, the second without them.
        for _ in 0..2 {
            field.plant();
            let found = field.walk(sources, Walk::Judge, |_| {});
            let wrong = contradicted(&found, sources);
            // `kept` is the opposite of `wrong`: nothing has changed where they differ everywhere.
            let same = (0..sources.len()).all(|i| field.kept[i] != wrong[i]);
            field.kept = wrong.into_iter().map(|wrong| !wrong).collect();
            if same {
                break;
            }
        }
        field.plant();
        let found = field.walk(sources, Walk::Read, &mut progress);
        field.values = found.into_iter().map(|found| found.value).collect();
        Ok(field)
    }

    /// The tree of the pairs that are kept.
    fn plant(&mut self) {
        let rows = (0..self.sources.len()).filter(|&i| self.kept[i]);
        self.tree = Tree::new(&self.sources, rows.collect());
    }

    /// The field at any points: O(1) time for each that has neighbours among them.
    pub fn at(&self, points: &[Point<f64, D>], progress: impl FnMut(f64)) -> Vec<LocalValue<D>> {
        let found = self.walk(points, Walk::Read, progress);
        found.into_iter().map(|found| found.value).collect()
    }

    /// The field at `points`, which are the sources where they are judged.
    fn walk(
        &self,
        points: &[Point<f64, D>],
        purpose: Walk,
        mut progress: impl FnMut(f64),
    ) -> Vec<Found<D>> {
        let count = match purpose {
            Walk::Judge => Self::PATCH / 2,
            Walk::Read => Self::PATCH,
        };
        // One patch serves all points of a block, which are neighbours.
        let blocks = Tree::new(points, (0..points.len()).collect());
        let mut patch = Patch::default();
        let mut found: Vec<Option<Found<D>>> = points.iter().map(|_| None).collect();
        let mut done = 0;
        for block in blocks.leaves() {
            let centre: SVector<f64, D> = block
                .iter()
                .map(|&i| points[i].coords)
                .sum::<SVector<f64, D>>()
                / block.len() as f64;
            let mut near = self.tree.nearest(&self.sources, &centre.into(), count);
            let reach = |near: &[(f64, usize)]| near.last().map_or(0.0, |last| last.0.sqrt());
            let extent = |i: &usize| (points[*i].coords - centre).norm();
            let extent = block.iter().map(extent).fold(0.0, f64::max);
            // Sparse points beside dense pairs have patches of their own.
            let together = extent <= 0.8 * reach(&near);
            let take = |patch: &mut Patch<D>, place: &SVector<f64, D>, near: &[_]| {
                patch.take(&self.sources, &self.displacements, place, near);
                // Judging compares a pair with the median of its block, in which a common factor
                // cancels.
                if purpose == Walk::Read {
                    patch.calibrate();
                }
            };
            if together {
                take(&mut patch, &centre, &near);
            }
            for &i in block {
                if !together {
                    near = self.tree.nearest(&self.sources, &points[i], count);
                    take(&mut patch, &points[i].coords, &near);
                }
                let value = patch.value(&points[i]);
                let (misfit, distance) = match (purpose, patch.row_of(i)) {
                    (Walk::Read, _) => (0.0, 0.0),
                    (Walk::Judge, Some(row)) => patch.left_out(row),
                    (Walk::Judge, None) => value.beside(&self.displacements[i]),
                };
                found[i] = Some(Found {
                    value,
                    misfit,
                    distance,
                });
            }
            done += block.len();
            progress(done as f64 / points.len() as f64);
        }
        found.into_iter().flatten().collect()
    }
}

/// Rows of the `count` points nearest to each place, nearest first. O(log n) for each place.
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
    let tree = Tree::new(points, (0..points.len()).collect());
    let near = |place| tree.nearest(points, place, count);
    let rows = |place| near(place).into_iter().map(|(_, row)| row).collect();
    places.iter().map(rows).collect()
}

/// Whether each pair contradicts its neighbours.
fn contradicted<const D: usize>(found: &[Found<D>], sources: &[Point<f64, D>]) -> Vec<bool> {
    let mut wrong = vec![false; found.len()];
    let blocks = Tree::new(sources, (0..sources.len()).collect());
    for block in blocks.leaves() {
        let mut misfits: Vec<f64> = block.iter().map(|&i| found[i].misfit).collect();
        let middle = misfits.len() / 2;
        let median = *misfits.select_nth_unstable_by(middle, f64::total_cmp).1;
        // Median of χ² with D degrees, by Wilson and Hilferty.
        let usual = D as f64 * (1.0 - 2.0 / (9.0 * D as f64)).powi(3);
        // Six standard deviations: fewer drop the largest residuals of a steep field, whose noise
        // is not Gaussian.
        let limit = 36.0 * median / usual;
        for &i in block {
            // A pair that lies so near to its place does no harm, whatever its neighbours' noise.
            let near = found[i].distance <= 0.15 * found[i].value.spacing;
            wrong[i] = found[i].misfit > limit && !near;
        }
    }
    wrong
}
