//! Markers printed on a gel: found in a frame, followed from the reference, and the shear and
//! torque that their displacements carry.

use crate::StrainBetween;
use crate::core::Estimate;
use crate::elasticity::strain::GreenLagrange;
use crate::matching::{AnnealedSoftassign, Doubt, MatchError, PointMatcher};
use nalgebra::{Point2, Vector2};
use ndarray::{Array2, ArrayView2};

/// A dark marker.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Marker {
    /// Centre (x, y) in pixels.
    pub position_px: Point2<f64>,
    /// Standard error of a coordinate from the image's noise, in pixels.
    pub standard_error_px: f64,
    /// Pixels.
    pub area_px: f64,
}

impl Marker {
    /// A marker that was found elsewhere.
    pub fn new(position_px: Point2<f64>, standard_error_px: f64, area_px: f64) -> Self {
        Self {
            position_px,
            standard_error_px,
            area_px,
        }
    }
}

/// Finds dark markers of one size in grey levels.
///
/// Levels are divided by the mean of the brighter pixels around them, which takes out colours and
/// slow shading, and cut by Otsu's threshold. Highlights inside a marker are filled. A centre is
/// the mean of a marker's pixels, weighted with their darkness. Patches below a third or above 1.8
/// times the median area are left out: broken prints, and markers that touch each other. O(pixels).
///
/// ```
/// use ndarray::Array2;
/// use tactile_imaging::markers::find_markers;
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
    // Markers are smaller than an eighth of the frame, their distances too.
    let reach = rows.max(columns) / 16;
    let grey = box_means(grey, grey.mapv(|_| 1.0).view(), 1);
    let around = box_means(grey.view(), grey.mapv(|_| 1.0).view(), reach);
    let bright = ndarray::Zip::from(&grey)
        .and(&around)
        .map_collect(|level, mean| f64::from(u8::from(level >= mean)));
    let ground = box_means(grey.view(), bright.view(), reach);
    let share = &grey / &ground.mapv(|level| level.max(1.0));
    let Some((cut, noise)) = otsu(share.view()) else {
        return Vec::new();
    };
    let dark = share.mapv(|share| share < cut);
    let patches: Vec<Vec<usize>> = patches(&dark, true);
    let patches = patches.into_iter().filter(|patch| patch.len() >= 9);
    let mut found: Vec<Vec<usize>> = patches.collect();
    let Some(usual) = median(found.iter().map(|patch| patch.len() as f64)) else {
        return Vec::new();
    };
    // A highlight is surrounded by its marker: the patch left of its first pixel.
    let mut owner = vec![usize::MAX; rows * columns];
    for (k, patch) in found.iter().enumerate() {
        patch.iter().for_each(|&at| owner[at] = k);
    }
    for hole in self::patches(&dark, false) {
        let border = |at: &usize| {
            let (r, c) = (at / columns, at % columns);
            r == 0 || c == 0 || r + 1 == rows || c + 1 == columns
        };
        let inside = (hole.len() as f64) < 0.5 * usual && !hole.iter().any(border);
        if inside && let Some(patch) = found.get_mut(owner[hole[0] - 1]) {
            patch.extend(hole);
        }
    }
    let areas = found.iter().map(|patch| patch.len() as f64);
    let usual = median(areas).unwrap_or(usual);
    found.retain(|patch| (0.35 * usual..1.8 * usual).contains(&(patch.len() as f64)));
    let marker = |patch: &Vec<usize>| {
        let darkness = |at: &usize| cut - share[[at / columns, at % columns]];
        let most = median(patch.iter().map(darkness)).unwrap_or(1.0).max(0.0);
        // Highlights weigh as the rest of the marker.
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
        // Half of the spread belongs to each axis, and every pixel's weight has the noise.
        let error = noise * (0.5 * n * spread).sqrt() / sums[0];
        Marker::new(centre, error, n)
    };
    found.iter().map(marker).collect()
}

/// Means over boxes of 2 `reach` + 1 pixels, weighted, by sums over rectangles. 0 where no weight
/// is.
fn box_means(
    values: ArrayView2<'_, f64>,
    weights: ArrayView2<'_, f64>,
    reach: usize,
) -> Array2<f64> {
    let (rows, columns) = values.dim();
    let mut sums = Array2::from_elem((rows + 1, columns + 1), [0.0; 2]);
    for r in 0..rows {
        let mut line = [0.0; 2];
        for c in 0..columns {
            let w = weights[[r, c]];
            line[0] += w * values[[r, c]];
            line[1] += w;
            let above = sums[[r, c + 1]];
            sums[[r + 1, c + 1]] = [above[0] + line[0], above[1] + line[1]];
        }
    }
    Array2::from_shape_fn((rows, columns), |(r, c)| {
        let (top, left) = (r.saturating_sub(reach), c.saturating_sub(reach));
        let (low, right) = ((r + reach + 1).min(rows), (c + reach + 1).min(columns));
        let total = |k: usize| {
            sums[[low, right]][k] - sums[[top, right]][k] - sums[[low, left]][k]
                + sums[[top, left]][k]
        };
        total(0) / total(1).max(1e-9)
    })
}

