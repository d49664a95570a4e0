//! Arrays of numbers as tables: `.npy` and `.npz` of NumPy, and `.mat` of version 5.
//!
//! The readers are our own, because `ndarray-npy` needs the number type of an array beforehand and
//! no well-kept crate reads `.mat`.
use super::error::{FileError, FilePlace, quoted};
use super::files::LARGEST_FILE;
use super::frames::{ARRAY_STARTS, header_fields, members};
use super::text::TextCells;
use flate2::read::ZlibDecoder;
use ndarray::{Array3, ArrayD, IxDyn, ShapeBuilder};
use std::io::Read;
use std::path::Path;

/// First bytes of a `.mat` file of version 5.
const MAT_5: &[u8] = b"MATLAB 5.0";

/// An array with its numbers in C order.
struct Array {
    name: String,
    shape: Vec<usize>,
    values: Vec<f64>,
}

impl Array {
    /// Rows and columns. An array of one axis is a column.
    fn sides(&self) -> Option<(usize, usize)> {
        match *self.shape {
            [rows] => Some((rows, 1)),
            [rows, columns] => Some((rows, columns)),
            _ => None,
        }
    }
}

/// Storage of numbers: letter of the kind (`f`, `i`, `u`, `b`), size in bytes, and whether the
/// highest byte comes first.
type Kind = (u8, usize, bool);

fn numbers(bytes: &[u8], (letter, size, big_endian): Kind) -> Option<Vec<f64>> {
    let number = |digits: &[u8]| {
        let mut eight = [0; 8];
        for (to, from) in eight.iter_mut().zip(digits.iter().rev()) {
            *to = *from;
        }
        if !big_endian {
            eight[..size].reverse();
        }
        let whole = u64::from_le_bytes(eight);
        let shift = 64 - 8 * size as u32;
        Some(match (letter, size) {
            (b'f', 8) => f64::from_bits(whole),
            (b'f', 4) => f64::from(f32::from_bits(whole as u32)),
            (b'u' | b'b', _) => whole as f64,
            (b'i', _) => ((whole << shift) as i64 >> shift) as f64,
            _ => return None,
        })
    };
    if !matches!(size, 1 | 2 | 4 | 8) {
        return None;
    }
    bytes.chunks_exact(size).map(number).collect()
}

/// An array of this shape. `None` if numbers are missing.
fn array(name: &str, shape: &[usize], by_columns: bool, values: Vec<f64>) -> Option<Array> {
    let name = quoted(name.strip_suffix(".npy").unwrap_or(name), 40);
    let length = shape
        .iter()
        .try_fold(1_usize, |all, side| all.checked_mul(*side))?;
    if length != values.len() {
        return None;
    }
    let values = match by_columns {
        true => ArrayD::from_shape_vec(IxDyn(shape).f(), values)
            .ok()?
            .iter()
            .copied()
            .collect(),
        false => values,
    };
    let shape = shape.to_vec();
    Some(Array {
        name,
        shape,
        values,
    })
}

/// The array of a `.npy` file. `None` if it holds no numbers.
fn of_npy(name: &str, bytes: &[u8]) -> Option<Array> {
    let wide = *bytes.get(6)? > 1;
    let start = if wide { 12 } else { 10 };
    let digits = bytes.get(8..start)?.iter().rev();
    let length = digits.fold(0, |sum, digit| 256 * sum + usize::from(*digit));
    let header = String::from_utf8_lossy(bytes.get(start..start.checked_add(length)?)?);
    let (kind, by_columns, shape) = header_fields(&header)?;
    let (order, rest) = kind.split_at_checked(1)?;
    let (letter, size) = rest.split_at_checked(1)?;
    let kind = (letter.as_bytes()[0], size.parse().ok()?, order == ">");
    array(
        name,
        &shape,
        by_columns,
        numbers(&bytes[start + length..], kind)?,
    )
}

