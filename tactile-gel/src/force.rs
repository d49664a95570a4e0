//! The layer of the gel, and the normal force from the shape of its face.

use ndarray::Array2;
use tactile_core::Estimate;

use crate::contacts::{block_means, quantile};
use crate::layer::GelLayer;
use crate::plane::{LayerShape, Plane};
use crate::{GaugeForce, GelError, GelFrame, GelImage, GelSensor, MarkerField};

/// Blocks of pixels along the longer side of a frame. The force is a sum, so finer blocks change it
/// little.
const BLOCKS: usize = 64;
/// Number of rounds in which pressure is computed from the remaining slopes. Each round leaves a
/// tenth of the previous error.
const ROUNDS: usize = 5;
/// Relative error of a force in addition to those of slopes and modulus, from layers under known
/// pressures (`cargo run --release -p tactile-gel --example exact_worlds`).
const LAW_ERROR: f64 = 0.025;

/// Forces from the shape of a gel's face, by the linear law of its layer.
///
/// The pressure is zero outside contacts, and its face has the gradients of the frame, including
/// those of the free gel around the contacts. In several rounds, the pressure of the remaining
/// gradients is added, so that the end of the frame cuts nothing off. The law assumes no friction
/// and small slopes. It takes five transforms per round.
pub struct GelForce {
    plane: Plane,
    block: usize,
    /// Force in newtons of a unit pressure in one cell.
    newtons: f64,
    modulus_error: f64,
    pixel_size_m: f64,
    /// Pascals per metre of sideways displacement of the face: the value for the longest wave.
    shear_pa_per_m: f64,
}

/// Total force and moments of the contacts of a frame about its centre, along x, y and into the
/// gel.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct GelWrench {
    /// F_x, F_y and F_z in newtons. `None` along x and y without markers.
    pub force_n: [Option<Estimate>; 3],
    /// M_x, M_y and M_z in newton metres. `None` about z without markers.
    pub torque_nm: [Option<Estimate>; 3],
}

/// Method that gives the forces of a sensor.
pub enum GelLaw {
    /// From the shape of the face and the layer of the gel.
    Layer(Box<GelForce>),
    /// From the volume of the contacts, calibrated with gauge readings.
    Gauge(GaugeForce),
}

impl GelLaw {
    /// The normal force of each contact in newtons.
    pub fn forces(&self, frame: &GelFrame) -> Vec<Estimate> {
        match self {
            Self::Layer(law) => law.forces(frame),
            Self::Gauge(law) => law.forces(frame),
        }
    }

    /// The total normal force of all contacts in newtons. `None` without contact.
    pub fn force(&self, frame: &GelFrame) -> Option<Estimate> {
        together(self.forces(frame))
    }
}

/// The sum of forces whose errors are mostly common. `None` if there are none.
fn together(forces: Vec<Estimate>) -> Option<Estimate> {
    forces.into_iter().reduce(|mut sum, force| {
        sum.value += force.value;
        sum.standard_error += force.standard_error;
        sum
    })
}

/// Pressure under the contacts of a frame, in blocks.
struct Pressed {
    pressure: Array2<f32>,
    shares: Vec<Array2<f32>>,
    noise: f64,
    /// Relative error common to the whole pressure.
    scale: f64,
}

impl GelForce {
    /// Creates the law for the frames of this sensor.
    ///
    /// # Errors
    /// [`GelError::Law`] for a layer with an invalid thickness, modulus or Poisson ratio.
    pub fn new(gel: &GelLayer, sensor: &GelSensor) -> Result<Self, GelError> {
        let (rows, columns) = sensor.shape();
        let block = rows.max(columns).div_ceil(BLOCKS).min(rows).min(columns);
        let cell_m = block as f64 * sensor.pixel_size_m();
        gel.guide()?;
        let modulus = gel.youngs_modulus_pa / (1.0 - gel.poisson_ratio.powi(2));
        let layer = LayerShape {
            thickness: gel.thickness_m / cell_m,
            poisson_ratio: gel.poisson_ratio,
        };
        Ok(Self {
            plane: Plane::new((rows / block, columns / block), 1.0, Some(layer)),
            block,
            newtons: 0.5 * modulus * cell_m * cell_m,
            modulus_error: gel.youngs_modulus_error_pa / gel.youngs_modulus_pa,
            pixel_size_m: sensor.pixel_size_m(),
            shear_pa_per_m: gel.shear_pa_per_m(),
        })
    }

