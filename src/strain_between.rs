//! From two point sets to a strain with its error: match, field, strain.
use crate::elasticity::ElasticityError;
use crate::elasticity::field::{StrainField, StrainSummary};
use crate::elasticity::strain::{Deformation, GreenLagrange, StrainMeasure};
use crate::matching::{
    AnnealedSoftassign, Doubt, LatticeStep, MatchError, Matching, PointMatcher, StopReason,
};
use crate::tps::{LocalField, LocalValue, TpsError, nearest_rows};
use nalgebra::{Matrix3, Point, SMatrix, SVector};
use std::ops::ControlFlow;
use std::sync::Arc;

/// The matcher and the strain measure of [`strain_between`].
///
/// ```
/// use tactile_imaging::{
///     StrainBetweenOptions, elasticity::strain::Hencky, matching::NearestNeighbour,
/// };
/// let options = StrainBetweenOptions::<2>::default()
///     .with_matcher(NearestNeighbour::default())
///     .with_measure(Hencky);
/// # let _ = options;
/// ```
#[derive(Clone)]
pub struct StrainBetweenOptions<const D: usize> {
    pub(crate) matcher: Arc<dyn PointMatcher<D> + Send + Sync>,
    measure: Arc<dyn StrainMeasure + Send + Sync>,
    doubtful_pairs: bool,
    watch: Watch,
}

/// Whether to go on.
type Watch = Arc<dyn Fn() -> ControlFlow<()> + Send + Sync>;

impl<const D: usize> Default for StrainBetweenOptions<D>
where
    AnnealedSoftassign: PointMatcher<D>,
{
    /// Annealed softassign and Green–Lagrange strain.
    fn default() -> Self {
        Self {
            matcher: Arc::new(AnnealedSoftassign::default()),
            measure: Arc::new(GreenLagrange),
            doubtful_pairs: false,
            watch: Arc::new(|| ControlFlow::Continue(())),
        }
    }
}

impl<const D: usize> StrainBetweenOptions<D> {
    /// Sets the matcher.
    #[must_use]
    pub fn with_matcher(mut self, matcher: impl PointMatcher<D> + 'static) -> Self {
        self.matcher = Arc::new(matcher);
        self
    }

    /// Sets the strain measure.
    #[must_use]
    pub fn with_measure(mut self, measure: impl StrainMeasure + 'static) -> Self {
        self.measure = Arc::new(measure);
        self
    }

    /// Returns the strain of doubtful pairs too, with its [`doubt`](StrainBetween::doubt). By
    /// default the result is [`StrainBetweenError::Doubtful`] instead.
    #[must_use]
    pub fn with_doubtful_pairs(mut self) -> Self {
        self.doubtful_pairs = true;
        self
    }

    /// Calls `watch` many times a second and stops with
    /// [`TpsError::Stopped`](crate::tps::TpsError::Stopped) if it returns `Break`.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use std::ops::ControlFlow;
    /// use tactile_imaging::{StrainBetweenOptions, strain_between, tps::TpsError};
    /// let points: Vec<_> = (0..36).map(|k| Point2::new(f64::from(k % 6), f64::from(k / 6))).collect();
    /// let options = StrainBetweenOptions::default()
    ///     .with_doubtful_pairs()
    ///     .with_watch(|| ControlFlow::Break(()));
    /// let stopped = strain_between(&points, &points, &options).unwrap_err();
    /// assert_eq!(stopped, TpsError::Stopped.into());
    /// ```
    #[must_use]
    pub fn with_watch(
        mut self,
        watch: impl Fn() -> ControlFlow<()> + Send + Sync + 'static,
    ) -> Self {
        self.watch = Arc::new(watch);
        self
    }

    fn work(&self) -> (&dyn StrainMeasure, &dyn Fn() -> ControlFlow<()>) {
        (&*self.measure, &*self.watch)
    }

    /// The match of two sets.
    pub(crate) fn matched(
        &self,
        before: &[Point<f64, D>],
        after: &[Point<f64, D>],
    ) -> Result<Matching<D>, StrainBetweenError> {
        let found = self
            .matcher
            .match_watched(before, after, &mut || (self.watch)())?;
        match found.report.stop {
            StopReason::Cancelled => Err(TpsError::Stopped.into()),
            _ => Ok(found),
        }
    }

