//! A sphere pressed on the waveguide: pressure, contact radius, indentation and surface
//! displacement.
//!
//! The contact at a force follows from a closed form or from tabulated states over the radius.
//! States by finite elements for two balls are included in the crate.

use crate::error::{SimulateError, at_least, finite, not_negative, positive, within};
use crate::materials::{Elastic, ElasticSphere, LightGuide};
use std::borrow::Cow;
use std::f64::consts::{FRAC_PI_2, PI};

/// Largest relative difference allowed between a state's force and the integral of its pressure.
/// Finite-element pressures recovered at nodes deviate by up to several per cent if the mesh is
/// coarse. A wrong unit gives a much larger difference.
const LARGEST_FORCE_MISMATCH: f64 = 0.05;

/// Radius R of the balls.
const RADIUS_M_LIMIT: f64 = 3e-3;

/// The contact at one load.
///
/// ```
/// use std::f64::consts::PI;
/// use tactile_simulate::{PressLoad, PressOptions, PressScene};
/// let scene = PressScene::new(PressOptions {
///     loads: vec![PressLoad::normal(0.01)],
///     ..PressOptions::default()
/// })?;
/// let contact = scene.truth(0).contact;
/// let (a, r, e) = (
///     contact.contact_radius_m,
///     contact.sphere_radius_m,
///     contact.effective_modulus_pa,
/// );
/// let near = |found: f64, expected: f64| (found / expected - 1.0).abs() < 1e-12;
/// assert!(
///     near(a.powi(3), 0.75 * 0.01 * r / e) && a / r < 0.3,
///     "a³ = 3FR/(4E*)"
/// );
/// assert!(
///     near(contact.pressure_pa(0.0), 1.5 * 0.01 / (PI * a * a)) && contact.pressure_pa(a) == 0.0
/// );
/// assert!(
///     near(contact.apparent_height_m(0.6 * a), 0.8 * a),
///     "a hemisphere"
/// );
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct SimulatedContact {
    /// Normal force in newtons.
    pub force_n: f64,
    /// Radius of the undeformed sphere in metres.
    pub sphere_radius_m: f64,
    /// Radius a of the contact in metres. 0 without load.
    pub contact_radius_m: f64,
    /// Approach δ of the two bodies in metres.
    pub indentation_m: f64,
    /// Pressure p₀ = 3F/(2πa²) at the centre, in pascal.
    pub peak_pressure_pa: f64,
    /// E* of 1/E* = (1 − ν₁²)/E₁ + (1 − ν₂²)/E₂, in pascal.
    pub effective_modulus_pa: f64,
    /// Fraction E*·(1 − ν₂²)/E₂ of the indentation due to the waveguide, 0 to 1.
    pub waveguide_share: f64,
    /// The state at this force, for a tabulated contact.
    #[cfg_attr(feature = "serde", serde(skip))]
    given: Option<ContactState>,
}

impl SimulatedContact {
    /// The contact of `sphere` on `waveguide` at `force_n` ≥ 0.
    ///
    /// # Errors
    /// [`SimulateError::OutOfRange`] for a force above the last state of a tabulated contact.
    pub(crate) fn new(
        sphere: &ElasticSphere,
        waveguide: &LightGuide,
        law: &ContactModel,
        force_n: f64,
    ) -> Result<Self, SimulateError> {
        let largest = law.largest_force_n(sphere, waveguide)?;
        within("the force in N", force_n, 0.0, largest)?;
        let hertz = Self::hertz(sphere, waveguide, force_n);
        if let Some(states) = law.states(sphere, waveguide)? {
            // Without force there is no state to scale from; the contact is then Hertz's with
            // radius 0.
            let state = (force_n > 0.0).then(|| ContactState::at_force(&states, force_n));
            return Ok(match state.flatten() {
                Some(state) => hertz.with_state(state),
                None => hertz,
            });
        }
        Ok(match law {
            ContactModel::Tatara => Self {
                indentation_m: hertz.indentation_m
                    - far_side_m(sphere, force_n, hertz.contact_radius_m),
                ..hertz
            },
            _ => hertz,
        })
    }

