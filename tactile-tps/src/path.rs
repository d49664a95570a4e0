//! The splines of several λ through the same pairs.

use nalgebra::Point;

use crate::{
    Factorization, FitOptions, Kernel, R2LogR, Scalar, Smoothing, TpsError,
    equations::Buffers,
    layout::{HEAD, PANEL},
    null_space::{MAX, dot},
    real::Lane,
    simd::{Job, dispatch},
    smoothing::validate_smoothing,
    system::System,
    tridiagonal::Tridiagonal,
};

/// The splines through the same pairs for several λ: what cross-validation over left-out points asks for.
///
/// With the side conditions eliminated a spline solves $(A + \lambda) z = b$ with A symmetric, and its value at a point is linear in z.
/// Householder's $A = H T H^T$ with T tridiagonal serves every λ (Eldén, BIT 17, 1977): O(n³) once, O(n²) a λ.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_tps::{FitOptions, LambdaPath, R2LogR, Smoothing, ThinPlateSpline};
/// # fn main() -> Result<(), tactile_tps::TpsError> {
/// let sources: Vec<_> = (0..20).map(|i| Point2::new((i % 5) as f64, (i * i % 7) as f64 + 0.1 * i as f64)).collect();
/// let targets: Vec<_> = sources.iter().map(|p| Point2::new(p.x.sin(), p.y)).collect();
/// let options = FitOptions::new(R2LogR);
/// let place = Point2::new(1.5, 2.5);
/// let mut path = LambdaPath::fit(&sources, &targets, &options, &[0.1, 10.0])?;
/// let stiff = ThinPlateSpline::fit(&sources, &targets, &options.with_smoothing(Smoothing::Lambda(10.0))?)?;
/// assert!((path.values(&place)[1] - stiff.apply(&place)).norm() < 1e-12);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct LambdaPath<T: Scalar, const D: usize, const M: usize, K = R2LogR> {
    /// Centres and options, without a factor.
    points: Factorization<T, D, K>,
    system: System<D>,
    buffers: Buffers,
    path: Path,
    origin: [f64; M],
    values: Vec<Point<T, M>>,
}

impl<T: Scalar, const D: usize, const M: usize, K: Kernel> LambdaPath<T, D, M, K> {
    /// The splines of [`Spline::fit`](crate::Spline::fit) with [`Smoothing::Lambda`] of each of the `lambdas`, to rounding.
    ///
    /// # Errors
    /// Those of [`Spline::fit`](crate::Spline::fit), and [`TpsError::Lambda`] for a λ that is not positive and finite.
    pub fn fit(
        sources: &[Point<T, D>],
        targets: &[Point<T, M>],
        options: &FitOptions<T, K>,
        lambdas: &[T],
    ) -> Result<Self, TpsError> {
        let empty = Self {
            points: Factorization::without_points(options.kernel.clone()),
            system: System::default(),
            buffers: Buffers::default(),
            path: Path::default(),
            origin: [0.0; M],
            values: Vec::new(),
        };
        empty.refit(sources, targets, options, lambdas)
    }

    /// As [`fit`](Self::fit), in the memory of these splines: for as many points nothing is allocated.
    ///
    /// ```
    /// # use nalgebra::Point2;
    /// # use tactile_tps::{FitOptions, LambdaPath};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// # let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
    /// let options = FitOptions::default();
    /// let mut path = LambdaPath::fit(&sources, &sources, &options, &[1e-9, 1.0])?;
    /// let lifted = sources.map(|p| Point2::new(p.x, p.y + p.x * p.y));
    /// path = path.refit(&sources, &lifted, &options, &[1e-9, 1.0])?;
    /// // Nearly interpolated, and smoothed.
    /// let misses = path.values(&sources[4]).iter().map(|v| (v - lifted[4]).norm()).collect::<Vec<_>>();
    /// assert!(misses[0] < 1e-6 && misses[1] > 1e-3, "{misses:?}");
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// As [`fit`](Self::fit).
    pub fn refit(
        mut self,
        sources: &[Point<T, D>],
        targets: &[Point<T, M>],
        options: &FitOptions<T, K>,
        lambdas: &[T],
    ) -> Result<Self, TpsError> {
        for &lambda in lambdas {
            validate_smoothing(&Smoothing::Lambda(lambda))?;
            if lambda.widen() == 0.0 {
                return Err(TpsError::Lambda { value: 0.0 });
            }
        }
        self.points = self.points.with_points(sources, options)?;
        self.points.check(targets, None, false)?;
        let Self {
            points,
            system,
            buffers,
            path,
            origin,
            values,
        } = &mut self;
        system.assemble(&points.setting(), &points.centre_weights, true);
        *origin = core::array::from_fn(|k| targets[0][k].widen());
        let weights = points.weights.as_deref();
        points.centres.gather(targets, weights, origin, buffers);
        let inner = |&lambda: &T| points.inner_lambda(Smoothing::Lambda(lambda));
        path.solve::<M, D>(system, &buffers.targets, lambdas.iter().map(inner));
        path.places.clear();
        path.places.resize((D + 1) * system.active.len(), 0.0);
        system.places(&points.centres, &mut path.places);
        values.clear();
        values.resize(lambdas.len(), Point::origin());
        Ok(self)
    }

