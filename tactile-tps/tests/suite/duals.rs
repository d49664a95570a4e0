//! Jacobians against forward-mode duals carried through a plain sum of the spline's public parts.

use core::ops::{Add, Div, Mul, Neg, Sub};

use crate::common::{Uniform, bend};
use nalgebra::{Point, SVector};
use tactile_tps::{FitOptions, Kernel, KernelScalar, NegR, R2LogR, R3, ThinPlateSpline};

/// x + ε dx, ε² = 0.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
struct Dual(f64, f64);

impl Add for Dual {
    type Output = Self;
    fn add(self, b: Self) -> Self {
        Self(self.0 + b.0, self.1 + b.1)
    }
}

impl Sub for Dual {
    type Output = Self;
    fn sub(self, b: Self) -> Self {
        self + -b
    }
}

impl Mul for Dual {
    type Output = Self;
    fn mul(self, b: Self) -> Self {
        Self(self.0 * b.0, self.0 * b.1 + self.1 * b.0)
    }
}

impl Div for Dual {
    type Output = Self;
    fn div(self, b: Self) -> Self {
        Self(self.0 / b.0, (self.1 - self.0 / b.0 * b.1) / b.0)
    }
}

impl Neg for Dual {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0, -self.1)
    }
}

impl KernelScalar for Dual {
    fn from_f64(x: f64) -> Self {
        Self(x, 0.0)
    }
    fn sqrt(self) -> Self {
        Self(self.0.sqrt(), 0.5 * self.1 / self.0.sqrt())
    }
    fn ln(self) -> Self {
        Self(self.0.ln(), self.1 / self.0)
    }
    fn exp(self) -> Self {
        Self(self.0.exp(), self.1 * self.0.exp())
    }
    fn mul_add(self, a: Self, b: Self) -> Self {
        self * a + b
    }
}

/// Σ wᵢ U(|x − xᵢ|) + A x + a₀ with x moving along axis `k`.
fn along<const D: usize, K: Kernel>(
    spline: &ThinPlateSpline<f64, D, K>,
    kernel: &K,
    x: &Point<f64, D>,
    k: usize,
) -> [Dual; D] {
    let place: [Dual; D] = core::array::from_fn(|i| Dual(x[i], f64::from(i == k)));
    let (linear, constant) = spline.affine();
    let mut sums: [Dual; D] = core::array::from_fn(|m| {
        (0..D).fold(Dual(constant[m], 0.0), |sum, i| {
            sum + Dual(linear[(m, i)], 0.0) * place[i]
        })
    });
    for (centre, weight) in spline.terms() {
        let distance = (0..D).map(|i| place[i] - Dual(centre[i], 0.0));
        let square = distance.fold(Dual(0.0, 0.0), |s, d| s + d * d);
        let value = kernel.derivatives(square).value;
        (0..D).for_each(|m| sums[m] = sums[m] + Dual(weight[m], 0.0) * value);
    }
    sums
}

fn agrees<const D: usize, K: Kernel>(kernel: K) {
    let mut random = Uniform(41);
    // Off the unit frame, so that the scaling inside shows.
    let place = |p: &Point<f64, D>| Point::from(p.coords * 3.0 + SVector::repeat(0.7));
    let sources: Vec<_> = random.points::<D>(40).iter().map(place).collect();
    let targets: Vec<_> = sources.iter().map(bend).collect();
    let spline = ThinPlateSpline::fit(&sources, &targets, &FitOptions::new(kernel.clone()))
        .expect("a spline");
    let weight = spline.terms().map(|(_, w)| w.norm()).sum::<f64>();
    for _ in 0..50 {
        let query = place(&random.point());
        let (value, jacobian) = (spline.apply(&query), spline.jacobian(&query));
        for k in 0..D {
            for (m, dual) in along(&spline, &kernel, &query, k).iter().enumerate() {
                // Rounding, 1e-16, of terms of at most a weight times U and U' at a distance of 10,
                // below 1e3.
                let rounding = 1e-13 * (weight + 1.0) * 10.0;
                assert!(
                    (dual.0 - value[m]).abs() < rounding,
                    "{dual:?} {}",
                    value[m]
                );
                assert!(
                    (dual.1 - jacobian[(m, k)]).abs() < rounding,
                    "{dual:?} {}",
                    jacobian[(m, k)]
                );
            }
        }
    }
}

#[test]
fn jacobians_agree_with_duals() {
    agrees::<2, _>(R2LogR);
    agrees::<2, _>(R3);
    agrees::<3, _>(R2LogR);
    agrees::<3, _>(NegR);
    agrees::<3, _>(R3);
}
