//! Young's modulus from a force–indentation curve.
//!
//! ```text
//! cargo run --release --example indentation_modulus -- CURVE.csv --shape sphere --radius 5e-3 --thickness 2e-3
//! ```
#![allow(clippy::print_stdout, clippy::print_stderr)]

use clap::{Parser, ValueEnum};
use std::error::Error;
use std::path::PathBuf;
use tactile_imaging::elasticity::contact::{Bond, relative_radius_m, tangent_of_degrees};
use tactile_imaging::elasticity::curve::{
    Baseline, ContactPoint, CurveFit, CurveOptions, CurveSelection, IndentationCurve, Indenter,
    Model, SelectionReason, select_model,
};
use tactile_imaging::elasticity::modulus::EstimatorKind;
use tactile_imaging::io::read_table;
use tactile_imaging::plot::{Colour, Page, Panel};

/// Fits force against indentation: finds the contact point, the modulus with its 95 % interval, and the law that fits.
///
/// CURVE.csv has two columns in SI units: indentation in m (growing into the sample, its zero anywhere) and force in N
/// (pressing positive). A header that names a force column decides the order.
#[derive(Parser)]
#[command(after_help = "\
Examples:
  indentation_modulus curve.csv --shape sphere --radius 5e-3
  indentation_modulus curve.csv --shape sphere --radius 5e-3 --thickness 2e-3 --poisson 0.48
  indentation_modulus curve.csv --shape sphere --ball-radius 3e-3      a plate on a soft ball
  indentation_modulus curve.csv --shape cone --half-angle 70.3 --json
Models: hertz, layer (integral equation), layer-series (corrected), layer-published (Dimitriadis 2002, as printed),
  tatara (squeezed ball), punch, cone; auto fits all that apply and takes the one with the lowest AICc.")]
struct Arguments {
    /// Two columns: indentation (m), force (N).
    curve: PathBuf,
    /// What presses.
    #[arg(long, value_enum)]
    shape: Shape,
    /// Radius of the sphere or punch in m.
    #[arg(long, value_name = "R")]
    radius: Option<f64>,
    /// Radius of the sample in m where it is a ball; without --radius a flat plate presses it.
    #[arg(long, value_name = "R2")]
    ball_radius: Option<f64>,
    /// The ball is squeezed between two plates and the indentation is that of both contacts.
    #[arg(long)]
    plates: bool,
    /// Half opening angle of the cone in degrees from its axis.
    #[arg(long, value_name = "DEGREES", default_value_t = 70.3)]
    half_angle: f64,
    /// Thickness of the sample in m, where it is a layer on a rigid base.
    #[arg(long, value_name = "H")]
    thickness: Option<f64>,
    /// The layer slides on its base instead of sticking to it.
    #[arg(long)]
    sliding: bool,
    /// Poisson's ratio of the sample.
    #[arg(long, value_name = "NU", default_value_t = 0.5)]
    poisson: f64,
    /// Law to fit, or auto.
    #[arg(long, value_enum, default_value_t = Law::Auto)]
    model: Law,
    /// Contact point in m where it is known; searched for otherwise.
    #[arg(long, value_name = "Z")]
    contact: Option<f64>,
    /// The force gauge was tared: no offset is fitted.
    #[arg(long)]
    tared: bool,
    /// Columns without a header are force, indentation.
    #[arg(long)]
    force_first: bool,
    /// Prints one JSON object instead of text.
    #[arg(long)]
    json: bool,
    /// Where the plot goes.
    #[arg(long, value_name = "FILE", default_value = "indentation_modulus.svg")]
    plot: PathBuf,
}

#[derive(Clone, Copy, ValueEnum)]
enum Shape {
    Sphere,
    Punch,
    Cone,
}

#[derive(Clone, Copy, ValueEnum)]
enum Law {
    Auto,
    Hertz,
    Layer,
    LayerSeries,
    LayerPublished,
    Tatara,
    Punch,
    Cone,
}

