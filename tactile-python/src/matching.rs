//! Matching of points, with a matcher of this library or one written in Python.
use crate::arrays;
use crate::errors::{self, Signals, invalid};
use crate::own::OwnStage;
use crate::results::{Match, StrainBetween, StrainGrid};
use nalgebra::{Matrix3, Point};
use ndarray::{Array2, ArrayView2};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyDict;
use std::str::FromStr;
use std::sync::{Arc, Mutex};
use tactile_imaging::core::statistics::quantile_95;
use tactile_imaging::elasticity::kinematics::StrainQuantities;
use tactile_imaging::elasticity::strain::{GreenLagrange, StrainMeasure};
use tactile_imaging::matching::labelling::{Compatibility, LengthMaximum, Neighbourhood};
use tactile_imaging::matching::{
    AnnealedSoftassign, CoherentPointDrift, FittedTransformation, LinearAssignment, Matching,
    NearestNeighbour, Normalization, Outliers, PointMatcher, RelaxationLabelling, Rotation,
    Transformation,
};
use tactile_imaging::pipeline::MatcherChoice;
use tactile_imaging::{
    PointGrid, StrainAt, StrainBetween as Strained, StrainBetweenError, StrainBetweenOptions,
    StrainSeries, strain_between as strain_of_sets,
};

/// The matcher given by the caller: parsed once, created for the plane or for space.
pub(crate) enum Matcher {
    Annealed(AnnealedSoftassign),
    Drift(CoherentPointDrift),
    Labelling(RelaxationLabelling),
    Assignment(LinearAssignment),
    Nearest(NearestNeighbour),
    Own(OwnStage),
}

/// Options of a matcher by name, removed one after the other.
struct Options<'py>(Vec<(String, Bound<'py, PyAny>)>);

impl<'py> Options<'py> {
    fn new(given: Option<&Bound<'py, PyDict>>) -> PyResult<Self> {
        let pair = |(name, value): (Bound<'py, PyAny>, _)| Ok((name.extract()?, value));
        let pairs: PyResult<_> = given.into_iter().flatten().map(pair).collect();
        Ok(Self(pairs?))
    }

    fn take(&mut self, name: &str) -> Option<Bound<'py, PyAny>> {
        let place = self.0.iter().position(|(option, _)| option == name)?;
        Some(self.0.remove(place).1)
    }

    fn number(&mut self, name: &str) -> PyResult<Option<f64>> {
        let number = self.take(name).map(|value| value.extract());
        let wrong = |_| PyTypeError::new_err(format!("{name} must be a number"));
        number.transpose().map_err(wrong)
    }

    fn count(&mut self, name: &str) -> PyResult<Option<usize>> {
        let number = self.take(name).map(|value| value.extract());
        let wrong =
            |_| PyTypeError::new_err(format!("{name} must be a whole number, not negative"));
        number.transpose().map_err(wrong)
    }

    fn choice<T: Copy>(&mut self, name: &str, choices: &[(&str, T)]) -> PyResult<Option<T>> {
        let Some(given) = self.take(name) else {
            return Ok(None);
        };
        let text: String = given.extract().unwrap_or_default();
        let chosen = choices.iter().find(|(choice, _)| *choice == text);
        let names: Vec<_> = choices.iter().map(|(name, _)| *name).collect();
        let unknown = || invalid(format!("{name} must be one of {names:?}, found {given}"));
        chosen.map(|(_, choice)| Some(*choice)).ok_or_else(unknown)
    }

    /// An error if options remain.
    fn finish(self, matcher: &str) -> PyResult<()> {
        match self.0.first() {
            Some((option, _)) => Err(PyTypeError::new_err(format!(
                "the matcher {matcher} has no option {option}"
            ))),
            None => Ok(()),
        }
    }
}

