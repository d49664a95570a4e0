//! Contact mechanics: forces, contact radii and indentations of elastic bodies.
//!
//! | item | contact |
//! |---|---|
//! | [`HertzContact`] | two spheres, small contact |
//! | [`flat_punch`], [`cone`] | rigid punch and cone on a half-space |
//! | [`depression_m`] | surface of layers under a ball's contact |
//! | [`LayerEquation`] | sphere on one or more bonded layers: the solution by an integral equation |
//! | [`LayerPlane`] | displacement of a layered surface under a contact of any shape, to pressure |
//! | [`LayerSeries`] | sphere on one layer: series in χ = √(Rδ)/h |
//! | [`tatara_indentation_m`] | sphere squeezed between two plates, large deformation |
//! | [`ContactTable`] | soft ball on a guide, tabulated by finite elements |
//! | [`Waveguide`] | the layers of a sensor |

mod depression;
mod hertz;
mod layers;
mod plane;
mod table;
mod waveguide;

pub use depression::depression_m;
pub use hertz::{
    Body, ConeContact, HertzContact, PunchContact, cone, flat_punch, hertz_surface_displacement_m,
    reduced_modulus_pa, relative_radius_m, tangent_of_degrees, tatara_indentation_m,
};
pub use layers::{Bond, LayerContact, LayerEquation, LayerSeries};
pub use plane::LayerPlane;
pub use table::{ContactCurve, ContactTable};
pub use waveguide::{
    Layer, PARABOLA_ERROR, PARAMETERS_PER_LAYER, Waveguide, guide_compliance_covariance,
    guide_compliance_error, guide_log_stiffness, parameter_slopes, stepped_layers,
};

pub(crate) use hertz::Squeeze;
pub(crate) use layers::{LayerKernel, LayerTable, SharedLayerTable};
pub(crate) use table::TabulatedForce;
