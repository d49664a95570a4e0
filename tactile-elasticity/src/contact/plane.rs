//! Pressure and force from the displacement of a layered surface over a contact of any shape.

use super::layers::LayerKernel;
use super::{Bond, Waveguide};
use crate::error::{ElasticityError, Quantity};
use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};
use std::sync::Arc;
use tactile_core::Estimate;

/// The linear law of layers on a rigid base, on a grid of equal cells.
///
/// A pressure of wavenumber k moves the surface by 2 L(kh)/(E* k), L and E* as in
/// [`LayerEquation`](super::LayerEquation). Surroundings of the contact carry no pressure, and move
/// freely. The contact's pressure is solved for by conjugate gradients, with the law applied by
/// Fourier transforms of twice the grid or more, which keeps copies apart. O(n log n) an iteration,
/// some ten of them. Without friction, for slopes that are small. It is linear: adhesion shows as a
/// negative pressure, and so does an error of the displacement.
///
/// ```
/// use tactile_elasticity::contact::{Bond, Layer, LayerPlane, Waveguide};
/// // A layer that is thin beside the contact carries its confined modulus times the strain.
/// let layer = Layer { thickness_m: 1e-3, youngs_modulus_pa: 1e5, poisson_ratio: 0.3 };
/// let guide = Waveguide::new(vec![layer])?;
/// let plane = LayerPlane::new(&guide, Bond::Bonded, [40, 40], 1e-3)?;
/// let pressure = plane.pressure(&[1e-5; 1600], &[true; 1600])?;
/// let confined_pa = 1e5 * (1.0 - 0.3) / ((1.0 + 0.3) * (1.0 - 2.0 * 0.3));
/// assert!((pressure[20 * 40 + 20] / (1e-2 * confined_pa) - 1.0).abs() < 0.01);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub struct LayerPlane {
    shape: [usize; 2],
    /// The grid with room for the transforms.
    padded: [usize; 2],
    cell_m: f64,
    /// Metres a pascal, of the transposed spectrum, over the number of cells.
    compliance: Vec<f64>,
    /// Transforms along columns and along rows, forwards and back.
    forward: [Arc<dyn Fft<f64>>; 2],
    inverse: [Arc<dyn Fft<f64>>; 2],
}

/// Conjugate gradients stop at this share of the displacement.
const TOLERANCE: f64 = 1e-4;

impl LayerPlane {
    /// For a grid of rows and columns of square cells of this size.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`] for a size, or a waveguide without layers.
    pub fn new(
        waveguide: &Waveguide,
        bond: Bond,
        shape: [usize; 2],
        cell_m: f64,
    ) -> Result<Self, ElasticityError> {
        Quantity::Distance.positive(cell_m)?;
        Quantity::Elements.positive(shape[0].min(shape[1]) as f64)?;
        let kernel = LayerKernel::of_layers(waveguide, bond)?;
        let thickness = waveguide.thickness_m();
        let plane_strain = 1.0 / waveguide.touched().compliance_per_pa();
        // Beyond four thicknesses a bonded layer is at rest. The room is bounded for layers that
        // are much thicker than the grid is wide.
        let reach = (4.0 * thickness / cell_m).ceil() as usize;
        let padded = shape.map(|cells| cells + reach.clamp(cells, 3 * cells));
        let count = (padded[0] * padded[1]) as f64;
        let wavenumber =
            |k: usize, n: usize| core::f64::consts::TAU * k.min(n - k) as f64 / (n as f64 * cell_m);
        let compliance = (0..padded[1]).flat_map(|column| {
            let across = wavenumber(column, padded[1]);
            (0..padded[0]).map(move |row| across.hypot(wavenumber(row, padded[0])))
        });
        // The longest wave of all stands for the mean. Its limit is finite.
        let compliance = compliance.map(|k| {
            let s = (k * thickness).max(1e-2);
            let yields = (1.0 - kernel.deficit(s)).max(0.0);
            2.0 * yields * thickness / (plane_strain * s * count)
        });
        let mut planner = FftPlanner::new();
        Ok(Self {
            shape,
            padded,
            cell_m,
            compliance: compliance.collect(),
            forward: [0, 1].map(|k: usize| planner.plan_fft_forward(padded[1 - k])),
            inverse: [0, 1].map(|k: usize| planner.plan_fft_inverse(padded[1 - k])),
        })
    }