impl Matcher {
    /// Creates a matcher from a name with options, or from an object with a method `match_points`.
    ///
    /// `annealed` is the configuration from which the default matcher starts.
    pub(crate) fn new(
        given: Option<&Bound<'_, PyAny>>,
        options: Option<&Bound<'_, PyDict>>,
        annealed: AnnealedSoftassign,
    ) -> PyResult<Self> {
        let mut options = Options::new(options)?;
        let choice = match given {
            None => MatcherChoice::default(),
            Some(given) => match given.extract::<String>() {
                Ok(name) => MatcherChoice::from_str(&name).map_err(invalid)?,
                Err(_) => {
                    options.finish("of your own")?;
                    let stage = OwnStage::new("matcher", "match_points", given)?;
                    return Ok(Self::Own(stage));
                }
            },
        };
        let matcher = match choice {
            MatcherChoice::CoherentPointDrift => drift(&mut options).map(Self::Drift),
            MatcherChoice::RelaxationLabelling => labelling(&mut options).map(Self::Labelling),
            MatcherChoice::LinearAssignment => {
                let within = options
                    .number("max_distance")?
                    .map(LinearAssignment::within);
                let matcher = within.transpose().map_err(invalid)?;
                Ok(Self::Assignment(matcher.unwrap_or_default()))
            }
            MatcherChoice::NearestNeighbour => {
                let within = options
                    .number("max_distance")?
                    .map(NearestNeighbour::within);
                let matcher = within.transpose().map_err(invalid)?;
                Ok(Self::Nearest(matcher.unwrap_or_default()))
            }
            _ => softassign(annealed, &mut options).map(Self::Annealed),
        }?;
        options.finish(&choice.to_string())?;
        Ok(matcher)
    }

    /// Creates the matcher for a stage of a pipeline.
    pub(crate) fn boxed<const D: usize>(self) -> Box<dyn PointMatcher<D> + Send + Sync> {
        match self {
            Self::Annealed(matcher) => Box::new(matcher),
            Self::Drift(matcher) => Box::new(matcher),
            Self::Labelling(matcher) => Box::new(matcher),
            Self::Assignment(matcher) => Box::new(matcher),
            Self::Nearest(matcher) => Box::new(matcher),
            Self::Own(matcher) => Box::new(matcher),
        }
    }
}

fn softassign(
    mut matcher: AnnealedSoftassign,
    options: &mut Options<'_>,
) -> PyResult<AnnealedSoftassign> {
    let rotations = [("limited", Rotation::Limited), ("any", Rotation::Any)];
    if let Some(rotation) = options.choice("rotation", &rotations)? {
        matcher = matcher.with_rotation(rotation);
    }
    let outliers = [
        ("both", Outliers::Both),
        ("model", Outliers::Model),
        ("target", Outliers::Target),
        ("none", Outliers::None),
    ];
    if let Some(outliers) = options.choice("outliers", &outliers)? {
        matcher = matcher.with_outliers(outliers);
    }
    let transformations = [
        ("smooth", Transformation::Smooth),
        ("affine", Transformation::Affine),
        ("similarity", Transformation::Similarity),
        ("rigid", Transformation::Rigid),
    ];
    if let Some(transformation) = options.choice("transformation", &transformations)? {
        matcher = matcher.with_transformation(transformation);
    }
    if let Some(ratio) = options.number("outlier_ratio")? {
        matcher = matcher.with_outlier_ratio(ratio).map_err(invalid)?;
    }
    if let Some(limit) = options.count("max_iterations")? {
        matcher = matcher.with_max_iterations(limit).map_err(invalid)?;
    }
    if let Some(motion) = options.number("largest_motion")? {
        matcher = matcher.with_largest_motion(motion).map_err(invalid)?;
    }
    Ok(matcher)
}

