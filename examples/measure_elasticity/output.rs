//! Measuring, printing, plotting.
use crate::arguments::Arguments;
use crate::source::{Failure, Source};
use serde::Serialize;
use std::time::Instant;
use tactile_imaging::pipeline::{Measurement, Stage, Truth};
use tactile_imaging::plot::{save_press_pages, summary_lines};

/// Median and 99th centile in milliseconds.
#[derive(Serialize)]
struct Timing {
    stage: String,
    median_ms: f64,
    centile_99_ms: f64,
}

/// The object that `--json` prints.
#[derive(Serialize)]
struct Json<'a> {
    #[serde(flatten)]
    measurement: &'a Measurement,
    #[serde(skip_serializing_if = "Option::is_none")]
    truth: Option<&'a Truth>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    timing: Vec<Timing>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let source = Source::open(arguments)?;
    let pipeline = source.pipeline(arguments)?;
    eprintln!("measuring");
    let mut timing = Vec::new();
    if arguments.repeat > 1 {
        timing = repeat(&source, &pipeline, arguments.repeat)?;
    }
    let mut press = source.press(&pipeline)?;
    let measurement = press.measure();
    if let Err(error) = &measurement.youngs_modulus_pa {
        eprintln!("no modulus: {}", source.explain(error.clone()));
    }
    let truth = source.truth();
    if arguments.json {
        let json = Json {
            measurement: &measurement,
            truth: truth.as_ref(),
            timing,
        };
        println!("{}", serde_json::to_string_pretty(&json)?);
    } else {
        println!("{measurement}");
        println!("time\n{}", measurement.report);
        timing.iter().for_each(print_timing);
        if let Some(truth) = &truth {
            print_comparison(&measurement, truth);
        }
    }
    if !arguments.no_plots {
        let mut lines = summary_lines(&measurement);
        if let Some(truth) = &truth {
            let true_kpa = truth.youngs_modulus_pa * 1e-3;
            if let Ok(modulus) = &measurement.youngs_modulus_pa {
                let error = percent(modulus.value, truth.youngs_modulus_pa);
                lines.push(format!(
                    "true modulus\t{true_kpa:.2} kPa (error {error:+.2} %)"
                ));
            }
        }
        let paths = save_press_pages(&mut press, lines, &arguments.out)?;
        eprintln!(
            "plots: {}",
            paths
                .iter()
                .map(|p| p.display().to_string())
                .collect::<Vec<_>>()
                .join(", ")
        );
    }
    Ok(())
}

/// Measures again and again from the frames, the reference being known; the time of every stage and of the whole.
fn repeat(
    source: &Source,
    pipeline: &tactile_imaging::Pipeline,
    n: u32,
) -> Result<Vec<Timing>, Failure> {
    let mut times = vec![Vec::with_capacity(n as usize); Stage::ALL.len() + 1];
    let first = source.press(pipeline)?;
    for _ in 0..n {
        let start = Instant::now();
        let mut press = first.renewed();
        press.measure();
        let whole = start.elapsed();
        for (list, stage) in times.iter_mut().zip(Stage::ALL) {
            list.push(press.report().work(stage).time);
        }
        times[Stage::ALL.len()].push(whole);
    }
    let names = Stage::ALL
        .map(|s| s.to_string())
        .into_iter()
        .chain(["whole".to_owned()]);
    let row = |(stage, mut list): (String, Vec<std::time::Duration>)| {
        list.sort_unstable();
        let at = |share: f64| {
            list[((list.len() - 1) as f64 * share).ceil() as usize].as_secs_f64() * 1e3
        };
        Timing {
            stage,
            median_ms: at(0.5),
            centile_99_ms: at(0.99),
        }
    };
    Ok(names.zip(times).map(row).collect())
}

fn print_timing(row: &Timing) {
    println!(
        "  {:<18} median {:9.3} ms   99th centile {:9.3} ms",
        row.stage, row.median_ms, row.centile_99_ms
    );
}

fn percent(found: f64, truth: f64) -> f64 {
    100.0 * (found / truth - 1.0)
}

fn print_comparison(measurement: &Measurement, truth: &Truth) {
    println!(
        "beside the truth        {:>12} {:>12} {:>10}",
        "measured", "true", "error"
    );
    let line = |name: String, unit: &str, found: f64, truth: f64| {
        println!(
            "  {name:<16} {unit:<4} {found:>12.4} {truth:>12.4} {:>+8.2} %",
            percent(found, truth)
        );
    };
    for (i, (m, t)) in measurement.frames.iter().zip(&truth.frames).enumerate() {
        let Ok(m) = m else { continue };
        if let Ok(force) = &m.force_n {
            line(format!("force {}", i + 1), "N", force.value, t.force_n);
        }
        line(
            format!("contact radius {}", i + 1),
            "mm",
            m.contact_radius_m.value * 1e3,
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
        let step = (m.centroid_px[0] - t.centroid_px[0]).hypot(m.centroid_px[1] - t.centroid_px[1]);
        println!(
            "  {:<16} px   {step:>12.4} away from the truth",
            format!("centroid {}", i + 1)
        );
    }
    if let (Ok(m), Some(t)) = (&measurement.strain, &truth.strain) {
        for (k, name) in ["strain e_xx", "strain e_yy", "strain e_zz"]
            .into_iter()
            .enumerate()
        {
            line(name.into(), "", m.mean[k][k], t[k][k]);
        }
    }
    if let Ok(modulus) = &measurement.youngs_modulus_pa {
        line(
            "modulus".into(),
            "kPa",
            modulus.value * 1e-3,
            truth.youngs_modulus_pa * 1e-3,
        );
    }
}
