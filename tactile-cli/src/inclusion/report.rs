//! What `tactile inclusion` prints, draws and writes.
use super::source::Source;
use crate::context::Context;
use crate::outputs::Csv;
use crate::plot::{Colour, Page, Panel};
use serde_json::{Value, json};
use tactile_imaging::fem::Interface;
use tactile_imaging::inclusion::{
    Estimated, Identifiable, InclusionEstimate, InclusionWarning, Verdict,
};
use tactile_imaging::pipeline::with_error;

fn interval(estimated: &Estimated, scale: f64, unit: &str) -> String {
    let value = with_error(estimated.value, estimated.standard_error, scale);
    let [low, high] = estimated.interval.map(|limit| limit * scale);
    format!("{value} {unit}   (95 %: {low:.3} to {high:.3})")
}

fn parameter(parameter: &Identifiable, scale: f64, unit: &str) -> String {
    match parameter {
        Identifiable::Yes(estimated) => interval(estimated, scale, unit),
        Identifiable::No(estimated) => {
            let [low, high] = estimated.interval.map(|limit| limit * scale);
            format!("cannot be told from these frames (95 %: {low:.2} to {high:.2} {unit})")
        }
    }
}

pub fn print(estimate: &InclusionEstimate, source: &Source, context: &mut Context) {
    let console = &mut context.console;
    let verdict = match (estimate.verdict(), estimate.probability) {
        (Verdict::Found, _) => "a lump".to_owned(),
        (Verdict::Absent, _) => "no lump that these frames show".to_owned(),
        (Verdict::Uncertain, p) if p > 0.5 => format!("uncertain: a lump with probability {p:.2}"),
        (Verdict::Uncertain, _) => "uncertain: the model does not explain the frames".to_owned(),
    };
    console.line(format!("found             {verdict}"));
    if let Some(inclusion) = &estimate.inclusion {
        console.line(format!(
            "diameter          {}",
            parameter(&inclusion.diameter_m, 1e3, "mm")
        ));
        console.line(format!(
            "depth of its top  {}",
            parameter(&inclusion.depth_m, 1e3, "mm")
        ));
        console.line(format!(
            "its modulus       {}",
            parameter(&inclusion.youngs_modulus_pa, 1e-3, "kPa")
        ));
        let [[_, depth, modulus], [_, _, both], _] = inclusion.correlation;
        console.line(format!(
            "correlations      diameter–depth {depth:+.2}, diameter–modulus {modulus:+.2}, depth–modulus {both:+.2}"
        ));
    }
    console.line(format!(
        "block's modulus   {}",
        interval(&estimate.block_modulus_pa, 1e-3, "kPa")
    ));
    let interface = match estimate.interface {
        Interface::Bonded => "bonded",
        Interface::Frictionless => "frictionless",
    };
    console.line(format!(
        "interface         {interface}, misfit χ² {:.2} per value",
        estimate.misfit
    ));
    if let Some([diameter, depth, modulus]) = source.truth {
        console.line(format!(
            "truth             diameter {:.1} mm, depth {:.1} mm, modulus {:.0} kPa (simulated by the same finite elements)",
            1e3 * diameter,
            1e3 * depth,
            1e-3 * modulus
        ));
    }
    for warning in &estimate.warnings {
        console.line(format!("warning           {}", sentence(warning)));
    }
}

fn sentence(warning: &InclusionWarning) -> String {
    match warning {
        InclusionWarning::PoorFit { excess } => format!(
            "the best fit leaves {excess:.1} times what the errors explain: several lumps, one off the axis, or wrong sizes or forces; errors are widened"
        ),
        InclusionWarning::OneFrame => {
            "one frame tells size and stiffness hardly apart: add approaches".into()
        }
        InclusionWarning::NotConverged => "the fit had not settled; nothing of it is told".into(),
        InclusionWarning::UncertainInterface => {
            "bonded and frictionless faces explain the frames about equally well".into()
        }
        InclusionWarning::AtBoundary => {
            "the lump touches the surface or the base: beyond the model".into()
        }
        InclusionWarning::Asymmetric { asymmetry } => format!(
            "the pressure is {:.1} % larger on one side: a lump off the axis, several, or a tilted block; the model is symmetric",
            100.0 * asymmetry
        ),
        other => format!("{other:?}"),
    }
}

