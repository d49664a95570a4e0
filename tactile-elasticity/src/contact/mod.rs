//! Contact mechanics: forces, contact radii and indentations of elastic bodies.
//!
//! | item | contact |
//! |---|---|
//! | [`HertzContact`] | two spheres, small contact |
//! | [`depression_m`] | surface of layers under a ball's contact |
//! | [`LayerEquation`] | sphere on one or more bonded layers: the solution by an integral equation |
//! | [`ContactTable`] | soft ball on a guide, tabulated by finite elements |
//! | [`Waveguide`] | the layers of a sensor |

mod depression;
mod guide;
mod hertz;
mod layers;
mod table;
mod waveguide;

pub use depression::depression_m;
pub use guide::{
    PARABOLA_ERROR, PARAMETERS_PER_LAYER, guide_log_stiffness, parameter_slopes, stepped_layers,
};
pub use hertz::{Body, HertzContact, hertz_surface_displacement_m, reduced_modulus_pa};
pub use layers::{Bond, LayerContact, LayerEquation};
pub use table::{ContactCurve, ContactTable};
pub use waveguide::{Layer, Waveguide};

pub(crate) use guide::GuideErrors;
pub(crate) use layers::{LayerKernel, SharedLayerTable};
pub(crate) use table::TabulatedForce;
