//! Surfaces that slide far on each other without friction, at one approach.
//!
//! [`ElementModel::slide`](crate::model::ElementModel::slide) lets nodes of one place share their
//! axial displacement. As the bodies spread by different amounts, such nodes part sideways by some
//! tenths of a millimetre, which moves the pressure by up to 1.1 % at a tenth of the block's
//! height. The upper body's mesh is therefore moved along its surface until nodes that share a
//! displacement meet in the deformed state.
//!
//! The pressure acts along the axis: its radial share p dz/dr on the slightly bent face is left
//! out. CalculiX with faces tied in the same way agrees (`evidence/inclusion_scenes.py`, the test
//! `inclusion::against_calculix`). With contact pairs, whose pressure is normal to the bent face,
//! CalculiX's forces and pressures are lower by 0.3 % at a thirtieth of the block's height and by
//! about 2 % at a tenth, which the search does not allow for.

use crate::model::ElementModel;
use crate::scene::{AppliedLoad, FemScene};
use crate::state::State;
use crate::system::Layout;

/// Distance of the rim's nodes over the face's radius at which they meet ([`MET`] elsewhere).
const RIM_MET: f64 = 5e-5;

/// Part of the face's radius beyond which nodes count as the rim's, and their distance there: at
/// a tenth of the block's height rounds leave a half of it instead of a tenth, and the pressure
/// within three quarters of the face changes by a hundredth of it.
const RIM_LIMIT: f64 = 0.9;

/// Distance of nodes over the face's radius at which they meet: pressures change by as large a
/// part.
const MET: f64 = 2e-6;

/// Part of the distance that a round may leave. Beyond a tenth of the block's height the rim's
/// nodes of a coarse mesh pass each other to and fro: moves are halved then. Left there, the
/// pressure would depend on where the rounds began, by 0.3 % at three quarters of the radius.
const STALLED: f64 = 0.8;

/// Part of a distance below which a halved move is given up.
const LEAST_MOVE: f64 = 0.1;

/// Rounds of meshing and solving; each leaves about a tenth of the distance before.
const MAX_ROUNDS: usize = 12;

/// Least part of a distance that is moved.
const LEAST_PART: f64 = 0.2;

/// Largest change of a shift over the distance of two nodes. Inside the face it is below 0.1.
const LARGEST_GROWTH: f64 = 0.9;

/// A node of the upper surface and the one of the lower that shares its axial displacement.
struct Pair {
    upper: usize,
    lower: usize,
}

impl FemScene {
    /// Scene and state at an approach with surfaces that slide. Those of a bonded interface
    /// unchanged.
    ///
    /// `depth_m` is how far below the surface the mesh may move. `near` a solution nearby, on a
    /// mesh with the same elements, `layout` one of such a mesh. `None` where there is no solution.
    pub(crate) fn slid(
        &self,
        layout: &mut Layout,
        approach_m: f64,
        depth_m: f64,
        near: Option<(&Self, &State)>,
    ) -> Option<(Self, State)> {
        let load = [AppliedLoad::Approach(approach_m)];
        let near = near.filter(|(scene, _)| scene.model.elements == self.model.elements);
        let mut scene = match near {
            Some((near, state)) => {
                // How far surfaces slide is nearly proportional to the approach.
                let growth = approach_m / state.approach_m();
                self.with_pairs_of(&near.model, growth, depth_m)
                    .or_else(|| self.with_pairs_of(&near.model, 1.0, depth_m))?
            }
            None => self.clone(),
        };
        let guess = near.map_or(&[][..], |(_, state)| core::slice::from_ref(state));
        let mut solve = |model: &ElementModel, guess: &[State]| {
            model.solve_near(layout, &load, guess).states.pop()
        };
        let mut state = solve(&scene.model, guess)?;
        let mut relaxation = Relaxation::default();
        let mut before = f64::INFINITY;
        let mut part_moved = 1.0;
        for _ in 0..MAX_ROUNDS {
            let pairs = scene.model.pairs();
            let radius =
                |node: usize| scene.model.nodes[node][0] + state.fields.displacement[2 * node];
            let apart = |pair: &Pair| radius(pair.upper) - radius(pair.lower);
            let face = pairs
                .iter()
                .map(|pair| radius(pair.lower))
                .fold(0.0, f64::max);
            let left = |pair: &Pair| {
                let is_rim = radius(pair.lower) > RIM_LIMIT * face;
                apart(pair).abs() / (if is_rim { RIM_MET } else { MET } * face)
            };
            let left = pairs.iter().map(left).fold(0.0, f64::max);
            if left > STALLED * before {
                part_moved *= 0.5;
            }
            if left <= 1.0 || part_moved < LEAST_MOVE {
                break;
            }
            before = left;
            let parts = relaxation.next(pairs.iter().map(apart));
            let mut shifts = Vec::with_capacity(pairs.len());
            for (pair, part) in pairs.iter().zip(parts) {
                let [upper, lower] =
                    [pair.upper, pair.lower].map(|node| scene.model.nodes[node][0]);
                shifts.push([lower, upper - lower - part_moved * part * apart(pair)]);
            }
            limit_growth(&mut shifts);
            let Some(next) = self.shifted(&shifts, depth_m) else {
                break;
            };
            let Some(found) = solve(&next.model, core::slice::from_ref(&state)) else {
                break;
            };
            (scene, state) = (next, found);
        }
        Some((scene, state))
    }

