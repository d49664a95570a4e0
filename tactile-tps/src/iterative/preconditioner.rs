//! A sparse inverse Cholesky factor of the kernel matrix on the complement of the affine functions.
//!
//! Points are ordered from coarse to fine. What point i adds to those before it is its error of prediction from them, the
//! function cᵢ(y) = yᵢ − f(xᵢ) with f the spline through the earlier points; such errors are uncorrelated in the kernel's
//! product, wᵢᵀA wⱼ = δᵢⱼ after scaling, so that A⁻¹ = Σ wᵢ wᵢᵀ on the complement. Here f goes through the nearest
//! earlier points only (Vecchia 1988; Schäfer, Katzfuss & Owhadi 2021): the weights of the spline with value one at xᵢ and
//! zero at its neighbours are wᵢ √wᵢᵢ. All of them satisfy the side conditions, which conditionally definite kernels need.

use core::ops::ControlFlow;

use super::ordering::Nearest;
use crate::{
    Kernel,
    centres::Centres,
    system::{Setting, System},
};

/// Earlier points that a point is predicted from: with more the set-up costs more, with fewer there are more steps.
const NEIGHBOURS: usize = 64;
/// Points of the coarsest level, which are solved for exactly.
const COARSE: usize = 512;

/// Σ wᵢ wᵢᵀ over the points in their order from coarse to fine.
#[derive(Clone, Debug, Default)]
pub(crate) struct Preconditioner<const D: usize> {
    /// The first points, factored.
    coarse: System<D>,
    coarse_points: usize,
    /// Of each later point: itself and its neighbours,
    places: Vec<u32>,
    /// and their weights.
    weights: Vec<f64>,
    row: usize,
}

/// The points in order and what stands on the diagonal.
pub(crate) struct Ordered<'a, K, const D: usize> {
    pub(crate) kernel: &'a K,
    pub(crate) centres: &'a Centres<D>,
    /// Centre of each point.
    pub(crate) order: &'a [usize],
    pub(crate) axes: [&'a [f64]; D],
    /// Squared distance to the nearest before it.
    pub(crate) spacing: &'a [f64],
    /// Weights of the points, empty if all are one.
    pub(crate) weights: &'a [f64],
    pub(crate) lambda: f64,
}

impl<K: Kernel, const D: usize> Ordered<'_, K, D> {
    /// Factors the system of the points at these places; `false` if rounding leaves it indefinite.
    fn factor(
        &self,
        places: &[usize],
        local: &mut Centres<D>,
        weights: &mut Vec<f64>,
        system: &mut System<D>,
    ) -> bool {
        self.centres
            .select(places.iter().map(|&i| self.order[i]), local);
        weights.clear();
        if !self.weights.is_empty() {
            weights.extend(places.iter().map(|&i| self.weights[i]));
        }
        let setting = Setting {
            kernel: self.kernel,
            centres: local,
            rank_tolerance: 0.0,
        };
        system.factor(&setting, weights, self.lambda).is_ok() && !system.indefinite
    }
}

/// Splines of value one at the last of a few points and zero at the others, one after the other.
struct Cardinal<'a, K, const D: usize> {
    points: &'a Ordered<'a, K, D>,
    local: Centres<D>,
    local_weights: Vec<f64>,
    system: System<D>,
    unit: Vec<f64>,
    work: Vec<f64>,
}

impl<'a, K: Kernel, const D: usize> Cardinal<'a, K, D> {
    fn new(points: &'a Ordered<'a, K, D>) -> Self {
        let (local, system) = (points.centres.clone(), System::default());
        Self {
            points,
            local,
            local_weights: Vec::new(),
            system,
            unit: Vec::new(),
            work: Vec::new(),
        }
    }

    /// The weights of the spline of the points at these places; the unit vector itself where there is none.
    fn weights(&mut self, places: &[usize]) -> &[f64] {
        let Self {
            points,
            local,
            local_weights,
            system,
            unit,
            work,
        } = self;
        unit.clear();
        unit.resize(places.len(), 0.0);
        unit[places.len() - 1] = 1.0;
        if points.factor(places, local, local_weights, system) {
            system.solve::<1>(unit, places.len(), 0.0, work, &mut Vec::new());
        }
        unit
    }
}

impl<const D: usize> Preconditioner<D> {
    /// Builds the factor; O(n m³ + n²) for m neighbours. Stops if `watch`, which hears how many points are done, returns `Break`.
    pub(crate) fn build<K: Kernel>(
        &mut self,
        points: &Ordered<'_, K, D>,
        watch: &mut dyn FnMut(usize) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let n = points.order.len();
        self.coarse_points = n.min(COARSE);
        let first: Vec<usize> = (0..self.coarse_points).collect();
        if !points.factor(
            &first,
            &mut points.centres.clone(),
            &mut Vec::new(),
            &mut self.coarse,
        ) {
            self.coarse_points = 0;
        }
        self.row = NEIGHBOURS + 1;
        self.places.clear();
        self.weights.clear();
        let (mut cardinal, mut nearest, mut places) =
            (Cardinal::new(points), Nearest::default(), Vec::new());
        for i in self.coarse_points.max(D + 2)..n {
            if i % 64 == 0 {
                watch(i)?;
            }
            nearest.find(points.axes, i, points.spacing[i], NEIGHBOURS, &mut places);
            places.push(i);
            self.push(&places, cardinal.weights(&places));
        }
        ControlFlow::Continue(())
    }

    /// Takes over the weights of a cardinal spline, scaled to unit energy.
    fn push(&mut self, places: &[usize], unit: &[f64]) {
        let own = unit[unit.len() - 1];
        let scale = if own > 0.0 && own.is_finite() {
            1.0 / own.sqrt()
        } else {
            0.0
        };
        self.places.extend(places.iter().map(|&i| i as u32));
        self.weights.extend(unit.iter().map(|w| w * scale));
        let padding = self.row - places.len();
        self.places
            .extend(core::iter::repeat_n(places[0] as u32, padding));
        self.weights.extend(core::iter::repeat_n(0.0, padding));
    }

    /// z = Σ wᵢ wᵢᵀ r for `M` columns of `n` places.
    pub(crate) fn apply<const M: usize>(
        &self,
        r: &[f64],
        z: &mut [f64],
        n: usize,
        spare: &mut [Vec<f64>; 2],
    ) {
        z.fill(0.0);
        for (places, weights) in self
            .places
            .chunks_exact(self.row)
            .zip(self.weights.chunks_exact(self.row))
        {
            for m in 0..M {
                let (r, z) = (&r[m * n..(m + 1) * n], &mut z[m * n..(m + 1) * n]);
                let product: f64 = places
                    .iter()
                    .zip(weights)
                    .map(|(&i, w)| w * r[i as usize])
                    .sum();
                places
                    .iter()
                    .zip(weights)
                    .for_each(|(&i, w)| z[i as usize] += product * w);
            }
        }
        let (count, [values, work]) = (self.coarse_points, spare);
        values.clear();
        (0..M).for_each(|m| values.extend_from_slice(&r[m * n..m * n + count]));
        if count > 0 {
            self.coarse
                .solve::<M>(values, count, 0.0, work, &mut Vec::new());
        }
        for (m, values) in values.chunks_exact(count.max(1)).enumerate() {
            z[m * n..m * n + count]
                .iter_mut()
                .zip(values)
                .for_each(|(z, v)| *z += v);
        }
    }
}
