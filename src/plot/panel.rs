//! A panel: axes with layers in them, described as data.
use super::colour::{ColorMap, Colour};
use super::heat::HeatMap;
use super::layer::{Layer, Marker};
use super::legend::Legend;
use super::scale::Scale;

/// One set of axes and what is drawn in it.
///
/// ```
/// use tactile_imaging::plot::{Colour, Marker, Page, Panel};
/// let (loads, radii) = ([0.2, 0.7, 1.2], [2.1, 3.3, 3.9]);
/// let at = || loads.into_iter().zip(radii).map(|(f, a)| [f, a]);
/// let law = (0..=20).map(|i| 0.07 * f64::from(i)).map(|f: f64| [f, 3.7 * f.cbrt()]);
/// let panel = Panel::new("Contact radius against force")
///     .x_label("force (N)")
///     .y_label("contact radius (mm)")
///     .dashed(law, Colour::GREY, "a ∝ F^(1/3)")
///     .error_bars(at(), [0.1; 3], Colour::BLUE)
///     .points(at(), Colour::BLUE, "measured")
///     .marked([[1.0, 3.0]], Marker::Cross, Colour::RED, "left out");
/// let svg = Page::new("").panel(panel).to_svg()?;
/// assert!(svg.contains("contact radius (mm)") && svg.contains("left out"));
/// # Ok::<(), tactile_imaging::plot::PlotError>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Panel {
    pub(super) title: String,
    pub(super) x_label: String,
    pub(super) y_label: String,
    pub(super) layers: Vec<Layer>,
    pub(super) equal_aspect: bool,
    pub(super) y_down: bool,
    pub(super) scales: [Scale; 2],
    pub(super) x_range: Option<[f64; 2]>,
    pub(super) y_range: Option<[f64; 2]>,
    pub(super) text: Vec<String>,
    pub(super) legend: Legend,
}

