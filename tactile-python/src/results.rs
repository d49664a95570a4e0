//! Frozen results with fields, a sentence, a table for notebooks, and a dictionary.
use crate::arrays::{self, Matrix, Tensors, Vector};
use crate::errors::{Signals, failed, invalid};
use nalgebra::{Point, SMatrix, SVector};
use ndarray::{Array2, Array3, ArrayView2};
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyType};
use std::path::PathBuf;
use tactile_imaging::core::{Estimate as CoreEstimate, Interval};
use tactile_imaging::tps::{LocalField, TpsError};

/// Functions of results as values, written in Python because they consist of Python values.
pub(crate) fn of_values<'py>(
    py: Python<'py>,
    function: &str,
    arguments: impl pyo3::call::PyCallArgs<'py>,
) -> PyResult<Bound<'py, PyAny>> {
    py.import("tactile_imaging._values")?
        .call_method1(function, arguments)
}

/// A table with two columns. Values are escaped, because they may contain text of the caller. For
/// arrays larger than a tensor, the shape is shown.
pub(crate) fn to_html(result: &Bound<'_, PyAny>, names: &[&str]) -> PyResult<String> {
    let escaped = |text: String| text.replace('&', "&amp;").replace('<', "&lt;");
    let mut html = String::from("<table>");
    for name in names {
        let value = result.getattr(*name)?;
        let size = value.getattr_opt("size")?;
        let is_large = size.is_some_and(|size| size.gt(9).unwrap_or(false));
        let value = match is_large {
            true => format!("array of shape {}", value.getattr("shape")?),
            false => value.str()?.to_string(),
        };
        let value = escaped(value);
        html += &format!("<tr><th>{name}</th><td>{value}</td></tr>");
    }
    Ok(html + "</table>")
}

/// A frozen class with fields and the methods of every result.
macro_rules! result {
    (
        $(#[$meta:meta])* $name:ident { $($(#[$doc:meta])* $field:ident: $kind:ty,)+
            $(; [$($computed:ident),*] $once:ident: $held:ty)?
        }
        $($methods:tt)*
    ) => {
        $(#[$meta])*
        #[pyclass(frozen, module = "tactile_imaging")]
        pub(crate) struct $name {
            pub text: String,
            $($(#[$doc])* #[pyo3(get)] pub $field: $kind,)+
            $(pub $once: $held,)?
        }

        #[pymethods]
        impl $name {
            fn __repr__(&self) -> String {
                format!("{}({})", stringify!($name), self.text)
            }

            fn _repr_html_(slf: &Bound<'_, Self>) -> PyResult<String> {
                to_html(slf.as_any(), &[$(stringify!($field)),+])
            }

            /// Names of the attributes that are computed from the fields on demand.
            #[classattr]
            fn _computed() -> Vec<&'static str> {
                vec![$($(stringify!($computed)),*)?]
            }

            #[classattr]
            fn _fields() -> Vec<&'static str> {
                vec![$(stringify!($field)),+]
            }

            #[getter]
            fn _text(&self) -> &str {
                &self.text
            }

            #[staticmethod]
            fn _restored(text: String, fields: Vec<Bound<'_, PyAny>>) -> PyResult<Self> {
                let mut fields = fields.into_iter();
                let mut next = || fields.next().ok_or_else(|| invalid("a field is missing"));
                Ok(Self {
                    text,
                    $($field: next()?.extract::<$kind>()?,)+
                    $($once: <$held>::new(),)?
                })
            }

            /// The fields by name. With `plain` they contain only numbers, text and lists.
            #[pyo3(signature = (*, plain=false))]
            fn to_dict<'py>(slf: &Bound<'py, Self>, plain: bool) -> PyResult<Bound<'py, PyAny>> {
                of_values(slf.py(), "to_dict", (slf, plain))
            }

            /// Creates a result from fields by name, as returned by `to_dict`.
            #[classmethod]
            fn from_dict<'py>(
                class: &Bound<'py, PyType>,
                fields: &Bound<'py, PyDict>,
            ) -> PyResult<Bound<'py, PyAny>> {
                of_values(class.py(), "from_dict", (class, fields))
            }

            /// A table of the fields with one row per point, or of a single row.
            fn to_dataframe<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
                of_values(slf.py(), "to_dataframe", (slf,))
            }

            fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
                of_values(slf.py(), "reduced", (slf,))
            }

            fn __eq__(slf: &Bound<'_, Self>, other: &Bound<'_, PyAny>) -> PyResult<bool> {
                of_values(slf.py(), "equal", (slf, other))?.is_truthy()
            }

            fn __float__(slf: &Bound<'_, Self>) -> PyResult<f64> {
                of_values(slf.py(), "number", (slf,))?.extract()
            }

            fn __format__<'py>(
                slf: &Bound<'py, Self>,
                format: &str,
            ) -> PyResult<Bound<'py, PyAny>> {
                of_values(slf.py(), "formatted", (slf, format))
            }

            $($methods)*
        }
    };
}

