//! The area inside a contact's outline, from the light of the pixels that the outline cuts.

use nalgebra::{Vector4, Vector5};
use ndarray::{Array2, ArrayView1, ArrayView2, ArrayViewMut1, Axis, Zip};
use tactile_core::{BoundingBox, Estimate, Polarity};

use super::FaceReading;

/// Pixels on either side of the outline whose light is summed. Blur of 0.8 pixels moves 1 %
/// further. This light is missing equally inside, where pixels are counted as whole, and outside.
const BAND: u8 = 2;
/// Width in pixels of the ring further inside in which the light is averaged: a wider ring has less
/// noise, a narrower one follows texture more closely.
const RING: u8 = 4;
/// Depth of the middle of the ring. Pixels next to the outline have the depth 1.
const RING_MIDDLE: f64 = BAND as f64 + 0.5 * (RING as f64 + 1.0);
/// Largest distance from the outline that is computed.
const FARTHEST: u8 = 12;
/// Margin in pixels around the box of the contact: the band, and the background outside it.
const MARGIN: usize = 10;
/// Side of the tiles in which the light of the ring is averaged. A mean covers three by three
/// tiles.
const TILE: usize = 8;
/// Minimum number of pixels for a mean: with fewer it is as noisy as the pixels themselves.
const FEWEST: f64 = 8.0;

/// Sums of the ring's light in one tile.
#[derive(Clone, Copy, Debug, Default)]
struct Tile {
    /// Σ of one, the light, the depth t below the middle of the ring, t², and t times the light.
    ring: Vector5<f64>,
    /// Change of the light with depth. Zero if it is not significant.
    slope: f64,
    /// Mean light at the middle of the ring in this and the neighbouring tiles, and the number of
    /// pixels.
    mean: f64,
    pixels: f64,
    /// Σ s/P of the outline's pixels here: the weight of the error of the mean.
    covered: f64,
}

/// Terms of a pixel in the moments: one, x, y and x² + y².
fn moments(x: f64, y: f64) -> Vector4<f64> {
    Vector4::new(1.0, x, y, x * x + y * y)
}

