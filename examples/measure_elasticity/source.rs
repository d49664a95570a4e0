//! Where the frames come from: the simulator or a scene file.
use crate::arguments::{Arguments, Polymer};
use tactile_imaging::pipeline::{Pipeline, Press, Trial, Truth};
use tactile_imaging::scene::{Scene, SceneData};
use tactile_imaging::simulate::{CalibrationOptions, Camera, Elastic, Load, PressOptions, Sphere};

pub(crate) type Failure = Box<dyn std::error::Error>;

/// Frames with all that is needed to measure them.
pub(crate) enum Source {
    /// Simulated, with the truth.
    Simulated(Box<Trial>),
    /// A user's own.
    Scene(Box<(Scene, SceneData)>),
}

impl Source {
    pub(crate) fn open(arguments: &Arguments) -> Result<Self, Failure> {
        if let Some(path) = &arguments.scene {
            eprintln!("reading {}", path.display());
            let scene = Scene::read(path)?;
            let data = scene.load()?;
            return Ok(Self::Scene(Box::new((scene, data))));
        }
        eprintln!(
            "simulating a calibration series and {} frames",
            arguments.forces.len()
        );
        Ok(Self::Simulated(Box::new(Trial::new(
            options(arguments),
            &CalibrationOptions::default(),
        )?)))
    }

    pub(crate) fn pipeline(&self, arguments: &Arguments) -> Result<Pipeline, Failure> {
        let pipeline = match self {
            Self::Simulated(trial) => trial.pipeline()?,
            Self::Scene(own) => own.0.pipeline(&own.1)?,
        };
        Ok(pipeline.with_control_points(arguments.points as usize))
    }

    pub(crate) fn press(&self, pipeline: &Pipeline) -> Result<Press<'_>, Failure> {
        match self {
            Self::Simulated(trial) => Ok(trial.press(pipeline)?),
            Self::Scene(own) => Ok(own.0.press(pipeline, &own.1)?),
        }
    }

    /// The pipeline's error, with file and field where there is a scene file.
    pub(crate) fn explain(&self, error: tactile_imaging::pipeline::PipelineError) -> Failure {
        match self {
            Self::Simulated(_) => error.into(),
            Self::Scene(own) => own.0.measure_error(error).into(),
        }
    }

    pub(crate) fn truth(&self) -> Option<Truth> {
        if let Self::Simulated(trial) = self {
            Some(trial.truth())
        } else {
            None
        }
    }
}

fn options(arguments: &Arguments) -> PressOptions {
    let polymer = match arguments.polymer {
        Polymer::Cl2000x => Elastic::CL2000X,
        Polymer::Cl2003x => Elastic::CL2003X,
    };
    let material = match arguments.modulus_kpa {
        Some(kpa) => Elastic {
            youngs_modulus_pa: kpa * 1e3,
            ..polymer
        },
        None => polymer,
    };
    let camera = if arguments.ideal_camera {
        Camera::default().ideal()
    } else {
        Camera::default()
    };
    PressOptions {
        object: Sphere {
            radius_m: arguments.radius_mm * 1e-3,
            material,
        },
        loads: arguments.forces.iter().map(|&f| Load::normal(f)).collect(),
        camera,
        seed: arguments.seed,
        ..PressOptions::default()
    }
}
