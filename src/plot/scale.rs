//! How axes count, and what they span.
use super::layer::Layer;
use super::panel::Panel;

/// How an axis counts.
///
/// ```
/// use tactile_imaging::plot::{Colour, Page, Panel, Scale};
/// let decades = [[0.0, 1e2], [1.0, 1e4], [2.0, 1e8]]; // depth (mm), modulus (Pa)
/// let panel = Panel::new("").y_label("modulus (Pa)").line(decades, Colour::BLUE, "");
/// let svg = |y| Page::new("").panel(panel.clone().scales(Scale::Linear, y)).to_svg();
/// assert!(svg(Scale::Linear)?.contains("0.2×10⁸"));
/// assert!(svg(Scale::Log10)?.contains("1×10⁶"));
/// # Ok::<(), tactile_imaging::plot::PlotError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Scale {
    /// Equal steps for equal differences.
    #[default]
    Linear,
    /// Equal steps for equal ratios; positions that are not positive are left out.
    Log10,
}

impl Scale {
    pub(super) fn forward(self, v: f64) -> f64 {
        match self {
            Self::Linear => v,
            Self::Log10 => v.log10(),
        }
    }
}

impl Panel {
    /// The ranges of both axes on their scales, a little wider than the data (not around heat maps).
    pub(super) fn ranges(&self) -> [[f64; 2]; 2] {
        let mut bounds = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        for layer in &self.layers {
            layer.visit(|p| {
                let q = [self.scales[0].forward(p[0]), self.scales[1].forward(p[1])];
                if q.iter().all(|v| v.is_finite()) {
                    for (b, v) in bounds.iter_mut().zip(q) {
                        *b = [b[0].min(v), b[1].max(v)];
                    }
                }
            });
        }
        let tight = self.layers.iter().any(|l| matches!(l, Layer::Heat(_)));
        let [x, y] = bounds.map(|b| widen(b, if tight { 0.0 } else { 0.04 }));
        let fixed = |r: Option<[f64; 2]>, s: Scale| r.map(|r| widen(r.map(|v| s.forward(v)), 0.0));
        [
            fixed(self.x_range, self.scales[0]).unwrap_or(x),
            fixed(self.y_range, self.scales[1]).unwrap_or(y),
        ]
    }
}

/// A range with a margin; never empty, never without bounds.
fn widen([lo, hi]: [f64; 2], share: f64) -> [f64; 2] {
    if !(lo.is_finite() && hi.is_finite()) {
        return [0.0, 1.0];
    }
    let width = hi - lo;
    let least = 1e-9 * lo.abs().max(hi.abs());
    if width > least {
        [lo - share * width, hi + share * width]
    } else {
        let half = if lo == 0.0 { 0.5 } else { 0.1 * lo.abs() };
        [lo - half, hi + half]
    }
}
