//! A panel: axes with layers in them, described as data.
use super::colour::{ColorMap, Colour};
use super::heat::HeatMap;
use super::layer::{Layer, Marker};
use super::legend::Legend;
use super::scale::Scale;

/// One set of axes and what is drawn in it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Panel {
    pub(super) title: String,
    pub(super) x_label: String,
    pub(super) y_label: String,
    pub(super) layers: Vec<Layer>,
    pub(super) equal_aspect: bool,
    pub(super) y_down: bool,
    pub(super) scales: [Scale; 2],
    pub(super) y_range: Option<[f64; 2]>,
    pub(super) text: Vec<String>,
    pub(super) legend: Legend,
}

impl Panel {
    /// An empty panel.
    pub(crate) fn new(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            ..Self::default()
        }
    }

    /// Names the x axis; write the unit into it.
    #[must_use]
    pub(crate) fn x_label(mut self, label: impl Into<String>) -> Self {
        self.x_label = label.into();
        self
    }

    /// Names the y axis; write the unit into it.
    #[must_use]
    pub(crate) fn y_label(mut self, label: impl Into<String>) -> Self {
        self.y_label = label.into();
        self
    }

    /// Gives both axes the same scale on the page.
    #[must_use]
    pub(crate) fn equal_aspect(mut self) -> Self {
        self.equal_aspect = true;
        self
    }

    /// Draws like an image: y downwards, both axes with the same scale.
    #[must_use]
    pub(crate) fn image_axes(mut self) -> Self {
        self.y_down = true;
        self.equal_aspect()
    }

    /// Moves the legend.
    #[must_use]
    pub(crate) fn legend(mut self, legend: Legend) -> Self {
        self.legend = legend;
        self
    }

    /// Sets how the axes count.
    #[must_use]
    pub(crate) fn scales(mut self, x: Scale, y: Scale) -> Self {
        self.scales = [x, y];
        self
    }

    /// Sets the range of the y axis.
    #[must_use]
    pub(crate) fn y_range(mut self, range: [f64; 2]) -> Self {
        self.y_range = Some(range);
        self
    }

    /// Adds any layer.
    #[must_use]
    pub(crate) fn layer(mut self, layer: Layer) -> Self {
        self.layers.push(layer);
        self
    }

    /// Adds discs.
    #[must_use]
    pub(crate) fn points(
        self,
        points: impl IntoIterator<Item = [f64; 2]>,
        colour: Colour,
        label: &str,
    ) -> Self {
        self.marked(points, Marker::Disc, colour, label)
    }

    /// Adds points of a given shape.
    #[must_use]
    pub(crate) fn marked(
        self,
        points: impl IntoIterator<Item = [f64; 2]>,
        marker: Marker,
        colour: Colour,
        label: &str,
    ) -> Self {
        let points = points.into_iter().collect();
        self.layer(Layer::Points {
            points,
            colour,
            marker,
            radius: 3.0,
            label: label.into(),
        })
    }

    /// Adds points coloured by a value, with a colour bar.
    #[must_use]
    pub(crate) fn coloured_points(
        self,
        points: impl IntoIterator<Item = [f64; 2]>,
        values: impl IntoIterator<Item = f64>,
        label: &str,
    ) -> Self {
        let (points, values) = (points.into_iter().collect(), values.into_iter().collect());
        let map = ColorMap::Viridis;
        self.layer(Layer::ColouredPoints {
            points,
            values,
            map,
            radius: 3.5,
            label: label.into(),
        })
    }

    /// Adds a line.
    #[must_use]
    pub(crate) fn line(
        self,
        points: impl IntoIterator<Item = [f64; 2]>,
        colour: Colour,
        label: &str,
    ) -> Self {
        let points = points.into_iter().collect();
        self.layer(Layer::Line {
            points,
            colour,
            dashed: false,
            label: label.into(),
        })
    }

    /// Adds a dashed line.
    #[must_use]
    pub(crate) fn dashed(
        self,
        points: impl IntoIterator<Item = [f64; 2]>,
        colour: Colour,
        label: &str,
    ) -> Self {
        let points = points.into_iter().collect();
        self.layer(Layer::Line {
            points,
            colour,
            dashed: true,
            label: label.into(),
        })
    }

    /// Adds vertical error bars of plus and minus `errors`.
    #[must_use]
    pub(crate) fn error_bars(
        self,
        points: impl IntoIterator<Item = [f64; 2]>,
        errors: impl IntoIterator<Item = f64>,
        colour: Colour,
    ) -> Self {
        let (points, errors) = (points.into_iter().collect(), errors.into_iter().collect());
        self.layer(Layer::ErrorBars {
            points,
            errors,
            colour,
        })
    }

    /// Adds arrows from the first to the second position of every pair.
    #[must_use]
    pub(crate) fn arrows(
        self,
        pairs: impl IntoIterator<Item = [[f64; 2]; 2]>,
        colour: Colour,
        label: &str,
    ) -> Self {
        let pairs = pairs.into_iter().collect();
        self.layer(Layer::Segments {
            pairs,
            colour,
            arrows: true,
            label: label.into(),
        })
    }

    /// Adds plain segments, such as the matches between two point sets.
    #[must_use]
    pub(crate) fn segments(
        self,
        pairs: impl IntoIterator<Item = [[f64; 2]; 2]>,
        colour: Colour,
        label: &str,
    ) -> Self {
        let pairs = pairs.into_iter().collect();
        self.layer(Layer::Segments {
            pairs,
            colour,
            arrows: false,
            label: label.into(),
        })
    }

    /// Adds a heat map and draws the panel like an image.
    #[must_use]
    pub(crate) fn heat_map(self, map: HeatMap) -> Self {
        self.layer(Layer::Heat(map)).image_axes()
    }

    /// Makes the panel a block of text lines instead of axes. A tab in a line starts the second column.
    #[must_use]
    pub(crate) fn text(mut self, lines: impl IntoIterator<Item = String>) -> Self {
        self.text.extend(lines);
        self
    }
}
