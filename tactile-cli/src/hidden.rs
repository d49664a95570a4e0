//! Where a lump could be without being found.
use crate::console::{Bar, Context};
use crate::plot::{Colour, Panel, circle};
use serde::Serialize;
use tactile_imaging::elasticity::ElasticityError;
use tactile_imaging::inclusion::{InclusionSearch, LoadedInclusion};

/// The largest balls that searches miss, on a grid of places and depths.
#[derive(Serialize)]
pub struct Hidden {
    /// Modulus of the ball over the tissue's.
    contrast: f64,
    positions_m: Vec<[f64; 2]>,
    depths_m: Vec<f64>,
    /// For each depth, one for each place. Infinite where every ball would be missed.
    diameters_m: Vec<Vec<f64>>,
    #[serde(skip)]
    faces_m: Vec<([f64; 2], f64)>,
}

impl Hidden {
    /// With progress, which Ctrl-C ends.
    pub fn new(
        search: &InclusionSearch,
        loaded: &LoadedInclusion,
        contrast: f64,
        context: &Context,
    ) -> Result<Self, ElasticityError> {
        let presses = &loaded.scan.presses;
        let axes: Vec<[f64; 2]> = presses.iter().map(|press| press.axis_m).collect();
        let cells = presses.iter().flat_map(|press| &press.positions_m);
        let reach = cells.map(|[x, y]| x.hypot(*y)).fold(0.0, f64::max);
        // Places across a face: the limits change little from one to the next.
        let places = 16.0;
        let span = [0, 1].map(|k| {
            let along = axes.iter().map(|axis| axis[k]);
            let low = along.clone().fold(f64::INFINITY, f64::min);
            [low - reach, along.fold(f64::NEG_INFINITY, f64::max) + reach]
        });
        let step = 2.0 * reach / places;
        let grid = span.map(|[low, high]| {
            let count = ((high - low) / step).ceil();
            (
                0.5 * (low + high - (count - 1.0) * step),
                step,
                count as usize,
            )
        });
        let [(left, dx, columns), (bottom, dy, rows)] = grid;
        let at = |row: usize, column: usize| [left + column as f64 * dx, bottom + row as f64 * dy];
        let positions_m: Vec<[f64; 2]> = (0..rows)
            .flat_map(|row| (0..columns).map(move |column| at(row, column)))
            .collect();
        // From just under the surface to as deep as a face is wide to the edge of its used part.
        let depths_m: Vec<f64> = (1..=6).map(|k| f64::from(k) * reach / 6.0).collect();
        let mut bar: Option<Bar> = None;
        let interrupt = &context.interrupt;
        interrupt.polled(true);
        let limits = search.detection_limits(
            &loaded.scan,
            contrast,
            &positions_m,
            &depths_m,
            &mut |now| {
                let bar = bar.get_or_insert_with(|| Bar::of(now.expected, "what could hide"));
                bar.done(now.done);
                interrupt.flow()
            },
        );
        interrupt.polled(false);
        Ok(Self {
            contrast,
            diameters_m: limits?,
            positions_m,
            depths_m,
            faces_m: axes.into_iter().map(|axis| (axis, reach)).collect(),
        })
    }

    /// Prints the range over all places that are searched, depth by depth.
    pub fn print(&self, context: &mut Context) {
        context.line(format_args!(
            "could hide: a ball of {} times the tissue's modulus",
            self.contrast
        ));
        for (depth, diameters) in self.depths_m.iter().zip(&self.diameters_m) {
            let searched = self.positions_m.iter().zip(diameters);
            let searched = searched.filter(|(place, _)| self.is_searched(**place));
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
    }

    fn is_searched(&self, [x, y]: [f64; 2]) -> bool {
        let mut faces = self.faces_m.iter();
        faces.any(|([u, v], reach)| (x - u).hypot(y - v) <= *reach)
    }

    /// From above at one depth, and in section.
    pub fn panels(&self) -> [Panel; 2] {
        let label = "hidden up to (mm)";
        // The second depth: lumps are mostly a few millimetres deep.
        let depth = 1;
        let title = format!("Could hide, top {:.1} mm deep", 1e3 * self.depths_m[depth]);
        let shown = self.shown(depth, |_| true);
        let (places, diameters): (Vec<_>, Vec<_>) = shown.unzip();
        let mut above = Panel::new(title, "x (mm)", "y (mm)")
            .equal_aspect()
            .valued_points(places, diameters, label);
        for (index, (axis, reach)) in self.faces_m.iter().enumerate() {
            let name = if index == 0 { "searched" } else { "" };
            let outline = circle(axis.map(|x| 1e3 * x), 1e3 * reach);
            above = above.line(outline, Colour::Orange, name);
        }
        let row = self.positions_m[self.positions_m.len() / 2][1];
        let levels = self
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

    /// Places and diameters in millimetres at one depth, where there is a limit.
    fn shown(
        &self,
        depth: usize,
        is_shown: impl Fn([f64; 2]) -> bool,
    ) -> impl Iterator<Item = ([f64; 2], f64)> {
        let limits = self.positions_m.iter().zip(&self.diameters_m[depth]);
        let limits = limits.filter(move |(place, limit)| is_shown(**place) && limit.is_finite());
        limits.map(|(place, limit)| (place.map(|x| 1e3 * x), 1e3 * limit))
    }
}
