//! Two inclusions, if one does not explain the pressure.
//!
//! The pressure is the product of that of a plain block and the ratios of both inclusions,
//!
//! $$ p = p_\mathrm{plain} \prod_k \frac{p_k}{p_\mathrm{plain}} $$
//!
//! where each p_k is computed with its lump on the axis and then moved to its position. The
//! parameters of both are fitted together.

use crate::covariance::{Observed, Resolution};
use crate::estimate::InclusionEstimate;
use crate::fit::{FIRST_FIT_ENDING, Fit, PAIR_ENDING, Prior, Problem};
use crate::forward::Forward;
use crate::hypothesis::{CLEAR_EVIDENCE, Hypothesis, is_poor};
use crate::inclusion_search::InclusionSearch;
use crate::parameters::{Coordinate, LumpParameters, Parameters};
use crate::picture::extent;
use crate::progress::Counter;
use crate::starts::{DEPTHS, DIAMETERS};
use nalgebra::DVector;
use tactile_fem::Kinematics;

/// Minimum difference of log-evidence between two inclusions and one: far above the effect of
/// ellipsoids and of the model error.
const LEAST_GAIN: f64 = 100.0;

/// Modulus of a trial inclusion relative to its surroundings. The logarithms of the pressures are
/// scaled from it.
const CONTRAST: f64 = 8.0;

/// Range of the factor by which the logarithmic effect of an inclusion may be scaled, over all
/// contrasts.
const POSSIBLE: core::ops::Range<f64> = 0.15..2.5;

/// Fineness of the meshes for the map of positions, in small strain.
const FINENESS: usize = 2;

/// Relative error of the product of ratios for two touching shallow inclusions that each double the
/// pressure. It decreases with their distance, and increases with the root of the product of their
/// contributions and with their depth over their distance ([`side_by_side`]).
const NEIGHBOURS: f64 = 0.03;

/// Displacement of an inclusion by tissue that flows away from the axis, next to another inclusion.
const CARRIED: Coordinate = Coordinate::Carried;

/// Standard error of the displacement: two inclusions hold back the tissue between them and move
/// half as far, in solutions in three dimensions.
const CARRIED_ERROR: f64 = 0.4;

/// Error of each position in x and in y, relative to the distance of the two. Compared with
/// solutions in three dimensions, each is estimated too close to the other, by 0.9 % of the
/// distance on average and 2 % at most.
const PLACE_ERROR: f64 = 0.015;

/// Largest distance of those solutions, in diameters. Beyond it the error falls with the third power
/// of the distance, as does the strain beside an inclusion.
const CLOSE: f64 = 1.5;

/// Fits of two inclusions under one assumption about the face.
struct Pair {
    lumps: [Hypothesis; 2],
}

impl Pair {
    fn evidence(&self) -> f64 {
        self.lumps[1].evidence()
    }

    /// Orders the pair so that the inclusion nearer to a position comes first.
    fn nearer_first(mut self, [x, y]: [f64; 2]) -> Self {
        let places = self.fits().map(|fit| fit.parameters.place.centre_m);
        let away: Vec<f64> = places.map(|at| (at[0] - x).hypot(at[1] - y)).collect();
        if !away.is_sorted() {
            self.lumps.reverse();
        }
        self
    }

    fn fits(&self) -> impl Iterator<Item = &Fit> {
        self.lumps.iter().filter_map(|one| one.lump.as_ref())
    }

    /// Whether the fits converged and explain the pressure, and the inclusions do not overlap.
    fn is_possible(&self, observed: &Observed) -> bool {
        self.fits().all(|fit| {
            fit.converged && !is_poor(fit.normal.misfit, observed) && apart(&fit.parameters) > 1.0
        })
    }
}

/// Distance of two inclusions relative to the distance at which they touch.
fn apart(both: &Parameters) -> f64 {
    let of = |one: &Parameters| {
        let width = one.lump.map_or(0.0, |lump| lump.axes_m()[0]);
        (width, one.place.centre_m)
    };
    let ((width, at), (other_width, other_at)) = (of(both), of(&both.swapped()));
    (at[0] - other_at[0]).hypot(at[1] - other_at[1]) / (0.5 * (width + other_width))
}

/// Factor by which the error of the product of ratios exceeds that of shallow inclusions, because
/// the contributions of deep ones overlap. Without it, two inclusions with their centres as deep as
/// their distance were estimated too far apart by three standard errors.
fn side_by_side(both: &Parameters) -> f64 {
    let middle = |one: &Parameters| {
        let lump = one.lump.map(|lump| lump.depth_m + 0.5 * lump.axes_m()[1]);
        (lump.unwrap_or(0.0), one.place.centre_m)
    };
    let ((depth, at), (other_depth, other)) = (middle(both), middle(&both.swapped()));
    let distance = (at[0] - other[0]).hypot(at[1] - other[1]);
    1.0 + 3.0 * (0.5 * (depth + other_depth) / distance).powi(4)
}

