//! Fits under one assumption about the face: of a homogeneous block, the first ones with an
//! inclusion, and the final one.

use crate::covariance::{Observed, Resolution};
use crate::fit::{ANSWER_ENDING, FIRST_FIT_ENDING, Fit, Prior, Problem};
use crate::forward::Forward;
use crate::hypothesis::{Hypothesis, LEAST_GAIN, Score, better};
use crate::inclusion_search::InclusionSearch;
use crate::parameters::Parameters;
use crate::progress::Counter;
use crate::starts::{GridStart, starts};
use tactile_fem::{Interface, Kinematics};

/// χ² of the first fit over its degrees of freedom up to which the block may be plain. Mesh errors
/// bring homogeneous blocks by CalculiX to 1.5, and to 2.2 under the wrong assumption about the
/// face. If an inclusion raises it above 2, no test is needed.
const DOUBTFUL: f64 = 2.0;

/// Elements along an eighth of the inclusion's circumference, for the first fit of a homogeneous
/// block and for the grid.
const HOMOGENEOUS_FINENESS: usize = 2;

/// Difference of log-evidence between the first fits above which an assumption about the face is
/// discarded.
const HOPELESS_EVIDENCE: f64 = 25.0;

/// Diameter of an inclusion relative to the face radius, and χ² of the first fit over its degrees
/// of freedom, below both of which an assumption about the face is not discarded. Balls of 4 to 6
/// mm are too small for the first mesh: under a sliding face it raises χ² of the true assumption to
/// 2.5 times its degrees of freedom, and the evidence of the other is then larger by up to 83. With
/// wider inclusions these are at most 1.3 times and 17 (60 blocks of
/// `evidence/inclusion_scenes.py`).
const NARROW: f64 = 0.4;
const HOPELESS_MISFIT: f64 = 3.0;

/// Number of starts that are fitted. With tempered errors most lead to the same optimum; a third
/// start takes a quarter more time.
const FITTED_STARTS: usize = 2;

/// Elements along an eighth of the inclusion's circumference in the first fits with an inclusion.
const FIRST_FINENESS: usize = 3;

/// Difference of log-evidence between the first fits above which a block is not plain.
const CERTAIN_EVIDENCE: f64 = 50.0;

/// Elements along an eighth of the inclusion's circumference for the final fit. For bonded blocks
/// the pressure is within 0.05 % of that of a mesh with ten. Five elements leave waves of 0.1 %
/// above a wide shallow inclusion, which change its size and depth by one bound. On a sliding face
/// they change χ² by up to ten, which is enough to mistake it for a bonded one. For a barely
/// detectable inclusion, the noise exceeds the error of five elements.
fn answer_fineness(is_certain: bool) -> usize {
    if is_certain { 7 } else { 5 }
}

/// A homogeneous block under one assumption about the face.
pub(crate) struct HomogeneousFit {
    /// Problem of the first fits.
    pub problem: Problem,
    pub interface: Interface,
    pub fit: Fit,
    /// The fit on the final mesh with the predicted contributions of inclusions. `None` if the
    /// block cannot be plain.
    pub settled: Option<(Fit, Score)>,
    pub grid: Vec<GridStart>,
    /// Small strain on the plain block with its prior parameters, used to solve the grid.
    pub linear: Forward,
    pub known: Parameters,
}

impl HomogeneousFit {
    /// Whether inclusions can be ruled out if the face is as assumed.
    pub(crate) fn is_homogeneous(&self) -> bool {
        (self.settled.as_ref()).is_some_and(|(_, score)| score.is_homogeneous())
    }

    /// Starts with pressures scaled to those observed, the best first.
    pub(crate) fn starts(&self) -> Vec<Parameters> {
        let mut scaled: Vec<(f64, Parameters)> = (self.grid.iter())
            .filter_map(|start| (self.problem).scaled_start(&start.parameters, &start.predicted))
            .collect();
        scaled.sort_by(|a, b| a.0.total_cmp(&b.0));
        scaled.into_iter().map(|(_, start)| start).collect()
    }
}

