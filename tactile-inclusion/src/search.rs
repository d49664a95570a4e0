//! Search for an inclusion: fits without one, then first fits and final fits under each assumption
//! about the face.

use crate::covariance::{Observed, ObservedCells, Resolution};
use crate::estimate::{InclusionEstimate, InclusionWarning};
use crate::fit::{ANSWER_ENDING, FIRST_FIT_ENDING, Fit, Prior, Problem};
use crate::forward::Forward;
use crate::hypothesis::{Assessed, Hypothesis, LEAST_GAIN, Score, better};
use crate::parameters::{Coordinate, LARGEST_POISSON_RATIO, Parameters, Place};
use crate::picture::{Cells, extent};
use crate::progress::Counter;
use crate::scan::Scan;
use crate::starts::{GridStart, starts};
use crate::tissue_block::{PressureProfile, SensorErrors, TissueBlock, check};
use core::ops::ControlFlow;
use std::sync::Arc;
use tactile_core::Progress;
use tactile_elasticity::{ElasticityError, Quantity};
use tactile_fem::{Guide, Interface, Kinematics};

/// Difference of log-evidence above which the other assumption about the face is not fitted to the
/// end.
const RIVAL_EVIDENCE: f64 = 16.0;

/// Prior standard deviation of an inclusion's elongations (logarithms).
const ELONGATION: f64 = 0.2;

/// With fewer rings the shape of an inclusion is not resolved.
const MIN_RINGS: usize = 8;

/// χ² of the first fit over its degrees of freedom up to which the block may be plain. Mesh errors
/// bring homogeneous blocks by CalculiX to 1.5, and to 2.2 under the wrong assumption about the
/// face. If an inclusion raises it above 2, no test is needed.
const DOUBTFUL: f64 = 2.0;

/// Elements along an eighth of the inclusion's circumference, for the first fit of a homogeneous
/// block and for the grid.
const HOMOGENEOUS_FINENESS: usize = 2;

/// The fraction of the better misfit in [`HOPELESS_EVIDENCE`]. Above a ball of 6 mm, 2.4 mm deep,
/// the first mesh raises the misfit under the true assumption by a third.
const HOPELESS_MISFIT: f64 = 0.3;

/// Difference of log-evidence between the first fits above which an assumption about the face is
/// discarded. A fraction of the better misfit, most of which is mesh error, is added.
const HOPELESS_EVIDENCE: f64 = 25.0;

/// Number of starts that are fitted. With tempered errors most lead to the same optimum; a third
/// start takes a quarter more time.
const FITTED_STARTS: usize = 2;

/// Elements along an eighth of the inclusion's circumference in the first fits with an inclusion.
const FIRST_FINENESS: usize = 3;

/// Difference of log-evidence between the first fits above which a block is not plain.
const CERTAIN_EVIDENCE: f64 = 50.0;

/// Fraction of the guide's radius within which pressures are used. Further out the singular rim
/// dominates, where meshes differ by several per cent.
pub(crate) const USED_FACE: f64 = 0.75;

/// Radial displacement of tissue under a face, relative to the radius and the mean strain of the
/// block, and its standard error. For incompressible tissue it is half the strain at that depth,
/// which exceeds the mean by several tenths because the strain decreases with depth. Solutions in
/// three dimensions give 0.53 to 0.70.
const CARRIED: (f64, f64) = (0.6, 0.1);

/// Spread of the load below the face ([`Place::spread`]), and its standard error. With half of it,
/// balls of 11 mm, 4 mm off the axis, seemed 0.15 mm further out, by two standard errors.
const SPREAD: (f64, f64) = (0.13, 0.15);

