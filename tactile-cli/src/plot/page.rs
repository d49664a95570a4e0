//! Pages of panels in rows and columns, and the layers of a panel.
//!
//! A page is one self-contained SVG file with panels in rows and columns. A panel is a set of axes
//! with layers. Heat maps use perceptually uniform colours and have a colour bar. Lines and points
//! use the colours of Okabe and Ito.
use super::axis::{Axis, value_range};
use super::canvas::{Area, Drawn, FINE, axis_style, drawing, font, picture, stroke, text};
use crate::text::printable;
use ndarray::{Array2, ArrayView2};
use plotters::coord::types::RangedCoordf64;
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::colors::colormaps::ViridisRGB;
use plotters::style::text_anchor::HPos;
use std::error::Error;
use std::io::Cursor;
use std::ops::Range;
use tactile_imaging::pipeline::PipelineError;

/// The reason why a page could not be drawn.
#[derive(Debug, thiserror::Error)]
pub(crate) enum PlotError {
    /// A page could not be drawn.
    #[error("cannot draw the page `{title}`: {source}")]
    Draw {
        /// Title of the page.
        title: String,
        /// The error of the drawing library or of the PNG encoder.
        source: Box<dyn Error + Send + Sync>,
    },
    /// A result to be drawn could not be computed.
    #[error(transparent)]
    Measure(#[from] PipelineError),
}

/// A position in the units of the axes.
pub(super) type PlotPoint = [f64; 2];

/// Positions in any kind of list.
pub(crate) trait Places: IntoIterator<Item = PlotPoint> {}
impl<T: IntoIterator<Item = PlotPoint>> Places for T {}

/// Starts and ends in any kind of list.
pub(crate) trait Ends: IntoIterator<Item = [PlotPoint; 2]> {}
impl<T: IntoIterator<Item = [PlotPoint; 2]>> Ends for T {}

/// Colours that can be distinguished with any colour vision (Okabe and Ito 2008), and two neutral
/// ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Colour {
    Blue,
    Orange,
    Green,
    Red,
    Purple,
    Sky,
    Black,
    Grey,
}

impl Colour {
    /// The colour of the `k`-th of several similar items.
    pub(crate) fn category(k: usize) -> Self {
        let order = [Self::Blue, Self::Orange, Self::Green, Self::Red];
        [&order[..], &[Self::Purple, Self::Sky]].concat()[k % 6]
    }

    fn rgb(self) -> RGBColor {
        match self {
            Self::Blue => RGBColor(0, 114, 178),
            Self::Orange => RGBColor(230, 159, 0),
            Self::Green => RGBColor(0, 158, 115),
            Self::Red => RGBColor(213, 94, 0),
            Self::Purple => RGBColor(204, 121, 167),
            Self::Sky => RGBColor(86, 180, 233),
            Self::Black => RGBColor(0, 0, 0),
            Self::Grey => RGBColor(130, 130, 130),
        }
    }
}

/// Values on a regular grid, `[row, column]`. A cell without a finite value is light grey.
#[derive(Clone, Debug)]
pub(crate) struct HeatMap {
    values: Array2<f64>,
    /// Outer edges of the first and the last cell along x and y.
    edges: [[f64; 2]; 2],
    range: [f64; 2],
    /// Whether it is a camera frame, drawn from black to white.
    grey: bool,
    label: String,
}

impl HeatMap {
    /// A map with cells of `pixel_size` (x, y). The centre of the first cell is the origin. The
    /// label names the values with their unit.
    pub(crate) fn of_pixels(
        values: ArrayView2<'_, f64>,
        pixel_size: [f64; 2],
        label: &str,
    ) -> Self {
        let (rows, columns) = values.dim();
        let span = |n: usize, size: f64| [-0.5 * size, (n as f64 - 0.5) * size];
        Self {
            values: values.to_owned(),
            edges: [span(columns, pixel_size[0]), span(rows, pixel_size[1])],
            range: value_range(values.iter().copied()),
            grey: false,
            label: label.into(),
        }
    }

