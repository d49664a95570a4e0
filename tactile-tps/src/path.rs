//! The values that splines of several λ take: what cross-validation over left-out points asks for.

use nalgebra::Point;

use crate::{
    Factorization, FitOptions, Kernel, Scalar, Smoothing, Spline, TpsError,
    centres::finite,
    equations::Buffers,
    layout::HEAD,
    null_space::{MAX, dot},
    options::validate_weight_count,
    real::Lane,
    simd::{Job, dispatch},
    smoothing::validate_smoothing,
    system::System,
    tridiagonal::Tridiagonal,
};

impl<T: Scalar, const D: usize, const M: usize, K: Kernel> Spline<T, D, M, K> {
    /// The values at `points` of the splines through the same pairs with each of the `lambdas`, in their order: those of
    /// [`fit`](Self::fit) with that [`Smoothing::Lambda`] and then [`apply`](Self::apply), to rounding.
    ///
    /// With the side conditions eliminated a spline solves $(A + \lambda) z = b$ with A symmetric, and its value at a point is linear in z.
    /// Householder's $A = H T H^T$ with T tridiagonal serves every λ (Eldén, BIT 17, 1977): O(n³ + p n²) once for p points, O(p n) a λ.
    ///
    /// ```
    /// use nalgebra::Point2;
    /// use tactile_tps::{FitOptions, R2LogR, Smoothing, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources: Vec<_> = (0..20).map(|i| Point2::new((i % 5) as f64, (i * i % 7) as f64 + 0.1 * i as f64)).collect();
    /// let targets: Vec<_> = sources.iter().map(|p| Point2::new(p.x.sin(), p.y)).collect();
    /// let options = FitOptions::new(R2LogR);
    /// let place = Point2::new(1.5, 2.5);
    /// let found = ThinPlateSpline::values_of_each(&sources, &targets, &options, &[0.1, 10.0], &[place])?;
    /// let stiff = ThinPlateSpline::fit(&sources, &targets, &options.with_smoothing(Smoothing::Lambda(10.0))?)?;
    /// assert!((found[1][0] - stiff.apply(&place)).norm() < 1e-12);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// Those of [`fit`](Self::fit), and [`TpsError::Lambda`] for a λ that is not positive and finite, [`TpsError::NotFinite`] for a point.
    pub fn values_of_each(
        sources: &[Point<T, D>],
        targets: &[Point<T, M>],
        options: &FitOptions<T, K>,
        lambdas: &[T],
        points: &[Point<T, D>],
    ) -> Result<Vec<Vec<Point<T, M>>>, TpsError> {
        for &lambda in lambdas {
            validate_smoothing(&Smoothing::Lambda(lambda))?;
            if lambda.widen() == 0.0 {
                return Err(TpsError::Lambda { value: 0.0 });
            }
        }
        if let Some(weights) = &options.weights {
            validate_weight_count(weights, sources.len())?;
        }
        finite(points, "queries")?;
        let splines = Factorization::unfactored(sources, options)?;
        splines.check(targets, None, false)?;
        let mut system = System::default();
        system.assemble(&splines.setting(), &splines.centre_weights, true);
        let origin: [f64; M] = core::array::from_fn(|k| targets[0][k].widen());
        let mut buffers = Buffers::default();
        let weights = splines.weights.as_deref();
        splines
            .centres
            .gather(targets, weights, &origin, &mut buffers);
        let places: Vec<_> = points
            .iter()
            .map(|p| splines.centres.frame.inside(p))
            .collect();
        let path = Path::<D, M>::new(&splines, &system, &buffers.targets, &places);
        let value = |shares: [f64; M]| {
            Point::from(core::array::from_fn(|m| T::narrow(origin[m] + shares[m])))
        };
        let each = lambdas.iter().map(|&lambda| {
            let inner = splines.inner_lambda(Smoothing::Lambda(lambda));
            path.values(inner).into_iter().map(value).collect()
        });
        Ok(each.collect())
    }
}

/// The splines' values at points: that of the affine fit, and what a spline's z adds.
struct Path<const D: usize, const M: usize> {
    /// T, and its vectors: what z adds at every point, then the right-hand sides.
    form: Tridiagonal,
    affine: Vec<[f64; M]>,
}

