//! Covariance of ring means: the sensor's errors and the model's.

use crate::forward::Forward;
use crate::picture::CellPositions;
use crate::tissue_block::SensorErrors;
use nalgebra::DMatrix;
use std::sync::Arc;
use tactile_fem::Interface;

/// Points of the half circle that a kernel is averaged over. The integrand is periodic and smooth but
/// for a kink of the third derivative: four digits.
const RING_POINTS: i32 = 48;

/// How far the finite elements are from another code's pressure within three quarters of the face,
/// relative.
#[derive(Debug, Clone, Copy)]
struct ModelErrors {
    /// Of all pressures and forces together.
    scale: f64,
    /// Of the profile's shape, correlated over [`SHAPE_LENGTH`] times the outermost radius.
    shape: f64,
    /// What the rim's singular pressure sends inwards, which grows with the square of the radius,
    /// at the outermost one: codes resolve a singularity differently.
    rim: f64,
    /// What elements leave of the pressure within their length, correlated over `element` times the
    /// outermost radius.
    rough: f64,
    element: f64,
    /// Of the forces beyond the pressures': most of it sits at the guide's rim.
    force: f64,
    /// What the rim sends inwards beyond `rim` as the face sinks in, at the outermost radius and
    /// the last frame. It grows with the sixth power of the radius and with the load. Half of its
    /// variance is correlated over `element`: waves of the elements' length.
    sinking: f64,
    /// The same of the forces.
    sinking_force: f64,
    /// What the pressure's radial share on the bent face would add, which the model leaves out. In
    /// the last frame, correlated as the shape, growing with the load.
    bent: f64,
}

/// Correlation length of the shape's error over the outermost radius.
const SHAPE_LENGTH: f64 = 0.4;

/// Against CalculiX, over bonded blocks with and without inclusion: all pressures 0.05 to 0.2 %
/// low, the shape within 0.1 %, lower by 0.05 to 0.3 % towards the rim. There are waves of 0.05 to
/// 0.1 % there, forces 0.1 to 1 % low. What grows as the face sinks in: between meshes of 5 and 10
/// elements an eighth, 0.1 % at the outermost radius and 0.3 % of the force.
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

/// The same, without friction: all pressures 0.05 to 0.25 % low, the shape within 0.1 %, lower by
/// up to 0.2 % towards the rim in soft tissue and by 0.85 % in tissue a third as stiff as the
/// guide. Over eight blocks of `evidence/inclusion_scenes.py` that is 0.5 % root mean square. Four
/// fifths of it go where CalculiX's elements at the rim are made a quarter as long, but data are as
/// they are. Up to 0.4 % on the axis above a shallow inclusion, forces 0.2 to 1.3 % low. What
/// grows: between rim elements of 0.02, 0.05 and 0.08 radii, 0.1 to 0.25 % at the outermost radius.
/// The radial share, put in as forces on the nodes at a tenth of the block's height, bends the
/// profile by 0.15 % across an inclusion. It does so by more above a shallow one.
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

/// Which mesh a covariance is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Resolution {
    /// The answer's.
    Answer,
    /// That of the first fits.
    FirstFits,
}

impl ModelErrors {
    /// `part` of the model's error counts.
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
            // Half a percent where there is room, up to 2 % above a shallow inclusion.
            Resolution::FirstFits => Self {
                rough: 8e-3,
                element: 0.2,
                ..fine
            },
        }
    }
}

/// Matérn's kernel of order 3/2 between points of two rings, averaged over their angle.
fn ring_kernel(a: f64, b: f64, length: f64) -> f64 {
    let mut sum = 0.0;
    for k in 0..RING_POINTS {
        let angle = core::f64::consts::PI * (f64::from(k) + 0.5) / f64::from(RING_POINTS);
        let squared = (a * a + b * b - 2.0 * a * b * angle.cos()).max(0.0);
        sum += kernel(squared.sqrt(), length);
    }
    sum / f64::from(RING_POINTS)
}

/// Values of all frames: the pressures of one after the other, then the forces.
#[derive(Debug, Clone)]
pub(crate) struct Observed {
    pub radii_m: Vec<f64>,
    pub values: Vec<f64>,
    /// White errors. Infinite for a force that is not known.
    pub white: Vec<f64>,
    pub frames: usize,
    /// Of a whole face.
    pub cells: Option<ObservedCells>,
}

