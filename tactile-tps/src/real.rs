//! The arithmetic a kernel may use, and the scalars a spline works in.

use core::ops::{Add, Div, Mul, Neg, Sub};

use nalgebra::RealField;

use crate::logarithm::{ln_f32, ln_f64};

/// What a [`Kernel`](crate::Kernel) may do with a number.
///
/// Kernels are written once against this trait and run in every arithmetic the crate needs: `f32`, `f64`, their
/// vectorised forms, and twice the working precision where digits would be lost.
///
/// Comparison is allowed; keep both branches free of side effects and the compiler turns them into a select.
///
/// ```
/// # use tactile_tps::Real;
/// /// ln(1 + eˣ), in whatever arithmetic it is called.
/// fn softplus<R: Real>(x: R) -> R {
///     (R::from_f64(1.0) + x.exp()).ln()
/// }
/// assert!((softplus(0.0f64) - 2f64.ln()).abs() < 1e-15 && (softplus(0.0f32) - 2f32.ln()).abs() < 1e-6);
/// ```
pub trait Real:
    Copy
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// The nearest number to `x`.
    fn from_f64(x: f64) -> Self;
    /// √x.
    fn sqrt(self) -> Self;
    /// Natural logarithm of a positive, finite number; anything (but no panic) elsewhere.
    fn ln(self) -> Self;
    /// eˣ.
    fn exp(self) -> Self;
    /// `self · a + b`, rounded once where that costs nothing extra.
    ///
    /// ```
    /// use tactile_tps::Real;
    /// /// Length of a vector, one rounding a term.
    /// fn length<R: Real>(components: &[R]) -> R {
    ///     components.iter().fold(R::from_f64(0.0), |sum, &c| c.mul_add(c, sum)).sqrt()
    /// }
    /// assert_eq!(length(&[3.0_f64, 4.0]), 5.0);
    /// assert_eq!(length(&[0.6_f32, 0.8]), 1.0);
    /// ```
    fn mul_add(self, a: Self, b: Self) -> Self;
}

/// A [`Real`] that stands for the scalar `T` in a vectorised loop.
pub trait Lane<T>: Real {
    /// Wraps the scalar.
    fn new(x: T) -> Self;
    /// Unwraps it.
    fn get(self) -> T;
}

/// What the crate does with a scalar inside; seals [`Scalar`].
pub trait Inner: RealField + Copy + Default {
    /// Arithmetic without a hardware fused multiply-add.
    type Plain: Lane<Self>;
    /// Arithmetic with it.
    type Fused: Lane<Self>;
    /// The nearest number to `x`.
    fn narrow(x: f64) -> Self;
    /// The same number as `f64`.
    fn widen(self) -> f64;
}

/// The scalar type of points: `f32` or `f64`.
///
/// Fits are always computed in `f64`; the type decides in which precision the spline is kept and evaluated.
///
/// ```
/// # use tactile_tps::Scalar;
/// assert_eq!(<f64 as Scalar>::UNIT_ROUNDOFF, 0.5 * f64::EPSILON);
/// ```
pub trait Scalar: Inner {
    /// Unit roundoff, half the distance from one to the next number.
    const UNIT_ROUNDOFF: f64;
}

/// `f32` or `f64` whose `mul_add` is one hardware instruction.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct Fused<T>(T);

macro_rules! real {
    ($t:ident, $unit:expr, $ln:path) => {
        impl Scalar for $t {
            const UNIT_ROUNDOFF: f64 = $unit;
        }

        impl Inner for $t {
            type Plain = $t;
            type Fused = Fused<$t>;
            #[inline(always)]
            fn narrow(x: f64) -> Self {
                x as $t
            }
            #[inline(always)]
            fn widen(self) -> f64 {
                self as f64
            }
        }

        impl Lane<$t> for $t {
            #[inline(always)]
            fn new(x: $t) -> Self {
                x
            }
            #[inline(always)]
            fn get(self) -> $t {
                self
            }
        }

        impl Real for $t {
            #[inline(always)]
            fn from_f64(x: f64) -> Self {
                x as $t
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                <$t>::sqrt(self)
            }
            #[inline(always)]
            fn ln(self) -> Self {
                $ln(self, |a, b, c| a * b + c)
            }
            #[inline(always)]
            fn exp(self) -> Self {
                <$t>::exp(self)
            }
            #[inline(always)]
            fn mul_add(self, a: Self, b: Self) -> Self {
                self * a + b
            }
        }

        impl Lane<$t> for Fused<$t> {
            #[inline(always)]
            fn new(x: $t) -> Self {
                Self(x)
            }
            #[inline(always)]
            fn get(self) -> $t {
                self.0
            }
        }

        impl Real for Fused<$t> {
            #[inline(always)]
            fn from_f64(x: f64) -> Self {
                Self(x as $t)
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                Self(self.0.sqrt())
            }
            #[inline(always)]
            fn ln(self) -> Self {
                Self($ln(self.0, <$t>::mul_add))
            }
            #[inline(always)]
            fn exp(self) -> Self {
                Self(self.0.exp())
            }
            #[inline(always)]
            fn mul_add(self, a: Self, b: Self) -> Self {
                Self(self.0.mul_add(a.0, b.0))
            }
        }
    };
}

real!(f32, 5.960_464_477_539_063e-8, ln_f32);
real!(f64, 1.110_223_024_625_156_5e-16, ln_f64);

macro_rules! operator {
    ($($trait:ident $method:ident),*) => {$(
        impl<T: $trait<Output = T>> $trait for Fused<T> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(self.0.$method(other.0))
            }
        }
    )*};
}
operator!(Add add, Sub sub, Mul mul, Div div);

impl<T: Neg<Output = T>> Neg for Fused<T> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0)
    }
}
