//! Plots as SVG: panels of points, lines, heat maps and vector fields on one page.
//!
//! A [`Panel`] is plain data: a title, axis labels (write the unit into them, "x (mm)") and layers that are drawn in order.
//! A [`Page`] lays panels out in columns and writes one self-contained SVG file. Heat maps use perceptually uniform colour
//! maps ([`ColorMap::Viridis`]) and carry a colour bar.
//!
//! ```
//! # fn main() -> Result<(), tactile_imaging::plot::PlotError> {
//! use tactile_imaging::plot::{Colour, HeatMap, Page, Panel};
//! let line = Panel::new("Calibration")
//!     .x_label("integrated pixel value (grey levels)")
//!     .y_label("force (N)")
//!     .line([[0.0, 0.0], [1e6, 1.0], [2e6, 2.0]], Colour::BLUE, "fit")
//!     .points([[0.9e6, 0.93], [1.7e6, 1.68]], Colour::ORANGE, "measured");
//! let heights = ndarray::Array2::from_shape_fn((40, 60), |(r, c)| (r * c) as f64);
//! let map = Panel::new("Surface")
//!     .x_label("x (mm)")
//!     .y_label("y (mm)")
//!     .heat_map(HeatMap::of_pixels(heights.view(), [0.05, 0.05], "height (mm)"));
//! let svg = Page::new("Two panels").columns(2).panel(line).panel(map).to_svg()?;
//! assert!(svg.starts_with("<svg") && svg.contains("Calibration"));
//! # Ok(()) }
//! ```
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
mod ticks;

pub use colour::{ColorMap, Colour};
pub use heat::HeatMap;
pub use layer::{Layer, Marker};
pub use legend::Legend;
pub use page::{Page, PlotError};
pub use panel::Panel;
pub use press::{save_press_pages, summary_lines};
pub use scale::Scale;