impl InclusionSearch {
    /// Fits a homogeneous block. `None` if it could not be solved.
    pub(crate) fn homogeneous(
        &self,
        observed: &Observed,
        approaches_m: &[f64],
        interface: Interface,
        counter: &mut Counter<'_>,
    ) -> Option<HomogeneousFit> {
        let guess = self.stiffness(observed, approaches_m);
        let forward = self.forward(observed, approaches_m, interface, HOMOGENEOUS_FINENESS);
        let mut problem = Problem {
            forward: forward.clone(),
            measured: observed.values.clone(),
            factor: (observed.covariance(self.sensor(), interface, Resolution::FirstFits))
                .cholesky()?,
            priors: self.block_priors(guess),
        };
        let presses = (observed.cells.as_ref()).map_or(1, |cells| cells.positions.axes_m.len());
        (problem.priors).extend(self.approach_priors(presses, approaches_m));
        let block = self.known_block(guess);
        let (_, start) = problem.scaled_start(&block, &forward.predict(&block)?)?;
        let fit = problem.fit(&start, FIRST_FIT_ENDING, || counter.step())?;
        // A homogeneous block that fits the pressures of an inclusion has parameters far from their
        // priors; the starts must not.
        let mut known = self.known_block(fit.parameters.block_modulus_pa);
        problem.forward = problem.forward.with_plain(&known)?;
        if let Some(cells) = &problem.forward.cells {
            known.strayed_m = vec![[0.0; 2]; cells.positions.axes_m.len()];
            known.place.centre_m = cells.most_symmetric(&observed.values);
        }
        let linear = Forward {
            kinematics: Kinematics::Linear,
            ..problem.forward.clone()
        };
        let linear = linear.with_plain(&known)?;
        let grid = starts(&linear, &known, counter)?;
        let settled = if fit.normal.misfit < DOUBTFUL * observed.values.len() as f64 {
            self.settled(&problem, &fit, observed, &grid, counter)
        } else {
            None
        };
        Some(HomogeneousFit {
            problem,
            interface,
            fit,
            settled,
            grid,
            linear,
            known,
        })
    }

    /// The fit of the homogeneous block on the final mesh, and the predicted contributions of
    /// inclusions.
    fn settled(
        &self,
        problem: &Problem,
        homogeneous: &Fit,
        observed: &Observed,
        grid: &[GridStart],
        counter: &mut Counter<'_>,
    ) -> Option<(Fit, Score)> {
        let problem = self.on_answers_mesh(problem, observed)?;
        let fit = problem.fit(&homogeneous.parameters, ANSWER_ENDING, || counter.step())?;
        let score = Score::new(&problem, &fit, grid)?;
        Some((fit, score))
    }

    /// A first-fit problem transferred to the final mesh, with the errors of that mesh.
    pub(crate) fn on_answers_mesh(
        &self,
        problem: &Problem,
        observed: &Observed,
    ) -> Option<Problem> {
        let interface = problem.forward.interface;
        let covariance = observed.covariance(self.sensor(), interface, Resolution::Answer);
        Some(Problem {
            forward: Forward {
                fineness: answer_fineness(false),
                ..problem.forward.clone()
            },
            factor: covariance.cholesky()?,
            ..problem.clone()
        })
    }

    /// Modulus of a homogeneous block from mean pressure over mean strain: accurate to a factor of
    /// three, from where the fit of ln E₀ converges.
    fn stiffness(&self, observed: &Observed, approaches_m: &[f64]) -> f64 {
        let rings = observed.radii_m.len();
        let last = observed.frames - 1;
        let pressures = &observed.values[last * rings..observed.frames * rings];
        let mean = pressures.iter().sum::<f64>() / rings as f64;
        let strain = approaches_m[last] / self.specimen().height_m();
        // Below one pascal there is no contact, and the misfit of the fit will reveal this.
        (0.5 * mean / strain).max(1.0)
    }
}

/// The best first fits under one assumption about the face.
///
/// Their covariance includes the error of the coarse mesh. Without it the objective would be as
/// rough as this error, and fits would end far from the truth.
pub(crate) struct FirstFits {
    problem: Problem,
    pub interface: Interface,
    homogeneous: Fit,
    /// The fit of the homogeneous block on the final mesh, if the block may be homogeneous.
    settled: Option<Fit>,
    score: Option<Score>,
    lump: Option<Fit>,
}

impl FirstFits {
    /// First fits without an inclusion.
    pub(crate) fn homogeneous(homogeneous: HomogeneousFit) -> Self {
        let (settled, score) = homogeneous.settled.unzip();
        Self {
            problem: homogeneous.problem,
            interface: homogeneous.interface,
            homogeneous: homogeneous.fit,
            settled,
            score,
            lump: None,
        }
    }

    fn better(&self) -> &Fit {
        better(&self.homogeneous, self.lump.as_ref())
    }

    /// Log-evidence of the better fit.
    pub(crate) fn evidence(&self) -> f64 {
        self.better().evidence
    }

    /// Fits an inclusion from a start, and keeps the fit if it is the best so far. The fit is stopped
    /// if it cannot compete with `another` assumption.
    pub(crate) fn fit(
        &mut self,
        start: &Parameters,
        another: Option<&Self>,
        counter: &mut Counter<'_>,
    ) {
        let ending = another.map_or(FIRST_FIT_ENDING, |another| {
            let evidence = another.evidence() - HOPELESS_EVIDENCE;
            let needed = (self.problem).objective_at(evidence, another.better().volume);
            FIRST_FIT_ENDING.below(needed.max(self.largest_misfit()))
        });
        let found = self.problem.fit(start, ending, || counter.step());
        let fits = self.lump.take().into_iter().chain(found);
        self.lump = fits.max_by(|a, b| a.evidence.total_cmp(&b.evidence));
    }

