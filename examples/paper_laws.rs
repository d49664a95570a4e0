//! The paper's two samples, pressed in finite elements and measured from frames, by every law: the table of COMPARE.md.
//!
//! ```console
//! cargo run --release --features cli -- table examples/data/contact_table/scene.toml --out target/table   # some minutes
//! cargo run --release --features cli --example paper_laws -- target/table/table.toml
//! ```
//! Without a table its rows are left out.
#![allow(clippy::print_stdout)]
use std::error::Error;
use std::time::Instant;
use tactile_imaging::elasticity::contact::{Bond, Layer, Waveguide};
use tactile_imaging::elasticity::modulus::{
    HertzSphere, LoadSeries, ModulusEstimator, PaperRatio, SphereOnWaveguide, TabulatedContact,
};
use tactile_imaging::pipeline::{Object, Pipeline, Trial};
use tactile_imaging::scene::read_contact_table;
use tactile_imaging::simulate::{self, CalibrationOptions, Elastic, PressOptions, Sphere};

const RADIUS_M: f64 = 3e-3;
const POISSON_RATIO: f64 = 0.5;
fn main() -> Result<(), Box<dyn Error>> {
    let layers = (simulate::Waveguide::default().layers.iter())
        .map(|l| Layer {
            thickness_m: l.thickness_m,
            youngs_modulus_pa: l.material.youngs_modulus_pa,
            poisson_ratio: l.material.poisson_ratio,
        })
        .collect();
    let guide = Waveguide::new(layers)?;
    let path = std::env::args()
        .nth(1)
        .filter(|path| path.ends_with(".toml"));
    let table = path.map(read_contact_table).transpose()?;
    println!("| sample | law | E (kPa) | error | time |");
    println!("|---|---|---|---|---|");
    for polymer in [Elastic::CL2000X, Elastic::CL2003X] {
        let options = PressOptions {
            object: Sphere {
                radius_m: RADIUS_M,
                material: polymer,
            },
            ..PressOptions::finite_elements()
        };
        let trial = Trial::new(options, &CalibrationOptions::default())?;
        let size = trial.simulation.pixel_size_m;
        let pipeline = Pipeline::from_pairs(&trial.pairs, size, Object::sphere(RADIUS_M))?
            .with_waveguide(guide.clone());
        let mut press = trial.press(&pipeline)?;
        let loads: LoadSeries<f64> = press.load_series()?;
        let hertz = HertzSphere::new(RADIUS_M, POISSON_RATIO)?;
        let mut laws: Vec<(&str, Box<dyn ModulusEstimator<f64>>)> = vec![
            ("Hertz, the guide taken as rigid", Box::new(hertz.clone())),
            (
                "Hertz, layers in series",
                Box::new(hertz.with_other_body(guide.as_body())),
            ),
            (
                "layered contact at finite strain (default)",
                Box::new(SphereOnWaveguide::new(
                    RADIUS_M,
                    POISSON_RATIO,
                    &guide,
                    Bond::Bonded,
                )?),
            ),
            (
                "stress over mean strain, (31)",
                Box::new(PaperRatio::default()),
            ),
        ];
        if let Some(table) = &table {
            let guide = Waveguide::new(table.layers().to_vec())?;
            let law =
                TabulatedContact::new(table.clone(), RADIUS_M, table.poisson_ratio(), &guide)?;
            laws.push(("contact table", Box::new(law)));
        }
        let truth = polymer.youngs_modulus_pa;
        for (name, law) in laws {
            let (microseconds, found) = timed(|| law.estimate(&loads));
            let answer = match found {
                Ok(found) => format!(
                    "{:.1} ± {:.1} | {:+.1} %",
                    1e-3 * found.youngs_modulus_pa,
                    1e-3 * found.standard_error_pa,
                    100.0 * (found.youngs_modulus_pa / truth - 1.0)
                ),
                Err(error) => format!("none: {error} | |"),
            };
            println!(
                "| {:.0} kPa | {name} | {answer} | {microseconds:.1} µs |",
                1e-3 * truth
            );
        }
    }
    Ok(())
}

/// The answer and the least time of some runs, in microseconds.
fn timed<R>(job: impl Fn() -> R) -> (f64, R) {
    let mut least = f64::INFINITY;
    let mut answer = job();
    for _ in 0..20 {
        let start = Instant::now();
        answer = job();
        least = least.min(start.elapsed().as_secs_f64());
    }
    (1e6 * least, answer)
}
