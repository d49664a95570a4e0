//! `tactile strain`: strain between two sets of points, before and after a deformation.
use self::grid::{Known, arrays};
use crate::arguments::{PointFrame, PointFrames, TableArguments};
use crate::console::Context;
use crate::failure::{Exit, Failure};
use crate::match_points::{self, Expectations};
use crate::outputs::{Csv, Npz};
use crate::plot::{Colour, Page, Panel};
use crate::text::{count, digits, four_digits};
use clap::{Args, ValueEnum};
use nalgebra::{Matrix3, Point};
use serde_json::{Map, Value, json};
use std::path::PathBuf;
use tactile_files::io::PointTable;
use tactile_imaging::elasticity::kinematics::StrainQuantities;
use tactile_imaging::elasticity::strain::{
    Biot, EulerAlmansi, GreenLagrange, Hencky, Infinitesimal, StrainMeasure,
};
use tactile_imaging::force::Estimate;
use tactile_imaging::matching::PointMatcher;
use tactile_imaging::pipeline::with_error;
use tactile_imaging::{PointGrid, StrainAt, StrainBetween, StrainBetweenOptions};

mod grid;
mod quantities;
mod series;

/// Match the points of two frames or more and measure the strain between them
///
/// The files are CSV with one point per row: columns x, y and, in space, z, found by name if there
/// is a header. Points may appear and disappear. The deformation is an affine map with a smooth
/// field, estimated together with the noise. Misplaced points are found and left out. Unreliable
/// pairs give no strain.
///
/// --out gets pairs.csv (rows, positions and displacements of the pairs) and strain.csv (at every
/// point the strain, displacement gradient, rotation, principal strains with their directions n1
/// and n2, area or volume ratio and von Mises equivalent strain, each with its standard error). It
/// also gets strain.npz (the same for NumPy, with row_before, points and displacement) and
/// strain.svg (maps over the points; for a volume, over the middle of z). With --grid it gets
/// grid.csv, grid.vtk (for ParaView) and grid.npz (axes z, y, x): displacement, strain and standard
/// error on a grid over the box of the points before. The errors grow with the distance from the
/// pairs.
///
/// Known pairs, for example from finite elements, image correlation or a tracker, need no matching.
/// With --paired, row i of one file corresponds to row i of the other. A single file must have
/// displacements u, v (and w) beside x, y (and z). Rows with nan or an empty cell are skipped.
///
/// The points of three or more files are followed from frame to frame. The strain is then that of
/// the last frame relative to the first, even if these two cannot be matched directly. --out also
/// gets tracks.csv (every point of every track: frame from 1, row from 0 and position) and
/// series.csv (strain of every step and relative to the first frame).
#[derive(Args)]
#[command(after_help = "\
Examples:
  tactile strain examples/data/before.csv examples/data/after.csv
  tactile strain examples/data/before.csv examples/data/after.csv --measure hencky --rotation any \
                        --out target/strain
  tactile strain examples/data/before.csv examples/data/after.csv examples/data/before.csv \
      --out target/series
  tactile strain --paired examples/data/sources.csv examples/data/targets.csv")]
pub(crate) struct StrainArguments {
    /// Points of the frames in order: before and after, or more. Alternatively one table with
    /// displacements or with a column of frame numbers (TrackMate, trackpy).
    #[arg(required = true, num_args = 1.., value_name = "FRAMES")]
    frames: Vec<PathBuf>,
    /// Strain measure.
    #[arg(long, value_enum, default_value_t = Measure::GreenLagrange)]
    measure: Measure,
    /// Row i of the second file is row i of the first: no matching.
    #[arg(long)]
    paired: bool,
    /// Spacing of the grid for displacement and strain, in the unit of the points.
    #[arg(long, value_name = "SPACING")]
    grid: Option<f64>,
    /// Also print the strain of doubtful pairs, with a caution.
    #[arg(long)]
    doubtful_pairs: bool,
    #[command(flatten)]
    expectations: Expectations,
    #[command(flatten)]
    table: TableArguments,
}

#[derive(Clone, Copy, ValueEnum)]
enum Measure {
    GreenLagrange,
    EulerAlmansi,
    Hencky,
    Biot,
    Infinitesimal,
}