fn main() -> std::process::ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => std::process::ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("error: {e}");
            std::process::ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let curve = read_curve(arguments)?;
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
    let found = select_model(
        &curve,
        &indenter(arguments)?,
        arguments.poisson,
        model(arguments.model),
        &options,
    )?;
    if arguments.json {
        println!("{:#}", json(&found));
    } else {
        print(&found, curve.force_n().len());
    }
    page(&curve, &found)?.save(&arguments.plot)?;
    eprintln!("plot: {}", arguments.plot.display());
    Ok(())
}

fn read_curve(arguments: &Arguments) -> Result<IndentationCurve, Box<dyn Error>> {
    let table = read_table(&arguments.curve)?;
    if table.values.ncols() < 2 {
        return Err(format!(
            "{}: two columns are needed, indentation and force",
            arguments.curve.display()
        )
        .into());
    }
    let named = table
        .header
        .iter()
        .position(|h| h.to_lowercase().contains("force"));
    let force = named.unwrap_or(if arguments.force_first { 0 } else { 1 });
    let depth = if force == 0 { 1 } else { 0 };
    let share = if arguments.plates { 0.5 } else { 1.0 };
    let z: Vec<f64> = table
        .values
        .column(depth)
        .iter()
        .map(|z| z * share)
        .collect();
    Ok(IndentationCurve::new(
        &z,
        &table.values.column(force).to_vec(),
    )?)
}

fn indenter(arguments: &Arguments) -> Result<Indenter, Box<dyn Error>> {
    let bond = if arguments.sliding {
        Bond::Free
    } else {
        Bond::Bonded
    };
    let thickness_m = arguments.thickness;
    Ok(
        match (arguments.shape, arguments.radius, arguments.ball_radius) {
            (Shape::Cone, ..) => Indenter::Cone {
                half_angle_tangent: tangent_of_degrees(arguments.half_angle)?,
            },
            (Shape::Punch, Some(radius_m), _) => Indenter::Punch { radius_m },
            (Shape::Sphere, Some(radius_m), None) => Indenter::Sphere {
                radius_m,
                thickness_m,
                bond,
            },
            (Shape::Sphere, None, Some(radius_m)) => Indenter::Ball { radius_m },
            (Shape::Sphere, Some(radius), Some(ball)) => Indenter::Sphere {
                radius_m: relative_radius_m(Some(radius), Some(ball))?,
                thickness_m: None,
                bond,
            },
            (Shape::Sphere | Shape::Punch, None, _) => {
                return Err("--radius (m) is needed for this shape".into());
            }
        },
    )
}

fn model(law: Law) -> Model {
    use EstimatorKind as K;
    Model::Named(match law {
        Law::Auto => return Model::Auto,
        Law::Hertz => K::HertzSphere,
        Law::Layer => K::LayerIntegralEquation,
        Law::LayerSeries => K::LayerCorrectedSeries,
        Law::LayerPublished => K::LayerPublishedSeries,
        Law::Tatara => K::TataraSphere,
        Law::Punch => K::FlatPunch,
        Law::Cone => K::Cone,
    })
}

/// Pascals in a unit one can read.
fn pascals(value: f64) -> String {
    let (scale, unit) = match value.abs() {
        v if v >= 1e9 => (1e-9, "GPa"),
        v if v >= 1e6 => (1e-6, "MPa"),
        v if v >= 1e3 => (1e-3, "kPa"),
        _ => (1.0, "Pa"),
    };
    format!("{:.4} {unit}", value * scale)
}

fn interval(fit: &CurveFit) -> String {
    let upper = fit.interval_95.upper.map_or("unbounded".into(), pascals);
    format!("{} to {upper}", pascals(fit.interval_95.lower))
}

fn reason(found: &CurveSelection) -> String {
    match found.reason {
        SelectionReason::Asked => "asked for".into(),
        SelectionReason::OnlyCandidate => "the only law for this indenter".into(),
        SelectionReason::BetterFit { margin } => {
            format!("its AICc is {margin:.1} below the next law's")
        }
        SelectionReason::MostGeneral { behind } => {
            format!(
                "fits as well as any (AICc {behind:.1} above the lowest) and holds wherever the others do"
            )
        }
        _ => "lowest AICc".into(),
    }
}

