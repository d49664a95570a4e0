//! `tactile indent`: Young's modulus from a force–indentation curve.
use crate::arguments::{finite, length_m, name, poisson, positive};
use crate::console::{Context, Exit, Failure, digits};
use crate::outputs::Csv;
use crate::plot::{Colour, Page, Panel};
use clap::{Args, ValueEnum};
use serde_json::{Value, json};
use std::path::PathBuf;
use std::sync::Arc;
use tactile_files::io::read_table;
use tactile_imaging::elasticity::ElasticityError;
use tactile_imaging::elasticity::contact::{Bond, relative_radius_m, tangent_of_degrees};
use tactile_imaging::elasticity::curve::{
    Baseline, ContactPoint, CurveFit, CurveOptions, CurveSelection, IndentationCurve, Indenter,
    Model, SelectionReason, select_model,
};
use tactile_imaging::elasticity::modulus::EstimatorKind;
use tactile_imaging::pipeline::{interval_text, with_error};

/// Measure Young's modulus from a force–indentation curve
///
/// Finds the contact point, the modulus with its 95 % interval, and the law that fits. CURVE.csv
/// has a column of indentation (or depth, position, displacement: growing into the sample, its zero
/// anywhere) and one of force (or load: pressing positive), found by name and converted from the
/// unit in the heading (indentation_um, force (mN)). Without a header it has exactly these two, in
/// m and N. --out gets fit.csv and indentation.svg.
#[derive(Args)]
#[command(after_help = "\
Examples:
  tactile indent examples/data/curve.csv --shape sphere --radius 5e-3
  tactile indent examples/data/curve.csv --shape sphere --radius 5e-3 --thickness 2e-3 --poisson \
                        0.48
  tactile indent examples/data/curve.csv --shape sphere --ball-radius 3e-3      a plate on a soft \
                        ball
  tactile indent examples/data/curve.csv --shape sphere --radius 5e-3 --ball-radius 3e-3 \
                        --on-plate    a tip on it
  tactile indent examples/data/curve.csv --shape cone --half-angle 70.3 --json
Models: hertz, layer (integral equation), layer-series (corrected), layer-published (Dimitriadis \
                        2002, as printed),
  ball (a ball on a rigid flat at finite strain), tatara (squeezed ball), punch, cone; auto fits \
                        all that apply and takes the
  one with the lowest AICc. The interval holds the law's own error as well as the fit's. A curve \
                        does not tell whether the
  surfaces slide: --no-slip (deep samples) says that they stick, which lowers the modulus by 1.6 % \
                        at a Poisson's ratio of 0.3
  and a sphere, 2.8 % under a punch, and not at all at 0.5.")]
pub struct IndentArguments {
    /// Table of indentation and force.
    curve: PathBuf,
    /// What presses.
    #[arg(long, value_enum)]
    shape: Shape,
    /// Radius of the sphere or punch in m.
    #[arg(long, value_name = "R", value_parser = length_m)]
    radius: Option<f64>,
    /// Radius of the sample in m where it is a ball. Without --radius a flat plate presses it.
    #[arg(long, value_name = "R2", value_parser = length_m)]
    ball_radius: Option<f64>,
    /// The ball is squeezed between two plates and the indentation is that of both contacts.
    #[arg(long)]
    plates: bool,
    /// The ball lies on a plate and a rigid sphere presses it from above: the indentation is that
    /// of both contacts.
    #[arg(long)]
    on_plate: bool,
    /// Half opening angle of the cone in degrees from its axis (70.3 if not given).
    #[arg(long, value_name = "DEGREES", value_parser = positive, allow_negative_numbers = true)]
    half_angle: Option<f64>,
    /// Thickness of the sample in m, where it is a layer on a rigid base.
    #[arg(long, value_name = "H", value_parser = length_m)]
    thickness: Option<f64>,
    /// The layer slides on its base instead of sticking to it.
    #[arg(long)]
    sliding: bool,
    /// The surfaces stick where they touch, instead of sliding without friction.
    #[arg(long, conflicts_with = "model")]
    no_slip: bool,
    /// Poisson's ratio of the sample.
    #[arg(long, value_name = "NU", default_value_t = 0.5, value_parser = poisson,
          allow_negative_numbers = true)]
    poisson: f64,
    /// Law to fit, or auto.
    #[arg(long, value_enum, default_value_t = Law::Auto)]
    model: Law,
    /// Contact point in m where it is known. Searched for otherwise.
    #[arg(long, value_name = "Z", value_parser = finite, allow_negative_numbers = true)]
    contact: Option<f64>,
    /// The force gauge was tared: no offset is fitted.
    #[arg(long)]
    tared: bool,
    /// In a table without a header the force comes first.
    #[arg(long)]
    force_first: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
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
    Ball,
    Tatara,
    Punch,
    Cone,
}

