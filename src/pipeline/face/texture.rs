//! Material points of a textured face, and the stretch between two loads that they tell.
//!
//! Points are the bright spots of the texture, at the maximum of the smoothed light and to a fraction of a pixel by a quadratic through its
//! surroundings; a face without texture has none. The outline's growth predicts where they go, the nearest spot there is the partner, and the similarity
//! q = l R p + t by least squares through the pairs has the stretch l. Where the face slips or sticks, l and the outline's √(A₂/A₁) differ.
use super::FaceReading;
use crate::force::{BoundingBox, Estimate};
use crate::matching::{MatchError, NearestNeighbour, PointMatcher};
use nalgebra::{Point2, Vector2};
use ndarray::{Array2, ArrayView2, Axis, Slice};

/// Half width in pixels of the window over which the light is smoothed, twice.
const SMOOTHING: usize = 2;
/// Half width in pixels of the window in which a spot is the brightest, and in which the quadratic is fitted.
const WINDOW: usize = 4;
/// A spot is brighter than the mean around its window by this share: vignetting and noise of a plain face are some hundredths.
const LEAST_CONTRAST: f64 = 0.05;
/// Pixels from the outline within which there are no spots: the smoothed light falls off there.
const RIM: usize = 12;
/// Fewest pairs from which a stretch is told.
const LEAST_PAIRS: usize = 8;
/// Pixels from the predicted place within which the partner lies: friction changes a stretch of 5 % by half, some pixels at the rim.
const REACH_PX: f64 = 4.0;

/// The stretch of a face from its material points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::pipeline) struct TextureStretch {
    pub points: usize,
    pub pairs: usize,
    pub stretch: Estimate<f64>,
    /// Root mean square distance that the similarity leaves, and mean length of the displacement, in metres.
    pub residual_m: f64,
    pub displacement_m: f64,
}

