//! The paper's matching method exactly as printed: dense, slow and obvious. The reference for the fast matcher.
//!
//! Two point sets `x_i` (model, `I` points) and `y_j` (target, `J` points) are graphs: every point is joined to its
//! neighbours. A match matrix `M`, `(I + 1) × (J + 1)` with a slack row and a slack column for points without a
//! partner ([`MatchMatrix`]), should keep neighbours neighbours. In the paper's numbers, with the reading taken here:
//!
//! | equation | what | here |
//! |---|---|---|
//! | (13) | neighbourhood: within the median of all pairwise distances, the median included | [`NeighbourGraph`] |
//! | (14) | energy `Σ_i Σ_{a∈N(i)} Σ_j Σ_{b∈N(j)} M_ij M_ab`: edges kept, each counted from both ends | [`energy`] |
//! | (15) | rows and columns sum to one, slack included; the slack row and column themselves need not | [`sinkhorn`] |
//! | (16) | `α = 1 − |d_ia − d_jb| / max(d_ia, d_jb)` per pair, or over the longest edge of both graphs | [`alpha`], [`alpha_global`] |
//! | (17) | `β = 1 − ∠(x_a − x_i, y_b − y_j) / π` | [`beta`] |
//! | (18) | `γ = 1 − d_ia / max_{a'∈N(i)} d_ia'`, one factor for each graph | [`gamma`] |
//! | (19) | support `S_ij = Σ_{a∈N(i)} Σ_{b∈N(j)} M_ab α β γ_ia γ_jb` | [`support`] |
//! | (20) | `M_ij ← M_ij S_ij / Σ_j' M_ij' S_ij'`, the slack entry with a constant gain in place of `S` | [`update`] |
//!
//! Three readings are worth a word. β compares directions: a difference of printed angles breaks at ±180° and does
//! not exist in 3-D, the angle between the vectors has neither fault (and the same value elsewhere). The maximum in
//! α may be meant per pair or over all pairs: [`LengthMaximum`] offers both. γ is nought for a point's farthest
//! neighbour, so that a point with one neighbour has no support: that is what is printed.
//!
//! One sweep costs `O(I J A B)` for `A` and `B` neighbours a point, and with neighbourhoods of the median radius
//! `A ≈ I/2`, `B ≈ J/2`: fourth order, not the third the paper claims. [`RelaxationMatcher`](crate::RelaxationMatcher)
//! is what to use; [`DenseRelaxation`] is what to check it against, and [`SparseRelaxation`] is the same method over few candidates.

mod compatibility;
mod match_matrix;
mod matcher;
mod neighbourhood;
mod outcome;
mod shape_context;
mod sparse;
mod support;
mod update;

pub use compatibility::{
    Compatibility, CompatibilityRule, LengthMaximum, alpha, alpha_global, beta, gamma,
};
pub use match_matrix::MatchMatrix;
pub use matcher::{DenseOptions, DenseRelaxation};
pub use neighbourhood::{Edge, NeighbourGraph, Neighbourhood, median_pairwise_distance};
pub use shape_context::first_matches;
pub use sparse::SparseRelaxation;
pub use support::{energy, support, support_by};
pub use update::{SinkhornReport, sinkhorn, sweep, update};