impl IndentArguments {
    /// Refuses options that do not apply to the shape, the sample or the law.
    fn check(&self) -> Result<(), Failure> {
        let is = |shape: Shape| self.shape == shape;
        let [sphere, cone] = [is(Shape::Sphere), is(Shape::Cone)];
        let [radius, ball] = [self.radius.is_some(), self.ball_radius.is_some()];
        let layer = self.thickness.is_some();
        // An option that is given, the case that it does not apply to, and the words for that.
        let rules = [
            (
                self.on_plate,
                !(ball && radius),
                "--on-plate",
                " without --radius and --ball-radius",
            ),
            (radius, cone, "--radius", ""),
            (self.half_angle.is_some(), !cone, "--half-angle", ""),
            (ball, !sphere, "--ball-radius", ""),
            (layer, !sphere, "--thickness", ""),
            (layer, ball, "--thickness", " with --ball-radius"),
            (self.sliding, !layer, "--sliding", " without --thickness"),
            (self.plates, !ball, "--plates", " without --ball-radius"),
            (self.no_slip, layer, "--no-slip", " with --thickness"),
            (self.no_slip, self.on_plate, "--no-slip", " with --on-plate"),
            (
                self.no_slip,
                ball && !radius,
                "--no-slip",
                " with --ball-radius alone",
            ),
            (self.plates, radius, "--plates", " with --radius"),
        ];
        if let Some((_, _, option, reason)) = rules.into_iter().find(|rule| rule.0 && rule.1) {
            let shape = name(self.shape);
            return Err(Failure::input(format!(
                "{option} does not apply to --shape {shape}{reason}: leave it out"
            )));
        }
        let (fits, needs) = match self.model {
            Law::Auto => (true, ""),
            Law::Hertz => (
                sphere && !self.on_plate,
                "--shape sphere without --on-plate",
            ),
            Law::Layer | Law::LayerSeries | Law::LayerPublished => {
                (sphere && layer, "--shape sphere with --thickness")
            }
            Law::Ball | Law::Tatara => (
                sphere && ball && !radius,
                "--shape sphere with --ball-radius alone",
            ),
            Law::Punch => (is(Shape::Punch), "--shape punch"),
            Law::Cone => (cone, "--shape cone"),
        };
        if !fits {
            let model = name(self.model);
            return Err(Failure::input(format!(
                "--model {model} is a law for {needs}: leave it out, or name another"
            )));
        }
        match self.shape {
            Shape::Punch if !radius => Err(Failure::input("--shape punch needs --radius, in m")),
            Shape::Sphere if !radius && !ball => Err(Failure::input(
                "--shape sphere needs --radius of the sphere or --ball-radius of the sample, in m",
            )),
            _ => Ok(()),
        }
    }

    fn indenter(&self) -> Result<Indenter, ElasticityError> {
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
        if self.no_slip {
            return Model::Named(match self.shape {
                Shape::Sphere => K::SphereWithoutSlip,
                Shape::Punch => K::FlatPunchWithoutSlip,
                Shape::Cone => K::ConeWithoutSlip,
            });
        }
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
        let indentation: (&[&str], _) =
            (&["indentation", "depth", "position", "displacement"], "m");
        let force: (&[&str], _) = (&["force", "load"], "N");
        if self.force_first && !table.header.is_empty() {
            return Err(Failure::input(format!(
                "--force-first is for tables without a header, and {} has one: leave it out",
                self.curve.display()
            )));
        }
        let [mut z, f] = if self.force_first {
            let [f, z] = table.columns([force, indentation])?;
            [z, f]
        } else {
            table.columns([indentation, force])?
        };
        refuse_return(&z).map_err(|reason| Failure::in_file(&self.curve, reason))?;
        if self.plates {
            // Each of the two contacts has half of the approach.
            z.iter_mut().for_each(|z| *z *= 0.5);
        }
        IndentationCurve::new(&z, &f).map_err(|error| Failure::in_file(&self.curve, error))
    }
}