/// The spots of a face in metres from the frame's first pixel. O(pixels of the contact's box).
pub(in crate::pipeline) fn spots(
    [frame, reference]: [ArrayView2<'_, u8>; 2],
    region: BoundingBox,
    mask: &Array2<bool>,
    sign: f32,
    [hx, hy]: [f64; 2],
) -> Vec<Point2<f64>> {
    let [frame, reference] = [frame, reference].map(|mut image| {
        image.slice_axis_inplace(Axis(0), Slice::from(region.row_start..region.row_end));
        image.slice_axis_inplace(Axis(1), Slice::from(region.column_start..region.column_end));
        image
    });
    let mut light = Array2::zeros(frame.dim());
    ndarray::Zip::from(&mut light)
        .and(&frame)
        .and(&reference)
        .for_each(|light, &f, &r| *light = sign * (f32::from(f) - f32::from(r)));
    smooth(&mut light);
    let rows = light.nrows();
    let mut spots = Vec::new();
    for row in RIM..rows.saturating_sub(RIM) {
        for column in brighter_than_beside(&light, row) {
            // The corners of a square around it lie in the contact: cheaper than a distance, and enough away from narrow notches.
            let corners = [
                (row - RIM, column - RIM),
                (row - RIM, column + RIM),
                (row + RIM, column - RIM),
                (row + RIM, column + RIM),
            ];
            if !corners.iter().all(|&(r, c)| mask[[r, c]]) || !is_brightest(&light, row, column) {
                continue;
            }
            if let Some([x, y]) = peak(&light, row, column) {
                spots.push(Point2::new(
                    (region.column_start as f64 + x) * hx,
                    (region.row_start as f64 + y) * hy,
                ));
            }
        }
    }
    spots
}

/// The stretch between two loads; `None` where too few spots have partners.
///
/// # Errors
/// Those of the matcher.
pub(in crate::pipeline) fn stretch(
    spots: [&[Point2<f64>]; 2],
    faces: [&FaceReading; 2],
    centres_m: [Point2<f64>; 2],
    pixel_m: f64,
) -> Result<Option<TextureStretch>, MatchError> {
    let [model, target] = spots;
    if model.len() < LEAST_PAIRS || target.len() < LEAST_PAIRS {
        return Ok(None);
    }
    let growth = (faces[1].area_m2.value / faces[0].area_m2.value).sqrt();
    let predicted: Vec<_> = model
        .iter()
        .map(|p| centres_m[1] + growth * (p - centres_m[0]))
        .collect();
    let matching =
        NearestNeighbour::within(REACH_PX * pixel_m)?.match_points(&predicted, target)?;
    let partners = matching.assignment.iter().enumerate();
    let pairs: Vec<_> = partners
        .filter_map(|(i, partner)| partner.map(|j| (model[i], target[j])))
        .collect();
    if pairs.len() < LEAST_PAIRS {
        return Ok(None);
    }
    let n = pairs.len() as f64;
    let sum = pairs.iter().fold([Vector2::zeros(); 2], |[a, b], (p, q)| {
        [a + p.coords, b + q.coords]
    });
    let [from, to] = sum.map(|sum| sum / n);
    let (mut spread, mut along, mut across) = (0.0, 0.0, 0.0);
    for (p, q) in &pairs {
        let (p, q) = (p.coords - from, q.coords - to);
        spread += p.norm_squared();
        along += p.dot(&q);
        across += p.perp(&q);
    }
    let (cosine, sine) = (along / spread, across / spread);
    let mut squares = 0.0;
    for (p, q) in &pairs {
        let (p, q) = (p.coords - from, q.coords - to);
        let mapped = Vector2::new(cosine * p.x - sine * p.y, sine * p.x + cosine * p.y);
        squares += (q - mapped).norm_squared();
    }
    // Two coordinates a pair, four parameters.
    let variance = squares / (2.0 * n - 4.0);
    let displacement = pairs.iter().map(|(p, q)| (q - p).norm()).sum::<f64>() / n;
    Ok(Some(TextureStretch {
        points: model.len(),
        pairs: pairs.len(),
        stretch: Estimate {
            value: cosine.hypot(sine),
            standard_error: (variance / spread).sqrt(),
        },
        residual_m: (squares / n).sqrt(),
        displacement_m: displacement,
    }))
}

/// The sum over a box of five pixels along both axes, twice, of grey levels: below 2²⁴ and so without rounding. Beyond the image its edge goes on.
fn smooth(light: &mut Array2<f32>) {
    let (rows, columns) = light.dim();
    if rows == 0 || columns == 0 {
        return;
    }
    let mut sums = Array2::zeros((rows, columns));
    for _ in 0..2 {
        for row in 0..rows {
            let near: [usize; 2 * SMOOTHING + 1] =
                std::array::from_fn(|k| (row + k).saturating_sub(SMOOTHING).min(rows - 1));
            let [a, b, c, d, e] = near.map(|row| light.row(row));
            ndarray::Zip::from(sums.row_mut(row))
                .and(a)
                .and(b)
                .and(c)
                .and(d)
                .and(e)
                .for_each(|sum: &mut f32, a, b, c, d, e| *sum = a + b + c + d + e);
        }
        std::mem::swap(light, &mut sums);
    }
    let mut line = vec![0.0; columns + 2 * SMOOTHING];
    let rows = light.as_slice_mut().unwrap_or_default();
    for _ in 0..2 {
        for row in rows.chunks_exact_mut(columns) {
            line[..SMOOTHING].fill(row[0]);
            line[SMOOTHING..][..columns].copy_from_slice(row);
            line[columns + SMOOTHING..].fill(row[columns - 1]);
            let near: [&[f32]; 2 * SMOOTHING + 1] = std::array::from_fn(|k| &line[k..k + columns]);
            let [a, b, c, d, e] = near;
            for (column, sum) in row.iter_mut().enumerate() {
                *sum = a[column] + b[column] + c[column] + d[column] + e[column];
            }
        }
    }
}

/// The columns of a row, away from the image's edge, whose pixels are brighter than the one to the left and no darker than the one to the right: few
/// of all.
fn brighter_than_beside(light: &Array2<f32>, row: usize) -> impl Iterator<Item = usize> + '_ {
    let line = light.row(row).to_slice().unwrap_or_default();
    let inner = line.len().saturating_sub(2 * RIM);
    let threes = line.windows(3).enumerate().skip(RIM - 1).take(inner);
    threes.filter_map(|(left, near)| (near[0] < near[1] && near[2] <= near[1]).then_some(left + 1))
}

