//! Material points of a textured face, and their stretch between two loads.
//!
//! Points are the bright spots of the texture, at the maximum of the smoothed light and to a
//! fraction of a pixel by a quadratic through its surroundings. A face without texture has none.
//! The outline's growth predicts where they go, and the nearest spot there is the partner. The
//! similarity q = l R p + t by least squares through the pairs has the stretch l. Where the face
//! slips or sticks, l and the outline's √(A₂/A₁) differ.

use nalgebra::{Point2, Vector2};
use ndarray::{Array2, ArrayView2, Zip};
use tactile_core::{BoundingBox, Estimate, Polarity};

/// Half width in pixels of the window over which the light is smoothed, twice.
const SMOOTHING: usize = 2;
/// Half width in pixels of the window in which a spot is the brightest, and of the quadratic's fit.
const WINDOW: usize = 4;
/// Pixels from the outline within which there are no spots: the smoothed light falls off there.
const RIM: usize = 12;
/// Fewest spots and fewest pairs of a stretch.
const LEAST_PAIRS: usize = 8;

/// The stretch of a face by its material points.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_force::TextureStretch;
///
/// let spot = |k: u32| Point2::new(f64::from(k % 5), f64::from(k / 5)) * 1e-3;
/// let from: Vec<_> = (0..20).map(spot).collect();
/// // Stretched by 2 % about the third spot.
/// let to: Vec<_> = from.iter().map(|p| from[2] + 1.02 * (p - from[2])).collect();
/// let found = TextureStretch::between([&from, &to], |p| *p, 1e-4).expect("20 pairs");
/// assert_eq!((found.points, found.pairs), (20, 20));
/// assert!((found.stretch.value - 1.02).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct TextureStretch {
    /// Number of spots of the first face.
    pub points: usize,
    /// Number of spots with a partner.
    pub pairs: usize,
    /// The stretch and its standard error.
    pub stretch: Estimate,
    /// Root mean square distance between the partners and the similarity, in metres.
    pub residual_m: f64,
    /// Mean length of the displacement in metres.
    pub displacement_m: f64,
}

impl TextureStretch {
    /// The stretch from the spots of a first face to those of a second. `predict` takes a spot to
    /// its expected place in the second frame. Partners lie within `reach_m` of it, which friction
    /// makes necessary: some pixels at the rim of a face that is stretched by 5 %.
    ///
    /// `None` with fewer than eight pairs. O(spots²).
    pub fn between(
        [model, target]: [&[Point2<f64>]; 2],
        predict: impl Fn(&Point2<f64>) -> Point2<f64>,
        reach_m: f64,
    ) -> Option<Self> {
        if model.len() < LEAST_PAIRS || target.len() < LEAST_PAIRS {
            return None;
        }
        // The nearest of the spots whose nearest target is this one.
        let mut partners = vec![None; target.len()];
        for point in model {
            let place = predict(point);
            let squares = target.iter().map(|q| (q - place).norm_squared());
            let (nearest, square) = squares.enumerate().min_by(|a, b| a.1.total_cmp(&b.1))?;
            // Two spots must not share a partner: the nearer keeps it.
            let is_nearer = partners[nearest].is_none_or(|(_, other)| square < other);
            if square <= reach_m * reach_m && is_nearer {
                partners[nearest] = Some((*point, square));
            }
        }
        let pairs = partners.iter().zip(target);
        let pairs: Vec<_> = pairs
            .filter_map(|(partner, q)| partner.map(|(p, _)| (p, *q)))
            .collect();
        (pairs.len() >= LEAST_PAIRS).then(|| Self::of_pairs(model.len(), &pairs))
    }

