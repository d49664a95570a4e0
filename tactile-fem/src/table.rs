//! Contact tables by finite elements.

use crate::{AppliedLoad, FemScene, Guide, GuideLayer, Material, ObjectPress, ObjectShape, State};
use core::ops::ControlFlow;
use tactile_core::Progress;
use tactile_elasticity::contact::{Bond, ContactCurve, ContactTable, Waveguide};
use tactile_elasticity::laws::{ContactLaw, ContactLength, WaveguideLaw};
use tactile_elasticity::{ElasticityError, Quantity};

/// Highest power of the radius with which the force may grow between two contacts. Above it the
/// ball has sunk in to its equator, and the contact is the last of its curve. Polynomials that
/// follow the bend there would have errors of 2 % of the force everywhere instead of 0.6 %.
const STEEPEST: f64 = 6.0;

/// The smallest computed a/R: at 0.1 the elements have an error of 0.5 % of the contact radius.
const SMALLEST_RATIO: f64 = 0.15;

/// Number of contacts per modulus.
const CONTACTS: usize = 16;

/// A contact radius with a larger relative uncertainty is skipped: the error of the force would be
/// three times as large.
const LARGEST_UNCERTAINTY: f64 = 5e-3;

/// Range of a table.
///
/// ```
/// use tactile_fem::ContactTableOptions;
///
/// let options = ContactTableOptions::default().with_moduli_pa(20e3, 400e3, 10)?;
/// assert!(ContactTableOptions::default().with_moduli_pa(400e3, 20e3, 10).is_err());
/// # let _ = options;
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactTableOptions {
    lowest_pa: f64,
    highest_pa: f64,
    moduli: usize,
    largest_ratio: f64,
}

impl Default for ContactTableOptions {
    /// Seven moduli from 25 to 400 kPa, contact radii up to 1.25 ball radii.
    ///
    /// With seven moduli the interpolation error is smaller than the scatter of the contact radius
    /// from the elements (`cargo bench -p tactile-benches --features fem --bench finite_elements`
    /// prints both).
    fn default() -> Self {
        Self {
            lowest_pa: 25e3,
            highest_pa: 400e3,
            moduli: 7,
            largest_ratio: 1.25,
        }
    }
}

impl ContactTableOptions {
    /// Sets the smallest and the largest modulus of the ball (Pa), and the number of moduli in
    /// equal ratios. A rigid flat uses a single modulus.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`]; [`ElasticityError::OutOfRange`] if the second modulus is
    /// not above the first; [`ElasticityError::LengthMismatch`] for fewer than two moduli.
    pub fn with_moduli_pa(
        mut self,
        lowest_pa: f64,
        highest_pa: f64,
        count: usize,
    ) -> Result<Self, ElasticityError> {
        Quantity::YoungsModulus.positive(lowest_pa)?;
        Quantity::YoungsModulus.positive(highest_pa)?;
        if highest_pa <= lowest_pa {
            return Err(Quantity::YoungsModulus.beyond(highest_pa, lowest_pa));
        }
        Quantity::YoungsModulus.at_least(count, 2)?;
        (self.lowest_pa, self.highest_pa, self.moduli) = (lowest_pa, highest_pa, count);
        Ok(self)
    }

