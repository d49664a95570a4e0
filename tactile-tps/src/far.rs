//! Cancellation far from the centres: how many digits a plain sum keeps, and the sum in double-double arithmetic.
//!
//! Far from the centres the terms wᵢ U grow like the distance's square while their sum grows like the distance: the side
//! conditions cancel the rest. In plain arithmetic the digits cancel with it, twice: in the sum, and in the weights,
//! whose rounding leaves moments that should be zero. Here the sum is carried in double-double numbers, and the
//! moments left are taken out with w ← w − P (PᵀP)⁻¹ Pᵀw.

use nalgebra::Point;

use crate::{
    Kernel, Scalar,
    centres::Frame,
    double_double::{DoubleDouble, two_sum},
    null_space::MAX,
    real::Real,
    sample::{Linear, Sample},
};

/// Size of the terms of a spline's sum relative to its values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Terms {
    /// Largest Σ |wᵢ| of an output.
    pub(crate) weight: f64,
    /// Largest target.
    pub(crate) level: f64,
    /// Squared distance from the frame's centre beyond which a sum is checked for lost digits.
    pub(crate) reach: f64,
}

impl Terms {
    pub(crate) const NONE: Self = Self {
        weight: 0.0,
        level: 0.0,
        reach: f64::INFINITY,
    };

    pub(crate) fn new<T: Scalar, K: Kernel>(kernel: &K, weight: f64, level: f64) -> Self {
        let terms = Self {
            weight,
            level,
            reach: 0.0,
        };
        let bad = |s: f64| terms.rounding::<T, K>(kernel, s) > tolerance::<T>() * level;
        // Doubling from the points' own size to beyond any query that has digits itself.
        let reach = (0..200)
            .map(|k| 2f64.powi(k))
            .find(|&s| bad(s))
            .unwrap_or(f64::INFINITY);
        Self {
            reach: if reach > 1.0 { reach / 2.0 } else { 0.0 },
            ..terms
        }
    }

    /// Rounding error to expect of a plain sum at squared distance `s` from the frame's centre.
    pub(crate) fn rounding<T: Scalar, K: Kernel>(&self, kernel: &K, s: f64) -> f64 {
        // The farthest centre lies a unit or so beyond; nearer than two units the terms do not shrink.
        let distance = f64::max(s.sqrt() + 1.0, 2.0);
        T::UNIT_ROUNDOFF * self.weight * kernel.jet(distance * distance).value.abs()
    }

    /// Whether a plain sum that gave values of size `found` at `s` lost too many digits.
    pub(crate) fn lost<T: Scalar, K: Kernel>(&self, kernel: &K, s: f64, found: f64) -> bool {
        self.rounding::<T, K>(kernel, s) > tolerance::<T>() * f64::max(found, self.level)
    }
}

/// Relative error that a plain sum may have: eight digits in `f64`, four in `f32`.
fn tolerance<T: Scalar>() -> f64 {
    if T::UNIT_ROUNDOFF < 1e-10 { 1e-8 } else { 1e-4 }
}

