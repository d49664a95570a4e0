//! The gel's layer, and the normal force from the shape of its face.

use ndarray::ArrayView3;
use tactile_core::Estimate;
use tactile_elasticity::ElasticityError;
use tactile_elasticity::contact::{Bond, Layer, LayerPlane, Waveguide};

use crate::{GelError, GelFrame, GelSensor};

/// The layer of gel on its rigid plate, as the files of a sensor name it in `[gel]`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
#[non_exhaustive]
pub struct GelLayer {
    /// Thickness in metres.
    pub thickness_m: f64,
    /// Poisson's ratio.
    pub poisson_ratio: f64,
    /// Young's modulus in pascals.
    pub youngs_modulus_pa: f64,
    /// Its standard error in pascals.
    pub youngs_modulus_error_pa: f64,
}

impl GelLayer {
    /// A layer of this thickness in metres, Poisson's ratio, Young's modulus and its standard error
    /// in pascals.
    pub fn new(thickness_m: f64, poisson_ratio: f64, youngs_modulus_pa: [f64; 2]) -> Self {
        let [youngs_modulus_pa, youngs_modulus_error_pa] = youngs_modulus_pa;
        Self {
            thickness_m,
            poisson_ratio,
            youngs_modulus_pa,
            youngs_modulus_error_pa,
        }
    }

    /// Of silicones, which hardly yield in volume.
    pub const DEFAULT_POISSON_RATIO: f64 = 0.48;

    /// The layer as the contact laws take it.
    ///
    /// # Errors
    /// [`ElasticityError`] for a layer without thickness, modulus or a Poisson ratio.
    pub fn guide(&self) -> Result<Waveguide, ElasticityError> {
        Waveguide::new(vec![Layer {
            thickness_m: self.thickness_m,
            youngs_modulus_pa: self.youngs_modulus_pa,
            poisson_ratio: self.poisson_ratio,
        }])
    }
}

/// Force from the shape of a gel's face, by the linear law of its layer.
///
/// The face is read in blocks of pixels, 48 along the longer side of the frame: the force is a sum,
/// and finer ones change it little.
pub struct GelForce {
    plane: LayerPlane,
    block: usize,
    pixel_size_m: f64,
    modulus_error: f64,
}

impl GelForce {
    /// For the frames of this sensor.
    ///
    /// # Errors
    /// [`GelError::Law`] for a layer without thickness, modulus or a Poisson ratio.
    pub fn new(gel: &GelLayer, sensor: &GelSensor) -> Result<Self, GelError> {
        let (rows, columns) = sensor.shape();
        let block = rows.max(columns).div_ceil(48).min(rows).min(columns);
        let pixel_size_m = sensor.model().pixel_size_m;
        let shape = [rows / block, columns / block];
        let cell_m = block as f64 * pixel_size_m;
        Ok(Self {
            plane: LayerPlane::new(&gel.guide()?, Bond::Bonded, shape, cell_m)?,
            block,
            pixel_size_m,
            modulus_error: gel.youngs_modulus_error_pa / gel.youngs_modulus_pa,
        })
    }

    /// The normal force in newtons with the errors of depth and modulus. `None` without contact.
    ///
    /// # Errors
    /// [`GelError`].
    pub fn force(&self, reading: &GelFrame) -> Result<Option<Estimate>, GelError> {
        let (moved, touched) = reading.displacement_m(self.block, self.pixel_size_m)?;
        if !touched.iter().any(|touched| *touched) {
            return Ok(None);
        }
        let moved = moved.into_raw_vec_and_offset().0;
        let touched = touched.into_raw_vec_and_offset().0;
        let force = self
            .plane
            .force(&moved, &touched, reading.depth_standard_error_m)?;
        let error = force.standard_error.hypot(self.modulus_error * force.value);
        Ok(Some(Estimate::new(force.value, error)))
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
            let unit = law.force(&reading)?.ok_or(GelError::NoContact)?;
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
