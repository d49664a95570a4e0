//! Frames of an independent forward model, which uses none of the crate's code: Hertz's contact,
//! light proportional to a power of the pressure, vignetting, drifting illumination, noise and
//! integer grey levels.

use ndarray::Array2;
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use rand_distr::{Distribution, StandardNormal};
use tactile_force::{
    Branch, CalibrationFrame, CalibrationPair, ContactOptions, DriftCorrection, ForceMeasurement,
    ForceMeter, ForceOptions, ForceWorkspace, PressureCurve, PressureCurveOptions, ReferenceFrame,
    StressCalibration,
};

pub(crate) const SHAPE: (usize, usize) = (200, 240);
pub(crate) const PIXEL_M: f64 = 40e-6;
pub(crate) const AREA_M2: f64 = PIXEL_M * PIXEL_M;

/// A sensor whose light is proportional to the pressure to the power `q`.
#[derive(Clone, Copy)]
pub(crate) struct Sensor {
    pub(crate) q: f64,
    /// Fraction of the light lost at the corners of the frame.
    pub(crate) vignetting: f64,
    /// Relative lag of unloading: its light corresponds to a pressure that is lower by this
    /// fraction.
    pub(crate) hysteresis: f64,
    /// Relative brightness of the light source.
    pub(crate) illumination: f64,
    /// Grey level of the sensor without load, in the middle of the frame.
    pub(crate) background: f64,
    /// Fraction by which the lens moves the corners of the frame inwards.
    pub(crate) barrel: f64,
    /// Height of a pixel divided by its width.
    pub(crate) aspect: f64,
}

impl Default for Sensor {
    fn default() -> Self {
        Self {
            q: 1.0,
            vignetting: 0.1,
            hysteresis: 0.0,
            illumination: 1.0,
            background: 40.0,
            barrel: 0.0,
            aspect: 1.0,
        }
    }
}

/// Hertz: contact radius in metres of a ball of radius `ball_m` under a force. E* = 200 kPa.
pub(crate) fn contact_radius(force_n: f64, ball_m: f64) -> f64 {
    (0.75 * force_n * ball_m / 200e3).cbrt()
}

impl Sensor {
    /// Grey level of a pressure: 120 at 60 kPa.
    pub(crate) fn light(&self, pressure_pa: f64) -> f64 {
        120.0 * (pressure_pa / 60e3).powf(self.q)
    }

    /// The undistorted position of a pixel, in pixel widths from the position of the first pixel. A
    /// point at the distance ρ from the middle (1 at the corners) has its image at ρ (1 − barrel
    /// ρ²), which is inverted here by iteration.
    pub(crate) fn place(&self, x: f64, y: f64) -> [f64; 2] {
        let middle = [0.5 * (SHAPE.1 as f64 - 1.0), 0.5 * (SHAPE.0 as f64 - 1.0)];
        let seen = [x - middle[0], self.aspect * (y - middle[1])];
        let corner = middle[0].hypot(self.aspect * middle[1]);
        let mut shrunk = 1.0;
        for _ in 0..20 {
            let rho = seen[0].hypot(seen[1]) / corner / shrunk;
            shrunk = 1.0 - self.barrel * rho * rho;
        }
        [
            middle[0] + seen[0] / shrunk,
            self.aspect * middle[1] + seen[1] / shrunk,
        ]
    }