/// Whether no pixel of the window is brighter, and none before it as bright.
fn is_brightest(light: &Array2<f32>, row: usize, column: usize) -> bool {
    let own = light[[row, column]];
    (row - WINDOW..=row + WINDOW).all(|r| {
        let near = light.row(r);
        (column - WINDOW..=column + WINDOW).all(|c| {
            let other = near[c];
            other < own || (other == own && (r, c) >= (row, column))
        })
    })
}

/// The place (x, y) of the maximum of the quadratic through the window, in pixels; `None` where it stands out too little or is no maximum.
fn peak(light: &Array2<f32>, row: usize, column: usize) -> Option<[f64; 2]> {
    let level = |at: (usize, usize)| f64::from(light[at]);
    let own = level((row, column));
    let far = [
        (row - RIM, column),
        (row + RIM, column),
        (row, column - RIM),
        (row, column + RIM),
    ];
    let around = far.into_iter().map(level).sum::<f64>() / 4.0;
    if own - around < LEAST_CONTRAST * own {
        return None;
    }
    let w = WINDOW as f64;
    // Sums of 1, t² and t⁴ over the window's lines: the least-squares quadratic in closed form.
    let side = 2.0 * w + 1.0;
    let squares = w * (w + 1.0) * side / 3.0;
    let fourths = squares * (3.0 * w * w + 3.0 * w - 1.0) / 5.0;
    let [mut gx, mut gy, mut xx, mut yy, mut xy, mut all] = [0.0; 6];
    for (r, c) in ndarray::indices((2 * WINDOW + 1, 2 * WINDOW + 1)) {
        let value = level((row + r - WINDOW, column + c - WINDOW));
        let (x, y) = (c as f64 - w, r as f64 - w);
        gx += x * value;
        gy += y * value;
        xx += x * x * value;
        yy += y * y * value;
        xy += x * y * value;
        all += value;
    }
    let slope = 1.0 / (side * squares);
    let bend = 1.0 / (side * (fourths - squares * squares / side));
    let (gx, gy) = (gx * slope, gy * slope);
    let mean_square = squares / side;
    let (hxx, hyy) = (
        2.0 * bend * (xx - mean_square * all),
        2.0 * bend * (yy - mean_square * all),
    );
    let hxy = xy / (squares * squares);
    let determinant = hxx * hyy - hxy * hxy;
    if hxx >= 0.0 || determinant <= 0.0 {
        return None;
    }
    let x = -(hyy * gx - hxy * gy) / determinant;
    let y = -(hxx * gy - hxy * gx) / determinant;
    (x.abs().max(y.abs()) <= w).then_some([column as f64 + x, row as f64 + y])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_peak_of_a_quadratic_is_found_to_rounding() {
        let light = Array2::from_shape_fn((40, 40), |(r, c)| {
            let (x, y) = (c as f64 - 20.3, r as f64 - 19.6);
            (100.0 - 0.2 * x * x - 0.3 * y * y + 0.1 * x * y) as f32
        });
        let [x, y] = peak(&light, 20, 20).unwrap();
        // Levels are rounded to 4e-6, and bend by 0.4 a pixel squared.
        assert!(
            (x - 20.3).abs() < 1e-5 && (y - 19.6).abs() < 1e-5,
            "{x} {y}"
        );
    }

    #[test]
    fn light_is_smoothed_by_two_boxes_of_five_pixels() {
        let level = |r: usize, c: usize| ((r * 37 + c * 101 + r * c) % 256) as f32;
        let mut light = Array2::from_shape_fn((23, 31), |(r, c)| level(r, c));
        smooth(&mut light);
        // Twice a box is a tent; the edge goes on.
        let tent = [1.0, 2.0, 3.0, 4.0, 5.0, 4.0, 3.0, 2.0, 1.0];
        for (row, column) in [(11, 15), (4, 4), (18, 26), (9, 20)] {
            let terms = ndarray::indices((9, 9)).into_iter();
            let expected: f32 = terms
                .map(|(r, c)| tent[r] * tent[c] * level(row + r - 4, column + c - 4))
                .sum();
            assert_eq!(light[[row, column]], expected, "{row} {column}");
        }
        let mut even = Array2::from_elem((6, 7), 3.0);
        smooth(&mut even);
        assert!(
            even.iter().all(|&sum| sum == 625.0 * 3.0),
            "the edge goes on"
        );
    }
}
