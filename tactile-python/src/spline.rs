//! Splines through scattered values.
use crate::arrays;
use crate::errors::{Signals, invalid};
use nalgebra::{Point, SMatrix};
use ndarray::{Array2, Array3, ArrayView2, Axis};
use numpy::{PyArray2, PyArray3, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use tactile_imaging::tps::{
    FitOptions, Kernel, NegR, Progress, R2LogR, R3, Smoothing, Spline, TpsError,
};

/// A spline of any kernel in the plane or in space. The first outputs are those of the caller, and
/// the others are zero.
trait Fitted: Send + Sync {
    /// (points, outputs).
    fn values(&self, points: ArrayView2<'_, f64>, outputs: usize) -> Array2<f64>;
    /// ∂f_m/∂x_k of each point, (points, outputs, axes).
    fn jacobians(&self, points: ArrayView2<'_, f64>, outputs: usize) -> Array3<f64>;
    fn lambda(&self) -> f64;
    /// Directions that the sources span.
    fn spanned(&self) -> usize;
}

/// Number of outputs of one fit.
const LANES: usize = 4;
/// Number of points evaluated between two checks for signals: 60 ms with 3,000 sources.
const AT_ONCE: usize = 4096;

impl<const D: usize, const M: usize, K: Kernel + Send + Sync> Fitted for Spline<D, M, K> {
    fn values(&self, points: ArrayView2<'_, f64>, outputs: usize) -> Array2<f64> {
        let points: Vec<Point<f64, D>> = filled_up(points);
        let mut values = vec![Point::<f64, M>::origin(); points.len()];
        self.apply_into(&points, &mut values)
            .expect("as many values as points");
        Array2::from_shape_fn((points.len(), outputs), |(n, m)| values[n][m])
    }

    fn jacobians(&self, points: ArrayView2<'_, f64>, outputs: usize) -> Array3<f64> {
        let points: Vec<Point<f64, D>> = filled_up(points);
        let mut jacobians = vec![SMatrix::<f64, M, D>::zeros(); points.len()];
        self.jacobian_into(&points, &mut jacobians)
            .expect("as many Jacobians as points");
        Array3::from_shape_fn((points.len(), outputs, D), |(n, m, k)| jacobians[n][(m, k)])
    }

    fn lambda(&self) -> f64 {
        self.report.lambda
    }

    fn spanned(&self) -> usize {
        self.report.rank.saturating_sub(1)
    }
}

/// A spline with an affine part: f(x) = a + A x + Σ w_i U(|x − x_i|).
///
/// Parameters
/// ----------
/// sources : (n, 1), (n, 2) or (n, 3) array
///     Distinct points.
/// targets : (n, ...) array
///     Real or complex values of any shape at each point.
/// smoothing : float or "gcv"
///     λ ≥ 0 in Σ|f(x_i) − y_i|² + λ wᵀKw, or generalised cross-validation. None is 0.
/// kernel : str
///     "thin_plate_spline" (r² ln r), "linear" (−r) or "cubic" (r³), as in SciPy's
///     `RBFInterpolator` with `degree=1`.
///
/// Raises
/// ------
/// ValueError
///     Different lengths, numbers that are not finite, or points that do not determine a spline.
///
/// Notes
/// -----
/// A fit of n points needs O(n³) time and O(n²) memory, for every four numbers of a target.
///
/// If the sources lie on a line or in a plane, the directions across it are undetermined. A spline
/// with as many outputs as axes is a map of space and keeps the identity in these directions.
/// Otherwise its slope there is zero. `flags` contains a sentence in this case.
#[pyclass(frozen, module = "tactile_imaging")]
pub(crate) struct ThinPlateSpline {
    /// Splines with up to four outputs each.
    fitted: Vec<Box<dyn Fitted>>,
    axes: usize,
    /// Number of real numbers of a target.
    outputs: usize,
    /// The shape of a target.
    shape: Vec<usize>,
    complex: bool,
    /// Number of sources.
    points: usize,
    /// The arguments of the constructor.
    arguments: [Py<PyAny>; 2],
    keywords: Py<PyDict>,
}

#[pymethods]
impl ThinPlateSpline {
    #[new]
    #[pyo3(signature = (sources, targets, *, smoothing=None, kernel="thin_plate_spline"))]
    fn new(
        py: Python<'_>,
        sources: &Bound<'_, PyAny>,
        targets: &Bound<'_, PyAny>,
        smoothing: Option<&Bound<'_, PyAny>>,
        kernel: &str,
    ) -> PyResult<Self> {
        let sources = arrays::matrix("sources", sources)?;
        let view = sources.as_array();
        let numpy = py.import("numpy")?;
        let mut values = arrays::asarray("targets", targets)?;
        let copies = [sources.as_any(), &values].map(|array| array.call_method0("copy"));
        let [of_sources, of_targets] = copies;
        let copies = [of_sources?.unbind(), of_targets?.unbind()];
        let keywords = PyDict::new(py);
        keywords.set_item("smoothing", smoothing)?;
        keywords.set_item("kernel", kernel)?;
        let mut shape: Vec<usize> = values.getattr("shape")?.extract()?;
        if shape.is_empty() {
            return Err(invalid(
                "targets must have a row for each source, found a number",
            ));
        }
        let rows = shape.remove(0);
        let complex = numpy
            .call_method1("iscomplexobj", (&values,))?
            .is_truthy()?;
        if complex {
            let parts = (values.getattr("real")?, values.getattr("imag")?);
            values = numpy.call_method1("stack", (parts, -1))?;
        }
        let outputs = shape.iter().product::<usize>() * (1 + usize::from(complex));
        let values = values.call_method1("reshape", (rows, outputs))?;
        let targets = arrays::matrix("targets", &values)?;
        let targets = targets.as_array();
        let axes = view.ncols();
        if !(1..=3).contains(&axes) || outputs == 0 {
            return Err(invalid(format!(
                "sources must have one to three columns and targets a number at least, \
                 found {axes} and {outputs}"
            )));
        }
        let smoothing = match smoothing {
            None => Smoothing::None,
            Some(given) if given.extract::<String>().is_ok_and(|name| name == "gcv") => {
                Smoothing::Gcv
            }
            Some(given) => match given.extract::<f64>() {
                Ok(0.0) => Smoothing::None,
                Ok(lambda) => Smoothing::Lambda(lambda),
                Err(_) => return Err(invalid("smoothing must be a number or \"gcv\"")),
            },
        };
        let is_map = outputs == axes;
        let fit = |columns: ArrayView2<'_, f64>, signals: &mut Signals| match (kernel, axes) {
            // Points on a line are treated as points in a plane with one axis of zero extent.
            ("thin_plate_spline", 1 | 2) => {
                fit::<2, _>([view, columns], is_map, R2LogR, smoothing, signals)
            }
            ("thin_plate_spline", _) => {
                fit::<3, _>([view, columns], is_map, R2LogR, smoothing, signals)
            }
            ("linear", 1 | 2) => fit::<2, _>([view, columns], is_map, NegR, smoothing, signals),
            ("linear", _) => fit::<3, _>([view, columns], is_map, NegR, smoothing, signals),
            ("cubic", 1 | 2) => fit::<2, _>([view, columns], is_map, R3, smoothing, signals),
            ("cubic", _) => fit::<3, _>([view, columns], is_map, R3, smoothing, signals),
            _ => Err(invalid(format!(
                "kernel must be \"thin_plate_spline\", \"linear\" or \"cubic\", found {kernel:?}"
            ))),
        };
        let fitted = Signals::during(py, |signals| {
            let parts = targets.axis_chunks_iter(Axis(1), LANES);
            parts
                .map(|part| fit(part, signals))
                .collect::<PyResult<Vec<_>>>()
        })??;
        Ok(Self {
            fitted,
            axes,
            outputs,
            shape,
            complex,
            points: view.nrows(),
            arguments: copies,
            keywords: keywords.unbind(),
        })
    }

    /// Values at points of shape (..., d), each with the shape of a target.
    fn __call__<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (points, mut shape) = self.queries(points)?;
        let view = points.as_array();
        let values = Signals::during(py, |signals| {
            let mut values = Array2::zeros((view.nrows(), self.outputs));
            let parts = values.axis_chunks_iter_mut(Axis(0), AT_ONCE);
            for (mut values, places) in parts.zip(view.axis_chunks_iter(Axis(0), AT_ONCE)) {
                if signals.check().is_break() {
                    break;
                }
                for (k, (part, outputs)) in self.parts().enumerate() {
                    let columns = LANES * k..LANES * k + outputs;
                    let mut columns = values.slice_axis_mut(Axis(1), columns.into());
                    columns.assign(&part.values(places, outputs));
                }
            }
            values
        })?;
        shape.extend(&self.shape);
        let mut values = PyArray2::from_owned_array(py, values).into_any();
        if self.complex {
            let in_order = values.call_method1("copy", ("C",))?;
            values = in_order.call_method1("view", ("complex128",))?;
        }
        values.call_method1("reshape", (shape,))
    }

    /// Jacobians ∂f_i/∂x_j at points of shape (..., d): (..., m, d) for m real numbers of a target.
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (points, mut shape) = self.queries(points)?;
        let view = points.as_array();
        let jacobians = Signals::during(py, |signals| {
            let mut jacobians = Array3::zeros((view.nrows(), self.outputs, self.axes));
            let parts = jacobians.axis_chunks_iter_mut(Axis(0), AT_ONCE);
            for (mut jacobians, places) in parts.zip(view.axis_chunks_iter(Axis(0), AT_ONCE)) {
                if signals.check().is_break() {
                    break;
                }
                for (k, (part, outputs)) in self.parts().enumerate() {
                    let rows = LANES * k..LANES * k + outputs;
                    let found = part.jacobians(places, outputs);
                    let mut rows = jacobians.slice_axis_mut(Axis(1), rows.into());
                    rows.assign(&found.slice_axis(Axis(2), (..self.axes).into()));
                }
            }
            jacobians
        })?;
        shape.extend([self.outputs, self.axes]);
        let jacobians = PyArray3::from_owned_array(py, jacobians).into_any();
        jacobians.call_method1("reshape", (shape,))
    }

    /// The smoothing λ that was used. With more than four outputs, the largest.
    #[getter]
    fn smoothing(&self) -> f64 {
        self.fitted
            .iter()
            .map(|part| part.lambda())
            .fold(0.0, f64::max)
    }

    /// Undetermined directions, one sentence each.
    #[getter]
    fn flags(&self) -> Vec<String> {
        let (axes, spanned) = (
            self.axes,
            self.fitted.first().map_or(0, |part| part.spanned()),
        );
        let sentence = || format!("the sources span {spanned} of {axes} directions");
        (spanned < axes).then(sentence).into_iter().collect()
    }

    /// A pickled spline is fitted anew from the arguments of the constructor.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let (py, made) = (slf.py(), slf.get());
        let anew = py.import("copyreg")?.getattr("__newobj_ex__")?;
        let [sources, targets] = made.arguments.each_ref().map(|array| array.bind(py));
        let given = ((sources, targets), &made.keywords);
        Ok((
            anew,
            (slf.get_type(), given.0, given.1)
                .into_pyobject(py)?
                .into_any(),
        ))
    }

    fn __repr__(&self) -> String {
        let Self {
            points,
            axes,
            outputs,
            ..
        } = self;
        let lambda = self.smoothing();
        format!(
            "ThinPlateSpline({points} points, {axes} axes to {outputs}, smoothing {lambda:.3e})"
        )
    }
}

