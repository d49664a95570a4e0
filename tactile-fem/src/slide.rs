//! Surfaces that slide far on each other without friction, at one approach.
//!
//! With [`ElementModel::slide`](crate::model::ElementModel::slide), coincident nodes share their
//! axial displacement. Because the bodies spread by different amounts, such nodes separate sideways
//! by several tenths of a millimetre. This changes the pressure by up to 1.1 % at a tenth of the
//! block's height. The mesh of the upper body is therefore moved along its surface until nodes that
//! share a displacement coincide in the deformed state.
//!
//! The pressure acts along the axis: its radial component p dz/dr on the slightly bent face is
//! neglected. CalculiX with faces tied in the same way agrees (`evidence/inclusion_scenes.py`, the
//! test `inclusion::against_calculix`). With contact pairs, whose pressure is normal to the bent
//! face, CalculiX gives lower forces and pressures: by 0.3 % at a thirtieth of the block's height,
//! and by about 2 % at a tenth. The search does not take this into account.

use crate::model::ElementModel;
use crate::scene::{AppliedLoad, FemScene};
use crate::state::State;
use crate::system::Layout;

/// Distance at which nodes of the rim count as coincident, relative to the face radius ([`MET`]
/// elsewhere).
const RIM_MET: f64 = 5e-5;

/// Fraction of the face radius above which nodes belong to the rim, with their own tolerance. At a
/// tenth of the block's height half of their distance remains after a round instead of a tenth. The
/// pressure within three quarters of the face then changes by a hundredth of it.
const RIM_LIMIT: f64 = 0.9;

/// Distance at which nodes count as coincident, relative to the face radius. Pressures change by
/// the same fraction.
const MET: f64 = 2e-6;

/// Fraction of the distance that a round may leave. Above a tenth of the block's height, the rim
/// nodes of a coarse mesh oscillate; moves are then halved. Otherwise the pressure would depend on
/// the start of the rounds, by 0.3 % at three quarters of the radius.
const STALLED: f64 = 0.8;

/// Minimum fraction of a distance for a halved move.
const LEAST_MOVE: f64 = 0.1;

/// Maximum number of rounds of meshing and solving. Each leaves about a tenth of the previous
/// distance.
const MAX_ROUNDS: usize = 12;

/// Minimum fraction of a distance that is moved.
const LEAST_PART: f64 = 0.2;

/// Largest change of a shift relative to the distance of two nodes. Inside the face it is below
/// 0.1.
const LARGEST_GROWTH: f64 = 0.9;

/// A node of the upper surface, with the node of the lower surface that shares its axial
/// displacement.
struct Pair {
    upper: usize,
    lower: usize,
}

impl FemScene {
    /// Scene and state at an approach with sliding surfaces. Scenes with a bonded interface are
    /// returned unchanged.
    ///
    /// `depth_m` is the depth below the surface to which the mesh may move. `near` is a nearby
    /// solution on a mesh with the same elements, and `layout` belongs to such a mesh. `None` if
    /// there is no solution.
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
                // The sliding distance is nearly proportional to the approach.
                let growth = approach_m / state.approach_m();
                self.with_pairs_of(&near.model, growth, depth_m)
                    .or_else(|| self.with_pairs_of(&near.model, 1.0, depth_m))?
            }
            None => self.clone(),
        };
        let guess = near.map_or(&[][..], |(_, state)| core::slice::from_ref(state));
        let mut state = (scene.model.solve_near(layout, &load, guess).states).pop()?;
        let mut last: Vec<[f64; 2]> = Vec::new();
        let mut before = f64::INFINITY;
        let mut part_moved = 1.0;
        for _ in 0..MAX_ROUNDS {
            let pairs = scene.model.pairs();
            let radius =
                |node: usize| scene.model.nodes[node][0] + state.fields.displacement[2 * node];
            let face = pairs
                .iter()
                .map(|pair| radius(pair.lower))
                .fold(0.0, f64::max);
            let mut moves = Vec::with_capacity(pairs.len());
            let mut shifts = Vec::with_capacity(pairs.len());
            for (k, pair) in pairs.iter().enumerate() {
                let [upper, lower] =
                    [pair.upper, pair.lower].map(|node| scene.model.nodes[node][0]);
                let apart = radius(pair.upper) - radius(pair.lower);
                let by = part_moved * secant_part(apart, last.get(k)) * apart;
                moves.push([apart, by]);
                shifts.push([lower, upper - lower - by]);
            }
            limit_growth(&mut shifts);
            let mut left = 0.0_f64;
            for ((pair, [lower, shift]), [apart, by]) in pairs.iter().zip(&shifts).zip(&mut moves) {
                let moved = scene.model.nodes[pair.upper][0] - lower - shift;
                let is_rim = radius(pair.lower) > RIM_LIMIT * face;
                let tolerance = if is_rim { RIM_MET } else { MET } * face;
                // A node that may not move further is not counted.
                left = left.max((moved / *by * *apart / tolerance).abs());
                *by = moved;
            }
            last = moves;
            if left > STALLED * before {
                part_moved *= 0.5;
            }
            if left <= 1.0 || part_moved < LEAST_MOVE {
                break;
            }
            before = left;
            let next = self.shifted(&shifts, depth_m).and_then(|next| {
                let state = next.model.solve_from(layout, &state, approach_m)?;
                Some((next, state))
            });
            let Some(next) = next else {
                break;
            };
            (scene, state) = next;
        }
        Some((scene, state))
    }

    /// Distances along r between the nodes of each pair, at the nodal displacements (r, z).
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

    /// This scene with the nodes of the upper surface shifted as in another scene, times `growth`.
    fn with_pairs_of(&self, near: &ElementModel, growth: f64, depth_m: f64) -> Option<Self> {
        let mut shifts = Vec::new();
        for pair in self.model.pairs() {
            let [upper, lower] = [pair.upper, pair.lower].map(|node| near.nodes[node][0]);
            shifts.push([self.model.nodes[pair.lower][0], growth * (upper - lower)]);
        }
        limit_growth(&mut shifts);
        self.shifted(&shifts, depth_m)
    }

    /// This scene with nodes of the upper body moved along r. At the surface the shift is the
    /// second value of `shifts` at the radius of the first. It falls linearly to zero at `depth_m`
    /// and at the outer side.
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

/// Fraction of its distance by which the node of a pair is moved: a secant step from its last
/// distance and move.
///
/// On a smooth face, a move by δ changes a distance by −δ. At the rim the move also changes the
/// pressure, and the change is larger, by a factor of two at a tenth of the block's height. Full
/// steps would never converge.
fn secant_part(distance: f64, last: Option<&[f64; 2]>) -> f64 {
    let part = last.map_or(1.0, |[before, moved]| moved / (before - distance));
    // Distances at rounding level give no secant.
    if part.is_finite() {
        part.clamp(LEAST_PART, 1.0)
    } else {
        1.0
    }
}

/// Limits the difference of neighbouring shifts to a fraction of the distance of the nodes: at the
/// rim, where the displacement is singular, elements would be inverted.
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
