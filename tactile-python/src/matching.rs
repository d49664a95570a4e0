//! Matching of points, with a matcher of this library or one written in Python.
use crate::arrays;
use crate::errors::{self, invalid};
use crate::results::{Match, StrainBetween};
use nalgebra::{Matrix3, Point};
use ndarray::Array2;
use numpy::PyArray2;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use tactile_imaging::core::statistics::quantile_95;
use tactile_imaging::matching::{
    AnnealedSoftassign, CoherentPointDrift, Doubt, LinearAssignment, MatchError, Matching, Motion,
    NearestNeighbour, Outliers, PointMatcher, RelaxationLabelling, Rotation, Search,
};
use tactile_imaging::{StrainBetweenOptions, strain_between as strain_of_sets};

pub type Boxed<const D: usize> = Box<dyn PointMatcher<D> + Send + Sync>;

/// A matcher as the caller gave it: read once, made for the plane or for space.
pub enum Matcher {
    Annealed(AnnealedSoftassign),
    Drift(CoherentPointDrift),
    Labelling(RelaxationLabelling),
    Assignment(LinearAssignment),
    Nearest(NearestNeighbour),
    Own(Py<PyAny>),
}

fn option<T: Copy>(name: &str, text: &str, choices: &[(&str, T)]) -> PyResult<T> {
    let names: Vec<_> = choices.iter().map(|(name, _)| *name).collect();
    let chosen = choices.iter().find(|(name, _)| *name == text);
    let unknown = || invalid(format!("{name} must be one of {names:?}, found {text:?}"));
    chosen.map(|(_, choice)| *choice).ok_or_else(unknown)
}

