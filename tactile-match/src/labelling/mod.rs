//! Relaxation labelling, the paper's matching method as printed: dense, slow and obvious, to check faster ones against.
//!
//! Two point sets `x_i` (model, `I` points) and `y_j` (target, `J` points) are graphs: every point is joined to its
//! neighbours. A match matrix `M`, `(I + 1) × (J + 1)` with a slack row and a slack column for points without a
//! partner, should keep neighbours neighbours. In the paper's numbers, with the reading taken here:
//!
//! | equation | what | where |
//! |---|---|---|
//! | (13) | neighbourhood: within the median of all pairwise distances, the median included | `neighbourhood.rs` |
//! | (14) | energy `Σ_i Σ_{a∈N(i)} Σ_j Σ_{b∈N(j)} M_ij M_ab`: edges kept, each counted from both ends | `support.rs` |
//! | constraint of (14) | rows and columns sum to one, slack included; the slack row and column themselves need not | `update.rs` |
//! | (15) | `α = 1 − |d_ia − d_jb| / max(d_ia, d_jb)` per pair, or over the longest edge of both graphs | `compatibility.rs` |
//! | (16) | `β = 1 − ∠(x_a − x_i, y_b − y_j) / π` | `compatibility.rs` |
//! | (17) | `γ = 1 − d_ia / max_{a'∈N(i)} d_ia'` | `compatibility.rs` |
//! | (18) | compatibility `r = αβγ_ia`, or `αβγ_ia γ_jb` ([`Compatibility`]) | `compatibility.rs` |
//! | (19) | support `S_ij = Σ_{a∈N(i)} Σ_{b∈N(j)} M_ab r(ia, jb)` | `support.rs` |
//! | (20) | `M_ij ← M_ij S_ij / Σ_j' M_ij' S_ij'`, the slack entry with a constant gain in place of `S` | `update.rs` |
//!
//! Four readings need a word. β compares directions: a difference of printed angles breaks at ±180° and does
//! not exist in 3-D, the angle between the vectors has neither fault (and the same value elsewhere). The maximum in
//! α may be meant per pair or over all pairs: [`LengthMaximum`] offers both. γ is printed for the model's edge alone, which prefers
//! one of the graphs: [`Compatibility`] offers that and, as the default, the product of both. γ is zero for a point's farthest
//! neighbour, so that a point with one neighbour has no support: that is what is printed.
//!
//! One sweep costs `O(I J A B)` for `A` and `B` neighbours a point, and with neighbourhoods of the median radius
//! `A ≈ I/2`, `B ≈ J/2`: fourth order, not the third the paper claims. [`AnnealedSoftassign`](crate::AnnealedSoftassign)
//! is the matcher to use; [`RelaxationLabelling`] is what to check it against, and
//! [`RelaxationLabelling::with_candidates`] runs the same method over few candidates.

mod compatibility;
mod match_matrix;
mod matcher;
mod neighbourhood;
mod options;
mod outcome;
mod relax;
mod shape_context;
mod sparse;
mod support;
#[cfg(test)]
pub(crate) mod testing {
    //! The building blocks, for tests of other modules against them.
    pub(crate) use super::compatibility::{Compatibility, CompatibilityRule};
    pub(crate) use super::match_matrix::MatchMatrix;
    pub(crate) use super::neighbourhood::{NeighbourGraph, Neighbourhood};
    pub(crate) use super::support::support;
    pub(crate) use super::update::sweep;
}
#[cfg(test)]
mod tests;
mod update;

pub use compatibility::{Compatibility, LengthMaximum};
pub use neighbourhood::Neighbourhood;
pub use options::RelaxationLabelling;

use compatibility::{CompatibilityRule, gamma};
use match_matrix::MatchMatrix;
use neighbourhood::{Edge, NeighbourGraph};
use relax::relax_with;
use shape_context::first_matches;
use support::{energy, support_by};
