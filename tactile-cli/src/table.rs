//! `tactile table`: the contacts of a ball with the guide of a sensor, computed once by finite
//! elements.
use crate::arguments::{modulus_kpa, positive};
use crate::console::{Bar, Context};
use crate::failure::{Exit, Failure};
use clap::Args;
use serde_json::json;
use std::path::PathBuf;
use std::time::Instant;
use tactile_files::scene::solve_contact_table;
use tactile_imaging::fem::ContactTableOptions;

/// Compute the contact table of a ball and a waveguide
///
/// SCENE.toml is a scene file, or a file with only its tables `object` (a sphere) and `waveguide`.
/// The contact table contains force as a function of contact radius and modulus, by finite elements
/// at finite strain. With `contact_table = "table.toml"` in a scene file, it is used for the
/// modulus. --out gets table.toml. Ctrl-C stops without a table.
#[derive(Args)]
#[command(
    after_help = "Example:\n  tactile table examples/data/press/scene.toml --moduli 2 \
                  --largest-ratio 0.5 --out target/table"
)]
pub(crate) struct ContactTableArguments {
    /// Scene file, or a file with its tables `object` and `waveguide`.
    scene: PathBuf,
    /// Smallest modulus of the ball, in kPa.
    #[arg(long, value_name = "KPA", default_value = "25", value_parser = modulus_kpa)]
    from_kpa: f64,
    /// Largest modulus of the ball, in kPa.
    #[arg(long, value_name = "KPA", default_value = "400", value_parser = modulus_kpa)]
    to_kpa: f64,
    /// Number of moduli.
    #[arg(long, default_value_t = 7, value_parser = clap::value_parser!(u16).range(2..=100))]
    moduli: u16,
    /// Largest contact radius relative to the radius of the ball.
    #[arg(long, value_name = "RATIO", default_value = "1.25", value_parser = positive)]
    largest_ratio: f64,
}

pub(crate) fn run(
    arguments: &ContactTableArguments,
    context: &mut Context,
) -> Result<Exit, Failure> {
    let path = arguments.scene.as_path();
    context.outputs.plan(&["table.toml"], &[path])?;
    let [from, to] = [arguments.from_kpa, arguments.to_kpa].map(|kpa| 1e3 * kpa);
    let options = ContactTableOptions::default()
        .with_moduli_pa(from, to, arguments.moduli.into())
        .and_then(|options| options.with_largest_ratio(arguments.largest_ratio))
        .map_err(Failure::input)?;
    let started = Instant::now();
    let mut bar = Bar::of(arguments.moduli.into(), "finite elements");
    context.interrupt.polled(true);
    let solved = solve_contact_table(path, &options, |progress| {
        bar.done(progress.done);
        context.interrupt.flow()
    });
    context.interrupt.polled(false);
    drop(bar);
    let table = solved.map_err(Failure::input)?;
    let seconds = started.elapsed().as_secs_f64();
    let (moduli, error) = (table.curves().len(), table.interpolation_error());
    context.line(format_args!(
        "contacts of {moduli} moduli, interpolated within {:.2} % of the force, in {seconds:.1} s",
        100.0 * error
    ));
    context.value(&json!({ "table": table, "interpolation_error": error, "seconds": seconds }));
    let text = toml::to_string(&table).map_err(Failure::output)?;
    context.outputs.add("table.toml", text.into_bytes());
    Ok(Exit::Complete)
}
