//! Which law a curve speaks for.

use super::{CurveFit, CurveOptions, IndentationCurve, Indenter, Model, fit_curve};
use crate::error::ElasticityError;

/// Why a law was chosen.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub enum SelectionReason {
    /// It was asked for.
    Asked,
    /// No other law applies.
    OnlyCandidate,
    /// Its AICc is lower than the next by this much.
    BetterFit {
        /// The margin; 10 is decisive.
        margin: f64,
    },
    /// Others fit as well (within 2 of the best AICc, by this much); this is the most general theory among them.
    MostGeneral {
        /// How far its AICc is above the best.
        behind: f64,
    },
}

/// All laws tried, the best first.
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

/// AICc differences up to this one are no evidence (Burnham & Anderson 2002).
const NO_EVIDENCE: f64 = 2.0;

/// Fits the law asked for, or all that apply, and chooses by AICc: among those within 2 of the best, the most general theory, which
/// holds wherever the others do.
///
/// # Errors
/// As [`fit_curve`], where no law can be fitted.
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
    let mut first_error = None;
    let mut fits: Vec<CurveFit> = Vec::new();
    for kind in candidates {
        match fit_curve(curve, indenter, nu, kind, options) {
            Ok(fit) => fits.push(fit),
            Err(e) => first_error = first_error.or(Some(e)),
        }
    }
    let lowest = fits.iter().map(|f| f.statistics.aicc).fold(f64::INFINITY, f64::min);
    let Some(chosen) = fits.iter().position(|f| f.statistics.aicc <= lowest + NO_EVIDENCE) else {
        let missing = ElasticityError::TooFewLoads { expected: super::FEWEST_POINTS, found: 0 };
        return Err(first_error.unwrap_or(missing));
    };
    let chosen = fits.remove(chosen);
    fits.sort_by(|a, b| a.statistics.aicc.total_cmp(&b.statistics.aicc));
    let behind = chosen.statistics.aicc - lowest;
    let rival = fits.first().map(|f| f.statistics.aicc - chosen.statistics.aicc);
    let reason = match (model, rival) {
        (Model::Named(_), _) => SelectionReason::Asked,
        (Model::Auto, None) => SelectionReason::OnlyCandidate,
        (Model::Auto, Some(margin)) if margin > NO_EVIDENCE => SelectionReason::BetterFit { margin },
        (Model::Auto, Some(_)) => SelectionReason::MostGeneral { behind },
    };
    fits.insert(0, chosen);
    let likelihood: Vec<f64> = fits.iter().map(|f| (-0.5 * (f.statistics.aicc - lowest)).exp()).collect();
    let total: f64 = likelihood.iter().sum();
    let weights = likelihood.iter().map(|l| l / total).collect();
    Ok(CurveSelection { fits, weights, reason })
}