    /// An 8-bit frame in grey, black to white over the whole scale.
    pub(crate) fn of_frame(frame: ArrayView2<'_, u8>, pixel_size: [f64; 2]) -> Self {
        let values = frame.mapv(f64::from);
        Self {
            range: [0.0, 255.0],
            grey: true,
            ..Self::of_pixels(values.view(), pixel_size, "grey level")
        }
    }

    /// Puts the centre of the first cell at `origin` instead of (0, 0).
    pub(crate) fn origin(mut self, origin: PlotPoint) -> Self {
        for (edges, shift) in self.edges.iter_mut().zip(origin) {
            *edges = edges.map(|edge| edge + shift);
        }
        self
    }

    /// The map as a PNG of this size. A pixel is the mean of the finite cells that it covers.
    fn png(&self, size: [f64; 2], upwards: bool) -> Result<Vec<u8>, image::ImageError> {
        let [width, height] = size.map(|pixels| pixels.round().max(1.0) as u32);
        let (rows, columns) = self.values.dim();
        // At least one cell, even if the page has more pixels than the map has cells.
        let cells = |i: u32, pixels: u32, n: usize| -> Range<usize> {
            let edge = |i: u32| (f64::from(i) * n as f64 / f64::from(pixels)) as usize;
            let start = edge(i).min(n.saturating_sub(1));
            start..edge(i + 1).clamp(start + 1, n.max(start + 1))
        };
        let picture = image::RgbImage::from_fn(width, height, |x, y| {
            let y = if upwards { height - 1 - y } else { y };
            let columns = cells(x, width, columns);
            let cells = cells(y, height, rows).flat_map(|r| columns.clone().map(move |c| (r, c)));
            let finite = cells.map(|at| self.values[at]).filter(|v| v.is_finite());
            let (sum, count) = finite.fold((0.0, 0.0), |(sum, n), v| (sum + v, n + 1.0));
            let RGBColor(r, g, b) = shade(sum / count, self.range, self.grey);
            image::Rgb([r, g, b])
        });
        let mut bytes = Cursor::new(Vec::new());
        picture.write_to(&mut bytes, image::ImageFormat::Png)?;
        Ok(bytes.into_inner())
    }
}

/// The colour of a value in a range: viridis, or grey for frames.
fn shade(value: f64, [low, high]: [f64; 2], grey: bool) -> RGBColor {
    if value.is_nan() {
        return RGBColor(235, 235, 235);
    }
    let share = if high > low {
        ((value - low) / (high - low)).clamp(0.0, 1.0)
    } else {
        0.5
    };
    if grey {
        let level = (255.0 * share).round() as u8;
        RGBColor(level, level, level)
    } else {
        ViridisRGB.get_color(share)
    }
}

/// The shape of a layer.
#[derive(Clone, Debug)]
enum Marks {
    Discs(Vec<PlotPoint>),
    Rings(Vec<PlotPoint>),
    /// A position that is not finite breaks the line.
    Line(Vec<PlotPoint>),
    Dashes(Vec<PlotPoint>),
    Segments(Vec<[PlotPoint; 2]>),
    Arrows(Vec<[PlotPoint; 2]>),
    /// Points coloured by a value.
    Valued(Vec<PlotPoint>, Vec<f64>),
    Heat(HeatMap),
}

/// Marks of one colour. An empty label keeps them out of the legend.
#[derive(Clone, Debug)]
struct Layer {
    marks: Marks,
    colour: Colour,
    label: String,
}

/// One set of axes with its layers.
#[derive(Clone, Debug, Default)]
pub(crate) struct Panel {
    title: String,
    labels: [String; 2],
    layers: Vec<Layer>,
    equal_aspect: bool,
    y_down: bool,
    logarithmic: bool,
    text: Vec<String>,
}

