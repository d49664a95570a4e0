//! The bumps of a patterned block in its light.

use nalgebra::Point2;
use ndarray::Array2;

/// Mean of several exposures.
pub(super) fn mean_frame(frames: &[Array2<u8>]) -> Array2<f64> {
    let sum = frames
        .iter()
        .fold(Array2::zeros(frames[0].dim()), |sum, f| {
            sum + f.mapv(f64::from)
        });
    sum / frames.len() as f64
}

/// Centroids of the bumps of a frame, in metres: whatever stands a quarter above the face.
pub(super) fn bumps(light: &Array2<f64>, pixel_m: f64) -> Vec<Point2<f64>> {
    let smooth = |r: usize, c: usize| {
        let window = light.slice(ndarray::s![
            r.saturating_sub(1)..r + 2,
            c.saturating_sub(1)..c + 2
        ]);
        window.sum() / window.len() as f64
    };
    let (rows, columns) = light.dim();
    let brightest = light.iter().copied().fold(0.0, f64::max);
    let mut lit: Vec<f64> = light
        .iter()
        .copied()
        .filter(|&v| v > 0.2 * brightest)
        .collect();
    lit.sort_by(f64::total_cmp);
    let threshold = 1.25 * lit[lit.len() / 4];
    let above = Array2::from_shape_fn((rows - 2, columns - 2), |(r, c)| {
        smooth(r + 1, c + 1) > threshold
    });
    let mut seen = Array2::from_elem(above.dim(), false);
    let mut found = Vec::new();
    for start in above.indexed_iter().filter(|(_, a)| **a).map(|(i, _)| i) {
        let (mut stack, mut sums, mut area) = (vec![start], [0.0; 3], 0);
        while let Some((r, c)) = stack.pop() {
            if !above[[r, c]] || std::mem::replace(&mut seen[[r, c]], true) {
                continue;
            }
            let weight = (light[[r + 1, c + 1]] - threshold).max(0.0);
            sums = [
                sums[0] + weight,
                sums[1] + weight * c as f64,
                sums[2] + weight * r as f64,
            ];
            area += 1;
            stack.extend([(r.saturating_sub(1), c), (r, c.saturating_sub(1))]);
            stack.extend(
                [(r + 1, c), (r, c + 1)]
                    .into_iter()
                    .filter(|&(r, c)| r < above.nrows() && c < above.ncols()),
            );
        }
        if area > 50 {
            found.push(Point2::new(
                sums[1] / sums[0] * pixel_m,
                sums[2] / sums[0] * pixel_m,
            ));
        }
    }
    found
}
