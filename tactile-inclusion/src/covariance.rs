//! Covariance of ring means: the sensor's errors and the model's.

use crate::specimen::SensorErrors;
use nalgebra::DMatrix;
use tactile_fem::Interface;

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
pub enum Resolution {
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
    // The integrand is periodic and smooth but for a kink of the third derivative: 48 points of the
    // half circle give four digits.
    let count = 48;
    let mut sum = 0.0;
    for k in 0..count {
        let angle = core::f64::consts::PI * (f64::from(k) + 0.5) / f64::from(count);
        let squared = (a * a + b * b - 2.0 * a * b * angle.cos()).max(0.0);
        let distance = 3f64.sqrt() * squared.sqrt() / length;
        sum += (1.0 + distance) * (-distance).exp();
    }
    sum / f64::from(count)
}

/// Values of all frames: the pressures of one after the other, then the forces.
#[derive(Debug, Clone)]
pub struct Observed {
    pub radii_m: Vec<f64>,
    pub values: Vec<f64>,
    /// White errors. Infinite for a force that is not known.
    pub white: Vec<f64>,
    pub frames: usize,
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

    /// Covariance of the values. Relative errors are of the values observed.
    pub fn covariance(
        &self,
        sensor: &SensorErrors,
        interface: Interface,
        resolution: Resolution,
    ) -> DMatrix<f64> {
        let model = ModelErrors::new(interface, resolution, sensor.model);
        let (frames, rings) = (self.frames, self.radii_m.len());
        let outermost = self.radii_m.last().copied().unwrap_or(1.0);
        let values = &self.values;
        let loads = self.loads();
        let mut covariance = DMatrix::from_fn(values.len(), values.len(), |i, k| {
            model.scale.powi(2) * values[i] * values[k]
        });
        for (i, &a) in self.radii_m.iter().enumerate() {
            for (j, &b) in self.radii_m.iter().enumerate() {
                let smooth = ring_kernel(a, b, sensor.correlation_m);
                let wide = ring_kernel(a, b, SHAPE_LENGTH * outermost);
                let shape = model.shape.powi(2) * wide;
                let rough = model.rough.powi(2) * ring_kernel(a, b, model.element * outermost);
                let rim = (model.rim * a * b / outermost.powi(2)).powi(2);
                let common = sensor.common.powi(2) * smooth + shape + rim + rough;
                let waves = 0.5 + 0.5 * ring_kernel(a, b, model.element * outermost);
                let rise = (a * b / outermost.powi(2)).powi(6);
                let grown = waves * model.sinking.powi(2) * rise + model.bent.powi(2) * wide;
                for k in 0..frames {
                    for l in 0..frames {
                        let own = sensor.each_frame.powi(2) * smooth;
                        let both = common + grown * loads[k] * loads[l];
                        let relative = if k == l { both + own } else { both };
                        let (row, column) = (k * rings + i, l * rings + j);
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