/// Refuses a table that goes into the sample and out again: the way back is another curve.
fn refuse_return(position_m: &[f64]) -> Result<(), String> {
    let depth = |k: &usize| position_m[*k];
    let rows = || 0..position_m.len();
    let deepest = rows().max_by(|a, b| depth(a).total_cmp(&depth(b)));
    let (Some(deepest), Some(last)) = (deepest, rows().last()) else {
        return Ok(());
    };
    let way = |from: usize, to: usize| position_m[to] - position_m[from];
    // A tenth of the way is more than a gauge's noise.
    let (there, back) = (way(0, deepest), way(last, deepest));
    if there > 0.0 && back > 0.1 * there {
        return Err(format!(
            "the indentation grows up to row {} and falls after it: keep the loading or the \
             unloading alone",
            deepest + 1
        ));
    }
    Ok(())
}

pub fn run(arguments: &IndentArguments, context: &mut Context) -> Result<Exit, Failure> {
    arguments.check()?;
    let names = ["fit.csv", "indentation.svg"];
    context.outputs.plan(&names, &[&arguments.curve])?;
    // The fit runs in a thread of its own, the curve is drawn in this one.
    let curve = Arc::new(arguments.read()?);
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
    let points = curve.force_n().len();
    let (model, poisson) = (arguments.model(), arguments.poisson);
    let fitted = Arc::clone(&curve);
    let found = context.wait(format!("fitting {points} points"), move || {
        select_model(&fitted, &indenter, poisson, model, &options)
    });
    let Some(found) = found else {
        return Ok(Exit::Interrupted);
    };
    let found = found.map_err(|error| Failure::in_file(&arguments.curve, error))?;
    let chosen = found.chosen();
    print(&found, points, context);
    doubts(&curve, chosen, arguments.contact.is_some(), context);
    context.value(&value(&found));
    let mut csv = Csv::new("position_m,force_N,fitted_N");
    for (i, fitted) in chosen.fitted_n.iter().enumerate() {
        csv.row([curve.position_m()[i], curve.force_n()[i], *fitted]);
    }
    context.outputs.add(names[0], csv.into_bytes());
    context.outputs.page(names[1], || page(&curve, chosen))?;
    Ok(Exit::Complete)
}

/// Cautions about a curve and its fit.
fn doubts(curve: &IndentationCurve, fit: &CurveFit, known_contact: bool, context: &mut Context) {
    for warning in &fit.warnings {
        context.warn("assumption", Value::Null, warning);
    }
    let force = curve.force_n();
    let (first, last) = (curve.position_m()[0], curve.position_m()[force.len() - 1]);
    let most = force.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    // A gauge in range repeats its largest reading by chance alone.
    let at_most = force.iter().filter(|f| **f == most).count();
    if at_most > 3 && 50 * at_most > force.len() {
        context.warn(
            "force_saturated",
            json!({ "points": at_most, "force_n": most }),
            format_args!(
                "{at_most} points have the largest force, {} mN: the gauge may be at its limit",
                digits(1e3 * most, 4)
            ),
        );
    }
    // Neighbours that go together leave fewer independent points than the interval counts.
    let correlation = fit.residual_autocorrelation;
    if correlation > 0.5 {
        context.warn(
            "residuals_correlated",
            json!({ "correlation": correlation }),
            format_args!(
                "the residuals of neighbours go together ({correlation:.2}): the curve is not \
                 that of this law, and the interval is too narrow"
            ),
        );
    }
    let reach = 0.02 * (last - first);
    let at = fit.contact_point_m;
    if !known_contact && (at < first + reach || at > last - reach) {
        context.warn(
            "contact_point_at_bound",
            json!({ "contact_point_m": at }),
            "the contact point lies at an end of the curve: it may begin before it, give \
             --contact where it is known",
        );
    }
}

/// The unit that a modulus of this size is read in, and its inverse in pascals.
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

