//! Arrays of NumPy to those of Rust and back.
use crate::errors::invalid;
use nalgebra::{Matrix3, Point};
use ndarray::{Array1, Array2, Array3, ArrayView2, Dimension};
use numpy::{Element, PyArray, PyArray1, PyArray2, PyArray3, PyReadonlyArrayDyn};
use pyo3::prelude::*;

/// What NumPy makes of an argument, whose kind of numbers is one of `kinds`, as `dtype`.
fn read<'py, T: Element>(
    name: &str,
    given: &Bound<'py, PyAny>,
    kinds: &str,
    dtype: &str,
) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
    let numpy = given.py().import("numpy")?;
    let array = numpy
        .call_method1("asarray", (given,))
        .map_err(|error| invalid(format!("{name} is no array: {error}")))?;
    let found = array.getattr("dtype")?;
    let kind: String = found.getattr("kind")?.extract()?;
    if !kinds.contains(&kind) {
        return Err(invalid(format!(
            "{name} must be an array of {dtype}, found {found}"
        )));
    }
    // Aligned and in the machine's order of bytes, copied only where it is not.
    let aligned = numpy.call_method1("require", (array, dtype, "A"))?;
    aligned.extract()
}

/// A copy of a view of two axes.
fn two_axes<T: Element + Copy + Default>(
    name: &str,
    array: &PyReadonlyArrayDyn<'_, T>,
) -> PyResult<Array2<T>> {
    let view = array.as_array();
    let &[rows, columns] = view.shape() else {
        let shape = view.shape();
        return Err(invalid(format!(
            "{name} must have two axes, found shape {shape:?}"
        )));
    };
    // NumPy's strides of an array without elements may be any.
    if view.is_empty() {
        return Ok(Array2::default((rows, columns)));
    }
    let view = view.into_dimensionality::<ndarray::Ix2>();
    Ok(view.map_err(invalid)?.to_owned())
}

/// A matrix of floating-point numbers.
pub fn matrix(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Array2<f64>> {
    two_axes(name, &read::<f64>(name, given, "iufb", "float64")?)
}

/// A frame: a matrix of bytes, [row, column]. Other numbers are refused, because a cast would wrap.
pub fn frame(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Array2<u8>> {
    let found = || -> PyResult<String> { Ok(given.getattr("dtype")?.str()?.to_string()) };
    if found().is_ok_and(|dtype| dtype != "uint8") {
        let found = found()?;
        return Err(invalid(format!(
            "{name} must be a frame of uint8, found {found}"
        )));
    }
    two_axes(name, &read::<u8>(name, given, "u", "uint8")?)
}

/// A vector of integers, as indices that may be −1.
pub fn indices(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<i64>> {
    let array = read::<i64>(name, given, "iu", "int64")?;
    let view = array.as_array();
    if view.ndim() != 1 {
        let shape = view.shape();
        return Err(invalid(format!(
            "{name} must have one axis, found shape {shape:?}"
        )));
    }
    Ok(view.iter().copied().collect())
}

/// A vector of floating-point numbers.
pub fn vector(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let array = read::<f64>(name, given, "iufb", "float64")?;
    let view = array.as_array();
    if view.ndim() != 1 {
        let shape = view.shape();
        return Err(invalid(format!(
            "{name} must have one axis, found shape {shape:?}"
        )));
    }
    Ok(view.iter().copied().collect())
}

/// Pixel size along x and y: one number for both, or two.
pub fn pixel_size(given: &Bound<'_, PyAny>) -> PyResult<[f64; 2]> {
    if let Ok(both) = given.extract::<f64>() {
        return Ok([both; 2]);
    }
    let sizes = vector("pixel_size", given)?;
    <[f64; 2]>::try_from(sizes).map_err(|_| invalid("pixel_size must be one number or two"))
}

/// Two sets of points in the plane or in space.
pub fn dimension(names: [&str; 2], sets: [ArrayView2<'_, f64>; 2]) -> PyResult<usize> {
    let [first, second] = sets.map(|set| set.ncols());
    if first != second || !(2..=3).contains(&first) {
        let [a, b] = names;
        return Err(invalid(format!(
            "{a} and {b} must both have two or three columns, found {first} and {second}"
        )));
    }
    Ok(first)
}

pub fn points<const D: usize>(rows: ArrayView2<'_, f64>) -> Vec<Point<f64, D>> {
    let point = |row: ndarray::ArrayView1<'_, f64>| Point::from(std::array::from_fn(|k| row[k]));
    rows.rows().into_iter().map(point).collect()
}

pub fn rows<const D: usize>(points: &[Point<f64, D>]) -> Array2<f64> {
    Array2::from_shape_fn((points.len(), D), |(i, k)| points[i][k])
}

/// An array that nobody can change, as a part of a frozen result.
pub fn kept<T: Element, D: Dimension>(
    py: Python<'_>,
    array: ndarray::Array<T, D>,
) -> Py<PyArray<T, D>> {
    let array = PyArray::from_owned_array(py, array);
    if let Ok(flags) = array.getattr("flags") {
        // An array of its own accepts this, and one that did not would still be right.
        let _ = flags.setattr("writeable", false);
    }
    array.unbind()
}

pub type Vector<T> = Py<PyArray1<T>>;
pub type Matrix<T> = Py<PyArray2<T>>;
pub type Tensors = Py<PyArray3<f64>>;

pub fn kept_vector<T: Element>(py: Python<'_>, values: Vec<T>) -> Vector<T> {
    kept(py, Array1::from_vec(values))
}

pub fn kept_tensor(py: Python<'_>, tensor: &Matrix3<f64>) -> Matrix<f64> {
    kept(py, Array2::from_shape_fn((3, 3), |(i, j)| tensor[(i, j)]))
}

pub fn kept_tensors(py: Python<'_>, tensors: &[Matrix3<f64>]) -> Tensors {
    let shape = (tensors.len(), 3, 3);
    kept(
        py,
        Array3::from_shape_fn(shape, |(n, i, j)| tensors[n][(i, j)]),
    )
}
