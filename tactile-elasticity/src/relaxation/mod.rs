//! Whether a modulus changes with time, and whether it is the sample that relaxes or the sensor that drifts.
//!
//! Loads at known times each give a modulus $E_k = F_k/x_k$, where $x_k$ is what the law makes of the contact's size: for a ball
//! $x \propto a^3$. In a standard linear solid, a spring $E_\infty$ beside a spring $E_0 - E_\infty$ in series with a dashpot,
//!
//! $F(t) = \int_0^t E(t - s)\, \mathrm d x(s), \qquad E(t) = E_\infty + (E_0 - E_\infty)\, e^{-t/\tau}$
//!
//! holds for a contact that grows (Lee and Radok, J. Appl. Mech. 27 (1960) 438), and so, whatever the history,
//!
//! $E_k = E_\infty + (E_0 - E_\infty)\, g_k(x, \tau), \qquad \frac 1 {E_k} = \frac 1 {E_\infty} - \Bigl(\frac 1 {E_\infty} - \frac 1 {E_0}\Bigr) g_k(F, \tau_c),
//! \qquad g_k(u, \tau) = \frac 1 {u_k} \int_0^{t_k} e^{-(t_k - s)/\tau}\, \mathrm d u(s)$
//!
//! with $\tau_c = \tau E_0/E_\infty$. A held approach ($x$ constant) is relaxation, a held force ($F$ constant) creep. The form is used whose
//! history varies less, since it must be known between the frames, where it is taken as linear.
//!
//! A gain that drifts multiplies the forces, and with them the moduli, by $1 + \gamma t$, whatever the history.
//!
//! # References
//! R. M. Christensen, *Theory of Viscoelasticity* (1982). R. E. Kass & A. E. Raftery, J. Am. Stat. Assoc. 90 (1995) 773. R. B. Davies,
//! Biometrika 74 (1987) 33: a time constant that has no meaning where nothing relaxes makes the likelihood ratio larger than χ².

mod decide;
mod fit;
mod history;
mod profile;

pub use decide::time_dependence;

use crate::modulus::{Estimate, Interval};

/// The modulus that one load gives, and when.
///
/// ```
/// use tactile_elasticity::modulus::Estimate;
/// use tactile_elasticity::relaxation::{TimeDependence, TimedModulus, time_dependence};
///
/// let at = |time_s: f64| TimedModulus { time_s, force_n: 0.7, youngs_modulus_pa: Estimate::new(100e3, 500.0) };
/// assert_eq!(time_dependence(&[0.0, 1.0, 2.0, 4.0, 8.0].map(at), 0.01, 0.0)?, TimeDependence::Steady);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimedModulus {
    /// Seconds since the object touched.
    pub time_s: f64,
    /// Normal force.
    pub force_n: f64,
    /// What this load alone says, with the part of its error that no other load has.
    pub youngs_modulus_pa: Estimate,
}

/// What a series of moduli says of time.
///
/// ```
/// use tactile_elasticity::modulus::Estimate;
/// use tactile_elasticity::relaxation::{TimeDependence, TimedModulus, time_dependence};
///
/// let series = |modulus: fn(f64) -> f64| {
///     [0.0, 1.0, 2.0, 3.0, 5.0, 8.0].map(|time_s| TimedModulus {
///         time_s,
///         force_n: modulus(time_s) * 1e-5, // a held approach
///         youngs_modulus_pa: Estimate::new(modulus(time_s), 300.0),
///     })
/// };
/// let relaxing = time_dependence(&series(|t| 80e3 + 30e3 * (-t / 2.0).exp()), 0.0, 0.0)?;
/// assert!(matches!(relaxing, TimeDependence::Relaxes(_)));
/// // No sample stiffens while it is held, but a gain may rise.
/// let rising = time_dependence(&series(|t| 80e3 * (1.0 + 0.01 * t)), 0.0, 0.0)?;
/// assert!(matches!(rising, TimeDependence::Drifts { per_s } if (per_s.value - 0.01).abs() < 0.001));
/// // A gain that falls steadily is what a sample shows that relaxes over hours.
/// let falling = time_dependence(&series(|t| 80e3 * (1.0 - 0.01 * t)), 0.0, 0.0)?;
/// assert!(matches!(falling, TimeDependence::Undecided { change } if (change + 0.08).abs() < 0.01));
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize),
    serde(tag = "kind", rename_all = "snake_case")
)]
#[non_exhaustive]
pub enum TimeDependence {
    /// No change that the errors would not explain (one such series in a hundred is told as one of the others).
    Steady,
    /// The sample relaxes as a standard linear solid.
    Relaxes(StandardLinearSolid),
    /// The sensor's gain rises, in proportion to time.
    Drifts {
        /// Relative change of the gain in a second.
        per_s: Estimate,
    },
    /// The moduli change with time and either may be the reason: too few loads, a fall in proportion to time (a falling gain, or a time constant
    /// longer than the loads last), or a change that neither explains.
    Undecided {
        /// Relative change from the first load to the last.
        change: f64,
    },
}

/// E(t) = E∞ + (E₀ − E∞) exp(−t/τ), each parameter with its 95 % interval by the profile of the likelihood.
///
/// ```
/// use tactile_elasticity::modulus::Estimate;
/// use tactile_elasticity::relaxation::{TimeDependence, TimedModulus, time_dependence};
///
/// // A weight of 0.7 N on 110 kPa that relax to 80 kPa with 2 s: the compliance creeps with 2 s · 110/80.
/// let loads = [0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0].map(|time_s: f64| {
///     let compliance = 1.0 / 80e3 - (1.0 / 80e3 - 1.0 / 110e3) * (-time_s / 2.75).exp();
///     TimedModulus { time_s, force_n: 0.7, youngs_modulus_pa: Estimate::new(1.0 / compliance, 300.0) }
/// });
/// let TimeDependence::Relaxes(solid) = time_dependence(&loads, 0.0, 0.0)? else { unreachable!() };
/// assert!((solid.instantaneous_pa / 110e3 - 1.0).abs() < 1e-3 && solid.instantaneous_95_pa.contains(110e3));
/// assert!((solid.equilibrium_pa / 80e3 - 1.0).abs() < 1e-3 && solid.equilibrium_95_pa.contains(80e3));
/// assert!((solid.time_constant_s / 2.0 - 1.0).abs() < 1e-3 && solid.time_constant_95_s.contains(2.0));
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct StandardLinearSolid {
    /// E₀, that of a load too fast to relax.
    pub instantaneous_pa: f64,
    /// Interval of E₀.
    pub instantaneous_95_pa: Interval,
    /// E∞, that of a load held for ever.
    pub equilibrium_pa: f64,
    /// Interval of E∞.
    pub equilibrium_95_pa: Interval,
    /// τ, of the relaxation under a held approach; under a held force it creeps with τ E₀/E∞.
    pub time_constant_s: f64,
    /// Interval of τ.
    pub time_constant_95_s: Interval,
}
