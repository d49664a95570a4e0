//! Contacts of a soft ball with one guide, computed once and interpolated.

mod curve;
mod surface;

pub use curve::ContactCurve;

use super::{Layer, Waveguide};
use crate::error::{ElasticityError, Quantity, poisson, positive};
use surface::{Sample, Surface};

/// Force over contact radius and modulus for a ball of one radius on one guide, or on a rigid flat.
///
/// With Hertz's force on a rigid flat taken out, $\ln[F / (\frac{4}{3} \frac{E}{1 - \nu^2} \frac{a^3}{R})]$ is a product of
/// polynomials in a/R and ln E, fitted to all contacts by least squares; F must grow with a and E everywhere between them.
/// [`interpolation_error`](Self::interpolation_error) is what the fit misses. With the feature `fem` `solve` computes one by finite
/// elements.
///
/// ```
/// use tactile_elasticity::contact::{ContactCurve, ContactTable, Waveguide};
///
/// // Hertz's contacts of a ball of 3 mm on a rigid flat: forces are in proportion to the modulus, one curve is enough.
/// let contact_radius_m: Vec<f64> = (1..=10).map(|k| 0.1e-3 * f64::from(k)).collect();
/// let force_n = contact_radius_m.iter().map(|a| 4.0 / 3.0 * 80e3 * a.powi(3) / 3e-3).collect();
/// let curve = ContactCurve { youngs_modulus_pa: 60e3, contact_radius_m, force_n };
/// let table = ContactTable::new(3e-3, 0.5, &Waveguide::rigid(), vec![curve])?;
/// let force_n = table.force_n(0.55e-3, 120e3).unwrap();
/// assert!((force_n / (4.0 / 3.0 * 160e3 * 0.55e-3_f64.powi(3) / 3e-3) - 1.0).abs() < 1e-9);
/// assert!(table.interpolation_error() < 1e-9);
/// assert_eq!(table.force_n(2e-3, 120e3), None); // larger than any contact of the table
/// assert_eq!((table.radius_m(), table.poisson_ratio()), (3e-3, 0.5));
/// assert!(table.layers().is_empty() && table.curves().len() == 1);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "TableFile", into = "TableFile"))]
pub struct ContactTable {
    radius_m: f64,
    poisson_ratio: f64,
    layers: Vec<Layer>,
    curves: Vec<ContactCurve>,
    surface: Surface,
    limits: Limits,
}

/// What the table covers.
#[derive(Debug, Clone, PartialEq)]
struct Limits {
    smallest_ratio: f64,
    /// ln E and the largest a/R of each curve: a stiff ball sinks in before its contact is as large as a soft one's.
    largest_ratio: Vec<(f64, f64)>,
    /// ln E; all reals on a rigid flat.
    log_modulus: [f64; 2],
}

impl Limits {
    /// The largest a/R at ln E, between curves linear.
    fn largest_ratio(&self, log_modulus: f64) -> f64 {
        let curves = &self.largest_ratio;
        let next = curves.partition_point(|c| c.0 < log_modulus);
        if next == 0 || next == curves.len() {
            return curves[next.min(curves.len() - 1)].1;
        }
        let (lower, upper) = (curves[next - 1], curves[next]);
        let t = (log_modulus - lower.0) / (upper.0 - lower.0);
        lower.1 + t * (upper.1 - lower.1)
    }
}

/// ln F of a contact and its slopes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TabulatedForce {
    pub(crate) log_force: f64,
    /// ∂ln F/∂ln a.
    pub(crate) radius_slope: f64,
    /// ∂ln F/∂ln E.
    pub(crate) modulus_slope: f64,
}

/// Limits are met by numbers that rounding moved by this.
const ROUNDING: f64 = 1e-12;

/// How much smaller than its smallest a contact may be: ln(F/F_Hertz) is some −0.1 a/R there, and is taken on along its tangent.
const SMALLER: f64 = 0.6;