impl Measure {
    fn strain(self) -> Box<dyn StrainMeasure + Send + Sync> {
        match self {
            Self::GreenLagrange => Box::new(GreenLagrange),
            Self::EulerAlmansi => Box::new(EulerAlmansi),
            Self::Hencky => Box::new(Hencky),
            Self::Biot => Box::new(Biot),
            Self::Infinitesimal => Box::new(Infinitesimal),
        }
    }
}

/// The unit of points if their headings state one.
const METRES: &str = "m";

const FILES: [&str; 4] = ["pairs.csv", "strain.csv", "strain.npz", "strain.svg"];
const GRID_FILES: [&str; 3] = ["grid.csv", "grid.vtk", "grid.npz"];
const SERIES_FILES: [&str; 2] = ["tracks.csv", "series.csv"];

pub(crate) fn run(arguments: &StrainArguments, context: &mut Context) -> Result<Exit, Failure> {
    let paths = &arguments.frames;
    if let Some(spacing) = arguments.grid.filter(|s| !(*s > 0.0 && s.is_finite())) {
        return Err(Failure::input(format!(
            "--grid {spacing}: give a spacing above zero"
        )));
    }
    let of_grid = &GRID_FILES[..if arguments.grid.is_some() { 3 } else { 0 }];
    let of_series = &SERIES_FILES[..if paths.len() == 2 { 0 } else { 2 }];
    let files = [&FILES, of_grid, of_series].concat();
    context.outputs.plan(&files, paths)?;
    if arguments.paired && paths.len() > 2 {
        return Err(Failure::input(
            "--paired takes two files, or one with displacements",
        ));
    }
    let reading = [arguments.paired, paths.len() > 2];
    let PointFrames { frames, empty } = arguments.table.read_points(paths, reading, context)?;
    let mut known = arguments.paired;
    let mut unit = "the points' unit";
    let (mut plane, mut space) = (Vec::new(), Vec::new());
    for PointFrame {
        number,
        name,
        points,
    } in frames
    {
        known |= points.displaced.is_some();
        if points.metric {
            unit = METRES;
        }
        for table in [Some(points.points), points.displaced]
            .into_iter()
            .flatten()
        {
            let name = name.clone();
            match table {
                PointTable::Plane(points) => plane.push(Frame {
                    number,
                    name,
                    points,
                }),
                PointTable::Space(points) => space.push(Frame {
                    number,
                    name,
                    points,
                }),
            }
        }
    }
    match [plane.len(), space.len()] {
        [0, 0 | 1] | [1, 0] => Err(Failure::input("fewer than two frames have points")),
        [_, 0] => answer(plane, empty, unit, known, arguments, context),
        [0, _] => answer(space, empty, unit, known, arguments, context),
        _ => Err(Failure::input(format!(
            "{} and the frames after it must all have two coordinates per point, or three",
            paths[0].display()
        ))),
    }
}

/// Points of a frame, its number from 1 among all given frames, and its name.
struct Frame<const D: usize> {
    number: usize,
    name: String,
    points: Vec<Point<f64, D>>,
}

impl StrainArguments {
    fn options<const D: usize>(&self) -> StrainBetweenOptions<D> {
        let options = StrainBetweenOptions::default().with_matcher(self.expectations.matcher());
        let options = options.with_measure(self.measure.strain());
        if self.doubtful_pairs {
            options.with_doubtful_pairs()
        } else {
            options
        }
    }
}