    fn hertz(sphere: &ElasticSphere, waveguide: &LightGuide, force_n: f64) -> Self {
        let body = waveguide.series();
        let sphere_compliance = sphere.material.plane_strain_compliance();
        let waveguide_compliance = body.plane_strain_compliance();
        let effective_modulus_pa = 1.0 / (sphere_compliance + waveguide_compliance);
        let radius = sphere.radius_m;
        let a = (0.75 * force_n * radius / effective_modulus_pa).cbrt();
        // Without load the quotient would be 0/0.
        let peak_pressure_pa = if a > 0.0 {
            1.5 * force_n / (PI * a * a)
        } else {
            0.0
        };
        Self {
            force_n,
            sphere_radius_m: radius,
            contact_radius_m: a,
            indentation_m: a * a / radius,
            peak_pressure_pa,
            effective_modulus_pa,
            waveguide_share: waveguide_compliance * effective_modulus_pa,
            given: None,
        }
    }

    fn with_state(self, state: ContactState) -> Self {
        Self {
            // The effective modulus and the fraction of the guide are Hertz's, because a state has
            // none.
            contact_radius_m: state.contact_radius_m,
            indentation_m: state.indentation_m,
            peak_pressure_pa: state.peak_pressure_pa(),
            given: Some(state),
            ..self
        }
    }

    /// Whether the pressure is Hertzian, p₀ √(1 − r²/a²).
    pub(crate) fn is_hertzian(&self) -> bool {
        self.given.is_none()
    }

    /// Pressure at distance `r_m` from the centre, in pascals: p₀ √(1 − r²/a²) for a closed form,
    /// otherwise that of the state.
    pub fn pressure_pa(&self, r_m: f64) -> f64 {
        let a = self.contact_radius_m;
        if r_m >= a {
            return 0.0;
        }
        match &self.given {
            Some(state) => state.pressure_at_pa(r_m),
            // The product keeps its digits near the rim, where a² − r² cancels.
            None => self.peak_pressure_pa * ((a - r_m) * (a + r_m)).sqrt() / a,
        }
    }

    /// a/R. Hertz's law is valid while this ratio is small (a warning is given above 0.3).
    pub fn contact_ratio(&self) -> f64 {
        self.contact_radius_m / self.sphere_radius_m
    }

    /// Height of the *apparent* surface: the pressure interpreted as the shading of a frontally lit
    /// Lambertian surface, z(r) = ∫ᵣᵃ √((p₀/p)² − 1) dr with the largest pressure p₀. Hertz's
    /// pressure gives exactly a hemisphere of radius a, z = √(a² − r²), for any radius and modulus
    /// of the sphere. Zero outside.
    pub fn apparent_height_m(&self, r_m: f64) -> f64 {
        let a = self.contact_radius_m;
        if r_m >= a {
            return 0.0;
        }
        let Some(state) = &self.given else {
            return ((a - r_m) * (a + r_m)).sqrt();
        };
        // With r = a sin φ the integrand is finite at the rim, where p falls as √(a − r). The
        // midpoint rule avoids the rim itself, where the ratio is infinite.
        const STEPS: usize = 64;
        let first = (r_m / a).asin();
        let step = (FRAC_PI_2 - first) / STEPS as f64;
        let slope_at = |phi: f64| {
            let ratio = self.peak_pressure_pa / state.pressure_at_pa(a * phi.sin());
            // By rounding, interpolation can exceed the largest sample, hence the lower limit of
            // the root's argument.
            (ratio * ratio - 1.0).max(0.0).sqrt() * a * phi.cos()
        };
        let angles = (0..STEPS).map(|k| first + (k as f64 + 0.5) * step);
        angles.map(slope_at).sum::<f64>() * step
    }

    /// Vertical displacement in metres of the waveguide's surface at distance `r_m` from the
    /// centre, negative under the object. For a closed form it is the waveguide's fraction of the
    /// joint displacement under Hertz's pressure, otherwise that of the state.
    pub(crate) fn waveguide_height_m(&self, r_m: f64) -> f64 {
        match &self.given {
            Some(state) => state.height_at_m(r_m),
            None if self.contact_radius_m == 0.0 => 0.0,
            None => -self.waveguide_share * self.joint_displacement_m(r_m),
        }
    }