result! {
    /// A number with its standard error.
    Estimate {
        /// Value.
        value: f64,
        /// Standard error of the value.
        standard_error: f64,
        /// 95 % interval. The upper end is None if the data do not bound it.
        interval_95: (f64, Option<f64>),
    }
}

result! {
    /// Young's modulus in pascals.
    Modulus {
        /// Young's modulus.
        value: f64,
        /// Standard error of the value.
        standard_error: f64,
        /// 95 % interval. The upper end is None if the loads do not bound it.
        interval_95: (f64, Option<f64>),
        /// The name of the estimator.
        estimator: String,
        /// Violated assumptions of the estimator, one sentence each.
        flags: Vec<String>,
    }
}

result! {
    /// One load of a series, as passed to an estimator.
    Load {
        /// Normal force in newtons.
        force: Py<Estimate>,
        /// Contact radius in metres.
        radius: Option<Py<Estimate>>,
        /// Contact area in square metres.
        area: Option<Py<Estimate>>,
        /// Indentation in metres.
        indentation: Option<Py<Estimate>>,
        /// Mean strain along the load, for specimens whose strain is computed.
        strain: Option<Py<Estimate>>,
    }
}

result! {
    /// The contact of one frame.
    Contact {
        /// Normal force in newtons, if the sensor is calibrated.
        force: Option<Py<Estimate>>,
        /// Contact radius in metres.
        radius: Py<Estimate>,
        /// Indentation in metres, for a sensor that measures depth.
        indentation: Option<Py<Estimate>>,
        /// Centroid x in pixels.
        x: Py<Estimate>,
        /// Centroid y in pixels.
        y: Py<Estimate>,
        /// Area in square metres.
        area: f64,
        /// Whether the contact is cut by the edge of the frame.
        touches_edge: bool,
        /// Doubts about the result, one sentence each.
        flags: Vec<String>,
    }
}

result! {
    /// A contact on a gel.
    GelContact {
        /// Centroid x in pixels.
        x: Py<Estimate>,
        /// Centroid y in pixels.
        y: Py<Estimate>,
        /// Area in square metres.
        area: Py<Estimate>,
        /// Largest depth in metres below the rim of the contact.
        depth: Py<Estimate>,
        /// Largest depth in metres below the gel far from contacts.
        depth_below_far: Py<Estimate>,
        /// Normal force in newtons, for sensors with a layer.
        force: Option<Py<Estimate>>,
        /// Columns and rows of the outline in order, (n, 2).
        outline: Matrix<i64>,
        /// Whether the contact is cut by the edge of the frame.
        touches_edge: bool,
    }
}

