//! Whether the pairs of an answer are to be relied on: doubts with their names, and the judgement of
//! pairs that come without a likelihood.

use crate::frame::centre_and_radius;
use nalgebra::{Point, SMatrix, SVector};
use tactile_core::statistics::median;

/// Why the pairs of an answer are not to be relied on.
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
/// // Two sets that have nothing to do with each other: some points coincide by chance.
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
    /// So few points of the smaller set have a partner that the pairs may have met by chance.
    FewPairs,
    /// The residuals are so large that points strewn at random would explain the targets nearly as
    /// well. Or those of a part of the set are far larger than the others', which may lie a point
    /// aside.
    LargeResiduals,
    /// More than one pair in ten may be wrong, by the pairs' confidences, by the points without a
    /// partner, and by the residuals.
    Undecided,
    /// Any rotation is allowed, and one of a twelfth of a turn or a multiple, in space of a right
    /// angle about an axis of the coordinates, takes the model onto itself: the answer may be
    /// turned by it.
    Symmetric,
    /// The points are those of a lattice that may go on beyond the view. Moved by one of its steps
    /// they explain the targets as well, with a motion that is not much larger: state the largest
    /// motion ([`AnnealedSoftassign::with_largest_motion`](crate::AnnealedSoftassign)).
    Repeats {
        /// The step, in the units of the points. In the plane the last number is zero.
        step: [f64; 3],
    },
    /// The model turned by a large angle explains the targets better, and such turns are excluded.
    Turned,
    /// A mirror image of the model explains the targets better: columns may be exchanged, or a sign
    /// changed.
    Mirrored,
}

impl std::fmt::Display for Doubt {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Repeats { step } => return write_repeats(f, step),
            Self::FewPairs => "the matched points are so few that they may have met by chance",
            Self::LargeResiduals => {
                "the residuals of the match are as large as those of scattered points"
            }
            Self::Undecided => "more than one matched pair in ten may be wrong",
            Self::Symmetric => "the points look the same after a turn, and any rotation is allowed",
            Self::Turned => "turned by a large angle the points match better: allow any rotation",
            Self::Mirrored => {
                "a mirror image of the points matches better: are columns of the second set \
                 exchanged, or a sign changed?"
            }
        })
    }
}

/// Whether the pairs of an answer are to be relied on.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::{AnnealedSoftassign, Judgement, NearestNeighbour, PointMatcher};
/// let model = [[0.0, 0.0], [1.0, 0.1], [0.2, 1.0], [1.1, 1.2], [0.5, 0.4]].map(Point2::from);
/// let judged = AnnealedSoftassign::default().match_points(&model, &model)?;
/// assert_eq!(judged.report.judgement, Judgement::Sure);
/// // A nearest neighbour exists for any two sets. Of few pairs alone nothing can be seen.
/// let paired = NearestNeighbour::default().match_points(&model, &model)?;
/// assert_eq!(paired.report.judgement, Judgement::NotJudged);
/// // Of more it shows whether neighbours move together.
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
pub enum Judgement {
    /// The pairs were given by the caller, or are too few to show whether neighbours move together.
    #[default]
    NotJudged,
    /// Nothing speaks against the pairs.
    Sure,
    /// Something does.
    Doubtful(Doubt),
}

/// The step of a lattice, along an axis where it lies within three degrees of one.
fn write_repeats(f: &mut std::fmt::Formatter<'_>, step: &[f64; 3]) -> std::fmt::Result {
    let length = step.iter().map(|s| s * s).sum::<f64>().sqrt();
    let [x, y, z] = step.map(|s| s / length);
    let axes = ["x", "y", "z"].into_iter().zip([x, y, z]);
    let along = match axes.into_iter().find(|(_, c)| c.abs() > 0.9986) {
        Some((axis, _)) => axis.to_owned(),
        None if z == 0.0 => format!("({x:.2}, {y:.2})"),
        None => format!("({x:.2}, {y:.2}, {z:.2})"),
    };
    write!(
        f,
        "the points repeat every {length:.4} along {along}: motions beyond {:.4} cannot be told \
         without a largest motion",
        0.5 * length
    )
}

// Pairs alone: do neighbours move together?
//
// Right pairs follow a field that is smooth over a few points. Wrong ones are off by distances of
// the order of the spacing, whatever found them. So each motion is predicted from those of its
// neighbours, by an affine field through the two thirds that agree best, and the median misfit is
// held against the spacing. The likelihood of the default matcher sees more, and judges its
// answers.

