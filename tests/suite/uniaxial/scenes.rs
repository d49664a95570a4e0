//! Simulated faces and their sensor.
use crate::common::press_of;
use tactile_imaging::force::CalibrationPair;
use tactile_imaging::pipeline::{Press, Settings};
use tactile_imaging::{Object, Pipeline};
use tactile_simulate::{
    Camera, Elastic, FaceOutline, SurfacePattern, UniaxialOptions, UniaxialScene,
};

/// A face of uniform brightness.
pub(super) fn plain() -> SurfacePattern {
    SurfacePattern {
        bump_height_m: [0.0; 2],
        ..SurfacePattern::default()
    }
}

/// A face with 8 × 8 bumps.
pub(super) fn speckled() -> SurfacePattern {
    SurfacePattern::default()
}

/// A compressed specimen and the camera above it.
#[derive(Clone, Debug)]
pub(super) struct Face {
    pub(super) outline: FaceOutline,
    pub(super) pattern: SurfacePattern,
    pub(super) modulus_pa: f64,
    pub(super) poisson_ratio: f64,
    /// Side, or diameter.
    pub(super) face_m: [f64; 2],
    /// Compressions 1 − λ_z.
    pub(super) squeezes: Vec<f64>,
    pub(super) camera: Camera,
}

impl Default for Face {
    /// A block of 12 mm and 103 kPa, compressed by 2, 5 and 9 %, seen by 400 pixels over 16 mm.
    fn default() -> Self {
        Self {
            outline: FaceOutline::Rectangle,
            pattern: plain(),
            modulus_pa: 103e3,
            poisson_ratio: 0.5,
            face_m: [12e-3; 2],
            squeezes: vec![0.02, 0.05, 0.09],
            camera: Camera {
                shape: [400, 400],
                pixel_size_m: [16e-3 / 400.0; 2],
                ..Camera::default()
            },
        }
    }
}

impl Face {
    pub(super) fn scene(&self, seed: u64) -> UniaxialScene {
        let area = match self.outline {
            FaceOutline::Rectangle => 1.0,
            FaceOutline::Ellipse => std::f64::consts::FRAC_PI_4,
        } * self.face_m[0]
            * self.face_m[1];
        // F = E A₀ λ(1 − λ²)/2.
        let force = |squeeze: &f64| {
            let axial = 1.0 - squeeze;
            0.5 * self.modulus_pa * area * axial * (1.0 - axial * axial)
        };
        UniaxialScene::new(UniaxialOptions {
            outline: self.outline,
            pattern: self.pattern,
            material: Elastic {
                youngs_modulus_pa: self.modulus_pa,
                poisson_ratio: self.poisson_ratio,
            },
            face_m: self.face_m,
            forces_n: self.squeezes.iter().map(force).collect(),
            camera: self.camera,
            seed,
            ..UniaxialOptions::default()
        })
        .unwrap()
    }

    /// A pipeline with an exact calibration.
    pub(super) fn pipeline(&self, scene: &UniaxialScene, object: Object) -> Pipeline {
        let per_grey = self.camera.pixel_size_m.iter().product::<f64>() / scene.grey_per_pascal();
        let pairs = exact_pairs(per_grey);
        let pipeline = Pipeline::from_pairs(&pairs, self.camera.pixel_size_m, object).unwrap();
        pipeline.with_settings(Settings::state_exact).unwrap()
    }

    /// All loads of a scene of this face.
    pub(super) fn press(&self, scene: &UniaxialScene, object: Object) -> Press<'static> {
        let frames = (0..self.squeezes.len()).map(|load| scene.frame(load, 0));
        let pipeline = self.pipeline(scene, object);
        press_of(&pipeline, scene.reference(0).view(), frames)
    }
}

/// A calibration without errors, with `per_grey` newtons per grey level.
pub(super) fn exact_pairs(per_grey: f64) -> Vec<CalibrationPair> {
    let values = [0.0, 5e6, 10e6, 15e6, 20e6, 25e6];
    values
        .map(|v| CalibrationPair::loading(v, per_grey * v))
        .to_vec()
}
