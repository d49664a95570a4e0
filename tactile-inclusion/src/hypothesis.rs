//! The fits under one assumption about the face, and a test for a plain block before an inclusion
//! is fitted.
//!
//! The test is Rao's score test. Let r be the residual of the homogeneous block, J its derivatives,
//! C and P the covariances of errors and prior, and s the contribution of a given inclusion to the
//! pressures. A multiple of s, with the parameters of the homogeneous block fitted at the same
//! time, lowers the objective by
//!
//! $$ \frac{(s^T Q r)^2}{s^T Q s}, \qquad Q = C^{-1} - C^{-1} J (J^T C^{-1} J + P^{-1})^{-1} J^T
//! C^{-1} $$
//!
//! and the odds of this inclusion against none are $\exp(s^T Q r - \tfrac{1}{2} s^T Q s)$ (C. R.
//! Rao, Proc. Cambridge Philos. Soc. 44 (1948) 50). The contribution is computed in small strain on
//! a coarse mesh, with and without the inclusion's modulus on the same mesh. Its size is accurate
//! to a few tens of per cent.

use crate::covariance::Observed;
use crate::estimate::{
    Estimated, Identifiable, Inclusion, InclusionEstimate, InclusionWarning, TWO_SIDED_95,
};
use crate::fit::{Fit, Normal, Problem};
use crate::parameters::Coordinate;
use crate::ridge::Marginal;
use crate::starts::GridStart;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix2, Vector2};
use tactile_fem::Interface;

/// A fit is poor if χ² exceeds its mean by more than this number of standard deviations, which
/// happens by chance once in 1000.
const POOR: f64 = 3.1;

/// Minimum contrast, E₁/E₀ or E₀/E₁. An inclusion with a modulus closer to the tissue's explains no
/// more than the mesh difference to a homogeneous block (a contrast of 1.02 to 1.04 in homogeneous
/// blocks by CalculiX).
const LEAST_CONTRAST: f64 = 1.2;

/// Minimum probability of a found inclusion.
const LEAST_PROBABILITY: f64 = 0.99;

/// Minimum fall of χ² for a found inclusion: six standard errors. Errors of the finite elements
/// bring it to 25 in one of 38 homogeneous blocks by CalculiX. It is 60 or more for 161 of 162
/// inclusions there, and 33 for the last, which is barely detectable (`inclusion_study`).
const LEAST_FALL: f64 = 36.0;

/// χ² over its degrees of freedom above which the model does not describe the block, so that a lump
/// in it explains nothing. For a lump that touches the surface it is about ten.
const LARGEST_MISFIT: f64 = 50.0;

/// Corresponding limit of χ² with two degrees of freedom.
const LARGEST: f64 = 13.8;

/// Minimum predicted fall of the objective, for an inclusion of the grid, at which inclusions are
/// fitted. A found inclusion lowers χ² by 36; its neighbour in the grid achieves at least half of
/// that.
const LEAST_PROMISE: f64 = 18.0;

/// Difference of log-evidence above which one assumption about the face is clearly better. It
/// consists of odds of 20 to 1, and three times as much for the finite-element error on a sliding
/// face, of which the covariance contains only the size. Two frames on soft tissue by CalculiX
/// favoured the wrong assumption by up to 13, with a poor fit (`inclusion_study` on the scenes of
/// `evidence/inclusion_scenes.py`). In exchange, intervals cover both assumptions if the correct
/// one leads by less. If the better fit leaves residuals above the errors, differences are reduced
/// accordingly (K. P. Burnham & D. R. Anderson, *Model Selection and Multimodel Inference* (2002),
/// §2.5).
pub(crate) const CLEAR_EVIDENCE: f64 = 12.0;

/// Minimum fall of the objective for an inclusion of this probability, 2 ln(p / (1 − p)). Its
/// additional parameters lower the evidence further, because the posterior is narrower than the
/// prior.
pub(crate) const LEAST_GAIN: f64 = 9.2;

