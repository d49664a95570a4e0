//! Detection of contacts: regions of pressure, and the edge of each by a model of the pressure.
//!
//! The pressure follows from the slopes by the linear law of the face ([`Plane`]). Outside a
//! contact it vanishes. At the edge of a smooth object the face leaves it without a kink, and the
//! pressure ends as √(distance to the edge). The mean pressure at each distance from the
//! half-height contour of a region is fitted with this root, blurred like the frame. Neither blur
//! nor threshold therefore shifts the edge. If the root does not fit, the face has a kink (a sharp
//! rim or steep walls), and the edge is at the largest slope.

use ndarray::{Array2, ArrayView2, Zip};
use tactile_core::BoundingBox;

/// Minimum peak of a region, in standard deviations of the smoothed pressure. By chance one cell in
/// 10⁹ exceeds it, and a frame has about 10⁴.
const LEAST_EVIDENCE: f32 = 6.0;
/// Minimum peak of a region relative to the strongest: next to a deep contact, the error of the
/// polynomial is several per cent of it.
const LEAST_SHARE: f32 = 0.06;
/// Minimum size of a region in cells of 2 × 2 pixels: a contact of 3 pixels radius.
const LEAST_CELLS: usize = 8;
/// Maximum number of cells used for the spread of a field.
const SPREAD_CELLS: usize = 6400;
/// Two peaks are separate contacts if the pressure between them falls below this fraction of the
/// lower one.
const SADDLE: f32 = 0.5;
/// Standard deviation, in cells, of the blur by frame, cell and bin.
const BLUR: f64 = 0.65;
/// If the root mean square misfit of the root exceeds this fraction of the pressure, the edge is a
/// kink.
const ROOT_MISFIT: f64 = 0.04;
/// Error of an edge in cells that remains without noise, from scenes with known edges.
const EDGE_ERROR: f64 = 0.12;
/// Discretisation shifts the fitted root inwards by this number of cells, in scenes of 10 to 50 px
/// (`cargo run --release -p tactile-gel --example exact_worlds`).
const ROOT_SHIFT: f64 = 0.09;
/// Blur shifts the largest slope at a kink inwards by this number of cells.
const KINK_SHIFT: f64 = 0.15;

/// A region of pressure with its edge, in pixels of the frame.
#[derive(Clone, Debug)]
pub(crate) struct Patch {
    /// Pixels inside, row by row.
    pub pixels: Vec<[usize; 2]>,
    /// Pixels on the edge, which define the level of the rim.
    pub rim: Vec<[usize; 2]>,
    /// Area in pixels.
    pub area: f64,
    /// Radius of the circle of this area, and the standard error of an edge, in pixels.
    pub radius: f64,
    pub edge_error: f64,
}

/// Pressure and slopes on cells of 2 × 2 pixels.
pub(crate) struct Cells {
    /// Slopes along x and y.
    pub slopes: [Array2<f32>; 2],
    pub pressure: Array2<f32>,
}

/// Means over blocks of `size` × `size` pixels. Incomplete blocks are dropped.
pub(crate) fn block_means(values: ArrayView2<'_, f32>, size: usize) -> Array2<f32> {
    let (rows, columns) = (values.nrows() / size, values.ncols() / size);
    let mut means = Array2::zeros((rows, columns));
    let share = 1.0 / (size * size) as f32;
    for (row, line) in values.outer_iter().enumerate().take(rows * size) {
        let mut to = means.row_mut(row / size);
        // Arrays created here are contiguous.
        if let (Some(line), Some(to)) = (line.as_slice(), to.as_slice_mut()) {
            for (to, cell) in to.iter_mut().zip(line.chunks_exact(size)) {
                *to += cell.iter().sum::<f32>() * share;
            }
        }
    }
    means
}

