//! Positions at which a lump could be present without being found.
use crate::console::Context;
use crate::plot::{Colour, Panel, circle};
use serde::Serialize;
use tactile_files::scene::LoadedInclusion;
use tactile_imaging::elasticity::ElasticityError;
use tactile_imaging::inclusion::{InclusionSearch, TissueBlock};

/// Number of positions across a face: the limits change little from one to the next.
const PLACES: f64 = 16.0;

/// Index of the depth whose map is drawn: lumps are mostly a few millimetres deep.
const SHOWN_DEPTH: usize = 1;

/// The largest balls that searches miss, on a grid of positions and depths.
#[derive(Serialize)]
pub(crate) struct Hidden {
    /// Ratio of the modulus of the ball to that of the tissue.
    contrast: f64,
    positions_m: Vec<[f64; 2]>,
    depths_m: Vec<f64>,
    /// One list per depth with one diameter per position: infinite if every ball would be missed.
    diameters_m: Vec<Vec<f64>>,
    /// Position at which the next press would search most.
    next_position_m: Option<[f64; 2]>,
    /// Positions of the axis of the guide in the presses, and the radius searched about each.
    #[serde(skip)]
    axes_m: Vec<[f64; 2]>,
    #[serde(skip)]
    reach_m: f64,
}

impl Hidden {
    /// Computes the balls, with progress. Ctrl-C stops it.
    pub(crate) fn new(
        search: &InclusionSearch,
        loaded: &LoadedInclusion,
        block: &TissueBlock,
        face_m: f64,
        contrast: f64,
        context: &Context,
    ) -> Result<Self, ElasticityError> {
        let presses = &loaded.scan.presses;
        let axes_m: Vec<[f64; 2]> = presses.iter().map(|press| press.axis_m).collect();
        let cells = presses.iter().flat_map(|press| &press.positions_m);
        let reach_m = cells.map(|[x, y]| x.hypot(*y)).fold(0.0, f64::max);
        let step = 2.0 * reach_m / PLACES;
        let steps = (block.radius_m() / step).floor() as i32;
        let line = (-steps..=steps).map(|k| f64::from(k) * step);
        let positions_m: Vec<[f64; 2]> = (line.clone())
            .flat_map(|y| line.clone().map(move |x| [x, y]))
            .filter(|[x, y]| x.hypot(*y) < block.radius_m())
            .collect();
        // Down to the radius of the searched part of a face.
        let depths_m: Vec<f64> = (1..=6).map(|k| f64::from(k) * reach_m / 6.0).collect();
        let diameters_m = context.reported("what could hide", |report| {
            search.detection_limits(&loaded.scan, contrast, &positions_m, &depths_m, report)
        })?;
        // A press is solved as if it were in the middle of the block: a block height away from the
        // rim, or as near to it as the presses made. A press on top of another searches little
        // more.
        let made = axes_m.iter().map(|[x, y]| x.hypot(*y)).fold(0.0, f64::max);
        let farthest = (block.radius_m() - block.height_m() - face_m).max(made);
        let candidates: Vec<[f64; 2]> = (positions_m.iter().copied())
            .filter(|place| place[0].hypot(place[1]) <= farthest)
            .filter(|place| nearest(&axes_m, *place) >= 0.5 * reach_m)
            .collect();
        Ok(Self {
            contrast,
            next_position_m: search.next_position(
                &loaded.scan,
                &positions_m,
                &diameters_m,
                &candidates,
            ),
            diameters_m,
            positions_m,
            depths_m,
            axes_m,
            reach_m,
        })
    }

    /// Prints the range over all searched positions, for each depth.
    pub(crate) fn print(&self, context: &mut Context) {
        context.line(format_args!(
            "could hide: a ball of {} times the tissue's modulus",
            self.contrast
        ));
        for (depth, diameters) in self.depths_m.iter().zip(&self.diameters_m) {
            let searched = self.positions_m.iter().zip(diameters);
            let searched =
                searched.filter(|(place, _)| nearest(&self.axes_m, **place) <= self.reach_m);
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
        if let Some([x, y]) = self.next_position_m {
            let place = format!("at ({:.1}, {:.1}) mm would search most", 1e3 * x, 1e3 * y);
            context.row("next press", place);
        }
    }

    /// Panels from above at one depth, and in section.
    pub(crate) fn panels(&self) -> [Panel; 2] {
        let label = "hidden up to (mm)";
        let title = format!(
            "Could hide, top {:.1} mm deep",
            1e3 * self.depths_m[SHOWN_DEPTH]
        );
        let shown = self.shown(SHOWN_DEPTH, |_| true);
        let (places, diameters): (Vec<_>, Vec<_>) = shown.unzip();
        let mut above = Panel::new(title, "x (mm)", "y (mm)")
            .equal_aspect()
            .valued_points(places, diameters, label);
        for (index, axis) in self.axes_m.iter().enumerate() {
            let name = if index == 0 { "searched" } else { "" };
            let outline = circle(axis.map(|x| 1e3 * x), 1e3 * self.reach_m);
            above = above.line(outline, Colour::Orange, name);
        }
        // The row of positions that is nearest to the axis of the first press.
        let rows = self.positions_m.iter().map(|place| place[1]);
        let away = |y: &f64| (y - self.axes_m[0][1]).abs();
        let row = rows.min_by(|a, b| away(a).total_cmp(&away(b)));
        let row = row.unwrap_or_default();
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

    /// Positions and diameters in millimetres at one depth, if there is a limit.
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

/// Distance of a position from the nearest of several axes.
fn nearest(axes_m: &[[f64; 2]], [x, y]: [f64; 2]) -> f64 {
    let distances = axes_m.iter().map(|axis| (x - axis[0]).hypot(y - axis[1]));
    distances.fold(f64::INFINITY, f64::min)
}
