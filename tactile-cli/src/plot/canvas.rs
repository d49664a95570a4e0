//! The canvas of the drawing library, its text and its strokes.
use crate::text::printable;
use base64::{Engine, engine::general_purpose::STANDARD};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::error::Error;

pub(super) type Drawn<T> = Result<T, Box<dyn Error + Send + Sync>>;
pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;

/// Refinement of the canvas. The drawing library uses whole pixels, which would be visible as steps
/// in curves.
pub(super) const FINE: i32 = 4;

/// Draws with `inside` on an area of this size and returns it as an element of a page.
pub(super) fn drawing(
    [x, y]: [i32; 2],
    [width, height]: [i32; 2],
    inside: impl FnOnce(&Area<'_>) -> Drawn<()>,
) -> Drawn<String> {
    let (fine_width, fine_height) = ((FINE * width) as u32, (FINE * height) as u32);
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, (fine_width, fine_height)).into_drawing_area();
        inside(&area)?;
        area.present()?;
    }
    // The outer size scales the fine canvas to pixels of the page.
    let fine = format!(r#"<svg width="{fine_width}" height="{fine_height}""#);
    let placed = format!(r#"<svg x="{x}" y="{y}" width="{width}" height="{height}""#);
    Ok(svg.replacen(&fine, &placed, 1))
}

/// A PNG as an element of a page.
pub(super) fn picture([x, y]: [f64; 2], [width, height]: [f64; 2], png: &[u8]) -> String {
    let data = STANDARD.encode(png);
    format!(
        r#"<image x="{x}" y="{y}" width="{width}" height="{height}" preserveAspectRatio="none" href="data:image/png;base64,{data}"/>
"#
    )
}

/// A font with this height in pixels of the page.
pub(super) fn font(size: i32) -> TextStyle<'static> {
    // The SVG back end divides the size by 1.24.
    ("sans-serif", 1.24 * f64::from(FINE * size))
        .into_font()
        .color(&BLACK)
}

pub(super) fn text(
    area: &Area<'_>,
    words: &str,
    [x, y]: [i32; 2],
    size: i32,
    at: HPos,
) -> Drawn<()> {
    let style = font(size).pos(Pos::new(at, VPos::Center));
    area.draw_text(&printable(words), &style, (FINE * x, FINE * y))?;
    Ok(())
}

pub(super) fn stroke(colour: RGBColor, width: i32) -> ShapeStyle {
    colour.stroke_width((FINE * width) as u32)
}

/// The style of axes and of their ticks.
pub(super) fn axis_style() -> ShapeStyle {
    stroke(RGBColor(90, 90, 90), 1)
}