fn print(found: &CurveSelection, points: usize) {
    let fit = found.chosen();
    println!(
        "Young's modulus   {}   (95 %: {})",
        pascals(fit.youngs_modulus_pa),
        interval(fit)
    );
    println!("law               {}: {}", fit.model, reason(found));
    println!("contact point     {:.4e} m", fit.contact_point_m);
    println!("force offset      {:.3e} N", fit.offset_n);
    println!(
        "residuals         {:.3e} N over {points} points, correlation of neighbours {:.2}",
        fit.residual_sd_n, fit.residual_autocorrelation
    );
    if let Some(ratio) = fit.contact_ratio {
        println!("largest a/R       {ratio:.3}");
    }
    for warning in &fit.warnings {
        println!("warning           {warning}");
    }
    if found.fits.len() > 1 {
        println!(
            "\n{:<40} {:>14} {:>10} {:>8}",
            "law", "modulus", "AICc", "weight"
        );
        for (fit, weight) in found.fits.iter().zip(&found.weights) {
            let modulus = pascals(fit.youngs_modulus_pa);
            println!(
                "{:<40} {modulus:>14} {:>10.1} {weight:>8.3}",
                fit.model.to_string(),
                fit.statistics.aicc
            );
        }
    }
}

fn json(found: &CurveSelection) -> serde_json::Value {
    let fits: Vec<_> = (found.fits.iter().zip(&found.weights))
        .map(|(fit, weight)| {
            serde_json::json!({
                "model": fit.model.to_string(),
                "youngs_modulus_pa": fit.youngs_modulus_pa,
                "standard_error_pa": fit.standard_error_pa,
                "interval_95_pa": [fit.interval_95.lower, fit.interval_95.upper],
                "contact_point_m": fit.contact_point_m,
                "offset_n": fit.offset_n,
                "residual_sd_n": fit.residual_sd_n,
                "residual_autocorrelation": fit.residual_autocorrelation,
                "largest_contact_ratio": fit.contact_ratio,
                "aicc": fit.statistics.aicc,
                "akaike_weight": weight,
                "warnings": fit.warnings.iter().map(ToString::to_string).collect::<Vec<_>>(),
            })
        })
        .collect();
    serde_json::json!({ "chosen": fits[0], "reason": reason(found), "fits": fits })
}

fn page(curve: &IndentationCurve, found: &CurveSelection) -> Result<Page, Box<dyn Error>> {
    let fit = found.chosen();
    let mm = |z: f64| (z - fit.contact_point_m) * 1e3;
    let at = |i: usize, force: f64| [mm(curve.position_m()[i]), force * 1e3];
    let measured = curve.force_n().iter().enumerate().map(|(i, &f)| at(i, f));
    let fitted = fit.fitted_n.iter().enumerate().map(|(i, &f)| at(i, f));
    let title = format!(
        "{}: {} ({})",
        fit.model,
        pascals(fit.youngs_modulus_pa),
        interval(fit)
    );
    let upper = Panel::new(title)
        .x_label("indentation from the contact point (mm)")
        .y_label("force (mN)")
        .points(measured, Colour::BLUE, "measured")
        .line(fitted, Colour::ORANGE, "fit");
    let zero = [
        mm(curve.position_m()[0]),
        mm(curve.position_m()[curve.position_m().len() - 1]),
    ];
    let residuals =
        (curve.force_n().iter().zip(&fit.fitted_n).enumerate()).map(|(i, (f, g))| at(i, f - g));
    let lower = Panel::new("Residuals")
        .x_label("indentation from the contact point (mm)")
        .y_label("measured − fit (mN)")
        .points(residuals, Colour::BLUE, "")
        .dashed(zero.map(|x| [x, 0.0]), Colour::ORANGE, "");
    Ok(Page::new("Indentation")
        .columns(1)
        .panel(upper)
        .panel(lower))
}