/// The numeric arrays of a `.mat` file.
fn of_mat(bytes: &[u8]) -> Vec<Array> {
    let big_endian = bytes.get(126) == Some(&b'M');
    let mut rest = bytes.get(128..).unwrap_or_default();
    let mut arrays = Vec::new();
    while let Some((kind, element)) = element(&mut rest, big_endian) {
        let mut unpacked = Vec::new();
        let mut inside = element;
        if kind == 15 {
            let mut packed = ZlibDecoder::new(element).take(LARGEST_FILE);
            // A damaged element is unpacked as far as possible. It is then found to be too short.
            let _ = packed.read_to_end(&mut unpacked);
            inside = &unpacked;
            let Some((14, matrix)) = self::element(&mut inside, big_endian) else {
                continue;
            };
            inside = matrix;
        }
        arrays.extend(matrix(inside, big_endian));
    }
    arrays
}

/// Kind and content of the next element.
fn element<'a>(rest: &mut &'a [u8], big_endian: bool) -> Option<(u32, &'a [u8])> {
    let all = *rest;
    let word = |at: usize| {
        let bytes = *all.get(at..)?.first_chunk()?;
        Some(if big_endian {
            u32::from_be_bytes(bytes)
        } else {
            u32::from_le_bytes(bytes)
        })
    };
    let (kind, size) = (word(0)?, word(4)?);
    // A small element has its size and kind in four bytes and its content in the next four.
    let (kind, from, size, whole) = match kind >> 16 {
        0 => (
            kind,
            8,
            size as usize,
            8 + (size as usize).next_multiple_of(8),
        ),
        small => (kind & 0xffff, 4, small as usize, 8),
    };
    let content = all.get(from..from + size)?;
    // A compressed element has no padding.
    let whole = if kind == 15 { 8 + size } else { whole };
    *rest = all.get(whole..).unwrap_or_default();
    Some((kind, content))
}

fn matrix(mut rest: &[u8], big_endian: bool) -> Option<Array> {
    let (_, flags) = element(&mut rest, big_endian)?;
    let class = if big_endian {
        flags.get(3)
    } else {
        flags.first()
    };
    // Cells, structures, objects, text, sparse matrices and complex numbers are not tables.
    let complex = flags.get(if big_endian { 2 } else { 1 })? & 8 != 0;
    if complex || !(6..=15).contains(class?) {
        return None;
    }
    let (_, sides) = element(&mut rest, big_endian)?;
    let sides = numbers(sides, (b'i', 4, big_endian))?;
    let mut shape: Vec<usize> = sides.iter().map(|side| side.max(0.0) as usize).collect();
    // A row vector of MATLAB is read as a column.
    if shape.len() == 2 && shape[0] == 1 {
        shape.remove(0);
    }
    let (_, name) = element(&mut rest, big_endian)?;
    let (kind, values) = element(&mut rest, big_endian)?;
    let (letter, size) = match kind {
        1 => (b'i', 1),
        2 => (b'u', 1),
        3 => (b'i', 2),
        4 => (b'u', 2),
        5 => (b'i', 4),
        6 => (b'u', 4),
        7 => (b'f', 4),
        9 => (b'f', 8),
        12 => (b'i', 8),
        13 => (b'u', 8),
        _ => return None,
    };
    let values = numbers(values, (letter, size, big_endian))?;
    array(&String::from_utf8_lossy(name), &shape, true, values)
}

/// The arrays of a NumPy or MATLAB file. `None` for other files.
fn arrays(bytes: &[u8]) -> Option<Vec<Array>> {
    if bytes.starts_with(ARRAY_STARTS[0]) {
        return Some(of_npy("", bytes).into_iter().collect());
    }
    if bytes.starts_with(MAT_5) {
        return Some(of_mat(bytes));
    }
    if !bytes.starts_with(ARRAY_STARTS[1]) {
        return None;
    }
    // A spreadsheet is a zip archive too.
    let mut files = members(bytes, LARGEST_FILE).unwrap_or_default();
    files.retain(|(name, _)| name.ends_with(".npy"));
    let arrays = files.iter().filter_map(|(name, bytes)| of_npy(name, bytes));
    (!files.is_empty()).then(|| arrays.collect())
}