impl Matcher {
    /// From a name with options, or from an object with a method `match_points`.
    pub fn new(
        given: &Bound<'_, PyAny>,
        options: Option<&Bound<'_, PyDict>>,
        search: Search,
    ) -> PyResult<Self> {
        let mut left: Vec<(String, Bound<'_, PyAny>)> = match options {
            Some(options) => options.extract::<Vec<_>>().or_else(|_| pairs(options))?,
            None => Vec::new(),
        };
        let Ok(name) = given.extract::<String>() else {
            if !given.hasattr("match_points")? {
                let message = "matcher must be a name or have a method match_points(model, target)";
                return Err(PyTypeError::new_err(message));
            }
            left.is_empty()
                .then_some(())
                .ok_or_else(|| invalid("options belong to a matcher that is given by its name"))?;
            return Ok(Self::Own(given.clone().unbind()));
        };
        let mut take = |name: &str| {
            let place = left.iter().position(|(option, _)| option == name)?;
            Some(left.remove(place).1)
        };
        let matcher = match name.as_str() {
            "annealed" | "annealed-softassign" => {
                let mut matcher = AnnealedSoftassign::default().with_search(search);
                if let Some(value) = take("rotation") {
                    let choices = [("limited", Rotation::Limited), ("any", Rotation::Any)];
                    matcher = matcher.with_rotation(option(
                        "rotation",
                        &value.extract::<String>()?,
                        &choices,
                    )?);
                }
                if let Some(value) = take("outliers") {
                    let choices = [
                        ("both", Outliers::Both),
                        ("model", Outliers::Model),
                        ("target", Outliers::Target),
                        ("none", Outliers::None),
                    ];
                    matcher = matcher.with_outliers(option(
                        "outliers",
                        &value.extract::<String>()?,
                        &choices,
                    )?);
                }
                if let Some(value) = take("outlier_ratio") {
                    let with = matcher.with_outlier_ratio(value.extract()?);
                    matcher = with.map_err(errors::matching)?;
                }
                if let Some(value) = take("max_iterations") {
                    let with = matcher.with_max_iterations(value.extract()?);
                    matcher = with.map_err(errors::matching)?;
                }
                Self::Annealed(matcher)
            }
            "cpd" | "coherent-point-drift" => {
                let mut matcher = CoherentPointDrift::default();
                if let Some(value) = take("motion") {
                    let choices = [
                        ("rigid", Some(Motion::Rigid)),
                        ("similarity", Some(Motion::Similarity)),
                        ("affine", Some(Motion::Affine)),
                        ("non-rigid", None),
                    ];
                    if let Some(motion) = option("motion", &value.extract::<String>()?, &choices)? {
                        matcher = matcher.with_motion(motion).map_err(errors::matching)?;
                    }
                }
                if let Some(value) = take("outlier_weight") {
                    let with = matcher.with_outlier_weight(value.extract()?);
                    matcher = with.map_err(errors::matching)?;
                }
                if let Some(value) = take("max_iterations") {
                    let with = matcher.with_max_iterations(value.extract()?);
                    matcher = with.map_err(errors::matching)?;
                }
                Self::Drift(matcher)
            }
            "labelling" | "relaxation-labelling" => {
                let mut matcher = RelaxationLabelling::default();
                if let Some(value) = take("candidates") {
                    let with = matcher.with_candidates(value.extract()?);
                    matcher = with.map_err(errors::matching)?;
                }
                if let Some(value) = take("max_iterations") {
                    let with = matcher.with_max_iterations(value.extract()?);
                    matcher = with.map_err(errors::matching)?;
                }
                Self::Labelling(matcher)
            }
            "assignment" | "linear-assignment" => Self::Assignment(match take("max_distance") {
                Some(value) => {
                    LinearAssignment::within(value.extract()?).map_err(errors::matching)?
                }
                None => LinearAssignment::default(),
            }),
            "nearest" | "nearest-neighbour" => Self::Nearest(match take("max_distance") {
                Some(value) => {
                    NearestNeighbour::within(value.extract()?).map_err(errors::matching)?
                }
                None => NearestNeighbour::default(),
            }),
            _ => {
                return Err(invalid(format!(
                    "matcher must be one of \"annealed\", \"cpd\", \"labelling\", \"assignment\", \"nearest\", found {name:?}"
                )));
            }
        };
        match left.first() {
            Some((option, _)) => Err(PyTypeError::new_err(format!(
                "the matcher {name:?} has no option {option:?}"
            ))),
            None => Ok(matcher),
        }
    }

    pub fn boxed<const D: usize>(self) -> Boxed<D> {
        match self {
            Self::Annealed(matcher) => Box::new(matcher),
            Self::Drift(matcher) => Box::new(matcher),
            Self::Labelling(matcher) => Box::new(matcher),
            Self::Assignment(matcher) => Box::new(matcher),
            Self::Nearest(matcher) => Box::new(matcher),
            Self::Own(object) => Box::new(OwnMatcher(object)),
        }
    }
}