    /// A frame of a contact at an undistorted position (x, y) in pixel widths. Without force it is
    /// a frame of the sensor without load.
    pub(crate) fn frame(
        &self,
        force_n: f64,
        ball_m: f64,
        [cx, cy]: [f64; 2],
        branch: Branch,
        seed: u64,
    ) -> Array2<u8> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let a = contact_radius(force_n, ball_m) / PIXEL_M;
        let lag = if branch == Branch::Unloading {
            1.0 - self.hysteresis
        } else {
            1.0
        };
        let peak = 1.5 * force_n / (std::f64::consts::PI * (a * PIXEL_M).powi(2)) * lag;
        let distorted = self.barrel != 0.0 || self.aspect != 1.0;
        Array2::from_shape_fn(SHAPE, |(y, x)| {
            let (x, y) = (x as f64, y as f64);
            let mut light = 0.0;
            // Distortion shifts a contact by less than twenty pixels.
            let margin = if distorted { 20.0 } else { 2.0 };
            if force_n > 0.0 && (x - cx).hypot(y - cy) < a + margin {
                // The mean over the pixel, at three by three points.
                for k in 0..9 {
                    let (dx, dy) = (
                        f64::from(k % 3) / 3.0 - 1.0 / 3.0,
                        f64::from(k / 3) / 3.0 - 1.0 / 3.0,
                    );
                    let [px, py] = if distorted {
                        self.place(x + dx, y + dy)
                    } else {
                        [x + dx, y + dy]
                    };
                    let r2 = ((px - cx).powi(2) + (py - cy).powi(2)) / (a * a);
                    light += self.light(peak * (1.0 - r2).max(0.0).sqrt()) / 9.0;
                }
            }
            let (u, v) = ((x - 119.5) / 119.5, (y - 99.5) / 99.5);
            let even = 1.0 - 0.5 * self.vignetting * (u * u + v * v);
            let expected = self.illumination * even * (light + self.background);
            let sd = (0.3 + 0.02 * expected).sqrt();
            let noise: f64 = StandardNormal.sample(&mut rng);
            (expected + sd * noise).round().clamp(0.0, 255.0) as u8
        })
    }

    pub(crate) fn reference(&self) -> ReferenceFrame {
        let frames: Vec<_> = (0..8)
            .map(|k| self.frame(0.0, 1.0, [0.0; 2], Branch::Loading, 900 + k))
            .collect();
        let views: Vec<_> = frames.iter().map(|f| f.view()).collect();
        ReferenceFrame::from_frames(&views)
            .unwrap()
            .with_flat_field()
            .unwrap()
    }

    /// Frames of a ball of 4 mm under 0.05 to 1 N, up and down, at different positions, with a
    /// gauge accurate to 0.2 %.
    pub(crate) fn calibration(
        &self,
        reference: &ReferenceFrame,
        seed: u64,
    ) -> (Vec<CalibrationFrame>, Vec<CalibrationPair>) {
        let meter = ForceMeter::new([PIXEL_M; 2], &ForceOptions::default()).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut workspace = ForceWorkspace::default();
        let (mut frames, mut pairs) = (Vec::new(), Vec::new());
        for k in 0..24 {
            let step = if k < 12 { k + 1 } else { 24 - k };
            let branch = if k < 12 {
                Branch::Loading
            } else {
                Branch::Unloading
            };
            let force = f64::from(step) / 12.0;
            let place = [
                100.0 + 30.0 * rng.random::<f64>(),
                85.0 + 25.0 * rng.random::<f64>(),
            ];
            let frame = self.frame(force, 4e-3, place, branch, 1000 * seed + k as u64);
            let contact = meter
                .detect_with(&mut workspace, frame.view(), reference)
                .unwrap()
                .unwrap();
            let noise: f64 = StandardNormal.sample(&mut rng);
            let gauge = force * (1.0 + 2e-3 * noise);
            let histogram = workspace.grey_histogram(AREA_M2).unwrap();
            let sum = contact.integrated_pixel_value.value;
            frames.push(CalibrationFrame::new(histogram, gauge, branch).unwrap());
            pairs.push(CalibrationPair {
                integrated_pixel_value: sum,
                force_n: gauge,
                branch,
            });
        }
        (frames, pairs)
    }

    pub(crate) fn curve(&self, reference: &ReferenceFrame, seed: u64) -> PressureCurve {
        PressureCurve::fit(
            &self.calibration(reference, seed).0,
            &PressureCurveOptions::default(),
        )
        .unwrap()
    }
}

pub(crate) fn measure(
    frame: &Array2<u8>,
    reference: &ReferenceFrame,
    calibration: &dyn StressCalibration,
    drift: DriftCorrection,
) -> ForceMeasurement {
    let options = ForceOptions::default().with_contact(ContactOptions::default().with_drift(drift));
    let meter = ForceMeter::new([PIXEL_M; 2], &options).unwrap();
    let mut workspace = ForceWorkspace::default();
    let found = meter.measure_with(&mut workspace, frame.view(), reference, calibration);
    found.unwrap()
}