impl FaceReading {
    /// The face of a contact, from a frame and its reference, the box of the contact and its pixels
    /// in the box. `None` if the contact is too small or too irregular to have an interior.
    ///
    /// O(pixels of the box). See [`FaceReading`] for an example.
    pub fn measure(
        [frame, reference]: [ArrayView2<'_, u8>; 2],
        region: BoundingBox,
        mask: ArrayView2<'_, bool>,
        polarity: Polarity,
        pixel_size_m: [f64; 2],
    ) -> Option<Self> {
        let window = region.grown(MARGIN, frame.dim());
        let sign = polarity.sign() as f32;
        // Differences keep their sign, so that noise outside the face cancels in the sum.
        let signal = Zip::from(window.of(frame))
            .and(window.of(reference))
            .map_collect(|&f, &r| sign * (f32::from(f) - f32::from(r)));
        let part = BoundingBox {
            row_start: region.row_start - window.row_start,
            row_end: region.row_end - window.row_start,
            column_start: region.column_start - window.column_start,
            column_end: region.column_end - window.column_start,
        };
        let inside = inside(signal.view(), part, mask)?;
        let distance = distance_to_outline(&inside);
        let near = distance.indexed_iter().filter(|(_, d)| **d < FARTHEST);
        let (rows, columns) = signal.dim();
        let mut face = Face {
            near: near.map(|((row, column), _)| [row, column]).collect(),
            tiles: Array2::default((rows.div_ceil(TILE), columns.div_ceil(TILE))),
            signal,
            inside,
            distance,
        };
        let background = face.background();
        face.signal.mapv_inplace(|s| s - background as f32);
        let variance = face.noise_variance();
        face.average_ring(variance)?;
        face.sum(pixel_size_m, variance)
    }
}

/// The pixels around a contact, and what is summed over them.
struct Face {
    /// Frame minus reference, positive in the contact.
    signal: Array2<f32>,
    inside: Array2<bool>,
    distance: Array2<u8>,
    /// The pixels closer to the outline than `FARTHEST`.
    near: Vec<[usize; 2]>,
    tiles: Array2<Tile>,
}

/// The inside pixels: brighter than half the lower quartile of the contact's light, which for a
/// plain face is half of its light. `part` is the contact's box in the signal.
fn inside(
    signal: ArrayView2<'_, f32>,
    part: BoundingBox,
    mask: ArrayView2<'_, bool>,
) -> Option<Array2<bool>> {
    let light = part.of(signal);
    let mut counts = [0_usize; 511];
    Zip::from(mask).and(light).for_each(|inside, &light| {
        counts[(light as i32 + 255) as usize] += usize::from(*inside);
    });
    let quarter = counts.iter().sum::<usize>() / 4;
    let mut below = 0;
    let quartile = counts.iter().position(|pixels| {
        below += pixels;
        below > quarter
    })?;
    // The lower quartile is used instead of the mean, because bright spots of a texture would
    // raise the level above its dark spots.
    let level = 0.5 * (quartile as f32 - 255.0);
    if level <= 0.0 {
        return None;
    }
    let mut inside = Array2::from_elem(signal.dim(), false);
    let mut there = inside.view_mut();
    there.slice_axis_inplace(Axis(0), (part.row_start..part.row_end).into());
    there.slice_axis_inplace(Axis(1), (part.column_start..part.column_end).into());
    Zip::from(there)
        .and(mask)
        .and(light)
        .for_each(|inside, mask, &light| *inside = *mask && light > level);
    Some(inside)
}

impl Face {
    /// Mean light a few pixels outside the outline, in excess of the reference.
    fn background(&self) -> f64 {
        let beyond = BAND + 2..=MARGIN as u8 - 1;
        let (mut sum, mut count) = (0.0, 0.0);
        for &at in &self.near {
            if !self.inside[at] && beyond.contains(&self.distance[at]) {
                sum += f64::from(self.signal[at]);
                count += 1.0;
            }
        }
        if count > 0.0 { sum / count } else { 0.0 }
    }