/// Blurs `times` times by (1, 4, 6, 4, 1)/16 along both axes. The border is extended.
pub(crate) fn blurred(image: &Array2<f32>, times: usize) -> Array2<f32> {
    let (rows, columns) = image.dim();
    let tap = |at: [f32; 5]| (at[0] + at[4] + 4.0 * (at[1] + at[3]) + 6.0 * at[2]) / 16.0;
    let near = |k: usize, n: usize| [0, 1, 2, 3, 4].map(|j| (k + j).saturating_sub(2).min(n - 1));
    let mut image = image.clone();
    let mut across = Array2::zeros((rows, columns));
    let mut padded = vec![0.0; columns + 4];
    for _ in 0..times {
        for (from, mut to) in image.outer_iter().zip(across.outer_iter_mut()) {
            for (padded, from) in padded[2..].iter_mut().zip(&from) {
                *padded = *from;
            }
            padded[..2].fill(from[0]);
            padded[columns + 2..].fill(from[columns - 1]);
            for (to, taps) in to.iter_mut().zip(padded.windows(5)) {
                *to = tap([0, 1, 2, 3, 4].map(|k| taps[k]));
            }
        }
        for (k, to) in image.outer_iter_mut().enumerate() {
            let [a, b, c, d, e] = near(k, rows).map(|k| across.row(k));
            Zip::from(to)
                .and(a)
                .and(b)
                .and(c)
                .and(d)
                .and(e)
                .for_each(|to, a, b, c, d, e| *to = tap([*a, *b, *c, *d, *e]));
        }
    }
    image
}

/// A quantile of values. 0 if there are none.
pub(crate) fn quantile(values: &mut [f32], share: f64) -> f32 {
    if values.is_empty() {
        return 0.0;
    }
    let at = ((share * values.len() as f64) as usize).min(values.len() - 1);
    *values.select_nth_unstable_by(at, f32::total_cmp).1
}

/// Standard deviation of the bulk of a field, from its median absolute deviation.
pub(crate) fn spread(field: &Array2<f32>) -> f32 {
    // Every third cell is enough for a median; for large fields fewer.
    let step = (field.len() / SPREAD_CELLS).max(3);
    let mut values: Vec<f32> = field.iter().step_by(step).copied().collect();
    let middle = quantile(&mut values, 0.5);
    values.iter_mut().for_each(|v| *v = (*v - middle).abs());
    1.4826 * quantile(&mut values, 0.5)
}

/// The regions of a frame of `shape`, the strongest first. `noise_floor` is the minimum standard
/// deviation of the smoothed pressure.
pub(crate) fn patches(cells: &Cells, shape: (usize, usize), noise_floor: f32) -> Vec<Patch> {
    if cells.pressure.nrows() < 8 || cells.pressure.ncols() < 8 {
        return Vec::new();
    }
    let smooth = blurred(&cells.pressure, 2);
    let noise = spread(&smooth).max(noise_floor);
    let strongest = smooth.iter().copied().fold(0.0, f32::max);
    let threshold = (LEAST_EVIDENCE * noise).max(LEAST_SHARE * strongest);
    let (regions, peaks) = regions(&smooth, threshold);
    // The noise of one cell, before the blur reduces it by this factor.
    let cell_noise = f64::from(spread(&(&cells.pressure - &blurred(&cells.pressure, 1))));
    let mut taken = Array2::from_elem(shape, false);
    let mut order: Vec<usize> = (0..peaks.len()).collect();
    order.sort_by(|a, b| peaks[*b].total_cmp(&peaks[*a]));
    let edged = order.into_iter().filter_map(|name| {
        let region = Region {
            regions: &regions,
            name: name as u32 + 1,
            level: SADDLE * peaks[name],
        };
        region.edged(cells, &smooth, cell_noise, &mut taken)
    });
    edged.collect()
}

