//! What is known of a press, as text and JSON, and beside the truth.
use super::Contact;
use super::timing::Timing;
use super::truth::Truth;
use crate::console::Console;
use serde_json::json;
use tactile_imaging::pipeline::{Measurement, with_error};

pub fn percent(found: f64, truth: f64) -> f64 {
    100.0 * (found / truth - 1.0)
}

/// Whether every stage has an answer.
pub fn is_complete(measurement: &Measurement) -> bool {
    measurement.youngs_modulus_pa.is_ok()
        && measurement.strain.is_ok()
        && (measurement.frames.iter()).all(|f| f.as_ref().is_ok_and(|f| f.force_n.is_ok()))
}

/// The contacts alone, of a measurement that Ctrl-C stopped.
pub fn print_contacts(contacts: &[Contact], console: &mut Console) {
    let mut values = Vec::new();
    for (k, contact) in contacts.iter().enumerate() {
        let name = format!("frame {}", k + 1);
        match contact {
            Ok(Some(contact)) => {
                let radius = contact.contact_radius_m;
                let force = contact.force_n.map_or("force unknown".to_owned(), |f| {
                    format!("force {} N", with_error(f.value, f.standard_error, 1.0))
                });
                let radius = with_error(radius.value, radius.standard_error, 1e3);
                console.line(format!("{name:<16} {force}   contact radius {radius} mm"));
                values.push(json!({ "value": contact }));
            }
            Ok(None) => {
                console.line(format!("{name:<16} no contact"));
                values.push(json!({ "value": null }));
            }
            Err(error) => {
                console.line(format!("{name:<16} none: {error}"));
                values.push(json!({ "error": error.to_string() }));
            }
        }
    }
    console.line("stopped by Ctrl-C before surfaces, strain and modulus");
    console.value(&json!({ "interrupted": true, "contacts": values }));
}

pub fn print(
    measurement: &Measurement,
    truth: Option<&Truth>,
    timing: &[Timing],
    console: &mut Console,
) {
    console.line(measurement);
    console.line(format!("time\n{}", measurement.report));
    for row in timing {
        console.line(format!(
            "  {:<18} median {:9.3} ms   99th centile {:9.3} ms",
            row.stage, row.median_ms, row.centile_99_ms
        ));
    }
    if let Some(truth) = truth {
        compare(measurement, truth, console);
    }
}

fn compare(measurement: &Measurement, truth: &Truth, console: &mut Console) {
    console.line(format!(
        "beside the truth        {:>12} {:>12} {:>10}",
        "measured", "true", "error"
    ));
    let mut line = |name: String, unit: &str, found: f64, truth: f64| {
        console.line(format!(
            "  {name:<16} {unit:<4} {found:>12.4} {truth:>12.4} {:>+8.2} %",
            percent(found, truth)
        ));
    };
    for (i, (m, t)) in measurement.frames.iter().zip(&truth.frames).enumerate() {
        let Ok(m) = m else {
            continue;
        };
        if let Ok(force) = &m.force_n {
            line(format!("force {}", i + 1), "N", force.value, t.force_n);
        }
        let radius = m.contact_radius_m.value;
        line(
            format!("contact radius {}", i + 1),
            "mm",
            radius * 1e3,
            t.contact_radius_m * 1e3,
        );
        if let Ok(height) = m.surface_height_m {
            line(
                format!("surface height {}", i + 1),
                "mm",
                height * 1e3,
                t.surface_height_m * 1e3,
            );
        }
        for (k, axis) in ["x", "y"].into_iter().enumerate() {
            line(
                format!("centroid {axis} {}", i + 1),
                "px",
                m.centroid_px[k],
                t.centroid_px[k],
            );
        }
    }
    if let (Ok(m), Some(t)) = (&measurement.strain, &truth.strain) {
        for (k, name) in ["e_xx", "e_yy", "e_zz"].into_iter().enumerate() {
            line(format!("strain {name}"), "", m.mean[k][k], t[k][k]);
        }
    }
    if let Ok(modulus) = &measurement.youngs_modulus_pa {
        let found = modulus.value * 1e-3;
        line(
            "modulus".into(),
            "kPa",
            found,
            truth.youngs_modulus_pa * 1e-3,
        );
    }
}
