//! The face of the gel: integrated gradients, the rest level far away, and the contacts.

use ndarray::{Array2, Axis};
use tactile_core::Estimate;

use crate::GelError;
use crate::contacts::{Cells, Patch, block_means};
use crate::frame_check::FrameDoubt;
use crate::integration::integrated;
use crate::model::ColourModel;
use crate::plane::Plane;
use crate::rest::{Tails, rest};

/// Number of cells of the coarse grid along the longer side of a frame.
const COARSE: usize = 40;
/// Variance, in square pixels, of the blur of the frames. The blur reduces the depth by half of it
/// times the Laplacian of the face.
const BLUR: f64 = 1.0;
/// Error of an integrated depth in pixels times slope, from noise that the scale of the calibration
/// does not include.
const DEPTH_NOISE: f64 = 0.01;
/// Depths within this number of standard errors of the noise do not differ from the maximum.
const PLATEAU: f64 = 2.0;
/// Slopes are not those of a surface if the root mean square of their curl exceeds this fraction of
/// that of their divergence.
const CURL: f32 = 0.6;
/// A face is not pressed in if its strong cells point outwards by this fraction of their weight.
const OUTWARDS: f32 = -0.3;

/// Results of one frame.
///
/// Gradients are those of the gel's surface, inside and outside contacts: ∂z/∂x and ∂z/∂y with the
/// depth z in metres, x along columns and y along rows.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct GelFrame {
    /// Gradients along x and y.
    pub gradient: [Array2<f32>; 2],
    /// Standard error of the components of the unit normal: see
    /// [`gradient_error`](Self::gradient_error).
    pub normal_standard_error: f64,
    /// Displacement of the face into the gel, in metres, at each pixel. It is zero far away.
    pub depth_m: Array2<f64>,
    /// Standard error of the depth of a pixel, and of the common rest level, in metres.
    pub depth_standard_error_m: [f64; 2],
    /// Relative standard error common to all slopes.
    pub slope_standard_error: f64,
    /// Increase of the level of the whole frame over the reference, in grey levels, that was
    /// subtracted. 0 for gels lit in colours, whose frames are divided by their exposure.
    pub background_step_grey: f64,
    /// Number of each pixel's contact, counted from 1 in the order of [`contacts`](Self::contacts).
    /// 0 outside contacts.
    pub labels: Array2<u16>,
    /// Contacts in descending order of pressure, or of area for gels that darken.
    pub contacts: Vec<GelContact>,
    /// Why the frame may not come from this sensor.
    pub doubts: Vec<FrameDoubt>,
}

/// A contact.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct GelContact {
    /// Column and row of the centroid.
    pub centroid_px: [Estimate; 2],
    /// Area in square metres.
    pub area_m2: Estimate,
    /// Maximum depth in metres below the contact's own rim.
    pub depth_m: Estimate,
    /// Maximum depth in metres below the gel far away.
    pub depth_below_far_m: Estimate,
    /// Column and row of the maximum depth.
    pub deepest_px: [usize; 2],
    /// Columns and rows of the outline, in order around the contact.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub outline_px: Vec<[usize; 2]>,
    /// Whether the contact reaches the frame's border.
    pub touches_border: bool,
}

impl GelFrame {
    /// The result for a frame that does not come from this sensor.
    pub(crate) fn refused(shape: (usize, usize), doubts: Vec<FrameDoubt>) -> Self {
        let none = || Array2::from_elem(shape, f32::NAN);
        Self {
            gradient: [none(), none()],
            normal_standard_error: f64::NAN,
            depth_m: Array2::from_elem(shape, f64::NAN),
            depth_standard_error_m: [f64::NAN; 2],
            slope_standard_error: f64::NAN,
            background_step_grey: 0.0,
            labels: Array2::zeros(shape),
            contacts: Vec::new(),
            doubts,
        }
    }

    /// Standard errors of the gradients: those of the normal times the derivative of the gradient
    /// by the normal, (1 + g gᵀ) √(1 + g²).
    pub fn gradient_error(&self) -> [Array2<f32>; 2] {
        let sd = self.normal_standard_error as f32;
        let [p, q] = &self.gradient;
        [0, 1].map(|k: usize| {
            let pairs = ndarray::Zip::from(p).and(q);
            pairs.map_collect(|p, q| sd * gradient_errors([*p, *q])[k])
        })
    }

    /// Whether the frame was rejected because it does not come from this sensor.
    pub fn is_refused(&self) -> bool {
        self.doubts.iter().any(FrameDoubt::refuses)
    }
}

/// Standard errors of a gradient for a unit error of the normal.
pub(crate) fn gradient_errors([p, q]: [f32; 2]) -> [f32; 2] {
    let length = (1.0 + p * p + q * q).sqrt();
    [p, q].map(|own| length * ((1.0 + own * own).powi(2) + (p * q).powi(2)).sqrt())
}

