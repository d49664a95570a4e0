//! Farthest-point order: from coarse to fine, every point the farthest from those before it.

use core::ops::ControlFlow;

use crate::{
    real::Lane,
    simd::{Job, dispatch},
};

/// Orders the points by farthest-point sampling from the one nearest to the origin; O(n²) time.
///
/// `distances` receives the squared distance of each, in the new order, to the nearest before it (infinite for the first). Stops if
/// `watch`, which hears how many points are ordered, returns `Break`.
pub(crate) fn coarse_to_fine<const D: usize>(
    axes: [&[f64]; D],
    near: &mut Vec<f64>,
    order: &mut Vec<usize>,
    distances: &mut Vec<f64>,
    watch: &mut dyn FnMut(usize) -> ControlFlow<()>,
) -> ControlFlow<()> {
    let n = axes[0].len();
    near.clear();
    near.resize(n, f64::INFINITY);
    order.clear();
    distances.clear();
    let norm = |i: usize| axes.iter().map(|axis| axis[i] * axis[i]).sum::<f64>();
    let mut next = (0..n).min_by(|&i, &j| norm(i).total_cmp(&norm(j)));
    while let Some(i) = next.filter(|_| order.len() < n) {
        if order.len().is_multiple_of(64) {
            watch(order.len())?;
        }
        order.push(i);
        distances.push(near[i]);
        let farthest = dispatch(Approach {
            axes,
            from: axes.map(|axis| axis[i]),
            near,
        });
        // A point taken is nowhere near the farthest any more.
        near[i] = -1.0;
        next = near
            .iter()
            .position(|&d| d == farthest)
            .or_else(|| near.iter().position(|&d| d >= 0.0));
    }
    ControlFlow::Continue(())
}

/// Lowers every distance to that from one more point; returns the largest.
struct Approach<'a, const D: usize> {
    axes: [&'a [f64]; D],
    from: [f64; D],
    near: &'a mut [f64],
}

impl<const D: usize> Job<f64> for Approach<'_, D> {
    type Output = f64;

    #[inline(always)]
    fn run<L: Lane<f64>>(self) -> f64 {
        let n = self.near.len();
        let axes = self.axes.map(|axis| &axis[..n]);
        for i in 0..n {
            let s = squared::<L, D>(axes, i, self.from);
            self.near[i] = if s < self.near[i] { s } else { self.near[i] };
        }
        let mut largest = [-1.0; 8];
        let chunks = self.near.chunks_exact(8);
        let rest = chunks.remainder();
        for chunk in chunks {
            (0..8).for_each(|l| {
                largest[l] = if chunk[l] > largest[l] {
                    chunk[l]
                } else {
                    largest[l]
                }
            });
        }
        rest.iter()
            .chain(&largest)
            .fold(-1.0, |m, &d| f64::max(m, d))
    }
}

#[inline(always)]
fn squared<L: Lane<f64>, const D: usize>(axes: [&[f64]; D], i: usize, from: [f64; D]) -> f64 {
    let d: [L; D] = core::array::from_fn(|k| L::new(axes[k][i]) - L::new(from[k]));
    d.iter()
        .fold(L::from_f64(0.0), |s, d| d.mul_add(*d, s))
        .get()
}

/// Squared distances of the first points from a place.
struct Distances<'a, const D: usize> {
    axes: [&'a [f64]; D],
    from: [f64; D],
    distances: &'a mut [f64],
}

impl<const D: usize> Job<f64> for Distances<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lane<f64>>(self) {
        let n = self.distances.len();
        let axes = self.axes.map(|axis| &axis[..n]);
        for (i, distance) in self.distances.iter_mut().enumerate() {
            *distance = squared::<L, D>(axes, i, self.from);
        }
    }
}

/// Finds, point by point in the order from coarse to fine, the nearest of the earlier ones.
#[derive(Default)]
pub(crate) struct Nearest {
    distances: Vec<f64>,
    candidates: Vec<(f64, usize)>,
    /// Squared radius searched first, in units of the point's own distance to the earlier ones.
    reach: f64,
}

impl Nearest {
    /// The `count` nearest to point `i` among the points before it, in rising order of place; `spacing` is its squared
    /// distance to the nearest.
    pub(crate) fn find<const D: usize>(
        &mut self,
        axes: [&[f64]; D],
        i: usize,
        spacing: f64,
        count: usize,
        found: &mut Vec<usize>,
    ) {
        self.distances.resize(i, 0.0);
        dispatch(Distances {
            axes,
            from: axes.map(|axis| axis[i]),
            distances: &mut self.distances,
        });
        self.gather(spacing, count.min(i));
        if self.candidates.len() > count {
            self.candidates
                .select_nth_unstable_by(count, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            self.candidates.truncate(count);
        }
        found.clear();
        found.extend(self.candidates.iter().map(|c| c.1));
        found.sort_unstable();
    }

    /// Makes the points within a distance candidates that leaves at least `count` of them.
    fn gather(&mut self, spacing: f64, count: usize) {
        let mut reach = f64::max(self.reach, 1.0);
        loop {
            let within = self
                .distances
                .iter()
                .copied()
                .enumerate()
                .filter(|&(_, d)| d <= reach * spacing);
            self.candidates.clear();
            self.candidates.extend(within.map(|(j, d)| (d, j)));
            if self.candidates.len() >= count || reach > 1e300 {
                break;
            }
            reach *= 1.5;
        }
        // Slowly down again, so that one point in a corner does not set the pace for all.
        self.reach = 0.98 * reach;
    }
}
