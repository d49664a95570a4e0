//! Splines through scattered values.
use crate::arrays;
use crate::errors::invalid;
use nalgebra::{Point, SMatrix};
use ndarray::{Array2, Array3, ArrayView2};
use numpy::{PyArray1, PyArray2, PyArray3, PyReadonlyArray2};
use pyo3::prelude::*;
use tactile_imaging::tps::{FitOptions, Kernel, NegR, R2LogR, R3, Smoothing, Spline};

/// A spline of any kernel in the plane or in space, of which the caller's outputs are the first and
/// the others zero.
trait Fitted: Send + Sync {
    /// (points, outputs).
    fn values(&self, points: ArrayView2<'_, f64>, outputs: usize) -> Array2<f64>;
    /// ∂f_m/∂x_k of each point, (points, outputs, axes).
    fn jacobians(&self, points: ArrayView2<'_, f64>, outputs: usize) -> Array3<f64>;
    fn lambda(&self) -> f64;
}

impl<const D: usize, const M: usize, K: Kernel + Send + Sync> Fitted for Spline<D, M, K> {
    fn values(&self, points: ArrayView2<'_, f64>, outputs: usize) -> Array2<f64> {
        let points: Vec<Point<f64, D>> = arrays::points(points);
        let mut values = vec![Point::<f64, M>::origin(); points.len()];
        self.apply_into(&points, &mut values)
            .expect("as many values as points");
        Array2::from_shape_fn((points.len(), outputs), |(n, m)| values[n][m])
    }

    fn jacobians(&self, points: ArrayView2<'_, f64>, outputs: usize) -> Array3<f64> {
        let points: Vec<Point<f64, D>> = arrays::points(points);
        let mut jacobians = vec![SMatrix::<f64, M, D>::zeros(); points.len()];
        self.jacobian_into(&points, &mut jacobians)
            .expect("as many Jacobians as points");
        Array3::from_shape_fn((points.len(), outputs, D), |(n, m, k)| jacobians[n][(m, k)])
    }

    fn lambda(&self) -> f64 {
        self.report.lambda
    }
}

/// A spline with an affine part: f(x) = a + A x + Σ w_i U(|x − x_i|).
///
/// Parameters
/// ----------
/// sources : (n, 2) or (n, 3) array
///     Distinct points.
/// targets : (n,) or (n, m) array
///     Up to three columns.
/// smoothing : float or "gcv"
///     λ ≥ 0 of Σ|f(x_i) − y_i|² + λ wᵀKw, or that of generalised cross-validation. None is 0.
/// kernel : str
///     "thin_plate_spline" (r² ln r), "linear" (−r) or "cubic" (r³), as SciPy's `RBFInterpolator`
///     with `degree=1`.
///
/// Raises
/// ------
/// ValueError
///     Lengths that differ, coordinates that are not finite, points that determine no spline.
///
/// Notes
/// -----
/// A fit of n points takes O(n³) time and O(n²) memory.
///
/// Where the sources lie on a line or in a plane, directions across them are undetermined: with as
/// many outputs as axes the spline is a map of space and keeps the identity there, else its slope
/// there is zero.
#[pyclass(frozen, module = "tactile_imaging")]
pub(crate) struct ThinPlateSpline {
    fitted: Box<dyn Fitted>,
    axes: usize,
    outputs: usize,
    /// Whether targets were a vector.
    flat: bool,
    /// Number of sources.
    points: usize,
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
        let flat = arrays::vector("targets", targets).ok();
        let is_flat = flat.is_some();
        let targets = match flat {
            Some(values) => {
                let shape = (values.len(), 1);
                Array2::from_shape_vec(shape, values).map_err(invalid)?
            }
            None => arrays::owned(arrays::matrix("targets", targets)?.as_array()),
        };
        let (axes, outputs) = (view.ncols(), targets.ncols());
        if !(2..=3).contains(&axes) || !(1..=3).contains(&outputs) {
            return Err(invalid(format!(
                "sources must have two or three columns and targets up to three, \
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
        let fitted = py.detach(|| match (kernel, axes) {
            ("thin_plate_spline", 2) => fit::<2, _>(view, &targets, R2LogR, smoothing),
            ("thin_plate_spline", _) => fit::<3, _>(view, &targets, R2LogR, smoothing),
            ("linear", 2) => fit::<2, _>(view, &targets, NegR, smoothing),
            ("linear", _) => fit::<3, _>(view, &targets, NegR, smoothing),
            ("cubic", 2) => fit::<2, _>(view, &targets, R3, smoothing),
            ("cubic", _) => fit::<3, _>(view, &targets, R3, smoothing),
            _ => Err(invalid(format!(
                "kernel must be \"thin_plate_spline\", \"linear\" or \"cubic\", found {kernel:?}"
            ))),
        })?;
        Ok(Self {
            fitted,
            axes,
            outputs,
            flat: is_flat,
            points: view.nrows(),
        })
    }

    /// Values at points: (k, d) to (k, m), or (k,) where the targets were a vector.
    fn __call__<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let points = self.queries(points)?;
        let view = points.as_array();
        let values = py.detach(|| self.fitted.values(view, self.outputs));
        if self.flat {
            return Ok(PyArray1::from_iter(py, values.iter().copied()).into_any());
        }
        Ok(PyArray2::from_owned_array(py, values).into_any())
    }

    /// Jacobians at points, (k, m, d): [n, i, j] is ∂f_i/∂x_j.
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let points = self.queries(points)?;
        let view = points.as_array();
        let jacobians = py.detach(|| self.fitted.jacobians(view, self.outputs));
        Ok(PyArray3::from_owned_array(py, jacobians))
    }

    /// The smoothing λ that was used.
    #[getter]
    fn smoothing(&self) -> f64 {
        self.fitted.lambda()
    }

    fn __repr__(&self) -> String {
        let Self {
            points,
            axes,
            outputs,
            ..
        } = self;
        let lambda = self.fitted.lambda();
        format!(
            "ThinPlateSpline({points} points, {axes} axes to {outputs}, smoothing {lambda:.3e})"
        )
    }
}

impl ThinPlateSpline {
    fn queries<'py>(&self, points: &Bound<'py, PyAny>) -> PyResult<PyReadonlyArray2<'py, f64>> {
        let points = arrays::matrix("points", points)?;
        let (expected, found) = (self.axes, points.as_array().ncols());
        if found != expected {
            return Err(invalid(format!(
                "points must have {expected} columns, found {found}"
            )));
        }
        Ok(points)
    }
}

/// A map of space where there are as many outputs as axes, else a function.
fn fit<const D: usize, K: Kernel + Send + Sync + 'static>(
    sources: ArrayView2<'_, f64>,
    targets: &Array2<f64>,
    kernel: K,
    smoothing: Smoothing,
) -> PyResult<Box<dyn Fitted>> {
    if targets.ncols() == D {
        fit_to::<D, D, K>(sources, targets, kernel, smoothing)
    } else {
        // More outputs than axes, so that the spline is no map.
        fit_to::<D, 4, K>(sources, targets, kernel, smoothing)
    }
}

fn fit_to<const D: usize, const M: usize, K: Kernel + Send + Sync + 'static>(
    sources: ArrayView2<'_, f64>,
    targets: &Array2<f64>,
    kernel: K,
    smoothing: Smoothing,
) -> PyResult<Box<dyn Fitted>> {
    let options = FitOptions::new(kernel).with_smoothing(smoothing);
    let options = options.map_err(invalid)?;
    let sources: Vec<Point<f64, D>> = arrays::points(sources);
    let target = |row: usize, k: usize| targets.get([row, k]).copied().unwrap_or(0.0);
    let targets: Vec<_> = (0..targets.nrows())
        .map(|row| Point::from(std::array::from_fn::<f64, M, _>(|k| target(row, k))))
        .collect();
    let spline = Spline::<D, M, K>::fit(&sources, &targets, &options);
    Ok(Box::new(spline.map_err(invalid)?))
}