/// Regions above a threshold, each around one peak and numbered from 1, with their peaks.
///
/// Cells are processed in descending order. If two regions meet, the lower one is a separate
/// contact if the saddle is below half of its peak.
fn regions(smooth: &Array2<f32>, threshold: f32) -> (Array2<u32>, Vec<f32>) {
    let (rows, columns) = smooth.dim();
    let mut cells: Vec<(f32, usize)> = smooth
        .iter()
        .enumerate()
        .filter(|(_, v)| **v > threshold)
        .map(|(at, v)| (*v, at))
        .collect();
    cells.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    // Peak, number of cells, and the region into which each was merged.
    let mut found: Vec<(f32, usize, usize)> = Vec::new();
    let mut owner = vec![0_usize; rows * columns];
    let mut beside: Vec<usize> = Vec::new();
    let root = |found: &[(f32, usize, usize)], mut name: usize| {
        while found[name].2 != name {
            name = found[name].2;
        }
        name
    };
    for (value, at) in cells {
        let (r, c) = (at / columns, at % columns);
        let near = (r.saturating_sub(1)..(r + 2).min(rows))
            .flat_map(|r| (c.saturating_sub(1)..(c + 2).min(columns)).map(move |c| (r, c)));
        beside.clear();
        for name in near.filter_map(|(r, c)| owner[r * columns + c].checked_sub(1)) {
            let name = root(&found, name);
            if !beside.contains(&name) {
                beside.push(name);
            }
        }
        beside.sort_by(|a, b| found[*b].0.total_cmp(&found[*a].0).then(a.cmp(b)));
        let Some((&main, others)) = beside.split_first() else {
            found.push((value, 1, found.len()));
            owner[at] = found.len();
            continue;
        };
        for &other in others {
            let (peak, count, _) = found[other];
            if value > SADDLE * peak || count < LEAST_CELLS {
                found[other].2 = main;
                found[main].1 += count;
            }
        }
        found[main].1 += 1;
        owner[at] = main + 1;
    }
    let mut names = vec![0; found.len()];
    let mut peaks = Vec::new();
    for (k, (peak, count, part)) in found.iter().enumerate() {
        if *part == k && *count >= LEAST_CELLS {
            peaks.push(*peak);
            names[k] = peaks.len() as u32;
        }
    }
    let owners = owner.iter().map(|name| match name.checked_sub(1) {
        Some(name) => names[root(&found, name)],
        None => 0,
    });
    let owners: Vec<u32> = owners.collect();
    let regions = Array2::from_shape_fn((rows, columns), |(r, c)| owners[r * columns + c]);
    (regions, peaks)
}

/// One region, with the level above which its core lies.
struct Region<'a> {
    regions: &'a Array2<u32>,
    name: u32,
    level: f32,
}

/// Means over the cells at each distance from the outline of the core. Distances inside are
/// negative.
struct Profile {
    distance: Vec<f64>,
    count: Vec<f64>,
    pressure: Vec<f64>,
    slope: Vec<f64>,
}