/// The strain between two frames or along a series, with its report and its files. `empty` is the
/// number of empty frames.
fn answer<const D: usize>(
    mut frames: Vec<Frame<D>>,
    empty: usize,
    unit: &'static str,
    known: bool,
    arguments: &StrainArguments,
    context: &mut Context,
) -> Result<Exit, Failure> {
    let remedy = "take every tenth point, or cut the sets into parts";
    for pair in frames.windows(2).filter(|_| !known) {
        match_points::allow(context, pair[0].points.len(), pair[1].points.len(), remedy)?;
    }
    let measured = if !known && frames.len() + empty > 2 {
        series::follow(&frames, unit, arguments, context)
    } else {
        let (after, before) = (frames.remove(1), frames.remove(0));
        between(before, after, known, unit, arguments, context)?
    };
    let Some(mut report) = measured else {
        return Ok(Exit::Interrupted);
    };
    report.complete &= empty == 0;
    report.print(context);
    let mut value = report.json();
    let measure = arguments.measure.strain();
    let read = report
        .strain
        .as_ref()
        .map_or_else(|_| Vec::new(), |strain| strain.kinematics(&*measure));
    if report.strain.is_ok() {
        value["strain"]["medians"] = quantities::json::<D>(&read);
    }
    if let Some(frames) = report.frames.take() {
        value["frames"] = frames;
    }
    context.value(&value);
    context.outputs.add(FILES[0], report.pairs());
    let Ok(strain) = &report.strain else {
        return Ok(Exit::complete_if(false));
    };
    context.outputs.add(FILES[1], report.table(strain, &read));
    context.outputs.add(FILES[2], report.arrays(strain, &read)?);
    context.outputs.page(FILES[3], || report.page(strain))?;
    if let Some(spacing) = arguments.grid {
        let grid = PointGrid::over(&report.before, spacing)
            .map_err(|error| Failure::input(format!("--grid {spacing}: {}", error.expected)))?;
        let (points, measure) = (grid.points(), arguments.measure.strain());
        let job = format!("strain at {} points of the grid", points.len());
        let evaluated = context.wait(job, |interrupt| {
            strain.at_watched(&points, &*measure, || interrupt.flow())
        });
        let Some(evaluated) = evaluated else {
            return Ok(Exit::Interrupted);
        };
        let found = evaluated.map_err(|error| Failure::input(error.to_string()))?;
        let read: Vec<_> = found.iter().map(|at| at.kinematics(&*measure)).collect();
        let known = |at: &StrainAt<D>| (at.displacement, at.strain, at.standard_error);
        let found: Vec<Known<D>> = found.iter().map(known).collect();
        let shape: Vec<usize> = grid.counts.iter().rev().copied().collect();
        let table = report.grid_table(&grid, &found, &read);
        let arrays = arrays(Npz::new(), &shape, &grid.points(), &found, &read)?;
        context.outputs.add(GRID_FILES[0], table);
        context
            .outputs
            .add(GRID_FILES[1], grid::vtk(&grid, &found, &read));
        context.outputs.add(GRID_FILES[2], arrays);
    }
    Ok(Exit::complete_if(report.complete))
}

/// The strain of a call with its input. Fields that are not yet known are empty.
struct StrainReport<const D: usize> {
    before: Vec<Point<f64, D>>,
    after: Vec<Point<f64, D>>,
    /// Pairs of the matcher.
    matched: Vec<(usize, usize)>,
    strain: Result<StrainBetween<D>, String>,
    /// The frames of a series, as JSON.
    frames: Option<Value>,
    /// Whether all results are available.
    complete: bool,
    measure: &'static str,
    unit: &'static str,
}

/// The strain between two frames, from pairs known row by row or matched. `None` after Ctrl-C.
fn between<const D: usize>(
    before: Frame<D>,
    after: Frame<D>,
    known: bool,
    unit: &'static str,
    arguments: &StrainArguments,
    context: &mut Context,
) -> Result<Option<StrainReport<D>>, Failure> {
    let ([first, second], [before, after]) =
        ([before.name, after.name], [before.points, after.points]);
    let mut matching = None;
    let matched: Vec<(usize, usize)> = if known {
        if before.len() != after.len() {
            let (rows, others) = (count(before.len(), "row"), after.len());
            return Err(Failure::input(format!(
                "{first} has {rows} and {second} {others}: with --paired row i of one file is \
                 row i of the other"
            )));
        }
        let finite = |p: &Point<f64, D>| p.iter().all(|x| x.is_finite());
        let rows = 0..before.len();
        let known = rows.filter(|&i| finite(&before[i]) && finite(&after[i]));
        known.map(|i| (i, i)).collect()
    } else {
        let matcher = arguments.expectations.matcher();
        let job = format!("matching {} to {} points", before.len(), after.len());
        let found = context.wait(job, |interrupt| {
            matcher.match_watched(&before, &after, &mut || interrupt.flow())
        });
        let Some(found) = found else {
            return Ok(None);
        };
        let found = found.map_err(|error| {
            Failure::input(format!("{first} and {second} cannot be matched: {error}"))
        })?;
        let pairs = found.assignment.iter().enumerate();
        let pairs = pairs.filter_map(|(i, j)| j.map(|j| (i, j))).collect();
        matching = Some(found);
        pairs
    };
    if let skipped @ 1.. = before.len() - matched.len()
        && known
    {
        context.warn(
            "skipped_rows",
            json!({ "rows": skipped }),
            format_args!("{} without numbers are left out", count(skipped, "row")),
        );
    }
    let job = format!("fitting {} pairs", matched.len());
    let options = arguments.options().with_watch(context.watch());
    // Ctrl-C during the fit keeps the pairs, which took longest to find.
    let found = context.wait(job, |_| {
        let found = match &matching {
            Some(matching) => StrainBetween::of_matching(&before, &after, matching, &options),
            None => StrainBetween::of_known_pairs(&before, &after, &options),
        };
        found.map_err(|error| error.to_string())
    });
    Ok(Some(StrainReport {
        before,
        after,
        matched,
        strain: found.unwrap_or_else(|| Err("stopped by Ctrl-C".to_owned())),
        ..StrainReport::new(unit, arguments)
    }))
}

