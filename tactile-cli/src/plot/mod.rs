//! Plots as SVG, and the pages of a press: its frames, surfaces, matches, displacement, strain and
//! summary.
mod axis;
mod canvas;
mod page;
mod press;

pub(crate) use page::{Colour, HeatMap, Page, Panel, PlotError};
pub(crate) use press::{circle, known_heights_mm, press_pages, summary_lines};