    /// Strain from the pairs of tracks, even if they are few of the points.
    pub(crate) fn total(
        &self,
        before: &[Point<f64, D>],
        after: &[Point<f64, D>],
        pairs: &[(usize, usize)],
    ) -> Result<StrainBetween<D>, StrainBetweenError> {
        let work = self.work();
        self.allow(StrainBetween::of_share(
            before,
            after,
            pairs,
            work,
            pairs.len(),
        )?)
    }

    /// The strain, or an error if its pairs are doubtful and such pairs are not allowed.
    fn allow(&self, found: StrainBetween<D>) -> Result<StrainBetween<D>, StrainBetweenError> {
        match found.doubt {
            Some(doubt) if !self.doubtful_pairs => Err(StrainBetweenError::Doubtful(doubt)),
            _ => Ok(found),
        }
    }
}

/// Why the pairs behind a strain may be wrong.
///
/// ```
/// use tactile_imaging::PairsDoubt;
/// let doubt = PairsDoubt::FewPartners { share: 0.31 };
/// assert_eq!(
///     doubt.to_string(),
///     "31 % of the smaller set have a partner on one smooth deformation"
/// );
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum PairsDoubt {
    /// The doubt of the matcher.
    Matcher(Doubt),
    /// Less than half of the smaller set fits one smooth deformation.
    FewPartners {
        /// Fraction of the smaller set that does.
        share: f64,
    },
    /// The residuals are so large that a point cannot be distinguished from its neighbour.
    LargeResiduals {
        /// Noise of one coordinate over the typical distance between neighbours.
        ratio: f64,
    },
    /// The points lie in a plane in space, so the deformation normal to it is unknown.
    Flat,
    /// One set is a mirror image of the other, which is not a deformation.
    Mirrored,
}

impl std::fmt::Display for PairsDoubt {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Matcher(doubt) => doubt.fmt(f),
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
            Self::Flat => {
                f.write_str("the points lie in a plane, and the strain normal to it is unknown")
            }
            Self::Mirrored => f.write_str("one set is a mirror image of the other"),
        }
    }
}

