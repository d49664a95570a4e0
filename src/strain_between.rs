//! Two point sets in, strain with its error out: match, spline, strain.
use crate::elasticity::ElasticityError;
use crate::elasticity::field::{StrainField, StrainSummary};
use crate::elasticity::strain::{GreenLagrange, StrainMeasure};
use crate::matching::{AnnealedSoftassign, Doubt, MatchError, PointMatcher};
use crate::tps::{RobustFit, ThinPlateSpline, TpsError};
use nalgebra::{Matrix3, Point, SVector};
use std::sync::Arc;

/// The matcher and the measure of strain that [`strain_between`] takes.
///
/// ```
/// use tactile_imaging::{StrainBetweenOptions, elasticity::strain::Hencky, matching::NearestNeighbour};
/// let options = StrainBetweenOptions::<2>::default()
///     .with_matcher(NearestNeighbour::default())
///     .with_measure(Hencky);
/// # let _ = options;
/// ```
#[derive(Clone)]
pub struct StrainBetweenOptions<const D: usize> {
    matcher: Arc<dyn PointMatcher<D> + Send + Sync>,
    measure: Arc<dyn StrainMeasure + Send + Sync>,
    doubtful_pairs: bool,
}

impl<const D: usize> Default for StrainBetweenOptions<D>
where
    AnnealedSoftassign: PointMatcher<D>,
{
    /// Annealed softassign, Green–Lagrange.
    fn default() -> Self {
        Self {
            matcher: Arc::new(AnnealedSoftassign::default()),
            measure: Arc::new(GreenLagrange),
            doubtful_pairs: false,
        }
    }
}

impl<const D: usize> StrainBetweenOptions<D> {
    /// With another matcher.
    #[must_use]
    pub fn with_matcher(mut self, matcher: impl PointMatcher<D> + Send + Sync + 'static) -> Self {
        self.matcher = Arc::new(matcher);
        self
    }

    /// With another measure of strain.
    #[must_use]
    pub fn with_measure(mut self, measure: impl StrainMeasure + Send + Sync + 'static) -> Self {
        self.measure = Arc::new(measure);
        self
    }

    /// Answers with a strain of doubtful pairs too, its [`doubt`](StrainBetween::doubt) beside it.
    /// By default
    /// [`StrainBetweenError::Doubtful`] takes its place.
    #[must_use]
    pub fn with_doubtful_pairs(mut self) -> Self {
        self.doubtful_pairs = true;
        self
    }
}

/// Why the pairs behind a strain may be wrong.
///
/// ```
/// use tactile_imaging::PairsDoubt;
/// let doubt = PairsDoubt::FewPartners { share: 0.31 };
/// assert_eq!(doubt.to_string(), "31 % of the smaller set have a partner on one smooth deformation");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum PairsDoubt {
    /// The matcher's own doubt.
    Matcher(Doubt),
    /// Less than half of the smaller set lies on one smooth deformation.
    FewPartners {
        /// Share of the smaller set that does.
        share: f64,
    },
    /// The residuals are so large that a point cannot be told from its neighbour.
    LargeResiduals {
        /// Noise of one coordinate over the usual distance between neighbours.
        ratio: f64,
    },
}

impl std::fmt::Display for PairsDoubt {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Matcher(Doubt::FewPairs) => {
                f.write_str("the matched points are so few that they may have met by chance")
            }
            Self::Matcher(Doubt::LargeResiduals) => {
                f.write_str("the residuals of the match are as large as those of scattered points")
            }
            Self::Matcher(_) => f.write_str("one matched pair in twenty or more is wrong"),
            Self::FewPartners { share } => write!(
                f,
                "{:.0} % of the smaller set have a partner on one smooth deformation",
                100.0 * share
            ),
            Self::LargeResiduals { ratio } => write!(
                f,
                "the residuals are {:.0} % of the distance between neighbours",
                100.0 * ratio
            ),
        }
    }
}

