//! What is known of a curve, as text, JSON, table and plot.
use crate::context::Context;
use crate::numbers::digits;
use crate::outputs::Csv;
use crate::plot::{Colour, Page, Panel};
use serde_json::{Value, json};
use tactile_imaging::elasticity::curve::{
    CurveFit, CurveSelection, IndentationCurve, SelectionReason,
};
use tactile_imaging::pipeline::with_error;

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

pub fn print(found: &CurveSelection, points: usize, context: &mut Context) {
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
    if fit.model_error > 0.0 {
        console.line(format!(
            "error of the law  {:.1} % (standard error, part of the interval)",
            100.0 * fit.model_error
        ));
    }
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

pub fn json(found: &CurveSelection) -> Value {
    let fit_json = |(fit, weight): (&CurveFit, &f64)| {
        json!({
            "model": fit.model.to_string(),
            "youngs_modulus_pa": fit.youngs_modulus_pa,
            "standard_error_pa": fit.standard_error_pa,
            "interval_95_pa": [Some(fit.interval_95.lower), fit.interval_95.upper],
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
    let fits: Vec<Value> = found
        .fits
        .iter()
        .zip(&found.weights)
        .map(fit_json)
        .collect();
    json!({ "chosen": fits.first(), "reason": reason(found), "fits": fits })
}

/// The curve beside the chosen fit.
pub fn table(curve: &IndentationCurve, fit: &CurveFit) -> Vec<u8> {
    let mut csv = Csv::new(&["position_m", "force_N", "fitted_N"]);
    for (i, fitted) in fit.fitted_n.iter().enumerate() {
        csv.row([curve.position_m()[i], curve.force_n()[i], *fitted]);
    }
    csv.into_bytes()
}

pub fn page(curve: &IndentationCurve, fit: &CurveFit) -> Page {
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
