//! The gel's layer, and the normal force from the shape of its face.

use ndarray::{Array2, ArrayView3};
use tactile_core::Estimate;

use crate::contacts::{block_means, quantile};
use crate::layer::GelLayer;
use crate::plane::{LayerShape, Plane};
use crate::{GelError, GelFrame, GelSensor};

/// Blocks of pixels along the longer side of a frame. The force is a sum, and finer ones change it
/// little.
const BLOCKS: usize = 64;
/// Rounds of pressure from what is left of the slopes. Each leaves a tenth of the last's error.
const ROUNDS: usize = 5;
/// Relative error of a force beside those of slopes and modulus, from layers under known pressures
/// (`cargo run --release -p tactile-gel --example exact_worlds`).
const LAW_ERROR: f64 = 0.025;

/// Forces from the shape of a gel's face, by the linear law of its layer.
///
/// The pressure is that whose face has the gradients of the frame, also of the free gel around the
/// contacts. It vanishes outside of them. In rounds, the pressure of what is left of the gradients
/// is added, so that the frame's end cuts nothing off. Without friction, for slopes that are small.
/// Five transforms a round.
pub struct GelForce {
    plane: Plane,
    block: usize,
    /// Newtons of 1 in a cell.
    newtons: f64,
    modulus_error: f64,
}

impl GelForce {
    /// For the frames of this sensor.
    ///
    /// # Errors
    /// [`GelError::Law`] for a layer without thickness, modulus or a Poisson ratio.
    pub fn new(gel: &GelLayer, sensor: &GelSensor) -> Result<Self, GelError> {
        let (rows, columns) = sensor.shape();
        let block = rows.max(columns).div_ceil(BLOCKS).min(rows).min(columns);
        let cell_m = block as f64 * sensor.model().pixel_size_m;
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
        })
    }

    /// The normal force of each contact in newtons, with the errors of slopes and modulus.
    pub fn forces(&self, frame: &GelFrame) -> Vec<Estimate> {
        if frame.contacts.is_empty() {
            return Vec::new();
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
        // Beside the contacts what is left is noise.
        let beside = rest.iter().zip(&touched).filter(|(_, t)| **t == 0.0);
        let mut beside: Vec<f32> = beside.map(|(f, _)| f.abs()).collect();
        let noise = 1.4826 * f64::from(quantile(&mut beside, 0.5));
        let scale = frame
            .slope_standard_error
            .hypot(self.modulus_error)
            .hypot(LAW_ERROR);
        let force = |share: &Array2<f32>| {
            let pairs = pressure.iter().zip(share);
            let (sum, cells) = pairs.fold((0.0, 0.0), |(sum, n), (f, s)| {
                (sum + f64::from(f * s), n + f64::from(*s))
            });
            // Neighbouring cells share some of their noise.
            let error = (scale * sum).hypot(2.0 * noise * cells.sqrt());
            Estimate::new(self.newtons * sum, self.newtons * error)
        };
        shares.iter().map(force).collect()
    }

    /// The normal force of all contacts together in newtons. `None` without contact.
    pub fn force(&self, frame: &GelFrame) -> Option<Estimate> {
        // Most of the errors is common to all contacts.
        let add = |a: Estimate, b: Estimate| {
            Estimate::new(a.value + b.value, a.standard_error + b.standard_error)
        };
        self.forces(frame).into_iter().reduce(add)
    }

    /// Each contact's share of the blocks: those with some of its pixels, by their number.
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

impl GelLayer {
    /// The layer with the modulus under which a calibrated sensor reads frames of known weights:
    /// frame and force in newtons.
    ///
    /// # Errors
    /// [`GelError::NoContact`] for a weight without contact, and those of [`GelSensor::read`].
    pub fn weighed(
        self,
        sensor: &GelSensor,
        weights: &[(ArrayView3<'_, u8>, Estimate)],
    ) -> Result<Self, GelError> {
        // The law is linear, so that it is solved for a modulus of 1 Pa.
        let unit = Self {
            youngs_modulus_pa: 1.0,
            youngs_modulus_error_pa: 0.0,
            ..self
        };
        let law = GelForce::new(&unit, sensor)?;
        // Each modulus is weighted by its relative error.
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
        // Errors of depth are the sensor's own: more weights do not average them out.
        let known = (count / total).sqrt();
        Ok(Self {
            youngs_modulus_pa: mean,
            youngs_modulus_error_pa: mean * known.max((square / count).sqrt()),
            ..self
        })
    }
}