    /// Sum of the normal displacements of both surfaces at distance r (Johnson, eqs. 3.41a and
    /// 3.42a).
    fn joint_displacement_m(&self, r: f64) -> f64 {
        let (a, p0, e) = (
            self.contact_radius_m,
            self.peak_pressure_pa,
            self.effective_modulus_pa,
        );
        // The profile is a paraboloid inside and the field of the whole load outside. They are
        // equal at r = a.
        if r <= a {
            return PI * p0 * (2.0 * a * a - r * r) / (4.0 * a * e);
        }
        let q = a / r;
        if q < 0.02 {
            // (2q² − 1) asin q + q√(1 − q²) = (4/3) q³ (1 + q²/10 + 9q⁴/280 + …), the far field of
            // a point force.
            return 2.0 * p0 * a * q / (3.0 * e) * (1.0 + q * q * (0.1 + q * q * (9.0 / 280.0)));
        }
        p0 * a / (2.0 * e) * ((2.0 - 1.0 / (q * q)) * q.asin() + ((1.0 - q) * (1.0 + q)).sqrt() / q)
    }
}

/// Source of pressure, contact radius and indentation at a force.
///
/// ```
/// use tactile_simulate::{ContactModel, PressOptions, PressScene};
/// let contact = |law| {
///     let scene = PressScene::new(PressOptions { law, ..PressOptions::default() })?;
///     Ok::<_, tactile_simulate::SimulateError>(scene.truth(0).contact)
/// };
/// let (hertz, tatara) = (contact(ContactModel::Hertz)?, contact(ContactModel::Tatara)?);
/// assert_eq!(hertz.indentation_m, hertz.contact_radius_m.powi(2) / hertz.sphere_radius_m);
/// assert_eq!(tatara.contact_radius_m, hertz.contact_radius_m);
/// assert!(tatara.indentation_m < hertz.indentation_m);
/// // At 0.7 N, a/R is 0.92. Springs in series underestimate the stiffness of the layers.
/// let solved = contact(ContactModel::FiniteElements)?;
/// assert!(
///     (solved.contact_radius_m / 2.75e-3 - 1.0).abs() < 0.01
///         && hertz.contact_radius_m > 1.15 * solved.contact_radius_m
/// );
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum ContactModel {
    /// Hertz (1882): a³ = 3FR/(4E*), δ = a²/R. It is valid for small contacts, a ≪ R; the simulator
    /// applies it at any load.
    #[default]
    Hertz,
    /// Tatara (1991), first extension of Hertz to a sphere compressed between two surfaces. Radius
    /// and pressure are Hertz's. The approach is reduced by the displacement due to the force of
    /// the opposite contact: δ = a²/R − F/(πE₁)·[(1 − ν₁²)/√(a² + 4R²) + 2(1 + ν₁)R²/(a² +
    /// 4R²)^{3/2}]. Only the sphere's material (E₁, ν₁) enters the correction, because the
    /// waveguide is loaded on one side. The stiffening of rubber and the lateral spread of the
    /// contact are not included.
    ///
    /// Y. Tatara, J. Eng. Mater. Technol. 113 (1991) 285–291.
    Tatara,
    /// Finite elements at finite strain: the contacts of a ball of 3 mm of
    /// [`CL2000X`](crate::Elastic::CL2000X) or [`CL2003X`](crate::Elastic::CL2003X) on the [default
    /// waveguide](crate::LightGuide::default) up to 1.3 N, neo-Hookean and without friction,
    /// computed by `examples/contact_states.rs`. Other balls or waveguides are rejected: pass their
    /// contacts as [`Tabulated`](Self::Tabulated). The interpolation between the states is the same
    /// as there.
    FiniteElements,
    /// States computed elsewhere, in ascending order of force. At the force of a state, the contact
    /// equals this state. Between two states, the radius, the pressure over its mean, and the
    /// height over F^⅔ at equal r/a are linear in F^⅓. Below the first state, the contact is scaled
    /// by Hertz's laws. A load above the last state is rejected.
    /// [`PressScene::calibrate`](crate::PressScene::calibrate), which presses another object, uses
    /// Hertz's law.
    Tabulated(Vec<ContactState>),
}