fn reason(found: &CurveSelection) -> String {
    match found.reason {
        SelectionReason::Asked => "asked for".into(),
        SelectionReason::OnlyCandidate => "the only law for this indenter".into(),
        SelectionReason::BetterFit { margin } => {
            format!("its AICc is {margin:.1} below the next law's")
        }
        SelectionReason::MostGeneral { behind } => format!(
            "fits as well as any (AICc {behind:.1} above the lowest) and holds wherever the \
             others do"
        ),
        _ => "lowest AICc".into(),
    }
}

fn print(found: &CurveSelection, points: usize, context: &mut Context) {
    let fit = found.chosen();
    // All limits in the unit of the value, so that they compare at a glance.
    let (scale, unit) = unit(fit.youngs_modulus_pa);
    let ends = (fit.interval_95.lower, fit.interval_95.upper);
    let ends = interval_text(ends, fit.standard_error_pa, scale);
    let text = format!("{}   (95 %: {ends} {unit})", modulus(fit));
    context.row("Young's modulus", text);
    context.row("law", format_args!("{}: {}", fit.model, reason(found)));
    if fit.model_error > 0.0 {
        let error = 100.0 * fit.model_error;
        let text = format!("{error:.1} % (standard error, part of the interval)");
        context.row("error of the law", text);
    }
    context.row(
        "contact point",
        digits(fit.contact_point_m * 1e6, 4) + " µm",
    );
    context.row("force offset", digits(fit.offset_n * 1e3, 3) + " mN");
    let residual = digits(fit.residual_sd_n * 1e3, 3);
    let correlation = fit.residual_autocorrelation;
    context.row(
        "residuals",
        format_args!(
            "{residual} mN over {points} points, correlation of neighbours {correlation:.2}"
        ),
    );
    if let Some(ratio) = fit.contact_ratio {
        context.row("largest a/R", format_args!("{ratio:.3}"));
    }
    if found.fits.len() > 1 {
        let [law, modulus, aicc, weight] = ["law", "modulus", "AICc", "weight"];
        context.line(format_args!(
            "\n{law:<40} {modulus:>22} {aicc:>10} {weight:>8}"
        ));
    }
    for (fit, weight) in found
        .fits
        .iter()
        .zip(&found.weights)
        .filter(|_| found.fits.len() > 1)
    {
        let (law, aicc) = (fit.model.to_string(), fit.statistics.aicc);
        let modulus = modulus(fit);
        context.line(format_args!(
            "{law:<40} {modulus:>22} {aicc:>10.1} {weight:>8.3}"
        ));
    }
}

fn value(found: &CurveSelection) -> Value {
    let fit = |(fit, weight): (&CurveFit, &f64)| {
        json!({
            "model": fit.model.to_string(),
            "youngs_modulus_pa": {
                "value": fit.youngs_modulus_pa,
                "standard_error": fit.standard_error_pa,
                "interval_95": [Some(fit.interval_95.lower), fit.interval_95.upper],
            },
            "model_error": fit.model_error,
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
    let fits: Vec<Value> = found.fits.iter().zip(&found.weights).map(fit).collect();
    json!({ "chosen": fits.first(), "reason": reason(found), "fits": fits })
}

fn page(curve: &IndentationCurve, fit: &CurveFit) -> Page {
    let (z, force) = (curve.position_m(), curve.force_n());
    let mm = |z: f64| (z - fit.contact_point_m) * 1e3;
    let at = |(i, force): (usize, f64)| [mm(z[i]), force * 1e3];
    let measured = force.iter().copied().enumerate().map(at);
    let fitted = fit.fitted_n.iter().copied().enumerate().map(at);
    let residuals = force.iter().zip(&fit.fitted_n).map(|(f, g)| f - g);
    let x = "indentation from the contact point (mm)";
    let title = format!("{}: {}", fit.model, modulus(fit));
    let upper = Panel::new(title, x, "force (mN)")
        .points(measured, Colour::Blue, "measured")
        .line(fitted, Colour::Orange, "fit");
    let zero = [z[0], z[z.len() - 1]].map(|z| [mm(z), 0.0]);
    let lower = Panel::new("Residuals", x, "measured − fit (mN)")
        .points(residuals.enumerate().map(at), Colour::Blue, "")
        .dashed(zero, Colour::Orange, "");
    Page::new("Indentation", 1, vec![upper, lower])
}
