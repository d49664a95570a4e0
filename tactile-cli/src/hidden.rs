//! Positions at which a lump could be present without being found.
use crate::console::Context;
use crate::plot::{Colour, Panel, circle};
use tactile_files::scene::HiddenLumps;

/// Index of the depth whose map is drawn: lumps are mostly a few millimetres deep.
const SHOWN_DEPTH: usize = 1;

/// Prints and draws the largest balls that searches miss.
pub(crate) struct Hidden(pub(crate) HiddenLumps);

impl Hidden {
    /// Prints the range over all searched positions, for each depth.
    pub(crate) fn print(&self, context: &mut Context) {
        context.line(format_args!(
            "could hide: a ball of {} times the tissue's modulus",
            self.0.contrast
        ));
        for (depth, diameters) in self.0.depths_m.iter().zip(&self.0.diameters_m) {
            let searched = self.0.positions_m.iter().zip(diameters);
            let searched =
                searched.filter(|(place, _)| self.0.from_press(**place) <= self.0.reach_m);
            let range = searched.fold([f64::INFINITY, 0.0f64], |[low, high], (_, diameter)| {
                [low.min(*diameter), high.max(*diameter)]
            });
            let text = match range.map(|diameter| 1e3 * diameter) {
                [low, _] if low.is_infinite() => "of any size".to_owned(),
                [low, high] if high.is_infinite() => {
                    format!("up to {low:.1} mm at the best place, of any size at others")
                }
                [low, high] => {
                    format!("up to {low:.1} mm at the best place, {high:.1} mm at the worst")
                }
            };
            context.row(&format!("{:.1} mm deep", 1e3 * depth), text);
        }
        if let Some([x, y]) = self.0.next_position_m {
            let place = format!("at ({:.1}, {:.1}) mm would show most", 1e3 * x, 1e3 * y);
            context.row("next press", place);
        }
    }

    /// Panels from above at one depth, and in section.
    pub(crate) fn panels(&self) -> [Panel; 2] {
        let label = "hidden up to (mm)";
        let title = format!(
            "Could hide, top {:.1} mm deep",
            1e3 * self.0.depths_m[SHOWN_DEPTH]
        );
        let shown = self.shown(SHOWN_DEPTH, |_| true);
        let (places, diameters): (Vec<_>, Vec<_>) = shown.unzip();
        let mut above = Panel::new(title, "x (mm)", "y (mm)")
            .equal_aspect()
            .valued_points(places, diameters, label);
        for (index, axis) in self.0.axes_m.iter().enumerate() {
            let name = if index == 0 { "searched" } else { "" };
            let outline = circle(axis.map(|x| 1e3 * x), 1e3 * self.0.reach_m);
            above = above.line(outline, Colour::Orange, name);
        }
        // The row of positions that is nearest to the axis of the first press.
        let rows = self.0.positions_m.iter().map(|place| place[1]);
        let away = |y: &f64| (y - self.0.axes_m[0][1]).abs();
        let row = rows.min_by(|a, b| away(a).total_cmp(&away(b)));
        let row = row.unwrap_or_default();
        let levels = self
            .0
            .depths_m
            .iter()
            .enumerate()
            .flat_map(|(depth, depth_m)| {
                let shown = self.shown(depth, move |[_, y]| y == row);
                shown.map(move |([x, _], diameter)| ([x, -1e3 * depth_m], diameter))
            });
        let (places, diameters): (Vec<_>, Vec<_>) = levels.unzip();
        let title = format!("Could hide, section at y = {:.1} mm", 1e3 * row);
        let section = Panel::new(title, "x (mm)", "height of its top (mm)")
            .equal_aspect()
            .valued_points(places, diameters, label);
        [above, section]
    }

    /// Positions and diameters in millimetres at one depth, if there is a limit.
    fn shown(
        &self,
        depth: usize,
        is_shown: impl Fn([f64; 2]) -> bool,
    ) -> impl Iterator<Item = ([f64; 2], f64)> {
        let limits = self.0.positions_m.iter().zip(&self.0.diameters_m[depth]);
        let limits = limits.filter(move |(place, limit)| is_shown(**place) && limit.is_finite());
        limits.map(|(place, limit)| (place.map(|x| 1e3 * x), 1e3 * limit))
    }
}
