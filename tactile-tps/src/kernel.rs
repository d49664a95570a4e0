//! Radial kernels.

use core::ops::{Add, Div, Mul, Neg, Sub};

/// The arithmetic available to a [`Kernel`](crate::Kernel).
///
/// Kernels are written once with this trait and run in every arithmetic that the crate needs:
/// `f64`, with and without fused multiply–add.
///
/// Comparisons are allowed. If both branches are free of side effects, the compiler turns them into
/// a select.
///
/// ```
/// use tactile_tps::KernelScalar;
/// /// ln(1 + eˣ), in any arithmetic.
/// fn softplus<R: KernelScalar>(x: R) -> R {
///     (R::from_f64(1.0) + x.exp()).ln()
/// }
/// assert!((softplus(0.0) - 2f64.ln()).abs() < 1e-15);
/// ```
pub trait KernelScalar:
    Copy
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The number nearest to `x`.
    fn from_f64(x: f64) -> Self;
    /// √x.
    fn sqrt(self) -> Self;
    /// Natural logarithm of a positive, finite number. For other values the result is unspecified,
    /// without a panic.
    fn ln(self) -> Self;
    /// eˣ.
    fn exp(self) -> Self;
    /// `self · a + b`, with a single rounding if this has no extra cost.
    ///
    /// ```
    /// use tactile_tps::KernelScalar;
    /// /// Length of a vector, with one rounding per term.
    /// fn length<R: KernelScalar>(components: &[R]) -> R {
    ///     components.iter().fold(R::from_f64(0.0), |sum, &c| c.mul_add(c, sum)).sqrt()
    /// }
    /// assert_eq!(length(&[3.0, 4.0]), 5.0);
    /// ```
    fn mul_add(self, a: Self, b: Self) -> Self;
}

/// Value and derivatives of a kernel with respect to the **squared** distance s = r².
///
/// With d = x − xᵢ the term U(|d|) has the gradient `2 first d` and the Hessian
/// `2 first I + 4 second d dᵀ`.
///
/// ```
/// use tactile_tps::{KernelDerivatives, Kernel, R3};
/// // U = s^(3/2) at s = r² = 4.
/// assert_eq!(R3.derivatives(4.0), KernelDerivatives { value: 8.0, first: 3.0, second: 0.375 });
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KernelDerivatives<R> {
    /// U.
    pub value: R,
    /// dU/ds.
    pub first: R,
    /// d²U/ds².
    pub second: R,
}

/// A radial function U(r) that is conditionally positive definite of order at most two.
///
/// This means Σᵢⱼ wᵢ wⱼ U(|xᵢ − xⱼ|) > 0 for distinct points and any w ≠ 0 with Σ wᵢ = 0 and Σ wᵢ
/// xᵢ = 0. The three kernels of the crate satisfy it. An implementation only needs
/// [`derivatives`](Self::derivatives).
///
/// ```
/// use tactile_tps::{KernelDerivatives, Kernel, KernelScalar};
///
/// /// −√(r² + c²), Hardy's multiquadric.
/// #[derive(Clone, Copy, Debug)]
/// struct Multiquadric(f64);
///
/// impl Kernel for Multiquadric {
///     fn derivatives<R: KernelScalar>(&self, s: R) -> KernelDerivatives<R> {
///         let root = (s + R::from_f64(self.0 * self.0)).sqrt();
///         let first = R::from_f64(-0.5) / root;
///         KernelDerivatives { value: -root, first,
///             second: -first * R::from_f64(0.5) / (root * root) }
///     }
/// }
/// ```
pub trait Kernel: Clone + Send + Sync {
    /// U and its derivatives with respect to s = r² ≥ 0.
    ///
    /// At s = 0, return the limit of U. For a derivative without a limit, return 0, which omits the
    /// point's own term.
    fn derivatives<R: KernelScalar>(&self, s: R) -> KernelDerivatives<R>;

