//! What a fit may be asked for.

use crate::{R2LogR, Scalar, TpsError, error::Input};

/// How closely the spline keeps to its targets.
///
/// ```
/// # use nalgebra::Point2;
/// # use tactile_tps::{FitOptions, Smoothing, ThinPlateSpline};
/// # fn main() -> Result<(), tactile_tps::TpsError> {
/// let sources: Vec<Point2<f64>> = (0..25).map(|i| Point2::new(f64::from(i % 5), f64::from(i / 5))).collect();
/// let noise = |i: usize| 0.01 * ((i * 7919 % 101) as f64 / 50.0 - 1.0);
/// let targets: Vec<_> = sources.iter().enumerate().map(|(i, p)| Point2::new(p.x + noise(i), p.y)).collect();
/// let options = FitOptions::default().smoothing(Smoothing::Gcv);
/// let smooth = ThinPlateSpline::fit(&sources, &targets, &options)?;
/// let through = ThinPlateSpline::fit(&sources, &targets, &options.smoothing(Smoothing::None))?;
/// assert!(smooth.report().lambda > 0.0 && smooth.bending_energy() < through.bending_energy());
/// # Ok(())
/// # }
/// ```
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
///
/// ```
/// # use nalgebra::Point2;
/// # use tactile_tps::{FitOptions, Solver, ThinPlateSpline};
/// # fn main() -> Result<(), tactile_tps::TpsError> {
/// let sources: Vec<Point2<f64>> =
///     (0..900).map(|i| Point2::new(f64::from(i % 30), f64::from(i / 30) + 0.3 * f64::from(i % 7))).collect();
/// let targets: Vec<_> = sources.iter().map(|p| Point2::new(p.x.sin(), p.y.cos())).collect();
/// let fit = |solver| ThinPlateSpline::fit(&sources, &targets, &FitOptions::default().solver(solver));
/// let (direct, iterative) = (fit(Solver::Direct)?, fit(Solver::Iterative)?);
/// let query = Point2::new(7.3, 11.9);
/// assert!((direct.apply(&query) - iterative.apply(&query)).norm() < 1e-8);
/// assert!(iterative.report().iterations > 0 && direct.report().iterations == 0);
/// # Ok(())
/// # }
/// ```
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
    ///
    /// ```
    /// # use tactile_tps::{FitOptions, R3};
    /// let options = FitOptions::<f64, _>::new(R3);
    /// assert_eq!(options.kernel(), &R3);
    /// ```
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
    ///
    /// ```
    /// # use nalgebra::Point2;
    /// # use tactile_tps::{FitOptions, Smoothing, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// # let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
    /// # let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let options = FitOptions::default().smoothing(Smoothing::Lambda(0.5));
    /// let warp = ThinPlateSpline::fit(&sources, &targets, &options)?;
    /// assert!((warp.report().lambda - 0.5).abs() < 1e-15 && warp.bending_energy() < 1e-3);
    /// # Ok(())
    /// # }
    /// ```
    #[must_use]
    pub fn smoothing(mut self, smoothing: Smoothing<T>) -> Self {
        self.smoothing = smoothing;
        self
    }

    /// Gives every point a weight of at least zero; zero leaves the point out.
    ///
    /// Weights act against λ: an interpolating spline passes through every point of positive weight.
    ///
    /// ```
    /// # use nalgebra::Point2;
    /// # use tactile_tps::{FitOptions, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// # let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 0.6]].map(Point2::from);
    /// # let targets = sources.map(|p| Point2::new(p.x + 0.1 * p.y * p.y, p.y));
    /// let warp = ThinPlateSpline::fit(&sources, &targets, &FitOptions::default().weights(vec![1.0, 1.0, 1.0, 1.0, 0.0]))?;
    /// assert_eq!(warp.report().ignored, 1);
    /// # Ok(())
    /// # }
    /// ```
    #[must_use]
    pub fn weights(mut self, weights: Vec<T>) -> Self {
        self.weights = Some(weights);
        self
    }

    /// Directions in which the points extend less than this share of their largest extent are dropped.
    ///
    /// The default 0 drops those that rounding of the coordinates alone could have made. A surface that is nearly
    /// flat deserves more: across it the spline's gradient is noise over thickness.
    ///
    /// ```
    /// # use nalgebra::Point3;
    /// # use tactile_tps::{FitOptions, NegR, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources = [[0.0, 0.0, 0.0], [1.0, 0.0, 1e-5], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.4, 0.6, 1e-5]].map(Point3::from);
    /// let rank = |tolerance| {
    ///     ThinPlateSpline::fit(&sources, &sources, &FitOptions::new(NegR).rank_tolerance(tolerance)).map(|s| s.report().rank)
    /// };
    /// assert_eq!((rank(0.0)?, rank(1e-3)?), (4, 3));
    /// # Ok(())
    /// # }
    /// ```
    #[must_use]
    pub fn rank_tolerance(mut self, tolerance: T) -> Self {
        self.rank_tolerance = tolerance;
        self
    }

    /// Sets how the equations are solved.
    ///
    /// ```
    /// # use tactile_tps::{FitOptions, Solver};
    /// let to_rounding = FitOptions::<f64>::default().solver(Solver::Direct);
    /// assert_ne!(to_rounding, FitOptions::default());
    /// ```
    #[must_use]
    pub fn solver(mut self, solver: Solver) -> Self {
        self.solver = solver;
        self
    }

    /// The residual at which an iterative solver stops: the largest at a point, relative to the largest target.
    ///
    /// The default is 10⁻¹⁰. The spline's values are off by about as much; its report says how far it came.
    ///
    /// ```
    /// # use nalgebra::Point2;
    /// # use tactile_tps::{FitOptions, Solver, ThinPlateSpline};
    /// # fn main() -> Result<(), tactile_tps::TpsError> {
    /// let sources: Vec<Point2<f64>> =
    ///     (0..900).map(|i| Point2::new(f64::from(i % 30), f64::from(i / 30) + 0.3 * f64::from(i % 7))).collect();
    /// let targets: Vec<_> = sources.iter().map(|p| Point2::new(p.x.sin(), p.y.cos())).collect();
    /// let options = FitOptions::default().solver(Solver::Iterative).tolerance(1e-4);
    /// let warp = ThinPlateSpline::fit(&sources, &targets, &options)?;
    /// assert!(warp.report().converged && warp.report().residual <= Some(1e-4));
    /// # Ok(())
    /// # }
    /// ```
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
    ///
    /// ```
    /// # use tactile_tps::{FitOptions, R2LogR};
    /// assert_eq!(FitOptions::<f64>::default().kernel(), &R2LogR);
    /// ```
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
        self.weights
            .as_deref()
            .map_or(Ok(()), |weights| validate_weights(weights, points))
    }
}

pub(crate) fn validate_smoothing<T: Scalar>(smoothing: &Smoothing<T>) -> Result<(), TpsError> {
    match smoothing {
        Smoothing::Lambda(lambda) if !(lambda.widen() >= 0.0 && lambda.widen().is_finite()) => {
            Err(TpsError::Lambda {
                value: lambda.widen(),
            })
        }
        _ => Ok(()),
    }
}

pub(crate) fn validate_weights<T: Scalar>(weights: &[T], points: usize) -> Result<(), TpsError> {
    if weights.len() != points {
        return Err(TpsError::Length {
            input: Input::Weights,
            expected: points,
            found: weights.len(),
        });
    }
    let bad = weights
        .iter()
        .position(|w| !(w.widen() >= 0.0 && w.widen().is_finite()));
    match bad {
        Some(index) => Err(TpsError::Weight {
            index,
            value: weights[index].widen(),
        }),
        None if weights.iter().all(|w| w.widen() == 0.0) => Err(TpsError::Empty(Input::Weights)),
        None => Ok(()),
    }
}
