//! Choice of the law that fits a curve best.

use super::{CurveFit, CurveOptions, IndentationCurve, Indenter, Model, fit_curve};
use crate::error::ElasticityError;
use crate::modulus::EstimatorKind;
pub use crate::selection::SelectionReason;
use crate::selection::{akaike_weights, in_order, rank};

/// All laws tried, the best first.
///
/// ```
/// use tactile_elasticity::contact::Bond;
/// use tactile_elasticity::curve::{CurveOptions, IndentationCurve, Indenter, Model, SelectionReason, select_model};
/// use tactile_elasticity::modulus::EstimatorKind;
///
/// // A 5 mm sphere on 30 kPa, deep: Hertz's law is asked for by name.
/// let z: Vec<f64> = (0..40).map(|i| i as f64 * 5e-6).collect();
/// let f: Vec<f64> = z.iter().map(|d| 4.0 / 3.0 * 40e3 * 5e-3_f64.sqrt() * d.powf(1.5)).collect();
/// let sphere = Indenter::Sphere { radius_m: 5e-3, thickness_m: None, bond: Bond::Bonded };
/// let hertz = Model::Named(EstimatorKind::HertzSphere);
/// let selection = select_model(&IndentationCurve::new(&z, &f)?, &sphere, 0.5, hertz, &CurveOptions::default())?;
/// assert_eq!(selection.reason, SelectionReason::Asked);
/// assert!((selection.chosen().youngs_modulus_pa / 30e3 - 1.0).abs() < 1e-6);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct CurveSelection {
    /// Fits; the first is the chosen one, the others follow by AICc.
    pub fits: Vec<CurveFit>,
    /// Akaike weights of the fits, in their order.
    pub weights: Vec<f64>,
    /// Why the first was chosen.
    pub reason: SelectionReason,
}

impl CurveSelection {
    /// The chosen fit.
    pub fn chosen(&self) -> &CurveFit {
        &self.fits[0]
    }
}

/// Fits the law asked for, or all that apply, and chooses by AICc: among those within 2 of the best, the most general theory, which
/// holds wherever the others do.
///
/// # Errors
/// As [`fit_curve`], where no law can be fitted.
///
/// ```
/// use tactile_elasticity::curve::{CurveOptions, IndentationCurve, Indenter, Model, select_model};
///
/// let z: Vec<f64> = (0..40).map(|i| i as f64 * 5e-6).collect();
/// let f: Vec<f64> = z.iter().map(|d| 2.0 * 40e3 * 1e-3 * d).collect();
/// let punch = Indenter::Punch { radius_m: 1e-3 };
/// let selection = select_model(&IndentationCurve::new(&z, &f)?, &punch, 0.5, Model::Auto, &CurveOptions::default())?;
/// assert!((selection.chosen().youngs_modulus_pa / 30e3 - 1.0).abs() < 1e-6);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub fn select_model(
    curve: &IndentationCurve,
    indenter: &Indenter,
    nu: f64,
    model: Model,
    options: &CurveOptions,
) -> Result<CurveSelection, ElasticityError> {
    let candidates = match model {
        Model::Named(kind) => vec![kind],
        Model::Auto => indenter.candidates(),
    };
    let fits = fit_each(curve, indenter, nu, &candidates, options)?;
    let criteria: Vec<f64> = fits.iter().map(|f| f.statistics.aicc).collect();
    let (order, reason) = rank(&criteria);
    let reason = if matches!(model, Model::Named(_)) {
        SelectionReason::Asked
    } else {
        reason
    };
    let weights = akaike_weights(order.iter().map(|&k| criteria[k]));
    Ok(CurveSelection {
        fits: in_order(fits, &order),
        weights,
        reason,
    })
}

/// The fits of the laws that can be fitted; the first error where none can.
fn fit_each(
    curve: &IndentationCurve,
    indenter: &Indenter,
    nu: f64,
    candidates: &[EstimatorKind],
    options: &CurveOptions,
) -> Result<Vec<CurveFit>, ElasticityError> {
    let mut first_error = None;
    let mut fits = Vec::new();
    for &kind in candidates {
        match fit_curve(curve, indenter, nu, kind, options) {
            Ok(fit) => fits.push(fit),
            Err(e) => first_error = first_error.or(Some(e)),
        }
    }
    if fits.is_empty() {
        let missing = ElasticityError::TooFewLoads {
            expected: super::FEWEST_POINTS,
            found: 0,
        };
        return Err(first_error.unwrap_or(missing));
    }
    Ok(fits)
}
