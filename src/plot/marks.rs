//! Drawing the layers that are points, lines and segments.
use super::colour::ColorMap;
use super::draw::{Chart, Fail, rgb};
use super::layer::{Layer, Marker, range_of};
use super::panel::Panel;
use plotters::prelude::*;

pub(super) fn draw_layer<'a>(
    chart: &mut Chart<'_, 'a>,
    panel: &Panel,
    layer: &Layer,
) -> Result<(), Fail<'a>> {
    let at = on_scales(panel);
    match layer {
        Layer::Heat(_) => Ok(()),
        Layer::Points {
            points,
            colour,
            marker,
            radius,
            ..
        } => {
            let positions: Vec<_> = points.iter().map(|&p| at(p)).filter(finite).collect();
            draw_markers(chart, &positions, *marker, *radius, rgb(*colour))
        }
        Layer::ColouredPoints {
            points,
            values,
            map,
            radius,
            ..
        } => draw_coloured(chart, panel, points, values, *map, *radius),
        Layer::Line {
            points,
            colour,
            dashed,
            ..
        } => draw_line(chart, panel, points, rgb(*colour), *dashed),
        Layer::ErrorBars {
            points,
            errors,
            colour,
        } => draw_error_bars(chart, panel, points, errors, rgb(*colour)),
        Layer::Segments {
            pairs,
            colour,
            arrows,
            ..
        } => {
            let ends = pairs
                .iter()
                .map(|pair| pair.map(&at))
                .filter(|p| p.iter().all(finite));
            let ends: Vec<_> = ends.collect();
            draw_segments(chart, &ends, rgb(*colour), *arrows)
        }
    }
}

/// Where a position stands on the panel's axes.
fn on_scales(panel: &Panel) -> impl Fn([f64; 2]) -> (f64, f64) + use<> {
    let [x, y] = panel.scales;
    move |p| (x.forward(p[0]), y.forward(p[1]))
}

fn finite(p: &(f64, f64)) -> bool {
    p.0.is_finite() && p.1.is_finite()
}

fn draw_coloured<'a>(
    chart: &mut Chart<'_, 'a>,
    panel: &Panel,
    points: &[[f64; 2]],
    values: &[f64],
    map: ColorMap,
    radius: f64,
) -> Result<(), Fail<'a>> {
    let [lo, hi] = range_of(values.iter());
    let at = on_scales(panel);
    let discs = points
        .iter()
        .zip(values)
        .map(|(&p, v)| (at(p), (v - lo) / (hi - lo).max(1e-300)));
    let discs = discs.filter(|(p, _)| finite(p));
    let disc = |(p, t): (_, f64)| Circle::new(p, radius as i32, rgb(map.at(t)).filled());
    chart.draw_series(discs.map(disc)).map(drop)
}

/// A line, broken where a position is not finite.
fn draw_line<'a>(
    chart: &mut Chart<'_, 'a>,
    panel: &Panel,
    points: &[[f64; 2]],
    colour: RGBColor,
    dashed: bool,
) -> Result<(), Fail<'a>> {
    let positions: Vec<_> = points.iter().copied().map(on_scales(panel)).collect();
    let stroke = colour.stroke_width(2);
    for piece in positions
        .split(|p| !finite(p))
        .filter(|piece| piece.len() > 1)
    {
        let piece = piece.iter().copied();
        if dashed {
            chart.draw_series(DashedLineSeries::new(piece, 6, 4, stroke))?;
        } else {
            chart.draw_series(LineSeries::new(piece, stroke))?;
        }
    }
    Ok(())
}

fn draw_error_bars<'a>(
    chart: &mut Chart<'_, 'a>,
    panel: &Panel,
    points: &[[f64; 2]],
    errors: &[f64],
    colour: RGBColor,
) -> Result<(), Fail<'a>> {
    let at = on_scales(panel);
    let bars = points
        .iter()
        .zip(errors)
        .map(|(&[x, y], e)| [[x, y - e], [x, y], [x, y + e]].map(&at));
    let bars = bars.filter(|b| b.iter().all(finite));
    let stroke = colour.stroke_width(1);
    let bar = |[lo, mid, hi]: [(f64, f64); 3]| {
        ErrorBar::new_vertical(mid.0, lo.1, mid.1, hi.1, stroke, 6)
    };
    chart.draw_series(bars.map(bar)).map(drop)
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
        Marker::Disc => chart
            .draw_series(positions.map(|p| Circle::new(p, radius, colour.filled())))
            .map(drop),
        Marker::Ring => chart
            .draw_series(positions.map(|p| Circle::new(p, radius, colour.stroke_width(1))))
            .map(drop),
        Marker::Cross => chart
            .draw_series(positions.map(|p| Cross::new(p, radius, colour.stroke_width(1))))
            .map(drop),
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
            let wings = [
                (-u - 0.45 * v, -v + 0.45 * u),
                (0.0, 0.0),
                (-u + 0.45 * v, -v - 0.45 * u),
            ];
            let wings = wings.map(|(x, y)| (x.round() as i32, y.round() as i32));
            let head = EmptyElement::at(*to) + Polygon::new(wings.to_vec(), colour.filled());
            chart.draw_series([head])?;
        }
    }
    Ok(())
}