impl Panel {
    /// A panel with the labels of its axes, which should state the units.
    pub(crate) fn new(
        title: impl Into<String>,
        x: impl Into<String>,
        y: impl Into<String>,
    ) -> Self {
        Self {
            title: title.into(),
            labels: [x.into(), y.into()],
            ..Self::default()
        }
    }

    /// A block of lines instead of axes. A tab in a line starts the second column.
    pub(crate) fn of_text(title: &str, lines: impl IntoIterator<Item = String>) -> Self {
        Self {
            text: lines.into_iter().collect(),
            ..Self::new(title, "", "")
        }
    }

    /// Gives both axes the same scale on the page.
    pub(crate) fn equal_aspect(mut self) -> Self {
        self.equal_aspect = true;
        self
    }

    /// Makes both axes logarithmic.
    pub(crate) fn logarithmic(mut self) -> Self {
        self.logarithmic = true;
        self
    }

    /// Adds discs.
    pub(crate) fn points(self, at: impl Places, colour: Colour, label: &str) -> Self {
        self.layer(Marks::Discs(at.into_iter().collect()), colour, label)
    }

    /// Adds open circles.
    pub(crate) fn rings(self, at: impl Places, colour: Colour, label: &str) -> Self {
        self.layer(Marks::Rings(at.into_iter().collect()), colour, label)
    }

    /// Adds a line.
    pub(crate) fn line(self, at: impl Places, colour: Colour, label: &str) -> Self {
        self.layer(Marks::Line(at.into_iter().collect()), colour, label)
    }

    /// Adds a dashed line.
    pub(crate) fn dashed(self, at: impl Places, colour: Colour, label: &str) -> Self {
        self.layer(Marks::Dashes(at.into_iter().collect()), colour, label)
    }

    /// Adds plain segments, such as error bars and the matches between two point sets.
    pub(crate) fn segments(self, ends: impl Ends, colour: Colour, label: &str) -> Self {
        self.layer(Marks::Segments(ends.into_iter().collect()), colour, label)
    }

    /// Adds arrows from the first to the second position of every pair.
    pub(crate) fn arrows(self, ends: impl Ends, colour: Colour, label: &str) -> Self {
        self.layer(Marks::Arrows(ends.into_iter().collect()), colour, label)
    }

    /// Adds points coloured by a value. The label of the colour bar names the values with their
    /// unit.
    pub(crate) fn valued_points(
        self,
        at: impl Places,
        values: impl IntoIterator<Item = f64>,
        label: &str,
    ) -> Self {
        let (at, values) = (at.into_iter().collect(), values.into_iter().collect());
        self.layer(Marks::Valued(at, values), Colour::Black, label)
    }

    /// Adds a heat map and draws the panel like an image: y downwards, both axes with the same
    /// scale.
    pub(crate) fn heat_map(mut self, map: HeatMap) -> Self {
        self.y_down = true;
        let label = map.label.clone();
        self.equal_aspect()
            .layer(Marks::Heat(map), Colour::Black, &label)
    }

    fn layer(mut self, marks: Marks, colour: Colour, label: &str) -> Self {
        let label = label.into();
        self.layers.push(Layer {
            marks,
            colour,
            label,
        });
        self
    }

    /// The axes, slightly wider than the data. Around heat maps they end exactly at the outer
    /// cells.
    fn axes(&self) -> [Axis; 2] {
        let heat = |layer: &Layer| matches!(layer.marks, Marks::Heat(_));
        let margin = if self.layers.iter().any(heat) {
            0.0
        } else {
            0.04
        };
        [0, 1].map(|k| {
            let places = self.layers.iter().flat_map(Layer::places);
            Axis::around(places.map(|at| at[k]), self.logarithmic, margin)
        })
    }
}

