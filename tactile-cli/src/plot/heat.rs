//! Heat maps: values on a grid, averaged over the pixels of the page.
use super::colour::ColorMap;
use super::scale::range_of;
use ndarray::{Array2, ArrayView2};
use std::ops::Range;

/// Values on a regular grid, `[row, column]`; NaN is left light grey.
#[derive(Clone, Debug)]
pub(crate) struct HeatMap {
    pub(super) values: Array2<f64>,
    pub(super) x: [f64; 2],
    pub(super) y: [f64; 2],
    pub(super) map: ColorMap,
    pub(super) range: [f64; 2],
    pub(super) label: String,
}

impl HeatMap {
    /// An image with pixels of `pixel_size` (x, y), in the unit of the axes; the first pixel's centre is the origin.
    ///
    /// The label names the values with their unit. The colours span the finite values; see [`range`](Self::range).
    pub(crate) fn of_pixels(
        values: ArrayView2<'_, f64>,
        pixel_size: [f64; 2],
        label: &str,
    ) -> Self {
        let (rows, columns) = values.dim();
        let span = |n: usize, size: f64| [-0.5 * size, (n as f64 - 0.5) * size];
        Self {
            values: values.to_owned(),
            x: span(columns, pixel_size[0]),
            y: span(rows, pixel_size[1]),
            map: ColorMap::Viridis,
            range: range_of(values.iter()),
            label: label.into(),
        }
    }

    /// An 8-bit frame in grey, black to white over the whole scale.
    pub(crate) fn of_frame(frame: ArrayView2<'_, u8>, pixel_size: [f64; 2]) -> Self {
        let values = frame.mapv(f64::from);
        Self::of_pixels(values.view(), pixel_size, "grey level")
            .colours(ColorMap::Grey)
            .range([0.0, 255.0])
    }

    /// The colours of a bar, from one end to the other.
    pub(super) fn of_bar(map: ColorMap) -> Self {
        let values = Array2::from_shape_fn((64, 1), |(i, _)| i as f64 / 63.0);
        Self {
            values,
            x: [0.0; 2],
            y: [0.0; 2],
            map,
            range: [0.0, 1.0],
            label: String::new(),
        }
    }

    /// Puts the grid's first pixel centre at `origin` instead of (0, 0).
    #[must_use]
    pub(crate) fn origin(mut self, origin: [f64; 2]) -> Self {
        self.x = self.x.map(|v| v + origin[0]);
        self.y = self.y.map(|v| v + origin[1]);
        self
    }

    /// Takes other colours.
    #[must_use]
    pub(crate) fn colours(mut self, map: ColorMap) -> Self {
        self.map = map;
        self
    }

    /// Sets the values at the two ends of the colours.
    #[must_use]
    pub(crate) fn range(mut self, range: [f64; 2]) -> Self {
        self.range = range;
        self
    }

    /// The map as `width` × `height` pixels of red, green, blue; every output pixel is the mean of the finite input pixels
    /// that it covers (or the nearest one). `flip` puts the first row at the bottom.
    pub(super) fn rgb(&self, width: u32, height: u32, flip: bool) -> Vec<u8> {
        let (rows, columns) = self.values.dim();
        let mut out = Vec::with_capacity(3 * (width * height) as usize);
        for y in 0..height {
            let y = if flip { height - 1 - y } else { y };
            let rows = cells(y, height, rows);
            for x in 0..width {
                let columns = cells(x, width, columns);
                let colour = self.map.at(self.unit(self.mean(rows.clone(), columns)));
                out.extend([colour.0, colour.1, colour.2]);
            }
        }
        out
    }

    fn mean(&self, rows: Range<usize>, columns: Range<usize>) -> f64 {
        let cells = rows.flat_map(|r| columns.clone().map(move |c| self.values[[r, c]]));
        let (sum, n) = cells
            .filter(|v| v.is_finite())
            .fold((0.0, 0), |(s, n), v| (s + v, n + 1));
        if n == 0 { f64::NAN } else { sum / f64::from(n) }
    }

    fn unit(&self, value: f64) -> f64 {
        let [lo, hi] = self.range;
        if hi > lo || value.is_nan() {
            (value - lo) / (hi - lo)
        } else {
            0.5
        }
    }
}

/// The cells out of `n` that pixel `i` of `pixels` covers: at least one.
fn cells(i: u32, pixels: u32, n: usize) -> Range<usize> {
    let edge = |i: u32| (f64::from(i) * n as f64 / f64::from(pixels)) as usize;
    let start = edge(i).min(n.saturating_sub(1));
    start..edge(i + 1).clamp(start + 1, n.max(start + 1))
}