fn drift(options: &mut Options<'_>) -> PyResult<CoherentPointDrift> {
    let mut matcher = CoherentPointDrift::default();
    let beta = options.number("beta")?.unwrap_or(2.0);
    let lambda = options.number("lambda_")?.unwrap_or(3.0);
    matcher = matcher.with_field(beta, lambda).map_err(invalid)?;
    if let Some(rank) = options.count("rank")? {
        matcher = matcher.with_rank(rank).map_err(invalid)?;
    }
    if let Some(weight) = options.number("outlier_weight")? {
        matcher = matcher.with_outlier_weight(weight).map_err(invalid)?;
    }
    if let Some(tolerance) = options.number("tolerance")? {
        matcher = matcher.with_tolerance(tolerance).map_err(invalid)?;
    }
    if let Some(limit) = options.count("max_iterations")? {
        matcher = matcher.with_max_iterations(limit).map_err(invalid)?;
    }
    let normalizations = [
        ("each", Normalization::Each),
        ("model", Normalization::Model),
        ("off", Normalization::Off),
    ];
    if let Some(normalization) = options.choice("normalization", &normalizations)? {
        matcher = matcher.with_normalization(normalization);
    }
    Ok(matcher)
}

fn labelling(options: &mut Options<'_>) -> PyResult<RelaxationLabelling> {
    let mut matcher = RelaxationLabelling::default();
    if let Some(count) = options.count("neighbours")? {
        let neighbourhood = Neighbourhood::Nearest(count);
        matcher = matcher.with_neighbourhood(neighbourhood).map_err(invalid)?;
    }
    let compatibilities = [
        ("count", Compatibility::Count),
        ("length", Compatibility::Length),
        ("length-direction", Compatibility::LengthDirection),
        ("printed", Compatibility::Printed),
        ("full", Compatibility::Full),
    ];
    if let Some(compatibility) = options.choice("compatibility", &compatibilities)? {
        matcher = matcher.with_compatibility(compatibility);
    }
    let maxima = [
        ("per-pair", LengthMaximum::PerPair),
        ("global", LengthMaximum::Global),
    ];
    if let Some(maximum) = options.choice("length_maximum", &maxima)? {
        matcher = matcher.with_length_maximum(maximum);
    }
    if let Some(temperature) = options.number("temperature")? {
        matcher = matcher.with_temperature(temperature).map_err(invalid)?;
    }
    if let Some(slack) = options.number("slack")? {
        matcher = matcher.with_slack(slack).map_err(invalid)?;
    }
    if let Some(lambda) = options.number("smoothing")? {
        matcher = matcher.with_smoothing(lambda).map_err(invalid)?;
    }
    if let Some(candidates) = options.count("candidates")? {
        matcher = matcher.with_candidates(candidates).map_err(invalid)?;
    }
    if let Some(limit) = options.count("max_iterations")? {
        matcher = matcher.with_max_iterations(limit).map_err(invalid)?;
    }
    Ok(matcher)
}

fn homogeneous<const D: usize>(map: &FittedTransformation<D>) -> Array2<f64> {
    Array2::from_shape_fn((D + 1, D + 1), |(row, column)| {
        match (row < D, column < D) {
            (true, true) => map.linear[(row, column)],
            (true, false) => map.shift[row],
            (false, inside) => f64::from(!inside),
        }
    })
}

pub(crate) fn answer<const D: usize>(
    py: Python<'_>,
    found: &Matching<D>,
    [model, target]: [&[Point<f64, D>]; 2],
) -> Match {
    let row = |row: &Option<usize>| row.map_or(-1, |row| row as i64);
    let pairs: Vec<_> = found.pairs().map(|(i, j, _)| (i, j)).collect();
    let (report, map) = (&found.report, found.transformation.as_ref());
    let (matched, points) = (pairs.len(), found.assignment.len());
    let flags: Vec<String> = report.doubt().iter().map(ToString::to_string).collect();
    let caution = flags
        .first()
        .map_or(String::new(), |flag| format!(", {flag}"));
    Match {
        text: format!(
            "{matched} of {points} points matched, sigma {:.3e}{caution}",
            report.sigma
        ),
        assignment: arrays::kept_vector(py, found.assignment.iter().map(row).collect()),
        confidence: arrays::kept_vector(py, found.confidence.clone()),
        pairs: arrays::kept(py, rows_of_pairs(&pairs)),
        sigma: report.sigma,
        period: report.period.map(|step| step.0[..D].to_vec()),
        iterations: report.iterations,
        rotation: map.map(|map| map.rotation.as_slice().to_vec()),
        rotation_error: map.map(|map| map.rotation_error.as_slice().to_vec()),
        scale: map.map(|map| map.scale),
        scale_error: map.map(|map| map.scale_error),
        translation: map.map(|map| map.shift.as_slice().to_vec()),
        translation_error: map.map(|map| map.shift_error.as_slice().to_vec()),
        matrix: map.map(|map| arrays::kept(py, homogeneous(map))),
        flags,
        model: arrays::kept(py, arrays::rows(model)),
        target: arrays::kept(py, arrays::rows(target)),
        warped_once: PyOnceLock::new(),
    }
}