impl Layer {
    /// All positions that must lie inside the axes.
    fn places(&self) -> Vec<PlotPoint> {
        match &self.marks {
            Marks::Discs(at) | Marks::Rings(at) | Marks::Valued(at, _) => at.clone(),
            Marks::Line(at) | Marks::Dashes(at) => at.clone(),
            Marks::Segments(ends) | Marks::Arrows(ends) => ends.concat(),
            Marks::Heat(map) => {
                let [x, y] = map.edges;
                vec![[x[0], y[0]], [x[1], y[1]]]
            }
        }
    }

    /// The range of the colour bar that the layer needs, and whether the bar is grey.
    fn bar(&self) -> Option<([f64; 2], bool)> {
        match &self.marks {
            Marks::Heat(map) => Some((map.range, map.grey)),
            Marks::Valued(_, values) => Some((value_range(values.iter().copied()), false)),
            _ => None,
        }
    }
}

/// Panels in rows and columns under one title.
#[derive(Clone, Debug)]
pub(crate) struct Page {
    title: String,
    columns: usize,
    panels: Vec<Panel>,
}

impl Page {
    /// A page of this many columns. Panels fill its rows from left to right.
    pub(crate) fn new(title: impl Into<String>, columns: usize, panels: Vec<Panel>) -> Self {
        Self {
            title: title.into(),
            columns: columns.max(1),
            panels,
        }
    }

    /// The page as the text of an SVG file.
    pub(crate) fn to_svg(&self) -> Result<String, PlotError> {
        self.draw().map_err(|source| PlotError::Draw {
            title: self.title.clone(),
            source,
        })
    }

    fn draw(&self) -> Drawn<String> {
        let [width, height, head] = [560, 420, 44];
        let rows = self.panels.len().div_ceil(self.columns).max(1) as i32;
        let size = [width * self.columns as i32, head + height * rows];
        let mut svg = format!(
            r#"<svg width="{0}" height="{1}" viewBox="0 0 {0} {1}" xmlns="http://www.w3.org/2000/svg">
<rect width="{0}" height="{1}" fill="white"/>
"#,
            size[0], size[1]
        );
        // Every part is a separate element, so that a panel can be drawn independently of the page.
        svg += &drawing([0, 0], [size[0], head], |area| {
            text(area, &self.title, [size[0] / 2, head / 2], 20, HPos::Center)
        })?;
        for (k, panel) in self.panels.iter().enumerate() {
            let (row, column) = ((k / self.columns) as i32, (k % self.columns) as i32);
            svg += &panel.draw([width * column, head + height * row], [width, height])?;
        }
        Ok(svg + "</svg>\n")
    }
}

/// The box of the axes in a panel of this size, in pixels of the page.
struct Layout {
    size: [i32; 2],
    start: [i32; 2],
    inner: [i32; 2],
}

impl Layout {
    /// Room for the labels of the axes.
    const LABELS: [i32; 2] = [70, 42];

    fn new(panel: &Panel, axes: &[Axis; 2], size: [i32; 2], legend_rows: i32) -> Self {
        // Title, legend and the name of the colour bar stand above the axes, so that they never
        // cover data.
        let has_bar = panel.bar().is_some();
        let rows = legend_rows.max(i32::from(has_bar));
        let [left, top] = [Self::LABELS[0] + 10, 34 + 20 * rows];
        let right = if has_bar { 104 } else { 18 };
        let bottom = Self::LABELS[1] + 6;
        let available = [size[0] - left - right, size[1] - top - bottom];
        let mut inner = available;
        if panel.equal_aspect {
            let data = [0, 1].map(|k| axes[k].length());
            let scales = [0, 1].map(|k| f64::from(available[k]) / data[k]);
            let scale = scales[0].min(scales[1]);
            inner = data.map(|d| (d * scale).round().max(8.0) as i32);
        }
        let start = [0, 1].map(|k| [left, top][k] + (available[k] - inner[k]) / 2);
        Self { size, start, inner }
    }

