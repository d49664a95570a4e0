//! What a fit may be asked for.

use crate::{R2LogR, Scalar, TpsError, error::Input};

/// How closely the spline keeps to its targets.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Smoothing<T> {
    /// Interpolate: λ = 0.
    #[default]
    None,
    /// Minimise Σ weightᵢ |f(xᵢ) − yᵢ|² + λ wᵀKw for this λ ≥ 0, in the units of the points and the kernel.
    Lambda(T),
    /// The λ of least generalised cross-validation (Craven & Wahba 1979; Golub, Heath & Wahba 1979).
    Gcv,
}

/// How the equations are solved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Solver {
    /// Direct up to 3000 points and for cross-validation, iterative beyond.
    #[default]
    Automatic,
    /// A dense factor: n³/3 operations and 8n² bytes, to rounding.
    Direct,
    /// Preconditioned conjugate gradients: n² kernels a step, O(n) memory, to the [tolerance](FitOptions::tolerance).
    Iterative,
}

/// Points up to which [`Solver::Automatic`] is direct.
const DIRECT_POINTS: usize = 3000;

/// Kernel, smoothing and weights of a fit.
///
/// ```
/// use tactile_tps::{FitOptions, NegR, Smoothing};
/// let options = FitOptions::new(NegR).smoothing(Smoothing::Lambda(1e-3)).weights(vec![1.0, 1.0, 0.2, 1.0]);
/// # let _ = options;
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FitOptions<T, K = R2LogR> {
    pub(crate) kernel: K,
    pub(crate) smoothing: Smoothing<T>,
    pub(crate) weights: Option<Vec<T>>,
    pub(crate) rank_tolerance: T,
    pub(crate) solver: Solver,
    pub(crate) tolerance: T,
}

impl<T: Scalar> Default for FitOptions<T, R2LogR> {
    fn default() -> Self {
        Self::new(R2LogR)
    }
}

impl<T: Scalar, K> FitOptions<T, K> {
    /// Interpolation with this kernel, all points alike.
    pub fn new(kernel: K) -> Self {
        Self {
            kernel,
            smoothing: Smoothing::None,
            weights: None,
            rank_tolerance: T::zero(),
            solver: Solver::Automatic,
            tolerance: T::narrow(1e-10),
        }
    }

    /// Sets the smoothing.
    #[must_use]
    pub fn smoothing(mut self, smoothing: Smoothing<T>) -> Self {
        self.smoothing = smoothing;
        self
    }

    /// Gives every point a weight of at least zero; zero leaves the point out.
    ///
    /// Weights act against λ: an interpolating spline passes through every point of positive weight.
    #[must_use]
    pub fn weights(mut self, weights: Vec<T>) -> Self {
        self.weights = Some(weights);
        self
    }

    /// Directions in which the points extend less than this share of their largest extent are dropped.
    ///
    /// The default 0 drops those that rounding of the coordinates alone could have made. A surface that is nearly
    /// flat deserves more: across it the spline's gradient is noise over thickness.
    #[must_use]
    pub fn rank_tolerance(mut self, tolerance: T) -> Self {
        self.rank_tolerance = tolerance;
        self
    }

    /// Sets how the equations are solved.
    #[must_use]
    pub fn solver(mut self, solver: Solver) -> Self {
        self.solver = solver;
        self
    }

    /// The residual at which an iterative solver stops: the largest at a point, relative to the largest target.
    ///
    /// The default is 10⁻¹⁰. The spline's values are off by about as much; its report says how far it came.
    #[must_use]
    pub fn tolerance(mut self, tolerance: T) -> Self {
        self.tolerance = tolerance;
        self
    }

    /// Whether so many points are to be solved for by iteration.
    pub(crate) fn iterates(&self, points: usize) -> bool {
        match self.solver {
            _ if self.smoothing == Smoothing::Gcv => false,
            Solver::Automatic => points > DIRECT_POINTS,
            Solver::Direct => false,
            Solver::Iterative => true,
        }
    }

    /// The kernel.
    pub fn kernel(&self) -> &K {
        &self.kernel
    }

    pub(crate) fn validate(&self, points: usize) -> Result<(), TpsError> {
        let tolerance = self.rank_tolerance.widen();
        if !(0.0..1.0).contains(&tolerance) {
            return Err(TpsError::RankTolerance { value: tolerance });
        }
        let tolerance = self.tolerance.widen();
        if !(tolerance > 0.0 && tolerance < 1.0) {
            return Err(TpsError::Tolerance { value: tolerance });
        }
        validate_smoothing(&self.smoothing)?;
        self.weights.as_deref().map_or(Ok(()), |weights| validate_weights(weights, points))
    }
}

pub(crate) fn validate_smoothing<T: Scalar>(smoothing: &Smoothing<T>) -> Result<(), TpsError> {
    match smoothing {
        Smoothing::Lambda(lambda) if !(lambda.widen() >= 0.0 && lambda.widen().is_finite()) => {
            Err(TpsError::Lambda { value: lambda.widen() })
        }
        _ => Ok(()),
    }
}

pub(crate) fn validate_weights<T: Scalar>(weights: &[T], points: usize) -> Result<(), TpsError> {
    if weights.len() != points {
        return Err(TpsError::Length { input: Input::Weights, expected: points, found: weights.len() });
    }
    let bad = weights.iter().position(|w| !(w.widen() >= 0.0 && w.widen().is_finite()));
    match bad {
        Some(index) => Err(TpsError::Weight { index, value: weights[index].widen() }),
        None if weights.iter().all(|w| w.widen() == 0.0) => Err(TpsError::Empty(Input::Weights)),
        None => Ok(()),
    }
}