impl ContactModel {
    pub(crate) fn validate(&self) -> Result<(), SimulateError> {
        let Self::Tabulated(states) = self else {
            return Ok(());
        };
        at_least("states", states.len(), 1)?;
        states.iter().try_for_each(ContactState::validate)?;
        // Equal forces would leave no interval for interpolation.
        for pair in states.windows(2) {
            within(
                "the force in N",
                pair[1].force_n,
                pair[0].force_n * (1.0 + EQUAL_FORCES),
                f64::MAX,
            )?;
        }
        Ok(())
    }

    /// The largest force with a defined contact.
    ///
    /// # Errors
    /// [`SimulateError::NoFiniteElements`].
    pub(crate) fn largest_force_n(
        &self,
        sphere: &ElasticSphere,
        waveguide: &LightGuide,
    ) -> Result<f64, SimulateError> {
        let states = self.states(sphere, waveguide)?;
        let largest = |last: &ContactState| last.force_n * (1.0 + EQUAL_FORCES);
        // A closed form is defined for any force; a table ends at its last state.
        Ok(states.map_or(f64::MAX, |s| s.last().map_or(0.0, largest)))
    }

    /// The states of a tabulated contact. `None` for a closed form.
    ///
    /// # Errors
    /// [`SimulateError::NoFiniteElements`].
    fn states(
        &self,
        sphere: &ElasticSphere,
        waveguide: &LightGuide,
    ) -> Result<Option<Cow<'_, [ContactState]>>, SimulateError> {
        match self {
            Self::Hertz | Self::Tatara => Ok(None),
            Self::FiniteElements => {
                let states = finite_element_states(sphere, waveguide);
                states
                    .map(|s| Some(Cow::Owned(s)))
                    .ok_or(SimulateError::NoFiniteElements)
            }
            Self::Tabulated(states) => Ok(Some(Cow::Borrowed(states))),
        }
    }
}

/// Reduction of the approach by the opposite contact for [`ContactModel::Tatara`], in metres.
fn far_side_m(sphere: &ElasticSphere, force_n: f64, a: f64) -> f64 {
    let (nu, r) = (sphere.material.poisson_ratio, sphere.radius_m);
    let d = (a * a + 4.0 * r * r).sqrt();
    force_n / (PI * sphere.material.youngs_modulus_pa)
        * ((1.0 - nu) * (1.0 + nu) / d + 2.0 * (1.0 + nu) * r * r / (d * d * d))
}

/// Forces with a smaller relative difference count as equal: a solver reaches a requested force
/// within its tolerance.
const EQUAL_FORCES: f64 = 1e-9;