    /// A chart with its labels in this part of the panel.
    fn chart<'a, 'b>(
        &self,
        area: &'a Area<'b>,
        at: [i32; 2],
        extent: [i32; 2],
    ) -> ChartBuilder<'a, 'a, SVGBackend<'b>> {
        let mut builder = ChartBuilder::on(area);
        let end = [0, 1].map(|k| self.size[k] - at[k] - extent[k]);
        builder
            .margin_left(FINE * at[0])
            .margin_right(FINE * end[0]);
        builder
            .margin_top(FINE * at[1])
            .margin_bottom(FINE * end[1]);
        builder
    }

    /// The corner of the colour bar, which is 14 pixels wide.
    fn bar(&self) -> [i32; 2] {
        [self.start[0] + self.inner[0] + 12, self.start[1]]
    }
}

impl Panel {
    /// The layer that has a colour bar, the range of the bar, and whether it is grey.
    fn bar(&self) -> Option<(&Layer, [f64; 2], bool)> {
        let with_bar = |layer| Layer::bar(layer).map(|(range, grey)| (layer, range, grey));
        self.layers.iter().find_map(with_bar)
    }

    /// Draws the panel in the area with this corner and size, in pixels of the page.
    fn draw(&self, corner: [i32; 2], size: [i32; 2]) -> Drawn<String> {
        if !self.text.is_empty() {
            return drawing(corner, size, |area| self.draw_text(area, size));
        }
        let axes = self.axes();
        let legend = self.legend(size[0]);
        let rows = legend.last().map_or(0, |entry| 1 + entry.row);
        let layout = Layout::new(self, &axes, size, rows);
        let pictures = self.pictures(&axes, &layout, corner)?;
        let lines = drawing(corner, size, |area| {
            text(area, &self.title, [size[0] / 2, 17], 16, HPos::Center)?;
            for entry in &legend {
                entry.draw(area, Layout::LABELS[0] + 10)?;
            }
            self.draw_layers(area, &axes, &layout)?;
            self.draw_bar(area, &layout)
        })?;
        // Pictures come first: axes and marks are drawn over them.
        Ok(pictures + &lines)
    }

    /// Draws heat maps and the colours of the bar.
    fn pictures(&self, axes: &[Axis; 2], layout: &Layout, corner: [i32; 2]) -> Drawn<String> {
        let mut svg = String::new();
        let on_page = |at: [i32; 2]| [0, 1].map(|k| f64::from(corner[k] + at[k]));
        let [start, inner] = [on_page(layout.start), layout.inner.map(f64::from)];
        for layer in &self.layers {
            if let Marks::Heat(map) = &layer.marks {
                let [low, high] =
                    [0, 1].map(|end| [0, 1].map(|k| axes[k].share(map.edges[k][end])));
                let at = [0, 1].map(|k| start[k] + low[k] * inner[k]);
                let extent = [0, 1].map(|k| (high[k] - low[k]) * inner[k]);
                svg += &picture(at, extent, &map.png(extent, false)?);
            }
        }
        if let Some((_, _, grey)) = self.bar() {
            let steps = Array2::from_shape_fn((64, 1), |(i, _)| i as f64);
            let map = HeatMap {
                grey,
                ..HeatMap::of_pixels(steps.view(), [1.0; 2], "")
            };
            let extent = [14.0, inner[1]];
            svg += &picture(on_page(layout.bar()), extent, &map.png(extent, true)?);
        }
        Ok(svg)
    }