fn rows_of_pairs(pairs: &[(usize, usize)]) -> Array2<i64> {
    let side = |(n, k): (usize, usize)| [pairs[n].0, pairs[n].1][k] as i64;
    Array2::from_shape_fn((pairs.len(), 2), side)
}

/// Matches the points of a model to those of a target.
///
/// Parameters
/// ----------
/// model : (n, 2) or (n, 3) array
///     Points in any unit.
/// target : (m, 2) or (m, 3) array
///     Points in the same unit. n and m may differ.
/// matcher : str or object
///     "annealed-softassign" (the default), "coherent-point-drift", "relaxation-labelling" (the
///     paper's), "linear-assignment", "nearest-neighbour", or an object with a method
///     `match_points(model, target)`. It returns the target row of every model point (-1 for none),
///     or a tuple of these rows and their confidences.
/// **options
///     For "annealed-softassign": `rotation` ("limited", "any"), `outliers` ("both", "model",
///     "target", "none"), `transformation` ("smooth", "affine", "similarity", "rigid"),
///     `outlier_ratio` (0.1), `largest_motion`, `max_iterations` (200). For
///     "coherent-point-drift": `beta` (2), `lambda_` (3), `rank`, `outlier_weight` (0.1),
///     `tolerance`, `max_iterations`, `normalization` ("each", "model", "off"). For
///     "relaxation-labelling": `neighbours`, `compatibility`, `length_maximum`, `temperature`,
///     `slack`, `smoothing`, `candidates`, `max_iterations`. For the other two: `max_distance`.
///
/// Returns
/// -------
/// Match
///
/// Raises
/// ------
/// ValueError
///     Empty sets, coordinates that are not finite, or options out of range.
/// TypeError
///     Options that the matcher does not have.
/// TactileError
///     A user-defined matcher failed. Its exception is the cause.
#[pyfunction]
#[pyo3(signature = (model, target, matcher=None, **options))]
pub(crate) fn match_points(
    py: Python<'_>,
    model: &Bound<'_, PyAny>,
    target: &Bound<'_, PyAny>,
    matcher: Option<&Bound<'_, PyAny>>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<Match> {
    let sets = [
        arrays::matrix("model", model)?,
        arrays::matrix("target", target)?,
    ];
    let sets = sets.each_ref().map(|set| set.as_array());
    let matcher = Matcher::new(matcher, options, AnnealedSoftassign::default())?;
    match arrays::dimension(["model", "target"], sets)? {
        2 => matched::<2>(py, sets, matcher),
        _ => matched::<3>(py, sets, matcher),
    }
}

