//! The splines of several λ through the same pairs.

use nalgebra::Point;

use super::{buffers::Buffers, factorization::Factorization, system::System, triangle::Triangle};
use crate::{
    FitOptions, Kernel, R2LogR, Smoothing, TpsError,
    error::validate_smoothing,
    lanes::{Job, Lane, dispatch, squared_distance},
    span::Coefficients,
};

/// The splines through the same pairs for several λ, as cross-validation over left-out points needs
/// them.
///
/// The matrix is assembled once for all λ and factored for each. The values at a point share its
/// kernels.
/// A fit takes O(n³/3) a λ, a point O(n) a λ.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_tps::{FitOptions, LambdaPath, R2LogR, Smoothing, ThinPlateSpline};
/// # fn main() -> Result<(), tactile_tps::TpsError> {
/// let point = |i: u32| Point2::new(f64::from(i % 5), f64::from(i * i % 7) + 0.1 * f64::from(i));
/// let sources: Vec<_> = (0..20).map(point).collect();
/// let targets: Vec<_> = sources.iter().map(|p| Point2::new(p.x.sin(), p.y)).collect();
/// let options = FitOptions::new(R2LogR);
/// let place = Point2::new(1.5, 2.5);
/// let mut path = LambdaPath::fit(&sources, &targets, &options, &[0.1, 10.0])?;
/// let stiff = options.with_smoothing(Smoothing::Lambda(10.0))?;
/// let stiff = ThinPlateSpline::fit(&sources, &targets, &stiff)?;
/// assert!((path.values(&place)[1] - stiff.apply(&place)).norm() < 1e-12);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct LambdaPath<const D: usize, const M: usize, K = R2LogR> {
    /// Centres and options, without a factor.
    points: Factorization<D, K>,
    system: System<D>,
    /// The system with λ added, factored.
    factor: Triangle,
    buffers: Buffers,
    origin: [f64; M],
    /// Of all splines side by side, centre by centre: column l M + m is output m of the l-th λ.
    weights: Vec<f64>,
    affine: Vec<[Coefficients; M]>,
    kernels: Vec<f64>,
    sums: Vec<f64>,
    values: Vec<Point<f64, M>>,
}

/// Columns of weights that are summed at once, in registers. Rows are padded to a multiple.
const TOGETHER: usize = 8;

impl<const D: usize, const M: usize, K: Kernel> LambdaPath<D, M, K> {
    /// The splines of [`Spline::fit`](crate::Spline::fit) with [`Smoothing::Lambda`] of each of the
    /// `lambdas`, to rounding.
    ///
    /// # Errors
    /// Those of [`Spline::fit`](crate::Spline::fit), and [`TpsError::Lambda`] for a λ that is not
    /// positive and finite.
    pub fn fit(
        sources: &[Point<f64, D>],
        targets: &[Point<f64, M>],
        options: &FitOptions<K>,
        lambdas: &[f64],
    ) -> Result<Self, TpsError> {
        let empty = Self {
            points: Factorization::without_points(options.kernel.clone()),
            system: System::default(),
            factor: Triangle::default(),
            buffers: Buffers::default(),
            origin: [0.0; M],
            weights: Vec::new(),
            affine: Vec::new(),
            kernels: Vec::new(),
            sums: Vec::new(),
            values: Vec::new(),
        };
        empty.refit(sources, targets, options, lambdas)
    }