/// Cells of a face on which pressures were measured.
#[derive(Debug, Clone)]
pub(crate) struct ObservedCells {
    pub positions: Arc<CellPositions>,
    /// Standard error of a press's place, each way.
    pub place_error_m: f64,
    /// Standard error of the zero that the approaches of one press have of its own.
    pub zero_error_m: f64,
    /// The reciprocal of each frame's approach.
    pub per_approach: Vec<f64>,
    /// Mean of each value and that of the cell on the other side of the axis, over the value: a
    /// tilted face's pressure without its tilt.
    pub even: Vec<f64>,
    /// Relative error of the pressure of an inclusion off the axis, of each cell.
    pub aside: Vec<f64>,
}

/// Error of the pressure of an inclusion off the axis, over its distance from the axis in radii of
/// the face and the part by which it lifts the pressure. Solutions in three dimensions differ by 0.2
/// to 0.6 % of the pressure at 0.25 to 0.5 radii, of lumps that lift it by a fifth to twice.
const ASIDE: f64 = 0.034;

/// What elements leave of the pressure on a whole face within their length, beyond what they leave
/// of rings: another code's solutions of plain blocks in three dimensions scatter by 0.12 to
/// 0.25 %.
const ROUGH_PICTURE: f64 = 2e-3;

/// Standard error of the angle between face and block, in radians: two degrees.
const TILT: f64 = 0.035;

/// Matérn's kernel of order 3/2.
fn kernel(distance: f64, length: f64) -> f64 {
    let scaled = 3f64.sqrt() * distance / length;
    (1.0 + scaled) * (-scaled).exp()
}

impl ObservedCells {
    /// Cells with their values, one frame after the other. `zero_error_m` is the standard error of
    /// the zero of a press's approaches, which presses of a scan have each.
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

    /// Whether two cells are of one press.
    fn is_one_press(&self, i: usize, j: usize) -> bool {
        self.positions.presses[i] == self.positions.presses[j]
    }
}

impl Observed {
    /// Each frame's pressure over the last one's: as large a part of its approach, nearly.
    fn loads(&self) -> Vec<f64> {
        let rings = self.radii_m.len();
        let sums = self.values[..self.frames * rings].chunks(rings);
        let sums: Vec<f64> = sums.map(|frame| frame.iter().sum()).collect();
        let last = sums.last().copied().unwrap_or(1.0);
        sums.into_iter().map(|sum| sum / last).collect()
    }

    /// These values with a relative error of the pressure that two inclusions have together, in
    /// quadrature with that of each.
    pub(crate) fn with_neighbours(mut self, error: f64) -> Self {
        let aside = self.cells.iter_mut().flat_map(|cells| &mut cells.aside);
        aside.for_each(|aside| *aside = aside.hypot(error));
        self
    }

    /// These values with the error of the pressure of an inclusion off the axis that lifts the
    /// pressure by this part, in quadrature with that of another. Far from a face it fades with
    /// what the inclusion adds there.
    pub(crate) fn with_lump_aside(&self, centre_m: [f64; 2], forward: &Forward, lift: f64) -> Self {
        let mut observed = self.clone();
        if let (Some(cells), Some(face)) = (&mut observed.cells, &forward.cells) {
            let CellPositions {
                presses, axes_m, ..
            } = &*cells.positions;
            let aside = presses.iter().zip(&cells.aside).map(|(press, before)| {
                let axis = axes_m[*press];
                let aside_m = (centre_m[0] - axis[0]).hypot(centre_m[1] - axis[1]);
                let share = lift.min(1.0) * face.fade(aside_m, aside_m);
                before.hypot(ASIDE * aside_m / forward.guide.radius_m() * share)
            });
            cells.aside = aside.collect();
        }
        observed
    }

    /// Covariance of the relative errors of two cells by an inclusion off the axis.
    fn aside(&self, i: usize, j: usize) -> f64 {
        let cells = self.cells.as_ref().filter(|cells| cells.is_one_press(i, j));
        cells.map_or(0.0, |cells| cells.aside[i] * cells.aside[j])
    }

    /// Covariance of the relative pressures of two cells of a press in two frames by the angle
    /// between face and block, θ: a rigid punch's pressure grows by 2 θ x / δ at the approach δ.
    /// And by the zero of the press's approaches. Ring means have none.
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

    /// Covariance of the values. Relative errors are of the values observed.
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
                // Presses share what belongs to sensor and rim. What goes with the inclusion, the
                // tilt and the errors of frames and of place are each press's own.
                let is_one_press =
                    (self.cells.as_ref()).is_none_or(|cells| cells.is_one_press(i, j));
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
                        covariance[(row, column)] += relative * values[row] * values[column];
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