/// Errors of the apparent parameters of an off-axis inclusion (logarithms), relative to its distance
/// from the axis in radii of the face. They are the same in all presses: in solutions in three
/// dimensions balls of 11 and 12 mm, 4 to 7 mm aside, appear up to 11 % too flat, 4 % too small, 4 %
/// too deep and 40 % too stiff.
const APPARENT: [(Coordinate, f64); 4] = [
    (Coordinate::Aspect, 0.25),
    (Coordinate::Diameter, 0.06),
    (Coordinate::Depth, 0.1),
    (Coordinate::LumpModulus, 0.6),
];

/// Error of the apparent distance of an inclusion from the axis, relative to the depth of its centre
/// and to the fourth power of the distance in radii of the face. In solutions in three dimensions
/// a ball of 12 mm, 6 mm deep, seems 1.2 to 1.5 mm too close to the axis at 9 mm, and 0.05 mm at 5
/// mm.
const APPARENT_PLACE: f64 = 1.3;

/// Covariance of the coordinates of a fit because of the apparent parameters of its off-axis
/// inclusion.
///
/// An error of one of them changes the pressures of each press along their derivative, in
/// proportion to the press's distance, and moves the fit by M⁻¹ Jᵀ C⁻¹ times this change. As an
/// error of the pressures it would free the fit to leave for any inclusion in this direction.
fn apparent(problem: &Problem, fit: &Fit) -> DMatrix<f64> {
    let count = problem.priors.len();
    let none = DMatrix::zeros(count, count);
    let Some(cells) = &problem.forward.cells else {
        return none;
    };
    let (positions, parameters) = (&cells.positions, &fit.parameters);
    let (columns, factor) = (&fit.normal.columns, problem.factor.l());
    let radius_m = cells.face_radius_m;
    let asides_m = positions.asides_m(parameters);
    // Changes of the values by an error of a coordinate that depends on the press.
    let change = |coordinate: Coordinate, error: &dyn Fn(usize) -> f64| {
        let mut change = &factor * &columns[problem.index(coordinate)?];
        for (value, press) in change.iter_mut().zip(positions.presses.iter().cycle()) {
            *value *= error(*press);
        }
        Some(change)
    };
    let of_sizes = APPARENT.iter().filter_map(|(coordinate, error)| {
        change(*coordinate, &|press| error * asides_m[press] / radius_m)
    });
    let lump = parameters.lump;
    let deep_m = lump.map_or(0.0, |lump| lump.depth_m + 0.5 * lump.axes_m()[1]);
    let of_place = [0, 1].map(|k| {
        change(Coordinate::Centre(k), &|press| {
            let aside = parameters.place.centre_m[k] - positions.axis_m(press, parameters)[k];
            // A press from which the inclusion is beyond the rim hardly shows it.
            let far = (asides_m[press] / radius_m).min(cells.reach_m / radius_m);
            APPARENT_PLACE * deep_m * far.powi(4) * aside / asides_m[press].max(f64::MIN_POSITIVE)
        })
    });
    let of_place = of_place.into_iter().flatten().reduce(|x, y| x + y);
    of_sizes.chain(of_place).fold(none, |sum, change| {
        let change = problem.whitened(change);
        let along = DVector::from_iterator(count, columns.iter().map(|c| c.dot(&change)));
        let by = &fit.covariance * along;
        sum + &by * by.transpose()
    })
}

/// Whether a fit leaves residuals above the errors.
pub(crate) fn is_poor(misfit: f64, observed: &Observed) -> bool {
    let freedom = observed.values.len() as f64;
    misfit > freedom + POOR * (2.0 * freedom).sqrt()
}

/// The fit with the higher evidence, without or with an inclusion.
pub(crate) fn better<'a>(homogeneous: &'a Fit, lump: Option<&'a Fit>) -> &'a Fit {
    lump.filter(|lump| lump.evidence > homogeneous.evidence)
        .unwrap_or(homogeneous)
}

