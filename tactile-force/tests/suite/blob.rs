//! Images of contacts for the tests.

use ndarray::Array2;

/// Hertz's pressure A √(1 − r²/a²) averaged over the pixels of an image: along y in closed form,
/// along x by midpoints, many where the edge may cut the pixel.
pub(crate) fn hertz(size: (usize, usize), centre: [f64; 2], radius: f64, peak: f64) -> Array2<f64> {
    Array2::from_shape_fn(size, |(row, column)| {
        let [x, y] = [column as f64 - centre[0], row as f64 - centre[1]];
        let depth = radius - x.hypot(y);
        if depth < -1.0 {
            return 0.0;
        }
        let nodes = if depth > 2.0 { 32 } else { 2000 };
        // ∫ √(w² − y²) dy.
        let area = |w2: f64, y: f64| {
            let w = w2.sqrt();
            let y = y.clamp(-w, w);
            0.5 * (y * (w2 - y * y).max(0.0).sqrt() + w2 * (y / w).clamp(-1.0, 1.0).asin())
        };
        let strip = |k: i32| {
            let at = x - 0.5 + (f64::from(k) + 0.5) / f64::from(nodes);
            let w2 = radius * radius - at * at;
            if w2 > 0.0 {
                area(w2, y + 0.5) - area(w2, y - 0.5)
            } else {
                0.0
            }
        };
        peak / radius * (0..nodes).map(strip).sum::<f64>() / f64::from(nodes)
    })
}