/// A spline's parts, in its frame.
pub(crate) struct Parts<'a, T, K, const D: usize, const M: usize> {
    pub(crate) kernel: &'a K,
    pub(crate) frame: Frame<D>,
    pub(crate) centres: [&'a [T]; D],
    pub(crate) weights: [&'a [T]; M],
    pub(crate) affine: &'a Linear<T, D, M>,
}

/// Value, gradient and Hessian of a sum.
#[derive(Clone, Copy)]
struct Jets<R, const D: usize> {
    value: R,
    gradient: [R; D],
    hessian: [[R; D]; D],
}

impl<R: Real, const D: usize> Jets<R, D> {
    fn zero() -> Self {
        Self {
            value: R::from_f64(0.0),
            gradient: [R::from_f64(0.0); D],
            hessian: [[R::from_f64(0.0); D]; D],
        }
    }

    fn add(&mut self, factor: R, term: &Self) {
        self.value = self.value + factor * term.value;
        for k in 0..D {
            self.gradient[k] = self.gradient[k] + factor * term.gradient[k];
            for i in 0..D {
                self.hessian[k][i] = self.hessian[k][i] + factor * term.hessian[k][i];
            }
        }
    }

    fn map<S>(&self, f: impl Fn(R) -> S) -> Jets<S, D> {
        Jets {
            value: f(self.value),
            gradient: core::array::from_fn(|k| f(self.gradient[k])),
            hessian: core::array::from_fn(|k| core::array::from_fn(|i| f(self.hessian[k][i]))),
        }
    }
}

/// The sums over the centres, and what it takes to rid them of the moments that rounding left in the weights.
struct Sums<const D: usize, const M: usize> {
    /// Σ wU of each output.
    jets: [Jets<DoubleDouble, D>; M],
    /// Σ pU of each affine function p, to be subtracted.
    shadows: [Jets<f64, D>; MAX],
    /// Pᵀw of each output.
    moments: [[DoubleDouble; MAX]; M],
    /// PᵀP.
    gram: [[f64; MAX]; MAX],
}

impl<const D: usize, const M: usize> Sums<D, M> {
    fn zero() -> Self {
        Self {
            jets: [Jets::zero(); M],
            shadows: [Jets::zero(); MAX],
            moments: [[DoubleDouble::ZERO; MAX]; M],
            gram: [[0.0; MAX]; MAX],
        }
    }

    fn add(
        &mut self,
        weights: &[DoubleDouble; M],
        centre: &[f64; D],
        term: &Jets<DoubleDouble, D>,
    ) {
        let affine = |c: usize| if c == 0 { 1.0 } else { centre[c - 1] };
        for m in 0..M {
            self.jets[m].add(weights[m], term);
            for c in 0..=D {
                self.moments[m][c] =
                    self.moments[m][c] + weights[m] * DoubleDouble::from_f64(affine(c));
            }
        }
        let plain = term.map(|x| x.high);
        for c in 0..=D {
            self.shadows[c].add(affine(c), &plain);
            (0..=D).for_each(|i| self.gram[c][i] += affine(c) * affine(i));
        }
    }

    /// Σ wU with the moments taken out of w.
    fn corrected(mut self) -> [Jets<DoubleDouble, D>; M] {
        for (jets, moments) in self.jets.iter_mut().zip(&self.moments) {
            let correction = solve_gram(self.gram, moments.map(|x| x.high), D + 1);
            for c in 0..=D {
                jets.add(
                    DoubleDouble::from_f64(-correction[c]),
                    &self.shadows[c].map(DoubleDouble::from_f64),
                );
            }
        }
        self.jets
    }
}

impl<T: Scalar, K: Kernel, const D: usize, const M: usize> Parts<'_, T, K, D, M> {
    /// The sample at a point in twice the working precision.
    #[cold]
    #[inline(never)]
    pub(crate) fn sample(&self, point: &Point<T, D>) -> Sample<T, D, M> {
        let x: [DoubleDouble; D] = core::array::from_fn(|k| {
            let shifted = two_sum(point[k].widen(), -self.frame.centre[k]);
            DoubleDouble {
                high: shifted.high / self.frame.scale,
                low: shifted.low / self.frame.scale,
            }
        });
        let mut sums = Sums::<D, M>::zero();
        for j in 0..self.centres[0].len() {
            let centre = core::array::from_fn(|k| self.centres[k][j].widen());
            let weights =
                core::array::from_fn(|m| DoubleDouble::from_f64(self.weights[m][j].widen()));
            sums.add(&weights, &centre, &self.term(&x, &centre));
        }
        self.finish(&x, &sums.corrected())
    }

    /// U and its derivatives about one centre.
    fn term(&self, x: &[DoubleDouble; D], centre: &[f64; D]) -> Jets<DoubleDouble, D> {
        let d: [DoubleDouble; D] =
            core::array::from_fn(|k| x[k] - DoubleDouble::from_f64(centre[k]));
        let s = d.iter().fold(DoubleDouble::ZERO, |s, &d| s + d * d);
        let jet = self.kernel.jet(s);
        let (slope, bend) = (
            jet.first * DoubleDouble::from_f64(2.0),
            jet.second * DoubleDouble::from_f64(4.0),
        );
        Jets {
            value: jet.value,
            gradient: d.map(|d| slope * d),
            hessian: core::array::from_fn(|k| {
                core::array::from_fn(|i| {
                    bend * d[k] * d[i] + if i == k { slope } else { DoubleDouble::ZERO }
                })
            }),
        }
    }

    fn finish(&self, x: &[DoubleDouble; D], sums: &[Jets<DoubleDouble, D>; M]) -> Sample<T, D, M> {
        let wide = |x: T| DoubleDouble::from_f64(x.widen());
        let scale = self.frame.scale;
        let value = core::array::from_fn(|m| {
            let constant = wide(self.affine.constant[m]) + sums[m].value;
            let sum = (0..D).fold(constant, |sum, k| {
                sum + wide(self.affine.gradient[m][k]) * x[k]
            });
            T::narrow(sum.high)
        });
        let gradient = core::array::from_fn(|m| {
            core::array::from_fn(|k| {
                T::narrow((wide(self.affine.gradient[m][k]) + sums[m].gradient[k]).high / scale)
            })
        });
        let hessian = core::array::from_fn(|m| {
            sums[m]
                .hessian
                .map(|row| row.map(|h| T::narrow(h.high / scale / scale)))
        });
        Sample {
            value,
            gradient,
            hessian,
        }
    }
}

/// Solves the normal equations of the first `q` affine functions; functions that depend on earlier ones are left out.
fn solve_gram(mut gram: [[f64; MAX]; MAX], mut b: [f64; MAX], q: usize) -> [f64; MAX] {
    let start: [f64; MAX] = core::array::from_fn(|k| gram[k][k]);
    let mut used = [false; MAX];
    for k in 0..q {
        used[k] = gram[k][k] > 1e-12 * start[k];
        for i in (k + 1..q).filter(|_| used[k]) {
            let factor = gram[i][k] / gram[k][k];
            (k..q).for_each(|j| gram[i][j] -= factor * gram[k][j]);
            b[i] -= factor * b[k];
        }
    }
    let mut x = [0.0; MAX];
    for k in (0..q).rev().filter(|&k| used[k]) {
        let rest: f64 = (k + 1..q).map(|j| gram[k][j] * x[j]).sum();
        x[k] = (b[k] - rest) / gram[k][k];
    }
    x
}
