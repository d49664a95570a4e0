//! `tactile indent`: Young's modulus from a force–indentation curve.
use crate::context::Context;
use crate::failure::{Exit, Failure};
use crate::numbers::{digits, finite, positive};
use crate::outputs::{Csv, Outputs};
use crate::progress::waiting;
use clap::{Args, ValueEnum};
use serde_json::{Value, json};
use std::path::PathBuf;
use tactile_imaging::elasticity::contact::{Bond, relative_radius_m, tangent_of_degrees};
use tactile_imaging::elasticity::curve::{
    Baseline, ContactPoint, CurveFit, CurveOptions, CurveSelection, IndentationCurve, Indenter,
    Model, SelectionReason, select_model,
};
use tactile_imaging::elasticity::modulus::EstimatorKind;
use tactile_imaging::io::{Column, Quantity, read_table};
use tactile_imaging::pipeline::with_error;
use tactile_imaging::plot::{Colour, Page, Panel};

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
Models: hertz, layer (integral equation), layer-series (corrected), layer-published (Dimitriadis 2002, as printed),
  ball (a ball on a rigid flat at finite strain), tatara (squeezed ball), punch, cone; auto fits all that apply and takes the
  one with the lowest AICc. The interval holds the law's own error as well as the fit's.")]
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

impl Arguments {
    /// Refuses options that do not apply to what is pressed by what.
    fn check(&self) -> Result<(), Failure> {
        let (shape, ball) = (self.shape, self.ball_radius.is_some());
        let sphere = shape == Shape::Sphere;
        let with = |wrong: bool, option: &str, reason: &str| {
            let shape = shape.name();
            wrong.then(|| {
                Failure::input(format!(
                    "{option} does not apply to --shape {shape}{reason}: leave it out"
                ))
            })
        };
        let layer = self.thickness.is_some();
        let both = ball && self.radius.is_some();
        let wrong = [
            with(
                self.on_plate && !both,
                "--on-plate",
                " without --radius and --ball-radius",
            ),
            with(
                self.radius.is_some() && shape == Shape::Cone,
                "--radius",
                "",
            ),
            with(
                self.half_angle.is_some() && shape != Shape::Cone,
                "--half-angle",
                "",
            ),
            with(ball && !sphere, "--ball-radius", ""),
            with(layer && !sphere, "--thickness", ""),
            with(layer && ball, "--thickness", " with --ball-radius"),
            with(self.sliding && !layer, "--sliding", " without --thickness"),
            with(self.plates && !ball, "--plates", " without --ball-radius"),
            with(
                self.plates && self.radius.is_some(),
                "--plates",
                " with --radius",
            ),
        ];
        if let Some(failure) = wrong.into_iter().flatten().next() {
            return Err(failure);
        }
        match shape {
            Shape::Punch if self.radius.is_none() => {
                Err(Failure::input("--shape punch needs --radius, in m"))
            }
            Shape::Sphere if self.radius.is_none() && !ball => Err(Failure::input(
                "--shape sphere needs --radius of the sphere or --ball-radius of the sample, in m",
            )),
            _ => Ok(()),
        }
    }

    fn indenter(&self) -> Result<Indenter, tactile_imaging::elasticity::ElasticityError> {
        let bond = if self.sliding {
            Bond::Free
        } else {
            Bond::Bonded
        };
        Ok(match (self.shape, self.radius, self.ball_radius) {
            (Shape::Cone, ..) => Indenter::Cone {
                half_angle_tangent: tangent_of_degrees(self.half_angle.unwrap_or(70.3))?,
            },
            (Shape::Punch, radius, _) => Indenter::Punch {
                radius_m: radius.unwrap_or_default(),
            },
            (Shape::Sphere, None, Some(radius_m)) => Indenter::Ball { radius_m },
            (Shape::Sphere, Some(tip_radius_m), Some(ball_radius_m)) if self.on_plate => {
                Indenter::TipOnBall {
                    tip_radius_m,
                    ball_radius_m,
                }
            }
            (Shape::Sphere, radius, ball) => Indenter::Sphere {
                radius_m: relative_radius_m(radius, ball)?,
                thickness_m: self.thickness,
                bond,
            },
        })
    }

    fn model(&self) -> Model {
        use EstimatorKind as K;
        Model::Named(match self.model {
            Law::Auto => return Model::Auto,
            Law::Hertz => K::HertzSphere,
            Law::Layer => K::LayerIntegralEquation,
            Law::LayerSeries => K::LayerCorrectedSeries,
            Law::LayerPublished => K::LayerPublishedSeries,
            Law::Ball => K::SphereOnFlat,
            Law::Tatara => K::TataraSphere,
            Law::Punch => K::FlatPunch,
            Law::Cone => K::Cone,
        })
    }

