//! How a spline follows its targets: the linear map from them to its value or Jacobian at a point.
//!
//! The value is f(x) = k(x)ᵀw + p(x)ᵀa with (w, a) from the symmetric system S(w, a) = (y, 0), so that f(x) = α(x)ᵀy for
//! the first part of S(α, β) = (k(x), p(x)): one solve, whatever the targets. Derivatives of k and p give those of f.

use nalgebra::{Point, SVector};

use crate::{
    Factorization, Kernel, Scalar, Smoothing, TpsError, Workspace,
    column::{Column, Fill},
    equations::Buffers,
    simd::dispatch,
    warp::same_length,
};

/// Points whose values are solved for together.
const GROUP: usize = 4;

impl<T: Scalar, const D: usize, K: Kernel> Factorization<T, D, K> {
    /// How much the spline's value at each point follows each target, into the caller's memory: aⱼ in f(x) = Σⱼ aⱼ yⱼ, row by row, `n`
    /// entries (one per source point) a point. Allocates nothing once the workspace has grown.
    ///
    /// The same for every output and all targets, with the weights and λ of the factorisation. Σ aⱼ = 1, and Σ aⱼ xⱼ = x
    /// where the points span space. Targets with covariances Cⱼ give f(x) the covariance Σ aⱼ² Cⱼ. O(n²) a point.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_tps::{Factorization, FitOptions, Workspace};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
    /// let factorization = Factorization::<f64, 2>::new(&sources, &FitOptions::default())?;
    /// let queries = [Point2::new(0.5, 0.5), sources[1]];
    /// let mut influence = [0.0; 2 * 5];
    /// factorization.influence_into(&mut Workspace::default(), &queries, &mut influence)?;
    /// let standard_error = 0.01 * influence[..5].iter().map(|a| a * a).sum::<f64>().sqrt();
    /// assert!((influence[..5].iter().sum::<f64>() - 1.0).abs() < 1e-14 && standard_error < 0.01);
    /// // At a source point the spline follows its target alone.
    /// assert!((influence[5 + 1] - 1.0).abs() < 1e-14 && influence[5 + 2].abs() < 1e-14);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`TpsError::DependsOnTargets`] if λ is left to cross-validation, [`TpsError::NoFactor`] if the solver is iterative,
    /// [`TpsError::NotDefinite`] if the points are so close to degenerate that plain arithmetic has no factor,
    /// [`TpsError::Length`] if `influence` is not of that length.
    pub fn influence_into(
        &self,
        workspace: &mut Workspace<D>,
        points: &[Point<T, D>],
        influence: &mut [T],
    ) -> Result<(), TpsError> {
        self.linear(points.len(), influence.len())?;
        let whole = points.len() / GROUP * GROUP;
        let (grouped, single) = influence.split_at_mut(whole * self.len());
        for (points, rows) in points
            .chunks_exact(GROUP)
            .zip(grouped.chunks_exact_mut(GROUP * self.len()))
        {
            let columns = core::array::from_fn(|r| Column::value(self, &points[r]));
            self.follow::<GROUP>(&columns, &mut workspace.buffers, |r, i, a| {
                rows[r * self.len() + i] = a
            });
        }
        for (point, row) in points[whole..]
            .iter()
            .zip(single.chunks_exact_mut(self.len()))
        {
            self.follow(
                &[Column::value(self, point)],
                &mut workspace.buffers,
                |_, i, a| row[i] = a,
            );
        }
        Ok(())
    }

    /// How much the Jacobian at each point follows each target, into the caller's memory: bⱼ in J(x) = Σⱼ yⱼ bⱼᵀ, row by row, `n`
    /// entries (one per source point) a point. Allocates nothing once the workspace has grown.
    ///
    /// ```
    /// use nalgebra::{Matrix2, Point2, Vector2};
    /// use tactile_tps::{Factorization, FitOptions, Workspace};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
    /// let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let (factorization, x) = (Factorization::<f64, 2>::new(&sources, &FitOptions::default())?, Point2::new(0.5, 0.5));
    /// let mut influence = [Vector2::zeros(); 5];
    /// factorization.jacobian_influence_into(&mut Workspace::default(), &[x], &mut influence)?;
    /// let sum = targets.iter().zip(&influence).fold(Matrix2::zeros(), |j, (y, b)| j + y.coords * b.transpose());
    /// assert!((factorization.fit(&targets)?.jacobian(&x) - sum).norm() < 1e-14);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// As [`influence_into`](Self::influence_into).
    pub fn jacobian_influence_into(
        &self,
        workspace: &mut Workspace<D>,
        points: &[Point<T, D>],
        influence: &mut [SVector<T, D>],
    ) -> Result<(), TpsError> {
        self.linear(points.len(), influence.len())?;
        for (point, row) in points.iter().zip(influence.chunks_exact_mut(self.len())) {
            let columns: [Column<D>; D] = core::array::from_fn(|k| Column::slope(self, point, k));
            self.follow(&columns, &mut workspace.buffers, |k, i, b| row[i][k] = b);
        }
        Ok(())
    }

    /// Whether there is a linear map, and memory for it at so many points.
    fn linear(&self, points: usize, found: usize) -> Result<(), TpsError> {
        same_length(points * self.len(), found)?;
        match self.smoothing {
            Smoothing::Gcv => Err(TpsError::DependsOnTargets),
            _ if self.iterative.is_some() => Err(TpsError::NoFactor),
            _ if self.system.indefinite => Err(TpsError::NotDefinite {
                column: self.system.null.q,
            }),
            _ => Ok(()),
        }
    }

    /// Solves for the influence of every source point on each column, and hands each to `sink`.
    fn follow<const R: usize>(
        &self,
        columns: &[Column<D>; R],
        buffers: &mut Buffers,
        mut sink: impl FnMut(usize, usize, T),
    ) {
        let n = self.centres.len();
        let Buffers { targets, work, .. } = buffers;
        targets.clear();
        targets.resize(R * n, 0.0);
        for (column, terms) in columns.iter().zip(targets.chunks_exact_mut(n)) {
            let axes = core::array::from_fn(|k| &self.centres.axes[k][..]);
            dispatch(Fill {
                kernel: &self.kernel,
                axes,
                column,
                terms,
            });
        }
        self.system
            .solve_adjoint(targets, n, columns.each_ref().map(|c| &c.affine), work);
        for (r, found) in targets.chunks_exact(n).enumerate() {
            for i in 0..self.len() {
                sink(
                    r,
                    i,
                    T::narrow(found[self.centres.centre(i)] * self.share(i) / columns[r].unit),
                );
            }
        }
    }

    /// The part of an input point in the target of its centre.
    fn share(&self, i: usize) -> f64 {
        if self.centres.centre_of.is_empty() {
            return 1.0;
        }
        let total = self.centre_weights[self.centres.centre(i)];
        let weight = self.weights.as_ref().map_or(1.0, |w| w[i].widen());
        if total > 0.0 { weight / total } else { 0.0 }
    }
}