    /// Pressure in pascals of every cell, row by row, 0 outside the contact, that moves the contact
    /// by these displacements in metres, into the layers. Those outside it are not used.
    ///
    /// # Errors
    /// [`ElasticityError::LengthMismatch`], [`ElasticityError::NotFinite`],
    /// [`ElasticityError::NoSolution`] where the iteration does not converge.
    pub fn pressure(
        &self,
        displacement_m: &[f64],
        contact: &[bool],
    ) -> Result<Vec<f64>, ElasticityError> {
        let touched = self.touched(displacement_m, contact)?;
        let wanted = touched.iter().map(|&at| displacement_m[at]).collect();
        let mut pressure = vec![0.0; contact.len()];
        for (at, p) in touched.iter().zip(self.solve(&touched, wanted)?) {
            pressure[*at] = p;
        }
        Ok(pressure)
    }

    /// Normal force in newtons of a contact, with the error from one of all displacements together.
    ///
    /// The law is symmetric: with q the pressure that moves the contact by 1 everywhere, the force
    /// is Σ q u over the cells, and the error of u counts with Σ q, the stiffness of a flat punch
    /// of this outline.
    ///
    /// # Errors
    /// Those of [`pressure`](Self::pressure).
    pub fn force(
        &self,
        displacement_m: &[f64],
        contact: &[bool],
        displacement_error_m: f64,
    ) -> Result<Estimate, ElasticityError> {
        let touched = self.touched(displacement_m, contact)?;
        let punch = self.solve(&touched, vec![1.0; touched.len()])?;
        let area = self.cell_m * self.cell_m;
        let pairs = touched.iter().zip(&punch);
        let force: f64 = pairs.map(|(at, q)| area * q * displacement_m[*at]).sum();
        let stiffness = area * punch.iter().sum::<f64>();
        let error = stiffness.abs() * displacement_error_m;
        Ok(Estimate::new(force, error))
    }

    /// The cells of a contact, whose displacements are finite.
    fn touched(
        &self,
        displacement_m: &[f64],
        contact: &[bool],
    ) -> Result<Vec<usize>, ElasticityError> {
        let cells = self.shape[0] * self.shape[1];
        for found in [displacement_m.len(), contact.len()] {
            Quantity::Elements.entries(found, cells)?;
        }
        let touched: Vec<usize> = (0..cells).filter(|&at| contact[at]).collect();
        for &at in &touched {
            Quantity::Indentation.finite(displacement_m[at])?;
        }
        Ok(touched)
    }

    fn solve(&self, touched: &[usize], wanted: Vec<f64>) -> Result<Vec<f64>, ElasticityError> {
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut field = Vec::new();
        let mut pressure = vec![0.0; wanted.len()];
        let mut rest = wanted;
        let mut way = rest.clone();
        let mut square = dot(&rest, &rest);
        let goal = square * TOLERANCE * TOLERANCE;
        for _ in 0..200 {
            if square <= goal {
                return Ok(pressure);
            }
            let moved = self.moved(&mut field, touched, &way);
            let step = square / dot(&way, &moved);
            pressure
                .iter_mut()
                .zip(&way)
                .for_each(|(p, w)| *p += step * w);
            rest.iter_mut()
                .zip(&moved)
                .for_each(|(r, m)| *r -= step * m);
            let next = dot(&rest, &rest);
            way.iter_mut()
                .zip(&rest)
                .for_each(|(w, r)| *w = r + next / square * *w);
            square = next;
        }
        Err(ElasticityError::NoSolution)
    }

    /// The displacement of the contact's cells under a pressure on them.
    fn moved(
        &self,
        field: &mut Vec<Complex<f64>>,
        touched: &[usize],
        pressure: &[f64],
    ) -> Vec<f64> {
        let (columns, [rows, width]) = (self.shape[1], self.padded);
        let place = |at: usize| width * (at / columns) + at % columns;
        field.clear();
        field.resize(rows * width, Complex::default());
        for (at, p) in touched.iter().zip(pressure) {
            field[place(*at)].re = *p;
        }
        self.forward[0].process(field);
        let mut turned = transposed(field, width);
        self.forward[1].process(&mut turned);
        turned
            .iter_mut()
            .zip(&self.compliance)
            .for_each(|(p, c)| *p *= *c);
        self.inverse[1].process(&mut turned);
        *field = transposed(&turned, rows);
        self.inverse[0].process(field);
        touched.iter().map(|at| field[place(*at)].re).collect()
    }
}

fn transposed(field: &[Complex<f64>], width: usize) -> Vec<Complex<f64>> {
    let along = |column: usize| field.iter().skip(column).step_by(width).copied();
    (0..width).flat_map(along).collect()
}