    /// Whether this assumption about the face is discarded, as `best` fits better.
    pub(crate) fn is_hopeless(&self, best: &Self) -> bool {
        let fit = self.better();
        let narrow_m = NARROW * self.problem.forward.guide.radius_m();
        let is_narrow = (fit.parameters.lump).is_some_and(|lump| lump.diameter_m < narrow_m);
        self.evidence() < best.evidence() - HOPELESS_EVIDENCE
            && !(is_narrow && fit.normal.misfit < self.largest_misfit())
    }

    /// Largest χ² of a true assumption about the face.
    fn largest_misfit(&self) -> f64 {
        HOPELESS_MISFIT * self.problem.measured.len() as f64
    }
}

impl InclusionSearch {
    /// The best first fits with an inclusion, from the best starts of the grid and from the best
    /// fit under `another` assumption.
    pub(crate) fn first_fits(
        &self,
        observed: &Observed,
        approaches_m: &[f64],
        homogeneous: HomogeneousFit,
        another: Option<&FirstFits>,
        counter: &mut Counter<'_>,
    ) -> FirstFits {
        let starts = homogeneous.starts();
        let mut first_fits = FirstFits::homogeneous(homogeneous);
        let modulus = first_fits.homogeneous.parameters.block_modulus_pa;
        let problem = &mut first_fits.problem;
        problem.priors.extend(self.lump_priors(modulus));
        problem.priors.extend(self.place_priors(observed));
        let forward = self.forward(observed, approaches_m, first_fits.interface, FIRST_FINENESS);
        problem.forward = Forward {
            cells: problem.forward.cells.clone(),
            ..forward
        };
        let best = another.and_then(|another| another.lump.as_ref());
        let best = best.map(|lump| &lump.parameters);
        for start in best.into_iter().chain(&starts).take(FITTED_STARTS) {
            first_fits.fit(start, another, counter);
        }
        first_fits
    }

    /// Repeats the first fits on the final mesh, in full if their log-evidence exceeds `needed`.
    /// `None` if the homogeneous block could not be solved.
    pub(crate) fn hypothesis(
        &self,
        observed: &Observed,
        approaches_m: &[f64],
        first_fits: FirstFits,
        needed: f64,
        counter: &mut Counter<'_>,
    ) -> Option<Hypothesis> {
        let FirstFits {
            mut problem,
            interface,
            homogeneous,
            settled,
            score,
            lump,
        } = first_fits;
        let with_lump = core::mem::take(&mut problem.priors);
        let of_block = with_lump
            .iter()
            .filter(|prior| prior.coordinate.is_of_block());
        let homogeneous_priors: Vec<Prior> = of_block.copied().collect();
        let gain = (lump.as_ref()).map_or(f64::NEG_INFINITY, |lump| {
            lump.evidence - homogeneous.evidence
        });
        let is_certain = gain > CERTAIN_EVIDENCE;
        let fineness = answer_fineness(is_certain);
        let forward = self.forward(observed, approaches_m, interface, fineness);
        problem.forward = forward
            .with_plain((lump.as_ref()).map_or(&homogeneous.parameters, |lump| &lump.parameters))?;
        let observed = &match &lump {
            Some(fit) => {
                let (face, solved) = (problem.forward.cells.as_ref(), &fit.normal.solved);
                (observed.clone()).with_lump_aside(&fit.parameters, face, solved)
            }
            None => observed.clone(),
        };
        let covariance = observed.covariance(self.sensor(), interface, Resolution::Answer);
        problem.factor = covariance.cholesky()?;
        let homogeneous = match settled {
            Some(settled) => settled,
            None if is_certain => homogeneous,
            None => {
                problem.priors = homogeneous_priors;
                problem.fit(&homogeneous.parameters, ANSWER_ENDING, || counter.step())?
            }
        };
        problem.priors = with_lump;
        let ending = if is_certain {
            ANSWER_ENDING
        } else {
            ANSWER_ENDING.below(homogeneous.normal.objective() - LEAST_GAIN)
        };
        let lump = lump.and_then(|fit| {
            let ending = ending.below(problem.objective_at(needed, fit.volume));
            problem.fit(&fit.parameters, ending, || counter.step())
        });
        Some(Hypothesis {
            problem,
            interface,
            homogeneous,
            score,
            lump,
            marginal: None,
        })
    }
}
