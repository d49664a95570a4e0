//! Where something touches: the pixels over which the normals turn outwards.

use ndarray::{Array2, ArrayView2, Axis, Zip};

use tactile_core::BoundingBox;

/// Pixels of an object in contact.
///
/// The divergence of the normals is twice the mean curvature. An object's face bulges towards the
/// gel, while the free gel around it hangs from the rim with almost none. The divergence is taken
/// of means over 2 × 2 pixels, blurred. The threshold lies half way between the means of the two
/// classes (Ridler & Calvard, IEEE Trans. SMC 8, 630–632, 1978). Patches are opened, filled and
/// smoothed. All are `false` where the two classes are those of noise.
pub fn contact(normals: &[Array2<f32>; 2]) -> Array2<bool> {
    let (rows, columns) = normals[0].dim();
    let (high, wide) = (rows / 2, columns / 2);
    let mut mask = Array2::from_elem((rows, columns), false);
    if high < 8 || wide < 8 {
        return mask;
    }
    let coarse = |n: &Array2<f32>| {
        let mut mean = Array2::zeros((high, wide));
        let mut two = vec![0.0; columns];
        for (r, mut to) in mean.outer_iter_mut().enumerate() {
            let rows = n.row(2 * r).into_iter().zip(n.row(2 * r + 1));
            two.iter_mut()
                .zip(rows)
                .for_each(|(two, (a, b))| *two = a + b);
            let pairs = to.iter_mut().zip(two.chunks_exact(2));
            pairs.for_each(|(to, two)| *to = 0.25 * (two[0] + two[1]));
        }
        blurred(&mean, 1)
    };
    let [nx, ny] = [coarse(&normals[0]), coarse(&normals[1])];
    let mut divergence = Array2::zeros((high, wide));
    for (r, mut to) in divergence.outer_iter_mut().enumerate() {
        // The border has the values beside it.
        let r = r.clamp(1, high - 2);
        let x = nx.row(r).into_iter().zip(nx.row(r).into_iter().skip(2));
        let y = ny.row(r - 1).into_iter().zip(ny.row(r + 1)).skip(1);
        let inner = to.iter_mut().skip(1).zip(x.zip(y));
        inner.for_each(|(to, ((left, right), (above, below)))| {
            *to = 0.5 * (right - left + below - above);
        });
        (to[0], to[wide - 1]) = (to[1], to[wide - 2]);
    }
    let Some(threshold) = threshold(&divergence) else {
        return mask;
    };
    let above = divergence.mapv(|d| d > threshold);
    // Shrinking before growing removes specks of noise and keeps the size of patches.
    let opened = grown(&grown(&above, false), true);
    let Some(patches) = filled(&opened) else {
        return mask;
    };
    // A blur of the patches and half of it straighten the rim. A blur of deviation σ takes σ²/2a
    // off the radius a of a circle: with σ² of 8 px² a tenth of a pixel at 40 px.
    let smooth = blurred(&patches.mapv(|inside| f32::from(u8::from(inside))), 2);
    // Values of pixels are linear between those of the means over 2 × 2.
    let split = |k: usize, n: usize| {
        let at = (0.5 * (k as f32 - 0.5)).clamp(0.0, (n - 1) as f32);
        let low = (at as usize).min(n - 2);
        (low, at - low as f32)
    };
    let across: Vec<(usize, f32)> = (0..columns).map(|column| split(column, wide)).collect();
    let mut line = vec![0.0; wide];
    for (row, mut to) in mask.outer_iter_mut().enumerate() {
        let (r, v) = split(row, high);
        let ends = smooth.row(r).into_iter().zip(smooth.row(r + 1));
        for (line, (above, below)) in line.iter_mut().zip(ends) {
            *line = (1.0 - v) * above + v * below;
        }
        // Most rows do not meet the contact, and their interpolation is spared.
        if line.iter().any(|value| *value > 0.5) {
            for (inside, &(c, u)) in to.iter_mut().zip(&across) {
                *inside = (1.0 - u) * line[c] + u * line[c + 1] > 0.5;
            }
        }
    }
    mask
}