    /// Sets the largest contact radius relative to the ball's (default 1.25).
    ///
    /// ```
    /// use tactile_fem::ContactTableOptions;
    ///
    /// assert!(ContactTableOptions::default().with_largest_ratio(0.6).is_ok());
    /// assert!(ContactTableOptions::default().with_largest_ratio(f64::NAN).is_err());
    /// ```
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`].
    pub fn with_largest_ratio(mut self, ratio: f64) -> Result<Self, ElasticityError> {
        self.largest_ratio = Quantity::ContactRadius.positive(ratio)?;
        Ok(self)
    }

    fn moduli(&self, rigid: bool) -> Vec<f64> {
        if rigid {
            // Forces are proportional to the modulus, so any modulus will do.
            return vec![(self.lowest_pa * self.highest_pa).sqrt()];
        }
        let last = (self.moduli - 1) as f64;
        let growth = (self.highest_pa / self.lowest_pa).ln();
        (0..self.moduli)
            .map(|k| self.lowest_pa * (growth * k as f64 / last).exp())
            .collect()
    }
}

/// Radius of the guide relative to the ball's and to its own thickness: for a larger radius its rim
/// does not affect the contact (`the_rim_of_the_guide_is_not_felt`).
const GUIDE_RADIUS: [f64; 2] = [4.0, 2.5];
/// The largest Poisson ratio of the elements, used for ν = ½. It reduces the force at a given
/// radius by 0.1 to 0.2 %, less than the error of the elements. At 0.4999 the first contact of a
/// ball of 25 kPa on a stiffer guide does not converge.
const LARGEST_POISSON_RATIO: f64 = 0.499;

/// Computes a table by finite elements at finite strain, without friction. The ball of radius R (m)
/// and Poisson ratio ν is neo-Hookean. It is pressed on neo-Hookean layers bonded to rigid glass,
/// or on a rigid flat. ν above 0.499 is computed as 0.499.
///
/// `progress` is called before each modulus and after the last, and ends the computation with
/// [`ControlFlow::Break`]. Contacts that the solver does not reach are skipped:
/// [`ContactTable::force_n`] is `None` there.
///
/// ```
/// use core::ops::ControlFlow;
/// use tactile_elasticity::contact::Waveguide;
/// use tactile_fem::{ContactTableOptions, solve_contact_table};
///
/// let options = ContactTableOptions::default().with_largest_ratio(0.5)?;
/// let mut steps = 0;
/// let table = solve_contact_table(3e-3, 0.495, &Waveguide::rigid(), &options, |progress| {
///     steps = progress.total;
///     ControlFlow::Continue(())
/// })?;
/// // On a rigid flat one modulus is enough. At a/R = 0.4 finite strain reduces Hertz's force by
/// // about 3 %.
/// assert_eq!(steps, 1);
/// let hertz_n = 4.0 / 3.0 * 103e3 / (1.0 - 0.495_f64.powi(2)) * 1.2e-3_f64.powi(3) / 3e-3;
/// let ratio = table.force_n(1.2e-3, 103e3).unwrap() / hertz_n;
/// assert!((0.95..0.98).contains(&ratio), "{ratio}");
/// let cancelled =
///     solve_contact_table(3e-3, 0.495, &Waveguide::rigid(), &options, |_| ControlFlow::Break(()));
/// assert!(cancelled.is_err());
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
///
/// # Errors
/// [`ElasticityError::Cancelled`]; [`ElasticityError::NotReached`] if a modulus has fewer than four
/// contacts; those of [`ContactTable::new`].
pub fn solve_contact_table(
    radius_m: f64,
    poisson_ratio: f64,
    guide: &Waveguide,
    options: &ContactTableOptions,
    mut progress: impl FnMut(Progress) -> ControlFlow<()>,
) -> Result<ContactTable, ElasticityError> {
    let law = WaveguideLaw::new(radius_m, poisson_ratio, guide, Bond::Bonded)?;
    let moduli = options.moduli(guide.layers().is_empty());
    let mut report = |done| match progress(Progress::new(done, moduli.len())) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(ElasticityError::Cancelled),
    };
    let mut curves = Vec::with_capacity(moduli.len());
    for (k, &youngs_modulus_pa) in moduli.iter().enumerate() {
        report(k)?;
        let ball = Ball {
            radius_m,
            poisson_ratio,
            youngs_modulus_pa,
        };
        curves.push(ball.curve(guide, &law, options)?);
    }
    report(moduli.len())?;
    ContactTable::new(radius_m, poisson_ratio, guide, curves)
}

