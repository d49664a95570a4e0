//! From the frame to the grid: nodes, angles to the light, known heights, boundary offsets and edges.

use super::boundary;
use super::grid::{EikonalBuffers, Node};
use crate::{BoundingBox, Domain, Frame, Lighting, PixelFlags, Scalar, SfsError, Surface};
use ndarray::Axis;

/// What a solve starts from.
pub(super) struct Input<'a, 'f, 'd, T> {
    pub(super) frame: &'a Frame<'f, T>,
    pub(super) domain: &'a Domain<'d, T>,
    pub(super) lighting: &'a Lighting<T>,
    /// Darkest reflectance that is told from black.
    pub(super) least: T,
    /// Height at the mask's border.
    pub(super) boundary: Option<T>,
}

/// How many heights are known.
#[derive(Clone, Copy, Default)]
pub(super) struct KnownCount {
    pub(super) inside: usize,
    border: usize,
}

impl<T: Scalar> EikonalBuffers<T> {
    /// Fills the grid and flags the pixels the model does not explain.
    pub(super) fn load(
        &mut self,
        input: &Input<'_, '_, '_, T>,
        surface: &mut Surface<T>,
    ) -> Result<KnownCount, SfsError> {
        let area = surface.bounding_box;
        let [hx, hy] = input.domain.pixel_size_m;
        self.clear(area.rows, area.columns);
        self.aspect = hy / hx;
        let count = self.load_nodes(input, surface);
        self.fill_holes(area.area())?;
        for (sine, &cosine) in self.sine.iter_mut().zip(&self.cosine) {
            *sine = ((T::one() - cosine) * (T::one() + cosine))
                .max(T::zero())
                .sqrt();
        }
        boundary::measure(self);
        if count.inside == 0
            && (count.border == 0 || self.offset.iter().all(|offset| offset.is_nan()))
        {
            return Err(SfsError::NoKnownHeight);
        }
        self.measure_edges();
        Ok(count)
    }

    /// The nodes of the mask, and the heights given around it.
    fn load_nodes(&mut self, input: &Input<'_, '_, '_, T>, surface: &mut Surface<T>) -> KnownCount {
        let area = surface.bounding_box;
        let mut count = KnownCount::default();
        for r in 0..area.rows + 2 {
            let inside = r > 0 && r <= area.rows;
            if inside && self.load_row(input, r, surface, &mut count).is_some() {
                self.load_place(input, [r, 0], surface, &mut count);
                self.load_place(input, [r, area.columns + 1], surface, &mut count);
            } else {
                (0..self.width).for_each(|c| self.load_place(input, [r, c], surface, &mut count));
            }
        }
        count
    }

    /// One place of the grid.
    fn load_place(
        &mut self,
        input: &Input<'_, '_, '_, T>,
        [r, c]: [usize; 2],
        surface: &mut Surface<T>,
        count: &mut KnownCount,
    ) {
        let area = surface.bounding_box;
        let Some(at @ (row, column)) = pixel(area, [r, c], input.frame.dim()) else {
            return;
        };
        let i = r * self.width + c;
        let in_box = r > 0 && c > 0 && r <= area.rows && c <= area.columns;
        if in_box && input.domain.contains(row, column) {
            surface.flags[at] = self.load_node(input, i, at);
            count.inside += usize::from(self.node[i] == Node::Known);
        } else if let Some(height) = input.domain.known(row, column).or(input.boundary) {
            self.given[i] = height / input.domain.pixel_size_m[0];
            count.border += 1;
        }
    }

