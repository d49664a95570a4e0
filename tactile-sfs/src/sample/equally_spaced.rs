//! Points spread evenly over the surface's own area.

use nalgebra::Point3;
use ndarray::ArrayView2;

use super::ControlPointSampler;
use super::elements::{self, Element};
use super::relax::relax;
use crate::{Scalar, SfsError};

/// Equally spaced control points: each stands for the same area of the surface (not of its projection).
///
/// The surface is cut into strips of rows and the strips into cells of equal area; then a few of Lloyd's steps (every
/// point to the middle of the part of the surface nearest to it, distances in space) even the spacing out.
/// Deterministic; O(pixels + count).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EquallySpaced;

impl EquallySpaced {
    /// The sampler; it has no options.
    pub fn new() -> Self {
        Self
    }
}

impl<T: Scalar> ControlPointSampler<T> for EquallySpaced {
    fn sample(
        &self,
        surface: ArrayView2<'_, T>,
        mask: Option<ArrayView2<'_, bool>>,
        pixel_size_m: [T; 2],
        count: usize,
    ) -> Result<Vec<Point3<T>>, SfsError> {
        let (mut all, area) = elements::collect(surface, mask, pixel_size_m, count)?;
        let chosen = spread(&mut all, count, area.rows, pixel_size_m.map(Scalar::as_f64));
        Ok(elements::points(&chosen, surface, pixel_size_m))
    }
}

/// `count` elements, each standing for the same weight.
pub(super) fn spread(all: &mut [Element], count: usize, rows: usize, step: [f64; 2]) -> Vec<Element> {
    if count == 0 {
        return Vec::new();
    }
    let mut chosen = strips(all, count, rows, step);
    // Where points are as dense as pixels there is no room to move.
    if all.len() >= 8 * count {
        relax(all, &mut chosen, step);
    }
    chosen
}

/// Cuts the surface into strips of rows and the strips into cells of equal weight; one pixel from the middle of each.
fn strips(all: &mut [Element], count: usize, rows: usize, [hx, hy]: [f64; 2]) -> Vec<Element> {
    let total: f64 = all.iter().map(|e| e.area).sum();
    let width = all.len() as f64 / rows as f64;
    let bands = ((count as f64 * rows as f64 * hy / (width * hx)).sqrt().round() as usize).clamp(1, count);
    let mut chosen = Vec::with_capacity(count);
    let (mut start, mut done) = (0, 0.0);
    for band in 0..bands {
        // The band gets its share of points and of weight, and leaves a pixel for every point still to come.
        let (before, after) = (band * count / bands, (band + 1) * count / bands);
        let goal = total * after as f64 / count as f64;
        let last = if band + 1 == bands { all.len() } else { all.len() - (count - after) };
        let mut end = start;
        while end < last && (done < goal || end < start + after - before || band + 1 == bands) {
            done += all[end].area;
            end += 1;
        }
        let cells = &mut all[start..end];
        cells.sort_by_key(|e| (e.column, e.row));
        pick(cells, after - before, &mut chosen);
        start = end;
    }
    chosen
}

/// The middle pixel of each of `points` runs of equal weight.
fn pick(cells: &[Element], points: usize, chosen: &mut Vec<Element>) {
    let total: f64 = cells.iter().map(|e| e.area).sum();
    let (mut start, mut done) = (0, 0.0);
    for point in 0..points {
        let goal = total * (point + 1) as f64 / points as f64;
        let last = cells.len() - (points - point - 1);
        let mut end = start + 1;
        done += cells[start].area;
        while end < last && done < goal {
            done += cells[end].area;
            end += 1;
        }
        let run = &cells[start..end];
        let n = run.len() as f64;
        let row = run.iter().map(|e| e.row as f64).sum::<f64>() / n;
        let column = run.iter().map(|e| e.column as f64).sum::<f64>() / n;
        let distance = |e: &Element| (e.row as f64 - row).powi(2) + (e.column as f64 - column).powi(2);
        if let Some(best) = run.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))) {
            chosen.push(*best);
        }
        start = end;
    }
}
