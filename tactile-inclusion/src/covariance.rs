//! Covariance of ring means: errors of the sensor and of the model.

use crate::forward::Solved;
use crate::parameters::Parameters;
use crate::picture::{CellPositions, Cells};
use crate::tissue_block::SensorErrors;
use nalgebra::DMatrix;
use std::sync::Arc;
use tactile_fem::Interface;

/// Number of points on the half circle for averaging a kernel. The integrand is periodic and smooth
/// except for a kink of the third derivative, which leaves four digits.
const RING_POINTS: i32 = 48;

/// Relative errors of the finite elements, from a comparison with the pressure of another code
/// within three quarters of the face.
#[derive(Debug, Clone, Copy)]
struct ModelErrors {
    /// Common factor of all pressures and forces.
    scale: f64,
    /// Error of the profile's shape, correlated over [`SHAPE_LENGTH`] times the outermost radius.
    shape: f64,
    /// Effect of the singular pressure at the rim, at the outermost radius: codes resolve a
    /// singularity differently. It grows with the square of the radius.
    rim: f64,
    /// Error of the pressure on the scale of the elements, correlated over `element` times the
    /// outermost radius.
    rough: f64,
    element: f64,
    /// Error of the forces in addition to that of the pressures. Most of it arises at the rim of
    /// the guide.
    force: f64,
    /// Additional effect of the rim as the face sinks in, at the outermost radius and the last
    /// frame. It grows with the sixth power of the radius and with the load. Half of its variance
    /// is correlated over `element`, from waves of the elements' length.
    sinking: f64,
    /// Corresponding error of the forces.
    sinking_force: f64,
    /// Effect of the radial component of the pressure on the bent face, which the model neglects.
    /// The value is for the last frame, is correlated like the shape, and grows with the load.
    bent: f64,
}

/// Correlation length of the shape error, relative to the outermost radius.
const SHAPE_LENGTH: f64 = 0.4;

/// Comparison with CalculiX for bonded blocks with and without an inclusion. All pressures are 0.05
/// to 0.2 % low, and forces are 0.1 to 1 % low. The shape agrees within 0.1 % and is low by 0.05 to
/// 0.3 % towards the rim, with waves of 0.05 to 0.1 %. The part that grows as the face sinks in is
/// the difference between meshes with 5 and 10 elements per eighth. It is 0.1 % at the outermost
/// radius and 0.3 % of the force.
const BONDED: ModelErrors = ModelErrors {
    scale: 2e-3,
    shape: 7e-4,
    rim: 2e-3,
    rough: 1e-3,
    element: 0.08,
    force: 6e-3,
    sinking: 1e-3,
    sinking_force: 3e-3,
    bent: 0.0,
};

/// Comparison without friction: all pressures are 0.05 to 0.25 % low. The shape agrees within 0.1
/// %. Towards the rim it is low by up to 0.2 % in soft tissue, and by 0.85 % in tissue a third as
/// stiff as the guide. Over eight blocks of `evidence/inclusion_scenes.py` the root mean square is
/// 0.5 %. Four fifths of this disappear if CalculiX's elements at the rim are a quarter as long,
/// but the data were not computed in that way. On the axis above a shallow inclusion the difference
/// is up to 0.4 %, and forces are 0.2 to 1.3 % low. The growing part is 0.1 to 0.25 % at the
/// outermost radius, between rim elements of 0.02, 0.05 and 0.08 radii. The radial component,
/// applied as nodal forces at a tenth of the block's height, bends the profile by 0.15 % across an
/// inclusion, and more above a shallow one.
const FRICTIONLESS: ModelErrors = ModelErrors {
    scale: 2e-3,
    shape: 1.2e-3,
    rim: 5e-3,
    rough: 1.2e-3,
    element: 0.12,
    force: 6e-3,
    sinking: 2.5e-3,
    sinking_force: 3e-3,
    bent: 1.5e-3,
};

/// The mesh to which a covariance applies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Resolution {
    /// The mesh of the final fit.
    Answer,
    /// The mesh of the first fits.
    FirstFits,
}

impl ModelErrors {
    /// Creates the errors. `part` is the fraction of the model's error that is included.
    fn new(interface: Interface, resolution: Resolution, part: f64) -> Self {
        let whole = match interface {
            Interface::Bonded => BONDED,
            Interface::Frictionless => FRICTIONLESS,
        };
        let fine = Self {
            scale: part * whole.scale,
            shape: part * whole.shape,
            rim: part * whole.rim,
            rough: part * whole.rough,
            force: part * whole.force,
            sinking: part * whole.sinking,
            sinking_force: part * whole.sinking_force,
            bent: part * whole.bent,
            ..whole
        };
        match resolution {
            Resolution::Answer => fine,
            // Half a per cent for a deep inclusion, up to 2 % above a shallow one.
            Resolution::FirstFits => Self {
                rough: 8e-3,
                element: 0.2,
                ..fine
            },
        }
    }
}