/// The best fits under one assumption about the face.
pub(crate) struct Hypothesis {
    pub problem: Problem,
    pub interface: Interface,
    pub homogeneous: Fit,
    /// Predicted contributions of inclusions. `None` if one was fitted.
    pub score: Option<Score>,
    pub lump: Option<Fit>,
    /// Posterior distributions of the fit with an inclusion, once its ridge has been followed.
    pub marginal: Option<Marginal>,
}

impl Hypothesis {
    /// Follows the ridge of the fit with an inclusion, if the evidence favours one, and adds the
    /// errors of its apparent parameters.
    pub(crate) fn follow(&mut self, go_on: impl FnMut() -> bool) {
        let homogeneous = self.homogeneous.evidence;
        if let Some(fit) = (self.lump.as_mut()).filter(|fit| fit.evidence > homogeneous) {
            let ridge = self.problem.ridge(fit, go_on);
            let apparent = apparent(&self.problem, fit);
            fit.covariance += &apparent;
            let shape = self.problem.index(Coordinate::Aspect);
            let shape = shape.map(|index| (index, self.problem.priors[index].standard_error));
            self.marginal = ridge.and_then(|mut ridge| {
                let nodes = ridge.nodes.iter_mut();
                nodes.for_each(|node| node.covariance += &apparent);
                Marginal::new(&ridge, shape)
            });
        }
    }

    pub(crate) fn evidence(&self) -> f64 {
        self.homogeneous.evidence.max(self.evidence_with())
    }

    /// The fit with the higher evidence.
    pub(crate) fn better(&self) -> &Fit {
        better(&self.homogeneous, self.lump.as_ref())
    }

    /// Difference of log-evidence above which this assumption is clearly better than another. It
    /// grows with χ² over its degrees of freedom, if these exceed one.
    pub(crate) fn clear_evidence(&self, observed: &Observed) -> f64 {
        let excess = self.better().normal.misfit / observed.values.len() as f64;
        CLEAR_EVIDENCE * excess.max(1.0)
    }

    /// Log-evidence above which another assumption is a rival of this one.
    pub(crate) fn rival_evidence(&self, observed: &Observed) -> f64 {
        self.evidence() - self.clear_evidence(observed)
    }

    /// Log-evidence with an inclusion. Without a fit, it comes from the grid.
    fn evidence_with(&self) -> f64 {
        match (&self.lump, &self.score) {
            (Some(fit), _) => fit.evidence + self.marginal.as_ref().map_or(0.0, |m| m.gain),
            (None, Some(score)) => self.homogeneous.evidence + score.log_odds,
            (None, None) => f64::NEG_INFINITY,
        }
    }

    /// Log-odds of an inclusion, over both contact conditions.
    fn log_odds(&self, rival: Option<&Self>) -> f64 {
        let both = || [self].into_iter().chain(rival);
        let with = both().map(Self::evidence_with);
        let without = both().map(|one| one.homogeneous.evidence);
        with.fold(f64::NEG_INFINITY, f64::max) - without.fold(f64::NEG_INFINITY, f64::max)
    }

    /// The fit with an inclusion, if it counts as found at these odds.
    fn found(&self, log_odds: f64) -> Option<&Fit> {
        let values = self.problem.measured.len() as f64;
        self.lump.as_ref().filter(|fit| {
            let parameters = &fit.parameters;
            let lowest = (parameters.lump).map_or(0.0, |lump| lump.depth_m + lump.axes_m()[1]);
            let modulus = |coordinate| fit.parameters.get(coordinate);
            let contrast = modulus(Coordinate::LumpModulus) - modulus(Coordinate::BlockModulus);
            probability(log_odds) > LEAST_PROBABILITY
                && self.homogeneous.normal.misfit - fit.normal.misfit > LEAST_FALL
                && contrast.abs() > f64::ln(LEAST_CONTRAST)
                && fit.normal.misfit < LARGEST_MISFIT * values
                && lowest < parameters.height_m
        })
    }