/// Otsu's threshold of shares from 0 to 1.5, and the standard deviation of the brighter class.
/// `None` for one class.
fn otsu(share: ArrayView2<'_, f64>) -> Option<(f64, f64)> {
    let bins = 300;
    let mut histogram = vec![0.0; bins];
    let bin = |v: f64| ((v / 1.5 * bins as f64) as usize).min(bins - 1);
    share.iter().for_each(|v| histogram[bin(*v)] += 1.0);
    let level = |k: usize| (k as f64 + 0.5) * 1.5 / bins as f64;
    let total: f64 = histogram.iter().sum();
    let sum: f64 = histogram
        .iter()
        .enumerate()
        .map(|(k, n)| n * level(k))
        .sum();
    let (mut below, mut sum_below, mut best) = (0.0, 0.0, None::<(f64, f64)>);
    for (k, n) in histogram.iter().enumerate() {
        below += n;
        sum_below += n * level(k);
        if below > 0.0 && below < total {
            let [low, high] = [sum_below / below, (sum - sum_below) / (total - below)];
            let between = below * (total - below) * (high - low).powi(2);
            if best.is_none_or(|best| between > best.0) {
                best = Some((between, 0.5 * (low + high)));
            }
        }
    }
    let (_, cut) = best?;
    // The median deviation of the gel bears what is printed on it.
    let gel = || share.iter().copied().filter(|v| *v >= cut);
    let middle = median(gel())?;
    let noise = 1.4826 * median(gel().map(|v| (v - middle).abs()))?;
    (middle - cut > 3.0 * noise).then_some((cut, noise))
}

/// Parts of a mask of this value that are connected by their sides, as places in reading order.
fn patches(mask: &Array2<bool>, value: bool) -> Vec<Vec<usize>> {
    let (rows, columns) = mask.dim();
    let mut open: Vec<bool> = mask.iter().map(|m| *m == value).collect();
    let mut found = Vec::new();
    for start in 0..open.len() {
        if !core::mem::take(&mut open[start]) {
            continue;
        }
        let (mut patch, mut next) = (vec![start], 0);
        while let Some(&at) = patch.get(next) {
            next += 1;
            let (r, c) = (at / columns, at % columns);
            let beside = [
                (c > 0).then(|| at - 1),
                (c + 1 < columns).then_some(at + 1),
                (r > 0).then(|| at - columns),
                (r + 1 < rows).then_some(at + columns),
            ];
            for at in beside.into_iter().flatten() {
                if core::mem::take(&mut open[at]) {
                    patch.push(at);
                }
            }
        }
        found.push(patch);
    }
    found
}

fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    let middle = values.len() / 2;
    let place =
        (middle < values.len()).then(|| values.select_nth_unstable_by(middle, f64::total_cmp));
    place.map(|(_, value, _)| *value)
}

/// A marker of the reference and where it went.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct MarkerTrack {
    /// Row of the marker in the reference and in the frame.
    pub rows: [usize; 2],
    /// Centre in the reference, in pixels.
    pub position_px: Point2<f64>,
    /// Displacement in pixels.
    pub displacement_px: Vector2<f64>,
    /// Standard error of a coordinate of the position, and of the displacement.
    pub standard_errors_px: [f64; 2],
}

/// Markers followed from the reference to a frame.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct MarkerField {
    /// The markers that are seen in both.
    pub tracks: Vec<MarkerTrack>,
    /// Strain of the gel's surface, from smoothed displacements. `None` below 16 tracks or where
    /// they are not smooth.
    pub strain: Option<StrainBetween<2>>,
    /// Why the pairs may be wrong, by the matcher.
    pub doubt: Option<Doubt>,
}

/// Shear force and torque, with the standard errors that the markers' give them.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct MarkerShear {
    /// F_x and F_y in newtons.
    pub force_n: [Estimate; 2],
    /// M_z about the markers' mean in newton metres.
    pub torque_nm: Estimate,
}

