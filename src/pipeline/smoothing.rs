//! Smoothing of a contact's signal before its surface is reconstructed.
use ndarray::Array2;

/// Two passes of a box of `width` pixels (odd; 1 does nothing) along both axes: nearly a Gaussian of standard deviation
/// √((width² − 1)/6). Beyond the edge the last pixel goes on. O(pixels × width): added up shifted line by line, which for the few pixels of a
/// usual width takes a fifth of what a running sum does, whose every step waits for the one before.
pub(super) fn smooth(image: &mut Array2<f64>, scratch: &mut Vec<f64>, width: usize) {
    let (rows, columns) = image.dim();
    if width < 2 || rows == 0 || columns == 0 {
        return;
    }
    for _ in 0..2 {
        for mut row in image.rows_mut() {
            if let Some(row) = row.as_slice_mut() {
                mean_along(row, scratch, width);
            }
        }
        if let Some(pixels) = image.as_slice_mut() {
            mean_across(pixels, columns, scratch, width);
        }
    }
}

/// Means over `width` neighbours of a row.
fn mean_along(row: &mut [f64], scratch: &mut Vec<f64>, width: usize) {
    let (half, columns) = (width / 2, row.len());
    scratch.clear();
    scratch.resize(half, row[0]);
    scratch.extend_from_slice(row);
    scratch.resize(columns + 2 * half, row[columns - 1]);
    row.copy_from_slice(&scratch[..columns]);
    for shift in 1..width {
        add(row, &scratch[shift..shift + columns]);
    }
    let width = width as f64;
    row.iter_mut().for_each(|pixel| *pixel /= width);
}

/// Means over `width` neighbours of every column.
fn mean_across(pixels: &mut [f64], columns: usize, scratch: &mut Vec<f64>, width: usize) {
    scratch.clear();
    scratch.extend_from_slice(pixels);
    let (half, last) = (width / 2, pixels.len() / columns - 1);
    let line = |row: usize| &scratch[row * columns..(row + 1) * columns];
    for (row, means) in pixels.chunks_exact_mut(columns).enumerate() {
        // Counted from the row that is half a width above.
        let near = |shift: usize| (row + shift).saturating_sub(half).min(last);
        means.copy_from_slice(line(near(0)));
        for shift in 1..width {
            add(means, line(near(shift)));
        }
        let width = width as f64;
        means.iter_mut().for_each(|pixel| *pixel /= width);
    }
}

fn add(sums: &mut [f64], line: &[f64]) {
    for (sum, value) in sums.iter_mut().zip(line) {
        *sum += value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smoothing_keeps_constants_and_lines_and_quietens_noise() {
        let plane = Array2::from_shape_fn((20, 30), |(r, c)| r as f64 + 2.0 * c as f64);
        let mut smoothed = plane.clone();
        smooth(&mut smoothed, &mut Vec::new(), 5);
        // Away from the edge a box mean of a linear function is the function, to rounding.
        assert!((smoothed[[10, 15]] - plane[[10, 15]]).abs() < 1e-12);
        let mut impulse = Array2::zeros((21, 21));
        impulse[[10, 10]] = 1.0;
        smooth(&mut impulse, &mut Vec::new(), 5);
        assert!((impulse.sum() - 1.0).abs() < 1e-12);
        assert!(
            (impulse[[10, 10]] - 0.04).abs() < 1e-12,
            "(1/5)² in the middle of two passes"
        );
    }
}
