//! Plots of a press as SVG: [`save_press_pages`] draws its frames, surfaces, matches, displacement, strain and summary.
//!
//! Every page is one self-contained SVG file; heat maps use perceptually uniform colours and carry a colour bar.
// Pages are made of panels, panels of layers; some kinds of layers are drawn by the program alone.

mod axes;
mod colour;
mod draw;
mod heat;
mod layer;
mod legend;
mod page;
mod panel;
mod press;
mod scale;
mod svg;
#[cfg(test)]
mod tests;
mod ticks;

pub(crate) use colour::Colour;
pub(crate) use heat::HeatMap;
pub(crate) use layer::{Layer, Marker};
pub(crate) use legend::Legend;
pub(crate) use page::Page;
pub use page::PlotError;
pub(crate) use panel::Panel;
pub use press::save_press_pages;
pub(crate) use press::{save_pages, summary_lines};
pub(crate) use scale::Scale;