/// Neighbours that a motion is predicted from, a dimension: more bend within their reach, fewer
/// leave nothing to leave out.
const NEIGHBOURS: usize = 6;
/// Share of them that is kept.
const AGREEING: f64 = 0.67;
/// Pairs that are looked at: the median of so many is known to a twentieth.
const SAMPLE: usize = 500;
/// Least share of the smaller set that is paired.
const LEAST_PAIRED: f64 = 0.55;
/// Noise, in typical distances of a target from the next, beyond which too many points trade
/// places: chance leaves 0.3 of a lattice and 0.8 of random points. More would be silent on lattices,
/// less doubts noise of a fifth of the spacing (`--example judgement`).
const MOST_NOISE: f64 = 0.25;
/// Misfits beyond so many deviations, and so many spacings, are of pairs that are off.
const OFF: [f64; 2] = [4.0, 0.3];
/// Largest share of those.
const MOST_OFF: f64 = 0.08;
/// A step takes so large a share of a lattice's points near another one, edges left out.
const REPEATED: f64 = 0.65;
/// Near, in steps.
const NEAR_STEP: f64 = 0.2;
/// Steps up to so many times the shortest are looked at: the diagonal of a square.
const LONGEST_STEP: f64 = 1.6;
/// A step away, so many times the motion is out of reach.
const REACH: f64 = 5.0;
/// Sets of which such a share is paired are the same points, not two views of more, if the box that
/// they fill has changed by such a share of a step.
const WHOLE: [f64; 2] = [0.995, 0.25];

impl Judgement {
    /// Judges pairs by the motions of neighbours: `O(n)` for each of [`SAMPLE`] pairs.
    pub(crate) fn of_pairs<const D: usize>(
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
        assignment: &[Option<usize>],
    ) -> Self {
        let scale = centre_and_radius(model).1.max(f64::MIN_POSITIVE);
        let rows = model.iter().zip(assignment);
        let pairs: Vec<_> = rows
            .filter_map(|(x, j)| Some((x.coords / scale, (target[(*j)?] - x) / scale)))
            .collect();
        if (pairs.len() as f64) < LEAST_PAIRED * model.len().min(target.len()) as f64 {
            return Self::Doubtful(Doubt::FewPairs);
        }
        let step = pairs.len().div_ceil(SAMPLE).max(1);
        let sample = (0..pairs.len()).step_by(step);
        let misfits: Vec<f64> = sample.filter_map(|row| misfit(&pairs, row)).collect();
        let spacing = typical_spacing(target) / scale;
        if misfits.is_empty() || spacing <= 0.0 {
            return Self::NotJudged;
        }
        let variance = median(&mut misfits.clone()) / median_of_chi_squared(D);
        let limit = (OFF[0] * variance.sqrt()).max(OFF[1] * spacing).powi(2);
        let off = misfits.iter().filter(|&&misfit| misfit > limit).count();
        if variance.sqrt() > MOST_NOISE * spacing {
            return Self::Doubtful(Doubt::LargeResiduals);
        }
        if off as f64 > MOST_OFF * misfits.len() as f64 {
            return Self::Doubtful(Doubt::Undecided);
        }
        repeats(model, target, &pairs, scale).map_or(Self::Sure, Self::Doubtful)
    }
}

type Motions<const D: usize> = [(SVector<f64, D>, SVector<f64, D>)];

/// Squared distance of a motion from what its neighbours predict, over the variance of that
/// difference at unit noise. `None` if there are too few of them.
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
    // Points on a line have no gradient across it.
    gram += SMatrix::identity() * (1e-3 * gram.trace());
    let inverse = gram.try_inverse()?;
    let arm = at - mean;
    let left = motion - moved - outer * inverse * arm;
    let variance = 1.0 + 1.0 / n + arm.dot(&(inverse * arm));
    Some(left.norm_squared() / variance)
}

/// The step of a lattice after which the answer explains the targets as well, with a motion that is
/// not much larger.
fn repeats<const D: usize>(
    model: &[Point<f64, D>],
    target: &[Point<f64, D>],
    pairs: &Motions<D>,
    scale: f64,
) -> Option<Doubt> {
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
        let meets = |p: &&Point<f64, D>| model.iter().any(|q| (q - **p - step).norm() < near);
        sampled().filter(meets).count() as f64 >= REPEATED * sampled().count() as f64
    };
    let step = others
        .filter(|step| step.norm() <= LONGEST_STEP * shortest)
        .filter(|step| root_mean_square(step) < REACH * own)
        .filter(|step| !(whole && changed > WHOLE[1] * step.norm()))
        .find(repeated)?;
    let mut outward = [0.0; 3];
    (0..D).for_each(|k| outward[k] = step[k]);
    Some(Doubt::Repeats { step: outward })
}

/// Median distance from a target to the next, over a sample.
fn typical_spacing<const D: usize>(target: &[Point<f64, D>]) -> f64 {
    let step = target.len().div_ceil(SAMPLE);
    let nearest = |i: usize| {
        let others = target.iter().enumerate().filter(|&(j, _)| j != i);
        let distances = others.map(|(_, t)| (t - target[i]).norm());
        distances.fold(f64::INFINITY, f64::min)
    };
    let mut distances: Vec<f64> = (0..target.len()).step_by(step).map(nearest).collect();
    let spacing = median(&mut distances);
    if spacing.is_finite() { spacing } else { 0.0 }
}

/// Median of the sum of `dimension` squared standard normal deviates, by the approximation of
/// Wilson and Hilferty (to 1 % from 2 on).
pub(crate) fn median_of_chi_squared(dimension: usize) -> f64 {
    let n = dimension as f64;
    n * (1.0 - 2.0 / (9.0 * n)).powi(3)
}
