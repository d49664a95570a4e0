//! Drawing one panel: layout, axes, layers, colour bar, legend.
use super::colour::Colour;
use super::heat::HeatMap;
use super::layer::Layer;
use super::legend::draw_legend;
use super::map::{draw_bar, draw_heat};
use super::marks::draw_layer;
use super::panel::Panel;
use super::ticks::Axis;
use plotters::chart::ChartContext;
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
pub(super) type Fail<'a> = DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>;
pub(super) type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<Axis, Axis>>;

/// Room in pixels for labels and title.
const EDGE: i32 = 10;
const LEFT: i32 = 78;
const BOTTOM: i32 = 46;
const TOP: i32 = 34;
const RIGHT: i32 = 18;
const BAR: i32 = 86;

pub(super) fn style(size: i32, colour: RGBColor) -> TextStyle<'static> {
    ("sans-serif", size).into_font().color(&colour)
}

pub(super) fn rgb(c: Colour) -> RGBColor {
    RGBColor(c.0, c.1, c.2)
}

pub(super) fn draw_panel<'a>(area: &Area<'a>, panel: &Panel) -> Result<(), Fail<'a>> {
    let (width, _) = area.dim_in_pixel();
    let middle = Pos::new(HPos::Center, VPos::Center);
    area.draw_text(
        &panel.title,
        &style(16, BLACK).pos(middle),
        (width as i32 / 2, 17),
    )?;
    if !panel.text.is_empty() {
        return draw_lines(area, &panel.text);
    }
    let bar = panel.layers.iter().find_map(Layer::bar);
    let frame = Frame::new(area, panel, if bar.is_some() { BAR } else { RIGHT });
    let mut chart = draw_axes(area, panel, &frame, bar.is_some())?;
    for layer in &panel.layers {
        draw_layer(&mut chart, panel, layer)?;
    }
    if let Some((map, range, text)) = bar {
        let corner = [frame.corner[0] + frame.size[0] + 12, frame.corner[1]];
        draw_bar(
            area,
            &HeatMap::of_bar(map, text),
            range,
            corner,
            frame.size[1],
        )?;
    }
    draw_legend(&mut chart, panel)
}

/// Where the axes stand in the panel's area, in pixels, and what they span.
struct Frame {
    corner: [i32; 2],
    size: [i32; 2],
    /// What is left of the area on the right and below.
    rest: [i32; 2],
    ranges: [[f64; 2]; 2],
}

impl Frame {
    fn new(area: &Area<'_>, panel: &Panel, right: i32) -> Self {
        let (width, height) = area.dim_in_pixel();
        let ranges @ [x, y] = panel.ranges();
        let room = [
            width as i32 - EDGE - LEFT - right,
            height as i32 - TOP - BOTTOM,
        ]
        .map(|v| v.max(20));
        let size = if panel.equal_aspect {
            fit(room, [x[1] - x[0], y[1] - y[0]])
        } else {
            room
        };
        let corner = [
            EDGE + LEFT + (room[0] - size[0]) / 2,
            TOP + (room[1] - size[1]) / 2,
        ];
        let rest = [
            width as i32 - corner[0] - size[0],
            height as i32 - corner[1] - size[1],
        ];
        Self {
            corner,
            size,
            rest,
            ranges,
        }
    }
}

/// The largest box inside `room` with the proportions of the data.
fn fit(room: [i32; 2], data: [f64; 2]) -> [i32; 2] {
    let scale = (f64::from(room[0]) / data[0]).min(f64::from(room[1]) / data[1]);
    data.map(|d| ((d * scale).round() as i32).max(8))
}

fn draw_lines<'a>(area: &Area<'a>, lines: &[String]) -> Result<(), Fail<'a>> {
    let (width, _) = area.dim_in_pixel();
    for (i, line) in lines.iter().enumerate() {
        let y = TOP + 14 + 21 * i as i32;
        for (part, x) in line.splitn(2, '\t').zip([24, 24 + width as i32 * 2 / 5]) {
            area.draw_text(part, &style(14, BLACK), (x, y))?;
        }
    }
    Ok(())
}

/// The chart with its maps and, over them, its axes.
fn draw_axes<'c, 'a>(
    area: &'c Area<'a>,
    panel: &Panel,
    Frame {
        corner,
        size,
        rest,
        ranges: [x, y],
    }: &Frame,
    map: bool,
) -> Result<Chart<'c, 'a>, Fail<'a>> {
    let up = if panel.y_down { [y[1], y[0]] } else { *y };
    let mut chart = ChartBuilder::on(area)
        .margin_left(corner[0] - LEFT)
        .margin_right(rest[0])
        .margin_top(corner[1])
        .margin_bottom(rest[1] - BOTTOM)
        .x_label_area_size(BOTTOM)
        .y_label_area_size(LEFT)
        .build_cartesian_2d(
            Axis::new(panel.scales[0], *x, (size[0] / 64).clamp(2, 9) as usize),
            Axis::new(panel.scales[1], up, (size[1] / 44).clamp(2, 9) as usize),
        )?;
    for layer in &panel.layers {
        if let Layer::Heat(map) = layer {
            draw_heat(&chart, map, panel.y_down)?;
        }
    }
    draw_mesh(&mut chart, panel, map)?;
    Ok(chart)
}

/// Axes, ticks and, unless there is a map below, lines across.
fn draw_mesh<'a>(chart: &mut Chart<'_, 'a>, panel: &Panel, map: bool) -> Result<(), Fail<'a>> {
    let mut mesh = chart.configure_mesh();
    mesh.x_desc(panel.x_label.as_str())
        .y_desc(panel.y_label.as_str())
        .label_style(style(13, RGBColor(40, 40, 40)))
        .axis_desc_style(style(14, BLACK))
        .axis_style(RGBColor(90, 90, 90))
        .light_line_style(TRANSPARENT)
        .bold_line_style(RGBColor(228, 228, 228));
    if map {
        mesh.disable_mesh();
    }
    mesh.draw()
}
