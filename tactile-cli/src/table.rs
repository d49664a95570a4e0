//! `tactile table`: the contacts of a ball with a sensor's guide, computed once by finite elements.
use crate::context::Context;
use crate::failure::{Exit, Failure};
use crate::numbers;
use crate::outputs::Outputs;
use crate::progress::Progress;
use clap::Args;
use serde_json::json;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;
use tactile_imaging::fem::TableOptions;
use tactile_imaging::scene::{solve_contact_table, write_contact_table};

/// Compute the contact table of a ball and a waveguide
///
/// SCENE.toml is a scene file, or one with its tables `object` (a sphere) and `waveguide` alone. The table holds force over contact
/// radius and modulus, by finite elements at finite strain; `contact_table = "table.toml"` in a scene file makes the modulus follow from
/// it. --out gets table.toml. Ctrl-C stops without a table.
#[derive(Args)]
#[command(
    after_help = "Example:\n  tactile table examples/data/press/scene.toml --moduli 2 --largest-ratio 0.5 --out target/table"
)]
pub struct Arguments {
    /// Scene file, or a file with its tables `object` and `waveguide`.
    scene: PathBuf,
    /// Smallest modulus of the ball, in kPa.
    #[arg(long, value_name = "KPA", default_value = "25", value_parser = numbers::positive)]
    from_kpa: f64,
    /// Largest modulus of the ball, in kPa.
    #[arg(long, value_name = "KPA", default_value = "400", value_parser = numbers::positive)]
    to_kpa: f64,
    /// Number of moduli.
    #[arg(long, default_value_t = 7, value_parser = clap::value_parser!(u16).range(2..=100))]
    moduli: u16,
    /// Largest contact radius over the ball's.
    #[arg(long, value_name = "RATIO", default_value = "1.25", value_parser = numbers::positive)]
    largest_ratio: f64,
    /// Folder for table.toml.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

const FILE: &str = "table.toml";

pub fn run(arguments: &Arguments, context: &mut Context) -> Result<Exit, Failure> {
    let path = arguments.scene.as_path();
    let outputs = Outputs::plan(arguments.out.as_deref(), &[FILE], &[path])?;
    let options = TableOptions::default()
        .with_moduli_pa(
            arguments.from_kpa * 1e3,
            arguments.to_kpa * 1e3,
            arguments.moduli.into(),
        )
        .and_then(|options| options.with_largest_ratio(arguments.largest_ratio))
        .map_err(Failure::input)?;
    let started = Instant::now();
    let mut bar = Progress::of(arguments.moduli.into(), "finite elements");
    context.interrupt.hear(true);
    let solved = solve_contact_table(path, &options, |progress| {
        bar.done(progress.done);
        if context.interrupt.requested() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    context.interrupt.hear(false);
    drop(bar);
    let table = solved.map_err(Failure::input)?;
    let seconds = started.elapsed().as_secs_f64();
    context.console.line(format!(
        "contacts of {} moduli, interpolated within {:.2} % of the force, in {seconds:.1} s",
        table.curves().len(),
        100.0 * table.interpolation_error()
    ));
    context.console.value(&json!({
        "table": table, "interpolation_error": table.interpolation_error(), "seconds": seconds,
    }));
    if outputs.wanted() {
        let folder = arguments.out.as_deref().unwrap_or(Path::new(""));
        write_contact_table(folder.join(FILE), &table)?;
        context
            .console
            .line(format!("wrote {}", folder.join(FILE).display()));
    }
    Ok(Exit::Complete)
}
