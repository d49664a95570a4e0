//! What finite strain adds to the linear contact of a ball.
//!
//! At the same contact radius a ball on a rigid flat carries less than linear theory says, at first by a tenth of a/R; a guide that
//! yields wraps round the ball and carries more. Both parts are fitted to finite elements without friction, neo-Hookean with ν = 0.495:
//! balls on a rigid flat (11 loads, a/R 0.1 to 0.9) and a ball on three layers (a/R 0.6 to 1.07). They are mixed by how much of the
//! compliance is each body's.

/// The correction as ln(F/F_linear) at the same a/R, split by which body yields.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FiniteStrain {
    poisson_ratio: f64,
}

impl FiniteStrain {
    /// Largest a/R of the scenes that the correction was fitted to.
    pub(crate) const LARGEST_CONTACT_RATIO: f64 = 1.2;
    /// Largest a/h of these.
    pub(crate) const LARGEST_LAYER_RATIO: f64 = 1.5;

    pub(crate) fn new(poisson_ratio: f64) -> Self {
        Self { poisson_ratio }
    }

    /// ln(F/F_linear) and its slope in ln x, x = a/R; `ball` is the ball's part of the compliance.
    pub(crate) fn force(&self, x: f64, ball: f64) -> (f64, f64) {
        let of_ball = odd_series(BALL, x);
        let of_guide = odd_series(GUIDE, x);
        let mixed = |of_ball: f64, of_guide: f64| ball * of_ball + (1.0 - ball) * of_guide;
        (mixed(of_ball.0, of_guide.0), mixed(of_ball.1, of_guide.1))
    }

    /// ln(δ/δ_linear) and its slope in ln x; δ is the approach of the ball's centre, which the ball's own bulk lets lag behind.
    pub(crate) fn indentation(&self, x: f64, ball: f64) -> (f64, f64) {
        // Beyond a/R = 1 nothing was pressed on a flat; a straight line keeps δ growing with a.
        let inside = x.min(1.0);
        let terms = [
            CENTRE[0] * inside,
            CENTRE[1] * inside.powi(2),
            CENTRE[2] * inside.powi(3),
        ];
        let slope = terms[0] + 2.0 * terms[1] + 3.0 * terms[2];
        let value = terms.iter().sum::<f64>() + slope * (x / inside).ln();
        (ball * ball * value, ball * ball * slope)
    }

    /// Standard error of ln F from the model.
    pub(crate) fn model_error(
        &self,
        x: f64,
        layer_ratio: Option<f64>,
        by_indentation: bool,
    ) -> f64 {
        let fit = 0.003 + 0.01 * x * x;
        // The guide's part is fitted to one guide. A single layer (h = 1.2 R, as stiff as the ball, a/R = 0.39) leaves 5 % of
        // the force, 3 % of it within the radius's own uncertainty: that is one and a half of these standard errors.
        let layers = layer_ratio.map_or(0.0, |ratio| 0.01 + 0.03 * x + 0.01 * ratio);
        let centre = match (by_indentation, layer_ratio) {
            (false, _) => 0.0,
            (true, None) => 0.01 + 0.02 * x,
            (true, Some(_)) => 0.02 + 0.1 * x,
        };
        // Fitted at ν = 0.495; what ν does at finite strain is not known, and taken as the correction's own size.
        let compressible = 0.2 * (0.5 - self.poisson_ratio).max(0.0) * x;
        (fit + layers).hypot(centre).hypot(compressible)
    }
}

/// Σ cₖ x^(2k+1) and its slope in ln x.
fn odd_series(coefficients: [f64; 3], x: f64) -> (f64, f64) {
    let (mut value, mut slope) = (0.0, 0.0);
    for (c, power) in coefficients.into_iter().zip([1.0, 3.0, 5.0]) {
        let term = c * x.powf(power);
        value += term;
        slope += power * term;
    }
    (value, slope)
}

/// A ball on a rigid flat: leaves 0.13 % of the finite elements' force up to a/R = 0.9.
const BALL: [f64; 3] = [-0.0945, 0.0087, 0.1069];
/// A guide that yields: leaves 1 % of the force on the paper's guide, a/R 0.6 to 1.07.
const GUIDE: [f64; 3] = [0.14, 0.0, 0.103];
/// The ball's centre, terms in x, x² and x³: leaves 0.7 % of the finite elements' approach.
const CENTRE: [f64; 3] = [-0.272, -0.06, -0.3];