    /// Value and 95 % interval of a coordinate, with errors widened by a factor.
    ///
    /// The optimum of a skewed posterior lies at one end of the interval, so D and d are medians.
    /// For E₁ the upper tail comes from the prior, and so would the median: the optimum depends on
    /// it less.
    fn posterior(&self, fit: &Fit, coordinate: Coordinate, widened: f64) -> (f64, [f64; 2]) {
        let is_modulus = coordinate == Coordinate::LumpModulus;
        let mut best = fit.parameters.get(coordinate);
        let coordinate = self.problem.index(coordinate).unwrap_or(0);
        let is_lump = fit.parameters.lump.is_some();
        let (at, [low, high]) = match self.marginal.as_ref().filter(|_| is_lump) {
            Some(marginal) => {
                let median = marginal.median(coordinate);
                if marginal.ball > 0.5 {
                    best += self.step_to_ball(fit, coordinate);
                }
                let at = if is_modulus { best } else { median };
                (at, marginal.interval(coordinate))
            }
            None => {
                let reach = TWO_SIDED_95 * fit.covariance[(coordinate, coordinate)].sqrt();
                (best, [best - reach, best + reach])
            }
        };
        let (down, up) = ((at - low).max(0.0), (high - at).max(0.0));
        (at, [at - widened * down, at + widened * up])
    }

    /// Whether the outline of an inclusion is not round, at a significance of 0.001.
    fn is_elongated(&self, fit: &Fit) -> bool {
        let Some(first) = self.problem.index(Coordinate::Elongation(0)) else {
            return false;
        };
        // Standard error of the elongation that an off-axis ball appears to have: 0.02 in solutions
        // in three dimensions.
        let of_model = Matrix2::identity() * 0.02_f64.powi(2);
        let covariance = fit.covariance.fixed_view::<2, 2>(first, first) + of_model;
        let elongation = Vector2::from(fit.parameters.place.elongation);
        let inverse = covariance.try_inverse();
        inverse.is_some_and(|inverse| elongation.dot(&(inverse * elongation)) > LARGEST)
    }

    /// Change of a coordinate from the fit to the fit with a ball.
    fn step_to_ball(&self, fit: &Fit, coordinate: usize) -> f64 {
        let away = self.problem.index(Coordinate::Aspect).map(|shape| {
            let c = &fit.covariance;
            c[(coordinate, shape)] / c[(shape, shape)] * fit.parameters.get(Coordinate::Aspect)
        });
        -away.unwrap_or(0.0)
    }

    /// Correlations of ln D, ln d and ln E₁.
    fn correlation(&self, fit: &Fit) -> [[f64; 3]; 3] {
        let marginal = self.marginal.as_ref().map(Marginal::covariance);
        let c = marginal.as_ref().unwrap_or(&fit.covariance);
        let sizes = [
            Coordinate::Diameter,
            Coordinate::Depth,
            Coordinate::LumpModulus,
        ];
        let at = sizes.map(|coordinate| self.problem.index(coordinate).unwrap_or(0));
        at.map(|i| at.map(|k| c[(i, k)] / (c[(i, i)] * c[(k, k)]).sqrt()))
    }

