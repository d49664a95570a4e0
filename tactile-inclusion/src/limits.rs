//! The smallest inclusion that can be found at each position.

use crate::estimate::InclusionEstimate;
use crate::first_fits::HomogeneousFit;
use crate::forward::{Forward, Solved};
use crate::hypothesis::Assessed;
use crate::inclusion_search::{InclusionSearch, USED_FACE};
use crate::parameters::{LumpParameters, Parameters};
use crate::progress::Counter;
use crate::scan::Scan;
use crate::starts::DEEPEST;
use core::cmp::Ordering;
use core::ops::ControlFlow;
use tactile_core::Progress;
use tactile_elasticity::{ElasticityError, Quantity};

/// Diameters that are solved, relative to the face radius. Smaller ones are treated as the first.
const DIAMETERS: [f64; 6] = [0.09, 0.15, 0.25, 0.4, 0.65, 1.05];

/// Expected fall of χ² for an inclusion that 95 of 100 searches find. Half of the searches found
/// balls that lower it by 58, 58 and 78, at three positions with 16 draws of the noise for each of
/// five diameters. At 110, 19, 19 and 16 of 20 searches found them; the last ball was small and
/// shallow, and 20 of 20 found it at 150. A smaller limit promises too much there; a larger one
/// declares larger balls undetectable.
const FOUND_GAIN: f64 = 150.0;

