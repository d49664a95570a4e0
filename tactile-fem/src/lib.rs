#![doc = include_str!("../README.md")]
//!
//! # Method
//! Bodies of revolution of compressible neo-Hookean material, or of Hooke's law, touch without
//! friction, without slip, or are bonded. Loads are forces or approaches. If a load is not reached,
//! the solution ends with a report.
//!
//! Elements are nine-node quadrilaterals with three discontinuous pressures each (Q9/P1, inf–sup
//! stable: no locking up to ν = 0.4999). The pressures and the centre node are eliminated in each
//! element. Newton's method uses the consistent tangent; scenes without contact keep it while it
//! converges fast. The sparse LDLᵀ factorisation is analysed once per pattern. Load steps are
//! halved and doubled according to the convergence.
//!
//! - Contact without friction: pressures are piecewise linear on the nodes of one surface. Gaps to
//!   the closest points of the other surface's edges are integrated between the ends of these edges
//!   (segment-to-segment). The augmented Lagrangian finds its contact zone by a primal–dual active
//!   set.
//! - Contact without slip: a penalty holds nodes along the surface where they first touched, and
//!   the load grows by a tenth per step.
//! - Surfaces that touch from the start and only slide share their axial displacements instead.
//!
//! # Accuracy
//! The method was compared with independent finite-element programs at ν = 0.495:
//!
//! - A ball on a rigid flat, up to a/R = 0.9: within 0.2 % in contact radius and 0.1 % in approach
//!   at given force.
//! - A ball on a guide of three layers, up to a/R = 1.07: within 0.2 % in contact radius and 0.3 %
//!   in approach at given force, 0.6 % in force at given contact radius.
//! - A bonded block with an inclusion of up to 11 mm: within 0.9 % in force, and 0.3 % root mean
//!   square in pressure over the inner three quarters of the face. Most of the difference comes
//!   from CalculiX's mesh: if it is refined, both are within 0.3 %. Without friction they are 1.6 %
//!   and 0.7 %.
//!
//! The bench `finite_elements` and the tests `against_calculix` of `tactile-inclusion` print these
//! values. Without slip, the results for a flat punch agree with Spence within 0.05 % at ν = 0, 0.3
//! and 0.45. The forces of a ball and a cone agree with Borodich and Keer within 0.3 % at ν = 0.
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