/// Why the strain between two point sets could not be computed.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_imaging::{StrainBetween, StrainBetweenError, elasticity::strain::GreenLagrange};
/// let points = [Point2::new(0.0, 0.0), Point2::new(1.0, 0.0)];
/// let error =
///     StrainBetween::of_pairs(&points, &points, &[(0, 0), (1, 1)], &GreenLagrange).unwrap_err();
/// assert_eq!(
///     error,
///     StrainBetweenError::TooFewPairs {
///         expected: 4,
///         found: 2
///     }
/// );
/// ```
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StrainBetweenError {
    /// Too few points have a partner.
    #[error("{found} matched points are too few for a strain and its error, which need {expected}")]
    TooFewPairs {
        /// Minimum number of pairs.
        expected: usize,
        /// Number of pairs.
        found: usize,
    },
    /// The pairs may be wrong, and strain of doubtful pairs is not allowed.
    #[error("no strain of doubtful pairs: {0}")]
    Doubtful(PairsDoubt),
    /// No smooth deformation maps the points to their partners.
    #[error("the matched points do not lie on any smooth deformation")]
    NotSmooth,
    /// The points could not be matched.
    #[error(transparent)]
    Match(#[from] MatchError),
    /// The field could not be fitted.
    #[error(transparent)]
    Field(#[from] TpsError),
    /// The strain could not be computed.
    #[error(transparent)]
    Strain(#[from] ElasticityError),
}

/// Matches, displacement and strain between two point sets. Each vector has one entry per pair.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct StrainBetween<const D: usize> {
    /// Rows of the matched points, before and after.
    pub rows: Vec<(usize, usize)>,
    /// Matched positions, before and after.
    pub pairs: Vec<[Point<f64, D>; 2]>,
    /// Displacement of each matched point of the first set, by the field.
    pub displacements: Vec<SVector<f64, D>>,
    /// Weight of each pair in the field, 0 if it was excluded.
    pub weights: Vec<f64>,
    /// Strain at each matched point of the first set.
    pub strains: Vec<Matrix3<f64>>,
    /// Standard error of the strain at each matched point, with the same conventions as for the
    /// mean.
    pub standard_errors: Vec<Matrix3<f64>>,
    /// Mean and spread of the strains.
    pub summary: StrainSummary,
    /// Standard error of the mean. Points of one patch are assumed to share their errors.
    pub standard_error: Matrix3<f64>,
    /// Degrees of freedom of the standard error.
    pub degrees_of_freedom: usize,
    /// Noise of one coordinate, in the unit of the points.
    pub sigma: f64,
    /// Number of points whose surrounding noise is far above that elsewhere: short waves or jumps
    /// that the pairs do not resolve. Their standard errors include it.
    pub unresolved: usize,
    /// Why the pairs may be wrong. `None` if no check raised a doubt.
    pub doubt: Option<PairsDoubt>,
    /// A lattice step by which the pairs can be shifted, see
    /// [`MatchReport::period`](crate::matching::MatchReport::period): the smallest
    /// motion is assumed. `None` for pairs that were given.
    pub period: Option<LatticeStep>,
    pub(crate) field: LocalField<D>,
    /// The field at each matched point.
    pub(crate) values: Vec<LocalValue<D>>,
}

/// Displacement and strain at a point in the space of the first set.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct StrainAt<const D: usize> {
    /// Displacement.
    pub displacement: SVector<f64, D>,
    /// Strain. NaN if the deformation folds.
    pub strain: Matrix3<f64>,
    /// Standard error of the strain, which grows away from the matched points.
    pub standard_error: Matrix3<f64>,
    /// The local fit.
    pub(crate) value: LocalValue<D>,
}

/// Strain of the deformation from the first set to the second.
///
/// The points are matched, a [`LocalField`] is fitted through the pairs, and the strain follows
/// from its gradient at each matched point. Wrong pairs have no weight, and pairs that the matcher
/// missed are found where the field predicts them. Time and memory are proportional to the number
/// of pairs.
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
    let matching = options.matched(before, after)?;
    StrainBetween::of_matching(before, after, &matching, options)
}

impl<const D: usize> StrainBetween<D> {
    /// Strain from a match of two sets: the second step of [`strain_between`].
    ///
    /// # Errors
    /// [`StrainBetweenError`].
    pub fn of_matching(
        before: &[Point<f64, D>],
        after: &[Point<f64, D>],
        matching: &Matching<D>,
        options: &StrainBetweenOptions<D>,
    ) -> Result<Self, StrainBetweenError> {
        let partner = |(i, j): (usize, &Option<usize>)| j.map(|j| (i, j));
        let assignment = matching.assignment.iter().enumerate();
        let pairs: Vec<_> = assignment.filter_map(partner).collect();
        let doubt = matching.report.doubt().map(PairsDoubt::Matcher);
        if let Some(doubt) = doubt
            && !options.doubtful_pairs
        {
            return Err(StrainBetweenError::Doubtful(doubt));
        }
        let possible = before.len().min(after.len());
        let mut found = Self::of_share(before, after, &pairs, options.work(), possible)?;
        found.doubt = doubt.or(found.doubt);
        found.period = matching.report.period;
        options.allow(found)
    }

