//! Specimens with a flat face, compressed without friction: strain and conjugate stress from the
//! area of the face.
//!
//! Under uniaxial load a block or a cylinder of any outline deforms homogeneously. The face
//! stretches by λ_t in its plane and by λ_z normal to it, and its area is A = A₀ λ_t². Let f be a
//! strain measure (for Green–Lagrange f(λ) = ½(λ² − 1)), with Poisson's ratio defined by the same
//! measure: f(λ_t) = −ν f(λ_z). For Hencky's measure and ν = ½ this is incompressibility, λ_z
//! λ_t² = 1. The stress conjugate to the measure does the work of the force: S df = (F/A₀) dλ_z,
//! hence
//!
//! S = F / (A₀ f′(λ_z)),
//!
//! which is the second Piola–Kirchhoff stress for Green–Lagrange, F/A₀ (engineering stress) for
//! Biot's measure, and J times the true stress F/A for Hencky's. The material law is S = E f(λ_z),
//! equation (31).
//!
//! Frames show only pressed faces, so A₀ is not measured. It is the area for which the line of S
//! over e passes through the origin: from n ≥ 2 loads, both unknowns E and A₀ are determined. To
//! first order E = 2ν ΔF/ΔA, which does not contain A₀. The error of A₀ is of the order of that of
//! E times the strain, and is neglected.
//!
//! The method assumes no friction. A face that sticks to the plate stretches less than the material
//! above it, so E is overestimated.

use super::bodies::Bodies;
use super::load::{LoadSeries, LoadState, validated};
use super::ratio::LINEAR_STRAIN;
use super::regression::StressStrainRegression;
use crate::error::{ElasticityError, Quantity};
use crate::strain::StrainMeasure;
use nalgebra::Matrix3;
use tactile_core::{Source, Uncertain};

// Maximum number of steps to the unloaded area. Each step reduces the error by a factor of about
// the strain, down to rounding for strains up to a third.
const AREA_STEPS: usize = 60;
// Range of axial stretches. Outside it no law with a single modulus is valid.
const STRETCHES: [f64; 2] = [0.05, 4.0];

/// The loads of a specimen with a flat face, with areas converted to strains and conjugate
/// stresses.
///
/// ```
/// use tactile_elasticity::modulus::{
///     Estimate, LoadSeries, LoadState, ModulusEstimator, StressStrainRegression, UniaxialLoads,
/// };
/// use tactile_elasticity::strain::GreenLagrange;
///
/// // A face of 1 cm² of 100 kPa and ν = ½, compressed by e = 2 % and 5 %: λ_z = √(1 − 2e),
/// // A = A₀(1 + e), F = E e λ_z A₀.
/// let load = |e: f64| LoadState::new(Estimate::new(100e3 * e * (1.0 - 2.0 * e).sqrt() * 1e-4, 1e-4))
///     .with_area(Estimate::new(1e-4 * (1.0 + e), 1e-9));
/// let uniaxial = UniaxialLoads::new(
///     &LoadSeries::new([load(0.02), load(0.05)]),
///     0.5,
///     &GreenLagrange,
/// )?;
/// assert!((uniaxial.unloaded_area_m2 / 1e-4 - 1.0).abs() < 1e-9);
/// let [_lateral, axial] = uniaxial.stretches[1];
/// assert!((axial - 0.9f64.sqrt()).abs() < 1e-9);
/// let modulus = StressStrainRegression.estimate(&uniaxial.series)?;
/// assert!((modulus.youngs_modulus_pa / 100e3 - 1.0).abs() < 1e-9);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct UniaxialLoads {
    /// The loads with their strains, for a [`StressStrainRegression`].
    pub series: LoadSeries,
    /// Stretches of the face in its plane and normal to it, λ_t and λ_z, for each load.
    pub stretches: Vec<[f64; 2]>,
    /// Area of the unloaded face in m².
    pub unloaded_area_m2: f64,
}