impl Panel {
    /// An empty panel.
    pub fn new(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            ..Self::default()
        }
    }

    /// Names the x axis; write the unit into it.
    #[must_use]
    pub fn x_label(mut self, label: impl Into<String>) -> Self {
        self.x_label = label.into();
        self
    }

    /// Names the y axis; write the unit into it.
    #[must_use]
    pub fn y_label(mut self, label: impl Into<String>) -> Self {
        self.y_label = label.into();
        self
    }

    /// Gives both axes the same scale on the page.
    ///
    /// ```
    /// use tactile_imaging::plot::{Colour, HeatMap, Page, Panel};
    /// let panel = Panel::new("").arrows([[[0.0, 0.0], [9.0, 1.0]]], Colour::BLUE, "displacement");
    /// let svg = |panel: Panel| Page::new("").panel(panel).to_svg();
    /// assert_ne!(svg(panel.clone())?, svg(panel.clone().equal_aspect())?);
    /// // Over a frame the y axis points down as well; a heat map sees to it.
    /// let frame = HeatMap::of_frame(ndarray::array![[10, 20], [30, 40]].view(), [5.0, 5.0]);
    /// let over = Panel::new("").heat_map(frame).arrows([[[0.0, 0.0], [5.0, 1.0]]], Colour::RED, "");
    /// assert_eq!(svg(over.clone())?, svg(over.image_axes())?);
    /// # Ok::<(), tactile_imaging::plot::PlotError>(())
    /// ```
    #[must_use]
    pub fn equal_aspect(mut self) -> Self {
        self.equal_aspect = true;
        self
    }

    /// Draws like an image: y downwards, both axes with the same scale.
    #[must_use]
    pub fn image_axes(mut self) -> Self {
        self.y_down = true;
        self.equal_aspect()
    }

    /// Moves the legend.
    ///
    /// ```
    /// use tactile_imaging::plot::{Colour, Legend, Page, Panel};
    /// let panel = Panel::new("").line([[0.0, 2.0], [1.0, 1.0]], Colour::BLUE, "falling");
    /// let svg = |panel: Panel| Page::new("").panel(panel).to_svg();
    /// let placed = svg(panel.clone().legend(Legend::LowerLeft))?;
    /// assert_ne!(placed, svg(panel)?, "left to itself it stands at the upper right");
    /// # Ok::<(), tactile_imaging::plot::PlotError>(())
    /// ```
    #[must_use]
    pub fn legend(mut self, legend: Legend) -> Self {
        self.legend = legend;
        self
    }

    /// Sets how the axes count.
    ///
    /// ```
    /// use tactile_imaging::plot::{Colour, Page, Panel, Scale};
    /// let times = [[1e2, 2e-3], [1e3, 0.3], [1e4, 40.0]]; // points, seconds
    /// let panel = Panel::new("").scales(Scale::Log10, Scale::Log10).points(times, Colour::BLUE, "");
    /// let svg = Page::new("").panel(panel.points([[0.0, 1.0]], Colour::RED, "")).to_svg()?;
    /// assert_eq!(svg.matches("<circle").count(), 3, "zero has no logarithm");
    /// # Ok::<(), tactile_imaging::plot::PlotError>(())
    /// ```
    #[must_use]
    pub fn scales(mut self, x: Scale, y: Scale) -> Self {
        self.scales = [x, y];
        self
    }

    /// Sets the range of the x axis.
    ///
    /// ```
    /// use tactile_imaging::plot::{Colour, Page, Panel};
    /// let panel = Panel::new("").line([[0.1, 0.2], [0.4, 0.8]], Colour::BLUE, "");
    /// let svg = |panel: Panel| Page::new("").panel(panel).to_svg();
    /// assert!(!svg(panel.clone())?.contains("120"));
    /// assert!(svg(panel.x_range([0.0, 120.0]).y_range([0.0, 1.0]))?.contains("120"));
    /// # Ok::<(), tactile_imaging::plot::PlotError>(())
    /// ```
    #[must_use]
    pub fn x_range(mut self, range: [f64; 2]) -> Self {
        self.x_range = Some(range);
        self
    }

    /// Sets the range of the y axis.
    #[must_use]
    pub fn y_range(mut self, range: [f64; 2]) -> Self {
        self.y_range = Some(range);
        self
    }

    /// Adds any layer.
    ///
    /// ```
    /// use tactile_imaging::plot::{ColorMap, Layer, Page, Panel};
    /// let layer = Layer::ColouredPoints {
    ///     points: vec![[0.0, 0.0], [1.0, 1.0]],
    ///     values: vec![-0.02, 0.02],
    ///     map: ColorMap::Diverging, // what `coloured_points` does not offer
    ///     radius: 5.0,
    ///     label: "strain e_zz".into(),
    /// };
    /// let svg = Page::new("").panel(Panel::new("").layer(layer)).to_svg()?;
    /// assert!(svg.contains("#2166AC") && svg.contains("#B2182B"));
    /// # Ok::<(), tactile_imaging::plot::PlotError>(())
    /// ```
    #[must_use]
    pub fn layer(mut self, layer: Layer) -> Self {
        self.layers.push(layer);
        self
    }

    /// Adds discs.
    #[must_use]
    pub fn points(
        self,
        points: impl IntoIterator<Item = [f64; 2]>,
        colour: Colour,
        label: &str,
    ) -> Self {
        self.marked(points, Marker::Disc, colour, label)
    }

    /// Adds points of a given shape.
    #[must_use]
    pub fn marked(
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
    ///
    /// ```
    /// use tactile_imaging::plot::{Page, Panel};
    /// let (points, rise) = ([[0.0, 0.0], [1.0, 0.5], [2.0, 0.0]], [0.0, 12.0, 40.0]);
    /// let panel = Panel::new("Along z").coloured_points(points, rise, "displacement (µm)");
    /// let svg = Page::new("").panel(panel).to_svg()?;
    /// assert!(svg.contains("#440154") && svg.contains("#FDE725"), "both ends of viridis");
    /// assert!(svg.contains("displacement (µm)"), "the colour bar's label");
    /// # Ok::<(), tactile_imaging::plot::PlotError>(())
    /// ```
    #[must_use]
    pub fn coloured_points(
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
    pub fn line(
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
    pub fn dashed(
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
    pub fn error_bars(
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
    pub fn arrows(
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
    ///
    /// ```
    /// use tactile_imaging::plot::{Colour, Page, Panel};
    /// let pairs = [[[0.0, 0.0], [1.0, 0.2]], [[0.0, 1.0], [1.0, 1.2]]];
    /// let svg = |panel: Panel| Page::new("").panel(panel).to_svg();
    /// let heads = |text: String| text.matches("<polygon").count();
    /// let plain = heads(svg(Panel::new("").segments(pairs, Colour::GREY, "match"))?);
    /// let arrows = heads(svg(Panel::new("").arrows(pairs, Colour::GREY, "match"))?);
    /// assert_eq!(arrows, plain + 2);
    /// # Ok::<(), tactile_imaging::plot::PlotError>(())
    /// ```
    #[must_use]
    pub fn segments(
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
    pub fn heat_map(self, map: HeatMap) -> Self {
        self.layer(Layer::Heat(map)).image_axes()
    }

    /// Makes the panel a block of text lines instead of axes. A tab in a line starts the second column.
    ///
    /// ```
    /// use tactile_imaging::plot::{Page, Panel};
    /// let panel = Panel::new("Results").text(["Young's modulus\t103 ± 4 kPa".to_owned()]);
    /// let svg = Page::new("").panel(panel).to_svg()?;
    /// assert!(svg.contains("103 ± 4 kPa") && !svg.contains('\t'));
    /// # Ok::<(), tactile_imaging::plot::PlotError>(())
    /// ```
    #[must_use]
    pub fn text(mut self, lines: impl IntoIterator<Item = String>) -> Self {
        self.text.extend(lines);
        self
    }
}
