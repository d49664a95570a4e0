//! A gel that darkens where it is pressed: from grey levels to the face by a table, and contacts.
//!
//! The depth of a pixel follows from its darkness alone, that is its level in the reference minus
//! its level in the frame. Contacts are the regions that are darker than a threshold.

use std::sync::Arc;

use ndarray::{Array2, ArrayView2};
use tactile_core::regions;
use tactile_core::statistics::median;
use tactile_sfs::DepthTable;

use crate::GelError;
use crate::contacts::Patch;
use crate::error::same_shape;
use crate::face::{Face, GelFrame};
use crate::frame_check::{Blocks, FrameDoubt, light};
use crate::model::DarkModel;

/// Regions with fewer pixels are specks of noise.
const LEAST_PIXELS: usize = 12;
/// The largest blurred darkness of a contact exceeds the threshold by this number of standard
/// deviations of the noise. Others are islands of noise, for example where a dent fades.
const EVIDENCE: f64 = 5.0;
/// Standard error of the position of a contact's edge in pixels without noise: the threshold is
/// crossed within a pixel.
const EDGE_PX: f64 = 0.5;
/// Number of directions in which an edge has an independent error. Pixels of one direction are
/// averaged.
const DIRECTIONS: f64 = 10.0;
/// Noise of a difference of two 8-bit frames from rounding alone, in grey levels.
const LEAST_NOISE_GREY: f64 = 0.41;
/// Factor of the noise of a pixel after the blur by (1, 4, 6, 4, 1)/16 along both axes.
const BLURRED_NOISE: f64 = 70.0 / 256.0;
/// If the part of the frame that is brighter than the reference exceeds the darker part by this
/// factor, frame and reference are probably exchanged.
const BRIGHTER: usize = 4;

/// A sensor of a gel that darkens.
#[derive(Clone)]
pub(crate) struct DarkSensor {
    pub(crate) model: DarkModel,
    table: DepthTable<f64>,
    reference: Arc<Array2<u8>>,
    blocks: Arc<Blocks>,
}

/// Darkness of a frame in grey levels, without the change of the whole frame.
pub(crate) struct Darkness {
    pub levels: Array2<f64>,
    /// Increase of the whole frame over the reference.
    pub step: f64,
    /// The levels blurred by (1, 4, 6, 4, 1)/16 along both axes.
    pub blurred: Array2<f64>,
    /// Standard deviation of the noise.
    noise: f64,
}

impl DarkSensor {
    pub(crate) fn new(model: DarkModel, reference: ArrayView2<'_, u8>) -> Result<Self, GelError> {
        let (rows, columns) = reference.dim();
        if rows == 0 || columns == 0 {
            return Err(GelError::EmptyImage { rows, columns });
        }
        Ok(Self {
            table: model.depth_table()?,
            blocks: Arc::new(Blocks::of_grey(reference, 0.0)),
            reference: Arc::new(reference.to_owned()),
            model,
        })
    }

