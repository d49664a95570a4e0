//! The padded grid of the mask's bounding box the sweeps run on, in units of a pixel's width.

use super::{flags_of, rim};
use crate::{Domain, Frame, Lighting, PixelFlags, Scalar, SfsError, Surface};

/// What a node of the grid is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Node {
    /// Not in the mask.
    #[default]
    Outside,
    /// To be solved for.
    Unknown,
    /// In the mask, height given.
    Known,
}

/// How intensities become slopes.
pub(super) struct Slopes<'a, T> {
    pub(super) lighting: &'a Lighting<T>,
    pub(super) max_slope: T,
}

/// How many heights are known.
pub(super) struct KnownCount {
    pub(super) inside: usize,
}

/// Buffers of the sweeps: the mask's box with a border of one pixel all around.
#[derive(Debug, Default)]
pub(crate) struct EikonalBuffers<T> {
    /// Nodes per row.
    pub(super) width: usize,
    /// Height of a pixel over its width.
    pub(super) aspect: T,
    pub(super) node: Vec<Node>,
    /// Nodes whose value may still improve.
    pub(super) active: Vec<bool>,
    /// Reflectance R = cos of the angle between normal and light.
    pub(super) cosine: Vec<T>,
    /// sin of that angle.
    pub(super) sine: Vec<T>,
    /// Given heights: inside the mask at the pixel's centre, outside it at the mask's border; NaN elsewhere.
    pub(super) given: Vec<T>,
    /// Height of the branch (its negative when falling), +∞ where not reached.
    pub(super) value: Vec<T>,
    /// Values of the branch solved first.
    pub(super) kept: Vec<T>,
    /// Height of a node above the rim next to it, NaN away from the rim.
    pub(super) rise: Vec<T>,
    /// 1/(slope · step)² of the edge to the next node in x and in y.
    pub(super) edges: Vec<[T; 2]>,
    /// cos²φ of the gradient of an earlier solution, and whether sweeps use it.
    pub(super) along_x: Vec<T>,
    pub(super) corrected: bool,
    /// Nodes whose intensity is not finite.
    holes: Vec<usize>,
}

impl<T: Scalar> EikonalBuffers<T> {
    fn clear(&mut self, rows: usize, columns: usize) {
        self.width = columns + 2;
        let length = self.width * (rows + 2);
        fill(&mut self.node, length, Node::Outside);
        fill(&mut self.active, length, false);
        fill(&mut self.cosine, length, T::one());
        fill(&mut self.sine, length, T::zero());
        fill(&mut self.given, length, T::nan());
        fill(&mut self.value, length, T::infinity());
        fill(&mut self.rise, length, T::nan());
        fill(&mut self.edges, length, [T::one(); 2]);
        fill(&mut self.along_x, length, T::nan());
        self.corrected = false;
        self.holes.clear();
    }

    /// Fills the grid from the image and prepares rim and edges.
    pub(super) fn load(
        &mut self,
        frame: &Frame<'_, T>,
        domain: &Domain<'_, T>,
        slopes: &Slopes<'_, T>,
        rim: Option<T>,
        surface: &mut Surface<T>,
    ) -> Result<KnownCount, SfsError> {
        let area = surface.bounding_box;
        self.clear(area.rows, area.columns);
        let [hx, hy] = domain.pixel_size_m;
        self.aspect = hy / hx;
        let (frame_rows, frame_columns) = frame.dim();
        let least = T::one() / (T::one() + slopes.max_slope * slopes.max_slope).sqrt();
        let (mut inside, mut border) = (0, 0);
        for r in 0..area.rows + 2 {
            let Some(row) = (area.top + r).checked_sub(1).filter(|&row| row < frame_rows) else { continue };
            for c in 0..self.width {
                let Some(column) = (area.left + c).checked_sub(1).filter(|&column| column < frame_columns)
                else {
                    continue;
                };
                let i = r * self.width + c;
                let in_box = r > 0 && c > 0 && r <= area.rows && c <= area.columns;
                let known = domain.known(row, column);
                if in_box && domain.contains(row, column) {
                    self.node[i] = if known.is_some() { Node::Known } else { Node::Unknown };
                    inside += usize::from(known.is_some());
                    self.given[i] = known.map_or(T::nan(), |height| height / hx);
                    let reflectance = slopes.lighting.reflectance(frame.at(row, column));
                    let flags = flags_of(reflectance, least);
                    surface.flags[[row, column]] = flags;
                    if flags == PixelFlags::NON_FINITE {
                        self.holes.push(i);
                        self.cosine[i] = T::nan();
                    } else {
                        self.cosine[i] = reflectance.max(least).min(T::one());
                    }
                } else if let Some(height) = known.or(rim) {
                    self.given[i] = height / hx;
                    border += 1;
                }
            }
        }
        self.fill_holes(area.rows * area.columns)?;
        for (sine, &cosine) in self.sine.iter_mut().zip(&self.cosine) {
            *sine = ((T::one() - cosine) * (T::one() + cosine)).max(T::zero()).sqrt();
        }
        rim::measure(self);
        if inside == 0 && (border == 0 || self.rise.iter().all(|rise| rise.is_nan())) {
            return Err(SfsError::NoKnownHeight);
        }
        self.measure_edges();
        Ok(KnownCount { inside })
    }

