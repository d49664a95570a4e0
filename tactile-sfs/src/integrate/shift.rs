//! The integration constant: mean height 0, or that of the known heights.

use crate::{Domain, Scalar, Surface};

/// Writes the heights of the surface's box to it, all shifted so that known heights are met on average, or the mean
/// inside the mask is 0.
pub(crate) fn write_levelled<T: Scalar>(
    grid: &[T],
    domain: &Domain<'_, T>,
    surface: &mut Surface<T>,
) {
    let area = surface.bounding_box;
    let shift = T::of(shift(grid, domain, surface));
    let mut heights = area.view_mut(surface.heights.view_mut());
    let mut inside = area.view_mut(surface.mask.view_mut());
    for (r, line) in grid.chunks(area.columns).enumerate() {
        let (mut to, mut inside) = (heights.row_mut(r), inside.row_mut(r));
        let Some(mask) = domain.mask else {
            to.iter_mut().zip(line).for_each(|(to, &z)| *to = z + shift);
            inside.fill(true);
            continue;
        };
        let mask = area.view(mask);
        for (((to, &z), inside), &wanted) in to
            .iter_mut()
            .zip(line)
            .zip(inside.iter_mut())
            .zip(mask.row(r))
        {
            if wanted && !z.is_nan() {
                (*to, *inside) = (z + shift, true);
            }
        }
    }
}

fn shift<T: Scalar>(grid: &[T], domain: &Domain<'_, T>, surface: &Surface<T>) -> f64 {
    let area = surface.bounding_box;
    let (mut sum, mut count) = (0.0, 0usize);
    let (mut excess, mut known) = (0.0, 0usize);
    for (r, line) in grid.chunks(area.columns).enumerate() {
        if domain.mask.is_none() && domain.known_heights.is_none() {
            sum += line.iter().fold(T::zero(), |sum, &z| sum + z).as_f64();
            count += line.len();
            continue;
        }
        for (c, &z) in line.iter().enumerate() {
            let (row, column) = (area.top + r, area.left + c);
            if domain.contains(row, column) && !z.is_nan() {
                sum += z.as_f64();
                count += 1;
                if let Some(height) = domain.known(row, column) {
                    excess += (height - z).as_f64();
                    known += 1;
                }
            }
        }
    }
    if known > 0 {
        excess / known as f64
    } else {
        -sum / count.max(1) as f64
    }
}