result! {
    /// The results of one frame of a gel.
    GelFrame {
        /// Displacement of the surface into the gel in metres, zero far from contacts.
        depth: Matrix<f64>,
        /// ∂depth/∂x along a row and ∂depth/∂y down the rows.
        gradient: (Matrix<f32>, Matrix<f32>),
        /// Standard errors of the depth of a pixel and of the common zero level.
        depth_error: (f64, f64),
        /// The contact of each pixel, from 1 in the order of `contacts`, and 0 without contact.
        labels: Matrix<u16>,
        /// The contacts, with that of the highest pressure first.
        contacts: Vec<Py<GelContact>>,
        /// Normal force of all contacts in newtons, for sensors with a layer.
        force: Option<Py<Estimate>>,
        /// Forces along x and y in newtons, from the dots of a gel with a layer (`GelSensor.follower`).
        shear: Option<(Py<Estimate>, Py<Estimate>)>,
        /// Torque about the axis through the centre of the frame in newton metres, from the dots.
        torque: Option<Py<Estimate>>,
        /// Fraction of the dots under the first contact that have slipped since it began.
        slip: Option<f64>,
        /// Doubts about the result, one sentence each.
        flags: Vec<String>,
        /// Size of a pixel on the gel in metres.
        pixel_size: f64,
    }

    /// Unit normals of the surface, (rows, columns, 3). z points to the object.
    fn normals<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray3<f32>> {
        let (p, q) = (
            self.gradient.0.bind(py).readonly(),
            self.gradient.1.bind(py).readonly(),
        );
        let (p, q) = (p.as_array(), q.as_array());
        let (rows, columns) = p.dim();
        let mut normals = Array3::zeros((rows, columns, 3));
        for ((at, p), q) in p.indexed_iter().zip(&q) {
            // The depth increases away from the object.
            let length = (1.0 + p * p + q * q).sqrt();
            for (k, part) in [*p, *q, 1.0].into_iter().enumerate() {
                normals[[at.0, at.1, k]] = part / length;
            }
        }
        PyArray3::from_owned_array(py, normals)
    }

    /// The surface as points in metres, (rows × columns, 3): x, y, and z to the object.
    fn points<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let depth = self.depth.bind(py).readonly();
        let depth = depth.as_array();
        let mut points = Array2::zeros((depth.len(), 3));
        for (mut point, ((row, column), z)) in points.outer_iter_mut().zip(depth.indexed_iter()) {
            point[0] = column as f64 * self.pixel_size;
            point[1] = row as f64 * self.pixel_size;
            point[2] = -z;
        }
        PyArray2::from_owned_array(py, points)
    }

    /// Plots the depth with the outlines of the contacts, as a matplotlib figure.
    fn plot<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let plots = slf.py().import("tactile_imaging._plot")?;
        plots.call_method1("plot_gel", (slf,))
    }
}

result! {
    /// Report of the calibration of a gel.
    GelReport {
        /// x, y and radius of the contacts in pixels, (n, 3). NaN for presses that were left out.
        circles: Matrix<f64>,
        /// Median angular error in degrees of the normals, with each press left out once.
        median_angle: f64,
        /// Relative standard error common to all slopes of a frame.
        slope_error: f64,
        /// Standard error of the depth of a pixel in metres.
        depth_error: f64,
        /// Doubts about the sensor, one sentence each.
        flags: Vec<String>,
    }
}

result! {
    /// Markers of a gel, followed from a reference to a frame.
    Markers {
        /// Positions in the reference in pixels, (n, 2).
        positions: Matrix<f64>,
        /// Displacements in pixels, (n, 2).
        displacements: Matrix<f64>,
        /// Standard errors of a coordinate of the position and of the displacement, (n, 2).
        standard_errors: Matrix<f64>,
        /// Step of a lattice by which the pairs can be shifted with an equal fit: the smallest
        /// motion is assumed. `None` for points that do not repeat.
        period: Option<Vec<f64>>,
        /// Doubts about the pairs, one sentence each.
        flags: Vec<String>,
    }
}

result! {
    /// Hertz's contact of a ball.
    HertzContact {
        /// Metres.
        contact_radius: f64,
        /// Metres.
        indentation: f64,
        /// Peak pressure in pascals.
        peak_pressure: f64,
        /// Mean pressure in pascals.
        mean_pressure: f64,
        /// Stiffness in newtons per metre.
        stiffness: f64,
        /// E* of both bodies in pascals.
        reduced_modulus: f64,
    }
}