    /// Draws the axes and all layers except heat maps.
    fn draw_layers(&self, area: &Area<'_>, axes: &[Axis; 2], layout: &Layout) -> Drawn<()> {
        let (start, inner, labels) = (layout.start, layout.inner, Layout::LABELS);
        let at = [start[0] - labels[0], start[1]];
        let extent = [inner[0] + labels[0], inner[1] + labels[1]];
        let [x, y] = axes.clone();
        let y = if self.y_down { y.downwards() } else { y };
        let mut chart = layout
            .chart(area, at, extent)
            .x_label_area_size(FINE * labels[1])
            .y_label_area_size(FINE * labels[0])
            .build_cartesian_2d(x, y)?;
        // Grid lines over a heat map would be mistaken for values.
        let grid = match self.bar() {
            Some(_) => TRANSPARENT.into(),
            None => stroke(RGBColor(228, 228, 228), 1),
        };
        // A number needs some 64 pixels along x and 44 along y.
        let ticks = [inner[0] / 64, inner[1] / 44].map(|n| n.clamp(2, 9) as usize);
        chart
            .configure_mesh()
            .x_labels(ticks[0])
            .y_labels(ticks[1])
            .x_desc(printable(&self.labels[0]))
            .y_desc(printable(&self.labels[1]))
            .axis_desc_style(font(14))
            .label_style(font(13))
            .set_all_tick_mark_size(FINE * 5)
            .axis_style(axis_style())
            .bold_line_style(grid)
            .light_line_style(TRANSPARENT)
            .draw()?;
        let place = |at: PlotPoint| {
            let finite = [0, 1].iter().all(|&k| axes[k].share(at[k]).is_finite());
            finite.then(|| chart.backend_coord(&(at[0], at[1])))
        };
        self.layers
            .iter()
            .try_for_each(|layer| layer.draw(area, &place))
    }

    /// Draws ticks and name of the colour bar.
    fn draw_bar(&self, area: &Area<'_>, layout: &Layout) -> Drawn<()> {
        let Some((layer, range, _)) = self.bar() else {
            return Ok(());
        };
        let at = layout.bar();
        let room = layout.size[0] - at[0] - 4;
        let name_at = [layout.size[0] - 8, at[1] - 12];
        text(area, &layer.label, name_at, 13, HPos::Right)?;
        let across: RangedCoordf64 = (0.0..1.0).into();
        layout
            .chart(area, at, [room, layout.inner[1]])
            .right_y_label_area_size(FINE * (room - 14))
            .build_cartesian_2d(across, Axis::around(range.into_iter(), false, 0.0))?
            .configure_mesh()
            .disable_mesh()
            .disable_x_axis()
            .y_labels((layout.inner[1] / 50).clamp(2, 6) as usize)
            .label_style(font(12))
            .set_all_tick_mark_size(FINE * 4)
            .axis_style(axis_style())
            .draw()?;
        Ok(())
    }

    fn draw_text(&self, area: &Area<'_>, size: [i32; 2]) -> Drawn<()> {
        text(area, &self.title, [size[0] / 2, 17], 16, HPos::Center)?;
        for (line, words) in self.text.iter().enumerate() {
            let y = 48 + 21 * line as i32;
            for (part, x) in words.splitn(2, '\t').zip([20, 20 + size[0] / 3]) {
                text(area, part, [x, y], 13, HPos::Left)?;
            }
        }
        Ok(())
    }

    /// The entries of the legend, in as many rows as their labels need.
    fn legend<'a>(&'a self, width: i32) -> Vec<Entry<'a>> {
        let (mut row, mut x) = (0, 0);
        let named = |layer: &&Layer| !layer.label.is_empty() && layer.bar().is_none();
        let entry = |layer: &'a Layer| {
            let Layer { label, .. } = layer;
            // A letter is about half as wide as high.
            let length = 40 + 7 * label.chars().count() as i32;
            if x > 0 && x + length > width - 106 {
                (row, x) = (row + 1, 0);
            }
            let entry = Entry { layer, row, x };
            x += length;
            entry
        };
        self.layers.iter().filter(named).map(entry).collect()
    }
}

/// A sample and the name of a layer, `x` pixels from the left edge of the axes.
struct Entry<'a> {
    layer: &'a Layer,
    row: i32,
    x: i32,
}