    /// Gives pixels without a finite intensity the mean of their finite neighbours, from the edge of a hole inwards.
    fn fill_holes(&mut self, pixels: usize) -> Result<(), SfsError> {
        for _ in 0..pixels {
            if self.holes.is_empty() {
                break;
            }
            let before = self.holes.len();
            let width = self.width;
            let mean = |cosine: &[T], node: &[Node], i: usize| {
                let near = [
                    i - width - 1,
                    i - width,
                    i - width + 1,
                    i - 1,
                    i + 1,
                    i + width - 1,
                    i + width,
                    i + width + 1,
                ];
                let valid = || near.iter().filter(|&&j| node[j] != Node::Outside && cosine[j].is_finite());
                let count = valid().count();
                (count > 0).then(|| valid().map(|&j| cosine[j]).sum::<T>() / T::of(count as f64))
            };
            // `kept` holds the new values until the pass is over, so that the order does not matter.
            self.kept.clear();
            self.kept
                .extend(self.holes.iter().map(|&i| mean(&self.cosine, &self.node, i).unwrap_or_else(T::nan)));
            for (&i, &value) in self.holes.iter().zip(&self.kept) {
                self.cosine[i] = value;
            }
            let cosine = &self.cosine;
            self.holes.retain(|&i| cosine[i].is_nan());
            if self.holes.len() == before {
                return if before == self.node.iter().filter(|&&n| n != Node::Outside).count() {
                    Err(SfsError::EmptyMask)
                } else {
                    // A part of the mask without any intensity: flat for want of better.
                    for &i in &self.holes {
                        self.cosine[i] = T::one();
                    }
                    self.holes.clear();
                    Ok(())
                };
            }
        }
        Ok(())
    }

    /// 1/(slope · step)² by the chord rule for every edge between two nodes of the mask.
    fn measure_edges(&mut self) {
        // A floor keeps flat parts (slope 0) from dividing by zero: 10⁻⁶ pixels per pixel.
        let floor = T::of(1e-6);
        let metric = |i: usize, j: usize, step: T| {
            let slope = (self.sine[i] + self.sine[j]) / (self.cosine[i] + self.cosine[j]);
            (slope.max(floor) * step).powi(-2)
        };
        for i in self.width..self.node.len() - self.width {
            if self.node[i] != Node::Outside {
                self.edges[i] = [metric(i, i + 1, T::one()), metric(i, i + self.width, self.aspect)];
            }
            if self.node[i - 1] == Node::Outside {
                self.edges[i - 1] = [T::one(); 2];
            }
        }
    }

    /// Sets the values sweeping starts from.
    pub(super) fn start(&mut self, rising: bool) {
        let sign = if rising { T::one() } else { -T::one() };
        for i in self.width..self.node.len() - self.width {
            self.active[i] = self.node[i] == Node::Unknown;
            self.value[i] = match self.node[i] {
                Node::Known => sign * self.given[i],
                Node::Unknown if !self.rise[i].is_nan() => rim::lowest(self, i, sign) + self.rise[i],
                _ => T::infinity(),
            };
        }
    }

    /// Keeps the values of the branch just solved.
    pub(super) fn keep(&mut self) {
        self.kept.clear();
        self.kept.extend_from_slice(&self.value);
    }

    /// Takes the kept values back.
    pub(super) fn restore(&mut self) {
        core::mem::swap(&mut self.value, &mut self.kept);
    }

    /// Writes value × `scale` to the surface.
    pub(super) fn store(&self, scale: T, domain: &Domain<'_, T>, surface: &mut Surface<T>) {
        let area = surface.bounding_box;
        for r in 0..area.rows {
            for c in 0..area.columns {
                let i = (r + 1) * self.width + c + 1;
                let (row, column) = (area.top + r, area.left + c);
                match self.node[i] {
                    Node::Outside => {}
                    Node::Known => surface.set(row, column, domain.known(row, column).unwrap_or_else(T::nan)),
                    Node::Unknown if self.value[i].is_finite() => {
                        surface.set(row, column, scale * self.value[i])
                    }
                    Node::Unknown => surface.flags[[row, column]] |= PixelFlags::UNREACHED,
                }
            }
        }
    }
}

/// Makes a buffer `length` copies of `value`.
fn fill<A: Copy>(buffer: &mut Vec<A>, length: usize, value: A) {
    buffer.clear();
    buffer.resize(length, value);
}