/// Matérn kernel of order 3/2 between points of two rings, averaged over their angle.
fn ring_kernel(a: f64, b: f64, length: f64) -> f64 {
    let mut sum = 0.0;
    for k in 0..RING_POINTS {
        let angle = core::f64::consts::PI * (f64::from(k) + 0.5) / f64::from(RING_POINTS);
        let squared = (a * a + b * b - 2.0 * a * b * angle.cos()).max(0.0);
        sum += kernel(squared.sqrt(), length);
    }
    sum / f64::from(RING_POINTS)
}

/// Values of all frames: the pressures of each frame in turn, then the forces.
#[derive(Debug, Clone)]
pub(crate) struct Observed {
    pub radii_m: Vec<f64>,
    pub values: Vec<f64>,
    /// White errors. Infinite for an unknown force.
    pub white: Vec<f64>,
    pub frames: usize,
    /// Data of a whole face.
    pub cells: Option<ObservedCells>,
}

/// Cells of a face with measured pressures.
#[derive(Debug, Clone)]
pub(crate) struct ObservedCells {
    pub positions: Arc<CellPositions>,
    /// Standard error of a press's position along each axis.
    pub place_error_m: f64,
    /// Standard error of the approach zero that is specific to one press.
    pub zero_error_m: f64,
    /// The reciprocal approach of each frame.
    pub per_approach: Vec<f64>,
    /// Mean of each value and that of the opposite cell across the axis, relative to the value: the
    /// pressure of a tilted face without the tilt.
    pub even: Vec<f64>,
    /// Relative error of the pressure of an off-axis inclusion, for each cell.
    pub aside: Vec<f64>,
}

/// Error of the pressure of an off-axis inclusion, relative to its distance from the axis in radii
/// of the face and to the relative increase of pressure that it causes. Solutions in three
/// dimensions differ by 0.2 to 0.6 % of the pressure at 0.25 to 0.5 radii. Their inclusions raise
/// the pressure by a fifth to a factor of three.
const ASIDE: f64 = 0.034;

/// Error of the pressure on a whole face on the scale of the elements, in addition to that of
/// rings. Solutions of plain blocks in three dimensions by another program scatter by 0.12 to 0.25
/// %.
const ROUGH_PICTURE: f64 = 2e-3;

/// Standard error of the angle between face and block, in radians: two degrees.
const TILT: f64 = 0.035;

/// Matérn kernel of order 3/2.
fn kernel(distance: f64, length: f64) -> f64 {
    let scaled = 3f64.sqrt() * distance / length;
    (1.0 + scaled) * (-scaled).exp()
}

impl ObservedCells {
    /// Cells with their values, frame by frame. `zero_error_m` is the standard error of the
    /// approach zero specific to each press of a scan.
    pub(crate) fn new(
        positions: CellPositions,
        [place_error_m, zero_error_m]: [f64; 2],
        values: &[f64],
        approaches_m: &[f64],
    ) -> Self {
        let CellPositions {
            positions_m,
            presses,
            axes_m,
        } = &positions;
        let count = positions_m.len();
        let opposite = |cell: usize| {
            let [x, y] = positions_m[cell];
            let away = |k: &usize| (positions_m[*k][0] + x).hypot(positions_m[*k][1] + y);
            let of_press = (0..count).filter(|k| presses[*k] == presses[cell]);
            let nearest = of_press.min_by(|a, b| away(a).total_cmp(&away(b)));
            nearest.unwrap_or(cell)
        };
        let opposites: Vec<usize> = (0..count).map(opposite).collect();
        let frames = values.chunks(count).take(approaches_m.len());
        let even = frames.flat_map(|frame| {
            let pairs = frame.iter().zip(&opposites);
            pairs.map(|(value, other)| 0.5 * (1.0 + frame[*other] / value))
        });
        Self {
            even: even.collect(),
            per_approach: approaches_m.iter().map(|a| a.recip()).collect(),
            aside: vec![0.0; count],
            zero_error_m: if axes_m.len() > 1 { zero_error_m } else { 0.0 },
            place_error_m,
            positions: Arc::new(positions),
        }
    }
}

impl Observed {
    /// Whether two rings or cells belong to the same press.
    fn is_one_press(&self, i: usize, j: usize) -> bool {
        self.cells.as_ref().is_none_or(|cells| {
            let presses = &cells.positions.presses;
            presses[i] == presses[j]
        })
    }

    /// Pressure of each frame relative to the last one. This is nearly the ratio of their
    /// approaches.
    fn loads(&self) -> Vec<f64> {
        let rings = self.radii_m.len();
        let sums = self.values[..self.frames * rings].chunks(rings);
        let sums: Vec<f64> = sums.map(|frame| frame.iter().sum()).collect();
        let last = sums.last().copied().unwrap_or(1.0);
        sums.into_iter().map(|sum| sum / last).collect()
    }

    /// Adds the relative error of the combined pressure of two inclusions, in quadrature with the
    /// errors of each.
    pub(crate) fn with_neighbours(mut self, error: f64) -> Self {
        let aside = self.cells.iter_mut().flat_map(|cells| &mut cells.aside);
        aside.for_each(|aside| *aside = aside.hypot(error));
        self
    }