/// The cells of one array, or of several named columns of equal length. `None` if the file holds no
/// arrays.
pub(super) fn cells(bytes: &[u8], path: &Path) -> Option<Result<TextCells, FileError>> {
    let expected = "one array of numbers of two axes, or several of one axis and length";
    let refused = |found: String| FileError::content(path, FilePlace::File, expected, found);
    let mut arrays = arrays(bytes)?;
    arrays.retain(|array| array.sides().is_some());
    // A single number beside a table, such as a frame rate, is not part of the table, even if the
    // table is empty.
    for is_table in [|length| length > 1, |length| length == 0] {
        if arrays.iter().any(|array| is_table(array.values.len())) {
            arrays.retain(|array| is_table(array.values.len()));
            break;
        }
    }
    let mut table = TextCells::default();
    match arrays.as_slice() {
        [] if bytes.starts_with(ARRAY_STARTS[0]) => {
            let header = String::from_utf8_lossy(&bytes[..bytes.len().min(140)]);
            let from = header.find('{').unwrap_or(0);
            // The header of a structured array lists its columns.
            let remedy = match header.contains("'descr': [") {
                true => "save its columns by numpy.savez",
                false => "save it by `astype(float)`",
            };
            let found = format!("`{}`: {remedy}", quoted(&header[from..], 70));
            return Some(Err(refused(found)));
        }
        [] => {
            return Some(Err(refused(
                "none: save arrays of numbers themselves".into(),
            )));
        }
        [one] => {
            table.columns = one.sides().map_or(1, |(_, columns)| columns);
            table.values.clone_from(&one.values);
            if table.columns == 1 {
                table.header = vec![one.name.clone()];
            }
        }
        [first, rest @ ..] => {
            let length = |array: &Array| array.sides().filter(|(_, columns)| *columns == 1);
            if length(first).is_none() || rest.iter().any(|array| length(array) != length(first)) {
                let names: Vec<&str> = arrays.iter().map(|array| array.name.as_str()).collect();
                return Some(Err(refused(format!("`{}`: keep one", names.join("`, `")))));
            }
            table.columns = arrays.len();
            table.header = arrays.iter().map(|array| array.name.clone()).collect();
            let rows = 0..first.values.len();
            table.values = rows
                .flat_map(|row| arrays.iter().map(move |a| a.values[row]))
                .collect();
        }
    }
    table.header.retain(|name| !name.is_empty());
    table.words = vec![None; table.columns];
    table.missing = vec![None; table.columns];
    for (k, value) in table.values.iter_mut().enumerate() {
        let column = k % table.columns;
        if value.is_infinite() {
            table.words[column].get_or_insert(((k / table.columns) as u64 + 1, "inf".into()));
        } else if value.is_nan() {
            table.missing[column].get_or_insert((k / table.columns) as u64 + 1);
        }
    }
    Some(Ok(table))
}

/// The array of vectors in a file of arrays, `[row, column, axis]`. `None` if the file holds no
/// arrays.
pub(super) fn vectors(bytes: &[u8], path: &Path) -> Option<Result<Array3<f64>, FileError>> {
    let found = arrays(bytes)?
        .into_iter()
        .filter(|array| !array.values.is_empty())
        .find_map(|array| match *array.shape {
            [rows, columns, 3] => Array3::from_shape_vec((rows, columns, 3), array.values).ok(),
            [3, rows, columns] => {
                let by_axis = Array3::from_shape_vec((3, rows, columns), array.values).ok()?;
                Some(by_axis.permuted_axes([1, 2, 0]))
            }
            _ => None,
        });
    let expected = "an array of normals of shape (rows, columns, 3)";
    Some(found.ok_or_else(|| {
        FileError::content(
            path,
            FilePlace::File,
            expected,
            "none: slopes are two files",
        )
    }))
}
