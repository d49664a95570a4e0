//! Where the frames come from: the simulator or a scene file.
use super::truth::Truth;
use super::{Arguments, Physics, Polymer, Simulation};
use crate::context::Context;
use crate::failure::Failure;
use crate::numbers::four_digits;
use crate::progress::waiting;
use crate::simulated::trial;
use std::path::Path;
use tactile_imaging::Pipeline;
use tactile_imaging::io::{Grey, read_grey_image};
use tactile_imaging::pipeline::{PipelineError, Press};
use tactile_imaging::scene::{Scene, SceneData};
use tactile_simulate::Trial;
use tactile_simulate::{
    Camera, ContactModel, Elastic, ElasticSphere, PressLoad, PressOptions, SimulateError,
};

/// Frames with all that is needed to measure them.
pub enum Source {
    /// Simulated, with the truth.
    Simulated(Box<Trial>),
    /// A user's own.
    Scene(Box<(Scene, SceneData)>),
}

impl Source {
    pub fn open(arguments: &Arguments, context: &Context) -> Result<Self, Failure> {
        if let Some(path) = &arguments.scene {
            let scene = Scene::read(path).map_err(Failure::input)?;
            allow(&scene, context)?;
            let job = format!("reading {} frames", scene.frames.len());
            let data = if scene.frames.len() <= KEPT_FRAMES {
                waiting(job, || scene.load())
            } else {
                scene.load_without_frames()
            };
            let data = data.map_err(Failure::input)?;
            return Ok(Self::Scene(Box::new((scene, data))));
        }
        let job = format!("simulating {} frames", arguments.simulation.forces.len());
        let options = options(&arguments.simulation);
        let trial = waiting(job, || trial(options));
        let trial = trial.map_err(|error| {
            let hint = match arguments.simulation.physics {
                Physics::FiniteElements => ", or try --physics hertz",
                Physics::Hertz => "",
            };
            let error = match error {
                SimulateError::CalibrationSaturates { .. } => {
                    "the gain that suits so small --forces saturates the camera in the calibration up to 2 N: give larger ones".to_owned()
                }
                // The library names its field, a user has written --forces.
                error => error.to_string().replace("force_n", "the force in N"),
            };
            Failure::input(format!("the press cannot be simulated: {error}{hint}"))
        })?;
        within_frame(&trial)?;
        Ok(Self::Simulated(Box::new(trial)))
    }

    pub fn pipeline(&self, points: usize) -> Result<Pipeline, Failure> {
        let pipeline = match self {
            Self::Simulated(trial) => trial.pipeline().map_err(Failure::input)?,
            Self::Scene(own) => own.0.pipeline(&own.1).map_err(Failure::input)?,
        };
        Ok(pipeline.with_control_points(points))
    }

    pub fn press(&self, pipeline: &Pipeline) -> Result<Press<'_>, Failure> {
        match self {
            Self::Simulated(trial) => trial.press(pipeline).map_err(Failure::input),
            Self::Scene(own) => {
                let (scene, data) = own.as_ref();
                let job = format!("reading {} frames", scene.frames.len());
                waiting(job, || scene.press(pipeline, data)).map_err(Failure::input)
            }
        }
    }

    /// The pipeline's error, with file and field where there is a scene file.
    pub fn explain(&self, error: PipelineError) -> String {
        match self {
            Self::Simulated(_) => error.to_string(),
            Self::Scene(own) => own.0.measure_error(error).to_string(),
        }
    }

    /// The images that were read.
    pub fn files(&self) -> Vec<&Path> {
        match self {
            Self::Simulated(_) => Vec::new(),
            Self::Scene(own) => {
                let frames = own.0.frames.iter().map(|frame| frame.image.as_path());
                frames.chain([own.0.reference.as_path()]).collect()
            }
        }
    }

    pub fn truth(&self) -> Option<Truth> {
        match self {
            Self::Simulated(trial) => Some(Truth::of(&trial.simulation)),
            Self::Scene(_) => None,
        }
    }
}

/// Refuses contacts beyond which the camera sees nothing of the sensor.
fn within_frame(trial: &Trial) -> Result<(), Failure> {
    let camera = trial.scene.options().camera;
    let [rows, columns] = camera.shape.map(|pixels| pixels as f64);
    let [width, height] = camera.pixel_size_m;
    let corner_m = 0.5 * (columns * width).hypot(rows * height);
    let contacts = trial.simulation.truth.iter().map(|truth| &truth.contact);
    match contacts.max_by(|a, b| a.contact_radius_m.total_cmp(&b.contact_radius_m)) {
        Some(largest) if largest.contact_radius_m > corner_m => Err(Failure::input(format!(
            "at {} N the contact has a radius of {} mm and covers the whole frame: give smaller --forces",
            four_digits(largest.force_n),
            four_digits(1e3 * largest.contact_radius_m),
        ))),
        _ => Ok(()),
    }
}

/// Frames up to which their pixels are kept: a press read twice is timed without its files. More are read again whenever a
/// stage needs them.
const KEPT_FRAMES: usize = 64;

/// Bytes that results take for every frame beside its pixels: what `/usr/bin/time -v` shows for scenes of thousands of frames.
const BYTES_OF_A_FRAME: f64 = 4e3;

/// Refuses a scene whose results do not fit into memory.
fn allow(scene: &Scene, context: &Context) -> Result<(), Failure> {
    let Ok(reference) = read_grey_image(&scene.reference, Grey::default(), None) else {
        // Loading will say what is wrong with it.
        return Ok(());
    };
    let frames = scene.frames.len();
    context.memory.allow(
        (frames.min(KEPT_FRAMES) + 1) as f64 * reference.levels.len() as f64
            + frames as f64 * BYTES_OF_A_FRAME,
        &format!("a scene of {frames} frames"),
        "give fewer or smaller frames",
    )
}

fn options(simulation: &Simulation) -> PressOptions {
    let polymer = match simulation.polymer {
        Polymer::Cl2000x => Elastic::CL2000X,
        Polymer::Cl2003x => Elastic::CL2003X,
    };
    let material = match simulation.modulus_kpa {
        Some(kpa) => Elastic {
            youngs_modulus_pa: kpa * 1e3,
            ..polymer
        },
        None => polymer,
    };
    let camera = if simulation.ideal_camera {
        Camera::default().ideal()
    } else {
        Camera::default()
    };
    PressOptions {
        object: ElasticSphere {
            radius_m: simulation.radius_mm * 1e-3,
            material,
        },
        loads: simulation
            .forces
            .iter()
            .map(|&f| PressLoad::normal(f))
            .collect(),
        camera,
        seed: simulation.seed,
        ..match simulation.physics {
            Physics::FiniteElements => PressOptions {
                law: ContactModel::FiniteElements,
                ..PressOptions::default()
            },
            Physics::Hertz => PressOptions::default(),
        }
    }
}