    /// The degree k if U(c r) = cᵏ U(r), up to a multiple of r², for every c > 0. `None` if there
    /// is no such degree.
    ///
    /// If there is one, points are scaled to unit size internally. A kernel with a length scale has
    /// none.
    /// none.
    ///
    /// ```
    /// use tactile_tps::{Kernel, NegR, R2LogR};
    /// assert_eq!((NegR.degree(), R2LogR.degree()), (Some(1), Some(2)));
    /// // r² ln r at 3 r is 9 r² ln r, up to 9 ln 3 r².
    /// let (s, excess) = (2.0_f64, 9.0 * 3_f64.ln() * 2.0);
    /// let value = |s: f64| R2LogR.derivatives(s).value;
    /// assert!((value(9.0 * s) - 9.0 * value(s) - excess).abs() < 1e-12);
    /// ```
    fn degree(&self) -> Option<i32> {
        None
    }
}

/// U(r) = r² ln r with U(0) = 0: the thin-plate kernel of the plane (m = 2, D = 2).
///
/// Bookstein's r² ln r² is twice this: its weights are half as large, and λ must be doubled for the
/// same spline.
///
/// ```
/// use tactile_tps::{Kernel, R2LogR};
/// let r = 2.0f64;
/// assert!((R2LogR.derivatives(r * r).value - r * r * r.ln()).abs() < 1e-15);
/// assert_eq!(R2LogR.derivatives(0.0).value, 0.0);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct R2LogR;

/// U(r) = −r: the kernel with the same energy in space (m = 2, D = 3). Its gradient has a cusp at
/// each source point.
///
/// ```
/// use tactile_tps::{Kernel, NegR};
/// assert_eq!(NegR.derivatives(9.0).value, -3.0);
/// assert_eq!(NegR.derivatives(0.0).first, 0.0); // the cusp, omitted
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct NegR;

/// U(r) = r³: one derivative smoother than −r (m = 3 in space, with an affine polynomial). Use it
/// for smooth maps of space.
///
/// ```
/// use tactile_tps::{Kernel, R3};
/// assert_eq!((R3.derivatives(4.0).value, R3.degree()), (8.0, Some(3)));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct R3;

/// `x` if s > 0, otherwise zero.
#[inline(always)]
fn off_centre<R: KernelScalar>(s: R, x: R) -> R {
    if s > R::from_f64(0.0) {
        x
    } else {
        R::from_f64(0.0)
    }
}

impl Kernel for R2LogR {
    #[inline(always)]
    fn derivatives<R: KernelScalar>(&self, s: R) -> KernelDerivatives<R> {
        let half = R::from_f64(0.5);
        // s ln s tends to 0 at the centre, where the logarithm is undefined.
        let log = off_centre(s, s.ln());
        let half_log = half * log;
        KernelDerivatives {
            value: s * half_log,
            // dU/ds of ½ s ln s is ½ (ln s + 1).
            first: off_centre(s, half_log + half),
            second: off_centre(s, half / s),
        }
    }
    fn degree(&self) -> Option<i32> {
        Some(2)
    }
}

impl Kernel for NegR {
    #[inline(always)]
    fn derivatives<R: KernelScalar>(&self, s: R) -> KernelDerivatives<R> {
        let r = s.sqrt();
        let first = off_centre(s, R::from_f64(-0.5) / r);
        KernelDerivatives {
            value: -r,
            first,
            second: off_centre(s, R::from_f64(-0.5) * first / s),
        }
    }
    fn degree(&self) -> Option<i32> {
        Some(1)
    }
}

impl Kernel for R3 {
    #[inline(always)]
    fn derivatives<R: KernelScalar>(&self, s: R) -> KernelDerivatives<R> {
        let r = s.sqrt();
        KernelDerivatives {
            value: s * r,
            first: R::from_f64(1.5) * r,
            second: off_centre(s, R::from_f64(0.75) / r),
        }
    }
    fn degree(&self) -> Option<i32> {
        Some(3)
    }
}