pub fn as_json(estimate: &InclusionEstimate, source: &Source) -> Value {
    let is_asymmetric = (estimate.warnings.iter())
        .any(|warning| matches!(warning, InclusionWarning::Asymmetric { .. }));
    json!({
        "verdict": estimate.verdict(),
        "found": estimate.found,
        "probability": estimate.probability,
        "inclusion": estimate.inclusion,
        "block_modulus_pa": estimate.block_modulus_pa,
        "interface": estimate.interface,
        "misfit": estimate.misfit,
        "asymmetry": source.asymmetry,
        "is_asymmetric": is_asymmetric,
        "warnings": estimate.warnings,
    })
}

pub fn table(estimate: &InclusionEstimate, source: &Source) -> Vec<u8> {
    let mut csv = Csv::new(&[
        "frame",
        "radius_m",
        "pressure_pa",
        "standard_error_pa",
        "fitted_pa",
        "plain_block_pa",
    ]);
    for (frame, profile) in source.profiles.iter().enumerate() {
        for (k, radius) in estimate.radii_m.iter().enumerate() {
            csv.row([
                frame as f64 + 1.0,
                *radius,
                profile.pressure_pa[k],
                profile.standard_error_pa[k],
                estimate.fitted_pa[frame][k],
                estimate.homogeneous_pa[frame][k],
            ]);
        }
    }
    csv.into_bytes()
}

pub fn page(estimate: &InclusionEstimate, source: &Source) -> Page {
    let mm = |radius: &f64| radius * 1e3;
    let count = estimate.radii_m.len();
    let mut pressures = Panel::new("pressure on the guide's face")
        .x_label("distance from the axis (mm)")
        .y_label("pressure (Pa)");
    let mut residuals = Panel::new("measured − fitted")
        .x_label("distance from the axis (mm)")
        .y_label("pressure (Pa)");
    for (frame, profile) in source.profiles.iter().enumerate() {
        let first = frame == 0;
        let name = |text: &str| {
            if first {
                text.to_owned()
            } else {
                String::new()
            }
        };
        let points = |values: &[f64]| -> Vec<[f64; 2]> {
            let pairs = estimate.radii_m.iter().zip(values);
            pairs.map(|(radius, value)| [mm(radius), *value]).collect()
        };
        let rest: Vec<f64> = (profile.pressure_pa[..count].iter())
            .zip(&estimate.fitted_pa[frame])
            .map(|(measured, fitted)| measured - fitted)
            .collect();
        pressures = pressures
            .points(
                points(&profile.pressure_pa[..count]),
                Colour::BLUE,
                &name("measured"),
            )
            .line(
                points(&estimate.fitted_pa[frame]),
                Colour::ORANGE,
                &name("fit"),
            )
            .dashed(
                points(&estimate.homogeneous_pa[frame]),
                Colour::GREY,
                &name("plain block"),
            );
        residuals = residuals.points(points(&rest), Colour::BLUE, &name("all frames"));
    }
    Page::new("Inclusion under the surface")
        .columns(2)
        .panel(pressures)
        .panel(residuals)
        .panel(section(source, estimate))
}

/// The block in section, to scale, with the lump.
fn section(source: &Source, estimate: &InclusionEstimate) -> Panel {
    let specimen = source.specimen;
    let (height, radius) = (1e3 * specimen.height_m(), 1e3 * specimen.radius_m());
    let outline = [
        [-radius, 0.0],
        [radius, 0.0],
        [radius, -height],
        [-radius, -height],
        [-radius, 0.0],
    ];
    let face = 1e3 * source.guide.radius_m();
    let mut panel = Panel::new("section, to scale")
        .x_label("mm")
        .y_label("height (mm)")
        .equal_aspect()
        .line(outline, Colour::GREY, "block")
        .line([[-face, 0.5], [face, 0.5]], Colour::BLUE, "guide's face");
    if let Some(inclusion) = &estimate.inclusion {
        let diameter = 1e3 * inclusion.diameter_m.estimate().value;
        let depth = 1e3 * inclusion.depth_m.estimate().value;
        let circle = (0..=72).map(|k| {
            let angle = std::f64::consts::TAU * f64::from(k) / 72.0;
            let (sin, cos) = angle.sin_cos();
            [0.5 * diameter * cos, -depth - 0.5 * diameter * (1.0 + sin)]
        });
        panel = panel.line(circle, Colour::ORANGE, "lump");
    }
    panel
}
