//! How far pixels are from an outline, along rows, columns and diagonals alike.
use ndarray::{Array2, ArrayView1, ArrayViewMut1, Axis};

/// Distances above this are not told apart.
pub(super) const FARTHEST: u8 = 12;

/// For every pixel the chessboard distance to the nearest pixel on the other side of the outline, at most [`FARTHEST`]: 1 beside the outline.
/// What is beyond the image counts as its last pixel does. O(pixels), over whole rows at a time.
pub(super) fn to_outline(inside: &Array2<bool>, distance: &mut Array2<u8>) {
    let mut from_one_side = [false, true].map(|side| from_side(inside, side));
    let [from_outside, from_inside] = &mut from_one_side;
    // One of the two is zero.
    ndarray::Zip::from(distance)
        .and(from_outside)
        .and(from_inside)
        .for_each(|distance, outside, inside| *distance = *outside + *inside);
}

/// The chessboard distance to the nearest pixel on a side, at most [`FARTHEST`]. With g the distance within the column, it is the least of
/// max(|k|, g(x + k)) over the columns x + k near by.
fn from_side(inside: &Array2<bool>, side: bool) -> Array2<u8> {
    let (rows, columns) = inside.dim();
    let mut distance = inside.mapv(|pixel| if pixel == side { 0 } else { FARTHEST });
    for row in 1..rows {
        let (above, mut below) = distance.view_mut().split_at(Axis(0), row);
        come_closer(below.row_mut(0), above.row(row - 1));
    }
    for row in (1..rows).rev() {
        let (mut above, below) = distance.view_mut().split_at(Axis(0), row);
        come_closer(above.row_mut(row - 1), below.row(0));
    }
    let reach = usize::from(FARTHEST) - 1;
    let mut line = vec![FARTHEST; columns + 2 * reach];
    let lines = distance.as_slice_mut().unwrap_or_default();
    for row in lines.chunks_exact_mut(columns.max(1)) {
        line[reach..reach + columns].copy_from_slice(row);
        for k in 1..=reach {
            let (left, right) = (&line[reach - k..], &line[reach + k..]);
            for ((own, left), right) in row.iter_mut().zip(left).zip(right) {
                *own = (*own).min((*left).min(*right).max(k as u8));
            }
        }
    }
    distance
}

/// Lowers the distances of a row to one more than those of a row beside it.
fn come_closer(row: ArrayViewMut1<'_, u8>, beside: ArrayView1<'_, u8>) {
    ndarray::Zip::from(row)
        .and(beside)
        .for_each(|own, beside| *own = (*own).min(*beside + 1));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_of_a_search_over_all_pixels() {
        let inside = Array2::from_shape_fn((30, 40), |(r, c)| {
            let (y, x) = (r as f64 - 14.0, c as f64 - 19.0);
            x.hypot(y) < 11.0 && !(x.abs() < 2.0 && y.abs() < 2.0)
        });
        let mut found = Array2::zeros(inside.dim());
        to_outline(&inside, &mut found);
        for ((r, c), &side) in inside.indexed_iter() {
            let others = inside.indexed_iter().filter(|(_, other)| **other != side);
            let nearest = others
                .map(|((y, x), _)| y.abs_diff(r).max(x.abs_diff(c)))
                .min();
            let expected = nearest.map_or(FARTHEST, |d| d.min(usize::from(FARTHEST)) as u8);
            assert_eq!(found[[r, c]], expected, "{r} {c}");
        }
    }
}