impl ContactTable {
    /// From curves of growing modulus for a ball of radius R (m) and Poisson ratio ν on a guide, or on a
    /// [rigid](Waveguide::rigid) flat.
    ///
    /// # Errors
    /// R, ν, a modulus, a contact radius or a force that is not valid or does not grow; fewer than four contacts of a modulus, or than two moduli on a
    /// guide that yields; [`ElasticityError::NotMonotone`] where the fitted force does not grow with contact radius and modulus.
    pub fn new(
        radius_m: f64,
        poisson_ratio: f64,
        guide: &Waveguide,
        curves: Vec<ContactCurve>,
    ) -> Result<Self, ElasticityError> {
        positive(radius_m, Quantity::Radius)?;
        poisson(poisson_ratio)?;
        let rigid = guide.layers().is_empty();
        at_least(
            curves.len(),
            if rigid { 1 } else { 2 },
            Quantity::YoungsModulus,
        )?;
        for curve in &curves {
            curve.check()?;
        }
        growing(
            curves.iter().map(|c| c.youngs_modulus_pa),
            Quantity::YoungsModulus,
        )?;
        let samples: Vec<Sample> = curves
            .iter()
            .flat_map(|curve| curve.samples(radius_m, poisson_ratio))
            .collect();
        let surface = Surface::fit(&samples, curves.len()).ok_or(ElasticityError::NotMonotone)?;
        let first = |c: &ContactCurve| c.contact_radius_m[0] / radius_m;
        let last = |c: &ContactCurve| c.contact_radius_m[c.contact_radius_m.len() - 1] / radius_m;
        let moduli = |k: usize| curves[k].youngs_modulus_pa.ln();
        let limits = Limits {
            smallest_ratio: SMALLER * curves.iter().map(first).fold(0.0, f64::max),
            largest_ratio: (curves.iter())
                .map(|c| (c.youngs_modulus_pa.ln(), last(c)))
                .collect(),
            log_modulus: if rigid {
                [f64::NEG_INFINITY, f64::INFINITY]
            } else {
                [moduli(0), moduli(curves.len() - 1)]
            },
        };
        let table = Self {
            radius_m,
            poisson_ratio,
            layers: guide.layers().to_vec(),
            curves,
            surface,
            limits,
        };
        table.check_monotone()?;
        Ok(table)
    }

    /// The ball's radius in metres.
    pub fn radius_m(&self) -> f64 {
        self.radius_m
    }

    /// The ball's Poisson ratio.
    pub fn poisson_ratio(&self) -> f64 {
        self.poisson_ratio
    }

    /// The guide's layers, the touched one first; none on a rigid flat.
    pub fn layers(&self) -> &[Layer] {
        &self.layers
    }

    /// The contacts that the table is made of, a curve a modulus.
    pub fn curves(&self) -> &[ContactCurve] {
        &self.curves
    }

    /// Root mean square relative error of the interpolated force: what each contact of the table misses when it is left out, but for those at the
    /// ends of the curves and of the softest and the stiffest ball, where that would show how well the fit extrapolates.
    pub fn interpolation_error(&self) -> f64 {
        self.surface.error()
    }

    /// The force in newtons at a contact radius (m) and a modulus (Pa); None outside the table.
    pub fn force_n(&self, contact_radius_m: f64, youngs_modulus_pa: f64) -> Option<f64> {
        let log_modulus = youngs_modulus_pa.ln();
        let [softest, stiffest] = self.limits.log_modulus;
        let covered = self.covers(contact_radius_m, log_modulus)
            && log_modulus >= softest - ROUNDING
            && log_modulus <= stiffest + ROUNDING;
        covered.then(|| self.at(contact_radius_m, log_modulus).log_force.exp())
    }

    /// Whether a contact radius lies between the smallest and the largest at ln E.
    pub(crate) fn covers(&self, a: f64, log_modulus: f64) -> bool {
        let [smallest, largest] = self.contact_ratios(log_modulus);
        let ratio = a / self.radius_m;
        ratio >= smallest * (1.0 - ROUNDING) && ratio <= largest * (1.0 + ROUNDING)
    }

    /// The force; beyond the computed contact radii at this ln E continued along the tangent.
    pub(crate) fn at(&self, a: f64, log_modulus: f64) -> TabulatedForce {
        let [smallest, largest] = self.contact_ratios(log_modulus);
        let ratio = a / self.radius_m;
        let inside = ratio.clamp(smallest / SMALLER, largest);
        let rest = self.surface.at(inside, log_modulus);
        let beyond = rest.ratio_slope * (ratio / inside).ln();
        TabulatedForce {
            log_force: log_hertz(a, log_modulus, self.radius_m, self.poisson_ratio)
                + rest.value
                + beyond,
            radius_slope: 3.0 + rest.ratio_slope,
            modulus_slope: 1.0 + rest.modulus_slope,
        }
    }

    /// ln E of the smallest and the largest modulus, without bounds on a rigid flat.
    pub(crate) fn log_moduli(&self) -> [f64; 2] {
        self.limits.log_modulus
    }

    /// The smallest and the largest a/R at ln E.
    pub(crate) fn contact_ratios(&self, log_modulus: f64) -> [f64; 2] {
        [
            self.limits.smallest_ratio,
            self.limits.largest_ratio(log_modulus),
        ]
    }

