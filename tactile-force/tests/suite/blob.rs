//! Test images of contacts, pseudo-random numbers, and a calibration.

use ndarray::Array2;
use tactile_force::{CalibrationPair, LinearCalibration};

/// A line of 1 µN per grey level.
pub(crate) fn calibration() -> LinearCalibration {
    let pairs = [0.0, 1e5, 2e5, 3e5, 4e5].map(|v| CalibrationPair::loading(v, 1e-6 * v));
    LinearCalibration::fit(&pairs).unwrap()
}

/// Pseudo-random bytes. Equal seeds give equal bytes.
pub(crate) fn bytes(seed: u64) -> impl FnMut() -> u8 {
    let mut state = seed;
    move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 56) as u8
    }
}

/// Noise from −2 to 1.75 grey levels, by quarters.
pub(crate) fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut next = bytes(seed);
    move || f64::from(next() >> 4) / 4.0 - 2.0
}

/// Hertz's pressure A √(1 − r²/a²) averaged over the pixels of an image: in closed form along y,
/// and by midpoints along x, with many midpoints if the edge may cut the pixel.
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
