//! Detection of markers printed on a gel.

use nalgebra::Point2;
use ndarray::{Array2, ArrayView2, Zip};
use tactile_core::{otsu, regions};

/// A dark marker.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Marker {
    /// Centre (x, y) in pixels.
    pub position_px: Point2<f64>,
    /// Standard error of a coordinate from the image's noise, in pixels.
    pub standard_error_px: f64,
    /// Area in pixels.
    pub area_px: f64,
}

impl Marker {
    /// A marker that was detected by other means.
    pub fn new(position_px: Point2<f64>, standard_error_px: f64, area_px: f64) -> Self {
        Self {
            position_px,
            standard_error_px,
            area_px,
        }
    }
}

/// Finds dark markers of similar size in an image of grey levels.
///
/// Levels are divided by the mean of the brighter pixels around them, which removes colours and
/// slow shading, and are cut by Otsu's threshold. Highlights inside a marker are filled. The centre
/// is the mean of a marker's pixels, weighted by their darkness. Regions below a third or above 1.8
/// times the median area are dropped: they are broken prints, or markers that touch. O(pixels).
///
/// ```
/// use ndarray::Array2;
/// use tactile_gel::find_markers;
/// // Twelve smooth dots, 20 px apart, on a gel that is brighter to the right.
/// let near = |v: usize| (v as f64).rem_euclid(20.0) - 10.3;
/// let frame = Array2::from_shape_fn((60, 80), |(r, c)| {
///     let cover = 1.0 / (1.0 + (2.0 * (near(r).hypot(near(c)) - 5.0)).exp());
///     (100.0 + c as f64) * (1.0 - 0.8 * cover)
/// });
/// let markers = find_markers(frame.view());
/// assert_eq!(markers.len(), 12);
/// assert!((markers[1].position_px.x - 30.3).abs() < 0.05);
/// ```
pub fn find_markers(grey: ArrayView2<'_, f64>) -> Vec<Marker> {
    let (rows, columns) = grey.dim();
    if rows < 16 || columns < 16 {
        return Vec::new();
    }
    // Markers, and the distances between them, are smaller than an eighth of the frame.
    let reach = rows.max(columns) / 16;
    // Single precision is far finer than an 8-bit level, and memory traffic takes most of the time.
    let mut share = Array2::zeros((rows, columns));
    box_sums(&grey.mapv(|level| level as f32), 1, &mut share);
    over_box_areas(&mut share, 1);
    let (mut bright, mut count) = (share.clone(), share.clone());
    box_sums(&share, reach, &mut bright);
    over_box_areas(&mut bright, reach);
    bright.zip_mut_with(&share, |mean, level| {
        *mean = f32::from(u8::from(level >= mean))
    });
    box_sums(&bright, reach, &mut count);
    bright *= &share;
    let mut ground = Array2::zeros((rows, columns));
    box_sums(&bright, reach, &mut ground);
    // Levels relative to the mean of the brighter ones, which is at least one level.
    Zip::from(&mut share)
        .and(&ground)
        .and(&count)
        .for_each(|share, sum, count| *share /= (sum / count.max(1.0)).max(1.0));
    let Some((cut, noise)) = threshold(&share) else {
        return Vec::new();
    };
    let (mut found, owner) = patches(&share, cut);
    let Some(usual) = median(found.iter().map(|patch| patch.len() as f64)) else {
        return Vec::new();
    };
    // Larger regions are dropped anyway.
    for (k, patch) in found.iter_mut().enumerate() {
        if (patch.len() as f64) < 1.8 * usual {
            let holes = holes(patch, &owner, k, columns);
            // A highlight is surrounded by its marker.
            if (holes.len() as f64) < 0.5 * usual {
                patch.extend(holes);
            }
        }
    }
    let areas = found.iter().map(|patch| patch.len() as f64);
    let usual = median(areas).unwrap_or(usual);
    found.retain(|patch| (0.35 * usual..1.8 * usual).contains(&(patch.len() as f64)));
    let marker = |patch: &Vec<usize>| {
        let darkness = |at: &usize| cut - f64::from(share[[at / columns, at % columns]]);
        let most = median(patch.iter().map(darkness)).unwrap_or(1.0).max(0.0);
        // Highlights get the weight of the rest of the marker.
        let weight = |at: &usize| match darkness(at) {
            d if d > 0.0 => d.min(most),
            _ => most,
        };
        let mut sums = [0.0; 4];
        for at in patch {
            let (w, x, y) = (weight(at), (at % columns) as f64, (at / columns) as f64);
            let more = [w, w * x, w * y, x * x + y * y];
            sums.iter_mut()
                .zip(more)
                .for_each(|(sum, more)| *sum += more);
        }
        let (n, centre) = (patch.len() as f64, Point2::new(sums[1], sums[2]) / sums[0]);
        let spread = (sums[3] / n - centre.coords.norm_squared()).max(1.0);
        // Each axis has half of the spread, and the weight of each pixel has the noise.
        let error = noise * (0.5 * n * spread).sqrt() / sums[0];
        Marker::new(centre, error, n)
    };
    found.iter().map(marker).collect()
}

