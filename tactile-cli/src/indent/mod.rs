//! `tactile indent`: Young's modulus from a force–indentation curve.
mod input;
mod report;

use crate::context::Context;
use crate::failure::{Exit, Failure};
use crate::numbers::{finite, positive};
use crate::outputs::Outputs;
use crate::progress::waiting_or_interrupted;
use clap::{Args, ValueEnum};
use std::path::PathBuf;
use std::sync::Arc;
use tactile_imaging::elasticity::curve::{Baseline, ContactPoint, CurveOptions, select_model};

/// Measure Young's modulus from a force–indentation curve
///
/// Finds the contact point, the modulus with its 95 % interval, and the law that fits. CURVE.csv has a column of
/// indentation (or depth, position, displacement: growing into the sample, its zero anywhere) and one of force (or load:
/// pressing positive), found by name and converted from the unit in the heading (indentation_um, force (mN)); without a
/// header it has exactly these two, in m and N. --out gets fit.csv and indentation.svg.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tactile indent examples/data/curve.csv --shape sphere --radius 5e-3
  tactile indent examples/data/curve.csv --shape sphere --radius 5e-3 --thickness 2e-3 --poisson 0.48
  tactile indent examples/data/curve.csv --shape sphere --ball-radius 3e-3      a plate on a soft ball
  tactile indent examples/data/curve.csv --shape sphere --radius 5e-3 --ball-radius 3e-3 --on-plate    a tip on it
  tactile indent examples/data/curve.csv --shape cone --half-angle 70.3 --json
  tactile indent examples/data/curve.csv --shape sphere --radius 5e-3 --poisson 0.3 --no-slip
Models: hertz, layer (integral equation), layer-series (corrected), layer-published (Dimitriadis 2002, as printed),
  ball (a ball on a rigid flat at finite strain), tatara (squeezed ball), punch, cone; auto fits all that apply and takes the
  one with the lowest AICc. The interval holds the law's own error as well as the fit's. A curve does not tell whether the
  surfaces slide: --no-slip (deep samples) says that they stick, which lowers the modulus by 1.6 % at a Poisson's ratio of 0.3
  and a sphere, 2.8 % under a punch, and not at all at 0.5.")]
pub struct Arguments {
    /// Table of indentation and force.
    curve: PathBuf,
    /// What presses.
    #[arg(long, value_enum)]
    shape: Shape,
    /// Radius of the sphere or punch in m.
    #[arg(long, value_name = "R", value_parser = positive)]
    radius: Option<f64>,
    /// Radius of the sample in m where it is a ball; without --radius a flat plate presses it.
    #[arg(long, value_name = "R2", value_parser = positive)]
    ball_radius: Option<f64>,
    /// The ball is squeezed between two plates and the indentation is that of both contacts.
    #[arg(long)]
    plates: bool,
    /// The ball lies on a plate and a rigid sphere presses it from above: the indentation is that of both contacts.
    #[arg(long)]
    on_plate: bool,
    /// Half opening angle of the cone in degrees from its axis (70.3 if not given).
    #[arg(long, value_name = "DEGREES", value_parser = positive)]
    half_angle: Option<f64>,
    /// Thickness of the sample in m, where it is a layer on a rigid base.
    #[arg(long, value_name = "H", value_parser = positive)]
    thickness: Option<f64>,
    /// The layer slides on its base instead of sticking to it.
    #[arg(long)]
    sliding: bool,
    /// The surfaces stick where they touch, instead of sliding without friction.
    #[arg(long, conflicts_with = "model")]
    no_slip: bool,
    /// Poisson's ratio of the sample.
    #[arg(long, value_name = "NU", default_value_t = 0.5, value_parser = poisson, allow_negative_numbers = true)]
    poisson: f64,
    /// Law to fit, or auto.
    #[arg(long, value_enum, default_value_t = Law::Auto)]
    model: Law,
    /// Contact point in m where it is known; searched for otherwise.
    #[arg(long, value_name = "Z", value_parser = finite, allow_negative_numbers = true)]
    contact: Option<f64>,
    /// The force gauge was tared: no offset is fitted.
    #[arg(long)]
    tared: bool,
    /// In a table without a header the force comes first.
    #[arg(long)]
    force_first: bool,
    /// Folder for fit.csv and indentation.svg.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Shape {
    Sphere,
    Punch,
    Cone,
}

impl Shape {
    fn name(self) -> &'static str {
        match self {
            Self::Sphere => "sphere",
            Self::Punch => "punch",
            Self::Cone => "cone",
        }
    }
}

#[derive(Clone, Copy, ValueEnum)]
enum Law {
    Auto,
    Hertz,
    Layer,
    LayerSeries,
    LayerPublished,
    Ball,
    Tatara,
    Punch,
    Cone,
}

fn poisson(text: &str) -> Result<f64, String> {
    let value = text.parse().ok();
    value
        .filter(|v: &f64| *v > -1.0 && *v <= 0.5)
        .ok_or_else(|| "expected a number above -1 and at most 0.5".to_owned())
}

const FILES: [&str; 2] = ["fit.csv", "indentation.svg"];

pub fn run(arguments: &Arguments, context: &mut Context) -> Result<Exit, Failure> {
    arguments.check()?;
    let mut outputs = Outputs::plan(arguments.out.as_deref(), &FILES, &[&arguments.curve])?;
    let curve = arguments.read()?;
    let indenter = arguments.indenter().map_err(Failure::input)?;
    let options = CurveOptions {
        baseline: if arguments.tared {
            Baseline::Zero
        } else {
            Baseline::Auto
        },
        contact_point: arguments
            .contact
            .map_or(ContactPoint::Search, ContactPoint::At),
    };
    let job = format!("fitting {} points", curve.force_n().len());
    let (model, poisson) = (arguments.model(), arguments.poisson);
    let curve = Arc::new(curve);
    let fitted = Arc::clone(&curve);
    let found = waiting_or_interrupted(job, &context.interrupt, move || {
        select_model(&fitted, &indenter, poisson, model, &options)
    });
    let Some(found) = found else {
        return Ok(Exit::Interrupted);
    };
    let found =
        found.map_err(|error| Failure::input(format!("{}: {error}", arguments.curve.display())))?;
    outputs.write(FILES[0], &report::table(&curve, found.chosen()))?;
    outputs.page(FILES[1], || report::page(&curve, found.chosen()))?;
    context.console.value(&report::json(&found));
    report::print(&found, curve.force_n().len(), context);
    if let Some(summary) = outputs.summary() {
        context.console.line(summary);
    }
    Ok(Exit::Complete)
}