impl InclusionSearch {
    /// Fits two inclusions. Returns them if the best fit of one is poor and that of two is good.
    /// `ones` are the fits of one inclusion under each assumption about the face, the best first.
    pub(crate) fn pair(
        &self,
        observed: &Observed,
        approaches_m: &[f64],
        ones: &[Hypothesis],
        counter: &mut Counter<'_>,
    ) -> Option<InclusionEstimate> {
        let one = ones.first()?.better();
        if observed.cells.is_none() || !is_poor(one.normal.misfit, observed) {
            return None;
        }
        // If the block may be plain, no inclusion was fitted.
        let is_fitted =
            |one: &&Hypothesis| !(one.problem.priors.iter()).all(|p| p.coordinate.is_of_block());
        let fitted: Vec<&Hypothesis> = ones.iter().filter(is_fitted).collect();
        let mut pairs: Vec<Pair> = (fitted.iter())
            .filter_map(|one| self.fit_pair(observed, approaches_m, one, counter))
            .collect();
        let is_unsolved = pairs.len() < fitted.len();
        pairs.sort_by(|a, b| b.evidence().total_cmp(&a.evidence()));
        let best = pairs.first()?.evidence();
        pairs.retain(|pair| pair.evidence() > best - CLEAR_EVIDENCE);
        if best < ones[0].evidence() + LEAST_GAIN
            || !pairs.iter().all(|pair| pair.is_possible(observed))
        {
            return None;
        }
        for lump in pairs.iter_mut().flat_map(|pair| &mut pair.lumps) {
            lump.follow(|| counter.step());
        }
        let mut pairs = pairs.into_iter();
        let best = pairs.next()?;
        let both = &best.fits().next()?.parameters;
        let (at, other) = (both.place.centre_m, both.second?.1.centre_m);
        let distance_m = (at[0] - other[0]).hypot(at[1] - other[1]);
        let fade = (CLOSE / apart(both)).min(1.0).powi(3);
        let rivals = pairs.next().map(|pair| pair.nearer_first(at).lumps);
        let rival = |k: usize| rivals.as_ref().map(|rivals| &rivals[k]);
        let [first, second] = best.lumps;
        let mut answer = first.estimate(observed, rival(0), is_unsolved);
        let second = second.estimate(observed, rival(1), is_unsolved);
        answer.second = Some(second.inclusion?);
        answer.inclusion?;
        let error_m = PLACE_ERROR * distance_m * fade;
        let both = answer.inclusion.iter_mut().chain(&mut answer.second);
        for at in both.filter_map(|one| one.position_m.as_mut()).flatten() {
            *at = at.widened(error_m);
        }
        Some(answer)
    }

    fn fit_pair(
        &self,
        observed: &Observed,
        approaches_m: &[f64],
        one: &Hypothesis,
        counter: &mut Counter<'_>,
    ) -> Option<Pair> {
        let mut at = self.pair_start(observed, one)?;
        let mut priors = one.problem.priors.clone();
        let of_second = one.problem.priors.iter().filter_map(|prior| {
            let coordinate = prior.coordinate.of_second()?;
            Some(Prior {
                coordinate,
                ..*prior
            })
        });
        priors.extend(of_second);
        for prior in &mut priors {
            if prior.coordinate == CARRIED || prior.coordinate == Coordinate::OfSecond(&CARRIED) {
                prior.standard_error = CARRIED_ERROR;
            }
        }
        // Elements along an eighth of an inclusion's circumference.
        for (fineness, resolution, ending) in [
            (3, Resolution::FirstFits, FIRST_FIT_ENDING),
            (5, Resolution::Answer, PAIR_ENDING),
        ] {
            let forward = self.forward(observed, approaches_m, one.interface, fineness);
            let forward = forward.with_plain(&at)?;
            let mut observed = observed.clone();
            let mut lifts: f64 = 1.0;
            for lump in [&at, &at.swapped()] {
                let (_, solved) = forward.predict_near(lump, None)?;
                let cells = forward.cells.as_ref();
                observed = observed.with_lump_aside(lump, cells, &solved);
                lifts *= cells.map_or(0.0, |cells| cells.lift(&solved.frames).min(1.0));
            }
            let alone = NEIGHBOURS * lifts.sqrt() / apart(&at).max(1.0);
            observed = observed.with_neighbours(alone * side_by_side(&at));
            let covariance = observed.covariance(self.sensor(), one.interface, resolution);
            let problem = Problem {
                forward,
                measured: observed.values.clone(),
                factor: covariance.cholesky()?,
                priors: priors.clone(),
            };
            let mut settled = |start: &Parameters| -> Option<Fit> {
                let mut fit = problem.fit(start, ending, || counter.step())?;
                // A mesh that was moved far delays the fit, which then continues on a new mesh.
                for _ in 0..2 {
                    if !fit.converged {
                        fit = problem.fit(&fit.parameters, ending, || counter.step())?;
                    }
                }
                Some(fit)
            };
            let fit = settled(&at)?;
            at = fit.parameters.clone();
            if resolution == Resolution::Answer {
                // Repeats this with the second inclusion in first position, to follow its
                // posterior.
                let swapped = settled(&at.swapped())?;
                let both = [(problem.clone(), fit), (problem, swapped)];
                let lumps = both.map(|(problem, fit)| Hypothesis {
                    problem,
                    interface: one.interface,
                    homogeneous: one.homogeneous.clone(),
                    score: None,
                    lump: Some(fit),
                    marginal: None,
                });
                return Some(Pair { lumps });
            }
        }
        None
    }

