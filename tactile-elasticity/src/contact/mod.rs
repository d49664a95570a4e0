//! Contact mechanics: forces, contact radii and indentations of elastic bodies.
//!
//! | item | contact |
//! |---|---|
//! | [`HertzContact`] | two spheres, small contact |
//! | [`flat_punch`], [`cone`] | rigid punch and cone on a half-space |
//! | [`LayerEquation`] | sphere on one or more bonded layers: the solution by an integral equation |
//! | [`LayerSeries`] | sphere on one layer: series in χ = √(Rδ)/h |
//! | [`tatara_indentation_m`] | sphere squeezed between two plates, large deformation |
//! | [`ContactTable`] | soft ball on a guide, tabulated by finite elements |
//! | [`Waveguide`] | the layers of a sensor |

mod body;
mod hertz;
mod interpolation;
mod layer_equation;
mod layer_kernel;
mod layer_series;
mod layer_table;
mod punch;
mod quadrature;
mod stack;
mod table;
mod tatara;
mod waveguide;

pub use body::{Body, reduced_modulus_pa, relative_radius_m, sample_modulus_pa};
pub use hertz::{
    HertzContact, hertz_surface_displacement_m, reduced_modulus_from_contact_radius,
    reduced_modulus_from_indentation,
};
pub use layer_equation::{LayerContact, LayerEquation};
pub use layer_kernel::Bond;
pub use layer_series::LayerSeries;
pub use punch::{ConeContact, PunchContact, cone, flat_punch, tangent_of_degrees};
pub use table::{ContactCurve, ContactTable};
pub use tatara::tatara_indentation_m;
pub use waveguide::{Layer, Waveguide};

pub(crate) use layer_kernel::LayerKernel;
pub(crate) use layer_table::{LayerTable, SharedLayerTable};
pub(crate) use quadrature::gauss_panels;
pub(crate) use table::TabulatedForce;
pub(crate) use tatara::Squeeze;
