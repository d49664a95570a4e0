//! Surfaces on pages, which the mouse rotates.
use ndarray::ArrayView2;
use serde::Serialize;

/// Largest number of points along a side. More would not look better and would rotate slowly.
const POINTS: usize = 80;

/// Number of steps from the lowest to the highest point, finer than a page can show.
const STEPS: u32 = 10_000;

/// Share of the height below which the rim counts as the foot of a dome. For a hemisphere with a
/// radius of ten points the rim reaches 0.44.
const FOOT: f64 = 0.5;

/// Heights on a grid, in the format of `relief.js`.
#[derive(Serialize)]
pub(crate) struct HeightGrid {
    columns: usize,
    /// Size of a grid cell along x and y and of a step of height, in millimetres.
    steps_mm: [f64; 3],
    /// Heights row by row, in steps above the lowest. `None` if there is no surface.
    heights: Vec<Option<u32>>,
    /// The height, in steps, below which the surface is cut. It removes the ragged rim of a dome,
    /// which follows the steps of the grid.
    cut: u32,
    /// Height from the lowest to the highest point.
    pub height_mm: f64,
}

impl HeightGrid {
    /// The part of `heights` that is not NaN, thinned. Heights and pixels are in millimetres.
    /// `None` if there is no such part or it is level.
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
        let unit = (high - low) / f64::from(STEPS);
        let cell = |at: (usize, usize)| {
            let height = heights[at];
            height
                .is_finite()
                .then(|| ((height - low) / unit).round() as u32)
        };
        let [dx, dy] = pixel.map(|side| side * step as f64);
        let width = columns.clone().count();
        let grid = rows.flat_map(|row| columns.clone().map(move |column| (row, column)));
        let heights: Vec<_> = grid.map(cell).collect();
        Some(Self {
            cut: cut(&heights, width),
            columns: width,
            steps_mm: [dx, dy, unit],
            heights,
            height_mm: high - low,
        })
    }
}

/// The highest point of the rim if the rim is the foot of a dome. Otherwise 0, which cuts nothing.
fn cut(heights: &[Option<u32>], columns: usize) -> u32 {
    let rows = heights.len() / columns;
    let outside = |row: usize, column: usize| {
        let near = |at: usize, end: usize| at.saturating_sub(1)..(at + 2).min(end);
        near(row, rows).any(|r| near(column, columns).any(|c| heights[r * columns + c].is_none()))
    };
    let rim = heights.iter().enumerate();
    let rim = rim.filter(|(k, _)| outside(k / columns, k % columns));
    let highest = rim.filter_map(|(_, height)| *height).max().unwrap_or(0);
    match f64::from(highest) < FOOT * f64::from(STEPS) {
        true => highest,
        false => 0,
    }
}