    /// The frame without contact.
    pub(crate) fn reference(&self) -> ArrayView2<'_, u8> {
        self.reference.view()
    }

    pub(crate) fn read(&self, frame: ArrayView2<'_, u8>) -> Result<GelFrame, GelError> {
        same_shape("frame", self.reference.dim(), frame.dim())?;
        let darkness = self.darkness(frame);
        let mut doubts = self.doubts(frame, darkness.step);
        if doubts.iter().any(FrameDoubt::refuses) {
            return Ok(GelFrame::refused(frame.dim(), doubts));
        }
        let patches = self.patches(&darkness);
        doubts.extend(
            self.exchanged(&darkness.levels)
                .then_some(FrameDoubt::Brighter),
        );
        for (contact, patch) in patches.iter().enumerate() {
            let darkest = patch.pixels.iter().map(|at| darkness.blurred[*at]);
            if !self.table.depth(darkest.fold(0.0, f64::max)).1 {
                doubts.push(FrameDoubt::BeyondTable { contact });
            }
        }
        Ok(self.frame(&darkness, &patches, doubts))
    }

    /// Whether the frame comes from this sensor, from its border. The pattern of the light is
    /// compared after the change of the whole frame is subtracted.
    pub(crate) fn doubts(&self, frame: ArrayView2<'_, u8>, step: f64) -> Vec<FrameDoubt> {
        use FrameDoubt::{AnotherPattern, Turned};
        let of = |step| light(&Blocks::of_grey(frame, step), &self.blocks).doubts;
        let is_pattern = |doubt: &FrameDoubt| matches!(doubt, AnotherPattern(_) | Turned(_));
        let (mut doubts, mut pattern) = (of(0.0), of(step));
        doubts.retain(|doubt| !is_pattern(doubt));
        pattern.retain(is_pattern);
        doubts.extend(pattern);
        doubts
    }

    /// Darkness of a frame of the reference's size. If all levels change by more than the
    /// threshold, measured along the border of the frame, the change is subtracted.
    pub(crate) fn darkness(&self, frame: ArrayView2<'_, u8>) -> Darkness {
        let (rows, columns) = frame.dim();
        // A sixteenth of the frame on each side.
        let (high, wide) = (rows.div_ceil(16), columns.div_ceil(16));
        let border =
            |r: usize, c: usize| r < high || c < wide || r + high >= rows || c + wide >= columns;
        let steps = frame.indexed_iter().filter(|((r, c), _)| border(*r, *c));
        let steps = steps.map(|(at, level)| f64::from(*level) - f64::from(self.reference[at]));
        let mut steps: Vec<f64> = steps.collect();
        let change = median(&mut steps);
        let mut deviations: Vec<f64> = steps.iter().map(|step| (step - change).abs()).collect();
        let noise = (1.4826 * median(&mut deviations)).max(LEAST_NOISE_GREY);
        let is_step = change.abs() > self.model.threshold_grey;
        let step = if is_step { change } else { 0.0 };
        let mut levels = self.reference.mapv(f64::from);
        levels.zip_mut_with(&frame, |level, own| *level += step - f64::from(*own));
        Darkness {
            blurred: blurred(&levels),
            levels,
            step,
            noise,
        }
    }

    /// The regions that are darker than the threshold, the widest first.
    pub(crate) fn patches(&self, darkness: &Darkness) -> Vec<Patch> {
        let Darkness {
            levels,
            blurred,
            noise,
            ..
        } = darkness;
        let columns = levels.ncols();
        let least = self.model.threshold_grey + EVIDENCE * BLURRED_NOISE * noise;
        let is_dark = |d: &f64| *d > self.model.threshold_grey;
        let mut dark: Vec<bool> = levels.iter().map(is_dark).collect();
        let found = regions(&mut dark, columns).filter(|region| region.len() >= LEAST_PIXELS);
        let found = found.map(|region| patch(region, blurred, *noise));
        let is_contact = |patch: &Patch| patch.pixels.iter().any(|at| blurred[*at] > least);
        let mut patches: Vec<Patch> = found.filter(is_contact).collect();
        patches.sort_by_key(|patch| core::cmp::Reverse(patch.pixels.len()));
        patches
    }

    /// Whether far more of the frame is brighter than the reference than darker.
    fn exchanged(&self, darkness: &Array2<f64>) -> bool {
        let limit = self.model.threshold_grey;
        let count = |is: &dyn Fn(f64) -> bool| darkness.iter().filter(|d| is(**d)).count();
        count(&|d| d < -limit) > BRIGHTER * count(&|d| d > limit) + LEAST_PIXELS
    }

    fn frame(&self, darkness: &Darkness, patches: &[Patch], doubts: Vec<FrameDoubt>) -> GelFrame {
        let size = self.model.pixel_size_m;
        let blurred = &darkness.blurred;
        let smooth = blurred.mapv(|level| self.depth(level));
        let along = |axis: usize| {
            Array2::from_shape_fn(smooth.dim(), |(r, c)| {
                (gradient_at(&smooth, r, c)[axis] / size) as f32
            })
        };
        let gradient = [along(0), along(1)];
        // Depth per grey level, in the mean of the darkest contact or of the table.
        let darkest = patches.iter().flat_map(|patch| &patch.pixels);
        let darkest = darkest.map(|at| blurred[*at]).fold(0.0, f64::max);
        let darkest = if darkest > 0.0 {
            darkest
        } else {
            self.darkest()
        };
        let per_grey = self.depth(darkest) / darkest;
        let rest_error = 0.5 * per_grey;
        let noise = per_grey * darkness.noise;
        let face = Face {
            pixel_size_m: size,
            slope_standard_error: self.model.slope_standard_error,
            depth: &smooth,
            gradient: &gradient,
            rest_error,
            noise_m: (noise * BLURRED_NOISE).hypot(rest_error),
        };
        let mut labels = Array2::zeros(smooth.dim());
        for (k, patch) in patches.iter().enumerate() {
            for at in &patch.pixels {
                labels[*at] = k as u16 + 1;
            }
        }
        let contacts = patches.iter().map(|patch| face.contact(patch)).collect();
        let pixel = self.model.depth_standard_error_m.hypot(noise);
        GelFrame {
            contacts,
            // Noise of a difference over two blurred pixels, whose blurs overlap.
            normal_standard_error: noise * BLURRED_NOISE / size,
            gradient,
            depth_m: darkness.levels.mapv(|level| self.depth(level)),
            depth_standard_error_m: [pixel, rest_error],
            slope_standard_error: self.model.slope_standard_error,
            background_step_grey: darkness.step,
            labels,
            doubts,
        }
    }

    /// Darkness of the last entry of the table.
    fn darkest(&self) -> f64 {
        let levels = self.model.table.iter().map(|[darkness, _]| *darkness);
        levels.fold(f64::MIN_POSITIVE, f64::max)
    }

    /// Depth of a darkness. Brightness counts as negative depth, so that noise has no mean depth.
    fn depth(&self, darkness: f64) -> f64 {
        self.table.depth(darkness.abs()).0.copysign(darkness)
    }
}

