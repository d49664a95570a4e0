#![doc = include_str!("../README.md")]
//!
//! # Overview
//! Bodies of revolution of compressible neo-Hookean material (or of Hooke's law) meet without friction,
//! without slip or bonded: a soft ball on a rigid flat or on a layered guide, a guide's face on a block of tissue
//! with a stiff inclusion. Loads are forces or approaches; what is not reached ends in a report.
//!
//! [`Scene`] has the ready models and [writes](Scene::write_vtk) states for ParaView, [`Press`] balls, half balls, cylinders, plates and cones
//! on a guide or a rigid flat. For three dimensions, bodies of another shape, or a mesh of one's own, take a general package: CalculiX,
//! FEniCSx or MOOSE.
//!
//! # Ready scenes
//! ```
//! use tactile_fem::{Block, Guide, Interface, Layer, Load, Lump, Material, Scene};
//!
//! # fn main() -> Result<(), tactile_elasticity::ElasticityError> {
//! let guide = Guide::new(
//!     vec![
//!         Layer { thickness_m: 2e-3, material: Material::new(136e3, 0.495)? },
//!         Layer { thickness_m: 3e-3, material: Material::new(80e3, 0.495)? },
//!         Layer { thickness_m: 5e-3, material: Material::new(34e3, 0.495)? },
//!     ],
//!     16e-3,
//! )?;
//! let lump = Lump { diameter_m: 11e-3, depth_m: 3.6e-3, material: Material::new(35e3, 0.495)? };
//! let block = Block {
//!     height_m: 31e-3,
//!     radius_m: 40e-3,
//!     material: Material::new(3.5e3, 0.495)?,
//!     lump: Some(lump),
//! };
//! let scene = Scene::block_under_guide(&block, &guide, Interface::Bonded)?;
//! let solution = scene.solve(&[Load::Approach(1.2e-3), Load::Approach(2.4e-3)]);
//! for state in &solution.states {
//!     let centre = state.pressure()[0].pressure_pa;
//!     assert!(centre > 0.0 && state.force_n() > 0.0);
//! }
//! # Ok(())
//! # }
//! ```
//!
//! # Method
//! Nine-node quadrilaterals with three discontinuous pressures each (Q9/P1, inf–sup stable: no locking
//! up to ν = 0.4999), the pressures and the centre node eliminated element by element; Newton's method
//! with the consistent tangent, which scenes without contact search keep as long as it converges fast, a sparse LDLᵀ
//! factorisation analysed once a pattern, load steps halved and doubled by what converges. Contact without friction: pressures piecewise linear on the nodes of one surface, gaps to
//! the closest points of the other's edges, integrated from one end of these edges to the next
//! (segment-to-segment), augmented Lagrangian, the contact zone of each iteration by a primal–dual active
//! set. Contact without slip: nodes are held along the surface, by a penalty, where they first touched, in load steps of a tenth.
//! Surfaces that touch from the start and only slide share their axial displacements instead.
//!
//! Measured against independent finite-element programs at ν = 0.495: a ball on a rigid flat up to
//! a/R = 0.9 within 0.2 % in contact radius and 0.1 % in approach at given force; a bonded block with an
//! inclusion within 0.9 % in force and, with D up to 11 mm, 0.3 % root mean square in pressure over the
//! inner three quarters of the face, most of it CalculiX's mesh: where that is refined, 0.3 % in both (the test
//! `inclusion::against_calculix`); without friction 1.6 % and 0.7 %; a ball on a guide of three layers
//! up to a/R = 1.07 within 0.2 % in contact radius and 0.3 % in approach at given force, 0.6 % in force at
//! given contact radius (`cargo bench -p tactile-benches --features fem --bench finite_elements`).
//!
//! Without slip a flat punch follows Spence within 0.05 % at ν = 0, 0.3 and 0.45, a ball's stiffness Borodich and Keer within 0.5 % at ν = 0.3
//! (the tests of `fem::stick`).
//!
//! # References
//! D. A. Spence, Proc. R. Soc. A 305 (1968) 55–80; F. M. Borodich and L. M. Keer, Int. J. Solids Struct. 41 (2004) 2479–2499 (contact without slip).
//! T. J. R. Hughes, *The Finite Element Method* (1987). P. Wriggers, *Computational Contact Mechanics*
//! (2006). M. Hintermüller, K. Ito & K. Kunisch, SIAM J. Optim. 13 (2003) 865. B. Yang, T. A. Laursen &
//! X. Meng, Int. J. Numer. Meth. Eng. 62 (2005) 1183.
#![forbid(unsafe_code)]

mod contact;
mod element;
mod error;
mod material;
mod mesh;
mod model;
mod nearby;
mod newton;
mod press;
mod recovery;
mod scene;
mod slide;
mod sparse;
mod state;
mod stick;
mod system;
mod table;
mod vtk;

pub use material::{Kinematics, Material};
pub use nearby::{Found, Neighbourhood};
pub use press::{Guide, Layer, Object, Press};
pub use scene::{Block, Interface, Load, Lump, Outcome, Report, Scene, Solution};
pub use slide::Relaxation;
pub use state::{ContactRadius, PressurePoint, State, Stress, pressure_at};
pub use system::Layout;
pub use table::{TableOptions, TableProgress, solve_contact_table};

#[cfg(test)]
mod tests;
