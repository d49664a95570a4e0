//! Points spread evenly over the surface's own area.

use nalgebra::Point3;
use ndarray::ArrayView2;

use super::ControlPointSampler;
use crate::{Domain, Scalar, SfsError};

/// Equally spaced control points: each stands for the same area of the surface (not of its projection).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EquallySpaced;

impl EquallySpaced {
    /// The sampler; it has no options.
    pub fn new() -> Self {
        Self
    }
}

/// A pixel of the surface and the surface area it stands for.
#[derive(Clone, Copy)]
struct Element {
    row: usize,
    column: usize,
    area: f64,
}

impl<T: Scalar> ControlPointSampler<T> for EquallySpaced {
    fn sample(
        &self,
        surface: ArrayView2<'_, T>,
        mask: Option<ArrayView2<'_, bool>>,
        pixel_size_m: [T; 2],
        count: usize,
    ) -> Result<Vec<Point3<T>>, SfsError> {
        let (rows, columns) = surface.dim();
        let domain = Domain { mask, pixel_size_m, known_heights: None };
        let area = domain.validate(rows, columns)?;
        let mut elements = Vec::new();
        for row in area.top..area.top + area.rows {
            for column in area.left..area.left + area.columns {
                if domain.contains(row, column) && surface[[row, column]].is_finite() {
                    elements.push(Element { row, column, area: element(surface, &domain, row, column) });
                }
            }
        }
        if elements.is_empty() {
            return Err(SfsError::EmptyMask);
        }
        if count > elements.len() {
            return Err(SfsError::TooManyPoints { requested: count, available: elements.len() });
        }
        let point = |e: &Element| {
            let [hx, hy] = pixel_size_m;
            Point3::new(T::of(e.column as f64) * hx, T::of(e.row as f64) * hy, surface[[e.row, e.column]])
        };
        Ok(strips(&mut elements, count, area.rows, pixel_size_m.map(Scalar::as_f64))
            .iter()
            .map(point)
            .collect())
    }
}

/// √(1 + p² + q²), slopes from the neighbours that exist.
fn element<T: Scalar>(z: ArrayView2<'_, T>, domain: &Domain<'_, T>, row: usize, column: usize) -> f64 {
    let [hx, hy] = domain.pixel_size_m.map(Scalar::as_f64);
    let at = |r: Option<usize>, c: Option<usize>| -> Option<f64> {
        let index = [r?, c?];
        let height = z.get(index)?.as_f64();
        (domain.contains(index[0], index[1]) && height.is_finite()).then_some(height)
    };
    let here = z[[row, column]].as_f64();
    let slope = |before: Option<f64>, after: Option<f64>, h: f64| match (before, after) {
        (Some(a), Some(b)) => (b - a) / (2.0 * h),
        (Some(a), None) => (here - a) / h,
        (None, Some(b)) => (b - here) / h,
        (None, None) => 0.0,
    };
    let p = slope(at(Some(row), column.checked_sub(1)), at(Some(row), Some(column + 1)), hx);
    let q = slope(at(row.checked_sub(1), Some(column)), at(Some(row + 1), Some(column)), hy);
    (1.0 + p * p + q * q).sqrt()
}

/// Cuts the surface into strips of rows and the strips into cells of equal area; one pixel from the middle of each.
fn strips(elements: &mut [Element], count: usize, rows: usize, [hx, hy]: [f64; 2]) -> Vec<Element> {
    let total: f64 = elements.iter().map(|e| e.area).sum();
    let width = elements.len() as f64 / rows as f64;
    let bands =
        ((count as f64 * rows as f64 * hy / (width * hx)).sqrt().round() as usize).clamp(1, count.max(1));
    let mut chosen = Vec::with_capacity(count);
    let (mut start, mut done) = (0, 0.0);
    for band in 0..bands {
        // The band gets its share of points and of area.
        let points = (band + 1) * count / bands - band * count / bands;
        let goal = total * ((band + 1) * count / bands) as f64 / count as f64;
        let mut end = start;
        let last = elements.len() - (count - (band + 1) * count / bands);
        while end < last && (done < goal || end < start + points) {
            done += elements[end].area;
            end += 1;
        }
        if band + 1 == bands {
            end = elements.len();
        }
        let cells = &mut elements[start..end];
        cells.sort_by_key(|e| (e.column, e.row));
        let area: f64 = cells.iter().map(|e| e.area).sum();
        pick(cells, points, area, &mut chosen);
        start = end;
    }
    chosen
}

/// The middle pixel of each of `points` runs of equal area.
fn pick(cells: &[Element], points: usize, area: f64, chosen: &mut Vec<Element>) {
    let (mut start, mut done) = (0, 0.0);
    for point in 0..points {
        let goal = area * (point + 1) as f64 / points as f64;
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