    /// The normal force of each contact in newtons, with the errors of slopes and modulus.
    pub fn forces(&self, frame: &GelFrame) -> Vec<Estimate> {
        let Some(pressed) = self.pressed(frame) else {
            return Vec::new();
        };
        let each = pressed.shares.iter();
        each.map(|share| pressed.moment(share, |_| 1.0) * self.newtons)
            .collect()
    }

    /// The total normal force of all contacts in newtons. `None` without contact.
    pub fn force(&self, frame: &GelFrame) -> Option<Estimate> {
        together(self.forces(frame))
    }

    /// Total force and moments of all contacts. F_z = ∫p dA, M_x = ∫p y dA and M_y = −∫p x dA come
    /// from the shape of the face. F_x, F_y and M_z come from the markers ([`MarkerField::shear`],
    /// with G/h of the layer). `None` without contact.
    pub fn wrench(&self, frame: &GelFrame, markers: Option<&MarkerField>) -> Option<GelWrench> {
        let pressed = self.pressed(frame)?;
        let all = pressed
            .shares
            .iter()
            .fold(Array2::zeros(pressed.pressure.dim()), |a, b| a + b);
        let (rows, columns) = frame.depth_m.dim();
        // Offset in metres of a block from the centre of the frame.
        let arm = |block: usize, pixels: usize| {
            let middle = (block as f64 + 0.5) * self.block as f64 - 0.5 * pixels as f64;
            self.pixel_size_m * middle
        };
        let [normal, about_x, about_y] = [
            pressed.moment(&all, |_| 1.0),
            pressed.moment(&all, |(row, _)| arm(row, rows)),
            pressed.moment(&all, |(_, column)| -arm(column, columns)),
        ]
        .map(|sum| Some(sum * self.newtons));
        let shear = markers.and_then(|field| field.shear(self.shear_pa_per_m, self.pixel_size_m));
        let with_modulus = |part: Estimate| {
            let error = part.standard_error.hypot(self.modulus_error * part.value);
            Some(Estimate::new(part.value, error))
        };
        let mut wrench = GelWrench {
            force_n: [None, None, normal],
            torque_nm: [about_x, about_y, None],
        };
        if let Some(shear) = shear {
            let [fx, fy] = shear.force_n;
            let middle = [columns, rows].map(|n| 0.5 * (n as f64 - 1.0));
            let [x, y] = [0, 1].map(|k| self.pixel_size_m * (shear.about_px[k] - middle[k]));
            let turn = shear.torque_nm;
            let moved = turn.value + x * fy.value - y * fx.value;
            let error = turn
                .standard_error
                .hypot(x * fy.standard_error)
                .hypot(y * fx.standard_error);
            wrench.force_n[0] = with_modulus(fx);
            wrench.force_n[1] = with_modulus(fy);
            wrench.torque_nm[2] = with_modulus(Estimate::new(moved, error));
        }
        Some(wrench)
    }

    /// Computes the pressure. `None` without contact.
    fn pressed(&self, frame: &GelFrame) -> Option<Pressed> {
        if frame.contacts.is_empty() {
            return None;
        }
        let [p, q] = frame
            .gradient
            .each_ref()
            .map(|g| block_means(g.view(), self.block));
        let shares = self.shares(frame, p.dim());
        let touched = Array2::from_shape_fn(p.dim(), |at| {
            f32::from(u8::from(shares.iter().any(|share| share[at] > 0.0)))
        });
        let mut pressure: Array2<f32> = Array2::zeros(p.dim());
        let (mut left_p, mut left_q) = (p.clone(), q.clone());
        let mut rest = pressure.clone();
        for _ in 0..ROUNDS {
            rest = self.plane.pressure(left_p.view(), left_q.view());
            pressure += &(&rest * &touched);
            let (_, [made_p, made_q]) = self.plane.moved(pressure.view());
            left_p = &p - &made_p;
            left_q = &q - &made_q;
        }
        // Outside the contacts the remainder is noise.
        let beside = rest.iter().zip(&touched).filter(|(_, t)| **t == 0.0);
        let mut beside: Vec<f32> = beside.map(|(f, _)| f.abs()).collect();
        let noise = 1.4826 * f64::from(quantile(&mut beside, 0.5));
        let scale = frame
            .slope_standard_error
            .hypot(self.modulus_error)
            .hypot(LAW_ERROR);
        Some(Pressed {
            pressure,
            shares,
            noise,
            scale,
        })
    }

