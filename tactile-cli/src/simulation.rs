//! The press of a ball that `measure` and `stream` simulate without a scene.
use crate::arguments::{length_mm, modulus_kpa};
use crate::console::Bar;
use crate::failure::Failure;
use crate::text::four_digits;
use clap::{Args, ValueEnum};
use tactile_simulate::{
    CalibrationRun, Camera, ContactModel, Elastic, ElasticSphere, PressOptions, SimulateError,
    Trial,
};

/// The ball and the camera.
#[derive(Args)]
pub(crate) struct Simulation {
    /// Simulation: the ball's material.
    #[arg(long, value_enum, default_value_t = Polymer::Cl2000x, conflicts_with = "scene")]
    polymer: Polymer,
    /// Simulation: the ball's Young's modulus in kPa, instead of a polymer's.
    #[arg(long, value_name = "KPA", value_parser = modulus_kpa,
          conflicts_with_all = ["scene", "polymer"])]
    modulus_kpa: Option<f64>,
    /// Simulation: the ball's radius in mm.
    #[arg(long, value_name = "MM", default_value_t = 3.0, value_parser = length_mm,
          conflicts_with = "scene")]
    radius_mm: f64,
    /// Simulation: where the contacts come from (finite elements in measure, Hertz in stream).
    /// Finite elements are there for the two polymers, 3 mm, up to 1.3 N.
    #[arg(long, value_enum, conflicts_with = "scene")]
    physics: Option<Physics>,
    /// Simulation: seed of the camera's noise.
    #[arg(
        long,
        default_value_t = 1,
        allow_negative_numbers = true,
        conflicts_with = "scene"
    )]
    seed: u64,
    /// Simulation: no noise, blur, vignetting or background.
    #[arg(long, conflicts_with = "scene")]
    ideal_camera: bool,
}

/// The law of the simulated contacts.
#[derive(Clone, Copy, ValueEnum)]
pub(crate) enum Physics {
    /// Finite elements at finite strain, on the layers. Read by the default estimator.
    FiniteElements,
    /// Hertz with the layers in series. Read by the same law.
    Hertz,
}

/// The paper's two polymers.
#[derive(Clone, Copy, ValueEnum)]
enum Polymer {
    /// Versaflex CL2000X, 103 kPa.
    Cl2000x,
    /// Versaflex CL2003X, 62 kPa.
    Cl2003x,
}

impl Simulation {
    /// The press as it is asked for, with the default's loads. `physics` is the law if no other is.
    pub(crate) fn options(&self, physics: Physics) -> PressOptions {
        let polymer = match self.polymer {
            Polymer::Cl2000x => Elastic::CL2000X,
            Polymer::Cl2003x => Elastic::CL2003X,
        };
        let own_pa = self.modulus_kpa.map(|kpa| kpa * 1e3);
        let material = Elastic {
            youngs_modulus_pa: own_pa.unwrap_or(polymer.youngs_modulus_pa),
            ..polymer
        };
        let camera = Camera::default();
        PressOptions {
            object: ElasticSphere {
                radius_m: self.radius_mm * 1e-3,
                material,
            },
            law: match self.physics.unwrap_or(physics) {
                Physics::FiniteElements => ContactModel::FiniteElements,
                Physics::Hertz => ContactModel::Hertz,
            },
            camera: if self.ideal_camera {
                camera.ideal()
            } else {
                camera
            },
            seed: self.seed,
            ..PressOptions::default()
        }
    }

    /// Simulates the press and the calibration of its sensor.
    pub(crate) fn trial(&self, options: PressOptions) -> Result<Trial, Failure> {
        let clock = Bar::clock(format!("simulating {} frames", options.loads.len()));
        let by_elements = matches!(options.law, ContactModel::FiniteElements);
        let trial = Trial::new(options, &CalibrationRun::default());
        drop(clock);
        let trial = trial.map_err(|error| {
            let hint = if by_elements {
                ", or try --physics hertz"
            } else {
                ""
            };
            let error = match error {
                SimulateError::CalibrationSaturates { .. } => {
                    "the gain that suits so small a force saturates the camera in the calibration \
                     up to 2 N: give larger ones"
                        .to_owned()
                }
                error => error.to_string(),
            };
            Failure::input(format!("the press cannot be simulated: {error}{hint}"))
        })?;
        // A contact that reaches beyond the corners leaves the camera nothing of the sensor to see.
        let camera = trial.scene.options().camera;
        let [rows, columns] = camera.shape.map(|pixels| pixels as f64);
        let [width, height] = camera.pixel_size_m;
        let corner_m = 0.5 * (columns * width).hypot(rows * height);
        let contacts = trial.simulation.truth.iter().map(|truth| &truth.contact);
        match contacts.max_by(|a, b| a.contact_radius_m.total_cmp(&b.contact_radius_m)) {
            Some(largest) if largest.contact_radius_m > corner_m => Err(Failure::input(format!(
                "at {} N the contact has a radius of {} mm and covers the whole frame: give \
                 smaller forces",
                four_digits(largest.force_n),
                four_digits(1e3 * largest.contact_radius_m),
            ))),
            _ => Ok(trial),
        }
    }
}