impl ThinPlateSpline {
    /// Points, and the shape of their array.
    fn queries<'py>(
        &self,
        points: &Bound<'py, PyAny>,
    ) -> PyResult<(PyReadonlyArray2<'py, f64>, Vec<usize>)> {
        let points = arrays::asarray("points", points)?;
        let mut shape: Vec<usize> = points.getattr("shape")?.extract()?;
        let (expected, found) = (self.axes, shape.pop().unwrap_or(0));
        if found != expected {
            return Err(invalid(format!(
                "points must have {expected} columns, found {found}"
            )));
        }
        let count: usize = shape.iter().product();
        let flat = points.call_method1("reshape", (count, expected))?;
        Ok((arrays::matrix("points", &flat)?, shape))
    }

    /// The splines and the numbers of their outputs.
    fn parts(&self) -> impl Iterator<Item = (&dyn Fitted, usize)> {
        let left = |k: usize| (self.outputs - LANES * k).min(LANES);
        let parts = self.fitted.iter().enumerate();
        parts.map(move |(k, part)| (&**part, left(k)))
    }
}

/// Points, with zero along missing axes.
fn filled_up<const D: usize>(points: ArrayView2<'_, f64>) -> Vec<Point<f64, D>> {
    let at = |row: usize, axis: usize| points.get([row, axis]).copied().unwrap_or(0.0);
    let point = |row| Point::from(std::array::from_fn::<f64, D, _>(|axis| at(row, axis)));
    (0..points.nrows()).map(point).collect()
}