impl Entry<'_> {
    fn draw(&self, area: &Area<'_>, left: i32) -> Drawn<()> {
        let [x, y] = [left + self.x, 42 + 20 * self.row];
        let colour = self.layer.colour.rgb();
        let middle = (FINE * (x + 9), FINE * y);
        let ends = vec![(FINE * x, FINE * y), (FINE * (x + 18), FINE * y)];
        match &self.layer.marks {
            Marks::Discs(_) => area.draw(&Circle::new(middle, FINE * 4, colour.filled()))?,
            Marks::Rings(_) => area.draw(&Circle::new(middle, FINE * 4, stroke(colour, 1)))?,
            Marks::Dashes(_) => dashes(area, &ends, colour)?,
            _ => area.draw(&PathElement::new(ends, stroke(colour, 2)))?,
        }
        text(area, &self.layer.label, [x + 24, y], 13, HPos::Left)
    }
}

type Pixel = (i32, i32);

fn dashes(area: &Area<'_>, at: &[Pixel], colour: RGBColor) -> Drawn<()> {
    let style = stroke(colour, 2);
    let points = at.iter().copied();
    area.draw(&DashedPathElement::new(points, FINE * 6, FINE * 4, style))?;
    Ok(())
}

impl Layer {
    /// Draws all marks except a heat map. `place` maps a position to the page, if it is finite on
    /// the axes.
    fn draw(&self, area: &Area<'_>, place: &dyn Fn(PlotPoint) -> Option<Pixel>) -> Drawn<()> {
        let colour = self.colour.rgb();
        let circles = |at: &[PlotPoint], radius: i32, style: ShapeStyle| -> Drawn<()> {
            for pixel in at.iter().filter_map(|&at| place(at)) {
                area.draw(&Circle::new(pixel, FINE * radius, style))?;
            }
            Ok(())
        };
        match &self.marks {
            Marks::Heat(_) => {}
            Marks::Discs(at) => circles(at, 3, colour.filled())?,
            Marks::Rings(at) => circles(at, 3, stroke(colour, 1))?,
            Marks::Valued(at, values) => {
                let range = value_range(values.iter().copied());
                for (&at, value) in at.iter().zip(values) {
                    circles(&[at], 4, shade(*value, range, false).filled())?;
                }
            }
            Marks::Line(at) | Marks::Dashes(at) => {
                let pixels: Vec<Option<Pixel>> = at.iter().map(|&at| place(at)).collect();
                for piece in pixels.split(Option::is_none) {
                    let piece: Vec<Pixel> = piece.iter().flatten().copied().collect();
                    if let Marks::Dashes(_) = self.marks {
                        dashes(area, &piece, colour)?;
                    } else {
                        area.draw(&PathElement::new(piece, stroke(colour, 2)))?;
                    }
                }
            }
            Marks::Segments(ends) | Marks::Arrows(ends) => {
                for ends in ends {
                    let [Some(from), Some(to)] = ends.map(place) else {
                        continue;
                    };
                    area.draw(&PathElement::new(vec![from, to], stroke(colour, 1)))?;
                    if let Marks::Arrows(_) = self.marks {
                        area.draw(&Polygon::new(head(from, to), colour.filled()))?;
                    }
                }
            }
        }
        Ok(())
    }
}

/// The head of an arrow: six pixels long, shorter on a short arrow.
fn head(from: Pixel, to: Pixel) -> Vec<Pixel> {
    let step = [to.0 - from.0, to.1 - from.1].map(f64::from);
    let length = step[0].hypot(step[1]).max(1.0);
    let [u, v] = step.map(|s| s / length * f64::from(6 * FINE).min(0.6 * length));
    let corner = |side: f64| {
        let back = [u + side * v, v - side * u].map(|b| b.round() as i32);
        (to.0 - back[0], to.1 - back[1])
    };
    vec![corner(0.45), to, corner(-0.45)]
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