fn matched<const D: usize>(
    py: Python<'_>,
    sets: [ArrayView2<'_, f64>; 2],
    matcher: Matcher,
) -> PyResult<Match> {
    let matcher = matcher.boxed::<D>();
    let [model, target] = sets.map(arrays::points);
    let found = Signals::during(py, |signals| {
        matcher.match_watched(&model, &target, &mut || signals.check())
    })?;
    Ok(answer(
        py,
        &found.map_err(errors::refused)?,
        [&model, &target],
    ))
}

/// Computes the strain between two point sets by a match, a local field and a strain measure.
///
/// Parameters
/// ----------
/// before : (n, 2) or (n, 3) array
///     Points in any unit.
/// after : (m, 2) or (m, 3) array
///     Points in the same unit.
/// matcher, **options
///     As in `match_points`.
/// measure : str or object
///     "green-lagrange", "euler-almansi", "hencky", "biot", "infinitesimal", or an object with a
///     method `strain(deformation_gradient)` that returns a 3 × 3 tensor.
/// paired : bool
///     Whether row i of `after` belongs to row i of `before`, as in results of finite elements, image
///     correlation or a tracker. The points are then not matched, and rows with NaN are skipped.
/// with_doubtful_pairs : bool
///     Whether unreliable pairs give a strain with a flag instead of an error.
/// grid : float or (k, d) array
///     Spacing of a grid over the box of `before`, or positions. Displacement and strain at these
///     points are `grid` of the result.
///
/// Returns
/// -------
/// StrainBetween
///     For points in the plane the third axis is undeformed.
///
/// Raises
/// ------
/// ValueError
///     As in `match_points`, or too few matched points.
/// TactileError
///     Doubtful pairs, or no smooth deformation.
#[pyfunction]
#[pyo3(signature = (
    before, after, matcher=None, *, measure=None, paired=false, with_doubtful_pairs=false,
    grid=None, **options
))]
#[expect(clippy::too_many_arguments, reason = "keywords of Python")]
pub(crate) fn strain_between(
    py: Python<'_>,
    before: &Bound<'_, PyAny>,
    after: &Bound<'_, PyAny>,
    matcher: Option<&Bound<'_, PyAny>>,
    measure: Option<&Bound<'_, PyAny>>,
    paired: bool,
    with_doubtful_pairs: bool,
    grid: Option<&Bound<'_, PyAny>>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<StrainBetween> {
    if paired && (matcher.is_some() || options.is_some_and(|options| !options.is_empty())) {
        return Err(invalid(
            "paired points need no matcher and no matcher options",
        ));
    }
    let sets = [
        arrays::matrix("before", before)?,
        arrays::matrix("after", after)?,
    ];
    let sets = sets.each_ref().map(|set| set.as_array());
    let work = Work::new(matcher, options, measure, with_doubtful_pairs)?;
    match arrays::dimension(["before", "after"], sets)? {
        2 => work.between::<2>(py, sets, paired, grid),
        _ => work.between::<3>(py, sets, paired, grid),
    }
}