/// Computes face and contacts from slopes.
pub(crate) fn frame(
    (model, tails): (&ColourModel, &Tails),
    gradient: [Array2<f32>; 2],
    cells: &Cells,
    patches: Vec<Patch>,
    doubts: Vec<FrameDoubt>,
) -> Result<GelFrame, GelError> {
    let shape = gradient[0].dim();
    let size = model.pixel_size_m;
    let mut depth = integrated(gradient.each_ref(), cells.slopes.each_ref(), size)?;
    let mut labels = Array2::zeros(shape);
    for (k, patch) in patches.iter().enumerate() {
        for at in &patch.pixels {
            labels[*at] = k as u16 + 1;
        }
    }
    let (rest, rest_error) = rest(tails, &depth, &labels, &cells.pressure, size);
    depth -= rest;
    let contacts = patches.iter().map(|patch| {
        let face = Face {
            pixel_size_m: size,
            slope_standard_error: model.slope_standard_error,
            depth: &depth,
            gradient: &gradient,
            rest_error,
            noise_m: 0.0,
        };
        face.contact(patch)
    });
    let contacts = contacts.collect();
    Ok(GelFrame {
        contacts,
        gradient,
        normal_standard_error: model.normal_standard_error,
        depth_m: depth,
        depth_standard_error_m: [model.depth_standard_error_m, rest_error],
        slope_standard_error: model.slope_standard_error,
        background_step_grey: 0.0,
        labels,
        doubts,
    })
}

/// A face whose contacts are measured. It is blurred by [`BLUR`].
pub(crate) struct Face<'a> {
    pub pixel_size_m: f64,
    pub slope_standard_error: f64,
    pub depth: &'a Array2<f64>,
    pub gradient: &'a [Array2<f32>; 2],
    pub rest_error: f64,
    /// Standard error of a depth from the noise of its pixel.
    pub noise_m: f64,
}

impl Face<'_> {
    /// Reduction of the depth at a position by the blur of the frames, from the divergence of the
    /// slopes over 5 × 5 pixels.
    fn blurred_off(&self, [row, column]: [usize; 2]) -> f64 {
        let (rows, columns) = self.depth.dim();
        if row < 2 || column < 2 || row + 2 >= rows || column + 2 >= columns {
            return 0.0;
        }
        let [p, q] = self.gradient;
        let along = (0..5).map(|k| {
            let (r, c) = (row + k - 2, column + k - 2);
            f64::from(p[[r, column + 2]] - p[[r, column - 2]] + q[[row + 2, c]] - q[[row - 2, c]])
        });
        // Differences over four pixels, in five lines.
        let divergence = along.sum::<f64>() / 20.0;
        -0.5 * BLUR * divergence.min(0.0) * self.pixel_size_m
    }

    /// The middle of the pixels whose depth is the maximum within the noise.
    fn deepest(&self, patch: &Patch) -> [usize; 2] {
        let depths = patch.pixels.iter().map(|at| self.depth[*at]);
        let largest = depths.fold(f64::NEG_INFINITY, f64::max);
        let limit = largest - PLATEAU * self.noise_m;
        let plateau = patch.pixels.iter().filter(|at| self.depth[**at] >= limit);
        let count = plateau.clone().count().max(1) as f64;
        let middle = |axis: usize| plateau.clone().map(|at| at[axis] as f64).sum::<f64>() / count;
        let middle = [middle(0), middle(1)];
        let away = |at: &[usize; 2]| (at[0] as f64 - middle[0]).hypot(at[1] as f64 - middle[1]);
        let nearest = plateau.min_by(|a, b| away(a).total_cmp(&away(b)));
        nearest.copied().unwrap_or_default()
    }

    pub(crate) fn contact(&self, patch: &Patch) -> GelContact {
        let (rows, columns) = self.depth.dim();
        let size = self.pixel_size_m;
        let n = patch.pixels.len() as f64;
        let mean = |axis: usize| patch.pixels.iter().map(|at| at[axis] as f64).sum::<f64>() / n;
        // The outline has an independent error in each of about ten directions.
        let centroid_error = 0.3 * patch.edge_error;
        let rim = patch
            .rim
            .iter()
            .filter(|at| at[0] < rows && at[1] < columns);
        let (sums, count) = rim.fold(([0.0; 2], 0.0_f64), |(sums, count), at| {
            let [p, q] = self.gradient.each_ref().map(|g| f64::from(g[*at]));
            (
                [sums[0] + self.depth[*at], sums[1] + p.hypot(q)],
                count + 1.0,
            )
        });
        let [rim, slope] = sums.map(|sum| sum / count.max(1.0));
        let deepest = self.deepest(patch);
        let below_far = self.depth[deepest] + self.blurred_off(deepest);
        let below_rim = (below_far - rim).max(0.0);
        let scale = self.slope_standard_error;
        let noise = (DEPTH_NOISE * size * slope.max(0.1)).hypot(self.noise_m);
        let own = (scale * below_rim)
            .hypot(slope * patch.edge_error * size)
            .hypot(noise);
        let far = (scale * below_far).hypot(self.rest_error).hypot(noise);
        let relative = 2.0 * patch.edge_error / patch.radius.max(1.0);
        let edge =
            |at: &[usize; 2]| at[0] == 0 || at[1] == 0 || at[0] + 1 == rows || at[1] + 1 == columns;
        GelContact {
            centroid_px: [mean(1), mean(0)].map(|v| Estimate::new(v, centroid_error)),
            area_m2: Estimate::new(patch.area, relative * patch.area) * (size * size),
            depth_m: Estimate::new(below_rim, own),
            depth_below_far_m: Estimate::new(below_far, far),
            deepest_px: [deepest[1], deepest[0]],
            outline_px: outline(&patch.pixels),
            touches_border: patch.pixels.iter().any(edge),
        }
    }
}

