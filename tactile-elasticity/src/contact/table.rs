//! Contacts of a soft ball with one guide, computed once and interpolated.

use super::{Layer, Waveguide};
use crate::error::{ElasticityError, Quantity, poisson};
use nalgebra::{DMatrix, DVector};

/// Force as a function of contact radius and modulus, for a ball of one radius on one guide or on a
/// rigid flat.
///
/// Relative to Hertz's force on a rigid flat, $\ln[F / (\frac{4}{3} \frac{E}{1 - \nu^2}
/// \frac{a^3}{R})]$ is a product of polynomials in a/R and ln E, fitted to all contacts by least
/// squares. F must increase with a and E everywhere in the table.
/// [`interpolation_error`](Self::interpolation_error) is the error of the fit. With the feature
/// `fem`, `solve` computes a table by finite elements.
///
/// ```
/// use tactile_elasticity::contact::{ContactCurve, ContactTable, Waveguide};
///
/// // Hertz's contacts of a ball of 3 mm on a rigid flat. Forces are proportional to the modulus,
/// // so one curve is enough.
/// let contact_radius_m: Vec<f64> = (1..=10).map(|k| 0.1e-3 * f64::from(k)).collect();
/// let force_n = contact_radius_m
///     .iter()
///     .map(|a| 4.0 / 3.0 * 80e3 * a.powi(3) / 3e-3)
///     .collect();
/// let curve = ContactCurve {
///     youngs_modulus_pa: 60e3,
///     contact_radius_m,
///     force_n,
/// };
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

/// Range of the table.
#[derive(Debug, Clone, PartialEq)]
struct Limits {
    smallest_ratio: f64,
    /// ln E and the largest a/R of each curve: a stiff ball sinks in before its contact becomes as
    /// large as that of a soft ball.
    largest_ratio: Vec<(f64, f64)>,
    /// Range of ln E. Unbounded on a rigid flat.
    log_modulus: [f64; 2],
}

impl Limits {
    /// The largest a/R at ln E, linearly interpolated between curves.
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

/// ln F of a contact with its slopes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TabulatedForce {
    pub(crate) log_force: f64,
    /// ∂ln F/∂ln a.
    pub(crate) radius_slope: f64,
    /// ∂ln F/∂ln E.
    pub(crate) modulus_slope: f64,
}

// Tolerance of limits for values changed by rounding.
const ROUNDING: f64 = 1e-12;

// Smallest contact relative to the smallest in the table. ln(F/F_Hertz) is about −0.1 a/R there,
// and is extrapolated along its tangent.
const SMALLER: f64 = 0.6;

