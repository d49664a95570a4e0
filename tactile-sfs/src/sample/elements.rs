//! The pixels of a surface with their positions and the area each stands for.

use nalgebra::Point3;
use ndarray::ArrayView2;

use crate::quality::slopes_at;
use crate::{BoundingBox, Domain, Scalar, SfsError};

/// A pixel of the surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Element {
    pub(super) row: usize,
    pub(super) column: usize,
    /// Position in metres.
    pub(super) position: [f64; 3],
    /// Area of the surface over the pixel, in pixels, times any density.
    pub(super) area: f64,
}

/// All elements in reading order, and the box that holds the mask.
pub(super) fn collect<T: Scalar>(
    surface: ArrayView2<'_, T>,
    mask: Option<ArrayView2<'_, bool>>,
    pixel_size_m: [T; 2],
    count: usize,
) -> Result<(Vec<Element>, BoundingBox), SfsError> {
    let (rows, columns) = surface.dim();
    let domain = Domain { mask, pixel_size_m, known_heights: None };
    let area = domain.validate(rows, columns)?;
    let [hx, hy] = pixel_size_m.map(Scalar::as_f64);
    let mut elements = Vec::with_capacity(area.area());
    for row in area.top..area.top + area.rows {
        for column in area.left..area.left + area.columns {
            let z = surface[[row, column]];
            if !(domain.contains(row, column) && z.is_finite()) {
                continue;
            }
            let [p, q] = slopes_at(surface, [row, column], pixel_size_m);
            let element = (T::one() + p * p + q * q).sqrt().as_f64();
            let position = [column as f64 * hx, row as f64 * hy, z.as_f64()];
            elements.push(Element { row, column, position, area: element });
        }
    }
    if elements.is_empty() {
        return Err(SfsError::EmptyMask);
    }
    if count > elements.len() {
        return Err(SfsError::TooManyPoints { requested: count, available: elements.len() });
    }
    Ok((elements, area))
}

/// The points of chosen elements, with the heights of the surface.
pub(super) fn points<T: Scalar>(
    chosen: &[Element],
    surface: ArrayView2<'_, T>,
    [hx, hy]: [T; 2],
) -> Vec<Point3<T>> {
    let point = |e: &Element| {
        Point3::new(T::of(e.column as f64) * hx, T::of(e.row as f64) * hy, surface[[e.row, e.column]])
    };
    chosen.iter().map(point).collect()
}