#[derive(Clone, Copy)]
struct Ball {
    radius_m: f64,
    poisson_ratio: f64,
    youngs_modulus_pa: f64,
}

impl Ball {
    fn curve(
        &self,
        guide: &Waveguide,
        law: &WaveguideLaw,
        options: &ContactTableOptions,
    ) -> Result<ContactCurve, ElasticityError> {
        let solution = self.scene(guide)?.solve(&self.loads(guide, law, options));
        let mut curve = ContactCurve {
            youngs_modulus_pa: self.youngs_modulus_pa,
            contact_radius_m: Vec::new(),
            force_n: Vec::new(),
        };
        for state in &solution.states {
            let Some(radius) = certain_radius(state) else {
                continue;
            };
            let force = state.force_n();
            if let (Some(before), Some(smaller)) =
                (curve.force_n.last(), curve.contact_radius_m.last())
                && (force / before).ln() > STEEPEST * (radius / smaller).ln()
            {
                break;
            }
            curve.contact_radius_m.push(radius);
            curve.force_n.push(force);
        }
        if curve.force_n.len() < ContactCurve::FEWEST_CONTACTS {
            return Err(ElasticityError::NotReached {
                youngs_modulus_pa: self.youngs_modulus_pa,
                force_n: solution.states.last().map_or(0.0, State::force_n),
            });
        }
        Ok(curve)
    }

    fn scene(&self, guide: &Waveguide) -> Result<FemScene, ElasticityError> {
        let material = |e, nu: f64| Material::new(e, nu.min(LARGEST_POISSON_RATIO));
        let ball = material(self.youngs_modulus_pa, self.poisson_ratio)?;
        let radius_m = self.radius_m;
        let press = ObjectPress::new(ObjectShape::Ball { radius_m }, ball)?;
        if guide.layers().is_empty() {
            return press.scene();
        }
        let present = guide.layers().iter().filter(|l| l.thickness_m > 0.0);
        let layers: Result<Vec<_>, _> = present
            .map(|l| {
                Ok::<_, ElasticityError>(GuideLayer {
                    thickness_m: l.thickness_m,
                    material: material(l.youngs_modulus_pa, l.poisson_ratio)?,
                })
            })
            .collect();
        let radius = (GUIDE_RADIUS[0] * self.radius_m).max(GUIDE_RADIUS[1] * guide.thickness_m());
        press.on_guide(Guide::new(layers?, radius)?)?.scene()
    }

    /// Forces for which the layered law predicts contact radii in equal steps.
    fn loads(
        &self,
        guide: &Waveguide,
        law: &WaveguideLaw,
        options: &ContactTableOptions,
    ) -> Vec<AppliedLoad> {
        let compliance = |e: f64, nu: f64| (1.0 - nu * nu) / e;
        let own = compliance(self.youngs_modulus_pa, self.poisson_ratio);
        let touched = guide.layers().iter().find(|l| l.thickness_m > 0.0);
        let other = touched.map_or(0.0, |l| compliance(l.youngs_modulus_pa, l.poisson_ratio));
        let reduced = 1.0 / (own + other);
        let last = (CONTACTS - 1) as f64;
        (0..CONTACTS)
            .map(|k| {
                let step = (options.largest_ratio - SMALLEST_RATIO) * k as f64 / last;
                (SMALLEST_RATIO + step) * self.radius_m
            })
            .filter_map(|a| {
                law.log_force(ContactLength::Radius(a), other * reduced)
                    .at()
            })
            .map(|force| AppliedLoad::Force(reduced * force.value().exp()))
            .collect()
    }
}

/// The contact radius, if the mesh determines it accurately enough.
fn certain_radius(state: &State) -> Option<f64> {
    let radius = state.contact_radius()?;
    (radius.uncertainty_m <= LARGEST_UNCERTAINTY * radius.radius_m).then_some(radius.radius_m)
}
