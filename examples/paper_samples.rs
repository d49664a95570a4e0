//! The two samples of the paper (balls of 3 mm radius with 103 and 62 kPa at 0.7 and 1.2 N) with
//! every estimator: a table of results and true values.
//!
//! ```console
//! cargo run --release -- table examples/data/contact_table/scene.toml --out target/table   # some minutes, for the last row
//! cargo run --release --example paper_samples -- target/paper_samples target/table/table.toml
//! ```
//! The presses are simulated by finite elements, written as scene files with their frames, and
//! measured from these files. Without a contact table its row is omitted. Without a folder the
//! files are written to `target/paper_samples`.
#![allow(clippy::print_stdout)]
use std::error::Error;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use tactile_files::scene::{Scene, read_contact_table};
use tactile_imaging::elasticity::contact::ContactTable;
use tactile_imaging::pipeline::EstimatorChoice;
use tactile_simulate::{
    CalibrationRun, Camera, ContactModel, Elastic, ElasticSphere, PressLoad, PressOptions,
    PressScene, write_folder,
};

const ESTIMATORS: [(EstimatorChoice, &str); 3] = [
    (
        EstimatorChoice::PaperRatio,
        "the paper's ratio (31), apparent",
    ),
    (EstimatorChoice::Sphere, "Hertz, layers in series"),
    (
        EstimatorChoice::SphereOnWaveguide,
        "ball on layers, large strain (default)",
    ),
];

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next();
    let folder = PathBuf::from(folder.unwrap_or_else(|| "target/paper_samples".into()));
    let contact_table = arguments.next().map(read_contact_table).transpose()?;
    let mut table = String::from(
        "| sample | estimator | modulus | 95 % interval | error |\n|---|---|---|---|---|\n",
    );
    for (name, material) in [("cl2000x", Elastic::CL2000X), ("cl2003x", Elastic::CL2003X)] {
        let truth_kpa = material.youngs_modulus_pa * 1e-3;
        let scene = write_sample(&folder.join(name), material)?;
        let found = moduli(&scene, contact_table.as_ref())?;
        for (label, modulus) in &found {
            let row = match modulus {
                Ok((kpa, interval)) => format!(
                    "{kpa:.1} kPa | {interval} | {:+.1} %",
                    100.0 * (kpa / truth_kpa - 1.0)
                ),
                Err(error) => format!("none: {error} | |"),
            };
            writeln!(table, "| {name}, {truth_kpa:.0} kPa | {label} | {row} |")?;
        }
    }
    print!("{table}");
    std::fs::write(folder.join("table.md"), &table)?;
    Ok(())
}

/// Simulates the press of a sample and writes its scene file.
fn write_sample(folder: &Path, material: Elastic) -> Result<Scene, Box<dyn Error>> {
    let camera = Camera {
        shape: [200, 260],
        pixel_size_m: [100e-6; 2],
        ..Camera::default()
    };
    let press = PressScene::new(PressOptions {
        object: ElasticSphere {
            radius_m: 3e-3,
            material,
        },
        loads: [0.7, 1.2].map(PressLoad::normal).to_vec(),
        camera,
        law: ContactModel::FiniteElements,
        ..PressOptions::default()
    })?;
    let calibration = press.calibrate(&CalibrationRun::default())?;
    let path = write_folder(&press, &calibration, folder)?;
    Ok(Scene::read(path)?)
}

/// A modulus in kPa with its 95 % interval as text, or the reason why there is none.
type Modulus = Result<(f64, String), String>;

fn moduli(
    scene: &Scene,
    contact_table: Option<&ContactTable>,
) -> Result<Vec<(&'static str, Modulus)>, Box<dyn Error>> {
    let mut data = scene.load()?;
    data.contact_table = contact_table.cloned();
    let mut rows = Vec::new();
    let tabulated = (EstimatorChoice::TabulatedContact, "contact table");
    let estimators = ESTIMATORS
        .into_iter()
        .chain(contact_table.map(|_| tabulated));
    for (estimator, label) in estimators {
        let mut scene = scene.clone();
        scene.stages.estimator = estimator;
        let pipeline = scene.pipeline(&data)?;
        let press = scene.press(&pipeline, &data)?;
        let modulus = press.modulus().map(|found| {
            let [lower, upper] = [Some(found.interval_95.lower), found.interval_95.upper]
                .map(|end| end.map_or("∞".into(), |pa| format!("{:.1}", pa * 1e-3)));
            (
                found.youngs_modulus_pa * 1e-3,
                format!("{lower} to {upper}"),
            )
        });
        rows.push((label, modulus.map_err(|error| error.to_string())));
    }
    Ok(rows)
}
