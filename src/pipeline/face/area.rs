//! The area within a contact's outline, from the light of the pixels that the outline cuts.
use super::distance::{FARTHEST, to_outline};
use super::histogram::Histogram;
use super::moments::Moments;
use super::{BAND, FaceReading, RING};
use crate::force::{BoundingBox, Estimate};
use crate::pipeline::contact::{FrameContact, resize};
use ndarray::{Array2, ArrayBase, ArrayView1, ArrayView2, Axis, Ix2, Slice};

/// Pixels around the contact's box that are looked at: the band, and the background beyond it.
const MARGIN: usize = 10;
/// Side of the tiles in which the light inside the outline is averaged; a mean is over three by three of them.
const TILE: usize = 8;
/// Fewest pixels of a mean: fewer are as noisy as the pixels themselves.
const FEWEST: f64 = 8.0;
/// Share of the lower quartile of the contact's light above which a pixel is inside: half the light of a plain face.
const LEVEL: f64 = 0.5;
/// Depth of the ring's middle: pixels beside the outline have the depth 1.
const RING_MIDDLE: f64 = BAND as f64 + 0.5 * (RING as f64 + 1.0);
/// Standard errors from which on the light's change with depth is followed: extrapolating noise would make the area of plain faces ten times as
/// noisy.
const CLEAR_SLOPE: f64 = 3.0;
/// Floor of the outline's mean error, in pixels: what sampling, rounding to grey levels and the slope of a texture leave.
const OUTLINE_FLOOR_PX: f64 = 5e-4;

/// Sums of the ring's light in one tile.
#[derive(Clone, Copy, Debug, Default)]
struct Tile {
    count: f64,
    sum: f64,
    /// Σ of the depth t below the ring's middle, of t², and of t times the light.
    depth: f64,
    depth_squared: f64,
    depth_light: f64,
    /// Change of the light with the depth, where it is more than noise, and the ring's mean depth.
    slope: f64,
    /// Mean light of this tile and those around it, and the pixels in it.
    mean: f64,
    pixels: f64,
    /// Σ s/P of the outline's pixels here: how much the mean's error counts.
    covered: f64,
}

/// What is kept from frame to frame to save allocations.
#[derive(Debug, Default)]
pub(in crate::pipeline) struct FaceWorkspace {
    signal: Array2<f32>,
    inside: Array2<bool>,
    distance: Array2<u8>,
    /// The pixels nearer to the outline than [`FARTHEST`].
    near: Vec<[usize; 2]>,
    tiles: Array2<Tile>,
}