    /// How far the nodes of each pair are apart along r, at the nodes' displacements (r, z).
    pub(crate) fn distances(&self, displacement: &[f64]) -> Vec<f64> {
        let radius = |node: usize| self.model.nodes[node][0] + displacement[2 * node];
        let pairs = self.model.pairs().into_iter();
        pairs
            .map(|pair| radius(pair.upper) - radius(pair.lower))
            .collect()
    }

    /// This scene with the upper node of each pair moved back by its distance.
    pub(crate) fn moved_back(&self, distances: &[f64], depth_m: f64) -> Option<Self> {
        let pairs = self.model.pairs().into_iter().zip(distances);
        let shifts: Vec<[f64; 2]> = pairs
            .map(|(pair, distance)| [self.model.nodes[pair.upper][0], -distance])
            .collect();
        self.shifted(&shifts, depth_m)
    }

    /// This scene with the upper surface's nodes where another scene has them, its shifts times
    /// `growth`.
    fn with_pairs_of(&self, near: &ElementModel, growth: f64, depth_m: f64) -> Option<Self> {
        let mut shifts = Vec::new();
        for pair in self.model.pairs() {
            let [upper, lower] = [pair.upper, pair.lower].map(|node| near.nodes[node][0]);
            shifts.push([self.model.nodes[pair.lower][0], growth * (upper - lower)]);
        }
        limit_growth(&mut shifts);
        self.shifted(&shifts, depth_m)
    }

    /// This scene with nodes of the upper body moved along r: at the surface by the second of
    /// `shifts` at the first, none at `depth_m` and at the outer side, linearly in between.
    fn shifted(&self, shifts: &[[f64; 2]], depth_m: f64) -> Option<Self> {
        let mut scene = self.clone();
        let model = &mut scene.model;
        let Some(&[rim, _]) = shifts.last() else {
            return Some(scene);
        };
        let outermost = model.nodes.iter().map(|node| node[0]).fold(0.0, f64::max);
        let mut is_upper = vec![false; model.nodes.len()];
        let regions = model.parts.last()?.regions.clone();
        for (element, region) in model.elements.iter().zip(&model.regions) {
            if regions.contains(region) {
                element.iter().for_each(|&node| is_upper[node] = true);
            }
        }
        let at = |radius: f64| {
            let after = shifts.partition_point(|shift| shift[0] < radius);
            match (after.checked_sub(1).map(|k| shifts[k]), shifts.get(after)) {
                (Some([a, from]), Some([b, to])) => from + (to - from) * (radius - a) / (b - a),
                (Some([_, last]), None) => last * (outermost - radius) / (outermost - rim),
                (None, Some([_, first])) => *first,
                (None, None) => 0.0,
            }
        };
        let moved = |node: usize, [r, z]: [f64; 2]| {
            let part = 1.0 - z / depth_m;
            let is_moved = is_upper[node] && part > 0.0;
            [if is_moved { r + part * at(r) } else { r }, z]
        };
        model.move_nodes(moved).ok()?;
        Some(scene)
    }
}

/// Part of its distance by which each pair's node is moved: a secant's step, pair by pair.
///
/// A move by δ changes a distance by −δ where the face is smooth. At the rim, whose pressure the
/// move changes, the change is larger, at a tenth of the block's height twice as large: full steps
/// would never end.
#[derive(Debug, Clone, Default)]
pub(crate) struct Relaxation {
    /// Distance before the last move, and the part of it that was moved.
    last: Vec<(f64, f64)>,
}

impl Relaxation {
    /// The part of a distance by which a node is moved, from the last two distances.
    pub(crate) fn next(&mut self, distances: impl Iterator<Item = f64>) -> Vec<f64> {
        let mut last = core::mem::take(&mut self.last).into_iter();
        for now in distances {
            let part = last.next().map_or(1.0, |(before, part)| {
                let secant = part * before / (before - now);
                // Distances that are rounding alone say nothing.
                if secant.is_finite() {
                    secant.clamp(LEAST_PART, 1.0)
                } else {
                    1.0
                }
            });
            self.last.push((now, part));
        }
        self.last.iter().map(|(_, part)| *part).collect()
    }
}

/// Keeps neighbouring shifts from differing by more than a part of the nodes' distance: at the rim,
/// where the displacement is singular, elements would be turned inside out.
fn limit_growth(shifts: &mut [[f64; 2]]) {
    for k in 1..shifts.len() {
        let [[before, last], [here, shift]] = [shifts[k - 1], shifts[k]];
        let most = LARGEST_GROWTH * (here - before);
        shifts[k][1] = last + (shift - last).clamp(-most, most);
    }
}

impl ElementModel {
    /// Pairs of nodes that share their axial displacement, from the axis outwards.
    fn pairs(&self) -> Vec<Pair> {
        let partners = self.partners.iter().enumerate();
        let mut pairs: Vec<Pair> = partners
            .filter_map(|(upper, lower)| lower.map(|lower| Pair { upper, lower }))
            .collect();
        pairs.sort_by(|a, b| self.nodes[a.lower][0].total_cmp(&self.nodes[b.lower][0]));
        pairs
    }
}
