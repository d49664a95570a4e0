//! Radial profile of the mean pressure, from an image.

use ndarray::{Array2, ArrayView2};
use tactile_inclusion::PressureProfile;

/// Number of rings over a face: as narrow as a pixel of common scenes, so that the profile is
/// nearly straight within each.
const RINGS: usize = 60;

/// Mean pressure in rings around the centre of the face.
///
/// ```
/// use tactile_imaging::inclusion::ring_means;
/// use ndarray::Array2;
///
/// // A disc of 30 pixels radius under even light, at 0.5 mm per pixel; a grey level is 30 Pa.
/// let image = Array2::from_shape_fn((81, 91), |(y, x)| {
///     let r = (x as f64 - 45.0).hypot(y as f64 - 40.0);
///     if r < 30.0 { 100.0 } else { 0.0 }
/// });
/// let rings = ring_means(&image.view(), [0.5e-3; 2], 30.0, 15e-3)?;
/// assert!((rings.centre_px[0] - 45.0).abs() < 0.1 && (rings.centre_px[1] - 40.0).abs() < 0.1);
/// assert!((rings.pressure_pa[3] / 3e3 - 1.0).abs() < 1e-12);
/// # Ok::<(), tactile_imaging::inclusion::RingError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct RingMeans {
    /// Centre of the pressed region (x, y), in pixels.
    pub centre_px: [f64; 2],
    /// Mean radii of the rings, in metres.
    pub radii_m: Vec<f64>,
    /// Mean pressure of each ring, in pascals.
    pub pressure_pa: Vec<f64>,
    /// Standard error of each mean from the noise of single pixels, in pascals.
    pub standard_error_pa: Vec<f64>,
    /// Standard deviation of the pixel noise, in pascals.
    pub pixel_noise_pa: f64,
    /// First harmonic of the pressure within three quarters of the face radius, relative to its
    /// mean. It is zero if the pressure is symmetric about the axis.
    pub asymmetry: f64,
    /// Root mean square of the second to fourth harmonics of the rings in the same region, relative
    /// to the pressure and corrected for noise. It is zero if the pressure is symmetric about the
    /// axis.
    pub harmonics: f64,
}

/// Why ring means cannot be computed from an image.
///
/// ```
/// use tactile_imaging::inclusion::{RingError, ring_means};
/// let dark = ndarray::Array2::zeros((50, 50));
/// assert_eq!(ring_means(&dark.view(), [0.25e-3; 2], 30.0, 15e-3), Err(RingError::NoContact));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RingError {
    /// Nothing presses on the face.
    #[error("no part of the frame is brighter than the reference: nothing presses on the face")]
    NoContact,
    /// The face is not entirely within the frame.
    #[error(
        "the face, {radius_px:.0} pixels in radius around ({x:.0}, {y:.0}), is cut by the frame's \
         border"
    )]
    Cut {
        /// Centre, x.
        x: f64,
        /// Centre, y.
        y: f64,
        /// Face radius in pixels.
        radius_px: f64,
    },
}

