//! The legend: a sample and a name for every labelled layer, in the corner where it hides the least.
use super::draw::{Chart, Fail, rgb, style};
use super::layer::Layer;
use super::panel::Panel;
use plotters::prelude::*;

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

/// Room around the legend, for a sample, for a letter and for a line, in pixels.
const MARGIN: i32 = 8;
const SAMPLE: i32 = 22;
const LETTER: i32 = 8;
const LINE: i32 = 18;

pub(super) fn draw_legend<'c, 'a: 'c>(
    chart: &mut Chart<'c, 'a>,
    panel: &Panel,
) -> Result<(), Fail<'a>> {
    let labels: Vec<_> = panel.layers.iter().filter_map(label_of).collect();
    if labels.is_empty() {
        return Ok(());
    }
    for layer in panel
        .layers
        .iter()
        .filter(|layer| label_of(layer).is_some())
    {
        draw_entry(chart, layer)?;
    }
    let longest = labels.iter().map(|l| l.chars().count()).max().unwrap_or(0) as i32;
    let size = [
        2 * MARGIN + SAMPLE + LETTER * longest,
        MARGIN + LINE * labels.len() as i32,
    ];
    let position = match panel.legend {
        Legend::Emptiest => emptiest(chart, panel, size),
        Legend::UpperRight => SeriesLabelPosition::UpperRight,
        Legend::UpperLeft => SeriesLabelPosition::UpperLeft,
        Legend::LowerRight => SeriesLabelPosition::LowerRight,
        Legend::LowerLeft => SeriesLabelPosition::LowerLeft,
    };
    chart
        .configure_series_labels()
        .position(position)
        .margin(MARGIN)
        .legend_area_size(SAMPLE)
        .label_font(style(13, BLACK))
        .background_style(WHITE.mix(0.85))
        .border_style(RGBColor(200, 200, 200))
        .draw()
}

/// The name a layer has in the legend.
fn label_of(layer: &Layer) -> Option<&str> {
    match layer {
        Layer::Points { label, .. } | Layer::Line { label, .. } | Layer::Segments { label, .. } => {
            (!label.is_empty()).then_some(label)
        }
        _ => None,
    }
}

fn draw_entry<'c, 'a: 'c>(chart: &mut Chart<'c, 'a>, layer: &Layer) -> Result<(), Fail<'a>> {
    let (Layer::Points { colour, label, .. }
    | Layer::Line { colour, label, .. }
    | Layer::Segments { colour, label, .. }) = layer
    else {
        return Ok(());
    };
    let colour = rgb(*colour);
    let gap = if matches!(layer, Layer::Line { dashed: true, .. }) {
        4
    } else {
        0
    };
    let entry = chart
        .draw_series(std::iter::empty::<Circle<(f64, f64), i32>>())?
        .label(label.as_str());
    if matches!(layer, Layer::Points { .. }) {
        entry.legend(move |(x, y)| Circle::new((x + 9, y), 4, colour.filled()));
    } else {
        let piece =
            move |x0: i32, x1: i32| PathElement::new([(x0, 0), (x1, 0)], colour.stroke_width(2));
        entry.legend(move |at| EmptyElement::at(at) + piece(0, 9 - gap) + piece(9 + gap, 18));
    }
    Ok(())
}

/// The corner whose box of the legend's size covers the fewest marks; the upper right one where several do.
fn emptiest(chart: &Chart<'_, '_>, panel: &Panel, size: [i32; 2]) -> SeriesLabelPosition {
    let (across, down) = chart.plotting_area().get_pixel_range();
    let marks = marks(chart, panel);
    let near = |value: i32, edge: i32, room: i32| (value - edge).abs() <= room + 2 * MARGIN;
    let hidden = |right: bool, lower: bool| {
        let corner = (
            if right { across.end } else { across.start },
            if lower { down.end } else { down.start },
        );
        marks
            .iter()
            .filter(|m| near(m.0, corner.0, size[0]) && near(m.1, corner.1, size[1]))
            .count()
    };
    let corners = [
        (SeriesLabelPosition::UpperRight, hidden(true, false)),
        (SeriesLabelPosition::UpperLeft, hidden(false, false)),
        (SeriesLabelPosition::LowerRight, hidden(true, true)),
        (SeriesLabelPosition::LowerLeft, hidden(false, true)),
    ];
    let least = corners.into_iter().min_by_key(|(_, count)| *count);
    least.map_or(SeriesLabelPosition::UpperRight, |(corner, _)| corner)
}

/// Where ink is, in pixels: points, and every stretch of a line at sixteen places.
fn marks(chart: &Chart<'_, '_>, panel: &Panel) -> Vec<(i32, i32)> {
    let mut marks = Vec::new();
    let mut put = |p: [f64; 2]| {
        let (x, y) = (panel.scales[0].forward(p[0]), panel.scales[1].forward(p[1]));
        if x.is_finite() && y.is_finite() {
            marks.push(chart.backend_coord(&(x, y)));
        }
    };
    let along = |a: [f64; 2], b: [f64; 2], t: f64| [0, 1].map(|k| a[k] + t * (b[k] - a[k]));
    for layer in &panel.layers {
        match layer {
            Layer::Heat(_) => {}
            Layer::Line { points, .. } => points.windows(2).for_each(|pair| {
                (0..=16).for_each(|i| put(along(pair[0], pair[1], f64::from(i) / 16.0)));
            }),
            layer => layer.visit(&mut put),
        }
    }
    marks
}
