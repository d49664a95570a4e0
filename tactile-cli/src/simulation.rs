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

/// Options of the ball and the camera.
#[derive(Args)]
pub(crate) struct Simulation {
    /// Simulation: material of the ball.
    #[arg(long, value_enum, default_value_t = Polymer::Cl2000x, conflicts_with = "scene")]
    polymer: Polymer,
    /// Simulation: Young's modulus of the ball in kPa, instead of that of a polymer.
    #[arg(long, value_name = "KPA", value_parser = modulus_kpa,
          conflicts_with_all = ["scene", "polymer"])]
    modulus_kpa: Option<f64>,
    /// Simulation: radius of the ball in mm.
    #[arg(long, value_name = "MM", default_value_t = 3.0, value_parser = length_mm,
          conflicts_with = "scene")]
    radius_mm: f64,
    /// Simulation: model of the contacts (default: finite elements in measure, Hertz in stream).
    /// Finite elements exist for the two polymers with 3 mm, up to 1.3 N.
    #[arg(long, value_enum, conflicts_with = "scene")]
    physics: Option<Physics>,
    /// Simulation: seed of the camera noise.
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
    /// Finite elements at finite strain, on the layers. Evaluated by the default estimator.
    FiniteElements,
    /// Hertz with the layers in series. Evaluated by the same law.
    Hertz,
}

/// The two polymers of the paper.
#[derive(Clone, Copy, ValueEnum)]
enum Polymer {
    /// Versaflex CL2000X, 103 kPa.
    Cl2000x,
    /// Versaflex CL2003X, 62 kPa.
    Cl2003x,
}

impl Simulation {
    /// The requested press, with the default loads. `physics` is the model if no other is
    /// requested.
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
                    "the gain for such a small force saturates the camera in the calibration up to \
                     2 N: give larger forces"
                        .to_owned()
                }
                error => error.to_string(),
            };
            Failure::input(format!("the press cannot be simulated: {error}{hint}"))
        })?;
        // If the contact reaches beyond the corners, the camera sees no part of the sensor without
        // contact.
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
