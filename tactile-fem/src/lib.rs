#![doc = include_str!("../README.md")]
//!
//! # Method
//! Bodies of revolution of compressible neo-Hookean material, or of Hooke's law, meet without
//! friction, without slip or bonded. Loads are forces or approaches. A load that is not reached
//! ends in a report.
//!
//! Elements are nine-node quadrilaterals with three discontinuous pressures each (Q9/P1, inf–sup
//! stable: no locking up to ν = 0.4999). The pressures and the centre node are eliminated element
//! by element. Newton's method has the consistent tangent. Scenes without contact keep it as long
//! as it converges fast. The sparse LDLᵀ factorisation is analysed once a pattern. Load steps are
//! halved and doubled by what converges.
//!
//! - Contact without friction: pressures are piecewise linear on the nodes of one surface. Gaps to
//!   the closest points of the other's edges are integrated from one end of these edges to the next
//!   (segment-to-segment). The augmented Lagrangian finds its contact zone by a primal–dual active
//!   set.
//! - Contact without slip: nodes are held along the surface, by a penalty, where they first
//!   touched, in load steps of a tenth.
//! - Surfaces that touch from the start and only slide share their axial displacements instead.
//!
//! # Accuracy
//! Against independent finite-element programs at ν = 0.495:
//!
//! - A ball on a rigid flat, up to a/R = 0.9: within 0.2 % in contact radius and 0.1 % in approach
//!   at given force.
//! - A ball on a guide of three layers, up to a/R = 1.07: within 0.2 % in contact radius and 0.3 %
//!   in approach at given force, 0.6 % in force at given contact radius.
//! - A bonded block with an inclusion of up to 11 mm: within 0.9 % in force and 0.3 % root mean
//!   square in pressure over the inner three quarters of the face. Most of it is CalculiX's mesh:
//!   where that is refined, 0.3 % in both. Without friction 1.6 % and 0.7 %.
//!
//! The bench `finite_elements` and the tests `against_calculix` of `tactile-inclusion` print these.
//! Without slip a flat punch follows Spence within 0.05 % at ν = 0, 0.3 and 0.45. The forces of a
//! ball and a cone follow Borodich and Keer within 0.3 % at ν = 0.
//!
//! # References
//! D. A. Spence, Proc. R. Soc. A 305 (1968) 55–80. F. M. Borodich and L. M. Keer, Int. J. Solids
//! Struct. 41 (2004) 2479–2499. T. J. R. Hughes, *The Finite Element Method* (1987). P. Wriggers,
//! *Computational Contact Mechanics* (2006). M. Hintermüller, K. Ito & K. Kunisch, SIAM J. Optim.
//! 13 (2003) 865. B. Yang, T. A. Laursen & X. Meng, Int. J. Numer. Meth. Eng. 62 (2005) 1183.
#![forbid(unsafe_code)]

mod contact;
mod element;
mod material;
mod mesh;
mod model;
mod nearby;
mod newton;
mod press;
mod recovery;
mod scene;
mod slide;
mod spacing;
mod sparse;
mod state;
mod stick;
mod surface;
mod system;
mod table;

pub use material::{Kinematics, Material};
pub use nearby::{FrameResponse, SolvedFrames};
pub use press::{Guide, GuideLayer, Interface, ObjectPress, ObjectShape};
pub use recovery::{ContactRadius, PressurePoint};
pub use scene::{AppliedLoad, Block, FemScene, Lump, Outcome, Solution, SolverReport};
pub use state::{State, Stress};
pub use table::{ContactTableOptions, solve_contact_table};
pub use tactile_core::Progress;

#[cfg(test)]
mod tests;
