//! Whether the pairs of an answer are reliable: named doubts, and a judgement of pairs that come
//! without a likelihood.

use crate::frame::{centre_and_radius, typical_spacing};
use nalgebra::{Point, SMatrix, SVector};
use tactile_core::statistics::median;

/// Why the pairs of an answer are not reliable.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::{AnnealedSoftassign, Doubt, PointMatcher};
/// let scattered = |seed: f64| -> Vec<Point2<f64>> {
///     let place = |i: i32, k: f64| (f64::from(i * i) * k + seed * f64::from(i)).fract();
///     (0..60)
///         .map(|i| Point2::new(place(i, 0.618), place(i, 0.755)))
///         .collect()
/// };
/// let matcher = AnnealedSoftassign::default();
/// let same = matcher.match_points(&scattered(0.1), &scattered(0.1))?;
/// assert_eq!(same.report.doubt(), None);
/// // Two unrelated sets: some points coincide by chance.
/// let other = matcher.match_points(&scattered(0.1), &scattered(0.37))?;
/// assert!(matches!(
///     other.report.doubt(),
///     Some(Doubt::FewPairs | Doubt::LargeResiduals | Doubt::Undecided)
/// ));
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "snake_case")
)]
pub enum Doubt {
    /// Few points of the smaller set have a partner, so the pairs may be chance coincidences.
    FewPairs,
    /// The residuals are so large that randomly scattered points would fit the targets nearly as
    /// well. Alternatively, part of the set has far larger residuals than the rest and may be
    /// shifted by one point.
    LargeResiduals,
    /// More than one pair in ten may be wrong, judged by the confidences, the unpaired points and
    /// the residuals.
    Undecided,
    /// All rotations are allowed and the model is symmetric: a multiple of 30° (in space: 90° about
    /// a coordinate axis) maps it onto itself. The answer may be off by that rotation.
    Symmetric,
    /// The points form a lattice that may continue outside the view. Shifted by one lattice step,
    /// they fit the targets equally well with a motion that is not much larger. To exclude it, set
    /// the largest motion ([`AnnealedSoftassign::with_largest_motion`](crate::AnnealedSoftassign)).
    Repeats {
        /// The lattice step.
        step: LatticeStep,
    },
    /// The model rotated by a large angle fits the targets better, but such rotations are excluded.
    Turned,
    /// A mirror image of the model fits the targets better: two columns may be exchanged or a sign
    /// reversed.
    Mirrored,
}

impl std::fmt::Display for Doubt {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Repeats { step } => {
                return write!(
                    f,
                    "{step}: motions beyond {:.4} are ambiguous unless a largest motion is set",
                    0.5 * step.length()
                );
            }
            Self::FewPairs => "so few points match that the pairs may be chance coincidences",
            Self::LargeResiduals => {
                "the residuals of the match are as large as those of scattered points"
            }
            Self::Undecided => "more than one matched pair in ten may be wrong",
            Self::Symmetric => {
                "the points are symmetric under a rotation, and any rotation is allowed"
            }
            Self::Turned => "the points match better after a large rotation: allow any rotation",
            Self::Mirrored => {
                "a mirror image of the points matches better: are columns of the second set \
                 exchanged, or is a sign reversed?"
            }
        })
    }
}

