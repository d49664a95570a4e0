//! Conjugate gradients on the complement of the affine functions, all outputs in step.

use core::ops::ControlFlow;

use super::{Iterative, Vectors};
use crate::{
    Kernel, Progress,
    equations::{Buffers, Solution},
    evaluate::{BLOCK, Sum},
    layout::HEAD,
    null_space::{MAX, NullSpace, dot, ratio},
    product::Subtract,
    progress::Watch,
    residual::{largest, relative},
    simd::dispatch,
    system::System,
};

/// Steps at most.
const STEPS: usize = 200;
/// Restarts from a recomputed residual, from which rounding has made the iterated one drift.
const STARTS: usize = 3;
/// Steps without the residual halving after which rounding is taken to allow no more.
const PATIENCE: usize = 25;
/// Kernels, in units of a block of places, between two calls that ask whether to go on: some seconds' worth.
const PAIRS: usize = (1 << 30) / BLOCK;

/// One run: its system and its stopping rule.
pub(crate) struct Run<'a, K, const D: usize> {
    pub(crate) kernel: &'a K,
    pub(crate) system: &'a System<D>,
    pub(crate) iterative: &'a Iterative<D>,
    /// Largest residual at a point, relative to the largest target, to stop at.
    pub(crate) tolerance: f64,
}

