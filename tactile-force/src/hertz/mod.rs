//! The contact radius, from the shape of the pressure: p(r) = p₀ √(1 − r²/a²) (Hertz).
//!
//! The grey levels of the contact are fitted with that profile averaged over a pixel and blurred by the optics, so that
//! radius and centre come out far below a pixel. Pixels are first gathered into thin rings about the centre, with the
//! sums that keep the least-squares problem of the pixels exact to first order in the centre's shift; the rings are then
//! fitted in microseconds.

mod edge;
mod fit;
mod misfit;
mod options;
mod outcome;
mod profile;
mod rings;
mod variance;

pub use options::HertzFitOptions;
pub use outcome::{HertzFit, ProfileShape};

pub(crate) use fit::{HertzFitter, Start};
pub(crate) use rings::Rings;
pub(crate) use variance::{LEVELS, PixelVariance};
