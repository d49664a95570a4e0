//! Drawing heat maps and colour bars as pixels.
use super::draw::{Area, Chart, Fail, style};
use super::heat::HeatMap;
use super::ticks::{label, nice_ticks};
use plotters::element::{Drawable, PointCollection};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters_backend::DrawingErrorKind;

/// Pixels put at a position of the chart.
struct Blit<C> {
    at: C,
    size: (u32, u32),
    rgb: Vec<u8>,
}

impl<'a, C> PointCollection<'a, C> for &'a Blit<C> {
    type Point = &'a C;
    type IntoIter = std::iter::Once<&'a C>;

    fn point_iter(self) -> Self::IntoIter {
        std::iter::once(&self.at)
    }
}

impl<C, DB: DrawingBackend> Drawable<DB> for Blit<C> {
    fn draw<I: Iterator<Item = (i32, i32)>>(
        &self,
        mut pos: I,
        backend: &mut DB,
        _: (u32, u32),
    ) -> Result<(), DrawingErrorKind<DB::ErrorType>> {
        pos.next()
            .map_or(Ok(()), |at| backend.blit_bitmap(at, self.size, &self.rgb))
    }
}

pub(super) fn draw_heat<'a>(
    chart: &Chart<'_, 'a>,
    map: &HeatMap,
    y_down: bool,
) -> Result<(), Fail<'a>> {
    let corners = [(map.x[0], map.y[0]), (map.x[1], map.y[1])].map(|p| chart.backend_coord(&p));
    let size = (
        corners[0].0.abs_diff(corners[1].0).max(1),
        corners[0].1.abs_diff(corners[1].1).max(1),
    );
    let at = (map.x[0], if y_down { map.y[0] } else { map.y[1] });
    chart.plotting_area().draw(&Blit {
        at,
        size,
        rgb: map.rgb(size.0, size.1, !y_down),
    })
}

/// The colour bar with ticks and its label, right of the axes.
pub(super) fn draw_bar<'a>(
    area: &Area<'a>,
    strip: &HeatMap,
    range: [f64; 2],
    corner: [i32; 2],
    height: i32,
) -> Result<(), Fail<'a>> {
    let [x, y] = corner;
    let size = (14, height.max(1) as u32);
    area.draw(&Blit {
        at: (x, y),
        size,
        rgb: strip.rgb(size.0, size.1, true),
    })?;
    area.draw(&Rectangle::new(
        [(x, y), (x + 14, y + height)],
        RGBColor(90, 90, 90),
    ))?;
    let [lo, hi] = if range[1] > range[0] {
        range
    } else {
        [range[0] - 0.5, range[0] + 0.5]
    };
    for v in nice_ticks(lo, hi, (height / 50).clamp(2, 6) as usize) {
        let at = y + height - ((v - lo) / (hi - lo) * f64::from(height)).round() as i32;
        area.draw(&PathElement::new(
            vec![(x + 14, at), (x + 18, at)],
            RGBColor(90, 90, 90),
        ))?;
        let anchor = Pos::new(HPos::Left, VPos::Center);
        area.draw_text(
            &label(v),
            &style(12, RGBColor(40, 40, 40)).pos(anchor),
            (x + 21, at),
        )?;
    }
    let turned = style(13, BLACK).transform(FontTransform::Rotate270);
    let anchor = Pos::new(HPos::Center, VPos::Top);
    area.draw_text(&strip.label, &turned.pos(anchor), (x + 56, y + height / 2))
}
