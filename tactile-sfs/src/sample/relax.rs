//! Lloyd's relaxation on a thinned set of elements: points move to the middle of their cells.

use super::elements::Element;

/// Elements per point that the cells are measured with; more do not change the spacing visibly.
const PER_POINT: usize = 40;
const STEPS: usize = 4;

/// Evens out the spacing of `chosen`; every point stays an element, and no two become the same.
pub(super) fn relax(all: &[Element], chosen: &mut [Element], step: [f64; 2]) {
    let stride = ((all.len() as f64 / (PER_POINT * chosen.len()) as f64).sqrt() as usize).max(1);
    let thin: Vec<Element> =
        all.iter().filter(|e| e.row % stride == 0 && e.column % stride == 0).copied().collect();
    if thin.len() < 4 * chosen.len() {
        return;
    }
    let total: f64 = thin.len() as f64 * step[0] * step[1] * (stride * stride) as f64;
    let cell = 1.5 * (total / chosen.len() as f64).sqrt();
    let mut owner = vec![0; thin.len()];
    for _ in 0..STEPS {
        assign(&thin, chosen, cell, &mut owner);
        recentre(&thin, &owner, chosen);
    }
}

/// Nearest point of every element, searched in the buckets around it.
fn assign(thin: &[Element], chosen: &[Element], cell: f64, owner: &mut [usize]) {
    let bound = |axis: usize, pick: fn(f64, f64) -> f64, start: f64| {
        thin.iter().map(|e| e.position[axis]).fold(start, pick)
    };
    let low = [bound(0, f64::min, f64::INFINITY), bound(1, f64::min, f64::INFINITY)];
    let high = [bound(0, f64::max, f64::NEG_INFINITY), bound(1, f64::max, f64::NEG_INFINITY)];
    let size = [0, 1].map(|axis| ((high[axis] - low[axis]) / cell) as usize + 1);
    let bucket = |position: &[f64; 3]| {
        [0, 1].map(|axis| (((position[axis] - low[axis]) / cell).max(0.0) as usize).min(size[axis] - 1))
    };
    let mut buckets: Vec<Vec<usize>> = vec![Vec::new(); size[0] * size[1]];
    for (k, point) in chosen.iter().enumerate() {
        let [x, y] = bucket(&point.position);
        buckets[y * size[0] + x].push(k);
    }
    for (element, owner) in thin.iter().zip(owner) {
        let at = bucket(&element.position);
        let mut best = f64::INFINITY;
        // Distances in the plane bound those in space from below, so that rings beyond the best need no look.
        for ring in 0..size[0].max(size[1]) {
            if ring > 1 && ((ring - 1) as f64 * cell).powi(2) > best {
                break;
            }
            for (x, y) in ring_of(at, ring, size) {
                for &k in &buckets[y * size[0] + x] {
                    let distance = squared(&element.position, &chosen[k].position);
                    if distance < best {
                        (best, *owner) = (distance, k);
                    }
                }
            }
        }
    }
}

/// Buckets at Chebyshev distance `ring` (the first two rings at once: ring 0 gives nothing new after ring 1).
fn ring_of([x, y]: [usize; 2], ring: usize, [w, h]: [usize; 2]) -> impl Iterator<Item = (usize, usize)> {
    let (left, right) = (x.saturating_sub(ring), (x + ring).min(w - 1));
    let (top, bottom) = (y.saturating_sub(ring), (y + ring).min(h - 1));
    (top..=bottom)
        .flat_map(move |v| (left..=right).map(move |u| (u, v)))
        .filter(move |&(u, v)| u.abs_diff(x).max(v.abs_diff(y)) == ring)
}

/// Moves every point to the element nearest to the weighted centroid of its cell.
fn recentre(thin: &[Element], owner: &[usize], chosen: &mut [Element]) {
    let mut sums = vec![([0.0; 3], 0.0); chosen.len()];
    for (element, &k) in thin.iter().zip(owner) {
        for (sum, x) in sums[k].0.iter_mut().zip(element.position) {
            *sum += element.area * x;
        }
        sums[k].1 += element.area;
    }
    let mut best = vec![f64::INFINITY; chosen.len()];
    for (element, &k) in thin.iter().zip(owner) {
        let centre = sums[k].0.map(|sum| sum / sums[k].1);
        let distance = squared(&element.position, &centre);
        // A point only ever moves to an element of its own cell, so that no two meet.
        if distance < best[k] {
            (best[k], chosen[k]) = (distance, *element);
        }
    }
}

fn squared(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]) * (a[i] - b[i])).sum()
}