impl Region<'_> {
    fn edged(
        &self,
        cells: &Cells,
        smooth: &Array2<f32>,
        cell_noise: f64,
        taken: &mut Array2<bool>,
    ) -> Option<Patch> {
        let inside = |at: (usize, usize)| self.regions[at] == self.name && smooth[at] > self.level;
        let core = Array2::from_shape_fn(smooth.dim(), inside);
        let area = core.iter().filter(|inside| **inside).count() as f64;
        let around = BoundingBox::of_mask(core.view())?;
        let radius = (area / core::f64::consts::PI).sqrt();
        let reach = (0.7 * radius).ceil() as usize + 4;
        let around = around.grown(reach + 2, smooth.dim());
        let core = around.of(core.view());
        let distance = signed_distance(core);
        let regions = around.of(self.regions.view());
        let own = |at: (usize, usize)| regions[at] == 0 || regions[at] == self.name;
        let profile = Profile::of(
            &distance,
            own,
            [&cells.pressure, &cells.slopes[0], &cells.slopes[1]]
                .map(|field| around.of(field.view())),
            [0.6 * radius, reach as f64],
        );
        let (edge, error) = profile.edge(radius, cell_noise)?;
        // Steiner's formula for an outline moved outwards by `edge`.
        let perimeter = perimeter(core);
        let area = area + perimeter * edge + core::f64::consts::PI * edge * edge;
        if area > 1.0 {
            self.filled(&around, &distance, [4.0 * area, edge, error], taken)
        } else {
            None
        }
    }

    /// The pixels nearest to the core, in the number given by the area, and those at the edge.
    fn filled(
        &self,
        around: &BoundingBox,
        distance: &Array2<f32>,
        [area, edge, error]: [f64; 3],
        taken: &mut Array2<bool>,
    ) -> Option<Patch> {
        let (rows, columns) = distance.dim();
        // Distances of pixels are interpolated linearly between those of the cells.
        let split = |k: usize, n: usize| {
            let at = (0.5 * (k as f32 - 0.5)).clamp(0.0, (n - 1) as f32);
            let low = (at as usize).min(n.saturating_sub(2));
            (low, at - low as f32)
        };
        let mut near: Vec<(f32, [usize; 2])> = Vec::new();
        for row in 0..2 * rows {
            let (r, v) = split(row, rows);
            for column in 0..2 * columns {
                let (c, u) = split(column, columns);
                let at = |r: usize, c: usize| distance[[r.min(rows - 1), c.min(columns - 1)]];
                // Distances change by at most one cell from cell to cell.
                if f64::from(at(r, c)) > edge + 4.0 {
                    continue;
                }
                let above = (1.0 - u) * at(r, c) + u * at(r, c + 1);
                let below = (1.0 - u) * at(r + 1, c) + u * at(r + 1, c + 1);
                let value = (1.0 - v) * above + v * below;
                if f64::from(value) < edge + 2.0 {
                    let at = [2 * around.row_start + row, 2 * around.column_start + column];
                    near.push((value, at));
                }
            }
        }
        let count = (area.round() as usize).min(near.len());
        let nearer =
            |a: &(f32, [usize; 2]), b: &(f32, [usize; 2])| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        let mut order = near.clone();
        let last = *order
            .select_nth_unstable_by(count.checked_sub(1)?, nearer)
            .1;
        let rim = near.iter().filter(|(d, _)| (d - last.0).abs() < 0.4);
        let rim = rim.map(|(_, at)| *at).collect();
        let mut pixels = Vec::with_capacity(count);
        for pixel in near.iter().filter(|pixel| nearer(pixel, &last).is_le()) {
            if !core::mem::replace(&mut taken[pixel.1], true) {
                pixels.push(pixel.1);
            }
        }
        (!pixels.is_empty()).then(|| Patch {
            pixels,
            rim,
            area,
            radius: (area / core::f64::consts::PI).sqrt(),
            edge_error: 2.0 * error,
        })
    }
}