    /// Start with two equal inclusions, whose product of ratios is closest to the pressure of the
    /// last frame over that of the plain block.
    ///
    /// Logarithms of ratios add up. Those of small strain on the axis are moved to each position of
    /// a grid; for each pair of positions the best multiples are fitted.
    fn pair_start(&self, observed: &Observed, one: &Hypothesis) -> Option<Parameters> {
        let forward = Forward {
            kinematics: Kinematics::Linear,
            fineness: FINENESS,
            ..one.problem.forward.clone()
        };
        // A fit of one inclusion distorts the parameters of the block away from their priors.
        let mut block = self.known_block(one.homogeneous.parameters.block_modulus_pa);
        block.strayed_m =
            vec![[0.0; 2]; one.problem.forward.cells.as_ref()?.positions.axes_m.len()];
        let forward = forward.with_plain(&block)?;
        let cells = forward.cells.as_ref()?;
        let (count, frame) = (cells.positions.positions_m.len(), observed.frames - 1);
        let face_m = forward.guide.radius_m();
        let plain = Parameters {
            lump: None,
            ..block.clone()
        };
        let plain = forward.predict(&plain)?[frame * count..][..count].to_vec();
        let relative = |values: &[f64]| {
            let logarithms = values.iter().zip(&plain).map(|(p, plain)| (p / plain).ln());
            let logarithms = DVector::from_iterator(count, logarithms);
            let mean = logarithms.mean();
            (logarithms.add_scalar(-mean), mean)
        };
        let (measured, level) = relative(&observed.values[frame * count..][..count]);
        let (middle, half_width) = extent(&cells.positions.axes_m);
        let step = face_m / 6.0;
        let reach = ((half_width + cells.reach_m) / step).floor() as i32;
        let grid = (-reach..=reach).flat_map(|i| (-reach..=reach).map(move |k| [i, k]));
        let places: Vec<[f64; 2]> = grid
            .map(|at| [0, 1].map(|k| middle[k] + step * f64::from(at[k])))
            .filter(|at| {
                let away = |axis: &[f64; 2]| (at[0] - axis[0]).hypot(at[1] - axis[1]);
                let mut axes_m = cells.positions.axes_m.iter();
                axes_m.any(|axis| away(axis) <= cells.reach_m)
            })
            .collect();
        let mut best: Option<(f64, Parameters)> = None;
        for (diameter, depth) in DIAMETERS
            .into_iter()
            .flat_map(|d| DEPTHS.map(|depth| (d, depth)))
        {
            let at = |place: [f64; 2], contrast: f64| {
                let mut parameters = block.clone();
                parameters.lump = Some(LumpParameters::ball(
                    diameter * face_m,
                    depth * face_m,
                    contrast * block.block_modulus_pa,
                ));
                parameters.place.centre_m = place;
                parameters.place.elongation = [0.0; 2];
                parameters
            };
            let Some((_, solved)) = forward.predict_near(&at(middle, CONTRAST), None) else {
                continue;
            };
            let axial = |radius: f64| solved.pressure_at(frame, radius);
            let (columns, means): (Vec<DVector<f64>>, Vec<f64>) = (places.iter())
                .map(|place| {
                    relative(&cells.pressures(frame, &at(*place, CONTRAST), &axial, &axial))
                })
                .unzip();
            let along: Vec<f64> = columns.iter().map(|column| column.dot(&measured)).collect();
            let squares: Vec<f64> = columns.iter().map(|column| column.norm_squared()).collect();
            for i in 0..places.len() {
                for k in 0..i {
                    let [a, b] = [places[i], places[k]];
                    if (a[0] - b[0]).hypot(a[1] - b[1]) < diameter * face_m {
                        continue;
                    }
                    let shared = columns[i].dot(&columns[k]);
                    let determinant = squares[i] * squares[k] - shared * shared;
                    let multiples = [
                        (squares[k] * along[i] - shared * along[k]) / determinant,
                        (squares[i] * along[k] - shared * along[i]) / determinant,
                    ];
                    let explained = multiples[0] * along[i] + multiples[1] * along[k];
                    if multiples.iter().all(|multiple| POSSIBLE.contains(multiple))
                        && best.as_ref().is_none_or(|(most, _)| explained > *most)
                    {
                        let [first, second] = multiples;
                        // Pressures are proportional to the moduli.
                        let scale = level - first * means[i] - second * means[k];
                        let start = |place, multiple: f64| {
                            let mut start = at(place, CONTRAST.powf(multiple) * scale.exp());
                            start.block_modulus_pa *= scale.exp();
                            start
                        };
                        let (mut both, other) = (start(a, first), start(b, second));
                        both.second = other.lump.map(|lump| (lump, other.place));
                        best = Some((explained, both));
                    }
                }
            }
        }
        best.map(|(_, both)| both)
    }
}
