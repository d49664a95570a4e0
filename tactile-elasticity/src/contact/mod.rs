//! Contact mechanics: forces, contact radii and indentations of elastic bodies.
//!
//! | item | contact |
//! |---|---|
//! | [`HertzContact`] | two spheres, small contact |
//! | [`LayerEquation`] | sphere on one or more bonded layers: the solution by an integral equation |
//! | [`ContactTable`] | soft ball on a guide, tabulated by finite elements |
//! | [`Waveguide`] | the layers of a sensor, and their surface under a ball |

mod depression;
mod guide;
mod hertz;
mod layers;
mod table;
mod waveguide;

pub use hertz::{Body, HertzContact};
pub use layers::{Bond, LayerContact, LayerEquation};
pub use table::{ContactCurve, ContactTable};
pub use waveguide::{Layer, Waveguide};

pub(crate) use guide::GuideErrors;
pub(crate) use layers::{LayerKernel, SharedLayerTable};
pub(crate) use table::TabulatedForce;
