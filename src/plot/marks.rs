//! Drawing the layers that are points, lines and segments.
use super::draw::{Chart, Fail, rgb};
use super::layer::{Layer, Marker, range_of};
use super::panel::Panel;
use plotters::prelude::*;

pub(super) fn draw_layer<'a>(
    chart: &mut Chart<'_, 'a>,
    panel: &Panel,
    layer: &Layer,
) -> Result<(), Fail<'a>> {
    let at = |p: [f64; 2]| (panel.scales[0].forward(p[0]), panel.scales[1].forward(p[1]));
    let finite = |p: &(f64, f64)| p.0.is_finite() && p.1.is_finite();
    match layer {
        Layer::Heat(_) => Ok(()),
        Layer::Points { points, colour, marker, radius, .. } => {
            let positions: Vec<_> = points.iter().map(|&p| at(p)).filter(finite).collect();
            draw_markers(chart, &positions, *marker, *radius, rgb(*colour))
        }
        Layer::ColouredPoints { points, values, map, radius, .. } => {
            let [lo, hi] = range_of(values.iter());
            let discs = points.iter().zip(values).map(|(&p, v)| (at(p), (v - lo) / (hi - lo).max(1e-300)));
            let discs = discs.filter(|(p, _)| finite(p));
            let disc = |(p, t): (_, f64)| Circle::new(p, *radius as i32, rgb(map.at(t)).filled());
            chart.draw_series(discs.map(disc)).map(drop)
        }
        Layer::Line { points, colour, dashed, .. } => {
            let positions: Vec<_> = points.iter().map(|&p| at(p)).collect();
            let pieces = positions.split(|p| !finite(p)).filter(|piece| piece.len() > 1);
            pieces.into_iter().try_for_each(|piece| {
                let stroke = rgb(*colour).stroke_width(2);
                if *dashed {
                    chart.draw_series(DashedLineSeries::new(piece.iter().copied(), 6, 4, stroke)).map(drop)
                } else {
                    chart.draw_series(LineSeries::new(piece.iter().copied(), stroke)).map(drop)
                }
            })
        }
        Layer::ErrorBars { points, errors, colour } => {
            let bars = points.iter().zip(errors).map(|(&[x, y], e)| [[x, y - e], [x, y], [x, y + e]].map(at));
            let bars = bars.filter(|b| b.iter().all(finite));
            let stroke = rgb(*colour).stroke_width(1);
            let bar =
                |[lo, mid, hi]: [(f64, f64); 3]| ErrorBar::new_vertical(mid.0, lo.1, mid.1, hi.1, stroke, 6);
            chart.draw_series(bars.map(bar)).map(drop)
        }
        Layer::Segments { pairs, colour, arrows, .. } => {
            let ends = pairs.iter().map(|pair| pair.map(at)).filter(|p| p.iter().all(finite));
            let ends: Vec<_> = ends.collect();
            draw_segments(chart, &ends, rgb(*colour), *arrows)
        }
    }
}

fn draw_markers<'a>(
    chart: &mut Chart<'_, 'a>,
    positions: &[(f64, f64)],
    marker: Marker,
    radius: f64,
    colour: RGBColor,
) -> Result<(), Fail<'a>> {
    let positions = positions.iter().copied();
    match marker {
        Marker::Disc => {
            chart.draw_series(positions.map(|p| Circle::new(p, radius, colour.filled()))).map(drop)
        }
        Marker::Ring => {
            chart.draw_series(positions.map(|p| Circle::new(p, radius, colour.stroke_width(1)))).map(drop)
        }
        Marker::Cross => {
            chart.draw_series(positions.map(|p| Cross::new(p, radius, colour.stroke_width(1)))).map(drop)
        }
    }
}

/// Segments, with heads of 6 pixels where they are arrows.
fn draw_segments<'a>(
    chart: &mut Chart<'_, 'a>,
    ends: &[[(f64, f64); 2]],
    colour: RGBColor,
    arrows: bool,
) -> Result<(), Fail<'a>> {
    for [from, to] in ends {
        chart.draw_series([PathElement::new(vec![*from, *to], colour.stroke_width(1))])?;
        let [a, b] = [from, to].map(|p| chart.backend_coord(p));
        let step = [f64::from(b.0 - a.0), f64::from(b.1 - a.1)];
        let length = step[0].hypot(step[1]);
        if arrows && length >= 2.0 {
            let [u, v] = step.map(|s| s / length * 6.0f64.min(0.6 * length));
            let wings = [(-u - 0.45 * v, -v + 0.45 * u), (0.0, 0.0), (-u + 0.45 * v, -v - 0.45 * u)];
            let wings = wings.map(|(x, y)| (x.round() as i32, y.round() as i32));
            let head = EmptyElement::at(*to) + Polygon::new(wings.to_vec(), colour.filled());
            chart.draw_series([head])?;
        }
    }
    Ok(())
}