/// A region from the indices of its pixels. Its rim are the pixels with a neighbour outside.
fn patch(mut region: Vec<usize>, blurred: &Array2<f64>, noise: f64) -> Patch {
    let (rows, columns) = blurred.dim();
    region.sort_unstable();
    let inside = |r: usize, c: usize| region.binary_search(&(r * columns + c)).is_ok();
    let at_rim = |at: &&usize| {
        let (r, c) = (*at / columns, *at % columns);
        let free = [
            r > 0 && !inside(r - 1, c),
            r + 1 < rows && !inside(r + 1, c),
            c > 0 && !inside(r, c - 1),
            c + 1 < columns && !inside(r, c + 1),
        ];
        free.contains(&true)
    };
    let place = |at: &usize| [at / columns, at % columns];
    let area = region.len() as f64;
    let radius = (area / core::f64::consts::PI).sqrt();
    let rim: Vec<[usize; 2]> = region.iter().filter(at_rim).map(place).collect();
    // Where the darkness fades slowly, its noise moves the edge.
    let slopes = rim.iter().map(|at| {
        let [x, y] = gradient_at(blurred, at[0], at[1]);
        x.hypot(y)
    });
    let slope = slopes.sum::<f64>() / rim.len().max(1) as f64;
    let shift = noise / slope.max(f64::MIN_POSITIVE);
    let edge_error = EDGE_PX.hypot(shift / (rim.len() as f64 / DIRECTIONS).max(1.0).sqrt());
    Patch {
        pixels: region.iter().map(place).collect(),
        area,
        edge_error: edge_error.min(radius),
        radius,
        rim,
    }
}

/// Levels blurred by (1, 4, 6, 4, 1)/16 along both axes. The border is extended by its last pixel.
fn blurred(levels: &Array2<f64>) -> Array2<f64> {
    let (rows, columns) = levels.dim();
    let near = |at: usize, k: usize, n: usize| (at + k).saturating_sub(2).min(n - 1);
    let sum = |level: &dyn Fn(usize) -> f64| {
        let [a, b, c, d, e] = [0, 1, 2, 3, 4].map(level);
        (a + e + 4.0 * (b + d) + 6.0 * c) / 16.0
    };
    let along = Array2::from_shape_fn(levels.dim(), |(r, c)| {
        sum(&|k| levels[[r, near(c, k, columns)]])
    });
    Array2::from_shape_fn(levels.dim(), |(r, c)| {
        sum(&|k| along[[near(r, k, rows), c]])
    })
}

/// Gradient along x and y per pixel by central differences, one-sided at the border.
fn gradient_at(values: &Array2<f64>, r: usize, c: usize) -> [f64; 2] {
    let (rows, columns) = values.dim();
    let [left, right] = [c.saturating_sub(1), (c + 1).min(columns - 1)];
    let [above, below] = [r.saturating_sub(1), (r + 1).min(rows - 1)];
    [
        (values[[r, right]] - values[[r, left]]) / (right - left).max(1) as f64,
        (values[[below, c]] - values[[above, c]]) / (below - above).max(1) as f64,
    ]
}