    /// Fraction of each block that belongs to a contact, by the number of its pixels.
    fn shares(&self, frame: &GelFrame, shape: (usize, usize)) -> Vec<Array2<f32>> {
        let mut shares = vec![Array2::zeros(shape); frame.contacts.len()];
        for ((row, column), label) in frame.labels.indexed_iter() {
            let at = [row / self.block, column / self.block];
            if let Some(share) = usize::from(*label)
                .checked_sub(1)
                .and_then(|k| shares.get_mut(k))
                .and_then(|share: &mut Array2<f32>| share.get_mut(at))
            {
                *share += 1.0;
            }
        }
        for r in 0..shape.0 {
            for c in 0..shape.1 {
                let sum: f32 = shares.iter().map(|share| share[[r, c]]).sum();
                shares
                    .iter_mut()
                    .for_each(|share| share[[r, c]] /= sum.max(1.0));
            }
        }
        shares
    }
}

impl Pressed {
    /// The weighted sum over the blocks, each times its arm.
    fn moment(&self, share: &Array2<f32>, arm: impl Fn((usize, usize)) -> f64) -> Estimate {
        let (mut sum, mut square) = (0.0, 0.0);
        for ((at, f), s) in self.pressure.indexed_iter().zip(share) {
            let weight = f64::from(*s) * arm(at);
            sum += f64::from(*f) * weight;
            square += f64::from(*s) * arm(at).powi(2);
        }
        // Neighbouring cells share some of their noise.
        let error = (self.scale * sum).hypot(2.0 * self.noise * square.sqrt());
        Estimate::new(sum, error)
    }
}

impl GelLayer {
    /// G/h, the resistance of the layer to a sideways displacement over more than its thickness, in
    /// pascals per metre.
    pub fn shear_pa_per_m(&self) -> f64 {
        self.youngs_modulus_pa / (2.0 * (1.0 + self.poisson_ratio) * self.thickness_m)
    }

    /// Fits the modulus of the layer to frames under known weights, given as frame and force in
    /// newtons.
    ///
    /// # Errors
    /// [`GelError::NoContact`] for a weight without contact, and the errors of [`GelSensor::read`].
    pub fn weighed(
        self,
        sensor: &GelSensor,
        weights: &[(GelImage<'_>, Estimate)],
    ) -> Result<Self, GelError> {
        // The law is linear, so it is solved for a modulus of 1 Pa.
        let unit = Self {
            youngs_modulus_pa: 1.0,
            youngs_modulus_error_pa: 0.0,
            ..self
        };
        let law = GelForce::new(&unit, sensor)?;
        // The weight of each modulus follows from its relative error.
        let (mut sum, mut total) = (0.0, 0.0);
        let mut moduli = Vec::new();
        for (frame, force) in weights {
            let reading = sensor.read(*frame)?;
            let unit = law.force(&reading).ok_or(GelError::NoContact)?;
            let modulus = force.value / unit.value;
            if !(modulus > 0.0 && modulus.is_finite()) {
                return Err(GelError::NoContact);
            }
            let error =
                (unit.standard_error / unit.value).hypot(force.standard_error / force.value);
            sum += modulus / (error * error);
            total += 1.0 / (error * error);
            moduli.push(modulus);
        }
        let mean = sum / total;
        let count = moduli.len() as f64;
        let square = moduli.iter().map(|e| (e / mean - 1.0).powi(2)).sum::<f64>() / count;
        // Errors of depth belong to the sensor and are not averaged out by more weights.
        let known = (count / total).sqrt();
        Ok(Self {
            youngs_modulus_pa: mean,
            youngs_modulus_error_pa: mean * known.max((square / count).sqrt()),
            ..self
        })
    }
}
