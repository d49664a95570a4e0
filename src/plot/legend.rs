//! The legend: a sample and a name for every labelled layer.
use super::draw::{Chart, Fail, rgb, style};
use super::layer::Layer;
use super::panel::{Legend, Panel};
use plotters::prelude::*;

pub(super) fn draw_legend<'c, 'a: 'c>(chart: &mut Chart<'c, 'a>, panel: &Panel) -> Result<(), Fail<'a>> {
    let mut any = false;
    for layer in &panel.layers {
        let (Layer::Points { colour, label, .. }
        | Layer::Line { colour, label, .. }
        | Layer::Segments { colour, label, .. }) = layer
        else {
            continue;
        };
        if label.is_empty() {
            continue;
        }
        any = true;
        let colour = rgb(*colour);
        let gap = if matches!(layer, Layer::Line { dashed: true, .. }) { 4 } else { 0 };
        let entry = chart.draw_series(std::iter::empty::<Circle<(f64, f64), i32>>())?.label(label.as_str());
        if matches!(layer, Layer::Points { .. }) {
            entry.legend(move |(x, y)| Circle::new((x + 9, y), 4, colour.filled()));
        } else {
            let piece = move |x0: i32, x1: i32| PathElement::new([(x0, 0), (x1, 0)], colour.stroke_width(2));
            entry.legend(move |at| EmptyElement::at(at) + piece(0, 9 - gap) + piece(9 + gap, 18));
        }
    }
    if !any {
        return Ok(());
    }
    let position = match panel.legend {
        Legend::UpperRight => SeriesLabelPosition::UpperRight,
        Legend::UpperLeft => SeriesLabelPosition::UpperLeft,
        Legend::LowerRight => SeriesLabelPosition::LowerRight,
        Legend::LowerLeft => SeriesLabelPosition::LowerLeft,
    };
    chart
        .configure_series_labels()
        .position(position)
        .margin(8)
        .legend_area_size(22)
        .label_font(style(13, BLACK))
        .background_style(WHITE.mix(0.85))
        .border_style(RGBColor(200, 200, 200))
        .draw()
}
