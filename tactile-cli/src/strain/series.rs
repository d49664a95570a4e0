//! `tactile strain` of three or more frames, whose points are followed from frame to frame.
use super::{
    Frame, SERIES_FILES, StrainArguments, StrainReport, components_json, strain_cells,
    strain_headings,
};
use crate::console::Context;
use crate::outputs::Csv;
use nalgebra::Matrix3;
use serde_json::{Value, json};
use tactile_imaging::pipeline::with_error;
use tactile_imaging::{SeriesStrain, StrainBetween, StrainSeries};

/// Follows the points and returns the strain between the first frame and the last frame with a
/// strain. `None` after Ctrl-C.
pub(super) fn follow<const D: usize>(
    frames: &[Frame<D>],
    unit: &'static str,
    arguments: &StrainArguments,
    context: &mut Context,
) -> Option<StrainReport<D>> {
    let first = &frames[0];
    let options = arguments.options().with_watch(context.watch());
    let mut series = StrainSeries::new(&first.points, options);
    let mut report = SeriesReport::<D>::new(first.number);
    // The series contains the frames that were not refused.
    let mut followed = vec![first];
    let mut measured = StrainReport {
        before: first.points.clone(),
        ..StrainReport::new(unit, arguments)
    };
    for frame in &frames[1..] {
        let points = &frame.points;
        let job = format!("following {} points to {}", points.len(), frame.name);
        let found = context.wait(job, |_| series.push(points))?;
        let total = found
            .as_ref()
            .map_or_else(Err, |found| found.total.as_ref());
        measured.complete &= total.is_ok();
        if found.is_ok() {
            followed.push(frame);
        }
        if let Ok(total) = total {
            measured.after.clone_from(&frame.points);
            measured.strain = Ok(total.clone());
        }
        report.add(frame, &found.map_err(|error| error.to_string()), context);
    }
    let mut header = ["track", "frame", "row"].map(str::to_owned).to_vec();
    header.extend(measured.headings("", ""));
    let mut tracks = Csv::new(&header.join(","));
    for (track, places) in series.tracks().iter().enumerate() {
        for &(frame, row) in places {
            let Frame { number, points, .. } = followed[frame];
            let place = points[row];
            let cells = [track, *number, row].map(|n| n as f64);
            tracks.row(cells.into_iter().chain(place.iter().copied()));
        }
    }
    context.outputs.add(SERIES_FILES[0], tracks.into_bytes());
    context
        .outputs
        .add(SERIES_FILES[1], report.table.into_bytes());
    measured.frames = Some(Value::Array(report.frames));
    Some(measured)
}

/// The results of a series, frame by frame.
struct SeriesReport<const D: usize> {
    /// The number of the first frame with points.
    first: usize,
    table: Csv,
    frames: Vec<Value>,
}

impl<const D: usize> SeriesReport<D> {
    fn new(first: usize) -> Self {
        let mut columns = vec!["frame".to_owned()];
        for part in ["step", "total"] {
            columns.push(format!("pairs_{part}"));
            columns.extend(strain_headings::<D>(&format!("_{part}")));
        }
        Self {
            first,
            table: Csv::new(&columns.join(",")),
            frames: Vec::new(),
        }
    }

    fn add(
        &mut self,
        Frame { number, name, .. }: &Frame<D>,
        found: &Result<SeriesStrain<D>, String>,
        context: &mut Context,
    ) {
        let total = |found: &SeriesStrain<D>| found.total.clone().map_err(|e| e.to_string());
        let total = found.as_ref().map_or_else(|e| Err(e.clone()), total);
        let step = found.as_ref().map(|found| &found.step);
        let parts = [
            step.map_err(Clone::clone),
            total.as_ref().map_err(Clone::clone),
        ];
        let mut cells = vec![Some(*number as f64)];
        let mut value = json!({ "frame": number, "file": name });
        for (name, part) in ["step", "total"].into_iter().zip(&parts) {
            match part {
                Ok(strain) => {
                    cells.push(Some(strain.rows.len() as f64));
                    let means = strain_cells::<D>(&strain.summary.mean, &strain.standard_error);
                    cells.extend(means.map(Some));
                    value[name] = json!({
                        "pairs": strain.rows.len(), "noise_per_coordinate": strain.sigma,
                        "doubt": strain.doubt.map(|doubt| doubt.to_string()),
                        "period": strain.period.map(|step| step.0[..D].to_vec()),
                        "components": components_json(strain),
                    });
                }
                Err(reason) => {
                    cells.extend(vec![None; 1 + strain_headings::<D>("").len()]);
                    value[name] = json!({ "error": reason });
                }
            }
        }
        self.table.cells(cells);
        self.frames.push(value);
        let text = parts.each_ref().map(|part| match part {
            Ok(strain) => mean_text(strain),
            Err(reason) => format!("none: {reason}"),
        });
        context.row(&format!("frame {number}"), format_args!("step {}", text[0]));
        context.row("", format_args!("since frame {} {}", self.first, text[1]));
        for (name, part) in ["step", "total"].into_iter().zip(&parts) {
            if let Some(doubt) = part.as_ref().ok().and_then(|strain| strain.doubt) {
                let place = json!({ "frame": number, "strain": name });
                let text = format_args!("frame {number}, {name}: {doubt}");
                context.warn("doubtful_pairs", place, text);
            }
        }
    }
}

/// The pairs and the diagonal of the mean strain.
fn mean_text<const D: usize>(strain: &StrainBetween<D>) -> String {
    let at = |m: &Matrix3<f64>, k: usize| m[(k, k)];
    let one = |k: usize| {
        let (mean, error) = (at(&strain.summary.mean, k), at(&strain.standard_error, k));
        format!(
            ", {} {}",
            ["e_xx", "e_yy", "e_zz"][k],
            with_error(mean, error, 1.0)
        )
    };
    let means: String = (0..D).map(one).collect();
    format!("{} pairs{means}", strain.rows.len())
}
