//! Conversion of NumPy arrays. They are read in place if their type and layout allow it.
use crate::errors::invalid;
use nalgebra::{Matrix3, Point};
use ndarray::{Array1, Array2, Array3, ArrayView2, Dimension};
use numpy::{
    Element, PyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray2,
    PyReadonlyArrayDyn, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use tactile_files::sensor::GelPixels;

/// Converts an argument with NumPy to `dtype`. Its kind of numbers must be one of `kinds`.
fn read<'py, T: Element>(
    name: &str,
    given: &Bound<'py, PyAny>,
    kinds: &str,
    dtype: &str,
) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
    let numpy = given.py().import("numpy")?;
    let array = asarray(name, given)?;
    let found = array.getattr("dtype")?;
    let kind: String = found.getattr("kind")?.extract()?;
    if !kinds.contains(&kind) {
        return Err(invalid(format!(
            "{name} must be an array of {dtype}, found {found}"
        )));
    }
    // Aligned and in native byte order, copied only if necessary.
    let aligned = numpy.call_method1("require", (array, dtype, "A"))?;
    aligned.extract()
}

/// An argument converted by NumPy. An array with a mask is an error, because the mask would be lost.
pub(crate) fn asarray<'py>(name: &str, given: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    unmasked(name, given)?;
    let array = given
        .py()
        .import("numpy")?
        .call_method1("asarray", (given,));
    array.map_err(|error| invalid(format!("{name} is no array: {error}")))
}

fn unmasked(name: &str, given: &Bound<'_, PyAny>) -> PyResult<()> {
    match given.getattr_opt("mask")? {
        Some(mask)
            if mask
                .call_method0("any")
                .and_then(|any| any.is_truthy())
                .unwrap_or(false) =>
        {
            Err(invalid(format!(
                "{name} is a masked array: leave out masked values, or fill them"
            )))
        }
        _ => Ok(()),
    }
}

fn axes(name: &str, expected: &str, shape: &[usize]) -> PyErr {
    invalid(format!(
        "{name} must have {expected}, found shape {shape:?}"
    ))
}

/// An array of two axes. Aligned and contiguous NumPy arrays are read in place.
fn two_axes<'py, T: Element>(
    name: &str,
    given: &Bound<'py, PyAny>,
    kinds: &str,
    dtype: &str,
) -> PyResult<PyReadonlyArray2<'py, T>> {
    if let Ok(array) = given.cast::<PyArray2<T>>() {
        unmasked(name, given)?;
        let aligned = (array.data() as usize).is_multiple_of(align_of::<T>());
        if aligned && array.is_c_contiguous() {
            return Ok(array.try_readonly()?);
        }
    }
    let array = read::<T>(name, given, kinds, dtype)?;
    let shape = array.shape().to_vec();
    let expected = match *shape.as_slice() {
        [_, _, 3] => "two axes, of grey levels (cv2.cvtColor makes them of colours)",
        _ => "two axes",
    };
    let two = array.cast::<PyArray2<T>>();
    Ok(two
        .map_err(|_| axes(name, expected, &shape))?
        .try_readonly()?)
}

/// A matrix of floating-point numbers.
pub(crate) fn matrix<'py>(
    name: &str,
    given: &Bound<'py, PyAny>,
) -> PyResult<PyReadonlyArray2<'py, f64>> {
    two_axes(name, given, "iufb", "float64")
}

/// A mask: a matrix of booleans.
pub(crate) fn mask(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Array2<bool>> {
    let array = two_axes::<bool>(name, given, "b", "bool")?;
    Ok(owned(array.as_array()))
}

/// A frame: a matrix of bytes, [row, column]. Other numbers are an error, because a cast would wrap.
pub(crate) fn frame<'py>(
    name: &str,
    given: &Bound<'py, PyAny>,
) -> PyResult<PyReadonlyArray2<'py, u8>> {
    if given.cast::<PyArray2<u8>>().is_err()
        && let Ok(found) = given.getattr("dtype")
        && found.str()? != "uint8"
    {
        return Err(invalid(format!(
            "{name} must be a frame of uint8, found {found}"
        )));
    }
    two_axes(name, given, "u", "uint8")
}

/// A frame of a gel, of grey levels or colours with any order of channels: bytes.
pub(crate) fn gel(name: &str, given: &Bound<'_, PyAny>) -> PyResult<GelPixels> {
    let array = bytes(name, given)?;
    let shape = array.shape().to_vec();
    let levels = array.as_array().to_owned();
    match *shape.as_slice() {
        [_, _, 3] => Ok(GelPixels::Colour(
            levels.into_dimensionality().map_err(invalid)?,
        )),
        [_, _] => Ok(GelPixels::Grey(
            levels.into_dimensionality().map_err(invalid)?,
        )),
        _ => {
            let wanted = "three axes (rows, columns, 3) of a gel lit in colours, or two of one \
                          that darkens";
            Err(axes(name, wanted, &shape))
        }
    }
}