    /// Strain from known pairs, for example from finite elements, image correlation or a tracker:
    /// row i of `before` corresponds to row i of `after`. Nothing is matched.
    ///
    /// Rows with a non-finite coordinate are skipped: [`rows`](Self::rows) lists the others.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_imaging::{StrainBetween, StrainBetweenOptions};
    /// let mut before: Vec<_> = (0..64)
    ///     .map(|k| Point2::new(f64::from(k % 8), f64::from(k / 8)))
    ///     .collect();
    /// let after: Vec<_> = before
    ///     .iter()
    ///     .map(|p| Point2::new(1.5 * p.x + 20.0, p.y))
    ///     .collect();
    /// before[5].x = f64::NAN;
    /// let options = StrainBetweenOptions::default();
    /// let found = StrainBetween::of_known_pairs(&before, &after, &options)?;
    /// assert_eq!((found.rows.len(), found.rows[5]), (63, (6, 6)));
    /// assert!((found.summary.mean[(0, 0)] - 0.625).abs() < 1e-6);
    /// # Ok::<(), tactile_imaging::StrainBetweenError>(())
    /// ```
    ///
    /// # Errors
    /// [`StrainBetweenError`], including one for sets of different lengths.
    pub fn of_known_pairs(
        before: &[Point<f64, D>],
        after: &[Point<f64, D>],
        options: &StrainBetweenOptions<D>,
    ) -> Result<Self, StrainBetweenError> {
        if before.len() != after.len() {
            let (expected, found) = (before.len(), after.len());
            let input = "points after";
            return Err(TpsError::Length {
                input,
                expected,
                found,
            }
            .into());
        }
        let finite = |p: &Point<f64, D>| p.iter().all(|x| x.is_finite());
        let known = |&i: &usize| finite(&before[i]) && finite(&after[i]);
        let known: Vec<usize> = (0..before.len()).filter(known).collect();
        let [from, to] = [before, after].map(|set| -> Vec<_> {
            let places = known.iter().map(|&i| set[i]);
            places.collect()
        });
        let pairs: Vec<_> = (0..known.len()).map(|k| (k, k)).collect();
        let mut found = Self::of_share(&from, &to, &pairs, options.work(), pairs.len())?;
        for (i, j) in &mut found.rows {
            (*i, *j) = (known[*i], known[*j]);
        }
        // The correspondence is known, so no point can be mistaken for its neighbour.
        let doubt = found.doubt;
        found.doubt = doubt.filter(|d| !matches!(d, PairsDoubt::LargeResiduals { .. }));
        options.allow(found)
    }

    /// Strain from pairs, given as rows of both sets. A [`doubt`](Self::doubt) is not an error
    /// here.
    ///
    /// # Errors
    /// [`StrainBetweenError`].
    pub fn of_pairs(
        before: &[Point<f64, D>],
        after: &[Point<f64, D>],
        matched: &[(usize, usize)],
        measure: &dyn StrainMeasure,
    ) -> Result<Self, StrainBetweenError> {
        let possible = before.len().min(after.len());
        let watch = || ControlFlow::Continue(());
        Self::of_share(before, after, matched, (measure, &watch), possible)
    }

    /// Like `of_pairs`, if this number of points can have a partner.
    fn of_share(
        before: &[Point<f64, D>],
        after: &[Point<f64, D>],
        matched: &[(usize, usize)],
        (measure, watch): (&dyn StrainMeasure, &dyn Fn() -> ControlFlow<()>),
        possible: usize,
    ) -> Result<Self, StrainBetweenError> {
        // An affine field, and one more pair for its error.
        let expected = D + 2;
        let found = matched.len();
        if found < expected {
            return Err(StrainBetweenError::TooFewPairs { expected, found });
        }
        let mut rows = among_matched(before, after, matched);
        if rows.len() < expected {
            return Err(StrainBetweenError::NotSmooth);
        }
        let mut sources: Vec<_> = rows.iter().map(|&(i, _)| before[i]).collect();
        let targets: Vec<_> = rows.iter().map(|&(_, j)| after[j]).collect();
        let field = LocalField::fit_watched(&sources, &targets, |_| watch())?;
        let mut values = field.values.clone();
        let mut weights: Vec<f64> = (field.kept.iter())
            .map(|&kept| f64::from(u8::from(kept)))
            .collect();
        let spacing = median(values.iter().map(|value| value.spacing)).unwrap_or(0.0);
        let (missed, found) = missed_partners(before, after, &rows, &field, spacing / 3.0);
        sources.extend(missed.iter().map(|&(i, _)| before[i]));
        rows.extend(missed);
        values.extend(found);
        weights.resize(rows.len(), 1.0);
        let strained = StrainField::from_gradients(&gradients_of(&values), None, measure)?;
        let errors = |value: &LocalValue<D>| strain_error(value, measure);
        let standard_errors: Vec<_> = values.iter().map(errors).collect();
        let centre = mean_value(&values, field.mean_gradient_covariance);
        // Noise and detail that the pairs do not resolve. A rough field through wrong pairs has no
        // noise.
        let usual = [0.674_5, 1.177_4, 1.538_2][D - 1];
        let miss = median(field.misses.iter().copied()).unwrap_or(0.0) / usual;
        let sigma = median(values.iter().map(|value| value.sigma)).unwrap_or(0.0);
        let kept = weights.iter().sum::<f64>();
        let share = kept / possible as f64;
        Ok(Self {
            doubt: doubt(share, miss / spacing).or(shape_doubt(&sources, &strained)),
            period: None,
            pairs: rows.iter().map(|&(i, j)| [before[i], after[j]]).collect(),
            displacements: values.iter().map(|value| value.displacement).collect(),
            rows,
            weights,
            strains: strained.strains.to_vec(),
            summary: strained.summary(),
            standard_error: centre.map_or(Matrix3::zeros(), |mean| strain_error(&mean, measure)),
            degrees_of_freedom: field.degrees_of_freedom,
            unresolved: values.iter().filter(|value| value.unresolved).count(),
            field,
            values,
            standard_errors,
            sigma,
        })
    }