/// Whether the pairs of an answer are reliable.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::{AnnealedSoftassign, Judgement, NearestNeighbour, PointMatcher};
/// let model = [[0.0, 0.0], [1.0, 0.1], [0.2, 1.0], [1.1, 1.2], [0.5, 0.4]].map(Point2::from);
/// let judged = AnnealedSoftassign::default().match_points(&model, &model)?;
/// assert_eq!(judged.report.judgement, Judgement::Sure);
/// // A nearest neighbour exists for any two sets. Too few pairs cannot be judged.
/// let paired = NearestNeighbour::default().match_points(&model, &model)?;
/// assert_eq!(paired.report.judgement, Judgement::NotJudged);
/// // With more pairs, the motions of neighbours can be compared.
/// let scattered = |seed: f64| -> Vec<Point2<f64>> {
///     let place = |i: i32, k: f64| (f64::from(i * i) * k + seed * f64::from(i)).fract();
///     (0..60)
///         .map(|i| Point2::new(place(i, 0.618), place(i, 0.755)))
///         .collect()
/// };
/// let paired = NearestNeighbour::default().match_points(&scattered(0.1), &scattered(0.37))?;
/// assert!(matches!(paired.report.judgement, Judgement::Doubtful(_)));
/// # Ok::<(), tactile_match::MatchError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "snake_case")
)]
#[non_exhaustive]
pub enum Judgement {
    /// The pairs were given by the caller, or are too few to compare the motions of neighbours.
    #[default]
    NotJudged,
    /// No check raised a doubt.
    Sure,
    /// A check raised this doubt.
    Doubtful(Doubt),
}

/// A step that maps a set of points onto itself, edges apart, in the units of the points. In the
/// plane the last component is zero.
///
/// ```
/// use tactile_match::LatticeStep;
/// let step = LatticeStep([0.0, 12.5, 0.0]);
/// assert_eq!(step.to_string(), "the points repeat every 12.5000 along y");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(transparent)
)]
pub struct LatticeStep(pub [f64; 3]);

impl LatticeStep {
    /// Length of the step.
    #[must_use]
    pub fn length(&self) -> f64 {
        self.0.iter().map(|s| s * s).sum::<f64>().sqrt()
    }
}

/// Names an axis if the step is within three degrees of it.
impl std::fmt::Display for LatticeStep {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let length = self.length();
        let [x, y, z] = self.0.map(|s| s / length);
        let axes = ["x", "y", "z"].into_iter().zip([x, y, z]);
        let along = match axes.into_iter().find(|(_, c)| c.abs() > 0.9986) {
            Some((axis, _)) => axis.to_owned(),
            None if z == 0.0 => format!("({x:.2}, {y:.2})"),
            None => format!("({x:.2}, {y:.2}, {z:.2})"),
        };
        write!(f, "the points repeat every {length:.4} along {along}")
    }
}

// Judges pairs by whether neighbours move together.
//
// Correct pairs follow a field that is smooth over a few points. Wrong pairs are off by distances
// of the order of the spacing, whatever method found them. So each motion is predicted from its
// neighbours, by an affine field through the two thirds that agree best, and the median misfit is
// compared with the spacing. The default matcher judges its answers by their likelihood instead,
// which is more sensitive.

/// Number of neighbours that predict a motion, per dimension. More neighbours would reach over more
/// of the bending; fewer would leave no margin to drop outliers.
const NEIGHBOURS: usize = 6;
/// Fraction of the neighbours that is kept.
const AGREEING: f64 = 0.67;
/// Number of pairs examined: enough to estimate the median to a twentieth.
const SAMPLE: usize = 500;
/// Minimum paired fraction of the smaller set.
const LEAST_PAIRED: f64 = 0.55;
/// Noise, in typical nearest-neighbour distances of the targets, above which too many points swap
/// places. Chance gives 0.3 on a lattice and 0.8 for random points. A larger limit would miss
/// lattices; a smaller one would doubt noise of a fifth of the spacing (`--example judgement`).
const MOST_NOISE: f64 = 0.25;
/// A pair is off if its misfit exceeds this number of standard deviations and this number of
/// spacings.
const OFF: [f64; 2] = [4.0, 0.3];
/// Maximum fraction of such pairs.
const MOST_OFF: f64 = 0.08;
/// A lattice step takes at least this fraction of the points, without the edges, near another
/// point.
const REPEATED: f64 = 0.65;
/// "Near" in units of the step.
const NEAR_STEP: f64 = 0.2;
/// Steps up to this multiple of the shortest are examined, which includes the diagonal of a square.
const LONGEST_STEP: f64 = 1.6;
/// A step is out of reach if it exceeds this multiple of the motion.
const REACH: f64 = 5.0;
/// Two sets hold the same points, rather than two views of more, if this fraction of them is paired
/// and their bounding box has changed by more than this fraction of a step.
const WHOLE: [f64; 2] = [0.995, 0.25];

