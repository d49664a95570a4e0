//! What a measurement of a simulated press should find.
use serde::Serialize;
use tactile_simulate::{PressSimulation, PressTruth};

/// The truth of one simulated frame.
#[derive(Serialize)]
pub struct FrameTruth {
    /// Normal force in newtons.
    pub force_n: f64,
    /// Contact radius in metres.
    pub contact_radius_m: f64,
    /// Contact radius over the ball's.
    pub contact_ratio: f64,
    /// Intensity centroid (x, y) in pixels.
    pub centroid_px: [f64; 2],
    /// Approach of the bodies in metres.
    pub indentation_m: f64,
    /// Greatest height of the surface that the pressure is read as, in metres.
    pub surface_height_m: f64,
}

/// The truth of a simulated press.
#[derive(Serialize)]
pub struct Truth {
    /// Young's modulus of the ball in pascals.
    pub youngs_modulus_pa: f64,
    /// The frames.
    pub frames: Vec<FrameTruth>,
    /// Green–Lagrange strain of the apparent surfaces between the first and the last frame, rows of the tensor.
    pub strain: Option<[[f64; 3]; 3]>,
}

impl Truth {
    pub fn of(simulation: &PressSimulation) -> Self {
        let truth = &simulation.truth;
        let frame = |t: &PressTruth| FrameTruth {
            force_n: t.contact.force_n,
            contact_radius_m: t.contact.contact_radius_m,
            contact_ratio: t.contact.contact_ratio(),
            centroid_px: t.centroid_px,
            indentation_m: t.contact.indentation_m,
            surface_height_m: t.contact.apparent_height_m(0.0),
        };
        let strain = (truth.len() > 1).then(|| {
            let e = truth[0]
                .scaling_to(&truth[truth.len() - 1])
                .green_lagrange_strain();
            std::array::from_fn(|r| std::array::from_fn(|c| e[(r, c)]))
        });
        Self {
            youngs_modulus_pa: simulation.youngs_modulus_pa,
            frames: truth.iter().map(frame).collect(),
            strain,
        }
    }
}
