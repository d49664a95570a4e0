//! Frozen results: fields, a sentence, a table for notebooks, a dictionary.
use crate::arrays::{Matrix, Tensors, Vector};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use tactile_imaging::core::{Estimate as CoreEstimate, Interval};

/// The fields of a result by name. Results inside become dictionaries too.
pub fn to_dict<'py>(result: &Bound<'py, PyAny>, names: &[&str]) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(result.py());
    for &name in names {
        dict.set_item(name, plain(result.getattr(name)?)?)?;
    }
    Ok(dict)
}

/// A result, or a list of results, as dictionaries. Other values as they are.
fn plain(value: Bound<'_, PyAny>) -> PyResult<Bound<'_, PyAny>> {
    if let Ok(list) = value.cast::<PyList>() {
        let values = list.iter().map(plain).collect::<PyResult<Vec<_>>>()?;
        return Ok(PyList::new(value.py(), values)?.into_any());
    }
    match value.hasattr("to_dict")? {
        true => value.call_method0("to_dict"),
        false => Ok(value),
    }
}

/// A table of two columns. Values are escaped: they may hold text of the caller. Of arrays larger
/// than a tensor the shape is shown.
pub fn to_html(result: &Bound<'_, PyAny>, names: &[&str]) -> PyResult<String> {
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

/// A frozen class of fields with what every result has.
macro_rules! result {
    ($(#[$meta:meta])* $name:ident { $($(#[$doc:meta])* $field:ident: $kind:ty,)+ }) => {
        $(#[$meta])*
        #[pyclass(frozen, module = "tactile_imaging")]
        pub(crate) struct $name {
            pub text: String,
            $($(#[$doc])* #[pyo3(get)] pub $field: $kind,)+
        }

        #[pymethods]
        impl $name {
            fn __repr__(&self) -> String {
                format!("{}({})", stringify!($name), self.text)
            }

            fn _repr_html_(slf: &Bound<'_, Self>) -> PyResult<String> {
                to_html(slf.as_any(), &[$(stringify!($field)),+])
            }

            /// The fields by name.
            fn to_dict<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
                to_dict(slf.as_any(), &[$(stringify!($field)),+])
            }
        }
    };
}

result! {
    /// A number with its standard error.
    Estimate {
        /// The number.
        value: f64,
        /// Its standard error.
        standard_error: f64,
        /// Its 95 % interval. No upper end where the data do not bound it.
        interval_95: (f64, Option<f64>),
    }
}

result! {
    /// Young's modulus in pascals.
    Modulus {
        /// Young's modulus.
        value: f64,
        /// Its standard error.
        standard_error: f64,
        /// Its 95 % interval. No upper end where the loads do not bound it.
        interval_95: (f64, Option<f64>),
        /// The name of the estimator.
        estimator: String,
        /// Where the estimator's assumptions fail, a sentence each.
        flags: Vec<String>,
    }
}

result! {
    /// One load of a series, as an estimator gets it.
    Load {
        /// Normal force in newtons.
        force: Py<Estimate>,
        /// Contact radius in metres.
        radius: Option<Py<Estimate>>,
        /// Contact area in square metres.
        area: Option<Py<Estimate>>,
        /// Indentation in metres.
        indentation: Option<Py<Estimate>>,
        /// Mean strain along the load, of specimens whose strain is worked out.
        strain: Option<Py<Estimate>>,
    }
}

result! {
    /// The contact of one frame.
    Contact {
        /// Normal force in newtons, where the sensor is calibrated.
        force: Option<Py<Estimate>>,
        /// Contact radius in metres.
        radius: Py<Estimate>,
        /// Indentation in metres, of a sensor that reads depth.
        indentation: Option<Py<Estimate>>,
        /// Centroid x in pixels.
        x: Py<Estimate>,
        /// Centroid y in pixels.
        y: Py<Estimate>,
        /// Area in square metres.
        area: f64,
        /// Whether the frame's edge cuts the contact.
        touches_edge: bool,
        /// What is doubtful about it, a sentence each.
        flags: Vec<String>,
    }
}

result! {
    /// A place where something touches a gel.
    GelContact {
        /// Centroid x in pixels.
        x: Py<Estimate>,
        /// Centroid y in pixels.
        y: Py<Estimate>,
        /// Area in square metres.
        area: Py<Estimate>,
        /// Greatest depth in metres below the contact's own rim.
        depth: Py<Estimate>,
        /// Greatest depth in metres below the gel far away.
        depth_below_far: Py<Estimate>,
        /// Normal force in newtons, of sensors with a layer.
        force: Option<Py<Estimate>>,
        /// Columns and rows of the outline in order, (n, 2).
        outline: Matrix<i64>,
        /// Whether the frame's edge cuts the contact.
        touches_edge: bool,
    }
}

result! {
    /// How the presses of a gel's calibration were read.
    GelReport {
        /// x, y and radius of the contacts in pixels, (n, 3), NaN of presses that were left out.
        circles: Matrix<f64>,
        /// Median angle in degrees of normals of presses left out in turn.
        median_angle: f64,
        /// Relative standard error of all slopes of a frame together.
        slope_error: f64,
        /// Standard error of the depth of a pixel in metres.
        depth_error: f64,
        /// Why the sensor may be wrong, a sentence each.
        flags: Vec<String>,
    }
}

result! {
    /// Markers of a gel, followed from a reference to a frame.
    Markers {
        /// Places in the reference in pixels, (n, 2).
        positions: Matrix<f64>,
        /// Displacements in pixels, (n, 2).
        displacements: Matrix<f64>,
        /// Standard errors of a coordinate of the place and of the displacement, (n, 2).
        standard_errors: Matrix<f64>,
        /// Why the pairs may be wrong, a sentence each.
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
        /// Pascals, in the middle.
        peak_pressure: f64,
        /// Pascals.
        mean_pressure: f64,
        /// Newtons a metre.
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
        /// Size of a pixel of the heights in metres, x and y.
        pixel_size: (f64, f64),
        /// Place of the first height in metres, x and y.
        origin: (f64, f64),
    }
}

result! {
    /// Mean strain between two frames.
    ///
    /// There is no interval: what a point is off is off at its neighbours too, and by how much is
    /// not known.
    Strain {
        /// Mean tensor over the control points, 3 × 3.
        value: Matrix<f64>,
        /// Standard error of the mean as if the points were independent, 3 × 3.
        standard_error: Matrix<f64>,
        /// Standard deviation over the control points, 3 × 3.
        spread: Matrix<f64>,
        /// The name of the measure of strain.
        measure: String,
        /// Control points that count.
        used: usize,
        /// What is doubtful about it, a sentence each.
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
        /// Displacement of every matched point by the smoothed deformation, (n, d).
        displacements: Matrix<f64>,
        /// Strain at every matched point, (n, 3, 3).
        strains: Tensors,
        /// Standard error of the strain at every matched point, (n, 3, 3).
        standard_errors: Tensors,
        /// Displacement gradient at every matched point, (n, 3, 3).
        displacement_gradients: Tensors,
        /// Its standard error, (n, 3, 3).
        displacement_gradient_errors: Tensors,
        /// Angle of the rotation at every matched point in radians, in the plane counter-clockwise,
        /// and its standard error, (n, 2).
        rotations_rad: Matrix<f64>,
        /// Principal strains at every matched point, the largest first, (n, 3).
        principal_strains: Matrix<f64>,
        /// Their standard errors, (n, 3).
        principal_strain_errors: Matrix<f64>,
        /// Their directions, up to sign: row k of a point is direction k, (n, 3, 3).
        principal_directions: Tensors,
        /// Volume, in the plane area, over that before, and its standard error, (n, 2).
        size_ratios: Matrix<f64>,
        /// Von Mises' equivalent strain and its standard error, (n, 2).
        von_mises: Matrix<f64>,
        /// Noise of one coordinate in the unit of the points.
        sigma: f64,
        /// Why the pairs are not to be relied on, a sentence each.
        flags: Vec<String>,
    }
}

result! {
    /// Which model point is which target point.
    Match {
        /// Target row of every model point, −1 for none, (n,).
        assignment: Vector<i64>,
        /// Probability that each of these is right, (n,).
        confidence: Vector<f64>,
        /// The warped model points, (n, d).
        warped: Matrix<f64>,
        /// Rows of model and target of every pair, (k, 2).
        pairs: Matrix<i64>,
        /// Noise of one coordinate in the unit of the points.
        sigma: f64,
        /// Root mean square distance of the warped points from their targets.
        residual: f64,
        /// Iterations.
        iterations: usize,
        /// Of a matcher with a `transformation`: the rotation vector in radians, in the plane its
        /// last number, and the standard errors.
        rotation: Option<Vec<f64>>,
        rotation_error: Option<Vec<f64>>,
        /// The growth of lengths, and its standard error.
        scale: Option<f64>,
        scale_error: Option<f64>,
        /// Where the origin goes, and the standard errors.
        shift: Option<Vec<f64>>,
        shift_error: Option<Vec<f64>>,
        /// Why the pairs are not to be relied on, where the matcher can tell, a sentence each.
        flags: Vec<String>,
    }
}

result! {
    /// A lump under the surface of a block.
    Lump {
        /// Its middle along x from the axis of the guide, or of a scan in the coordinates of its
        /// presses, in metres. None where it was searched under the axis.
        x: Option<Py<Estimate>>,
        /// The same along y.
        y: Option<Py<Estimate>>,
        /// Diameter of the ball of its volume in metres.
        diameter: Py<Estimate>,
        /// Depth of its top in metres.
        depth: Py<Estimate>,
        /// Its Young's modulus in pascals.
        youngs_modulus: Py<Estimate>,
        /// Its height along the axis over its width.
        height_over_width: Option<Py<Estimate>>,
        /// Probability that it is a ball.
        ball_probability: f64,
        /// Names of those of diameter, depth and modulus that the frames determine. Of the others
        /// the interval alone is of use.
        identified: Vec<&'static str>,
    }
}

result! {
    /// What a search for a lump in a block found.
    Inclusion {
        /// "found", "absent" or "uncertain".
        verdict: String,
        /// Probability that there is a lump.
        probability: f64,
        /// Young's modulus of the block in pascals.
        block_modulus: Py<Estimate>,
        /// The lump, or two of them. None where the frames show none, or it is not explained.
        lumps: Vec<Py<Lump>>,
        /// "bonded" or "frictionless", whether the guide's face sticks to the block or slides on
        /// it.
        interface: &'static str,
        /// What is doubtful about it, a sentence each.
        flags: Vec<String>,
    }
}

result! {
    /// A simulated press with its truth.
    SimulatedPress {
        /// The frame without contact, uint8.
        reference: Matrix<u8>,
        /// One frame for each load, uint8.
        frames: Vec<Matrix<u8>>,
        /// Calibration of the sensor: integrated pixel value and newtons, (n, 2).
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
        /// The estimator that knows the simulated contacts.
        estimator: &'static str,
        /// The true Young's modulus, forces, contact radii and centres.
        truth: Py<PyDict>,
    }
}

impl Estimate {
    pub fn of(py: Python<'_>, estimate: CoreEstimate) -> PyResult<Py<Self>> {
        let CoreEstimate {
            value,
            standard_error,
            ..
        } = estimate;
        Self::within(py, value, standard_error, ends(estimate.interval_95()))
    }

    pub fn within(
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

pub fn ends(interval: Interval) -> (f64, Option<f64>) {
    (interval.lower, interval.upper)
}