/// A map of space if there are as many outputs as axes, otherwise a function.
fn fit<const D: usize, K: Kernel + Send + Sync + 'static>(
    sets: [ArrayView2<'_, f64>; 2],
    is_map: bool,
    kernel: K,
    smoothing: Smoothing,
    signals: &mut Signals,
) -> PyResult<Box<dyn Fitted>> {
    if is_map && sets[0].ncols() == D {
        fit_to::<D, D, K>(sets, kernel, smoothing, signals)
    } else {
        // More outputs than axes, so that the spline is not a map.
        fit_to::<D, LANES, K>(sets, kernel, smoothing, signals)
    }
}

fn fit_to<const D: usize, const M: usize, K: Kernel + Send + Sync + 'static>(
    [sources, targets]: [ArrayView2<'_, f64>; 2],
    kernel: K,
    smoothing: Smoothing,
    signals: &mut Signals,
) -> PyResult<Box<dyn Fitted>> {
    let options = FitOptions::new(kernel).with_smoothing(smoothing);
    let options = options.map_err(invalid)?;
    let sources: Vec<Point<f64, D>> = filled_up(sources);
    let target = |row: usize, k: usize| targets.get([row, k]).copied().unwrap_or(0.0);
    let targets: Vec<_> = (0..targets.nrows())
        .map(|row| Point::from(std::array::from_fn::<f64, M, _>(|k| target(row, k))))
        .collect();
    let spline = match smoothing {
        // The decomposition of a large matrix cannot be stopped.
        Smoothing::Gcv => signals
            .beside(move || Spline::<D, M, K>::fit(&sources, &targets, &options))
            .unwrap_or(Err(TpsError::Stopped)),
        _ => {
            let watch = |_: &Progress| signals.check();
            Spline::fit_watched(&sources, &targets, &options, watch)
        }
    };
    Ok(Box::new(spline.map_err(invalid)?))
}
