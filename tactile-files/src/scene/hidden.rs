//! Positions of a scene's block at which a lump could be present without being found.
use super::inclusion::LoadedInclusion;
use core::ops::ControlFlow;
use serde::Serialize;
use tactile_imaging::elasticity::{ElasticityError, Quantity};
use tactile_imaging::inclusion::{InclusionEstimate, Progress};

/// Number of positions across a face: the limits change little from one to the next.
const PLACES: f64 = 16.0;

/// The largest balls that a search of a scene misses, on a grid of positions and depths.
///
/// ```no_run
/// # use core::ops::ControlFlow;
/// use tactile_files::scene::InclusionScene;
/// let loaded = InclusionScene::read("scan.toml")?.load()?;
/// let estimate = loaded.estimate(&mut |_| ControlFlow::Continue(()))?;
/// let hidden = loaded.hidden(&estimate, 4.0, &mut |_| ControlFlow::Continue(()))?;
/// if let Some([x, y]) = hidden.next_position_m {
///     println!("press next at ({:.1}, {:.1}) mm", 1e3 * x, 1e3 * y);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Serialize)]
pub struct HiddenLumps {
    /// Ratio of the modulus of the ball to that of the tissue.
    pub contrast: f64,
    /// Positions (x, y) of its centre.
    pub positions_m: Vec<[f64; 2]>,
    /// Depths of its top.
    pub depths_m: Vec<f64>,
    /// One list per depth with one diameter per position: infinite if every ball would be missed.
    pub diameters_m: Vec<Vec<f64>>,
    /// Position at which the next press would show most: above a lump of `estimate` under the rim,
    /// or where most could be hidden. `None` if there is no place for one.
    pub next_position_m: Option<[f64; 2]>,
    /// Positions of the axis of the guide in the presses.
    #[serde(skip)]
    pub axes_m: Vec<[f64; 2]>,
    /// Radius searched about each.
    #[serde(skip)]
    pub reach_m: f64,
}

impl LoadedInclusion {
    /// The largest balls that the search misses, down to the radius of the searched part of a face.
    /// `contrast` is their modulus over that of the tissue.
    ///
    /// # Errors
    /// Those of [`tactile_imaging::inclusion::InclusionSearch::detection_limits`].
    pub fn hidden(
        &self,
        estimate: &InclusionEstimate,
        contrast: f64,
        progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<HiddenLumps, ElasticityError> {
        let presses = &self.scan.presses;
        let axes_m: Vec<[f64; 2]> = presses.iter().map(|press| press.axis_m).collect();
        let cells = presses.iter().flat_map(|press| &press.positions_m);
        let reach_m = cells.map(|[x, y]| x.hypot(*y)).fold(0.0, f64::max);
        let step = 2.0 * reach_m / PLACES;
        let block = self.search.specimen();
        let radius_m = block.radius_m();
        let steps = (radius_m / Quantity::Distance.positive(step)?).floor() as i32;
        let line = (-steps..=steps).map(|k| f64::from(k) * step);
        let positions_m: Vec<[f64; 2]> = (line.clone())
            .flat_map(|y| line.clone().map(move |x| [x, y]))
            .filter(|[x, y]| x.hypot(*y) < radius_m)
            .collect();
        let depths_m: Vec<f64> = (1..=6).map(|k| f64::from(k) * reach_m / 6.0).collect();
        let (search, scan) = (&self.search, &self.scan);
        let diameters_m =
            search.detection_limits(scan, contrast, &positions_m, &depths_m, progress)?;
        // A press is solved as if it were in the middle of the block: a block height away from the
        // rim, or as near to it as the presses made. A press on top of another searches little
        // more.
        let made = axes_m.iter().map(|[x, y]| x.hypot(*y)).fold(0.0, f64::max);
        let inner = radius_m - block.height_m() - self.search.guide().radius_m();
        let farthest = inner.max(made);
        let mut found = HiddenLumps {
            contrast,
            next_position_m: None,
            diameters_m,
            positions_m,
            depths_m,
            axes_m,
            reach_m,
        };
        let candidates: Vec<[f64; 2]> = (found.positions_m.iter().copied())
            .filter(|place| place[0].hypot(place[1]) <= farthest)
            .filter(|place| found.from_press(*place) >= 0.5 * reach_m)
            .collect();
        let (places, limits) = (&found.positions_m, &found.diameters_m);
        found.next_position_m = search.next_position(scan, estimate, places, limits, &candidates);
        Ok(found)
    }
}

impl HiddenLumps {
    /// Distance of a position from the axis of the nearest press.
    pub fn from_press(&self, [x, y]: [f64; 2]) -> f64 {
        let distances = self
            .axes_m
            .iter()
            .map(|axis| (x - axis[0]).hypot(y - axis[1]));
        distances.fold(f64::INFINITY, f64::min)
    }
}