    fn read(&self) -> Result<IndentationCurve, Failure> {
        let table = read_table(&self.curve)?;
        let indentation = Column {
            names: &["indentation", "depth", "position", "displacement"],
            quantity: Quantity::Length,
            unit: "m",
        };
        let force = Column {
            names: &["force", "load"],
            quantity: Quantity::Force,
            unit: "N",
        };
        if self.force_first && !table.header.is_empty() {
            return Err(Failure::input(format!(
                "--force-first is for tables without a header, and {} has one: leave it out",
                self.curve.display()
            )));
        }
        let [mut z, f] = if self.force_first {
            let [f, z] = table.columns([force, indentation], &self.curve)?;
            [z, f]
        } else {
            table.columns([indentation, force], &self.curve)?
        };
        if self.plates {
            z.iter_mut().for_each(|z| *z *= 0.5);
        }
        IndentationCurve::new(&z, &f)
            .map_err(|error| Failure::input(format!("{}: {error}", self.curve.display())))
    }
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
    let model = arguments.model();
    let found = waiting(job, || {
        select_model(&curve, &indenter, arguments.poisson, model, &options)
    })
    .map_err(|error| Failure::input(format!("{}: {error}", arguments.curve.display())))?;
    outputs.write(FILES[0], &table(&curve, found.chosen()))?;
    outputs.page(FILES[1], || page(&curve, found.chosen()))?;
    context.console.value(&json(&found));
    print(&found, curve.force_n().len(), context);
    if let Some(summary) = outputs.summary() {
        context.console.line(summary);
    }
    Ok(Exit::Complete)
}

/// The unit that a modulus of this size is read in, and how many of it one pascal is.
fn unit(pascals: f64) -> (f64, &'static str) {
    match pascals.abs() {
        v if v >= 1e9 => (1e-9, "GPa"),
        v if v >= 1e6 => (1e-6, "MPa"),
        v if v >= 1e3 => (1e-3, "kPa"),
        _ => (1.0, "Pa"),
    }
}

fn modulus(fit: &CurveFit) -> String {
    let (scale, unit) = unit(fit.youngs_modulus_pa);
    let value = with_error(fit.youngs_modulus_pa, fit.standard_error_pa, scale);
    format!("{value} {unit}")
}

fn interval(fit: &CurveFit) -> String {
    let (scale, unit) = unit(fit.youngs_modulus_pa);
    let lower = digits(fit.interval_95.lower * scale, 5);
    match fit.interval_95.upper {
        Some(upper) => format!("{lower} to {} {unit}", digits(upper * scale, 5)),
        None => format!("above {lower} {unit}"),
    }
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

fn print(found: &CurveSelection, points: usize, context: &mut Context) {
    let console = &mut context.console;
    let fit = found.chosen();
    console.line(format!(
        "Young's modulus   {}   (95 %: {})",
        modulus(fit),
        interval(fit)
    ));
    console.line(format!(
        "law               {}: {}",
        fit.model,
        reason(found)
    ));
    console.line(format!(
        "contact point     {} µm",
        digits(fit.contact_point_m * 1e6, 4)
    ));
    console.line(format!(
        "force offset      {} mN",
        digits(fit.offset_n * 1e3, 3)
    ));
    console.line(format!(
        "residuals         {} mN over {points} points, correlation of neighbours {:.2}",
        digits(fit.residual_sd_n * 1e3, 3),
        fit.residual_autocorrelation
    ));
    if let Some(ratio) = fit.contact_ratio {
        console.line(format!("largest a/R       {ratio:.3}"));
    }
    for warning in &fit.warnings {
        console.line(format!("warning           {warning}"));
    }
    if found.fits.len() > 1 {
        console.line(format!(
            "\n{:<40} {:>22} {:>10} {:>8}",
            "law", "modulus", "AICc", "weight"
        ));
        for (fit, weight) in found.fits.iter().zip(&found.weights) {
            console.line(format!(
                "{:<40} {:>22} {:>10.1} {weight:>8.3}",
                fit.model.to_string(),
                modulus(fit),
                fit.statistics.aicc
            ));
        }
    }
}

fn json(found: &CurveSelection) -> Value {
    let fit_json = |(fit, weight): (&CurveFit, &f64)| {
        json!({
            "model": fit.model.to_string(),
            "youngs_modulus_pa": fit.youngs_modulus_pa,
            "standard_error_pa": fit.standard_error_pa,
            "interval_95_pa": [Some(fit.interval_95.lower), fit.interval_95.upper],
            "contact_point_m": fit.contact_point_m,
            "offset_n": fit.offset_n,
            "residual_sd_n": fit.residual_sd_n,
            "residual_autocorrelation": fit.residual_autocorrelation,
            "largest_contact_ratio": fit.contact_ratio,
            "aicc": fit.statistics.aicc,
            "akaike_weight": weight,
            "warnings": fit.warnings.iter().map(ToString::to_string).collect::<Vec<_>>(),
        })
    };
    let fits: Vec<Value> = found
        .fits
        .iter()
        .zip(&found.weights)
        .map(fit_json)
        .collect();
    json!({ "chosen": fits.first(), "reason": reason(found), "fits": fits })
}

/// The curve beside the chosen fit.
fn table(curve: &IndentationCurve, fit: &CurveFit) -> Vec<u8> {
    let mut csv = Csv::new(&["position_m", "force_N", "fitted_N"]);
    for (i, fitted) in fit.fitted_n.iter().enumerate() {
        csv.row([curve.position_m()[i], curve.force_n()[i], *fitted]);
    }
    csv.into_bytes()
}

fn page(curve: &IndentationCurve, fit: &CurveFit) -> Page {
    let mm = |z: f64| (z - fit.contact_point_m) * 1e3;
    let at = |i: usize, force: f64| [mm(curve.position_m()[i]), force * 1e3];
    let measured = curve.force_n().iter().enumerate().map(|(i, &f)| at(i, f));
    let fitted = fit.fitted_n.iter().enumerate().map(|(i, &f)| at(i, f));
    let upper = Panel::new(format!("{}: {}", fit.model, modulus(fit)))
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
    Page::new("Indentation")
        .columns(1)
        .panel(upper)
        .panel(lower)
}