impl<const D: usize, const M: usize> Path<D, M> {
    fn new<T: Scalar, K: Kernel>(
        splines: &Factorization<T, D, K>,
        system: &System<D>,
        targets: &[f64],
        places: &[[f64; D]],
    ) -> Self {
        let (null, count, centres) = (&system.null, places.len(), &splines.centres);
        let (q, stride, order) = (null.q, null.stride, system.active.len() - null.q);
        let mut form = Tridiagonal::new(order, count + M);
        let [row, width] = form.strides();
        let matrix = &system.cholesky.l;
        for i in 0..order {
            for j in i..order {
                let entry = matrix[(HEAD + i) * stride + HEAD + j];
                form.matrix[i * row + j] = entry;
                form.matrix[j * row + i] = entry;
            }
        }
        let mut column = vec![0.0; stride];
        let mut heads = [[0.0; MAX]; M];
        for m in 0..M {
            column.fill(0.0);
            let own = &targets[m * centres.len()..(m + 1) * centres.len()];
            system.scaled(own, &mut column[null.rows()]);
            null.apply_transpose(&mut column);
            heads[m][..q].copy_from_slice(&column[HEAD - q..HEAD]);
            for i in 0..order {
                form.vectors[i * width + count + m] = column[HEAD + i];
            }
        }
        let mut axes = vec![0.0; (D + 1) * system.active.len()];
        system.places(centres, &mut axes);
        let mut affine = Vec::with_capacity(count);
        for (p, place) in places.iter().enumerate() {
            let mut terms = [0.0; MAX];
            for (c, term) in terms.iter_mut().enumerate().take(q) {
                *term = system.span.value(c, place);
            }
            let terms = null.solve_transpose(&terms);
            affine.push(core::array::from_fn(|m| dot(&terms[..q], &heads[m][..q])));
            column.fill(0.0);
            dispatch(Kernels {
                kernel: &splines.kernel,
                place,
                axes: &axes,
                values: &mut column[null.rows()],
            });
            null.apply_transpose(&mut column);
            for (k, term) in terms.iter().enumerate().take(q) {
                let tail = column[HEAD..HEAD + order].iter_mut();
                tail.zip(system.coupling(k))
                    .for_each(|(value, coupling)| *value -= term * coupling);
            }
            for i in 0..order {
                form.vectors[i * width + p] = column[HEAD + i];
            }
        }
        form.reduce();
        Self { form, affine }
    }

    /// The values at all points, from the targets' origin.
    fn values(&self, lambda: f64) -> Vec<[f64; M]> {
        let (count, width) = (self.affine.len(), self.form.strides()[1]);
        let sides = self.form.vectors.chunks_exact(width);
        let mut z: Vec<[f64; M]> = sides
            .map(|row| core::array::from_fn(|m| row[count + m]))
            .collect();
        self.form.solve(lambda, &mut z);
        let mut sums = vec![0.0; M * width];
        dispatch(Combine {
            vectors: &self.form.vectors,
            z: &z,
            sums: &mut sums,
            width,
        });
        let value = |(p, affine): (usize, &[f64; M])| {
            core::array::from_fn(|m| affine[m] + sums[m * width + p])
        };
        self.affine.iter().enumerate().map(value).collect()
    }
}

/// The kernel's value at a place for every centre, times the centre's scale.
struct Kernels<'a, K, const D: usize> {
    kernel: &'a K,
    place: &'a [f64; D],
    /// D coordinates and the scale, one after the other.
    axes: &'a [f64],
    values: &'a mut [f64],
}

impl<K: Kernel, const D: usize> Job<f64> for Kernels<'_, K, D> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lane<f64>>(self) {
        let n = self.values.len();
        let axes: [&[f64]; D] = core::array::from_fn(|k| &self.axes[k * n..(k + 1) * n]);
        let scales = &self.axes[D * n..(D + 1) * n];
        for (i, value) in self.values.iter_mut().enumerate() {
            let mut s = L::from_f64(0.0);
            for k in 0..D {
                let d = L::new(self.place[k]) - L::new(axes[k][i]);
                s = d.mul_add(d, s);
            }
            *value = (self.kernel.jet(s).value * L::new(scales[i])).get();
        }
    }
}

/// Σ z_i × the i-th components of the vectors, for each of M columns of z.
struct Combine<'a, const M: usize> {
    vectors: &'a [f64],
    z: &'a [[f64; M]],
    sums: &'a mut [f64],
    width: usize,
}

impl<const M: usize> Job<f64> for Combine<'_, M> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lane<f64>>(self) {
        for (row, z) in self.vectors.chunks_exact(self.width).zip(self.z) {
            for (sums, &z) in self.sums.chunks_exact_mut(self.width).zip(z) {
                for (sum, x) in sums.iter_mut().zip(row) {
                    *sum = L::new(z).mul_add(L::new(*x), L::new(*sum)).get();
                }
            }
        }
    }
}
