//! Points, lines, error bars and segments.
use super::super::axes::Axes;
use super::super::colour::{ColorMap, Colour};
use super::super::layer::{Layer, Marker};
use super::super::scale::range_of;
use super::super::svg::{Stroke, Svg};

/// Draws a layer other than a heat map.
pub(super) fn draw_layer(svg: &mut Svg, axes: &Axes, layer: &Layer) {
    match layer {
        Layer::Heat(_) => {}
        Layer::Points {
            points,
            colour,
            marker,
            radius,
            ..
        } => {
            for at in points.iter().filter_map(|&p| axes.place(p)) {
                draw_marker(svg, at, *marker, *radius, *colour);
            }
        }
        Layer::ColouredPoints {
            points,
            values,
            map,
            radius,
            ..
        } => draw_coloured(svg, axes, points, values, *map, *radius),
        Layer::Line {
            points,
            colour,
            dashed,
            ..
        } => {
            let stroke = Stroke {
                dashed: *dashed,
                ..Stroke::new(*colour, 2.0)
            };
            draw_line(svg, axes, points, stroke);
        }
        Layer::ErrorBars {
            points,
            errors,
            colour,
        } => draw_error_bars(svg, axes, points, errors, *colour),
        Layer::Segments {
            pairs,
            colour,
            arrows,
            ..
        } => draw_segments(svg, axes, pairs, *colour, *arrows),
    }
}

fn draw_marker(svg: &mut Svg, at: [f64; 2], marker: Marker, radius: f64, colour: Colour) {
    match marker {
        Marker::Disc => svg.disc(at, radius, colour),
        Marker::Ring => svg.ring(at, radius, Stroke::new(colour, 1.0)),
    }
}

fn draw_coloured(
    svg: &mut Svg,
    axes: &Axes,
    points: &[[f64; 2]],
    values: &[f64],
    map: ColorMap,
    radius: f64,
) {
    let [low, high] = range_of(values.iter());
    for (&point, value) in points.iter().zip(values) {
        // All values equal: the lower end of the colours.
        let share = (value - low) / (high - low).max(f64::MIN_POSITIVE);
        if let Some(at) = axes.place(point) {
            svg.disc(at, radius, map.at(share));
        }
    }
}

/// A line, broken where a position is not finite.
fn draw_line(svg: &mut Svg, axes: &Axes, points: &[[f64; 2]], stroke: Stroke) {
    let places: Vec<_> = points.iter().map(|&p| axes.place(p)).collect();
    for piece in places.split(Option::is_none) {
        let piece: Vec<[f64; 2]> = piece.iter().flatten().copied().collect();
        if piece.len() > 1 {
            svg.line(&piece, stroke);
        }
    }
}

fn draw_error_bars(
    svg: &mut Svg,
    axes: &Axes,
    points: &[[f64; 2]],
    errors: &[f64],
    colour: Colour,
) {
    const HALF_CAP: f64 = 3.0;
    let stroke = Stroke::new(colour, 1.0);
    for (&[x, y], error) in points.iter().zip(errors) {
        let ends = [[x, y - error], [x, y + error]].map(|p| axes.place(p));
        let [Some(low), Some(high)] = ends else {
            continue;
        };
        svg.line(&[low, high], stroke);
        for [x, y] in [low, high] {
            svg.line(&[[x - HALF_CAP, y], [x + HALF_CAP, y]], stroke);
        }
    }
}

/// Segments, with heads of 6 pixels where they are arrows.
fn draw_segments(
    svg: &mut Svg,
    axes: &Axes,
    pairs: &[[[f64; 2]; 2]],
    colour: Colour,
    arrows: bool,
) {
    for pair in pairs {
        let [Some(from), Some(to)] = pair.map(|p| axes.place(p)) else {
            continue;
        };
        svg.line(&[from, to], Stroke::new(colour, 1.0));
        let step = [to[0] - from[0], to[1] - from[1]];
        let length = step[0].hypot(step[1]);
        if arrows && length >= 2.0 {
            let [u, v] = step.map(|s| s / length * 6.0_f64.min(0.6 * length));
            let head = [
                [to[0] - u - 0.45 * v, to[1] - v + 0.45 * u],
                to,
                [to[0] - u + 0.45 * v, to[1] - v - 0.45 * u],
            ];
            svg.polygon(&head, colour);
        }
    }
}