    /// Variance of a pixel's noise some distance inside, from second differences along rows, whose
    /// variance is six times as large. Linear changes, also those of a texture, cancel.
    fn noise_variance(&self) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0_f64);
        for &at in &self.near {
            let [row, column] = at;
            let is_deep = self.inside[at] && self.distance[at] >= BAND + 2;
            if !is_deep || column == 0 || column + 1 == self.signal.ncols() {
                continue;
            }
            let beside = self.signal[[row, column - 1]] + self.signal[[row, column + 1]];
            let bend = f64::from(beside - 2.0 * self.signal[at]);
            sum += bend * bend;
            count += 1.0;
        }
        sum / (6.0 * count.max(1.0))
    }

    /// Averages the light just inside the outline, around each tile.
    fn average_ring(&mut self, variance: f64) -> Option<()> {
        let mut all = Vector5::zeros();
        for &at in &self.near {
            let distance = self.distance[at];
            if self.inside[at] && (BAND + 1..=BAND + RING).contains(&distance) {
                let light = f64::from(self.signal[at]);
                let t = f64::from(distance) - RING_MIDDLE;
                let terms = Vector5::new(1.0, light, t, t * t, t * light);
                self.tiles[at.map(|k| k / TILE)].ring += terms;
                all += terms;
            }
        }
        if all[0] < FEWEST || all[1] <= 0.0 {
            return None;
        }
        for (row, column) in ndarray::indices(self.tiles.dim()) {
            let near = around(&self.tiles, row, column).map(|tile| tile.ring);
            let [count, light, t, tt, t_light] = near.sum::<Vector5<f64>>().into();
            let tile = &mut self.tiles[[row, column]];
            if count < FEWEST || light <= 0.0 {
                (tile.slope, tile.mean, tile.pixels) = (0.0, all[1] / all[0], all[0]);
                continue;
            }
            // Least squares of the light over the depth, about the means of both.
            let spread = tt - t * t / count;
            let slope = (t_light - t * light / count) / spread;
            // Below three standard errors, extrapolated noise would make the area of plain faces
            // ten times as noisy.
            let is_clear = spread > 0.0 && slope * slope * spread > 9.0 * variance;
            tile.slope = if is_clear { slope } else { 0.0 };
            tile.mean = (light - tile.slope * t) / count;
            tile.pixels = count;
        }
        Some(())
    }

    /// Computes area, moments and errors.
    fn sum(&mut self, [hx, hy]: [f64; 2], variance: f64) -> Option<FaceReading> {
        let [mut area, mut light] = self.deep_moments([hx, hy]);
        // Light 4 to 5 and 8 to 9 pixels inside with the number of pixels, and the length of the
        // outline.
        let (mut near, mut far, mut outline) = ([0.0; 2], [0.0; 2], 0.0);
        let mut of_pixels = 0.0;
        for &at in &self.near {
            let [row, column] = at;
            let (inside, distance) = (self.inside[at], self.distance[at]);
            let signal = f64::from(self.signal[at]);
            let (x, y) = (column as f64 * hx, row as f64 * hy);
            // Pixels further out do not belong to the face; pixels further in count as whole.
            if distance > BAND {
                if inside {
                    area += moments(x, y);
                    light += moments(x, y) * signal;
                    match distance {
                        4..=5 => near = [near[0] + signal, near[1] + 1.0],
                        8..=9 => far = [far[0] + signal, far[1] + 1.0],
                        _ => {}
                    }
                }
                continue;
            }
            let tile = &mut self.tiles[[row / TILE, column / TILE]];
            // Outside pixels have the light of the outline itself, half a pixel before the first
            // inside pixel.
            let depth = if inside { f64::from(distance) } else { 0.5 };
            let level = tile.mean + tile.slope * (depth - RING_MIDDLE);
            if level <= 0.0 {
                return None;
            }
            let share = signal / level;
            tile.covered += share;
            // A grey level of this pixel changes the area by 1/P.
            of_pixels += tile.mean.powi(-2);
            area += moments(x, y) * share;
            light += moments(x, y) * signal;
            outline += f64::from(inside && distance == 1);
        }
        if far[1] < FEWEST || area[0] <= 0.0 || light[0] <= 0.0 {
            return None;
        }
        // Sampling, rounding to grey levels and the slope of a texture contribute 5e-4 pixels to
        // the mean position of the outline.
        let noise = variance * (of_pixels + self.weights_squared());
        let error = noise.sqrt().hypot(5e-4 * outline);
        // Σ w r² about the centre of the area, over Σ w.
        let (x, y) = (area[1] / area[0], area[2] / area[0]);
        let [of_area, of_light] =
            [area, light].map(|m| (m[3] - 2.0 * (x * m[1] + y * m[2])) / m[0] + x * x + y * y);
        let pixel = hx * hy;
        Some(FaceReading {
            area_m2: Estimate::new(area[0] * pixel, error * pixel),
            edge_ratio: near[0] * far[1] / (near[1] * far[0]),
            outline_moment: 2.0 * std::f64::consts::PI * of_area / (area[0] * pixel),
            light_moment: of_light / of_area,
        })
    }

    /// Moments of the area and of the light over the pixels deeper than `FARTHEST`, which are
    /// nearly all. They are summed by rows, because the column positions are common to them.
    fn deep_moments(&self, [hx, hy]: [f64; 2]) -> [Vector4<f64>; 2] {
        let [mut area, mut light] = [Vector4::zeros(); 2];
        let rows = self.signal.rows().into_iter();
        let rows = rows.zip(self.inside.rows()).zip(self.distance.rows());
        for (row, ((signal, inside), distance)) in rows.enumerate() {
            let (mut ones, mut signals) = ([0_u64; 3], [0.0; 3]);
            let pixels = pixels_of(signal).iter().zip(pixels_of(inside));
            let pixels = pixels.zip(pixels_of(distance)).enumerate();
            for (column, ((&signal, &inside), &distance)) in pixels {
                if inside && distance == FARTHEST {
                    let column = column as u64;
                    let (x, signal) = (column as f64, f64::from(signal));
                    ones = [ones[0] + 1, ones[1] + column, ones[2] + column * column];
                    signals[0] += signal;
                    signals[1] += signal * x;
                    signals[2] += signal * x * x;
                }
            }
            let y = row as f64 * hy;
            // Moments from the sums of the weights, and of the weights times the column and its
            // square.
            let of_row = |[one, column, square]: [f64; 3]| {
                let squares = square * hx * hx + one * y * y;
                Vector4::new(one, column * hx, one * y, squares)
            };
            area += of_row(ones.map(|sum| sum as f64));
            light += of_row(signals);
        }
        [area, light]
    }

    /// Σ w² over the pixels of the ring, where w is the change of the area per grey level of one of
    /// them.
    fn weights_squared(&self) -> f64 {
        let mut sum = 0.0;
        for ((row, column), tile) in self.tiles.indexed_iter() {
            if tile.ring[0] > 0.0 {
                let near = around(&self.tiles, row, column);
                // A grey level in the ring changes the mean light of nine tiles, and thereby the
                // covered fractions there.
                let weight: f64 = near.map(|t| t.covered / (t.pixels * t.mean)).sum();
                sum += tile.ring[0] * weight * weight;
            }
        }
        sum
    }
}

