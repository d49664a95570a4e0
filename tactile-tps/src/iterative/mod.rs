//! Matrix-free solution for thousands of points: preconditioned conjugate gradients.
//!
//! The dense factor takes n³/3 operations and 8n² bytes. Here a step takes one sum over all pairs, n² kernels and no memory,
//! and the preconditioner keeps the steps few whatever n. On the complement of the affine functions the matrix is definite,
//! so conjugate gradients stay there: every direction satisfies the side conditions.

mod gradients;
mod ordering;
mod preconditioner;

use core::ops::ControlFlow;

use crate::{
    Kernel, Progress,
    centres::Centres,
    progress::Watch,
    system::{Setting, System},
};
pub(crate) use gradients::Run;
use preconditioner::{Ordered, Preconditioner};

/// Memory of an iterative solve.
#[derive(Clone, Debug, Default)]
pub(crate) struct Vectors {
    residual: Vec<f64>,
    preconditioned: Vec<f64>,
    direction: Vec<f64>,
    product: Vec<f64>,
    solution: Vec<f64>,
    target: Vec<f64>,
    column: Vec<f64>,
    spare: [Vec<f64>; 2],
}

/// Points from coarse to fine with their preconditioner.
#[derive(Clone, Debug, Default)]
pub(crate) struct Iterative<const D: usize> {
    /// Coordinates of the active centres in order, axis by axis.
    axes: Vec<Vec<f64>>,
    /// λ/weight of each, empty without λ.
    diagonal: Vec<f64>,
    preconditioner: Preconditioner<D>,
}

impl<const D: usize> Iterative<D> {
    /// Orders the points that `system` outlines, which it reorders, and builds the preconditioner: O(n²) time, O(n) memory.
    pub(crate) fn build<K: Kernel>(
        &mut self,
        setting: &Setting<'_, K, D>,
        weights: &[f64],
        lambda: f64,
        system: &mut System<D>,
        watch: &mut Watch<'_>,
    ) -> ControlFlow<()> {
        system.choose(setting.centres.len(), weights, false);
        // Every point is ordered first, and then given its weights.
        let n = system.active.len();
        let mut tell = |done| {
            watch(&Progress {
                done,
                total: 2 * n,
                residual: None,
            })
        };
        let spacing = self.arrange(setting.centres, system, &mut tell)?;
        system.outline(setting);
        let weights: Vec<f64> = system
            .active
            .iter()
            .filter_map(|&i| weights.get(i).copied())
            .collect();
        self.diagonal.clear();
        if lambda > 0.0 {
            let inverse = |i: usize| lambda / weights.get(i).copied().unwrap_or(1.0);
            self.diagonal.extend((0..system.active.len()).map(inverse));
        }
        let ordered = Ordered {
            kernel: setting.kernel,
            centres: setting.centres,
            order: &system.active,
            axes: core::array::from_fn(|k| &self.axes[k][..]),
            spacing: &spacing,
            weights: if lambda > 0.0 { &weights } else { &[] },
            lambda,
        };
        (self.preconditioner).build(&ordered, &mut |weighted| tell(n + weighted))
    }

    /// Orders the active points from coarse to fine; gives the squared distance of each to the nearest before it.
    fn arrange(
        &mut self,
        centres: &Centres<D>,
        system: &mut System<D>,
        watch: &mut dyn FnMut(usize) -> ControlFlow<()>,
    ) -> ControlFlow<(), Vec<f64>> {
        let gathered = |order: &[usize]| -> Vec<Vec<f64>> {
            centres
                .axes
                .iter()
                .map(|axis| order.iter().map(|&i| axis[i]).collect())
                .collect()
        };
        self.axes = gathered(&system.active);
        let (mut near, mut order, mut spacing) = (Vec::new(), Vec::new(), Vec::new());
        ordering::coarse_to_fine(self.axes(), &mut near, &mut order, &mut spacing, watch)?;
        order.iter_mut().for_each(|i| *i = system.active[*i]);
        self.axes = gathered(&order);
        system.active = order;
        ControlFlow::Continue(spacing)
    }

    fn axes(&self) -> [&[f64]; D] {
        core::array::from_fn(|k| &self.axes[k][..])
    }
}