impl UniaxialLoads {
    /// Finds A₀ and the state of each load that has a contact area. Other loads get only a force.
    /// O(loads).
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`] for an area, or for a Poisson ratio that does not determine
    /// the axial strain. [`ElasticityError::TooFewLoads`] for fewer than two areas,
    /// [`ElasticityError::EqualLoads`] and [`ElasticityError::ZeroStrain`] if all are equal,
    /// [`ElasticityError::OppositeSigns`] if the area does not increase with the force.
    pub fn new(
        series: &LoadSeries,
        poisson_ratio: f64,
        measure: &dyn StrainMeasure,
    ) -> Result<Self, ElasticityError> {
        let law = LateralLaw {
            poisson_ratio: Quantity::PoissonRatio.positive(poisson_ratio)?,
            measure,
        };
        let faces = series.loads().iter().filter_map(|l| l.contact_area_m2);
        let mut unloaded = f64::INFINITY;
        for face in faces {
            let area =
                Quantity::ContactArea.positive(validated(face, Quantity::ContactArea)?.value)?;
            unloaded = unloaded.min(area);
        }
        for _ in 0..AREA_STEPS {
            let line = StressStrainRegression::line(&StressStrainRegression::points(
                &law.strained(series, unloaded)?.0,
            )?)?;
            // The strain at which the line has zero stress is that of the unloaded face.
            let strain = -line.intercept / line.slope;
            let ratio = (1.0
                - 2.0 * law.poisson_ratio * strain.clamp(-LINEAR_STRAIN, LINEAR_STRAIN))
            .recip();
            unloaded *= ratio;
            if (ratio - 1.0).abs() < 1e-14 {
                break;
            }
        }
        let (loads, stretches) = law.strained(series, unloaded)?;
        Ok(Self {
            series: series.with_loads(loads),
            stretches,
            unloaded_area_m2: unloaded,
        })
    }

    /// Relative excess of the ratio of conjugate stress to strain over the modulus, for a
    /// uniaxially stretched rubber at a strain of this measure.
    ///
    /// An incompressible neo-Hookean solid has the nominal stress P = E (λ − λ⁻²)/3. Its [conjugate
    /// stress](StrainMeasure::conjugate_stress) over the strain equals E only at small strain: at
    /// −9 % it is 1.28 E for Green–Lagrange and 0.96 E for Hencky.
    ///
    /// # Errors
    /// [`ElasticityError::NoConjugateStress`], and [`ElasticityError::SingularDeformation`] for a
    /// strain without a stretch between 0.05 and 4.
    ///
    /// ```
    /// use tactile_elasticity::modulus::UniaxialLoads;
    /// use tactile_elasticity::strain::{GreenLagrange, Hencky};
    ///
    /// // λ² = 0.82: (λ − λ⁻²)/(3 λ) = −0.1156.
    /// assert!((UniaxialLoads::neo_hookean_excess(&GreenLagrange, -0.09)? - 0.284_f64).abs() < 1e-3);
    /// assert!((UniaxialLoads::neo_hookean_excess(&Hencky, -0.09)? + 0.04).abs() < 0.01);
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn neo_hookean_excess(
        measure: &dyn StrainMeasure,
        strain: f64,
    ) -> Result<f64, ElasticityError> {
        let stretch = stretch_of(measure, strain)?;
        let nominal = (stretch - stretch.powi(-2)) / 3.0;
        Ok(measure.conjugate_stress(nominal, stretch)? / strain - 1.0)
    }
}

/// f(λ_t) = −ν f(λ_z).
struct LateralLaw<'a> {
    poisson_ratio: f64,
    measure: &'a dyn StrainMeasure,
}

impl LateralLaw<'_> {
    /// λ_z of a face stretched by λ_t.
    fn axial(&self, lateral: f64) -> Result<f64, ElasticityError> {
        let wanted = -strain_of(self.measure, lateral)? / self.poisson_ratio;
        stretch_of(self.measure, wanted)
    }

    /// f′ at a stretch.
    fn slope(&self, stretch: f64) -> Result<f64, ElasticityError> {
        Ok(self.measure.conjugate_stress(1.0, stretch)?.recip())
    }

    /// The loads with their strains, and the stretches of each load.
    fn strained(
        &self,
        series: &LoadSeries,
        unloaded_m2: f64,
    ) -> Result<(Vec<LoadState>, Vec<[f64; 2]>), ElasticityError> {
        // Strains from lateral stretches are inversely proportional to Poisson's ratio.
        let ratio = series.bodies().map(Bodies::poisson_ratio);
        let ratio_error = ratio.map_or(0.0, |ratio| ratio.part(Source::PoissonRatio));
        let relative_ratio = ratio_error / self.poisson_ratio;
        let mut loads = Vec::with_capacity(series.loads().len());
        let mut stretches = Vec::with_capacity(series.loads().len());
        for state in series.loads() {
            let Some(face) = state.contact_area_m2 else {
                loads.push(LoadState {
                    mean_strain: None,
                    contact_radius_m: None,
                    ..*state
                });
                stretches.push([1.0; 2]);
                continue;
            };
            let lateral = (face.value / unloaded_m2).sqrt();
            let axial = self.axial(lateral)?;
            let axial_slope = self.slope(axial)?;
            // de_zz/d ln A = −f′(λ_t) λ_t / 2ν.
            let per_relative_area = self.slope(lateral)? * lateral / (2.0 * self.poisson_ratio);
            let strain = Uncertain::exact(-strain_of(self.measure, axial)?)
                .by_estimated(
                    Source::Noise,
                    per_relative_area * face.part(Source::Noise) / face.value,
                    face.degrees_of_freedom(Source::Noise),
                )
                .by_relative(Source::PoissonRatio, -relative_ratio);
            // Errors common to all faces affect A₀, which is fitted, and not the strains.
            let common = face.without(Source::Noise) * face.value.recip();
            loads.push(LoadState {
                contact_area_m2: Some(common * (unloaded_m2 * axial_slope)),
                contact_radius_m: None,
                mean_strain: Some(strain),
                ..*state
            });
            stretches.push([lateral, axial]);
        }
        Ok((loads, stretches))
    }
}

/// f of a stretch along an axis.
fn strain_of(measure: &dyn StrainMeasure, stretch: f64) -> Result<f64, ElasticityError> {
    let gradient = Matrix3::from_diagonal(&[0.0, 0.0, stretch - 1.0].into());
    Ok(measure.strain(&gradient)?[(2, 2)])
}

/// The stretch for a strain along an axis, by bisection: f increases with the stretch for every
/// measure.
fn stretch_of(measure: &dyn StrainMeasure, wanted: f64) -> Result<f64, ElasticityError> {
    let [mut low, mut high] = STRETCHES;
    if !(strain_of(measure, low)? < wanted && wanted < strain_of(measure, high)?) {
        return Err(ElasticityError::SingularDeformation);
    }
    while high - low > 4.0 * f64::EPSILON {
        let middle = 0.5 * (low + high);
        if strain_of(measure, middle)? < wanted {
            low = middle;
        } else {
            high = middle;
        }
        if middle == 0.5 * (low + high) {
            break;
        }
    }
    Ok(0.5 * (low + high))
}
