//! Where a panel's axes stand on the page, and how data are brought to it.
use super::layer::Layer;
use super::panel::Panel;
use super::scale::{Scale, widen};

/// Space in pixels for labels, title and colour bar.
const EDGE: f64 = 10.0;
pub(super) const LEFT: f64 = 78.0;
pub(super) const BOTTOM: f64 = 46.0;
pub(super) const TOP: f64 = 34.0;
const RIGHT: f64 = 18.0;
const BAR: f64 = 86.0;

/// The box of the axes on the page in pixels, and what it spans.
pub(super) struct Axes {
    pub(super) corner: [f64; 2],
    pub(super) size: [f64; 2],
    /// Of x and y, on their scales.
    pub(super) ranges: [[f64; 2]; 2],
    pub(super) scales: [Scale; 2],
    pub(super) y_down: bool,
}

impl Axes {
    /// The axes of `panel` in the area with this corner and size.
    pub(super) fn new(panel: &Panel, corner: [f64; 2], size: [f64; 2]) -> Self {
        let ranges @ [x, y] = ranges(panel);
        let has_bar = panel.layers.iter().any(|layer| layer.bar().is_some());
        let right = if has_bar { BAR } else { RIGHT };
        let available =
            [size[0] - EDGE - LEFT - right, size[1] - TOP - BOTTOM].map(|v| v.max(20.0));
        let size = if panel.equal_aspect {
            fit(available, [x[1] - x[0], y[1] - y[0]])
        } else {
            available
        };
        let corner = [
            corner[0] + EDGE + LEFT + ((available[0] - size[0]) / 2.0).round(),
            corner[1] + TOP + ((available[1] - size[1]) / 2.0).round(),
        ];
        Self {
            corner,
            size,
            ranges,
            scales: panel.scales,
            y_down: panel.y_down,
        }
    }

    /// Where a value on the scale of axis `k` (0 for x) stands on the page.
    pub(super) fn along(&self, k: usize, value: f64) -> f64 {
        let [from, to] = self.ranges[k];
        let share = (value - from) / (to - from);
        let downwards = k == 0 || self.y_down;
        let share = if downwards { share } else { 1.0 - share };
        self.corner[k] + share * self.size[k]
    }

    /// Where a position of the data stands on the page; none where it has no finite place on the scales.
    pub(super) fn place(&self, p: [f64; 2]) -> Option<[f64; 2]> {
        let on_page = [0, 1].map(|k| self.along(k, self.scales[k].forward(p[k])));
        on_page.iter().all(|v| v.is_finite()).then_some(on_page)
    }

    /// The page's coordinate of the right edge (0) or the lower edge (1).
    pub(super) fn end(&self, k: usize) -> f64 {
        self.corner[k] + self.size[k]
    }
}

/// The largest box inside `available` with the proportions of the data.
fn fit(available: [f64; 2], data: [f64; 2]) -> [f64; 2] {
    let scale = (available[0] / data[0]).min(available[1] / data[1]);
    data.map(|d| (d * scale).round().max(8.0))
}

/// The ranges of both axes on their scales, a little wider than the data (not around heat maps).
fn ranges(panel: &Panel) -> [[f64; 2]; 2] {
    let mut bounds = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    for layer in &panel.layers {
        layer.visit(|p| {
            let q = [panel.scales[0].forward(p[0]), panel.scales[1].forward(p[1])];
            if q.iter().all(|v| v.is_finite()) {
                for (b, v) in bounds.iter_mut().zip(q) {
                    *b = [b[0].min(v), b[1].max(v)];
                }
            }
        });
    }
    let tight = panel
        .layers
        .iter()
        .any(|layer| matches!(layer, Layer::Heat(_)));
    let margin = if tight { 0.0 } else { 0.04 };
    let fixed = [None, panel.y_range];
    [0, 1].map(|k| match fixed[k] {
        Some(range) => widen(range.map(|v| panel.scales[k].forward(v)), 0.0),
        None => widen(bounds[k], margin),
    })
}
