//! A contact computed elsewhere, given as numbers over the radius.

use std::f64::consts::PI;

use super::error::{SimulateError, at_least, finite, not_negative, positive, within};

/// Largest relative difference allowed between a state's force and the integral of its pressure. Finite-element pressures
/// recovered at nodes miss the force by up to some percent where the mesh is coarse; a wrong unit misses it by far more.
const LARGEST_FORCE_MISMATCH: f64 = 0.05;

/// Forces that differ by no more than this part are one: a solver meets the force that it was asked for within its tolerance.
pub(super) const EQUAL_FORCES: f64 = 1e-9;

/// An axisymmetric contact at one load, computed by other means: finite elements, integral equations, a measurement.
///
/// The columns are samples over the distance r from the contact's axis in the deformed configuration. Between samples p² is linear
/// in r², which is exact for Hertz's √(1 − r²/a²) and follows the square-root fall at any rim; heights are linear in r.
/// The pressure is scaled to carry `force_n` exactly.
///
/// ```
/// use tactile_simulate::{Camera, ContactLaw, ContactState, Load, PressOptions, PressScene};
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
///     law: ContactLaw::Tabulated(vec![state]),
///     loads: vec![Load::normal(0.6), Load::normal(1.2)],
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
    /// Normal force in newton.
    pub force_n: f64,
    /// Radius of the contact in metres; the pressure is taken as 0 from here on.
    pub contact_radius_m: f64,
    /// Approach of the two bodies in metres.
    pub indentation_m: f64,
    /// Distances from the axis in metres: 0 first, then growing, beyond the contact's rim at the last or at it.
    pub radius_m: Vec<f64>,
    /// Contact pressure in pascal at each distance.
    pub pressure_pa: Vec<f64>,
    /// Vertical displacement in metres of the waveguide's surface at each distance, negative under the object.
    pub height_m: Vec<f64>,
}

