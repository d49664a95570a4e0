//! How far pixels are from an outline, along rows, columns and diagonals alike.
use ndarray::Array2;

/// Distances above this are not told apart.
pub(super) const FARTHEST: u8 = 12;

/// For every pixel the chessboard distance to the nearest pixel on the other side of the outline, at most [`FARTHEST`]: 1 beside the outline.
/// What is beyond the image counts as its last pixel does. Two passes, O(pixels).
pub(super) fn to_outline(inside: &Array2<bool>, distance: &mut Array2<u8>) {
    let (rows, columns) = inside.dim();
    distance.fill(FARTHEST);
    let pixels = inside.as_slice().unwrap_or_default();
    let Some(distances) = distance.as_slice_mut() else {
        return;
    };
    let closer = |own: u8, side: bool, other: usize, distances: &[u8]| {
        let other = if pixels[other] == side {
            distances[other]
        } else {
            0
        };
        own.min(other + 1)
    };
    for row in 0..rows {
        for column in 0..columns {
            let at = row * columns + column;
            let (mut own, side) = (distances[at], pixels[at]);
            if row > 0 {
                own = closer(own, side, at - columns, distances);
                if column > 0 {
                    own = closer(own, side, at - columns - 1, distances);
                }
                if column + 1 < columns {
                    own = closer(own, side, at - columns + 1, distances);
                }
            }
            if column > 0 {
                own = closer(own, side, at - 1, distances);
            }
            distances[at] = own;
        }
    }
    for row in (0..rows).rev() {
        for column in (0..columns).rev() {
            let at = row * columns + column;
            let (mut own, side) = (distances[at], pixels[at]);
            if row + 1 < rows {
                own = closer(own, side, at + columns, distances);
                if column > 0 {
                    own = closer(own, side, at + columns - 1, distances);
                }
                if column + 1 < columns {
                    own = closer(own, side, at + columns + 1, distances);
                }
            }
            if column + 1 < columns {
                own = closer(own, side, at + 1, distances);
            }
            distances[at] = own;
        }
    }
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