/// An axisymmetric contact at one load, computed by other means, such as finite elements, integral
/// equations or a measurement.
///
/// The columns are samples over the distance r from the axis of the contact in the deformed
/// configuration. Between samples p² is linear in r², which is exact for Hertz's √(1 − r²/a²) and
/// follows the square-root decay at any rim. Heights are linear in r. The pressure is scaled to
/// carry `force_n` exactly.
///
/// ```
/// use tactile_simulate::{Camera, ContactModel, ContactState, PressLoad, PressOptions, PressScene};
/// let camera = Camera::default().coarser(16);
/// // A flat-topped pressure: 1.2 N on a disc of 4 mm radius, level in its inner half.
/// let radius_m: Vec<f64> = (0..=40).map(|k| 1e-4 * f64::from(k)).collect();
/// let shape = |r: f64| (1.0 - ((r - 2e-3).max(0.0) / 2e-3).powi(2)).sqrt();
/// let state = ContactState {
///     force_n: 1.2,
///     contact_radius_m: 4e-3,
///     indentation_m: 2e-3,
///     pressure_pa: radius_m.iter().map(|&r| 29.1e3 * shape(r)).collect(),
///     height_m: radius_m.iter().map(|&r| -1e-3 * shape(r)).collect(),
///     radius_m,
/// };
/// let options = PressOptions {
///     law: ContactModel::Tabulated(vec![state]),
///     loads: vec![PressLoad::normal(0.6), PressLoad::normal(1.2)],
///     camera,
///     ..PressOptions::default()
/// };
/// let truth = PressScene::new(options)?.truth(1);
/// let force_n = truth.pressure_pa().sum() * camera.pixel_size_m.iter().product::<f64>();
/// assert!((force_n / 1.2 - 1.0).abs() < 2e-3, "{force_n}");
/// let [middle, off] = [truth.contact.pressure_pa(0.0), truth.contact.pressure_pa(1.5e-3)];
/// assert!((off / middle - 1.0).abs() < 1e-12, "level in the middle");
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ContactState {
    /// Normal force in newtons.
    pub force_n: f64,
    /// Radius of the contact in metres. The pressure is zero from this radius on.
    pub contact_radius_m: f64,
    /// Approach of the two bodies in metres.
    pub indentation_m: f64,
    /// Distances from the axis in metres, ascending from 0. The last one is at least the contact
    /// radius.
    pub radius_m: Vec<f64>,
    /// Contact pressure in pascals at each distance.
    pub pressure_pa: Vec<f64>,
    /// Vertical displacement in metres of the waveguide's surface at each distance, negative under
    /// the object.
    pub height_m: Vec<f64>,
}

impl ContactState {
    pub(crate) fn validate(&self) -> Result<(), SimulateError> {
        positive("the force in N", self.force_n)?;
        positive("contact_radius_m", self.contact_radius_m)?;
        finite("indentation_m", self.indentation_m)?;
        let samples = self.radius_m.len();
        at_least("radius_m", samples, 2)?;
        for (field, found) in [
            ("pressure_pa", self.pressure_pa.len()),
            ("height_m", self.height_m.len()),
        ] {
            if found != samples {
                return Err(SimulateError::LengthMismatch {
                    field,
                    expected: samples,
                    found,
                });
            }
        }
        // The pressure at the centre must be a sample, because there is no extrapolation inwards.
        within("radius_m", self.radius_m[0], 0.0, 0.0)?;
        for pair in self.radius_m.windows(2) {
            positive("radius_m", pair[1] - pair[0])?;
        }
        // If the rim were outside the table, the pressure beyond the last sample would be unknown.
        let last = self.radius_m[samples - 1];
        within(
            "contact_radius_m",
            self.contact_radius_m,
            0.0,
            last * (1.0 + 1e-9),
        )?;
        for k in 0..samples {
            not_negative("pressure_pa", self.pressure_pa[k])?;
            finite("height_m", self.height_m[k])?;
        }
        let carried_n = self.carried_force_n();
        within(
            "the force in N",
            self.force_n,
            carried_n * (1.0 - LARGEST_FORCE_MISMATCH),
            carried_n * (1.0 + LARGEST_FORCE_MISMATCH),
        )
    }

    /// The same state, with its pressure scaled to carry its force exactly.
    fn balanced(mut self) -> Self {
        let scale = self.force_n / self.carried_force_n();
        self.pressure_pa.iter_mut().for_each(|p| *p *= scale);
        self
    }

    /// ∫ p dS with this interpolation: for q = p² linear in s = r², π ∫ √q ds over an interval from
    /// q₀ to q₁ is (2π/3)·Δs·(q₀ + √(q₀q₁) + q₁)/(√q₀ + √q₁).
    pub(crate) fn carried_force_n(&self) -> f64 {
        let rim = self.contact_radius_m;
        let mut force = 0.0;
        for pair in self.radius_m.windows(2) {
            // An interval that extends past the rim is cut there; one outside has zero width.
            let [from, to] = [pair[0].min(rim), pair[1].min(rim)];
            let [p0, p1] = [self.sampled_pressure_pa(from), self.sampled_pressure_pa(to)];
            // In terms of p the rule needs no root, but 0/0 must be avoided.
            if p0 + p1 > 0.0 {
                let mean = (p0 * p0 + p0 * p1 + p1 * p1) / (p0 + p1);
                force += 2.0 * PI / 3.0 * (to * to - from * from) * mean;
            }
        }
        force
    }