/// Finds a spheroidal inclusion in a block from the pressure on a guide's face at several
/// approaches.
///
/// The maximum a posteriori estimate is found by Levenberg–Marquardt with finite-strain finite
/// elements, from several starts. The unknowns are ln D, ln d, ln E₁, the height over width of the
/// inclusion, ln E₀, the block's height, ν and the approach zero. A score test first decides
/// whether an inclusion would explain more than the homogeneous block. Intervals follow the
/// posterior along ln E₁. The probability of an inclusion follows from the evidence with and
/// without one.
///
/// ```no_run
/// use core::ops::ControlFlow;
/// use tactile_fem::{Guide, GuideLayer, Material};
/// use tactile_inclusion::{
///     AssumedInclusion, InclusionSearch, PressureProfile, SensorErrors, TissueBlock,
/// };
///
/// # fn example(radii_m: Vec<f64>, frames: Vec<PressureProfile>) -> Result<(), tactile_elasticity::ElasticityError> {
/// let layer = GuideLayer { thickness_m: 10e-3, material: Material::new(60e3, 0.495)? };
/// let guide = Guide::new(vec![layer], 16e-3)?;
/// let search = InclusionSearch::new(TissueBlock::new(30e-3, 40e-3)?, guide)?;
/// // A sensor whose calibration is twice as good as usual.
/// let search =
///     search.with_sensor_errors(SensorErrors { common: 1.5e-3, ..SensorErrors::default() })?;
/// // Are two frames enough for a small lump?
/// let lump = AssumedInclusion {
///     diameter_m: 8e-3,
///     depth_m: 4e-3,
///     youngs_modulus_pa: 40e3,
///     block_modulus_pa: 5e3,
/// };
/// let errors =
///     search.expected_errors(&lump, &[1.5e-3, 3e-3], &radii_m, &vec![1.0; radii_m.len()])?;
/// println!("its diameter would be known within {:.0} %", 100.0 * errors.diameter);
/// let estimate = search.search_with_progress(&radii_m, &frames, &mut |progress| {
///     println!("{} of {}", progress.done, progress.total);
///     ControlFlow::Continue(())
/// })?;
/// if let (true, Some(inclusion)) = (estimate.found, &estimate.inclusion) {
///     println!("{:?}", inclusion.diameter_m);
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Debug, Clone)]
pub struct InclusionSearch {
    specimen: TissueBlock,
    guide: Guide,
    sensor: SensorErrors,
    shape_error: f64,
}

/// Difference of log-evidence above which one assumption about the face is clearly better. It
/// consists of odds of 20 to 1, and three times as much for the finite-element error on a sliding
/// face, of which the covariance contains only the size. Two frames on soft tissue by CalculiX
/// favoured the wrong assumption by up to 13, with a poor fit (`inclusion_study` on the scenes of
/// `evidence/inclusion_scenes.py`). In exchange, intervals cover both assumptions if the correct
/// one leads by less. If the better fit leaves residuals above the errors, differences are reduced
/// accordingly (K. P. Burnham & D. R. Anderson, *Model Selection and Multimodel Inference* (2002),
/// §2.5).
pub(crate) const CLEAR_EVIDENCE: f64 = 12.0;

/// Default standard error of the logarithm of an inclusion's height over its width: the 95 % range
/// extends from 1 : 1.75 to 1.75 : 1.
const SHAPE_ERROR: f64 = 0.29;

impl InclusionSearch {
    /// A search in a block under a guide, with [`SensorErrors::default`].
    ///
    /// # Errors
    /// An error for a block that is no wider than the guide.
    pub fn new(specimen: TissueBlock, guide: Guide) -> Result<Self, ElasticityError> {
        if specimen.radius_m() <= guide.radius_m() {
            return Err(Quantity::Radius.beyond(specimen.radius_m(), guide.radius_m()));
        }
        Ok(Self {
            specimen,
            guide,
            sensor: SensorErrors::default(),
            shape_error: SHAPE_ERROR,
        })
    }

    /// Sets the standard error of the logarithm of an inclusion's height over its width (default
    /// 0.29). The ratio is fitted with the other parameters, and its uncertainty enters the
    /// intervals. With 0 every inclusion is a ball.
    ///
    /// # Errors
    /// An error for a negative value or NaN.
    pub fn with_shape_error(mut self, error: f64) -> Result<Self, ElasticityError> {
        self.shape_error = Quantity::StandardError.not_negative(error)?;
        Ok(self)
    }

    /// Sets the smooth errors of the sensor.
    ///
    /// # Errors
    /// An error for a negative value or NaN, or a correlation length or force error of zero.
    pub fn with_sensor_errors(mut self, errors: SensorErrors) -> Result<Self, ElasticityError> {
        self.sensor = errors.checked()?;
        Ok(self)
    }