    /// The values at `point`, one for each λ, in the order of the λ; O(n) each.
    pub fn values(&mut self, point: &Point<T, D>) -> &[Point<T, M>] {
        let Self {
            points,
            system,
            path,
            origin,
            values,
            ..
        } = self;
        let place = points.centres.frame.inside(point);
        path.evaluate(&points.kernel, system, &place);
        for (value, sums) in values.iter_mut().zip(path.sums.chunks_exact(M)) {
            *value = Point::from(core::array::from_fn(|m| T::narrow(origin[m] + sums[m])));
        }
        values
    }
}

/// The splines of several λ side by side: column l M + m is output m of the l-th λ. Rows have a multiple of eight columns.
#[derive(Clone, Debug, Default)]
struct Path {
    form: Tridiagonal,
    width: usize,
    shifts: Vec<f64>,
    pivots: Vec<f64>,
    /// Right-hand sides, output by output, and what the affine functions take of them.
    sides: Vec<f64>,
    heads: Vec<[f64; MAX]>,
    solutions: Vec<f64>,
    /// Centre by centre, in the order of the system.
    weights: Vec<f64>,
    affine: Vec<[f64; MAX]>,
    /// Coordinates of the centres, axis by axis, and their scales.
    places: Vec<f64>,
    kernels: Vec<f64>,
    sums: Vec<f64>,
    column: Vec<f64>,
}

impl Path {
    /// Weights and affine parts for every λ.
    fn solve<const M: usize, const D: usize>(
        &mut self,
        system: &System<D>,
        targets: &[f64],
        lambdas: impl Iterator<Item = f64>,
    ) {
        self.shifts.clear();
        self.shifts
            .extend(lambdas.flat_map(|lambda| core::iter::repeat_n(lambda, M)));
        let count = self.shifts.len();
        // At least one panel: rows of no columns are none.
        self.width = count.next_multiple_of(PANEL).max(PANEL);
        self.shifts.resize(self.width, 1.0);
        self.load(system);
        self.form.reduce();
        self.project::<M, D>(system, targets);
        let (width, outputs) = (self.width, M.next_multiple_of(PANEL));
        // The same right-hand sides for every λ: turned once.
        self.form.turn(&mut self.sides, outputs);
        self.solutions.clear();
        self.solutions
            .resize(self.sides.len() / outputs * width, 0.0);
        let rows = self.solutions.chunks_exact_mut(width);
        for (row, side) in rows.zip(self.sides.chunks_exact(outputs)) {
            for (c, value) in row[..count].iter_mut().enumerate() {
                *value = side[c % M];
            }
        }
        self.form
            .solve(&self.shifts, &mut self.solutions, &mut self.pivots);
        self.form.turn_back(&mut self.solutions, width);
        self.lift::<M, D>(system, count);
    }

    /// The projected matrix.
    fn load<const D: usize>(&mut self, system: &System<D>) {
        let (null, order) = (&system.null, system.active.len() - system.null.q);
        self.form.reset(order);
        let row = self.form.stride();
        for i in 0..order {
            let start = (HEAD + i) * null.stride + HEAD;
            self.form.matrix[i * row + i..i * row + order]
                .copy_from_slice(&system.cholesky.l[start + i..start + order]);
        }
    }