impl InclusionSearch {
    /// Minimum diameters of a ball that a scan detects, in metres: for each depth of its top, one
    /// value per position (x, y) of its centre. Infinite if no ball up to the radius of the face is
    /// detected, or if the position is not searched.
    ///
    /// A ball `contrast` times as stiff as the block adds s to the pressures of a plain block. Let
    /// C be the covariance of the errors, and J and P the derivatives and the prior covariance of
    /// the block's parameters. The ball lowers χ² by
    ///
    /// $$ s^T Q s, \qquad Q = C^{-1} - C^{-1} J (J^T C^{-1} J + P^{-1})^{-1} J^T C^{-1} $$
    ///
    /// The minimum diameter is that at which this is 150, where at least 95 of 100 searches find
    /// it. The block is assumed plain except for this ball: next to another inclusion, sensitivity
    /// is lower. Errors and the block's modulus are those of the scan's frames. The face is assumed
    /// bonded unless the specimen specifies its interface. s is computed in small strain, with an
    /// accuracy of about ten per cent, which is about three per cent of the diameter.
    ///
    /// ```no_run
    /// use core::ops::ControlFlow;
    /// use tactile_inclusion::{InclusionSearch, Scan};
    ///
    /// # use tactile_elasticity::{ElasticityError, Quantity};
    /// # fn example(search: InclusionSearch, scan: Scan) -> Result<(), ElasticityError> {
    /// let (places, depths) = ([[0.0, 0.0], [8e-3, 0.0]], [2e-3, 6e-3]);
    /// let limits = search.detection_limits(&scan, 4.0, &places, &depths, &mut |_| {
    ///     ControlFlow::Continue(())
    /// })?;
    /// println!("6 mm deep, balls of up to {:.1} mm can hide", 1e3 * limits[1][0]);
    /// let beside = [[16e-3, 0.0], [0.0, 16e-3]];
    /// let estimate = search.search_scan(&scan, &mut |_| ControlFlow::Continue(()))?;
    /// let next = search.next_position(&scan, &estimate, &places, &limits, &beside);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// Those of [`Self::search_scan`], and errors for a contrast or depth that is not positive and
    /// for a position that is not finite.
    pub fn detection_limits(
        &self,
        scan: &Scan,
        contrast: f64,
        places_m: &[[f64; 2]],
        depths_m: &[f64],
        progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Vec<Vec<f64>>, ElasticityError> {
        Quantity::YoungsModulus.positive(contrast)?;
        for depth in depths_m {
            Quantity::Distance.positive(*depth)?;
        }
        for coordinate in places_m.iter().flatten() {
            Quantity::Distance.finite(*coordinate)?;
        }
        let (observed, approaches_m) = self.observed_scan(scan)?;
        let solutions = 20 + 2 * depths_m.len() * DIAMETERS.len();
        let mut counter = Counter::new(solutions, progress);
        let interface = self.specimen().interfaces()[0];
        let block = self.homogeneous(&observed, &approaches_m, interface, &mut counter);
        if counter.cancelled {
            return Err(ElasticityError::Cancelled);
        }
        let block = block.ok_or(ElasticityError::NoSolution)?;
        let problem = self.on_answers_mesh(&block.problem, &observed);
        let problem = problem.ok_or(ElasticityError::NoSolution)?;
        let fit = &block.fit;
        let normal = problem.normal(&fit.parameters, Some(&fit.normal.solved));
        let normal = normal.ok_or(ElasticityError::NoSolution)?;
        let plain = Assessed::new(&problem, &normal).ok_or(ElasticityError::NoSolution)?;
        let reach_m = USED_FACE * self.guide().radius_m();
        let mut limits = Vec::new();
        for &depth_m in depths_m {
            let mut balls = Vec::new();
            for diameter in DIAMETERS {
                let diameter_m = diameter * self.guide().radius_m();
                let modulus_pa = contrast * block.known.block_modulus_pa;
                let lump = LumpParameters::ball(diameter_m, depth_m, modulus_pa);
                if lump.diameter_m + depth_m < DEEPEST * self.specimen().height_m() {
                    balls.extend(Ball::new(&block, lump, &mut counter));
                }
                if counter.cancelled {
                    return Err(ElasticityError::Cancelled);
                }
            }
            let limit = |place: &[f64; 2]| {
                if scan.nearest_press_m(*place) > reach_m {
                    return f64::INFINITY;
                }
                let gain = |ball: &Ball| {
                    let added = ball.added(&block.linear, *place);
                    plain.gain(&plain.added(added.into_iter()))
                };
                least_found(balls.iter().map(|ball| (ball.diameter_m(), gain(ball))))
            };
            limits.push(places_m.iter().map(limit).collect());
        }
        Ok(limits)
    }

    /// The position of `candidates_m` for the next press of a scan.
    ///
    /// If the size of an inclusion of `estimate` is open, and a sixth of it lies outside the used
    /// part of the face in every press, this is the candidate nearest to it. Otherwise it is where
    /// the mean volume of the balls that could be hidden under the used part of the face is largest.
    /// `limits_m` are [`Self::detection_limits`] at `places_m`. In unsearched regions a ball as
    /// wide as the face's radius could be hidden. Among equally good candidates, the one nearest to
    /// the presses of the scan is chosen. `None` if no candidate has any of these positions under
    /// its face.
    pub fn next_position(
        &self,
        scan: &Scan,
        estimate: &InclusionEstimate,
        places_m: &[[f64; 2]],
        limits_m: &[Vec<f64>],
        candidates_m: &[[f64; 2]],
    ) -> Option<[f64; 2]> {
        let face_m = self.guide().radius_m();
        let reach_m = USED_FACE * face_m;
        let away = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
        let cut = estimate.inclusions().into_iter().filter_map(|inclusion| {
            let place = inclusion.position_m?.map(|told| told.value);
            let diameter = inclusion.diameter_m;
            let is_cut = scan.nearest_press_m(place) + diameter.estimate().value / 3.0 > reach_m;
            (is_cut && diameter.value().is_none()).then_some(place)
        });
        let mut above = cut.filter_map(|place| {
            let nearer = candidates_m.iter().copied();
            nearer
                .filter(|candidate| away(*candidate, place) < scan.nearest_press_m(place))
                .min_by(|a, b| away(*a, place).total_cmp(&away(*b, place)))
        });
        let volume = |limit: &f64| (limit / face_m).min(1.0).powi(3);
        let hidden = |place: usize| {
            let limits = limits_m.iter().filter_map(|limits| limits.get(place));
            limits.map(volume).sum()
        };
        let hidden: Vec<f64> = (0..places_m.len()).map(hidden).collect();
        let found = candidates_m.iter().filter_map(|&candidate| {
            let under = places_m.iter().zip(&hidden);
            let under = under.filter(|(place, _)| away(**place, candidate) <= reach_m);
            let (sum, count) = under.fold((0.0, 0), |(sum, n), (_, hidden)| (sum + hidden, n + 1));
            // Equal fractions of positions differ by rounding.
            let searched = (-1e9 * sum / f64::from(count)).round();
            (count > 0).then_some(([searched, scan.nearest_press_m(candidate)], candidate))
        });
        let best = found.min_by(|a, b| a.0.partial_cmp(&b.0).unwrap_or(Ordering::Equal));
        above.next().or(best.map(|(_, candidate)| candidate))
    }
}

/// A ball on the axis, and the same mesh with the modulus of the block in its place.
struct Ball {
    parameters: Parameters,
    with: Solved,
    without: Solved,
}

impl Ball {
    /// `None` if it could not be solved.
    fn new(
        block: &HomogeneousFit,
        lump: LumpParameters,
        counter: &mut Counter<'_>,
    ) -> Option<Self> {
        let mut solved = |youngs_modulus_pa: f64| {
            let lump = LumpParameters {
                youngs_modulus_pa,
                ..lump
            };
            let parameters = Parameters {
                lump: Some(lump),
                ..block.known.clone()
            };
            counter.step().then_some(())?;
            let (_, solved) = block.linear.predict_near(&parameters, None)?;
            Some((parameters, solved))
        };
        let (_, without) = solved(block.known.block_modulus_pa)?;
        let (parameters, with) = solved(lump.youngs_modulus_pa)?;
        Some(Self {
            parameters,
            with,
            without,
        })
    }

    fn diameter_m(&self) -> f64 {
        self.parameters.lump.map_or(0.0, |lump| lump.diameter_m)
    }

    /// Relative excess of each value over that of a plain block, with the centre of the ball at a
    /// given position.
    fn added(&self, linear: &Forward, centre_m: [f64; 2]) -> Vec<f64> {
        let mut parameters = self.parameters.clone();
        parameters.place.centre_m = centre_m;
        let [with, without] =
            [&self.with, &self.without].map(|solved| linear.of_solved(&parameters, solved));
        let pairs = with.iter().zip(&without);
        pairs.map(|(with, without)| with / without - 1.0).collect()
    }
}

/// The diameter at which the fall of χ² is sufficient, from falls at increasing diameters. They are
/// nearly a power of the diameter, and are computed up to the first that is sufficient.
fn least_found(gains: impl Iterator<Item = (f64, f64)>) -> f64 {
    let mut before = None;
    for (diameter, gain) in gains {
        if gain < FOUND_GAIN {
            before = Some((diameter, gain));
            continue;
        }
        return match before {
            Some((smaller, less)) if less > 0.0 => {
                let part = (FOUND_GAIN / less).ln() / (gain / less).ln();
                smaller * (diameter / smaller).powf(part)
            }
            _ => diameter,
        };
    }
    f64::INFINITY
}