/// The pixels of a row, contiguous in the buffers.
fn pixels_of<T>(row: ArrayView1<'_, T>) -> &[T] {
    row.to_slice().unwrap_or_default()
}

/// The tile and its eight neighbours, where they exist.
fn around(tiles: &Array2<Tile>, row: usize, column: usize) -> impl Iterator<Item = &Tile> {
    let (rows, columns) = tiles.dim();
    let columns = column.saturating_sub(1)..(column + 2).min(columns);
    let rows = row.saturating_sub(1)..(row + 2).min(rows);
    rows.flat_map(move |row| columns.clone().map(move |column| &tiles[[row, column]]))
}

/// The chessboard distance of each pixel to the nearest pixel on the other side of the outline, at
/// most `FARTHEST`, and 1 next to the outline. The image is extended by its last pixels. O(pixels).
fn distance_to_outline(inside: &Array2<bool>) -> Array2<u8> {
    // One of the two is zero.
    distance_to_side(inside, false) + distance_to_side(inside, true)
}

/// The chessboard distance to the nearest pixel on one side, at most `FARTHEST`. With g the
/// distance within the column, it is the minimum of max(|k|, g(x + k)) over nearby columns x + k.
fn distance_to_side(inside: &Array2<bool>, side: bool) -> Array2<u8> {
    let (rows, columns) = inside.dim();
    // Two passes along the columns, down and up, give g. The rows then combine nearby columns.
    let mut distance = inside.mapv(|pixel| if pixel == side { 0 } else { FARTHEST });
    for row in 1..rows {
        let (above, mut below) = distance.view_mut().split_at(Axis(0), row);
        come_closer(below.row_mut(0), above.row(row - 1));
    }
    for row in (1..rows).rev() {
        let (mut above, below) = distance.view_mut().split_at(Axis(0), row);
        come_closer(above.row_mut(row - 1), below.row(0));
    }
    let reach = usize::from(FARTHEST) - 1;
    let mut line = vec![FARTHEST; columns + 2 * reach];
    let lines = distance.as_slice_mut().unwrap_or_default();
    for row in lines.chunks_exact_mut(columns.max(1)) {
        line[reach..reach + columns].copy_from_slice(row);
        for k in 1..=reach {
            let (left, right) = (&line[reach - k..], &line[reach + k..]);
            for ((own, left), right) in row.iter_mut().zip(left).zip(right) {
                *own = (*own).min((*left).min(*right).max(k as u8));
            }
        }
    }
    distance
}

/// Limits the distances of a row to one more than those of an adjacent row.
fn come_closer(row: ArrayViewMut1<'_, u8>, beside: ArrayView1<'_, u8>) {
    Zip::from(row)
        .and(beside)
        .for_each(|own, beside| *own = (*own).min(*beside + 1));
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
        let found = distance_to_outline(&inside);
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