    /// The right-hand sides, rotated into the complement of the affine functions, and what that leaves in `heads`.
    fn project<const M: usize, const D: usize>(&mut self, system: &System<D>, targets: &[f64]) {
        let (null, order) = (&system.null, system.active.len() - system.null.q);
        let centres = targets.len() / M;
        let outputs = M.next_multiple_of(PANEL);
        self.sides.clear();
        self.sides.resize(order * outputs, 0.0);
        self.heads.clear();
        let column = &mut self.column;
        for m in 0..M {
            column.clear();
            column.resize(null.stride, 0.0);
            let own = &targets[m * centres..(m + 1) * centres];
            system.scaled(own, &mut column[null.rows()]);
            null.apply_transpose(column);
            let mut head = [0.0; MAX];
            head[..null.q].copy_from_slice(&column[HEAD - null.q..HEAD]);
            self.heads.push(head);
            for (row, value) in self.sides.chunks_exact_mut(outputs).zip(&column[HEAD..]) {
                row[m] = *value;
            }
        }
    }

    /// From solutions to weights and affine parts.
    fn lift<const M: usize, const D: usize>(&mut self, system: &System<D>, count: usize) {
        let (null, width) = (&system.null, self.width);
        let n = system.active.len();
        self.weights.clear();
        self.weights.resize(n * width, 0.0);
        self.affine.clear();
        let column = &mut self.column;
        for c in 0..count {
            column.clear();
            column.resize(null.stride, 0.0);
            for (value, row) in column[HEAD..]
                .iter_mut()
                .zip(self.solutions.chunks_exact(width))
            {
                *value = row[c];
            }
            let mut head = self.heads[c % M];
            for (k, head) in head.iter_mut().enumerate().take(null.q) {
                *head -= dot(system.coupling(k), &column[HEAD..HEAD + n - null.q]);
            }
            self.affine.push(null.solve_upper(&head[..null.q]));
            null.apply(column);
            for (row, weight) in self
                .weights
                .chunks_exact_mut(width)
                .zip(&column[null.rows()])
            {
                row[c] = *weight;
            }
        }
    }

    /// The values of all splines at a place, into `sums`.
    fn evaluate<K: Kernel, const D: usize>(
        &mut self,
        kernel: &K,
        system: &System<D>,
        place: &[f64; D],
    ) {
        self.kernels.resize(system.active.len(), 0.0);
        self.sums.resize(self.width, 0.0);
        dispatch(Evaluate {
            kernel,
            place,
            places: &self.places,
            kernels: &mut self.kernels,
            weights: &self.weights,
            sums: &mut self.sums,
        });
        for (sum, affine) in self.sums.iter_mut().zip(&self.affine) {
            *sum += system.span.polynomial(affine, |k| place[k]);
        }
    }
}

/// Kernels between a place and the centres, times their scales, and their products with the weights of all splines.
struct Evaluate<'a, K, const D: usize> {
    kernel: &'a K,
    place: &'a [f64; D],
    places: &'a [f64],
    kernels: &'a mut [f64],
    weights: &'a [f64],
    sums: &'a mut [f64],
}

impl<K: Kernel, const D: usize> Job<f64> for Evaluate<'_, K, D> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lane<f64>>(self) {
        let n = self.kernels.len();
        let axes: [&[f64]; D] = core::array::from_fn(|k| &self.places[k * n..(k + 1) * n]);
        let scales = &self.places[D * n..(D + 1) * n];
        for (i, value) in self.kernels.iter_mut().enumerate() {
            let mut s = L::from_f64(0.0);
            for k in 0..D {
                let d = L::new(self.place[k]) - L::new(axes[k][i]);
                s = d.mul_add(d, s);
            }
            *value = (self.kernel.jet(s).value * L::new(scales[i])).get();
        }
        let width = self.sums.len();
        let mut at = 0;
        while at + TOGETHER <= width {
            combine::<L, TOGETHER>(self.kernels, self.weights, width, at, self.sums);
            at += TOGETHER;
        }
        while at < width {
            combine::<L, PANEL>(self.kernels, self.weights, width, at, self.sums);
            at += PANEL;
        }
    }
}

/// Columns that are summed at once, in registers.
const TOGETHER: usize = 3 * PANEL;

/// The sums of so many columns of the weights from the `at`-th on.
#[inline(always)]
fn combine<L: Lane<f64>, const W: usize>(
    kernels: &[f64],
    weights: &[f64],
    width: usize,
    at: usize,
    sums: &mut [f64],
) {
    let mut own = [0.0; W];
    for (row, kernel) in weights.chunks_exact(width).zip(kernels) {
        let (row, kernel) = (&row[at..at + W], L::new(*kernel));
        for l in 0..W {
            own[l] = kernel.mul_add(L::new(row[l]), L::new(own[l])).get();
        }
    }
    sums[at..at + W].copy_from_slice(&own);
}