/// Mean pressure in rings around the centre of the pressed region.
///
/// Light is assumed proportional to the pressure: p = s I, where I is the brightening of the frame
/// and s is `pascals_per_grey`. `image` is the brightening, [row, column], `pixel_size_m` is (x,
/// y), and `face_radius_m` is the radius of the guide's face. O(pixels).
///
/// ```
/// use tactile_imaging::inclusion::ring_means;
/// let image = ndarray::Array2::from_shape_fn((81, 81), |(y, x)| {
///     let r = (x as f64 - 40.0).hypot(y as f64 - 40.0);
///     if r < 30.0 { 100.0 - r } else { 0.0 }
/// });
/// let rings = ring_means(&image.view(), [0.5e-3; 2], 30.0, 15e-3)?;
/// assert!(rings.pressure_pa[5] > rings.pressure_pa[25]);
/// # Ok::<(), tactile_imaging::inclusion::RingError>(())
/// ```
///
/// # Errors
/// [`RingError`].
pub fn ring_means(
    image: &ArrayView2<'_, f64>,
    pixel_size_m: [f64; 2],
    pascals_per_grey: f64,
    face_radius_m: f64,
) -> Result<RingMeans, RingError> {
    let total: f64 = image.iter().filter(|value| value.is_finite()).sum();
    let high = high_value(image);
    if !(total > 0.0 && high > 0.0) {
        return Err(RingError::NoContact);
    }
    let [sx, sy] = pixel_size_m;
    // The threshold of the pressed region is a quarter of the high values of the frame.
    let centre_px = centre(image, 0.25 * high).ok_or(RingError::NoContact)?;
    let (rows, columns) = image.dim();
    let inside = |centre: f64, size: f64, count: usize| {
        let reach = 0.8 * face_radius_m / size;
        centre - reach >= 0.0 && centre + reach <= count as f64 - 1.0
    };
    // The rim itself may be cut, because the rings of the outer fifth are not used.
    if !(inside(centre_px[0], sx, columns) && inside(centre_px[1], sy, rows)) {
        return Err(RingError::Cut {
            x: centre_px[0],
            y: centre_px[1],
            radius_px: face_radius_m / sx,
        });
    }
    let width = face_radius_m / RINGS as f64;
    // Outside this radius the pressure rises steeply to the rim, and a search does not use it.
    let used_radius_m = 0.75 * face_radius_m;
    let mut rings = vec![Ring::default(); RINGS];
    let mut harmonic = [0.0; 2];
    let mut mean = 0.0;
    let offset = |y: usize, x: usize| {
        let (dx, dy) = (
            (x as f64 - centre_px[0]) * sx,
            (y as f64 - centre_px[1]) * sy,
        );
        (dx, dy, dx.hypot(dy))
    };
    for ((y, x), &value) in image.indexed_iter() {
        let (dx, dy, radius) = offset(y, x);
        let index = (radius / width) as usize;
        if let Some(ring) = rings.get_mut(index) {
            ring.count += 1.0;
            ring.sum += value;
            ring.radius += radius;
        }
        if radius < used_radius_m && radius > 0.0 {
            harmonic[0] += value * dx / radius;
            harmonic[1] += value * dy / radius;
            mean += value;
        }
    }
    let noise = pixel_noise(image, |y, x| offset(y, x).2 < used_radius_m);
    let filled: Vec<Ring> = rings.into_iter().filter(|ring| ring.count > 0.0).collect();
    let radii_m: Vec<f64> = (filled.iter())
        .map(|ring| ring.radius / ring.count)
        .collect();
    let means: Vec<f64> = filled.iter().map(|ring| ring.sum / ring.count).collect();
    let pixels = image.indexed_iter().filter_map(|((y, x), &value)| {
        let (dx, dy, radius) = offset(y, x);
        let off = value - interpolated(&radii_m, &means, radius);
        (radius < used_radius_m).then(|| (radius / used_radius_m, dy.atan2(dx), value, off))
    });
    let harmonics = harmonics(pixels, noise);
    Ok(RingMeans {
        centre_px,
        radii_m,
        pixel_noise_pa: pascals_per_grey * noise,
        harmonics,
        pressure_pa: means.iter().map(|mean| pascals_per_grey * mean).collect(),
        standard_error_pa: (filled.iter())
            .map(|ring| pascals_per_grey * noise / ring.count.sqrt())
            .collect(),
        asymmetry: 2.0 * harmonic[0].hypot(harmonic[1]) / mean,
    })
}

/// Root mean square of the second to fourth harmonics around rings, relative to the mean value.
/// Each pixel is given as (radius over the outermost radius, angle, value, deviation from the mean
/// of its ring).
fn harmonics(pixels: impl Iterator<Item = (f64, f64, f64, f64)>, noise: f64) -> f64 {
    // The rings are wide enough for an even distribution of pixels around all but the innermost.
    const RINGS: usize = 12;
    const ORDERS: [f64; 3] = [2.0, 3.0, 4.0];
    let mut sums = [[[0.0; 2]; ORDERS.len()]; RINGS];
    let mut counts = [0.0; RINGS];
    let mut total = 0.0;
    for (radius, angle, value, off) in pixels {
        let ring = ((radius * RINGS as f64) as usize).min(RINGS - 1);
        counts[ring] += 1.0;
        total += value;
        for (sum, order) in sums[ring].iter_mut().zip(ORDERS) {
            sum[0] += off * (order * angle).cos();
            sum[1] += off * (order * angle).sin();
        }
    }
    let count: f64 = counts.iter().sum();
    // White noise of variance σ² adds 4 σ² / n to the square of an amplitude.
    let squares = (sums.iter().zip(counts)).filter(|(_, n)| *n > 0.0);
    let squares = squares.flat_map(|(ring, n)| {
        let square = move |[a, b]: &[f64; 2]| 4.0 * ((a * a + b * b) / n - noise * noise);
        ring.iter().map(square)
    });
    (squares.sum::<f64>().max(0.0) / count).sqrt() / (total / count)
}