impl Judgement {
    /// Judges pairs by the motions of neighbours: `O(n)` for each of [`SAMPLE`] pairs. Returns also
    /// the step of a lattice by which they can be shifted.
    pub(crate) fn of_pairs<const D: usize>(
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
        assignment: &[Option<usize>],
    ) -> (Self, Option<LatticeStep>) {
        let doubtful = |doubt| (Self::Doubtful(doubt), None);
        let scale = centre_and_radius(model).1.max(f64::MIN_POSITIVE);
        let rows = model.iter().zip(assignment);
        let pairs: Vec<_> = rows
            .filter_map(|(x, j)| Some((x.coords / scale, (target[(*j)?] - x) / scale)))
            .collect();
        if (pairs.len() as f64) < LEAST_PAIRED * model.len().min(target.len()) as f64 {
            return doubtful(Doubt::FewPairs);
        }
        let step = pairs.len().div_ceil(SAMPLE).max(1);
        let sample = (0..pairs.len()).step_by(step);
        let misfits: Vec<f64> = sample.filter_map(|row| misfit(&pairs, row)).collect();
        let scaled = target.iter().map(|y| (y - target[0]) / scale);
        let scaled: Vec<[f64; D]> = scaled.map(Into::into).collect();
        let spacing = typical_spacing(&scaled, SAMPLE, &mut Vec::new());
        if misfits.is_empty() || spacing <= 0.0 {
            return (Self::NotJudged, None);
        }
        let variance = median(&mut misfits.clone()) / median_of_chi_squared(D);
        let limit = (OFF[0] * variance.sqrt()).max(OFF[1] * spacing).powi(2);
        let off = misfits.iter().filter(|&&misfit| misfit > limit).count();
        if variance.sqrt() > MOST_NOISE * spacing {
            return doubtful(Doubt::LargeResiduals);
        }
        if off as f64 > MOST_OFF * misfits.len() as f64 {
            return doubtful(Doubt::Undecided);
        }
        match repeats(model, target, &pairs, scale) {
            Some((step, true)) => (Self::Doubtful(Doubt::Repeats { step }), Some(step)),
            found => (Self::Sure, found.map(|(step, _)| step)),
        }
    }
}

type Motions<const D: usize> = [(SVector<f64, D>, SVector<f64, D>)];

/// Squared distance of a motion from the prediction of its neighbours, over the variance of that
/// difference at unit noise. `None` if there are too few neighbours.
fn misfit<const D: usize>(pairs: &Motions<D>, row: usize) -> Option<f64> {
    let count = NEIGHBOURS * D;
    let (at, motion) = pairs[row];
    let mut near: Vec<(f64, usize)> = (0..pairs.len())
        .filter(|&k| k != row)
        .map(|k| ((pairs[k].0 - at).norm_squared(), k))
        .collect();
    if near.len() < count {
        return None;
    }
    near.select_nth_unstable_by(count - 1, |a, b| a.0.total_cmp(&b.0));
    near.truncate(count);
    let mut middle = SVector::<f64, D>::zeros();
    for axis in 0..D {
        let mut values: Vec<f64> = near.iter().map(|&(_, k)| pairs[k].1[axis]).collect();
        middle[axis] = median(&mut values);
    }
    near.iter_mut()
        .for_each(|(far, k)| *far = (pairs[*k].1 - middle).norm_squared());
    near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    near.truncate((AGREEING * count as f64) as usize);
    let rows = near.iter().map(|&(_, k)| pairs[k]);
    let n = near.len() as f64;
    let mean: SVector<f64, D> = rows.clone().map(|(x, _)| x).sum::<SVector<f64, D>>() / n;
    let moved: SVector<f64, D> = rows.clone().map(|(_, u)| u).sum::<SVector<f64, D>>() / n;
    let (mut gram, mut outer) = (SMatrix::<f64, D, D>::zeros(), SMatrix::<f64, D, D>::zeros());
    for (x, u) in rows {
        gram += (x - mean) * (x - mean).transpose();
        outer += (u - moved) * (x - mean).transpose();
    }
    // Points on a line determine no gradient across it.
    gram += SMatrix::identity() * (1e-3 * gram.trace());
    let inverse = gram.try_inverse()?;
    let arm = at - mean;
    let left = motion - moved - outer * inverse * arm;
    let variance = 1.0 + 1.0 / n + arm.dot(&(inverse * arm));
    Some(left.norm_squared() / variance)
}