/// Blurs by (1, 4, 6, 4, 1)/16 along both axes, so many times. The border is continued.
fn blurred(image: &Array2<f32>, times: usize) -> Array2<f32> {
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

/// The threshold between free gel and contact, to a bin of a histogram. `None` where there is one
/// class alone.
fn threshold(divergence: &Array2<f32>) -> Option<f32> {
    const BINS: usize = 4096;
    let low = divergence.iter().copied().fold(f32::MAX, f32::min);
    // Contacts have positive divergence, so that the largest value is at least 0.
    let high = divergence.iter().copied().fold(0.0, f32::max);
    let scale = BINS as f32 / (high - low);
    if !(scale > 0.0 && scale.is_finite()) {
        return None;
    }
    let bin = |d: f32| (((d - low) * scale) as usize).min(BINS - 1);
    // Number, sum and sum of squares of the pixels up to every bin.
    let mut below = vec![[0.0_f64; 3]; BINS];
    for &divergence in divergence {
        let d = f64::from(divergence);
        let sums = below[bin(divergence)].iter_mut().zip([1.0, d, d * d]);
        sums.for_each(|(sum, d)| *sum += d);
    }
    let mut all = [0.0; 3];
    // Running sums give the moments of both classes at any threshold without another pass.
    for sums in &mut below {
        all = [0, 1, 2].map(|k| all[k] + sums[k]);
        *sums = all;
    }
    let mut threshold = 0.5 * high;
    for _ in 0..50 {
        let free = below[bin(threshold)];
        let touched = [0, 1].map(|k| all[k] - free[k]);
        // An empty class has no mean.
        if free[0] < 1.0 || touched[0] < 1.0 {
            return None;
        }
        let (below, above) = (free[1] / free[0], touched[1] / touched[0]);
        let next = (0.5 * (below + above)) as f32;
        if (next - threshold).abs() < 1e-4 * high {
            let sd = (free[2] / free[0] - below * below).max(0.0).sqrt();
            // The halves of one normal distribution are 2.6 deviations of the lower half apart.
            return (above - below > 4.0 * sd).then_some(next);
        }
        threshold = next;
    }
    None
}

/// Grows the pixels of this `value` by one in the four directions.
fn grown(mask: &Array2<bool>, value: bool) -> Array2<bool> {
    let mut grown = mask.clone();
    for axis in [Axis(0), Axis(1)] {
        let n = mask.len_of(axis);
        for (to, from) in [(0..n - 1, 1..n), (1..n, 0..n - 1)] {
            let from = mask.slice_axis(axis, from.into());
            let mut to = grown.slice_axis_mut(axis, to.into());
            to.zip_mut_with(&from, |to, from| {
                *to = if *from == value { value } else { *to }
            });
        }
    }
    grown
}

/// Patches of at least a tenth of the largest, with their holes. `None` without a patch of 25
/// pixels, below which noise makes them.
fn filled(mask: &Array2<bool>) -> Option<Array2<bool>> {
    let patches = parts(mask.view(), true);
    let largest = patches.iter().map(Vec::len).max()?;
    if largest < 25 {
        return None;
    }
    let mut kept = Array2::from_elem(mask.dim(), false);
    // Several objects may touch at once. What is far smaller than the largest is noise.
    let large = patches.iter().filter(|patch| 10 * patch.len() >= largest);
    large.flatten().for_each(|&at| kept[at] = true);
    // A part of the box around all patches that reaches its border is outside of them.
    let mut window = BoundingBox::of_mask(kept.view())?.of_mut(kept.view_mut());
    let (rows, columns) = window.dim();
    let border = |&[r, c]: &[usize; 2]| r == 0 || c == 0 || r + 1 == rows || c + 1 == columns;
    let holes = parts(window.view(), false);
    let inner = holes.iter().filter(|hole| !hole.iter().any(border));
    inner.flatten().for_each(|&at| window[at] = true);
    Some(kept)
}

/// The parts of a mask of this `value` that are connected by their sides, as `[row, column]`.
pub(crate) fn parts(mask: ArrayView2<'_, bool>, value: bool) -> Vec<Vec<[usize; 2]>> {
    let columns = mask.ncols();
    let mut open: Vec<bool> = mask.iter().map(|m| *m == value).collect();
    let mut parts = Vec::new();
    for start in 0..open.len() {
        if !core::mem::take(&mut open[start]) {
            continue;
        }
        let mut part = vec![[start / columns, start % columns]];
        let mut next = 0;
        while let Some(&[r, c]) = part.get(next) {
            next += 1;
            let at = r * columns + c;
            if c > 0 && core::mem::take(&mut open[at - 1]) {
                part.push([r, c - 1]);
            }
            if c + 1 < columns && core::mem::take(&mut open[at + 1]) {
                part.push([r, c + 1]);
            }
            if r > 0 && core::mem::take(&mut open[at - columns]) {
                part.push([r - 1, c]);
            }
            if open.get_mut(at + columns).is_some_and(core::mem::take) {
                part.push([r + 1, c]);
            }
        }
        parts.push(part);
    }
    parts
}