result! {
    /// A reconstructed surface.
    Surface {
        /// Heights in metres, NaN outside the contact.
        heights: Matrix<f64>,
        /// Pixel size of the heights in metres, x and y.
        pixel_size: (f64, f64),
        /// Position of the first height in metres, x and y.
        origin: (f64, f64),
    }

    /// Positions of the columns along x in metres.
    #[getter]
    fn x<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let place = |k| self.origin.0 + self.pixel_size.0 * k as f64;
        PyArray1::from_iter(py, (0..self.heights.bind(py).shape()[1]).map(place))
    }

    /// Positions of the rows along y in metres.
    #[getter]
    fn y<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let place = |k| self.origin.1 + self.pixel_size.1 * k as f64;
        PyArray1::from_iter(py, (0..self.heights.bind(py).shape()[0]).map(place))
    }

    /// The heights.
    #[pyo3(signature = (dtype=None, copy=None))]
    fn __array__<'py>(
        &self,
        py: Python<'py>,
        dtype: Option<&Bound<'py, PyAny>>,
        copy: Option<bool>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let heights = self.heights.bind(py).as_any();
        match (dtype, copy) {
            (Some(dtype), _) => heights.call_method1("astype", (dtype,)),
            (None, Some(true)) => heights.call_method0("copy"),
            _ => Ok(heights.clone()),
        }
    }
}

result! {
    /// Mean strain between two frames.
    ///
    /// There is no interval, because the errors of neighbouring points are correlated to an unknown
    /// degree.
    Strain {
        /// Mean tensor over the control points, 3 × 3.
        value: Matrix<f64>,
        /// Standard error of the mean as if the points were independent, 3 × 3.
        standard_error: Matrix<f64>,
        /// Standard deviation over the control points, 3 × 3.
        spread: Matrix<f64>,
        /// Name of the strain measure.
        measure: String,
        /// Number of control points used.
        used: usize,
        /// Doubts about the result, one sentence each.
        flags: Vec<String>,
    }
}

result! {
    /// Strain between two point sets.
    StrainBetween {
        /// Mean tensor over the matched points, 3 × 3.
        value: Matrix<f64>,
        /// Standard error of the mean, 3 × 3.
        standard_error: Matrix<f64>,
        /// Lower and upper end of the 95 % interval of every component, 3 × 3 each.
        interval_95: (Matrix<f64>, Matrix<f64>),
        /// Rows of the matched points, before and after, (n, 2).
        pairs: Matrix<i64>,
        /// The matched points before, (n, d).
        points: Matrix<f64>,
        /// Displacement of every matched point by the smoothed deformation, (n, d).
        displacements: Matrix<f64>,
        /// Strain at every matched point, (n, 3, 3).
        strains: Tensors,
        /// Standard error of the strain at every matched point, (n, 3, 3).
        standard_errors: Tensors,
        /// Displacement gradient at every matched point, (n, 3, 3).
        displacement_gradients: Tensors,
        /// Standard error of the gradient, (n, 3, 3).
        displacement_gradient_errors: Tensors,
        /// Angle of the rotation at every matched point in radians, in the plane counter-clockwise,
        /// and its standard error, (n, 2).
        rotations_rad: Matrix<f64>,
        /// Principal strains at every matched point, the largest first, (n, 3).
        principal_strains: Matrix<f64>,
        /// Standard errors of the principal strains, (n, 3).
        principal_strain_errors: Matrix<f64>,
        /// Principal directions, up to their sign, (n, 3, 3). Row k of a point is direction k.
        principal_directions: Tensors,
        /// Ratio of volumes (of areas in the plane), after to before, and its standard error, (n, 2).
        size_ratios: Matrix<f64>,
        /// Von Mises' equivalent strain and its standard error, (n, 2).
        von_mises: Matrix<f64>,
        /// Noise of one coordinate in the unit of the points.
        sigma: f64,
        /// Step of a lattice by which the pairs can be shifted with an equal fit: the smallest
        /// motion is assumed. `None` for points that do not repeat.
        period: Option<Vec<f64>>,
        /// Reasons why the pairs are unreliable, one sentence each.
        flags: Vec<String>,
        /// Displacement and strain on the grid, if one was requested.
        grid: Option<Py<StrainGrid>>,
    }

    /// Writes displacement and strain in the legacy format of VTK (ParaView): of the grid, or of the
    /// matched points without a grid.
    ///
    /// Parameters
    /// ----------
    /// path : str or PathLike
    fn to_vtk(slf: &Bound<'_, Self>, path: PathBuf) -> PyResult<()> {
        of_values(slf.py(), "to_vtk", (slf, path)).map(|_| ())
    }

    /// Draws the displacements, and a component of the strain at the points.
    ///
    /// Parameters
    /// ----------
    /// row, column : int
    ///     The component.
    ///
    /// Returns
    /// -------
    /// matplotlib.figure.Figure
    ///
    /// Raises
    /// ------
    /// ImportError
    ///     matplotlib is not installed.
    #[pyo3(signature = (row=0, column=0))]
    fn plot<'py>(slf: &Bound<'py, Self>, row: usize, column: usize) -> PyResult<Bound<'py, PyAny>> {
        let plots = slf.py().import("tactile_imaging._plot")?;
        plots.call_method1("plot_strain", (slf, row, column))
    }
}

