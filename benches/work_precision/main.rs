//! Time against error for every setting that affects both, for each stage and for the whole
//! pipeline.
//!
//! ```console
//! cargo bench -p tactile-benches --bench work_precision              # some minutes
//! cargo bench -p tactile-benches --bench work_precision -- --quick   # under two minutes: fewer repeats, smaller problems
//! cargo bench -p tactile-benches --bench work_precision -- matching  # one study
//! cargo bench -p tactile-benches --bench work_precision -- --quick --within=1.5   # fails where a default lies further behind
//! ```
//! Writes `target/work_precision/STUDY.csv`.
//!
//! A default is behind the front if another setting is more than 1.2 times faster and no less
//! accurate, or more than 1.2 times more accurate and no slower. With `--within=FACTOR` that factor
//! applies, and such a default fails the run. With `--test` everything runs once without a
//! judgement, because a single timing is not reliable.
#![allow(missing_docs, clippy::print_stdout)]

mod elasticity;
mod force;
mod matching;
mod optics;
mod pipeline;
mod sfs;
mod study;
mod tps;

use std::path::Path;
use std::process::ExitCode;
use study::{Effort, Study};

/// Largest distance of a default from the front without a mark, unless `--within=` is given.
const WITHIN: f64 = 1.2;

/// The name of a study and the function that fills it.
type Filler = (&'static str, fn(&mut Study));

const STUDIES: [Filler; 11] = [
    ("splines", tps::clean),
    ("splines_noise", tps::noisy),
    ("matching", matching::noisy),
    ("matching_outliers", matching::outliers),
    ("surfaces", sfs::surfaces),
    ("slopes", sfs::slopes),
    ("force", force::frame),
    ("ball_laws", elasticity::laws),
    ("rays_section", optics::section),
    ("rays_volume", optics::volume),
    ("pipeline", pipeline::strain),
];

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let has = |flag: &str| arguments.iter().any(|a| a == flag);
    let effort = if has("--test") {
        Effort::Once
    } else if has("--quick") {
        Effort::Quick
    } else {
        Effort::Full
    };
    let named: Vec<&String> = arguments.iter().filter(|a| !a.starts_with("--")).collect();
    let within = arguments.iter().find_map(|a| a.strip_prefix("--within="));
    let within: Option<f64> =
        within.map(|text| text.parse().expect("--within= a factor such as 1.5"));
    let folder = Path::new(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../target/work_precision"
    ));
    std::fs::create_dir_all(folder).expect("a folder for the results");
    let mut behind = 0;
    for (name, fill) in STUDIES
        .iter()
        .filter(|(name, _)| named.is_empty() || named.iter().any(|n| n == name))
    {
        let mut study = Study::new(name, effort);
        fill(&mut study);
        study
            .write_csv(&folder.join(format!("{name}.csv")))
            .expect("a written table");
        behind += study.judge(within.unwrap_or(WITHIN));
    }
    println!("results in {}", folder.display());
    if behind == 0 || within.is_none() || effort == Effort::Once {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}
