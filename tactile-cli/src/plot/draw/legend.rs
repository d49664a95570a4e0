//! The legend: a sample and a name for every labelled layer.
use super::super::axes::Axes;
use super::super::colour::Colour;
use super::super::layer::Layer;
use super::super::legend::Legend;
use super::super::panel::Panel;
use super::super::svg::{Anchor, Stroke, Svg};
use super::style::black;

/// Space around the legend, for a sample, for a letter and for a line, in pixels.
const MARGIN: f64 = 8.0;
const SAMPLE: f64 = 22.0;
const LETTER: f64 = 7.5;
const LINE: f64 = 18.0;

/// The corners of the axes, the one preferred first.
const CORNERS: [Legend; 4] = [
    Legend::UpperRight,
    Legend::UpperLeft,
    Legend::LowerRight,
    Legend::LowerLeft,
];

pub(super) fn draw_legend(svg: &mut Svg, panel: &Panel, axes: &Axes) {
    let entries: Vec<&Layer> = (panel.layers.iter())
        .filter(|l| label_of(l).is_some())
        .collect();
    let Some(longest) = (entries.iter())
        .filter_map(|layer| label_of(layer))
        .map(|label| label.chars().count())
        .max()
    else {
        return;
    };
    let size = [
        2.0 * MARGIN + SAMPLE + LETTER * longest as f64,
        MARGIN + LINE * entries.len() as f64,
    ];
    let position = match panel.legend {
        Legend::Emptiest => emptiest(panel, axes, size),
        chosen => chosen,
    };
    let corner = corner_of(position, axes, size);
    let border = Stroke::new(Colour(200, 200, 200), 1.0);
    svg.rectangle(corner, size, Colour::WHITE, Some(border));
    for (k, layer) in entries.into_iter().enumerate() {
        let at = [
            corner[0] + MARGIN,
            corner[1] + 0.5 * MARGIN + LINE * (k as f64 + 0.5),
        ];
        draw_entry(svg, layer, at);
    }
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

fn draw_entry(svg: &mut Svg, layer: &Layer, [x, y]: [f64; 2]) {
    let sample = [[x, y], [x + SAMPLE - 4.0, y]];
    match layer {
        Layer::Points { colour, .. } => svg.disc([x + 9.0, y], 4.0, *colour),
        Layer::Line { colour, dashed, .. } => {
            let stroke = Stroke {
                dashed: *dashed,
                ..Stroke::new(*colour, 2.0)
            };
            svg.line(&sample, stroke);
        }
        Layer::Segments { colour, .. } => svg.line(&sample, Stroke::new(*colour, 2.0)),
        _ => {}
    }
    let label = label_of(layer).unwrap_or_default();
    svg.text(&black(label, [x + SAMPLE, y], 13.0, Anchor::Start));
}

/// Upper left corner of a legend of `size` at `position`.
fn corner_of(position: Legend, axes: &Axes, size: [f64; 2]) -> [f64; 2] {
    let right = matches!(
        position,
        Legend::UpperRight | Legend::LowerRight | Legend::Emptiest
    );
    let lower = matches!(position, Legend::LowerRight | Legend::LowerLeft);
    let at = |k: usize, far: bool| {
        if far {
            axes.end(k) - MARGIN - size[k]
        } else {
            axes.corner[k] + MARGIN
        }
    };
    [at(0, right), at(1, lower)]
}

/// The corner where a legend of `size` covers the fewest marks; the upper right one where several do.
fn emptiest(panel: &Panel, axes: &Axes, size: [f64; 2]) -> Legend {
    let marks = marks(panel, axes);
    let covered = |position: &Legend| {
        let corner = corner_of(*position, axes, size);
        let inside = |p: &&[f64; 2]| {
            (0..2).all(|k| p[k] >= corner[k] - MARGIN && p[k] <= corner[k] + size[k] + MARGIN)
        };
        marks.iter().filter(inside).count()
    };
    CORNERS.into_iter().min_by_key(covered).unwrap_or_default()
}

/// Where ink is, in pixels: points, and every stretch of a line at sixteen places.
fn marks(panel: &Panel, axes: &Axes) -> Vec<[f64; 2]> {
    const PLACES: u32 = 16;
    let mut marks = Vec::new();
    let mut put = |p: [f64; 2]| marks.extend(axes.place(p));
    for layer in &panel.layers {
        match layer {
            Layer::Heat(_) => {}
            Layer::Line { points, .. } => {
                for pair in points.windows(2) {
                    for i in 0..=PLACES {
                        let t = f64::from(i) / f64::from(PLACES);
                        put([0, 1].map(|k| pair[0][k] + t * (pair[1][k] - pair[0][k])));
                    }
                }
            }
            layer => layer.visit(&mut put),
        }
    }
    marks
}