    /// A row of the box as slices, a third of what its places take one by one; `None`, with nothing done, where heights are known inside or the
    /// images do not lie in memory row by row.
    fn load_row(
        &mut self,
        input: &Input<'_, '_, '_, T>,
        r: usize,
        surface: &mut Surface<T>,
        count: &mut KnownCount,
    ) -> Option<()> {
        let (Frame::Real(image), Some(mask), None) =
            (input.frame, input.domain.mask, input.domain.known_heights)
        else {
            return None;
        };
        let area = surface.bounding_box;
        let row = area.top + r - 1;
        let columns = area.left..area.left + area.columns;
        let image = &image.index_axis(Axis(0), row).to_slice()?[columns.clone()];
        let mask = &mask.index_axis(Axis(0), row).to_slice()?[columns.clone()];
        let flags = surface.flags.index_axis_mut(Axis(0), row);
        let flags = &mut flags.into_slice()?[columns];
        let first = r * self.width + 1;
        let line = first..first + area.columns;
        let given = input
            .boundary
            .map(|height| height / input.domain.pixel_size_m[0]);
        let nodes = self.node[line.clone()].iter_mut();
        let nodes = nodes.zip(&mut self.cosine[line.clone()]);
        let nodes = nodes.zip(&mut self.given[line]).zip(flags);
        let pixels = image.iter().zip(mask);
        for (i, (place, (light, inside))) in nodes.zip(pixels).enumerate() {
            let (((node, cosine), height), flags) = place;
            if !inside {
                if let Some(given) = given {
                    *height = given;
                    count.border += 1;
                }
                continue;
            }
            *node = Node::Unknown;
            let reflectance = input.lighting.reflectance(*light);
            *flags = PixelFlags::of_reflectance(reflectance, input.least);
            if *flags == PixelFlags::NON_FINITE {
                self.holes.push(first + i);
                *cosine = T::nan();
            } else {
                *cosine = reflectance.max(input.least).min(T::one());
            }
        }
        Some(())
    }

    /// A node of the mask; returns its flags.
    fn load_node(
        &mut self,
        input: &Input<'_, '_, '_, T>,
        i: usize,
        (row, column): (usize, usize),
    ) -> PixelFlags {
        let known = input.domain.known(row, column);
        self.node[i] = if known.is_some() {
            Node::Known
        } else {
            Node::Unknown
        };
        self.given[i] = known.map_or(T::nan(), |height| height / input.domain.pixel_size_m[0]);
        let reflectance = input.lighting.reflectance(input.frame.at(row, column));
        let flags = PixelFlags::of_reflectance(reflectance, input.least);
        if flags == PixelFlags::NON_FINITE {
            self.holes.push(i);
            self.cosine[i] = T::nan();
        } else {
            self.cosine[i] = reflectance.max(input.least).min(T::one());
        }
        flags
    }

    /// Gives pixels without a finite intensity the mean of their finite neighbours, from the edge of a hole inwards. A part of
    /// the mask without any intensity is taken as flat, for want of better; a mask without any is refused.
    fn fill_holes(&mut self, pixels: usize) -> Result<(), SfsError> {
        for _ in 0..pixels {
            let before = self.holes.len();
            if before == 0 {
                break;
            }
            // `kept` holds the new values until the pass is over, so that the order does not matter.
            let mut values = core::mem::take(&mut self.kept);
            values.clear();
            values.extend(self.holes.iter().map(|&i| self.mean_around(i)));
            for (&i, &value) in self.holes.iter().zip(&values) {
                self.cosine[i] = value;
            }
            self.kept = values;
            let cosine = &self.cosine;
            self.holes.retain(|&i| cosine[i].is_nan());
            if self.holes.len() == before {
                if before
                    == self
                        .node
                        .iter()
                        .filter(|&&node| node != Node::Outside)
                        .count()
                {
                    return Err(SfsError::EmptyMask);
                }
                self.holes.drain(..).for_each(|i| self.cosine[i] = T::one());
            }
        }
        Ok(())
    }

    /// Mean reflectance of the eight neighbours that have one, NaN if none has.
    fn mean_around(&self, i: usize) -> T {
        let (mut sum, mut count) = (T::zero(), 0usize);
        for line in [i - self.width, i, i + self.width] {
            for j in [line - 1, line, line + 1] {
                if self.node[j] != Node::Outside && self.cosine[j].is_finite() {
                    sum += self.cosine[j];
                    count += 1;
                }
            }
        }
        if count > 0 {
            sum / T::of(count as f64)
        } else {
            T::nan()
        }
    }
}

/// The pixel of the frame under a node of the grid, whose border may lie outside the frame.
fn pixel(
    area: BoundingBox,
    [r, c]: [usize; 2],
    (rows, columns): (usize, usize),
) -> Option<(usize, usize)> {
    let row = (area.top + r).checked_sub(1).filter(|&row| row < rows)?;
    let column = (area.left + c)
        .checked_sub(1)
        .filter(|&column| column < columns)?;
    Some((row, column))
}