result! {
    /// Displacement and strain at given points.
    StrainGrid {
        /// Positions, (k, d), with the first axis fastest.
        points: Matrix<f64>,
        /// Number of points along each axis of a grid. Empty for given positions.
        counts: Vec<usize>,
        /// Displacements, (k, d).
        displacements: Matrix<f64>,
        /// Strains, (k, 3, 3). NaN if the deformation folds.
        strains: Tensors,
        /// Standard errors of the strains, (k, 3, 3).
        standard_errors: Tensors,
    }
}

/// Positions, (k, d), and the standard error of a coordinate of each.
type PlacesAndErrors<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>);

result! {
    /// Pairs of model and target points.
    Match {
        /// Target row of every model point, −1 for none, (n,).
        assignment: Vector<i64>,
        /// Probability that each row is correct, (n,).
        confidence: Vector<f64>,
        /// Rows of model and target of every pair, (k, 2).
        pairs: Matrix<i64>,
        /// Noise of one coordinate in the unit of the points.
        sigma: f64,
        /// Step of a lattice by which the pairs can be shifted with an equal fit: the smallest
        /// motion is assumed. `None` for points that do not repeat.
        period: Option<Vec<f64>>,
        /// Number of iterations.
        iterations: usize,
        /// For a matcher with a `transformation`: the rotation vector in radians (in the plane its last
        /// component), and the standard errors.
        rotation: Option<Vec<f64>>,
        rotation_error: Option<Vec<f64>>,
        /// Scale factor of lengths, and its standard error.
        scale: Option<f64>,
        scale_error: Option<f64>,
        /// Image of the origin, and the standard errors.
        translation: Option<Vec<f64>>,
        translation_error: Option<Vec<f64>>,
        /// Matrix of homogeneous coordinates, (d + 1, d + 1).
        matrix: Option<Matrix<f64>>,
        /// Reasons why the pairs are unreliable, if the matcher reports them, one sentence each.
        flags: Vec<String>,
        /// Model points, (n, d).
        model: Matrix<f64>,
        /// Target points, (m, d).
        target: Matrix<f64>,
        ; [warped, residual] warped_once: PyOnceLock<Matrix<f64>>
    }

    /// Images of the model points by `transform`, (n, d).
    #[getter]
    fn warped(&self, py: Python<'_>) -> PyResult<Matrix<f64>> {
        let moved = || {
            let model = self.model.bind(py);
            let places = match self.pairs.bind(py).is_empty() {
                true => model.readonly().as_array().to_owned(),
                false => self.moved(py, model.readonly().as_array())?.0,
            };
            Ok::<_, PyErr>(arrays::kept(py, places))
        };
        Ok(self.warped_once.get_or_try_init(py, moved)?.clone_ref(py))
    }

    /// Root mean square distance of the warped points from their targets.
    #[getter]
    fn residual(&self, py: Python<'_>) -> PyResult<f64> {
        let warped = self.warped(py)?;
        let sets = [warped.bind(py).readonly(), self.target.bind(py).readonly()];
        let [warped, target] = sets.each_ref().map(|set| set.as_array());
        let pairs = self.pairs.bind(py).readonly();
        let pairs = pairs.as_array();
        let squares = pairs.rows().into_iter().map(|pair| {
            let miss = &warped.row(pair[0] as usize) - &target.row(pair[1] as usize);
            miss.dot(&miss)
        });
        Ok((squares.sum::<f64>() / pairs.nrows().max(1) as f64).sqrt())
    }

    /// Draws the points in the plane (points in space are seen along z), with a line from each to its
    /// target.
    ///
    /// Returns
    /// -------
    /// matplotlib.figure.Figure
    ///
    /// Raises
    /// ------
    /// ImportError
    ///     matplotlib is not installed.
    fn plot<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let plots = slf.py().import("tactile_imaging._plot")?;
        plots.call_method1("plot_match", (slf,))
    }

    /// Maps points by the matrix of a `transformation`, or by the local field of the pairs.
    ///
    /// Parameters
    /// ----------
    /// points : (k, d) array
    ///
    /// Returns
    /// -------
    /// points, standard_errors : ndarray
    ///     Mapped points, (k, d), and the standard error of a coordinate of each, (k,).
    ///
    /// Raises
    /// ------
    /// TactileError
    ///     There are no pairs.
    fn transform<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
    ) -> PyResult<PlacesAndErrors<'py>> {
        let points = arrays::matrix("points", points)?;
        let (places, errors) = self.moved(py, points.as_array())?;
        Ok((PyArray2::from_owned_array(py, places), PyArray1::from_vec(py, errors)))
    }
}