/// Name and indices of a component of the strain.
type Component = (&'static str, usize, usize);

/// The components in `D` dimensions.
fn components<const D: usize>() -> Vec<Component> {
    let plane = [("e_xx", 0, 0), ("e_yy", 1, 1), ("e_xy", 0, 1)];
    let space = [("e_zz", 2, 2), ("e_xz", 0, 2), ("e_yz", 1, 2)];
    let more = if D == 2 { &[][..] } else { &space };
    plane.iter().chain(more).copied().collect()
}

/// Headings of the components and of their standard errors.
fn strain_headings<const D: usize>(suffix: &str) -> Vec<String> {
    let named = |before| components::<D>().into_iter().map(move |c| (before, c.0));
    let names = named("").chain(named("se_"));
    names
        .map(|(before, name)| format!("{before}{name}{suffix}"))
        .collect()
}

/// The components of a strain and of its standard error.
fn strain_cells<const D: usize>(
    strain: &Matrix3<f64>,
    error: &Matrix3<f64>,
) -> impl Iterator<Item = f64> {
    let of = |tensor: Matrix3<f64>| {
        components::<D>()
            .into_iter()
            .map(move |c| tensor[(c.1, c.2)])
    };
    of(*strain).chain(of(*error))
}

/// Number of pairs that were left out of the fit.
fn left_out<const D: usize>(found: &StrainBetween<D>) -> usize {
    (0..found.rows.len()).filter(|&k| !found.is_kept(k)).count()
}

/// The components of the mean strain with their standard errors.
fn components_json<const D: usize>(found: &StrainBetween<D>) -> Map<String, Value> {
    let component = |(name, i, j): Component| {
        let (mean, error) = (found.summary.mean[(i, j)], found.standard_error[(i, j)]);
        let mut value = json!(Estimate::new(mean, error));
        value["spread"] = json!(found.summary.spread[(i, j)]);
        (name.to_owned(), value)
    };
    components::<D>().into_iter().map(component).collect()
}

impl<const D: usize> StrainReport<D> {
    fn new(unit: &'static str, arguments: &StrainArguments) -> Self {
        Self {
            before: Vec::new(),
            after: Vec::new(),
            matched: Vec::new(),
            strain: Err("no frame could be tracked".to_owned()),
            frames: None,
            complete: true,
            measure: arguments.measure.strain().name(),
            unit,
        }
    }

    /// The pairs used for the strain, or those of the matcher if there is no strain.
    fn rows(&self) -> &[(usize, usize)] {
        self.strain.as_ref().map_or(&self.matched, |s| &s.rows)
    }

    /// Headings of coordinates, with their unit if it is known.
    fn headings(&self, before: &str, after: &str) -> Vec<String> {
        let unit = if self.unit == METRES { "_m" } else { "" };
        let axes = ["x", "y", "z"][..D].iter();
        axes.map(|axis| format!("{before}{axis}{after}{unit}"))
            .collect()
    }

    fn print(&self, context: &mut Context) {
        let pairs = self.rows().len();
        let of = |set: &[Point<f64, D>], name: &str| {
            let share = 100.0 * pairs as f64 / set.len() as f64;
            format!("of {} {name} ({share:.1} %)", set.len())
        };
        let [before, after] = [of(&self.before, "points before"), of(&self.after, "after")];
        context.answer("matched", format_args!("{pairs} {before}, {after}"));
        let found = match &self.strain {
            Ok(found) => found,
            Err(reason) => return context.row("strain", format_args!("none: {reason}")),
        };
        context.row("left out", format_args!("{} as misplaced", left_out(found)));
        let noise = four_digits(found.sigma);
        context.row(
            "noise",
            format_args!("{noise} for each coordinate (in {})", self.unit),
        );
        if let Some(step) = found.period {
            context.row("assumed", match_points::smallest_motion(step));
        }
        if found.unresolved > 0 {
            let text = format!(
                "the noise about {} points is far above that elsewhere: the points do not resolve \
                 short waves or jumps",
                found.unresolved
            );
            context.warn("unresolved", json!({ "points": found.unresolved }), text);
        }
        if let Some(doubt) = found.doubt {
            context.warn("doubtful_pairs", json!(null), doubt);
        }
        let folded = found.summary.folded.len();
        if folded > 0 {
            let text = format!("folded at {folded} points (det F ≤ 0), left out of the mean");
            context.warn("folded", json!({ "points": folded }), text);
        }
        let measure = self.measure;
        context.line(format_args!(
            "\n{:<8} {:>26}   spread   ({measure} strain)",
            "", "mean"
        ));
        for (name, i, j) in components::<D>() {
            let at = |m: &Matrix3<f64>| m[(i, j)];
            let mean = with_error(at(&found.summary.mean), at(&found.standard_error), 1.0);
            let spread = four_digits(at(&found.summary.spread));
            context.line(format_args!("{name:<8} {mean:>26}   {spread}"));
        }
        let degrees = found.degrees_of_freedom;
        context.line(format_args!(
            "(standard errors with {degrees} degrees of freedom)"
        ));
    }

    fn json(&self) -> Value {
        let strain = match &self.strain {
            Ok(found) => json!({
                "measure": self.measure,
                "left_out_as_misplaced": left_out(found),
                "noise_per_coordinate": found.sigma,
                "unresolved_points": found.unresolved,
                "degrees_of_freedom": found.degrees_of_freedom,
                "folded_points": found.summary.folded,
                "doubt": found.doubt.map(|doubt| doubt.to_string()),
                "period": found.period.map(|step| step.0[..D].to_vec()),
                "components": components_json(found),
            }),
            Err(reason) => json!({ "error": reason }),
        };
        json!({
            "points_before": self.before.len(), "points_after": self.after.len(),
            "unit": self.unit,
            "match": { "pairs": self.rows().len() },
            "strain": strain,
        })
    }

    /// Rows (counted from 0), positions and displacements of the pairs, and their weights in the
    /// spline.
    fn pairs(&self) -> Vec<u8> {
        let mut header = vec!["row_before".to_owned(), "row_after".to_owned()];
        header.extend(self.headings("", ""));
        header.extend(self.headings("", "_after"));
        header.extend(self.headings("u_", ""));
        header.push("weight".to_owned());
        let mut csv = Csv::new(&header.join(","));
        for (k, &(i, j)) in self.rows().iter().enumerate() {
            let (a, b) = (self.before[i], self.after[j]);
            let mut row = vec![i as f64, j as f64];
            row.extend(a.iter().chain(b.iter()).chain((b - a).iter()));
            row.push(self.strain.as_ref().map_or(1.0, |s| s.weights[k]));
            csv.row(row);
        }
        csv.into_bytes()
    }

    /// The strain at every point, and its standard error.
    fn table(&self, found: &StrainBetween<D>, read: &[StrainQuantities]) -> Vec<u8> {
        let mut header = vec!["row_before".to_owned()];
        header.extend(self.headings("", ""));
        header.extend(strain_headings::<D>(""));
        header.extend(quantities::headings::<D>());
        let mut csv = Csv::new(&header.join(","));
        for (k, pair) in found.pairs.iter().enumerate() {
            let mut row = vec![found.rows[k].0 as f64];
            row.extend(pair[0].iter());
            row.extend(strain_cells::<D>(
                &found.strains[k],
                &found.standard_errors[k],
            ));
            row.extend(quantities::cells::<D>(&read[k]));
            csv.row(row);
        }
        csv.into_bytes()
    }

    /// The strain at every point and its standard error, as arrays.
    fn arrays(
        &self,
        found: &StrainBetween<D>,
        read: &[StrainQuantities],
    ) -> Result<Vec<u8>, Failure> {
        let shape = [found.pairs.len()];
        let rows = found.rows.iter().map(|row| (row.0 as i64).to_le_bytes());
        let mut npz = Npz::new();
        npz.add("row_before", "<i8", &shape, rows)?;
        let points: Vec<_> = found.pairs.iter().map(|pair| pair[0]).collect();
        let known = |k| {
            (
                found.displacements[k],
                found.strains[k],
                found.standard_errors[k],
            )
        };
        let known: Vec<Known<D>> = (0..points.len()).map(known).collect();
        arrays(npz, &shape, &points, &known, read)
    }

    /// Displacement, strain and its standard error on the grid.
    fn grid_table(
        &self,
        grid: &PointGrid<D>,
        found: &[Known<D>],
        read: &[StrainQuantities],
    ) -> Vec<u8> {
        let mut header = self.headings("", "");
        header.extend(self.headings("u_", ""));
        header.extend(strain_headings::<D>(""));
        header.extend(quantities::headings::<D>());
        let mut csv = Csv::new(&header.join(","));
        let rows = grid.points().into_iter().zip(found).zip(read);
        for ((point, (displacement, strain, error)), read) in rows {
            let places = point.iter().chain(displacement.iter()).copied();
            let strains = strain_cells::<D>(strain, error);
            csv.row(places.chain(strains).chain(quantities::cells::<D>(read)));
        }
        csv.into_bytes()
    }

    /// Displacement and strain as maps over the points. A volume is drawn at its middle slice.
    fn page(&self, found: &StrainBetween<D>) -> Page {
        let unit = self.unit;
        let flat = |p: &Point<f64, D>| [p[0], p[1]];
        let shown = shown_pairs(found);
        let pairs = |kept: bool| {
            let chosen = shown.iter().filter(move |&&k| found.is_kept(k) == kept);
            chosen.map(|&k| found.pairs[k].each_ref().map(flat))
        };
        let heights = shown
            .iter()
            .map(|&k| found.pairs[k][0].iter().nth(2).copied());
        let (low, high) = heights.fold((f64::MAX, f64::MIN), |(low, high), z| {
            (low.min(z.unwrap_or(0.0)), high.max(z.unwrap_or(0.0)))
        });
        let panel = |title: String| {
            let title = match D {
                2 => title,
                _ => format!("{title}, z {} to {}", digits(low, 3), digits(high, 3)),
            };
            Panel::new(title, format!("x ({unit})"), format!("y ({unit})")).equal_aspect()
        };
        let mut matches =
            panel("Displacements".into()).arrows(pairs(true), Colour::Blue, "matched");
        if pairs(false).next().is_some() {
            matches = matches.arrows(pairs(false), Colour::Red, "left out");
        }
        let positions: Vec<_> = shown.iter().map(|&k| flat(&found.pairs[k][0])).collect();
        let displacement = |axis: usize| {
            let name = ["u_x", "u_y", "u_z"][axis];
            let values = shown.iter().map(|&k| found.displacements[k][axis]);
            let label = format!("{name} ({unit})");
            panel(name.into()).valued_points(positions.clone(), values, &label)
        };
        let strain = |(name, i, j): Component| {
            let (mean, error) = (found.summary.mean[(i, j)], found.standard_error[(i, j)]);
            let values = shown.iter().map(|&k| found.strains[k][(i, j)]);
            let title = format!("{name}: mean {}", with_error(mean, error, 1.0));
            panel(title).valued_points(positions.clone(), values, name)
        };
        let maps = (0..D).map(displacement);
        let maps = maps.chain(components::<D>().into_iter().map(strain));
        let panels = std::iter::once(matches).chain(maps).collect();
        Page::new("Strain between two point sets", 2, panels)
    }
}

/// The pairs on a page: of a volume only the middle quarter along z, and not more than a picture
/// can resolve.
fn shown_pairs<const D: usize>(found: &StrainBetween<D>) -> Vec<usize> {
    let mut rows: Vec<usize> = (0..found.pairs.len()).collect();
    if D == 3 {
        rows.sort_by(|&a, &b| found.pairs[a][0][D - 1].total_cmp(&found.pairs[b][0][D - 1]));
        rows = rows[3 * rows.len() / 8..5 * rows.len() / 8].to_vec();
    }
    let step = rows.len().div_ceil(4000).max(1);
    rows.into_iter().step_by(step).collect()
}
