//! A start for dense sets: which target a point is, is told by where its neighbours come to lie.
//!
//! Once the temperature is below the points' spacing, a part of a dense set that lies one point aside stays there: points
//! are matched one by one, and each has a neighbour's target at hand. The pattern of the neighbours, though, fits at the
//! right target only, the better the less regular the set is. For every model point i and every target j in reach the
//! neighbours are put about `tⱼ` as the warp has them about `yᵢ`, a small affine correction is fitted, and what remains to the
//! targets found there is the candidate's misfit.

use super::cells::Cells;
use super::gated::GatedNearest;
use nalgebra::{SMatrix, SVector};

/// Neighbours a point, for every dimension.
const NEIGHBOURS: usize = 4;
/// Farthest candidate, in radii of the model.
const REACH: f64 = 0.25;
/// A neighbour's target lies within this many spacings of where it is expected.
const GATE: f64 = 0.45;
/// Side of the cells in which candidates are looked up, in spacings.
const CANDIDATE_CELLS: f64 = 2.0;
/// Rounds of looking up the neighbours' targets and fitting the affine correction.
const ROUNDS: usize = 2;
/// Misfits above this share of the largest there can be are not worth a correction.
const HOPELESS: f64 = 0.75;
/// Weight of no correction at all, in squared spacings.
const RIDGE: f64 = 0.3;
/// Misfits are told apart no finer than this, in spacings.
const RESOLUTION: f64 = 2e-3;
/// Points by which the spacing is told.
const SAMPLE: usize = 101;

/// The target that the pattern of a model point fits best.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    target: usize,
    misfit: f64,
    /// Misfit at the next best target.
    second: f64,
}

/// Memory of the start.
#[derive(Clone, Debug, Default)]
pub(crate) struct LocalPatterns<const D: usize> {
    /// Where candidates and where neighbours' targets are looked up.
    targets: Cells<D>,
    gated: GatedNearest<D>,
    model: Cells<D>,
    offsets: Vec<[f64; D]>,
    distances: Vec<(f64, usize)>,
    candidates: Vec<usize>,
    best: Vec<Candidate>,
    /// The likeliest target of every model point, with the probability that it is right.
    pub(crate) pairs: Vec<(usize, f64)>,
    pub(crate) spacing: f64,
}

impl<const D: usize> LocalPatterns<D> {
    /// Finds `pairs` for model points that a first warp has put at `warped`; false where the sets have no spacing to speak of.
    pub(crate) fn propose(&mut self, warped: &[[f64; D]], target: &[[f64; D]]) -> bool {
        let all = 0..warped.len();
        self.propose_for(all, warped, target, REACH)
    }

    /// As [`propose`](Self::propose) for some model rows, with candidates up to `reach` away; `pairs` are in the order of the rows.
    pub(crate) fn propose_for(
        &mut self,
        rows: impl Iterator<Item = usize>,
        warped: &[[f64; D]],
        target: &[[f64; D]],
        reach: f64,
    ) -> bool {
        self.spacing = self.typical_spacing(target);
        if !(self.spacing > 0.0 && self.spacing < reach) {
            return false;
        }
        self.targets.build(target, CANDIDATE_CELLS * self.spacing);
        self.gated.build(target, GATE * self.spacing);
        self.model.build(warped, 2.0 * self.spacing);
        self.best.clear();
        for i in rows {
            self.look_around(warped, i);
            let best = self.best_candidate(warped, target, i, reach);
            self.best.push(best);
        }
        self.weigh();
        true
    }

    /// Median distance from a target to the next, over a sample.
    pub(crate) fn typical_spacing(&mut self, target: &[[f64; D]]) -> f64 {
        let step = target.len().div_ceil(SAMPLE);
        self.distances.clear();
        for i in (0..target.len()).step_by(step) {
            let others = target.iter().enumerate().filter(|&(j, _)| j != i);
            let nearest = others
                .map(|(_, t)| squared(&difference(t, &target[i])))
                .fold(f64::INFINITY, f64::min);
            self.distances.push((nearest, i));
        }
        let middle = self.distances.len() / 2;
        self.distances
            .select_nth_unstable_by(middle, |a, b| a.0.total_cmp(&b.0))
            .1
            .0
            .sqrt()
    }

