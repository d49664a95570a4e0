//! Surfaces as pages show them: heights that the mouse turns.
use ndarray::ArrayView2;
use serde::Serialize;

/// Points along a side, at most: more would be no clearer, and turn slowly.
const POINTS: usize = 80;

/// Heights on a grid, as `relief.js` draws them.
#[derive(Serialize)]
pub(crate) struct HeightGrid {
    columns: usize,
    /// Size of a grid cell along x and y and of a step of height, in millimetres.
    steps_mm: [f64; 3],
    /// Row by row, in steps above the lowest. None where there is no surface.
    heights: Vec<Option<u32>>,
    /// From the lowest to the highest point.
    pub height_mm: f64,
}

impl HeightGrid {
    /// The part of `heights` that is not NaN, thinned. Heights and pixels are in millimetres.
    /// `None` where there is no part, or a level one.
    pub(crate) fn of(heights: ArrayView2<'_, f64>, pixel: [f64; 2]) -> Option<Self> {
        let known = heights
            .indexed_iter()
            .filter(|(_, height)| height.is_finite());
        let (mut first, mut last) = ([usize::MAX; 2], [0; 2]);
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for ((row, column), &height) in known {
            for (side, at) in [row, column].into_iter().enumerate() {
                first[side] = first[side].min(at);
                last[side] = last[side].max(at);
            }
            (low, high) = (low.min(height), high.max(height));
        }
        if low >= high {
            return None;
        }
        let sides = [0, 1].map(|side| last[side] - first[side] + 1);
        let step = sides[0].max(sides[1]).div_ceil(POINTS);
        let rows = (first[0]..=last[0]).step_by(step);
        let columns = (first[1]..=last[1]).step_by(step);
        // A ten-thousandth of the height is finer than a page shows.
        let unit = 1e-4 * (high - low);
        let cell = |at: (usize, usize)| {
            let height = heights[at];
            height
                .is_finite()
                .then(|| ((height - low) / unit).round() as u32)
        };
        let [dx, dy] = pixel.map(|side| side * step as f64);
        Some(Self {
            columns: columns.clone().count(),
            steps_mm: [dx, dy, unit],
            heights: rows
                .flat_map(|row| columns.clone().map(move |column| (row, column)))
                .map(cell)
                .collect(),
            height_mm: high - low,
        })
    }
}