/// Check whether slopes belong to a face that is pressed in, on blocks of cells.
pub(crate) struct SurfaceCheck {
    block: usize,
    plane: Plane,
}

impl SurfaceCheck {
    pub(crate) fn new((rows, columns): (usize, usize)) -> Self {
        let (rows, columns) = (rows / 2, columns / 2);
        let block = rows.max(columns).div_ceil(COARSE).max(1);
        Self {
            block,
            plane: Plane::new((rows / block, columns / block), 0.2, None),
        }
    }

    /// Whether the curl of slopes on cells is as large as their divergence, or the face bulges out
    /// of the gel.
    pub(crate) fn no_surface(&self, cells: &Cells, noise_floor: f32) -> bool {
        let [p, q] = cells
            .slopes
            .each_ref()
            .map(|slope| block_means(slope.view(), self.block));
        if p.nrows() < 6 || p.ncols() < 6 {
            return false;
        }
        let plane = &self.plane;
        // The outermost cells are affected by the end of the frame.
        let inner = |field: &Array2<f32>| {
            let (rows, columns) = field.dim();
            let field = field.slice_axis(Axis(0), (1..rows - 1).into());
            field
                .slice_axis(Axis(1), (1..columns - 1).into())
                .to_owned()
        };
        let root = |field: &Array2<f32>| {
            (field.iter().map(|v| v * v).sum::<f32>() / field.len() as f32).sqrt()
        };
        let pressure = inner(&plane.pressure(p.view(), q.view()));
        let curl = inner(&plane.curl(p.view(), q.view()));
        let (strength, turning) = (root(&pressure), root(&curl));
        let largest = pressure.iter().fold(0.0_f32, |m, f| m.max(f.abs()));
        // Noise has as much curl as divergence, and no cell far above the others.
        if largest < 60.0 * noise_floor || largest < 4.0 * strength.min(turning) {
            return false;
        }
        let square: f32 = pressure.iter().map(|f| f * f).sum();
        let signed: f32 = pressure.iter().map(|f| f * f.abs()).sum();
        turning > CURL * strength || signed < OUTWARDS * square
    }
}

/// Pixels of a region with a neighbour outside, in order around it, as column and row.
fn outline(pixels: &[[usize; 2]]) -> Vec<[usize; 2]> {
    let Some(&start) = pixels.first() else {
        return Vec::new();
    };
    let inside = |r: i64, c: i64| {
        r >= 0 && c >= 0 && pixels.binary_search(&[r as usize, c as usize]).is_ok()
    };
    // Eight directions, clockwise from the left.
    const AROUND: [(i64, i64); 8] = [
        (0, -1),
        (-1, -1),
        (-1, 0),
        (-1, 1),
        (0, 1),
        (1, 1),
        (1, 0),
        (1, -1),
    ];
    let (mut at, mut from) = ((start[0] as i64, start[1] as i64), 0);
    let mut line = vec![[start[1], start[0]]];
    // Moore tracing: the next pixel is the first one clockwise from the previous one.
    for _ in 0..4 * pixels.len() {
        let next = (1..=8).map(|k| (from + k) % 8).find(|k| {
            let (r, c) = AROUND[*k];
            inside(at.0 + r, at.1 + c)
        });
        let Some(k) = next else {
            break;
        };
        at = (at.0 + AROUND[k].0, at.1 + AROUND[k].1);
        from = (k + 4) % 8;
        let place = [at.1 as usize, at.0 as usize];
        if place == line[0] {
            break;
        }
        line.push(place);
    }
    line
}