/// Follows markers from the reference to a frame by [`AnnealedSoftassign`]: no order and no grid is
/// assumed, markers may be missing in either.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_imaging::markers::{Marker, track_markers};
/// let place = |k: usize| {
///     Point2::new(
///         10.0 * (k % 7) as f64,
///         11.0 * (k / 7) as f64 + (k % 3) as f64,
///     )
/// };
/// let reference: Vec<_> = (0..42).map(|k| Marker::new(place(k), 0.05, 60.0)).collect();
/// // Sheared by 10 %, the last markers hidden.
/// let sheared = |p: Point2<f64>| Point2::new(p.x + 0.1 * p.y, p.y);
/// let frame: Vec<_> = (0..38).map(|k| Marker::new(sheared(place(k)), 0.05, 60.0)).collect();
/// let field = track_markers(&reference, &frame)?;
/// assert_eq!(field.tracks.len(), 38);
/// assert!(field.tracks.iter().all(|track| track.rows[0] == track.rows[1]));
/// # Ok::<(), tactile_imaging::matching::MatchError>(())
/// ```
///
/// # Errors
/// Those of the matcher: too few markers.
pub fn track_markers(reference: &[Marker], frame: &[Marker]) -> Result<MarkerField, MatchError> {
    let [before, after] =
        [reference, frame].map(|set| set.iter().map(|m| m.position_px).collect::<Vec<_>>());
    let matching = AnnealedSoftassign::default().match_points(&before, &after)?;
    let partner = |(i, j): (usize, &Option<usize>)| j.map(|j| (i, j));
    let mut pairs: Vec<_> = matching
        .assignment
        .iter()
        .enumerate()
        .filter_map(partner)
        .collect();
    // A smooth deformation drops wrong pairs and finds markers that the matcher missed.
    let strain = StrainBetween::of_pairs(&before, &after, &pairs, &GreenLagrange).ok();
    if let Some(strain) = &strain {
        pairs.clone_from(&strain.rows);
    }
    let track = |&(i, j): &(usize, usize)| {
        let [own, there] = [&reference[i], &frame[j]];
        MarkerTrack {
            rows: [i, j],
            position_px: own.position_px,
            displacement_px: there.position_px - own.position_px,
            standard_errors_px: [
                own.standard_error_px,
                own.standard_error_px.hypot(there.standard_error_px),
            ],
        }
    };
    Ok(MarkerField {
        tracks: pairs.iter().map(track).collect(),
        strain,
        doubt: matching.report.doubt,
    })
}

impl MarkerField {
    /// Shear force and torque of a gel whose surface resists displacement by k Pa per metre:
    /// F = k A Σ u and M = k A Σ (r × u), A the area of a marker's cell, r from the markers' mean.
    ///
    /// A layer of shear modulus G and thickness h bonded to a rigid plate has k = G/h where it
    /// moves over more than its thickness. Errors are those of the markers alone. `None` without a
    /// track.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_imaging::markers::{Marker, track_markers};
    /// let place = |k: usize| Point2::new(10.0 * (k % 6) as f64, 10.0 * (k / 6) as f64);
    /// let all = |dx: f64| -> Vec<_> {
    ///     (0..36)
    ///         .map(|k| Marker::new(place(k) + nalgebra::Vector2::new(dx, 0.0), 0.05, 60.0))
    ///         .collect()
    /// };
    /// let field = track_markers(&all(0.0), &all(1.0))?;
    /// // 36 cells of 1 mm² move by 0.1 mm on a layer of 1e8 Pa/m.
    /// let shear = field.shear(1e8, 1e-4).expect("tracks");
    /// assert!((shear.force_n[0].value - 0.36).abs() < 1e-6 && shear.torque_nm.value.abs() < 1e-9);
    /// # Ok::<(), tactile_imaging::matching::MatchError>(())
    /// ```
    pub fn shear(&self, stiffness_pa_per_m: f64, pixel_size_m: f64) -> Option<MarkerShear> {
        let spacing = median(self.tracks.iter().filter_map(|track| {
            let others = self.tracks.iter().filter(|other| other.rows != track.rows);
            let distances = others.map(|other| (other.position_px - track.position_px).norm());
            distances.min_by(f64::total_cmp)
        }))?;
        let scale = stiffness_pa_per_m * (spacing * pixel_size_m).powi(2) * pixel_size_m;
        let n = self.tracks.len() as f64;
        let coords = self.tracks.iter().map(|track| track.position_px.coords);
        let mean = coords.sum::<Vector2<f64>>() / n;
        let (mut force, mut torque, mut variances) = (Vector2::zeros(), 0.0, [0.0; 2]);
        for track in &self.tracks {
            let (r, u) = (track.position_px.coords - mean, track.displacement_px);
            force += u;
            torque += r.x * u.y - r.y * u.x;
            let variance = track.standard_errors_px[1].powi(2);
            variances[0] += variance;
            variances[1] += variance * r.norm_squared();
        }
        let turn = scale * pixel_size_m;
        Some(MarkerShear {
            force_n: [force.x, force.y]
                .map(|sum| Estimate::from_variance(scale * sum, scale * scale * variances[0])),
            torque_nm: Estimate::from_variance(turn * torque, turn * turn * variances[1]),
        })
    }
}