impl RingMeans {
    /// The profile at other radii: linear between the rings, constant beyond the outermost. The
    /// search compares frames ring by ring.
    #[must_use]
    pub fn profile(
        &self,
        radii_m: &[f64],
        approach_m: f64,
        force_n: Option<f64>,
    ) -> PressureProfile {
        let resampled = |values: &[f64]| -> Vec<f64> {
            let at = |&radius| interpolated(&self.radii_m, values, radius);
            radii_m.iter().map(at).collect()
        };
        PressureProfile {
            approach_m,
            force_n,
            pressure_pa: resampled(&self.pressure_pa),
            standard_error_pa: resampled(&self.standard_error_pa),
        }
    }
}

/// Linear interpolation of values at ascending radii, constant beyond the outermost.
fn interpolated(radii: &[f64], values: &[f64], radius: f64) -> f64 {
    if radii.len() < 2 {
        return values.first().copied().unwrap_or(0.0);
    }
    let after = (radii.partition_point(|r| *r < radius)).clamp(1, radii.len() - 1);
    let (a, b) = (radii[after - 1], radii[after]);
    let part = ((radius - a) / (b - a)).clamp(0.0, 1.0);
    values[after - 1] + part * (values[after] - values[after - 1])
}

#[derive(Clone, Copy, Default)]
struct Ring {
    count: f64,
    sum: f64,
    radius: f64,
}

/// Square cells of a face, each with its pixels.
///
/// ```
/// use tactile_imaging::inclusion::FaceCells;
/// // A face of 10 mm radius around the image's centre, 0.5 mm per pixel, in cells of 2.5 mm.
/// let cells = FaceCells::new((41, 41), [20.0; 2], [0.5e-3; 2], 10e-3, 2.5e-3);
/// let tilted = ndarray::Array2::from_shape_fn((41, 41), |(_, x)| x as f64);
/// let first = (cells.means(&tilted.view())[0], cells.positions_m[0][0]);
/// assert!((first.0 - (20.0 + first.1 / 0.5e-3)).abs() < 1e-9);
/// ```
#[derive(Clone, Debug)]
pub struct FaceCells {
    /// Centre (x, y) of each cell relative to the axis.
    pub positions_m: Vec<[f64; 2]>,
    /// Number of pixels in each cell.
    counts: Vec<f64>,
    /// Cell of each pixel [row, column].
    cells: Array2<Option<usize>>,
}

impl FaceCells {
    /// Creates the cells within three quarters of the face radius. The centre is in pixels, the
    /// cell width in metres.
    pub fn new(
        size: (usize, usize),
        centre_px: [f64; 2],
        pixel_size_m: [f64; 2],
        face_radius_m: f64,
        width: f64,
    ) -> Self {
        let mut indices = std::collections::HashMap::new();
        let mut sums: Vec<[f64; 3]> = Vec::new();
        let mut cells = Array2::from_elem(size, None);
        for ((y, x), cell) in cells.indexed_iter_mut() {
            let dx = (x as f64 - centre_px[0]) * pixel_size_m[0];
            let dy = (y as f64 - centre_px[1]) * pixel_size_m[1];
            if dx.hypot(dy) < 0.75 * face_radius_m {
                let key = [dx, dy].map(|off| (off / width).floor() as i64);
                let index = *indices.entry(key).or_insert(sums.len());
                if index == sums.len() {
                    sums.push([0.0; 3]);
                }
                for (sum, part) in sums[index].iter_mut().zip([1.0, dx, dy]) {
                    *sum += part;
                }
                *cell = Some(index);
            }
        }
        Self {
            positions_m: sums.iter().map(|[n, x, y]| [x / n, y / n]).collect(),
            counts: sums.iter().map(|[n, ..]| *n).collect(),
            cells,
        }
    }

    /// Mean of an image over each cell.
    pub fn means(&self, image: &ArrayView2<'_, f64>) -> Vec<f64> {
        let mut sums = vec![0.0; self.counts.len()];
        for (cell, value) in self.cells.iter().zip(image.iter()) {
            if let Some(cell) = cell {
                sums[*cell] += value;
            }
        }
        let pairs = sums.iter().zip(&self.counts);
        pairs.map(|(sum, count)| sum / count).collect()
    }

    /// Standard error of each mean, from the noise of a pixel.
    pub fn errors(&self, pixel_noise: f64) -> Vec<f64> {
        let error = |count: &f64| pixel_noise / count.sqrt();
        self.counts.iter().map(error).collect()
    }
}