    /// The sample at the start of the interval that contains `r_m`.
    fn stretch(&self, r_m: f64) -> usize {
        let not_beyond = self.radius_m.partition_point(|&r| r <= r_m);
        not_beyond.saturating_sub(1).min(self.radius_m.len() - 2)
    }

    /// Pressure at a distance from the axis, in pascals. 0 from the rim on.
    pub(crate) fn pressure_at_pa(&self, r_m: f64) -> f64 {
        if r_m >= self.contact_radius_m {
            0.0
        } else {
            self.sampled_pressure_pa(r_m)
        }
    }

    fn sampled_pressure_pa(&self, r_m: f64) -> f64 {
        let k = self.stretch(r_m);
        let [q0, q1] = [self.pressure_pa[k].powi(2), self.pressure_pa[k + 1].powi(2)];
        // The rim usually lies between two samples: the pressure falls to zero there, not at the
        // next sample.
        let last = self.radius_m[k + 1];
        let end = if q1 == 0.0 {
            last.min(self.contact_radius_m)
        } else {
            last
        };
        let [from, to] = [self.radius_m[k].powi(2), end * end];
        // The rim may coincide with the previous sample, so that the interval is empty.
        let t = if to > from {
            ((r_m * r_m - from) / (to - from)).clamp(0.0, 1.0)
        } else {
            1.0
        };
        (q0 + t * (q1 - q0)).sqrt()
    }

    /// Height at a distance from the axis, in metres. Outside the last sample it decays as 1/r,
    /// like the displacement of a point load.
    pub(crate) fn height_at_m(&self, r_m: f64) -> f64 {
        let last = self.radius_m.len() - 1;
        if r_m > self.radius_m[last] {
            return self.height_m[last] * self.radius_m[last] / r_m;
        }
        let k = self.stretch(r_m);
        let [from, to] = [self.radius_m[k], self.radius_m[k + 1]];
        let t = (r_m - from) / (to - from);
        self.height_m[k] + t * (self.height_m[k + 1] - self.height_m[k])
    }

    /// The largest pressure of the table, in pascals.
    fn peak_pressure_pa(&self) -> f64 {
        (self.radius_m.iter().copied())
            .map(|r| self.pressure_at_pa(r))
            .fold(0.0, f64::max)
    }

    /// The state at `force_n` > 0 from `states` of ascending force: one of them if the force
    /// matches, otherwise an interpolation. a, p over its mean, z/F^⅔ and δ/F^⅔ are linear in F^⅓.
    /// Below the first state, it is scaled by Hertz's laws, a ∝ F^⅓ and z ∝ F^⅔. `None` above the
    /// last.
    pub(crate) fn at_force(states: &[Self], force_n: f64) -> Option<Self> {
        // The first state at or above the force, including one within the tolerance.
        let next = states.partition_point(|s| s.force_n < force_n * (1.0 - EQUAL_FORCES));
        let upper = states.get(next)?;
        let scale = (force_n / upper.force_n).cbrt();
        let state = match next.checked_sub(1).map(|k| &states[k]) {
            _ if (scale - 1.0).abs() < EQUAL_FORCES => Self {
                force_n,
                ..upper.clone()
            },
            None => upper.scaled(force_n, scale),
            Some(lower) => {
                let from = (lower.force_n / upper.force_n).cbrt();
                Self::between(lower, upper, (scale - from) / (1.0 - from), force_n)
            }
        };
        Some(state.balanced())
    }

    /// This state scaled to `force_n` by Hertz's laws, with `scale` = (F/F₀)^⅓.
    fn scaled(&self, force_n: f64, scale: f64) -> Self {
        Self {
            force_n,
            contact_radius_m: self.contact_radius_m * scale,
            indentation_m: self.indentation_m * scale * scale,
            radius_m: self.radius_m.iter().map(|r| r * scale).collect(),
            pressure_pa: self.pressure_pa.iter().map(|p| p * scale).collect(),
            height_m: self.height_m.iter().map(|z| z * scale * scale).collect(),
        }
    }

