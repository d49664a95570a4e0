//! Dots printed on a gel, filled in with the light around them.
//!
//! A dot that moves from its place in the reference would be read as two slopes. So the dots of
//! reference and frame are replaced, each by the plane through the light of the ring around it.

use nalgebra::{Matrix3, Vector3};
use ndarray::{Array2, Array3, ArrayView3};

use crate::markers::{Marker, find_markers};

/// Fewest dots of a printed gel. Dust and scratches are fewer.
const LEAST_DOTS: usize = 12;
/// Largest brightness of a printed dot, relative to the light around it. Noise and shading are
/// brighter.
const LARGEST_SHARE: f64 = 0.85;
/// Pixels beyond the radius of a dot's area to which its blurred edge extends.
const EDGE_PX: f64 = 2.0;
/// Relative error of all slopes because of the light that replaces dots. Under rendered dots that
/// cover a sixth of the gel, forces of contacts of 12 to 30 px are 4 % too low in the mean, and up
/// to 9 %.
pub(crate) const SLOPE_ERROR: f64 = 0.06;
/// Width in pixels of the ring whose light replaces a dot.
const RING_PX: f64 = 3.0;
/// Fewest pixels of a ring. A plane has three parameters.
const LEAST_RING: usize = 12;

/// The mean of the three channels.
pub(crate) fn grey(frame: ArrayView3<'_, u8>) -> Array2<f64> {
    let (rows, columns, _) = frame.dim();
    Array2::from_shape_fn((rows, columns), |(row, column)| {
        let levels = (0..3).map(|channel| f64::from(frame[[row, column, channel]]));
        levels.sum::<f64>() / 3.0
    })
}

/// Whether dots are printed on the gel, seen in its frame without contact. O(pixels).
pub(crate) fn are_printed(reference: ArrayView3<'_, u8>) -> bool {
    let before = grey(reference);
    let dots = find_markers(before.view());
    if dots.len() < LEAST_DOTS {
        return false;
    }
    let after = grey(filled(reference, &dots).view());
    let dark = dots.iter().filter(|dot| {
        let centre = dot.position_px.coords.map(|v| v.round() as usize);
        let at = [centre.y, centre.x];
        before[at] < LARGEST_SHARE * after[at]
    });
    // Half of the dots may have highlights.
    dark.count() >= LEAST_DOTS.max(dots.len() / 2)
}

/// The frame without its dots. O(pixels).
pub(crate) fn without_dots(frame: ArrayView3<'_, u8>) -> Array3<u8> {
    filled(frame, &find_markers(grey(frame).view()))
}

fn filled(frame: ArrayView3<'_, u8>, dots: &[Marker]) -> Array3<u8> {
    let mut covered = Array2::from_elem((frame.dim().0, frame.dim().1), false);
    let radius = |dot: &Marker| (dot.area_px / core::f64::consts::PI).sqrt() + EDGE_PX;
    for dot in dots {
        around(dot, radius(dot), covered.dim(), |at, _| covered[at] = true);
    }
    let mut without = frame.to_owned();
    for dot in dots {
        let mut ring = Vec::new();
        around(dot, radius(dot) + RING_PX, covered.dim(), |at, from| {
            if !covered[at] {
                ring.push((at, from));
            }
        });
        if ring.len() < LEAST_RING {
            continue;
        }
        for channel in 0..3 {
            let plane = plane(&ring, |[row, column]| {
                f64::from(frame[[row, column, channel]])
            });
            around(dot, radius(dot), covered.dim(), |[row, column], from| {
                let level = plane.dot(&Vector3::new(1.0, from[0], from[1]));
                without[[row, column, channel]] = level.round().clamp(0.0, 255.0) as u8;
            });
        }
    }
    without
}

/// Calls `visit` with the pixels of a disc about a dot, and their distances in x and y from it.
fn around(
    dot: &Marker,
    radius: f64,
    (rows, columns): (usize, usize),
    mut visit: impl FnMut([usize; 2], [f64; 2]),
) {
    let [x, y] = [dot.position_px.x, dot.position_px.y];
    let span = |centre: f64, end: usize| {
        let first = (centre - radius).ceil().max(0.0) as usize;
        first..((centre + radius).floor().max(-1.0) + 1.0).min(end as f64) as usize
    };
    for row in span(y, rows) {
        for column in span(x, columns) {
            let from = [column as f64 - x, row as f64 - y];
            if from[0].hypot(from[1]) <= radius {
                visit([row, column], from);
            }
        }
    }
}

/// The plane c₀ + c₁ x + c₂ y of least squares, or the mean level if the pixels lie on a line.
fn plane(ring: &[([usize; 2], [f64; 2])], level: impl Fn([usize; 2]) -> f64) -> Vector3<f64> {
    let (mut matrix, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for (at, [x, y]) in ring {
        let terms = Vector3::new(1.0, *x, *y);
        matrix += terms * terms.transpose();
        right += terms * level(*at);
    }
    let mean = Vector3::new(right.x / ring.len() as f64, 0.0, 0.0);
    matrix
        .cholesky()
        .map_or(mean, |factor| factor.solve(&right))
}
