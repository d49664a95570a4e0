//! Where something touches: the pixels over which the normals turn outwards.

use ndarray::{Array2, ArrayView2, Zip};

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
        let mean = Array2::from_shape_fn((high, wide), |(r, c)| {
            0.25 * (n[[2 * r, 2 * c]]
                + n[[2 * r, 2 * c + 1]]
                + n[[2 * r + 1, 2 * c]]
                + n[[2 * r + 1, 2 * c + 1]])
        });
        blurred(&mean, 1)
    };
    let [nx, ny] = [coarse(&normals[0]), coarse(&normals[1])];
    let divergence = Array2::from_shape_fn((high, wide), |(r, c)| {
        let (r, c) = (r.clamp(1, high - 2), c.clamp(1, wide - 2));
        0.5 * (nx[[r, c + 1]] - nx[[r, c - 1]] + ny[[r + 1, c]] - ny[[r - 1, c]])
    });
    let Some(threshold) = threshold(&divergence) else {
        return mask;
    };
    let above = divergence.mapv(|d| d > threshold);
    let opened = grown(&grown(&above, false), true);
    let Some(patches) = filled(&opened) else {
        return mask;
    };
    // A blur of the patches and half of it straighten the rim. A blur of deviation σ takes σ²/2a
    // off the radius a of a circle: with σ² of 8 px² a tenth of a pixel at 40 px.
    let smooth = blurred(&patches.mapv(|inside| f32::from(u8::from(inside))), 2);
    for ((row, column), inside) in mask.indexed_iter_mut() {
        *inside = between(&smooth, row, column) > 0.5;
    }
    mask
}

/// The value at a pixel of the frame, linear between the means over 2 × 2 pixels.
fn between(coarse: &Array2<f32>, row: usize, column: usize) -> f32 {
    let (rows, columns) = coarse.dim();
    let split = |k: usize, n: usize| {
        let at = (0.5 * (k as f32 - 0.5)).clamp(0.0, (n - 1) as f32);
        let low = (at as usize).min(n - 2);
        (low, at - low as f32)
    };
    let ((r, v), (c, u)) = (split(row, rows), split(column, columns));
    let along = |r: usize| (1.0 - u) * coarse[[r, c]] + u * coarse[[r, c + 1]];
    (1.0 - v) * along(r) + v * along(r + 1)
}

/// Blurs by (1, 4, 6, 4, 1)/16 along both axes, so many times. The border is continued.
fn blurred(image: &Array2<f32>, times: usize) -> Array2<f32> {
    let (rows, columns) = image.dim();
    let tap = |at: [f32; 5]| (at[0] + at[4] + 4.0 * (at[1] + at[3]) + 6.0 * at[2]) / 16.0;
    let near = |k: usize, n: usize| [0, 1, 2, 3, 4].map(|j| (k + j).saturating_sub(2).min(n - 1));
    let mut image = image.clone();
    for _ in 0..times {
        let mut across = Array2::zeros((rows, columns));
        for (from, mut to) in image.outer_iter().zip(across.outer_iter_mut()) {
            for (k, to) in to.iter_mut().enumerate() {
                *to = match k >= 2 && k + 2 < columns {
                    true => tap([0, 1, 2, 3, 4].map(|j| from[k + j - 2])),
                    false => tap(near(k, columns).map(|k| from[k])),
                };
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
    for sums in &mut below {
        all = [0, 1, 2].map(|k| all[k] + sums[k]);
        *sums = all;
    }
    let mut threshold = 0.5 * high;
    for _ in 0..50 {
        let free = below[bin(threshold)];
        let touched = [0, 1].map(|k| all[k] - free[k]);
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
    Array2::from_shape_fn(mask.dim(), |(r, c)| {
        let beside = [
            [r.wrapping_sub(1), c],
            [r + 1, c],
            [r, c.wrapping_sub(1)],
            [r, c + 1],
        ];
        let any = mask[[r, c]] == value
            || beside
                .iter()
                .any(|&at| mask.get(at).is_some_and(|&m| m == value));
        any == value
    })
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
    let large = patches.iter().filter(|patch| 10 * patch.len() >= largest);
    large.flatten().for_each(|&at| kept[at] = true);
    let (rows, columns) = mask.dim();
    let border = |&[r, c]: &[usize; 2]| r == 0 || c == 0 || r + 1 == rows || c + 1 == columns;
    let holes = parts(kept.view(), false);
    let inner = holes.iter().filter(|hole| !hole.iter().any(border));
    inner.flatten().for_each(|&at| kept[at] = true);
    Some(kept)
}

/// The parts of a mask of this `value` that are connected by their sides, as `[row, column]`.
pub fn parts(mask: ArrayView2<'_, bool>, value: bool) -> Vec<Vec<[usize; 2]>> {
    let mut open = mask.mapv(|m| m == value);
    let (rows, columns) = open.dim();
    let mut parts = Vec::new();
    for start in (0..rows * columns).map(|k| [k / columns, k % columns]) {
        if !core::mem::take(&mut open[start]) {
            continue;
        }
        let mut part = vec![start];
        let mut next = 0;
        while let Some(&[r, c]) = part.get(next) {
            next += 1;
            let (above, left) = (r.wrapping_sub(1), c.wrapping_sub(1));
            for beside in [[above, c], [r + 1, c], [r, left], [r, c + 1]] {
                if open.get_mut(beside).is_some_and(core::mem::take) {
                    part.push(beside);
                }
            }
        }
        parts.push(part);
    }
    parts
}