impl Profile {
    fn of(
        distance: &Array2<f32>,
        own: impl Fn((usize, usize)) -> bool,
        [pressure, p, q]: [ArrayView2<'_, f32>; 3],
        [inwards, outwards]: [f64; 2],
    ) -> Self {
        let low = inwards.ceil();
        let bins = (low + outwards.ceil()) as usize + 1;
        let mut sums = vec![[0.0; 4]; bins];
        for (at, d) in distance.indexed_iter() {
            let bin = (f64::from(*d) + low).round();
            let inside = bin >= 0.0 && own(at);
            if let Some(sums) = sums.get_mut(bin.max(0.0) as usize).filter(|_| inside) {
                let slope = (p[at] * p[at] + q[at] * q[at]).sqrt();
                let more = [1.0, pressure[at], slope, *d];
                sums.iter_mut()
                    .zip(more)
                    .for_each(|(s, v)| *s += f64::from(v));
            }
        }
        sums.retain(|sums| sums[0] > 0.0);
        let mean = |k: usize| sums.iter().map(|s| s[k] / s[0]).collect();
        Self {
            distance: mean(3),
            count: sums.iter().map(|sums| sums[0]).collect(),
            pressure: mean(1),
            slope: mean(2),
        }
    }

    /// Distance of the edge from the outline of the core, and its standard error. `None` if the
    /// pressure does not decrease outwards.
    fn edge(&self, radius: f64, noise: f64) -> Option<(f64, f64)> {
        let last = *self.distance.last()?;
        let fit = |edge: f64| self.root(radius + edge, edge);
        let coarse = (0..).map(|k| -1.0 + 0.25 * f64::from(k));
        let coarse = coarse.take_while(|edge| *edge < last);
        let best = coarse.min_by(|a, b| fit(*a).0.total_cmp(&fit(*b).0))?;
        // A parabola through three misfits around the smallest one.
        let step = 0.25;
        let [left, middle, right] = [best - step, best, best + step].map(|edge| fit(edge).0);
        let bend = left + right - 2.0 * middle;
        let shift = match bend > 0.0 {
            true => (0.5 * step * (left - right) / bend).clamp(-step, step),
            false => 0.0,
        };
        let edge = best + shift;
        let (misfit, height) = fit(edge);
        if height <= 0.0 || height.is_nan() {
            return None;
        }
        let bins = self.distance.len() as f64;
        let pixels: f64 = self.count.iter().sum();
        let excess = (misfit - 2.0 * bins * noise * noise).max(0.0) / pixels;
        // χ² increases by 1 at one standard error. Neighbouring cells share some of their noise.
        let curvature = bend / (step * step);
        let spread = match curvature > 0.0 {
            true => (2.0 * (misfit / bins).max(noise * noise) / curvature).sqrt(),
            false => 1.0,
        };
        if excess.sqrt() < ROOT_MISFIT * height {
            return Some((edge + ROOT_SHIFT, spread.hypot(EDGE_ERROR)));
        }
        let kink = self.kink()?;
        // The uncertainty between the two models adds a fraction of their distance.
        Some((kink, (0.25 * (kink - edge)).hypot(2.0 * EDGE_ERROR)))
    }

    /// Weighted misfit of c √(1 − (r/a)²), blurred, above a level, and the fitted c.
    fn root(&self, radius: f64, edge: f64) -> (f64, f64) {
        // Five-point Gauss–Hermite rule.
        const NODES: [(f64, f64); 5] = [
            (-2.856_97, 0.011_257),
            (-1.355_626, 0.222_076),
            (0.0, 0.533_333),
            (1.355_626, 0.222_076),
            (2.856_97, 0.011_257),
        ];
        let radius = radius.max(1.0);
        let height = |distance: f64| {
            let inwards = (edge - distance).min(radius);
            match inwards > 0.0 {
                true => (inwards * (2.0 * radius - inwards)).sqrt() / radius,
                false => 0.0,
            }
        };
        let mut sums = [0.0; 6];
        for ((distance, count), pressure) in
            self.distance.iter().zip(&self.count).zip(&self.pressure)
        {
            let model: f64 = NODES
                .iter()
                .map(|(node, weight)| weight * height(distance + BLUR * node))
                .sum();
            let more = [
                1.0,
                model,
                *pressure,
                model * model,
                model * pressure,
                pressure * pressure,
            ];
            sums.iter_mut()
                .zip(more)
                .for_each(|(sum, v)| *sum += count * v);
        }
        let [n, m, p, mm, mp, pp] = sums;
        let (spread, product) = (mm - m * m / n, mp - m * p / n);
        if spread <= 0.0 || spread.is_nan() {
            return (f64::INFINITY, 0.0);
        }
        let height = product / spread;
        (pp - p * p / n - height * product, height)
    }

    /// Position of the largest slope, or of a sudden fall by half.
    fn kink(&self) -> Option<f64> {
        let all = || self.slope.iter().enumerate();
        let (at, top) = all().max_by(|a, b| a.1.total_cmp(b.1))?;
        let far = self.distance.get(at + 3);
        let fallen = (at + 1..self.slope.len()).find(|k| self.slope[*k] < 0.5 * top);
        if let (Some(k), Some(far)) = (fallen, far)
            && self.distance[k] <= *far
        {
            let [high, low] = [self.slope[k - 1], self.slope[k]];
            let share = (high - 0.5 * top) / (high - low);
            return Some(self.distance[k - 1] + share * (self.distance[k] - self.distance[k - 1]));
        }
        let beside = |k: usize| self.slope.get(k).copied();
        let shift = match (at.checked_sub(1).and_then(beside), beside(at + 1)) {
            (Some(left), Some(right)) if left + right < 2.0 * top => {
                0.5 * (left - right) / (left + right - 2.0 * top)
            }
            _ => 0.0,
        };
        Some(self.distance[at] + shift + KINK_SHIFT)
    }
}

/// Length of a mask's outline in cells: the length along the sides of the cells, times π/4, which
/// is correct on average over all directions.
fn perimeter(mask: ArrayView2<'_, bool>) -> f64 {
    let (rows, columns) = mask.dim();
    let at = |r: usize, c: usize| r < rows && c < columns && mask[[r, c]];
    let mut sides = 0_usize;
    for ((r, c), inside) in mask.indexed_iter() {
        let other = [
            at(r, c + 1),
            at(r + 1, c),
            c > 0 && at(r, c - 1),
            r > 0 && at(r - 1, c),
        ];
        sides += usize::from(*inside) * other.iter().filter(|inside| !**inside).count();
    }
    core::f64::consts::FRAC_PI_4 * sides as f64
}

/// Distance of each cell from a mask's outline. Distances inside are negative.
fn signed_distance(mask: ArrayView2<'_, bool>) -> Array2<f32> {
    let [inside, outside] = [false, true].map(|to| distances(mask.mapv(|m| m == to)));
    Zip::from(&inside)
        .and(&outside)
        .map_collect(|inside, outside| {
            // The centre of a cell is half a side away from an adjacent outline.
            match *inside > 0.0 {
                true => 0.5 - inside.sqrt(),
                false => outside.sqrt() - 0.5,
            }
        })
}

/// Square of the distance to the nearest `true` (Felzenszwalb & Huttenlocher, Theory of Computing
/// 8, 415–428, 2012).
fn distances(targets: Array2<bool>) -> Array2<f32> {
    let far = 1e9_f32;
    let mut square = targets.mapv(|target| if target { 0.0 } else { far });
    for axis in [0, 1] {
        // Parabolas of the lower envelope, with the start of each.
        let (mut values, mut envelope): (Vec<f32>, Vec<(usize, f32)>) = Default::default();
        for mut lane in square.lanes_mut(ndarray::Axis(axis)) {
            values.clear();
            values.extend(&lane);
            envelope.clear();
            for (q, value) in values.iter().enumerate() {
                let meets = |p: usize| {
                    let squares = (q * q) as f32 - (p * p) as f32;
                    (value - values[p] + squares) / (2.0 * (q as f32 - p as f32))
                };
                while envelope.len() > 1
                    && envelope.last().is_some_and(|(p, from)| meets(*p) <= *from)
                {
                    envelope.pop();
                }
                let from = match envelope.last() {
                    Some((p, _)) => meets(*p),
                    None => f32::NEG_INFINITY,
                };
                envelope.push((q, from));
            }
            let mut k = 0;
            for (q, to) in lane.iter_mut().enumerate() {
                while envelope
                    .get(k + 1)
                    .is_some_and(|(_, from)| *from <= q as f32)
                {
                    k += 1;
                }
                let (p, _) = envelope[k];
                *to = (q as f32 - p as f32).powi(2) + values[p];
            }
        }
    }
    square
}