    /// Least squares for the similarity.
    fn of_pairs(points: usize, pairs: &[(Point2<f64>, Point2<f64>)]) -> Self {
        let n = pairs.len() as f64;
        let sum = pairs.iter().fold([Vector2::zeros(); 2], |[a, b], (p, q)| {
            [a + p.coords, b + q.coords]
        });
        let [from, to] = sum.map(|sum| sum / n);
        let about = || pairs.iter().map(|(p, q)| (p.coords - from, q.coords - to));
        // About the centroids the shift drops out of the least squares.
        let (mut spread, mut along, mut across) = (0.0, 0.0, 0.0);
        for (p, q) in about() {
            spread += p.norm_squared();
            along += p.dot(&q);
            across += p.perp(&q);
        }
        let (cosine, sine) = (along / spread, across / spread);
        let turned =
            |p: Vector2<f64>| Vector2::new(cosine * p.x - sine * p.y, sine * p.x + cosine * p.y);
        let squares: f64 = about().map(|(p, q)| (q - turned(p)).norm_squared()).sum();
        // Two coordinates a pair, four parameters.
        let freedom = 2.0 * n - 4.0;
        Self {
            points,
            pairs: pairs.len(),
            stretch: Estimate::from_variance(cosine.hypot(sine), squares / freedom / spread)
                .with_degrees_of_freedom(freedom),
            residual_m: (squares / n).sqrt(),
            displacement_m: pairs.iter().map(|(p, q)| (q - p).norm()).sum::<f64>() / n,
        }
    }
}

/// The bright spots of a textured face in metres from the frame's first pixel, from a frame and its
/// reference, the contact's box and its pixels within the box. None of a plain face.
///
/// O(pixels of the box).
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::{BoundingBox, Polarity, texture_spots};
///
/// let reference = Array2::from_elem((60, 60), 20_u8);
/// let frame = Array2::from_shape_fn((60, 60), |(row, column)| {
///     let distance2 = (row as f64 - 31.4).powi(2) + (column as f64 - 28.7).powi(2);
///     (120.0 + 60.0 * (-distance2 / 30.0).exp()).round() as u8
/// });
/// let region = BoundingBox::whole(frame.dim());
/// let mask = Array2::from_elem(frame.dim(), true);
/// let images = [frame.view(), reference.view()];
/// let spots = texture_spots(images, region, mask.view(), Polarity::Brighter, [1.0; 2]);
/// assert!((spots[0].x - 28.7).abs() < 0.05 && (spots[0].y - 31.4).abs() < 0.05);
/// ```
pub fn texture_spots(
    [frame, reference]: [ArrayView2<'_, u8>; 2],
    region: BoundingBox,
    mask: ArrayView2<'_, bool>,
    polarity: Polarity,
    [hx, hy]: [f64; 2],
) -> Vec<Point2<f64>> {
    let sign = polarity.sign() as f32;
    let mut light = Array2::zeros((region.rows(), region.columns()));
    Zip::from(&mut light)
        .and(region.of(frame))
        .and(region.of(reference))
        .for_each(|light, &f, &r| *light = sign * (f32::from(f) - f32::from(r)));
    smooth(&mut light);
    let mut spots = Vec::new();
    for row in RIM..light.nrows().saturating_sub(RIM) {
        for column in brighter_than_beside(&light, row) {
            // The corners of a square around it lie in the contact: cheaper than a distance, and
            // enough away from narrow notches.
            let [rows, columns] = [row, column].map(|at| [at - RIM, at + RIM]);
            let is_inside = rows.iter().all(|&r| columns.iter().all(|&c| mask[[r, c]]));
            if is_inside
                && is_brightest(&light, row, column)
                && let Some([x, y]) = peak(&light, row, column)
            {
                spots.push(Point2::new(
                    (region.column_start as f64 + x) * hx,
                    (region.row_start as f64 + y) * hy,
                ));
            }
        }
    }
    spots
}

/// The sum over a box of five pixels along both axes, twice, of grey levels: below 2²⁴ and so
/// without rounding. Beyond the image its edge goes on.
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
            Zip::from(sums.row_mut(row))
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

/// The columns of a row, away from the image's edge, whose pixels are brighter than the one to the
/// left and no darker than the one to the right: few of all.
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

/// The place (x, y) of the maximum of the quadratic through the window, in pixels. `None` where it
/// stands out too little or is no maximum.
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
    // Vignetting and noise of a plain face are some hundredths.
    if own - around < 0.05 * own {
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
    // Curvatures are orthogonal to the mean level only after their own mean is taken off.
    let bend = 1.0 / (side * (fourths - squares * squares / side));
    let (gx, gy) = (gx * slope, gy * slope);
    let mean_square = squares / side;
    let (hxx, hyy) = (
        2.0 * bend * (xx - mean_square * all),
        2.0 * bend * (yy - mean_square * all),
    );
    let hxy = xy / (squares * squares);
    let determinant = hxx * hyy - hxy * hxy;
    // A maximum curves downwards in every direction.
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
        // Twice a box is a tent. The edge goes on.
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