/// Why there is no strain between two point sets.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_imaging::{StrainBetween, StrainBetweenError, elasticity::strain::GreenLagrange};
/// let points = [Point2::new(0.0, 0.0), Point2::new(1.0, 0.0)];
/// let error = StrainBetween::of_pairs(&points, &points, &[(0, 0), (1, 1)], &GreenLagrange).unwrap_err();
/// assert_eq!(error, StrainBetweenError::TooFewPairs { expected: 16, found: 2 });
/// ```
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StrainBetweenError {
    /// Too few points have a partner.
    #[error(
        "{found} matched points are too few for a smoothing spline and its error, which need {expected}"
    )]
    TooFewPairs {
        /// The least number.
        expected: usize,
        /// Number of pairs.
        found: usize,
    },
    /// The pairs may be wrong, and a strain of doubtful pairs was not asked for.
    #[error("no strain of doubtful pairs: {0}")]
    Doubtful(PairsDoubt),
    /// No smooth deformation takes the points to their partners.
    #[error("the matched points do not lie on any smooth deformation")]
    NotSmooth,
    /// The points could not be matched.
    #[error(transparent)]
    Match(#[from] MatchError),
    /// The spline could not be fitted.
    #[error(transparent)]
    Spline(#[from] TpsError),
    /// The strain does not exist.
    #[error(transparent)]
    Strain(#[from] ElasticityError),
}

/// Matches, displacement and strain between two point sets, each pair a row of the vectors.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct StrainBetween<const D: usize> {
    /// Rows of the matched points, before and after.
    pub rows: Vec<(usize, usize)>,
    /// Matched positions, before and after.
    pub pairs: Vec<[Point<f64, D>; 2]>,
    /// Displacement of every matched point of the first set by the smoothed deformation.
    pub displacements: Vec<SVector<f64, D>>,
    /// Weight of every pair in the spline.
    pub weights: Vec<f64>,
    /// Strain at every matched point of the first set.
    pub strains: Vec<Matrix3<f64>>,
    /// Standard error of the strain at every matched point, as that of the mean.
    pub standard_errors: Vec<Matrix3<f64>>,
    /// Mean and spread of the strains.
    pub summary: StrainSummary,
    /// Standard error of the mean: the jackknife over the spline's parts, and the response of the
    /// spline's weights.
    pub standard_error: Matrix3<f64>,
    /// Degrees of freedom of the standard error: parts less one.
    pub degrees_of_freedom: usize,
    /// Noise of one coordinate, in the points' unit.
    pub sigma: f64,
    /// Smoothing λ over the squared radius of the points.
    pub relative_lambda: f64,
    /// Why the pairs may be wrong, where there is a reason.
    pub doubt: Option<PairsDoubt>,
}

/// Strain of the first set on its way to the second.
///
/// The points are matched, a smoothing spline is fitted robustly through the pairs, and its
/// gradient is strained at every matched point. Wrong pairs get no weight, and pairs that the
/// matcher missed are found by the spline. O(n³) time.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_imaging::{StrainBetweenOptions, strain_between};
/// // A sheet of 8 × 8 points is stretched by 2 % along x.
/// let before: Vec<_> = (0..64)
///     .map(|k| Point2::new(f64::from(k % 8) + 0.2 * f64::from(k % 3), f64::from(k / 8)))
///     .collect();
/// let after: Vec<_> = before.iter().map(|p| Point2::new(1.02 * p.x, p.y)).collect();
/// let found = strain_between(&before, &after, &StrainBetweenOptions::default())?;
/// assert_eq!(found.pairs.len(), 64);
/// // Green–Lagrange: (1.02² − 1)/2.
/// assert!((found.summary.mean[(0, 0)] - 0.0202).abs() < 1e-6);
/// assert!((found.displacements[7].x - 0.02 * before[7].x).abs() < 1e-6);
/// # Ok::<(), tactile_imaging::StrainBetweenError>(())
/// ```
///
/// # Errors
/// [`StrainBetweenError`].
pub fn strain_between<const D: usize>(
    before: &[Point<f64, D>],
    after: &[Point<f64, D>],
    options: &StrainBetweenOptions<D>,
) -> Result<StrainBetween<D>, StrainBetweenError> {
    let matching = options.matcher.match_points(before, after)?;
    let partner = |(i, j): (usize, &Option<usize>)| j.map(|j| (i, j));
    let pairs: Vec<_> = matching
        .assignment
        .iter()
        .enumerate()
        .filter_map(partner)
        .collect();
    let mut found = StrainBetween::of_pairs(before, after, &pairs, options.measure.as_ref())?;
    found.doubt = matching
        .report
        .doubt
        .map(PairsDoubt::Matcher)
        .or(found.doubt);
    match found.doubt {
        Some(doubt) if !options.doubtful_pairs => Err(StrainBetweenError::Doubtful(doubt)),
        _ => Ok(found),
    }
}

impl<const D: usize> StrainBetween<D> {
    /// Strain from the pairs of a match, rows of both sets: the second half of [`strain_between`].
    ///
    /// # Errors
    /// [`StrainBetweenError`].
    pub fn of_pairs(
        before: &[Point<f64, D>],
        after: &[Point<f64, D>],
        matched: &[(usize, usize)],
        measure: &dyn StrainMeasure,
    ) -> Result<Self, StrainBetweenError> {
        // Fewer leave the parts of the jackknife empty.
        let expected = 16;
        let found = matched.len();
        if found < expected {
            return Err(StrainBetweenError::TooFewPairs { expected, found });
        }
        let rough = fit(before, after, matched)?;
        let spacing = median_spacing(after);
        // A point that lies where the spline predicts is a partner, whatever the matcher's answer.
        let rows = partners(before, after, &rough, spacing);
        if rows.len() < expected {
            return Err(StrainBetweenError::NotSmooth);
        }
        let robust = fit(before, after, &rows)?;
        let sources: Vec<_> = rows.iter().map(|&(i, _)| before[i]).collect();
        let strained = |spline| {
            let gradients = gradients(spline, &sources);
            StrainField::from_gradients(&gradients, None, measure)
        };
        let field = strained(&robust.spline)?;
        let folds = (robust.folds.iter())
            .map(strained)
            .collect::<Result<Vec<_>, _>>()?;
        let means: Vec<_> = folds.iter().map(|fold| fold.summary().mean).collect();
        let errors_at = |k: usize| {
            let without: Vec<_> = folds.iter().map(|fold| fold.strains[k]).collect();
            jackknife(&without) * robust.response
        };
        let displacement = |p: &Point<f64, D>| robust.spline.apply(p) - p;
        let share = rows.len() as f64 / before.len().min(after.len()) as f64;
        Ok(Self {
            doubt: doubt(share, robust.sigma / spacing),
            pairs: rows.iter().map(|&(i, j)| [before[i], after[j]]).collect(),
            displacements: sources.iter().map(displacement).collect(),
            standard_errors: (0..rows.len()).map(errors_at).collect(),
            rows,
            strains: field.strains.to_vec(),
            summary: field.summary(),
            standard_error: jackknife(&means) * robust.response,
            degrees_of_freedom: means.len() - 1,
            weights: robust.weights,
            sigma: robust.sigma,
            relative_lambda: robust.relative_lambda,
        })
    }
}

fn fit<const D: usize>(
    before: &[Point<f64, D>],
    after: &[Point<f64, D>],
    pairs: &[(usize, usize)],
) -> Result<RobustFit<D>, TpsError> {
    let sources: Vec<_> = pairs.iter().map(|&(i, _)| before[i]).collect();
    let targets: Vec<_> = pairs.iter().map(|&(_, j)| after[j]).collect();
    RobustFit::new(&sources, &targets, None)
}

/// H = ∇f − I at every point, in three dimensions.
fn gradients<const D: usize>(
    spline: &ThinPlateSpline<f64, D>,
    points: &[Point<f64, D>],
) -> Vec<Matrix3<f64>> {
    points
        .iter()
        .map(|p| {
            let mut h = spline.jacobian(p).fixed_resize::<3, 3>(0.0);
            (0..D).for_each(|i| h[(i, i)] -= 1.0);
            h
        })
        .collect()
}

/// Why a share of matched points or their residuals over the distance between neighbours cast doubt
/// on the pairs.
///
/// Where the deformation is wrong, a prediction meets some point within a third of the spacing by
/// chance, a tenth of them in space and a third in the plane. Residuals of a quarter of the spacing
/// exchange one neighbour in twenty.
fn doubt(share: f64, ratio: f64) -> Option<PairsDoubt> {
    if share < 0.5 {
        Some(PairsDoubt::FewPartners { share })
    } else if ratio > 0.25 {
        Some(PairsDoubt::LargeResiduals { ratio })
    } else {
        None
    }
}

/// The point of a set nearest to `p`, without the one of row `not`.
fn nearest<const D: usize>(p: &Point<f64, D>, set: &[Point<f64, D>], not: usize) -> Option<usize> {
    let distance = |k: usize| (set[k] - p).norm_squared();
    (0..set.len())
        .filter(|&k| k != not)
        .min_by(|&a, &b| distance(a).total_cmp(&distance(b)))
}

/// Median distance to the nearest neighbour.
fn median_spacing<const D: usize>(points: &[Point<f64, D>]) -> f64 {
    let mut spacing: Vec<f64> = (0..points.len())
        .filter_map(|j| nearest(&points[j], points, j).map(|k| (points[k] - points[j]).norm()))
        .collect();
    spacing.sort_by(f64::total_cmp);
    spacing.get(spacing.len() / 2).copied().unwrap_or(0.0)
}

/// Mutual nearest neighbours of prediction and target, within a third of the targets' usual
/// spacing.
fn partners<const D: usize>(
    before: &[Point<f64, D>],
    after: &[Point<f64, D>],
    rough: &RobustFit<D>,
    spacing: f64,
) -> Vec<(usize, usize)> {
    let predicted: Vec<_> = before.iter().map(|p| rough.spline.apply(p)).collect();
    let reach = spacing / 3.0;
    (0..before.len())
        .filter_map(|i| nearest(&predicted[i], after, usize::MAX).map(|j| (i, j)))
        .filter(|&(i, j)| (after[j] - predicted[i]).norm() <= reach)
        .filter(|&(i, j)| nearest(&after[j], &predicted, usize::MAX) == Some(i))
        .collect()
}

/// √((K − 1)/K Σ(θₖ − θ̄)²) of the means without one part each.
fn jackknife(means: &[Matrix3<f64>]) -> Matrix3<f64> {
    let k = means.len() as f64;
    let centre: Matrix3<f64> = means.iter().sum::<Matrix3<f64>>() / k;
    let squares = means
        .iter()
        .map(|m| (m - centre).component_mul(&(m - centre)))
        .sum::<Matrix3<f64>>();
    squares.map(|s| (s * (k - 1.0) / k).sqrt())
}