/// Standard error, in grey levels, of the mean of an image that was rounded to whole levels: the
/// error of zero that such a reference frame gives to all pressures.
///
/// Of an even frame without noise every pixel has the same error, evenly distributed over a level.
/// If the levels vary with standard deviation σ, from noise or light, the error averages out, with
/// the variance
///
/// $$ \sum_{k \geq 1} \frac{e^{-4 \pi^2 k^2 \sigma^2}}{2 \pi^2 k^2} $$
///
/// σ is the median over squares of eight pixels. The result is zero if a value is not whole.
///
/// ```
/// use tactile_imaging::inclusion::rounding_error;
/// let even = ndarray::Array2::from_elem((40, 40), 7.0);
/// assert!((rounding_error(&even.view()) - 1.0 / 12f64.sqrt()).abs() < 1e-3);
/// let noisy = ndarray::Array2::from_shape_fn((40, 40), |(y, x)| ((7 * y + 5 * x) % 4) as f64);
/// assert!(rounding_error(&noisy.view()) < 1e-6);
/// ```
pub fn rounding_error(image: &ArrayView2<'_, f64>) -> f64 {
    if image.iter().any(|level| level.fract() != 0.0) {
        return 0.0;
    }
    let variance = |square: ArrayView2<'_, f64>| square.var(0.0);
    let mut variances: Vec<f64> = image
        .exact_chunks((8, 8))
        .into_iter()
        .map(variance)
        .collect();
    if variances.is_empty() {
        return 0.0;
    }
    let middle = variances.len() / 2;
    let median = *variances.select_nth_unstable_by(middle, f64::total_cmp).1;
    // Rounding itself adds a twelfth to the variance.
    let variance = (median - 1.0 / 12.0).max(0.0);
    let term = |k: u32| {
        let wave = (core::f64::consts::TAU * f64::from(k)).powi(2);
        2.0 * (-wave * variance).exp() / wave
    };
    // The terms left out sum to less than a thousandth of a twelfth.
    (1..=1000).map(term).sum::<f64>().sqrt()
}

/// The value exceeded by one pixel in a hundred.
fn high_value(image: &ArrayView2<'_, f64>) -> f64 {
    let mut values: Vec<f64> = image.iter().copied().filter(|v| v.is_finite()).collect();
    if values.is_empty() {
        return 0.0;
    }
    // A quantile instead of the maximum, so that single bright pixels have no effect.
    let at = values.len() - 1 - values.len() / 100;
    *values.select_nth_unstable_by(at, f64::total_cmp).1
}

/// Centre (x, y) of the pixels above a threshold whose four neighbours are above it too, so that
/// single bright pixels have no effect.
fn centre(image: &ArrayView2<'_, f64>, threshold: f64) -> Option<[f64; 2]> {
    let above: Array2<bool> = image.mapv(|value| value > threshold);
    let (rows, columns) = image.dim();
    let mut sums = [0.0; 3];
    for y in 1..rows.saturating_sub(1) {
        for x in 1..columns.saturating_sub(1) {
            let all = [[y, x], [y - 1, x], [y + 1, x], [y, x - 1], [y, x + 1]];
            if all.iter().all(|&at| above[at]) {
                sums[0] += 1.0;
                sums[1] += x as f64;
                sums[2] += y as f64;
            }
        }
    }
    (sums[0] > 0.0).then(|| [sums[1] / sums[0], sums[2] / sums[0]])
}

/// Standard deviation of the pixel noise, from second differences along rows (variance 6σ²) between
/// inside pixels. A smooth profile cancels in them; the steep rim of the face would not. The result
/// is at least the rounding error of grey levels.
fn pixel_noise(image: &ArrayView2<'_, f64>, is_inside: impl Fn(usize, usize) -> bool) -> f64 {
    let (mut squares, mut count) = (0.0, 0.0);
    for (y, row) in image.rows().into_iter().enumerate() {
        for x in 1..row.len().saturating_sub(1) {
            if is_inside(y, x - 1) && is_inside(y, x + 1) {
                squares += (row[x - 1] - 2.0 * row[x] + row[x + 1]).powi(2);
                count += 1.0;
            }
        }
    }
    // Standard deviation of the error of rounding to integers.
    let rounding = 1.0 / 12f64.sqrt();
    if count > 0.0 {
        (squares / (6.0 * count)).sqrt().max(rounding)
    } else {
        rounding
    }
}