    /// Adds the errors of the pressure of the first inclusion if it is off the axis, in quadrature
    /// with those of another inclusion. Far from a face the errors fade together with the
    /// inclusion's contribution. `face` are the cells of the model that was solved.
    pub(crate) fn with_lump_aside(
        mut self,
        block: &Parameters,
        face: Option<&Cells>,
        solved: &Solved,
    ) -> Self {
        if let (Some(cells), Some(face)) = (&mut self.cells, face) {
            let asides_m = cells.positions.asides_m(block);
            let lift = face.lift(&solved.frames).min(1.0);
            for (before, press) in cells.aside.iter_mut().zip(&cells.positions.presses) {
                let aside_m = asides_m[*press];
                let share = lift * face.fade(aside_m, aside_m);
                *before = before.hypot(ASIDE * aside_m / face.face_radius_m * share);
            }
        }
        self
    }

    /// Covariance of the relative errors of two cells because of an off-axis inclusion.
    fn aside(&self, i: usize, j: usize) -> f64 {
        let cells = self.cells.as_ref();
        cells.map_or(0.0, |cells| cells.aside[i] * cells.aside[j])
    }

    /// Covariance of the relative pressures of two cells of a press in two frames, because of the
    /// angle θ between face and block and the zero of the press's approaches. The pressure of a
    /// rigid punch grows by 2 θ x / δ at the approach δ. Ring means are not affected.
    fn posture(&self, i: usize, j: usize, k: usize, l: usize) -> f64 {
        let Some(cells) = &self.cells else {
            return 0.0;
        };
        let positions_m = &cells.positions.positions_m;
        let [a, b] = [positions_m[i], positions_m[j]];
        let even = cells.even[k * positions_m.len() + i] * cells.even[l * positions_m.len() + j];
        let tilt = (2.0 * TILT).powi(2) * (a[0] * b[0] + a[1] * b[1]) * even;
        (tilt + cells.zero_error_m.powi(2)) * cells.per_approach[k] * cells.per_approach[l]
    }

    /// Covariance of the values. Relative errors refer to the observed values.
    pub(crate) fn covariance(
        &self,
        sensor: &SensorErrors,
        interface: Interface,
        resolution: Resolution,
    ) -> DMatrix<f64> {
        let mut model = ModelErrors::new(interface, resolution, sensor.model);
        if self.cells.is_some() {
            model.rough = model.rough.hypot(sensor.model * ROUGH_PICTURE);
        }
        let (frames, rings) = (self.frames, self.radii_m.len());
        let outermost = self.radii_m.iter().copied().fold(0.0, f64::max);
        let correlation = |i: usize, k: usize, length: f64| match &self.cells {
            Some(cells) => {
                let [a, b] = [i, k].map(|cell| cells.positions.positions_m[cell]);
                kernel((a[0] - b[0]).hypot(a[1] - b[1]), length)
            }
            None => ring_kernel(self.radii_m[i], self.radii_m[k], length),
        };
        let values = &self.values;
        let loads = self.loads();
        let mut covariance = DMatrix::from_fn(values.len(), values.len(), |i, k| {
            model.scale.powi(2) * values[i] * values[k]
        });
        for (i, &a) in self.radii_m.iter().enumerate() {
            for (j, &b) in self.radii_m.iter().enumerate() {
                let smooth = correlation(i, j, sensor.correlation_m);
                let wide = correlation(i, j, SHAPE_LENGTH * outermost);
                let short = correlation(i, j, model.element * outermost);
                // Presses share the errors of sensor and rim. The errors of inclusion, tilt, frames
                // and position are specific to each press.
                let is_one_press = self.is_one_press(i, j);
                let own = if is_one_press { 1.0 } else { 0.0 };
                let shape = (model.shape.powi(2) + self.aside(i, j)) * wide;
                let rough = model.rough.powi(2) * short;
                let rim = (model.rim * a * b / outermost.powi(2)).powi(2);
                let common = sensor.common.powi(2) * smooth + rim + own * (shape + rough);
                let waves = 0.5 + 0.5 * short;
                let rise = (a * b / outermost.powi(2)).powi(6);
                let bent = own * model.bent.powi(2) * wide;
                let grown = waves * model.sinking.powi(2) * rise + bent;
                for k in 0..frames {
                    for l in 0..frames {
                        let (row, column) = (k * rings + i, l * rings + j);
                        let mut relative = common + grown * loads[k] * loads[l];
                        if is_one_press {
                            relative += self.posture(i, j, k, l);
                            if k == l {
                                relative += sensor.each_frame.powi(2) * smooth;
                            }
                        }
                        covariance[(row, column)] +=
                            relative * values[row] * values[column] + sensor.zero_pa.powi(2);
                    }
                }
            }
        }
        for k in frames * rings..values.len() {
            covariance[(k, k)] += (sensor.force * values[k]).powi(2);
            for l in frames * rings..values.len() {
                let grown = loads[k - frames * rings] * loads[l - frames * rings];
                let relative = model.force.powi(2) + model.sinking_force.powi(2) * grown;
                covariance[(k, l)] += relative * values[k] * values[l];
            }
        }
        for (k, white) in self.white.iter().enumerate() {
            covariance[(k, k)] += white * white;
        }
        covariance
    }
}