    /// The nearest neighbours of model point `i`, as offsets from it.
    fn look_around(&mut self, warped: &[[f64; D]], i: usize) {
        let near = &mut self.distances;
        let wanted = NEIGHBOURS * D;
        let mut radius = 2.0 * self.spacing;
        // Twice as far until there are enough; a point far from all others makes do with fewer.
        for _ in 0..4 {
            near.clear();
            self.model
                .within(&warped[i], radius, |a, square| near.push((square, a)));
            near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            near.dedup();
            if near.len() > wanted {
                break;
            }
            radius *= 2.0;
        }
        near.retain(|&(_, a)| a != i);
        near.truncate(wanted);
        self.offsets.clear();
        self.offsets.extend(
            near.iter()
                .map(|&(_, a)| difference(&warped[a], &warped[i])),
        );
    }

    /// The candidate of least misfit for model point `i`.
    fn best_candidate(
        &mut self,
        warped: &[[f64; D]],
        target: &[[f64; D]],
        i: usize,
        reach: f64,
    ) -> Candidate {
        let candidates = &mut self.candidates;
        candidates.clear();
        self.targets
            .within(&warped[i], reach, |j, _| candidates.push(j));
        candidates.sort_unstable();
        candidates.dedup();
        let mut best = Candidate {
            target: 0,
            misfit: f64::INFINITY,
            second: f64::INFINITY,
        };
        for &j in &self.candidates {
            let misfit = self.misfit(target, j);
            if misfit < best.misfit {
                best = Candidate {
                    target: j,
                    misfit,
                    second: best.misfit,
                };
            } else if misfit < best.second {
                best.second = misfit;
            }
        }
        best
    }

    /// Sum of squared distances between where the neighbours are expected about target `j`, a little bent, and the targets there.
    fn misfit(&self, target: &[[f64; D]], j: usize) -> f64 {
        let hopeless = HOPELESS * (GATE * self.spacing).powi(2) * self.offsets.len() as f64;
        let (mut misfit, mut bend) = self.bent(&target[j], target, &SMatrix::zeros());
        for _ in 0..ROUNDS {
            if misfit > hopeless {
                break;
            }
            (misfit, bend) = self.bent(&target[j], target, &bend);
        }
        misfit
    }

    /// The misfit about `centre` when the neighbours' offsets are bent by `bend`, and the bend that the targets found ask for.
    fn bent(
        &self,
        centre: &[f64; D],
        target: &[[f64; D]],
        bend: &SMatrix<f64, D, D>,
    ) -> (f64, SMatrix<f64, D, D>) {
        let gate = GATE * self.spacing;
        let mut misfit = 0.0;
        let mut outer = SMatrix::<f64, D, D>::zeros();
        let mut gram = SMatrix::<f64, D, D>::identity() * (RIDGE * self.spacing * self.spacing);
        for offset in &self.offsets {
            let offset = SVector::from(*offset);
            let place = SVector::from(*centre) + offset + bend * offset;
            let Some(found) = self.gated.find(&place.into()) else {
                misfit += gate * gate;
                continue;
            };
            let rest = SVector::from(target[found]) - place;
            misfit += rest.norm_squared();
            outer += (rest + bend * offset) * offset.transpose();
            gram += offset * offset.transpose();
        }
        (
            misfit,
            outer * gram.try_inverse().unwrap_or_else(SMatrix::zeros),
        )
    }

    /// Probabilities from misfits, with the noise at which the typical best candidate fits as it does.
    fn weigh(&mut self) {
        let values = (NEIGHBOURS * D * D) as f64;
        self.distances.clear();
        self.distances
            .extend(self.best.iter().map(|best| (best.misfit, 0)));
        let place = self.distances.len() / 4;
        let typical = self
            .distances
            .select_nth_unstable_by(place, |a, b| a.0.total_cmp(&b.0))
            .1
            .0;
        let variance = (typical / values).max((RESOLUTION * self.spacing).powi(2));
        self.pairs.clear();
        let pair = |best: &Candidate| {
            let trust = if best.misfit.is_finite() {
                1.0 / (1.0 + (-0.5 * (best.second - best.misfit) / variance).exp())
            } else {
                0.0
            };
            // A misfit three times the typical is no longer one.
            let fits = (-0.5 * best.misfit / (9.0 * variance * values)).exp();
            (best.target, trust * fits)
        };
        self.pairs.extend(self.best.iter().map(pair));
    }
}

fn difference<const D: usize>(a: &[f64; D], b: &[f64; D]) -> [f64; D] {
    std::array::from_fn(|k| a[k] - b[k])
}

fn squared<const D: usize>(v: &[f64; D]) -> f64 {
    v.iter().map(|x| x * x).sum()
}