/// Sums over boxes of 2 `reach` + 1 pixels per side, clipped to the frame: running sums along
/// columns, then along rows.
fn box_sums(values: &Array2<f32>, reach: usize, sums: &mut Array2<f32>) {
    let (rows, columns) = values.dim();
    let mut tall = vec![0.0_f32; columns];
    // The running sum of the row, from `reach` + 1 pixels before its first pixel to `reach` after
    // its end.
    let mut running = vec![0.0; columns + 2 * reach + 1];
    for last in 0..rows + reach {
        if last < rows {
            let row = values.row(last);
            tall.iter_mut().zip(row).for_each(|(sum, v)| *sum += v);
        }
        if let Some(first) = last.checked_sub(2 * reach + 1) {
            let row = values.row(first);
            tall.iter_mut().zip(row).for_each(|(sum, v)| *sum -= v);
        }
        let Some(centre) = last.checked_sub(reach) else {
            continue;
        };
        let mut total = 0.0;
        for (running, tall) in running[reach + 1..].iter_mut().zip(&tall) {
            total += tall;
            *running = total;
        }
        running[reach + 1 + columns..].fill(total);
        let ends = running.iter().zip(&running[2 * reach + 1..]);
        for (sum, (before, upto)) in sums.row_mut(centre).iter_mut().zip(ends) {
            *sum = upto - before;
        }
    }
}

/// Divides sums over boxes by their areas.
fn over_box_areas(sums: &mut Array2<f32>, reach: usize) {
    let (rows, columns) = sums.dim();
    let length = |k: usize, n: usize| ((k + reach + 1).min(n) - k.saturating_sub(reach)) as f32;
    let widths: Vec<f32> = (0..columns).map(|c| length(c, columns)).collect();
    for (r, mut row) in sums.outer_iter_mut().enumerate() {
        let height = length(r, rows);
        row.iter_mut()
            .zip(&widths)
            .for_each(|(sum, width)| *sum /= height * width);
    }
}

/// Otsu's threshold of relative levels from 0 to 1.5, and the standard deviation of the brighter
/// class. `None` if there is only one class.
fn threshold(share: &Array2<f32>) -> Option<(f64, f64)> {
    /// A twentieth of a grey level at level 100.
    const WIDTH: f64 = 0.0005;
    const PER_SHARE: f32 = (1.0 / WIDTH) as f32;
    let mut histogram = vec![0.0; (1.5 / WIDTH) as usize];
    let last = histogram.len() - 1;
    let bins = share.iter().map(|v| ((v * PER_SHARE) as usize).min(last));
    bins.for_each(|bin| histogram[bin] += 1.0);
    let level = |k: usize| (k as f64 + 0.5) * WIDTH;
    let cut = otsu(&histogram, level)?;
    // The median deviation of the gel tolerates the printed markers.
    let first = ((cut / WIDTH) as usize).min(last);
    let gel = &histogram[first..];
    let half = 0.5 * gel.iter().sum::<f64>();
    let mut sum = 0.0;
    let middle = gel.iter().position(|n| {
        sum += n;
        sum >= half
    })?;
    let (mut within, mut distance) = (gel[middle], 0);
    let mut more = within;
    while within < half {
        distance += 1;
        let beside = [middle.checked_sub(distance), Some(middle + distance)];
        let beside = beside.into_iter().flatten().filter_map(|k| gel.get(k));
        more = beside.sum();
        within += more;
    }
    // Pixels are distributed evenly over the bins at that distance.
    let share = (half - (within - more)) / more;
    let bins = if distance == 0 {
        0.5 * share
    } else {
        distance as f64 - 0.5 + share
    };
    let noise = 1.4826 * WIDTH * bins;
    (level(middle + first) - cut > 3.0 * noise).then_some((cut, noise))
}

/// The pixel belongs to no region.
const NOBODY: u32 = u32::MAX;

/// Regions of at least nine pixels below `cut` that are connected by their sides, as positions in
/// reading order, and the region of each pixel.
fn patches(share: &Array2<f32>, cut: f64) -> (Vec<Vec<usize>>, Vec<u32>) {
    let mut owner = vec![NOBODY; share.len()];
    let mut dark: Vec<bool> = share.iter().map(|share| f64::from(*share) < cut).collect();
    let mut found = Vec::new();
    for patch in regions(&mut dark, share.ncols()).filter(|patch| patch.len() >= 9) {
        let name = found.len() as u32;
        patch.iter().for_each(|&at| owner[at] = name);
        found.push(patch);
    }
    (found, owner)
}

/// Positions inside region `k` that do not belong to it: those that no path from outside reaches.
fn holes(patch: &[usize], owner: &[u32], k: usize, columns: usize) -> Vec<usize> {
    let (low, high) = (
        patch[0] / columns,
        patch.iter().max().map_or(0, |at| at / columns),
    );
    let across = patch.iter().map(|at| at % columns);
    let left = across.clone().min().unwrap_or(0);
    let wide = across.max().unwrap_or(0) - left + 3;
    let high = high - low + 3;
    // The box of the region with a margin of one pixel.
    let place = |cell: usize| {
        let (r, c) = (cell / wide, cell % wide);
        let inside = r > 0 && r + 1 < high && c > 0 && c + 1 < wide;
        inside.then(|| (low + r - 1) * columns + left + c - 1)
    };
    let own = |cell: usize| place(cell).is_some_and(|at| owner[at] == k as u32);
    let mut open: Vec<bool> = (0..high * wide).map(|cell| !own(cell)).collect();
    // The region around it starts in the margin.
    let inner = regions(&mut open, wide).skip(1).flatten();
    inner.filter_map(place).collect()
}

/// The median, the upper one of two. `None` if there are no values.
fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    (!values.is_empty()).then(|| tactile_core::statistics::median(&mut values))
}