    /// Whether a pair contributes to the deformation and was not rejected as misplaced.
    #[must_use]
    pub fn is_kept(&self, pair: usize) -> bool {
        self.weights.get(pair).is_some_and(|&weight| weight >= 1e-3)
    }

    /// The images of points in the space of the first set under the deformation.
    pub(crate) fn images(&self, points: &[Point<f64, D>]) -> Vec<Point<f64, D>> {
        let moved = self.field.at(points).into_iter().zip(points);
        moved.map(|(value, p)| p + value.displacement).collect()
    }

    /// Displacement and strain at any points in the space of the first set.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_imaging::{StrainBetween, elasticity::strain::GreenLagrange};
    /// let before: Vec<_> = (0..64)
    ///     .map(|k| Point2::new(f64::from(k % 8), f64::from(k / 8)))
    ///     .collect();
    /// let after: Vec<_> = before
    ///     .iter()
    ///     .map(|p| Point2::new(1.02 * p.x, p.y))
    ///     .collect();
    /// let rows: Vec<_> = (0..64).map(|k| (k, k)).collect();
    /// let found = StrainBetween::of_pairs(&before, &after, &rows, &GreenLagrange)?;
    /// let at = found.at(&[Point2::new(2.5, 3.5)], &GreenLagrange)?[0];
    /// assert!((at.strain[(0, 0)] - 0.0202).abs() < 1e-6);
    /// # Ok::<(), tactile_imaging::StrainBetweenError>(())
    /// ```
    ///
    /// # Errors
    /// [`StrainBetweenError::Strain`].
    pub fn at(
        &self,
        points: &[Point<f64, D>],
        measure: &dyn StrainMeasure,
    ) -> Result<Vec<StrainAt<D>>, StrainBetweenError> {
        self.at_watched(points, measure, || ControlFlow::Continue(()))
    }

    /// Like [`at`](Self::at). `watch` is called many times a second and may stop it.
    ///
    /// # Errors
    /// Those of [`at`](Self::at), and [`TpsError::Stopped`](crate::tps::TpsError::Stopped).
    pub fn at_watched(
        &self,
        points: &[Point<f64, D>],
        measure: &dyn StrainMeasure,
        watch: impl FnMut() -> ControlFlow<()>,
    ) -> Result<Vec<StrainAt<D>>, StrainBetweenError> {
        let values = self.field.at_watched(points, watch)?;
        let mut strained = StrainField::from_gradients(&gradients_of(&values), None, measure)?;
        for &folded in &strained.folded {
            strained.strains[folded].fill(f64::NAN);
        }
        let at = |(value, strain): (&LocalValue<D>, &Matrix3<f64>)| StrainAt {
            displacement: value.displacement,
            strain: *strain,
            standard_error: strain_error(value, measure),
            value: *value,
        };
        Ok(values.iter().zip(&strained.strains).map(at).collect())
    }
}