fn pairs<'py>(options: &Bound<'py, PyDict>) -> PyResult<Vec<(String, Bound<'py, PyAny>)>> {
    let pair = |(key, value): (Bound<'py, PyAny>, _)| Ok((key.extract::<String>()?, value));
    options.iter().map(pair).collect()
}

/// An object of Python with a method `match_points(model, target)`.
///
/// It returns the target row of every model point, −1 for none, or that and a confidence for each, as
/// a tuple or as the attributes `assignment` and `confidence`.
struct OwnMatcher(Py<PyAny>);

impl OwnMatcher {
    fn pairs<const D: usize>(
        &self,
        py: Python<'_>,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
    ) -> PyResult<Vec<(usize, usize, f64)>> {
        let array = |points| PyArray2::from_owned_array(py, arrays::rows(points));
        let arguments = (array(model), array(target));
        let answer = self.0.bind(py).call_method1("match_points", arguments)?;
        let (assignment, confidence) = if let Ok(both) = answer.cast::<PyTuple>() {
            (both.get_item(0)?, Some(both.get_item(1)?))
        } else if answer.hasattr("assignment")? {
            let confidence = match answer.hasattr("confidence")? {
                true => Some(answer.getattr("confidence")?),
                false => None,
            };
            (answer.getattr("assignment")?, confidence)
        } else {
            (answer, None)
        };
        let rows = arrays::indices("the assignment of match_points", &assignment)?;
        let confidence = match confidence {
            Some(given) => arrays::vector("the confidence of match_points", &given)?,
            None => vec![1.0; rows.len()],
        };
        let (expected, found) = (model.len(), [rows.len(), confidence.len()]);
        if found != [expected; 2] {
            return Err(invalid(format!(
                "match_points must return an assignment and a confidence for each of {expected} \
                 model points, found {} and {}",
                found[0], found[1]
            )));
        }
        let mut pairs = Vec::with_capacity(expected);
        for (i, (&row, &confidence)) in rows.iter().zip(&confidence).enumerate() {
            match usize::try_from(row) {
                Ok(j) => pairs.push((i, j, confidence)),
                Err(_) if row == -1 => {}
                Err(_) => {
                    return Err(invalid(format!(
                        "match_points must return rows of the target or -1, found {row}"
                    )));
                }
            }
        }
        Ok(pairs)
    }
}

impl<const D: usize> PointMatcher<D> for OwnMatcher {
    fn match_points(
        &self,
        model: &[Point<f64, D>],
        target: &[Point<f64, D>],
    ) -> Result<Matching<D>, MatchError> {
        let pairs = Python::attach(|py| self.pairs(py, model, target));
        let pairs = pairs.map_err(MatchError::custom)?;
        // A row twice or a confidence that is NaN is the fault of the stage as well.
        Matching::from_pairs(model, target, &pairs)
            .map_err(|error| MatchError::custom(invalid(format!("match_points: {error}"))))
    }
}

fn doubt(doubt: Doubt) -> String {
    match doubt {
        Doubt::FewPairs => "few pairs",
        Doubt::LargeResiduals => "large residuals",
        _ => "undecided",
    }
    .into()
}

pub fn answer<const D: usize>(py: Python<'_>, found: &Matching<D>) -> Match {
    let row = |row: &Option<usize>| row.map_or(-1, |row| row as i64);
    let pairs: Vec<_> = found.pairs().collect();
    let report = &found.report;
    let text = format!(
        "{} of {} points matched, sigma {:.3e}{}",
        pairs.len(),
        found.assignment.len(),
        report.sigma,
        report
            .doubt
            .map_or(String::new(), |d| format!(", doubt: {}", doubt(d)))
    );
    let both = |(i, k): (usize, usize)| [pairs[i].0, pairs[i].1][k] as i64;
    Match {
        text,
        assignment: arrays::kept_vector(py, found.assignment.iter().map(row).collect()),
        confidence: arrays::kept_vector(py, found.confidence.clone()),
        warped: arrays::kept(py, arrays::rows(&found.warped)),
        pairs: arrays::kept(py, Array2::from_shape_fn((pairs.len(), 2), both)),
        sigma: report.sigma,
        doubt: report.doubt.map(doubt),
        iterations: report.iterations,
    }
}

/// Finds which point of the model is which point of the target.
///
/// Parameters
/// ----------
/// model, target : (n, 2) or (n, 3) and (m, 2) or (m, 3) arrays, in any unit
/// matcher : "annealed", "cpd", "labelling", "assignment", "nearest", or an object with a method
///     `match_points(model, target)`
/// **options : options of the matcher
#[pyfunction]
#[pyo3(signature = (model, target, matcher=None, **options))]
pub fn match_points(
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
    let matcher = chosen(py, matcher, options)?;
    match arrays::dimension(["model", "target"], sets.each_ref().map(|set| set.view()))? {
        2 => matched::<2>(py, sets, matcher),
        _ => matched::<3>(py, sets, matcher),
    }
}

fn chosen(
    py: Python<'_>,
    matcher: Option<&Bound<'_, PyAny>>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<Matcher> {
    let default = pyo3::types::PyString::new(py, "annealed").into_any();
    Matcher::new(matcher.unwrap_or(&default), options, Search::Thorough)
}

fn matched<const D: usize>(
    py: Python<'_>,
    sets: [Array2<f64>; 2],
    matcher: Matcher,
) -> PyResult<Match> {
    let matcher = matcher.boxed::<D>();
    let found = py.detach(|| {
        let [model, target] = sets.each_ref().map(|set| arrays::points(set.view()));
        matcher.match_points(&model, &target)
    });
    Ok(answer(py, &found.map_err(errors::matching)?))
}

/// Strain of a point set on its way to another: match, robust spline, Green-Lagrange strain.
///
/// Parameters
/// ----------
/// before, after : (n, 2) or (n, 3) and (m, 2) or (m, 3) arrays, in any unit
/// matcher : as that of `match_points`
#[pyfunction]
#[pyo3(signature = (before, after, matcher=None, **options))]
pub fn strain_between(
    py: Python<'_>,
    before: &Bound<'_, PyAny>,
    after: &Bound<'_, PyAny>,
    matcher: Option<&Bound<'_, PyAny>>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<StrainBetween> {
    let sets = [
        arrays::matrix("before", before)?,
        arrays::matrix("after", after)?,
    ];
    let matcher = chosen(py, matcher, options)?;
    match arrays::dimension(["before", "after"], sets.each_ref().map(|set| set.view()))? {
        2 => strained::<2>(py, sets, matcher),
        _ => strained::<3>(py, sets, matcher),
    }
}

fn strained<const D: usize>(
    py: Python<'_>,
    sets: [Array2<f64>; 2],
    matcher: Matcher,
) -> PyResult<StrainBetween> {
    let options = StrainBetweenOptions::<D>::default().with_matcher(matcher.boxed::<D>());
    let found = py.detach(|| {
        let [before, after] = sets.each_ref().map(|set| arrays::points(set.view()));
        strain_of_sets(&before, &after, &options)
    });
    let found = found.map_err(errors::strain_between)?;
    let (mean, error) = (found.summary.mean, found.standard_error);
    let half = error * quantile_95(Some(found.degrees_of_freedom as f64));
    let pair = |(i, k): (usize, usize)| [found.rows[i].0, found.rows[i].1][k] as i64;
    let displaced = |(i, k): (usize, usize)| found.displacements[i][k];
    let count = found.rows.len();
    Ok(StrainBetween {
        text: format!("{count} points, {}", tensor_text(&mean, &error)),
        value: arrays::kept_tensor(py, &mean),
        standard_error: arrays::kept_tensor(py, &error),
        interval_95: interval(py, &mean, &half),
        pairs: arrays::kept(py, Array2::from_shape_fn((count, 2), pair)),
        displacements: arrays::kept(py, Array2::from_shape_fn((count, D), displaced)),
        strains: arrays::kept_tensors(py, &found.strains),
        standard_errors: arrays::kept_tensors(py, &found.standard_errors),
        sigma: found.sigma,
    })
}

/// The two ends of an interval, centre less half and centre plus half.
pub fn interval(
    py: Python<'_>,
    centre: &Matrix3<f64>,
    half: &Matrix3<f64>,
) -> (arrays::Matrix<f64>, arrays::Matrix<f64>) {
    let end = |tensor: Matrix3<f64>| arrays::kept_tensor(py, &tensor);
    (end(centre - half), end(centre + half))
}

pub fn tensor_text(mean: &Matrix3<f64>, error: &Matrix3<f64>) -> String {
    let one = |name: &str, k: usize| format!("{name} {:.5} ± {:.5}", mean[(k, k)], error[(k, k)]);
    format!("{}, {}, {}", one("e_xx", 0), one("e_yy", 1), one("e_zz", 2))
}