/// Grey levels of a frame of bytes: the mean of its channels.
pub(crate) fn grey(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Array2<f64>> {
    let array = bytes(name, given)?;
    let levels = array.as_array().mapv(f64::from);
    let shape = levels.shape().to_vec();
    let levels = match *shape.as_slice() {
        [_, _] => levels,
        [_, _, 3] => levels.sum_axis(ndarray::Axis(2)) / 3.0,
        _ => return Err(axes(name, "two axes, or three with three channels", &shape)),
    };
    levels.into_dimensionality().map_err(invalid)
}

fn bytes<'py>(name: &str, given: &Bound<'py, PyAny>) -> PyResult<PyReadonlyArrayDyn<'py, u8>> {
    let found = asarray(name, given)?;
    let kind = found.getattr("dtype")?;
    if kind.str()? != "uint8" {
        return Err(invalid(format!(
            "{name} must be a frame of uint8, found {kind}"
        )));
    }
    read(name, &found, "u", "uint8")
}

/// A copy. ndarray does not accept NumPy's strides of an array without elements.
pub(crate) fn owned<T: Clone + Default>(view: ArrayView2<'_, T>) -> Array2<T> {
    match view.is_empty() {
        true => Array2::default(view.dim()),
        false => view.to_owned(),
    }
}

/// A vector of integers, as indices that may be −1.
pub(crate) fn indices(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<i64>> {
    one_axis(name, given, "iu", "int64")
}

/// A vector of floating-point numbers.
pub(crate) fn vector(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    one_axis(name, given, "iufb", "float64")
}

fn one_axis<T: Element + Copy>(
    name: &str,
    given: &Bound<'_, PyAny>,
    kinds: &str,
    dtype: &str,
) -> PyResult<Vec<T>> {
    let array = read::<T>(name, given, kinds, dtype)?;
    match array.ndim() {
        1 => Ok(array.as_array().iter().copied().collect()),
        _ => Err(axes(name, "one axis", array.shape())),
    }
}

/// Pixel size along x and y: one number for both, or two.
pub(crate) fn pixel_size(given: &Bound<'_, PyAny>) -> PyResult<[f64; 2]> {
    if let Ok(both) = given.extract::<f64>() {
        return Ok([both; 2]);
    }
    let sizes = vector("pixel_size", given)?;
    <[f64; 2]>::try_from(sizes).map_err(|_| invalid("pixel_size must be one number or two"))
}

/// The rows of an array of N columns.
pub(crate) fn columns<const N: usize>(
    name: &str,
    given: &Bound<'_, PyAny>,
) -> PyResult<Vec<[f64; N]>> {
    let array = matrix(name, given)?;
    let view = array.as_array();
    if view.ncols() != N {
        return Err(axes(name, &format!("{N} columns"), view.shape()));
    }
    let row = |row: ndarray::ArrayView1<'_, f64>| std::array::from_fn(|k| row[k]);
    Ok(view.rows().into_iter().map(row).collect())
}

/// Two sets of points in the plane or in space.
pub(crate) fn dimension(names: [&str; 2], sets: [ArrayView2<'_, f64>; 2]) -> PyResult<usize> {
    let [first, second] = sets.map(|set| set.ncols());
    if first != second || !(2..=3).contains(&first) {
        let [a, b] = names;
        return Err(invalid(format!(
            "{a} and {b} must both have two or three columns, found {first} and {second}"
        )));
    }
    Ok(first)
}

pub(crate) fn points<const D: usize>(rows: ArrayView2<'_, f64>) -> Vec<Point<f64, D>> {
    let point = |row: ndarray::ArrayView1<'_, f64>| Point::from(std::array::from_fn(|k| row[k]));
    rows.rows().into_iter().map(point).collect()
}

pub(crate) fn rows<const D: usize>(points: &[Point<f64, D>]) -> Array2<f64> {
    Array2::from_shape_fn((points.len(), D), |(i, k)| points[i][k])
}

pub(crate) fn tensor(rows: ArrayView2<'_, f64>) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| rows[[i, j]])
}

/// A read-only array, as a part of a frozen result.
pub(crate) fn kept<T: Element, D: Dimension>(
    py: Python<'_>,
    array: ndarray::Array<T, D>,
) -> Py<PyArray<T, D>> {
    let array = PyArray::from_owned_array(py, array);
    if let Ok(flags) = array.getattr("flags") {
        // Setting this flag on a new array succeeds. The result would be correct without it.
        let _ = flags.setattr("writeable", false);
    }
    array.unbind()
}

pub(crate) type Vector<T> = Py<PyArray1<T>>;
pub(crate) type Matrix<T> = Py<PyArray2<T>>;
pub(crate) type Tensors = Py<PyArray3<f64>>;

pub(crate) fn kept_vector<T: Element>(py: Python<'_>, values: Vec<T>) -> Vector<T> {
    kept(py, Array1::from_vec(values))
}

/// Rows of equal length.
pub(crate) fn kept_rows<R: AsRef<[f64]>>(py: Python<'_>, rows: &[R]) -> Matrix<f64> {
    let columns = rows.first().map_or(0, |row| row.as_ref().len());
    let at = |(i, j): (usize, usize)| rows[i].as_ref()[j];
    kept(py, Array2::from_shape_fn((rows.len(), columns), at))
}

pub(crate) fn kept_tensor(py: Python<'_>, tensor: &Matrix3<f64>) -> Matrix<f64> {
    kept(py, Array2::from_shape_fn((3, 3), |(i, j)| tensor[(i, j)]))
}

pub(crate) fn kept_tensors(py: Python<'_>, tensors: &[Matrix3<f64>]) -> Tensors {
    let shape = (tensors.len(), 3, 3);
    kept(
        py,
        Array3::from_shape_fn(shape, |(n, i, j)| tensors[n][(i, j)]),
    )
}