/// The displacement gradient H of each local fit, in three dimensions.
fn gradients_of<const D: usize>(values: &[LocalValue<D>]) -> Vec<Matrix3<f64>> {
    let gradients = values.iter().map(|value| value.gradient.fixed_resize(0.0));
    gradients.collect()
}

/// The mean of local values, with this covariance of its gradient.
fn mean_value<const D: usize>(
    values: &[LocalValue<D>],
    covariance: SMatrix<f64, D, D>,
) -> Option<LocalValue<D>> {
    let mut mean = *values.first()?;
    let gradients = values.iter().map(|value| value.gradient);
    mean.gradient = gradients.sum::<SMatrix<f64, D, D>>() / values.len() as f64;
    mean.gradient_covariance = covariance;
    Some(mean)
}

/// Standard error of the strain, to first order in the error of the gradient. Infinite if the
/// strain depends on a derivative along an axis that the points do not span.
fn strain_error<const D: usize>(
    value: &LocalValue<D>,
    measure: &dyn StrainMeasure,
) -> Matrix3<f64> {
    let undefined = Matrix3::from_element(f64::NAN);
    let strain = |gradient: &SMatrix<f64, D, D>| {
        let h: Matrix3<f64> = gradient.fixed_resize(0.0);
        measure.of(&Deformation::from_displacement_gradient(h)).ok()
    };
    let Some(centre) = strain(&value.gradient) else {
        return undefined;
    };
    let mut squares = Matrix3::zeros();
    let mut add = |row: usize, direction: SVector<f64, D>, factor: f64| {
        let mut moved = value.gradient;
        (0..D).for_each(|a| moved[(row, a)] += direction[a]);
        let change = strain(&moved).map(|strain| strain - centre);
        squares += change.map_or(undefined, |change| {
            change.map(|c| if c == 0.0 { 0.0 } else { factor * c * c })
        });
    };
    let known = |a: usize| value.gradient_covariance[(a, a)].is_finite();
    let finite = SMatrix::<f64, D, D>::from_fn(|a, b| match known(a) && known(b) {
        true => value.gradient_covariance[(a, b)],
        false => 0.0,
    });
    let eigen = nalgebra::SymmetricEigen::new(finite.fixed_resize::<3, 3>(0.0));
    for row in 0..D {
        for (size, direction) in eigen
            .eigenvalues
            .iter()
            .zip(eigen.eigenvectors.column_iter())
        {
            let direction: SVector<f64, D> = direction.fixed_resize::<D, 1>(0.0);
            add(row, direction * size.max(0.0).sqrt(), 1.0);
        }
        for axis in (0..D).filter(|&a| !known(a)) {
            // The strain depends on this derivative if any step changes it.
            let direction = SVector::from_fn(|a, _| if a == axis { 1e-3 } else { 0.0 });
            add(row, direction, f64::INFINITY);
        }
    }
    squares.map(f64::sqrt)
}

/// Keeps the pairs around which most points of both sets have a partner. If a matcher fails, for
/// example in a corner that it confused with another, single points match by chance. A part that
/// exists in one set only has partners on the other side.
fn among_matched<const D: usize>(
    before: &[Point<f64, D>],
    after: &[Point<f64, D>],
    matched: &[(usize, usize)],
) -> Vec<(usize, usize)> {
    // Half of the typical fraction in both sets: with random outliers, one pair in 10⁴ has fewer.
    let neighbours = 16.min(before.len()).min(after.len());
    let matched_nearby = |set: &[Point<f64, D>], rows: &[usize]| -> Vec<bool> {
        let mut has_partner = vec![false; set.len()];
        rows.iter().for_each(|&row| has_partner[row] = true);
        let least = 0.5 * (neighbours * rows.len()) as f64 / set.len() as f64;
        let places: Vec<_> = rows.iter().map(|&row| set[row]).collect();
        let near = nearest_rows(set, &places, neighbours).into_iter();
        let partners = near.map(|near| near.iter().filter(|&&row| has_partner[row]).count());
        partners.map(|count| count as f64 >= least).collect()
    };
    let (own, other): (Vec<_>, Vec<_>) = matched.iter().copied().unzip();
    let (own, other) = (matched_nearby(before, &own), matched_nearby(after, &other));
    let pairs = matched.iter().zip(own.iter().zip(&other));
    let kept = pairs.filter(|(_, (own, other))| **own || **other);
    kept.map(|(pair, _)| *pair).collect()
}