    /// The inclusion that best fits ring means at `radii_m` (metres, ascending). Rings outside
    /// three quarters of the guide's radius are not used. It takes about 100 finite-element
    /// solutions.
    ///
    /// # Errors
    /// An error if there is no frame, approaches do not increase, lengths differ, values are not
    /// finite, or fewer than eight rings are within reach. [`ElasticityError::NoSolution`] if the
    /// approaches are too large for the finite elements of the block.
    pub fn search(
        &self,
        radii_m: &[f64],
        frames: &[PressureProfile],
    ) -> Result<InclusionEstimate, ElasticityError> {
        self.search_with_progress(radii_m, frames, &mut |_| ControlFlow::Continue(()))
    }

    /// Like [`Self::search`]. `progress` is called for each solution and may stop the search.
    ///
    /// # Errors
    /// Those of [`Self::search`], and [`ElasticityError::Cancelled`].
    pub fn search_with_progress(
        &self,
        radii_m: &[f64],
        frames: &[PressureProfile],
        progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<InclusionEstimate, ElasticityError> {
        check(radii_m, frames)?;
        let observed = self.observed(radii_m, frames)?;
        let approaches_m: Vec<f64> = frames.iter().map(|frame| frame.approach_m).collect();
        self.search_observed(&observed, &approaches_m, progress)
    }

    /// Like [`Self::search_with_progress`], from whole faces: the inclusion may lie off the axis.
    /// The scan has one or several presses at positions of a block that is much wider than the
    /// guide. There is one posterior over all of them, with one inclusion or two. The deviation of
    /// each press from its stated position is fitted, and each press has its own error of the
    /// approach zero. The position of the inclusion is given in the coordinates of the presses.
    ///
    /// Only positions under the used part of a press's face are searched. The result has two
    /// inclusions if a single one does not fit within the errors and two do. The time grows with
    /// the third power of the number of cells. A fifteenth of the face radius resolves the pressure
    /// of a single press, and an eighth is narrow enough for five presses. The force is not used.
    ///
    /// # Errors
    /// Those of [`Self::search_with_progress`], and errors if there is no press, approaches differ
    /// between presses, or the position error is negative or NaN.
    pub fn search_scan(
        &self,
        scan: &Scan,
        progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<InclusionEstimate, ElasticityError> {
        let (observed, approaches_m) = self.observed_scan(scan)?;
        self.search_observed(&observed, &approaches_m, progress)
    }

    fn search_observed(
        &self,
        observed: &Observed,
        approaches_m: &[f64],
        progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<InclusionEstimate, ElasticityError> {
        let interfaces = self.specimen.interfaces();
        // Per contact condition: a homogeneous fit, the grid, two first fits and the final fit.
        let mut counter = Counter::new(interfaces.len() * 55, progress);
        let (mut hypotheses, mut is_unsolved) =
            self.hypotheses(observed, approaches_m, &interfaces, &mut counter);
        let pair = self.pair(observed, approaches_m, &hypotheses, &mut counter);
        if let Some(pair) = pair.filter(|_| !counter.cancelled) {
            return Ok(pair);
        }
        let contradicting = (hypotheses.first().filter(|_| interfaces.len() == 1))
            .and_then(|stated| self.contradicting(observed, stated, &mut counter));
        if let Some(other) = contradicting {
            let (others, _) = self.hypotheses(observed, approaches_m, &[other], &mut counter);
            is_unsolved |= others.is_empty();
            hypotheses.extend(others);
        }
        let best = (hypotheses.iter()).map(Hypothesis::evidence);
        let needed = best.fold(f64::NEG_INFINITY, f64::max) - RIVAL_EVIDENCE;
        for hypothesis in &mut hypotheses {
            if contradicting.is_some() || hypothesis.evidence() > needed {
                hypothesis.follow(|| counter.step());
            }
        }
        if counter.cancelled {
            return Err(ElasticityError::Cancelled);
        }
        hypotheses.sort_by(|a, b| b.evidence().total_cmp(&a.evidence()));
        let mut hypotheses = hypotheses.into_iter();
        let best = hypotheses.next().ok_or(ElasticityError::NoSolution)?;
        let clear = CLEAR_EVIDENCE * best.inflation(observed);
        let rival = (hypotheses.next())
            .filter(|other| contradicting.is_some() || best.evidence() - other.evidence() < clear);
        let mut found = best.estimate(observed, rival.as_ref(), is_unsolved);
        if contradicting.is_some() {
            (found.warnings).retain(|warning| *warning != InclusionWarning::UncertainInterface);
            found.warnings.push(InclusionWarning::ContradictedInterface);
        }
        Ok(found)
    }

    /// The face that is not assumed, if its values are clearly more likely than those of the fit.
    fn contradicting(
        &self,
        observed: &Observed,
        assumed: &Hypothesis,
        counter: &mut Counter<'_>,
    ) -> Option<Interface> {
        let other = match assumed.interface {
            Interface::Bonded => Interface::Frictionless,
            Interface::Frictionless => Interface::Bonded,
        };
        let fit = assumed.better();
        let forward = Forward {
            interface: other,
            ..assumed.problem.forward.clone()
        };
        let values = counter.step().then(|| {
            let forward = forward.with_plain(&fit.parameters)?;
            forward.predict(&fit.parameters)
        });
        let log_odds = Assessed::new(&assumed.problem, &fit.normal)?.log_odds(&values??);
        (log_odds > CLEAR_EVIDENCE * assumed.inflation(observed)).then_some(other)
    }

    /// The best fits under each assumption about the face, the most likely first, and whether the
    /// fits of one failed.
    fn hypotheses(
        &self,
        observed: &Observed,
        approaches_m: &[f64],
        interfaces: &[Interface],
        counter: &mut Counter<'_>,
    ) -> (Vec<Hypothesis>, bool) {
        let blocks: Vec<HomogeneousFit> = (interfaces.iter())
            .filter_map(|face| self.homogeneous(observed, approaches_m, *face, counter))
            .collect();
        // If the better-fitting homogeneous block needs no inclusion, an inclusion in the other
        // would compensate for a wrong assumption about the face.
        let best = (blocks.iter()).max_by(|a, b| a.fit.evidence.total_cmp(&b.fit.evidence));
        let is_homogeneous = best.is_some_and(HomogeneousFit::is_homogeneous);
        let mut candidates: Vec<FirstFits> = Vec::new();
        for homogeneous in blocks {
            candidates.push(if is_homogeneous || homogeneous.is_homogeneous() {
                FirstFits::homogeneous(homogeneous)
            } else {
                self.first_fits(
                    observed,
                    approaches_m,
                    homogeneous,
                    candidates.first(),
                    counter,
                )
            });
        }
        candidates.sort_by(|a, b| b.evidence().total_cmp(&a.evidence()));
        let hopeless = candidates
            .first()
            .map_or(f64::NEG_INFINITY, FirstFits::hopeless);
        candidates.retain(|first_fits| first_fits.evidence() > hopeless);
        let mut hypotheses: Vec<Hypothesis> = Vec::new();
        let mut is_unsolved = false;
        for first_fits in candidates {
            let needed = (hypotheses.first())
                .map_or(f64::NEG_INFINITY, |best| best.evidence() - RIVAL_EVIDENCE);
            let found = self.hypothesis(observed, approaches_m, first_fits, needed, counter);
            is_unsolved |= found.is_none();
            hypotheses.extend(found);
        }
        hypotheses.sort_by(|a, b| b.evidence().total_cmp(&a.evidence()));
        (hypotheses, is_unsolved)
    }

    /// The values of all presses, with the approaches of each.
    pub(crate) fn observed_scan(
        &self,
        scan: &Scan,
    ) -> Result<(Observed, Vec<f64>), ElasticityError> {
        let (cells, frames) = scan.joined(USED_FACE * self.guide.radius_m())?;
        let radii_m: Vec<f64> = (cells.positions_m.iter())
            .map(|[x, y]| x.hypot(*y))
            .collect();
        let approaches_m: Vec<f64> = frames.iter().map(|frame| frame.approach_m).collect();
        let mut observed = self.observed(&radii_m, &frames)?;
        let [_, (_, zero_error_m), _] = self.specimen.known();
        observed.cells = Some(ObservedCells::new(
            cells,
            [scan.position_error_m, zero_error_m],
            &observed.values,
            &approaches_m,
        ));
        Ok((observed, approaches_m))
    }

    fn observed(
        &self,
        radii_m: &[f64],
        frames: &[PressureProfile],
    ) -> Result<Observed, ElasticityError> {
        let used = self.rings_within_reach(radii_m)?;
        let mut values = Vec::new();
        let mut white = Vec::new();
        for frame in frames {
            values.extend(used.iter().map(|&k| frame.pressure_pa[k]));
            white.extend(used.iter().map(|&k| frame.standard_error_pa[k]));
        }
        let area = core::f64::consts::PI * self.guide.radius_m().powi(2);
        for frame in frames {
            let mean = frame.pressure_pa.iter().sum::<f64>() / frame.pressure_pa.len() as f64;
            let expected = mean * area;
            values.push(frame.force_n.unwrap_or(expected));
            // An unknown force has no weight.
            white.push(if frame.force_n.is_some() {
                0.0
            } else {
                1e3 * expected.abs()
            });
        }
        Ok(Observed {
            radii_m: used.iter().map(|&k| radii_m[k]).collect(),
            values,
            white,
            frames: frames.len(),
            cells: None,
        })
    }

    /// Priors of the effects of each approach's own error, if there is one. Pressures are nearly
    /// proportional to the approach.
    pub(crate) fn approach_priors(&self, presses: usize, approaches_m: &[f64]) -> Vec<Prior> {
        let error_m = self.specimen.each_approach_error_m();
        let all = approaches_m
            .iter()
            .cycle()
            .take(presses * approaches_m.len());
        let priors = all.filter(|_| error_m > 0.0).enumerate();
        priors
            .map(|(k, approach)| Prior::new(Coordinate::Pressed(k), (0.0, error_m / approach)))
            .collect()
    }

    pub(crate) fn forward(
        &self,
        observed: &Observed,
        approaches_m: &[f64],
        interface: Interface,
        fineness: usize,
    ) -> Forward {
        Forward {
            guide: self.guide.clone(),
            block_radius_m: self.specimen.radius_m(),
            interface,
            approaches_m: approaches_m.to_vec(),
            radii_m: observed.radii_m.clone(),
            cells: observed.cells.as_ref().map(|cells| Cells {
                positions: Arc::clone(&cells.positions),
                plain: None,
                squeezed: (approaches_m.iter())
                    .map(|approach| approach / self.specimen.height_m())
                    .collect(),
                face_radius_m: self.guide.radius_m(),
                reach_m: USED_FACE * self.guide.radius_m(),
            }),
            fineness,
            kinematics: Kinematics::Finite,
        }
    }

    pub(crate) fn known_block(&self, block_modulus_pa: f64) -> Parameters {
        Parameters {
            block_modulus_pa,
            lump: None,
            place: Place {
                carried: CARRIED.0,
                spread: SPREAD.0,
                ..Place::default()
            },
            second: None,
            strayed_m: Vec::new(),
            pressed: Vec::new(),
            zero_m: 0.0,
            height_m: self.specimen.height_m(),
            poisson_ratio: self.specimen.poisson_ratio().min(LARGEST_POISSON_RATIO),
        }
    }

    /// Priors of the block. `guess` is used for its modulus if none is stated.
    pub(crate) fn block_priors(&self, guess: f64) -> Vec<Prior> {
        let [height, zero, (poisson_ratio, error)] = self.specimen.known();
        let poisson = (poisson_ratio.min(LARGEST_POISSON_RATIO), error);
        // Three decades on either side.
        let modulus = self.specimen.block_modulus().unwrap_or((guess.ln(), 3.5));
        vec![
            Prior::new(Coordinate::BlockModulus, modulus),
            Prior::new(Coordinate::Zero, zero),
            Prior::new(Coordinate::Height, height),
            Prior::new(Coordinate::PoissonRatio, poisson),
        ]
    }

    /// Priors of the sizes, depths and contrasts that a face of this radius can detect. The 95 %
    /// ranges are 0.2 to 2 radii for D, 0.06 to 1.5 radii for d, and 0.4 to 47 times E₀ for E₁. The
    /// shape has a prior unless it is certainly a ball.
    pub(crate) fn lump_priors(&self, block_modulus_pa: f64) -> Vec<Prior> {
        let face = self.guide.radius_m();
        let mut priors = vec![
            Prior::new(Coordinate::Diameter, ((0.65 * face).ln(), 0.6)),
            Prior::new(Coordinate::Depth, ((0.3 * face).ln(), 0.8)),
            Prior::new(
                Coordinate::LumpModulus,
                ((4.5 * block_modulus_pa).ln(), 1.2),
            ),
        ];
        if self.shape_error > 0.0 {
            priors.push(Prior::new(Coordinate::Aspect, (0.0, self.shape_error)));
        }
        priors
    }

    /// Priors of the inclusion's position, if it is observable: under the face, with axes up to
    /// 1.75 : 1 in two of three cases. Also priors of the deviations of presses from their stated
    /// positions.
    fn place_priors(&self, observed: &Observed) -> Vec<Prior> {
        let Some(cells) = &observed.cells else {
            return Vec::new();
        };
        let axes_m = &cells.positions.axes_m;
        let ([x, y], half_width) = extent(axes_m);
        let centre = 0.4 * self.guide.radius_m() + half_width;
        let mut known = vec![
            Prior::new(Coordinate::Centre(0), (x, centre)),
            Prior::new(Coordinate::Centre(1), (y, centre)),
            Prior::new(Coordinate::Elongation(0), (0.0, ELONGATION)),
            Prior::new(Coordinate::Elongation(1), (0.0, ELONGATION)),
            Prior::new(Coordinate::Carried, CARRIED),
            Prior::new(Coordinate::Spread, SPREAD),
        ];
        let error = cells.place_error_m;
        if error > 0.0 {
            let strayed = |press| [0, 1].map(|axis| Coordinate::Strayed(press, axis));
            let strayed = (0..axes_m.len()).flat_map(strayed);
            known.extend(strayed.map(|coordinate| Prior::new(coordinate, (0.0, error))));
        }
        known
    }

    pub(crate) fn sensor(&self) -> &SensorErrors {
        &self.sensor
    }

    /// The guide.
    pub fn guide(&self) -> &Guide {
        &self.guide
    }

    /// The block.
    pub fn specimen(&self) -> &TissueBlock {
        &self.specimen
    }

    /// Indices of the rings within reach.
    pub(crate) fn rings_within_reach(
        &self,
        radii_m: &[f64],
    ) -> Result<Vec<usize>, ElasticityError> {
        let limit = USED_FACE * self.guide.radius_m();
        let used: Vec<usize> = (0..radii_m.len())
            .filter(|&k| radii_m[k] <= limit)
            .collect();
        Quantity::Samples.at_least(used.len(), MIN_RINGS)?;
        Ok(used)
    }
}

/// Elements along an eighth of the inclusion's circumference for the final fit. For bonded blocks
/// the pressure is within 0.05 % of that of a mesh with ten. Five elements leave waves of 0.1 %
/// above a wide shallow inclusion, which change its size and depth by one bound. On a sliding face
/// they change χ² by up to ten, which is enough to mistake it for a bonded one. For a barely
/// detectable inclusion, the noise exceeds the error of five elements.
pub(crate) fn answer_fineness(is_certain: bool) -> usize {
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
    interface: Interface,
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

    /// Log-evidence of the first fits below which another assumption about the face is discarded.
    fn hopeless(&self) -> f64 {
        self.evidence() - HOPELESS_EVIDENCE - HOPELESS_MISFIT * self.better().normal.misfit
    }
}

impl InclusionSearch {
    /// The best first fits with an inclusion, from the best starts of the grid and from the best
    /// fit under `another` assumption.
    fn first_fits(
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
        let best = another.and_then(|another| Some((another, another.lump.as_ref()?)));
        let ending = best.map_or(FIRST_FIT_ENDING, |(another, lump)| {
            FIRST_FIT_ENDING.below(problem.objective_at(another.hopeless(), lump.volume))
        });
        let best = best.map(|(_, lump)| &lump.parameters);
        first_fits.lump = (best.into_iter().chain(&starts).take(FITTED_STARTS))
            .filter_map(|start| problem.fit(start, ending, || counter.step()))
            .max_by(|a, b| a.evidence.total_cmp(&b.evidence));
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