    /// The state at `force_n`, at the fraction `t` from `lower` to `upper`, for equal r/a.
    fn between(lower: &Self, upper: &Self, t: f64, force_n: f64) -> Self {
        let mix = |of: &dyn Fn(&Self) -> f64| of(lower) + t * (of(upper) - of(lower));
        // The interpolated quantities are constant under Hertz's laws: z/F^⅔, δ/F^⅔, and p over its
        // mean.
        let depth = |force_n: f64| force_n.cbrt().powi(2);
        let mean_pressure = |force_n: f64, radius_m: f64| force_n / (PI * radius_m * radius_m);
        let contact_radius_m = mix(&|s| s.contact_radius_m);
        let pressure = |ratio: f64| {
            let normalised = mix(&|s| {
                let own_mean = mean_pressure(s.force_n, s.contact_radius_m);
                s.pressure_at_pa(ratio * s.contact_radius_m) / own_mean
            });
            normalised * mean_pressure(force_n, contact_radius_m)
        };
        let height = |ratio: f64| {
            let normalised = mix(&|s| s.height_at_m(ratio * s.contact_radius_m) / depth(s.force_n));
            normalised * depth(force_n)
        };
        // The samples are those of the upper state. The lower state is interpolated at equal r/a.
        let ratios: Vec<f64> = (upper.radius_m.iter())
            .map(|r| r / upper.contact_radius_m)
            .collect();
        Self {
            force_n,
            contact_radius_m,
            indentation_m: mix(&|s| s.indentation_m / depth(s.force_n)) * depth(force_n),
            radius_m: ratios
                .iter()
                .map(|ratio| ratio * contact_radius_m)
                .collect(),
            pressure_pa: ratios.iter().map(|&ratio| pressure(ratio)).collect(),
            height_m: ratios.iter().map(|&ratio| height(ratio)).collect(),
        }
    }
}

/// One row per point: modulus and radius of the ball, layers of the guide, force, contact radius
/// and approach of the state, then distance, pressure and height. Written by
/// `examples/contact_states.rs`.
const POINTS: &str = include_str!("finite_elements.csv");

/// The states of a ball on a waveguide, in ascending order of force. `None` for bodies that were
/// not computed.
pub(crate) fn finite_element_states(
    sphere: &ElasticSphere,
    waveguide: &LightGuide,
) -> Option<Vec<ContactState>> {
    // The comparison is exact, because contacts are tabulated only for identical bodies.
    let known = [Elastic::CL2000X, Elastic::CL2003X].contains(&sphere.material);
    let elastic = |w: &LightGuide| -> Vec<(f64, Elastic)> {
        w.layers
            .iter()
            .map(|l| (l.thickness_m, l.material))
            .collect()
    };
    let same_guide = elastic(waveguide) == elastic(&LightGuide::default());
    if !known || !same_guide || sphere.radius_m != RADIUS_M_LIMIT {
        return None;
    }
    let mut states: Vec<ContactState> = Vec::new();
    for row in POINTS.lines().skip(1) {
        // The layers in the third column are those of the default waveguide.
        let cells = row
            .split(',')
            .enumerate()
            .filter(|(column, _)| *column != 2);
        let numbers: Option<Vec<f64>> = cells.map(|(_, cell)| cell.parse().ok()).collect();
        let [
            modulus,
            _radius,
            force_n,
            contact_radius_m,
            indentation_m,
            r,
            pressure,
            height,
        ] = numbers?.try_into().ok()?;
        if modulus != sphere.material.youngs_modulus_pa {
            continue;
        }
        // The rows of a state are contiguous: another force starts the next state.
        if states.last().is_none_or(|s| s.force_n != force_n) {
            states.push(ContactState {
                force_n,
                contact_radius_m,
                indentation_m,
                radius_m: Vec::new(),
                pressure_pa: Vec::new(),
                height_m: Vec::new(),
            });
        }
        if let Some(state) = states.last_mut() {
            state.radius_m.push(r);
            state.pressure_pa.push(pressure);
            state.height_m.push(height);
        }
    }
    Some(states)
}
