//! Drawing one panel: title, axes, layers, colour bar, legend.
mod bar;
mod frame;
mod legend;
mod marks;
pub(super) mod style;

use std::io;

use super::axes::{Axes, TOP};
use super::layer::Layer;
use super::panel::Panel;
use super::svg::{Anchor, Svg};
use style::black;

/// Draws `panel` in the area with this corner and size.
pub(super) fn draw_panel(
    svg: &mut Svg,
    panel: &Panel,
    corner: [f64; 2],
    size: [f64; 2],
) -> io::Result<()> {
    let title = [corner[0] + 0.5 * size[0], corner[1] + 17.0];
    svg.text(&black(&panel.title, title, 16.0, Anchor::Middle));
    if !panel.text.is_empty() {
        draw_lines(svg, &panel.text, corner, size[0]);
        return Ok(());
    }
    let axes = Axes::new(panel, corner, size);
    for layer in &panel.layers {
        if let Layer::Heat(map) = layer {
            let mut drawn = Ok(());
            svg.clipped(axes.corner, axes.size, |svg| {
                drawn = bar::draw_heat(svg, &axes, map)
            });
            drawn?;
        }
    }
    let bar = panel.layers.iter().find_map(Layer::bar);
    frame::draw_axes(svg, panel, &axes, bar.is_none());
    svg.clipped(axes.corner, axes.size, |svg| {
        for layer in &panel.layers {
            marks::draw_layer(svg, &axes, layer);
        }
    });
    if let Some((map, range, label)) = bar {
        bar::draw_bar(svg, &axes, map, range, label)?;
    }
    legend::draw_legend(svg, panel, &axes);
    Ok(())
}

/// Lines of text; a tab leads to the second column.
fn draw_lines(svg: &mut Svg, lines: &[String], corner: [f64; 2], width: f64) {
    for (i, line) in lines.iter().enumerate() {
        let y = corner[1] + TOP + 14.0 + 21.0 * i as f64;
        for (part, x) in line.splitn(2, '\t').zip([24.0, 24.0 + 0.4 * width]) {
            svg.text(&black(part, [corner[0] + x, y], 14.0, Anchor::Start));
        }
    }
}