    /// The result. `rival` fits the frames about equally well; `is_unsolved` means that a possible
    /// rival could not be solved.
    pub(crate) fn estimate(
        self,
        observed: &Observed,
        rival: Option<&Self>,
        is_unsolved: bool,
    ) -> InclusionEstimate {
        let log_odds = self.log_odds(rival);
        let found = self.found(log_odds);
        let is_found = found.is_some();
        let chosen = found.unwrap_or(&self.homogeneous);
        let misfit = chosen.normal.misfit / observed.values.len() as f64;
        let is_poor = is_poor(chosen.normal.misfit, observed);
        let widened = if is_poor { misfit.sqrt() } else { 1.0 };
        let mut warnings = Vec::new();
        if is_poor {
            warnings.push(InclusionWarning::PoorFit { excess: misfit });
        }
        if observed.frames == 1 {
            warnings.push(InclusionWarning::OneFrame);
        }
        if !chosen.converged {
            warnings.push(InclusionWarning::NotConverged);
        }
        if rival.is_some() || is_unsolved {
            warnings.push(InclusionWarning::UncertainInterface);
        }
        let is_at_boundary = chosen.parameters.is_at_boundary();
        if is_at_boundary {
            warnings.push(InclusionWarning::AtBoundary);
        }
        let cells = self.problem.forward.cells.as_ref();
        let is_at_rim = cells.is_some_and(|cells| cells.is_at_rim(&chosen.parameters));
        if is_at_rim {
            warnings.push(InclusionWarning::AtRim);
        }
        let found = found.filter(|_| observed.cells.is_none() || !is_poor);
        let elongated = found.filter(|fit| self.is_elongated(fit));
        if let Some(fit) = elongated {
            let [a, b] = fit.parameters.place.elongation;
            let axes = (2.0 * a.hypot(b)).exp();
            warnings.push(InclusionWarning::NotABall { axes });
        }
        let found = found.filter(|_| elongated.is_none());
        let is_reliable =
            chosen.converged && !is_poor && !is_unsolved && !is_at_boundary && !is_at_rim;
        let posterior = |coordinate: Coordinate| {
            let (at, interval) = self.posterior(chosen, coordinate, widened);
            let other = rival.and_then(|rival| {
                let lump = rival.lump.as_ref().filter(|_| found.is_some());
                let plain = coordinate.is_of_block().then_some(&rival.homogeneous);
                Some(rival.posterior(lump.or(plain)?, coordinate, widened).1)
            });
            (at, other.map_or(interval, |other| hull(interval, other)))
        };
        let estimated = |coordinate| {
            let (at, interval) = posterior(coordinate);
            Estimated::within(at, interval)
        };
        let position = |axis: usize| {
            let (at, interval) = posterior(Coordinate::Centre(axis));
            let error = if is_at_rim { PLACE_AT_RIM } else { 0.0 };
            Estimated::new(at, interval).widened(error * self.problem.forward.guide.radius_m())
        };
        let inclusion = found.map(|fit| {
            let parameter = |coordinate| Identifiable::new(estimated(coordinate), is_reliable);
            Inclusion {
                position_m: (observed.cells.as_ref()).map(|_| [0, 1].map(position)),
                diameter_m: parameter(Coordinate::Diameter),
                depth_m: parameter(Coordinate::Depth),
                youngs_modulus_pa: parameter(Coordinate::LumpModulus),
                height_over_width: self
                    .problem
                    .index(Coordinate::Aspect)
                    .map(|_| estimated(Coordinate::Aspect)),
                ball_probability: self.marginal.as_ref().map_or(1.0, |marginal| marginal.ball),
                correlation: self.correlation(fit),
            }
        });
        let rings = observed.radii_m.len();
        let split = |values: &[f64]| -> Vec<Vec<f64>> {
            let pressures = values[..observed.frames * rings].chunks(rings);
            pressures.map(<[f64]>::to_vec).collect()
        };
        InclusionEstimate {
            probability: probability(log_odds),
            found: is_found,
            block_modulus_pa: estimated(Coordinate::BlockModulus),
            inclusion,
            second: None,
            interface: self.interface,
            misfit,
            warnings,
            radii_m: observed.radii_m.clone(),
            fitted_pa: split(&chosen.normal.predicted),
            homogeneous_pa: split(&self.homogeneous.normal.predicted),
        }
    }
}

