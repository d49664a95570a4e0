//! Where the legend stands.

/// Where the legend stands.
///
/// ```
/// use tactile_imaging::plot::{Colour, Legend, Page, Panel};
/// let rising = [[0.0, 0.0], [1e6, 1.0], [2e6, 2.0]];
/// let panel = Panel::new("Calibration").line(rising, Colour::BLUE, "fit");
/// let svg = |legend| Page::new("").panel(panel.clone().legend(legend)).to_svg();
/// assert_eq!(svg(Legend::Emptiest)?, svg(Legend::UpperLeft)?, "a rising line leaves that corner free");
/// assert_ne!(svg(Legend::UpperLeft)?, svg(Legend::LowerRight)?);
/// # Ok::<(), tactile_imaging::plot::PlotError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Legend {
    /// In the corner where it hides the least.
    #[default]
    Emptiest,
    /// Above the data, on the right.
    UpperRight,
    /// Above the data, on the left.
    UpperLeft,
    /// Below the data, on the right.
    LowerRight,
    /// Below the data, on the left.
    LowerLeft,
}