    /// Refuses another ball or guide than the table's.
    pub(crate) fn check_made_for(
        &self,
        radius_m: f64,
        poisson_ratio: f64,
        guide: &Waveguide,
    ) -> Result<(), ElasticityError> {
        let same = |found: f64, expected: f64, quantity| {
            // Numbers that went through a text file, or through millimetres, keep this.
            if (found - expected).abs() <= 1e-9 * expected.abs() {
                Ok(())
            } else {
                Err(ElasticityError::TableMismatch {
                    quantity,
                    expected,
                    found,
                })
            }
        };
        same(radius_m, self.radius_m, Quantity::Radius)?;
        same(poisson_ratio, self.poisson_ratio, Quantity::PoissonRatio)?;
        let (found, expected) = (guide.layers(), &self.layers);
        same(found.len() as f64, expected.len() as f64, Quantity::Layers)?;
        for (found, expected) in found.iter().zip(expected) {
            same(found.thickness_m, expected.thickness_m, Quantity::Thickness)?;
            let (e, expected_e) = (found.youngs_modulus_pa, expected.youngs_modulus_pa);
            same(e, expected_e, Quantity::YoungsModulus)?;
            same(
                found.poisson_ratio,
                expected.poisson_ratio,
                Quantity::PoissonRatio,
            )?;
        }
        Ok(())
    }

    /// Steps of the check between neighbouring limits.
    const CHECKED: usize = 40;

    fn check_monotone(&self) -> Result<(), ElasticityError> {
        let [soft, stiff] = if self.layers.is_empty() {
            [0.0; 2]
        } else {
            self.limits.log_modulus
        };
        let between =
            |low: f64, high: f64, k: usize| low + (high - low) * k as f64 / Self::CHECKED as f64;
        for j in 0..=Self::CHECKED {
            let log_modulus = between(soft, stiff, j);
            let [low, high] = self.contact_ratios(log_modulus);
            for i in 0..=Self::CHECKED {
                let value = self
                    .surface
                    .at(between(low / SMALLER, high, i), log_modulus);
                let grows = 3.0 + value.ratio_slope > 0.0 && 1.0 + value.modulus_slope > 0.0;
                if !grows || low >= high {
                    return Err(ElasticityError::NotMonotone);
                }
            }
        }
        Ok(())
    }
}

/// ln of Hertz's force of contact radius a on a rigid flat, 4/3 E/(1 − ν²) a³/R.
fn log_hertz(a: f64, log_modulus: f64, radius_m: f64, poisson_ratio: f64) -> f64 {
    let shape = 4.0 / 3.0 * a.powi(3) / (radius_m * (1.0 - poisson_ratio * poisson_ratio));
    log_modulus + shape.ln()
}

fn at_least(found: usize, expected: usize, quantity: Quantity) -> Result<(), ElasticityError> {
    if found < expected {
        return Err(ElasticityError::LengthMismatch {
            quantity,
            expected,
            found,
        });
    }
    Ok(())
}

/// Positive numbers, each above the one before.
fn growing(values: impl Iterator<Item = f64>, quantity: Quantity) -> Result<(), ElasticityError> {
    let mut last = 0.0;
    for value in values {
        positive(value, quantity)?;
        if value <= last {
            return Err(ElasticityError::OutOfRange {
                quantity,
                found: value,
                limit: last,
            });
        }
        last = value;
    }
    Ok(())
}

/// The table as files hold it.
#[cfg(feature = "serde")]
#[derive(serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct TableFile {
    version: u32,
    radius_m: f64,
    poisson_ratio: f64,
    #[serde(default)]
    layers: Vec<Layer>,
    curves: Vec<ContactCurve>,
}

/// Raised whenever a file's meaning changes.
#[cfg(feature = "serde")]
const VERSION: u32 = 1;

#[cfg(feature = "serde")]
impl From<ContactTable> for TableFile {
    fn from(table: ContactTable) -> Self {
        Self {
            version: VERSION,
            radius_m: table.radius_m,
            poisson_ratio: table.poisson_ratio,
            layers: table.layers,
            curves: table.curves,
        }
    }
}

#[cfg(feature = "serde")]
impl TryFrom<TableFile> for ContactTable {
    type Error = ElasticityError;

    fn try_from(file: TableFile) -> Result<Self, ElasticityError> {
        if file.version != VERSION {
            return Err(ElasticityError::TableVersion {
                expected: VERSION,
                found: file.version,
            });
        }
        let guide = if file.layers.is_empty() {
            Waveguide::rigid()
        } else {
            Waveguide::new(file.layers)?
        };
        Self::new(file.radius_m, file.poisson_ratio, &guide, file.curves)
    }
}

#[cfg(test)]
mod tests;