/// Standard error of the position of an inclusion under the rim, relative to the radius of the
/// face: the law of the load's spread was not fitted there. In a block solved in three dimensions
/// the estimate is half a millimetre too close to the axis, on a face of 16 mm radius.
const PLACE_AT_RIM: f64 = 0.03;

fn probability(log_odds: f64) -> f64 {
    1.0 / (1.0 + (-log_odds).exp())
}

/// The smallest interval that contains both.
fn hull(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// A fit with its derivatives, to assess changes of its values.
pub(crate) struct Assessed<'a> {
    problem: &'a Problem,
    normal: &'a Normal,
    /// Whitened derivatives with respect to the fitted parameters.
    columns: DMatrix<f64>,
    precision: Cholesky<f64, Dyn>,
}

impl<'a> Assessed<'a> {
    /// `None` if the curvature at the fit is not positive.
    pub(crate) fn new(problem: &'a Problem, normal: &'a Normal) -> Option<Self> {
        Some(Self {
            problem,
            normal,
            columns: DMatrix::from_columns(&normal.columns),
            precision: normal.matrix.clone().cholesky()?,
        })
    }

    /// The whitened change of the values for relative changes.
    pub(crate) fn added(&self, relative: impl Iterator<Item = f64>) -> DVector<f64> {
        let values = relative.zip(&self.normal.predicted);
        let added = values.map(|(part, p)| part * p);
        let count = self.normal.predicted.len();
        self.problem.whitened(DVector::from_iterator(count, added))
    }

    /// The whitened residual, without the part that the parameters can still absorb.
    fn left(&self) -> DVector<f64> {
        let residual = self.problem.residual(&self.normal.predicted);
        let absorbed = self.precision.solve(&self.normal.gradient);
        self.problem.whitened(residual) - &self.columns * absorbed
    }

    /// Log-odds of other values against those of the fit, whose parameters are fitted along.
    pub(crate) fn log_odds(&self, values: &[f64]) -> f64 {
        let pairs = values.iter().zip(&self.normal.predicted);
        let added = self.added(pairs.map(|(other, value)| other / value - 1.0));
        added.dot(&self.left()) - 0.5 * self.gain(&added)
    }

    /// Fall of χ² by a whitened change that is present, minus the part that the parameters of the
    /// block absorb: sᵀ Q s.
    pub(crate) fn gain(&self, added: &DVector<f64>) -> f64 {
        let shared = self.columns.tr_mul(added);
        added.norm_squared() - shared.dot(&self.precision.solve(&shared))
    }
}

/// Effect of a grid of inclusions on a homogeneous fit.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Score {
    /// Largest fall of the objective.
    pub predicted_gain: f64,
    /// Log-odds of an inclusion, with equal priors on the grid.
    log_odds: f64,
}

impl Score {
    /// Computes the score of a fit without inclusion. `None` if the curvature at the fit is not positive.
    pub(crate) fn new(problem: &Problem, homogeneous: &Fit, grid: &[GridStart]) -> Option<Self> {
        let plain = Assessed::new(problem, &homogeneous.normal)?;
        let left = plain.left();
        let mut odds = Vec::new();
        let mut predicted_gain = 0.0f64;
        for start in grid {
            let added = plain.added(start.added.iter().copied());
            let square = plain.gain(&added);
            if square <= 0.0 {
                continue;
            }
            let along = added.dot(&left);
            predicted_gain = predicted_gain.max(along.powi(2) / square);
            odds.push(along - 0.5 * square);
        }
        let largest = odds.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let sum: f64 = odds.iter().map(|odds| (odds - largest).exp()).sum();
        Some(Self {
            predicted_gain,
            log_odds: largest + (sum / odds.len().max(1) as f64).ln(),
        })
    }

    /// Whether an inclusion can be ruled out.
    pub(crate) fn is_homogeneous(&self) -> bool {
        self.predicted_gain < LEAST_PROMISE
    }
}
