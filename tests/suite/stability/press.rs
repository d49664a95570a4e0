//! A simulated press, its sensor in any unit, and the results of the pipeline.
use nalgebra::Matrix3;
use ndarray::Array2;
use std::sync::Arc;
use tactile_imaging::Pipeline;
use tactile_imaging::elasticity::contact::{Layer, Waveguide};
use tactile_imaging::force::{
    CalibrationPair, ContactOptions, DriftCorrection, ForceOptions, LinearCalibration,
    ReferenceFrame,
};
use tactile_imaging::pipeline::{EstimatorChoice, LightContact, Object, StagesConfig};
use tactile_simulate::{CalibrationRun, Camera, Gain, PressLoad, PressOptions, Trial};

/// 348 × 260 pixels on 15 mm: the contact has as many pixels as with a camera of 696 × 520, enough
/// for 200 control points.
pub(crate) fn camera() -> Camera {
    Camera {
        shape: [260, 348],
        pixel_size_m: [43.1e-6; 2],
        ..Camera::default()
    }
}

/// 174 × 130 pixels on 30 mm: enough for force, radius and modulus.
pub(crate) fn coarse_camera() -> Camera {
    Camera::default().coarser(8)
}

/// A press at these forces seen by a camera whose brightest pixel is this grey value above the
/// background.
pub(crate) fn trial(camera: Camera, peak_grey: f64, forces: &[f64]) -> Trial {
    let options = PressOptions {
        camera,
        loads: forces.iter().map(|&f| PressLoad::normal(f)).collect(),
        gain: Gain::PeakGrey(peak_grey),
        seed: 3,
        ..PressOptions::default()
    };
    // The contact of the calibration also lies completely within the view of the finer camera.
    let calibration = CalibrationRun {
        largest_force_n: 1.5,
        ..CalibrationRun::default()
    };
    Trial::new(options, &calibration).expect("a scene")
}

/// Units of length and force of the description of the sensor, and the grey levels of its
/// calibration.
#[derive(Clone, Copy)]
pub(crate) struct Units {
    pub(crate) length: f64,
    pub(crate) force: f64,
    pub(crate) grey: f64,
}

pub(crate) const SI: Units = Units {
    length: 1.0,
    force: 1.0,
    grey: 1.0,
};

/// The pipeline of the trial with its sensor described in other units, including the moduli of the
/// layers in force per length².
pub(crate) fn pipeline(trial: &Trial, units: Units) -> Pipeline {
    let options = trial.scene.options();
    let layers = options.waveguide.layers.iter().map(|l| Layer {
        thickness_m: l.thickness_m * units.length,
        youngs_modulus_pa: l.material.youngs_modulus_pa * units.force
            / (units.length * units.length),
        poisson_ratio: l.material.poisson_ratio,
    });
    let scaled = |p: &CalibrationPair| CalibrationPair {
        integrated_pixel_value: p.integrated_pixel_value * units.grey,
        force_n: p.force_n * units.force,
        ..*p
    };
    let pairs: Vec<_> = trial.pairs.iter().map(scaled).collect();
    let size = trial.simulation.pixel_size_m.map(|s| s * units.length);
    let ball = options.object;
    let object = Object::Sphere {
        radius_m: ball.radius_m * units.length,
        poisson_ratio: ball.material.poisson_ratio,
    };
    let waveguide = Waveguide::new(layers.collect()).expect("layers");
    // The drift of the light is determined from tiles of the frame, and a shifted or rotated frame
    // has different tiles: the comparison covers the stages after it.
    let contact = ContactOptions::default().with_drift(DriftCorrection::None);
    let options = ForceOptions::default().with_contact(contact);
    let line = LinearCalibration::fit(&pairs).expect("a calibration");
    let contact = LightContact::new(line, size, &options).expect("options");
    Pipeline::new(contact, object)
        .expect("a pipeline")
        .with_settings(|settings| {
            settings.waveguide = Some(waveguide);
            settings.state_exact();
        })
        .unwrap()
        .with_stages(&StagesConfig {
            // The law of the simulated contacts.
            estimator: EstimatorChoice::Sphere,
            ..StagesConfig::default()
        })
        .expect("stages")
}

/// Exposures without contact, for the measurement of the noise of all pixels, and the frames of a
/// press.
#[derive(Clone)]
pub(crate) struct Images {
    pub(crate) references: [Array2<u8>; 2],
    pub(crate) frames: Vec<Array2<u8>>,
}

impl Images {
    pub(crate) fn of(trial: &Trial) -> Self {
        let references = [0, 1].map(|repeat| trial.scene.reference(repeat));
        Self {
            references,
            frames: trial.simulation.frames.clone(),
        }
    }

    pub(crate) fn map(&self, change: impl Fn(&Array2<u8>) -> Array2<u8>) -> Self {
        let references = [0, 1].map(|k| change(&self.references[k]));
        Self {
            references,
            frames: self.frames.iter().map(change).collect(),
        }
    }
}

/// The results of the pipeline for a press.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Answer {
    /// Force in each frame.
    pub(crate) force_n: Vec<f64>,
    pub(crate) radius_m: Vec<f64>,
    pub(crate) centroid_px: Vec<[f64; 2]>,
    /// Modulus and its standard error.
    pub(crate) modulus_pa: [f64; 2],
    /// Strain from the first frame to the last, with its standard error.
    pub(crate) strain: Matrix3<f64>,
    pub(crate) strain_error: Matrix3<f64>,
}

pub(crate) fn answer(pipeline: &Pipeline, images: &Images) -> Answer {
    let references = images.references.each_ref().map(|image| image.view());
    let reference = ReferenceFrame::from_frames(&references).expect("two exposures");
    let mut press = pipeline.press_on(Arc::new(reference));
    for image in &images.frames {
        press.add_frame(image.view());
    }
    let (mut force_n, mut radius_m, mut centroid_px) = (Vec::new(), Vec::new(), Vec::new());
    for frame in 0..press.frames() {
        let contact = press.contact(frame).unwrap().expect("a contact");
        force_n.push(contact.force_n.expect("a force").value);
        radius_m.push(contact.contact_radius_m.value);
        centroid_px.push(contact.centroid_px.map(|c| c.value));
    }
    let modulus = press.modulus().expect("a modulus");
    let strain = &press.strain(press.frames() - 1).expect("a strain").summary;
    Answer {
        force_n,
        radius_m,
        centroid_px,
        modulus_pa: [modulus.youngs_modulus_pa, modulus.standard_error_pa],
        strain: strain.mean,
        strain_error: strain.standard_error,
    }
}

/// The largest relative difference between the scaled numbers and the expected ones.
pub(crate) fn relative(found: &[f64], expected: &[f64], scale: f64) -> f64 {
    let gap = |(f, e): (&f64, &f64)| (f / scale / e - 1.0).abs();
    let worst = |worst: f64, gap: f64| if worst >= gap { worst } else { gap };
    found.iter().zip(expected).map(gap).fold(0.0, worst)
}