/// Computes the strain of every frame of a series relative to the first. Points are followed from
/// frame to frame.
///
/// Parameters
/// ----------
/// frames : sequence of (n, 2) or (n, 3) arrays
///     Points in any unit. Numbers of points may differ.
/// matcher, measure, with_doubtful_pairs, **options
///     As in `strain_between`.
///
/// Returns
/// -------
/// list of StrainBetween or None
///     One result for every frame after the first. None if too few points of the first frame
///     remain, or if their pairs are doubtful.
///
/// Raises
/// ------
/// ValueError, TactileError
///     As in `strain_between`, for two consecutive frames.
#[pyfunction]
#[pyo3(signature = (frames, matcher=None, *, measure=None, with_doubtful_pairs=false, **options))]
pub(crate) fn strain_series(
    py: Python<'_>,
    frames: Vec<Bound<'_, PyAny>>,
    matcher: Option<&Bound<'_, PyAny>>,
    measure: Option<&Bound<'_, PyAny>>,
    with_doubtful_pairs: bool,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<Vec<Option<StrainBetween>>> {
    let frames = frames.iter().enumerate();
    let frames = frames.map(|(k, frame)| arrays::matrix(&format!("frame {k}"), frame));
    let frames = frames.collect::<PyResult<Vec<_>>>()?;
    let sets: Vec<_> = frames.iter().map(|frame| frame.as_array()).collect();
    let work = Work::new(matcher, options, measure, with_doubtful_pairs)?;
    let Some((&first, rest)) = sets.split_first() else {
        return Err(invalid("frames must contain at least one set of points"));
    };
    let mut axes = arrays::dimension(["frame 0", "frame 0"], [first; 2])?;
    for &next in rest {
        axes = arrays::dimension(["all frames", "frame 0"], [next, first])?;
    }
    match axes {
        2 => work.series::<2>(py, first, rest),
        _ => work.series::<3>(py, first, rest),
    }
}

/// Arguments of the strains of points.
struct Work {
    matcher: Matcher,
    measure: Arc<dyn StrainMeasure + Send + Sync>,
    with_doubtful_pairs: bool,
    signals: Arc<Mutex<Signals>>,
}

impl Work {
    fn new(
        matcher: Option<&Bound<'_, PyAny>>,
        options: Option<&Bound<'_, PyDict>>,
        measure: Option<&Bound<'_, PyAny>>,
        with_doubtful_pairs: bool,
    ) -> PyResult<Self> {
        Ok(Self {
            matcher: Matcher::new(matcher, options, AnnealedSoftassign::default())?,
            measure: match measure {
                Some(given) => Arc::from(crate::pipeline::strain_measure("measure", given)?),
                None => Arc::new(GreenLagrange),
            },
            with_doubtful_pairs,
            signals: Arc::new(Mutex::new(Signals::new())),
        })
    }

    /// Computes with the options, without the interpreter lock.
    fn run<const D: usize, T: Send>(
        self,
        py: Python<'_>,
        compute: impl Send + FnOnce(StrainBetweenOptions<D>) -> Result<T, StrainBetweenError>,
    ) -> PyResult<T> {
        let mut options = StrainBetweenOptions::<D>::default()
            .with_matcher(self.matcher.boxed::<D>())
            .with_measure(self.measure)
            .with_watch(errors::watch_of(&self.signals));
        if self.with_doubtful_pairs {
            options = options.with_doubtful_pairs();
        }
        let found = py.detach(|| compute(options));
        let mut signals = self
            .signals
            .lock()
            .unwrap_or_else(|broken| broken.into_inner());
        signals.finish()?;
        found.map_err(errors::strain_between)
    }

    fn between<const D: usize>(
        self,
        py: Python<'_>,
        sets: [ArrayView2<'_, f64>; 2],
        paired: bool,
        grid: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<StrainBetween> {
        let measure = Arc::clone(&self.measure);
        let [before, after] = sets.map(arrays::points::<D>);
        let watch = errors::watch_of(&self.signals);
        let (counts, places) = grid.map_or(Ok(Default::default()), |grid| places(grid, &before))?;
        let (found, on_grid) = self.run(py, |options| {
            let found = match paired {
                true => Strained::of_known_pairs(&before, &after, &options),
                false => strain_of_sets(&before, &after, &options),
            }?;
            let on_grid = found.at_watched(&places, &*measure, watch)?;
            Ok((found, on_grid))
        })?;
        let grid = grid.map(|_| grid_result(py, counts, &places, &on_grid));
        result(
            py,
            &found,
            &*measure,
            grid.map(|grid| Py::new(py, grid)).transpose()?,
        )
    }

    fn series<const D: usize>(
        self,
        py: Python<'_>,
        first: ArrayView2<'_, f64>,
        rest: &[ArrayView2<'_, f64>],
    ) -> PyResult<Vec<Option<StrainBetween>>> {
        let measure = Arc::clone(&self.measure);
        let found = self.run(py, |options| {
            let mut series = StrainSeries::<D>::new(&arrays::points(first), options);
            let next = |set: &ArrayView2<'_, f64>| Ok(series.push(&arrays::points(*set))?.total);
            rest.iter()
                .map(next)
                .collect::<Result<Vec<_>, StrainBetweenError>>()
        })?;
        let found = found.iter().map(|found| match found {
            Ok(found) => result(py, found, &*measure, None).map(Some),
            Err(_) => Ok(None),
        });
        found.collect()
    }
}

/// The places of a grid of this spacing over the box of the points, and their numbers along the
/// axes. No numbers if positions are given.
fn places<const D: usize>(
    grid: &Bound<'_, PyAny>,
    points: &[Point<f64, D>],
) -> PyResult<(Vec<usize>, Vec<Point<f64, D>>)> {
    let Ok(spacing) = grid.extract::<f64>() else {
        let places = arrays::columns::<D>("grid", grid)?;
        return Ok((Vec::new(), places.into_iter().map(Point::from).collect()));
    };
    let grid = PointGrid::over(points, spacing).map_err(invalid)?;
    Ok((grid.counts.to_vec(), grid.points()))
}

fn grid_result<const D: usize>(
    py: Python<'_>,
    counts: Vec<usize>,
    places: &[Point<f64, D>],
    found: &[StrainAt<D>],
) -> StrainGrid {
    let tensors = |of: fn(&StrainAt<D>) -> Matrix3<f64>| {
        arrays::kept_tensors(py, &found.iter().map(of).collect::<Vec<_>>())
    };
    let displaced = |(i, k): (usize, usize)| found[i].displacement[k];
    StrainGrid {
        text: format!("{} places", places.len()),
        counts,
        points: arrays::kept(py, arrays::rows(places)),
        displacements: arrays::kept(py, Array2::from_shape_fn((found.len(), D), displaced)),
        strains: tensors(|at| at.strain),
        standard_errors: tensors(|at| at.standard_error),
    }
}

fn result<const D: usize>(
    py: Python<'_>,
    found: &Strained<D>,
    measure: &dyn StrainMeasure,
    grid: Option<Py<StrainGrid>>,
) -> PyResult<StrainBetween> {
    let read = found.kinematics(measure);
    let (mean, error) = (found.summary.mean, found.standard_error);
    let half = error * quantile_95(Some(found.degrees_of_freedom as f64));
    let displaced = |(i, k): (usize, usize)| found.displacements[i][k];
    let count = found.rows.len();
    let tensors = |of: fn(&StrainQuantities) -> Matrix3<f64>| {
        arrays::kept_tensors(py, &read.iter().map(of).collect::<Vec<_>>())
    };
    let triples = |of: fn(&StrainQuantities) -> [f64; 3]| {
        arrays::kept(
            py,
            Array2::from_shape_fn((count, 3), |(i, k)| of(&read[i])[k]),
        )
    };
    let with_error = |of: fn(&StrainQuantities) -> [f64; 2]| {
        arrays::kept(
            py,
            Array2::from_shape_fn((count, 2), |(i, k)| of(&read[i])[k]),
        )
    };
    let before: Vec<_> = found.pairs.iter().map(|pair| pair[0]).collect();
    Ok(StrainBetween {
        text: format!("{count} points, {}", tensor_text(&mean, &error)),
        value: arrays::kept_tensor(py, &mean),
        standard_error: arrays::kept_tensor(py, &error),
        interval_95: (
            arrays::kept_tensor(py, &(mean - half)),
            arrays::kept_tensor(py, &(mean + half)),
        ),
        pairs: arrays::kept(py, rows_of_pairs(&found.rows)),
        points: arrays::kept(py, arrays::rows(&before)),
        displacements: arrays::kept(py, Array2::from_shape_fn((count, D), displaced)),
        strains: arrays::kept_tensors(py, &found.strains),
        standard_errors: arrays::kept_tensors(py, &found.standard_errors),
        displacement_gradients: tensors(|at| at.gradient),
        displacement_gradient_errors: tensors(|at| at.gradient_error),
        rotations_rad: with_error(|at| [at.rotation_rad, at.rotation_error_rad]),
        principal_strains: triples(|at| at.principal),
        principal_strain_errors: triples(|at| at.principal_error),
        principal_directions: tensors(|at| at.directions.transpose()),
        size_ratios: with_error(|at| [at.size_ratio, at.size_ratio_error]),
        von_mises: with_error(|at| [at.equivalent, at.equivalent_error]),
        sigma: found.sigma,
        period: found.period.map(|step| step.0[..D].to_vec()),
        flags: found.doubt.iter().map(ToString::to_string).collect(),
        grid,
    })
}

pub(crate) fn tensor_text(mean: &Matrix3<f64>, error: &Matrix3<f64>) -> String {
    let one = |name: &str, k: usize| format!("{name} {:.5} ± {:.5}", mean[(k, k)], error[(k, k)]);
    format!("{}, {}, {}", one("e_xx", 0), one("e_yy", 1), one("e_zz", 2))
}