impl ContactTable {
    /// Creates a table from curves of increasing modulus, for a ball of radius R (m) and Poisson
    /// ratio ν on a guide or on a [rigid](Waveguide::rigid) flat.
    ///
    /// # Errors
    /// An error for a value of R, ν, a modulus, a contact radius or a force that is invalid or does
    /// not increase, for fewer than four contacts per modulus, and for fewer than two moduli on a
    /// compliant guide. [`ElasticityError::NotMonotone`] if the fitted force does not increase with
    /// contact radius and modulus.
    pub fn new(
        radius_m: f64,
        poisson_ratio: f64,
        guide: &Waveguide,
        curves: Vec<ContactCurve>,
    ) -> Result<Self, ElasticityError> {
        Quantity::Radius.positive(radius_m)?;
        poisson(poisson_ratio)?;
        let rigid = guide.layers().is_empty();
        Quantity::YoungsModulus.at_least(curves.len(), if rigid { 1 } else { 2 })?;
        for curve in &curves {
            curve.check()?;
        }
        Quantity::YoungsModulus.growing(curves.iter().map(|c| c.youngs_modulus_pa))?;
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

    /// The guide's layers, the touched one first. Empty on a rigid flat.
    pub fn layers(&self) -> &[Layer] {
        &self.layers
    }

    /// The contacts of the table, one curve per modulus.
    pub fn curves(&self) -> &[ContactCurve] {
        &self.curves
    }

    /// Root mean square relative error of the interpolated force, by leaving out one contact at a
    /// time. The ends of the curves and the softest and stiffest ball are not left out, because
    /// this would measure extrapolation.
    pub fn interpolation_error(&self) -> f64 {
        self.surface.error
    }

    /// The force in newtons at a contact radius (m) and a modulus (Pa). `None` outside the table.
    pub fn force_n(&self, contact_radius_m: f64, youngs_modulus_pa: f64) -> Option<f64> {
        let log_modulus = youngs_modulus_pa.ln();
        let [softest, stiffest] = self.limits.log_modulus;
        let covered = self.covers(contact_radius_m, log_modulus)
            && log_modulus >= softest - ROUNDING
            && log_modulus <= stiffest + ROUNDING;
        covered.then(|| self.at(contact_radius_m, log_modulus).log_force.exp())
    }

    /// Whether a contact radius is between the smallest and the largest at ln E.
    pub(crate) fn covers(&self, a: f64, log_modulus: f64) -> bool {
        let [smallest, largest] = self.contact_ratios(log_modulus);
        let ratio = a / self.radius_m;
        ratio >= smallest * (1.0 - ROUNDING) && ratio <= largest * (1.0 + ROUNDING)
    }

    /// The force. Outside the computed contact radii at this ln E it is extrapolated along the
    /// tangent.
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

    /// ln E of the smallest and the largest modulus. Unbounded on a rigid flat.
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

    /// Rejects a ball or guide other than that of the table.
    pub(crate) fn check_made_for(
        &self,
        radius_m: f64,
        poisson_ratio: f64,
        guide: &Waveguide,
    ) -> Result<(), ElasticityError> {
        let same = |found: f64, expected: f64, quantity| {
            // Numbers that passed through a text file, or through millimetres, keep this accuracy.
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

    /// Number of checked points between neighbouring limits.
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

/// ln of Hertz's force for contact radius a on a rigid flat, 4/3 E/(1 − ν²) a³/R.
fn log_hertz(a: f64, log_modulus: f64, radius_m: f64, poisson_ratio: f64) -> f64 {
    let shape = 4.0 / 3.0 * a.powi(3) / (radius_m * (1.0 - poisson_ratio * poisson_ratio));
    log_modulus + shape.ln()
}

/// The file format of the table.
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

/// Incremented whenever the meaning of the format changes.
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

/// The contacts of one ball under increasing loads, as in the example of
/// [`ContactTable`](super::ContactTable): columns of equal length.
///
/// ```
/// use tactile_elasticity::contact::ContactCurve;
///
/// let curve = ContactCurve {
///     youngs_modulus_pa: 60e3,
///     contact_radius_m: vec![0.3e-3, 0.6e-3],
///     force_n: vec![0.9e-3, 7.1e-3],
/// };
/// assert_eq!(curve.contact_radius_m.len(), curve.force_n.len());
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct ContactCurve {
    /// E of the ball, in pascals.
    pub youngs_modulus_pa: f64,
    /// Contact radii in ascending order, in metres.
    pub contact_radius_m: Vec<f64>,
    /// The force at each contact radius, in newtons.
    pub force_n: Vec<f64>,
}

impl ContactCurve {
    /// Minimum number of contacts in a curve.
    pub const FEWEST_CONTACTS: usize = 4;

    fn check(&self) -> Result<(), ElasticityError> {
        Quantity::YoungsModulus.positive(self.youngs_modulus_pa)?;
        let contacts = self.contact_radius_m.len();
        Quantity::ContactRadius.at_least(contacts, Self::FEWEST_CONTACTS)?;
        Quantity::Force.entries(self.force_n.len(), contacts)?;
        Quantity::ContactRadius.growing(self.contact_radius_m.iter().copied())?;
        Quantity::Force.growing(self.force_n.iter().copied())
    }

    fn samples(&self, radius_m: f64, poisson_ratio: f64) -> impl Iterator<Item = Sample> {
        let log_modulus = self.youngs_modulus_pa.ln();
        let contacts = self.contact_radius_m.iter().zip(&self.force_n);
        contacts.map(move |(a, force)| Sample {
            ratio: a / radius_m,
            log_modulus,
            value: force.ln() - log_hertz(*a, log_modulus, radius_m, poisson_ratio),
        })
    }
}

// Degree in a/R and maximum degree in ln E. The residuals for contacts computed by finite elements
// are the scatter of the elements in the contact radius, about 0.1 %
// (`the_surface_leaves_the_scatter_of_the_contact_radius`).
const DEGREE_IN_RATIO: usize = 6;
const DEGREE_IN_MODULUS: usize = 5;

/// One tabulated contact in the variables of the surface.
#[derive(Debug, Clone, Copy)]
struct Sample {
    /// a/R.
    ratio: f64,
    /// ln E.
    log_modulus: f64,
    /// ln of the force relative to Hertz's of the same radius on a rigid flat.
    value: f64,
}

/// The value with its slopes in ln a and ln E.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Value {
    value: f64,
    ratio_slope: f64,
    modulus_slope: f64,
}

/// A product of Chebyshev series in a/R and ln E, fitted by least squares.
#[derive(Debug, Clone, PartialEq)]
struct Surface {
    ratio: Range,
    log_modulus: Range,
    /// Rows by degree in a/R, columns by degree in ln E.
    coefficients: DMatrix<f64>,
    /// Root mean square leave-one-out error of the samples that have others on both sides.
    error: f64,
}

/// A range mapped to [−1, 1]. A single value is mapped to 0.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Range {
    lower: f64,
    upper: f64,
}

impl Range {
    fn of(values: impl Iterator<Item = f64> + Clone) -> Self {
        Self {
            lower: values.clone().fold(f64::INFINITY, f64::min),
            upper: values.fold(f64::NEG_INFINITY, f64::max),
        }
    }

    fn place(self, value: f64) -> f64 {
        if self.upper > self.lower {
            (2.0 * value - self.lower - self.upper) / (self.upper - self.lower)
        } else {
            0.0
        }
    }

    /// d place/d value.
    fn scale(self) -> f64 {
        if self.upper > self.lower {
            2.0 / (self.upper - self.lower)
        } else {
            0.0
        }
    }
}

/// Chebyshev polynomials T₀ … T_n at t and their derivatives.
fn chebyshev(t: f64, polynomials: &mut [f64], derivatives: &mut [f64]) {
    for k in 0..polynomials.len() {
        (polynomials[k], derivatives[k]) = match k {
            0 => (1.0, 0.0),
            1 => (t, 1.0),
            _ => (
                2.0 * t * polynomials[k - 1] - polynomials[k - 2],
                2.0 * polynomials[k - 1] + 2.0 * t * derivatives[k - 1] - derivatives[k - 2],
            ),
        };
    }
}

impl Surface {
    /// Fits samples of `moduli` different moduli. `None` if they do not determine the surface.
    fn fit(samples: &[Sample], moduli: usize) -> Option<Self> {
        let per_modulus = samples.len() / moduli.max(1);
        // Two samples more than coefficients in each direction allow an error of the fit.
        let rows = (DEGREE_IN_RATIO + 1).min(per_modulus.saturating_sub(2).max(1));
        let columns = (DEGREE_IN_MODULUS + 1).min(moduli);
        let mut surface = Self {
            ratio: Range::of(samples.iter().map(|s| s.ratio)),
            log_modulus: Range::of(samples.iter().map(|s| s.log_modulus)),
            coefficients: DMatrix::zeros(rows, columns),
            error: 0.0,
        };
        let unknowns = rows * columns;
        let basis = DMatrix::from_fn(samples.len(), unknowns, |i, k| {
            let polynomials = surface.basis(samples[i].ratio, samples[i].log_modulus);
            polynomials.ratio[k % rows] * polynomials.modulus[k / rows]
        });
        let values = DVector::from_iterator(samples.len(), samples.iter().map(|s| s.value));
        let factors = basis.clone().qr();
        let orthogonal = factors.q();
        let solution = factors
            .r()
            .solve_upper_triangular(&(orthogonal.transpose() * &values))?;
        let residuals = &values - &basis * &solution;
        let left_out = |i: usize| {
            let leverage = orthogonal.row(i).norm_squared();
            residuals[i] / (1.0 - leverage).max(1e-6)
        };
        let between = (0..samples.len()).filter(|&i| surface.surrounds(samples, i));
        let (mut squares, mut count) = (0.0, 0);
        for i in between {
            squares += left_out(i).powi(2);
            count += 1;
        }
        if count == 0 {
            squares = (0..samples.len()).map(|i| left_out(i).powi(2)).sum();
            count = samples.len();
        }
        surface.error = (squares / count as f64).sqrt();
        surface.coefficients = DMatrix::from_column_slice(rows, columns, solution.as_slice());
        solution.iter().all(|c| c.is_finite()).then_some(surface)
    }

    /// Whether there are contacts on both sides of a sample. At the ends of its curve, and for the
    /// smallest and the largest modulus, leaving one out would measure extrapolation, which is
    /// never used.
    fn surrounds(&self, samples: &[Sample], i: usize) -> bool {
        let own = samples[i].log_modulus;
        let same = |k: usize| samples.get(k).is_some_and(|s| s.log_modulus == own);
        let inside = i > 0 && same(i - 1) && same(i + 1);
        let of_one = self.log_modulus.lower == self.log_modulus.upper;
        inside && (of_one || (own > self.log_modulus.lower && own < self.log_modulus.upper))
    }

    /// The value at a/R and ln E. The caller stays within the range of the samples.
    fn at(&self, ratio: f64, log_modulus: f64) -> Value {
        let basis = self.basis(ratio, log_modulus);
        let (mut value, mut ratio_slope, mut modulus_slope) = (0.0, 0.0, 0.0);
        for (column, (m, dm)) in basis.modulus.iter().zip(basis.modulus_slope).enumerate() {
            if column >= self.coefficients.ncols() {
                break;
            }
            for row in 0..self.coefficients.nrows() {
                let c = self.coefficients[(row, column)];
                value += c * basis.ratio[row] * m;
                ratio_slope += c * basis.ratio_slope[row] * m;
                modulus_slope += c * basis.ratio[row] * dm;
            }
        }
        Value {
            value,
            ratio_slope: ratio_slope * self.ratio.scale() * ratio,
            modulus_slope: modulus_slope * self.log_modulus.scale(),
        }
    }

    fn basis(&self, ratio: f64, log_modulus: f64) -> Basis {
        let mut basis = Basis::default();
        chebyshev(
            self.ratio.place(ratio),
            &mut basis.ratio,
            &mut basis.ratio_slope,
        );
        chebyshev(
            self.log_modulus.place(log_modulus),
            &mut basis.modulus,
            &mut basis.modulus_slope,
        );
        basis
    }
}

#[derive(Default)]
struct Basis {
    ratio: [f64; DEGREE_IN_RATIO + 1],
    ratio_slope: [f64; DEGREE_IN_RATIO + 1],
    modulus: [f64; DEGREE_IN_MODULUS + 1],
    modulus_slope: [f64; DEGREE_IN_MODULUS + 1],
}

#[cfg(test)]
#[path = "table_tests.rs"]
mod tests;
