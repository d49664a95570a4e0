//! What a panel can show.
use super::colour::{ColorMap, Colour};
use super::heat::HeatMap;
use super::scale::range_of;

/// The shape of a point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub(crate) enum Marker {
    /// A filled disc.
    #[default]
    Disc,
    /// An open circle.
    Ring,
}

/// One layer of a panel; layers are drawn in the order in which they were added. An empty label keeps a layer out of the legend.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub(crate) enum Layer {
    /// Separate points.
    Points {
        /// Positions.
        points: Vec<[f64; 2]>,
        /// Colour of all of them.
        colour: Colour,
        /// Their shape.
        marker: Marker,
        /// Radius, in pixels of the page.
        radius: f64,
        /// Name in the legend.
        label: String,
    },
    /// Points coloured by a value, with a colour bar.
    ColouredPoints {
        /// Positions.
        points: Vec<[f64; 2]>,
        /// A value for each.
        values: Vec<f64>,
        /// Colours of the values.
        map: ColorMap,
        /// Radius, in pixels of the page.
        radius: f64,
        /// What the values are, with their unit: the colour bar's label.
        label: String,
    },
    /// A line through points; NaN breaks it.
    Line {
        /// Vertices.
        points: Vec<[f64; 2]>,
        /// Colour.
        colour: Colour,
        /// Whether it is dashed.
        dashed: bool,
        /// Name in the legend.
        label: String,
    },
    /// Vertical bars of plus and minus an error.
    ErrorBars {
        /// The middle of each bar.
        points: Vec<[f64; 2]>,
        /// Half of each bar's length.
        errors: Vec<f64>,
        /// Colour.
        colour: Colour,
    },
    /// Arrows (a vector field) or plain segments (matches).
    Segments {
        /// Start and end of each.
        pairs: Vec<[[f64; 2]; 2]>,
        /// Colour.
        colour: Colour,
        /// Whether they end in an arrow head.
        arrows: bool,
        /// Name in the legend.
        label: String,
    },
    /// Values on a grid, with a colour bar.
    Heat(HeatMap),
}

impl Layer {
    /// Calls `f` with every position that must be inside the axes.
    pub(super) fn visit(&self, mut f: impl FnMut([f64; 2])) {
        match self {
            Self::Points { points, .. }
            | Self::ColouredPoints { points, .. }
            | Self::Line { points, .. } => {
                points.iter().for_each(|&p| f(p));
            }
            Self::ErrorBars { points, errors, .. } => {
                points.iter().zip(errors).for_each(|(p, e)| {
                    f([p[0], p[1] - e]);
                    f([p[0], p[1] + e]);
                })
            }
            Self::Segments { pairs, .. } => pairs.iter().flatten().for_each(|&p| f(p)),
            Self::Heat(map) => {
                f([map.x[0], map.y[0]]);
                f([map.x[1], map.y[1]]);
            }
        }
    }

    /// The colour bar that the layer needs: colours, range of values, label.
    pub(super) fn bar(&self) -> Option<(ColorMap, [f64; 2], &str)> {
        match self {
            Self::Heat(map) => Some((map.map, map.range, &map.label)),
            Self::ColouredPoints {
                values, map, label, ..
            } => Some((*map, range_of(values.iter()), label)),
            _ => None,
        }
    }
}
