//! Axes with their ticks, grid lines and labels.
use super::super::axes::{Axes, BOTTOM, LEFT};
use super::super::colour::Colour;
use super::super::panel::Panel;
use super::super::svg::{Anchor, Stroke, Svg, Text};
use super::super::ticks::{Tick, ticks};
use super::style::{AXIS, TICK_TEXT, black};

const GRID: Stroke = Stroke::new(Colour(228, 228, 228), 1.0);
const LINE: Stroke = Stroke::new(AXIS, 1.0);
/// Length of a tick mark and the gap to its number, in pixels.
const MARK: f64 = 5.0;
const GAP: f64 = 4.0;

/// Ticks with their numbers, the axes' labels and, with `grid`, lines across.
pub(super) fn draw_axes(svg: &mut Svg, panel: &Panel, axes: &Axes, grid: bool) {
    let [left, top] = axes.corner;
    let [right, bottom] = [axes.end(0), axes.end(1)];
    // A number needs some 64 pixels along x and 44 along y.
    let [across, down] =
        [(axes.size[0] / 64.0), (axes.size[1] / 44.0)].map(|n| n.clamp(2.0, 9.0) as usize);
    for Tick { at, label } in ticks(axes.scales[0], axes.ranges[0], across) {
        let x = axes.along(0, at);
        if grid {
            svg.line(&[[x, top], [x, bottom]], GRID);
        }
        svg.line(&[[x, bottom], [x, bottom + MARK]], LINE);
        svg.text(&number(
            &label,
            [x, bottom + MARK + GAP + 6.0],
            Anchor::Middle,
        ));
    }
    for Tick { at, label } in ticks(axes.scales[1], axes.ranges[1], down) {
        let y = axes.along(1, at);
        if grid {
            svg.line(&[[left, y], [right, y]], GRID);
        }
        svg.line(&[[left - MARK, y], [left, y]], LINE);
        svg.text(&number(&label, [left - MARK - GAP, y], Anchor::End));
    }
    svg.line(&[[left, top], [left, bottom], [right, bottom]], LINE);
    let below = [0.5 * (left + right), bottom + BOTTOM - 10.0];
    svg.text(&black(&panel.x_label, below, 14.0, Anchor::Middle));
    let beside = [left - LEFT + 10.0, 0.5 * (top + bottom)];
    svg.text(&Text {
        upright: true,
        ..black(&panel.y_label, beside, 14.0, Anchor::Middle)
    });
}

fn number(content: &str, at: [f64; 2], anchor: Anchor) -> Text<'_> {
    Text {
        content,
        at,
        size: 13.0,
        colour: TICK_TEXT,
        anchor,
        upright: false,
    }
}