impl Match {
    /// See `transform`.
    fn moved(
        &self,
        py: Python<'_>,
        view: ArrayView2<'_, f64>,
    ) -> PyResult<(Array2<f64>, Vec<f64>)> {
        let sets = [&self.model, &self.target].map(|set| set.bind(py).readonly());
        let [model, target] = sets.each_ref().map(|set| set.as_array());
        let pairs = self.pairs.bind(py).readonly();
        let matrix = self
            .matrix
            .as_ref()
            .map(|matrix| matrix.bind(py).readonly());
        let matrix = matrix.as_ref().map(|matrix| matrix.as_array());
        let set = |set: ArrayView2<'_, f64>, side: usize| {
            let rows = pairs.as_array();
            let row = |k: usize| set.row(rows[[k, side]] as usize).to_vec();
            let rows: Vec<f64> = (0..rows.nrows()).flat_map(row).collect();
            Array2::from_shape_vec((pairs.as_array().nrows(), set.ncols()), rows)
        };
        let [sources, images] = [set(model, 0), set(target, 1)];
        let (sources, images) = (sources.map_err(invalid)?, images.map_err(invalid)?);
        arrays::dimension(["the model", "points"], [model, view])?;
        let noise = self.sigma;
        let sets = [sources.view(), images.view(), view];
        let found = Signals::during(py, |signals| match model.ncols() {
            2 => moved::<2>(sets, matrix, noise, signals),
            _ => moved::<3>(sets, matrix, noise, signals),
        })?;
        found.map_err(failed)
    }
}

result! {
    /// A lump under the surface of a block.
    Lump {
        /// x of the centre in metres, from the axis of the guide, or in the coordinates of the presses of
        /// a scan. None if the lump was searched only under the axis.
        x: Option<Py<Estimate>>,
        /// y of the centre, like `x`.
        y: Option<Py<Estimate>>,
        /// Diameter in metres of a ball of equal volume.
        diameter: Py<Estimate>,
        /// Depth of the top of the lump in metres.
        depth: Py<Estimate>,
        /// Young's modulus of the lump in pascals.
        youngs_modulus: Py<Estimate>,
        /// Ratio of height along the axis to width.
        height_over_width: Option<Py<Estimate>>,
        /// Probability that the lump is a ball.
        ball_probability: f64,
        /// The names of diameter, depth and modulus that are determined by the frames. Only the interval
        /// of the others is meaningful.
        identified: Vec<String>,
    }
}

result! {
    /// Result of the search for a lump in a block.
    Inclusion {
        /// "found", "absent" or "uncertain".
        verdict: String,
        /// Probability that there is a lump.
        probability: f64,
        /// Young's modulus of the block in pascals.
        block_modulus: Py<Estimate>,
        /// One lump or two. Empty if the frames show none or cannot be explained.
        lumps: Vec<Py<Lump>>,
        /// "bonded" or "frictionless": whether the face of the guide sticks to the block or slides on
        /// it.
        interface: String,
        /// The largest balls that would not be found. None unless they were asked for.
        hidden: Option<Py<HiddenLumps>>,
        /// Doubts about the result, one sentence each.
        flags: Vec<String>,
    }
}