/// Pairs of unmatched points whose prediction meets an unmatched point, with the field there.
fn missed_partners<const D: usize>(
    before: &[Point<f64, D>],
    after: &[Point<f64, D>],
    matched: &[(usize, usize)],
    field: &LocalField<D>,
    reach: f64,
) -> (Vec<(usize, usize)>, Vec<LocalValue<D>>) {
    let (mut open, mut free) = (vec![true; before.len()], vec![true; after.len()]);
    for &(i, j) in matched {
        (open[i], free[j]) = (false, false);
    }
    let open: Vec<usize> = (0..before.len()).filter(|&i| open[i]).collect();
    let mut free: Vec<usize> = (0..after.len()).filter(|&j| free[j]).collect();
    // Only points close along the first axis can be close.
    free.sort_unstable_by(|&a, &b| after[a][0].total_cmp(&after[b][0]));
    let places: Vec<_> = open.iter().map(|&i| before[i]).collect();
    let values = field.at(&places);
    let mut meetings = Vec::new();
    for (k, value) in values.iter().enumerate() {
        // Four standard errors of the prediction and the point. Beyond a third of the spacing, a
        // chance coincidence is equally likely.
        let error = (value.displacement_variance + value.sigma * value.sigma).sqrt();
        if 4.0 * error > reach {
            continue;
        }
        let reach = (4.0 * error).max(0.1 * reach);
        let predicted = places[k] + value.displacement;
        let first = free.partition_point(|&j| after[j][0] < predicted[0] - reach);
        let near = free[first..]
            .iter()
            .take_while(|&&j| after[j][0] <= predicted[0] + reach);
        let distances = near.map(|&j| ((after[j] - predicted).norm(), k, j));
        meetings.extend(distances.filter(|meeting| meeting.0 <= reach));
    }
    meetings.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let (mut pairs, mut found) = (Vec::new(), Vec::new());
    let (mut taken, mut settled) = (vec![false; after.len()], vec![false; open.len()]);
    for (_, k, j) in meetings {
        if !taken[j] && !settled[k] {
            (taken[j], settled[k]) = (true, true);
            pairs.push((open[k], j));
            found.push(values[k]);
        }
    }
    (pairs, found)
}

/// The median, the upper one of two.
pub(crate) fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    let middle = values.len() / 2;
    let place =
        (middle < values.len()).then(|| values.select_nth_unstable_by(middle, f64::total_cmp));
    place.map(|(_, value, _)| *value)
}

/// A doubt about sets whose strain is meaningless.
fn shape_doubt<const D: usize>(
    sources: &[Point<f64, D>],
    field: &StrainField,
) -> Option<PairsDoubt> {
    let centre = sources.iter().map(|p| p.coords).sum::<SVector<f64, D>>() / sources.len() as f64;
    let mut scatter = Matrix3::zeros();
    for p in sources {
        let r: nalgebra::Vector3<f64> = (p.coords - centre).fixed_resize(0.0);
        scatter += r * r.transpose();
    }
    let extents = scatter.symmetric_eigenvalues();
    let (least, most) = (extents.min(), extents.max());
    if D == 3 && least < 1e-8 * most {
        return Some(PairsDoubt::Flat); // a ten-thousandth of the extent: rounding of coordinates
    }
    (2 * field.folded.len() > sources.len()).then_some(PairsDoubt::Mirrored)
}

/// A doubt if too few points match, or if their residuals are too large compared with the distance
/// between neighbours.
///
/// If the deformation is wrong, a prediction meets some point within a third of the spacing by
/// chance: a tenth of them in space and a third in the plane. Residuals of a quarter of the spacing
/// swap one neighbour in twenty.
fn doubt(share: f64, ratio: f64) -> Option<PairsDoubt> {
    if share < 0.5 {
        Some(PairsDoubt::FewPartners { share })
    } else if ratio > 0.25 {
        Some(PairsDoubt::LargeResiduals { ratio })
    } else {
        None
    }
}
