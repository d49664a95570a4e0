//! Heat maps and colour bars, drawn as pixels.
use std::io;

use super::super::axes::Axes;
use super::super::colour::ColorMap;
use super::super::heat::HeatMap;
use super::super::svg::{Anchor, Stroke, Svg, Text};
use super::super::ticks::{label, nice_ticks};
use super::style::{AXIS, TICK_TEXT, black};

const WIDTH: f64 = 14.0;

pub(super) fn draw_heat(svg: &mut Svg, axes: &Axes, map: &HeatMap) -> io::Result<()> {
    let corners = [[map.x[0], map.y[0]], [map.x[1], map.y[1]]].map(|p| axes.place(p));
    let [Some(a), Some(b)] = corners else {
        return Ok(());
    };
    let pixels = [0, 1].map(|k| (b[k] - a[k]).abs().round().max(1.0) as u32);
    let corner = [a[0].min(b[0]), a[1].min(b[1])];
    let rgb = map.rgb(pixels[0], pixels[1], !axes.y_down);
    svg.image(corner, (pixels[0], pixels[1]), &rgb)
}

/// The colour bar with ticks and its label, right of the axes.
pub(super) fn draw_bar(
    svg: &mut Svg,
    axes: &Axes,
    map: ColorMap,
    range: [f64; 2],
    title: &str,
) -> io::Result<()> {
    let [x, y] = [axes.end(0) + 12.0, axes.corner[1]];
    let height = axes.size[1];
    let pixels = (WIDTH as u32, height.max(1.0) as u32);
    let rgb = HeatMap::of_bar(map).rgb(pixels.0, pixels.1, true);
    svg.image([x, y], pixels, &rgb)?;
    svg.outline([x, y], [WIDTH, height], Stroke::new(AXIS, 1.0));
    let [low, high] = if range[1] > range[0] {
        range
    } else {
        [range[0] - 0.5, range[0] + 0.5]
    };
    for value in nice_ticks(low, high, (height / 50.0).clamp(2.0, 6.0) as usize) {
        let at = y + height - (value - low) / (high - low) * height;
        let mark = [[x + WIDTH, at], [x + WIDTH + 4.0, at]];
        svg.line(&mark, Stroke::new(AXIS, 1.0));
        svg.text(&Text {
            colour: TICK_TEXT,
            ..black(&label(value), [x + WIDTH + 7.0, at], 12.0, Anchor::Start)
        });
    }
    svg.text(&Text {
        upright: true,
        ..black(title, [x + 64.0, y + 0.5 * height], 13.0, Anchor::Middle)
    });
    Ok(())
}