result! {
    /// The largest balls in a block that a search would not find.
    HiddenLumps {
        /// Positions of their centres in metres, (n, 2).
        positions: Matrix<f64>,
        /// Depths of their tops in metres, (k,).
        depths: Vector<f64>,
        /// Diameters in metres by depth and position, (k, n). Infinite if no ball would be found.
        diameters: Matrix<f64>,
        /// Position in metres where the next press would show most. None if there is no place.
        next_position: Option<(f64, f64)>,
    }
}

result! {
    /// A simulated press with the true values.
    SimulatedPress {
        /// The frame without contact, uint8.
        reference: Matrix<u8>,
        /// One frame per load, uint8.
        frames: Vec<Matrix<u8>>,
        /// Calibration of the sensor: integrated pixel values and forces in newtons, (n, 2).
        pairs: Matrix<f64>,
        /// Size of a pixel in metres, x and y.
        pixel_size: (f64, f64),
        /// Layers of the waveguide: thickness in metres, Young's modulus in pascals, Poisson's
        /// ratio, (n, 3).
        waveguide: Matrix<f64>,
        /// Radius of the ball in metres.
        radius: f64,
        /// Poisson's ratio of the ball.
        poisson_ratio: f64,
        /// The estimator that corresponds to the simulated contacts.
        estimator: String,
        /// The true Young's modulus, forces, contact radii and centres.
        truth: Py<PyDict>,
    }
}

/// Images of points and the standard error of a coordinate, from sources, their images and the points.
fn moved<const D: usize>(
    [sources, images, points]: [ArrayView2<'_, f64>; 3],
    matrix: Option<ArrayView2<'_, f64>>,
    noise: f64,
    signals: &mut Signals,
) -> Result<(Array2<f64>, Vec<f64>), TpsError> {
    let [sources, images, points] = [sources, images, points].map(arrays::points::<D>);
    let Some(matrix) = matrix else {
        let field = LocalField::fit_watched(&sources, &images, |_| signals.check())?;
        let field = field.at_watched(&points, || signals.check())?;
        let places: Vec<_> = points
            .iter()
            .zip(&field)
            .map(|(point, at)| point + at.displacement)
            .collect();
        let errors = field
            .iter()
            .map(|at| at.displacement_variance.sqrt())
            .collect();
        return Ok((arrays::rows(&places), errors));
    };
    let linear = SMatrix::<f64, D, D>::from_fn(|i, k| matrix[[i, k]]);
    let shift = SVector::<f64, D>::from_fn(|i, _| matrix[[i, D]]);
    let places: Vec<_> = points
        .iter()
        .map(|p| Point::from(linear * p.coords + shift))
        .collect();
    // The error combines that of the mean and that of the other parameters of the map. The second
    // increases with the distance from the mean. Each of D directions is assumed to have an equal
    // part of the spread.
    let count = sources.len().max(1) as f64;
    let centre = sources.iter().map(|p| p.coords).sum::<SVector<f64, D>>() / count;
    let spread: f64 = sources
        .iter()
        .map(|p| (p.coords - centre).norm_squared())
        .sum();
    let error = |point: &Point<f64, D>| {
        let arm = (point.coords - centre).norm_squared();
        noise * (count.recip() + D as f64 * arm / spread.max(f64::MIN_POSITIVE)).sqrt()
    };
    let errors = points.iter().map(error).collect();
    Ok((arrays::rows(&places), errors))
}

impl Estimate {
    pub(crate) fn of(py: Python<'_>, estimate: CoreEstimate) -> PyResult<Py<Self>> {
        let CoreEstimate {
            value,
            standard_error,
            ..
        } = estimate;
        Self::within(py, value, standard_error, ends(estimate.interval_95()))
    }

    pub(crate) fn within(
        py: Python<'_>,
        value: f64,
        standard_error: f64,
        interval_95: (f64, Option<f64>),
    ) -> PyResult<Py<Self>> {
        let text = format!("{value:.6e} ± {standard_error:.1e}");
        Py::new(
            py,
            Self {
                text,
                value,
                standard_error,
                interval_95,
            },
        )
    }
}

pub(crate) fn ends(interval: Interval) -> (f64, Option<f64>) {
    (interval.lower, interval.upper)
}