    /// As [`fit`](Self::fit), in the memory of these splines: for as many points nothing is
    /// allocated.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_tps::{FitOptions, LambdaPath};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4,
    ///     0.6]].map(Point2::from);
    /// let options = FitOptions::default();
    /// let mut path = LambdaPath::fit(&sources, &sources, &options, &[1e-9, 1.0])?;
    /// let lifted = sources.map(|p| Point2::new(p.x, p.y + p.x * p.y));
    /// path = path.refit(&sources, &lifted, &options, &[1e-9, 1.0])?;
    /// // Nearly interpolated, and smoothed.
    /// let miss = |v: &Point2<f64>| (v - lifted[4]).norm();
    /// let misses: Vec<f64> = path.values(&sources[4]).iter().map(miss).collect();
    /// assert!(misses[0] < 1e-6 && misses[1] > 1e-3, "{misses:?}");
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// As [`fit`](Self::fit).
    pub fn refit(
        mut self,
        sources: &[Point<f64, D>],
        targets: &[Point<f64, M>],
        options: &FitOptions<K>,
        lambdas: &[f64],
    ) -> Result<Self, TpsError> {
        for &lambda in lambdas {
            validate_smoothing(&Smoothing::Lambda(lambda))?;
            // An interpolant needs targets that agree where points coincide, which is not checked
            // here.
            if lambda == 0.0 {
                return Err(TpsError::Lambda { value: 0.0 });
            }
        }
        self.points = self.points.with_points(sources, options)?;
        self.points.check(targets)?;
        let points = &self.points;
        let (setting, weights) = (points.setting(), &points.centre_weights);
        // Without λ, which is added to a copy for each of them.
        self.system.assemble(&setting, weights, true);
        self.origin = core::array::from_fn(|k| targets[0][k]);
        let weights = points.weights.as_deref();
        let buffers = &mut self.buffers;
        points
            .centres
            .gather(targets, weights, &self.origin, buffers);
        let n = points.centres.len();
        // Weights of one centre stand side by side: a kernel is read once for all λ.
        let width = (lambdas.len() * M).next_multiple_of(TOGETHER).max(TOGETHER);
        self.weights.clear();
        self.weights.resize(n * width, 0.0);
        self.affine.clear();
        for (l, &lambda) in lambdas.iter().enumerate() {
            self.factor.copy_from(&self.system.matrix);
            let inner = points.inner_lambda(Smoothing::Lambda(lambda));
            self.factor.add_to_diagonal(inner);
            self.factor.factor()?;
            buffers.weights.clone_from(&buffers.targets);
            let solver = |columns: &mut [f64]| self.factor.solve(columns);
            let affine = self
                .system
                .solve_by(&mut buffers.weights, &mut buffers.work, solver);
            self.affine.push(affine);
            for (m, column) in buffers.weights.chunks_exact(n).enumerate() {
                let row = self.weights.chunks_exact_mut(width);
                row.zip(column).for_each(|(row, w)| row[l * M + m] = *w);
            }
        }
        self.kernels.resize(n, 0.0);
        self.sums.resize(width, 0.0);
        self.values.clear();
        self.values.resize(lambdas.len(), Point::origin());
        Ok(self)
    }

    /// The values at `point`, one for each λ, in the order of the λ. O(n) each.
    pub fn values(&mut self, point: &Point<f64, D>) -> &[Point<f64, M>] {
        let place = self.points.centres.frame.inside(point);
        dispatch(Evaluate {
            kernel: &self.points.kernel,
            place: &place,
            axes: &self.points.centres.axes,
            kernels: &mut self.kernels,
            weights: &self.weights,
            sums: &mut self.sums,
        });
        let sums = self.sums.chunks_exact(M).zip(&self.affine);
        for (value, (sums, affine)) in self.values.iter_mut().zip(sums) {
            *value = Point::from(core::array::from_fn(|m| {
                let affine = self.system.span.polynomial(&affine[m], &place);
                self.origin[m] + sums[m] + affine
            }));
        }
        &self.values
    }
}

/// Kernels between a place and the centres, and their products with the weights of all splines.
struct Evaluate<'a, K, const D: usize> {
    kernel: &'a K,
    place: &'a [f64; D],
    axes: &'a [Vec<f64>; D],
    kernels: &'a mut [f64],
    weights: &'a [f64],
    sums: &'a mut [f64],
}

impl<K: Kernel, const D: usize> Job for Evaluate<'_, K, D> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lane>(self) {
        let n = self.kernels.len();
        let (axes, place) = (
            self.axes.each_ref().map(|axis| &axis[..n]),
            self.place.map(L::from_f64),
        );
        for (i, value) in self.kernels.iter_mut().enumerate() {
            let s = squared_distance(axes, i, place);
            *value = self.kernel.derivatives(s).value.get();
        }
        let width = self.sums.len();
        for at in (0..width).step_by(TOGETHER) {
            let mut own = [0.0; TOGETHER];
            for (row, kernel) in self.weights.chunks_exact(width).zip(&*self.kernels) {
                let (row, kernel) = (&row[at..at + TOGETHER], L::from_f64(*kernel));
                for l in 0..TOGETHER {
                    own[l] = kernel
                        .mul_add(L::from_f64(row[l]), L::from_f64(own[l]))
                        .get();
                }
            }
            self.sums[at..at + TOGETHER].copy_from_slice(&own);
        }
    }
}