impl ContactState {
    pub(super) fn validate(&self) -> Result<(), SimulateError> {
        positive("force_n", self.force_n)?;
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
        within("radius_m", self.radius_m[0], 0.0, 0.0)?;
        for pair in self.radius_m.windows(2) {
            positive("radius_m", pair[1] - pair[0])?;
        }
        // Without the rim inside the table the last sample's pressure would have to be guessed.
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
            "force_n",
            self.force_n,
            carried_n * (1.0 - LARGEST_FORCE_MISMATCH),
            carried_n * (1.0 + LARGEST_FORCE_MISMATCH),
        )
    }

    /// The same state with its pressure scaled to carry its force exactly.
    fn balanced(mut self) -> Self {
        let scale = self.force_n / self.carried_force_n();
        self.pressure_pa.iter_mut().for_each(|p| *p *= scale);
        self
    }

    /// ∫ p dS as interpolated: with q = p² linear in s = r², π ∫ √q ds over a stretch from q₀ to q₁ is
    /// (2π/3)·Δs·(q₀ + √(q₀q₁) + q₁)/(√q₀ + √q₁).
    pub(super) fn carried_force_n(&self) -> f64 {
        let rim = self.contact_radius_m;
        let mut force = 0.0;
        for pair in self.radius_m.windows(2) {
            let [from, to] = [pair[0].min(rim), pair[1].min(rim)];
            let [p0, p1] = [self.sampled_pressure_pa(from), self.sampled_pressure_pa(to)];
            if p0 + p1 > 0.0 {
                let mean = (p0 * p0 + p0 * p1 + p1 * p1) / (p0 + p1);
                force += 2.0 * PI / 3.0 * (to * to - from * from) * mean;
            }
        }
        force
    }

    /// The sample that begins the stretch in which `r_m` lies.
    fn stretch(&self, r_m: f64) -> usize {
        let not_beyond = self.radius_m.partition_point(|&r| r <= r_m);
        not_beyond.saturating_sub(1).min(self.radius_m.len() - 2)
    }

    /// Pressure at a distance from the axis, in pascal; 0 from the rim on.
    pub(super) fn pressure_at_pa(&self, r_m: f64) -> f64 {
        if r_m >= self.contact_radius_m {
            0.0
        } else {
            self.sampled_pressure_pa(r_m)
        }
    }

    fn sampled_pressure_pa(&self, r_m: f64) -> f64 {
        let k = self.stretch(r_m);
        let [q0, q1] = [self.pressure_pa[k].powi(2), self.pressure_pa[k + 1].powi(2)];
        // The rim mostly lies between two samples: the pressure falls to zero there, not at the sample beyond.
        let last = self.radius_m[k + 1];
        let end = if q1 == 0.0 {
            last.min(self.contact_radius_m)
        } else {
            last
        };
        let [from, to] = [self.radius_m[k].powi(2), end * end];
        let t = if to > from {
            ((r_m * r_m - from) / (to - from)).clamp(0.0, 1.0)
        } else {
            1.0
        };
        (q0 + t * (q1 - q0)).sqrt()
    }

    /// Height at a distance from the axis, in metres. Beyond the last sample it falls off as 1/r, a point load's displacement.
    pub(super) fn height_at_m(&self, r_m: f64) -> f64 {
        let last = self.radius_m.len() - 1;
        if r_m > self.radius_m[last] {
            return self.height_m[last] * self.radius_m[last] / r_m;
        }
        let k = self.stretch(r_m);
        let [from, to] = [self.radius_m[k], self.radius_m[k + 1]];
        let t = (r_m - from) / (to - from);
        self.height_m[k] + t * (self.height_m[k + 1] - self.height_m[k])
    }

    /// The largest pressure of the table, in pascal.
    pub(super) fn peak_pressure_pa(&self) -> f64 {
        (self.radius_m.iter().copied())
            .map(|r| self.pressure_at_pa(r))
            .fold(0.0, f64::max)
    }

    /// The state at `force_n` > 0 among `states` of growing force: one of them where the force is its own, else between
    /// two of them, with a, p over its mean, z/F^⅔ and δ/F^⅔ linear in F^⅓. Below
    /// the first, that one shrunk by Hertz's scaling, a ∝ F^⅓ and z ∝ F^⅔. None above the last.
    pub(super) fn at_force(states: &[Self], force_n: f64) -> Option<Self> {
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

    /// The state at `force_n`, `t` of the way from `lower` to `upper`, at equal r/a.
    fn between(lower: &Self, upper: &Self, t: f64, force_n: f64) -> Self {
        let mix = |of: &dyn Fn(&Self) -> f64| of(lower) + t * (of(upper) - of(lower));
        // What Hertz's laws leave constant is mixed: z/F^⅔, δ/F^⅔, and p over its mean.
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

#[cfg(test)]
mod tests {
    use super::super::contact::Contact;
    use super::super::contact_law::ContactLaw;
    use super::super::material::{Elastic, Sphere, Waveguide};
    use super::*;

    /// Hertz's contact as a table of `samples` distances out to 1.5 a.
    fn hertz(force_n: f64, samples: usize) -> (Contact, ContactState) {
        let sphere = Sphere {
            radius_m: 3e-3,
            material: Elastic::CL2000X,
        };
        let contact =
            Contact::new(&sphere, &Waveguide::default(), &ContactLaw::Hertz, force_n).unwrap();
        let a = contact.contact_radius_m;
        let radius_m: Vec<f64> = (0..samples)
            .map(|k| 1.5 * a * k as f64 / (samples - 1) as f64)
            .collect();
        let state = ContactState {
            force_n,
            contact_radius_m: a,
            indentation_m: contact.indentation_m,
            pressure_pa: radius_m.iter().map(|&r| contact.pressure_pa(r)).collect(),
            height_m: radius_m
                .iter()
                .map(|&r| contact.waveguide_height_m(r))
                .collect(),
            radius_m,
        };
        (contact, state)
    }

    #[test]
    fn hertz_survives_its_table() {
        // 16 samples: the rim, at 10/15 of the last, is one of them.
        let (contact, state) = hertz(0.7, 16);
        state.validate().unwrap();
        // p² is linear in r² for Hertz: only rounding is left.
        assert!((state.carried_force_n() / 0.7 - 1.0).abs() < 1e-12);
        for k in 0..100 {
            let r = 1.2 * contact.contact_radius_m * f64::from(k) / 100.0;
            let difference = state.pressure_at_pa(r) - contact.pressure_pa(r);
            assert!(
                difference.abs() < 1e-7 * contact.peak_pressure_pa,
                "{difference}"
            );
        }
        // Heights are linear between samples: a parabola's chord is off by h²/8R, h = a/10.
        let r = 0.55 * contact.contact_radius_m;
        let chord = contact.contact_radius_m.powi(2) / 100.0 / (8.0 * 3e-3);
        assert!((state.height_at_m(r) - contact.waveguide_height_m(r)).abs() < 1.01 * chord);
    }

    #[test]
    fn states_between_and_below_hertz_are_hertz() {
        let states = [hertz(0.2, 301).1, hertz(1.2, 301).1];
        for force_n in [0.01, 0.2, 0.6, 1.2] {
            let found = ContactState::at_force(&states, force_n).unwrap();
            let (expected, _) = hertz(force_n, 2);
            let close = |x: f64, y: f64| (x / y - 1.0).abs() < 1e-9;
            assert!(
                close(found.contact_radius_m, expected.contact_radius_m),
                "{force_n}"
            );
            assert!(close(found.carried_force_n(), force_n));
            let r = 0.4 * expected.contact_radius_m;
            assert!(close(found.pressure_at_pa(r), expected.pressure_pa(r)));
            // Heights are linear between the samples: a chord of a/200 is off by some 1e-5 of the height.
            let height = found.height_at_m(r) / expected.waveguide_height_m(r);
            assert!((height - 1.0).abs() < 1e-4, "{force_n} {height}");
        }
        assert_eq!(ContactState::at_force(&states, 1.3), None);
    }

    #[test]
    fn a_table_without_meaning_is_refused() {
        let (_, good) = hertz(0.7, 16);
        let refused = |change: &dyn Fn(&mut ContactState)| {
            let mut state = good.clone();
            change(&mut state);
            state.validate().unwrap_err()
        };
        let names = [
            refused(&|s| s.force_n = 1.0),
            refused(&|s| s.force_n = f64::NAN),
            refused(&|s| s.radius_m[0] = 1e-6),
            refused(&|s| s.radius_m.swap(3, 4)),
            refused(&|s| s.pressure_pa[2] = -1.0),
            refused(&|s| s.height_m[2] = f64::INFINITY),
            refused(&|s| s.contact_radius_m *= 1.6),
            refused(&|s| s.indentation_m = f64::NAN),
        ];
        let fields = [
            "force_n",
            "force_n",
            "radius_m",
            "radius_m",
            "pressure_pa",
            "height_m",
            "contact_radius_m",
            "indentation_m",
        ];
        for (error, expected) in names.iter().zip(fields) {
            assert!(
                matches!(error, SimulateError::OutOfRange { field, .. } if *field == expected),
                "{error}"
            );
        }
        let long = refused(&|s| s.height_m.push(0.0));
        assert_eq!(
            long,
            SimulateError::LengthMismatch {
                field: "height_m",
                expected: 16,
                found: 17
            }
        );
        let short = refused(&|s| s.pressure_pa.truncate(15));
        assert_eq!(
            short,
            SimulateError::LengthMismatch {
                field: "pressure_pa",
                expected: 16,
                found: 15
            }
        );
    }
}