impl FaceWorkspace {
    /// The face in a contact; `sign` is −1 for sensors that darken. `None` where the contact has no inside.
    ///
    /// O(pixels of the contact's box).
    pub(in crate::pipeline) fn measure(
        &mut self,
        [frame, reference]: [ArrayView2<'_, u8>; 2],
        contact: &FrameContact,
        sign: f32,
        pixel_size_m: [f64; 2],
    ) -> Option<FaceReading> {
        let region = contact.region?;
        let window = grown(region, frame.dim());
        self.load([frame, reference], window, sign);
        self.threshold(region, window, contact)?;
        to_outline(&self.inside, &mut self.distance);
        self.list_near();
        let background = self.background();
        self.signal.mapv_inplace(|s| s - background as f32);
        let variance = self.noise_variance();
        self.average_ring(variance)?;
        self.sum(pixel_size_m, variance)
    }

    fn load(&mut self, [frame, reference]: [ArrayView2<'_, u8>; 2], w: BoundingBox, sign: f32) {
        let [frame, reference] = [frame, reference].map(|image| within(image, w));
        let shape = frame.dim();
        resize(&mut self.signal, shape);
        resize(&mut self.inside, shape);
        resize(&mut self.distance, shape);
        resize(
            &mut self.tiles,
            (shape.0.div_ceil(TILE), shape.1.div_ceil(TILE)),
        );
        self.tiles.fill(Tile::default());
        ndarray::Zip::from(&mut self.signal)
            .and(&frame)
            .and(&reference)
            .for_each(|s, &f, &r| *s = sign * (f32::from(f) - f32::from(r)));
    }

    /// Which pixels are inside: as bright as half of the darker quarter of the contact.
    fn threshold(
        &mut self,
        region: BoundingBox,
        w: BoundingBox,
        contact: &FrameContact,
    ) -> Option<()> {
        let part = BoundingBox {
            row_start: region.row_start - w.row_start,
            row_end: region.row_end - w.row_start,
            column_start: region.column_start - w.column_start,
            column_end: region.column_end - w.column_start,
        };
        let signal = within(self.signal.view(), part);
        let mut levels = Histogram::default();
        ndarray::Zip::from(&contact.mask)
            .and(signal)
            .for_each(|inside, &signal| {
                if *inside {
                    levels.count(signal);
                }
            });
        let level = LEVEL as f32 * levels.lower_quartile()?;
        if level <= 0.0 {
            return None;
        }
        self.inside.fill(false);
        ndarray::Zip::from(within(self.inside.view_mut(), part))
            .and(&contact.mask)
            .and(signal)
            .for_each(|inside, mask, &signal| *inside = *mask && signal > level);
        Some(())
    }

    fn list_near(&mut self) {
        self.near.clear();
        for (row, distances) in self.distance.rows().into_iter().enumerate() {
            let columns = distances.iter().enumerate();
            let near = columns.filter(|&(_, &distance)| distance < FARTHEST);
            self.near.extend(near.map(|(column, _)| [row, column]));
        }
    }

    /// Mean light a few pixels outside the outline: what the reference does not know of.
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

    /// Variance of a pixel's noise, from the pixels some way inside.
    fn noise_variance(&self) -> f64 {
        let mut noise = NoiseLevel::default();
        for &at in &self.near {
            if self.inside[at] && self.distance[at] >= BAND + 2 {
                noise.see(&self.signal, at);
            }
        }
        noise.variance()
    }

    /// The light just inside the outline, around every tile.
    fn average_ring(&mut self, variance: f64) -> Option<()> {
        let ring = BAND + 1..=BAND + RING;
        let (mut all, mut count) = (0.0, 0.0);
        for &[row, column] in &self.near {
            let at = [row, column];
            let distance = self.distance[at];
            if self.inside[at] && ring.contains(&distance) {
                let tile = &mut self.tiles[[row / TILE, column / TILE]];
                let light = f64::from(self.signal[at]);
                let depth = f64::from(distance) - RING_MIDDLE;
                tile.count += 1.0;
                tile.sum += light;
                tile.depth += depth;
                tile.depth_squared += depth * depth;
                tile.depth_light += depth * light;
                all += light;
                count += 1.0;
            }
        }
        if count < FEWEST || all <= 0.0 {
            return None;
        }
        for (row, column) in ndarray::indices(self.tiles.dim()) {
            let (mut sum, mut pixels) = (0.0, 0.0);
            let (mut t, mut tt, mut ts) = (0.0, 0.0, 0.0);
            for tile in around(&self.tiles, row, column) {
                sum += tile.sum;
                pixels += tile.count;
                t += tile.depth;
                tt += tile.depth_squared;
                ts += tile.depth_light;
            }
            let spread = tt - t * t / pixels;
            let slope = (ts - t * sum / pixels) / spread;
            let clear =
                spread > 0.0 && slope * slope * spread > CLEAR_SLOPE * CLEAR_SLOPE * variance;
            let few = pixels < FEWEST || sum <= 0.0;
            let tile = &mut self.tiles[[row, column]];
            // The mean at the ring's middle.
            tile.slope = if clear && !few { slope } else { 0.0 };
            let sum = sum - tile.slope * t;
            (tile.mean, tile.pixels) = if few {
                (all / count, count)
            } else {
                (sum / pixels, pixels)
            };
        }
        Some(())
    }

    /// Area, moments and errors.
    fn sum(&mut self, [hx, hy]: [f64; 2], variance: f64) -> Option<FaceReading> {
        let [mut area, mut light] = self.deep_moments([hx, hy]);
        // Light 3 to 5 and 7 to 9 pixels inside, and the outline's length.
        let (mut near, mut far, mut outline) = ([0.0; 2], [0.0; 2], 0.0);
        let mut of_pixels = 0.0;
        for &[row, column] in &self.near {
            let at = [row, column];
            let (inside, distance) = (self.inside[at], self.distance[at]);
            let signal = f64::from(self.signal[at]);
            let (x, y) = (column as f64 * hx, row as f64 * hy);
            if distance > BAND {
                if inside {
                    area.add(1.0, x, y);
                    light.add(signal, x, y);
                    match distance {
                        4..=5 => near = [near[0] + signal, near[1] + 1.0],
                        8..=9 => far = [far[0] + signal, far[1] + 1.0],
                        _ => {}
                    }
                }
                continue;
            }
            let tile = &mut self.tiles[[row / TILE, column / TILE]];
            let depth = if inside {
                f64::from(distance) - 0.5
            } else {
                0.0
            };
            let level = tile.mean + tile.slope * (depth + 0.5 - RING_MIDDLE);
            if level <= 0.0 {
                return None;
            }
            let share = signal / level;
            tile.covered += share;
            of_pixels += tile.mean.powi(-2);
            area.add(share, x, y);
            light.add(signal, x, y);
            outline += if inside && distance == 1 { 1.0 } else { 0.0 };
        }
        if far[1] < FEWEST || area.0[0] <= 0.0 || light.0[0] <= 0.0 {
            return None;
        }
        let of_means = self.weights_squared();
        let error = (variance * (of_pixels + of_means))
            .sqrt()
            .hypot(OUTLINE_FLOOR_PX * outline);
        let [count, sx, sy, _] = area.0;
        let centre = [sx / count, sy / count];
        let [of_area, of_light] = [area, light].map(|m| m.about(centre[0], centre[1]));
        let pixel = hx * hy;
        Some(FaceReading {
            area_m2: Estimate {
                value: count * pixel,
                standard_error: error * pixel,
            },
            edge_ratio: near[0] * far[1] / (near[1] * far[0]),
            outline_moment: 2.0 * std::f64::consts::PI * of_area / (count * pixel),
            light_moment: of_light / of_area,
        })
    }

    /// Moments of the area and of the light over the pixels that are further inside than those near the outline: of all, nearly all.
    fn deep_moments(&self, [hx, hy]: [f64; 2]) -> [Moments; 2] {
        let [mut area, mut light] = [Moments::default(); 2];
        let rows = self.signal.rows().into_iter();
        let rows = rows.zip(self.inside.rows()).zip(self.distance.rows());
        for (row, ((signal, inside), distance)) in rows.enumerate() {
            // Of one and of the signal: their sums, and those with the column and its square.
            let (mut ones, mut signals) = ([0_u64; 3], [0.0; 3]);
            let (inside, distance) = (pixels_of(inside), pixels_of(distance));
            let pixels = pixels_of(signal)
                .iter()
                .zip(inside)
                .zip(distance)
                .enumerate();
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
            area.add_row(ones.map(|sum| sum as f64), hx, y);
            light.add_row(signals, hx, y);
        }
        [area, light]
    }

    /// Σ w² over the ring's pixels, w what a grey level of one of them takes from the area.
    fn weights_squared(&self) -> f64 {
        let mut sum = 0.0;
        for ((row, column), tile) in self.tiles.indexed_iter() {
            if tile.count > 0.0 {
                let near = around(&self.tiles, row, column);
                let weight: f64 = near.map(|t| t.covered / (t.pixels * t.mean)).sum();
                sum += tile.count * weight * weight;
            }
        }
        sum
    }
}

/// The part of an image in a box.
fn within<P: ndarray::RawData>(
    mut image: ArrayBase<P, Ix2>,
    part: BoundingBox,
) -> ArrayBase<P, Ix2> {
    image.slice_axis_inplace(Axis(0), Slice::from(part.row_start..part.row_end));
    image.slice_axis_inplace(Axis(1), Slice::from(part.column_start..part.column_end));
    image
}

/// A row's pixels, side by side as they lie in an array of this module.
fn pixels_of<T>(row: ArrayView1<'_, T>) -> &[T] {
    row.to_slice().unwrap_or_default()
}

/// Variance of the pixels' noise, from second differences along rows: they leave out what is linear, a texture too.
#[derive(Debug, Default)]
struct NoiseLevel {
    sum: f64,
    count: f64,
}

impl NoiseLevel {
    fn see(&mut self, signal: &Array2<f32>, [row, column]: [usize; 2]) {
        let beside = column
            .checked_sub(1)
            .and_then(|left| signal.get([row, left]));
        if let (Some(left), Some(right)) = (beside, signal.get([row, column + 1])) {
            let bend = f64::from(left - 2.0 * signal[[row, column]] + right);
            self.sum += bend * bend;
            self.count += 1.0;
        }
    }

    /// A second difference has six times the variance of a pixel.
    fn variance(&self) -> f64 {
        self.sum / (6.0 * self.count.max(1.0))
    }
}

/// The tile and its eight neighbours, as far as they exist.
fn around(tiles: &Array2<Tile>, row: usize, column: usize) -> impl Iterator<Item = &Tile> {
    let (rows, columns) = tiles.dim();
    let columns = column.saturating_sub(1)..(column + 2).min(columns);
    let rows = row.saturating_sub(1)..(row + 2).min(rows);
    rows.flat_map(move |row| columns.clone().map(move |column| &tiles[[row, column]]))
}

/// The box with the margin, inside the frame.
fn grown(region: BoundingBox, (rows, columns): (usize, usize)) -> BoundingBox {
    BoundingBox {
        row_start: region.row_start.saturating_sub(MARGIN),
        row_end: (region.row_end + MARGIN).min(rows),
        column_start: region.column_start.saturating_sub(MARGIN),
        column_end: (region.column_end + MARGIN).min(columns),
    }
}