impl<K: Kernel, const D: usize> Run<'_, K, D> {
    /// Solves for the targets in `buffers`; weights come there. Stops early if `watch` returns `Break`.
    pub(crate) fn solve<const M: usize>(
        &self,
        buffers: &mut Buffers,
        watch: &mut Watch<'_>,
    ) -> Solution<M> {
        let (active, n) = (&self.system.active, self.system.active.len());
        let Buffers {
            targets,
            weights,
            vectors,
            ..
        } = buffers;
        let centres = targets.len() / M;
        let Vectors {
            target, solution, ..
        } = vectors;
        target.clear();
        (0..M).for_each(|m| {
            target.extend(active.iter().map(|&centre| targets[m * centres + centre]))
        });
        solution.clear();
        solution.resize(M * n, 0.0);
        let (mut answer, mut broken) = (Solution::new([[0.0; MAX]; M], 1.0), false);
        for start in 0..=STARTS {
            let (affine, residual) = self.residual::<M>(vectors);
            (answer.affine, answer.residual) = (affine, Some(residual));
            answer.converged = residual <= self.tolerance;
            let stopped =
                answer.converged || start == STARTS || broken || answer.iterations >= STEPS;
            if stopped {
                break;
            }
            broken = self.steps::<M>(vectors, &mut answer, watch).is_break();
        }
        weights.clear();
        weights.resize(M * centres, 0.0);
        for (m, column) in vectors.solution.chunks_exact(n).enumerate() {
            active
                .iter()
                .zip(column)
                .for_each(|(&centre, w)| weights[m * centres + centre] = *w);
        }
        answer
    }

    /// Iterates until the residual it carries along is small enough.
    fn steps<const M: usize>(
        &self,
        vectors: &mut Vectors,
        answer: &mut Solution<M>,
        watch: &mut Watch<'_>,
    ) -> ControlFlow<()> {
        vectors.direction.clear();
        vectors.direction.resize(vectors.residual.len(), 0.0);
        let (mut size, mut best) = ([0.0; M], (f64::INFINITY, answer.iterations));
        while answer.iterations < STEPS {
            let left = relative(largest(&vectors.residual), &vectors.target);
            let done = answer.iterations;
            watch(&Progress {
                done,
                total: STEPS,
                residual: Some(left),
            })?;
            if left < 0.5 * best.0 {
                best = (left, done);
            }
            if left <= 0.5 * self.tolerance || done >= best.1 + PATIENCE {
                break;
            }
            self.turn::<M>(vectors, &mut size);
            let mut still_wanted = || {
                watch(&Progress {
                    done,
                    total: STEPS,
                    residual: Some(left),
                })
            };
            self.advance::<M>(vectors, &size, &mut still_wanted)?;
            answer.iterations += 1;
        }
        ControlFlow::Continue(())
    }

    /// The next direction p ← M⁻¹r + βp; `size` is rᵀM⁻¹r of each output.
    fn turn<const M: usize>(&self, vectors: &mut Vectors, size: &mut [f64; M]) {
        let n = self.system.active.len();
        let Vectors {
            residual,
            preconditioned,
            direction,
            spare,
            column,
            ..
        } = vectors;
        preconditioned.resize(M * n, 0.0);
        self.iterative
            .preconditioner
            .apply::<M>(residual, preconditioned, n, spare);
        self.complement(preconditioned, column);
        let new = inner::<M>(residual, preconditioned);
        for m in 0..M {
            let (beta, part) = (ratio(new[m], size[m]), m * n..(m + 1) * n);
            let terms = direction[part.clone()]
                .iter_mut()
                .zip(&preconditioned[part]);
            terms.for_each(|(p, z)| *p = z + beta * *p);
        }
        *size = new;
    }

    /// The step along the direction that makes the energy least; none if `still_wanted` returns `Break` before it is known.
    fn advance<const M: usize>(
        &self,
        vectors: &mut Vectors,
        size: &[f64; M],
        still_wanted: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let n = self.system.active.len();
        let Vectors {
            residual,
            direction,
            product,
            solution,
            column,
            ..
        } = vectors;
        product.clear();
        product.resize(direction.len(), 0.0);
        self.subtract::<M>(direction, product, still_wanted)?;
        let curvature = inner::<M>(direction, product);
        for m in 0..M {
            // The product comes with its sign turned.
            let alpha = ratio(size[m], -curvature[m]);
            for i in m * n..(m + 1) * n {
                solution[i] += alpha * direction[i];
                residual[i] += alpha * product[i];
            }
        }
        self.complement(residual, column);
        ControlFlow::Continue(())
    }

    /// r ← r − (K + λW⁻¹) w; unfinished if `still_wanted`, asked between runs of [`PAIRS`], returns `Break`.
    fn subtract<const M: usize>(
        &self,
        w: &[f64],
        r: &mut [f64],
        still_wanted: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let (n, places) = (self.system.active.len(), self.iterative.axes());
        let weights = core::array::from_fn(|m| &w[m * n..(m + 1) * n]);
        // Whole blocks, so that the sums are the same however often it is asked.
        let run = (PAIRS / n.max(1)).max(1) * BLOCK;
        for start in (0..n).step_by(run) {
            if start > 0 {
                still_wanted()?;
            }
            let sum = Sum::<_, _, D, M> {
                kernel: self.kernel,
                centres: places,
                weights,
            };
            dispatch(Subtract {
                sum,
                places,
                range: start..n.min(start + run),
                residuals: r,
            });
        }
        if !self.iterative.diagonal.is_empty() {
            for (r, w) in r.chunks_exact_mut(n).zip(w.chunks_exact(n)) {
                r.iter_mut()
                    .zip(w)
                    .zip(&self.iterative.diagonal)
                    .for_each(|((r, w), d)| *r -= d * w);
            }
        }
        ControlFlow::Continue(())
    }

    /// Forms the residual anew: y − (K + λW⁻¹)w − P a with the a that makes it least, and its largest entry relative to the
    /// largest target.
    fn residual<const M: usize>(&self, vectors: &mut Vectors) -> ([[f64; MAX]; M], f64) {
        let Vectors {
            residual,
            solution,
            target,
            column,
            ..
        } = vectors;
        self.complement(solution, column);
        residual.clone_from(target);
        // To the end: the affine part of what is returned comes from it.
        let _ = self.subtract::<M>(solution, residual, &mut || ControlFlow::Continue(()));
        let null = &self.system.null;
        let mut affine = [[0.0; MAX]; M];
        for (affine, values) in affine.iter_mut().zip(residual.chunks_exact_mut(null.n)) {
            let head = without_head(null, values, column);
            *affine = null.solve_upper(&head);
        }
        (affine, relative(largest(residual), target))
    }

    /// Removes from each column what affine functions there are in it.
    fn complement(&self, values: &mut [f64], column: &mut Vec<f64>) {
        for values in values.chunks_exact_mut(self.system.null.n) {
            without_head(&self.system.null, values, column);
        }
    }
}

/// Inner products of the columns.
fn inner<const M: usize>(a: &[f64], b: &[f64]) -> [f64; M] {
    let n = a.len() / M;
    core::array::from_fn(|m| dot(&a[m * n..(m + 1) * n], &b[m * n..(m + 1) * n]))
}

/// x ← Q₂Q₂ᵀx; returns Q₁ᵀx.
fn without_head(null: &NullSpace, values: &mut [f64], column: &mut Vec<f64>) -> [f64; MAX] {
    column.clear();
    column.resize(null.stride, 0.0);
    column[null.rows()].copy_from_slice(values);
    null.apply_transpose(column);
    let mut head = [0.0; MAX];
    head[..null.q].copy_from_slice(&column[HEAD - null.q..HEAD]);
    column[HEAD - null.q..HEAD].fill(0.0);
    null.apply(column);
    values.copy_from_slice(&column[null.rows()]);
    head
}