/// The lattice step by which the answer can be shifted so that it fits the targets equally well
/// with the least motion, and whether that is not much larger.
fn repeats<const D: usize>(
    model: &[Point<f64, D>],
    target: &[Point<f64, D>],
    pairs: &Motions<D>,
    scale: f64,
) -> Option<(LatticeStep, bool)> {
    let centre = centre_and_radius(model).0;
    let from = model.iter().min_by(|a, b| {
        let square = |p: &Point<f64, D>| (p.coords - centre).norm_squared();
        square(a).total_cmp(&square(b))
    })?;
    let offsets = model.iter().map(|p| p - from);
    let others = offsets.filter(|step| step.norm_squared() > 0.0);
    let shortest = others
        .clone()
        .map(|step| step.norm())
        .fold(f64::INFINITY, f64::min);
    let root_mean_square = |step: &SVector<f64, D>| {
        let squares = pairs.iter().map(|(_, u)| (u * scale + step).norm_squared());
        (squares.sum::<f64>() / pairs.len() as f64).sqrt()
    };
    let own = root_mean_square(&SVector::zeros());
    let sides = |points: &[Point<f64, D>]| -> SVector<f64, D> {
        let first = (points[0], points[0]);
        let (low, high) = points.iter().fold(first, |(l, h), p| (l.inf(p), h.sup(p)));
        high - low
    };
    let changed = (sides(model) - sides(target)).amax();
    let whole = pairs.len() as f64 >= WHOLE[0] * model.len().max(target.len()) as f64;
    let sampled = || model.iter().step_by(model.len().div_ceil(SAMPLE));
    let repeated = |step: &SVector<f64, D>| {
        let near = NEAR_STEP * step.norm();
        let misses = |p: &&Point<f64, D>| model.iter().all(|q| (q - **p - step).norm() >= near);
        let most = (1.0 - REPEATED) * sampled().count() as f64;
        // Most steps of scattered points are given up after a part of the sample.
        (sampled().filter(misses).take(most as usize + 1).count() as f64) <= most
    };
    let mut steps: Vec<_> = others
        .filter(|step| step.norm() <= LONGEST_STEP * shortest)
        .filter(|step| !(whole && changed > WHOLE[1] * step.norm()))
        .map(|step| (root_mean_square(&step), step))
        .collect();
    steps.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (motion, step) = steps.into_iter().find(|(_, step)| repeated(step))?;
    let mut outward = [0.0; 3];
    (0..D).for_each(|k| outward[k] = step[k]);
    Some((LatticeStep(outward), motion < REACH * own))
}

/// Median of the sum of `dimension` squared standard normal deviates, by the approximation of
/// Wilson and Hilferty (accurate to 1 % from two dimensions on).
pub(crate) fn median_of_chi_squared(dimension: usize) -> f64 {
    let n = dimension as f64;
    n * (1.0 - 2.0 / (9.0 * n)).powi(3)
}
