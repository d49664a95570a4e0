//! How a frame differs from the reference where there is no contact: the light has changed, or the two were swapped.
use crate::force::BoundingBox;
use ndarray::{ArrayView2, Axis, Slice};
use std::ops::Range;

/// Difference in grey levels of a block's mean that is no noise: a camera's 1 to 3 grey levels are a tenth of it in a block.
const CLEAR_STEP_GREY: f64 = 4.0;

/// Side of the blocks in pixels: smaller than contacts that can be measured, and large enough to average noise.
const BLOCK: usize = 8;

/// Rows looked at for the median: some ten thousand pixels tell it to a grey level.
const ROWS: usize = 24;

/// The mean of frame minus reference, in grey levels, of the block where it is greatest.
fn greatest_step(image: ArrayView2<'_, u8>, reference: ArrayView2<'_, u8>) -> f64 {
    if image.dim() != reference.dim() {
        return 0.0;
    }
    let side = [BLOCK.min(image.nrows()), BLOCK.min(image.ncols())];
    let blocks = image.exact_chunks(side);
    let steps = blocks
        .into_iter()
        .zip(reference.exact_chunks(side))
        .map(|(block, reference)| {
            let differences = block.iter().zip(reference);
            let sum: i32 = differences
                .map(|(&f, &r)| i32::from(f) - i32::from(r))
                .sum();
            f64::from(sum) / block.len() as f64
        });
    steps.fold(0.0, |greatest: f64, step| {
        if step.abs() > greatest.abs() {
            step
        } else {
            greatest
        }
    })
}

/// The step of a frame without contact that is not the reference's: other light, or the two swapped.
pub(crate) fn clear_step(image: ArrayView2<'_, u8>, reference: ArrayView2<'_, u8>) -> Option<f64> {
    let grey = greatest_step(image, reference);
    (grey.abs() > CLEAR_STEP_GREY).then_some(grey)
}

/// The median of frame minus reference outside a contact's box, in grey levels; None where hardly a pixel is outside.
///
/// A mean would follow what the contact does to its surroundings: a dent in a dark sensor is wider than the contact.
pub(super) fn median_step_outside(
    image: ArrayView2<'_, u8>,
    reference: ArrayView2<'_, u8>,
    contact: BoundingBox,
) -> Option<i32> {
    if image.dim() != reference.dim() {
        return None;
    }
    let mut counts = [0_usize; 511];
    let mut total = 0;
    for row in (0..image.nrows()).step_by(image.nrows() / ROWS + 1) {
        let columns = image.ncols();
        let mut count = |span: Range<usize>| {
            total += span.len();
            let [image, reference] = [image, reference].map(|image| {
                let row = image.index_axis_move(Axis(0), row);
                row.slice_axis_move(Axis(0), Slice::from(span.clone()))
            });
            match (image.to_slice(), reference.to_slice()) {
                // Slices, which most images have, are walked without an index.
                (Some(image), Some(reference)) => count_differences(&mut counts, image, reference),
                _ => count_differences(&mut counts, image, reference),
            }
        };
        if (contact.row_start..contact.row_end).contains(&row) {
            count(0..contact.column_start);
            count(contact.column_end..columns);
        } else {
            count(0..columns);
        }
    }
    // The median of fewer is not known to a grey level.
    if total < 100 {
        return None;
    }
    let mut below = 0;
    let median = counts.iter().position(|count| {
        below += count;
        2 * below > total
    });
    median.map(|index| index as i32 - 255)
}

/// Counts the pixels by their image − reference, from −255 on.
fn count_differences<'a>(
    counts: &mut [usize; 511],
    image: impl IntoIterator<Item = &'a u8>,
    reference: impl IntoIterator<Item = &'a u8>,
) {
    for (&f, &r) in image.into_iter().zip(reference) {
        counts[usize::from(255 + u16::from(f) - u16::from(r))] += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    #[test]
    fn steps_are_found_where_they_are() {
        let reference = Array2::from_elem((40, 50), 90_u8);
        let frame = Array2::from_shape_fn((40, 50), |(row, column)| {
            let inside = (8..24).contains(&row) && (16..32).contains(&column);
            if inside { 20 } else { 88_u8 }
        });
        assert_eq!(greatest_step(frame.view(), reference.view()), -70.0);
        let contact = BoundingBox {
            row_start: 8,
            row_end: 24,
            column_start: 16,
            column_end: 32,
        };
        let step = median_step_outside(frame.view(), reference.view(), contact);
        assert_eq!(step, Some(-2));
        let all = BoundingBox {
            row_start: 0,
            row_end: 40,
            column_start: 0,
            column_end: 50,
        };
        assert_eq!(
            median_step_outside(frame.view(), reference.view(), all),
            None
        );
    }
}
